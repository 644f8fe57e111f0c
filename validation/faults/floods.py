"""Floods and second publishers: driver and controller keep their rate and memory, and nobody else commands the hand.

A flood is a process that publishes on one topic as fast as 5 kHz, or messages of a million names, or bytes that are no
message, or that calls one service or action without a pause. Rates and memory are those of the driver and the
controller while the hand moves. Where the flood is a second publisher of what the hand does or measures, the hand is
vented and its frames are not used, so that only the driver is to keep its rate.
"""

from __future__ import annotations

import time

from std_msgs.msg import Empty

from hand_ros.node import QUEUED_QOS
from validation.faults.closed_loop import description
from validation.faults.live import Nodes, TooLateError, User, rss_mb
from validation.faults.processes import CONTROLLER, QUIET_PA, Rig, rig
from validation.faults.result import FaultResult, Size, Tally
from validation.faults.rogue import FULL_PA
from validation.faults.rogue_calls import ACTIONS, SERVICES

FAMILY = "floods"
FLOOD_S = 4.0
MOST_MISSED = 0.05
"""Share of the periods that the driver, and the controller of a hand that is driven on, may miss."""
MOST_GROWTH_MB = 10.0
REACTION_S = 1.0
"""A second publisher must be named, and the hand vented, within this time after its first message."""
RATES_HZ = {"absurd": 5000.0, "malformed": 5000.0, "huge": 2.0}
COMMANDS = ("valve_command", "joint_commands", "joint_trajectory")
SENSORS = ("joint_states", "pressures", "contact_forces", "board_state")
SIGNALS = ("heartbeat", "emergency_stop")
"""Topics whose messages have no content, so that none can be huge."""
DRIVEN_ON = ("joint_commands", "joint_trajectory", "contact_forces", "heartbeat", *SERVICES, *ACTIONS)
"""What anybody may publish or call: the hand is controlled meanwhile, and each frame is answered."""
DRIVER = "simulation"


def run(size: Size, seed: int) -> list[FaultResult]:
    """Every topic and kind; quick: one."""
    with rig("loopback") as running:
        running.nodes.end("recorder")  # it would write the flood to the disk
        found = [emergency_stop(running, size.of(1, 5, 20), seed)]
        found += [second_publisher(running, topic, size.of(1, 2, 5), seed) for topic in ("valve_command",)]
        found.append(second_states(running, size.of(1, 2, 5), seed))
        found += [absurd_commands(running, topic, size.of(500, 2_000, 4_000), seed) for topic in COMMANDS]
        for topic in (*COMMANDS, *SENSORS, *SIGNALS):
            tally = Tally(FAMILY, f"flood of {topic}", seed, "MB growth", real_time=True)
            for kind, rate_hz in RATES_HZ.items():
                if not (kind == "huge" and topic in SIGNALS):
                    flood(running, tally, topic, kind, rate_hz)
            found.append(tally.result())
        for name in (*SERVICES, *ACTIONS):
            tally = Tally(FAMILY, f"flood of {name}", seed, "MB growth", real_time=True)
            for _ in range(size.of(1, 2, 4)):
                flood_of_calls(running, tally, name)
            found.append(tally.result())
    return found


def start_rogue(
    nodes: Nodes, user: User, topic: str, kind: str, rate_hz: float, seconds: float, *, count: int = 0
) -> None:
    """Start a second publisher for `seconds` [s] and wait for its first message; count: it ends after so many."""
    (nodes.folder / "rogue.log").unlink(missing_ok=True)
    nodes.module(
        "validation.faults.rogue",
        topic,
        kind,
        "--rate",
        f"{rate_hz:g}",
        "--seconds",
        f"{seconds:g}",
        "--count",
        str(count),
    )
    user.until(lambda: "begun" in nodes.log("rogue"), f"the second publisher of {topic} does not begin")


def end_rogue(nodes: Nodes, name: str = "rogue") -> None:
    """End the second publisher or caller, where there is one."""
    if name in nodes.running:
        nodes.end(name)


def flood(running: Rig, tally: Tally, topic: str, kind: str, rate_hz: float) -> None:
    """One flood of a topic: missed periods, and growth of both processes."""
    user, nodes = running.user, running.nodes
    name = f"{kind} at {rate_hz:g} Hz"
    try:
        user.drive()
        before = memory_mb(nodes)
        start_rogue(nodes, user, topic, kind, rate_hz, FLOOD_S)
        weigh(running, tally, topic, name, before)
    except TooLateError as error:
        tally.case(f"{name}: {error}", False)
    finally:
        end_rogue(nodes)


def flood_of_calls(running: Rig, tally: Tally, name: str) -> None:
    """One flood of calls of a service or an action: the same."""
    user, nodes = running.user, running.nodes
    try:
        user.drive()
        before = memory_mb(nodes)
        (nodes.folder / "rogue_calls.log").unlink(missing_ok=True)
        nodes.module("validation.faults.rogue_calls", name, "--seconds", f"{FLOOD_S:g}")
        user.until(lambda: "begun" in nodes.log("rogue_calls"), f"the calls of {name} do not begin")
        weigh(running, tally, name, "without a pause", before)
    except TooLateError as error:
        tally.case(f"without a pause: {error}", False)
    finally:
        end_rogue(nodes, "rogue_calls")


def memory_mb(nodes: Nodes) -> dict[str, float]:
    """Resident memory of driver and controller [MB]."""
    return {process: rss_mb(nodes.running[process]) for process in (DRIVER, CONTROLLER)}


def weigh(running: Rig, tally: Tally, flooded: str, name: str, before: dict[str, float]) -> None:
    """Count what a flood that has begun costs as a case. before: memory [MB] of both processes before it."""
    user, nodes = running.user, running.nodes
    frames = user.pressures_ns if flooded == "joint_states" else user.stamps_ns
    frames.clear()
    user.answered_ns.clear()
    user.spin(FLOOD_S)
    share = {DRIVER: missed(frames, FLOOD_S)}
    if flooded in DRIVEN_ON:
        share[CONTROLLER] = missed(user.answered_ns, FLOOD_S)
    for rogue in ("rogue", "rogue_calls"):
        end_rogue(nodes, rogue)
    user.spin(1.0)
    ended = [process for process in before if nodes.running[process].poll() is not None]
    if ended:
        tally.case(f"{name}: {', '.join(ended)} ended", False)
        for process in ended:
            nodes.restart(process)
        return
    growth = max(mb - before[process] for process, mb in memory_mb(nodes).items())
    faults = [
        f"{100 * lost:.1f} % of the periods of {node} missed" for node, lost in share.items() if lost > MOST_MISSED
    ]
    faults += [f"{growth:.0f} MB more"] if growth > MOST_GROWTH_MB else []
    tally.case(": ".join(filter(None, (name, ", ".join(faults)))), not faults, None, growth)


def absurd_commands(running: Rig, topic: str, count: int, seed: int) -> FaultResult:
    """Commands that are wrong in many ways, over DDS: no set-point in force leaves its limits, and nothing ends."""
    user, nodes = running.user, running.nodes
    tally = Tally(FAMILY, f"absurd {topic} over DDS", seed, "Pa", real_time=True)
    most_pa = float(description().limits.max_pressure_pa.max())
    rate_hz = 500.0
    try:
        user.drive()
        user.worst_set_point_pa = user.worst_pa = 0.0
        start_rogue(nodes, user, topic, "random", rate_hz, 0.0, count=count)
        user.until(lambda: "sent" in nodes.log("rogue"), "the second publisher does not end")
        sent = int(nodes.log("rogue").rpartition("sent ")[2])
        ended = [name for name in (DRIVER, CONTROLLER) if nodes.running[name].poll() is not None]
        good = user.worst_set_point_pa <= most_pa and not ended
        tally.many(sent, sent if good else 0)
        tally.worst = user.worst_set_point_pa
        if ended:
            tally.case(f"{', '.join(ended)} ended", False)
        user.drive()
    except TooLateError as error:
        tally.case(str(error), False)
    finally:
        end_rogue(nodes)
    return tally.result()


def missed(stamps_ns: list[int], seconds: float, rate_hz: float = 200.0) -> float:
    """Share of the periods without a frame within `seconds` [s], 0 to 1."""
    return max(0.0, 1.0 - len(set(stamps_ns)) / (seconds * rate_hz))


def second_publisher(running: Rig, topic: str, repeats: int, seed: int) -> FaultResult:
    """A second node commands full pressure: it is named and not obeyed, and the hand vents."""
    user, nodes = running.user, running.nodes
    tally = Tally(FAMILY, f"second publisher of {topic}", seed, "Pa", real_time=True)
    for number in range(repeats):
        try:
            user.drive()
            user.spin(1.5)
            user.worst_pa = 0.0
            start_rogue(nodes, user, topic, "full", 200.0, 2.0)
            at_s = time.monotonic()
            user.until(lambda: user.named("rogue"), "the second publisher is not named", 2.0)
            took_s = time.monotonic() - at_s
            user.spin(1.0)
            fault = f"{user.worst_pa:.0f} Pa reached" if user.worst_pa > 0.8 * FULL_PA else ""
            fault += f" named after {took_s:.2f} s" if took_s > REACTION_S else ""
            tally.case(f"{number}: {fault}", not fault, took_s, user.worst_pa)
        except TooLateError as error:
            tally.case(f"{number}: {error}; {user.worst_pa:.0f} Pa reached", False, None, user.worst_pa)
        finally:
            end_rogue(nodes)
    return tally.result()


def second_states(running: Rig, repeats: int, seed: int) -> FaultResult:
    """A second node publishes other joint states: it is named, and the hand vents."""
    user, nodes = running.user, running.nodes
    tally = Tally(FAMILY, "second publisher of joint_states", seed, "Pa", real_time=True)
    for number in range(repeats):
        try:
            user.drive()
            user.spin(1.0)
            user.worst_pa = 0.0
            start_rogue(nodes, user, "joint_states", "full", 200.0, 2.0)
            at_s = time.monotonic()
            took_s = user.until_vented(at_s)
            user.until(lambda: user.named("rogue"), "the second publisher is not named", 2.0)
            tally.case(f"{number}: vented after {took_s:.2f} s", took_s <= REACTION_S, took_s, user.worst_pa)
        except TooLateError as error:
            tally.case(f"{number}: {error}", False)
        finally:
            end_rogue(nodes)
    return tally.result()


def emergency_stop(running: Rig, repeats: int, seed: int) -> FaultResult:
    """Any node publishes emergency_stop: the hand vents, and enable alone does not drive it."""
    user = running.user
    tally = Tally(FAMILY, "emergency stop", seed, "Pa", real_time=True)
    publisher = user.node.create_publisher(Empty, "emergency_stop", QUEUED_QOS)
    for number in range(repeats):
        try:
            user.until(lambda: publisher.get_subscription_count() > 0, "nobody subscribes to emergency_stop", 2.0)
            user.drive()
            user.spin(0.5)
            at_s = time.monotonic()
            publisher.publish(Empty())
            took_s = user.until_vented(at_s)
            refused = not user.enable()
            user.spin(1.0)
            user.worst_pa = 0.0
            user.spin(0.3)
            fault = "" if refused else "enabled without a reset"
            fault += f" {user.worst_pa:.0f} Pa after a second" if user.worst_pa > QUIET_PA else ""
            tally.case(f"{number}: {fault}", not fault and took_s < REACTION_S, took_s, user.worst_pa)
        except TooLateError as error:
            tally.case(f"{number}: {error}", False)
    user.node.destroy_publisher(publisher)
    return tally.result()
