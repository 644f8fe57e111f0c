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
from collections.abc import Sequence
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
def _simulate(u, q, sizes, dt, finer):  # type: ignore[no-untyped-def]
    """Pressures and angles (T, 2) under set-points u (T,). q: plain numbers in the order of `_numbers`.

    sizes: of the forms, by their numbers, 0 for those that are absent.
    """
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
            if sizes[4] > 0.0:
                spool = min(max(spool, goal - sizes[4]), goal + sizes[4])
                goal = spool
            error = goal - p
            if sizes[2] > 0.0:  # second order, damping ratio 0.45, in series with the plain valve
                rate += h * ((goal - pv) / (sizes[2] * sizes[2]) - 0.9 / sizes[2] * rate)
                pv += h * rate
                error = pv - p
            if sizes[18] > 0.0:  # a coil pulls, a spring returns
                pv += h / (sizes[18] * (1.0 if goal > pv else 2.5)) * (goal - pv)
                error = pv - p
            if sizes[1] > 0.0:
                error = error * error * error / (error * error + sizes[1] * sizes[1])
            flow = error / tau
            if sizes[19] > 0.0:  # sharper than a fraction, softer than a corner
                share = abs(flow) * sizes[19] * (1.0 if flow > 0.0 else 1.4)
                flow /= (1.0 + share**3) ** (1.0 / 3.0)
            if sizes[3] > 0.0:
                limit = 1.0 / sizes[3]
                flow = limit * math.tanh(flow / limit)
            flow = min(max(flow, -vent), fill)
            if sizes[5] > 0.0:
                flow -= sizes[5] * math.sqrt(max(p, 0.0) * (p + ATMOSPHERE_PA)) / ATMOSPHERE_PA
            if sizes[7] > 0.0:
                flow -= sizes[7] * (p + ATMOSPHERE_PA) * 0.3 / (1.0 + 0.3 * phi) * w
            if sizes[20] > 0.0:  # adiabatic at first, at the wall's temperature in the end
                volume = 2e-6 + a2 * phi + 0.5 * a3 * phi * phi
                work = sizes[20] * (p + ATMOSPHERE_PA) * (a2 + a3 * phi) * w / volume
                warmed += h / 0.6 * (work - warmed)
                flow -= work - 0.286 * warmed
            p += h * flow
            if sizes[6] > 0.0:
                gap = p - pa
                pa += h / sizes[6] * math.copysign(math.sqrt(abs(gap) + 1.0) - 1.0, gap) * 30.0
            else:
                pa = p
            ext = max(0.0, (b1 * (pa - p_min) - creep) / t_ext)
            rec = min(0.0, (b0 * pa - creep) / t_rec)
            creep += h * (ext + rec)
            m = a0 + a1 * (phi - creep * phi_max) + (a2 + a3 * phi) * pa - damp * w
            drive = a2 * pa
            if sizes[8] > 0.0:
                k1 += h / 0.7 * (sizes[8] * drive - k1)
                k2 += h / 9.0 * (sizes[8] * drive - k2)
                m += k1 + k2
            if sizes[9] > 0.0:  # LuGre, Canudas de Wit et al. 1995
                level = sizes[9] * (1.0 + 0.4 * math.exp(-((w / 0.1) ** 2)))
                stiff = sizes[9] / math.radians(0.15)
                slide = w - stiff * abs(w) / level * bristle
                bristle += h * slide
                m -= stiff * bristle + 0.02 * math.sqrt(stiff * inertia) * slide
            if sizes[10] > 0.0:  # Prandtl-Ishlinskii
                for j in range(5):
                    half = math.radians(1.0 + 2.5 * j)
                    plays[j] = min(max(plays[j], phi - half), phi + half)
                    m -= sizes[10] / 5.0 * (phi - plays[j]) / half
            if sizes[11] > 0.0:
                depth = max(phi - math.radians(45.0), 0.0)
                m -= sizes[11] * depth * math.sqrt(depth)
            if sizes[12] > 0.0:
                m -= a1 * sizes[12] * (1.0 - math.exp(-t / 12.0)) * phi
            if sizes[13] > 0.0:
                m -= sizes[13] * math.sinh(1.8 * (phi - 0.3)) / 3.0
            if sizes[14] > 0.0:
                m -= sizes[14] * math.copysign(math.sqrt(abs(w) + 0.01) - 0.1, w)
            if sizes[15] > 0.0:
                m -= sizes[15] * math.sin(14.0 * phi)
            if sizes[17] > 0.0:
                m -= sizes[17] * math.sin(7.0 * phi + 0.5)
            if sizes[16] > 0.0:
                m += sizes[16] * math.sin(2.0 * math.pi * 1.7 * t)
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


def simulated(u: np.ndarray, q: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Pressures and angles (T, 2) [Pa, rad] under set-points u (T,) [Pa] of the joint with numbers q and forms."""
    return np.asarray(_simulate(u, q, sizes, 1.0 / RATE_HZ, FINER))


def _size_of(form: str, floors: float, u: np.ndarray, q: np.ndarray, plain: np.ndarray) -> float:
    """Size at which a form alone changes a signal by so many practical floors."""
    number, size, _ = FORMS[form]
    if not number:
        return 0.0
    low, high = math.log(size) - 7.0, math.log(size) + 7.0
    sizes = np.zeros(len(FORMS))
    for _ in range(18):
        middle = 0.5 * (low + high)
        sizes[number] = math.exp(middle)
        low, high = (middle, high) if difference_floors(simulated(u, q, sizes), plain) < floors else (low, middle)
    return math.exp(low)


def recording(hand: Hand, forms: str, floors: float, seed: int) -> tuple[Signals, dict[str, float]]:
    """A recording of the joint with one form, or several joined by +, and their sizes, in the forms' own units.

    floors: RMS change of a signal by each form alone, in practical floors [-].
    """
    rng = np.random.default_rng(seed)
    u, q = commands_pa(rng), _numbers(hand)
    sizes, plain = np.zeros(len(FORMS)), simulated(u, q, np.zeros(len(FORMS)))
    given = {form: _size_of(form, floors, u, q, plain) for form in forms.split("+")}
    for form, size in given.items():
        sizes[FORMS[form][0]] = size
    out = simulated(u, q, sizes)
    yes = np.ones(1, dtype=bool)
    shape = (len(u), 1)
    signals = Signals(
        name=f"{forms}_{seed}",
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
    return signals, given


def nominal_model(hand: Hand, seed: int, share: float = 0.03) -> Hand:
    """The hand with every number of the plain plant wrong by a few percent, as a nominal model is.

    share: standard deviation of the relative error [-].
    """
    from hand_identification.free_parameters import NOMINAL_KEYS  # noqa: PLC0415 - only for the nominal model

    rng, parameters = np.random.default_rng(seed + 1000), hand.parameters.copy()
    for key in NOMINAL_KEYS:
        parameters[ROW[key]] *= 1.0 + share * rng.standard_normal(len(hand.joints))
    return replace(hand, parameters=parameters)


def pairs(count: int, seed: int) -> list[str]:
    """Names of random pairs of forms, joined by +; both are of the catalogue, and no effect names both."""
    known = [form for form, (number, _, right) in FORMS.items() if number and right]
    apart = [f"{a}+{b}" for a in known for b in known if FORMS[a][2].isdisjoint(FORMS[b][2])]
    return [str(pair) for pair in np.random.default_rng(seed).choice(apart, count)]


def main(seed: int, floors: float = 12.0, forms: Sequence[str] = tuple(FORMS)) -> None:
    """Print the verdict, the findings and the remainder of a recording of every form, or of pairs of them.

    floors: RMS change of a signal by each form, in practical floors [-].
    """
    from hand_diagnosis.diagnosis import diagnose  # noqa: PLC0415 - the recordings need no fit
    from hand_model.description import load_hand  # noqa: PLC0415 - as above

    hand = load_hand(Path(__file__).parents[1] / "config" / "hand.yaml")
    for k, form in enumerate(forms):
        right = ["/".join(sorted(FORMS[each][2])) or "none" for each in form.split("+")]
        own = seed + 17 * k
        signals, _ = recording(hand, form, floors, own)
        model = nominal_model(hand, own)
        found = diagnose([signals], model, tolerance=0.05, seed=0, joints=[JOINT], sensor_curve=False)
        named = [f"{finding.effect} {finding.probability:.2f}" for finding in found.findings]
        left = [f"remainder {entry.probability:.2f}" for entry in found.remainder]
        test, results = found.joints[0].test, found.joints[0].results
        errors = [] if test is None else [f"{test.rmse(1)[r.stage] / r.noise:.2f}" for r in results]
        print(f"{form} (seed {own}, right: {', '.join(right)}): {found.verdict}; {named + left};"
              f" test error over the noise: {', '.join(errors)}", flush=True)  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="python -m validation.other_forms",
        description="Diagnose a recording of every form, or of random pairs of forms.",
        epilog="Example: python -m validation.other_forms 1 --floors 12",
    )
    parser.add_argument("seed", type=int, help="seed of the first recording")
    parser.add_argument("--floors", type=float, default=12.0, help="RMS change of a signal, in practical floors")
    parser.add_argument("--pairs", type=int, default=0, help="number of recordings with two forms each, instead")
    asked = parser.parse_args()
    main(asked.seed, asked.floors, pairs(asked.pairs, asked.seed) if asked.pairs else tuple(FORMS))
