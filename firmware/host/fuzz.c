/* fuzz COUNT SEED: random and mutated packets, samples and times into a board; stops where a promise is broken.
 *
 * Promises after every call: set-points are within 0 and the limit of their joint; a vented board has none; a frame is
 * a valid packet; no set-point rises faster than the rate. Build it with sanitizers (validation/c_checks.py). */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "board_config.h"

#define LONGEST (64U)

static uint64_t random_state;
static hand_board board;
static uint64_t now_us;
static uint64_t sampled_us;
static uint32_t sequence;
static uint32_t number; /* of the converter */
static int32_t valves[HAND_SAFETY_JOINTS], before[HAND_SAFETY_JOINTS];
static uint64_t driven, accepted;

static uint32_t draw(uint32_t below)
{
    random_state ^= random_state << 13U; /* xorshift64 */
    random_state ^= random_state >> 7U;
    random_state ^= random_state << 17U;
    return (uint32_t)((random_state >> 11U) % below);
}

static void check(int promise, const char *text)
{
    if (!promise) {
        (void)printf("broken: %s\n", text);
        exit(1);
    }
}

/* A packet of set-points or an offer, with every field random around what is allowed. */
static size_t make_packet(uint8_t *packet)
{
    uint8_t payload[LONGEST];
    size_t end = 0U;
    const uint32_t kind = draw(20U);
    const uint32_t version = (kind < 12U) ? 1U + draw(2U) : draw(4U);
    if (kind == 19U) {
        end = hand_wire_write(payload, end, 0x0301U, 2U);
        end = hand_wire_write(payload, end, draw(4U), 1U);
        end = hand_wire_write(payload, end, draw(4U), 1U);
        end = hand_wire_write(payload, end, 7U + (draw(8U) == 0U), 4U);
    } else {
        const uint32_t count = (kind == 18U) ? draw(20U) : board_config.joints;
        const uint32_t level = (draw(3U) == 0U) ? 0U : draw((draw(9U) == 0U) ? 65536U : 60001U);
        sequence += (draw(12U) == 0U) ? draw(0xFFFFFFFFU) : 1U;
        end = hand_wire_write(payload, end, version, 1U);
        end = hand_wire_write(payload, end, (draw(50U) == 0U) ? draw(256U) : 2U, 1U);
        end = hand_wire_write(payload, end, sequence, 4U);
        end = hand_wire_write(payload, end, (draw(20U) == 0U) ? draw(65536U) : 100U, 2U);
        if (version == 2U) {
            end = hand_wire_write(payload, end, 7U, 4U);
        }
        end = hand_wire_write(payload, end, count, 1U);
        for (uint32_t i = 0U; i < count; i++) {
            end = hand_wire_write(payload, end, level, 2U);
        }
    }
    const size_t size = hand_wire_packet(payload, end, packet);
    if (draw(8U) == 0U) {
        packet[draw((uint32_t)size)] ^= (uint8_t)(1U << draw(8U));
    }
    return size;
}

static void receive(void)
{
    static uint8_t packet[LONGEST + HAND_WIRE_OVERHEAD], answer[HAND_BOARD_ANSWER_SIZE];
    const uint8_t was = board.newest.accepted;
    size_t size = make_packet(packet);
    if (draw(30U) == 0U) {
        size = draw((uint32_t)size + 1U);
    }
    const size_t answered = hand_board_receive(&board, now_us, packet, size, answer);
    check(answered <= sizeof answer, "an answer fits its array");
    accepted += (board.newest.accepted != was);
}

/* Eq. 11 of a fully crept joint at an angle within its limits, in floating point. */
static int within_torque(const hand_safety_joint *joint, int32_t angle_urad, int32_t pressure_pa)
{
    const int32_t raised = (angle_urad > joint->low_urad) ? angle_urad : joint->low_urad;
    const double phi = 1e-6 * ((raised < joint->high_urad) ? raised : joint->high_urad);
    const double passive = joint->a0_nnm + (joint->a1_nnm_per_rad * (phi - (1e-6 * joint->phi_max_urad)));
    const double active = (joint->a2_pnm_per_pa + (joint->a3_pnm_per_pa_rad * phi)) * pressure_pa * 1e-3;
    return (pressure_pa == 0) || (passive + active <= 1.10001 * joint->max_torque_nnm);
}

/* What holds for the set-points after every call that writes them. */
static void check_set_points(void)
{
    const int vented = board.safety.state == (uint8_t)HAND_SAFETY_VENTED;
    for (uint32_t i = 0U; i < board_config.joints; i++) {
        check((valves[i] >= 0) && (valves[i] <= board_limits[i].max_pressure_pa), "a set-point is within its limit");
        check((!vented) || (valves[i] == 0), "a vented board has no set-points");
        check(vented || within_torque(&board_limits[i], board.safety.angle_urad[i], valves[i]),
              "a set-point is within the torque limit");
        driven += (valves[i] > 0);
    }
}

/* Rounds of the main loop, which receives, without a sample. */
static void stop_samples(void)
{
    for (uint32_t round = 0U; round < 12U; round++) {
        now_us += draw(20000U);
        receive();
        const int written = hand_board_watch(&board, now_us, valves) ? 1 : 0;
        check(written || (now_us - sampled_us <= HAND_SAFETY_WARN_US), "a stopped acquisition is seen");
        check((now_us - sampled_us <= HAND_SAFETY_VENT_US) || (board.safety.state == (uint8_t)HAND_SAFETY_VENTED),
              "a board without samples is vented");
        check_set_points();
    }
}

static void sample(void)
{
    static uint8_t frame[HAND_BOARD_FRAME_SIZE];
    static hand_wire_receiver receiver;
    uint16_t counts[HAND_BOARD_CHANNELS];
    for (uint32_t i = 0U; i < HAND_BOARD_CHANNELS; i++) {
        counts[i] = (uint16_t)((draw(2000U) == 0U) ? draw(65536U) : 8000U + draw(30000U));
    }
    const uint32_t gap_us = (draw(200U) == 0U) ? draw(0xFFFFFFFFU) : 1000U + draw(9000U);
    now_us += gap_us;
    if (draw(5000U) == 0U) {
        now_us -= draw(0xFFFFFFFFU);
    }
    const uint16_t supply_mv = (uint16_t)((draw(500U) == 0U) ? draw(65536U) : 5000U);
    (void)memcpy(before, valves, sizeof valves);
    const int was_driving = board.safety.state == (uint8_t)HAND_SAFETY_DRIVING;
    number += (draw(20U) == 0U) ? 0U : 1U;
    const hand_board_reading reading = {number, (uint16_t)(draw(500U) == 0U ? 8U : 0U), supply_mv, counts};
    const size_t size = hand_board_sample(&board, now_us, &reading, valves, frame);
    sampled_us = now_us;
    check(size <= sizeof frame, "a frame fits its array");
    hand_wire_start(&receiver);
    int whole = 0;
    for (size_t i = 0U; i < size; i++) {
        whole = hand_wire_take(&receiver, frame[i]) ? 1 : 0;
    }
    check(whole && (receiver.corrupt == 0U), "a frame is one valid packet");
    check_set_points();
    for (uint32_t i = 0U; i < board_config.joints; i++) {
        check((!was_driving) || ((int64_t)valves[i] - before[i] <= ((int64_t)HAND_SAFETY_RATE_PA_PER_S * gap_us) / 1000000),
              "no set-point rises faster than the rate");
    }
}

int main(int argc, char **argv)
{
    const unsigned long count = (argc > 1) ? strtoul(argv[1], NULL, 10) : 0UL;
    random_state = (argc > 2) ? strtoul(argv[2], NULL, 10) * 2654435769U + 1U : 1U;
    if (count == 0UL) {
        (void)fprintf(stderr, "usage: fuzz COUNT SEED\n");
        return 2;
    }
    check(hand_board_start(&board, &board_config), "the configuration can be used");
    for (unsigned long k = 0UL; k < count; k++) {
        receive();
        if (draw(2U) == 0U) {
            sample();
        }
        if (draw(200U) == 0U) {
            stop_samples();
        }
        if (draw(4000U) == 0U) {
            (void)hand_board_start(&board, &board_config);
            (void)memset(valves, 0, sizeof valves);
        }
    }
    (void)printf("%lu packets, %" PRIu64 " accepted, %" PRIu64 " set-points above 0\n", count, accepted, driven);
    return 0;
}
