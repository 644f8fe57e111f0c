/* Replays recorded calls of the board sample and compares every result with the recorded one. */
#ifndef HAND_BOARD_REPLAY_H
#define HAND_BOARD_REPLAY_H

#include <stddef.h>
#include <stdint.h>

/* Returns 0, or 1 + the index of the first event that differs. */
size_t board_replay(const uint32_t *words, size_t count);

/* Number of events that the last call compared. */
size_t board_replay_compared(void);

#endif
