"""Two effects of one joint: found at once, weighed again next to each other, and known numbers next to a law."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hand_diagnosis.problem import Prepared, Task, effects_without, fit_part, log_evidence
from hand_diagnosis.search import JointSearch, search_joint
from hand_diagnosis.search.completion import with_known_numbers
from hand_diagnosis.search.hypotheses import Hypothesis
from hand_diagnosis.search.pairs import two_at_once
from hand_diagnosis.search.rounds import ranked_round
from hand_identification.map_fit import map_fit
from hand_model.description import Hand
from hand_model.effects import EFFECTS
from hand_model.effects.effect import Effect
from hand_model.kernel.rows import ROW
from test.diagnosis.recordings import changed, record
from validation.other_forms import JOINT, nominal_model, recording

PRESSURE = ("valve_deadband", "valve_hysteresis", "gas_compression")


def prepared(hand: Hand, forms: str, floors: float, seed: int) -> Prepared:
    """The problem of a joint with other forms than the catalogue's, from a model whose numbers are 3 % off."""
    print(f"seed {seed}")
    signals, _ = recording(hand, forms, floors, seed)
    model = nominal_model(hand, seed)
    task = Task(signals=[signals], model=model, joints=[JOINT], effects=[], tolerance=0.05, seed=0, floors={})
    return task.prepare(JOINT)


def chosen(*names: str) -> list[Effect]:
    """Effects by name."""
    return [EFFECTS[name] for name in names]


def names_of(accepted: Sequence[Hypothesis]) -> set[str]:
    """Names of hypotheses."""
    return {hypothesis.effect.name for hypothesis in accepted}


def begun(ready: Prepared, effects: Sequence[Effect]) -> JointSearch:
    """A search whose first round is done and accepted nothing."""
    problem = fit_part(ready.problem)
    nominal = map_fit(problem, ready.free, ready.start)
    found = JointSearch(problem, nominal, log_evidence(problem, nominal))
    found.rounds.append(ranked_round(found, nominal, effects, np.random.default_rng(0)))
    found.evidences.append(found.nominal_evidence)
    return found


def pair_of(found: JointSearch, effects: Sequence[Effect]) -> list[Hypothesis]:
    """The pair that is added to the plain model."""
    return two_at_once(found, found.nominal, found.nominal_evidence, effects, np.random.default_rng(1))


def test_two_effects_are_found_at_once(hand: Hand) -> None:
    """Fails when a round without an acceptable effect is not followed by pairs, or its rounds miss rivals."""
    effects = chosen(*PRESSURE)
    found = begun(prepared(hand, "smooth_dead_zone+chamber_volume", 20.0, 3), effects)
    pair = pair_of(found, effects)
    assert names_of(pair) == {"valve_deadband", "gas_compression"}
    assert pair[1].log_evidence > pair[0].log_evidence + 6.0 > found.nominal_evidence
    assert len(found.rounds) == len(found.evidences) == 2
    assert found.evidences[1] == pair[0].log_evidence
    assert {ROW[key] for hypothesis in pair for key in hypothesis.keys} <= {p.row for p in pair[1].fit.free}


def test_one_effect_gets_no_second_one(hand: Hand) -> None:
    """Fails when the only effect of a joint, or none, is found with a second one that is not there."""
    for form in ("smooth_dead_zone", "plain"):
        effects = chosen(*PRESSURE)
        found = begun(prepared(hand, form, 20.0, 4), effects)
        assert pair_of(found, effects) == []
        assert (len(found.rounds), len(found.evidences)) == (1, 1)


def test_an_effect_gives_way_to_a_better_name_next_to_a_later_one(hand: Hand) -> None:
    """Fails when a dead band that stood for a leak while the hysteresis of the valve was missing is kept."""
    ready = prepared(hand, "orifice_leak+play_of_spool", 30.0, 6)
    effects = chosen("valve_deadband", "valve_hysteresis", "pressure_gain", "leak")
    found = search_joint(fit_part(ready.problem), effects, ready.free, np.random.default_rng(0), ready.start)
    assert names_of(found.accepted) == {"leak", "valve_hysteresis"}


def test_numbers_that_a_law_does_not_need_stay_known(hand: Hand) -> None:
    """Fails when creep of two retardation times loosens the numbers of Eq. 12, which then mispredict other data."""
    ready = prepared(hand, "kelvin_voigt_creep", 12.0, 5)
    found = search_joint(fit_part(ready.problem), chosen("creep"), ready.free, np.random.default_rng(0), ready.start)
    known = {parameter.row: parameter for parameter in found.nominal.free}
    rows = {ROW[key] for key in EFFECTS["creep"].keys}
    assert found.accepted[0].freed
    assert {p.row for p in found.final.free if p.row in rows} == rows
    assert all(p == known[p.row] for p in found.final.free if p.row in rows)


def test_a_textbook_form_keeps_its_numbers_free(hand: Hand) -> None:
    """Fails when an effect that is nothing but other numbers of the plain plant returns to their tolerance."""
    rng = np.random.default_rng(7)
    slow = changed(hand, JOINT, material__extension_time_s=3.0, material__phi_max_deg=80.0)
    task = Task(signals=[record(slow, rng, 24.0)], model=hand, joints=[JOINT], effects=[], tolerance=0.05, seed=0,
                floors={})  # fmt: skip
    ready = task.prepare(JOINT)
    found = search_joint(
        fit_part(ready.problem), chosen("creep"), ready.free, np.random.default_rng(0), ready.start, laws=False
    )
    assert names_of(found.accepted) == {"creep"} and not found.accepted[0].freed
    (kept,) = with_known_numbers(found.problem, found.nominal, found.accepted)
    assert kept is found.accepted[0]


def test_a_neighbour_is_offered_where_one_moves(hand: Hand) -> None:
    """Fails when a spring from a joint that was not recorded, or that rests, may stand for this joint's elasticity."""
    rng = np.random.default_rng(8)
    alone, _ = recording(hand, "plain", 0.0, 8)
    effects, offered = effects_without((), hand), []
    for signals in (record(hand, rng, 12.0), alone):
        task = Task(signals=[signals], model=hand, joints=[JOINT], effects=effects, tolerance=0.05, seed=0, floors={})
        beside = task.effects_beside(task.prepare(JOINT).problem)
        offered.append([effect.name for effect in effects if effect not in beside])
    assert offered == [[], ["joint_coupling"]]
