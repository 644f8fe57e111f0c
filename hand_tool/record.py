"""`hand record`: record a hand's topics, or mend a recording whose recorder died."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.live import Live
from rich.text import Text

from hand_recording.record_options import RecordOptions, RecordSummary, Selection
from hand_recording.repair import Repair, repair


def record(
    out: Annotated[
        Path | None,
        typer.Option(help="New folder, or NAME.mcap for one bare file. Default: hand_DATE_TIME."),
    ] = None,
    storage: Annotated[str, typer.Option(help="mcap or sqlite3.")] = "mcap",
    topics: Annotated[list[str] | None, typer.Option(help="Record these topics only; may be repeated.")] = None,
    namespace: Annotated[
        list[str] | None, typer.Option(help="Record all topics below this; may be repeated. Default: /hand.")
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Seconds; until Ctrl-C without.")] = None,
    rosout: Annotated[bool, typer.Option(help="Record /rosout too.")] = False,
    mend: Annotated[
        Path | None, typer.Option("--repair", help="Mend this recording (folder or .mcap) instead.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")] = False,
) -> None:
    """Record every topic of a hand, with /diagnostics and /clock, as a rosbag2 recording.

    Example: hand record --out grasp_1 --duration 20

    Exit codes: 0 done, 1 nothing was published, 2 bad usage or a recording that cannot be written or mended.
    """
    try:
        if mend is not None:
            _show_repair(repair(mend), as_json)
            return
        selection = Selection(tuple(namespace or ("/hand",)), tuple(topics or ()), rosout)
        path = out or Path(time.strftime("hand_%Y-%m-%d_%H-%M-%S"))
        summary = _record(RecordOptions(path, storage, selection, duration), quiet=as_json)
    except (ValueError, OSError) as error:
        print(f"hand record: {error}", file=sys.stderr)
        raise typer.Exit(2) from error
    print(json.dumps(summary.as_json()) if as_json else _table(summary))
    if not summary.messages:
        print("hand record: nothing was published on the chosen topics", file=sys.stderr)
        raise typer.Exit(1)


def _record(options: RecordOptions, quiet: bool) -> RecordSummary:
    # rclpy is missing on machines that only evaluate recordings; they can still mend and read the help.
    try:
        from hand_recording.node import record as run  # noqa: PLC0415
        from hand_recording.node import stop_signals  # noqa: PLC0415
    except ImportError as error:
        raise ValueError(f"recording needs ROS 2, and {error.name} is not to be found") from error
    console = Console(stderr=True)
    line: AbstractContextManager[Live | None] = nullcontext()
    if console.is_terminal and not quiet:
        line = Live(console=console, transient=True, auto_refresh=False)
    with stop_signals() as stop, line as live:
        return run(options, stop.wait, None if live is None else _shower(live))


def _shower(live: Live) -> Callable[[RecordSummary], None]:
    def show(summary: RecordSummary) -> None:
        rates = ", ".join(f"{t.name.rsplit('/', 1)[-1]} {t.rate_hz:.0f} Hz" for t in summary.topics)
        text = f"{summary.duration_s:6.1f} s  {summary.messages} messages  {summary.bytes / 1e6:.1f} MB  {rates}"
        live.update(Text(text, overflow="ellipsis", no_wrap=True), refresh=True)

    return show


def _table(summary: RecordSummary) -> str:
    """The outcome for people: one line a topic."""
    lines = [f"{summary.path}: {summary.messages} messages in {summary.duration_s:.1f} s"]
    for topic in summary.topics:
        lines.append(
            f"  {topic.name:<28} {topic.messages:>8} messages {topic.rate_hz:8.1f} Hz {topic.bytes:>12} bytes"
            + (f"  {topic.missed} missed" if topic.missed else "")
        )
    lines += [f"  not recorded: {reason}" for reason in summary.skipped.values()]
    return "\n".join(lines)


def _show_repair(outcome: Repair, as_json: bool) -> None:
    if as_json:
        print(json.dumps(outcome.as_json()))
        return
    total = sum(outcome.messages.values())
    if not outcome.changed:
        print(f"{outcome.path}: sound, {total} messages; nothing to mend")
        return
    print(f"{outcome.path}: {total} messages recovered, {outcome.lost_bytes} bytes lost")
    for name, messages in outcome.messages.items():
        print(f"  {name:<28} {messages:>8} messages")
    if outcome.damaged:
        print(f"  the file as it was: {outcome.damaged}")
