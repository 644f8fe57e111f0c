/* See replay.h. An event is: its kind, its arguments, its result; then state, fault, flags and set-points. */
#include "replay.h"

#include <string.h>

#include "hand_safety.h"

enum {
    EVENT_START,
    EVENT_COMMAND,
    EVENT_SESSION,
    EVENT_SAMPLE,
    EVENT_HEARTBEAT,
    EVENT_ARM,
    EVENT_VENT,
    EVENT_RESET,
    EVENT_TICK,
    EVENT_STEP,
    EVENT_INTEGER,
    EVENT_CEILING,
    EVENT_DAMAGE
};

#define MOST (256U)
#define UNTOUCHED (-12345)

static const uint32_t *next_word;
static hand_safety layer;
static hand_safety_joint joints[MOST];
static uint32_t joint_count;
static int32_t output[HAND_SAFETY_JOINTS + 1U];
static size_t compared;

static uint32_t word(void)
{
    return *next_word++;
}

static int32_t number(void)
{
    const uint32_t bits = word();
    int32_t value;
    (void)memcpy(&value, &bits, sizeof value);
    return value;
}

static float real(void)
{
    const uint32_t bits = word();
    float value;
    (void)memcpy(&value, &bits, sizeof value);
    return value;
}

static uint32_t bits_of(float value)
{
    uint32_t bits;
    (void)memcpy(&bits, &value, sizeof bits);
    return bits;
}

static void numbers(int32_t *values, uint32_t count)
{
    for (uint32_t i = 0U; i < count; i++) {
        values[i] = number();
    }
}

static uint32_t start(void)
{
    joint_count = word();
    for (uint32_t i = 0U; i < joint_count; i++) {
        int32_t row[9];
        numbers(row, 9U);
        joints[i] = (hand_safety_joint){row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8]};
    }
    (void)memset(&layer, 0xA5, sizeof layer); /* the start has to set every field */
    return hand_safety_start(&layer, joints, (uint8_t)joint_count);
}

static uint32_t command(void)
{
    const uint32_t now_us = word(), sequence = word(), lifetime_us = word(), count = word();
    int32_t pressure[MOST];
    numbers(pressure, count);
    return (uint32_t)hand_safety_command(&layer, now_us, sequence, lifetime_us, (uint8_t)count, pressure);
}

static uint32_t sample(void)
{
    const uint32_t now_us = word(), sequence = word(), valid = word();
    int32_t pressure[MOST], angle[MOST];
    numbers(pressure, joint_count);
    numbers(angle, joint_count);
    return hand_safety_sample(&layer, now_us, sequence, valid != 0U, pressure, angle);
}

static uint32_t integer(void)
{
    const float value = real(), scale = real();
    int32_t result = -1;
    const uint32_t fits = hand_safety_integer(value, scale, &result);
    return (fits != 0U) ? (uint32_t)result : 0x7FFFFFFFU;
}

static uint32_t result_of(uint32_t event)
{
    uint32_t result = 0U, first, second;
    switch (event) {
    case EVENT_START: result = start(); break;
    case EVENT_COMMAND: result = command(); break;
    case EVENT_SESSION: hand_safety_new_session(&layer); break;
    case EVENT_SAMPLE: result = sample(); break;
    case EVENT_HEARTBEAT:
        first = word();
        second = word();
        result = hand_safety_heartbeat(&layer, first, second);
        break;
    case EVENT_ARM: result = hand_safety_arm(&layer, word()); break;
    case EVENT_VENT: hand_safety_vent(&layer); break;
    case EVENT_RESET: result = hand_safety_reset(&layer); break;
    case EVENT_TICK:
        output[layer.count] = UNTOUCHED;
        hand_safety_tick(&layer, word(), output);
        result = memcmp(output, layer.output_pa, layer.count * sizeof output[0]) == 0;
        result = (result != 0U) && (output[layer.count] == UNTOUCHED);
        break;
    case EVENT_STEP: result = bits_of(hand_safety_step(real())); break;
    case EVENT_INTEGER: result = integer(); break;
    case EVENT_CEILING:
        first = word();
        result = (uint32_t)hand_safety_torque_ceiling(&joints[first], number());
        break;
    case EVENT_DAMAGE: layer.state = (uint8_t)word(); break;
    default: result = 0xFFFFFFFFU; break;
    }
    return result;
}

/* 16 where the layer wrote beyond its number of joints. */
static uint32_t beyond(void)
{
    uint32_t found = 0U;
    for (uint32_t i = layer.count; i < HAND_SAFETY_JOINTS; i++) {
        if (((uint32_t)layer.command_pa[i] | (uint32_t)layer.pressure_pa[i] | (uint32_t)layer.angle_urad[i]
             | (uint32_t)layer.output_pa[i] | layer.over_us[i])
            != 0U) {
            found = 16U;
        }
    }
    return found;
}

static uint32_t flags(void)
{
    return (uint32_t)layer.late + 2U * layer.integrate + 4U * layer.torque_limited + 8U * layer.rate_limited + beyond();
}

size_t hand_replay(const uint32_t *words, size_t count)
{
    size_t differs = 0U;
    compared = 0U;
    next_word = words;
    while ((differs == 0U) && (next_word < words + count)) {
        const uint32_t event = word();
        const uint32_t result = result_of(event);
        int same = word() == result;
        compared++;
        same = (word() == layer.state) && same;
        same = (word() == layer.fault) && same;
        same = (word() == flags()) && same;
        const uint32_t outputs = word();
        same = (outputs == layer.count) && same;
        for (uint32_t i = 0U; i < outputs; i++) {
            const int32_t expected = number();
            same = (i < HAND_SAFETY_JOINTS) && (expected == layer.output_pa[i]) && same;
        }
        if (!same) {
            differs = compared;
        }
    }
    return differs;
}

size_t hand_replay_compared(void)
{
    return compared;
}
