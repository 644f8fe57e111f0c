"""Families of laws for each class of effects, and how each draws a law: what a referee can conceal in a joint.

A family draws the form of its law; its size is one number, in units of the detection limit. development.py lists the
families whose recordings may be looked at; those of held_back.py are run, not looked at. Frozen, see held_back.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from validation.referees import shapes
from validation.referees.plant import DRAG_SPEED, MODES, PLAYS, ROOM_PA, C, Laws
from validation.referees.shapes import Rng
from validation.trial.arrays import Array
from validation.trial.plant import ROW

DEGREE = math.pi / 180.0
Apply = Callable[[Laws, int, float], None]


@dataclass(frozen=True, slots=True)
class Site:
    """Where a law is drawn: the joint's constants q (rows,), the largest angle [rad] and pressure [Pa] it reaches."""

    q: Array
    reach_rad: float
    top_pa: float


@dataclass(frozen=True, slots=True)
class Family:
    """A family of laws of one class.

    effect, place: as `hand diagnose` names them.  draw: (site, rng) -> the law, which sets a size on a joint.  stage:
    the signal that it changes, 0 pressure, 1 angle.  most: largest size.  everywhere: it acts on all joints.
    """

    name: str
    effect: str
    place: str
    draw: Callable[[Site, Rng], Apply]
    stage: int = 1
    most: float = 1e4
    everywhere: bool = False


def number(**units: float) -> Apply:
    """A law of numbers: each is its unit times the size."""

    def apply(laws: Laws, joint: int, size: float) -> None:
        for name, unit in units.items():
            laws.number[C[name], joint] = unit * size

    return apply


def table(name: str, unit: float, shape: Callable[[Array], Array], **fixed: float) -> Apply:
    """A law that is a table; fixed: numbers that do not grow with the size.

    unit: of the law at size 1 [SI, see plant.TABLES].  shape: (POINTS,) states -> (POINTS,) values of about 1 [-].
    """

    def apply(laws: Laws, joint: int, size: float) -> None:
        laws.tabulate(name, joint, lambda x: unit * size * shape(x))
        for key, value in fixed.items():
            laws.number[C[key], joint] = value

    return apply


def _valve_two_speeds(site: Site, rng: Rng) -> Apply:
    """A first-order valve that is slower in one direction, smoothly so."""
    lean, blend = rng.uniform(-0.8, 0.8), rng.uniform(1e4, 6e4)

    def apply(laws: Laws, joint: int, size: float) -> None:
        lag = site.q[ROW["lag"]]
        laws.tabulate("valve_slope", joint, lambda e: e / (lag + 0.01 * size * (1.0 + lean * np.tanh(e / blend))))
        laws.number[C["valve_own"], joint] = 1.0

    return apply


def _valve_poles(site: Site, rng: Rng) -> Apply:
    """Two complex poles before the valve."""
    damping = rng.uniform(0.45, 0.9)

    def apply(laws: Laws, joint: int, size: float) -> None:
        laws.number[C["lag_pole"], joint] = 1.0 / (0.01 * size)
        laws.number[C["lag_damping"], joint] = damping

    return apply


def _band(site: Site, rng: Rng, *, soft: float, lean: float) -> Apply:
    """A valve that answers small errors weakly: over the band, its slope rises from `soft` to 1; two widths."""

    def apply(laws: Laws, joint: int, size: float) -> None:
        lag = site.q[ROW["lag"]]

        def law(e: Array) -> Array:
            width = 2e3 * size * np.where(e > 0.0, 1.0 + lean, 1.0 - lean)
            beyond = np.maximum(np.abs(e) - width, 0.0)
            return np.asarray(np.sign(e) * (beyond + soft * np.minimum(np.abs(e), width)) / lag)

        laws.tabulate("valve_slope", joint, law)
        laws.number[C["valve_own"], joint] = 1.0

    return apply


def _orifice(site: Site, rng: Rng, *, power: float) -> Apply:
    """Filling and venting through orifices of any critical ratio; they are narrower the larger the size."""
    b_in, b_out, lean = rng.uniform(0.15, 0.6), rng.uniform(0.15, 0.6), rng.uniform(0.6, 1.6)
    supply = site.q[ROW["supply"]] + ROOM_PA

    def apply(laws: Laws, joint: int, size: float) -> None:
        rate = 8.0 / max(size, 1e-9)
        laws.tabulate(
            "fill_limit", joint, lambda p: rate * supply * shapes.iso_flow((p + ROOM_PA) / supply, b_in, power)
        )
        laws.tabulate(
            "vent_limit",
            joint,
            lambda p: lean * rate * (p + ROOM_PA) * shapes.iso_flow(ROOM_PA / (p + ROOM_PA), b_out, power) + 1e3,
        )
        laws.number[C["limits_own"], joint] = 1.0

    return apply


def _valve_plays(site: Site, rng: Rng, *, kind: str) -> Apply:
    """A density of plays between set-point and valve."""
    weights, radii = shapes.density(rng, 1.0, PLAYS, kind)

    def apply(laws: Laws, joint: int, size: float) -> None:
        laws.valve_plays[0, :, joint] = weights
        laws.valve_plays[1, :, joint] = 3e3 * size * radii

    return apply


def _tube(site: Site, rng: Rng, *, laminar: float) -> Apply:
    """A resistance between sensor and actuator; its flow is partly proportional, partly the root of the difference."""

    def apply(laws: Laws, joint: int, size: float) -> None:
        def law(d: Array) -> Array:
            return (laminar * d + (1.0 - laminar) * np.sign(d) * np.sqrt(np.abs(d) * 3e4)) / (0.01 * size)

        laws.tabulate("tube", joint, law)
        laws.number[C["tube_own"], joint] = 1.0

    return apply


def _chamber(site: Site, rng: Rng, *, dead: float) -> Apply:
    """A gas chamber with an exponent between isothermal and adiabatic, and a second volume that does not change."""
    exponent, per_pa = rng.uniform(1.0, 1.4), rng.uniform(0.0, 3e-12)
    volume = rng.uniform(1.5e-6, 4e-6)

    def apply(laws: Laws, joint: int, size: float) -> None:
        laws.number[C["gas"], joint] = 0.3 * size * exponent
        laws.number[C["gas_volume"], joint] = volume
        laws.number[C["gas_per_pa"], joint] = per_pa
        laws.number[C["gas_dead"], joint] = dead * volume

    return apply


def _creep(site: Site, rng: Rng, *, modes: int) -> Apply:
    weights, times = shapes.spectrum(rng, 0.8, 90.0, modes)

    def apply(laws: Laws, joint: int, size: float) -> None:
        laws.prony[0, :modes, joint] = 0.1 * size * weights / 3e5
        laws.prony[1, :modes, joint] = times

    assert modes <= MODES
    return apply


def _loops(site: Site, rng: Rng, *, kind: str) -> Apply:
    weights, radii = shapes.density(rng, rng.uniform(0.3, 0.9), PLAYS, kind)

    def apply(laws: Laws, joint: int, size: float) -> None:
        # A play of stiffness k and radius r gives at most k (x - play): the elements slide at r, all of them elastic.
        laws.loops[0, :, joint] = 0.02 * size * weights
        laws.loops[1, :, joint] = radii

    return apply


def _bouc(site: Site, rng: Rng) -> Apply:
    power, lean, scale = rng.uniform(0.8, 3.0), rng.uniform(0.5, 0.9), rng.uniform(0.08, 0.25)

    def apply(laws: Laws, joint: int, size: float) -> None:
        for key, value in {"bouc": 0.005 * size, "bouc_scale": scale, "bouc_power": power, "bouc_lean": lean}.items():
            laws.number[C[key], joint] = value

    return apply


def _spring(site: Site, rng: Rng) -> Apply:
    """A spring that hardens from an angle on, without a straight part: only what a constant and a slope leave."""
    begin = rng.uniform(0.2, 0.5) * site.reach_rad
    shape = shapes.rising(rng, begin, 2.2, 4, bend=0.5)
    return table("spring", 0.05, lambda x: shape(x) * np.maximum(x - begin, 0.0))


def _friction(site: Site, rng: Rng, *, power: float, peak: float) -> Apply:
    shape = shapes.falling_friction(rng, peak, rng.uniform(0.05, 0.4), rng.uniform(0.7, 2.0), rng.uniform(0.0, 0.3))
    load, bristle = rng.uniform(0.0, 3e-6), rng.uniform(0.003, 0.02)

    def apply(laws: Laws, joint: int, size: float) -> None:
        laws.tabulate("friction", joint, lambda x: 0.003 * size * shape(x))
        fixed = {"bristle": bristle, "bristle_power": power, "friction_load": load, "bristle_damping": 1e-5 * size}
        for key, value in fixed.items():
            laws.number[C[key], joint] = value

    return apply


def _drag(site: Site, rng: Rng, *, power: float) -> Apply:
    def shape(share: Array) -> Array:
        v = DRAG_SPEED * share / np.maximum(1.0 - np.abs(share), 0.05)
        return np.sign(v) * np.abs(v) ** power

    return table("drag", 1e-3, shape)


def _gap(site: Site, rng: Rng, *, lean: float, slope: float) -> Apply:
    settle = rng.uniform(0.0005, 0.003)

    def apply(laws: Laws, joint: int, size: float) -> None:
        half, begun = 0.25 * DEGREE * size, min(size, 1.0)
        values = {"gap_up": half * (1.0 + lean), "gap_down": half * (1.0 - lean)}
        values |= {"gap_s": 1e-6 + settle * begun, "gap_slope": slope * begun}
        for key, value in values.items():
            laws.number[C[key], joint] = value

    return apply


def _stand(site: Site, rng: Rng, *, what: str, power: float) -> Apply:
    """A stop or an obstacle nearer than the joint's reach, with a force that grows with a power of the depth."""
    stiff, damping = rng.uniform(0.6, 2.5), rng.uniform(0.0, 0.4)

    def apply(laws: Laws, joint: int, size: float) -> None:
        laws.tabulate(what, joint, lambda d: stiff * d * (d / 0.05) ** (power - 1.0))
        laws.number[C[f"{what}_at"], joint] = max(min(site.reach_rad, 1.6) - 0.05 * size, 0.15)
        laws.number[C[f"{what}_damping"], joint] = damping

    return apply


def _weight(site: Site, rng: Rng) -> Apply:
    phase = rng.uniform(-0.6, 1.2)
    return table("weight", 0.01, lambda x: np.sin(x + phase))


def _turned_weight(site: Site, rng: Rng) -> Apply:
    """A weight on a hand whose attitude turns to and fro, slowly."""
    phase, turn = rng.uniform(-0.3, 0.9), {"turn_hz": rng.uniform(0.01, 0.05), "turn_rad": rng.uniform(0.2, 0.5)}
    return table("weight", 0.01, lambda x: np.sin(x + phase), **turn)


def _tendon(site: Site, rng: Rng) -> Apply:
    soft = rng.uniform(0.3, 1.2)
    return table("tendon", 0.005, lambda x: np.tanh(x / soft))


def _age(site: Site, rng: Rng, *, by_use: bool) -> Apply:
    shape = shapes.rising(rng, 0.0, 1.0, 4, bend=0.7)

    def apply(laws: Laws, joint: int, size: float) -> None:
        laws.tabulate("ageing", joint, lambda x: 0.01 * size * shape(x))
        laws.number[C["age_by_use"], joint] = float(by_use)

    return apply


def _warm(site: Site, rng: Rng, *, by: str) -> Apply:
    sign, fixed = rng.choice([-1.0, 1.0]), {"warm_s": rng.uniform(5.0, 25.0)} | ({by: 1.0} if by else {})
    shape = shapes.rising(rng, 0.0, 1.0, 4, bend=0.4)
    return table("warming", 0.005 * sign, shape, **fixed)


def _sag(site: Site, rng: Rng, *, pump: bool) -> Apply:
    """A reservoir that the filling joints empty; its compressor runs always, or starts at a low pressure."""
    volume, start = rng.uniform(1.5e6, 4e6), rng.uniform(0.5, 0.8) if pump else 1.0
    flow = rng.uniform(0.05, 0.2)

    def apply(laws: Laws, joint: int, size: float) -> None:
        values = {"sag": min(0.1 * size, 0.9), "sag_volume": volume, "sag_flow": flow, "sag_start": start}
        for key, value in values.items():
            laws.number[C[key], :] = value

    return apply


def _sensor(site: Site, rng: Rng, *, orders: tuple[int, ...]) -> Apply:
    return table("sensor", 0.5 * DEGREE, shapes.harmonics(rng, orders, 0.7))


def _late(site: Site, rng: Rng) -> Apply:
    damping = rng.uniform(0.6, 1.2)

    def apply(laws: Laws, joint: int, size: float) -> None:
        laws.number[C["late"], joint], laws.number[C["late_damping"], joint] = 0.006 * size, damping

    return apply


def _signed(unit: float, rng: Rng) -> float:
    return unit * float(rng.choice([-1.0, 1.0]))


def _make(draw: Callable[..., Apply], **options: Any) -> Callable[[Site, Rng], Apply]:
    return lambda site, rng: draw(site, rng, **options)
