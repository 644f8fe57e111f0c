"""Families of laws that are run, never looked at while the diagnosis is changed.

Frozen: its SHA-256 stands in frozen.json, and `make.py` refuses to draw from it where the two differ. A new family goes
into a new file. Every run is logged in docs/proof.md with its commit and its scores, the first one included.
"""

from __future__ import annotations

import numpy as np

from validation.referees import shapes
from validation.referees.forms import (
    DEGREE,
    Apply,
    Family,
    Site,
    _age,
    _band,
    _chamber,
    _creep,
    _drag,
    _friction,
    _gap,
    _loops,
    _make,
    _orifice,
    _sag,
    _sensor,
    _signed,
    _stand,
    _tube,
    _valve_plays,
    _warm,
    number,
    table,
)
from validation.referees.plant import C, Laws
from validation.referees.shapes import Rng
from validation.trial.arrays import Array
from validation.trial.plant import ROW


def _valve_spline(site: Site, rng: Rng) -> Apply:
    """A valve whose rate is any monotone function of the error, slower everywhere than nominal."""
    up, down = (shapes.rising(rng, 0.0, 4e5, 5, bend=0.35) for _ in range(2))

    def apply(laws: Laws, joint: int, size: float) -> None:
        lag = site.q[ROW["lag"]]

        def law(e: Array) -> Array:
            shape = np.where(e > 0.0, up(np.abs(e)), down(np.abs(e)))
            share = np.maximum(shape / np.maximum(np.abs(e) / 4e5, 1e-6), 0.2)
            return np.asarray(e / (lag + 0.01 * size / np.clip(share, 0.4, 2.5)))

        laws.tabulate("valve_slope", joint, law)
        laws.number[C["valve_own"], joint] = 1.0

    return apply


def _pressure_spring(site: Site, rng: Rng) -> Apply:
    """A stiffness over angle and pressure: a hump over the angle, times the pressure."""
    middle, width = rng.uniform(0.4, 0.7) * site.reach_rad, rng.uniform(0.15, 0.35)
    return table("spring_p", 4e-8, lambda x: np.exp(-(((x - middle) / width) ** 2)))


def _softening(site: Site, rng: Rng) -> Apply:
    """A spring that softens at both ends of the range."""
    third, scale = rng.uniform(0.3, 0.6), rng.uniform(0.3, 0.6)
    middle = 0.5 * site.reach_rad
    return table("spring", 0.01, lambda x: np.tanh((x - middle) / scale) - third * (x - middle) / scale)


def _turning_weight(site: Site, rng: Rng) -> Apply:
    """A weight with a second harmonic: its centre is off the link's axis and moves with the angle."""
    phase, second = rng.uniform(-0.6, 1.2), rng.uniform(-0.25, 0.25)
    return table("weight", 0.01, lambda x: np.sin(x + phase) + second * np.sin(2.0 * x))


def _square_tendon(site: Site, rng: Rng) -> Apply:
    """A tendon that pulls in one direction only."""
    slack = rng.uniform(-0.3, 0.3)
    return table("tendon", 0.008, lambda x: np.minimum(x - slack, 0.0))


def _sloping_offset(site: Site, rng: Rng) -> Apply:
    """An offset of the angle that grows or falls a little over the range."""
    slope = rng.uniform(-0.1, 0.1)
    return table("sensor", _signed(DEGREE, rng), lambda x: 1.0 + slope * x)


def _two_delays(site: Site, rng: Rng) -> Apply:
    """Dead time together with a little lag of its own."""
    share, damping = rng.uniform(0.1, 0.25), rng.uniform(0.8, 1.2)

    def apply(laws: Laws, joint: int, size: float) -> None:
        laws.number[C["delay"], joint] = 0.01 * size
        laws.number[C["lag_pole"], joint] = 1.0 / (0.01 * share * size)
        laws.number[C["lag_damping"], joint] = damping

    return apply


HELD_BACK: tuple[Family, ...] = (
    Family("valve of a monotone spline", "valve_lag", "valve", _valve_spline, 0, 12.0),
    Family("dead time with a lag", "valve_delay", "valve", _two_delays, 0, 4.0),
    Family("dead band of two widths", "valve_deadband", "valve", _make(_band, soft=0.05, lean=0.5), 0),
    Family("orifices of another index", "valve_flow_limit", "valve", _make(_orifice, power=0.7), 0, 40.0),
    Family("hump of the valve's density", "valve_hysteresis", "valve", _make(_valve_plays, kind="hump"), 0),
    Family(
        "leak of a monotone spline", "leak", "fluid",
        lambda s, r: table("leak", 4e4, shapes.rising(r, 0.0, 4e5, 5, bend=0.8)), 0,
    ),
    Family("turbulent tube", "tube_lag", "fluid", _make(_tube, laminar=0.15), 1, 15.0),
    Family("laminar tube", "tube_lag", "fluid", _make(_tube, laminar=0.95), 1, 15.0),
    Family("chamber of two volumes", "gas_compression", "fluid", _make(_chamber, dead=1.2), 0, 6.0),
    Family("creep of six modes", "creep", "material", _make(_creep, modes=6)),
    Family("hump of the material's density", "hysteresis", "material", _make(_loops, kind="hump"), 1, 30.0),
    Family("even density of the material", "hysteresis", "material", _make(_loops, kind="even"), 1, 30.0),
    Family("stiffness over angle and pressure", "stiffening", "material", _pressure_spring, 1, 60.0),
    Family("softening spring", "stiffening", "material", _softening, 1, 40.0),
    Family("ageing by use", "ageing", "material", _make(_age, by_use=True), 1, 15.0),
    Family("warming by pressure", "thermal_drift", "material", _make(_warm, by="warm_by_pressure")),
    Family("soft presliding, no peak", "coulomb_friction", "joint", _make(_friction, power=0.6, peak=0.0)),
    Family("sharp Stribeck peak", "coulomb_friction", "joint", _make(_friction, power=2.0, peak=0.8)),
    Family("drag of power 2.4", "viscous_friction", "joint", _make(_drag, power=2.4)),
    Family("drag that saturates", "viscous_friction", "joint", _make(_drag, power=0.7)),
    Family("one-sided play", "backlash", "joint", _make(_gap, lean=0.9, slope=0.0)),
    Family("hard stop", "end_stop", "joint", _make(_stand, what="stop", power=1.0), 1, 20.0),
    Family("weight off the axis", "gravity", "joint", _turning_weight, 1, 15.0),
    Family("one-way tendon", "joint_coupling", "joint", _square_tendon, 1, 8.0),
    Family("soft obstacle", "contact", "environment", _make(_stand, what="wall", power=2.2), 1, 20.0),
    Family(
        "three harmonics of the sensor", "hall_misalignment", "angle_sensor", _make(_sensor, orders=(1, 2, 5)), 1, 20.0
    ),
    Family(
        "offset with a slope", "angle_offset", "angle_sensor",
_sloping_offset, 1, 15.0,
    ),
    Family("compressor that starts late", "supply_droop", "supply", _make(_sag, pump=True), 0, 18.0, everywhere=True),
    Family("inertia of a held tool", "added_inertia", "joint", lambda s, r: number(inertia=5e-5, load=2e-4)),
)  # fmt: skip
