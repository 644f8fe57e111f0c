"""Angle sensors that were exchanged before arming: found by the first motions, and confirmed by a small step back.

Sensors that are exchanged in motion make a step (sensor_watch). Before arming they make none: joint i bends, the angle
of joint k rises, the controller waits for i, and its pressure rises on. For each pair of neighbouring channels the
motion u that is measured and the motion w that the pressures ask for, both over about half a second, are compared:

    as wired     u_i of w_i, u_k of w_k     CLEARly likelier: settled, a later exchange makes a step, unless the angles
                                            stay together, or frames come too rarely: then open
    exchanged    u_i of w_k, u_k of w_i     CLEARly likelier: suspected

A motion u of w has the mean w and the variance (MODEL w)^2 + FLOOR_RAD^2. Where both joints are asked to move alike
nothing decides, and nothing is lost by an exchange until they are asked to part.

A push on k while an obstacle blocks i looks the same. A suspected joint is therefore asked: its set-point returns
towards the pressure that it was armed with, until it is to have fallen by FALL_RAD, and that of k is held. If k goes
back as i should, and i as k should, they are exchanged, once this has happened QUESTIONS times; a push knows nothing of
the pressure, unless it comes in the rhythm of the questions. Until a joint has first moved as its pressure asks, its
set-point rises slowly, and for ALIKE_S longer where its neighbour moves alike.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hand_control.declared import inlined
from hand_model.arrays import Array
from hand_model.compile_cache import without_arrays

LEAST_RAD = math.radians(2.0)
"""Motions below are no evidence."""
MODEL, FLOOR_RAD = 0.3, math.radians(1.0)
"""Standard deviation of a motion from the one asked for: a share of it by the model, and a floor: friction, stops."""
CLEAR = 6.0
"""Logarithm of a likelihood ratio that decides: 1 in 400."""
ALIKE = (0.4, 2.5)
"""Share of the motion asked for that is measured where the constants of the model are 30 % off."""
FOLLOWS, RECENT_S = 0.65, 0.5
"""Motions older than RECENT_S fade. The largest difference to an exchanged one is at most the share FOLLOWS of it."""
ENOUGH_S = 0.03
QUESTIONS = 2
"""Answers in a row that prove an exchange: one may be a push that ends at that moment."""
FORGET_S = 1.0
"""Time after a question, without another one, for which its answer counts; exchanged joints soon look so again."""
FALL_RAD, STAYS = math.radians(5.0), 0.5
"""By how much the pressure lets a joint fall in a question, and the share of its pressure that it keeps then."""
ASKED_S = 0.4
"""Time for an answer; one that is not CLEAR counts in part from half of CLEAR on."""
ALIKE_S = 0.3
"""Time for which a joint must have moved as asked while its neighbour may be exchanged with it: both move alike."""
CAUTION_PA_PER_S = 1.5e5
CROSSING_RAD, CROSSING_S = math.radians(0.5), 0.05
"""Sensors that are exchanged where the angles differ by less make no step. Angles that part sooner show it: their
speeds are exchanged, too."""
NONE = -1
_CAREFUL, _MOVED_S, _FROM_PA, _HELD_PA, _STATE, _UNSETTLED, _BEFORE_PA = range(7)
"""Rows of a joint; _STATE: free, asked, asked and far enough, or held because its neighbour is asked; _UNSETTLED:
whether a pair is open; _BEFORE_PA: set-point before the question."""
_OPEN, _SUSPECT_S, _ASKED, _ASKED_S, _ANSWER_S, _MODEL_I, _MODEL_K, _OF_I, _OF_K, _MISSED, _CONFIRMED = range(7, 18)
_TOGETHER_S, _SINCE_S, _OLD = 18, 19, 20
"""Rows of a pair, in the column of its first joint; _SINCE_S: since the last question; from _OLD on, what its four
motions were when the angles met."""
ROWS = 24
_FREE, _ANSWERS, _STAYS, _WAITS = range(4)


@inlined
def _is_like(u, w):  # type: ignore[no-untyped-def]
    """Whether a measured motion u is the one asked for, w [rad]."""
    return abs(w) > LEAST_RAD and ALIKE[0] < u / w < ALIKE[1]


@inlined
def _careful(s, i, w, u, dt):  # type: ignore[no-untyped-def]
    """End the care with joint i when it has moved as its pressure asks."""
    s[_MOVED_S, i] = s[_MOVED_S, i] + dt if _is_like(u, w) else 0.0
    if s[_MOVED_S, i] > (ENOUGH_S if s[_UNSETTLED, i] == 0.0 else ALIKE_S):
        s[_CAREFUL, i] = 0.0


@without_arrays
def _misfit(u, w):  # type: ignore[no-untyped-def]
    """Square of the error of a measured motion u against the one asked for, w [rad], over its variance."""
    return (u - w) ** 2 / ((MODEL * w) ** 2 + FLOOR_RAD * FLOOR_RAD)


@without_arrays
def _evidence(u_i, u_k, w_i, w_k):  # type: ignore[no-untyped-def]
    """Logarithm of how much likelier motions u are as those asked for, w [rad], of the other joint than of its own."""
    return 0.5 * (_misfit(u_i, w_i) + _misfit(u_k, w_k) - _misfit(u_i, w_k) - _misfit(u_k, w_i))


@without_arrays
def _which(u_i, u_k, w_i, w_k):  # type: ignore[no-untyped-def]
    """1: motions u [rad] are those asked for, w, of the other joint; -1: of the joint itself; 0: undecided."""
    evidence = _evidence(u_i, u_k, w_i, w_k)
    return 1.0 if evidence > CLEAR else -1.0 if evidence < -CLEAR else 0.0


@inlined
def _lasts(now, sign, dt):  # type: ignore[no-untyped-def]
    """For how long [s] a sign has been seen without a break, with that sign."""
    return max(now, 0.0) + dt if sign > 0.0 else min(now, 0.0) - dt if sign < 0.0 else 0.0


@without_arrays
def _note(s, pair, i, k, position, model):  # type: ignore[no-untyped-def]
    s[_MODEL_I, pair], s[_MODEL_K, pair] = model[i], model[k]
    s[_OF_I, pair], s[_OF_K, pair] = position[i], position[k]


@without_arrays
def _is_answered(s, pair, i, k, position, model, dt):  # type: ignore[no-untyped-def]
    """Whether joint k has answered the question to joint i; the question ends after ASKED_S, or when i answers."""
    s[_ASKED_S, pair] -= dt
    if model[i] > s[_MODEL_I, pair]:  # the pressure still rises
        _note(s, pair, i, k, position, model)
    w_i, w_k, evidence, sign = model[i] - s[_MODEL_I, pair], model[k] - s[_MODEL_K, pair], 0.0, 0.0
    u_i, u_k = position[i] - s[_OF_I, pair], position[k] - s[_OF_K, pair]
    if w_i < -LEAST_RAD:
        evidence = _evidence(u_i, u_k, w_i, w_k) / CLEAR
        if evidence > 0.0:
            evidence = min(evidence, 1.0) if _is_like(u_k, w_i) else 0.0
        sign = 1.0 if evidence == 1.0 else -1.0 if evidence < -1.0 else 0.0
    s[_ANSWER_S, pair] = _lasts(s[_ANSWER_S, pair], sign, dt)
    if s[_ANSWER_S, pair] > ENOUGH_S:
        s[_CONFIRMED, pair] += 1.0
        s[_ASKED_S, pair] = 0.0
    elif s[_ANSWER_S, pair] < -ENOUGH_S or s[_ASKED_S, pair] <= 0.0:
        s[_CONFIRMED, pair] = s[_CONFIRMED, pair] + evidence if evidence >= 0.5 else 0.0
        s[_ASKED_S, pair] = 0.0
    return s[_CONFIRMED, pair] >= QUESTIONS


@without_arrays
def _watch(s, pair, other, w, u, position, model, dt):  # type: ignore[no-untyped-def]
    """Whether the joints of a pair are exchanged; asks one of them where they look so.

    A joint takes part in one question at a time: one whose own pressure falls would answer for another.
    """
    if s[_ASKED_S, pair] > 0.0:
        i, s[_SINCE_S, pair] = int(s[_ASKED, pair]), 0.0
        return _is_answered(s, pair, i, pair + other - i, position, model, dt)
    s[_SINCE_S, pair] += dt
    if s[_SINCE_S, pair] > FORGET_S:
        s[_CONFIRMED, pair] = 0.0
    w_i, w_k, u_i, u_k = _since(s, pair, other, w, u)
    i = pair
    if w_i < w_k:
        i, w_i, w_k, u_i, u_k = other, w_k, w_i, u_k, u_i
    missed = max(abs(u_k - w_i), abs(u_i - w_k))
    s[_MISSED, pair] = max(missed, s[_MISSED, pair] * (1.0 - dt / (dt + RECENT_S)))
    if max(w_i, -w_k) < LEAST_RAD:
        return False
    sign = _which(u_i, u_k, w_i, w_k)
    if sign > 0.0 and s[_MISSED, pair] > FOLLOWS * w_i:
        sign = 0.0  # joint k has moved on its own account
    time = _lasts(s[_SUSPECT_S, pair], sign, dt)
    s[_SUSPECT_S, pair] = time
    if time < -ENOUGH_S:
        s[_OPEN, pair] = 0.0
    elif time > ENOUGH_S and w_i > LEAST_RAD and s[_STATE, pair] == _FREE and s[_STATE, other] == _FREE:
        s[_SUSPECT_S, pair], s[_ANSWER_S, pair] = 0.0, 0.0
        s[_ASKED, pair], s[_ASKED_S, pair] = i, ASKED_S
        s[_CAREFUL, pair] = s[_CAREFUL, other] = 1.0
        _note(s, pair, i, pair + other - i, position, model)
    return False


@inlined
def _involve(s, pair, other, model):  # type: ignore[no-untyped-def]
    """Set the states of a pair with a question: its pressure falls until the model [rad] has fallen enough."""
    if s[_ASKED_S, pair] > 0.0:
        i = int(s[_ASKED, pair])
        s[_STATE, i] = _ANSWERS if model[i] > s[_MODEL_I, pair] - FALL_RAD else _STAYS
        s[_STATE, pair + other - i] = _WAITS


@inlined
def _since(s, pair, other, w, u):  # type: ignore[no-untyped-def]
    """Motions of a pair since its angles have met: asked for, w_i and w_k, and measured, u_i and u_k [rad]."""
    old = s[_OLD:, pair]
    return w[pair] - old[0], w[other] - old[1], u[pair] - old[2], u[other] - old[3]


@inlined
def _meet(s, pair, other, w, u, position, dt):  # type: ignore[no-untyped-def]
    """Begin again with a pair whose angles meet: there an exchange makes no step."""
    for row in range(_OLD, ROWS):
        s[row, pair] *= 1.0 - dt / (dt + RECENT_S)
    meet = abs(position[pair] - position[other]) < CROSSING_RAD
    s[_TOGETHER_S, pair] = s[_TOGETHER_S, pair] + dt if meet else 0.0
    if s[_TOGETHER_S, pair] > CROSSING_S and s[_ASKED_S, pair] <= 0.0:
        s[_OPEN, pair], s[_SUSPECT_S, pair], s[_MISSED, pair] = 1.0, 0.0, 0.0
        s[_OLD, pair], s[_OLD + 1, pair] = w[pair], w[other]
        s[_OLD + 2, pair], s[_OLD + 3, pair] = u[pair], u[other]


@without_arrays
def begin_again(s, after, i, k, w, u):  # type: ignore[no-untyped-def]
    """Begin again with joints i and k, whose speeds crossed: careful as after arming, watched where they are a pair.

    w, u: as in `check_places`; those of i and k become 0 in place.
    """
    for joint in (i, k):
        s[_CAREFUL, joint], s[_MOVED_S, joint] = 1.0, 0.0
        w[joint] = u[joint] = 0.0
    for pair in range(len(after)):
        other = after[pair]
        if pair in (i, k):
            s[_OLD, pair] = s[_OLD + 2, pair] = 0.0
        if other in (i, k):
            s[_OLD + 1, pair] = s[_OLD + 3, pair] = 0.0
        if pair in (i, k) and other in (i, k):
            s[_OPEN, pair], s[_SUSPECT_S, pair], s[_MISSED, pair] = 1.0, 0.0, 0.0


@inlined
def open_again(s, after):  # type: ignore[no-untyped-def]
    """Watch every pair on, and let every set-point rise slowly: frames come too rarely to see an exchange in motion."""
    for pair in range(len(after)):
        s[_CAREFUL, pair] = 1.0
        if after[pair] >= 0:
            s[_OPEN, pair] = 1.0


@inlined
def check_places(s, after, w, u, position, model, dt):  # type: ignore[no-untyped-def]
    """The first joint of an exchanged pair, or NONE, dt [s] after the last call; updates the state s in place.

    w, u: (joints,) motions of about half a second, asked for and measured [rad].  position, model: (joints,) [rad], the
    angles measured and those that the pressures ask for.
    """
    n, found = len(position), NONE
    for i in range(n):
        s[_STATE, i] = _FREE
        if s[_CAREFUL, i] > 0.0:
            _careful(s, i, w[i], u[i], dt)
        s[_UNSETTLED, i] = 0.0
    for pair in range(n):
        if after[pair] >= 0 and s[_OPEN, pair] != 0.0:
            _involve(s, pair, after[pair], model)
    for pair in range(n):
        other = after[pair]
        if other < 0:
            continue
        _meet(s, pair, other, w, u, position, dt)
        if s[_OPEN, pair] == 0.0:
            continue
        s[_UNSETTLED, pair] = s[_UNSETTLED, other] = 1.0
        if s[_SUSPECT_S, pair] > 0.0:
            s[_MOVED_S, pair] = s[_MOVED_S, other] = 0.0
        if _watch(s, pair, other, w, u, position, model, dt):
            found = pair
        _involve(s, pair, other, model)
    return found


@without_arrays
def hold_places(s, command, pressure, dt):  # type: ignore[no-untyped-def]
    """Limit set-points [Pa] in place, never below 0: a question, or a slow rise.  Whether one is lower now."""
    limits = False
    for i in range(len(command)):
        asked = command[i]
        if s[_STATE, i] == _ANSWERS:
            command[i] = min(command[i], s[_FROM_PA, i])
        elif s[_STATE, i] == _STAYS:
            command[i] = min(command[i], max(pressure[i], STAYS * s[_BEFORE_PA, i]))
        elif s[_STATE, i] == _WAITS:
            command[i] = min(command[i], s[_HELD_PA, i])
        elif s[_CAREFUL, i] > 0.0:
            armed_with = min(max(pressure[i], 0.0), s[_FROM_PA, i])
            command[i] = min(command[i], max(s[_HELD_PA, i] + CAUTION_PA_PER_S * dt, armed_with))
        s[_HELD_PA, i] = command[i]
        if s[_STATE, i] == _FREE or s[_STATE, i] == _WAITS:
            s[_BEFORE_PA, i] = command[i]
        limits |= command[i] < asked
    return limits


def following(channel: NDArray[np.int64]) -> NDArray[np.int64]:
    """The joint whose channel follows that of each joint, -1 where there is none; (joints,)."""
    of = {int(c): j for j, c in enumerate(channel)}
    return np.array([of.get(int(c) + 1, -1) for c in channel], dtype=np.int64)


class PlaceWatch:
    """Compares the motions of neighbouring channels after arming.

    state: of `check_places` and `hold_places`, which compiled code calls.
    after: (joints,) the joint whose angle channel follows, -1 where there is none.
    """

    def __init__(self, after: NDArray[np.int64], memory: Array | None = None) -> None:
        """Begin without evidence. memory: (ROWS, joints) for the state; None: one of its own."""
        self.after = after
        self.state = np.zeros((ROWS, len(after))) if memory is None else memory

    def start(self, pressure: Array) -> None:
        """Begin without evidence at pressures (n,) [Pa]."""
        s = self.state
        s[:] = 0.0
        s[[_OPEN, _CAREFUL]] = 1.0
        s[[_FROM_PA, _HELD_PA]] = np.maximum(pressure, 0.0)  # a sensor at ambient pressure reads noise about 0

    def restart(self) -> None:
        """Forget what is undecided, after a gap."""
        self.state[[_MOVED_S, _SUSPECT_S, _ASKED_S, _ANSWER_S, _CONFIRMED]] = 0.0
