"""Draw, simulate and seal the cases of the referees: laws of many forms, kinds that no catalogue holds, conditions."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from validation.referees import development, held_back, unknown_kinds
from validation.referees.conditions import DEFAULT_TOLERANCE, Conditions, draw
from validation.referees.forms import Family
from validation.referees.plant import FRAME_S, Laws, record
from validation.referees.scene import Joints, cut, inseparable, limit
from validation.referees.shapes import Rng
from validation.referees.unknown_kinds import Kind
from validation.trial.arrays import Array
from validation.trial.bag import write_bag
from validation.trial.limits import Projector
from validation.trial.make import all_made
from validation.trial.motions import EXPERIMENTS, set_points
from validation.trial.nominal import UNCERTAIN, Nominal
from validation.trial.plant import ROW
from validation.trial.seal import seal

HALVES = ("development", "held_back")
KINDS = {"single": 0.5, "null": 0.17, "several": 0.16, "outside": 0.17}
"""Shares of the kinds of cases."""
MULTIPLES = (2.0, 5.0)
AT_THE_LIMIT = 0.1
COMMAND_FRAMES = 2
"""A new set-point every second frame: 100 Hz."""
USUAL = 0.4
"""Share of the cases under the usual condition in every respect."""
FROZEN = Path(__file__).with_name("frozen.json")
"""SHA-256 of the files that decide what a held-back case is."""
TRIES = 4


@dataclass(slots=True)
class Case:
    """One recording, with the fields that validation/trial/grade.py reads; families: names of what was concealed."""

    number: int
    seed: int
    kind: str
    half: str
    referee: str = "families"
    motion: str = ""
    model: str = "model.yaml"
    without: str = ""
    conditions: dict[str, Any] = field(default_factory=dict)
    labels: list[str] = field(default_factory=list)
    families: list[str] = field(default_factory=list)
    truth: list[dict[str, Any]] = field(default_factory=list)
    unplaced: list[str] = field(default_factory=list)


def of_half(half: str) -> tuple[tuple[Family, ...], tuple[Kind, ...]]:
    """Families and unknown kinds of a half. Raises ValueError where the held-back ones differ from what was frozen."""
    if half == "development":
        return development.DEVELOPMENT, unknown_kinds.DEVELOPMENT
    wanted = json.loads(FROZEN.read_text(encoding="utf-8"))
    for name, digest in wanted.items():
        found = hashlib.sha256(FROZEN.with_name(name).read_bytes()).hexdigest()
        if found != digest:
            raise ValueError(f"validation/referees/{name} is not the frozen one: its SHA-256 is {found}")
    return held_back.HELD_BACK, unknown_kinds.HELD_BACK


def make(
    out: Path,
    model: Path,
    count: int,
    seed: int,
    key: bytes,
    half: str,
    *,
    jobs: int,
    progress: Callable[[float], None],
    tool: dict[str, Any] | None = None,
) -> str:
    """Write the folder of a trial of a half; returns the commitment, the SHA-256 of the truth.

    model: the nominal hand.yaml.  count: number of cases.  jobs: number of processes.  progress: called with the share
    done, 0 to 1.  tool: see validation.trial.seal.tool_numbers.  Raises ValueError: see `of_half`.
    """
    known, kinds = of_half(half)
    out.mkdir(parents=True, exist_ok=True)
    nominal = Nominal(model)
    nominal.write(nominal.rows, out / "model.yaml", 100.0, {})
    rng = np.random.default_rng(seed)
    turns = _in_turn(len(known), rng)
    cases = [Case(k, int(rng.integers(2**31)), kind, half) for k, kind in enumerate(kinds_in_order(KINDS, count, rng))]
    work = [
        (case, [next(turns) for _ in range(3)], int(rng.integers(len(kinds))), str(model), str(out)) for case in cases
    ]
    made = all_made(make_case, work, jobs, progress)
    return planned_and_sealed(made, seed, tool, out, key)


def planned_and_sealed(cases: Sequence[Case], seed: int, tool: dict[str, Any] | None, out: Path, key: bytes) -> str:
    """Write plan.json and the sealed truth of recorded cases into a folder; returns the commitment."""
    (out / "plan.json").write_text(json.dumps(plan_of(cases), indent=1), encoding="utf-8")
    return seal({"seed": seed, "tool": tool, "cases": [asdict(case) for case in cases]}, out, key)


def kinds_in_order(shares: dict[str, float], count: int, rng: Rng) -> list[str]:
    """The kinds of the cases of a trial, by their shares, in a drawn order."""
    names = [name for name, share in shares.items() for _ in range(math.ceil(share * count))][:count]
    return [str(kind) for kind in rng.permutation(names)]


def plan_of(cases: Sequence[Case]) -> list[dict[str, Any]]:
    """What plan.json says about the cases."""
    return [
        {
            "number": case.number,
            "model": case.model,
            "without": case.without,
            "tolerance": 0.0 if case.conditions["stated"] == DEFAULT_TOLERANCE else case.conditions["stated"],
        }
        for case in cases
    ]


def _in_turn(count: int, rng: Rng) -> Iterator[int]:
    """Every family in turn, each round in a new order."""
    while True:
        yield from (int(k) for k in rng.permutation(count))


def make_case(work: tuple[Case, list[int], int, str, str]) -> Case:
    """Simulate and record a case and fill in its truth; work: case, families in turn, unknown kind, model, folder."""
    case, turn, kind, model, out = work
    known, kinds = of_half(case.half)
    nominal, rng = Nominal(Path(model)), np.random.default_rng(case.seed)
    how = Conditions() if rng.random() < USUAL else draw(rng)
    case.conditions, case.labels = asdict(how), how.labels()
    q, u, joints = _hand(nominal, how, case, rng)
    laws = Laws(q.shape[1], len(u))
    taken: set[int] = set()
    if case.kind in {"single", "several"}:
        number = 1 if case.kind == "single" else int(rng.integers(2, 4))
        for index in turn[:number]:
            _conceal(known[index], case, laws, (q, u), nominal, rng, joints, taken, known)
    reading: tuple[int, Kind, float] | None = None
    if case.kind == "outside":
        reading = _outside(kinds[kind], case, laws, u, nominal, rng, joints)
    _write(case, how, (q, u), laws, nominal, rng, joints, reading, Path(out))
    return case


def true_rows(nominal: Nominal, off: float, rng: Rng) -> Array:
    """Constants (rows, joints): those of the nominal model times 1 + off x a normal variable, within two of them.

    off: relative standard deviation [-].
    """
    q, n = nominal.rows.copy(), len(nominal.joints)
    for name in UNCERTAIN:
        q[ROW[name]] *= np.clip(1.0 + off * np.clip(rng.standard_normal(n), -2.0, 2.0), 0.5, 1.5)
    return q


def _hand(nominal: Nominal, how: Conditions, case: Case, rng: Rng) -> tuple[Array, Array, list[int]]:
    """True constants (rows, n), set-points (frames, n) [Pa] and the joints that are recorded; all of them move."""
    n, frames = len(nominal.joints), round(how.duration_s / FRAME_S)
    q = true_rows(nominal, how.off, rng)
    case.motion = str(rng.choice(EXPERIMENTS))
    commands = -(-frames // COMMAND_FRAMES)
    u = np.repeat(set_points(case.motion, commands, COMMAND_FRAMES * FRAME_S, n, rng), COMMAND_FRAMES, axis=0)[:frames]
    first = int(rng.integers(n))
    joints = [k % n for k in range(first, first + how.joints)]
    u[:, [k for k in range(n) if k not in joints]] = 0.0
    return q, u, sorted(joints)


def _conceal(
    family: Family,
    case: Case,
    laws: Laws,
    plant: tuple[Array, Array],
    nominal: Nominal,
    rng: Rng,
    joints: list[int],
    taken: set[int],
    known: tuple[Family, ...],
) -> None:
    """Give a joint the law of a family at a multiple of its detection limit, and note it in the truth."""
    q, u = plant
    able = [k for k in joints if k not in taken and _recorded(family, k, joints, nominal)]
    at_limit = case.kind == "single" and rng.random() < AT_THE_LIMIT
    multiple = 1.0 if at_limit else float(rng.choice(MULTIPLES))
    for joint in rng.permutation(able)[:TRIES]:
        where: Joints = cut(q, u, nominal.partner, nominal.neighbour, int(joint))
        law = family.draw(where.site(), rng)
        projector = Projector(where, family.stage)
        smallest = limit(law, family.stage, family.most, where, projector)
        if not math.isfinite(smallest) or smallest * multiple > family.most:
            continue
        size = smallest * multiple
        group = [family.effect]
        if not family.everywhere:
            group = inseparable(family, (law, size), where, projector, known, rng)
        law(laws, int(joint), size)
        taken.add(int(joint))
        case.families.append(family.name)
        case.truth.append(_truth(family, nominal.joints[joint], multiple, size, group))
        return
    case.unplaced.append(family.name)


def _recorded(family: Family, joint: int, joints: list[int], nominal: Nominal) -> bool:
    """Whether a joint's recording can show a law: one between two joints needs readings of both."""
    return family.effect != "joint_coupling" or int(nominal.neighbour[joint]) in joints


def _truth(family: Family, joint: str, multiple: float, size: float, group: list[str]) -> dict[str, Any]:
    return {
        "effect": family.effect, "place": family.place, "joint": None if family.everywhere else joint,
        "multiple": multiple, "size": size, "group": group, "number": None,
    }  # fmt: skip


def _outside(
    kind: Kind, case: Case, laws: Laws, u: Array, nominal: Nominal, rng: Rng, joints: list[int]
) -> tuple[int, Kind, float] | None:
    """Add physics that no catalogue holds to a joint; a kind that changes readings is returned with joint and size."""
    joint, size = int(rng.choice(joints)), float(rng.uniform(1.0, 3.0))
    case.families.append(kind.name)
    case.truth.append(
        {
            "effect": kind.name, "place": "unknown", "joint": nominal.joints[joint], "multiple": 5.0, "size": size,
            "group": [kind.name], "number": None, "family": kind.family,
        }
    )  # fmt: skip
    if kind.change is not None:
        kind.change(laws, joint, size, rng)
        return None
    return joint, kind, size


def _write(
    case: Case,
    how: Conditions,
    plant: tuple[Array, Array],
    laws: Laws,
    nominal: Nominal,
    rng: Rng,
    joints: list[int],
    reading: tuple[int, Kind, float] | None,
    out: Path,
) -> None:
    """Simulate the hand and write the recording under the conditions."""
    q, u = plant
    frames = len(u)
    since = round(how.onset * frames)
    plain = Laws(laws.joints, frames)
    case.conditions["onset_s"] = since * FRAME_S if since else None
    readings = record(q, (plain, laws), u, FRAME_S, nominal.partner, nominal.neighbour, since=since)
    if reading is not None:
        joint, kind, size = reading
        assert kind.reading is not None
        readings[:3, :, joint] = kind.reading(readings[:3, :, joint], size, rng)
    path = out / "recordings" / f"case_{case.number:04d}.mcap"
    write_recording(path, how, (readings, u), nominal.joints, joints, rng)


def write_recording(
    path: Path, how: Conditions, taken: tuple[Array, Array], names: list[str], joints: list[int], rng: Rng
) -> None:
    """Write what a recorder makes of a motion under the conditions.

    taken: readings (4, frames, joints) [SI] and set-points (frames, joints) [Pa].  names: of all joints.  joints: those
    that are recorded.
    """
    readings, u = taken
    frames = len(u)
    noise = how.noise * np.array([rng.uniform(80.0, 250.0), math.radians(rng.uniform(0.01, 0.04)), 0.01, 0.02])
    readings = readings + noise[:, None, None] * rng.standard_normal(readings.shape)
    every = max(round(1.0 / FRAME_S / how.rate_hz), 1)
    kept = (np.arange(frames) % every == 0) & (rng.random(frames) >= how.lost)
    kept[: 5 * every : every] = True
    jitter = np.clip(how.jitter_s * rng.standard_normal(frames), -0.4 / how.rate_hz, 0.4 / how.rate_hz)
    path.parent.mkdir(exist_ok=True)
    write_bag(
        path,
        [names[k] for k in joints],
        np.ascontiguousarray(readings[:, :, joints]),
        np.ascontiguousarray(u[:, joints]),
        FRAME_S,
        site=None,
        kept=kept,
        pressure_late_s=0.0,
        sent=np.arange(frames) % COMMAND_FRAMES == 0,
        jitter_s=jitter,
    )
