"""Learned laws of the effects: the textbook form remains exactly, and constraints hold whatever the coefficients.

The equations are called as plain functions of scalars. Coefficients are drawn at random within their bounds; every
property below must hold for all of them, since bounds and basis functions enforce it and no penalty does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest import approx
from scipy.optimize import nnls
from scipy.signal import TransferFunction, step

from hand_identification.model_file import write_model
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.effects import CATALOGUE, EFFECTS, class_table
from hand_model.effects.constitution import STATES, Constitution
from hand_model.effects.effect import ANGLE, EXOGENOUS, HOOKS, INFLOW, SPEED, TIME, Effect, hook_arguments
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.hooks import compose, has_laws
from hand_model.kernel.inline import Equation
from hand_model.kernel.plant_rows import Parameter
from hand_model.kernel.rows import JOINT_PARAMETERS, MEMORY_ROW, ROW, STARTS, WORK_ROWS
from hand_model.kernel.rows import STATES as STATE_ROWS
from test.model.plain_numbers import PLAIN as PLAIN_NUMBERS
from test.model.plain_numbers import SUPPLY_PA

H = 1e-3
ATMOSPHERE_PA = 101325.0
PLAIN = PLAIN_NUMBERS | {"spring.stiffness_nm_per_rad": 0.0, "constant_load.torque_nm": 0.0}
LEARNED = [effect for effect in CATALOGUE if effect.coefficients]
REST = (0.0,) * EXOGENOUS
DRAWS = 40


def plain(function: Any) -> Callable[..., Any]:
    return getattr(function, "py_func", function)  # type: ignore[no-any-return]


def numbers(effect: Effect, h: float = H, **values: float) -> tuple[float, ...]:
    """q of an effect: neutral values but for those given in SI by the last part of their key."""
    own = [values.pop(own.key.partition(".")[2], own.neutral_si) for own in effect.parameters]
    assert not values, values
    read = [PLAIN[key] for key in effect.reads]
    return (*own, *read, *(plain(effect.hooks["prepare"])((*own, *read), h) if effect.prepared else ()))


def call(effect: Effect, hook: str, *arguments: Any) -> Any:
    return plain(effect.hooks[hook])(*arguments)


def law_parameters(effect: Effect) -> list[Parameter]:
    return [own for own in effect.parameters if own.law]


def drawn(name: str, seed: int, **others: float) -> Iterator[tuple[float, ...]]:
    """q at coefficients of the law drawn within their bounds and ten typical sizes, with other parameters as given."""
    effect = EFFECTS[name]
    print(f"{name}: seed {seed}")
    rng = np.random.default_rng(seed)
    for _ in range(DRAWS):
        values = {}
        for own in law_parameters(effect):
            neutral = own.neutral or 0.0
            low, high = max(own.low, neutral - 10.0 * own.typical), min(own.high, neutral + 10.0 * own.typical)
            values[own.key.partition(".")[2]] = float(rng.uniform(low, high)) * own.scale
        yield numbers(effect, **(values | others))


PLACED = {
    "unnamed_torque": {"offset": 0.1, "angle_per_rad": 0.5},
    "unnamed_pressure": {"set_point_per_pa": 1.0 / SUPPLY_PA},
}


def acting(effect: Effect) -> dict[str, float]:
    """Textbook parameters at which the effect acts, SI."""
    own = {own.key: own for own in effect.parameters if not own.law}
    if effect.name in PLACED:  # its curve stands nowhere until a state is chosen
        return {key.partition(".")[2]: 0.0 for key in own} | PLACED[effect.name]
    return {
        key.partition(".")[2]: (parameter.typical or parameter.neutral or 0.0) * parameter.scale
        for key, parameter in own.items()
    }


def test_every_effect_of_the_catalogue_states_its_class() -> None:
    """Fails when a class is missing or is not in the table, or a law parameter may be freed by no learned law."""
    table = class_table()
    for effect in CATALOGUE:
        assert effect.constitution is not None, effect.name
        assert f"| `{effect.name}` | {effect.constitution.acts_on} |" in table
        own = [own.key for own in law_parameters(effect)]
        assert set(own) <= set(effect.coefficients)
    assert len(LEARNED) == 25


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sign": ""}, "sign is empty"),
        ({"over": ("mood",)}, "state is 'mood'; it must be one of angle"),
        ({"coefficients": ("leak.x",)}, "must be given together"),
        ({"curve": lambda q, x, y: 0.0}, "must be given together"),
    ],
)
def test_an_incomplete_class_is_refused(changes: dict[str, Any], message: str) -> None:
    """Fails when a class without a sign, with an unknown state, or with half of a learned law is accepted."""
    good: dict[str, Any] = {"acts_on": "a", "sign": "b", "monotone": "c", "source": "d", "over": ("angle",)}
    assert Constitution(**good).over[0] in STATES
    with pytest.raises(ValueError, match=message):
        Constitution(**(good | changes))


# The textbook form remains.


def signals(rng: np.random.Generator) -> dict[str, Any]:
    p, u = rng.uniform(0.0, SUPPLY_PA, 2).tolist()
    phi, omega, before, after = (rng.uniform(-1.0, 1.5, 4) * (1.0, 10.0, 1.0, 1.0)).tolist()
    e = tuple((rng.standard_normal(EXOGENOUS) * (100.0, 1.0, 1e6, 50.0, 1.0, 20.0, 50.0)).tolist())
    return {
        "p": p, "u": u, "error": u - p, "limit": 2e6, "fills": u > p, "reading": p, "force": 3.0, "h": H, "phi": phi,
        "omega": omega, "before": before, "after": after, "creep_angle": 0.1, "e": e,
    }  # fmt: skip


def test_hooks_without_laws_equal_those_with_neutral_laws() -> None:
    """Fails when a neutral coefficient changes any hook of an effect that acts, be it in the last bit."""
    effects = tuple(effect for effect in LEARNED if effect.name != "creep")
    of_laws = [MEMORY_ROW[f"{effect.name}.{name}"] for effect in effects for name in effect.law_memory]
    with_laws, without = compose(effects), compose(effects, laws=False)
    rng = np.random.default_rng(11)
    for _ in range(10):
        s = signals(rng)
        w = np.zeros((WORK_ROWS, 2))
        for own in JOINT_PARAMETERS:
            w[ROW[own.key]] = PLAIN.get(own.key, (own.neutral or 0.0) * own.scale)
        for effect in effects:
            for key, value in acting(effect).items():
                w[ROW[f"{effect.name}.{key}"]] = value * rng.uniform(0.5, 1.5)
        w[list(MEMORY_ROW.values())] = rng.uniform(-0.5, 0.5, (len(MEMORY_ROW), 1))
        for row, kind in STARTS:
            w[row] = s["phi"] if kind == "angle" else s["p"]
        assert not has_laws(w[: len(ROW)].T)
        other = w.copy()
        for hook in ("prepare", "set_point", "actuator_pressure", *HOOKS, "moved", "angle_sensor"):
            if hook in ("valve",):
                continue
            given = [s[name] for name in HOOKS[hook]]
            got = getattr(with_laws, hook)(w, 1, *given), getattr(without, hook)(other, 1, *given)
            assert got[0] == got[1], hook
        assert np.array_equal(other[of_laws, 1], other[of_laws, 0])  # left out: lane 0 is as it started
        other[of_laws] = w[of_laws]
        assert np.array_equal(w, other)


def textbook_level(q: Any, omega: float, p: float) -> float:
    x = omega * (1.0 / q[2])
    return float(q[0] + q[1] / (1.0 + x * x) + q[3] * max(p, 0.0))


def textbook_band(q: Any, error: float) -> float:
    x = min(max(error * (1.0 / (q[0] + 1e-9)), -2.0), 2.0)
    sharp, gradual = min(max(error, -q[0]), q[0]), q[0] * x * (1.0 - 0.25 * abs(x))
    return float(error - sharp - q[1] * (gradual - sharp))


def textbook_static(q: Any, phi: float, p: float) -> float:
    return float((q[2] * (phi * phi) + q[3] * p) * p - (q[0] + q[1] * phi) * (phi * phi))


TEXTBOOK: dict[str, tuple[str, Callable[[Any, dict[str, Any]], float]]] = {
    "coulomb_friction": ("dry", lambda q, s: textbook_level(q, s["omega"], s["p"]) * (1.0 - q[17])),
    "valve_deadband": ("valve_error", lambda q, s: textbook_band(q, s["error"])),
    "viscous_friction": ("damping", lambda q, s: q[0] * abs(s["omega"])),
    "leak": (
        "pressure_source",
        lambda q, s: -q[0] * ((1.0 - q[1]) * s["p"] + q[1] * float(np.sqrt(1e5 * max(s["p"], 0.0)))),
    ),
    "stiffening": ("torque", lambda q, s: textbook_static(q, s["phi"], s["p"])),
}
"""Equations as the textbook has them, rounded in the same order."""


@pytest.mark.parametrize("name", TEXTBOOK)
def test_the_textbook_form_remains_to_the_last_bit(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when an equation with neutral coefficients differs from its textbook form in the last bit.

    Both are rounded after each operation: equations that an equation calls are plain Python as well, and not fused.
    """
    monkeypatch.setattr(Equation, "__call__", lambda equation, *arguments: equation.py_func(*arguments))
    effect, (hook, textbook) = EFFECTS[name], TEXTBOOK[name]
    rng = np.random.default_rng(5)
    for _ in range(200):
        q, s = (
            numbers(effect, **{key: value * rng.uniform(0.5, 2.0) for key, value in acting(effect).items()}),
            signals(rng),
        )
        state = ((0.3,) * len(effect.memory),) if effect.memory else ()
        got = call(effect, hook, q, *state[: hook != "valve_error"], *(s[argument] for argument in HOOKS[hook]))
        assert (got[0] if hook == "torque" else got) == textbook(q, s)


LIMIT_ERRORS_PA = (8e4, 6e4)
"""Errors of the plain valve that reach its limit while it fills, and while it vents: 4e6 and 3e6 Pa/s within 0.02 s."""


def responses(effect: Effect, q: tuple[float, ...]) -> Array:
    """Everything that an effect returns along random signals, one column a number."""
    rng = np.random.default_rng(9)
    m = tuple({"angle": 0.2, "pressure": 1e5}.get(str(start), 0.0) for start in effect.starts.values())
    rows = []
    phi = 0.2
    for _ in range(150):
        s = signals(rng)
        s["before"], phi = phi, float(rng.uniform(max(phi - 0.3, -0.6), min(phi + 0.3, 2.1)))
        s["phi"] = s["after"] = phi
        row: list[float] = []
        for hook in effect.hooks:
            if hook == "prepare":
                continue
            names = hook_arguments(hook, bool(effect.memory))
            out = call(effect, hook, *(({"q": q, "m": m} | s)[name] for name in names))
            if hook in ("moved", "angle_sensor"):
                m = out
                continue
            if hook in ("set_point", "actuator_pressure") and effect.memory:
                out, m = out
            if hook == "valve_error" and "flow_limit" in effect.hooks:  # no flow is larger than that of its limit
                out = min(max(out, -LIMIT_ERRORS_PA[1]), LIMIT_ERRORS_PA[0])
            row += np.ravel(out).tolist()
        rows.append(row)
    return np.array(rows)


@pytest.mark.parametrize("effect", LEARNED, ids=[effect.name for effect in LEARNED])
def test_every_coefficient_acts_and_a_small_one_is_small(effect: Effect) -> None:
    """Fails when a coefficient changes nothing, or jumps where it leaves its neutral value."""
    still = responses(effect, numbers(effect, **acting(effect)))
    for own in law_parameters(effect):
        key, neutral = own.key.partition(".")[2], own.neutral_si
        base = acting(effect) | ({"inner_share": 0.3} if key == "inner_gap" else {})
        if key in ("knee", "relaxing_per_s"):  # contacts that yield, and against which the drawn steps are slow
            base["presliding_deg"] = 0.01 if key == "knee" else 20.0
        if key == "heat_time_s":
            base["heat_share"] = 0.2
        if key == "blend_pa":  # from one time constant to another
            base["venting_ratio"] = 2.0
        reference = still if base == acting(effect) else responses(effect, numbers(effect, **base))
        sizes = [base | {key: neutral + size * own.typical * own.scale} for size in (1.0, 1e-6)]
        large, small = (np.abs(responses(effect, numbers(effect, **values)) - reference) for values in sizes)
        assert large.max() > 0.0, own.key
        assert np.all(small.max(axis=0) <= 1e-3 * large.max(axis=0) + 1e-12 * np.abs(reference).max(axis=0)), own.key


# Constraints hold for every coefficient.


def test_friction_falls_with_the_speed_and_rises_with_the_pressure() -> None:
    """Fails when a level of dry friction is negative, rises with the speed or falls with the pressure."""
    effect = EFFECTS["coulomb_friction"]
    curve = effect.constitution.curve  # type: ignore[union-attr]
    assert curve is not None
    for q in drawn("coulomb_friction", 1, torque_nm=0.01, breakaway_nm=0.003):
        level = np.array([[curve(q, x, y) for x in np.linspace(0.0, 6.0, 40)] for y in np.linspace(0.0, SUPPLY_PA, 15)])
        assert level.min() >= 0.01
        assert np.diff(level, axis=1).max() <= 1e-15
        assert np.diff(level, axis=0).min() >= -1e-15
        speed = 0.8
        fall = 0.01 + 0.003 / (1.0 + 64.0) + q[8] * 0.75  # textbook part and the slowest fall, by hand
        assert level[0, 0] == approx(0.013 + sum(q[5:9]))
        assert curve(q, speed, 0.0) == approx(fall)


def test_friction_over_the_travel_is_never_negative_and_stays_beyond_it() -> None:
    """Fails when a level is negative at an angle, grows without end beyond the travel, or differs between the contacts
    that stick and those that yield."""
    effect = EFFECTS["coulomb_friction"]
    travel = effect.constitution.travel  # type: ignore[union-attr]
    assert travel is not None
    angles = np.linspace(-4.0, 4.0, 161)
    for q in drawn("coulomb_friction", 2, torque_nm=0.01, presliding_deg=0.001, relaxing_per_s=0.0):
        size = np.array([travel(q, phi) for phi in angles])
        assert travel(q, 0.0) == 1.0
        assert size.min() >= 0.0
        assert size.max() <= 4.0
        assert np.ptp(size[angles <= -1.5]) == np.ptp(size[angles >= 1.5]) == 0.0
        for phi in (-2.0, -0.6, 0.3, 1.2):
            way = min(max(phi / 1.5, -1.0), 1.0)
            expected = (1.0 + 0.5 * (q[11] * way + q[12] * way * way)) ** 2
            assert travel(q, phi) == approx(expected)
            level = call(effect, "dry", q, (1.0,), phi, 2.0, 1e5) - call(
                effect, "torque", q, (1.0,), phi, 2.0, 1e5, 0.0, (0.0,) * EXOGENOUS
            )[0]  # fmt: skip
            assert level == approx(expected * effect.constitution.curve(q, 2.0, 1e5), rel=1e-6)  # type: ignore


def test_friction_under_load_falls_with_the_speed_and_rises_with_the_torques() -> None:
    """Fails when friction under load is negative, rises with the speed, or falls while a torque grows."""
    effect = EFFECTS["gear_friction"]
    curve = effect.constitution.curve  # type: ignore[union-attr]
    assert curve is not None
    pressures = np.linspace(0.0, SUPPLY_PA, 12)
    for q in drawn("gear_friction", 3, per_drive=0.1, per_load=0.2):
        opposed, driven = (np.array([curve(q, x, y) for x in np.linspace(0.01, 6.0, 40)]) for y in (0.0, 1.0))
        assert min(opposed.min(), driven.min()) > 0.0
        assert max(np.diff(opposed).max(), np.diff(driven).max()) <= 1e-15
        assert driven == approx(opposed * (1.0 + q[4]))
        for omega in (-2.0, 2.0):
            assert np.diff([call(effect, "dry", q, (0.4,), 0.4, omega, p) for p in pressures]).min() >= 0.0


def test_viscous_friction_rises_with_the_speed() -> None:
    """Fails when a torque falls with the speed, or acts with it, or differs by direction in another share."""
    effect = EFFECTS["viscous_friction"]
    for q in drawn("viscous_friction", 2, asymmetry=0.0):
        speeds = np.linspace(0.0, 30.0, 400)
        torque = np.array([call(effect, "damping", q, omega) * omega for omega in speeds])
        assert torque[0] == 0.0
        assert np.diff(torque).min() > 0.0
        assert call(effect, "damping", q, -2.0) == call(effect, "damping", q, 2.0) > 0.0
        uneven = (*q[:6], 0.25, *q[7:])
        flexing, extending = (q[7] + call(effect, "damping", uneven, omega) for omega in (2.0, -2.0))
        assert flexing / extending == approx(1.25 / 0.75)
    alone = numbers(effect, from_3_nm_s_per_rad=2e-3)
    assert call(effect, "damping", alone, 7.0) == approx(2e-3 * 7.0 / (7.0 + 3.0))
    assert call(effect, "damping", alone, 3.0) == approx(1e-3)


@pytest.mark.parametrize("power", [1.2, 1.4, 1.6, 1.8])
def test_viscous_friction_describes_drag_of_any_power(power: float) -> None:
    """Fails when the shares by speed cannot add up to a torque that grows with a power between 1 and 2."""
    effect = EFFECTS["viscous_friction"]
    speeds = np.geomspace(0.1, 10.0, 60)
    names = [key.partition(".")[2] for key in effect.coefficients if "from" in key] + ["quadratic_nm_s2_per_rad2"]
    shares = [
        [call(effect, "damping", numbers(effect, **{name: 1.0}), omega) * omega for omega in speeds] for name in names
    ]
    torque = speeds**power
    left = nnls(np.array([*shares, speeds]).T / torque[:, None], np.ones(len(speeds)))[1]
    assert left / np.sqrt(len(speeds)) < 0.02


def test_the_error_of_a_magnet_is_a_sum_of_harmonics() -> None:
    """Fails when a coefficient belongs to another harmonic, or the reading is not periodic in the angle."""
    effect = EFFECTS["hall_misalignment"]
    for q in drawn("hall_misalignment", 17, sine_deg=0.01, cosine_2_deg=0.02):
        for phi in (-2.0, 0.3, 1.4):
            series = sum(q[2 * k] * np.sin((k + 1) * phi) + q[2 * k + 1] * np.cos((k + 1) * phi) for k in range(4))
            assert call(effect, "angle_reading", q, phi) == approx(phi + series, abs=1e-6)


def test_a_dead_band_stays_within_its_sector() -> None:
    """Fails when the valve reacts to more than the error, against it, or less to a larger error."""
    effect = EFFECTS["valve_deadband"]
    for q in drawn("valve_deadband", 3, width_pa=5e3, softness=0.5):
        felt = np.array([call(effect, "valve_error", q, x) for x in np.linspace(-3e4, 3e4, 301)])
        assert np.diff(felt).min() >= -1e-9
        assert np.all(felt * np.linspace(-3e4, 3e4, 301) >= 0.0)
        assert np.all(np.abs(felt) <= np.abs(np.linspace(-3e4, 3e4, 301)) + 1e-9)
    assert call(effect, "valve_error", numbers(effect, width_pa=5e3, slope_left=0.2), 4e3) == approx(800.0)
    clears = numbers(effect, width_pa=5e3, clearing=1.0)  # x - 1 / (1 + x^2) for x widths
    assert [call(effect, "valve_error", clears, 5e3 * x) for x in (-1.0, 3.0)] == approx([-2.5e3, 14.5e3])
    apart = numbers(effect, width_pa=5e3, asymmetry=0.4)  # 7 kPa wide when filling, 3 kPa when venting
    assert [call(effect, "valve_error", apart, x) for x in (9e3, -9e3)] == approx([2e3, -6e3])
    rounded = numbers(effect, width_pa=5e3, softness=1.0, asymmetry=0.4)  # x^2 / (4 width) up to twice the width
    assert [call(effect, "valve_error", rounded, x) for x in (7e3, -3e3)] == approx([1.75e3, -0.75e3])


def test_a_tube_resists_more_at_a_larger_difference_and_less_under_pressure() -> None:
    """Fails when its time constant is negative, falls with the difference, rises with the pressure or is off a knot."""
    effect = EFFECTS["tube_lag"]
    curve = effect.constitution.curve  # type: ignore[union-attr]
    assert curve is not None
    gaps = np.geomspace(10.0, 3e5, 60)
    for q in drawn("tube_lag", 4, time_constant_s=0.02):
        tau = np.array([[curve(q, gap, p) for gap in gaps] for p in np.linspace(0.0, SUPPLY_PA, 10)])
        assert tau.min() > 0.0
        assert np.diff(tau, axis=1).min() >= 0.0
        assert np.diff(tau, axis=0).max() <= 0.0
        for k, edge in enumerate((1e3, 3e3, 1e4, 3e4, 1e5), 1):
            assert curve(q, edge, 0.0) == approx(0.02 + sum(q[2 : 2 + k]))


def test_a_tube_with_a_law_follows_its_differential_equation() -> None:
    """Fails when the output differs from tau(|p - y|) dy/dt = p - y, integrated with small steps."""
    effect = EFFECTS["tube_lag"]
    q = numbers(effect, time_constant_s=0.01, added_4_s=0.03, added_5_s=0.05)
    p, y, m = 3e5, 1e5, (3e5, 1e5, 1e5)
    for _ in range(60):
        out, m = call(effect, "actuator_pressure", q, m, p, H)
        for _ in range(200):
            gap = abs(p - y)
            tau = 0.01 + 0.03 * np.clip((gap - 1e4) / 2e4, 0.0, 1.0) + 0.05 * np.clip((gap - 3e4) / 7e4, 0.0, 1.0)
            y += H / 200 * (p - y) / tau
        assert out == approx(y, abs=0.02 * 2e5)
    assert out == approx(y, abs=0.01 * 2e5)


def test_flow_does_not_fall_with_the_difference_that_drives_it() -> None:
    """Fails when a limit grows while the difference shrinks, passes the textbook limit, or mixes up the directions."""
    effect = EFFECTS["valve_flow_limit"]
    pressures = np.linspace(0.0, SUPPLY_PA, 61)
    for q in drawn("valve_flow_limit", 5):
        fill, vent = (
            np.array([call(effect, "flow_limit", q, 1e6, p, fills) for p in pressures]) for fills in (True, False)
        )
        assert np.diff(fill).max() <= 1e-6
        assert np.diff(vent).min() >= -1e-6
        assert fill[0] == approx(1e6)
        assert vent[-1] == approx(1e6)
        assert fill.min() > 0.0 and vent.min() > 0.0
    filling, venting = LIMIT_ERRORS_PA
    soft = numbers(effect, gradual=1.0)
    assert [call(effect, "valve_error", soft, x) for x in (filling, -2.0 * venting)] == approx([4e4, -4e4])
    for g in (1e-9, 0.3, 0.7):
        bent = numbers(effect, gradual=g)
        x = np.linspace(0.0, 6.0, 121)
        filled, vented = (
            np.array([call(effect, "valve_error", bent, full * each) for each in x]) / full
            for full in (filling, -venting)
        )
        np.testing.assert_allclose((1.0 - g * g) * filled**2 - (1.0 + x) * filled + x, 0.0, atol=1e-12)
        np.testing.assert_allclose(vented, filled, atol=1e-12)
        assert np.diff(filled).min() >= -1e-12 and np.all(filled <= np.minimum(x, 1.0) + 1e-12)
    one = numbers(effect, vent_1=1.0)
    assert call(effect, "flow_limit", one, 1e6, 1e5, False) == approx(0.75e6)
    assert call(effect, "flow_limit", one, 1e6, 1e5, True) == approx(1e6)


COLD = (0.0,)
"""Memory of the gas before any motion."""
SQUEEZED = tuple(1.0 if column == SPEED else 0.0 for column in range(EXOGENOUS))
"""Surroundings of a joint at angle 0 that flexes with 1 rad/s."""


def test_a_slow_motion_of_a_gas_lacks_what_the_wall_takes() -> None:
    """Fails when heat is exchanged with another time constant, or fast motion is not adiabatic, slow one not softer."""
    gas, tau, taken, h = EFFECTS["gas_compression"], 0.4, 0.286, 1e-3
    q = numbers(gas, h, exponent=1.4, heat_share=taken, heat_time_s=tau)
    whole = numbers(gas, h, exponent=1.4)
    for omega in (0.5, 2.5, 20.0):
        m, rates = COLD, []
        times = h * np.arange(round((8.0 * tau + 4.0 * np.pi / omega) / h))
        for t in times:
            e = tuple(np.cos(omega * t) * each for each in SQUEEZED)
            u, m = call(gas, "set_point", q, m, 2e5, 1e5, e, h)
            assert u == 2e5
            rates.append(call(gas, "pressure_source", q, m, 1e5, e))
        settled = times > 8.0 * tau
        unit = call(gas, "pressure_source", whole, COLD, 1e5, SQUEEZED)
        expected = (1.0 - taken / (1.0 + 1j * omega * tau)) * np.exp(1j * omega * times)
        np.testing.assert_allclose(np.array(rates)[settled], unit * expected.real[settled], atol=0.01 * abs(unit))


def test_gas_and_leak_stay_passive() -> None:
    """Fails when a gain of the gas is negative, a loss falls with the pressure, or either is not linear in it."""
    gas, leak = EFFECTS["gas_compression"], EFFECTS["leak"]
    for q in drawn("gas_compression", 6, exponent=1.2):
        source = [call(gas, "pressure_source", q, COLD, p, SQUEEZED) for p in np.linspace(0.0, SUPPLY_PA, 30)]
        assert max(source) <= 0.0
        bent = tuple(0.5 if column == ANGLE else value for column, value in enumerate(SQUEEZED))
        assert call(gas, "pressure_source", q, COLD, 3e5, bent) <= 0.0
    straight, angled = numbers(gas, exponent=1.2), numbers(gas, exponent=1.2, gain_per_rad=2.0)
    assert call(gas, "pressure_source", angled, COLD, 3e5, bent) == approx(
        2.0 * call(gas, "pressure_source", straight, COLD, 3e5, bent)
    )
    for q in drawn("leak", 6, rate_per_s=0.5, turbulent=0.3):
        opens = q[3]
        source = [call(leak, "pressure_source", q, p, REST) for p in np.linspace(opens, opens + SUPPLY_PA, 30)]
        assert np.diff(source).max() < 0.0
        assert max(abs(call(leak, "pressure_source", q, p, REST)) for p in np.linspace(0.0, opens, 5)) < 1e-6
    late = numbers(leak, rate_per_s=0.5, opens_pa=1e5)
    assert [call(leak, "pressure_source", late, p, REST) for p in (0.9e5, 3e5)] == approx([0.0, -0.5 * 2e5])
    half = numbers(leak, rate_per_s=0.5, with_pressure=2.0)
    assert call(leak, "pressure_source", half, 3e5, REST) == approx(-0.5 * 3e5 * 2.0)
    plain_gas, twice = numbers(gas, exponent=1.0), numbers(gas, exponent=1.0, with_pressure=2.0)
    ratio = [
        call(gas, "pressure_source", twice, COLD, p, SQUEEZED)
        / call(gas, "pressure_source", plain_gas, COLD, p, SQUEEZED)
        for p in (0.0, 3e5)
    ]
    assert ratio == approx([1.0, 2.0])


@pytest.mark.parametrize("gain", [0.0, 3.0, 15.0])
@pytest.mark.parametrize("inertia", [0.0, 0.2, 0.5, 3.0])
def test_a_valve_with_resonance_and_inertia_answers_as_its_transfer_function(gain: float, inertia: float) -> None:
    """Fails when the step response differs from (1 + k) / ((mu tau^2 s^2 + tau s + 1)(T s + 1) + k), damped or not."""
    effect = EFFECTS["valve_lag"]
    tau, own, h = 0.02, 0.02, 2e-4
    q = numbers(effect, h, time_constant_s=tau, resonance=gain, inertia_ratio=inertia)
    p, m, got = 0.0, (0.0, 0.0, 0.0), []
    for _ in range(1500):
        u, m = call(effect, "set_point", q, m, 1e5, p, REST, h)
        p += (u - p) * -np.expm1(-h / own)
        got.append(p)
    times, k = h * np.arange(1, 1501), gain / (1.0 + gain * inertia)
    poles = np.polynomial.Polynomial((1.0, tau, inertia * tau**2)) * (1.0, own) + k
    system = TransferFunction([1.0 + k], np.trim_zeros(poles.coef[::-1], "f"))
    _, expected = step(system, T=np.append(0.0, times))
    np.testing.assert_allclose(got, 1e5 * expected[1:], atol=400.0)
    curve = effect.constitution.curve  # type: ignore[union-attr]
    assert curve is not None
    assert [curve(q, t, 0.0) for t in times[::300]] == approx(list(expected[1::300]), abs=1e-6)


def test_a_valve_is_stable_whatever_its_law() -> None:
    """Fails when a feedback, an inertia and two time constants within their bounds let the pressure swing up."""
    effect, h, draw = EFFECTS["valve_lag"], 5e-4, np.random.default_rng(4)
    for _ in range(20):
        gain, inertia = draw.uniform(0.0, 50.0), draw.uniform(0.0, 6.0)
        tau, own = 10.0 ** draw.uniform(-2.5, -0.5, 2)
        returning = 5.0 ** draw.uniform(-1.0, 1.0)
        q = numbers(effect, h, time_constant_s=tau, resonance=gain, inertia_ratio=inertia, returning_ratio=returning)
        p, m, error = 0.0, (0.0, 0.0, 0.0), []
        for _ in range(int(60.0 * (tau + own) / h)):
            u, m = call(effect, "set_point", q, m, 1e5, p, REST, h)
            p += (u - p) * -np.expm1(-h / own)
            error.append(abs(p - 1e5))
        parts = np.array_split(error, 10)
        assert max(parts[-1]) < max(parts[1]) + 1.0 and max(error) < 1.2e5, (gain, inertia, tau, own, returning)


def test_a_spool_returns_with_a_time_constant_of_its_own() -> None:
    """Fails when the way down has the time constant of the way up, or either is not the exact solution."""
    effect, h = EFFECTS["valve_lag"], 2e-3
    q = numbers(effect, h, time_constant_s=0.03, returning_ratio=2.5)
    for begin, end, tau in ((1e5, 2e5, 0.03), (2e5, 1e5, 0.075)):
        m = (begin, begin, 0.0)
        for k in range(1, 60):
            mean, m = call(effect, "set_point", q, m, end, begin, REST, h)
            before, after = np.exp(-(k - 1) * h / tau), np.exp(-k * h / tau)
            assert m[0] == approx(end + (begin - end) * after, rel=1e-6)
            assert mean == approx(end + (begin - end) * tau / h * (before - after), rel=1e-6)


def test_the_rate_of_a_valve_rises_with_the_error_between_both_time_constants() -> None:
    """Fails when a blend of both time constants is not monotone, wrong far from it, or jumps at its middle."""
    effect = EFFECTS["valve_lag"]
    errors = np.linspace(-3e5, 3e5, 4001)
    for k, q in enumerate(drawn("valve_lag", 8)):
        q = (q[0], (0.2, 0.5, 2.0, 5.0)[k % 4], *q[2:])
        q = (*q[:15], 1.0 / q[1], q[16])
        rate = np.array([call(effect, "valve_error", q, error) for error in errors])
        assert np.diff(rate).min() > 0.0
        assert rate[2000] == 0.0
    blended = numbers(effect, venting_ratio=3.0, blend_pa=1e4)
    for error, slowness in ((3e6, 1.0), (-3e6, 3.0), (1e-3, 2.0)):
        assert call(effect, "valve_error", blended, error) == approx(error / slowness, rel=1e-4)
    slow = numbers(effect, small=1.0)
    assert call(effect, "valve_error", slow, 1.0) == approx(0.5, rel=1e-3)
    assert call(effect, "valve_error", slow, 1e8) == approx(1e8, rel=1e-3)


def test_a_bent_pressure_sensor_rises_and_is_inverted() -> None:
    """Fails when a reading falls with the pressure, a bow has another shape, or the true pressure is lost."""
    effect = EFFECTS["pressure_gain"]
    pressures = np.linspace(-1e4, 1.1 * SUPPLY_PA, 300)
    for error in (-0.5, 0.0, 0.5):
        for q in drawn("pressure_gain", 10, error=error):
            readings = np.array([call(effect, "pressure_reading", q, p) for p in pressures])
            assert np.diff(readings).min() > 0.0
    for q in drawn("pressure_gain", 11, error=0.1):
        found = [call(effect, "pressure_true", q, call(effect, "pressure_reading", q, p)) for p in pressures]
        assert found == approx(list(pressures), abs=30.0)
    bent, skewed = numbers(effect, bend=0.1), numbers(effect, skew=0.1)
    for x in (0.25, 0.5, 0.75):
        p = x * SUPPLY_PA
        assert call(effect, "pressure_reading", bent, p) - p == approx(0.1 * SUPPLY_PA * x * (1.0 - x))
        assert call(effect, "pressure_reading", skewed, p) - p == approx(
            0.1 * SUPPLY_PA * x * (1.0 - x) * (1.0 - 2.0 * x), abs=1e-6
        )


def test_creep_is_a_sum_of_retardations() -> None:
    """Fails when a shift has another sign, size or time than its term of Eq. 10, or recovers other than it came."""
    effect = EFFECTS["creep"]
    weights = dict(zip((f"shift_{k}_deg" for k in range(1, 7)), (0.02, 0.03, 0.01, 0.05, 0.04, 0.02), strict=True))
    h = 2e-3
    q, m = numbers(effect, h, **weights), (0.0,) * 6
    for _ in range(round(4.0 / h)):
        p, m = call(effect, "actuator_pressure", q, m, 3e5, h)
        assert p == 3e5
    times = np.array([0.3, 1.0, 3.0, 10.0, 30.0, 100.0])
    shift = 0.5 * float(np.dot(list(weights.values()), -np.expm1(-4.0 / times)))
    torque, stiffness = call(effect, "torque", q, m, 0.4, 1.0, 3e5, 0.1, REST)
    assert (torque, stiffness) == (approx(0.05 * shift, rel=1e-4), 0.0)
    for q in drawn("creep", 7):
        curve = effect.constitution.curve  # type: ignore[union-attr]
        assert curve is not None
        after = np.array([curve(q, t, 0.0) for t in np.linspace(0.0, 200.0, 100)])
        assert np.diff(after).min() >= 0.0
        assert np.diff(after, 2).max() <= 1e-12


def motion(seed: int) -> Array:
    """A random motion [rad] that ends where it began."""
    way = np.cumsum(np.random.default_rng(seed).normal(0.0, 6e-3, 600))
    return np.concatenate([way, np.linspace(way[-1], way[0], 200)])


@pytest.mark.parametrize("name", ["hysteresis", "coulomb_friction"])
def test_a_loop_takes_energy_over_any_motion(name: str) -> None:
    """Fails when a loop with some coefficients gives energy over a closed motion, or leaves its height."""
    effect = EFFECTS[name]
    given = {"torque_nm": 0.01} | ({"scale_deg": 0.1} if name == "hysteresis" else {"presliding_deg": 0.01})
    for seed, q in enumerate(drawn(name, 8, **given)):
        way, m, torques = motion(seed), (0.0,) * len(effect.memory), [0.0]
        for before, after in pairwise(way):
            m = call(effect, "moved", q, m, before, after, H)
            assert -1.0 <= min(m) <= max(m) <= 1.0
            torques.append(call(effect, "torque", q, m, after, np.sign(after - before), 0.0, 0.0, REST)[0])
        work = np.sum(0.5 * (np.array(torques[1:]) + torques[:-1]) * np.diff(way))
        assert work < 0.0, seed


def test_elements_of_a_loop_stick_and_then_slip() -> None:
    """Fails when an element yields at another angle or torque, or its stiffness is not that of its branch."""
    effect = EFFECTS["hysteresis"]
    for k, share in enumerate((8.0, 4.0, 8.0 / 3.0, 2.0, 4.0 / 3.0, 1.0), 1):
        q, m, phi, z = numbers(effect, scale_deg=0.2, **{f"stop_{k}_nm": 0.01}), (0.0,) * 7, 0.0, 0.0
        for after in (0.01, 0.3, 0.28, -0.4, -0.399):
            m = call(effect, "moved", q, m, phi, after, H)
            z = float(np.clip(z + (after - phi) / (0.2 / share), -1.0, 1.0))
            torque, stiffness = call(effect, "torque", q, m, after, np.sign(after - phi), 0.0, 0.0, REST)
            assert torque == approx(-0.01 * z)
            sticks = abs(z) < 1.0
            assert stiffness == approx(0.01 * share / 0.2 if sticks else 0.0)
            phi = after


def test_the_growth_of_a_loop_falls_to_zero() -> None:
    """Fails when a growth function rises, is negative or not 0 where the loop is closed, or a term is another one."""
    effect = EFFECTS["hysteresis"]
    curve = effect.constitution.curve  # type: ignore[union-attr]
    assert curve is not None
    states = np.linspace(-1.0, 1.0, 101)
    for q in drawn("hysteresis", 9, torque_nm=0.02, scale_deg=0.2):
        growth = np.array([curve(q, x, 0.0) for x in states])
        assert np.diff(growth).max() <= 1e-12
        assert growth[-1] == approx(0.0, abs=1e-12)
        back = 0.1 * (2.0 + q[3] + q[4] + q[5] + q[6])  # at a = -1
        assert growth[0] == approx(back)


def test_the_static_map_has_a_potential_and_its_stiffness_is_its_slope() -> None:
    """Fails when the stiffness of a bump is not minus its slope, or a bump sits at another angle or pressure."""
    effect = EFFECTS["stiffening"]
    for q in drawn("stiffening", 10):
        for phi, p in ((-0.15, 1e5), (0.4, 3e5), (1.3, 5e5), (1.69, 0.0)):
            torque, stiffness = call(effect, "torque", q, phi, 0.0, p, 0.0, REST)
            ahead, back = (call(effect, "torque", q, phi + d, 0.0, p, 0.0, REST)[0] for d in (1e-6, -1e-6))
            assert stiffness == approx(-(ahead - back) / 2e-6, rel=1e-4, abs=1e-6)
            assert call(effect, "torque", q, phi, 3.0, p, 0.5, REST)[0] == torque
    for k in range(8):
        q = numbers(effect, **{f"angle_{k}_nm": 0.01})
        assert call(effect, "torque", q, -0.2 + 1.9 * k / 7, 0.0, 2e5, 0.0, REST)[0] == approx(0.01)
    q = numbers(effect, pressure_2_nm=0.01)
    assert call(effect, "torque", q, 0.5, 0.0, 4e5, 0.0, REST)[0] == approx(0.01)


def test_a_supply_sags_more_than_in_proportion_and_recovers_at_its_own_rate() -> None:
    """Fails when the growth with the flow or the time of recovery is another one, or falling flow raises the sag."""
    effect = EFFECTS["supply_droop"]
    drawn_flow = tuple(3e6 if column == INFLOW else 0.0 for column in range(EXOGENOUS))
    q = numbers(effect, resistance_s=0.05, time_constant_s=0.1, turbulent=0.4, recovery_ratio=3.0)
    m: tuple[float, ...] = (0.0,)
    for _ in range(2000):
        _, m = call(effect, "set_point", q, m, 1e5, 0.0, drawn_flow, H)
    sag = 0.05 * 3e6 * (1.0 + 0.4 * 3e6 / SUPPLY_PA)
    assert m[0] == approx(sag, rel=1e-6)
    for _ in range(300):
        _, m = call(effect, "set_point", q, m, 1e5, 0.0, REST, H)
    assert m[0] == approx(sag * np.exp(-1.0), rel=1e-4)
    for q in drawn("supply_droop", 12, resistance_s=0.05):
        curve = effect.constitution.curve  # type: ignore[union-attr]
        assert curve is not None
        sags = np.array([curve(q, x, 0.0) for x in np.linspace(0.0, 5e6, 60)])
        assert np.diff(sags).min() >= 0.0
        assert np.diff(sags[sags < SUPPLY_PA], 2).min(initial=0.0) >= -1e-6  # no more than the whole supply


def test_backlash_is_a_sum_of_two_plays() -> None:
    """Fails when the second play has another gap or share, or the reading goes back while the joint goes on."""
    effect = EFFECTS["backlash"]
    q = numbers(effect, gap_deg=0.1, inner_share=0.3, inner_gap=0.4)
    m = (0.5, 0.5, 0.5)
    outer = inner = 0.5
    for phi in 0.5 + 0.2 * np.sin(np.linspace(0.0, 12.0, 400)):
        m = call(effect, "angle_sensor", q, m, phi, H)
        outer, inner = np.clip(outer, phi - 0.05, phi + 0.05), np.clip(inner, phi - 0.02, phi + 0.02)
        reading = call(effect, "angle_reading", q, m, phi)
        assert reading == approx(0.7 * outer + 0.3 * inner)


def test_slow_changes_follow_use_and_attitude() -> None:
    """Fails when travel is not summed up, heat of motion is another, or the attitude turns the other way."""
    ageing, warming, gravity = (EFFECTS[name] for name in ("ageing", "thermal_drift", "gravity"))
    q, m = numbers(ageing, stiffness_per_rad=1e-3, early=0.1, strength_per_rad=2e-3), (0.0,)
    for before, after in ((0.0, 6.0), (6.0, -4.0), (-4.0, 0.0)):
        m = call(ageing, "moved", q, m, before, after, H)
    assert m == (20.0,)
    change = 1e-3 * 20.0 + 0.1 * 20.0 / 30.0
    expected = change * -0.05 * (0.4 - 0.1) + 2e-3 * 20.0 * (4e-7 - 1e-7 * 0.4) * 1e5
    assert call(ageing, "torque", q, m, 0.4, 0.0, 1e5, 0.1, REST)[0] == approx(expected)
    q = numbers(warming, torque_nm=0.01, time_constant_s=5.0, by_use=0.25)
    warm: tuple[float, ...] = (0.0, 0.0, 0.0)
    for _ in range(60_000):
        warm = call(warming, "moved", q, warm, 0.0, 3.0 * H, H)
    assert warm[0] == approx(0.75 + 0.25 * 3.0, rel=1e-4)
    q = numbers(warming, torque_nm=0.01, time_constant_s=50.0, second=0.4, faster=0.1)
    warm = (0.0, 0.0, 0.0)
    for _ in range(10_000):
        warm = call(warming, "moved", q, warm, 0.0, 0.0, H)
    expected = 0.01 * (0.6 * -np.expm1(-10.0 / 50.0) + 0.4 * -np.expm1(-10.0 / 5.0))
    assert call(warming, "torque", q, warm, 0.4, 0.0, 1e5, 0.1, REST)[0] == approx(expected, rel=1e-4)
    q = numbers(gravity, sine_nm=0.02, turning_rad_per_s=0.01)
    later = tuple(30.0 if column == TIME else 0.0 for column in range(EXOGENOUS))
    assert call(gravity, "torque", q, 0.5, 0.0, 0.0, 0.0, later)[0] == approx(-0.02 * np.sin(0.8), rel=1e-5)


def test_heat_of_friction_bends_and_a_hand_sways() -> None:
    """Fails when the square of the speed does not heat, a bent law falls, or the attitude sways by another angle."""
    warming, gravity = EFFECTS["thermal_drift"], EFFECTS["gravity"]
    q = numbers(warming, torque_nm=0.01, time_constant_s=5.0, by_use=0.4, by_square=0.5, bend=-1.0)
    warm: tuple[float, ...] = (0.0, 0.0, 0.0)
    for _ in range(60_000):
        warm = call(warming, "moved", q, warm, 0.0, 3.0 * H, H)
    heat = 0.5 * (0.6 + 0.4 * 3.0) + 0.5 * 9.0
    assert warm[0] == approx(heat, rel=1e-4)
    expected = 0.01 * 2.0 * heat / (heat + 1.0)
    assert call(warming, "torque", q, warm, 0.4, 0.0, 1e5, 0.1, REST)[0] == approx(expected, rel=1e-4)
    for bend in (-1.0, -0.3, 0.6, 1.0):
        torques = [
            call(
                warming, "torque", numbers(warming, torque_nm=1.0, bend=bend), (w, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0, REST
            )[0]
            for w in np.linspace(0.0, 4.0, 60)
        ]
        assert np.diff(torques).min() > 0.0
    q = numbers(gravity, cosine_nm=0.02, sway_deg=0.3, nod_deg=0.2, sway_2_deg=0.1, nod_2_deg=-0.1, period_s=50.0)
    for t in (0.0, 7.0, 30.0, 130.0):
        w = 2.0 * np.pi * t / 50.0
        lean = 0.3 * np.sin(w) + 0.2 * (1.0 - np.cos(w)) + 0.1 * np.sin(2.0 * w) - 0.1 * (1.0 - np.cos(2.0 * w))
        at = tuple(t if column == TIME else 0.0 for column in range(EXOGENOUS))
        found = call(gravity, "torque", q, 0.5, 0.0, 0.0, 0.0, at)[0]
        assert found == approx(-0.02 * np.cos(0.5 + lean), abs=2e-7)


def test_work_against_the_elasticity_heats_soft_material() -> None:
    """Fails when the heat is not in proportion to the angle from rest and the speed, or motion at rest heats."""
    warming = EFFECTS["thermal_drift"]
    rest = -PLAIN["statics.a0_nm"] / PLAIN["statics.a1_nm_per_rad"]
    q = numbers(warming, time_constant_s=5.0, by_strain=1.0)
    for away, speed in ((0.3, 2.0), (-0.3, 2.0), (0.6, 2.0), (0.3, -4.0), (0.3, 0.0), (0.0, 2.0)):
        middle, half = rest + away, 0.5 * speed * H
        warm: tuple[float, ...] = (0.0, 0.0, 0.0)
        for _ in range(60_000):
            warm = call(warming, "moved", q, warm, middle - half, middle + half, H)
        power = abs(PLAIN["statics.a1_nm_per_rad"] * away * speed)
        unit = abs(PLAIN["statics.a1_nm_per_rad"]) * 0.25  # at a quarter of a radian and 1 rad/s
        assert warm[0] == approx(power / unit, rel=1e-4, abs=1e-9)


def test_work_against_friction_under_load_heats() -> None:
    """Fails when the heat is not in proportion to pressure and speed, motion without pressure heats, or rest does."""
    warming = EFFECTS["thermal_drift"]
    q = numbers(warming, time_constant_s=5.0, by_load=1.0)
    for p, speed in ((0.25 * SUPPLY_PA, 1.0), (0.5 * SUPPLY_PA, -3.0), (0.5 * SUPPLY_PA, 0.0), (0.0, 2.0)):
        warm: tuple[float, ...] = (0.0, 0.0, 0.0)
        for _ in range(60_000):
            passed, warm = call(warming, "actuator_pressure", q, warm, p, H)
            assert passed == p
            warm = call(warming, "moved", q, warm, 0.3, 0.3 + speed * H, H)
        assert warm[0] == approx(p / (0.25 * SUPPLY_PA) * abs(speed), rel=1e-4, abs=1e-9)


def test_a_reservoir_with_a_limited_refill_empties_and_fills_at_a_constant_rate() -> None:
    """Fails when the refill grows with the sag beyond its limit, or the textbook form is not left at zero."""
    effect, tau, limited = EFFECTS["supply_droop"], 0.5, 40.0
    q = numbers(effect, resistance_s=0.2, time_constant_s=tau, limited=limited)
    m: tuple[float, ...] = (3e5,)
    level = SUPPLY_PA / limited  # the refill tends to this sag over the time constant
    fallen = []
    for _ in range(400):
        before = m[0]
        _, m = call(effect, "set_point", q, m, 1e5, 0.0, REST, H)
        fallen.append((before - m[0]) / H)
    assert fallen[0] == approx(level / tau / (1.0 + level / 3e5), rel=2e-3)
    assert fallen[-1] == approx(fallen[0], rel=0.01)
    low: tuple[float, ...] = (1.0,)
    _, low = call(effect, "set_point", q, low, 1e5, 0.0, REST, H)
    assert (1.0 - low[0]) / H == approx(1.0 / tau, rel=2e-3)


def test_a_supply_that_sags_slows_valves_that_fill() -> None:
    """Fails when the rate of filling falls by another share, venting becomes slower, or a sag lifts no regulator."""
    effect, sag, p = EFFECTS["supply_droop"], 1e5, 1.2e5
    q = numbers(effect, resistance_s=0.2, time_constant_s=1e6, slowing=0.5)
    lost = 0.5 * sag / SUPPLY_PA
    for u, share in ((3e5, 1.0 - lost), (0.5e5, 1.0)):
        found, _ = call(effect, "set_point", q, (sag,), u, p, REST, H)
        assert found - p == approx(share * (u - p), rel=1e-6)
    rising = numbers(effect, resistance_s=0.2, time_constant_s=1e6, share=-0.1)
    assert call(effect, "set_point", rising, (sag,), 3e5, p, REST, H)[0] == approx(3e5 + 0.1 * sag, rel=1e-6)


@pytest.mark.parametrize(("follows", "inner", "innermost"), [(0.4, 0.0, 0.0), (0.0, 0.7, 0.5), (0.3, 0.5, 1.0)])
def test_a_valve_of_several_plays_stays_behind_by_their_sum(follows: float, inner: float, innermost: float) -> None:
    """Fails when a play has another width or share, the valve goes back, or the plotted loop is another one."""
    effect, width = EFFECTS["valve_hysteresis"], 9e3
    q = numbers(effect, width_pa=width, follows=follows, inner=inner, innermost=innermost)
    rng = np.random.default_rng(11)
    turns = np.concatenate([[3e5], 3e5 + rng.uniform(-3e4, 3e4, 20)])
    u = np.concatenate([np.linspace(a, b, 300) for a, b in pairwise(turns)])
    m: tuple[float, ...] = (0.0, u[0], 0.0, 0.0)
    shares = ((1.0 - inner) * (1.0 - innermost), inner * (1.0 - innermost), innermost)
    radii, plays = (width, width / 3.0, width / 9.0), np.full(3, u[0])
    out = []
    for value in u:
        y, m = call(effect, "set_point", q, m, value, 0.0, REST, H)
        plays = np.array([np.clip(play, value - r, value + r) for play, r in zip(plays, radii, strict=True)])
        assert y == approx(value - (1.0 - follows) * float(np.dot(shares, value - plays)), abs=1e-6)
        out.append(y)
    assert (np.diff(out) * np.diff(u)).min() >= -1e-9
    wide = np.concatenate([np.linspace(3e5, 3.5e5, 500), np.linspace(3.5e5, 2.5e5, 500), np.linspace(2.5e5, 3e5, 501)])
    m = (0.0, wide[0], 0.0, 0.0)
    behind = []
    for value in wide:
        y, m = call(effect, "set_point", q, m, value, 0.0, REST, H)
        behind.append(value - y)
    curve = effect.constitution.curve  # type: ignore[union-attr]
    assert curve is not None
    for k in range(1000, 1501, 50):
        assert behind[k] == approx(curve(q, wide[k] - 2.5e5, 0.0), abs=1e-6)


# Laws run where the kernel runs, and are stored.


def test_a_learned_law_is_simulated_and_stored(hand: Hand, tmp_path: Path) -> None:
    """Fails when the simulation ignores a law, or model.yaml does not give its coefficients back."""
    joint = hand.joints.index("index_distal")
    laws = {"creep.shift_2_deg": 0.3, "coulomb_friction.fall_2_nm": 1e-5, "tube_lag.added_4_s": 0.02}
    stored = write_model(hand, {"index_distal": laws}, tmp_path / "model.yaml", "learned laws")
    for key, value in laws.items():
        assert stored.parameters[ROW[key], joint] == approx(value, rel=1e-3)
    commands = np.full((1, 600, 1), 1e5)
    ends = []
    for description in (hand, stored):
        column = description.parameters[:, [joint]].copy()
        column[ROW["dynamics.coupling_inertia_kg_m2"]] = 0.0
        assert has_laws(column.T) == (description is stored)
        loop = ClosedLoop(column[None], np.array([-1]), np.zeros((1, STATE_ROWS, 1)), 0.005)
        ends.append(float(loop.advance(commands)[0, -1, 1, 0]))
    a1, a3 = (hand.parameters[ROW[f"statics.{key}"], joint] for key in ("a1_nm_per_rad", "a3_nm_per_pa_rad"))
    shift = 0.3 * 1e5 / hand.supply_pressure_pa * -np.expm1(-3.0) * a1 / (a1 + a3 * 1e5)
    assert ends[1] - ends[0] == approx(shift, rel=0.05)
