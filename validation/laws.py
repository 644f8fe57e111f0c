"""Learned laws on forms that no class has: `python -m validation.laws [--half tuned|looked_at_once] [--json FILE]`.

A joint is simulated with scipy.integrate from textbook equations, with one effect in a constitutive form that is
neither the textbook form of its class (hand_model/effects) nor exactly one of its learned law. Each class of the same
stage is fitted with its textbook form and with its learned law. Reported are the error on another recording over the
noise, and whether the class of the form has the most evidence. The forms are in two halves: one to try changes of the
fits on, and one to look at afterwards.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from hand_diagnosis.search import LearnedLaw, learn_law, training_evidence
from hand_identification.driving import shape_driving
from hand_identification.free_parameters import (
    NOMINAL_KEYS,
    FreeParameter,
    effect_free_parameters,
    merged,
    nominal_free_parameters,
    probe_values,
)
from hand_identification.joint_data import joint_problem
from hand_identification.joint_problem import STAGES, JointProblem
from hand_identification.map_fit import MapFit, costs_at, map_fit
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.effects import EFFECTS
from hand_model.effects.effect import Effect
from hand_model.kernel.rows import ROW
from hand_recording.signals import Signals

JOINT, PERIOD_S, SECONDS = "index_distal", 0.01, 40.0
NOISE = (150.0, float(np.radians(0.03)))
"""Noise of pressure [Pa] and angle [rad]."""
OFF = 0.02
"""Standard deviation of the relative error of the nominal numbers."""
VALVE = ("valve_lag", "valve_deadband", "valve_flow_limit", "leak", "gas_compression")
MOTION = (
    "tube_lag", "creep", "hysteresis", "stiffening", "ageing", "thermal_drift", "coulomb_friction", "viscous_friction",
    "backlash", "gravity",
)  # fmt: skip
ATMOSPHERE_PA = 101325.0


@dataclass(frozen=True, slots=True)
class Form:
    """An effect in another form. changes: what replaces parts of the plain joint (`Plain`)."""

    name: str
    effect: str
    half: str
    source: str
    changes: dict[str, Callable[..., Any]]
    states: int = 0


def psi(ratio: float, critical: float, power: float = 0.5) -> float:
    """Flow function of ISO 6358-1 with the subsonic index `power` [-]."""
    x = (ratio - critical) / (1.0 - critical)
    return 1.0 if x <= 0.0 else max(1.0 - x * x, 0.0) ** power


class Plain:
    """The plain joint: p' = (u - p) / tau within the limits; Eq. 6 and 8 without creep. x holds further states.

    A change `valve(s, u, p, phi, omega, x)` gives p', `inner(s, p, x)` the actuator's pressure,
    `torque(s, t, phi, omega, p, x)` an added torque, `states(s, t, u, p, phi, omega, x)` the slopes of x, and
    `reading(s, angles)` the measured angles.
    """

    def __init__(self, column: Array, form: Form) -> None:
        def get(key: str) -> float:
            return float(column[ROW[key]])

        self.form = form
        self.tau, self.fill, self.vent = (
            get(f"valve.{key}") for key in ("time_constant_s", "fill_rate_pa_per_s", "vent_rate_pa_per_s")
        )
        self.a = [get(f"statics.{key}") for key in ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad")]
        self.inertia, self.damping = get("dynamics.inertia_kg_m2"), get("dynamics.viscous_friction_nm_s_per_rad")
        self.supply, self.dead = get("supply.pressure_pa"), get("valve.dead_time_s")
        self.low, self.high = get("end_stop.low_deg"), get("end_stop.high_deg")

    def rate(self, error: float) -> float:
        """Rate of the pressure [Pa/s] at an error [Pa]."""
        return min(max(error / self.tau, -self.vent), self.fill)

    def slopes(self, t: float, y: Array, u: float) -> list[float]:
        """Slopes of pressure, angle, speed and further states y (3 + states,) under the set-point u [Pa], SI."""
        p, phi, omega, x = float(y[0]), float(y[1]), float(y[2]), y[3:]
        change = self.form.changes
        rise = change["valve"](self, u, p, phi, omega, x) if "valve" in change else self.rate(u - p)
        inner = change["inner"](self, p, x) if "inner" in change else p
        a0, a1, a2, a3 = self.a
        torque = a0 + a1 * phi + (a2 + a3 * phi) * inner - self.damping * omega
        torque += -5.0 * max(phi - self.high, 0.0) + 5.0 * max(self.low - phi, 0.0)
        if "torque" in change:
            torque += change["torque"](self, t, phi, omega, inner, x)
        more = change["states"](self, t, u, p, phi, omega, x) if "states" in change else []
        return [rise, omega, torque / self.inertia, *more]


def simulated(column: Array, form: Form, commands: Array) -> tuple[Array, Array]:
    """Pressures [Pa] and angles [rad] (T,) at the samples, from rest under commands (T,) [Pa]."""
    plant = Plain(column, form)
    a0, a1, _, _ = plant.a
    y = np.zeros(3 + form.states)
    y[1] = -a0 / a1
    out = [y]
    for k in range(len(commands) - 1):
        before = commands[max(k - 1, 0)]
        switch = min(plant.dead, 0.999 * PERIOD_S)
        for begin, end, u in ((0.0, switch, before), (switch, PERIOD_S, commands[k])):
            span = ((k * PERIOD_S) + begin, (k * PERIOD_S) + end)
            done = solve_ivp(plant.slopes, span, y, "LSODA", args=(float(u),), rtol=1e-6, atol=1e-8, max_step=5e-3)
            y = done.y[:, -1]
        out.append(y)
    states = np.array(out)
    angle = states[:, 1]
    return states[:, 0], form.changes["reading"](plant, angle) if "reading" in form.changes else angle


# Forms.


def second_order(frequency_hz: float, ratio: float, lag_s: float = 0.0) -> dict[str, Callable[..., Any]]:
    """Regulator of second order, damping ratio [-]; x: rate of the pressure and, with a lag, the filtered set-point."""
    w = 2.0 * np.pi * frequency_hz

    def states(s: Plain, t: float, u: float, p: float, phi: float, omega: float, x: Array) -> list[float]:
        drive = float(x[1]) if lag_s else u
        return [w * w * (drive - p) - 2.0 * ratio * w * float(x[0])] + ([(u - drive) / lag_s] if lag_s else [])

    return {"valve": lambda s, u, p, phi, omega, x: float(x[0]), "states": states}


def orifice(fill: float, vent: float, critical: float, power: float) -> dict[str, Callable[..., Any]]:
    """ISO 6358 orifices behind a linear regulator; fill, vent: choked rates at full supply [Pa/s]."""

    def valve(s: Plain, u: float, p: float, phi: float, omega: float, x: Array) -> float:
        here, full = p + ATMOSPHERE_PA, s.supply + ATMOSPHERE_PA
        most = fill * psi(here / full, critical, power)
        least = vent * here / full * psi(ATMOSPHERE_PA / here, critical, power)
        return min(max((u - p) / s.tau, -least), most)

    return {"valve": valve}


def leaking(flow: Callable[[float], float]) -> dict[str, Callable[..., Any]]:
    """A loss [Pa/s] over the gauge pressure [Pa]."""
    return {"valve": lambda s, u, p, phi, omega, x: s.rate(u - p) - flow(max(p, 0.0))}


def squeezed(gain: Callable[[Plain, float, float], float]) -> dict[str, Callable[..., Any]]:
    """A rise of the pressure per lost volume [Pa/m^3], over pressure and angle."""

    def valve(s: Plain, u: float, p: float, phi: float, omega: float, x: Array) -> float:
        return s.rate(u - p) - gain(s, p, phi) * (s.a[2] + s.a[3] * phi) * omega

    return {"valve": valve}


def line(flow: Callable[[float, float], float]) -> dict[str, Callable[..., Any]]:
    """A tube: rate of the actuator's pressure x[0] by the pressures at both ends [Pa/s]."""
    return {
        "inner": lambda s, p, x: float(x[0]),
        "states": lambda s, t, u, p, phi, omega, x: [flow(p, float(x[0]))],
    }


def retarded(weights_rad: Sequence[float], times_s: Sequence[float]) -> dict[str, Callable[..., Any]]:
    """Kelvin elements in series with the chamber, loaded by its elastic torque (standard linear solids)."""

    def states(s: Plain, t: float, u: float, p: float, phi: float, omega: float, x: Array) -> list[float]:
        load = (s.a[2] + s.a[3] * phi) * p / (s.a[2] * s.supply)
        return [(w * load - float(shift)) / tau for w, tau, shift in zip(weights_rad, times_s, x, strict=True)]

    return {"torque": lambda s, t, phi, omega, p, x: -s.a[1] * float(np.sum(x)), "states": states}


def jenkin(heights_nm: Sequence[float], yields_rad: Sequence[float]) -> dict[str, Callable[..., Any]]:
    """Elasto-plastic elements in parallel, with a steep but smooth yield."""

    def states(s: Plain, t: float, u: float, p: float, phi: float, omega: float, x: Array) -> list[float]:
        return [omega / y * (1.0 - abs(z) ** 20 * (z * omega > 0.0)) for y, z in zip(yields_rad, x, strict=True)]

    return {"torque": lambda s, t, phi, omega, p, x: -float(np.dot(heights_nm, x)), "states": states}


def bouc_wen(height: float, scale: float, beta: float, power: float) -> dict[str, Callable[..., Any]]:
    """Bouc's and Wen's loop of a height [N m] with any power and share of its two terms."""

    def states(s: Plain, t: float, u: float, p: float, phi: float, omega: float, x: Array) -> list[float]:
        z = float(x[0])
        bend = (beta * np.sign(z * omega) + 1.0 - beta) * abs(z) ** power
        return [omega / scale * (1.0 - bend)]

    return {"torque": lambda s, t, phi, omega, p, x: -height * float(x[0]), "states": states}


def lugre(level: Callable[[Plain, float, float], float], bristle_rad: float) -> dict[str, Callable[..., Any]]:
    """LuGre friction: bristles x[0] whose steady torque is level(s, speed, pressure) [N m]."""

    def states(s: Plain, t: float, u: float, p: float, phi: float, omega: float, x: Array) -> list[float]:
        return [(omega - abs(omega) * float(x[0])) / bristle_rad]

    def torque(s: Plain, t: float, phi: float, omega: float, p: float, x: Array) -> float:
        return -level(s, abs(omega), max(p, 0.0)) * float(x[0])

    return {"torque": torque, "states": states}


def added(torque: Callable[..., float]) -> dict[str, Callable[..., Any]]:
    """A torque without memory [N m]."""
    return {"torque": torque}


def used(torque: Callable[[Plain, float, float, float, float], float]) -> dict[str, Callable[..., Any]]:
    """A torque (s, phi, p, travel, t) with the travel [rad] in x[0]."""
    return {
        "torque": lambda s, t, phi, omega, p, x: torque(s, phi, p, float(x[0]), t),
        "states": lambda s, t, u, p, phi, omega, x: [abs(omega)],
    }


def plays(gaps_rad: Sequence[float], weights: Sequence[float]) -> dict[str, Callable[..., Any]]:
    """A reading that is a weighted sum of plays."""

    def reading(s: Plain, angles: Array) -> Array:
        out = np.zeros(len(angles))
        for gap, weight in zip(gaps_rad, weights, strict=True):
            link = angles[0]
            for k, phi in enumerate(angles):
                link = min(max(link, phi - 0.5 * gap), phi + 0.5 * gap)
                out[k] += weight * link
        return out

    return {"reading": reading}


def dead(felt: Callable[[float], float]) -> dict[str, Callable[..., Any]]:
    """A regulator that reacts to a part of its error [Pa]."""
    return {"valve": lambda s, u, p, phi, omega, x: s.rate(felt(u - p))}


TUNED, ONCE = "tuned", "looked_at_once"
FORMS = (
    Form("damped regulator, 6 Hz, 0.4", "valve_lag", TUNED, "Ogata 2010", second_order(6.0, 0.4), 1),
    Form("regulator, 9 Hz, 0.25, with a filter", "valve_lag", ONCE, "Ogata 2010", second_order(9.0, 0.25, 0.015), 2),
    Form("cubic notch", "valve_deadband", TUNED, "Merritt 1967", dead(lambda e: e**3 / (e * e + 1.2e4**2))),
    Form("exponential notch", "valve_deadband", ONCE, "Merritt 1967",
         dead(lambda e: e * (1.0 - 0.85 * float(np.exp(-abs(e) / 9e3))))),
    Form("ISO 6358, b 0.35", "valve_flow_limit", TUNED, "ISO 6358-1", orifice(1.6e6, 2.4e6, 0.35, 0.5)),
    Form("ISO 6358, b 0.1, index 0.6", "valve_flow_limit", ONCE, "ISO 6358-3", orifice(1.0e6, 1.5e6, 0.1, 0.6)),
    Form("laminar gap", "leak", TUNED, "White 2016", leaking(lambda p: 1.2 * p * (p + 2.0 * ATMOSPHERE_PA) / 5e5)),
    Form("choked hole", "leak", ONCE, "ISO 6358-1",
         leaking(lambda p: 0.5 * (p + ATMOSPHERE_PA) * psi(ATMOSPHERE_PA / (p + ATMOSPHERE_PA), 0.3))),
    Form("adiabatic, large dead volume", "gas_compression", TUNED, "Beater 2007",
         squeezed(lambda s, p, phi: 1.4 * (p + ATMOSPHERE_PA) / (8e-7 + 2e-7 * phi))),
    Form("balloon", "gas_compression", ONCE, "Beater 2007",
         squeezed(lambda s, p, phi: 1.1 * (p + ATMOSPHERE_PA) / (6e-7 + 1.2e-12 * p + 2e-18 * p * p))),
    Form("laminar and turbulent", "tube_lag", TUNED, "White 2016",
         line(lambda p, y: float(np.sign(p - y)) * 6e4 * (np.sqrt(1.0 + abs(p - y) / 5e3) - 1.0) * 6.0), 1),
    Form("compressible capillary", "tube_lag", ONCE, "White 2016",
         line(lambda p, y: ((p + ATMOSPHERE_PA) ** 2 - (y + ATMOSPHERE_PA) ** 2) / (2.0 * 1.5e5) / 0.06), 1),
    Form("two standard linear solids", "creep", TUNED, "Ferry 1980", retarded((0.06, 0.09), (1.7, 17.0)), 2),
    Form("power law, t^0.2", "creep", ONCE, "Findley 1976",
         retarded([0.03 * 2.4 ** (0.2 * k) for k in range(9)], [0.15 * 2.4**k for k in range(9)]), 9),
    Form("ten Jenkin elements", "hysteresis", TUNED, "Iwan 1966",
         jenkin([0.0025] * 10, [0.02 + 0.04 * k for k in range(10)]), 10),
    Form("Bouc-Wen 1.5, 0.75", "hysteresis", ONCE, "Wen 1976", bouc_wen(0.025, 0.12, 0.75, 1.5), 1),
    Form("tanh map", "stiffening", TUNED, "Ogden 1984",
         added(lambda s, t, phi, omega, p, x: -0.03 * float(np.tanh((phi - 0.7) / 0.25)))),
    Form("exponential stiffening", "stiffening", ONCE, "Fung 1993",
         added(lambda s, t, phi, omega, p, x: -4e-4 * (float(np.exp(4.0 * max(phi, 0.0))) - 1.0))),
    Form("exponential softening with travel", "ageing", TUNED, "Mullins 1969",
         used(lambda s, phi, p, travel, t: -0.2 * s.a[1] * phi * float(-np.expm1(-travel / 25.0))), 1),
    Form("softening with the root of travel", "ageing", ONCE, "Mullins 1969",
         used(lambda s, phi, p, travel, t: -0.02 * s.a[1] * phi * travel**0.5), 1),
    Form("two thermal capacities", "thermal_drift", TUNED, "Incropera 2002",
         added(lambda s, t, phi, omega, p, x: 0.02 - 0.012 * np.exp(-t / 6.0) - 0.008 * np.exp(-t / 40.0))),
    Form("stretched exponential", "thermal_drift", ONCE, "Kohlrausch",
         added(lambda s, t, phi, omega, p, x: 0.02 * (1.0 - float(np.exp(-((t / 15.0) ** 0.7)))))),
    Form("LuGre, Gaussian Stribeck", "coulomb_friction", TUNED, "Canudas de Wit 1995",
         lugre(lambda s, w, p: 0.006 + 0.006 * float(np.exp(-((w / 0.4) ** 2))), 2e-3), 1),
    Form("LuGre, exponential, root of pressure", "coulomb_friction", ONCE, "Tustin 1947",
         lugre(lambda s, w, p: (0.005 + 0.004 * float(np.exp(-w / 0.7))) * (1.0 + (p / s.supply) ** 0.5), 2e-3), 1),
    Form("Cross fluid", "viscous_friction", TUNED, "Cross 1965",
         added(lambda s, t, phi, omega, p, x: -6e-3 * omega / (1.0 + (abs(omega) / 0.7) ** 0.8))),
    Form("power law, 0.6", "viscous_friction", ONCE, "Ostwald 1925",
         added(lambda s, t, phi, omega, p, x: -6e-3 * omega / (omega * omega + 1e-4) ** 0.2)),
    Form("three plays", "backlash", TUNED, "Krasnosel'skii 1989", plays((0.01, 0.03, 0.07), (0.3, 0.4, 0.3))),
    Form("six plays", "backlash", ONCE, "Krasnosel'skii 1989",
         plays([0.01 * k for k in range(1, 7)], [0.1, 0.1, 0.2, 0.2, 0.2, 0.2])),
    Form("wrist that turns", "gravity", TUNED, "Goldstein 2002",
         added(lambda s, t, phi, omega, p, x: -0.03 * float(np.sin(phi + 0.2 + 0.025 * t)))),
    Form("wrist that turns and stops", "gravity", ONCE, "Goldstein 2002",
         added(lambda s, t, phi, omega, p, x: -0.03 * float(np.sin(phi + 0.3 * np.tanh(t / 30.0))))),
)  # fmt: skip


def excitation(rng: np.random.Generator) -> Array:
    """Staircase, slow triangle, random steps and multisine, a quarter each (T,) [Pa]."""
    count = round(SECONDS / PERIOD_S / 4)
    time = np.arange(count) * PERIOD_S
    levels = np.r_[np.linspace(0.0, rng.uniform(3.6e5, 4.2e5), 5), np.linspace(3e5, 0.0, 4)]
    stairs = np.repeat(levels, count // 9 + 1)[:count]
    slow = 4e5 * np.abs(2.0 * ((1.5 * time / time[-1]) % 1.0) - 1.0)
    steps = np.repeat(rng.uniform(0.0, 4.2e5, count // 60 + 1), 60)[:count]
    waves = sum(5e4 * np.sin(2 * np.pi * f * time + rng.uniform(0.0, 6.0)) for f in np.geomspace(0.1, 4.0, 8))
    return np.concatenate([stairs, slow, steps, np.clip(2e5 + waves, 0.0, 4.5e5)])


def recording(hand: Hand, form: Form, rng: np.random.Generator) -> Signals:
    """What noisy sensors record of a joint with an effect in a form."""
    commands = excitation(rng)
    pressure, angle = simulated(hand.parameters[:, 0], form, commands)
    shape, yes = (len(commands), 1), np.ones(1, dtype=bool)
    pressures = pressure[:, None] + NOISE[0] * rng.standard_normal(shape)
    angles = angle[:, None] + NOISE[1] * rng.standard_normal(shape)
    nothing, known = np.full(shape, np.nan), np.ones(shape, dtype=bool)
    return Signals(
        name="simulated",
        joints=(JOINT,),
        period_s=PERIOD_S,
        set_point_pa=commands[:, None],
        pressure_pa=pressures,
        angle_rad=angles,
        force_n=nothing,
        known=known,
        has_set_point=yes,
        has_pressure=yes,
    )


def one_joint(path: Path) -> Hand:
    """The shipped hand's distal joint as the only one, without creep and without a partner."""
    hand = load_hand(path)
    index = hand.joints.index(JOINT)
    parameters = hand.parameters[:, [index]].copy()
    for key in ("dynamics.coupling_inertia_kg_m2", "material.phi_max_deg"):
        parameters[ROW[key]] = 0.0
    return replace(hand, joints=(JOINT,), parameters=parameters, partner=np.array([-1]))


def problem_of(hand: Hand, signals: Signals) -> tuple[JointProblem, list[FreeParameter], MapFit]:
    """A joint's problem with its driving pressure shaped by the fit of the nominal numbers, and this fit."""
    problem = joint_problem([signals], hand, JOINT)
    free = nominal_free_parameters(problem.nominal, 0.05, True)
    fit = map_fit(problem, free, np.zeros(len(free)))
    shape_driving(problem, free, fit.z)
    return problem, free, map_fit(problem, free, fit.z)


def textbook_fit(problem: JointProblem, nominal: MapFit, effect: Effect) -> MapFit:
    """The model with the textbook form of an effect, fitted from its probes."""
    free = merged(nominal.free, effect_free_parameters(effect, problem.nominal))
    here = {parameter.row: float(z) for parameter, z in zip(nominal.free, nominal.z, strict=True)}
    own = {ROW[key] for key in effect.keys}
    starts = []
    for probe in probe_values(effect, problem.nominal):
        for share in (0.1, 0.3, 1.0, 2.5):
            start = []
            for parameter in free:
                if parameter.row in own:
                    now = float(problem.nominal[parameter.row])
                    there = probe.get(parameter.row, now)
                    whole = parameter.key in effect.shape
                    start.append(parameter.coordinate(there if whole else now + share * (there - now)))
                else:
                    start.append(here.get(parameter.row, 0.0))
            starts.append(start)
    costs = costs_at(problem, free, np.array(starts))
    rough = [map_fit(problem, free, np.array(starts[k]), 8) for k in np.argsort(costs)[:3]]
    return min((map_fit(problem, free, fit.z, 20) for fit in rough), key=lambda fit: fit.cost)


def ratio_on(problem: JointProblem, test: JointProblem, fit: MapFit, stage: int) -> float:
    """Error of a fit on the test recording over the noise of the signal [-]."""
    columns, starts = problem.columns(fit.free, fit.z[None])
    residual = test.residuals(columns, starts)[0][0, stage]
    used = test.segments[0].use[stage]
    return float(np.sqrt(np.mean(residual[used] ** 2)) / NOISE[stage])


QUICK = ("leak",)
"""Effects of the short form."""


def classes(form: Form, quick: bool = False) -> tuple[str, ...]:
    """The classes of a form's stage. quick: its own and the first other one."""
    every = VALVE if form.effect in VALVE else MOTION
    return (form.effect, next(name for name in every if name != form.effect)) if quick else every


def compare(hand: Hand, form: Form, seed: int, names: Sequence[str]) -> dict[str, Any]:
    """Textbook and learned laws of classes, a form's own among them, on one recording; errors on another one."""
    rng = np.random.default_rng(seed)
    nominal = replace(hand, parameters=hand.parameters.copy())
    for key in NOMINAL_KEYS:  # effects stay neutral
        nominal.parameters[ROW[key]] *= 1.0 + OFF * rng.standard_normal(len(hand.joints))
    problem, _, base = problem_of(nominal, recording(hand, form, rng))
    test, _, _ = problem_of(nominal, recording(hand, form, rng))
    stage = 0 if form.effect in VALVE else 1
    laws: dict[str, LearnedLaw] = {}
    evidence: dict[str, float] = {}
    for name in names:
        text = textbook_fit(problem, base, EFFECTS[name])
        laws[name] = learn_law(problem, text, EFFECTS[name], np.random.default_rng(seed))
        fits = (text, laws[name].fit)
        evidence[name] = max(training_evidence(problem, fit) for fit in fits)
    right = laws[form.effect]
    ranked = sorted(evidence, key=lambda name: -evidence[name])
    rivals = [name for name in ranked if name != form.effect]
    ratios = {name: ratio_on(problem, test, fit, stage)
              for name, fit in (("nominal", base), ("textbook", right.textbook), ("learned", right.fit))}  # fmt: skip
    return {
        "form": form.name, "effect": form.effect, "half": form.half, "seed": seed, "signal": STAGES[stage], **ratios,
        "first": ranked[0], "right": ranked[0] == form.effect, "ahead": evidence[form.effect] - evidence[rivals[0]],
        "rival": rivals[0], "rival_ratio": ratio_on(problem, test, laws[rivals[0]].fit, stage),
        "preferred": right.preferred, "coefficients": right.coefficients, "freed": list(right.freed),
    }  # fmt: skip


def main(half: str, path: Path, out: Path | None, names: Sequence[str], *, quick: bool = False) -> None:
    """Compare the forms of a half, one line each. quick: those of QUICK alone, with one other class."""
    hand, rows = one_joint(path), []
    names = names or QUICK if quick else names
    for number, form in enumerate(FORMS):
        if form.half == half and (not names or form.effect in names):
            row = compare(hand, form, 100 + number, classes(form, quick))
            rows.append(row)
            ratios = "  ".join(f"{row[key]:7.2f}" for key in ("nominal", "textbook", "learned"))
            verdict = "first" if row["right"] else f"after {row['first']}"
            print(f"{form.effect:17s} {form.name:38s} {ratios}  {verdict}, {row['ahead']:+.0f} to {row['rival']}"
                  f" ({row['rival_ratio']:.1f})  {row['coefficients']:.1f} coefficients", flush=True)  # fmt: skip
            if out:
                out.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="python -m validation.laws",
        description="Fit learned laws to forms that no class has.",
        epilog="Example: python -m validation.laws --half tuned --json laws.json",
    )
    parser.add_argument("effects", nargs="*", help="effects whose forms are fitted; default: all")
    parser.add_argument("--half", choices=(TUNED, ONCE), default=TUNED, help="which forms")
    parser.add_argument("--quick", action="store_true", help="one form, compared with one other class")
    parser.add_argument("--model", type=Path, default=Path("config/hand.yaml"), help="description of the hand")
    parser.add_argument("--json", type=Path, help="file for the results")
    given = parser.parse_args()
    main(given.half, given.model, given.json, given.effects, quick=given.quick)
