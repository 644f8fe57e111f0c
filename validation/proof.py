"""The proof of the diagnosis: blind trials against every plant, the plants of others first; `make proof` runs it.

    python -m validation.proof --cases 60 --out out/proof

Each plant has a folder of its own below the output: `hand trial make` seals the truth, `hand trial run` diagnoses in
processes without the key, `hand trial score` opens the seal. The key of a trial stays in this process. The scores that
count are those of the families that nobody looked at and of the plants of others, together; the rest is development.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from hand_pages.results import Results, Section, Table, write_results
from validation import figures
from validation.results import provenance
from validation.trial.document import REFEREE_GOALS, goal_of, score_cell
from validation.trial.grade import Grade
from validation.trial.score import LABELS, scores_of

TOOL = [sys.executable, "-m", "hand_tool", "trial"]
COUNT, DEVELOPMENT = {"held_back": 0.4, "mujoco": 0.15, "progpy": 0.05}, {"development": 0.2, "trial": 0.2}
"""Plants whose scores count, and those that were looked at: shares of the recordings."""
INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""
LEAST_CASES = 5
"""Recordings of a plant; `hand trial make` takes no fewer."""
CASES = (5, 100_000)
WORDS = {
    "held_back": "families of laws that nobody looked at",
    "mujoco": "the hand in MuJoCo",
    "progpy": "a pneumatic valve by NASA",
    "development": "families of laws that were looked at",
    "trial": "the plant of the first trials",
}
TILES = ("first", "place", "false_alarm", "unknown_found")


def shares_of(cases: int, plants: Sequence[str] = ()) -> dict[str, int]:
    """Recordings of each plant, those that count first. plants: only these; all where none is given."""
    shares = {plant: share for plant, share in (COUNT | DEVELOPMENT).items() if plant in plants or not plants}
    whole = sum(shares.values())
    return {plant: max(LEAST_CASES, round(share / whole * cases)) for plant, share in shares.items()}


def called(*arguments: str, key: str = "", allowed: Sequence[int] = (0,)) -> str:
    """What `hand trial` printed. key: its standard input. RuntimeError with its last line where it fails."""
    done = subprocess.run([*TOOL, *arguments, "--quiet"], input=key, capture_output=True, text=True, check=False)
    if done.returncode not in allowed:
        lines = done.stderr.strip().splitlines() or ["no message"]
        raise RuntimeError(f"hand trial {arguments[0]} ended with {done.returncode}: {lines[-1]}")
    return done.stdout


def run_plant(plant: str, folder: Path, count: int, options: Sequence[str]) -> dict[str, Any]:
    """A sealed trial against a plant: its scores.json, and its grades under `grades`. options: of `hand trial run`."""
    printed = called("make", str(folder), "--cases", str(count), "--plant", plant)
    key = next(line.removeprefix("key ") for line in printed.splitlines() if line.startswith("key "))
    called("run", str(folder), *options)
    called("score", str(folder), key=key, allowed=(0, 1))
    scores: dict[str, Any] = json.loads((folder / "scores.json").read_text(encoding="utf-8"))
    return scores | {"grades": json.loads((folder / "grades.json").read_text(encoding="utf-8"))}


def together(runs: Mapping[str, Mapping[str, Any]], plants: Sequence[str]) -> dict[str, Any]:
    """The scores of several plants as those of one trial."""
    return scores_of([Grade(**grade) for plant in plants for grade in runs[plant]["grades"]])


def prove(
    out: Path, counts: Mapping[str, int], options: Sequence[str], progress: Callable[[str], None] = lambda _: None
) -> dict[str, Any]:
    """Run all trials; returns what proof.json holds under `proof`. RuntimeError: see `called`.

    counts: recordings of each plant.  options: of `hand trial run`.
    """
    begun, runs = time.monotonic(), dict[str, dict[str, Any]]()
    for plant, count in counts.items():
        progress(f"{plant}: {count} recordings, {WORDS[plant]}")
        runs[plant] = run_plant(plant, out / plant, count, options)
    kept = ("scores", "recordings", "kinds", "seed", "commitment", "by_group")
    return {
        "together": together(runs, [plant for plant in COUNT if plant in runs]),
        "plants": {plant: {key: run[key] for key in kept} for plant, run in runs.items()},
        "minutes": (time.monotonic() - begun) / 60.0,
    }


def rows_of(proof: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """A row a score: its name, goal, what counts together, and every plant."""
    runs = [proof["together"], *(run["scores"] for run in proof["plants"].values())]
    return [(LABELS[name], goal_of(name), *(score_cell(name, run[name]) for run in runs)) for name in REFEREE_GOALS]


def head_of(proof: Mapping[str, Any]) -> tuple[str, ...]:
    """The heads of the columns of `rows_of`."""
    return ("score", "goal", " and ".join(counted(proof)) or "none that counts", *proof["plants"])


def counted(proof: Mapping[str, Any]) -> list[str]:
    """The plants of a proof whose scores count."""
    return [plant for plant in COUNT if plant in proof["plants"]]


def write_page(path: Path, proof: Mapping[str, Any], made: Mapping[str, str]) -> None:
    """Write proof.html: what counts first, then each plant, then families and conditions."""
    scores = proof["together"]
    tiles = [(score_cell(name, scores[name]) or "-", LABELS[name]) for name in TILES]
    count = sum(proof["plants"][plant]["recordings"] for plant in counted(proof))
    about = (
        f"{count} recordings are of plants that count: {', '.join(WORDS[plant] for plant in COUNT)}. The others were"
        f" looked at while the tool was changed: {', '.join(WORDS[plant] for plant in DEVELOPMENT)}. It took"
        f" {proof['minutes']:.0f} minutes."
    )
    groups = [
        (plant, name, *(score_cell(key, group[key]) for key in TILES))
        for plant, run in proof["plants"].items()
        for name, group in run["by_group"].items()
    ]
    head = ("plant", "cases", *(LABELS[name] for name in TILES))
    sections = [
        Section("Scores", tables=[Table(head_of(proof), rows_of(proof))]),
        Section("By family, size and condition", tables=[Table(head, groups)], folded=True),
    ]
    first = scores["first"]
    title = f"The effect is named first in {score_cell('first', first)}" if first["count"] else "No effect was graded"
    write_results(path, Results(title, about, tiles, sections, made))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; exit code 0 done, 1 a trial failed, 2 bad usage or bad input, 130 interrupted."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.proof",
        description="Blind trials of the diagnosis against every plant; scores into proof.json and proof.html.",
        epilog="Example: python -m validation.proof --cases 60 --out out/proof",
    )
    parser.add_argument("--cases", type=int, default=600, help="recordings of all plants together, at least 5 of each")
    parser.add_argument("--plant", action="append", choices=list(WORDS), help="only this plant; may be repeated")
    parser.add_argument("--out", type=Path, default=Path("out/proof"), help="new or empty folder")
    parser.add_argument("--jobs", type=int, default=2, help="processes that diagnose, 1 to 256")
    parser.add_argument("--scheduler", help="address of a dask scheduler that diagnoses instead")
    parser.add_argument("--write-docs", action="store_true", help="store the scores, and write them into the documents")
    options = parser.parse_args(arguments)
    out: Path = options.out
    try:
        if not CASES[0] <= options.cases <= CASES[1]:
            raise ValueError(f"--cases is {options.cases}; the allowed range is {CASES[0]} to {CASES[1]}")
        if not 1 <= options.jobs <= 256:
            raise ValueError(f"--jobs is {options.jobs}; the allowed range is 1 to 256")
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise ValueError(f"{out} is not an empty folder; give a new one with --out")
        out.mkdir(parents=True, exist_ok=True)
        passed = ["--scheduler", options.scheduler] if options.scheduler else ["--jobs", str(options.jobs)]
        counts = shares_of(options.cases, options.plant or ())
        proof = prove(out, counts, passed, lambda line: print(line, file=sys.stderr, flush=True))
        made = provenance("make proof")
        (out / "proof.json").write_text(json.dumps({**made, "proof": proof}, indent=1) + "\n", encoding="utf-8")
        write_page(out / "proof.html", proof, made)
    except KeyboardInterrupt:
        done = ", ".join(plant for plant in WORDS if (out / plant / "scores.json").is_file()) or "no plant"
        print(
            f"python -m validation.proof: interrupted; scored so far: {done}; proof.json is not written",
            file=sys.stderr,
        )
        return INTERRUPTED
    except RuntimeError as fault:
        print(f"python -m validation.proof: {fault}", file=sys.stderr)
        return 1
    except (OSError, ValueError) as fault:
        print(f"python -m validation.proof: {fault}", file=sys.stderr)
        return 2
    for row in (head_of(proof), *rows_of(proof)):
        print("  ".join(row[:3]))
    print(f"written: {out / 'proof.html'}, {out / 'proof.json'}")
    if options.write_docs:
        taken = [part for plant in proof["plants"] for part in ("--take", str(out / plant))]
        return figures.main([*taken, "--take", str(out / "proof.json")])
    return 0


if __name__ == "__main__":
    sys.exit(main())
