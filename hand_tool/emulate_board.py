"""`hand emulate-board`: the simulated hand as real bytes on a serial line or a CAN bus."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from hand_driver.board import BoardError
from hand_model.description import Hand, load_hand
from hand_recording.installed import default_model
from hand_sim.can_endpoint import CanEndpoint, SlcanEndpoint
from hand_sim.emulator import BoardEndpoint, Emulator
from hand_sim.faults import Faults, parse_disconnect, parse_stuck
from hand_sim.plant import SimulatedPlant
from hand_sim.serial_endpoint import SerialEndpoint

SLCAN = "slcan"
UNPLUGGED_S = 1.5
"""How long SIGUSR1 takes the cable away."""


def emulate_board(
    serial: Annotated[str | None, typer.Option(help="Serve a serial port at this path; auto: say which.")] = None,
    can: Annotated[str | None, typer.Option(help="Serve a CAN channel; with slcan the path of a serial port.")] = None,
    can_interface: Annotated[str, typer.Option(help="slcan, or any interface of python-can.")] = SLCAN,
    can_bitrate: Annotated[int, typer.Option(help="Bit rate of the CAN bus [1/s].")] = 1_000_000,
    model: Annotated[Path | None, typer.Option(help="hand.yaml to simulate. Default: the installed one.")] = None,
    seed: Annotated[int, typer.Option(help="Of sensor noise and random faults.")] = 0,
    drop: Annotated[float, typer.Option(help="Probability of losing a frame, 0 to 1.")] = 0.0,
    corrupt: Annotated[float, typer.Option(help="Probability of damaging a frame, 0 to 1.")] = 0.0,
    delay_ms: Annotated[float, typer.Option("--delay", help="Extra latency of every frame in ms.")] = 0.0,
    disconnect: Annotated[
        list[str] | None, typer.Option(help="AT:FOR, unplug after AT seconds for FOR seconds; may be repeated.")
    ] = None,
    stuck: Annotated[
        list[str] | None, typer.Option(help="CHANNEL or CHANNEL=COUNT, a channel that sticks; may be repeated.")
    ] = None,
) -> None:
    """Serve the simulated hand as the bytes a board would send, until Ctrl-C.

    Example: hand emulate-board --serial /tmp/hand_board --drop 0.01 --disconnect 10:2

    Then: ros2 run fluidic_hand driver --ros-args -p serial_port:=/tmp/hand_board

    SIGUSR1 pulls the cable for 1.5 s at any time: kill -USR1 PID

    Exit codes: 0 ended by Ctrl-C or SIGTERM, 2 bad usage, bad input or a port that cannot be made.
    """
    try:
        hand = load_hand(model or default_model())
        full_scale = hand.sensors.adc.full_scale
        sticking = dict(parse_stuck(text, hand.channel_count, full_scale) for text in stuck or ())
        faults = Faults(
            drop, corrupt, delay_ms * 1e-3, tuple(parse_disconnect(text) for text in disconnect or ()), sticking
        )
        open_endpoint = _endpoint(serial, can, can_interface, can_bitrate)
        plant = SimulatedPlant(hand, hand.rate_hz, seed)
        emulator = Emulator(plant, open_endpoint, hand.rate_hz, hand.valve_count, faults, seed=seed)
    except (ValueError, OSError, BoardError) as error:
        print(f"hand emulate-board: {error}", file=sys.stderr)
        raise typer.Exit(2) from None
    _serve(emulator, hand)


def _endpoint(serial: str | None, can: str | None, interface: str, bitrate: int) -> Callable[[], BoardEndpoint]:

    if serial is not None and can is None:
        return lambda: SerialEndpoint(serial)
    if can is not None and serial is None:
        if interface == SLCAN:
            return lambda: SlcanEndpoint(can)
        return lambda: CanEndpoint(interface, can, bitrate)
    raise ValueError("give either --serial PATH or --can CHANNEL")


def _serve(emulator: Emulator, hand: Hand) -> None:
    stopped = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    signal.signal(signal.SIGUSR1, lambda *_: emulator.unplug(UNPLUGGED_S))
    print(f"ready: {emulator.description}, {hand.channel_count} channels, {hand.rate_hz:g} Hz", flush=True)
    try:
        emulator.run(stopped.is_set)
    except (OSError, BoardError) as error:  # plugged in again, and the place is taken
        print(f"hand emulate-board: {error}", file=sys.stderr)
        raise typer.Exit(2) from None
    finally:
        emulator.close()


if __name__ == "__main__":
    typer.run(emulate_board)
