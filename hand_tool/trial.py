"""`hand trial make | run | score | reality`: a blind trial of the diagnosis on concealed effects."""

from __future__ import annotations

import json
import os
import secrets
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from hand_recording.version import version
from hand_tool.chosen_model import choose_model
from hand_tool.console import fail, note, progress_bar, require, running
from hand_tool.options import AsJson, Model, Quiet, Verbose
from hand_tool.paths import check_exists, check_folder

app = typer.Typer(
    no_args_is_help=True,
    help="A blind trial: conceal effects, diagnose, open the seal and score.\n\n"
    "Example: hand trial make out/trial --cases 40",
)
KEY = "HAND_TRIAL_KEY"
PLANTS = ("trial", "development", "held_back", "mujoco", "progpy")
TOOL = [sys.executable, "-m", "hand_tool"]
_Folder = Annotated[Path, typer.Argument(help="Folder of the trial.")]
_Out = Annotated[Path, typer.Argument(help="New folder.")]
_Key = Annotated[str | None, typer.Option(help=f"The key that make printed. Default: ${KEY}, or standard input.")]
_Jobs = Annotated[int, typer.Option(help="Number of processes, 1 to 256.")]


@app.command()
def make(
    *,
    out: _Folder,
    cases: Annotated[int, typer.Option(help="Number of recordings, 5 to 100000.")] = 400,
    seed: Annotated[int | None, typer.Option(help="Master seed. Default: a new one, sealed with the truth.")] = None,
    model: Model = None,
    plant: Annotated[str, typer.Option(help=f"Who conceals: {', '.join(PLANTS)}.")] = PLANTS[0],
    jobs: _Jobs = 2,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Simulate recordings with concealed effects on an independent plant, and seal the truth about them.

    trial: the plant of the trial, usual conditions. development: laws of many forms under many conditions, which may be
    looked at. held_back: laws and kinds of physics that are run, not looked at; note each run in docs/proof.md.
    mujoco: the hand in MuJoCo, with MuJoCo's own friction, damping, limits, tendons, weight and contact.
    progpy: NASA's pneumatic valve with worn seals and springs, as a machine; --model is not used.

    Prints the commitment (SHA-256 of the truth, of the tool's version and of all its settings, splits included) and the
    key, which is not written to any file: keep it for score.

    Example: hand trial make out/trial --cases 40

    Exit codes: 0 done, 2 bad usage.
    """
    with running("trial make", out / "recordings", out / "plan.json", errors=(KeyError,)) as outputs:
        if not 5 <= cases <= 100000:
            raise ValueError(f"--cases is {cases}; the allowed range is 5 to 100000")
        if plant not in PLANTS:
            raise ValueError(f"--plant is {plant!r}; it must be one of {', '.join(PLANTS)}")
        _check_jobs(jobs)
        check_folder(out)
        if out.exists() and any(out.iterdir()):
            raise ValueError(f"{out} is not empty; give a new folder")
        chosen = choose_model(model)
        require("validation", "cryptography")
        from hand_diagnosis.settings_table import numbers_in_force
        from validation.referees.make import make as make_referees
        from validation.trial.make import make as make_trial
        from validation.trial.seal import new_key, tool_numbers

        chosen.print()
        key = new_key()
        master = secrets.randbits(31) if seed is None else seed
        tool = tool_numbers(version(), numbers_in_force())
        with _bar("cases") as advance:
            if plant == PLANTS[0]:
                promised = make_trial(out, chosen.path, cases, master, key, jobs=jobs, progress=advance, tool=tool)
            elif plant == "mujoco":
                require("validation", "mujoco")
                from validation.referees.mujoco_hand import make as make_mujoco

                promised = make_mujoco(out, chosen.path, cases, master, key, jobs=jobs, progress=advance, tool=tool)
            elif plant == "progpy":
                require("validation", "progpy")
                from validation.referees.progpy_valve import make as make_progpy

                promised = make_progpy(out, cases, master, key, jobs=jobs, progress=advance, tool=tool)
            else:
                promised = make_referees(
                    out, chosen.path, cases, master, key, plant, jobs=jobs, progress=advance, tool=tool
                )
        outputs.complete(out / "recordings", out / "plan.json")
    print(f"commitment {promised}")
    print(f"key {key.decode()}")


@app.command()
def run(
    folder: _Folder,
    tolerance: Annotated[float, typer.Option(help="Of hand diagnose: relative error of the nominal numbers.")] = 0.05,
    jobs: _Jobs = 2,
    scheduler: Annotated[str | None, typer.Option(help="Address of a dask scheduler, instead of --jobs.")] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Diagnose the recordings of the trial with the ordinary command; refused where the key is set.

    An interrupted run goes on where it stopped when it is started again.

    Example: hand trial run out/trial

    Exit codes: 0 done, 1 the diagnosis failed on a recording, 2 bad usage.
    """
    with running("trial run", folder / "reports", folder / "timing.json") as outputs:
        _check_jobs(jobs)
        if KEY in os.environ:
            raise ValueError(f"{KEY} is set; a diagnosis must not be able to open the seal")
        if not (folder / "plan.json").is_file():
            raise ValueError(f"{folder} holds no trial (plan.json is missing); make one with: hand trial make {folder}")
        from validation.trial.run import run as run_trial

        note(f"model: as the trial describes it, {folder / 'plan.json'}")
        with _bar("recordings") as advance:
            try:
                run_trial(folder, TOOL, jobs, tolerance, advance, scheduler=scheduler)
            except RuntimeError as error:
                fail("trial run", str(error), 1)
        outputs.complete(folder / "reports", folder / "timing.json")


@app.command()
def score(
    folder: _Folder,
    key: _Key = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Open the seal, check the commitment, grade every report; scores.html, scores.json and pictures.

    Example: hand trial score out/trial --key KEY

    Exit codes: 0 done, 1 a goal is not reached, 2 bad usage, a wrong key or a broken seal.
    """
    with running("trial score", folder / "scores.json"):
        check_exists(folder)
        require("validation", "cryptography")
        from validation.results import provenance
        from validation.trial.score import score as score_trial
        from validation.trial_page import write_page

        result = score_trial(folder, _given_key(key), made=provenance("hand trial score OUT"))
        write_page(folder, result)
    _print_scores(result, folder, as_json)


@app.command()
def export(folder: _Folder, out: _Out, quiet: Quiet = False, verbose: Verbose = False) -> None:
    """Copy recordings and nominal models of a trial, without the truth, for another method; docs/benchmark.md.

    Example: hand trial export out/trial out/task

    Exit codes: 0 done, 2 bad usage or an incomplete trial.
    """
    with running("trial export", out) as outputs:
        check_folder(out)
        if out.exists() and any(out.iterdir()):
            raise ValueError(f"{out} is not empty; give a new folder")
        if not (folder / "plan.json").is_file():
            raise ValueError(f"{folder} holds no trial (plan.json is missing); make one with: hand trial make {folder}")
        from validation.trial.answers import export as export_trial

        count = export_trial(folder, out)
        outputs.complete(out)
    print(f"{count} recordings without their truth: {out}; answer them as docs/benchmark.md says")


@app.command(name="score-answers")
def score_answers(
    folder: _Folder,
    answers: Annotated[Path, typer.Argument(help="answers.json: findings and remainder of every case.")],
    key: _Key = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Open the seal of a trial and grade the answers of another method as reports of ours are graded.

    Example: hand trial score-answers out/trial answers.json --key KEY

    Exit codes: 0 done, 1 a goal is not reached, 2 bad usage, bad answers, a wrong key or a broken seal.
    """
    with running("trial score-answers", folder / "scores.json"):
        check_exists(folder)
        check_exists(answers)
        require("validation", "cryptography")
        from validation.trial.answers import read_answers
        from validation.trial.score import score as score_trial
        from validation.trial_page import write_page

        given = read_answers(answers)
        result = score_trial(folder, _given_key(key), given)
        write_page(folder, result)
    _print_scores(result, folder, as_json)


def _given_key(key: str | None) -> bytes:
    return (key or os.environ.get(KEY) or sys.stdin.readline().strip()).encode()


def _print_scores(result: dict[str, Any], folder: Path, as_json: bool) -> None:
    """Print the scores; exit code 1 where a goal is not reached."""
    from validation.trial.score import met

    reached = {name: met(name, figure["value"]) for name, figure in result["scores"].items()}
    lines = [*_score_lines(result, reached), f"written: {folder / 'scores.html'}, {folder / 'scores.json'}"]
    print(json.dumps(result) if as_json else "\n".join(lines))
    raise typer.Exit(1 if False in reached.values() else 0)


def _score_lines(result: dict[str, Any], reached: dict[str, bool | None]) -> list[str]:
    """One line per score: its value, its interval, its count and its goal."""
    from validation.trial.score import GOALS, LABELS, shown

    lines = [f"seed {result['seed']}, commitment {result['commitment']} kept, {result['recordings']} recordings"]
    for name, figure in result["scores"].items():
        if figure["value"] is None:
            continue
        sign, goal = GOALS.get(name) or ("", float("nan"))
        interval = f" ({figure['low']:.1%} to {figure['high']:.1%})" if "low" in figure else ""
        verdict = {True: "reached", False: "NOT reached", None: ""}[reached[name]]
        wanted = f"  goal {sign} {goal:.0%} {verdict}" if sign else ""
        title = LABELS[name]
        lines.append(f"{title:45s} {shown(name, figure['value'])}{interval} of {figure['count']}{wanted}")
    return lines


@app.command()
def reality(
    data: Annotated[Path, typer.Argument(help="Folder with pneumatic_cylinder and servo_pendulum.")],
    out: Annotated[Path, typer.Option(help="Folder for reports and reality.json.")],
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Diagnose public recordings of real machines and compare with fixed friction models and a sparse regression.

    Example: hand trial reality data --out out/reality

    Exit codes: 0 done, 1 the diagnosis failed on a machine, 2 bad usage.
    """
    with running("trial reality", out / "reality.json", errors=(KeyError,)):
        check_folder(out)
        require("validation", "pyarrow", "pysindy")
        from validation.trial.reality import examine, machines

        found = machines(data)
        results = []
        with _bar("machines") as advance:
            for number, machine in enumerate(found):
                try:
                    results.append(examine(machine, out, TOOL))
                except RuntimeError as error:
                    fail("trial reality", str(error), 1)
                advance((number + 1) / len(found))
        (out / "reality.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    for result in results:
        errors = f"{result['before']:.3g} to {result['after']:.3g} {result['unit']}"
        effects = ", ".join(result["found"]) or "none"
        print(f"{result['machine']}: {result['verdict']}, found {effects}; held-out {errors}")


def _check_jobs(jobs: int) -> None:
    if not 1 <= jobs <= 256:
        raise ValueError(f"--jobs is {jobs}; the allowed range is 1 to 256")


@contextmanager
def _bar(what: str) -> Iterator[Callable[[float], None]]:
    """A progress bar; its function takes the share done, 0 to 1."""
    with progress_bar(as_json=False) as progress:
        task = progress.add_task(what, total=1.0)
        yield lambda share: progress.update(task, completed=share)
