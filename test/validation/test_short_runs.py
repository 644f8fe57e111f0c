"""Short forms of the programs that compare laws, certificates and whole diagnoses on forms outside the catalogue."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from hand_diagnosis.judgement import certify
from hand_model.description import load_hand
from validation import certificates, development, laws
from validation.trial.nominal import Nominal

CONFIG = Path(__file__).resolve().parents[2] / "config" / "hand.yaml"


def test_a_learned_law_fits_a_form_that_no_class_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when the law of a laminar leak leaves more than noise, or its textbook form or another class does not."""
    laws.main(laws.TUNED, CONFIG, tmp_path / "laws.json", (), quick=True)
    (row,) = json.loads((tmp_path / "laws.json").read_text(encoding="utf-8"))
    assert row["effect"] == row["first"] == "leak"
    assert row["learned"] < 1.1 < 5.0 < row["textbook"] < row["nominal"]
    assert row["rival_ratio"] > 10.0
    assert "laminar gap" in capsys.readouterr().out


def test_no_certificate_of_a_right_explanation_is_broken(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a flexible model predicts the error that a right explanation of a plain joint or an effect leaves.

    Also when the same attack finds nothing where the effect is left out of the model.
    """
    nominal, hand = Nominal(CONFIG), load_hand(CONFIG)
    done = []
    for kind in certificates.QUICK:
        rng = np.random.default_rng([7, 0, certificates.KINDS.index(kind)])
        case = certificates.draw_case(nominal, kind, rng, certificates.QUICK_SECONDS)
        found, attacks, seconds = certificates.diagnosed(case, hand)
        done.append(certificates.row_of(case, found, attacks, seconds))
    assert [row["verdict"] for row in done] == ["agrees", "explained"]
    assert [name for name, _ in done[1]["findings"]] == list(done[1]["effects"]) != []
    lines = list(certificates.summary(done))
    assert [line.partition(";")[0] for line in lines] == [
        f"{kind}: 1 of 1 leave nothing that is reported" for kind in certificates.QUICK
    ]
    assert all("certificates broken: 0 of 1" in line for line in lines)
    joint = found.joints[0]
    assert joint.whole is not None
    left = certify(joint.search.problem, joint.whole, joint.search.nominal, joint.results, free_axis=False)
    assert any(each.broken for each in left)


def test_a_form_outside_the_catalogue_is_named_and_a_plain_joint_is_not(tmp_path: Path) -> None:
    """Fails when a laminar leak is not named leak, with an error down to the noise, or a plain joint gets a finding."""
    out = tmp_path / "rows.json"
    development.main(CONFIG, 1, laws.TUNED, development.QUICK, deleted=False, out=out)
    leak, plain = json.loads(out.read_text(encoding="utf-8"))
    assert leak["first"] and leak["findings"][0][0] == "leak" and leak["remainder"] == 0.0
    assert max(leak["ratios"].values()) <= development.FLOORS
    assert plain["null"] and plain["findings"] == [] and plain["remainder"] == 0.0
    assert development.summary([leak, plain]).startswith("first 1 of 1; test error at most 1.25 floors 1 of 1;")


@pytest.mark.parametrize(
    ("form", "effect", "most"), [("returning_spool", "valve_lag", 1.25), ("bending_flow", "valve_flow_limit", 2.0)]
)
def test_the_learned_law_of_a_valve_follows_another_form(tmp_path: Path, form: str, effect: str, most: float) -> None:
    """Fails when a spool with another speed of return, or a limit that bends, gets another name or a large test error.

    A lag of one time constant, and a mean of a sharp and a gradual limit, leave 4 to 7 times the noise.
    """
    out = tmp_path / "rows.json"
    development.main(CONFIG, 305, laws.TUNED, (form,), deleted=False, out=out)
    (row,) = json.loads(out.read_text(encoding="utf-8"))
    assert row["findings"][0][0] == effect and row["remainder"] == 0.0
    assert max(row["ratios"].values()) <= most
