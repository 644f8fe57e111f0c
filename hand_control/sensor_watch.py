"""Sensors that contradict the motion: angles with the wrong sign or of a neighbour, pressures of a neighbour, jumps.

A push, a contact or a wrong constant also contradicts the model, so a large residual alone proves nothing. A fault is
found where another hypothesis explains the same motion, and the model does not. Over a sliding window, the changes of
the actuator's torque E by the pressure are compared with the torque R that the measured motion needs, Eqs. 6 and 8:

    E = (a2 + a3 phi) dp,   R = -(a1 + a3 p) dphi + d phi' + J phi'' + J_c phi''_partner

    hypothesis                 explains the motion where
    believed sensor            R = g E
    angle with wrong sign      R = -g E, the leverage taken at the mirrored angle
    angles i, k exchanged      R_k = g E_i and R_i = g E_k: the motion of the one follows the pressure of the other
    pressures i, k exchanged   each pressure is what the set-point of the other one asks for

g is free within what a model 30 % off leaves (BELIEVED, SUSPECTED). The misfit of a hypothesis is the unexplained share
of the energy in R and g E: 0 explains all, 1 nothing, 2 the opposite. Evidence is the time, weighted by how far the
energy exceeds that of friction and noise, in which the believed sensor does not explain the motion and one of the
others does (a CUSUM: it falls otherwise, and never below 0). A fault is reported at ENOUGH_S of evidence.

A push may look like a fault for a moment. But a sensor cannot change its sign or its place without a break: its angle
steps to the mirrored angle or to that of the neighbour, or its speed turns back within a frame there. So a joint that
has moved as only the believed sensor explains, or for TRIED_S, is sure, and no evidence counts against it until such a
break. After arming, a wrong sign is possible where the pressure does not explain the pose. Angles that are exchanged
before arming are not found: pushes on two joints at once look like it too often.

A jump is a change of an angle that no torque of the actuator or of a hand could give within a frame; it counts when it
stays for JUMP_FRAMES frames. While evidence grows, no set-point exceeds the last one from before.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.statics import leverage, stiffness, torque

FILTER_S = 0.008
"""Time constant of both filters that give speed and acceleration."""
BASE_S = 0.3
"""Changes are those against the slow part with this time constant."""
WINDOW_S = 0.05
"""Memory of the sums over E and R."""
BELIEVED, SUSPECTED = (0.4, 2.5), (0.55, 1.9)
"""Range of g for the believed sensor, and for another hypothesis."""
UNEXPLAINED, EXPLAINED = 0.4, 0.25
"""Misfit above which the believed sensor does not explain the motion, and below which a hypothesis does."""
LEAST_NM = 0.008
"""Torque whose energy counts half: friction, noise and loads of this size explain nothing."""
ENOUGH_S = 0.035
REFUTED = 0.6
"""Misfit of another hypothesis above which a motion refutes it."""
APART = 0.4
"""Share of the energy of two motions by which they must differ, so that their exchange can be seen."""
NOISES, NOISE_S = 6.0, 1.0
"""A step is larger than NOISES times the mean surprise of the last NOISE_S, within LEAST_STEP_RAD and STEP_RAD."""
TRIED_S = 0.4
"""Time of motion after which a joint is sure, also where its motion was not as expected: a fault is found sooner."""
LEAST_RAD_PER_S = 0.3
"""Speed of the joints below which nothing moves."""
PUSHED = 0.2
"""Share of the energy of a motion below which its pressure has not caused it: another torque has."""
FROZEN_FRAMES, HELD_FRAMES = 14, 3
"""Bit-identical angles of a joint in motion: of a channel that repeats one in ten readings by chance, so many in a row
are seen less often than once in a million hours. Set-points are held after HELD_FRAMES."""
FROZEN_RAD_PER_S = 0.05
"""Speed at the last change of an angle from which its joint was in motion."""
PRESSURE_WINDOW_S = 0.03
LEAST_PA = 1.2e4
"""Difference of two pressures from which an exchange can be seen."""
REVERSED_RAD_PER_S, REVERSED = 0.6, 0.4
"""A joint that moved at this speed and within a frame moves back at this share of it has hit something, or its sensor
has changed its sign: older motion is forgotten, and the set-points are held for PAUSE_S."""
PAUSE_S = 0.05
LEAST_STEP_RAD, STEP_RAD, STEP, MATCH, MIRRORED, STEP_PA = math.radians(0.1), math.radians(0.5), 0.25, 0.7, 0.3, 1.2e4
"""A larger change of the motion within a frame than STEP_RAD and this share of the motion, and a larger change of a
pressure, is a break: a sensor cannot change its sign or its place without one."""
CAUTION_PA_PER_S, CAUTION_S = 2.0e5, 0.35
"""Largest rise of a set-point while a joint is driven with caution: for CAUTION_S after it has turned back, and after
arming in a pose that the pressure does not explain, until it has moved by CONFIRMED_RAD as its pressure changed."""
CONFIRMED_RAD = math.radians(3.0)
POSE_NM = 0.012
"""Torque that a pose may leave unexplained by its pressure: an error of the model, friction."""
JUMP_RAD = math.radians(4.0)
"""Jump that is always allowed."""
PUSH_NM = 0.6
"""Torque of a hand or an obstacle that a jump may come from."""
JUMP_FRAMES = 3
LEAST_LEVERAGE = 2e-7
STOP_NM, BEYOND_RAD, BEYOND_S = 0.2, math.radians(1.5), 0.01
"""A joint is beyond its lower end stop by more than this torque presses it and this angle, or by twice as much beyond
its upper one, for longer than one frame: no hand and no pressure explains it."""
FINE, JUMPED, SIGN, ANGLES_SWAPPED, PRESSURES_SWAPPED, FROZEN, BEYOND = range(7)
"""Verdicts."""
_KEYS = (
    "statics.a1_nm_per_rad",
    "statics.a2_nm_per_pa",
    "statics.a3_nm_per_pa_rad",
    "dynamics.inertia_kg_m2",
    "dynamics.viscous_friction_nm_s_per_rad",
    "dynamics.coupling_inertia_kg_m2",
    "end_stop.low_deg",
    "end_stop.high_deg",
)
_A1, _A2, _A3, _J, _D, _JC, _LOW, _HIGH, _MIRROR, _BEYOND = range(10)
_PHI_1, _PHI_2, _PHI_BASE, _P_1, _P_2, _P_BASE, _SPEED, _ACC = range(8)
_EE, _RR, _ER, _RRU, _ERU, _RRD, _ERD, _RX, _EM = range(8, 17)
(
    _PE,
    _PX,
    _FLIP,
    _SWAP,
    _PSWAP,
    _JUMP,
    _TARGET,
    _SIZE,
    _LAST,
    _BELIEVED_PA,
    _RUN,
    _RUN_SPEED,
    _HOLDS,
    _STEP_SPEED,
    _PAUSE,
    _CAUTION,
    _FROM_PHI,
    _FROM_P,
    _SURE_SIGN,
    _SURE_ANGLES,
    _SURE_PRESSURES,
    _BROKE,
    _P_LAST,
    _PREDICTED,
    _PUSHED,
    _PAIR_PUSHED,
    _NOISE,
    _OUTSIDE,
    _CENTRE,
) = range(17, 46)
_ROWS = 46


class Contradiction(NamedTuple):
    """What was found: a verdict, its joint, and the other joint of an exchange or -1.  size: of a jump [rad]."""

    verdict: int
    joint: int
    other: int
    size: float


@njit(cache=True)
def _misfit(ee, rr, er, low, high):  # type: ignore[no-untyped-def]
    """Unexplained energy and whole energy [(N m)^2] of R = g E, with the best g within low ... high."""
    g = min(max(er / ee, low), high) if ee > 0.0 else low
    return max(rr - 2.0 * g * er + g * g * ee, 0.0), rr + g * g * ee


@njit(cache=True)
def _mark_pushed(s, row, i, pressed, moved):  # type: ignore[no-untyped-def]
    """Note a motion that began before the pressure changed, until it has ended: energies of both [(N m)^2].

    After a break (-1), the motion is an older one, which proves nothing.
    """
    if s[row, i] < 0.0:
        return
    if moved < 0.06 * LEAST_NM * LEAST_NM:
        s[row, i] = 0.0
    elif moved > 0.25 * LEAST_NM * LEAST_NM and pressed < PUSHED * moved:
        s[row, i] = 1.0


@njit(cache=True)
def _grow(s, row, sure, i, energy, own, other, moves, dt):  # type: ignore[no-untyped-def]
    """Add a time step to the evidence of a row: misfit of the believed sensor, and of the other hypothesis.

    sure: the row of the time in which the motion was explained by the believed sensor and by no other hypothesis.
    """
    if s[sure, i] >= ENOUGH_S:
        s[row, i] = 0.0
        return
    if energy > LEAST_NM * LEAST_NM and s[_PAUSE, i] == 0.0:
        s[sure, i] += dt if own < EXPLAINED and other > REFUTED else dt * ENOUGH_S / TRIED_S
    if other < EXPLAINED and own > UNEXPLAINED and moves:
        weight = energy / (energy + LEAST_NM * LEAST_NM)
        s[row, i] += dt * weight * min(own - UNEXPLAINED, 1.0)
    else:
        s[row, i] = max(s[row, i] - dt, 0.0)


@njit(cache=True)
def _observe(s, i, phi, p, dt):  # type: ignore[no-untyped-def]
    """Advance the filters of joint i: backward Euler, two equal ones and the slow part."""
    share, slow = dt / (dt + FILTER_S), dt / (dt + BASE_S)
    s[_PHI_1, i] += share * (phi - s[_PHI_1, i])
    s[_PHI_2, i] += share * (s[_PHI_1, i] - s[_PHI_2, i])
    s[_P_1, i] += share * (p - s[_P_1, i])
    s[_P_2, i] += share * (s[_P_1, i] - s[_P_2, i])
    s[_SPEED, i] = (s[_PHI_1, i] - s[_PHI_2, i]) / FILTER_S
    s[_ACC, i] = (phi - 2.0 * s[_PHI_1, i] + s[_PHI_2, i]) / (FILTER_S * FILTER_S)
    s[_PHI_BASE, i] += slow * (s[_PHI_2, i] - s[_PHI_BASE, i])
    s[_P_BASE, i] += slow * (s[_P_2, i] - s[_P_BASE, i])


@njit(cache=True)
def _needed(s, c, i, k):  # type: ignore[no-untyped-def]
    """R [N m] of joint i where the motion is that of the angle channel of joint k."""
    spring = -stiffness(s[_P_2, i], c[_A1, i], c[_A3, i]) * (s[_PHI_2, k] - s[_PHI_BASE, k])
    return spring + c[_D, i] * s[_SPEED, k] + c[_J, i] * s[_ACC, k]


@njit(cache=True)
def _lever(c, i, phi):  # type: ignore[no-untyped-def]
    return max(leverage(phi, c[_A2, i], c[_A3, i]), LEAST_LEVERAGE)


@njit(cache=True)
def _sums(s, c, partner, above, i, dt):  # type: ignore[no-untyped-def]
    """Advance the sums over E and R of joint i and of the exchange with the joint above."""
    share = dt / (dt + WINDOW_S)
    e = _lever(c, i, s[_PHI_2, i]) * (s[_P_2, i] - s[_P_BASE, i])
    r = _needed(s, c, i, i)
    if partner[i] >= 0:
        r += c[_JC, i] * s[_ACC, partner[i]]
    s[_EE, i] += share * (e * e - s[_EE, i])
    s[_RR, i] += share * (r * r - s[_RR, i])
    s[_ER, i] += share * (e * r - s[_ER, i])
    full = c[_A2, i] * (s[_P_2, i] - s[_P_BASE, i])
    s[_EM, i] += share * (full * full - s[_EM, i])
    k = above[i]
    if k < 0:
        return
    up, down = _needed(s, c, i, k), _needed(s, c, k, i)
    other = _lever(c, k, s[_PHI_2, k]) * (s[_P_2, k] - s[_P_BASE, k])
    s[_RX, i] += share * (r * up - s[_RX, i])
    s[_RRU, i] += share * (up * up - s[_RRU, i])
    s[_ERU, i] += share * (e * up - s[_ERU, i])
    s[_RRD, i] += share * (down * down - s[_RRD, i])
    s[_ERD, i] += share * (other * down - s[_ERD, i])


@njit(cache=True)
def _angles(s, c, above, i, dt):  # type: ignore[no-untyped-def]
    """Advance the evidence against the angle of joint i: its sign, and the exchange with the joint above."""
    phi = s[_PHI_2, i]
    own, energy = _misfit(s[_EE, i], s[_RR, i], s[_ER, i], BELIEVED[0], BELIEVED[1])
    _mark_pushed(s, _PUSHED, i, s[_EM, i], s[_RR, i])
    scale = _lever(c, i, s[_CENTRE, i] - phi) / _lever(c, i, phi)
    ee, er = s[_EE, i] * scale * scale, -s[_ER, i] * scale
    left, whole = _misfit(ee, s[_RR, i], er, SUSPECTED[0], SUSPECTED[1])
    mirrored = left / whole if whole > 0.0 else 2.0
    if s[_PUSHED, i] <= 0.0:
        moves = abs(s[_SPEED, i]) > LEAST_RAD_PER_S
        _grow(s, _FLIP, _SURE_SIGN, i, energy, own / energy if energy > 0.0 else 0.0, mirrored, moves, dt)
    else:
        s[_FLIP, i] = 0.0
    k = above[i]
    if k >= 0:
        _exchanged(s, c, i, k, own, energy, dt)


@njit(cache=True)
def _exchanged(s, c, i, k, own, energy, dt):  # type: ignore[no-untyped-def]
    """Advance the evidence that the angles of joints i and k are exchanged: both alone unexplained, both explained."""
    phi = s[_PHI_2, i]
    own_k, energy_k = _misfit(s[_EE, k], s[_RR, k], s[_ER, k], BELIEVED[0], BELIEVED[1])
    scale = _lever(c, i, s[_PHI_2, k]) / _lever(c, i, phi)
    up, up_all = _misfit(s[_EE, i] * scale * scale, s[_RRU, i], s[_ERU, i] * scale, SUSPECTED[0], SUSPECTED[1])
    scale = _lever(c, k, phi) / _lever(c, k, s[_PHI_2, k])
    down, down_all = _misfit(s[_EE, k] * scale * scale, s[_RRD, i], s[_ERD, i] * scale, SUSPECTED[0], SUSPECTED[1])
    _mark_pushed(s, _PAIR_PUSHED, i, s[_EM, i] + s[_EM, k], s[_RR, i] + s[_RR, k])
    same = s[_RR, i] + s[_RRU, i]
    apart = same - 2.0 * s[_RX, i] > APART * same
    if s[_PAIR_PUSHED, i] > 0.0 or not apart or energy + energy_k <= 0.0:
        s[_SWAP, i] = 0.0
        return
    # What has no energy needs no explanation; what has some needs its own.
    floor = 0.25 * LEAST_NM * LEAST_NM
    other = max(up / (up_all + floor), down / (down_all + floor), (up + down) / (up_all + down_all + floor))
    believed = min(own / energy if energy > floor else 2.0, own_k / energy_k if energy_k > floor else 2.0)
    moves = max(abs(s[_SPEED, i]), abs(s[_SPEED, k])) > LEAST_RAD_PER_S
    _grow(s, _SWAP, _SURE_ANGLES, i, energy + energy_k, believed, other, moves, dt)


@njit(cache=True)
def _pressures(s, above, expected, pressure, liquid, i, dt):  # type: ignore[no-untyped-def]
    """Advance the evidence that the pressures of joint i and the one above it are exchanged."""
    k = above[i]
    if k < 0:
        return
    share = dt / (dt + PRESSURE_WINDOW_S)
    as_is = (pressure[i] - expected[i]) ** 2 + (pressure[k] - expected[k]) ** 2
    swapped = (pressure[i] - expected[k]) ** 2 + (pressure[k] - expected[i]) ** 2
    s[_PE, i] += share * (as_is - s[_PE, i])
    s[_PX, i] += share * (swapped - s[_PX, i])
    if s[_SURE_PRESSURES, i] >= ENOUGH_S or liquid:
        s[_PSWAP, i] = 0.0
    elif s[_PX, i] > 2.0 * LEAST_PA * LEAST_PA and s[_PE, i] < 0.5 * EXPLAINED * s[_PX, i]:
        s[_SURE_PRESSURES, i] += dt
    elif s[_PE, i] > 2.0 * LEAST_PA * LEAST_PA and s[_PX, i] < 0.5 * EXPLAINED * s[_PE, i]:
        s[_PSWAP, i] += dt
    else:
        s[_PSWAP, i] = max(s[_PSWAP, i] - dt, 0.0)


@njit(cache=True)
def _allowed(s, c, i, p, dt):  # type: ignore[no-untyped-def]
    """Largest deviation [rad] of joint i from a straight motion over dt [s]: a torque from rest, with damping."""
    phi = s[_LAST, i]
    reach = abs(leverage(phi, c[_A2, i], c[_A3, i])) * abs(p) + abs(c[_A1, i]) * (abs(phi) + 0.5) + PUSH_NM
    fastest, lag = reach / c[_D, i], c[_J, i] / c[_D, i]
    return JUMP_RAD + 2.0 * fastest * (dt - lag * (1.0 - math.exp(-dt / lag)))


@njit(cache=True)
def _jumps(s, c, i, phi, p, dt):  # type: ignore[no-untyped-def]
    """Count the frames for which a jump of joint i has stayed."""
    step = phi - s[_LAST, i] - s[_SPEED, i] * dt
    if s[_JUMP, i] > 0.0:
        stays = abs(phi - s[_TARGET, i]) < 0.5 * abs(s[_SIZE, i])
        s[_JUMP, i] = s[_JUMP, i] + 1.0 if stays else 0.0
    elif abs(step) > _allowed(s, c, i, p, dt):
        s[_JUMP, i], s[_TARGET, i], s[_SIZE, i] = 1.0, phi, step
    s[_LAST, i] = phi


@njit(cache=True)
def _breaks(s, i, phi, dt):  # type: ignore[no-untyped-def]
    """Note whether the motion of joint i breaks: its angle steps, or its speed turns back within a frame."""
    before, now = s[_STEP_SPEED, i], (phi - s[_LAST, i]) / dt
    s[_STEP_SPEED, i] = now
    s[_PREDICTED, i] = s[_LAST, i] + before * dt
    s[_PAUSE, i] = max(s[_PAUSE, i] - dt, 0.0)
    surprise = abs(now - before) * dt
    s[_NOISE, i] += dt / (dt + NOISE_S) * (min(surprise, STEP_RAD) - s[_NOISE, i])
    turns = abs(before) > REVERSED_RAD_PER_S and before * now < -REVERSED * before * before
    turns = turns and surprise > _least_step(s, i)  # in a short frame the noise alone turns a speed back
    if turns:
        _be_careful(s, i)
    s[_BROKE, i] = 2.0 if turns else 1.0 if surprise > _least_step(s, i) + STEP * abs(before) * dt else 0.0


@njit(cache=True)
def _least_step(s, i):  # type: ignore[no-untyped-def]
    """Step [rad] of joint i within a frame that its noise does not make."""
    return min(max(NOISES * s[_NOISE, i], LEAST_STEP_RAD), STEP_RAD)


@njit(cache=True)
def _be_careful(s, i):  # type: ignore[no-untyped-def]
    """Hold the set-point of joint i, then let it rise slowly."""
    s[_PAUSE, i], s[_CAUTION, i] = PAUSE_S, max(s[_CAUTION, i], CAUTION_S)


@njit(cache=True)
def _begin_again(s, i, phi, p):  # type: ignore[no-untyped-def]
    """Forget the motion of joint i before now."""
    _be_careful(s, i)
    s[_PHI_1, i] = s[_PHI_2, i] = s[_PHI_BASE, i] = phi
    s[_P_1, i] = s[_P_2, i] = s[_P_BASE, i] = p
    for row in range(_EE, _EM + 1):
        s[row, i] = 0.0


@njit(cache=True)
def _suspect(s, c, above, position, drive, i, dt):  # type: ignore[no-untyped-def]
    """After a break that is one of a changed sign or of an exchange, forget the older motion; nothing is sure."""
    if s[_BROKE, i] == 0.0:
        return
    least, speed = _least_step(s, i), abs(s[_STEP_SPEED, i]) * dt
    stepped = abs(position[i] - s[_PREDICTED, i]) > 2.0 * least + speed
    near = least + (MIRRORED if stepped else MATCH) * speed
    if (stepped or s[_BROKE, i] > 1.0) and abs(position[i] - (c[_MIRROR, i] - s[_PREDICTED, i])) < near:
        s[_SURE_SIGN, i] = s[_FLIP, i] = 0.0
        s[_PUSHED, i], s[_CENTRE, i] = -1.0, c[_MIRROR, i]
        _begin_again(s, i, position[i], drive[i])
    near = least + MATCH * speed
    k = above[i]
    if k < 0 or s[_BROKE, k] == 0.0 or not stepped:
        return
    near = 2.0 * near + _least_step(s, k) + MATCH * abs(s[_STEP_SPEED, k]) * dt
    if abs(position[i] - s[_PREDICTED, k]) < near and abs(position[k] - s[_PREDICTED, i]) < near:
        s[_SURE_ANGLES, i] = s[_SWAP, i] = 0.0
        s[_PAIR_PUSHED, i] = -1.0
        _begin_again(s, i, position[i], drive[i])
        _begin_again(s, k, position[k], drive[k])


@njit(cache=True)
def _pressure_breaks(s, above, pressure, i):  # type: ignore[no-untyped-def]
    """After a step of the pressure of joint i, or of the one above it, nothing is sure of their exchange."""
    k = above[i]
    if k >= 0 and max(abs(pressure[i] - s[_P_LAST, i]), abs(pressure[k] - s[_P_LAST, k])) > STEP_PA:
        s[_SURE_PRESSURES, i] = 0.0


@njit(cache=True)
def _grows_sure(s, c, i, dt):  # type: ignore[no-untyped-def]
    """Count down the caution for joint i; it ends where the joint has followed its pressure."""
    s[_CAUTION, i] = max(s[_CAUTION, i] - dt, 0.0)
    moved, pressed = s[_PHI_2, i] - s[_FROM_PHI, i], s[_P_2, i] - s[_FROM_P, i]
    driven = _lever(c, i, s[_PHI_2, i]) * pressed
    if s[_CAUTION, i] > CAUTION_S and abs(moved) > CONFIRMED_RAD and abs(driven) > LEAST_NM and moved * driven > 0.0:
        s[_CAUTION, i] = 0.0


@njit(cache=True)
def _repeats(s, i, phi):  # type: ignore[no-untyped-def]
    """Count bit-identical angles of joint i; how many there are in a row while the joint should move."""
    if phi != s[_LAST, i]:
        s[_RUN, i], s[_RUN_SPEED, i] = 0.0, s[_SPEED, i]
        return 0.0
    s[_RUN, i] += 1.0
    return s[_RUN, i] if abs(s[_RUN_SPEED, i]) > FROZEN_RAD_PER_S else 0.0


@njit(cache=True)
def _check(s, c, partner, above_angle, above_pressure, position, pressure, expected, drive, liquid, dt):  # type: ignore[no-untyped-def]
    """Verdict, joint and other joint of a frame."""
    n, frozen = len(position), -1
    for i in range(n):
        run = _repeats(s, i, position[i])
        s[_HOLDS, i] = 1.0 if run >= HELD_FRAMES else 0.0
        if run >= FROZEN_FRAMES:
            frozen = i
        _breaks(s, i, position[i], dt)
        _jumps(s, c, i, position[i], pressure[i], dt)
        if s[_JUMP, i] == 0.0:
            _observe(s, i, position[i], drive[i], dt)
        _grows_sure(s, c, i, dt)
    for i in range(n):
        _suspect(s, c, above_angle, position, drive, i, dt)
        _pressure_breaks(s, above_pressure, pressure, i)
    for i in range(n):
        s[_P_LAST, i] = pressure[i]
        _sums(s, c, partner, above_angle, i, dt)
    for i in range(n):
        _angles(s, c, above_angle, i, dt)
        _pressures(s, above_pressure, expected, pressure, liquid, i, dt)
    if frozen >= 0:
        return FROZEN, frozen, -1
    for i in range(n):
        if s[_PSWAP, i] > ENOUGH_S:
            return PRESSURES_SWAPPED, i, above_pressure[i]
        if s[_SWAP, i] > ENOUGH_S:
            return ANGLES_SWAPPED, i, above_angle[i]
        if s[_FLIP, i] > ENOUGH_S:
            return SIGN, i, -1
        if s[_JUMP, i] >= JUMP_FRAMES:
            return JUMPED, i, -1
        beyond = position[i] < c[_LOW, i] - c[_BEYOND, i] or position[i] > c[_HIGH, i] + 2.0 * c[_BEYOND, i]
        s[_OUTSIDE, i] = s[_OUTSIDE, i] + dt if beyond else 0.0
        if s[_OUTSIDE, i] > BEYOND_S:
            return BEYOND, i, -1
    return FINE, 0, -1


@njit(cache=True)
def _hold(s, above_angle, command, dt):  # type: ignore[no-untyped-def]
    """Limit the set-points of joints under suspicion to the last ones from before, and slow their rise, in place."""
    n = len(command)
    for i in range(n):
        k = above_angle[i]
        if s[_SWAP, i] > 0.0 and k >= 0:
            s[_HOLDS, i] = s[_HOLDS, k] = 1.0
        if s[_FLIP, i] + s[_JUMP, i] + s[_PSWAP, i] + s[_PAUSE, i] > 0.0:
            s[_HOLDS, i] = 1.0
    for i in range(n):
        if s[_HOLDS, i] > 0.0:
            command[i] = min(command[i], s[_BELIEVED_PA, i])
            continue
        if s[_CAUTION, i] > 0.0:
            # The pressure that the joint has already may stay.
            command[i] = min(command[i], max(s[_BELIEVED_PA, i] + CAUTION_PA_PER_S * dt, s[_P_LAST, i]))
        s[_BELIEVED_PA, i] = command[i]


class SensorWatch:
    """Compares angles and pressures of one hand with its motion, frame by frame."""

    def __init__(self, hand: Hand) -> None:
        """Begin without evidence; `start` gives the first measurement."""
        sensors = hand.sensors
        self._joints = hand.joints
        self._partner = hand.partner
        pressed = STOP_NM / hand.row("end_stop.stiffness_nm_per_rad") + hand.row("end_stop.engagement_deg")
        rows = [*(hand.row(key) for key in _KEYS), 2.0 * sensors.hall.zero_rad, pressed + BEYOND_RAD]
        self._constants = np.array(rows)
        self._above_angle = _next(sensors.angle_channel)
        self._above_pressure = _next(sensors.pressure_channel)
        self._channels = (sensors.angle_channel, sensors.pressure_channel)
        self._state = np.zeros((_ROWS, len(hand.joints)))
        self._period_s = 1.0 / hand.rate_hz
        self._elapsed_s = 0.0
        self._liquid = bool(hand.row("hydraulic.share").max() > 0.0)
        self._a0 = hand.row("statics.a0_nm")

    def start(self, position: Array, pressure: Array) -> None:
        """Begin without evidence at position (n,) [rad] and pressure (n,) [Pa]."""
        self._state[:] = 0.0
        self._restart(position, pressure)
        self._state[_FROM_PHI], self._state[_FROM_P] = position, pressure
        c = self._constants
        left, mirrored, negated = (
            np.abs(torque(pressure, angle, 0.0, self._a0, c[_A1], c[_A2], c[_A3], 0.0))
            for angle in (position, c[_MIRROR] - position, -position)
        )
        self._state[_CAUTION] = np.where(left > POSE_NM, math.inf, 0.0)
        self._state[_CENTRE] = np.where(mirrored < negated, c[_MIRROR], 0.0)
        self._state[_BELIEVED_PA] = pressure
        self._state[_SURE_ANGLES] = ENOUGH_S
        self._state[_SURE_SIGN] = np.where(self._state[_CAUTION] > 0.0, 0.0, ENOUGH_S)

    def _restart(self, position: Array, pressure: Array) -> None:
        """Start the filters at rest; what was found is kept."""
        s = self._state
        s[[_PHI_1, _PHI_2, _PHI_BASE, _LAST]] = position
        s[[_P_1, _P_2, _P_BASE, _P_LAST]] = pressure
        s[_SPEED : _PX + 1] = 0.0
        s[[_JUMP, _RUN, _RUN_SPEED, _STEP_SPEED, _PAUSE]] = 0.0

    def check(
        self, position: Array, pressure: Array, expected: Array, driven: Array, elapsed_s: float
    ) -> Contradiction | None:
        """What contradicts the motion, elapsed_s [s] after the last frame; None where nothing does.

        position (n,) [rad], pressure (n,) [Pa]: measured, finite.  expected: (n,) [Pa], of set-points and motion.
        driven: (n,) [Pa], of the set-points alone; it counts where a liquid lets the motion itself change the pressure.
        """
        drive = driven if self._liquid else pressure
        self._elapsed_s = min(max(elapsed_s, 0.0), 3.0 * self._period_s)
        if elapsed_s > max(3.0 * self._period_s, 0.02):
            self._restart(position, drive)
            return None
        if elapsed_s <= 0.0:
            return None
        channels = (self._partner, self._above_angle, self._above_pressure)
        verdict, joint, other = _check(
            self._state, self._constants, *channels, position, pressure, expected, drive, self._liquid, elapsed_s
        )
        if verdict == FINE:
            return None
        return Contradiction(verdict, joint, other, float(self._state[_SIZE, joint]))

    def hold(self, command: Array) -> None:
        """Limit set-points (n,) [Pa] in place: none above the last one from before the present evidence."""
        _hold(self._state, self._above_angle, command, self._elapsed_s)

    def line(self, found: Contradiction) -> str:
        """What was found: joints, channels, evidence and what to check."""
        joint, other = self._joints[found.joint], self._joints[found.other]
        angle, pressure = (int(channel[found.joint]) for channel in self._channels)
        if found.verdict == JUMPED:
            return (
                f"{joint}: its angle (channel {angle}) jumped by {math.degrees(abs(found.size)):.0f} degrees, which no"
                " torque explains; check the sensor, its cable and its polarity"
            )
        if found.verdict == BEYOND:
            return (
                f"{joint}: its angle (channel {angle}) is beyond the end stop; check the polarity of the sensor and the"
                " calibration of the channel"
            )
        if found.verdict == FROZEN:
            return (
                f"{joint}: its angle (channel {angle}) stands still to the last bit while the joint moves; check the"
                " sensor, its cable and the converter"
            )
        if found.verdict == SIGN:
            return (
                f"{joint}: its angle (channel {angle}) falls where the pressure bends the joint; check the polarity of"
                " the sensor and the calibration of the channel"
            )
        if found.verdict == ANGLES_SWAPPED:
            return (
                f"{joint} and {other}: each angle (channels {angle} and {int(self._channels[0][found.other])}) follows"
                " the pressure of the other joint; check whether the sensors are exchanged"
            )
        return (
            f"{joint} and {other}: each pressure (channels {pressure} and {int(self._channels[1][found.other])})"
            " follows the set-point of the other joint; check whether sensors or tubes are exchanged"
        )


def _next(channel: NDArray[np.int64]) -> NDArray[np.int64]:
    """The joint whose channel follows that of each joint, -1 where there is none; (joints,)."""
    of = {int(c): j for j, c in enumerate(channel)}
    return np.array([of.get(int(c) + 1, -1) for c in channel], dtype=np.int64)
