/* A board of docs/protocol.md, versions 1 and 2, without input and output: bytes and samples in, bytes and set-points
 * out. C99, no heap. The safety layer (hand_safety.h) decides what reaches the valves.
 *
 * Set-points that are all zero are the request that arms a vented board; set-points of another value never are. A latched
 * fault other than the end of a lifetime is cleared by a new session only, and the board is then armed as after a start.
 */
#ifndef HAND_BOARD_H
#define HAND_BOARD_H

#include "hand_safety.h"
#include "hand_wire.h"

#define HAND_BOARD_CHANNELS (64U) /* largest number of channels */
#define HAND_BOARD_ANSWER_SIZE (24U)
#define HAND_BOARD_FRAME_SIZE (19U + (2U * HAND_BOARD_CHANNELS) + 8U + (2U * HAND_SAFETY_JOINTS) + HAND_WIRE_OVERHEAD)

/* Status bits of a frame. */
#define HAND_BOARD_VENTED (1U)
#define HAND_BOARD_SUPPLY_LOW (2U)
#define HAND_BOARD_OVER_PRESSURE (4U)
#define HAND_BOARD_ADC_FAULT (8U)

/* A ratiometric sensor: value = (counts / full scale * reference / supply - zero) * per_ratio. */
typedef struct {
    uint8_t channel;
    int32_t zero_ppm;
    int32_t per_ratio; /* [Pa] or [urad] */
} hand_board_sensor;

/* Constants of a hand, made by python -m hand_control.board_config. */
typedef struct {
    uint8_t joints;
    uint8_t channels;
    uint16_t lowest_supply_mv;
    uint16_t highest_supply_mv;
    uint16_t reference_mv;
    uint16_t full_scale;
    uint16_t lowest_count; /* a channel at or beyond these is at a rail */
    uint16_t highest_count;
    const hand_safety_joint *limits;
    const hand_board_sensor *angle;
    const hand_board_sensor *pressure;
} hand_board_config;

/* What the converter has measured. number: its own count of conversions; one that is repeated is no new sample.
 * status: HAND_BOARD_SUPPLY_LOW and HAND_BOARD_ADC_FAULT where they apply. counts: one per channel. */
typedef struct {
    uint32_t number;
    uint16_t status;
    uint16_t supply_mv;
    const uint16_t *counts;
} hand_board_reading;

/* Accepted set-points, as the echo reports them. */
typedef struct {
    uint64_t at_us;
    uint32_t sequence;
    uint8_t accepted; /* packets in this session, modulo 256 */
    bool any;
} hand_board_accepted;

/* The caller reads safety and receiver.corrupt; only the functions below write. */
typedef struct {
    const hand_board_config *config;
    hand_safety safety;
    hand_wire_receiver receiver;
    hand_board_accepted newest;
    hand_board_accepted in_force; /* the newest at the last tick: the valves follow these */
    uint64_t sampled_us; /* last call of hand_board_sample */
    uint32_t session;
    uint32_t frame_sequence;
    uint32_t loops;
    uint8_t channels;
    uint8_t version;
    bool in_session;   /* the host has offered a session */
    bool session_used; /* and sent set-points in it */
} hand_board;

/* Begin vented. Returns false for a configuration that cannot be used; then the board sends frames and stays vented. */
bool hand_board_start(hand_board *b, const hand_board_config *config);

/* Bytes from the host, possibly none; call it in every round of the main loop, which is the heartbeat. answer has room
 * for HAND_BOARD_ANSWER_SIZE bytes. Returns the number of bytes to send; the last offer is answered. */
size_t hand_board_receive(hand_board *b, uint64_t now_us, const uint8_t *data, size_t size, uint8_t *answer);

/* One sample of every channel. valve_pa: the set-points of the next period, one per joint. frame has room for
 * HAND_BOARD_FRAME_SIZE bytes. Returns its size. */
size_t hand_board_sample(hand_board *b, uint64_t now_us, const hand_board_reading *reading, int32_t *valve_pa,
                         uint8_t *frame);

/* Checks every age where samples have stopped; call it in each round of the main loop, or from a timer that does not
 * depend on the converter. Returns false, without a result, while samples arrive. Where it returns true, send valve_pa
 * to the valves: it is 0 from HAND_SAFETY_VENT_US after the last sample on. */
bool hand_board_watch(hand_board *b, uint64_t now_us, int32_t *valve_pa);

#endif
