"""Absurd commands against the checks that every message passes: each is refused whole, or stays within all limits.

Joint commands, trajectories and grasps go to a controller in motion; valve commands and sensor messages go, as bytes,
to the readers of the driver and of the controller. Refusing must cost little: its CPU time is the worst of each result.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from hand_control.controller import Controller, Times
from hand_control.grasps import load_grasps
from hand_control.inputs import JointInput
from hand_driver.set_points import MAX_LIFETIME_S, CommandReader, RefusedError
from hand_messages.cdr import Layout
from hand_messages.commands import Header, read_joint_command, read_trajectory
from hand_messages.layouts import CONTACT_FORCES, JOINT_PRESSURES, JOINT_STATE, VALVE_COMMAND
from hand_ros.memory import spare_collections
from validation.faults.closed_loop import CONFIG, VirtualHand, description
from validation.faults.result import FaultResult, Size, Tally

FAMILY = "commands"
NOT_FINITE = (math.nan, math.inf, -math.inf)
HUGE = 100_000
"""Number of entries of a huge list."""
MOST_CPU_S = 0.02
"""CPU time that refusing a message may take; the warning for late sensor data comes after the same time."""
REPEATS = 3
"""Further times that a command is offered which took longer."""
MOST_LETTERS = 2000
"""Length of a line that names a refusal."""
NS = 1_000_000_000
MESSAGES = (
    ("builtin_interfaces", "Time"), ("builtin_interfaces", "Duration"), ("std_msgs", "Header"),
    ("trajectory_msgs", "JointTrajectory"), ("trajectory_msgs", "JointTrajectoryPoint"),
)  # fmt: skip
Values = list[float]


def run(size: Size, seed: int) -> list[FaultResult]:
    """At least 10^4 commands in all; quick: 10^3."""
    spare_collections()  # as a node does; otherwise a collection of all that this process holds counts as refusing
    return [
        joint_commands(size.of(400, 6_000), seed),
        trajectories(size.of(200, 4_000), seed),
        extreme_trajectories(size.of(16, 400), seed),
        grasps(size.of(100, 1_000), seed),
        damaged_commands(size.of(500, 20_000), seed),
        damaged_valve_commands(size.of(1_000, 100_000), seed),
        wrong_valve_commands(size.of(200, 4_000), seed),
        damaged_sensor_messages(size.of(1_000, 100_000), seed),
    ]


def expect_refusal(tally: Tally, name: str, offer: Callable[[], object], allowed: Callable[[], bool]) -> None:
    """Offer a command; it is handled if ValueError names it in one line, or if what was accepted is allowed.

    One that takes too long is offered again: what it costs each time counts, and not a stall of the machine.
    """
    begun_s = time.process_time()
    try:
        offer()
        handled = allowed()
    except ValueError as error:
        handled = "\n" not in str(error) and len(str(error)) < MOST_LETTERS
        name += "" if handled else f": a line of {len(str(error))} letters"
    except Exception as error:  # whatever it is, the node would end
        name, handled = f"{name}: {type(error).__name__}", False
    used_s = time.process_time() - begun_s
    for _ in range(REPEATS):
        if used_s <= MOST_CPU_S:
            break
        begun_s = time.process_time()
        with suppress(Exception):
            offer()
        used_s = min(used_s, time.process_time() - begun_s)
    late = used_s > MOST_CPU_S
    tally.case(f"{name}: {1e3 * used_s:.0f} ms" if late else name, handled and not late, None, 1e3 * used_s)


class Driven:
    """A hand in motion that is checked after each command."""

    def __init__(self, seed: int, frames: int = 3) -> None:
        """Move it; check it over a number of frames."""
        self._frames = frames
        self.outside_rad = 0.0
        self.hand = VirtualHand(seed)
        self.hand.move(40.0)
        self.hand.run(0.3)
        self._low = description().limits.low_rad - 1e-6
        self._high = description().limits.high_rad + 1e-6

    def __call__(self) -> bool:
        """Whether references and set-points are within their limits over the next frames."""
        for _ in range(self._frames):
            self.hand.step()
            tick = self.hand.tick
            assert tick is not None
            outside = np.maximum(tick.reference - self._high, self._low - tick.reference)
            self.outside_rad = max(self.outside_rad, float(outside.max()))
        return self.outside_rad <= 0.0 and self.hand.worst_excess_pa <= 0.0

    def joint_command(self, raw: bytes) -> None:
        """Read and follow a serialized joint command."""
        message = read_joint_command(raw)
        times = Times(stamp_ns(message.header), self.hand.now_ns, self.hand.now_ns)
        self.controller.command(times, message.name, message.position, message.effort)

    def trajectory(self, raw: bytes) -> None:
        """Read and follow a serialized trajectory."""
        message = read_trajectory(raw, len(description().joints))
        times = Times(stamp_ns(message.header), self.hand.now_ns, self.hand.now_ns)
        points = [
            (point.time_from_start.sec + point.time_from_start.nanosec * 1e-9, point.positions, point.velocities)
            for point in message.points
        ]
        self.controller.trajectory(times, message.joint_names, points)

    def refresh(self) -> None:
        """Drive again if a command has tripped the hand."""
        if self.hand.vented:
            self.hand.controller.reset()
            self.hand.controller.enable(True)
            self.hand.run(0.1)

    @property
    def controller(self) -> Controller:
        """Its controller."""
        return self.hand.controller


def stamp_ns(header: Header) -> int:
    """The stamp of a header [ns]."""
    return header.stamp.sec * NS + header.stamp.nanosec


def number(rng: np.random.Generator, *ordinary: float) -> float:
    """A number [any unit] that no command should hold, or one of the ordinary numbers that are wrong here."""
    return float(rng.choice([*NOT_FINITE, 1e308, -1e308, 1e9, -1e9, 1e3, -1e3, *ordinary]))


def names_and_values(rng: np.random.Generator, joints: Sequence[str]) -> tuple[list[str], Values, Values]:
    """A list of joints, positions and efforts with at least one thing wrong."""
    count = int(rng.integers(1, len(joints) + 1))
    names = [str(name) for name in rng.permutation(list(joints))[:count]]
    position = rng.uniform(0.0, 1.0, count).tolist()
    effort: Values = rng.uniform(0.0, 0.3, count).tolist() if rng.random() < 0.5 else []
    at = int(rng.integers(count))
    way = int(rng.integers(8))
    if way == 0:
        position[at] = number(rng, 5.0, -5.0)
    elif way == 1:
        effort = [0.1] * count
        effort[at] = float(rng.choice([math.inf, -math.inf, -1.0, 1e9, 1e308]))
    elif way == 2:
        names[at] = str(rng.choice(["", "elbow", "index_proximal ", "INDEX_PROXIMAL", "\x00", "a" * 10_000]))
    elif way == 3:
        names.append(names[0])
        position.append(0.5)
        effort = []
    elif way == 4:
        position = position + [0.1] * int(rng.integers(1, 40))
    elif way == 5:
        position = position[:-1]
    elif way == 6:
        effort = [0.1] * (count + int(rng.integers(1, 40)))
    else:
        names, position, effort = [], [], []
    return names, position, effort


def absurd_stamp(rng: np.random.Generator, now_ns: int) -> int:
    """A stamp of another time [ns]."""
    return int(rng.choice([1, now_ns - NS, now_ns + NS, 2 * now_ns, (1 << 62), now_ns - 600_000_000]))


def joint_commands(cases: int, seed: int) -> FaultResult:
    """Commands with values, names, lengths or stamps that no command may have."""
    rng = np.random.default_rng([seed, 20])
    tally = Tally(FAMILY, "joint command", seed, "ms CPU")
    driven = Driven(seed)
    for case in range(cases):
        names, position, effort = names_and_values(rng, description().joints)
        stamp_ns = 0
        if case % 9 == 8:
            names, position, effort = ["index_proximal"], [0.5], []
            stamp_ns = absurd_stamp(rng, driven.hand.now_ns)
        times = Times(stamp_ns, driven.hand.now_ns, driven.hand.now_ns)
        what = f"case {case}: {names[:2]} {position[:2]} {effort[:2]}"
        expect_refusal(
            tally,
            what,
            lambda times=times, names=names, position=position, effort=effort: driven.controller.command(  # type: ignore[misc]
                times, names, position, effort
            ),
            driven,
        )
        driven.refresh()
    tally.case("limits afterwards", driven())
    return tally.result()


def trajectories(cases: int, seed: int) -> FaultResult:
    """Trajectories with times, positions, velocities or lengths that none may have."""
    rng = np.random.default_rng([seed, 21])
    tally = Tally(FAMILY, "trajectory", seed, "ms CPU")
    driven = Driven(seed + 1)
    for case in range(cases):
        names, points = absurd_trajectory(rng)
        stamp_ns = absurd_stamp(rng, driven.hand.now_ns) if case % 9 == 8 else 0
        times = Times(stamp_ns, driven.hand.now_ns, driven.hand.now_ns)
        expect_refusal(
            tally,
            f"case {case}: {names[:2]} {str(points[:2])[:80]}",
            lambda times=times, names=names, points=points: driven.controller.trajectory(times, names, points),  # type: ignore[misc]
            lambda: False,
        )
        driven.refresh()
    tally.case("limits afterwards", driven())
    return tally.result()


def absurd_trajectory(rng: np.random.Generator) -> tuple[list[str], list[tuple[float, Values, Values]]]:
    """Joints and points (time [s], positions [rad], velocities [rad/s]) with something wrong or extreme."""
    names = ["index_proximal", "ring_distal"]
    count = int(rng.integers(1, 6))
    starts = np.sort(rng.uniform(0.01, 1.0, count))
    points = [(float(t), rng.uniform(0.0, 1.5, 2).tolist(), rng.uniform(-3.0, 3.0, 2).tolist()) for t in starts]
    at = int(rng.integers(count))
    moment, position, velocity = points[at]
    way = int(rng.integers(8))
    if way == 0:
        points[at] = (moment, [number(rng, 5.0, -5.0), 0.5], velocity)
    elif way == 1:
        points[at] = (moment, position, [number(rng), 0.5])
    elif way == 2:
        points[at] = (float(rng.choice([*NOT_FINITE, -1.0, 1e18])), position, velocity)
    elif way == 3:
        points[at] = (moment, position[:1], velocity)
    elif way == 4:
        points = points + [(moment, position, velocity)] * 2
    elif way == 5:
        points[at] = (moment, position, velocity[:1])
    elif way == 6:
        names = ["index_proximal", "index_proximal"]
    else:
        points = [(1e-3 * k, [0.5, 0.5], []) for k in range(20_000 if rng.random() < 0.2 else 5_001)]
    return names, points


def extreme_trajectories(cases: int, seed: int) -> FaultResult:
    """The fastest motions between the limits that the check accepts: the reference must stay within the limits."""
    rng = np.random.default_rng([seed, 26])
    tally = Tally(FAMILY, "trajectory at the limits, accepted", seed, "deg outside")
    limits = description().limits
    low, high = float(limits.low_rad.max()), float(limits.high_rad.min())
    driven = Driven(seed + 3, 120)
    for case in range(cases):
        span_s, fast = float(rng.choice([0.01, 0.05, 0.25, 0.5])), float(rng.choice([0.0, 3.0, 20.0, 99.0]))
        speed = [fast, -fast] if fast or case % 2 else []
        points = [(span_s * (k + 1), [(low, high)[k % 2], (high, low)[k % 2]], speed) for k in range(case % 4 + 1)]
        driven.outside_rad = 0.0
        with suppress(ValueError):  # refusing one is also right
            driven.controller.trajectory(driven.hand.times, ["index_proximal", "ring_distal"], points)
        handled = driven()
        tally.case(f"every {span_s:g} s at {fast:g} rad/s", handled, None, float(np.degrees(driven.outside_rad)))
        driven.refresh()
    return tally.result()


def grasps(cases: int, seed: int) -> FaultResult:
    """Grasps of a closure or torque that none may have."""
    rng = np.random.default_rng([seed, 22])
    tally = Tally(FAMILY, "grasp", seed, "ms CPU")
    driven = Driven(seed + 2)
    shapes = list(load_grasps(CONFIG / "grasps.yaml", description()).values())
    for case in range(cases):
        closure, torque_nm = float(rng.uniform(0.0, 1.0)), float(rng.uniform(0.0, 0.3))
        if case % 2:
            closure = float(rng.choice([*NOT_FINITE, -1e-9, 1.0 + 1e-9, 1e308]))
        else:
            torque_nm = float(rng.choice([math.inf, -math.inf, -1e-9, 0.6 + 1e-9, 1e308]))
        shape = shapes[int(rng.integers(len(shapes)))]
        expect_refusal(
            tally,
            f"closure {closure:g}, torque {torque_nm:g}",
            lambda shape=shape, closure=closure, torque_nm=torque_nm: driven.controller.grasp(  # type: ignore[misc]
                shape, closure, torque_nm, driven.hand.now_ns
            ),
            lambda: False,
        )
    tally.case("limits afterwards", driven())
    return tally.result()


def damaged(raw: bytes, rng: np.random.Generator) -> bytes:
    """A serialized message with damage: DDS has its own checksum, so that this stands for a faulty sender."""
    data = bytearray(raw)
    way = int(rng.integers(6))
    at = int(rng.integers(len(data)))
    if way == 0:
        data[at] ^= 1 << int(rng.integers(8))
    elif way == 1:
        count = int(rng.integers(1, 17))
        data[at : at + count] = rng.bytes(len(data[at : at + count]))
    elif way == 2:
        del data[at:]
    elif way == 3:  # a length field that claims much
        data[at : at + 4] = int(rng.choice([0xFFFFFFFF, 0x7FFFFFFF, 1_000_000, 0])).to_bytes(4, "little")
    elif way == 4:
        data = bytearray(rng.bytes(int(rng.integers(0, 2 * len(raw)))))
    else:
        data[at:at] = rng.bytes(int(rng.integers(1, 64)))
    return bytes(data)


def damaged_valve_commands(cases: int, seed: int) -> FaultResult:
    """Bytes of valve commands with damage: refused, or pressures, lifetime and age within their limits."""
    rng = np.random.default_rng([seed, 23])
    tally = Tally(FAMILY, "valve command, damaged bytes", seed, "ms CPU")
    hand, now_ns = description(), 5_000 * NS
    reader = CommandReader(hand)
    raw = Layout(VALVE_COMMAND, "hand", hand.joints).encode(
        now_ns, lifetime_ns=100_000_000, pressure=rng.uniform(0.0, 5e5, len(hand.joints))
    )
    for case in range(cases):
        data = damaged(raw, rng)
        found: list[Any] = []
        expect_refusal(
            tally,
            f"case {case}: {data[:40].hex()}",
            lambda data=data, found=found: found.append(reader.read(data, now_ns)),  # type: ignore[misc]
            lambda found=found: _within(found[0], now_ns),  # type: ignore[misc]
        )
    try:
        reader.read(raw, now_ns)
    except RefusedError as error:
        tally.case(f"the good command afterwards is refused: {error}", False)
    return tally.result()


def _within(set_points: Any, now_ns: int) -> bool:
    """Whether set-points may be sent to the valves."""
    hand = description()
    pressure = set_points.pressure_pa
    fits = pressure.shape == (hand.valve_count,) and bool(np.isfinite(pressure).all())
    fits = fits and bool(((pressure >= 0.0) & (pressure <= hand.limits.max_pressure_pa)).all())
    age_s = (now_ns - set_points.stamp_ns) * 1e-9
    return fits and 0.0 < set_points.lifetime_s <= MAX_LIFETIME_S and -0.1 <= age_s <= set_points.lifetime_s


def wrong_valve_commands(cases: int, seed: int) -> FaultResult:
    """Well-formed valve commands of wrong names, lengths, pressures, lifetimes and stamps; huge ones, too."""
    rng = np.random.default_rng([seed, 24])
    tally = Tally(FAMILY, "valve command, wrong content", seed, "ms CPU")
    hand, now_ns = description(), 5_000 * NS
    reader = CommandReader(hand)
    for case in range(cases):
        data = absurd_valve_command(rng, list(hand.joints), now_ns)
        expect_refusal(
            tally,
            f"case {case}: {len(data)} bytes",
            lambda data=data: reader.read(data, now_ns),  # type: ignore[misc]
            lambda: False,
        )
    return tally.result()


def absurd_valve_command(rng: np.random.Generator, joints: list[str], now_ns: int) -> bytes:
    """The bytes of a valve command that must be refused."""
    pressure = rng.uniform(0.0, 5e5, len(joints)).tolist()
    names, stamp_ns, lifetime_ns = list(joints), now_ns, 100_000_000
    at = int(rng.integers(len(joints)))
    way = int(rng.integers(8))
    if way == 0:
        pressure[at] = float(rng.choice([*NOT_FINITE, -1.0, 600_001.0, 1e308]))
    elif way == 1:
        names[at] = str(rng.choice(["", "elbow", names[at - 1]]))
    elif way == 2:
        pressure = pressure[:-1] if at % 2 else [*pressure, 0.0]
    elif way == 3:
        lifetime_ns = int(rng.choice([0, -1, 2 * NS, -NS]))
    elif way == 4:
        stamp_ns = int(rng.choice([0, now_ns - NS, now_ns + NS]))
    elif way == 5:
        names, pressure = names[:-1], pressure[:-1]
    elif way == 6:
        names, pressure = [], []
    else:
        if rng.random() < 0.5:
            return huge_valve_command(now_ns)
        names, pressure = [f"joint_{k}" for k in range(200)], [0.0] * 200
    layout = Layout(VALVE_COMMAND, "hand", names, {"pressure": len(pressure)})
    values: dict[str, Any] = {"pressure": pressure} if pressure else {}
    return layout.encode(stamp_ns, lifetime_ns=lifetime_ns, **values)


@cache
def huge_layout() -> Layout:
    """The layout of a valve command of HUGE names."""
    return Layout(VALVE_COMMAND, "hand", [f"joint_{k}" for k in range(HUGE)])


def huge_valve_command(now_ns: int) -> bytes:
    """A valve command of HUGE names."""
    return huge_layout().encode(now_ns, lifetime_ns=100_000_000, pressure=np.zeros(HUGE))


def damaged_commands(cases: int, seed: int) -> FaultResult:
    """Bytes of joint commands and trajectories with damage, or of 20 MB: refused, or a motion within the limits."""
    rng = np.random.default_rng([seed, 27])
    tally = Tally(FAMILY, "joint command and trajectory, damaged bytes", seed, "ms CPU")
    driven = Driven(seed + 4, 1)
    joints = list(description().joints)
    good = Layout(JOINT_STATE, "", joints[:3], {"velocity": 0, "effort": 0}).encode(0, position=[0.3, 0.4, 0.5])
    path = trajectory_bytes_of(joints[:2], [(0.2, [0.3, 0.4]), (0.4, [0.5, 0.6]), (0.6, [0.4, 0.2])])
    for case in range(cases):
        raw = bytes(20_000_000) if case % 500 == 3 else damaged((good, path)[case % 2], rng)
        offer = driven.joint_command if case % 2 == 0 else driven.trajectory
        what = f"case {case}: {len(raw)} bytes {raw[:40].hex()}"
        expect_refusal(tally, what, lambda raw=raw, offer=offer: offer(raw), driven)  # type: ignore[misc]
        driven.refresh()
    driven.joint_command(good)
    driven.trajectory(path)
    tally.case("limits afterwards", driven())
    return tally.result()


def trajectory_bytes_of(joints: list[str], points: list[tuple[float, Values]]) -> bytes:
    """A serialized joint_trajectory of points (time [s], positions [rad])."""
    types = get_typestore(Stores.ROS2_JAZZY)
    make = {name: types.types[f"{kind}/msg/{name}"] for kind, name in MESSAGES}
    none = np.zeros(0)
    made = [
        make["JointTrajectoryPoint"](np.array(angle), none, none, none, make["Duration"](0, int(time_s * 1e9)))
        for time_s, angle in points
    ]
    header = make["Header"](make["Time"](0, 0), "")
    message = make["JointTrajectory"](header, joints, made)
    return bytes(types.serialize_cdr(message, "trajectory_msgs/msg/JointTrajectory"))


def damaged_sensor_messages(cases: int, seed: int) -> FaultResult:
    """Bytes of the driver's topics with damage: ValueError, or arrays of the hand's length."""
    rng = np.random.default_rng([seed, 25])
    tally = Tally(FAMILY, "sensor message, damaged bytes", seed, "ms CPU")
    hand = description()
    topics = []
    for spec, names, fields in (
        (JOINT_STATE, hand.joints, ("position", "velocity", "effort")),
        (JOINT_PRESSURES, hand.joints, ("pressure",)),
        (CONTACT_FORCES, hand.sensors.sites, ("force",)),
    ):
        values = {field: rng.uniform(0.0, 1.0, len(names)) for field in fields}
        topics.append((JointInput(spec, names, fields[:2]), Layout(spec, "hand", names).encode(NS, **values)))
    for case in range(cases):
        reader, raw = topics[case % len(topics)]
        data = damaged(raw, rng)
        found: list[Any] = []
        expect_refusal(
            tally,
            f"case {case}: {data[:40].hex()}",
            lambda data=data, reader=reader, found=found: found.append(reader.read(data)),  # type: ignore[misc]
            lambda found=found: all(len(values) for values in found[0][1]),  # type: ignore[misc]
        )
    for reader, raw in topics:
        expect_refusal(tally, "good afterwards", lambda reader=reader, raw=raw: reader.read(raw), lambda: True)  # type: ignore[misc]
    return tally.result()
