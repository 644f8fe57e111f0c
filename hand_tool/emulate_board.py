"""`hand emulate-board`: the simulated hand as real bytes on a serial line or a CAN bus."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from hand_tool import interrupts
from hand_tool.chosen_model import choose_model
from hand_tool.console import running
from hand_tool.options import Model, Quiet, Verbose

if TYPE_CHECKING:
    from hand_model.description import Hand
    from hand_sim.emulator import BoardEndpoint, Emulator

SLCAN = "slcan"
UNPLUGGED_S = 1.5
"""Duration of the disconnection that SIGUSR1 starts."""


def emulate_board(
    *,
    serial: Annotated[str | None, typer.Option(help="Serve a serial port at this path; auto: any.")] = None,
    can: Annotated[str | None, typer.Option(help="Serve a CAN channel; with slcan the path of a serial port.")] = None,
    can_interface: Annotated[str, typer.Option(help="slcan, or any interface of python-can.")] = SLCAN,
    can_bitrate: Annotated[int, typer.Option(help="Bit rate of the CAN bus [1/s].")] = 1_000_000,
    model: Model = None,
    seed: Annotated[int, typer.Option(help="Seed of sensor noise and random faults.")] = 0,
    drop: Annotated[float, typer.Option(help="Probability of losing a frame, 0 to 1.")] = 0.0,
    corrupt: Annotated[float, typer.Option(help="Probability of damaging a frame, 0 to 1.")] = 0.0,
    delay_ms: Annotated[float, typer.Option("--delay", help="Extra latency of every frame in ms.")] = 0.0,
    disconnect: Annotated[
        list[str] | None, typer.Option(help="AT:FOR, disconnect after AT seconds for FOR seconds; may be repeated.")
    ] = None,
    stuck: Annotated[
        list[str] | None, typer.Option(help="CHANNEL or CHANNEL=COUNT, a channel that sticks; may be repeated.")
    ] = None,
    protocol: Annotated[int, typer.Option(min=1, max=2, help="Highest protocol version of the board.")] = 2,
    repeat: Annotated[float, typer.Option(help="Probability of sending an earlier frame once more, 0 to 1.")] = 0.0,
    deaf: Annotated[
        list[str] | None, typer.Option(help="AT:FOR, take no set-points after AT seconds for FOR; may be repeated.")
    ] = None,
    deaf_valve: Annotated[
        list[int] | None, typer.Option(help="A valve that stays at 0 Pa, by its number; may be repeated.")
    ] = None,
    lose: Annotated[float, typer.Option(help="Probability of losing a packet of set-points, 0 to 1.")] = 0.0,
    restart: Annotated[
        list[float] | None, typer.Option(help="Restart the board after this many seconds; may be repeated.")
    ] = None,
    clock_error: Annotated[float, typer.Option(help="Relative error of the board's clock: 0.01 is 1 % fast.")] = 0.0,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Serve the simulated hand as the bytes a board would send, until Ctrl-C.

    Example: hand emulate-board --serial /tmp/hand_board --drop 0.01 --disconnect 10:2

    Then: hand up --serial /tmp/hand_board

    SIGUSR1 disconnects the board for 1.5 s, SIGUSR2 restarts it: kill -USR1 PID

    Exit codes: 0 ended by Ctrl-C or SIGTERM, 2 bad usage, bad input or a port that cannot be made.
    """
    with running("emulate-board"):
        if (serial is None) == (can is None):
            raise ValueError("give either --serial PATH or --can CHANNEL")
        chosen = choose_model(model)
        from hand_model.description import load_hand

        hand = load_hand(chosen.path)
        from hand_driver.board import BoardError
        from hand_sim.emulator import Emulator
        from hand_sim.faults import Faults, check_valves, parse_disconnect, parse_stuck
        from hand_sim.plant import SimulatedPlant

        full_scale = hand.sensors.adc.full_scale
        sticking = dict(parse_stuck(text, hand.channel_count, full_scale) for text in stuck or ())
        outages = tuple(parse_disconnect(text) for text in disconnect or ())
        faults = Faults(
            drop,
            corrupt,
            delay_ms * 1e-3,
            outages,
            sticking,
            repeat=repeat,
            deaf=tuple(parse_disconnect(text, "deaf") for text in deaf or ()),
            deaf_valves=check_valves(deaf_valve or (), hand.valve_count),
            lose=lose,
            restart=tuple(restart or ()),
            clock_error=clock_error,
        )
        plant = SimulatedPlant(hand, hand.rate_hz, seed)
    with running("emulate-board", errors=(BoardError,)):
        open_endpoint = _endpoint(serial, can, can_interface, can_bitrate, protocol)
        emulator = Emulator(plant, open_endpoint, hand.rate_hz, hand.valve_count, faults, seed=seed)
        chosen.print()
        _serve(emulator, hand)


def _endpoint(
    serial: str | None, can: str | None, interface: str, bitrate: int, protocol: int
) -> Callable[[], BoardEndpoint]:
    """What opens the board's end of the link; exactly one of serial and can is given."""
    from hand_sim.can_endpoint import CanEndpoint, SlcanEndpoint
    from hand_sim.serial_endpoint import SerialEndpoint

    if serial is not None:
        return lambda: SerialEndpoint(serial, protocol=protocol)
    channel = can or ""
    if interface == SLCAN:
        return lambda: SlcanEndpoint(channel, protocol)
    return lambda: CanEndpoint(interface, channel, bitrate, protocol=protocol)


def _serve(emulator: Emulator, hand: Hand) -> None:
    """Serve until SIGINT or SIGTERM; raises OSError or BoardError where the port cannot be opened again."""
    from hand_ros.memory import lock_memory, spare_collections

    stopped = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    interrupts.release()
    signal.signal(signal.SIGUSR1, lambda *_: emulator.unplug(UNPLUGGED_S))
    signal.signal(signal.SIGUSR2, lambda *_: emulator.restart())
    lock_memory()
    spare_collections()
    print(f"ready: {emulator.description}, {hand.channel_count} channels, {hand.rate_hz:g} Hz", flush=True)
    try:
        emulator.run(stopped.is_set)
    finally:
        emulator.close()


if __name__ == "__main__":
    typer.run(emulate_board)
