"""A diagnosis with learned laws: from a recording to name, law, figure and a model.yaml that runs in every loop.

The plant of these tests is the offline plant of the stack with a leak whose law grows with the pressure, which the
textbook form (a loss in proportion to the pressure) does not follow.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from hand_diagnosis.api import Report, diagnose
from hand_diagnosis.judgement import confirm_laws
from hand_diagnosis.report import schema
from hand_identification.map_fit import map_fit
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.kernel.rows import ROW
from hand_recording.signals import Signals
from hand_sim.plant import HandPlant, P
from test.diagnosis.recordings import changed, off_by_a_little, record

JOINT = "index_distal"
RATE_PER_S, WITH_PRESSURE = 1.0, 2.0
SECONDS = 24.0


@pytest.fixture(scope="module")
def leaking(hand: Hand) -> tuple[Hand, Signals, Report]:
    """A hand with a leak that grows with the pressure, its recording, and the diagnosis of it."""
    rng = np.random.default_rng(8)
    print("seed 8")
    truth = changed(hand, JOINT, leak__rate_per_s=RATE_PER_S, leak__with_pressure=WITH_PRESSURE)
    signals = record(truth, rng, SECONDS)
    found = diagnose([signals], off_by_a_little(hand, rng), joints=[JOINT], sensor_curve=False)
    return truth, signals, found


@pytest.fixture(scope="module")
def written(leaking: tuple[Hand, Signals, Report], tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("learned")
    leaking[2].write(out)
    return out


def test_the_class_is_named_and_its_law_learned(leaking: tuple[Hand, Signals, Report]) -> None:
    """Fails when the law is not freed in the search, another class wins, or the report lacks the law's points."""
    report = leaking[2]
    jsonschema.validate(json.loads(json.dumps(report.content)), schema())
    (finding,) = report.findings
    assert (finding["effect"], report.verdict) == ("leak", "explained")
    law = finding["law"]
    assert (law["form"], law["over"], law["unit"]) == ("learned", ["pressure"], "Pa/s")
    pressure, value, low, high, textbook = np.array(law["points"]).T
    supply = load_hand(report.hand.path).supply_pressure_pa
    true = RATE_PER_S * pressure * (1.0 + WITH_PRESSURE * pressure / supply)
    np.testing.assert_allclose(value, true, rtol=0.05, atol=6e3)
    assert np.all((low <= value) & (value <= high))
    assert np.abs(textbook - true).max() > 3.0 * np.abs(value - true).max()
    assert "Its law departs from the textbook form: the loss rises from 0 Pa/s to" in finding["statement"]
    tested = [row for row in report.content["fit"] if row["split"] == "test" and row["signal"] == "pressure"]
    assert all(row["rmse_after"] < 1.25 * row["noise_floor"] < row["rmse_before"] for row in tested)


def test_the_textbook_form_stays_where_it_suffices(hand: Hand) -> None:
    """Fails when friction of one level gets a learned law, or its law has no points."""
    rng = np.random.default_rng(9)
    print("seed 9")
    signals = record(changed(hand, JOINT, coulomb_friction__torque_nm=0.012), rng, SECONDS)
    (finding,) = diagnose([signals], off_by_a_little(hand, rng), joints=[JOINT], sensor_curve=False).findings
    law = finding["law"]
    assert (finding["effect"], law["form"], law["over"]) == (
        "coulomb_friction",
        "textbook",
        ["speed", "pressure", "angle"],
    )
    _, value, _, _, textbook = np.array(law["points"]).T
    np.testing.assert_array_equal(value, textbook)
    np.testing.assert_allclose(value, 0.012, rtol=0.15)


def simulated(hand: Hand, commands: Array) -> Array:
    """Pressures (T,) [Pa] of the joint by the offline plant, which is that of the simulation node."""
    plant = HandPlant(hand, 0.005)
    states = np.concatenate([plant.state[None], plant.advance(commands[:-1])])
    pressures: Array = states[:, P, hand.joints.index(JOINT)]
    return pressures


def test_the_model_with_the_law_runs_in_the_simulation(leaking: tuple[Hand, Signals, Report], written: Path) -> None:
    """Fails when model.yaml loses a coefficient of the law, or the closed loop runs another law than the fit did."""
    truth, signals, report = leaking
    patched = load_hand(written / "model.yaml")
    joint = patched.joints.index(JOINT)
    search = report.diagnosis.joints[0].search
    columns, _ = search.problem.columns(search.final.free, search.final.z[None])
    for key in ("leak.rate_per_s", "leak.with_pressure"):
        assert patched.parameters[ROW[key], joint] == pytest.approx(columns[0, ROW[key]], rel=0.05), key
    measured = signals.pressure_pa[:, signals.joints.index(JOINT)]
    errors = {
        name: float(np.sqrt(np.mean((simulated(model, signals.set_point_pa) - measured) ** 2)))
        for name, model in (("nominal", report.hand), ("patched", patched), ("true", truth))
    }
    print(errors)
    assert errors["patched"] < 2.0 * errors["true"] < 0.1 * errors["nominal"]


def test_the_law_stands_in_the_files_for_a_reader(written: Path) -> None:
    """Fails when model.yaml has no points of the law with units, or the page lacks its sentence or its figure."""
    head = [line for line in (written / "model.yaml").read_text(encoding="utf-8").splitlines() if line.startswith("#")]
    (line,) = [line for line in head if "Learned law of leak of index_distal" in line]
    assert "[Pa/s] over pressure [Pa]: 0: 0, " in line
    page = (written / "report.html").read_text(encoding="utf-8")
    assert len(re.findall('<figure class="plot" tabindex', page)) == 3  # over time, over a state, and the law
    assert '"name":"textbook form"' in page
    assert "<figcaption>the loss rises from 0 Pa/s" in page


def test_a_law_that_the_test_data_contradict_is_withdrawn(leaking: tuple[Hand, Signals, Report]) -> None:
    """Fails when a learned law stays although the textbook form has the smaller error on the test data."""
    joint = leaking[2].diagnosis.joints[0]
    assert joint.whole is not None
    search = replace(joint.search, accepted=list(joint.search.accepted))
    found = search.accepted[0]
    index = [p.key for p in found.fit.free].index("leak.with_pressure")
    wrong = found.fit.z.copy()
    wrong[index] *= 4.0  # a law that the fitted data would not have given
    search.accepted[0] = replace(found, fit=map_fit(search.problem, found.fit.free, wrong, 1))
    confirm_laws(joint.whole, search, free_axis=False)
    assert search.accepted[0].freed == ()
    assert "leak.with_pressure" not in {p.key for p in search.final.free}
    right = replace(joint.search, accepted=list(joint.search.accepted))
    confirm_laws(joint.whole, right, free_axis=False)
    assert right.accepted[0].freed == ("leak.with_pressure",)
