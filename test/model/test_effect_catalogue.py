"""The catalogue of effects and its composed hooks: declarations are checked, rows are bound, absent effects vanish."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hand_model.arrays import Array
from hand_model.effects import CATALOGUE, EFFECTS
from hand_model.effects.effect import EXOGENOUS, HOOKS, INFLOW, NEIGHBOUR, Effect, assemble, hook_arguments
from hand_model.kernel.hooks import Hooks, active_effects, compose, equations_key
from hand_model.kernel.plant_rows import PLANT_PARAMETERS, Parameter
from hand_model.kernel.rows import (
    JOINT_PARAMETERS,
    MEMORY_ROW,
    PREPARED_ROW,
    ROW,
    STARTS,
    STATE_ROW,
    WORK_ROWS,
    effect_rows,
    memory_rows,
)

H = 1e-3
LANE = 1


def working_array(phi: float = 0.0, p: float = 0.0, **values: float) -> Array:
    """Two lanes at neutral values; in lane 1 those given, SI, by key with a double underscore for the dot."""
    rng = np.random.default_rng(7)
    w = np.zeros((WORK_ROWS, 2))
    for parameter in JOINT_PARAMETERS:
        neutral = 0.5 * (parameter.low + parameter.high) if parameter.neutral is None else parameter.neutral
        w[ROW[parameter.key]] = neutral * parameter.scale
    w[len(ROW) :] = rng.uniform(1.0, 2.0, (WORK_ROWS - len(ROW), 2))  # what is not prepared must not matter
    for name, value in values.items():
        w[ROW[name.replace("__", ".")], LANE] = value
    for row in MEMORY_ROW.values():
        w[row] = 0.0
    for row, kind in STARTS:
        w[row] = phi if kind == "angle" else p
    return w


@pytest.fixture(scope="module")
def hooks() -> Hooks:
    return compose(CATALOGUE)


def signals(seed: int) -> dict[str, Any]:
    """One value for every argument of a hook."""
    rng = np.random.default_rng(seed)
    p, u = rng.uniform(0.0, 1e6, 2).tolist()
    values: dict[str, Any] = {name: float(rng.uniform(-2.0, 2.0)) for name in ("phi", "before", "after", "omega")}
    e = rng.standard_normal(EXOGENOUS) * (100.0, 1.0, 1e6, 50.0, 1.0, 20.0, 50.0)
    values |= {
        "p": p,
        "u": u,
        "error": u - p,
        "limit": float(rng.uniform(1e5, 5e8)),
        "fills": u > p,
        "reading": p,
        "force": 3.0,
    }
    return values | {"h": H, "creep_angle": 0.1, "e": tuple(e.tolist())}


@pytest.mark.parametrize("chosen", [(), CATALOGUE], ids=["none", "all"])
def test_neutral_hooks_are_identities_in_compiled_code(chosen: tuple[Effect, ...]) -> None:
    """Fails when the compiled hooks of neutral effects, or of none, change a signal by a bit or add any torque."""
    composed = compose(chosen)
    for seed in range(20):
        s = signals(seed)
        w = working_array(s["phi"], s["p"])
        composed.prepare(w, LANE, H)
        composed.moved(w, LANE, s["before"], s["phi"], H)
        composed.angle_sensor(w, LANE, s["after"], H)
        composed.force_sensor(w, LANE, s["force"], H)
        got = {hook: getattr(composed, hook)(w, LANE, *(s[name] for name in HOOKS[hook])) for hook in _RETURNING}
        assert got["torque"] == (0.0, 0.0)
        assert got["pressure_source"] == got["torque_damping"] == got["damping"] == got["dry"] == 0.0
        for hook, signal in _RETURNING.items():
            if signal and hook != "angle_reading":
                assert got[hook] == s[signal], hook
        assert composed.angle_reading(w, LANE, s["after"]) == s["after"]
        assert not composed.valve_replaced(w, LANE)


_RETURNING = {
    "set_point": "u",
    "valve_error": "error",
    "flow_limit": "limit",
    "pressure_source": "",
    "pressure_reading": "p",
    "pressure_true": "reading",
    "actuator_pressure": "p",
    "torque": "",
    "torque_damping": "",
    "damping": "",
    "dry": "",
    "angle_reading": "phi",
    "force_reading": "force",
}
"""Hooks with a result, and the signal that they pass through."""


def plain(function: Any) -> Callable[..., Any]:
    return getattr(function, "py_func", function)  # type: ignore[no-any-return]


@pytest.mark.parametrize(
    "name", [effect.name for effect in CATALOGUE if effect.hooks and effect.name != "switching_valve"]
)
def test_composed_hooks_bind_the_rows_of_an_effect(name: str, hooks: Hooks) -> None:
    """Fails when a composed hook passes another row, another lane or another order of arguments to an equation."""
    effect = EFFECTS[name]
    rng = np.random.default_rng(len(name))
    values = {
        parameter.key.replace(".", "__"): parameter.scale * rng.uniform(0.6, 0.9)
        * (parameter.typical or parameter.neutral or 0.0)
        for parameter in effect.parameters
    }  # fmt: skip
    s = signals(3)
    w = working_array(s["phi"], s["p"], **values)
    hooks.prepare(w, LANE, H)
    q = tuple(w[list(effect_rows(effect)), LANE].tolist())
    if effect.prepared:
        own_and_read = tuple(w[list(effect_rows(effect, prepared=False)), LANE].tolist())
        assert q == pytest.approx((*own_and_read, *plain(effect.hooks["prepare"])(own_and_read, H)), rel=1e-12)
    memory = list(memory_rows(effect))
    for row in memory:
        w[row, LANE] *= 0.9
        w[row, LANE] += 0.05
    for hook in effect.hooks:
        if hook == "prepare":
            continue
        if (
            hook == "angle_reading" and "angle_sensor" not in effect.hooks
        ):  # passes the neutral filters of other effects
            hooks.angle_sensor(w, LANE, s["phi"], H)
        before = w.copy()
        state = tuple(w[memory, LANE].tolist())
        names = hook_arguments(hook, bool(effect.memory))
        expected = plain(effect.hooks[hook])(*(({"q": q, "m": state} | s)[argument] for argument in names))
        got = getattr(hooks, hook)(w, LANE, *(s[argument] for argument in HOOKS[hook]))
        if hook in ("moved", "angle_sensor", "force_sensor"):
            assert tuple(w[memory, LANE]) == pytest.approx(expected, rel=1e-12), hook
        elif effect.memory and hook in ("set_point", "actuator_pressure"):
            assert got == pytest.approx(expected[0], rel=1e-12), hook
            assert tuple(w[memory, LANE]) == pytest.approx(expected[1], rel=1e-12), hook
        else:
            assert got == pytest.approx(expected, rel=1e-12), hook
        before[list(MEMORY_ROW.values()), LANE] = w[list(MEMORY_ROW.values()), LANE]
        assert np.array_equal(before, w), hook


def test_switching_valve_replaces_the_linear_one_where_its_share_says_so(hooks: Hooks) -> None:
    """Fails when the lane's share is not looked at, or the composed valve is not the effect's."""
    w = working_array(switching_valve__share=1.0)
    hooks.prepare(w, LANE, H)
    assert hooks.valve_replaced(w, LANE)
    assert not hooks.valve_replaced(w, 0)
    effect = EFFECTS["switching_valve"]
    q = tuple(w[list(effect_rows(effect)), LANE].tolist())
    e = signals(1)["e"]
    after, memory = plain(effect.hooks["valve"])(q, (0.0, 0.0, 0.0), 1e5, 3e5, e, H)
    assert hooks.valve(w, LANE, 1e5, 3e5, e, H) == pytest.approx(after, rel=1e-12)
    assert tuple(w[list(memory_rows(effect)), LANE]) == pytest.approx(memory, rel=1e-12)
    assert compose(()).valve(w, LANE, 1e5, 3e5, e, H) == 1e5


def test_readings_act_in_the_order_of_the_catalogue(hooks: Hooks) -> None:
    """Fails when gain acts after offset, a filter does not see the reading so far, or the inverse is not one."""
    w = working_array(angle_gain__error=0.1, angle_offset__offset_deg=0.2, pressure_gain__error=0.1,
                      pressure_offset__offset_pa=5e3, fsr_drift__share=0.5, fsr_gain__error=1.0)  # fmt: skip
    hooks.prepare(w, LANE, H)
    hooks.angle_sensor(w, LANE, 1.0, H)
    assert hooks.angle_reading(w, LANE, 1.0) == pytest.approx(1.3)
    assert hooks.pressure_reading(w, LANE, 2e5) == pytest.approx(2.25e5)
    assert hooks.pressure_true(w, LANE, 2.25e5) == pytest.approx(2e5)
    hooks.force_sensor(w, LANE, 2.0, 1e9)  # creep is over
    assert hooks.force_reading(w, LANE, 2.0) == pytest.approx(2.0 * (2.0 + 0.5 * 2.0))


class Surroundings(tuple[float, ...]):
    """What surrounds a joint; notes which columns an equation uses."""

    used: set[int]

    def __getitem__(self, column: Any) -> Any:
        self.used.add(column)
        return super().__getitem__(column)


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_that_uses_other_joints_says_so(name: str) -> None:
    """Fails when a loop would not give an equation the neighbour's angle or the hand's inflow that it uses."""
    effect, s = EFFECTS[name], signals(5)
    surroundings = Surroundings(s["e"])
    surroundings.used = set()
    w = working_array(0.2, 1e5)
    for hook, function in effect.hooks.items():
        if "e" in HOOKS[hook]:
            values = {"q": tuple(w[list(effect_rows(effect)), LANE].tolist()), "m": (0.5,) * len(memory_rows(effect))}
            names = hook_arguments(hook, bool(effect.memory))
            plain(function)(*((values | s | {"e": surroundings})[argument] for argument in names))
    assert effect.meets_others == bool(surroundings.used & {NEIGHBOUR, INFLOW})
    assert effect.draws == (INFLOW in surroundings.used)


def test_torques_damping_and_friction_add_up(hooks: Hooks) -> None:
    """Fails when the effects of a hook replace each other."""
    w = working_array(gravity__sine_nm=0.1, stiffening__cubic_nm_per_rad3=0.2, coulomb_friction__torque_nm=0.3)
    hooks.prepare(w, LANE, H)
    torque, stiffness = hooks.torque(w, LANE, 1.0, 0.0, 0.0, 0.0, (0.0,) * EXOGENOUS)
    assert torque == pytest.approx(-0.1 * np.sin(1.0) - 0.2, rel=1e-6)
    assert stiffness == pytest.approx(0.1 * np.cos(1.0) + 0.6, rel=1e-6)
    assert hooks.dry(w, LANE, 0.5, 1.0, 0.0) == pytest.approx(0.3)


def test_rows_follow_each_other_without_gap() -> None:
    """Fails when two things share a row, a row is unused, or the plain plant's parameters are not first."""
    assert [parameter.key for parameter in JOINT_PARAMETERS[: len(PLANT_PARAMETERS)]] == [
        parameter.key for parameter in PLANT_PARAMETERS
    ]
    rows = [*ROW.values(), *PREPARED_ROW.values(), *MEMORY_ROW.values()]
    assert rows == list(range(STATE_ROW))
    assert WORK_ROWS > STATE_ROW
    assert {kind for _, kind in STARTS} == {"angle", "pressure"}


def test_active_effects_are_those_off_neutral() -> None:
    """Fails when an effect that acts is left out, or one that does not is compiled in."""
    w = working_array()
    assert active_effects(w[: len(ROW)]) == ()
    for effect in CATALOGUE:
        for parameter in effect.parameters:
            changed = w.copy()
            changed[ROW[parameter.key], 0] += 1e-12
            assert active_effects(changed[: len(ROW)]) == (effect,)


def test_a_set_is_refused_that_is_not_part_of_the_catalogue() -> None:
    """Fails when a set in another order, with an effect twice, or with an unknown effect is composed."""
    gravity, leak = EFFECTS["gravity"], EFFECTS["leak"]
    for effects in ((gravity, leak), (leak, leak)):
        with pytest.raises(ValueError, match="order of the catalogue"):
            compose(effects)
    with pytest.raises(ValueError, match="effect gravity is not part"):
        compose((replace(gravity),))
    assert equations_key("leak") != equations_key()


def good(**changes: Any) -> Effect:
    """An effect that is accepted, with something changed."""

    def torque(q, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
        return -q[0] * phi, q[0]

    values: dict[str, Any] = {
        "name": "spring",
        "place": "joint",
        "parameters": (Parameter("spring.stiffness_nm_per_rad", 0.0, 1.0, "of a spring", 1.0, 0.0, 0.1),),
        "keys": ("spring.stiffness_nm_per_rad",),
        "probes": ((0.1,),),
        "hooks": {"torque": torque},
        "says": "a spring of {stiffness_nm_per_rad} acts on the {angle}",
        "experiments": ("staircase",),
        "doc": "A spring.",
        "source": "Hooke",
    }
    return Effect(**(values | changes))


def prepare(q, h):  # type: ignore[no-untyped-def]
    return (h,)


def other_hook(q, phi):  # type: ignore[no-untyped-def]
    return phi


WRONG: tuple[tuple[dict[str, Any], str], ...] = (
    ({"place": "motor"}, "place is 'motor'; it must be one of supply, valve"),
    ({"says": ""}, "says is empty"),
    ({"doc": ""}, "doc is empty"),
    ({"source": ""}, "source is empty"),
    ({"experiments": ("dance",)}, "experiment is 'dance'; it must be one of staircase"),
    ({"parameters": (Parameter("leak.rate", 0.0, 1.0, "", 1.0, 0.0),)}, "must be in the group 'spring'"),
    ({"parameters": (Parameter("spring.x", 0.0, 1.0, "", 1.0, 2.0),)}, "neutral value of 'spring.x' is 2.0; .* 0 to 1"),
    ({"parameters": (Parameter("spring.x", 0.0, 1.0, ""),)}, "neutral value of 'spring.x' is None"),
    ({"memory": {"loop": "speed"}}, "start of memory 'loop' is 'speed'; it must be one of 0.0, angle, pressure"),
    ({"keys": ("spring.damping",)}, "key is 'spring.damping'"),
    ({"spread": {"spring.x": 1.0}}, "key of spread is 'spring.x'"),
    ({"expected": {"spring.x": 1.0}}, "key of expected is 'spring.x'"),
    ({"shape": ("spring.x",)}, "key of shape is 'spring.x'"),
    ({"probes": ((0.1, 0.2),)}, "a probe has 2 values; it must have 1, one per key"),
    ({"probes": ((),)}, "a probe has 0 values; it must have 1, one per key"),
    ({"says": "a spring of {stiffness}"}, "key in 'says' is 'stiffness'; it must be one of stiffness_nm_per_rad"),
    ({"hooks": {"torqe": other_hook}}, "hook is 'torqe'; it must be one of prepare"),
    ({"hooks": {"moved": other_hook}}, "hook 'moved' needs memory"),
    ({"hooks": {"torque": other_hook}}, "arguments of 'torque' is 'q, phi'; it must be one of q, phi, omega, p"),
    ({"memory": ("loop",)}, "arguments of 'torque' is .* it must be one of q, m, phi"),
    ({"law_hooks": ("moved",)}, "law_hooks is 'moved'; it must be one of torque"),
    ({"hooks": {"prepare": prepare}}, "'prepared' and the hook 'prepare' must be given together"),
    ({"prepared": ("per_scale",)}, "'prepared' and the hook 'prepare' must be given together"),
)


@pytest.mark.parametrize(("changes", "message"), WRONG, ids=[message[:40] for _, message in WRONG])
def test_a_wrong_declaration_is_refused_in_one_line(changes: dict[str, Any], message: str) -> None:
    """Fails when a mistake in an effect's declaration is accepted, or the message names neither effect nor mistake."""
    assert good().starts == {}
    with pytest.raises(ValueError, match=f"^effect spring: .*{message}") as caught:
        good(**changes)
    assert "\n" not in str(caught.value)


def test_a_declaration_is_by_keywords_and_a_name_is_used_once() -> None:
    """Fails when positional declarations, two effects of one name or two parameters of one key are accepted."""
    with pytest.raises(TypeError, match="positional"):
        Effect("spring")  # type: ignore[call-arg, misc]
    with pytest.raises(ValueError, match="the effect 'spring' more than once"):
        assemble([good(), good()])
    twice = good().parameters * 2
    with pytest.raises(ValueError, match=r"the parameter 'spring.stiffness_nm_per_rad' more than once"):
        assemble([good(parameters=twice)])


def test_an_effect_reads_numbers_of_the_plant_and_of_other_effects_only() -> None:
    """Fails when a key that no parameter has may be read, or that of another effect may not."""
    with pytest.raises(ValueError, match=r"effect spring: reads is 'statics.a9', which is no parameter"):
        assemble([good(reads=("statics.a9",))])
    other = replace(good(), name="other", parameters=(), hooks={}, keys=(), probes=(), says="nothing")
    assemble([good(), replace(other, reads=("spring.stiffness_nm_per_rad", "statics.a0_nm"))])
