"""Recordings of a finger of two rigid links, by equations and an integrator that share nothing with the kernel."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.geometry import geometry_of
from hand_model.kernel.rows import ROW
from hand_recording.signals import Signals

FINGER = ("index_proximal", "index_distal")
PERIOD_S = 0.005
ANGLE_NOISE_RAD, PRESSURE_NOISE_PA = np.radians(0.03), 150.0
STATICS = ("statics.a0_nm", "statics.a1_nm_per_rad", "statics.a2_nm_per_pa", "statics.a3_nm_per_pa_rad")
CREEP = ("p_min_pa", "b1_per_pa", "b0_per_pa", "extension_time_s", "recovery_time_s", "phi_max_deg")
OFF = (*STATICS, "dynamics.viscous_friction_nm_s_per_rad", "valve.time_constant_s", "material.b1_per_pa")


class Load(Protocol):
    """A torque against flexion of the distal joint."""

    def torque(self, angle: float, speed: float) -> float:
        """Torque [N m] at an angle [rad] and a speed [rad/s]."""


class SmoothFriction:
    """Friction that builds up over the speed alone, as in simulators: a level [N m] times tanh of speed / scale."""

    def __init__(self, level: float, speed: float) -> None:
        """level [N m], speed [rad/s]."""
        self.level, self.speed = level, speed

    def torque(self, angle: float, speed: float) -> float:
        """Torque [N m] against the motion."""
        return float(self.level * np.tanh(speed / self.speed))


class Stop:
    """A one-sided spring [N m/rad] and damper [N m s/rad] from an angle [rad] on, in the way of the distal joint."""

    def __init__(self, angle: float, stiffness: float, damping: float) -> None:
        """angle [rad], stiffness [N m/rad], damping [N m s/rad]."""
        self.angle, self.stiffness, self.damping = angle, stiffness, damping

    def torque(self, angle: float, speed: float) -> float:
        """Torque [N m] against flexion; it never pulls."""
        depth = angle - self.angle
        return max(self.stiffness * depth + self.damping * speed, 0.0) if depth > 0.0 else 0.0


def waves(rng: np.random.Generator, seconds: float) -> Array:
    """Set-points (T, 2) [Pa]: eight sines for each joint."""
    time = np.arange(round(seconds / PERIOD_S)) * PERIOD_S
    out = np.empty((len(time), 2))
    for k in range(2):
        sines = [8e4 * np.sin(2 * np.pi * f * time + rng.uniform(0, 6)) for f in np.geomspace(0.1, 4, 8)]
        out[:, k] = np.clip(2.2e5 + np.sum(sines, axis=0), 0, 4.5e5)
    return out


def finger(hand: Hand, rng: np.random.Generator, off: float) -> dict[str, Array]:
    """Numbers of the index finger's joints by key, (2,) SI, those of OFF wrong by a relative share `off`."""
    columns = [hand.joints.index(name) for name in FINGER]
    numbers = {key: hand.parameters[row, columns].copy() for key, row in ROW.items()}
    for key in OFF:
        numbers[key] *= 1.0 + off * np.clip(rng.standard_normal(2), -2.0, 2.0)
    return numbers


def changing_inertia(hand: Hand) -> float:
    """h of the mass matrix of the index finger [kg m^2]: mass of the distal link x length x distance of its centre."""
    links = {link.joint: link for link in geometry_of(hand).links}
    proximal, distal = (links[hand.joints.index(name)] for name in FINGER)
    return float(distal.mass_kg * proximal.size_m[0] * distal.center_m[0])


def run(numbers: dict[str, Array], u: Array, h: float, load: Load | None = None, fine: int = 4) -> tuple[Array, Array]:
    """Pressures [Pa] and angles [rad], (T, 2), under set-points u (T, 2) [Pa], by Runge and Kutta's fourth order.

    h: the part of the inertia that changes with the cosine of the distal angle [kg m^2]; 0: constant inertia.  fine:
    integration steps of a sample.
    """
    a0, a1, a2, a3 = (numbers[key] for key in STATICS)
    p_min, b1, b0, extending, recovering, reach = (numbers[f"material.{key}"] for key in CREEP)
    inertia, shared = numbers["dynamics.inertia_kg_m2"], numbers["dynamics.coupling_inertia_kg_m2"][0]
    drag, lag = numbers["dynamics.viscous_friction_nm_s_per_rad"], numbers["valve.time_constant_s"]
    step, middle = PERIOD_S / fine, np.cos(np.radians(45.0))

    def rate(s: Array, set_point: Array) -> Array:
        p, creep, x, w = s[0:2], s[2:4], s[4:6], s[6:8]
        creeping = np.maximum(0.0, (b1 * (p - p_min) - creep) / extending)
        creeping += np.minimum(0.0, (b0 * p - creep) / recovering)
        torque = a0 + a1 * (x - creep * reach) + (a2 + a3 * x) * p - drag * w
        bend, sine = h * (np.cos(x[1]) - middle), h * np.sin(x[1])
        torque[0] += sine * (2.0 * w[0] * w[1] + w[1] ** 2)
        torque[1] -= sine * w[0] ** 2 + (load.torque(x[1], w[1]) if load else 0.0)
        j_p, j_c, j_d = inertia[0] + 2.0 * bend, shared + bend, inertia[1]
        whole = j_p * j_d - j_c * j_c
        turned = np.array([j_d * torque[0] - j_c * torque[1], j_p * torque[1] - j_c * torque[0]]) / whole
        return np.concatenate([(set_point - p) / lag, creeping, w, turned])

    late = np.rint(numbers["valve.dead_time_s"] / step).astype(int)
    held = np.repeat(u, fine, axis=0)
    delayed = np.stack([np.r_[np.full(n, c[0]), c[: len(c) - n]] for n, c in zip(late, held.T, strict=True)], axis=1)
    state = np.concatenate([np.zeros(4), -a0 / a1, np.zeros(2)])
    out = np.empty((len(u), 8))
    for k, set_point in enumerate(delayed):
        if k % fine == 0:
            out[k // fine] = state
        k1 = rate(state, set_point)
        k2 = rate(state + 0.5 * step * k1, set_point)
        k3 = rate(state + 0.5 * step * k2, set_point)
        state = state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rate(state + step * k3, set_point))
    return out[:, 0:2], out[:, 4:6]


def recorded(u: Array, p: Array, x: Array, rng: np.random.Generator) -> Signals:
    """The recording that noisy sensors make of both joints; u, p [Pa] and x [rad], (T, 2) each."""
    yes = np.ones(2, dtype=bool)
    return Signals(
        name="links",
        joints=FINGER,
        period_s=PERIOD_S,
        set_point_pa=u,
        pressure_pa=p + PRESSURE_NOISE_PA * rng.standard_normal(u.shape),
        angle_rad=x + ANGLE_NOISE_RAD * rng.standard_normal(u.shape),
        force_n=np.full(u.shape, np.nan),
        known=np.ones(u.shape, dtype=bool),
        has_set_point=yes,
        has_pressure=yes,
    )
