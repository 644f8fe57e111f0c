"""`hand check-board`: whether a board on a serial line or a CAN bus works, in numbers and one verdict."""

from __future__ import annotations

import json
import time
from typing import TYPE_CHECKING, Annotated

import typer

from hand_tool.chosen_model import choose_model
from hand_tool.console import progress_bar, running
from hand_tool.options import AsJson, Model, Quiet, Verbose

if TYPE_CHECKING:
    from rich.progress import Progress

    from hand_driver.board import Board
    from hand_driver.board_check import BoardCheck, BoardResult
    from hand_model.description import Hand

READ_S = 0.1
SEND_S = 1.0
"""Time for which set-points are sent."""
SEND_PERIOD_S = 0.02
LIFETIME_S = 0.1
RELEASE_S = 0.6
MAX_TEST_KPA = 50.0


def check_board(
    *,
    serial: Annotated[str | None, typer.Option(help="Serial port of the board, for example /dev/ttyUSB0.")] = None,
    baud: Annotated[int, typer.Option(min=9600, max=12_000_000, help="Bit rate of the serial port [1/s].")] = 1_000_000,
    can: Annotated[str | None, typer.Option(help="Channel of the CAN interface; with slcan its serial port.")] = None,
    can_interface: Annotated[str, typer.Option(help="Interface of python-can, for example slcan.")] = "socketcan",
    can_bitrate: Annotated[
        int, typer.Option(min=10_000, max=1_000_000, help="Bit rate of the CAN bus [1/s].")
    ] = 1_000_000,
    seconds: Annotated[float, typer.Option(min=0.5, max=3600.0, help="Time for which frames are read [s].")] = 3.0,
    listen_only: Annotated[bool, typer.Option(help="Send no set-points at all.")] = False,
    test_joint: Annotated[
        str | None, typer.Option(help="Put a small pressure on this joint; the hand moves, so keep clear of it.")
    ] = None,
    test_kpa: Annotated[float, typer.Option(min=1.0, max=MAX_TEST_KPA, help="That pressure [kPa].")] = 20.0,
    model: Model = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Read a board, send it 0 Pa for a second, and say what is wrong with it. Stop the driver first.

    Example: hand check-board --serial /dev/ttyUSB0

    With --test-joint NAME this joint gets a pressure of --test-kpa, and its sensor must see it. The hand moves.

    Exit codes: 0 the board works, 1 a fault was found, 2 bad usage, bad input or a port that cannot be opened.
    """
    with running("check-board"):
        if (serial is None) == (can is None):
            raise ValueError("give either --serial PORT or --can CHANNEL")
        if listen_only and test_joint is not None:
            raise ValueError("--listen-only sends nothing, so that --test-joint cannot be tested")
        chosen = choose_model(model)
        from hand_driver.board import BoardError, LinkLost, ProtocolMismatch
        from hand_driver.board_check import BoardCheck
        from hand_model.description import load_hand

        hand = load_hand(chosen.path)
        test = _test_of(hand, test_joint, test_kpa)
        check = BoardCheck(hand)
    with running("check-board", errors=(BoardError,)):
        board = _open(hand, serial, baud, can, can_interface, can_bitrate)
        chosen.print(as_json)
        try:
            with progress_bar(as_json) as progress:
                _read(board, check, progress, seconds)
                if not listen_only and not check.result.faults_of_link:
                    _drive(board, hand, check, progress, test)
        except (LinkLost, ProtocolMismatch) as error:
            check.result.faults.append(str(error))
        finally:
            board.close()
    result = check.result
    if as_json:
        print(json.dumps(result.as_json()))
    else:
        _print(result)
    if result.faults:
        raise typer.Exit(1)


def _test_of(hand: Hand, joint: str | None, kpa: float) -> tuple[int, float] | None:
    """Number of the joint to test and its pressure [Pa]. ValueError for an unknown joint."""
    if joint is None:
        return None
    if joint not in hand.joints:
        raise ValueError(f"--test-joint is {joint!r}; joints are {', '.join(hand.joints)}")
    return hand.joints.index(joint), kpa * 1e3


def _open(hand: Hand, serial: str | None, baud: int, can: str | None, interface: str, bitrate: int) -> Board:
    """The board; exactly one of serial and can is given. BoardError: one line."""
    from hand_driver.can_board import CanBoard
    from hand_driver.serial_board import SerialBoard

    if serial is not None:
        return SerialBoard(serial, hand.channel_count, baud)
    return CanBoard(interface, can or "", hand.channel_count, bitrate)


def _read(board: Board, check: BoardCheck, progress: Progress, seconds: float) -> None:
    """First phase: frames without set-points."""
    task = progress.add_task("reading", total=seconds)
    begun_s = time.monotonic()
    while (passed_s := time.monotonic() - begun_s) < seconds:
        frame = board.read(READ_S)
        if frame is not None:
            check.read(frame)
        progress.update(task, completed=passed_s)
    check.finish_reading(board.counters, board.protocol, seconds)
    progress.remove_task(task)


def _drive(board: Board, hand: Hand, check: BoardCheck, progress: Progress, test: tuple[int, float] | None) -> None:
    """Second phase: harmless set-points. Third phase: none, until the board must have vented."""
    import numpy as np

    pressure_pa = np.zeros(hand.valve_count)
    if test is not None:
        pressure_pa[test[0]] = test[1]
    task = progress.add_task("set-points", total=SEND_S + RELEASE_S)
    begun_s, sent_s = time.monotonic(), -1.0
    while (passed_s := time.monotonic() - begun_s) < SEND_S + RELEASE_S:
        if passed_s < SEND_S and passed_s - sent_s >= SEND_PERIOD_S:
            sent_s = passed_s
            now_ns = time.monotonic_ns()
            check.sent(board.write(pressure_pa, LIFETIME_S) or 0, pressure_pa, LIFETIME_S, now_ns)
        frame = board.read(min(READ_S, SEND_PERIOD_S))
        if frame is not None:
            (check.driven if passed_s < SEND_S else check.released)(frame)
        progress.update(task, completed=passed_s)
    check.finish(test)


def _print(result: BoardResult) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    if result.channels:
        table = Table(box=None, pad_edge=False)
        for title in ("channel", "measures", "volts", "noise [mV]", ""):
            table.add_column(title, justify="right" if title in ("channel", "volts", "noise [mV]") else "left")
        for channel in result.channels:
            style = "" if channel.verdict == "ok" else "bold red"
            cells = (f"{channel.volts:.4f}", f"{channel.noise_v * 1e3:.2f}", Text(channel.verdict, style))
            table.add_row(str(channel.number), channel.measures, *cells)
        console.print(table)
    for name, value in result.summary().items():
        console.print(f"{name:<12} {value}", highlight=False, soft_wrap=True)
    for remark in result.remarks:
        console.print(f"note: {remark}", highlight=False, soft_wrap=True, markup=False)
    for fault in result.faults:
        console.print(Text(f"fault: {fault}", "bold red"), highlight=False, soft_wrap=True)
    count = len(result.faults)
    verdict = "the board works" if not count else f"{count} fault{'s' if count > 1 else ''} found"
    console.print(f"verdict: {verdict}", highlight=False)
