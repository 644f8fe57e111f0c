"""Draw the cases of a trial, simulate and record them, and seal what was concealed."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from validation.trial.arrays import Array
from validation.trial.bag import write_bag
from validation.trial.catalogue import BY_NAME, FOREIGN, KNOWN, Concealed
from validation.trial.limits import CLOCK_S, KNOWN_WALL, OFF, inseparable, limit_size, scene, switch_on
from validation.trial.motions import EXPERIMENTS, set_points
from validation.trial.nominal import UNCERTAIN, Nominal
from validation.trial.plant import ROW, record
from validation.trial.seal import seal
from validation.trial.workers import end_with_parent

FRAME_S, DURATION_S = 0.01, 30.0
W = TypeVar("W")
R = TypeVar("R")
MULTIPLES = (1.0, 2.0, 5.0)
NULL, PAIR, OUTSIDE, DELETED = 0.20, 0.15, 0.10, 0.06
WALL = {
    "angle_deg": math.degrees(KNOWN_WALL[0]),
    "stiffness_nm_per_rad": KNOWN_WALL[1],
    "damping_nm_s_per_rad": 0.0,
    "engagement_deg": 1.0,
}
"""The known obstacle, as the description of the hand has it."""
TRIES = 6
MOVING = (4, 7)
"""Least and largest number of joints that move in a recording; the others stay vented."""


@dataclass(slots=True)
class Case:
    """One recording.

    kind: null, single, pair, outside or deleted.  effects: name and multiple of the detection limit of what is
    concealed.  model, without: file of the nominal model, and the effect that is deleted from the catalogue.  make_case
    fills in truth (joint, size, isolability class, parameter of each effect) and unplaced (effects not visible).
    """

    number: int
    seed: int
    kind: str
    effects: list[tuple[str, float]]
    motion: str
    model: str = "model.yaml"
    without: str = ""
    truth: list[dict[str, Any]] = field(default_factory=list)
    unplaced: list[str] = field(default_factory=list)


def draw_cases(count: int, seed: int) -> list[Case]:
    """Draw `count` cases with the shares above, the known effects in turn at every multiple, and random motions."""
    rng = np.random.default_rng(seed)
    kinds = ["null"] * math.ceil(NULL * count) + ["pair"] * math.ceil(PAIR * count)
    kinds += ["outside"] * math.ceil(OUTSIDE * count) + ["deleted"] * math.ceil(DELETED * count)
    kinds += ["single"] * max(count - len(kinds), 0)
    grid = [(known.name, multiple) for multiple in MULTIPLES for known in KNOWN]
    singles = _dealt(grid, kinds.count("single"), rng)
    cases = []
    for number, kind in enumerate(kinds):
        case = Case(number, int(rng.integers(2**31)), kind, [], str(rng.choice(EXPERIMENTS)))
        if kind == "single":
            case.effects = [singles.pop()]
        elif kind == "outside":
            case.effects = [(str(rng.choice([foreign.name for foreign in FOREIGN])), float(rng.choice(MULTIPLES[1:])))]
        elif kind in {"pair", "deleted"}:
            pool = [known.name for known in KNOWN if not known.needs and not known.everywhere]
            names = rng.choice(pool, 2 if kind == "pair" else 1, replace=False)
            case.effects = [(str(name), float(rng.choice(MULTIPLES[1:]))) for name in names]
        if kind == "deleted":
            case.without = case.effects[0][0]
        cases.append(case)
    order = rng.permutation(len(cases))
    return [replace(cases[k], number=at) for at, k in enumerate(order)]


def _dealt(grid: list[tuple[str, float]], count: int, rng: np.random.Generator) -> list[tuple[str, float]]:
    dealt: list[tuple[str, float]] = []
    while len(dealt) < count:
        dealt += [grid[k] for k in rng.permutation(len(grid))]
    return dealt[:count]


def make(
    out: Path,
    model: Path,
    count: int,
    seed: int,
    key: bytes,
    *,
    jobs: int,
    progress: Callable[[float], None],
    tool: dict[str, Any] | None = None,
) -> str:
    """Write the folder of a trial; returns the commitment, the SHA-256 of the truth.

    model: the nominal hand.yaml.  count: number of recordings.  progress: called with the share done, 0 to 1.
    tool: see validation.trial.seal.tool_numbers.
    """
    out.mkdir(parents=True, exist_ok=True)
    nominal = Nominal(model)
    write_models(nominal, out)
    cases = draw_cases(count, seed)
    work = [(case, str(model), str(out)) for case in cases]
    made = all_made(make_case, work, jobs, progress)
    plan = [{"number": c.number, "model": c.model, "without": c.without, "tolerance": 0.0} for c in made]
    (out / "plan.json").write_text(json.dumps(plan, indent=1), encoding="utf-8")
    return seal({"seed": seed, "tool": tool, "cases": [asdict(case) for case in made]}, out, key)


def all_made(do: Callable[[W], R], work: list[W], jobs: int, progress: Callable[[float], None]) -> list[R]:
    """The results of `do` for each piece of work, in order, by `jobs` processes; progress: the share done, 0 to 1."""
    made: list[R] = []
    for done in _mapped(do, work, jobs):
        made.append(done)
        progress(len(made) / len(work))
    return made


def _mapped(do: Callable[[W], R], work: list[W], jobs: int) -> Iterator[R]:
    """The results of `do` for each piece of work, in order, by `jobs` processes."""
    if jobs <= 1:
        yield from map(do, work)
        return
    pool = ProcessPoolExecutor(jobs, initializer=end_with_parent)
    try:
        yield from pool.map(do, work)
    finally:
        pool.shutdown(cancel_futures=True)  # an interruption must not wait for the cases that have not begun


def write_models(nominal: Nominal, out: Path) -> None:
    """Write the nominal models: the hand; the hand without creep; the hand with a known obstacle on each joint."""
    rate = 1.0 / FRAME_S
    nominal.write(nominal.rows, out / "model.yaml", rate, {})
    rigid = nominal.rows.copy()
    rigid[ROW["reach"]] = 0.0
    nominal.write(rigid, out / "model_no_creep.yaml", rate, {})
    walls = {j: {"contact": dict(WALL)} for j in range(len(nominal.joints))}
    nominal.write(nominal.rows, out / "model_wall.yaml", rate, walls)


def make_case(work: tuple[Case, str, str]) -> Case:
    """Simulate and record one case and fill in its truth; work: the case, the nominal model, the folder."""
    case, model, out = work
    nominal = Nominal(Path(model))
    rng = np.random.default_rng(case.seed)
    frames, count = round(DURATION_S / FRAME_S), len(nominal.joints)
    q = nominal.rows.copy()
    for name in UNCERTAIN:
        q[ROW[name]] *= 1.0 + OFF * np.clip(rng.standard_normal(count), -2.0, 2.0)
    wander = _wander(frames, rng)
    u = set_points(case.motion, frames, FRAME_S, count, rng)
    still = rng.permutation(count)[rng.integers(MOVING[0], MOVING[1] + 1) :]
    u[:, still] = 0.0
    kept, late_s, site = np.ones(frames, dtype=np.bool_), 0.0, None
    needs = {BY_NAME[name].needs for name, _ in case.effects}
    if "known_wall" in needs:
        case.model = "model_wall.yaml"
        q[ROW["wall_at"]], q[ROW["wall_k"]], q[ROW["wall_plain"]] = KNOWN_WALL
    if "no_creep" in needs:
        case.model = "model_no_creep.yaml"
        q[ROW["reach"]] = 0.0
    joint = -1
    for name, multiple in case.effects:
        concealed = BY_NAME[name]
        place = _place(concealed, multiple, case, (q, u, wander), nominal, rng=rng, taken=joint)
        if place is None:
            case.unplaced.append(name)
            continue
        joint, size, group, u = place
        if concealed.needs == "drop":
            kept = rng.random(frames) >= size
            kept[:5] = True
        elif concealed.needs == "clock":
            late_s = CLOCK_S * size
        else:
            near = scene(q, u, nominal.partner, nominal.neighbour, joint, frame_s=FRAME_S, wander=wander)
            switch_on(concealed, q, joint, size, near)
        whole = concealed.everywhere or concealed.needs in {"drop", "clock"}
        name_of_joint = None if whole else nominal.joints[joint]
        number = _number(concealed, size, q[:, joint])
        case.truth.append(_truth(concealed, multiple, size, name_of_joint, group) | {"number": number})
    noise = (rng.uniform(80.0, 250.0), math.radians(rng.uniform(0.01, 0.04)), 0.01, 0.02)
    readings = record(q, u, FRAME_S, nominal.partner, nominal.neighbour, wander=wander)
    readings = readings + np.array(noise)[:, None, None] * rng.standard_normal(readings.shape)
    if "known_wall" in needs and joint >= 0:
        site = (joint, nominal.pads[joint])
    folder = Path(out) / "recordings"
    folder.mkdir(exist_ok=True)
    path = folder / f"case_{case.number:04d}.mcap"
    write_bag(path, nominal.joints, readings, u, FRAME_S, site=site, kept=kept, pressure_late_s=late_s)
    return case


def _place(
    concealed: Concealed,
    multiple: float,
    case: Case,
    signals: tuple[Array, Array, Array],
    nominal: Nominal,
    *,
    rng: np.random.Generator,
    taken: int,
) -> tuple[int, float, list[str], Array] | None:
    """A joint on which the effect is visible, its size, its isolability class, and the set-points (perhaps redrawn).

    signals: parameters (rows, joints), set-points (frames, joints), random process (frames,).  taken: a joint that has
    an effect already.  None where the effect is visible nowhere up to its largest size.
    """
    q, u, wander = signals
    for _ in range(TRIES):
        needs_pad = concealed.needs == "known_wall"
        able = [j for j in range(q.shape[1]) if j != taken and u[:, j].any() and (nominal.pads[j] or not needs_pad)]
        joint = int(rng.choice(able))
        near = scene(q, u, nominal.partner, nominal.neighbour, joint, frame_s=FRAME_S, wander=wander)
        limit = limit_size(concealed, near)
        if np.isfinite(limit) and limit * multiple < concealed.most:
            sign = float(rng.choice([-1.0, 1.0])) if concealed.signed else 1.0
            size = sign * limit * multiple
            return joint, size, inseparable(concealed, size, near), u
        if case.motion != "mixed":
            case.motion = "mixed"
            u = set_points("mixed", len(u), FRAME_S, q.shape[1], rng) * u.any(axis=0)
    return None


def _number(concealed: Concealed, size: float, rows: Array) -> dict[str, Any] | None:
    """Key and value (SI) of the parameter that the diagnosis should report; rows: the joint's (rows,)."""
    if concealed.truth is None:
        return None
    key, unit = concealed.truth
    base = {"valve.time_constant_s": "lag", "valve.dead_time_s": "delay"}.get(key)
    return {"key": key, "value": unit * size + (float(rows[ROW[base]]) if base else 0.0)}


def _truth(concealed: Concealed, multiple: float, size: float, joint: str | None, group: list[str]) -> dict[str, Any]:
    return {
        "effect": concealed.name,
        "place": concealed.place,
        "joint": joint,
        "multiple": multiple,
        "size": size,
        "group": group,
    }


def _wander(frames: int, rng: np.random.Generator) -> Array:
    """An Ornstein-Uhlenbeck process of unit size and a time constant of 1.5 s."""
    keep = math.exp(-FRAME_S / 1.5)
    out = np.zeros(frames)
    for k in range(1, frames):
        out[k] = keep * out[k - 1] + math.sqrt(1.0 - keep * keep) * rng.standard_normal()
    return out
