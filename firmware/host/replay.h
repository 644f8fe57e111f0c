/* Replays recorded calls of the safety layer and compares every result with the recorded one. */
#ifndef HAND_REPLAY_H
#define HAND_REPLAY_H

#include <stddef.h>
#include <stdint.h>

/* words: events as validation/c_safety.py writes them. Returns 0, or 1 + the index of the first event that differs. */
size_t hand_replay(const uint32_t *words, size_t count);

/* Number of events that the last call compared. */
size_t hand_replay_compared(void);

#endif
