/* See board_replay.h. An event is: its kind, its arguments; the bytes to send; state, fault, corrupt, valves. */
#include "board_replay.h"

#include "hand_board.h"

enum { EVENT_START, EVENT_RECEIVE, EVENT_SAMPLE, EVENT_PACKET, EVENT_WATCH };

#define MOST (256U)
#define UNTOUCHED (0xA5U)

static const uint32_t *next_word;
static hand_board board;
static hand_board_config config;
static hand_safety_joint limits[MOST];
static hand_board_sensor angle[MOST], pressure[MOST];
static int32_t valves[MOST];
static size_t compared;

static uint32_t word(void)
{
    return *next_word++;
}

static int32_t number(void)
{
    return (int32_t)word(); /* two's complement */
}

static void fill(void *to, size_t size)
{
    for (size_t i = 0U; i < size; i++) {
        ((uint8_t *)to)[i] = UNTOUCHED;
    }
}

static void sensors(hand_board_sensor *sensor)
{
    for (uint32_t i = 0U; i < config.joints; i++) {
        sensor[i].channel = (uint8_t)word();
        sensor[i].zero_ppm = number();
        sensor[i].per_ratio = number();
    }
}

static uint32_t start(void)
{
    config.joints = (uint8_t)word();
    config.channels = (uint8_t)word();
    config.lowest_supply_mv = (uint16_t)word();
    config.highest_supply_mv = (uint16_t)word();
    config.reference_mv = (uint16_t)word();
    config.full_scale = (uint16_t)word();
    config.lowest_count = (uint16_t)word();
    config.highest_count = (uint16_t)word();
    for (uint32_t i = 0U; i < config.joints; i++) {
        int32_t row[9];
        for (uint32_t k = 0U; k < 9U; k++) {
            row[k] = number();
        }
        limits[i] = (hand_safety_joint){row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8]};
    }
    sensors(angle);
    sensors(pressure);
    config.limits = limits;
    config.angle = angle;
    config.pressure = pressure;
    fill(&board, sizeof board); /* the start has to set every field */
    for (uint32_t i = 0U; i < MOST; i++) {
        valves[i] = 0;
    }
    return hand_board_start(&board, &config);
}

static uint64_t time_us(void)
{
    const uint64_t high = word();
    return (high << 32U) | word();
}

/* Whether the bytes are those recorded, and the byte after them is untouched. */
static int same_bytes(const uint8_t *bytes, size_t size)
{
    const size_t expected = word();
    int same = (expected == size) && (bytes[size] == UNTOUCHED);
    for (size_t i = 0U; i < expected; i++) {
        const uint32_t byte = word();
        same = (i < size) && (bytes[i] == byte) && same;
    }
    return same;
}

static int receive(void)
{
    static uint8_t data[4096], answer[HAND_BOARD_ANSWER_SIZE + 1U];
    fill(answer, sizeof answer);
    const uint64_t now_us = time_us();
    const size_t size = word();
    for (size_t i = 0U; i < size; i++) {
        data[i] = (uint8_t)word();
    }
    return same_bytes(answer, hand_board_receive(&board, now_us, data, size, answer));
}

static int sample(void)
{
    static uint8_t frame[HAND_BOARD_FRAME_SIZE + 1U];
    fill(frame, sizeof frame);
    const uint64_t now_us = time_us();
    uint16_t counts[MOST];
    hand_board_reading reading = {.counts = counts};
    reading.number = word();
    reading.status = (uint16_t)word();
    reading.supply_mv = (uint16_t)word();
    for (uint32_t i = 0U; i < config.channels; i++) {
        counts[i] = (uint16_t)word();
    }
    return same_bytes(frame, hand_board_sample(&board, now_us, &reading, valves, frame));
}

static int watch(void)
{
    const uint64_t now_us = time_us();
    return hand_board_watch(&board, now_us, valves) == (word() != 0U);
}

static int packet(void)
{
    static uint8_t payload[HAND_WIRE_PACKET_SIZE], made[HAND_WIRE_PACKET_SIZE + 1U];
    fill(made, sizeof made);
    const size_t size = word();
    for (size_t i = 0U; i < size; i++) {
        payload[i] = (uint8_t)word();
    }
    return same_bytes(made, hand_wire_packet(payload, size, made));
}

static int same_state(void)
{
    int same = word() == board.safety.state;
    same = (word() == board.safety.fault) && same;
    same = (word() == board.receiver.corrupt) && same;
    const uint32_t outputs = word();
    same = (outputs == board.safety.count) && same;
    for (uint32_t i = 0U; i < outputs; i++) {
        same = (number() == valves[i]) && same;
    }
    return same;
}

size_t board_replay(const uint32_t *words, size_t count)
{
    size_t differs = 0U;
    compared = 0U;
    next_word = words;
    while ((differs == 0U) && (next_word < words + count)) {
        const uint32_t event = word();
        int same;
        if (event == EVENT_START) {
            same = start() == word();
        } else if (event == EVENT_PACKET) {
            same = packet();
        } else if (event == EVENT_WATCH) {
            same = watch();
        } else {
            same = (event == EVENT_RECEIVE) ? receive() : sample();
        }
        compared++;
        if (!(same_state() && same)) {
            differs = compared;
        }
    }
    return differs;
}

size_t board_replay_compared(void)
{
    return compared;
}
