"""`hand diagnose`: where simulation and recording differ, which physics is missing, and a model that has it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hand_tool import interrupts
from hand_tool.chosen_model import choose_model
from hand_tool.console import progress_bar, require, running
from hand_tool.options import AsJson, Model, Quiet, Verbose
from hand_tool.origin import Origin
from hand_tool.paths import check_exists, check_file, check_folder

if TYPE_CHECKING:
    from hand_diagnosis.fleet import Cluster, Job

LINES, PROPOSED = 15, 3
WRITTEN = ("report.html", "report.json", "model.yaml", "patch.yaml")
"""What the last line names; patch.diff and PNGs are next to them."""


def diagnose(
    *,
    recordings: Annotated[
        list[Path], typer.Argument(help="rosbag2 folders or .mcap/.db3 files, or tables with --map or --machine.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for report.json, report.html, model.yaml, patch.yaml and PNGs. Required."),
    ] = None,
    model: Model = None,
    mapping: Annotated[
        Path | None, typer.Option("--map", help="YAML that names the columns of a CSV or Parquet.")
    ] = None,
    machine: Annotated[Path | None, typer.Option(help="Another single-axis machine's file instead of a hand.")] = None,
    suggest_map: Annotated[
        bool,
        typer.Option("--suggest-map", help="Print the columns of a machine file for a table or rosbag2, and stop."),
    ] = False,
    joints: Annotated[str, typer.Option(help="Comma-separated joints. Default: all that move.")] = "",
    tolerance: Annotated[float, typer.Option(help="Expected relative error of the nominal numbers, 0 to 1.")] = 0.05,
    without: Annotated[str, typer.Option(help="Comma-separated effects to leave out of the search.")] = "",
    sensor_curve: Annotated[
        bool | None,
        typer.Option(help="Angles are readings of the described Hall sensors. Default: what fits better."),
    ] = None,
    rerun: Annotated[
        list[Path] | None,
        typer.Option(help="A recording of the same commands; differences to it are never claimed."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the bootstrap and of the further starts of fits.")] = 0,
    each: Annotated[bool, typer.Option("--each", help="Diagnose every recording by itself, into one table.")] = False,
    jobs: Annotated[int, typer.Option(help="Number of processes; more than 1 implies --each.")] = 1,
    scheduler: Annotated[str | None, typer.Option(help="Address of a dask scheduler; implies --each.")] = None,
    tls_ca: Annotated[
        Path | None, typer.Option(help="With --scheduler tls://...: certificate of its authority.")
    ] = None,
    tls_cert: Annotated[Path | None, typer.Option(help="The same: our certificate.")] = None,
    tls_key: Annotated[Path | None, typer.Option(help="The same: the key of our certificate.")] = None,
    ask: Annotated[bool, typer.Option("--ask", help="Print the command of the experiment to record next.")] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Locate the mismatch, name the missing physics, model it, and show how the fit improves.

    Example: hand diagnose recording.mcap --model config/hand.yaml --out out/diagnosis

    Exit codes: 0 done, 2 bad usage or a recording or model that cannot be used.
    """
    if suggest_map:
        _suggest_map(recordings)
        return
    if out is None:
        raise typer.BadParameter("a folder for the results is needed", param_hint="--out")
    files = tuple(out / name for name in ("report.json", "report.html", "model.yaml", "patch.yaml", "patch.diff"))
    fleet = each or jobs > 1 or scheduler is not None
    tls = (tls_ca, tls_cert, tls_key)
    table = tuple(out / name for name in ("findings.parquet", "summary.json", "index.html"))
    with running("diagnose", *(table if fleet else files)) as outputs:
        _check(recordings, mapping, rerun or [], tolerance, jobs, fleet)
        cluster = _cluster(scheduler, tls)
        check_folder(out)
        chosen = choose_model(machine or model)
        origin = Origin(chosen, seed)
        if machine is not None:
            _refuse_with_machine(
                {
                    "--model": model,
                    "--map": mapping,
                    "--joints": joints,
                    "--sensor-curve": sensor_curve,
                    "--rerun": rerun,
                    "--ask": ask,
                }
            )
        names = [str(path) for path in recordings]
        if fleet:
            _check_model(chosen.path, of_machine=machine is not None)
            chosen.print(as_json)
            from hand_diagnosis.fleet import Job

            template = Job(
                recording="",
                model=str(chosen.path),
                mapping=str(mapping) if mapping else None,
                out="",
                tolerance=tolerance,
                seed=seed,
                joints=tuple(_list(joints)),
                without=tuple(_list(without)),
                sensor_curve=sensor_curve,
                of_machine=machine is not None,
                made=origin.document(),
            )
            summary = _fleet(recordings, template, origin, outputs, out, jobs=jobs, cluster=cluster, as_json=as_json)
            _print_fleet(summary | {"model_file": chosen.as_json()}, out, as_json)
            return
        if machine is not None:
            from hand_diagnosis.machine_report import write_machine_report
            from hand_machine.machine import load_machine

            loaded = load_machine(chosen.path, recordings, to_fit=True)
            chosen.print(as_json)
            content = write_machine_report(
                loaded,
                names,
                out,
                tolerance=tolerance,
                seed=seed,
                without=_list(without),
                made=origin.document,
            )
            _print(content | {"model_file": chosen.as_json()}, out, as_json, ask=False)
            return
        from hand_model.description import load_hand

        hand = load_hand(chosen.path)
        from hand_diagnosis import diagnose as run
        from hand_diagnosis import read_recording

        signals = [read_recording(path, hand, mapping=mapping) for path in recordings]
        repeated = [read_recording(path, hand, mapping=mapping) for path in rerun or []]
        with progress_bar(as_json, counted=True) as progress:
            total = len({joint for recorded in signals for joint in recorded.joints})
            bar = progress.add_task("joints", total=total)
            result = run(
                signals,
                hand,
                tolerance=tolerance,
                seed=seed,
                joints=_list(joints),
                without=_list(without),
                sensor_curve=sensor_curve,
                reruns=repeated,
                names=names,
                progress=lambda joint: progress.update(bar, advance=1, description=joint),
            )
            progress.update(bar, completed=total)
        chosen.print(as_json)
        content = result.write(out, page=False, made=origin.document())
        outputs.complete(files[0], *files[2:])
        from hand_diagnosis.pages.page import write_page

        write_page(result.diagnosis, content, out, hand)
    _print(content | {"model_file": chosen.as_json()}, out, as_json, ask)


def _check(
    recordings: list[Path], mapping: Path | None, rerun: list[Path], tolerance: float, jobs: int, fleet: bool
) -> None:
    """Check what needs no library. Of many recordings, the bad ones are rows of the table."""
    if not 0.0 < tolerance <= 1.0:
        raise ValueError(f"--tolerance is {tolerance:g}; the allowed range is above 0 to 1")
    if not 1 <= jobs <= 256:
        raise ValueError(f"--jobs is {jobs}; the allowed range is 1 to 256")
    if rerun and fleet:
        raise ValueError("--rerun cannot be used with --each, --jobs or --scheduler")
    if fleet:
        require("pyarrow", *(["distributed"] if jobs > 1 else []))
    if mapping is not None:
        require("pyarrow")
        check_file(mapping)
    for path in rerun if fleet else [*recordings, *rerun]:
        check_exists(path)


def _print(content: dict[str, Any], out: Path, as_json: bool, ask: bool) -> None:
    print(json.dumps(content) if as_json else "\n".join(summary_lines(content, out, ask=ask)))


def _refuse_with_machine(given: dict[str, object]) -> None:
    """Refuse options that have no part in the diagnosis of another machine. given: values by option, false if not."""
    wrong = [option for option, value in given.items() if value or (option == "--sensor-curve" and value is False)]
    if wrong:
        raise ValueError(f"{', '.join(wrong)} cannot be used with --machine")


def _check_model(path: Path, *, of_machine: bool) -> None:
    """Refuse a model that cannot be used before many recordings are read."""
    from hand_machine.description import load_description
    from hand_model.description import load_hand

    load_description(path) if of_machine else load_hand(path)


def _suggest_map(recordings: list[Path]) -> None:
    """Print the section `columns` of a machine file, proposed from the first recording."""
    from hand_machine.suggestion import suggest_map

    with running("diagnose"):
        print(suggest_map(recordings[0]), end="")


def _fleet(
    recordings: list[Path],
    template: Job,
    origin: Origin,
    outputs: interrupts.Outputs,
    out: Path,
    *,
    jobs: int,
    cluster: Cluster | None,
    as_json: bool,
) -> dict[str, Any]:
    """Diagnose every recording by itself; a recording that has a report is not diagnosed again. The summary.

    template: what all jobs have in common.
    """
    from hand_diagnosis.fleet import report_folder, run_fleet, write_table
    from hand_diagnosis.pages.fleet_page import write_index

    folders = {path: report_folder(path, out) for path in dict.fromkeys(recordings)}
    work = [replace(template, recording=str(path), out=str(folder)) for path, folder in folders.items()]
    rows: list[dict[str, Any]] = []

    def index() -> None:
        out.mkdir(parents=True, exist_ok=True)  # no report has made it where all are unusable
        answered = {row["recording"]: row["error"] for row in rows}
        entries = [(path, folder) for path, folder in folders.items() if str(path) in answered]
        errors = {path: error for path, error in answered.items() if error}
        write_index(entries, errors, out, origin.of_page(), len(folders) - len(entries))
        outputs.complete(out / "index.html")

    if jobs > 1:
        interrupts.before_workers()
    with progress_bar(as_json, counted=True) as progress:
        bar = progress.add_task("recordings", total=len(work))
        for part in run_fleet(work, jobs, cluster):
            rows += part
            outputs.at_interruption(index)
            progress.advance(bar)
    outputs.at_interruption(None)
    summary = write_table(rows, out)
    index()
    return summary


def _cluster(scheduler: str | None, tls: tuple[Path | None, Path | None, Path | None]) -> Cluster | None:
    """The cluster of the options. Raises ValueError where they do not fit."""
    from hand_diagnosis.fleet import Cluster

    if scheduler is None:
        if any(tls):
            raise ValueError("--tls-ca, --tls-cert and --tls-key need --scheduler tls://HOST:PORT")
        return None
    cluster = Cluster(scheduler, *tls)
    cluster.check()
    return cluster


def _print_fleet(summary: dict[str, Any], out: Path, as_json: bool) -> None:
    if as_json:
        print(json.dumps(summary))
        return
    counts = ", ".join(f"{count} {verdict}" for verdict, count in summary["verdicts"].items())
    print(f"{summary['recordings']} recordings: {counts}")
    for name, count in list(summary["by_joint"].items())[:10]:
        print(f"  {count:4d}  {name}")
    print(
        f"written: {out / 'index.html'}, {out / 'findings.parquet'}, {out / 'summary.json'}, one report per recording"
    )


def _list(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def summary_lines(content: dict[str, Any], out: Path, *, ask: bool) -> list[str]:
    """What is printed of a report, at most LINES lines; the next experiment, the notes and the paths always are."""
    from hand_diagnosis.pages.headline import by_reason, title, words_of

    lines = [f"verdict: {content['verdict']}"]
    for finding in content["findings"]:
        shares = {row["effect"]: row["probability"] for row in finding["alternatives"]}
        names = [f"{finding['effect']} ({finding['probability']:.0%})"]
        names += [f"{name} ({shares.get(name, 0.0):.0%})" for name in finding["tied_with"]]
        lines.append(f"{finding['rank']}. {' or '.join(names)}: {finding['statement']}")
    lines += [f"remainder ({left['probability']:.0%}): {left['statement']}" for left in content["remainder"]]
    if content["verdict"] in {"agrees", "unusable"}:
        lines.append(title(content, *words_of(content)))
    last = []
    following = content["next_experiment"]
    proposed = [following] if following else []
    proposed += [finding["tie"] for finding in content["findings"] if finding["tie"] not in (None, following)]
    for each in proposed[:PROPOSED]:
        last.append(f"record next: {each['name']} - {each['why']}" if "name" in each else f"tie: {each['why']}")
        if "how" in each:
            last.append(f"  {each['how']}")
        if ask and "command" in each:
            last.append(f"  {each['command']}")
    if content["not_judged"]:
        last += [f"not diagnosed, {why}: {', '.join(names)}" for why, names in by_reason(content["not_judged"])]
    last += [f"not claimable: {row['statement']}" for row in content["not_claimable"][:2]]
    last += [f"note: {line}" for line in content["data_check"][:3]]
    last.append(f"written: {', '.join(str(out / name) for name in WRITTEN)}")
    room = LINES - len(last)
    if len(lines) > room:
        lines = [*lines[: room - 1], f"and {len(lines) - room + 1} more in the report"]
    return lines + last
