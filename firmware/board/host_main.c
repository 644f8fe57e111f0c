/* host_board RATE_HZ: the board sample on this machine, with a simple hand. Bytes of the host come from descriptor 0,
 * bytes to it go to descriptor 1; the program ends when descriptor 0 is closed. One line a second is written to
 * descriptor 2: state, fault and highest set-point. */
#define _POSIX_C_SOURCE 200809L

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#include "board_config.h"

#define NS_PER_S (1000000000ULL)
#define SUPPLY_MV (5000U)
#define SENSOR_SHARE (0.05) /* the valves' lag: share of a difference that is left after one period is 1 - this */

static hand_board board;
static double pressure_pa[HAND_SAFETY_JOINTS];
static int32_t valve_pa[HAND_SAFETY_JOINTS];

static uint64_t now_ns(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return ((uint64_t)t.tv_sec * NS_PER_S) + (uint64_t)t.tv_nsec;
}

static uint16_t count_of(const hand_board_sensor *sensor, double value)
{
    const double ratio = ((double)sensor->zero_ppm * 1e-6) + (value / (double)sensor->per_ratio);
    return (uint16_t)(ratio * SUPPLY_MV / board_config.reference_mv * board_config.full_scale);
}

static void sample(uint32_t number)
{
    uint16_t counts[HAND_BOARD_CHANNELS] = {0};
    uint8_t frame[HAND_BOARD_FRAME_SIZE];
    for (uint32_t i = 0U; i < board_config.joints; i++) {
        pressure_pa[i] += SENSOR_SHARE * ((double)valve_pa[i] - pressure_pa[i]);
        counts[board_config.pressure[i].channel] = count_of(&board_config.pressure[i], pressure_pa[i]);
        counts[board_config.angle[i].channel] = count_of(&board_config.angle[i], 2.0 * pressure_pa[i]);
    }
    const hand_board_reading reading = {number, 0U, SUPPLY_MV, counts};
    const size_t size = hand_board_sample(&board, now_ns() / 1000U, &reading, valve_pa, frame);
    if (write(STDOUT_FILENO, frame, size) != (ssize_t)size) {
        (void)fprintf(stderr, "a frame was lost\n");
    }
}

/* Bytes until the time of the next sample. Returns 0 when the line is closed. */
static int serve(uint64_t until_ns)
{
    struct pollfd line = {STDIN_FILENO, POLLIN, 0};
    int open = 1;
    for (uint64_t at = now_ns(); (open != 0) && (at < until_ns); at = now_ns()) {
        uint8_t data[256], answer[HAND_BOARD_ANSWER_SIZE];
        ssize_t got = 0;
        if (poll(&line, 1U, (int)((until_ns - at) / 1000000U) + 1) > 0) {
            got = read(STDIN_FILENO, data, sizeof data);
            open = got > 0;
        }
        const size_t size = hand_board_receive(&board, now_ns() / 1000U, data, (got > 0) ? (size_t)got : 0U, answer);
        if ((size > 0U) && (write(STDOUT_FILENO, answer, size) != (ssize_t)size)) {
            (void)fprintf(stderr, "an answer was lost\n");
        }
        (void)hand_board_watch(&board, now_ns() / 1000U, valve_pa);
    }
    return open;
}

int main(int argc, char **argv)
{
    const unsigned long rate_hz = (argc == 2) ? strtoul(argv[1], NULL, 10) : 0UL;
    if ((rate_hz == 0UL) || !hand_board_start(&board, &board_config)) {
        (void)fprintf(stderr, "usage: host_board RATE_HZ\n");
        return 2;
    }
    const uint64_t begun_ns = now_ns();
    for (uint64_t tick = 1U; serve(begun_ns + ((tick * NS_PER_S) / rate_hz)) != 0; tick++) {
        sample((uint32_t)tick);
        if ((tick % rate_hz) == 0U) {
            (void)fprintf(stderr, "state %u fault %u set-point %ld Pa\n", (unsigned)board.safety.state,
                          (unsigned)board.safety.fault, (long)board.safety.output_pa[0]);
        }
    }
    return 0;
}
