"""`hand trial make | run | score`: a blind trial of the diagnosis on concealed effects."""

from __future__ import annotations

import json
import os
import secrets
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from hand_recording.installed import default_model
from hand_tool.validation_extra import needs_validation

app = typer.Typer(no_args_is_help=True, help="A blind trial: conceal effects, diagnose, open the seal and score.")
KEY = "HAND_TRIAL_KEY"
_Folder = Annotated[Path, typer.Argument(help="The trial's folder.")]
_Jobs = Annotated[int, typer.Option(help="Processes.")]


@app.command()
def make(
    out: _Folder,
    cases: Annotated[int, typer.Option(help="Recordings, 10 to 100000.")] = 400,
    seed: Annotated[int | None, typer.Option(help="Master seed. Default: a fresh one, sealed with the truth.")] = None,
    model: Annotated[Path | None, typer.Option(help="The nominal hand.yaml. Default: the installed one.")] = None,
    jobs: _Jobs = 2,
) -> None:
    """Simulate recordings with concealed effects on an independent plant, and seal what they are.

    Prints the commitment (SHA-256 of the truth) and the key, which is written nowhere: keep it for score.

    Example: hand trial make out/trial --cases 40

    Exit codes: 0 done, 2 bad usage.
    """
    if not 10 <= cases <= 100000:
        _refuse(f"--cases is {cases}; the allowed range is 10 to 100000")
    _check_jobs(jobs)
    if out.exists() and any(out.iterdir()):
        _refuse(f"{out} is not empty; give a new folder")
    with needs_validation("trial"):
        from validation.trial.make import make as make_trial  # noqa: PLC0415 - a robot need not have it
        from validation.trial.seal import new_key  # noqa: PLC0415 - as above

    key = new_key()
    with _bar("cases") as advance:
        try:
            master = secrets.randbits(31) if seed is None else seed
            promised = make_trial(out, model or default_model(), cases, master, key, jobs, advance)
        except (ValueError, OSError, KeyError) as error:
            _refuse(str(error))
    print(f"commitment {promised}")
    print(f"key {key.decode()}")


@app.command()
def run(
    folder: _Folder,
    tolerance: Annotated[float, typer.Option(help="Of hand diagnose: relative error of the nominal numbers.")] = 0.05,
    jobs: _Jobs = 2,
) -> None:
    """Diagnose the trial's recordings with the ordinary command; refuses where the key is at hand.

    Example: hand trial run out/trial

    Exit codes: 0 done, 1 the tool failed on a recording, 2 bad usage.
    """
    _check_jobs(jobs)
    if KEY in os.environ:
        _refuse(f"{KEY} is set; a diagnosis must not be able to open the seal")
    if not (folder / "plan.json").is_file():
        _refuse(f"{folder} holds no trial (plan.json is missing); make one with: hand trial make {folder}")
    with needs_validation("trial"):
        from validation.trial.run import run as run_trial  # noqa: PLC0415 - a robot need not have it

    with _bar("recordings") as advance:
        try:
            run_trial(folder, [sys.executable, "-m", "hand_tool.cli"], jobs, tolerance, advance)
        except RuntimeError as error:
            print(f"hand trial run: {error}", file=sys.stderr)
            raise typer.Exit(1) from None


@app.command()
def score(
    folder: _Folder,
    key: Annotated[
        str | None, typer.Option(help=f"The key that make printed. Default: ${KEY}, or standard input.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print scores.json.")] = False,
) -> None:
    """Open the seal, check the commitment, grade every report; scores.json, confusion.png, reliability.png.

    Example: hand trial score out/trial --key KEY

    Exit codes: 0 done, 1 a goal is not reached, 2 bad usage, a wrong key or a broken seal.
    """
    with needs_validation("trial"):
        from validation.trial.score import GOALS, SAYS, met  # noqa: PLC0415 - a robot need not have it
        from validation.trial.score import score as score_trial  # noqa: PLC0415 - as above

    try:
        given = key or os.environ.get(KEY) or sys.stdin.readline().strip()
        result = score_trial(folder, given.encode())
    except (ValueError, OSError) as error:
        _refuse(str(error))
    reached = {name: met(name, one["value"]) for name, one in result["scores"].items()}
    if as_json:
        print(json.dumps(result))
    else:
        print(f"seed {result['seed']}, commitment {result['commitment']} kept, {result['recordings']} recordings")
        for name, one in result["scores"].items():
            if one["value"] is None:
                continue
            sign, goal = GOALS.get(name) or ("", float("nan"))
            span = f" ({one['low']:.1%} to {one['high']:.1%})" if "low" in one else ""
            verdict = {True: "reached", False: "NOT reached", None: ""}[reached[name]]
            wanted = f"  goal {sign} {goal:.0%} {verdict}" if sign else ""
            print(
                f"{SAYS.get(name, 'expected calibration error'):45s} {one['value']:.1%}{span} of {one['count']}{wanted}"
            )
    raise typer.Exit(1 if False in reached.values() else 0)


@app.command()
def reality(
    data: Annotated[Path, typer.Argument(help="Folder with pneumatic_cylinder and servo_pendulum.")],
    out: Annotated[Path, typer.Option(help="Folder for reports and reality.json.")],
) -> None:
    """Diagnose public recordings of real machines, beside fixed friction models and a sparse regression.

    Example: hand trial reality data --out out/reality

    Exit codes: 0 done, 1 the tool failed on a machine, 2 bad usage.
    """
    with needs_validation("trial"):
        from validation.trial.reality import examine, machines  # noqa: PLC0415 - a robot need not have it

    try:
        found = machines(data)
    except (OSError, KeyError, ValueError) as error:
        _refuse(str(error))
    results = []
    with _bar("machines") as advance:
        for number, machine in enumerate(found):
            try:
                results.append(examine(machine, out, [sys.executable, "-m", "hand_tool.cli"]))
            except RuntimeError as error:
                print(f"hand trial reality: {error}", file=sys.stderr)
                raise typer.Exit(1) from None
            advance((number + 1) / len(found))
    (out / "reality.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    for one in results:
        errors = f"{one['before']:.3g} to {one['after']:.3g} {one['unit']}"
        print(f"{one['machine']}: {one['verdict']}, found {', '.join(one['found']) or 'none'}; held-out {errors}")


def _check_jobs(jobs: int) -> None:
    if not 1 <= jobs <= 256:
        _refuse(f"--jobs is {jobs}; the allowed range is 1 to 256")


def _refuse(line: str) -> None:
    print(f"hand trial: {line}", file=sys.stderr)
    raise typer.Exit(2)


class _bar:  # noqa: N801 - a context manager that reads like a function
    """A progress bar on standard error."""

    def __init__(self, what: str) -> None:
        columns = (TextColumn(what), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
        self._progress = Progress(*columns, console=Console(stderr=True), transient=True)

    def __enter__(self):  # type: ignore[no-untyped-def]
        self._progress.start()
        task = self._progress.add_task("", total=1.0)
        return lambda share: self._progress.update(task, completed=share)

    def __exit__(self, *_: object) -> None:
        self._progress.stop()
