"""Recordings of one joint without a partner whose missing physics has another textbook form than the catalogue's.

The plain equations are those of Martin et al. 2004 (Eqs. 6, 8, 11 and 12), integrated here by explicit steps of 0.25 ms
and without the code of hand_model. Each form acts with one size, which is raised until the recording differs from that
of the plain plant by a chosen number of practical floors.

    python -m validation.other_forms 1

diagnoses one recording of every form, from the seed given, and prints what was found, with the test errors of pressure
and angle over the noise.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from numba import njit

from hand_model.description import Hand
from hand_model.kernel.rows import ROW
from hand_recording.signals import Signals

JOINT, RATE_HZ, SECONDS, FINER = "thumb_opposition", 100.0, 28.0, 40
"""The model of a joint with a partner would expect its motion."""
FLOOR_PA, FLOOR_RAD = 300.0, math.radians(0.05)
NOISE_PA, NOISE_RAD = 150.0, math.radians(0.03)
ATMOSPHERE_PA = 1.0e5

FORMS: dict[str, tuple[int, float, frozenset[str]]] = {
    # number in the loop, size at which the search for the right size begins, effects that name it
    "smooth_dead_zone": (1, 3e3, frozenset({"valve_deadband"})),
    "oscillating_valve": (2, 0.02, frozenset({"valve_lag"})),
    "saturating_flow": (3, 1e-6, frozenset({"valve_flow_limit"})),
    "play_of_spool": (4, 3e3, frozenset({"valve_hysteresis"})),
    "orifice_leak": (5, 1e5, frozenset({"leak"})),
    "turbulent_tube": (6, 3e-4, frozenset({"tube_lag"})),
    "chamber_volume": (7, 1.0, frozenset({"gas_compression"})),
    "kelvin_voigt_creep": (8, 0.05, frozenset({"creep"})),
    "sliding_bristles": (9, 4e-3, frozenset({"coulomb_friction"})),
    "stack_of_plays": (10, 4e-3, frozenset({"hysteresis", "coulomb_friction"})),
    "hertz_obstacle": (11, 0.2, frozenset({"contact", "end_stop"})),
    "softening_with_time": (12, 0.1, frozenset({"thermal_drift", "ageing"})),
    "rubber_band": (13, 0.02, frozenset({"stiffening"})),
    "power_law_drag": (14, 1e-3, frozenset({"viscous_friction"})),
    "cogging": (15, 5e-3, frozenset()),
    "shaken": (16, 5e-3, frozenset()),
    "plain": (0, 0.0, frozenset()),
    "coarse_teeth": (17, 5e-3, frozenset()),
    "returning_spool": (18, 0.03, frozenset({"valve_lag"})),
    "bending_flow": (19, 1e-6, frozenset({"valve_flow_limit"})),
    "gas_with_heat": (20, 0.5, frozenset({"gas_compression"})),
}


@njit(cache=True)
def _simulate(u, q, form, size, dt, finer):  # type: ignore[no-untyped-def]
    """Pressures and angles (T, 2) under set-points u (T,). q: plain numbers in the order of `_numbers`."""
    tau, dead, fill, vent, a0, a1, a2, a3, phi_max, p_min, b1, t_ext, b0, t_rec, inertia, damp, low, high, stop = q
    out = np.empty((len(u), 2))
    h = dt / finer
    delay = round(dead / h)
    # at rest: the angle of zero pressure
    phi = min(max(-a0 / a1, low), high)
    p = pv = w = creep = rate = k1 = k2 = spool = bristle = warmed = 0.0
    pa = 0.0
    plays = np.full(5, phi)
    for k in range(len(u)):
        out[k, 0], out[k, 1] = p, phi
        for n in range(finer):
            at = k * finer + n - delay
            goal = u[max(at, 0) // finer] if at >= 0 else u[0]
            t = (k * finer + n) * h
            if form == 4:
                spool = min(max(spool, goal - size), goal + size)
                goal = spool
            error = goal - p
            if form == 1:
                error = error * error * error / (error * error + size * size)
            if form == 2:  # second order, damping ratio 0.45, in series with the plain valve
                rate += h * ((goal - pv) / (size * size) - 0.9 / size * rate)
                pv += h * rate
                error = pv - p
            if form == 18:  # a coil pulls, a spring returns
                pv += h / (size * (1.0 if goal > pv else 2.5)) * (goal - pv)
                error = pv - p
            flow = error / tau
            if form == 19:  # sharper than a fraction, softer than a corner
                share = abs(flow) * size * (1.0 if flow > 0.0 else 1.4)
                flow /= (1.0 + share**3) ** (1.0 / 3.0)
            if form == 3:
                limit = 1.0 / size
                flow = limit * math.tanh(flow / limit)
            flow = min(max(flow, -vent), fill)
            if form == 5:
                flow -= size * math.sqrt(max(p, 0.0) * (p + ATMOSPHERE_PA)) / ATMOSPHERE_PA
            if form == 7:
                flow -= size * (p + ATMOSPHERE_PA) * 0.3 / (1.0 + 0.3 * phi) * w
            if form == 20:  # adiabatic at first, at the wall's temperature in the end
                volume = 2e-6 + a2 * phi + 0.5 * a3 * phi * phi
                work = size * (p + ATMOSPHERE_PA) * (a2 + a3 * phi) * w / volume
                warmed += h / 0.6 * (work - warmed)
                flow -= work - 0.286 * warmed
            p += h * flow
            if form == 6:
                gap = p - pa
                pa += h / size * math.copysign(math.sqrt(abs(gap) + 1.0) - 1.0, gap) * 30.0
            else:
                pa = p
            ext = max(0.0, (b1 * (pa - p_min) - creep) / t_ext)
            rec = min(0.0, (b0 * pa - creep) / t_rec)
            creep += h * (ext + rec)
            m = a0 + a1 * (phi - creep * phi_max) + (a2 + a3 * phi) * pa - damp * w
            drive = a2 * pa
            if form == 8:
                k1 += h / 0.7 * (size * drive - k1)
                k2 += h / 9.0 * (size * drive - k2)
                m += k1 + k2
            elif form == 9:  # LuGre, Canudas de Wit et al. 1995
                level = size * (1.0 + 0.4 * math.exp(-((w / 0.1) ** 2)))
                stiff = size / math.radians(0.15)
                slide = w - stiff * abs(w) / level * bristle
                bristle += h * slide
                m -= stiff * bristle + 0.02 * math.sqrt(stiff * inertia) * slide
            elif form == 10:  # Prandtl-Ishlinskii
                for j in range(5):
                    half = math.radians(1.0 + 2.5 * j)
                    plays[j] = min(max(plays[j], phi - half), phi + half)
                    m -= size / 5.0 * (phi - plays[j]) / half
            elif form == 11:
                depth = max(phi - math.radians(45.0), 0.0)
                m -= size * depth * math.sqrt(depth)
            elif form == 12:
                m -= a1 * size * (1.0 - math.exp(-t / 12.0)) * phi
            elif form == 13:
                m -= size * math.sinh(1.8 * (phi - 0.3)) / 3.0
            elif form == 14:
                m -= size * math.copysign(math.sqrt(abs(w) + 0.01) - 0.1, w)
            elif form == 15:
                m -= size * math.sin(14.0 * phi)
            elif form == 17:
                m -= size * math.sin(7.0 * phi + 0.5)
            elif form == 16:
                m += size * math.sin(2.0 * math.pi * 1.7 * t)
            m += stop * (max(low - phi, 0.0) - max(phi - high, 0.0))
            w += h * m / inertia
            phi += h * w
    return out


def _numbers(hand: Hand) -> np.ndarray:
    keys = (
        "valve.time_constant_s", "valve.dead_time_s", "valve.fill_rate_pa_per_s", "valve.vent_rate_pa_per_s",
        "statics.a0_nm", "statics.a1_nm_per_rad", "statics.a2_nm_per_pa", "statics.a3_nm_per_pa_rad",
        "material.phi_max_deg", "material.p_min_pa", "material.b1_per_pa", "material.extension_time_s",
        "material.b0_per_pa", "material.recovery_time_s", "dynamics.inertia_kg_m2",
        "dynamics.viscous_friction_nm_s_per_rad", "end_stop.low_deg", "end_stop.high_deg",
        "end_stop.stiffness_nm_per_rad",
    )  # fmt: skip
    return np.array([hand.parameters[ROW[key], hand.joints.index(JOINT)] for key in keys])


def commands_pa(rng: np.random.Generator, seconds: float = SECONDS) -> np.ndarray:
    """Set-points (T,) [Pa]: a staircase, a slow triangle, random steps and a multisine, a quarter each."""
    count = round(seconds * RATE_HZ / 4)
    t = np.arange(count) / RATE_HZ
    stairs = np.repeat(np.r_[np.linspace(0, 4e5, 5), np.linspace(3e5, 0, 4)], count // 9 + 1)[:count]
    triangle = 4e5 * np.abs(2.0 * ((1.5 * t / t[-1] + rng.uniform()) % 1.0) - 1.0)
    steps = np.repeat(rng.uniform(0, 4.2e5, count // 70 + 1), 70)[:count]
    waves = sum(5e4 * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in np.geomspace(0.1, 4, 8))
    return np.concatenate([stairs, triangle, steps, np.clip(2e5 + waves, 0, 4.5e5)])


def difference_floors(one: np.ndarray, other: np.ndarray) -> float:
    """Largest RMS difference of two outputs (T, 2) [practical floors], infinite for one that diverged."""
    square = np.mean((one - other) ** 2, axis=0) / np.array([FLOOR_PA**2, FLOOR_RAD**2])
    return float(np.sqrt(square.max())) if np.isfinite(square).all() else math.inf


def recording(hand: Hand, form: str, floors: float, seed: int) -> tuple[Signals, float]:
    """A recording of the joint with one form, and the size of it, in the form's own unit.

    floors: RMS change of a signal by the form, in practical floors [-].
    """
    rng = np.random.default_rng(seed)
    number, size, _ = FORMS[form]
    u, q = commands_pa(rng), _numbers(hand)
    plain = _simulate(u, q, 0, 0.0, 1.0 / RATE_HZ, FINER)
    out = plain
    if number:
        low, high = math.log(size) - 7.0, math.log(size) + 7.0
        for _ in range(18):
            middle = 0.5 * (low + high)
            out = _simulate(u, q, number, math.exp(middle), 1.0 / RATE_HZ, FINER)
            low, high = (middle, high) if difference_floors(out, plain) < floors else (low, middle)
        size = math.exp(low)
        out = _simulate(u, q, number, size, 1.0 / RATE_HZ, FINER)
    yes = np.ones(1, dtype=bool)
    shape = (len(u), 1)
    signals = Signals(
        name=f"{form}_{seed}",
        joints=(JOINT,),
        period_s=1.0 / RATE_HZ,
        set_point_pa=u[:, None],
        pressure_pa=out[:, :1] + NOISE_PA * rng.standard_normal(shape),
        angle_rad=out[:, 1:] + NOISE_RAD * rng.standard_normal(shape),
        force_n=np.full(shape, np.nan),
        known=np.ones(shape, dtype=bool),
        has_set_point=yes,
        has_pressure=yes,
    )
    return signals, size


def nominal_model(hand: Hand, seed: int, share: float = 0.03) -> Hand:
    """The hand with every number of the plain plant wrong by a few percent, as a nominal model is.

    share: standard deviation of the relative error [-].
    """
    from hand_identification.free_parameters import NOMINAL_KEYS  # noqa: PLC0415 - only for the nominal model

    rng, parameters = np.random.default_rng(seed + 1000), hand.parameters.copy()
    for key in NOMINAL_KEYS:
        parameters[ROW[key]] *= 1.0 + share * rng.standard_normal(len(hand.joints))
    return replace(hand, parameters=parameters)


def main(seed: int, floors: float = 12.0) -> None:
    """Print the verdict, the findings and the remainder of a recording of every form.

    floors: RMS change of a signal by each form, in practical floors [-].
    """
    from hand_diagnosis.diagnosis import diagnose  # noqa: PLC0415 - the recordings need no fit
    from hand_model.description import load_hand  # noqa: PLC0415 - as above

    hand = load_hand(Path(__file__).parents[1] / "config" / "hand.yaml")
    for k, (form, (_, _, right)) in enumerate(FORMS.items()):
        own = seed + 17 * k
        signals, _ = recording(hand, form, floors, own)
        model = nominal_model(hand, own)
        found = diagnose([signals], model, tolerance=0.05, seed=0, joints=[JOINT], sensor_curve=False)
        named = [f"{finding.effect} {finding.probability:.2f}" for finding in found.findings]
        left = [f"remainder {entry.probability:.2f}" for entry in found.remainder]
        test, results = found.joints[0].test, found.joints[0].results
        errors = [] if test is None else [f"{test.rmse(1)[r.stage] / r.noise:.2f}" for r in results]
        print(f"{form} (seed {own}, right: {', '.join(sorted(right)) or 'none'}): {found.verdict}; {named + left};"
              f" test error over the noise: {', '.join(errors)}", flush=True)  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="python -m validation.other_forms",
        description="Diagnose a recording of every form.",
        epilog="Example: python -m validation.other_forms 1 --floors 12",
    )
    parser.add_argument("seed", type=int, help="seed of the first recording")
    parser.add_argument("--floors", type=float, default=12.0, help="RMS change of a signal, in practical floors")
    given = parser.parse_args()
    main(given.seed, given.floors)
