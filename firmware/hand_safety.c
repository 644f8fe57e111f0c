/* See hand_safety.h. The rules follow MISRA C:2012 where README.md does not list a deviation. */
#include "hand_safety.h"

#include <float.h>

#define HALF_RANGE_US (0x80000000U) /* a longer time is a clock that went back */
#define FULL_TURN_URAD (6300000)
#define MICRO (1000000)
#define MILLI (1000)

static uint32_t shorter_of(uint32_t a, uint32_t b)
{
    return (a < b) ? a : b;
}

static int32_t lower_of(int32_t a, int32_t b)
{
    return (a < b) ? a : b;
}

static int32_t bounded(int32_t value, int32_t low, int32_t high)
{
    const int32_t raised = (value > low) ? value : low;
    return lower_of(raised, high);
}

static void release(hand_safety *s)
{
    s->state = (uint8_t)HAND_SAFETY_VENTED;
    s->commanded = false;
}

static void trip(hand_safety *s, hand_safety_fault fault)
{
    if (s->fault == (uint8_t)HAND_SAFETY_NO_FAULT) {
        s->fault = (uint8_t)fault;
    }
    release(s);
}

/* Torque per pressure at an angle [1e-15 N m/Pa]. */
static int64_t leverage(const hand_safety_joint *joint, int32_t angle_urad)
{
    const int64_t fixed = (int64_t)joint->a2_pnm_per_pa * MICRO;
    const int64_t turned = (int64_t)joint->a3_pnm_per_pa_rad * angle_urad;
    return (fixed + turned) / MILLI;
}

static bool usable(const hand_safety_joint *joint)
{
    const bool pressure = (joint->max_pressure_pa > 0) && (joint->max_pressure_pa <= HAND_SAFETY_HIGHEST_PA);
    const bool torque = (joint->max_torque_nnm > 0) && (joint->a1_nnm_per_rad <= 0);
    const bool creep = (joint->phi_max_urad >= 0) && (joint->phi_max_urad <= FULL_TURN_URAD);
    const bool angles = (joint->low_urad >= -FULL_TURN_URAD) && (joint->low_urad < joint->high_urad)
                     && (joint->high_urad <= FULL_TURN_URAD);
    bool flexes = false;
    if (angles) {
        flexes = (leverage(joint, joint->low_urad) > 0) && (leverage(joint, joint->high_urad) > 0);
    }
    return pressure && torque && creep && flexes;
}

bool hand_safety_start(hand_safety *s, const hand_safety_joint *joints, uint8_t count)
{
    bool good = (count > 0U) && (count <= HAND_SAFETY_JOINTS);
    *s = (hand_safety){0}; /* vented, without a fault, nothing known */
    s->joints = joints;
    s->count = good ? count : 0U;
    s->late = true;
    for (uint8_t i = 0U; i < s->count; i++) {
        good = usable(&joints[i]) && good;
    }
    if (!good) {
        trip(s, HAND_SAFETY_CONFIGURATION);
    }
    return good;
}

/* A newer number follows the last one within the window; the counter wraps. */
static bool newer(const hand_safety *s, uint32_t sequence)
{
    const uint32_t ahead = sequence - s->command_sequence;
    return (!s->command_known) || ((ahead > 0U) && (ahead < HAND_SAFETY_SEQUENCE_WINDOW));
}

static bool within_limits(const hand_safety *s, const int32_t *pressure_pa)
{
    bool good = true;
    for (uint8_t i = 0U; i < s->count; i++) {
        if ((pressure_pa[i] < 0) || (pressure_pa[i] > s->joints[i].max_pressure_pa)) {
            good = false;
        }
    }
    return good;
}

hand_safety_answer hand_safety_command(hand_safety *s, uint32_t now_us, uint32_t sequence, uint32_t lifetime_us,
                                       uint8_t count, const int32_t *pressure_pa)
{
    hand_safety_answer answer = HAND_SAFETY_ACCEPTED;
    if (count != s->count) {
        answer = HAND_SAFETY_WRONG_COUNT;
    } else if ((lifetime_us == 0U) || (lifetime_us > HAND_SAFETY_LIFETIME_US)) {
        answer = HAND_SAFETY_WRONG_LIFETIME;
    } else if (!newer(s, sequence)) {
        answer = HAND_SAFETY_REPLAYED;
    } else if (!within_limits(s, pressure_pa)) {
        answer = HAND_SAFETY_WRONG_PRESSURE;
    } else {
        s->command_us = now_us;
        s->command_sequence = sequence;
        s->lifetime_us = lifetime_us;
        s->command_known = true;
        s->commanded = true;
        for (uint8_t i = 0U; i < s->count; i++) {
            s->command_pa[i] = pressure_pa[i];
        }
    }
    return answer;
}

void hand_safety_new_session(hand_safety *s)
{
    s->command_known = false;
}

static int32_t over_limit(const hand_safety_joint *joint)
{
    return joint->max_pressure_pa + (int32_t)(((int64_t)joint->max_pressure_pa * HAND_SAFETY_OVER_PERMILLE) / MILLI);
}

static bool plausible(const hand_safety *s, const int32_t *pressure_pa, const int32_t *angle_urad)
{
    bool good = true;
    for (uint8_t i = 0U; i < s->count; i++) {
        if ((pressure_pa[i] < -HAND_SAFETY_HIGHEST_PA) || (pressure_pa[i] > HAND_SAFETY_HIGHEST_PA)
            || (angle_urad[i] < -FULL_TURN_URAD) || (angle_urad[i] > FULL_TURN_URAD)) {
            good = false;
        }
    }
    return good;
}

static void take_sample(hand_safety *s, uint32_t step_us, const int32_t *pressure_pa, const int32_t *angle_urad)
{
    for (uint8_t i = 0U; i < s->count; i++) {
        s->pressure_pa[i] = pressure_pa[i];
        s->angle_urad[i] = angle_urad[i];
        if (pressure_pa[i] > over_limit(&s->joints[i])) {
            s->over_us[i] = shorter_of(s->over_us[i] + step_us, HAND_SAFETY_OVER_US + 1U);
        } else {
            s->over_us[i] = 0U;
        }
        if (s->over_us[i] > HAND_SAFETY_OVER_US) {
            trip(s, HAND_SAFETY_OVER_PRESSURE);
        }
    }
}

bool hand_safety_sample(hand_safety *s, uint32_t now_us, uint32_t sequence, bool valid, const int32_t *pressure_pa,
                        const int32_t *angle_urad)
{
    const uint32_t gap_us = now_us - s->sample_us;
    const bool repeated = s->sample_known && (sequence == s->sample_sequence);
    const bool counts = valid && (!repeated) && plausible(s, pressure_pa, angle_urad);
    if (counts) {
        uint32_t step_us = 0U;
        if (s->sample_known) { /* the gap to a sample that is forgotten may have wrapped */
            step_us = s->sampled ? shorter_of(gap_us, HAND_SAFETY_STEP_US) : HAND_SAFETY_STEP_US;
        }
        s->integrate = s->sampled && (gap_us <= HAND_SAFETY_FREEZE_US);
        take_sample(s, step_us, pressure_pa, angle_urad);
        s->sample_us = now_us;
        s->sample_sequence = sequence;
        s->sample_known = true;
        s->sampled = true;
    }
    return counts;
}

bool hand_safety_heartbeat(hand_safety *s, uint32_t now_us, uint32_t number)
{
    const bool counts = (!s->beat_known) || (number != s->beat);
    if (counts) {
        s->beat_us = now_us;
        s->beat = number;
        s->beat_known = true;
        s->beating = true;
    }
    return counts;
}

/* Forget what is too old, so that an age that wraps cannot make it recent again. */
static void forget(hand_safety *s, uint32_t now_us)
{
    s->commanded = s->commanded && ((now_us - s->command_us) < s->lifetime_us);
    s->sampled = s->sampled && ((now_us - s->sample_us) <= HAND_SAFETY_VENT_US);
    s->beating = s->beating && ((now_us - s->beat_us) <= HAND_SAFETY_HEARTBEAT_US);
    s->late = (!s->sampled) || ((now_us - s->sample_us) > HAND_SAFETY_WARN_US);
    if (!s->sampled) {
        s->integrate = false;
    }
}

static bool over_now(const hand_safety *s)
{
    bool over = false;
    for (uint8_t i = 0U; i < s->count; i++) {
        if (s->pressure_pa[i] > over_limit(&s->joints[i])) {
            over = true;
        }
    }
    return over;
}

bool hand_safety_arm(hand_safety *s, uint32_t now_us)
{
    forget(s, now_us);
    const bool waiting = (s->state == (uint8_t)HAND_SAFETY_VENTED) && (s->fault == (uint8_t)HAND_SAFETY_NO_FAULT);
    const bool ready = waiting && s->commanded && s->sampled && s->beating && (!over_now(s));
    if (ready) {
        s->state = (uint8_t)HAND_SAFETY_RAMPING;
        s->ramp_us = HAND_SAFETY_RAMP_US;
        s->tick_us = now_us;
        for (uint8_t i = 0U; i < s->count; i++) {
            s->output_pa[i] = bounded(s->pressure_pa[i], 0, s->joints[i].max_pressure_pa);
        }
    }
    return ready;
}

void hand_safety_vent(hand_safety *s)
{
    release(s);
}

bool hand_safety_reset(hand_safety *s)
{
    if (s->fault != (uint8_t)HAND_SAFETY_CONFIGURATION) {
        s->fault = (uint8_t)HAND_SAFETY_NO_FAULT;
    }
    return s->fault == (uint8_t)HAND_SAFETY_NO_FAULT;
}

int32_t hand_safety_torque_ceiling(const hand_safety_joint *joint, int32_t angle_urad)
{
    const int32_t at_urad = bounded(angle_urad, joint->low_urad, joint->high_urad);
    const int64_t allowed = (int64_t)joint->max_torque_nnm * (MILLI + HAND_SAFETY_TORQUE_PERMILLE) * MILLI;
    const int64_t crept = (int64_t)joint->a1_nnm_per_rad * ((int64_t)at_urad - joint->phi_max_urad);
    const int64_t room = (allowed - ((int64_t)joint->a0_nnm * MICRO)) - crept;
    int32_t ceiling = 0;
    if (room > 0) {
        const int64_t pressure_pa = room / leverage(joint, at_urad);
        ceiling = (pressure_pa < joint->max_pressure_pa) ? (int32_t)pressure_pa : joint->max_pressure_pa;
    }
    return ceiling;
}

static void drive(hand_safety *s, uint32_t step_us, int32_t rate_pa_per_s)
{
    const int32_t rise_pa = (int32_t)(((int64_t)rate_pa_per_s * (int64_t)step_us) / MICRO);
    for (uint8_t i = 0U; i < s->count; i++) {
        const int32_t allowed_pa = lower_of(s->command_pa[i], hand_safety_torque_ceiling(&s->joints[i], s->angle_urad[i]));
        const int32_t highest_pa = s->output_pa[i] + rise_pa;
        s->torque_limited = s->torque_limited || (allowed_pa < s->command_pa[i]);
        s->rate_limited = s->rate_limited || (highest_pa < allowed_pa);
        s->output_pa[i] = lower_of(allowed_pa, highest_pa);
    }
}

static void stop_driving(hand_safety *s)
{
    for (uint8_t i = 0U; i < s->count; i++) {
        s->output_pa[i] = 0;
    }
}

static void write_output(hand_safety *s, uint32_t step_us)
{
    s->torque_limited = false;
    s->rate_limited = false;
    switch (s->state) {
    case (uint8_t)HAND_SAFETY_RAMPING:
        drive(s, step_us, HAND_SAFETY_RAMP_PA_PER_S);
        s->ramp_us -= shorter_of(step_us, s->ramp_us);
        if (s->ramp_us == 0U) {
            s->state = (uint8_t)HAND_SAFETY_DRIVING;
        }
        break;
    case (uint8_t)HAND_SAFETY_DRIVING:
        drive(s, step_us, HAND_SAFETY_RATE_PA_PER_S);
        break;
    case (uint8_t)HAND_SAFETY_VENTED:
        stop_driving(s);
        break;
    default: /* a state that damage to the memory left behind */
        release(s);
        stop_driving(s);
        break;
    }
}

void hand_safety_tick(hand_safety *s, uint32_t now_us, int32_t *output_pa)
{
    const uint32_t elapsed_us = now_us - s->tick_us;
    s->tick_us = now_us;
    forget(s, now_us);
    if (s->state != (uint8_t)HAND_SAFETY_VENTED) {
        if (elapsed_us >= HALF_RANGE_US) {
            trip(s, HAND_SAFETY_CLOCK_FAULT);
        } else if (!s->commanded) {
            trip(s, HAND_SAFETY_COMMAND_LOST);
        } else if (!s->sampled) {
            trip(s, HAND_SAFETY_SENSORS_LOST);
        } else if (!s->beating) {
            trip(s, HAND_SAFETY_HEARTBEAT_LOST);
        } else {
            /* everything is recent */
        }
    }
    write_output(s, shorter_of(elapsed_us, HAND_SAFETY_STEP_US));
    for (uint8_t i = 0U; i < s->count; i++) {
        output_pa[i] = s->output_pa[i];
    }
}

float hand_safety_step(float dt_s)
{
    float step_s = 0.0F;
    if ((dt_s >= HAND_SAFETY_LEAST_STEP_S) && (dt_s <= FLT_MAX)) { /* NaN fails both comparisons */
        step_s = (dt_s < HAND_SAFETY_STEP_S) ? dt_s : HAND_SAFETY_STEP_S;
    }
    return step_s;
}

bool hand_safety_integer(float value, float scale, int32_t *result)
{
    const float scaled = value * scale;
    const bool fits = (scaled > -2.0e9F) && (scaled < 2.0e9F); /* NaN fails both comparisons */
    if (fits) {
        *result = (int32_t)scaled;
    }
    return fits;
}
