"""The simulated board's rules, and the offline plant that follows the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_driver.board import LinkLost, Status
from hand_driver.wire import SamplePayload, SetPointPayload
from hand_model.description import load_hand
from hand_sim.board import SimulatedBoard
from hand_sim.emulator import BoardEndpoint, Emulator
from hand_sim.faults import FaultError, Faults, FaultState, parse_disconnect, parse_stuck
from hand_sim.offline import Commands, Measured, replay, set_points_in_force
from hand_sim.plant import CREEP, OMEGA, PHI, HandPlant, P, SimulatedPlant, resting_state
from hand_sim.sample_ticks import rebuild_ticks

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
COUNT = len(HAND.joints)
PERIOD_NS = 5_000_000


class Time:
    """A clock that only sleeping moves."""

    def __init__(self) -> None:
        self.ns = 0

    def now(self) -> int:
        return self.ns

    def sleep(self, seconds: float) -> None:
        self.ns += round(seconds * 1e9)


def board(time: Time, speed: float = 1.0) -> SimulatedBoard:
    return SimulatedBoard(SimulatedPlant(HAND, 200.0), 200.0, speed, monotonic_ns=time.now, sleep=time.sleep)


def test_frames_come_at_the_rate_and_are_numbered() -> None:
    """Fails when the sample clock drifts, runs at another speed, or sequence numbers jump."""
    for speed in (1.0, 4.0):
        time = Time()
        made = board(time, speed)
        frames = [made.read(1.0) for _ in range(100)]
        assert [f.sequence for f in frames if f] == list(range(100))
        assert [f.board_time_us for f in frames if f] == [5000 * (k + 1) for k in range(100)]
        assert time.ns == pytest.approx(100 * PERIOD_NS / speed, abs=100_000)


def test_set_points_act_until_their_lifetime_ends() -> None:
    """Fails when a set-point is held beyond its lifetime, or the status VENTED is missing."""
    made = board(Time())
    first = made.read(1.0)
    assert first is not None
    assert Status.VENTED in first.status
    made.write(np.full(COUNT, 2e5), 0.1)
    frames = [made.read(1.0) for _ in range(60)]
    vented = [Status.VENTED in f.status for f in frames if f]
    assert vented == [True] + [False] * 20 + [True] * 39
    assert made._plant.plant.state[0].max() < 2e5 * np.exp(-0.15 / 0.05)


def test_a_host_that_slept_finds_the_hand_moved_on() -> None:
    """Fails when lost time is not simulated, not counted, or a lost command is held beyond its lifetime."""
    time = Time()
    made = board(time)
    made.read(1.0)
    made.write(np.full(COUNT, 2e5), 0.1)
    made.read(1.0)
    time.sleep(1.0)
    frame = made.read(1.0)
    assert frame is not None
    assert frame.board_time_us * 1000 == pytest.approx(time.ns, abs=PERIOD_NS)
    assert made.counters.dropped == pytest.approx(199, abs=1)
    assert Status.VENTED in frame.status
    assert made._plant.plant.state[0].max() < 100.0


def test_a_closed_board_is_lost() -> None:
    """Fails when a closed board still gives frames."""
    made = board(Time())
    made.close()
    with pytest.raises(LinkLost):
        made.read(0.1)


def test_offline_follows_the_board_to_the_last_digit() -> None:
    """Fails when the offline plant applies commands by other rules than the live board."""
    seed = 4
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    made = board(Time())
    stamps, states, sent, pressures = [], [], [], []
    for k in range(1, 401):
        frame = made.read(1.0)
        assert frame is not None
        stamps.append(frame.board_time_us * 1000)
        states.append(made._plant.plant.state)
        if k % 10 < 8 and not 200 < k < 240:  # some periods without a command, one long silence
            pressure = rng.uniform(0.0, 3e5, COUNT)
            made.write(pressure, 0.1)
            sent.append(stamps[-1] + 1_000_000)
            pressures.append(pressure)
    live = np.array(states)
    measured = Measured(
        np.array(stamps),
        HAND.sensors.angle_line.angle_rad(HAND.sensors.hall.ratio(live[:, PHI])),
        live[:, 2],
        live[:, 0],
    )
    commands = Commands(np.array(sent), np.array(pressures), np.full(len(sent), 0.1))
    _, offline = replay(HAND, measured, commands)
    assert np.degrees(np.ptp(live[:, PHI])) > 20.0
    assert np.degrees(np.abs(offline[:, PHI] - live[:, PHI])).max() < 0.01


@pytest.mark.parametrize("creep", [0.0, 0.08, 0.3])
def test_the_creep_a_hand_begins_with_is_found_from_its_motion(creep: float) -> None:
    """Fails when a noisy, moving beginning leaves an error of creep, which stays for minutes."""
    seed = 11
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    state = resting_state(HAND)
    state[CREEP] = creep
    plant = HandPlant(HAND, 0.005, state)
    plant.hold_history(np.full(COUNT, 6e4))
    plant.advance(np.full((200, COUNT), 6e4))
    pressures = np.repeat(rng.uniform(0.5e5, 2.5e5, (16, COUNT)), 250, axis=0)  # a recording that begins in motion
    live = np.concatenate([plant.state[None], plant.advance(pressures)[:-1]])
    stamps = np.arange(len(live), dtype=np.int64) * PERIOD_NS
    seen = HAND.sensors.angle_line.angle_rad(HAND.sensors.hall.ratio(live[:, PHI]))
    measured = Measured(
        stamps,
        seen + rng.normal(0.0, 1.5e-4, seen.shape),
        live[:, OMEGA] + rng.normal(0.0, 0.02, seen.shape),
        live[:, P] + rng.normal(0.0, 100.0, seen.shape),
    )
    commands = Commands(stamps - 1_000_000, pressures, np.full(len(stamps), 0.1))
    _, offline = replay(HAND, measured, commands)
    late = np.degrees(offline[200:, PHI] - live[200:, PHI])
    assert np.ptp(live[:, PHI]) > 0.5
    assert np.sqrt(np.mean(late**2, axis=0)).max() < 0.05


def test_ticks_are_found_again_through_losses_and_drift() -> None:
    """Fails when lost frames or a drifting board clock shift the replay."""
    number = np.delete(np.arange(2000), [5, 6, 700, 1500])
    stamps = (1_000_000_000 + number * PERIOD_NS * (1.0 + 3e-4)).astype(np.int64)
    ticks = rebuild_ticks(stamps, 200.0)
    assert ticks.number.tolist() == number.tolist()
    assert ticks.period_s == pytest.approx(0.005 * (1.0 + 3e-4), rel=1e-7)
    for bad in (stamps[:1], stamps[::-1]):
        with pytest.raises(ValueError, match="ascending"):
            rebuild_ticks(bad, 200.0)


def test_commands_before_the_first_and_after_the_last() -> None:
    """Fails when valves are not vented before the first command and after the last one's lifetime."""
    ticks = rebuild_ticks(np.arange(100) * PERIOD_NS, 200.0)
    commands = Commands(np.array([10 * PERIOD_NS + 1]), np.full((1, 2), 7.0), np.array([0.05]))
    held = set_points_in_force(commands, ticks)[:, 0]
    assert np.flatnonzero(held).tolist() == list(range(11, 21))
    none = Commands(np.array([], np.int64), np.zeros((0, 2)), np.array([]))
    assert not set_points_in_force(none, ticks).any()


class Wire(BoardEndpoint):
    """A port that keeps what is sent and gives one order at the start."""

    def __init__(self, orders: list[SetPointPayload]) -> None:
        self.orders = orders
        self.sent: list[tuple[SamplePayload, bool]] = []
        self.open = True

    @property
    def description(self) -> str:
        return "wire"

    def send(self, sample: SamplePayload, corrupt: bool = False) -> None:
        self.sent.append((sample, corrupt))

    def receive(self) -> list[SetPointPayload]:
        orders, self.orders = self.orders, []
        return orders

    def close(self) -> None:
        self.open = False


def emulate(faults: Faults, ticks: int = 200) -> list[Wire]:
    wires: list[Wire] = []

    def open_port() -> BoardEndpoint:
        wires.append(Wire([SetPointPayload(0, 0.1, np.full(COUNT, 2e5))]))
        return wires[-1]

    emulator = Emulator(SimulatedPlant(HAND, 200.0), open_port, 200.0, COUNT, faults, seed=1)
    for tick in range(1, ticks + 1):
        emulator.tick(tick)
    return wires


def test_the_emulator_vents_by_its_watchdog() -> None:
    """Fails when the emulated board keeps a set-point beyond its lifetime."""
    (wire,) = emulate(Faults())
    vented = [Status.VENTED in sample.status for sample, _ in wire.sent]
    assert vented == [True] + [False] * 20 + [True] * 179


def test_faults_do_what_they_say() -> None:
    """Fails when an injected fault is missing or another one appears."""
    assert 20 < 200 - len(emulate(Faults(drop=0.2))[0].sent) < 65
    assert 20 < sum(corrupt for _, corrupt in emulate(Faults(corrupt=0.2))[0].sent) < 65
    assert len(emulate(Faults(delay_s=0.05))[0].sent) == 190
    before, after = emulate(Faults(disconnect=((0.2, 0.5),)))
    assert not before.open
    assert (len(before.sent), after.sent[0][0].sequence) == (39, 139)
    counts = {int(sample.counts[3]) for sample, _ in emulate(Faults(stuck={3: 65535}))[0].sent}
    assert counts == {65535}
    assert len({int(s.counts[3]) for s, _ in emulate(Faults(stuck={3: None}))[0].sent}) == 1
    assert FaultState(Faults(), 0).dropped() is False


@pytest.mark.parametrize("text", ["", "3", "a:b", "-1:2", "1:0"])
def test_a_wrong_disconnect_is_one_line(text: str) -> None:
    """Fails when a wrong option is taken for something else."""
    with pytest.raises(FaultError, match="disconnect is"):
        parse_disconnect(text)


@pytest.mark.parametrize("text", ["", "x", "33", "-1", "3=70000", "3=x"])
def test_a_wrong_stuck_channel_is_one_line(text: str) -> None:
    """Fails when a channel that does not exist is taken."""
    with pytest.raises(FaultError, match="stuck is"):
        parse_stuck(text, 33, 65535)
