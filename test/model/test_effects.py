"""Every effect of the catalogue against a closed form, a limit case or an energy balance, written from the physics.

The equations are called as plain functions of scalars, without the kernel. The formulas here are computed with NumPy
from the textbook and use no code of the effects. Effects that are wrong numbers of the plain plant have no equation of
their own; they are checked on one joint of the plain plant.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numba import config
from pytest import approx
from scipy.integrate import solve_ivp

from hand_model.arrays import Array
from hand_model.effects import CATALOGUE, EFFECTS
from hand_model.effects.effect import (
    ANGLE,
    EXOGENOUS,
    INFLOW,
    NEIGHBOUR,
    SPEED,
    TIME,
    Effect,
    Times,
    hook_arguments,
)
from hand_model.kernel.open_loop import MeasuredInputs, open_loop
from hand_model.kernel.rows import ROW
from test.model.plain_numbers import PLAIN, SUPPLY_PA

H = 1e-3
ATMOSPHERE_PA = 101325.0
"""Standard atmosphere, ISO 2533."""
A1, A2, A3 = -0.05, 4e-7, -1e-7
REST = (0.0,) * EXOGENOUS
PERIOD_S = 0.005
ADDED = ("pressure_source", "torque", "torque_damping", "damping", "dry")
"""Hooks whose results are added to a rate, a torque or a damping; the others pass a signal on."""


def call(name: str, hook: str, *arguments: Any) -> Any:
    """An equation as plain Python; where compilation is disabled it is that already."""
    function = EFFECTS[name].hooks[hook]
    return getattr(function, "py_func", function)(*arguments)


def numbers(name: str, h: float = H, **values: float) -> tuple[float, ...]:
    """q of an effect: neutral values but for those given in SI by the last part of their key."""
    effect, given = EFFECTS[name], dict(values)
    own = [given.pop(parameter.key.partition(".")[2], parameter.neutral_si) for parameter in effect.parameters]
    read = [given.pop(key.replace(".", "__"), given.pop(key.partition(".")[2], PLAIN[key])) for key in effect.reads]
    assert not given, given
    constants = call(name, "prepare", (*own, *read), h) if effect.prepared else ()
    assert len(constants) == len(effect.prepared)
    return (*own, *read, *constants)


def memory(effect: Effect, phi: float = 0.0, p: float = 0.0) -> tuple[float, ...]:
    """m at its start."""
    return tuple({"angle": phi, "pressure": p}.get(str(start), 0.0) for start in effect.starts.values())


def around(**columns: float) -> tuple[float, ...]:
    """What surrounds the joint: time, neighbour, inflow, angle, speed; 0 for what is not given."""
    places = {"time": TIME, "neighbour": NEIGHBOUR, "inflow": INFLOW, "angle": ANGLE, "speed": SPEED}
    e = [0.0] * EXOGENOUS
    for column, value in columns.items():
        e[places[column]] = value
    return tuple(e)


def torque(name: str, q: tuple[float, ...], phi: float, m: tuple[float, ...] | None = None, **other: Any) -> Any:
    """Torque and stiffness of an effect at an angle."""
    values = {"omega": 0.0, "p": 0.0, "creep_angle": 0.0, "e": REST} | other
    state = () if m is None else (m,)
    return call(name, "torque", q, *state, phi, values["omega"], values["p"], values["creep_angle"], values["e"])


def assert_stiffness(name: str, q: tuple[float, ...], m: tuple[float, ...] | None = None, **other: Any) -> None:
    """The stiffness is minus the slope of the torque over the angle."""
    for phi in (-0.4, 0.3, 1.2):
        step = 1e-5
        slope = (torque(name, q, phi + step, m, **other)[0] - torque(name, q, phi - step, m, **other)[0]) / (2 * step)
        assert torque(name, q, phi, m, **other)[1] == approx(-slope, rel=1e-5, abs=1e-9)


def assert_damping(name: str, q: tuple[float, ...], m: tuple[float, ...] | None = None, **other: Any) -> None:
    """The damping is minus the slope of the torque over the speed."""
    values: dict[str, Any] = {"p": 0.0, "creep_angle": 0.0, "e": REST} | other
    omega, state = values.pop("omega"), () if m is None else (m,)
    for phi in (-0.4, 0.0, 1.2):
        below, above = (torque(name, q, phi, m, omega=omega + step, **values)[0] for step in (-1e-5, 1e-5))
        found = call(name, "torque_damping", q, *state, phi, omega, values["p"], values["creep_angle"], values["e"])
        assert found == approx(-(above - below) / 2e-5, rel=1e-5, abs=1e-9)


def work(force: Array, way: Array) -> float:
    """Work of a force along a way, by the trapezoidal rule."""
    return float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(way)))


def triangle(amplitude: float, cycles: int, points: int = 4000) -> Array:
    """Cycles between -amplitude and amplitude that begin and end at -amplitude; `points` a branch."""
    up = np.linspace(-amplitude, amplitude, points + 1)
    return np.concatenate([np.concatenate([up[:-1], up[::-1][:-1]])] * cycles + [up[:1]])


def friction_along(name: str, q: tuple[float, ...], way: Array) -> Array:
    """Torque of an effect with memory of the motion, at every point of a way from the first one on."""
    m, torques = memory(EFFECTS[name], way[0]), [0.0]
    for before, after in pairwise(way):
        m = call(name, "moved", q, m, before, after, H)
        torques.append(torque(name, q, after, m, omega=(after - before) / H)[0])
    return np.array(torques)


def filtered(name: str, hook: str, q: tuple[float, ...], signal: Array) -> Array:
    """Output of a sensor's filter at every sample of a signal, from rest at its first value."""
    m, out = memory(EFFECTS[name], signal[0], signal[0]), [signal[0]]
    for value in signal[1:]:
        if hook == "actuator_pressure":
            y, m = call(name, hook, q, m, value, H)
        else:
            m = call(name, hook, q, m, value, H)
            y = call(name, "angle_reading", q, m, value)
        out.append(y)
    return np.array(out)


# Equations, one check per effect.


def supply_droop(_: Any) -> None:
    """Broken by a wrong deficit, sag, time constant or share passed on, or a set-point below 0."""
    q = numbers("supply_droop", deficit_pa=2e5)
    assert call("supply_droop", "set_point", q, (0.0,), 5e5, 0.0, REST, H)[0] == SUPPLY_PA - 2e5
    assert call("supply_droop", "set_point", q, (0.0,), 3e5, 0.0, REST, H)[0] == 3e5
    drawn, tau, u = 1e6, 0.2, 2e5
    q = numbers("supply_droop", resistance_s=0.1, time_constant_s=tau, share=0.4, ratio=0.5)
    m: tuple[float, ...] = (0.0,)
    for step in range(500):
        out, m = call("supply_droop", "set_point", q, m, u, 0.0, around(inflow=drawn), H)
        sag = 0.1 * drawn * (1.0 - np.exp(-(step + 0.5) * H / tau))
        assert out == approx(u - (0.4 + 0.5 * u / SUPPLY_PA) * sag, rel=1e-5)
        assert m[0] == approx(0.1 * drawn * (1.0 - np.exp(-(step + 1) * H / tau)), rel=1e-4)
    assert call("supply_droop", "set_point", q, m, 1e3, 0.0, around(inflow=drawn), H)[0] == 0.0
    nearly = call("supply_droop", "set_point", numbers("supply_droop", h=1e-9), (5e4,), SUPPLY_PA, 0.0, REST, 1e-9)[0]
    assert nearly == approx(SUPPLY_PA - 5e4, rel=1e-6)


def valve_hysteresis(_: Any) -> None:
    """Broken by a wrong side, width or area of the loop, or by another curve than Dahl's where it is rounded."""
    width, centre, amplitude = 5e3, 3e5, 4e4
    for soft in (0.0, 1.0):
        q, u = numbers("valve_hysteresis", width_pa=width, softness=soft), centre + triangle(amplitude, 2)
        m, out = (0.0, u[0], 0.0, 0.0), []
        for value in u:
            y, m = call("valve_hysteresis", "set_point", q, m, value, 0.0, REST, H)
            out.append(y)
        branch = np.array(out)[8000:12001]
        way = u[8000:12001] - u[8000]
        rounded = np.where(way < width, way - width, width * (1.0 - np.exp(-(way - width) / width)))
        behind = np.minimum(way - width, width) if soft == 0.0 else rounded
        np.testing.assert_allclose(u[8000:12001] - branch, behind, atol=30.0)
        back = np.array(out)[12000:16001]
        np.testing.assert_allclose(u[12000:16001] - back, -behind, atol=30.0)
    half = numbers("valve_hysteresis", width_pa=width, softness=0.5)
    (_, (behind_half, *_)) = call("valve_hysteresis", "set_point", half, (2.5e3, 0.0, 0.0, 0.0), 100.0, 0.0, REST, H)
    reach = width / 0.5
    assert behind_half == approx(reach - (reach - 2.5e3) * np.exp(-100.0 / reach), rel=1e-6)
    for q in (numbers("valve_hysteresis", width_pa=width, softness=soft) for soft in (0.0, 0.3, 1.0)):
        (_, at_once), parts = call("valve_hysteresis", "set_point", q, (-4e3, 0.0, 0.0, 0.0), 9e3, 0.0, REST, H), 7
        m = (-4e3, 0.0, 0.0, 0.0)
        for part in range(parts):
            (_, m) = call("valve_hysteresis", "set_point", q, m, 9e3 * (part + 1) / parts, 0.0, REST, H)
        assert m == approx(at_once, rel=2e-6)


def valve_lag(_: Any) -> None:
    """Broken by a wrong time constant or mean of the lag, or a venting ratio that acts on filling."""
    tau, step_pa = 0.03, 1e5
    q = numbers("valve_lag", time_constant_s=tau, venting_ratio=2.0)
    m = memory(EFFECTS["valve_lag"], p=2e5)
    for step in range(100):
        mean, m = call("valve_lag", "set_point", q, m, 2e5 + step_pa, 0.0, REST, H)
        begin, end = np.exp(-step * H / tau), np.exp(-(step + 1) * H / tau)
        assert m[0] == approx(2e5 + step_pa * (1.0 - end), rel=1e-5)
        assert mean == approx(2e5 + step_pa * (1.0 - tau / H * (begin - end)), rel=1e-5)
    for error in (0.5, 1e4):
        assert call("valve_lag", "valve_error", q, error) == error
        assert call("valve_lag", "valve_error", q, -error) == approx(-error / 2.0)


def valve_deadband(_: Any) -> None:
    """Broken by a wrong width, a wrong sign, or a gradual edge of another shape."""
    for width, error in np.random.default_rng(1).uniform((1e3, -3e4), (1e4, 3e4), (50, 2)):
        sharp = np.sign(error) * max(abs(error) - width, 0.0)
        beyond = max(abs(error) - 2.0 * width, 0.0)  # the square up to twice the width, then a straight line
        gradual = np.sign(error) * (beyond + min(abs(error), 2.0 * width) ** 2 / (4.0 * width))
        for soft in (0.0, 0.3, 1.0):
            felt = call(
                "valve_deadband", "valve_error", numbers("valve_deadband", width_pa=width, softness=soft), error
            )
            assert felt == approx((1.0 - soft) * sharp + soft * gradual, rel=1e-9, abs=1e-6)
    assert call("valve_deadband", "valve_error", numbers("valve_deadband", softness=1.0), 0.0) == 0.0


def iso_6358(ratio: float, critical: float) -> float:
    """Flow over the choked flow at a ratio of absolute pressures, ISO 6358-1."""
    return 1.0 if ratio <= critical else float(np.sqrt(1.0 - ((ratio - critical) / (1.0 - critical)) ** 2))


def valve_flow_limit(_: Any) -> None:
    """Broken by a limit not choked below the critical ratio of 0.3, not elliptic above, or of the other side."""
    full = SUPPLY_PA + ATMOSPHERE_PA
    for p in (0.0, 0.2 * full - ATMOSPHERE_PA, 0.65 * full - ATMOSPHERE_PA, 5.5e5):
        here = p + ATMOSPHERE_PA
        for choking in (0.0, 0.4, 1.0):
            q = numbers("valve_flow_limit", choking=choking)
            fill = 4e6 * (1.0 - choking + choking * iso_6358(here / full, 0.3))
            vent = 3e6 * (1.0 - choking + choking * iso_6358(ATMOSPHERE_PA / here, 0.3) * here / full)
            assert call("valve_flow_limit", "flow_limit", q, 4e6, p, True) == approx(fill, rel=1e-12)
            assert call("valve_flow_limit", "flow_limit", q, 3e6, p, False) == approx(vent, rel=1e-12)


def switching_valve(_: Any) -> None:
    """Broken by flow other than ISO 6358's, a mean rate other than the loop's, or motion without compression."""
    conductance, vented, growth = 3e-10, 2e-6, 1.2e-12
    q = numbers("switching_valve", share=1.0)
    p, m = 1e5, (0.0, 0.0, 0.0)
    after, m = call("switching_valve", "valve", q, m, p, 5e5, REST, H)  # far away: the fill valve is open all the time
    choked = 1e5 * conductance * (SUPPLY_PA + ATMOSPHERE_PA)
    assert after - p == approx(H * choked / (vented + growth * p + growth * (p + ATMOSPHERE_PA)), rel=1e-9)
    assert m == approx((0.009, 0.0, 0.009))
    after, m = call("switching_valve", "valve", q, (0.0, 0.0, 0.0), p, 0.0, REST, H)
    venting = 1e5 * conductance * (p + ATMOSPHERE_PA) * iso_6358(ATMOSPHERE_PA / (p + ATMOSPHERE_PA), 0.3)
    assert p - after == approx(H * venting / (vented + growth * p + growth * (p + ATMOSPHERE_PA)), rel=1e-9)
    stiff = (vented + growth * p + growth * (p + ATMOSPHERE_PA)) / vented  # the loop reckons with the vented volume
    for error, periods in ((4e4, 1), (8e3, 2)):  # the second needs a pulse that is too short alone and is saved up
        after, m = p, (0.0, 0.0, 0.0)
        for _ in range(10 * periods):
            after, m = call("switching_valve", "valve", q, m, after, p + error, REST, H)
        assert (after - p) * stiff == approx(error / 0.03 * 0.01 * periods, rel=0.03)  # (u - p) / response
    after, m = p, (1.0, 0.0, 0.0)  # closed for the next second
    for phi in np.linspace(0.0, 0.5, 2001):
        after, m = call("switching_valve", "valve", q, m, after, p, around(angle=phi, speed=0.5 / 2001 / 1e-4), 1e-4)
    held = (p + ATMOSPHERE_PA) * (vented + growth * p)
    volume = vented + growth * after + A2 * 0.5 + 0.5 * A3 * 0.25
    assert (after + ATMOSPHERE_PA) * volume == approx(held, rel=1e-3)
    assert call("switching_valve", "valve", q, (0.0, 0.0, 0.0), SUPPLY_PA, SUPPLY_PA + 1e5, REST, H)[0] == SUPPLY_PA
    assert call("switching_valve", "valve", q, (1.0, 0.0, -0.01), -5e3, 0.0, REST, H)[0] == -5e3  # nothing to vent
    tiny, closed = numbers("switching_valve", share=1.0, volume_m3=1e-7), (1.0, 0.0, 0.0)
    after, _ = call("switching_valve", "valve", tiny, closed, 0.0, 0.0, around(angle=-1.0, speed=0.1), 1e-5)
    smallest = 1e-7 + growth * ATMOSPHERE_PA  # the map's volume is negative here
    assert after == approx(-1e-5 * ATMOSPHERE_PA * (A2 - A3) * 0.1 / smallest)


def hydraulic(_: Any) -> None:
    """Broken by a wrong sign or factor: a closed chamber of liquid must keep its volume along any motion."""
    q, growth = numbers("hydraulic", share=1.0), 1.2e-12
    angles = np.linspace(0.0, 0.4, 4001)
    middle = 0.5 * (angles[1:] + angles[:-1])
    p = 3e5
    for phi in middle:
        p += H * call("hydraulic", "pressure_source", q, p, around(angle=phi, speed=(angles[1] - angles[0]) / H))
    assert growth * p + A2 * 0.4 + 0.5 * A3 * 0.16 == approx(growth * 3e5, rel=1e-6)
    half = numbers("hydraulic", share=0.5)
    assert call("hydraulic", "pressure_source", half, p, around(angle=0.4, speed=1.0)) == approx(
        -0.5 * (A2 + A3 * 0.4) / growth
    )


def leak(_: Any) -> None:
    """Broken by a gain instead of a loss, another law than exponential decay through a gap, or than Torricelli's."""
    for turbulent in (0.0, 1.0):
        q, p, rate = numbers("leak", rate_per_s=0.5, turbulent=turbulent), 4e5, 0.5
        for _ in range(2000):
            middle = p + 0.5 * H * call("leak", "pressure_source", q, p, REST)
            p += H * call("leak", "pressure_source", q, middle, REST)
        gap, hole = 4e5 * np.exp(-rate * 2.0), (np.sqrt(4e5) - 0.5 * rate * np.sqrt(1e5) * 2.0) ** 2
        assert p == approx(hole if turbulent else gap, rel=1e-6)
        assert call("leak", "pressure_source", q, 1e5, REST) == approx(-rate * 1e5)
    assert call("leak", "pressure_source", numbers("leak", rate_per_s=0.5, turbulent=1.0), -1e4, REST) == 0.0
    mixed = numbers("leak", rate_per_s=0.5, turbulent=0.25)
    assert call("leak", "pressure_source", mixed, 4e5, REST) == approx(-0.5 * (0.75 * 4e5 + 0.25 * 2e5))


def two_lags(name: str, hook: str) -> None:
    """A ramp and a step through one lag and through two in series, whose time constants are known."""
    tau, time = 0.04, H * np.arange(300)
    ramp = 7.0 + 3.0 * time
    step: Array = np.sign(time)
    for second in (0.0, 0.25):
        a, b = (1.0 - second) * tau, second * tau
        q = numbers(name, time_constant_s=tau, second=second)
        out = filtered(name, hook, q, np.asarray(ramp, dtype=np.float64))
        slow = (a**2 * np.exp(-time / a) - (b**2 * np.exp(-time / b) if b else 0.0)) / (a - b)
        np.testing.assert_allclose(out, 7.0 + 3.0 * (time - tau + slow), atol=1e-5)
        out = filtered(name, hook, q, step)
        left = (a * np.exp(-(time - 0.5 * H) / a) - (b * np.exp(-(time - 0.5 * H) / b) if b else 0.0)) / (a - b)
        np.testing.assert_allclose(out[5:], 1.0 - left[5:], atol=2e-3)


def tube_lag(_: Any) -> None:
    """Broken by a wrong time constant of a volume, a wrong order of the lags or a memory that is not kept."""
    two_lags("tube_lag", "actuator_pressure")


def chamber(p: float, phi: float) -> float:
    """Volume [m^3] of the chamber at a gauge pressure and an angle."""
    return 2e-6 + 1.2e-12 * p + A2 * phi + 0.5 * A3 * phi * phi


def gas_compression(_: Any) -> None:
    """Broken by a wrong sign, by gauge instead of absolute pressure or by a volume other than Eq. 7's."""
    cold = memory(EFFECTS["gas_compression"])
    for exponent in (1.0, 1.3):
        q = numbers("gas_compression", exponent=exponent)
        angles = np.linspace(0.6, 0.1, 4001)
        p, speed = 2e5, (angles[1] - angles[0]) / H
        for before, after in pairwise(angles):
            first = call("gas_compression", "pressure_source", q, cold, p, around(angle=before, speed=speed))
            trial = p + 0.5 * H * first
            middle = 0.5 * (before + after)
            p += H * call("gas_compression", "pressure_source", q, cold, trial, around(angle=middle, speed=speed))
        assert p > 2e5  # extending closes the chamber
        held = (2e5 + ATMOSPHERE_PA) * chamber(2e5, 0.6) ** exponent
        assert (p + ATMOSPHERE_PA) * chamber(p, 0.1) ** exponent == approx(held, rel=1e-7)
    tiny = numbers("gas_compression", exponent=1.0, volume_m3=1e-7)
    closed = call("gas_compression", "pressure_source", tiny, cold, 0.0, around(angle=-1.0, speed=1.0))
    smallest = 1e-7 + 1.2e-12 * ATMOSPHERE_PA  # the map's volume is negative here
    assert closed == approx(-ATMOSPHERE_PA * (A2 - A3) / smallest)
    still = call("gas_compression", "pressure_source", numbers("gas_compression", exponent=1.0), cold, 2e5, REST)
    assert still == 0.0


def dahl_loss(height: float, scale: float, amplitude: float) -> float:
    """Energy per cycle of Dahl's loop, 4 T (A - s tanh(A / s))."""
    return 4.0 * height * (amplitude - scale * float(np.tanh(amplitude / scale)))


def hysteresis(_: Any) -> None:
    """Broken by a loop that gives energy, loses another one than Dahl's closed form, or bends otherwise than tanh."""
    height, scale, amplitude = 0.02, 0.1, 0.4
    q = numbers("hysteresis", torque_nm=height, scale_deg=scale)
    way = triangle(amplitude, 4)
    torques = friction_along("hysteresis", q, way)
    assert -work(torques[-8001:], way[-8001:]) == approx(dahl_loss(height, scale, amplitude), rel=2e-3)
    virgin = np.linspace(0.0, 0.5, 5001)
    np.testing.assert_allclose(
        -friction_along("hysteresis", q, virgin), height * (1.0 - np.exp(-virgin / scale)), atol=5e-4 * height
    )
    sharp = numbers("hysteresis", torque_nm=height, scale_deg=scale, sharpness=1.0)
    np.testing.assert_allclose(
        -friction_along("hysteresis", sharp, virgin), height * np.tanh(virgin / scale), atol=5e-4 * height
    )
    back = np.concatenate([np.linspace(0.0, 0.5, 5001), np.linspace(0.5, 0.42, 801)[1:]])
    unloading = -friction_along("hysteresis", sharp, back)[5000:]  # with exponent 2 it unloads along a straight line
    np.testing.assert_allclose(unloading, height * (np.tanh(5.0) - np.linspace(0.0, 0.8, 801)), atol=5e-4 * height)
    for values, slope in ((q, 1.0 - 0.3), (sharp, 1.0 - 0.3**2)):
        assert torque("hysteresis", values, 0.0, (0.3, *6 * (0.0,)), omega=1.0)[1] == approx(height / scale * slope)
    assert torque("hysteresis", q, 0.0, (0.3, *6 * (0.0,)), omega=-1.0)[1] == approx(height / scale * 1.3)
    assert torque("hysteresis", sharp, 0.0, (0.3, *6 * (0.0,)), omega=-1.0)[1] == approx(height / scale)


def stiffening(_: Any) -> None:
    """Broken by a wrong sign, power or factor of a term of the series, or of the stiffness that belongs to it."""
    terms = {"quadratic_nm_per_rad2": 0.03, "cubic_nm_per_rad3": 0.02, "mixed_nm_per_pa_rad2": 6e-8}
    q = numbers("stiffening", **terms, square_nm_per_pa2=2e-13)
    for phi in (-0.5, 0.7, 1.3):
        series = np.polyval([-0.02, -0.03 + 6e-8 * 2e5, 0.0, 2e-13 * 4e10], phi)
        assert torque("stiffening", q, phi, p=2e5)[0] == approx(series)
    assert_stiffness("stiffening", q, p=2e5)


def ageing(_: Any) -> None:
    """Broken by a share that does not grow with time, or by elasticity and strength exchanged."""
    q = numbers("ageing", stiffness_per_h=0.2 / 3600.0, strength_per_h=-0.1 / 3600.0)
    phi, creep, p = 0.8, 0.2, 3e5
    for hours in (0.0, 1.0, 2.5):
        aged = A1 * (1.0 + 0.2 * hours) * (phi - creep) + (A2 + A3 * phi) * (1.0 - 0.1 * hours) * p
        fresh = A1 * (phi - creep) + (A2 + A3 * phi) * p
        surroundings = around(time=3600.0 * hours)
        added, _ = torque("ageing", q, phi, (0.0,), p=p, creep_angle=creep, e=surroundings)
        assert added == approx(aged - fresh, abs=1e-15)
        assert_stiffness("ageing", q, (0.0,), p=p, creep_angle=creep, e=surroundings)


def thermal_drift(_: Any) -> None:
    """Broken by cooling instead of warming, a wrong time constant, or warmth that stiffens where it should soften."""
    tau = 50.0
    q, m = numbers("thermal_drift", h=0.05, torque_nm=0.01, softening=0.3, time_constant_s=tau), (0.0, 0.0, 0.0)
    for step in range(1, 2001):
        m = call("thermal_drift", "moved", q, m, 0.0, 0.0, 0.05)
        assert m[0] == approx(1.0 - np.exp(-step * 0.05 / tau), abs=1e-6)
    phi, creep = 0.9, 0.2
    whole = A1 * (phi - creep) + torque("thermal_drift", q, phi, m, creep_angle=creep)[0]
    assert whole == approx(0.01 * m[0] + A1 * (1.0 - 0.3 * m[0]) * (phi - creep), rel=1e-9)
    assert_stiffness("thermal_drift", q, m, creep_angle=creep)


def coulomb_friction(_: Any) -> None:
    """Broken by a level other than Stribeck's, a share lost between rigid and yielding contacts, or another loop."""
    level = {"torque_nm": 0.02, "breakaway_nm": 0.01, "torque_nm_per_pa": 2e-8, "stribeck_rad_per_s": 0.5}
    rigid = numbers("coulomb_friction", **level)
    for omega, p in ((0.0, 1e5), (0.5, 0.0), (-0.5, 3e5), (40.0, -1e4)):
        expected = 0.02 + 0.01 / (1.0 + (omega / 0.5) ** 2) + 2e-8 * abs(p)  # a drive loads its bearings either way
        assert call("coulomb_friction", "dry", rigid, (0.0,), 0.4, omega, p) == approx(expected)
        assert torque("coulomb_friction", rigid, 0.0, (0.7,), omega=omega, p=p) == (approx(0.0), approx(0.0))
        for presliding, yielding in ((0.02, 0.0), (0.035, 0.5), (0.05, 1.0), (0.5, 1.0)):
            q = numbers("coulomb_friction", **level, presliding_deg=np.radians(presliding))
            assert call("coulomb_friction", "dry", q, (0.0,), 0.4, omega, p) == approx(
                (1.0 - yielding) * expected, abs=1e-12
            )
            bristle = torque("coulomb_friction", q, 0.0, (0.7,), omega=omega, p=p)[0]
            assert bristle == approx(-0.7 * yielding * expected, abs=1e-12)
    scale = np.radians(0.5)
    q, way = numbers("coulomb_friction", torque_nm=0.02, presliding_deg=scale), triangle(3.0 * scale, 3)
    torques = friction_along("coulomb_friction", q, way)
    assert -work(torques[-8001:], way[-8001:]) == approx(dahl_loss(0.02, scale, 3.0 * scale), rel=2e-3)
    assert torque("coulomb_friction", q, 0.0, (0.4,), omega=1.0)[1] == approx(0.02 / scale * 0.6)


def viscous_friction(_: Any) -> None:
    """Broken by drag that is not quadratic in the speed or depends on its sign."""
    q = numbers("viscous_friction", quadratic_nm_s2_per_rad2=3e-3)
    for omega in (-4.0, 0.0, 2.5):
        assert call("viscous_friction", "damping", q, omega) * omega == approx(3e-3 * omega**2 * np.sign(omega))


def backlash(_: Any) -> None:
    """Broken by another gap than the one given, by a driven side outside of it, or a contact of another time."""
    gap, amplitude = 0.05, 0.4
    q, phi = numbers("backlash", gap_deg=gap), triangle(amplitude, 2)
    link = filtered("backlash", "angle_sensor", q, phi)
    assert np.abs(link - phi).max() == approx(0.5 * gap)
    loop = slice(8000, 16001)
    assert abs(work(link[loop], phi[loop])) == approx(2.0 * gap * amplitude - gap * gap, rel=1e-3)
    np.testing.assert_allclose(link[11000:12001], phi[11000:12001] - 0.5 * gap, atol=1e-12)
    tau, time = 0.02, H * np.arange(200)
    q = numbers("backlash", gap_deg=gap, contact_time_s=tau)
    pushed = filtered("backlash", "angle_sensor", q, np.where(time > 0.0, 0.3, 0.0))
    np.testing.assert_allclose(pushed[5:], (0.3 - 0.5 * gap) * (1.0 - np.exp(-(time[5:] - 0.5 * H) / tau)), atol=1e-3)


def gravity(_: Any) -> None:
    """Broken by sine and cosine exchanged, a wrong sign, or a swing that gains or loses energy."""
    q = numbers("gravity", sine_nm=0.03, cosine_nm=0.01)
    assert torque("gravity", q, 0.0) == (approx(-0.01), approx(0.03))
    assert torque("gravity", q, 0.5 * np.pi) == (approx(-0.03), approx(-0.01, abs=1e-7))
    assert torque("gravity", q, np.pi)[0] == approx(0.01, rel=1e-5)
    assert torque("gravity", q, 7.0)[0] == approx(-0.03 * np.sin(7.0) - 0.01 * np.cos(7.0), rel=1e-5)
    assert_stiffness("gravity", q)
    inertia, phi, omega, h = 1e-4, 1.2, 0.0, 1e-4
    energies = []
    for _ in range(6000):  # leapfrog: several swings
        omega += 0.5 * h * torque("gravity", q, phi)[0] / inertia
        phi += h * omega
        omega += 0.5 * h * torque("gravity", q, phi)[0] / inertia
        energies.append(0.5 * inertia * omega**2 - 0.03 * np.cos(phi) + 0.01 * np.sin(phi))
    assert np.ptp(energies) < 1e-5 * 0.03


def joint_coupling(_: Any) -> None:
    """Broken by a neighbour that pushes where it should pull, a wrong ratio, or an arm that does not shrink."""
    values = {"stiffness_nm_per_rad": 0.02, "ratio": 0.5}
    plain, soft = numbers("joint_coupling", **values), numbers("joint_coupling", **values, softening=0.3)
    for phi, neighbour in ((0.0, 0.6), (0.8, 0.4), (0.5, -0.7)):
        e, stretch = around(neighbour=neighbour), neighbour - 0.5 * phi
        assert torque("joint_coupling", plain, phi, e=e)[0] == approx(0.02 * stretch)
        assert torque("joint_coupling", soft, phi, e=e)[0] == approx(0.02 * (stretch - 0.3 * stretch**3))
        assert_stiffness("joint_coupling", soft, e=e)
    assert torque("joint_coupling", soft, 0.0, e=around(neighbour=1.0))[0] == approx(0.02 * (1.0 - 0.3))


def hall_misalignment(_: Any) -> None:
    """Broken by a harmonic that is not that of the angle or of twice the angle."""
    sizes = np.array([0.01, 0.02, 0.03, 0.04])
    names = ("sine_deg", "cosine_deg", "sine_2_deg", "cosine_2_deg")
    q = numbers("hall_misalignment", **dict(zip(names, sizes.tolist(), strict=True)))
    for phi in (-0.5, 0.4, 2.0):
        harmonics = np.array([np.sin(phi), np.cos(phi), np.sin(2 * phi), np.cos(2 * phi)])
        assert call("hall_misalignment", "angle_reading", q, phi) == approx(phi + sizes @ harmonics, abs=1e-7)


def angle_gain(_: Any) -> None:
    """Broken by an error that is not relative, or has the wrong sign."""
    assert call("angle_gain", "angle_reading", numbers("angle_gain", error=0.05), 0.8) == approx(0.84)


def angle_offset(_: Any) -> None:
    """Broken by an offset with the wrong sign."""
    assert call("angle_offset", "angle_reading", numbers("angle_offset", offset_deg=0.1), 0.8) == approx(0.9)


def angle_lag(_: Any) -> None:
    """Broken by a wrong time constant of a filter, a wrong order of the filters or a memory that is not kept."""
    two_lags("angle_lag", "angle_sensor")


def pressure_gain(_: Any) -> None:
    """Broken by an error that is not relative, has the wrong sign, or is not taken back."""
    q = numbers("pressure_gain", error=0.25)
    assert call("pressure_gain", "pressure_reading", q, 2e5) == approx(2.5e5)
    assert call("pressure_gain", "pressure_true", q, 2.5e5) == approx(2e5)


def pressure_offset(_: Any) -> None:
    """Broken by an offset with the wrong sign, or one that is not taken back."""
    q = numbers("pressure_offset", offset_pa=5e3)
    assert call("pressure_offset", "pressure_reading", q, 2e5) == approx(2.05e5)
    assert call("pressure_offset", "pressure_true", q, 2.05e5) == approx(2e5)


def fsr_drift(_: Any) -> None:
    """Broken by a wrong time constant, sign or share of the creep under a force that lasts."""
    period, tau, force = 0.005, 2.0, 3.0
    q, m = numbers("fsr_drift", share=0.4, time_constant_s=tau), (0.0,)
    for sample in range(1, 1201):
        m = call("fsr_drift", "force_sensor", q, m, force, period)
        expected = force * (1.0 + 0.4 * (1.0 - np.exp(-sample * period / tau)))
        assert call("fsr_drift", "force_reading", q, m, force) == approx(expected, rel=1e-5)
    slow = numbers("fsr_drift", share=0.4, time_constant_s=0.1)
    assert call("fsr_drift", "force_sensor", slow, (0.0,), force, 10.0)[0] == force  # never beyond the force


def fsr_hysteresis(_: Any) -> None:
    """Broken by a reading ahead of a rising force, a loop of another size, or one that turns over another change."""
    q, m = numbers("fsr_hysteresis", share=0.2, turn_n=0.5), (0.0, 0.0)
    forces = np.concatenate([np.linspace(0.0, 5.0, 501), np.linspace(5.0, 1.0, 401)[1:]])
    readings = []
    for force in forces:
        m = call("fsr_hysteresis", "force_sensor", q, m, force, H)
        readings.append(call("fsr_hysteresis", "force_reading", q, m, force))
    side = np.concatenate([np.minimum(forces[:501] / 0.5, 1.0), np.maximum(1.0 - (5.0 - forces[501:]) / 0.5, -1.0)])
    np.testing.assert_allclose(readings, forces * (1.0 - 0.2 * side), atol=1e-9)


def fsr_gain(_: Any) -> None:
    """Broken by an error that is not relative, or has the wrong sign."""
    assert call("fsr_gain", "force_reading", numbers("fsr_gain", error=-0.3), 2.0) == approx(1.4)


def unnamed_torque(_: Any) -> None:
    """Broken by a knot at a wrong place, a curve that goes on beyond its ends, a wrong state, period or stiffness."""
    rng = np.random.default_rng(3)
    heights = dict(zip([f"knot_{k}_nm" for k in range(8)], rng.normal(size=8), strict=True))
    surroundings = around(time=4.0, neighbour=-0.3)
    states = {"angle_per_rad": 0.7, "speed_s_per_rad": -2.0, "pressure_per_pa": 3e5, "time_per_s": 4.0}
    for key, value in (states | {"neighbour_per_rad": -0.3}).items():
        for low in (value - 0.21, value - 0.6, value + 0.2, value - 2.0):
            q = numbers("unnamed_torque", **heights, **{key: 1.0}, offset=-low)
            arguments: dict[str, Any] = {"omega": -2.0, "p": 3e5, "e": surroundings}
            expected = np.interp(value - low, np.linspace(0.0, 1.0, 8), list(heights.values()))
            assert torque("unnamed_torque", q, 0.7, **arguments)[0] == approx(expected, abs=1e-9)
            assert_stiffness("unnamed_torque", q, omega=-2.0, p=3e5, e=surroundings)
    q = numbers("unnamed_torque", angle_per_rad=14.0 / (2.0 * np.pi), sine_nm=0.3, cosine_nm=-0.2)
    for phi in np.linspace(-0.2, 1.5, 12):
        expected = 0.3 * np.sin(14.0 * phi) - 0.2 * np.cos(14.0 * phi)
        assert torque("unnamed_torque", q, phi)[0] == approx(expected, abs=1e-6)
    assert_stiffness("unnamed_torque", q)


def unnamed_pressure(_: Any) -> None:
    """Broken by a knot at a wrong place, a wrong state or period, or a set-point that is replaced and not shifted."""
    rng = np.random.default_rng(4)
    heights = dict(zip([f"knot_{k}_pa" for k in range(8)], 1e4 * rng.normal(size=8), strict=True))
    u, p, surroundings = 2e5, 3e5, around(time=4.0, angle=0.7)
    for key, value in {"set_point_per_pa": u, "pressure_per_pa": p, "time_per_s": 4.0, "angle_per_rad": 0.7}.items():
        for share in (0.2, 0.63, -0.1, 1.4):
            q = numbers("unnamed_pressure", **heights, **{key: 1.0}, offset=share - value)
            expected = u + np.interp(share, np.linspace(0.0, 1.0, 8), list(heights.values()))
            assert call("unnamed_pressure", "set_point", q, u, p, surroundings, H) == approx(expected, abs=1e-3)
    for time_s in (0.0, 0.1, 0.33, 7.2):
        q = numbers("unnamed_pressure", time_per_s=1.7, sine_pa=2e3, cosine_pa=1e3)
        phase = 2.0 * np.pi * 1.7 * time_s
        expected = u + 2e3 * np.sin(phase) + 1e3 * np.cos(phase)
        assert call("unnamed_pressure", "set_point", q, u, p, around(time=time_s), H) == approx(expected, abs=0.01)


# Wrong numbers of the plain plant: on one joint of it.

STATICS = {
    "statics__a0_nm": 0.0,
    "statics__a1_nm_per_rad": A1,
    "statics__a2_nm_per_pa": A2,
    "statics__a3_nm_per_pa_rad": A3,
}
P, PHI, OMEGA = range(3)


def rest_angle(joint: Any, pressure_pa: float, **changes: float) -> float:
    """Angle at which one joint rests under a constant pressure, without creep."""
    values = STATICS | {"material__phi_max_deg": 0.0, "dynamics__viscous_friction_nm_s_per_rad": 2e-3} | changes
    return float(joint.run(np.full((600, 1), pressure_pa), **values)[-1, PHI, 0])


def valve_delay(joint: Any) -> None:
    """Broken by a pressure that reacts before its dead time is over, or later."""
    early = joint.run(np.full((60, 1), 2e5), 0.001, valve__dead_time_s=0.02)[:, P, 0]
    late = joint.run(np.full((60, 1), 2e5), 0.001, valve__dead_time_s=0.03)[:, P, 0]
    assert np.all(early[:21] == 0.0)
    assert early[21] > 0.0
    np.testing.assert_allclose(late[10:], early[:-10], atol=1e-6)


def creep(joint: Any) -> None:
    """Broken by creep that moves the rest angle otherwise than Eq. 11, A' = 0 at A = b1 (p - p_min)."""
    p, reach = 3e5, 0.5
    values = STATICS | {"material__phi_max_deg": reach, "material__extension_time_s": 0.5}
    states = joint.run(np.full((2000, 1), p), **values)
    start, per_pa = (joint.parameters()[ROW[f"material.{key}"], 0] for key in ("p_min_pa", "b1_per_pa"))
    ratio = per_pa * (p - start)
    assert states[-1, 3, 0] == approx(ratio, rel=1e-4)
    assert states[-1, PHI, 0] == approx(-(A2 * p - A1 * ratio * reach) / (A1 + A3 * p), rel=1e-4)


def end_stop(joint: Any) -> None:
    """Broken by a stop that acts before its angle, holds with another stiffness, or pulls."""
    stop, stiff, width = 0.5, 5.0, 0.02
    values = {"end_stop__high_deg": stop, "end_stop__stiffness_nm_per_rad": stiff, "end_stop__engagement_deg": width}
    phi = rest_angle(joint, 3e5, **values)
    depth = phi - stop
    spring = stiff * (0.5 * depth * depth / width if depth < width else depth - 0.5 * width)
    assert A1 * phi + (A2 + A3 * phi) * 3e5 == approx(spring, rel=1e-3)
    assert rest_angle(joint, 3e4, **values) == approx(-A2 * 3e4 / (A1 + A3 * 3e4), rel=1e-6)


def contact(joint: Any) -> None:
    """Broken by an obstacle that acts before its angle, holds with another stiffness, or pulls."""
    wall, stiff, width = 0.6, 0.3, 0.1
    values = {"contact__angle_deg": wall, "contact__stiffness_nm_per_rad": stiff, "contact__engagement_deg": width}
    phi = rest_angle(joint, 3e5, **values)
    depth = phi - wall
    spring = stiff * (0.5 * depth * depth / width if depth < width else depth - 0.5 * width)
    assert A1 * phi + (A2 + A3 * phi) * 3e5 == approx(spring, rel=1e-3)
    assert rest_angle(joint, 3e4, **values) == approx(-A2 * 3e4 / (A1 + A3 * 3e4), rel=1e-6)


def constant_load(joint: Any) -> None:
    """Broken by a load that helps flexion, or has another size than Eq. 8's M_d."""
    phi = rest_angle(joint, 1e5, constant_load__torque_nm=0.01)
    assert A1 * phi + (A2 + A3 * phi) * 1e5 == approx(0.01, rel=1e-4)


def added_inertia(joint: Any) -> None:
    """Broken by an inertia that does not divide the torque: half the acceleration for twice the inertia."""
    start = np.array([[0.0], [0.4], [0.0], [0.0]])
    values = STATICS | {"material__phi_max_deg": 0.0, "dynamics__viscous_friction_nm_s_per_rad": 0.0}
    for inertia in (1e-3, 2e-3):
        state = joint.run(np.zeros((1, 1)), 1e-3, start, dynamics__inertia_kg_m2=inertia, **values)[-1]
        assert state[OMEGA, 0] == approx(A1 * 0.4 / inertia * 1e-3, rel=1e-3)


def clock_offset(joint: Any) -> None:
    """Broken by a shift of the pressures against the set-points or the angles other than the offset and its share."""
    time = PERIOD_S * np.arange(400)
    command, pressure = 2e5 + 1e5 * np.sign(np.sin(9.0 * time)), 2e5 + 1e5 * np.sin(9.0 * time)
    offset, share, samples = 0.01, 0.25, 2

    def predicted(measured: Array, **changes: float) -> Array:
        start = np.array([[2e5, 0.5, 0.0, 0.0]])
        surroundings = np.zeros((len(measured), EXOGENOUS))
        columns = joint.parameters(**changes).T
        inputs = MeasuredInputs(command[: len(measured)], measured, surroundings, PERIOD_S)
        readings: Array = open_loop(columns, start, inputs)[0]
        return readings

    shifted = predicted(pressure, clock_offset__offset_s=offset, clock_offset__share=share)
    late = predicted(pressure, valve__dead_time_s=joint.parameters()[ROW["valve.dead_time_s"], 0] + offset * share)
    np.testing.assert_allclose(shifted[0], late[0], atol=1e-6)
    later = predicted(pressure[samples:])
    np.testing.assert_allclose(shifted[1, : -2 * samples], later[1, :-samples], atol=1e-9)


def command_delay(joint: Any) -> None:
    """Broken by a shift of the inputs other than the dead time, or one that moves the set-points."""
    time = PERIOD_S * np.arange(400)
    command, pressure = np.full(400, 2e5), 2e5 + 1e5 * np.sin(9.0 * time)

    def predicted(measured: Array, **changes: float) -> Array:
        surroundings = np.zeros((len(measured), EXOGENOUS))
        inputs = MeasuredInputs(command[: len(measured)], measured, surroundings, PERIOD_S)
        readings: Array = open_loop(joint.parameters(**changes).T, np.array([[2e5, 0.5, 0.0, 0.0]]), inputs)[0]
        return readings

    late, plain = predicted(pressure, command_delay__dead_time_s=0.02), predicted(np.r_[np.full(4, 2e5), pressure[:-4]])
    np.testing.assert_allclose(late, plain, atol=1e-9)


def directional_friction(_: Any) -> None:
    """Broken by friction against the motion other than all of it forward and none back, or one that can push."""
    name = "directional_friction"
    for level, drag in ((0.02, 0.003), (-0.02, -0.003), (0.02, -0.003)):
        q = numbers(name, torque_nm=level, drag_nm_s_per_rad=drag)
        for omega in (2.0, -2.0):
            dry = np.sign(omega) * call(name, "dry", q, 0.3, omega, 0.0)
            against = dry - torque(name, q, 0.3, omega=omega)[0] + call(name, "damping", q, omega) * omega
            slides = (level > 0.0) == (omega > 0.0), (drag > 0.0) == (omega > 0.0)
            expected = np.sign(omega) * (abs(level) * slides[0] + abs(drag * omega) * slides[1])
            assert against == approx(expected, abs=1e-12)
            assert against * omega >= 0.0
        assert call(name, "damping", q, 0.0) == approx(0.5 * abs(drag))


def cogging(_: Any) -> None:
    """Broken by another period or phase, or a torque that is not the slope of an energy."""
    period = np.radians(12.0)
    q = numbers("cogging", sine_nm=0.03, cosine_nm=-0.01, period_deg=period)
    for phi in (0.0, 0.1, 1.7, -3.0):
        turns = 2.0 * np.pi * phi / period
        assert torque("cogging", q, phi)[0] == approx(0.03 * np.sin(turns) - 0.01 * np.cos(turns), abs=1e-6)
        assert torque("cogging", q, phi + period)[0] == approx(torque("cogging", q, phi)[0], abs=1e-6)
    assert_stiffness("cogging", q)


def drive_saturation(_: Any) -> None:
    """Broken by a torque beyond the limit, one that is changed below it, or a limit on what is not of the drive."""
    q = numbers("drive_saturation", limit_nm=0.1)
    for p, phi in ((1e5, 0.2), (4e5, 0.2), (-4e5, 0.5)):
        asked = (A2 + A3 * phi) * p
        assert asked + torque("drive_saturation", q, phi, p=p)[0] == approx(np.clip(asked, -0.1, 0.1))
    q = numbers("drive_saturation", limit_nm=0.1, stiffness_nm_per_rad=2.0, damping_nm_s_per_rad=0.05)
    for p, phi, omega in ((1e5, 0.0, 0.0), (1e5, 0.2, 1.0), (1e5, -0.3, 4.0), (0.0, 0.01, 0.2)):
        asked = (A2 + A3 * phi) * p - 2.0 * phi - 0.05 * omega
        added, stiffness = torque("drive_saturation", q, phi, omega=omega, p=p)
        assert asked + added == approx(np.clip(asked, -0.1, 0.1), abs=1e-12)
        assert stiffness == approx(0.0 if abs(asked) <= 0.1 else A3 * p - 2.0)
    assert_stiffness("drive_saturation", numbers("drive_saturation", limit_nm=0.01), p=4e5)
    q = numbers("drive_saturation", limit_nm=0.1, fall_nm_s_per_rad=0.02)
    for omega, low, high in ((2.0, -0.1, 0.06), (-3.0, -0.04, 0.1), (9.0, -0.1, 0.0)):
        for p in (4e5, -4e5):
            asked = A2 * p
            assert asked + torque("drive_saturation", q, 0.0, omega=omega, p=p)[0] == approx(np.clip(asked, low, high))
            assert_damping("drive_saturation", q, omega=omega, p=p)


def drive_gain(_: Any) -> None:
    """Broken by another share of what input and controller ask for, or one that is not limited with it."""
    scale = {"drive_saturation__stiffness_nm_per_rad": 2.0, "drive_saturation__damping_nm_s_per_rad": 0.05}
    q = numbers("drive_gain", error=0.3, **scale)
    asked = (A2 + A3 * 0.4) * 2e5 - 2.0 * 0.4 - 0.05 * 3.0
    assert torque("drive_gain", q, 0.4, omega=3.0, p=2e5)[0] == approx(0.3 * asked)
    assert_stiffness("drive_gain", q, p=2e5)
    limited = numbers("drive_saturation", limit_nm=0.1, drive_gain__error=0.3)
    both = A2 * 3e5 + torque("drive_gain", numbers("drive_gain", error=0.3), 0.0, p=3e5)[0]
    assert both + torque("drive_saturation", limited, 0.0, p=3e5)[0] == approx(0.1)


def gear_friction(_: Any) -> None:
    """Broken by another share of a torque, one of the wrong side, or a law that is not the Stribeck form it states."""
    name, phi, p = "gear_friction", 0.4, 2e5
    drive = (A2 + A3 * phi) * p
    load = -0.06 * np.sin(phi) + 0.02 * np.cos(phi) + (A1 - 0.03) * phi - 0.01

    def level(omega: float, p: float = p, **given: float) -> Any:
        return call(name, "dry", numbers(name, **given), (phi,), phi, omega, p)

    assert level(1.0, per_drive=0.2) == approx(0.2 * drive, rel=1e-5)
    assert level(1.0, p=-p, per_drive=0.2) == approx(0.2 * drive, rel=1e-5)
    assert level(1.0, per_load=0.3) == approx(0.3 * abs(load), rel=1e-5)
    assert level(1.0, per_drive=0.2, limit_nm=0.01) == approx(0.2 * 0.01)
    controlled = {"drive_saturation__stiffness_nm_per_rad": 0.04, "drive_saturation__damping_nm_s_per_rad": 0.005}
    asked = drive - 0.04 * phi - 0.005 * 1.0
    assert level(1.0, per_drive=0.2, drive_gain__error=0.5, **controlled) == approx(0.2 * 1.5 * asked, rel=1e-5)
    assert level(1.0, per_load=0.3, **controlled) == approx(0.3 * abs(load + 0.04 * phi), rel=1e-5)
    both = {"per_drive": 0.2, "per_load": 0.3}
    sliding = level(50.0, **both)
    for omega in (0.0, 0.1, 0.5):
        expected = sliding * (1.0 + 0.8 / (1.0 + (omega / 0.1) ** 2))
        assert level(omega, **both, at_rest=0.8, stribeck_rad_per_s=0.1) == approx(expected, rel=1e-4)
    assert (load < 0.0, level(-1.0, **both, back=0.5)) == (True, approx(1.5 * sliding))
    assert level(1.0, **both, back=0.5) == approx(sliding)
    assert call(name, "moved", numbers(name), (0.0,), 0.3, 0.4, H) == (approx(0.45),)
    assert level(1.0, **both, growth=0.4) == approx(sliding * (1.0 + 0.4 * (drive + abs(load)) / 0.5), rel=1e-5)


def spring(_: Any) -> None:
    """Broken by a torque that is not Hooke's, or by a spring of one sign only."""
    for stiffness in (0.2, -0.2):
        q = numbers("spring", stiffness_nm_per_rad=stiffness)
        assert torque("spring", q, 0.4)[0] == approx(-0.4 * stiffness)
        assert_stiffness("spring", q)


def swinging(gap: float, at_load: float, h: float) -> tuple[Array, Array, Array]:
    """Readings, and angles of drive and load, of a drive that moves along a chirp, by the equations of the effect."""
    q = numbers(
        "drive_elasticity", h, share=0.6, frequency_hz=6.0, damping=0.1, gap_deg=gap, at_load=at_load
    )  # fmt: skip
    time = np.arange(0.0, 1.0, h)
    drive = 0.3 * np.sin(2.0 * np.pi * (2.0 + 4.0 * time) * time)
    m, loads, readings = memory(EFFECTS["drive_elasticity"], drive[0]), [drive[0]], [drive[0]]
    for before, after in pairwise(drive):
        m = call("drive_elasticity", "moved", q, m, before, after, h)
        loads.append(m[0])
        readings.append(call("drive_elasticity", "angle_reading", q, m, after))
    return np.array(readings), drive, np.array(loads)


def drive_elasticity(_: Any) -> None:
    """Broken by another resonance, damping, gap or inertia, or a torque on the drive that is not that on the load."""
    rate, h = 2.0 * np.pi * 6.0, 2e-4
    for gap in (0.0, 0.05):
        readings, drive, load = swinging(gap, 1.0, h)
        np.testing.assert_allclose(readings, load, rtol=1e-12, atol=1e-15)
        np.testing.assert_array_equal(swinging(gap, 0.0, h)[0], drive)

        def rates(t: float, y: Array, gap: float = gap) -> list[float]:
            phase = 2.0 * np.pi * (2.0 + 4.0 * t) * t
            angle, speed = 0.3 * np.sin(phase), 0.3 * np.cos(phase) * 2.0 * np.pi * (2.0 + 8.0 * t)
            ahead = y[0] - angle
            wound = np.sign(ahead) * max(abs(ahead) - 0.5 * gap, 0.0)
            loss = 2.0 * 0.1 * rate * (y[1] - speed) * (abs(ahead) >= 0.5 * gap)
            return [y[1], -rate * rate * wound - loss]

        exact = solve_ivp(rates, (0.0, 1.0), [0.0, 0.0], "LSODA", h * np.arange(len(load)), max_step=1e-3, rtol=1e-8).y
        np.testing.assert_allclose(load, exact[0], atol=2e-3 * np.ptp(exact[0]))
    q, inertia = numbers("drive_elasticity", 1e-6, share=0.6, frequency_hz=6.0, damping=0.0), 1.5 * 4e-4
    m = (0.1, 0.0)
    assert torque("drive_elasticity", q, 0.06, m)[0] == approx(inertia * rate**2 * 0.04)
    assert_stiffness("drive_elasticity", q, m)
    q = numbers("drive_elasticity", share=0.6, frequency_hz=6.0, damping=0.2, gap_deg=0.02)
    assert torque("drive_elasticity", q, 0.095, m) == (0.0, 0.0)
    speed = call("drive_elasticity", "moved", q, (0.1, 0.0), 0.0, 0.0, H)[1]
    assert speed / H == approx(-(rate**2) * 0.09, rel=0.03)
    for m, phi, omega in (((0.1, 0.3), 0.02, 1.7), ((0.1, 0.3), 0.095, -4.0)):
        assert_damping("drive_elasticity", q, m, omega=omega)
        back, stiffness = torque("drive_elasticity", q, phi, m, omega=omega)
        speed = call("drive_elasticity", "moved", q, m, phi, phi + H * omega, H)[1]
        assert (back - stiffness * 0.5 * H * omega) * H == approx(-inertia * (speed - m[1]), rel=1e-9, abs=1e-15)


def drive_lag(_: Any) -> None:
    """Broken by another step response than that of a first-order lag."""
    tau, time = 0.03, H * np.arange(1, 201)
    q, m = numbers("drive_lag", time_constant_s=tau), (0.0, 0.0)
    out = []
    for _ in time:
        value, m = call("drive_lag", "actuator_pressure", q, m, 1e5, H)
        out.append(value)
    # The first step goes straight from 0 to 1e5: half a step late.
    np.testing.assert_allclose(out, 1e5 * (1.0 - np.exp(-(time - 0.5 * H) / tau)), atol=30.0)


def dropped_frames(_: Any) -> None:
    """Broken by an equation, a parameter or a key: missing frames are seen in the stamps and change no signal."""
    effect = EFFECTS["dropped_frames"]
    assert (effect.hooks, effect.parameters, effect.keys, effect.everywhere) == ({}, (), (), True)


ON_THE_PLANT = (valve_delay, creep, end_stop, contact, constant_load, added_inertia, clock_offset, command_delay)


@pytest.mark.parametrize("name", EFFECTS)
def test_equation(name: str, request: pytest.FixtureRequest) -> None:
    """Fails where an equation differs from the physics it names; the check of every effect says what breaks it."""
    check: Callable[[Any], None] = globals()[name]
    assert inspect.getdoc(check), name
    if check in ON_THE_PLANT and config.DISABLE_JIT:
        pytest.skip("the loops of the plain plant need compilation")
    check(request.getfixturevalue("joint") if check in ON_THE_PLANT else None)


# Neutral and small effects.


def outputs(effect: Effect, q: tuple[float, ...], seed: int, steps: int = 60) -> dict[str, Array]:
    """Results of every hook minus what an absent effect gives, along random signals; 0 throughout for no effect."""
    rng = np.random.default_rng(seed)
    m = memory(effect, phi := 0.3, p := 1e5)
    force, result = 0.0, {hook: [] for hook in effect.hooks}  # type: ignore[var-annotated]
    for _ in range(steps):
        before, phi = phi, phi + 0.05 * rng.standard_normal()
        p, u, force = (float(rng.uniform(0.0, top)) for top in (SUPPLY_PA, SUPPLY_PA, 20.0))
        signals = {
            "p": p, "u": u, "h": H, "phi": phi, "before": before, "after": phi, "omega": (phi - before) / H,
            "error": u - p, "limit": float(rng.uniform(1e5, 4e6)), "fills": u > p, "reading": p, "force": force,
            "creep_angle": 0.1,
            "e": tuple(rng.standard_normal(EXOGENOUS) * (100.0, 1.0, 1e6, 50.0, 1.0, 20.0, 50.0)),
        }  # fmt: skip
        for hook in (*(hook for hook in effect.hooks if hook.endswith("sensor")), *effect.hooks):
            if hook in ("prepare", "valve"):
                continue
            values = {"q": q, "m": m} | signals
            out = call(effect.name, hook, *(values[name] for name in hook_arguments(hook, bool(effect.memory))))
            if hook in ("moved", "angle_sensor", "force_sensor"):
                m = out
                continue
            if effect.memory and hook in ("set_point", "actuator_pressure"):
                out, m = out
            first = hook_arguments(hook, False)[1]
            absent = 0.0 if hook in ADDED else signals[first]
            result[hook].append(np.ravel(out) - absent)
    return {hook: np.array(values) for hook, values in result.items() if values}


WITH_HOOKS = [effect.name for effect in CATALOGUE if set(effect.hooks) - {"valve"}]


@pytest.mark.parametrize("name", WITH_HOOKS)
def test_a_neutral_effect_is_exactly_absent(name: str) -> None:
    """Fails when an effect at its neutral values changes any signal, be it in the last bit, or adds any torque."""
    for seed in range(5):
        for hook, differences in outputs(EFFECTS[name], numbers(name), seed).items():
            assert np.all(differences == 0.0), (hook, seed)


def scaled(effect: Effect, probe: tuple[float, ...], size: float, keep_shape: bool) -> dict[str, float]:
    """Own parameters a share of the way from neutral to a probe, SI; shapes wholly where keep_shape is true."""
    own = {parameter.key: parameter for parameter in effect.parameters}
    values = {}
    for key, number in zip(effect.keys, probe, strict=True):
        if key in own and not isinstance(number, Times):
            share = 1.0 if keep_shape and key in effect.shape else size
            neutral = own[key].neutral_si
            values[key.partition(".")[2]] = neutral + share * (number * own[key].scale - neutral)
    return values


@pytest.mark.parametrize("keep_shape", [False, True])
@pytest.mark.parametrize("name", [name for name in WITH_HOOKS if EFFECTS[name].probes])
def test_a_small_effect_is_small(name: str, keep_shape: bool) -> None:
    """Fails when an effect jumps where it is switched on: a millionth changes more than a thousandth."""
    effect = EFFECTS[name]
    if keep_shape and set(effect.keys) == set(effect.shape):
        pytest.skip("the effect has no size apart from its shape")
    for probe in effect.probes:
        whole, part, small = (
            outputs(effect, numbers(name, **scaled(effect, probe, size, keep_shape)), 3) for size in (1.0, 1e-2, 1e-6)
        )
        for hook in small:
            large = np.maximum(np.abs(whole[hook]).max(axis=0), np.abs(part[hook]).max(axis=0))
            assert np.all(np.abs(small[hook]).max(axis=0) <= 1e-3 * large), (probe, hook)


@pytest.mark.parametrize("name", ["coulomb_friction", "hysteresis", "viscous_friction"])
def test_friction_takes_energy_over_any_motion(name: str) -> None:
    """Fails when friction, over a random motion that ends where it began, gives energy to the joint."""
    sizes = {"coulomb_friction": {"torque_nm": 0.01, "presliding_deg": 0.005}, "hysteresis": {"torque_nm": 0.01}}
    for sharp in (0.0, 1.0) if name == "hysteresis" else (0.0,):
        for seed in range(5):
            print(f"seed {seed}")
            way = np.cumsum(np.random.default_rng(seed).normal(0.0, 8e-4, 1000))
            way = np.concatenate([way, np.linspace(way[-1], way[0], 300)])
            if name == "viscous_friction":
                q, speed = numbers(name, quadratic_nm_s2_per_rad2=1e-3), np.diff(way) / H
                taken = sum(call(name, "damping", q, omega) * omega**2 * H for omega in speed)
            else:
                values = sizes[name] | ({"sharpness": sharp} if name == "hysteresis" else {})
                taken = -work(friction_along(name, numbers(name, **values), way), way)
            assert taken > 0.0, seed
