"""Learned laws from data: a fit from far away arrives, the textbook form stays where it suffices, laws in words.

The plant is the kernel's own closed loop with coefficients of a law that are known; the fit uses the open loop on noisy
readings. Forms that no class has are compared in validation/laws.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pytest import approx

from hand_diagnosis.problem import validation_rmse
from hand_diagnosis.search import LearnedLaw, describe, laws, learn_law, posterior_covariance, training_evidence
from hand_identification.driving import shape_driving
from hand_identification.free_parameters import (
    effect_free_parameters,
    law_free_parameters,
    merged,
    nominal_free_parameters,
)
from hand_identification.joint_data import joint_problem
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, map_fit
from hand_model.arrays import Array
from hand_model.description import load_hand
from hand_model.effects import EFFECTS
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.rows import ROW
from hand_model.quantities import amount
from hand_recording.signals import Signals

CONFIG = Path(__file__).resolve().parents[2] / "config" / "hand.yaml"
JOINT, PERIOD_S, SECONDS = "index_distal", 0.01, 32.0
NOISE = np.array([150.0, np.radians(0.03)])
CLOSE = 1.25
"""Validation error over the noise up to which a fit has arrived: the limit of docs/proof.md."""
FIT_SEED = 3
TRUTHS: Mapping[str, Mapping[str, float]] = {
    "valve_lag": {"time_constant_s": 0.05, "resonance": 6.0},
    "valve_deadband": {"width_pa": 1.2e4, "slope_left": 0.2},
    "leak": {"rate_per_s": 1.0, "with_pressure": 2.0},
    "gas_compression": {"exponent": 1.2, "volume_m3": 1e-6, "with_pressure": 1.5},
    "tube_lag": {"time_constant_s": 0.03, "added_4_s": 0.04, "added_5_s": 0.1},
    "creep": {"shift_2_deg": 0.1, "shift_4_deg": 0.08},
    "hysteresis": {"torque_nm": 0.02, "scale_deg": 0.15, "unload_4": 3.0, "knee_8": 1.0},
    "stiffening": {"angle_2_nm": 0.02, "angle_5_nm": -0.015},
    "ageing": {"stiffness_per_h": 1.0 / 3600.0, "early": 0.3},
    "viscous_friction": {"from_3_nm_s_per_rad": 3e-3, "thinning_nm_s_per_rad": 3e-3},
    "backlash": {"gap_deg": 0.05, "inner_share": 0.5, "inner_gap": 0.3},
    "hall_misalignment": {"sine_deg": 0.02, "cosine_3_deg": 0.02},
    "gravity": {"sine_nm": 0.03, "turning_rad_per_s": 0.03},
    "valve_hysteresis": {"width_pa": 1.2e4, "follows": 0.4, "inner": 0.5},
    "thermal_drift": {"softening": 0.3, "time_constant_s": 15.0, "by_use": 0.9, "by_strain": 0.6},
    "contact": {"angle_deg": 0.7, "stiffness_nm_per_rad": 0.02, "steeper_2": 3.0, "steeper_3": 20.0},
}
"""Own parameters of the plant by effect, SI; their names without the effect."""


def excitation(rng: np.random.Generator) -> Array:
    """Staircase, slow triangle, random steps and multisine, a quarter each (T,) [Pa]."""
    count = round(SECONDS / PERIOD_S / 4)
    time = np.arange(count) * PERIOD_S
    levels = np.r_[np.linspace(0.0, 4e5, 5), np.linspace(3e5, 0.0, 4)]
    slow = 4e5 * np.abs(2.0 * ((1.5 * time / time[-1]) % 1.0) - 1.0)
    steps = np.repeat(rng.uniform(0.0, 4.2e5, count // 60 + 1), 60)[:count]
    waves = sum(5e4 * np.sin(2 * np.pi * f * time + rng.uniform(0.0, 6.0)) for f in np.geomspace(0.1, 4.0, 8))
    stairs = np.repeat(levels, count // 9 + 1)[:count]
    return np.concatenate([stairs, slow, steps, np.clip(2e5 + waves, 0.0, 4.5e5)])


def made(effect: str, truth: Mapping[str, float], seed: int) -> tuple[JointProblem, MapFit]:
    """A recording of one joint with an effect of given parameters, and the nominal model fitted to it."""
    print(f"{effect}: seed {seed}")
    rng, hand = np.random.default_rng(seed), load_hand(CONFIG)
    index = hand.joints.index(JOINT)
    parameters = hand.parameters.copy()
    parameters[ROW["dynamics.coupling_inertia_kg_m2"]] = 0.0
    column = parameters[:, [index]].copy()
    for key, value in truth.items():
        column[ROW[f"{effect}.{key}"]] = value
    commands = excitation(rng)
    loop = ClosedLoop(column[None], np.array([-1]), np.zeros((1, 4, 1)), PERIOD_S)
    states = np.concatenate([np.zeros((1, 4, 1)), loop.advance(commands[None, :-1, None])[0]])
    shape, yes = (len(commands), 1), np.ones(1, dtype=bool)
    pressure, angle = (states[:, k] + NOISE[k] * rng.standard_normal(shape) for k in (0, 1))
    nothing, known = np.full(shape, np.nan), np.ones(shape, dtype=bool)
    signals = Signals(
        name="s",
        joints=(JOINT,),
        period_s=PERIOD_S,
        set_point_pa=commands[:, None],
        pressure_pa=pressure,
        angle_rad=angle,
        force_n=nothing,
        known=known,
        has_set_point=yes,
        has_pressure=yes,
    )
    problem = joint_problem([signals], replace(hand, parameters=parameters), JOINT)
    free = nominal_free_parameters(problem.nominal, 0.03, True)
    fit = map_fit(problem, free, np.zeros(len(free)))
    shape_driving(problem, free, fit.z)
    return problem, map_fit(problem, free, fit.z)


def textbook(problem: JointProblem, nominal: MapFit, effect: str, truth: Mapping[str, float]) -> MapFit:
    """The fit of the textbook form from a third of the effect's true size."""
    free = merged(nominal.free, effect_free_parameters(EFFECTS[effect], problem.nominal))
    here = {parameter.row: float(z) for parameter, z in zip(nominal.free, nominal.z, strict=True)}
    start = []
    for parameter in free:
        size = truth.get(parameter.key.partition(".")[2])
        shape = 1.0 if parameter.key in EFFECTS[effect].shape else 1 / 3
        start.append(here.get(parameter.row, 0.0) if size is None else parameter.coordinate(shape * size))
    return map_fit(problem, free, np.array(start), 20)


def ratios(problem: JointProblem, fit: MapFit) -> Array:
    """Validation errors of pressure and angle over the noise."""
    return np.asarray(validation_rmse(problem, fit.squares)[:2] / NOISE)


QUICK = ("backlash", "gravity", "stiffening", "thermal_drift", "tube_lag")
"""Laws of every part, which the short tests fit; the long ones fit all."""


@pytest.mark.parametrize(
    "effect", [pytest.param(name, marks=() if name in QUICK else pytest.mark.long) for name in TRUTHS]
)
def test_a_fit_of_a_law_arrives_from_the_textbook_form(effect: str) -> None:
    """Fails when the fit of a law stays in a local minimum, is not preferred, or its evidence is not the larger one."""
    problem, nominal = made(effect, TRUTHS[effect], 1)
    plain = textbook(problem, nominal, effect, TRUTHS[effect])
    law = learn_law(problem, plain, EFFECTS[effect], np.random.default_rng(FIT_SEED))
    stage = 0 if EFFECTS[effect].place == "valve" or effect in ("leak", "gas_compression") else 1
    assert ratios(problem, plain)[stage] > 1.5  # else the law would have nothing to explain
    assert law.stage == stage
    assert law.preferred
    assert law.evidence > 0.0
    assert law.evidence == approx(training_evidence(problem, law.fit) - training_evidence(problem, plain))
    assert law.chosen is law.fit
    sharp = replace(problem, weight=25.0 * problem.weight)  # the practical floor hides what the noise would show
    assert ratios(problem, map_fit(sharp, law.fit.free, law.fit.z, 10))[stage] < CLOSE
    assert 0.0 < law.coefficients <= len(law.freed) <= len(EFFECTS[effect].coefficients)


def test_points_to_start_from_differ_and_every_kind_has_its_turn() -> None:
    """Fails when a point that a bound made equal to another is fitted twice, or one kind of points takes all turns."""
    points = [np.array([float(k), 0.0]) for k in range(6)]
    again = [points[1], -1.0 * points[0], points[2], -1.0 * (-points[1])]  # the second has negative zeros
    form, near, far = laws.distinct([points[:1], again, points[2:]])
    assert [float(point[0]) for group in (form, near, far) for point in group] == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert [float(point[0]) for point in laws.in_turn([near, far, []], 3)] == [1.0, 3.0, 2.0]
    assert [float(point[0]) for point in laws.in_turn([near, far], 9)] == [1.0, 3.0, 2.0, 4.0, 5.0]


@pytest.fixture(scope="module")
def leaking() -> tuple[JointProblem, LearnedLaw]:
    problem, nominal = made("leak", TRUTHS["leak"], 1)
    return problem, learn_law(
        problem, textbook(problem, nominal, "leak", TRUTHS["leak"]), EFFECTS["leak"], np.random.default_rng(FIT_SEED)
    )


@pytest.mark.parametrize("effect", ["leak", "hysteresis", "stiffening"])
def test_the_textbook_form_stays_where_it_suffices(effect: str) -> None:
    """Fails when a plant in the textbook form gets a learned law, or many coefficients."""
    truth = {"leak": {"rate_per_s": 1.0}, "hysteresis": {"torque_nm": 0.02, "scale_deg": 0.15},
             "stiffening": {"cubic_nm_per_rad3": 0.01}}[effect]  # fmt: skip
    problem, nominal = made(effect, truth, 2)
    plain = textbook(problem, nominal, effect, truth)
    law = learn_law(problem, plain, EFFECTS[effect], np.random.default_rng(FIT_SEED))
    assert not law.preferred
    assert law.chosen is plain
    assert describe(problem, law.effect, law.chosen).form == "textbook"


def test_the_effective_number_of_coefficients_is_the_share_of_information(
    leaking: tuple[JointProblem, LearnedLaw],
) -> None:
    """Fails when it differs from the trace, over the coefficients, of what the data add to the prior."""
    problem, law = leaking
    own = [k for k, parameter in enumerate(law.fit.free) if parameter.key in law.freed]
    covariance = posterior_covariance(problem, law.fit)
    assert law.coefficients == approx(len(own) - np.trace(covariance[np.ix_(own, own)]))
    assert np.all(np.linalg.eigvalsh(covariance) <= 1.0 + 1e-9)


@pytest.mark.parametrize(("lacking", "preferred"), [(0.5, True), (1e6, False)])
def test_validation_data_count_next_to_the_evidence(
    leaking: tuple[JointProblem, LearnedLaw], monkeypatch: pytest.MonkeyPatch, lacking: float, preferred: bool
) -> None:
    """Fails when a law that validation data confirm is refused for little evidence, or taken against all of it."""
    problem, law = leaking
    monkeypatch.setattr(laws, "training_evidence", lambda _, fit: -lacking if fit is law.fit else 0.0)
    rows = {ROW[key] for key in law.freed}
    assert laws._compared(problem, law.textbook, law.fit, law.effect, rows).preferred is preferred


def test_a_law_is_described_by_points_and_in_words(leaking: tuple[JointProblem, LearnedLaw]) -> None:
    """Fails when points, band, textbook form, units or the sentence do not belong to the law that was found."""
    problem, law = leaking
    curve = describe(problem, law.effect, law.fit, law.textbook)
    assert (curve.form, curve.over, curve.unit, curve.over_unit) == ("learned", ("pressure",), "Pa/s", "Pa")
    pressure, value, low, high, plain = curve.points.T
    true = pressure * (1.0 + 2.0 * pressure / load_hand(CONFIG).supply_pressure_pa)
    np.testing.assert_allclose(value, true, rtol=0.05, atol=3e3)
    assert np.all((low <= value + 1e-6) & (value <= high + 1e-6))
    assert np.abs(plain - true).max() > np.abs(value - true).max()
    assert curve.statement.startswith("the loss rises from 0 Pa/s to ")
    assert curve.statement.endswith("Pa/s over the pressure")
    document = curve.document()
    assert document["columns"] == ["state", "law", "low", "high", "textbook"]
    assert len(document["points"]) == len(curve.points)
    assert set(document) >= {"form", "over", "points", "unit", "over_unit", "statement"}


def test_an_effect_without_a_learned_law_is_refused(leaking: tuple[JointProblem, LearnedLaw]) -> None:
    """Fails when an effect without coefficients is fitted as if it had a law."""
    problem, law = leaking
    with pytest.raises(ValueError, match="the effect valve_delay has no learned law"):
        learn_law(problem, law.textbook, EFFECTS["valve_delay"], np.random.default_rng(0))
    assert law_free_parameters(EFFECTS["valve_delay"], problem.nominal) == []


def test_the_prior_of_a_law_is_centred_on_the_textbook_form() -> None:
    """Fails when a coefficient has another prior mode than its neutral value, or may leave its bounds."""
    nominal = load_hand(CONFIG).parameters[:, 0]
    for effect in EFFECTS.values():
        parameters = law_free_parameters(effect, nominal)
        assert [parameter.key for parameter in parameters] == list(effect.coefficients)
        for parameter in parameters:
            assert parameter.value(np.zeros(1))[0] == approx(nominal[parameter.row])
            far = parameter.value(np.array([-50.0, 50.0]))
            assert parameter.low <= far[0] <= far[1] <= parameter.high


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0141, "N m", "14.1 mN m"),
        (1234.0, "Pa", "1.23 kPa"),
        (5e5, "Pa/s", "500 kPa/s"),
        (0.02, "s", "20 ms"),
        (100.0, "s", "100 s"),
        (2500.0, "s", "2500 s"),
        (0.2, "rad/s", "0.2 rad/s"),
        (0.5, "1", "0.5"),
        (0.0, "N m", "0 N m"),
        (-0.0141, "N m", "-14.1 mN m"),
    ],
)
def test_amounts_have_a_prefix(value: float, unit: str, text: str) -> None:
    """Fails when a number in a sentence has another prefix, sign or number of digits."""
    assert amount(value, unit) == text
