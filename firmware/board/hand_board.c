/* See hand_board.h. */
#include "hand_board.h"

#define FIRST_VERSION (1U)
#define SECOND_VERSION (2U)
#define TYPE_FRAME (1U)
#define TYPE_SET_POINTS (2U)
#define TYPE_OFFER (3U)
#define TYPE_ANSWER (4U)
#define OFFER_SIZE (8U)
#define UNIT_PA (10)
#define MS_US (1000U)
#define OLDEST_MS (65534U)
#define NEVER_MS (65535U)
#define MILLION (1000000)
#define MOST_REFERENCE (10U) /* largest reference of the converter, in lowest supplies of the sensors */
#define FARTHEST (2000000000)

/* Whether every sensor has its channel and every conversion its range. */
static bool consistent(const hand_board_config *c)
{
    bool good = (c->channels > 0U) && (c->channels <= HAND_BOARD_CHANNELS) && (c->highest_count <= c->full_scale)
             && (c->lowest_supply_mv > 0U)
             && ((uint32_t)c->reference_mv <= (MOST_REFERENCE * (uint32_t)c->lowest_supply_mv));
    for (uint8_t i = 0U; i < c->joints; i++) {
        if ((c->angle[i].channel >= c->channels) || (c->pressure[i].channel >= c->channels)) {
            good = false;
        }
    }
    return good;
}

bool hand_board_start(hand_board *b, const hand_board_config *config)
{
    const bool good = consistent(config);
    *b = (hand_board){0};
    b->config = config;
    b->version = FIRST_VERSION;
    b->channels = good ? config->channels : 0U;
    hand_wire_start(&b->receiver);
    return hand_safety_start(&b->safety, config->limits, good ? config->joints : 0U);
}

/* Whether set-points of this version and session may be considered; begins their numbering where it is new. */
static bool admitted(hand_board *b, uint8_t version, uint32_t session)
{
    bool good = false;
    if (version == FIRST_VERSION) {
        good = !b->session_used;
        if (good && (b->safety.state == (uint8_t)HAND_SAFETY_VENTED)) {
            hand_safety_new_session(&b->safety); /* another host begins at any number; version 1 does not name it */
        }
    } else {
        good = (b->version >= SECOND_VERSION) && (session == b->session);
        if (good && (!b->session_used)) {
            hand_safety_new_session(&b->safety);
        }
    }
    return good;
}

/* Zero set-points arm a vented board. Of the faults, they clear the end of a lifetime only: see begin_session. */
static void arm_on_request(hand_board *b, uint32_t now_us, const int32_t *pressure_pa)
{
    bool request = true;
    for (uint8_t i = 0U; i < b->safety.count; i++) {
        if (pressure_pa[i] != 0) {
            request = false;
        }
    }
    if (request && (b->safety.state == (uint8_t)HAND_SAFETY_VENTED)) {
        if (b->safety.fault == (uint8_t)HAND_SAFETY_COMMAND_LOST) {
            (void)hand_safety_reset(&b->safety);
        }
        (void)hand_safety_arm(&b->safety, now_us);
    }
}

static void take_set_points(hand_board *b, uint64_t now_us, uint8_t version)
{
    const uint8_t *payload = b->receiver.payload;
    const size_t head = (version == FIRST_VERSION) ? 9U : 13U;
    const size_t size = b->receiver.size;
    if ((size < head) || (size != (head + (2U * (size_t)payload[head - 1U]))) || (hand_wire_read(&payload[6], 2U) == 0U)) {
        b->receiver.corrupt++;
    } else if (payload[head - 1U] == b->safety.count) {
        const uint32_t sequence = hand_wire_read(&payload[2], 4U);
        const uint32_t lifetime_us = hand_wire_read(&payload[6], 2U) * MS_US;
        int32_t pressure_pa[HAND_SAFETY_JOINTS];
        for (uint8_t i = 0U; i < b->safety.count; i++) {
            pressure_pa[i] = (int32_t)hand_wire_read(&payload[head + (2U * (size_t)i)], 2U) * UNIT_PA;
        }
        if (admitted(b, version, hand_wire_read(&payload[8], 4U))
            && (hand_safety_command(&b->safety, (uint32_t)now_us, sequence, lifetime_us, b->safety.count, pressure_pa)
                == HAND_SAFETY_ACCEPTED)) {
            b->session_used = (version == SECOND_VERSION);
            b->newest = (hand_board_accepted){now_us, sequence, (uint8_t)(b->newest.accepted + 1U), true};
            arm_on_request(b, (uint32_t)now_us, pressure_pa);
        }
    } else {
        /* set-points of a hand with another number of valves */
    }
}

/* A new session is the request of the host to clear a latched fault; the board stays vented until it is armed. */
static void begin_session(hand_board *b, uint32_t session, uint8_t version)
{
    if ((!b->in_session) || (session != b->session)) {
        b->version = version;
        b->session = session;
        b->in_session = true;
        b->session_used = false;
        b->newest = (hand_board_accepted){.any = false};
        b->in_force = b->newest;
        (void)hand_safety_reset(&b->safety);
    }
}

/* Returns the size of the answer, 0 for an offer that cannot be read. */
static size_t answer_offer(hand_board *b, uint8_t *answer)
{
    const uint8_t *offer = b->receiver.payload;
    const uint8_t lowest = offer[2];
    const uint8_t highest = offer[3];
    size_t size = 0U;
    if ((b->receiver.size == OFFER_SIZE) && (offer[0] == FIRST_VERSION) && (lowest > 0U) && (lowest <= highest)) {
        const uint32_t session = hand_wire_read(&offer[4], 4U);
        const uint8_t common = (highest < SECOND_VERSION) ? highest : (uint8_t)SECOND_VERSION;
        uint8_t payload[OFFER_SIZE] = {FIRST_VERSION, TYPE_ANSWER, 0U, SECOND_VERSION};
        if (common >= lowest) {
            begin_session(b, session, common);
            payload[2] = b->version;
        }
        (void)hand_wire_write(payload, 4U, session, 4U);
        size = hand_wire_packet(payload, OFFER_SIZE, answer);
    } else {
        b->receiver.corrupt++;
    }
    return size;
}

/* One payload with a correct CRC. Returns the size of an answer. */
static size_t take_payload(hand_board *b, uint64_t now_us, uint8_t *answer)
{
    const uint8_t version = b->receiver.payload[0];
    size_t size = 0U;
    if ((version == FIRST_VERSION) || (version == SECOND_VERSION)) {
        switch (b->receiver.payload[1]) {
        case TYPE_SET_POINTS:
            take_set_points(b, now_us, version);
            break;
        case TYPE_OFFER:
            size = answer_offer(b, answer);
            break;
        default:
            b->receiver.corrupt++;
            break;
        }
    }
    return size;
}

size_t hand_board_receive(hand_board *b, uint64_t now_us, const uint8_t *data, size_t size, uint8_t *answer)
{
    size_t to_send = 0U;
    b->loops++;
    (void)hand_safety_heartbeat(&b->safety, (uint32_t)now_us, b->loops);
    for (size_t i = 0U; i < size; i++) {
        if (hand_wire_take(&b->receiver, data[i])) {
            const size_t answered = take_payload(b, now_us, answer);
            if (answered > 0U) {
                to_send = answered;
            }
        }
    }
    return to_send;
}

/* Returns false, without a value, for a channel at a rail. */
static bool convert(const hand_board_config *c, const hand_board_sensor *sensor, uint16_t supply_mv, const uint16_t *counts,
                    int32_t *value)
{
    const uint16_t count = counts[sensor->channel];
    const bool inside = (count > c->lowest_count) && (count < c->highest_count);
    *value = 0;
    if (inside) {
        const int64_t scaled = (int64_t)count * c->reference_mv * MILLION;
        const int64_t ratio_ppm = scaled / ((int64_t)c->full_scale * (int64_t)supply_mv);
        const int64_t exact = ((ratio_ppm - sensor->zero_ppm) * (int64_t)sensor->per_ratio) / MILLION;
        if (exact > FARTHEST) {
            *value = FARTHEST;
        } else if (exact < -FARTHEST) {
            *value = -FARTHEST;
        } else {
            *value = (int32_t)exact;
        }
    }
    return inside;
}

static void measure(hand_board *b, uint32_t now_us, const hand_board_reading *reading)
{
    const hand_board_config *c = b->config;
    int32_t pressure_pa[HAND_SAFETY_JOINTS];
    int32_t angle_urad[HAND_SAFETY_JOINTS];
    const uint16_t supply_mv = reading->supply_mv;
    const bool supplied = (supply_mv >= c->lowest_supply_mv) && (supply_mv <= c->highest_supply_mv);
    if (supplied && ((reading->status & HAND_BOARD_ADC_FAULT) == 0U)) {
        bool good = true;
        for (uint8_t i = 0U; i < b->safety.count; i++) {
            const bool angle = convert(c, &c->angle[i], supply_mv, reading->counts, &angle_urad[i]);
            const bool pressure = convert(c, &c->pressure[i], supply_mv, reading->counts, &pressure_pa[i]);
            good = good && angle && pressure;
        }
        (void)hand_safety_sample(&b->safety, now_us, reading->number, good, pressure_pa, angle_urad);
    }
}

static size_t write_echo(const hand_board *b, uint64_t now_us, uint8_t *payload, size_t at)
{
    size_t end = at;
    uint64_t age_ms = NEVER_MS;
    if (b->in_force.any) {
        age_ms = ((now_us - b->in_force.at_us) + (MS_US / 2U)) / MS_US;
        if (age_ms > OLDEST_MS) {
            age_ms = OLDEST_MS;
        }
    }
    end = hand_wire_write(payload, end, b->safety.count, 1U);
    end = hand_wire_write(payload, end, b->in_force.sequence, 4U);
    end = hand_wire_write(payload, end, b->in_force.accepted, 1U);
    end = hand_wire_write(payload, end, age_ms, 2U);
    for (uint8_t i = 0U; i < b->safety.count; i++) {
        end = hand_wire_write(payload, end, (uint64_t)(uint32_t)((b->safety.output_pa[i] + (UNIT_PA / 2)) / UNIT_PA), 2U);
    }
    return end;
}

static size_t write_frame(const hand_board *b, uint64_t now_us, const hand_board_reading *reading, uint8_t *frame)
{
    uint8_t payload[HAND_BOARD_FRAME_SIZE];
    size_t end = 0U;
    uint32_t bits = reading->status;
    if (b->safety.state == (uint8_t)HAND_SAFETY_VENTED) {
        bits |= HAND_BOARD_VENTED;
    }
    if (b->safety.fault == (uint8_t)HAND_SAFETY_OVER_PRESSURE) {
        bits |= HAND_BOARD_OVER_PRESSURE;
    }
    end = hand_wire_write(payload, end, b->version, 1U);
    end = hand_wire_write(payload, end, TYPE_FRAME, 1U);
    end = hand_wire_write(payload, end, b->frame_sequence, 4U);
    end = hand_wire_write(payload, end, now_us, 8U);
    end = hand_wire_write(payload, end, bits, 2U);
    end = hand_wire_write(payload, end, reading->supply_mv, 2U);
    end = hand_wire_write(payload, end, b->channels, 1U);
    for (uint8_t i = 0U; i < b->channels; i++) {
        end = hand_wire_write(payload, end, reading->counts[i], 2U);
    }
    if (b->version >= SECOND_VERSION) {
        end = write_echo(b, now_us, payload, end);
    }
    return hand_wire_packet(payload, end, frame);
}

/* The set-points of a tick, and what the echo of the next frame says of them. */
static void take_over(hand_board *b, uint64_t now_us, int32_t *valve_pa)
{
    hand_safety_tick(&b->safety, (uint32_t)now_us, valve_pa);
    b->in_force = b->newest;
}

size_t hand_board_sample(hand_board *b, uint64_t now_us, const hand_board_reading *reading, int32_t *valve_pa,
                         uint8_t *frame)
{
    measure(b, (uint32_t)now_us, reading);
    const size_t size = write_frame(b, now_us, reading, frame);
    b->frame_sequence++;
    b->sampled_us = now_us;
    take_over(b, now_us, valve_pa);
    return size;
}

/* A time before the last sample was read before the interrupt of that sample, and is no fault of the clock. */
bool hand_board_watch(hand_board *b, uint64_t now_us, int32_t *valve_pa)
{
    const bool stopped = (now_us > b->sampled_us) && ((now_us - b->sampled_us) > HAND_SAFETY_WARN_US);
    if (stopped) {
        take_over(b, now_us, valve_pa);
    }
    return stopped;
}
