"""Laws of stops, obstacles and couplings: they rise with the displacement whatever the coefficients, and never pull."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest import approx
from scipy.optimize import nnls

from hand_model.arrays import Array
from hand_model.description import load_hand
from hand_model.effects import EFFECTS
from hand_model.effects.effect import NEIGHBOUR
from hand_model.effects.force_curves import DEPTHS, engaged, steeper
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.rows import ROW
from hand_model.statics import torque as static_torque
from test.model.plain_numbers import PLAIN

CONFIG = Path(__file__).parents[2] / "config" / "hand.yaml"
STATICS = [ROW[f"statics.{key}"] for key in ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad")]
LOW, HIGH = PLAIN["end_stop.low_deg"], PLAIN["end_stop.high_deg"]
SPAN = HIGH - LOW
WALL, ENGAGEMENT = PLAIN["contact.angle_deg"], PLAIN["contact.engagement_deg"]
DRAWS = 40
SPRING = ("stiffness_nm_per_rad", "damping_nm_s_per_rad", "engagement_deg")


def numbers(name: str, **given: float) -> tuple[float, ...]:
    """q of an effect: own parameters, neutral where not given, and what it reads."""
    effect = EFFECTS[name]
    own = tuple(given.get(each.key.partition(".")[2], each.neutral_si) for each in effect.parameters)
    return (*own, *(PLAIN[key] for key in effect.reads))


def drawn(name: str, rng: np.random.Generator) -> dict[str, float]:
    """Coefficients of the law within their bounds, most of them near the lower one."""
    laws = (each for each in EFFECTS[name].parameters if each.law)
    return {each.key.partition(".")[2]: each.low + (each.high - each.low) * rng.uniform() ** 4 for each in laws}


def torque(
    name: str, q: tuple[float, ...], phi: float, neighbour: float = 0.0, omega: float = 0.0
) -> tuple[float, float]:
    around = (0.0,) * NEIGHBOUR + (neighbour,)
    function: Any = EFFECTS[name].hooks["torque"]
    added, stiffness = getattr(function, "py_func", function)(q, phi, omega, 0.0, 0.0, around)
    return float(added), float(stiffness)


def curve(name: str, q: tuple[float, ...], x: Array) -> Array:
    constitution = EFFECTS[name].constitution
    assert constitution is not None and constitution.curve is not None
    function: Callable[..., float] = constitution.curve
    return np.array([function(q, float(value), 0.0) for value in x])


@pytest.mark.parametrize(
    ("name", "x"), [("contact", np.linspace(WALL, HIGH, 80)), ("end_stop", np.linspace(HIGH, 2.5, 80))]
)
def test_a_stop_pushes_and_rises_with_the_depth_whatever_its_law(name: str, x: Array) -> None:
    """Fails when a stop with a law pulls, gives way at a greater depth, or acts outside."""
    rng = np.random.default_rng(4)
    for _ in range(DRAWS):
        q = numbers(name, **drawn(name, rng))
        pushed = curve(name, q, x)
        assert pushed[0] == 0.0 and np.all(np.diff(pushed) > 0.0)
        assert torque(name, q, float(x[0]) - 0.05) == (0.0, 0.0)


@pytest.mark.parametrize("name", ["contact", "end_stop"])
def test_a_stop_with_damping_never_pulls_and_takes_energy(name: str) -> None:
    """Fails when a stop pulls a joint that leaves it, its damping helps the motion, or is not the slope over speed."""
    rng = np.random.default_rng(5)
    begins = WALL if name == "contact" else HIGH
    stiffness, damping, width = (PLAIN[f"{name}.{key}"] for key in SPRING)
    for _ in range(DRAWS):
        q = numbers(name, **drawn(name, rng))
        depth, omega = float(rng.uniform(0.0, 0.5)), float(rng.uniform(-20.0, 20.0))
        x, share = engaged(depth, width, 1.0 / width)
        plain = max(stiffness * x + damping * share * omega, 0.0)
        pushes = [
            plain_at - torque(name, q, begins + depth, omega=speed)[0]
            for speed, plain_at in ((omega, plain), (0.0, stiffness * x))
        ]
        assert pushes[0] >= -1e-12
        assert (pushes[0] - pushes[1]) * omega >= -1e-9
        slower, faster = (torque(name, q, begins + depth, omega=omega + side)[0] for side in (-1e-6, 1e-6))
        hook: Any = EFFECTS[name].hooks["torque_damping"]
        given = getattr(hook, "py_func", hook)(q, begins + depth, omega, 0.0, 0.0, ())
        if pushes[0] > 1e-6:
            assert given == approx(-(faster - slower) / 2e-6, rel=1e-3, abs=1e-6)


def test_a_stop_with_a_law_is_alike_at_both_ends() -> None:
    """Fails when the stop of extension has another curve than that of flexion, or pushes the other way."""
    q = numbers("end_stop", steeper_1=2.0, steeper_3=7.0)
    depths = np.linspace(0.0, 0.5, 40)
    np.testing.assert_allclose(curve("end_stop", q, HIGH + depths), -curve("end_stop", q, LOW - depths), atol=1e-12)
    assert torque("end_stop", q, LOW - 0.1)[0] > 0.0 > torque("end_stop", q, HIGH + 0.1)[0]


@pytest.mark.parametrize("name", ["contact", "end_stop", "joint_coupling"])
def test_the_stiffness_is_the_slope_of_the_torque(name: str) -> None:
    """Fails when the stiffness that a law reports is not that of its torque."""
    rng = np.random.default_rng(6)
    given = {"stiffness_nm_per_rad": 0.02, "ratio": 0.7} if name == "joint_coupling" else {}
    step = 1e-7
    for _ in range(DRAWS):
        q = numbers(name, **given, **drawn(name, rng))
        phi, neighbour = float(rng.uniform(-0.4, 1.9)), float(rng.uniform(-1.0, 1.5))
        above, below = (torque(name, q, phi + side * step, neighbour)[0] for side in (0.5, -0.5))
        assert torque(name, q, phi, neighbour)[1] == approx(-(above - below) / step, rel=1e-4, abs=1e-5)


@pytest.mark.parametrize(
    ("power", "reach"), [(0.6, 0.25), *((power, reach) for power in (1.0, 1.5, 2.0, 2.5) for reach in (0.1, 0.25, 0.5))]
)
def test_the_law_of_an_obstacle_describes_powers_of_the_depth(power: float, reach: float) -> None:
    """Fails when the force of a sphere on a plane (power 1.5), of foam or of a cone is further off than 3 %."""
    depth = np.linspace(0.0, reach * SPAN, 200)
    x = [engaged(value, ENGAGEMENT, 1.0 / ENGAGEMENT)[0] for value in depth]
    basis = [x, *([steeper(value / SPAN, DEPTHS, shares)[0] for value in x] for shares in np.eye(4))]
    _, left = nnls(np.array(basis).T, depth**power)
    assert left / np.sqrt(len(depth)) < 0.03 * float(np.sqrt(np.mean(depth ** (2 * power))))


def test_a_coupling_with_a_law_rises_and_may_be_slack() -> None:
    """Fails when a coupling falls with the difference of the angles, or play or slack on one side is no law of it."""
    rng, x = np.random.default_rng(8), np.linspace(-1.5, 1.5, 121)
    for _ in range(DRAWS):
        q = numbers("joint_coupling", stiffness_nm_per_rad=0.02, **drawn("joint_coupling", rng))
        assert np.all(np.diff(curve("joint_coupling", q, x)) >= -1e-12)
    gaps = {"ahead_gap_deg": 0.15, "behind_gap_deg": 0.3}
    pulled = curve("joint_coupling", numbers("joint_coupling", stiffness_nm_per_rad=0.02, **gaps), x)
    expected = 0.02 * (np.maximum(x - 0.15, 0.0) - np.maximum(-x - 0.3, 0.0))
    np.testing.assert_allclose(pulled, expected, atol=1e-12)
    slack = {f"behind_{k}": -1.0 for k in range(1, 5)}
    pulled = curve("joint_coupling", numbers("joint_coupling", stiffness_nm_per_rad=0.02, **slack), x)
    np.testing.assert_allclose(pulled, 0.02 * np.maximum(x, 0.0), atol=1e-12)


def test_a_joint_rests_where_the_obstacle_balances_it() -> None:
    """Fails when the law of an obstacle acts in the plant with another size than in its curve."""
    hand = load_hand(CONFIG)
    column = hand.parameters[:, [hand.joints.index("index_distal")]].copy()
    column[ROW["material.phi_max_deg"]] = 0.0
    given = {"steeper_2": 4.0, "steeper_3": 15.0}
    obstacle = {key.partition(".")[2]: PLAIN[key] for key in EFFECTS["contact"].reads if key.startswith("contact.")}
    column[ROW["end_stop.low_deg"]], column[ROW["end_stop.high_deg"]] = LOW, HIGH
    for key, value in (given | obstacle).items():
        column[ROW[f"contact.{key}"]] = value
    loop = ClosedLoop(column[None], np.array([-1]), np.zeros((1, 4, 1)), 0.01)
    angle = float(loop.advance(np.full((1, 600, 1), 3e5))[0][-1, 1, 0])
    drive = float(static_torque(3e5, angle, 0.0, *column[STATICS, 0], 0.0))
    assert angle > WALL
    assert drive == approx(float(curve("contact", numbers("contact", **given), np.array([angle]))[0]), rel=1e-3)
