"""How often a certificate withdraws a right explanation, and how often it finds a half one.

    python -m validation.certificates --seed 5 --cases 12

Recordings of one joint on the plant of the referees, with laws of the development families: a plain one, one effect,
two effects on the same joint, and two of which the diagnosis may not name one. Printed are the verdict with and without
certificates, and the strongest attack. An explanation is right where nothing was deleted from the catalogue.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hand_diagnosis.diagnosis import Diagnosis, JointDiagnosis, diagnose
from hand_diagnosis.judgement import Certificate, certify
from hand_model.description import Hand, load_hand
from hand_recording.signals import Signals
from validation.referees.development import DEVELOPMENT
from validation.referees.forms import Family
from validation.referees.plant import FRAME_S, Laws, record
from validation.referees.scene import cut, limit
from validation.referees.shapes import Rng
from validation.trial.limits import Projector
from validation.trial.motions import EXPERIMENTS, set_points
from validation.trial.nominal import UNCERTAIN, Nominal
from validation.trial.plant import ROW

KINDS = ("plain", "one", "two", "half")
QUICK = KINDS[:2]
"""Kinds of the short form."""
SECONDS, QUICK_SECONDS, OFF, EVERY = 30.0, 18.0, 0.03, 2
NOISE = (150.0, math.radians(0.03))
MULTIPLES = (2.0, 5.0)
"""Sizes, in detection limits."""
TRIES = 40


@dataclass(frozen=True, slots=True)
class Case:
    """A recording of a joint: its kind, the effects that it has, and those that the diagnosis may not name."""

    kind: str
    joint: str
    signals: Signals
    effects: tuple[str, ...]
    without: tuple[str, ...]


def draw_case(nominal: Nominal, kind: str, rng: Rng, seconds: float = SECONDS) -> Case:
    """Draw a recording of one joint of the hand. kind: of KINDS.  seconds: its duration [s]."""
    q = nominal.rows.copy()
    for name in UNCERTAIN:
        q[ROW[name]] *= 1.0 + OFF * np.clip(rng.standard_normal(q.shape[1]), -2.0, 2.0)
    frames, joint = round(seconds / FRAME_S), int(rng.integers(q.shape[1]))
    u = set_points(str(rng.choice(EXPERIMENTS)), frames // EVERY, EVERY * FRAME_S, q.shape[1], rng)
    u[:, [k for k in range(q.shape[1]) if k != joint]] = 0.0
    where = cut(q, np.repeat(u, EVERY, axis=0), nominal.partner, nominal.neighbour, joint)
    laws = Laws(where.q.shape[1], frames)
    taken: list[Family] = []
    for index in rng.permutation(len(DEVELOPMENT))[:TRIES]:
        if len(taken) == {"plain": 0, "one": 1}.get(kind, 2):
            break
        family = DEVELOPMENT[index]
        if family.everywhere or any(family.place == other.place for other in taken):
            continue
        law = family.draw(where.site(), rng)
        size = float(rng.choice(MULTIPLES)) * limit(
            law, family.stage, family.most, where, Projector(where, family.stage)
        )
        if math.isfinite(size) and size <= family.most:
            law(laws, 0, size)
            taken.append(family)
    readings = record(where.q, (laws, laws), where.u, FRAME_S, where.partner, where.neighbour)[:, ::EVERY, :1]
    noisy = [r + level * rng.standard_normal(r.shape) for r, level in zip(readings[:2], NOISE, strict=True)]
    yes, name = np.ones(1, dtype=bool), nominal.joints[joint]
    signals = Signals(
        name=kind,
        joints=(name,),
        period_s=EVERY * FRAME_S,
        set_point_pa=where.u[::EVERY, :1],
        pressure_pa=noisy[0],
        angle_rad=noisy[1],
        force_n=np.full(noisy[0].shape, np.nan),
        known=np.ones(noisy[0].shape, dtype=bool),
        has_set_point=yes,
        has_pressure=yes,
    )
    effects = tuple(family.effect for family in taken)
    return Case(kind, name, signals, effects, effects[-1:] if kind == "half" else ())


def diagnosed(case: Case, hand: Hand) -> tuple[Diagnosis, tuple[Certificate, ...], float]:
    """The diagnosis, the certificates of its joint, also where it agrees with the plain model, and CPU time [s]."""
    found = diagnose(
        [case.signals], hand, tolerance=0.05, seed=0, joints=[case.joint], without=case.without, sensor_curve=False
    )
    begun = time.process_time()
    certificates = attacked(found.joints[0]) if found.joints else ()
    return found, certificates, time.process_time() - begun


def attacked(joint: JointDiagnosis) -> tuple[Certificate, ...]:
    """The attacks on a joint with nothing left, whatever was found; empty where a remainder is reported."""
    if joint.whole is None or any(stage.remains for stage in joint.results):
        return ()
    return certify(joint.search.problem, joint.whole, joint.search.final, joint.results, free_axis=False)


def row_of(case: Case, found: Diagnosis, certificates: Sequence[Certificate], seconds: float) -> dict[str, Any]:
    """What is printed and counted of a case. seconds: CPU time of the attacks [s]."""
    strongest = max(certificates, key=lambda each: (each.broken, each.share), default=None)
    return {
        "kind": case.kind, "joint": case.joint, "effects": case.effects, "without": case.without,
        "verdict": found.verdict, "findings": [(f.effect, round(f.probability, 2)) for f in found.findings],
        "nothing_left": bool(certificates), "broken": any(each.broken for each in certificates), "seconds": seconds,
        "strongest": None if strongest is None else [strongest.stage, strongest.model, strongest.over, strongest.share],
    }  # fmt: skip


def rows(path: Path, seed: int, cases: int, kinds: Sequence[str], seconds: float = SECONDS) -> Iterator[dict[str, Any]]:
    """Draw, diagnose and attack the cases of every kind. seconds: duration of a recording [s]."""
    nominal, hand = Nominal(path), load_hand(path)
    for number in range(cases):
        for kind in kinds:
            case = draw_case(nominal, kind, np.random.default_rng([seed, number, KINDS.index(kind)]), seconds)
            yield row_of(case, *diagnosed(case, hand))


def summary(done: Sequence[dict[str, Any]]) -> Iterator[str]:
    """A line for each kind: with nothing left, explained before certificates, withdrawn, CPU time."""
    for kind in dict.fromkeys(row["kind"] for row in done):
        own = [row for row in done if row["kind"] == kind]
        clean = [row for row in own if row["nothing_left"]]
        broken = sum(row["broken"] for row in clean)
        longest = max((row["seconds"] for row in clean), default=0.0)
        yield (
            f"{kind}: {len(clean)} of {len(own)} leave nothing that is reported; certificates broken: {broken} of"
            f" {len(clean)}; at most {longest:.2f} s CPU"
        )


def main(
    path: Path, seed: int, cases: int, kinds: Sequence[str], out: Path | None, *, seconds: float = SECONDS
) -> None:
    """Print every case and the counts. seconds: duration of a recording [s]."""
    done = []
    for row in rows(path, seed, cases, kinds, seconds):
        done.append(row)
        print(json.dumps(row), flush=True)
    for line in summary(done):
        print(f"seed {seed}: {line}")
    if out:
        out.write_text(json.dumps(done, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="python -m validation.certificates",
        description="Count certificates that are withdrawn, on right and on half explanations.",
        epilog="Example: python -m validation.certificates --seed 5 --cases 4 half",
    )
    parser.add_argument("kinds", nargs="*", choices=[*KINDS, []], help="kinds of cases; default: all")
    parser.add_argument("--seed", type=int, default=5, help="of recordings")
    parser.add_argument("--cases", type=int, default=12, help="cases of each kind")
    parser.add_argument("--quick", action="store_true", help="one short recording of the first two kinds")
    parser.add_argument("--model", type=Path, default=Path("config/hand.yaml"), help="description of the hand")
    parser.add_argument("--json", type=Path, help="file for the results")
    given = parser.parse_args()
    if given.quick:
        main(given.model, given.seed, 1, given.kinds or QUICK, given.json, seconds=QUICK_SECONDS)
    else:
        main(given.model, given.seed, given.cases, given.kinds or KINDS, given.json)
