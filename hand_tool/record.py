"""`hand record`: record a hand's topics, or repair a recording whose recorder ended without closing it."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hand_tool import interrupts
from hand_tool.console import VERBOSITY, note, running
from hand_tool.options import AsJson, Quiet, Verbose
from hand_tool.paths import check_exists, check_new

if TYPE_CHECKING:
    from rich.live import Live

    from hand_recording.record_options import RecordOptions, RecordSummary
    from hand_recording.repair import Repair


WATCH_S = 1.0
"""Time for which a recording that changed lately is watched before it is repaired [s]."""
HINT = (
    "hint: does a hand run? Start one with: hand up --sim; its namespace is set "
    "with --namespace, and ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE must be those of its nodes"
)


def record(
    *,
    out: Annotated[
        Path | None,
        typer.Option(help="New folder, or NAME.mcap for one bare file. Default: hand_DATE_TIME."),
    ] = None,
    storage: Annotated[str, typer.Option(help="mcap or sqlite3.")] = "mcap",
    topics: Annotated[list[str] | None, typer.Option(help="Record these topics only; may be repeated.")] = None,
    namespace: Annotated[
        list[str] | None, typer.Option(help="Record all topics below this; may be repeated. Default: /hand.")
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Length in s. Default: until Ctrl-C.")] = None,
    rosout: Annotated[bool, typer.Option(help="Record /rosout too.")] = False,
    mend: Annotated[
        Path | None, typer.Option("--repair", help="Repair this recording (folder or .mcap) instead.")
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Record every topic of a hand, with /diagnostics and /clock, as a rosbag2 recording.

    Example: hand record --out grasp_1 --duration 20

    Exit codes: 0 done, 1 nothing was published, 2 bad usage or a recording that cannot be written or repaired.
    """
    path = out or Path(time.strftime("hand_%Y-%m-%d_%H-%M-%S"))
    with running("record", path if mend is None else mend):
        if mend is not None:
            check_exists(mend)
            from hand_recording.repair import repair

            _show_repair(repair(mend, WATCH_S), as_json)
            return
        check_new(path)
        from hand_recording.record_options import RecordOptions, Selection

        selection = Selection(tuple(namespace or ("/hand",)), tuple(topics or ()), rosout)
        options = RecordOptions(path, storage, selection, duration)
        summary = _record(options, as_json)
    print(json.dumps(summary.as_json()) if as_json else _table(summary))
    if not summary.messages:
        print("hand record: nothing was published on the chosen topics", file=sys.stderr)
        note(HINT)
        raise typer.Exit(1)


def _record(options: RecordOptions, as_json: bool) -> RecordSummary:
    from rich.console import Console
    from rich.live import Live

    from hand_recording.node import record as run
    from hand_recording.node import stop_signals

    quiet = as_json or VERBOSITY.quiet
    console = Console(stderr=True)
    line: AbstractContextManager[Live | None] = nullcontext()
    if console.is_terminal and not quiet:
        line = Live(console=console, transient=True, auto_refresh=False)
    with stop_signals() as stop, line as live:
        interrupts.release()
        return run(options, stop.wait, None if live is None else _shower(live))


def _shower(live: Live) -> Callable[[RecordSummary], None]:
    from rich.text import Text

    def show(summary: RecordSummary) -> None:
        rates = ", ".join(f"{t.name.rsplit('/', 1)[-1]} {t.rate_hz:.0f} Hz" for t in summary.topics)
        text = f"{summary.duration_s:6.1f} s  {summary.messages} messages  {summary.bytes / 1e6:.1f} MB  {rates}"
        live.update(Text(text, overflow="ellipsis", no_wrap=True), refresh=True)

    return show


def _table(summary: RecordSummary) -> str:
    """The outcome for people: one line per topic."""
    lines = [f"{summary.path}: {summary.messages} messages in {summary.duration_s:.1f} s"]
    for topic in summary.topics:
        lines.append(
            f"  {topic.name:<28} {topic.messages:>8} messages {topic.rate_hz:8.1f} Hz {topic.bytes:>12} bytes"
            + (f"  {topic.missed} missed" if topic.missed else "")
        )
    lines += [f"  {name}: {reason}" for name, reason in summary.limited.items()]
    lines += [f"  not recorded: {reason}" for reason in summary.skipped.values()]
    return "\n".join(lines)


def _show_repair(outcome: Repair, as_json: bool) -> None:
    if as_json:
        print(json.dumps(outcome.as_json()))
        return
    total = sum(outcome.messages.values())
    if not outcome.changed:
        print(f"{outcome.path}: complete, {total} messages; nothing to repair")
        return
    print(f"{outcome.path}: {total} messages recovered, {outcome.lost_bytes} bytes lost")
    for name, messages in outcome.messages.items():
        print(f"  {name:<28} {messages:>8} messages")
    if outcome.damaged:
        print(f"  the file before the repair: {outcome.damaged}")
