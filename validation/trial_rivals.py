"""Rivals of the diagnosis on the recordings of a blind trial: python -m validation.trial_rivals FOLDER --train FOLDER.

Every rival gets the recordings, nominal model and split of `hand diagnose` (hand_diagnosis/problem/splits.py). The
numbers of the nominal model are fitted again; the other rivals model the angle that it leaves, as a function of the
angle, speed, pressure and direction that it predicts. Friction models are so in their quasi-static form. A random
forest (Breiman 2001) learns effects from features of the residuals on other trials whose truth is known. The truth of
both is opened only to train it and to grade.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hand_diagnosis.api import read_recording
from hand_diagnosis.problem import Task, check, effects_without, fit_part, moving_joints, predict_test
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import Segment
from hand_identification.map_fit import map_fit
from hand_machine.description import MachineDescription
from hand_model.arrays import Array
from hand_model.description import load_hand
from hand_recording.signals import white_noise
from validation.machines.parts import STANDSTILL, Part
from validation.machines.rivals import RIVALS, Rig, error
from validation.results import provenance
from validation.trial.calibration import log_score
from validation.trial.grade import FLOORS, grade
from validation.trial.run import TOLERANCE, read_plan
from validation.trial.seal import unseal

PRESSURE, ANGLE = 0, 1
TREES, SEED = 400, 0
NOTHING = "nothing"
COMMAND = "python -m validation.trial_rivals FOLDER --train FOLDER"
_AXIS = MachineDescription(
    path=Path(), name="joint", linear=True, imposed=True, gain=1.0, stiffness=0.0, damping=0.0, inertia=0.0, weight=0.0,
    has=frozenset(), columns={}, tolerances={}, effects={}, recordings={}, sizes=None,
    derivative_window_s=None, controller={}, per_kelvin={}, reference_c=20.0,
)  # fmt: skip
"""What the rivals need to know of a joint whose predicted motion is given: the angle is regressed, not simulated."""


@dataclass(frozen=True, slots=True)
class JointData:
    """A joint of a recording. fitted, tested: parts whose target is the angle [rad].  noise_rad: of the angle.

    features (k,): of what the re-identified model leaves of the data that are not test data.
    """

    joint: str
    fitted: Part
    tested: Part
    noise_rad: float
    features: Array


def joints_of(folder: Path, case: dict[str, Any]) -> Iterator[JointData]:
    """The diagnosed joints of a case of plan.json that have test data. RecordingError: a broken recording."""
    hand = load_hand(folder / case["model"])
    checked = check(read_recording(folder / "recordings" / f"case_{case['number']:04d}.mcap", hand), hand)
    signals = [checked.signals]
    names = moving_joints(signals, hand, (), frozenset(checked.unusable))
    task = Task(
        signals=signals,
        model=hand,
        joints=names,
        effects=effects_without([], hand),
        tolerance=case["tolerance"] or TOLERANCE,
        seed=SEED,
        floors={},
    )
    for name in names:
        ready = task.prepare(name)
        problem = fit_part(ready.problem)
        fit = map_fit(problem, ready.free, ready.start, SETTINGS.rough_iterations)
        columns, starts = problem.columns(fit.free, fit.z[None])
        predicted = problem.predict(columns, starts)[0][0]
        tested = predict_test(ready.problem, fit, free_axis=False)
        if not tested:
            continue
        still = STANDSTILL * float(np.std(np.gradient(predicted[ANGLE], problem.segments[0].period_s)))
        features = _features(problem.segments[0], predicted, still)
        noise = white_noise(ready.problem.segments[0].angle_rad)
        yield JointData(name, _part(problem.segments[0], predicted, still), _part(*tested[0], still), noise, features)


def _part(segment: Segment, predicted: Array, still: float) -> Part:
    """The residual of the angle over the predicted motion; still: speed around which its sign is smoothed [rad/s]."""
    x = predicted[ANGLE]
    v = np.gradient(x, segment.period_s)
    states = np.column_stack([x, v, segment.pressure_pa, np.tanh(v / max(still, 1e-9))])
    a = np.gradient(v, segment.period_s)
    return Part(segment.period_s, states, a, segment.angle_rad, segment.angle_rad - x, segment.use[ANGLE])


def _features(segment: Segment, predicted: Array, still: float) -> Array:
    """Of the residuals of pressure and angle: size over noise, smoothness, peaks, and correlation with the motion."""
    part, found = _part(segment, predicted, still), list[float]()
    x, v, p, sign = part.states.T
    time, half = np.linspace(-1.0, 1.0, len(x)), np.arange(len(x)) < len(x) // 2
    motion = (x, v, p, sign, part.acceleration, np.abs(v), x**2, x * sign, np.gradient(p), time, segment.set_point_pa)
    for signal, measured in ((PRESSURE, segment.pressure_pa), (ANGLE, segment.angle_rad)):
        use = segment.use[signal]
        left = (measured - predicted[signal])[use]
        size = float(np.std(left)) or 1.0
        found += [float(np.log(size / (white_noise(measured) or 1.0))), float(np.mean(left)) / size]
        found += [float(np.mean(left[1:] * left[:-1])) / size**2, float(np.max(np.abs(left), initial=0.0)) / size]
        found += [float(np.std(left[half[use]]) / size)]
        found += [float(np.mean((left - left.mean()) * _unit(each[use]))) / size for each in motion]
    return np.asarray(np.nan_to_num(np.array(found, dtype=np.float64)), dtype=np.float64)


def _unit(values: Array) -> Array:
    return np.asarray((values - values.mean()) / (float(values.std()) or 1.0))


def ratios_of(data: JointData) -> dict[str, float]:
    """Test error of the angle over its noise, of each rival that predicts."""
    part = data.fitted
    speed, size = float(np.std(part.states[:, 1])), float(np.std(part.lacking)) or 1.0
    rig = Rig(_AXIS, STANDSTILL * speed, size)
    found = {"nominal numbers fitted again": error(lambda each: each.states[:, 0], [data.tested]) / data.noise_rad}
    for name, rival in RIVALS.items():
        if name == "re-identified":
            continue
        fitted, tested = (_left(each) if name == "NARX" else each for each in (part, data.tested))
        found[name] = error(rival(rig, [fitted]), [tested]) / data.noise_rad
    return found


def _left(part: Part) -> Part:
    """The part with the residual as its target: a network need not learn again what the nominal model predicts."""
    return replace(part, target=part.lacking)


def label(truth: Sequence[dict[str, Any]], joint: str) -> str:
    """What a joint of a case has: the first concealed effect on it or on the whole hand, `unknown`, or NOTHING."""
    for each in truth:
        if each["joint"] in {joint, None}:
            return "unknown" if each["place"] == "unknown" else str(each["effect"])
    return NOTHING


class Forest:
    """A random forest over the effects of training trials. rows (n, k): features of joints.  labels: see `label`."""

    def __init__(self, rows: Array, labels: Sequence[str], truths: Sequence[dict[str, Any]]) -> None:
        """Train. truths: where the effects are.  ValueError: no two labels, so nothing can be learned."""
        from sklearn.ensemble import RandomForestClassifier  # noqa: PLC0415 - slow to load, and only here

        if len(set(labels)) < 2:
            raise ValueError("the training recordings hold fewer than two classes; give more with --train")
        self._forest = RandomForestClassifier(TREES, random_state=SEED, min_samples_leaf=2, class_weight="balanced")
        self._forest.fit(rows, labels)
        self._places = {each["effect"]: (each["place"], each["joint"] is None) for each in truths}

    def answer(self, joints: Sequence[JointData]) -> dict[str, Any]:
        """Findings and remainder of a case in the form that validation/trial/grade.py reads."""
        findings, remainder = list[dict[str, Any]](), list[dict[str, Any]]()
        names = [str(name) for name in self._forest.classes_]
        for data in joints:
            chances = self._forest.predict_proba(data.features[None])[0]
            order = [names[k] for k in np.argsort(-chances)]
            entry = {"joint": data.joint, "probability": float(chances.max())}
            if order[0] == "unknown":
                remainder.append(entry)
            elif order[0] != NOTHING:
                place, everywhere = self._places[order[0]]
                others = [{"effect": name} for name in order[1:] if name not in {NOTHING, "unknown"}]
                own = {"effect": order[0], "place": place, "parameters": {}, "alternatives": others}
                findings.append(entry | own | ({"joint": None} if everywhere else {}))
        findings.sort(key=lambda finding: -finding["probability"])
        return {"findings": findings, "remainder": remainder, "fit": []}


def compare(folder: Path, key: bytes, training: Sequence[tuple[Path, bytes]]) -> dict[str, Any]:
    """Ratios of every rival and the tool, and grades of the forest. ValueError: a wrong key or an incomplete trial."""
    cases = {case["number"]: case for case in unseal(folder, key)[0]["cases"]}
    forest, count = _trained(training)
    ratios, grades, own, own_ratios = dict[str, list[float]](), [], [], list[float]()
    for planned in read_plan(folder):
        joints = list(joints_of(folder, planned))
        for data in joints:
            for name, ratio in ratios_of(data).items():
                ratios.setdefault(name, []).append(ratio)
        case = cases[planned["number"]]
        grades.append(grade(case, forest.answer(joints)))
        if report := _report(folder, planned["number"]):
            own.append(grade(case, report))
            own_ratios += _own_ratios(report, joints)
    complete = len(own) == len(grades)  # on a part of the recordings the tool would not be compared with the others
    if complete and own_ratios:
        ratios["this tool"] = own_ratios
    fits = {name: fit_row(values) for name, values in ratios.items()}
    names = {"random forest": name_row(grades)} | ({"this tool": name_row(own)} if complete else {})
    return {"recordings": len(grades), "trained_on": count, "fits": fits, "names": names}


def _trained(training: Sequence[tuple[Path, bytes]]) -> tuple[Forest, int]:
    rows, labels, truths, count = list[Array](), list[str](), list[dict[str, Any]](), 0
    for folder, key in training:
        cases = {case["number"]: case for case in unseal(folder, key)[0]["cases"]}
        for planned in read_plan(folder):
            truth = cases[planned["number"]]["truth"]
            truths += truth
            count += 1
            for data in joints_of(folder, planned):
                rows.append(data.features)
                labels.append(label(truth, data.joint))
    return Forest(np.array(rows), labels, truths), count


def _report(folder: Path, number: int) -> dict[str, Any] | None:
    """The tool's report on a case; None where `hand trial run` has not made it."""
    found = sorted(folder.glob(f"reports/*/case_{number:04d}_*/report.json"))
    return json.loads(found[0].read_text(encoding="utf-8")) if found else None


def _own_ratios(report: dict[str, Any], joints: Sequence[JointData]) -> Iterator[float]:
    """Test errors of the angle [deg] of the tool over the noise that the rivals are measured by."""
    for data in joints:
        for row in report["fit"]:
            if (row["joint"], row["signal"], row["split"]) == (data.joint, "angle", "test"):
                yield float(np.radians(row["rmse_after"])) / data.noise_rad


def fit_row(ratios: Sequence[float]) -> dict[str, float]:
    """Median of test error over noise, share of at most FLOORS, and number of joints."""
    values = np.array(ratios)
    return {"median": float(np.median(values)), "clean": float(np.mean(values <= FLOORS)), "joints": len(values)}


def name_row(grades: Sequence[Any]) -> dict[str, float | None]:
    """Shares of right answers, None where no case asks, and the log score of the claims."""
    found = dict[str, float | None]()
    for name in ("first", "place", "joint", "false_alarm", "unknown_found"):
        asked = [getattr(each, name) for each in grades if getattr(each, name) is not None]
        found[name] = sum(asked) / len(asked) if asked else None
    return found | {"log_score": log_score([claim for each in grades for claim in each.claims])}


def lines_of(result: dict[str, Any]) -> Iterator[str]:
    """The results for a reader."""
    for name, row in result["fits"].items():
        yield f"{name}: median {row['median']:.2f}, at most {FLOORS}: {row['clean']:.0%} of {row['joints']} joints"
    for name, row in result["names"].items():
        yield f"{name}: " + ", ".join(f"{k} {'-' if v is None else f'{v:.2f}'}" for k, v in row.items())
    silent = [name for name in result["fits"] if name not in result["names"]]
    yield f"give no names: {', '.join(silent)}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; exit code 0 done, 2 bad usage or bad input."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.trial_rivals",
        description="Compare rivals of the diagnosis on the recordings of a trial, with the tool's reports if it ran.",
        epilog="Example: python -m validation.trial_rivals out/test --key KEY --train out/train --train-key KEY2",
    )
    parser.add_argument("folder", type=Path, help="folder of the trial")
    parser.add_argument("--key", required=True, help="key of the trial, as hand trial make printed it")
    parser.add_argument("--train", type=Path, action="append", required=True, help="another trial; may be repeated")
    parser.add_argument("--train-key", action="append", required=True, help="its key, in the same order")
    parser.add_argument("--out", type=Path, default=Path("out/trial_rivals.json"), help="file of the results")
    options = parser.parse_args(arguments)
    try:
        if len(options.train) != len(options.train_key):
            raise ValueError(f"{len(options.train)} --train but {len(options.train_key)} --train-key; give one each")
        if options.folder.resolve() in {folder.resolve() for folder in options.train}:
            raise ValueError(f"--train {options.folder} is the trial itself; a forest must learn from another one")
        keys = [key.encode() for key in options.train_key]
        result = compare(options.folder, options.key.encode(), list(zip(options.train, keys, strict=True)))
        options.out.parent.mkdir(parents=True, exist_ok=True)
        data = {**provenance(COMMAND), "trial_rivals": result}
        options.out.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    except (OSError, ValueError) as fault:
        print(f"python -m validation.trial_rivals: {fault}", file=sys.stderr)
        return 2
    print("\n".join(lines_of(result)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
