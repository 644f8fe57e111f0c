"""Operators that several effects share: sine and cosine, first-order lags, loops of friction and hysteresis.

All are functions of scalars without branches, so that a compiler vectorises them over lanes.
"""

from __future__ import annotations

import math

from hand_model.kernel.inline import inline

_TURNS_PER_RAD = 0.5 / math.pi
_TURN_HIGH, _TURN_LOW = 6.28125, 2.0 * math.pi - 6.28125
_ROUND = 6755399441055744.0  # 1.5 * 2**52: adding and subtracting it rounds to the nearest integer
_SINE = (0.499999988, -2.08333095e-2, 2.60403119e-4, -1.54694512e-6, 5.05954689e-9)
"""Odd coefficients of sin(z/2) for |z| <= pi, to 4e-9."""
_COSINE = (-0.124999831, 2.60399934e-3, -2.16498859e-5, 9.06030522e-8)
"""Even ones of cos(z/2), from z^2 on, to 6e-8."""
STEEP_PER_RAD_S = 1e6
"""Slope at standstill of the direction of motion over the speed [s/rad]; it replaces the jump of the sign function."""
ROOT = 0.02
"""Least difference of the poles of a second-order lag over their mean [-]: nearer ones lose digits of `decay`."""


@inline
def sine_cosine(x):  # type: ignore[no-untyped-def]
    """Sine and cosine of x [rad] to 3e-7 within 1e6 rad, finite for every finite x.

    The angle is reduced to half a turn. Polynomials of it with the least greatest error give sine and cosine of its
    half, which are doubled: sin 2y = 2 sin y cos y.
    """
    turns = (x * _TURNS_PER_RAD + _ROUND) - _ROUND
    z = min(max((x - turns * _TURN_HIGH) - turns * _TURN_LOW, -4.0), 4.0)
    q = z * z
    s = z * (_SINE[0] + q * (_SINE[1] + q * (_SINE[2] + q * (_SINE[3] + q * _SINE[4]))))
    c = 1.0 + q * (_COSINE[0] + q * (_COSINE[1] + q * (_COSINE[2] + q * _COSINE[3])))
    return 2.0 * s * c, 1.0 - 2.0 * s * s


@inline
def decay(x):  # type: ignore[no-untyped-def]
    """exp(-x) for x >= 0 to 3e-6: the fifth-order series of an eighth of x, to the eighth power."""
    y = 0.125 * x
    root = 1.0 / (1.0 + y * (1.0 + y * (0.5 + y * (1 / 6 + y * (1 / 24 + y * (1 / 120))))))
    square = root * root
    return (square * square) * (square * square)


@inline
def knot(weight, away, value, rise):  # type: ignore[no-untyped-def]
    """A linear spline's value and its slope per knot with one more knot of this weight, `away` knots below the place.

    The slope is that between the two knots around the place.
    """
    near = 1.0 if abs(away) < 1.0 else 0.0
    toward = near if away < 0.0 else -near
    return value + weight * max(1.0 - abs(away), 0.0), rise + weight * toward


@inline
def lag_constants(tau, h):  # type: ignore[no-untyped-def]
    """Constants (kept, slowness) of a first-order lag of time constant tau [s] over a step of h [s].

    kept is exp(-h / tau), the share of a deviation that is left after the step: exactly 0 where tau is 0, and it tends
    to 0 with tau. slowness is tau / h; loops compute the reciprocal of their step once.
    """
    kept = 0.0 if tau <= 0.0 else decay(h / tau)
    return kept, tau * (1.0 / h)


@inline
def second_order_constants(tau, inertia, h):  # type: ignore[no-untyped-def]
    """Constants (even, odd, slowness) of mu tau^2 d'' + tau d' + d = 0 over h [s]; mu, the inertia, is >= 0 [-].

    With w = tau d', d becomes (even + odd) d + 2 mu odd w and w becomes (even - odd) w - 2 odd d: the exact solution,
    with real poles up to mu = 1/4. Without inertia it is that of `lag_constants`, and even = odd = kept / 2.
    Around mu = 1/4, where both poles are equal, the poles of a mu 1e-4 away are used.
    """
    steps = h / tau if tau > 0.0 else 1e12
    root = math.sqrt(max(abs(1.0 - 4.0 * inertia), ROOT * ROOT))
    slow, fast = decay(steps * (2.0 / (1.0 + root))), decay(steps * (2.0 / max(1.0 - root, 1e-12)))
    turn = min(steps * (2.0 / (1.0 + root * root)), 1e3)
    left = decay(turn)
    sine, cosine = sine_cosine(turn * root)
    real = inertia <= 0.25
    even = 0.5 * (slow + fast) if real else left * cosine
    odd = 0.5 * (slow - fast) / root if real else left * sine / root
    return even, odd, tau * (1.0 / h)


@inline
def lagged(y, before, now, kept, slowness):  # type: ignore[no-untyped-def]
    """Output of a first-order lag after a step in which its input went straight from before to now.

    The exact solution of tau dy/dt = x - y for an input x linear in time. With tau = 0 it is `now`, bit for bit.
    """
    behind = slowness * (now - before)
    return now - behind + (y - before + behind) * kept


@inline
def two_lag_constants(tau, share, h):  # type: ignore[no-untyped-def]
    """Constants of two lags in series whose time constants sum to tau [s]; the second has the given share of it."""
    second = share * tau
    kept_1, slowness_1 = lag_constants(tau - second, h)
    kept_2, slowness_2 = lag_constants(second, h)
    return kept_1, slowness_1, kept_2, slowness_2


@inline
def lagged_twice(m, now, constants):  # type: ignore[no-untyped-def]
    """Memory (last input, output of the first lag, output of both) of two lags in series after a step."""
    before, between, last = m
    kept_1, slowness_1, kept_2, slowness_2 = constants
    first = lagged(between, before, now, kept_1, slowness_1)
    return now, first, lagged(last, between, first, kept_2, slowness_2)


@inline
def direction(omega):  # type: ignore[no-untyped-def]
    """Direction of motion, -1 ... 1, continuous in the speed [rad/s]."""
    return min(max(omega * STEEP_PER_RAD_S, -1.0), 1.0)


@inline
def drive_torque(phi, omega, p, numbers):  # type: ignore[no-untyped-def]
    """Torque [N m] that a drive is asked for at the input p [Pa], and its slope over the angle [N m/rad].

    numbers: scale of the drive [-], its torque per input and the change of that with the angle [N m/Pa, N m/(Pa rad)],
    stiffness [N m/rad] and damping [N m s/rad] of a controller, 0 where the input is a torque.
    """
    scale, per_pa, per_pa_rad, stiffness, damper = numbers
    asked = scale * ((per_pa + per_pa_rad * phi) * p - stiffness * phi - damper * omega)
    return asked, scale * (per_pa_rad * p - stiffness)


@inline
def loop_growth(z, toward, sharp):  # type: ignore[no-untyped-def]
    """Growth of a loop state z (-1 ... 1) per motion over its scale, dz/dx = scale^-1 loop_growth.

    sharp 0: Dahl's, 1 - z sgn(dx). sharp 1: Bouc's and Wen's with exponent 2, 1 - z^2 while loading, 1 while unloading.
    """
    a = z * toward
    forward = max(a, 0.0)
    return 1.0 - (1.0 - sharp) * a - sharp * forward * forward


@inline
def loop_torque(z, omega, per_scale, sharp):  # type: ignore[no-untyped-def]
    """Torque of a loop as a share of its height (against the motion so far), and its stiffness [1/rad]."""
    return -z, loop_growth(z, direction(omega), sharp) * per_scale


@inline
def loop_moved(z, before, after, per_scale, sharp):  # type: ignore[no-untyped-def]
    """Loop state after a motion [rad] from before to after.

    An exponential step of second order, linearised, with (1 - exp(-x)) / x as (1 + x/2) / (1 + x + x^2/2): no motion is
    too long for it.
    """
    way = abs(after - before) * per_scale
    toward = 1.0 if after > before else -1.0
    a = z * toward
    x = way * ((1.0 - sharp) + 2.0 * sharp * max(a, 0.0))
    half = 1.0 + 0.5 * x
    return toward * min(a + way * loop_growth(z, toward, sharp) * half / (1.0 + x * half), 1.0)
