"""An end stop and an obstacle have one law: what the recording cannot separate is a tie, and what it can is none.

The plant is that of links.py, which is independent of the kernel.
"""

from __future__ import annotations

import numpy as np
import pytest

from hand_diagnosis.diagnosis import Diagnosis, diagnose
from hand_diagnosis.experiments import tie_separations
from hand_identification.free_parameters import nominal_free_parameters
from hand_identification.joint_problem import validation_blocks
from hand_identification.settings import FITS
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.effects import CATALOGUE
from hand_model.kernel.rows import ROW
from test.diagnosis.links import FINGER, PERIOD_S, Stop, changing_inertia, finger, recorded, run, waves
from test.diagnosis.recordings import CONFIG, changed

SEED = 8
FINE = 8
RIVALS = {"end_stop", "contact", "coulomb_friction", "stiffening", "constant_load"}
WITHOUT = tuple(effect.name for effect in CATALOGUE if effect.keys and effect.name not in RIVALS)
"""The whole catalogue takes minutes."""


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand(CONFIG)


def moved(hand: Hand, *stops: Stop | None) -> tuple[Array, Array, list[Array], np.random.Generator]:
    """Set-points and pressures [Pa], the angles [rad] with each of the stops, and the generator of the noise."""
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    numbers, u = finger(hand, rng, 0.03), np.clip(1.25 * waves(rng, 16.0), 0.0, 4.5e5)
    runs = [run(numbers, u, changing_inertia(hand), stop, FINE) for stop in stops]
    return u, runs[0][0], [x for _, x in runs], rng


def diagnosed(hand: Hand, u: Array, p: Array, x: Array, rng: np.random.Generator) -> Diagnosis:
    signals = recorded(u, p, x, rng)
    return diagnose([signals], hand, tolerance=0.05, seed=0, sensor_curve=False, without=WITHOUT, joints=[FINGER[1]])


@pytest.mark.parametrize(("at_deg", "leads", "other"), [(55.0, "contact", "end_stop"), (84.0, "end_stop", "contact")])
def test_a_stop_and_an_obstacle_are_a_tie_that_the_place_orders(
    hand: Hand, at_deg: float, leads: str, other: str
) -> None:
    """Fails when one is named alone, an obstacle far inside the range (to 100 degrees) is called an end stop first or a
    stop near its end an obstacle, a probability is missing, or the experiment that separates them is not stated.
    """
    u, p, (x,), rng = moved(hand, Stop(np.radians(at_deg), 8.0, 0.02))
    assert x[:, 1].max() > np.radians(at_deg)
    result = diagnosed(hand, u, p, x, rng)
    (finding,) = result.findings
    assert (finding.effect, finding.tied_with) == (leads, (other,))
    assert finding.alternatives[0][0] == other
    assert 0.0 < finding.alternatives[0][1] < finding.probability
    (tie,) = tie_separations(result)
    assert tie is not None and tie["name"] == "free_space" and "nothing in reach" in tie["how"]


def test_a_stop_that_is_a_little_off_is_a_wrong_number(hand: Hand) -> None:
    """Fails when a joint whose stop begins 2.5 degrees before the described angle lacks physics, or keeps the error."""
    u, p, (x,), rng = moved(hand, Stop(np.radians(84.0), 5.0, 0.02))
    described = changed(hand, FINGER[1], end_stop__high_deg=np.radians(86.5))
    result = diagnosed(described, u, p, x, rng)
    assert result.verdict == "agrees", result.findings
    (joint,) = result.joints
    assert -1.5 < joint.search.nominal.by_row[ROW["end_stop.high_deg"]] < -0.5


def test_a_stop_that_only_one_held_out_block_shows_is_a_wrong_number(hand: Hand) -> None:
    """Fails when validation blocks stay where they alone show something, which so no model can be fitted to."""
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    numbers, u = finger(hand, rng, 0.03), np.clip(0.8 * waves(rng, 24.0), 0.0, 2.5e5)
    length = round(FITS.block_s / PERIOD_S)
    held = int(np.flatnonzero(validation_blocks(len(u) // length))[2])
    u[held * length : (held + 1) * length, 1] += 2e5 * np.sin(np.linspace(0.0, np.pi, length)) ** 2
    p, x = run(numbers, u, 0.0, Stop(np.radians(84.0), 5.0, 0.02), FINE)
    met = np.flatnonzero(x[:, 1] > np.radians(84.0)) // length
    assert set(met) == {held}
    described = changed(hand, FINGER[1], end_stop__high_deg=np.radians(88.0))
    result = diagnosed(described, u, p, x, rng)
    assert result.verdict == "agrees", result.findings
    (joint,) = result.joints
    assert not joint.search.problem.validation[held]


def test_a_stop_of_another_material_is_a_wrong_number(hand: Hand) -> None:
    """Fails when a joint that hits a softer stop, which is damped more, lacks physics, or its impacts do."""
    u, p, (x,), rng = moved(hand, Stop(np.radians(84.0), 1.5, 0.1))
    described = changed(hand, FINGER[1], end_stop__high_deg=np.radians(84.0))
    result = diagnosed(described, u, p, x, rng)
    assert result.verdict == "agrees", result.findings
    (joint,) = result.joints
    assert joint.search.nominal.by_row[ROW["end_stop.stiffness_nm_per_rad"]] < -0.5


def test_a_stop_without_damping_is_diagnosed(hand: Hand) -> None:
    """Fails when a described damping of 0 ends the diagnosis of a joint that meets a stop elsewhere."""
    u, p, (x,), rng = moved(hand, Stop(np.radians(60.0), 8.0, 0.02))
    result = diagnosed(changed(hand, FINGER[1], end_stop__damping_nm_s_per_rad=0.0), u, p, x, rng)
    assert not result.not_judged
    assert result.findings[0].effect in ("contact", "end_stop")


@pytest.mark.parametrize(
    ("least_deg", "most_deg", "free"),
    [(0.0, 80.0, set()), (0.0, 90.0, {"high_deg"}), (-5.0, 80.0, {"low_deg"}), (-5.0, 90.0, {"high_deg", "low_deg"})],
)
def test_only_stops_that_the_joint_came_near_are_free(
    hand: Hand, least_deg: float, most_deg: float, free: set[str]
) -> None:
    """Fails when a stop that no reading depends on is fitted, a near one is not, one near 0 is taken as exact, or it
    passes as a wrong number wherever it is because other numbers are uncertain.
    """
    nominal, motion = hand.parameters[:, 0], (np.radians(least_deg), np.radians(most_deg))
    how = {"stiffness_nm_per_rad", "damping_nm_s_per_rad"} if free else set()
    for tolerance in (0.05, 0.2):
        found = {p.key: p for p in nominal_free_parameters(nominal, tolerance, True, hand.tolerances, motion)}
        stops = {key.removeprefix("end_stop.") for key in found if key.startswith("end_stop.")}
        assert stops == free | how
        assert all(found[f"end_stop.{name}"].log for name in how)
        for name in free:
            of_deg = {"low_deg": 55.0, "high_deg": 100.0}[name]  # half the range, where the angle is smaller
            assert found[f"end_stop.{name}"].scale == pytest.approx(0.05 * np.radians(of_deg))


@pytest.mark.long
def test_what_comes_inside_the_recording_is_an_obstacle(hand: Hand) -> None:
    """Fails when an obstacle that comes in the middle of a recording ties with an end stop, which is always there."""
    at = np.radians(50.0)
    u, p, (free, blocked), rng = moved(hand, None, Stop(at, 1.0, 0.02))
    clear = np.maximum(free[:, 1], blocked[:, 1]) < at - np.radians(5.0)
    comes = len(u) // 2 + int(np.argmax(clear[len(u) // 2 :]))  # it comes where both motions are away from it
    result = diagnosed(hand, u, p, np.concatenate([free[:comes], blocked[comes:]]), rng)
    finding = result.findings[0]
    assert (finding.effect, finding.tied_with) == ("contact", ())
    assert finding.onset is not None and abs(finding.onset.at_s - comes * PERIOD_S) < 0.5


def test_a_free_finger_has_neither(hand: Hand) -> None:
    """Fails when a finger that meets nothing gets a stop or an obstacle."""
    u, p, (x,), rng = moved(hand, None)
    assert diagnosed(hand, u, p, x, rng).verdict == "agrees"
