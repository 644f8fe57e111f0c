"""The shaped reference: motions and torques within their limits, whatever is commanded.

Angle. A critically damped second-order filter with bandwidth w [rad/s] on target and target speed makes a motion that
the valve can follow of a step; a smooth trajectory passes without lag:

    v' = 2 w (target' + c(target - r) - v),   r' = v,   c(e) = w e / 2, at most sqrt(A |e|)

within |v'| <= A, |v| <= V and the limits of the joint. The speed at the end of each step is bounded such that the
reference can still stop within the joint's limits at the acceleration A:

    r + (v + u) h / 2 + u^2 / (2 A) <= high   with u the speed at the end of a step of h

Where no such u exists, the reference brakes to a stop within the step. This holds for every sequence of steps, also
where the next one has another length. Where A or V is lowered in motion, the limits of the joint have priority.

Torque. In torque mode the target approaches the commanded torque at a bounded rate. In position mode the torque limit
rises at this rate, and falls at once.
"""

from __future__ import annotations

import math

import numpy as np

from hand_control.declared import Settings, U, bounded_dt
from hand_model.arrays import Array
from hand_model.compile_cache import njit
from hand_model.statics import leverage

SUBSTEP = 0.1
"""Largest share of the filter's time constant 1/w that one explicit step takes: well inside stability."""


@njit(cache=True, error_model="numpy")
def _below(r, v, u, high, most, h):  # type: ignore[no-untyped-def]
    """Angle and speed after a step of h [s] from (r, v) towards speed u, from which a stop below `high` is possible."""
    root = most * h * most * h + 4.0 * most * (2.0 * (high - r) - v * h)
    fastest = 0.5 * (np.sqrt(root) - most * h) if root >= 0.0 else -1.0
    if u <= max(fastest, 0.0):
        return r + 0.5 * (v + u) * h, u
    if fastest >= 0.0:
        return r + 0.5 * (v + fastest) * h, fastest
    # Brake within the step; harder than `most` only where that limit was lowered in motion.
    left = high - r
    if left <= 0.0 or v <= 0.0:
        return high, 0.0
    brake = max(most, 0.5 * v * v / left)
    time = min(h, v / brake)
    return r + (v - 0.5 * brake * time) * time, max(v - brake * time, 0.0)


@njit(cache=True, error_model="numpy")
def _shape(rows, target, target_speed, low, high, bandwidth, max_speed, flexing, most, dt):  # type: ignore[no-untyped-def]
    if dt <= 0.0:
        rows[U.acceleration] = 0.0
        return
    steps = max(1, int(np.ceil(bandwidth * dt / SUBSTEP)))
    h = dt / steps
    for i in range(rows.shape[1]):
        r, v = rows[U.reference, i], rows[U.speed, i]
        before = v
        goal = min(max(target[i], low[i]), high[i]) if math.isfinite(target[i]) else r
        goal_speed = target_speed[i] if math.isfinite(target_speed[i]) else 0.0
        top = min(flexing[i], max_speed)
        goal_speed = min(max(goal_speed, -max_speed), top)
        for _ in range(steps):
            error = goal - r
            closing = min(0.5 * bandwidth * abs(error), np.sqrt(most * abs(error)))
            wanted = goal_speed + (closing if error > 0.0 else -closing)
            a = min(max(2.0 * bandwidth * (wanted - v), -most), most)
            u = min(max(v + a * h, -max(max_speed, -v - most * h)), max(top, v - most * h))
            if u > 0.0:
                r, v = _below(r, v, u, high[i], most, h)
            else:
                r, v = _below(-r, -v, -u, -low[i], most, h)
                r, v = -r, -v
            r = min(max(r, low[i]), high[i])
        rows[U.reference, i], rows[U.speed, i] = r, v
        rows[U.acceleration, i] = (v - before) / dt


def approach_speed(inertia: Array, torque_nm: Array, settings: Settings) -> Array:
    """Largest speed (n,) [rad/s] at which the first impact stays below torque_nm (n,) [N m].

    A joint of inertia J (n,) [kg m^2] that meets a spring k at the speed v is stopped by the torque v sqrt(J k): its
    kinetic energy J v^2 / 2 becomes that of the spring. The actuator's own torque comes later, through the valve.
    """
    impedance = np.sqrt(inertia * settings.contact_stiffness_nm_per_rad)
    fastest = np.full(len(inertia), np.inf)
    np.divide(np.maximum(torque_nm, 0.0), impedance, out=fastest, where=impedance > 0.0)
    return fastest


def filling_speed(statics: tuple[Array, Array, Array, Array], angle: Array, rate_pa_per_s: float) -> Array:
    """Speed (n,) [rad/s] at which the pressure that holds an angle (n,) [rad] rises by rate_pa_per_s.

    statics: a0 ... a3 of Eq. 6, (n,) each; the pressure is -(a0 + a1 phi) / (a2 + a3 phi).
    """
    a0, a1, a2, a3 = statics
    lever = leverage.py_func(angle, a2, a3)
    return np.asarray(rate_pa_per_s * lever * lever / np.maximum(a0 * a3 - a1 * a2, 1e-12), dtype=np.float64)


class Shaper:
    """The shaped reference r [rad], its speed v [rad/s] and acceleration a [rad/s^2], (n,) each."""

    def __init__(self, joints: int, inputs: Array | None = None, limits: tuple[Array, Array] | None = None) -> None:
        """Begin at 0; latch before use.

        inputs: the array (rows, n) of the law whose first rows it fills.  limits: low and high (n,) [rad].
        """
        self._rows = np.zeros((3, joints)) if inputs is None else inputs
        self.r, self.v, self.a = (self._rows[row] for row in (U.reference, U.speed, U.acceleration))
        low, high = (np.full(joints, -np.inf), np.full(joints, np.inf)) if limits is None else limits
        self._free = np.full(joints, np.inf)
        self._low, self._high = np.array(low, dtype=np.float64), np.array(high, dtype=np.float64)

    def latch(self, position: Array) -> None:
        """Stand still at position (n,) [rad] or the nearest limit."""
        self.r[:] = np.clip(position, self._low, self._high)
        self.v[:] = self.a[:] = 0.0

    def step(
        self, target: Array, target_speed: Array, settings: Settings, dt: float, flexing: Array | None = None
    ) -> None:
        """Follow target (n,) [rad] and its speed (n,) [rad/s] for dt [s], bounded as in the law.

        A target or speed that is not finite counts as the present reference at rest.  flexing: a further bound
        on the positive speeds (n,) [rad/s], as of `approach_speed`.
        """
        max_speed = math.radians(settings.max_speed_deg_per_s)
        flexing = self._free if flexing is None else flexing
        most = math.radians(settings.max_acceleration_deg_per_s2)
        bandwidth = settings.reference_bandwidth_rad_per_s
        bounds = self._low, self._high, bandwidth, max_speed, flexing, most
        _shape(self._rows, target, target_speed, *bounds, bounded_dt(dt))

    def stopping_point(self, settings: Settings) -> Array:
        """Angles (n,) [rad] at which the reference comes to rest without turning back."""
        most = math.radians(settings.max_acceleration_deg_per_s2)
        speed = np.abs(self.v)
        distance = np.maximum(speed / settings.reference_bandwidth_rad_per_s, 0.5 * speed * speed / most)
        rest: Array = np.clip(self.r + np.copysign(distance, self.v), self._low, self._high)
        return rest


class TorqueLimiter:
    """The torque that acts now, (n,) [N m]: the limit in position mode, the target in torque mode."""

    def __init__(self, torque_nm: Array) -> None:
        """Begin at torque_nm (n,)."""
        self.now: Array = torque_nm.copy()

    def start(self, torque_nm: Array) -> None:
        """Continue from torque_nm (n,) [N m]; a joint whose value is not finite continues from 0."""
        self.now[:] = np.nan_to_num(torque_nm, nan=0.0, posinf=0.0, neginf=0.0)

    def step(self, wanted_nm: Array, rate_nm_per_s: float, dt: float, torque_mode: bool) -> None:
        """Approach wanted_nm (n,) for dt [s], bounded as in the law. In position mode the torque falls at once."""
        step = rate_nm_per_s * bounded_dt(dt)
        rising = np.minimum(wanted_nm, self.now + step)
        self.now[:] = np.maximum(rising, self.now - step) if torque_mode else rising
