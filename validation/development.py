"""Whole diagnoses of development recordings: `python -m validation.development [--deleted] [--json FILE]`.

The recordings are those of validation/laws.py (its development half) and of validation/other_forms.py: a joint
with one effect in a constitutive form that the catalogue does not have. Each is diagnosed with the whole catalogue, or
(--deleted) without the effects that name its form; then the right answer is a remainder, or a name with a low
probability. Printed are the findings, the remainder, the test errors over the noise, and at the end the shares and the
expected calibration error and log score of the claims (validation/trial/calibration.py).
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hand_diagnosis.diagnosis import Diagnosis, diagnose
from hand_diagnosis.judgement import StageResult
from hand_diagnosis.problem import ErrorsOnTest
from hand_diagnosis.report import fit_rows
from hand_model.description import Hand, load_hand
from hand_recording.signals import Signals
from validation import laws, other_forms
from validation.trial.calibration import calibration_error, log_score

FLOORS = 1.25
"""Largest test error over the noise that counts as down to the noise."""
QUICK = ("laminar gap", "plain")
"""Recordings of the short form."""
BELOW = 0.6
"""Probability below which the name of a stand-in for a deleted effect is not misleading."""


@dataclass(frozen=True, slots=True)
class Case:
    """A recording and its nominal model. right: effects that name its form; empty for physics outside the catalogue.

    null: nothing is added to the plain joint.
    """

    name: str
    right: frozenset[str]
    signals: Signals
    model: Hand
    null: bool = False


def cases(path: Path, seed: int, half: str, names: Sequence[str]) -> Iterator[Case]:
    """The recordings whose name or right effect holds one of the names (all, where there is none)."""

    def wanted(name: str, right: frozenset[str]) -> bool:
        return not names or any(part in name or part in right for part in names)

    hand = laws.one_joint(path)
    for number, form in enumerate(laws.FORMS):
        if form.half == half and wanted(form.name, frozenset({form.effect})):
            rng = np.random.default_rng([seed, number])
            model = other_forms.nominal_model(hand, seed + 31 * number, laws.OFF)
            yield Case(form.name, frozenset({form.effect}), laws.recording(hand, form, rng), model)
    hand = load_hand(path)
    for number, (name, (_, _, right)) in enumerate(other_forms.FORMS.items()):
        if half == laws.TUNED and wanted(name, right):
            own = seed + 17 * number
            signals, _ = other_forms.recording(hand, name, 12.0, own)
            yield Case(name, right, signals, other_forms.nominal_model(hand, own), name == "plain")


def row_of(case: Case, found: Diagnosis, deleted: bool, seconds: float) -> dict[str, Any]:
    """What a diagnosis says about a case. seconds: CPU time [s]. Raises RuntimeError where it diagnosed no joint."""
    if not found.joints:
        raise RuntimeError(f"{case.name}: {found.not_judged}")
    joint = found.joints[0]
    errors = {
        row["signal"]: row["rmse_after"] / row["noise_floor"] for row in fit_rows(found) if row["split"] == "test"
    }
    names = [(f.effect, f.probability, f.law.form if f.law else "", list(f.tied_with)) for f in found.findings]
    left = max((entry.probability for entry in found.remainder), default=0.0)
    right = set() if deleted else case.right
    first = names[0] if names else None
    claims = [(first[1], first[0] in right)] if first else [(left, not right and not case.null)] if left else []
    return {
        "name": case.name, "effect": sorted(case.right), "null": case.null, "deleted": deleted, "findings": names,
        "alternatives": [f.alternatives for f in found.findings], "remainder": left, "verdict": found.verdict,
        "family": [entry.family for entry in found.remainder], "ratios": errors, "claims": claims,
        "first": bool(first and first[0] in case.right), "seconds": seconds,
        "flagged": bool(found.remainder) or first is None or first[1] < BELOW,
        "signals": {r.name: signal_of(r, joint.test) for r in joint.results},
        "stages": [joint.search.accepted[k].stage for k in joint.claimed()],
    }  # fmt: skip


def signal_of(result: StageResult, test: ErrorsOnTest | None) -> dict[str, float]:
    """Errors of a signal beyond the noise, in practical floors, on validation and on test data, before and after."""
    found = {"before": result.excess_before / result.floor, "after": result.excess_after / result.floor}
    if test is not None:
        for name, fit in (("test_before", 0), ("test_after", 1)):
            beyond = max(test.rmse(fit)[result.stage] ** 2 - result.noise**2, 0.0)
            found[name] = float(beyond**0.5 / result.floor)
    return found


def line_of(row: dict[str, Any]) -> str:
    """A row for a reader."""
    named = ", ".join(f"{name} {p:.2f} {form[:1]}{' = ' * bool(tied)}{'/'.join(tied)}"
                      for name, p, form, tied in row["findings"])  # fmt: skip
    ratios = " ".join(f"{name} {ratio:.2f}" for name, ratio in row["ratios"].items())
    return (f"{row['name']:34s} {'/'.join(row['effect']) or '-':18s} {named or '-'}; remainder {row['remainder']:.2f};"
            f" {ratios}; {row['seconds']:.0f} s")  # fmt: skip


def summary(rows: Sequence[dict[str, Any]]) -> str:
    """The shares, in one line."""
    known = [row for row in rows if row["effect"]]
    text = []
    if any(not row["deleted"] for row in known):
        text.append(f"first {sum(row['first'] for row in known)} of {len(known)}")
        clean = [all(ratio <= FLOORS for ratio in row["ratios"].values()) for row in known]
        text.append(f"test error at most {FLOORS} floors {sum(clean)} of {len(known)}")
    else:
        text.append(f"flagged or below {BELOW} {sum(row['flagged'] for row in known)} of {len(known)}")
    claims = [(float(p), bool(right)) for row in rows for p, right in row["claims"]]
    text.append(f"expected calibration error {calibration_error(claims) or 0.0:.3f}")
    text.append(f"log score {log_score(claims) or 0.0:.3f}")
    text.append(f"CPU {sum(row['seconds'] for row in rows):.0f} s")
    return "; ".join(text)


def main(path: Path, seed: int, half: str, names: Sequence[str], *, deleted: bool, out: Path | None) -> None:
    """Diagnose the cases, one line each, and print the shares."""
    rows = []
    for case in cases(path, seed, half, names):
        if deleted and not case.right:
            continue
        begun = time.process_time()
        without = sorted(case.right) if deleted else []
        found = diagnose([case.signals], case.model, tolerance=0.05, seed=0, joints=list(case.signals.joints),
                         without=without, sensor_curve=False)  # fmt: skip
        rows.append(row_of(case, found, deleted, time.process_time() - begun))
        print(line_of(rows[-1]), flush=True)
        if out:
            out.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    print(f"seed {seed}: {summary(rows)}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="python -m validation.development",
        description="Diagnose recordings of a joint with one effect in a form that the catalogue does not have.",
        epilog="Example: python -m validation.development --deleted --seed 1 valve_lag",
    )
    parser.add_argument("names", nargs="*", help="forms or effects; default: all")
    parser.add_argument("--seed", type=int, default=1, help="of recordings and nominal models")
    parser.add_argument("--half", choices=(laws.TUNED, laws.ONCE), default=laws.TUNED, help="which forms")
    parser.add_argument("--deleted", action="store_true", help="without the effects that name the form")
    parser.add_argument("--quick", action="store_true", help="one form and the plain joint only")
    parser.add_argument("--model", type=Path, default=Path("config/hand.yaml"), help="description of the hand")
    parser.add_argument("--json", type=Path, help="file for the results")
    given = parser.parse_args()
    chosen = given.names or (QUICK if given.quick else ())
    main(given.model, given.seed, given.half, chosen, deleted=given.deleted, out=given.json)
