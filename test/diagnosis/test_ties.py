"""What a report says of two ties: the experiment that separates each by simulation, or why none does."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hand_diagnosis.experiments import SIMULATED, next_experiment, recordings_needed, tie_separations
from hand_diagnosis.judgement import Finding, findings
from hand_diagnosis.search import Hypothesis
from hand_diagnosis.settings import SETTINGS
from hand_identification.free_parameters import effect_free_parameters
from hand_identification.joint_data import joint_problem
from hand_identification.map_fit import map_fit
from hand_machine.wording import wording_of
from hand_model.description import Hand, load_hand
from hand_model.effects import EFFECTS
from hand_model.quantities import HAND
from test.diagnosis.recordings import CONFIG, recorded_alone

JOINTS = ("index_distal", "ring_distal")
SEED = 5


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand(CONFIG)


def tied(hand: Hand, joint: str, sizes: tuple[float, float]) -> tuple[Finding, Any]:
    """A finding of a valve's lag that ties with a leak on a recording at rest, and its joint of a diagnosis.

    sizes: of the lag and the leak in their usual sizes.
    """
    print(f"seed {SEED}")
    commands = np.zeros((1500, 11))
    commands[:, hand.joints.index(joint)] = 1e5
    problem = joint_problem([recorded_alone(hand, commands, joint)], hand, joint)
    hypotheses = []
    for name, size in zip(("valve_lag", "leak"), sizes, strict=True):
        free = effect_free_parameters(EFFECTS[name], problem.nominal)
        hypotheses.append(
            Hypothesis(EFFECTS[name], map_fit(problem, free, size * np.ones(len(free)), 1), 0.0, 0, (0.0, 0.0))
        )
    finding = Finding(
        joint=joint,
        place="valve",
        effect="valve_lag",
        probability=0.5,
        alternatives=(("leak", 0.45, "hold"),),
        when=(),
        signal="pressure",
        condition="everywhere",
        numbers=(),
        statement="",
        tied_with=("leak",),
    )
    return finding, SimpleNamespace(joint=joint, search=SimpleNamespace(problem=problem, rounds=[hypotheses]))


@pytest.fixture(scope="module")
def diagnosis(hand: Hand) -> Any:
    """Two ties: one of models that differ in motion, one of models that hardly differ in any motion."""
    apart, alike = tied(hand, JOINTS[0], (0.5, 0.5)), tied(hand, JOINTS[1], (0.0, 0.0))
    findings = (alike[0], apart[0])
    return SimpleNamespace(findings=findings, joints=[apart[1], alike[1]], remainder=(), wording=HAND)


def changed(diagnosis: Any, **fields: Any) -> Any:
    """The diagnosis with other fields."""
    return SimpleNamespace(**{**vars(diagnosis), **fields})


def test_each_tie_has_the_command_that_separates_it(diagnosis: Any) -> None:
    """Fails when only one of two ties gets a command, or a command is about another joint."""
    findings = tuple(replace(diagnosis.findings[1], joint=joint) for joint in JOINTS)
    joints = [SimpleNamespace(joint=joint, search=diagnosis.joints[0].search) for joint in JOINTS]
    both = changed(diagnosis, findings=findings, joints=joints)
    separations = tie_separations(both)
    for joint, tie in zip(JOINTS, separations, strict=True):
        assert tie is not None and tie["name"] in SIMULATED
        assert tie["command"] == f"hand excite {tie['name']} --joints {joint} --live --out {tie['name']}.mcap"
        assert tie["why"].startswith(
            f"separates valve_lag (50%) from leak (45%) on {joint}; in simulation the two differ by "
        )
    assert next_experiment(both, separations) in separations


def test_a_tie_without_an_experiment_says_why(diagnosis: Any) -> None:
    """Fails when an experiment is named although no simulated one separates the two, or the reason is missing."""
    tie = tie_separations(diagnosis)[0]
    assert tie is not None and tie["name"] == "closed_valve_push"
    assert (
        "shows leak and is arranged by hand, so that it cannot be simulated; in simulation of every other" in tie["why"]
    )
    machine = wording_of(True, per_torque=1.0, per_angle=1.0, per_input=1.0, per_force=1.0)
    of_machine = changed(diagnosis, wording=machine)
    alike, apart = tie_separations(of_machine)
    assert (
        alike is not None
        and alike["why"].startswith("no experiment of the catalogue separates them")
        and "name" not in alike
    )
    assert apart is not None and "name" in apart and "command" not in apart


def test_a_finding_without_a_tie_has_none(diagnosis: Any) -> None:
    """Fails when a finding that ties with nothing gets an experiment for a tie."""
    alone = changed(diagnosis, findings=(replace(diagnosis.findings[1], tied_with=()),))
    assert tie_separations(alone) == [None]


def test_a_tie_is_broken_by_evidence() -> None:
    """Fails when a difference below that of a tie counts as a separation by one recording, or the evidence of several
    does not add up, or the recorded motion or hundreds of recordings are proposed.
    """
    enough = 1.01 * np.sqrt(2.0 * SETTINGS.tie_log_evidence)
    assert recordings_needed(enough, 0.0) == 1
    assert recordings_needed(0.5 * enough, 0.0) == 4
    assert recordings_needed(enough, enough) == recordings_needed(0.1 * enough, 0.0) == recordings_needed(0.0, 0.0) == 0


@pytest.mark.parametrize(("unsure", "first"), [(0.3, JOINTS[1]), (0.9, JOINTS[0])])
def test_a_guess_stands_behind_a_sure_finding(monkeypatch: pytest.MonkeyPatch, unsure: float, first: str) -> None:
    """Fails when a guess about a joint that missed more comes before what is sure on another, or a tie is a guess."""

    def finding(joint: str, effect: str, probability: float, *tied: str) -> Finding:
        return Finding(
            joint=joint,
            place="valve",
            effect=effect,
            probability=probability,
            alternatives=(("leak", 0.45, "hold"), ("gravity", 0.5, "hold")),
            when=(),
            signal="pressure",
            condition="everywhere",
            numbers=(),
            statement="",
            tied_with=tied,
        )

    of_joints = {
        JOINTS[0]: [finding(JOINTS[0], "creep", 0.98), finding(JOINTS[0], "contact", unsure)],
        JOINTS[1]: [finding(JOINTS[1], "valve_lag", 0.5, "leak")],
    }
    monkeypatch.setattr(findings, "joint_findings", lambda result: of_joints[result.joint])
    costs = {JOINTS[0]: 100.0, JOINTS[1]: 40.0}
    ended = SimpleNamespace(cost=0.0)
    results: list[Any] = [
        SimpleNamespace(joint=joint, search=SimpleNamespace(nominal=SimpleNamespace(cost=cost), final=ended))
        for joint, cost in costs.items()
    ]
    ranked = findings.ranked_findings(results, [])
    assert ranked[0].effect == "creep" and ranked[1].joint == first
