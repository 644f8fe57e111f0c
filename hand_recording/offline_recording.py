"""A recording of the simulated hand without any node: set-points in, the bag a live session would leave out."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_recording.replay import Replay, write_replay
from hand_sim.offline import Commands, Ticks
from hand_sim.plant import HandPlant

START_NS = 1_700_000_000_000_000_000
LIFETIME_S = 0.1


def simulate_recording(hand: Hand, set_point_pa: Array, start_ns: int = START_NS) -> Replay:
    """A vented hand that follows set-points (T, joints) [Pa], one a frame; each is sent just after its frame."""
    period_s = 1.0 / hand.rate_hz
    plant = HandPlant(hand, period_s)
    states = np.concatenate([plant.state[None], plant.advance(set_point_pa[:-1])])
    ticks = Ticks(np.arange(len(states)), period_s, start_ns)
    # A set-point in force from tick k on was sent between ticks k - 1 and k.
    sent_ns = ticks.stamp_ns - round(0.8e9 * period_s)
    commands = Commands(sent_ns, set_point_pa, np.full(len(states), LIFETIME_S))
    return Replay(hand, "/hand", ticks, states, commands)


def record_offline(hand: Hand, set_point_pa: Array, out: Path, seed: int, storage: str = "mcap") -> Iterator[float]:
    """Write that recording with sensor noise from the seed; yields the share done."""
    yield from write_replay(simulate_recording(hand, set_point_pa), out, storage, seed)
