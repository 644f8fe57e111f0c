"""Hours of operation without a fault, of hands that differ from their model, in a world that pushes and blocks.

Each minute has a plant of its own: model 0, 10 or 30 % off, friction, valve lag once or twice, noise once or five
times, air or liquid. It moves in steps, in smooth paths and in grasps; joints are pushed with smooth torques, meet
obstacles and lose them. Frames are missing for up to 90 ms, while the controller's watch for silence runs. In a stall
of up to 0.5 s neither frames nor the watch run, and a frame comes first when it ends: the node whose watch comes first
vents instead, as it does after any silence of 0.1 s.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hand_control.grasps import Grasp, load_grasps
from hand_control.supervisor import Phase
from hand_model.description import Hand
from validation.faults.sensor_loop import Loop, Plant
from validation.faults.sensors import CONFIG, ERRORS, Operation

MINUTE_S = 60.0
NO_OBSTACLE_RAD = 3.0
LEAVING_RAD_PER_S = 3.0
GAP_S = 0.09
"""Longest time between two frames in a gap."""
PUSH_NM, PUSH_LIQUID_NM = 0.15, 0.03
"""Largest torque of a push; a liquid that cannot leave would otherwise be pulled below vacuum, which no plant has."""


class World:
    """What happens to one hand during a minute; counts of it. Every draw is from one generator."""

    def __init__(self, hand: Hand, seed: int) -> None:
        """Draw a plant and enable its hand."""
        self.rng = rng = np.random.default_rng(seed)
        self.plant = Plant(
            float(rng.choice(ERRORS)),
            float(rng.uniform(0.001, 0.006)),
            float(rng.choice([1.0, 2.0])),
            float(rng.choice([1.0, 5.0])),
            bool(rng.random() < 0.2),
        )
        self.loop = Loop(hand, self.plant, seed)
        self.count = len(hand.joints)
        self.loop.change("contact.stiffness_nm_per_rad", rng.uniform(1.0, 30.0, self.count))
        self.loop.change("contact.damping_nm_s_per_rad", 0.05)
        self.grasps: list[Grasp] = list(load_grasps(CONFIG / "grasps.yaml", hand).values())
        self.obstacle = np.full(self.count, NO_OBSTACLE_RAD)
        self.leaves = np.zeros(self.count, dtype=np.bool_)
        self.push = np.zeros(self.count)
        self.pushed_s, self.push_s = 0.0, 0.0
        self.target = np.zeros(self.count)
        self.smooth: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self.silent = 0
        self.stalled = False
        self.heard = True
        self.counts = {"frames": 0, "gaps": 0, "stalls": 0, "pushes": 0, "contacts": 0}
        self.loop.controller.enable(True)
        self.loop.step()

    def frame(self) -> bool:
        """One frame; whether the hand is still driven."""
        loop, rng, dt = self.loop, self.rng, 1.0 / self.loop.rate_hz
        if rng.random() < dt / 2.0:
            self._next_motion()
        if self.smooth is not None and loop.number % 4 == 0:
            middle, amplitude, rate = self.smooth
            loop.command(middle + amplitude * np.sin(rate * loop.number * dt))
        if self.push_s <= 0.0 and rng.random() < dt / 4.0:
            self._begin_push()
        if self.push_s > 0.0:
            self._push(dt)
        if rng.random() < dt / 3.0:
            self._move_obstacles()
        if self.leaves.any():  # an object is taken away, it does not vanish
            self.obstacle = np.where(self.leaves, self.obstacle + LEAVING_RAD_PER_S * dt, self.obstacle)
            self.loop.change("contact.angle_deg", self.obstacle)
            self.leaves &= self.obstacle < NO_OBSTACLE_RAD
        if self.silent == 0:
            self._fall_silent(dt)
        self.heard = heard = self.silent == 0
        watched = not heard and not self.stalled
        self.silent = max(self.silent - 1, 0)
        self.counts["frames"] += 1
        driven = loop.step(heard)
        if watched:
            loop.controller.check(loop.now_ns)
            driven = loop.controller.safety.phase is Phase.ACTIVE
        return driven or not (heard or watched)

    def _next_motion(self) -> None:
        rng, loop = self.rng, self.loop
        kind, self.smooth = rng.integers(5), None
        if kind == 0:
            middle = rng.uniform(0.3, 0.9, self.count)
            self.smooth = (middle, rng.uniform(0.0, 0.3, self.count), rng.uniform(0.5, 8.0, self.count))
        elif kind == 1:
            grasp = self.grasps[rng.integers(len(self.grasps))]
            loop.controller.grasp(grasp, float(rng.uniform(0.4, 1.0)), 0.2, loop.now_ns)
        else:
            moved = rng.random(self.count) < (1.0 if kind == 2 else 0.3)
            self.target = np.where(moved, rng.uniform(-0.1, 1.4, self.count), self.target)
            loop.command(self.target)

    def _begin_push(self) -> None:
        rng = self.rng
        joints = rng.random(self.count) < rng.choice([0.1, 0.3, 1.0])
        largest = PUSH_LIQUID_NM if self.plant.liquid else PUSH_NM
        self.push = np.where(joints, rng.uniform(-largest, largest, self.count), 0.0)
        self.push_s = self.pushed_s = float(rng.uniform(0.1, 2.0))
        self.counts["pushes"] += 1

    def _push(self, dt: float) -> None:
        self.push_s -= dt
        share = np.sin(np.pi * max(self.push_s, 0.0) / self.pushed_s) ** 2
        self.loop.change("constant_load.torque_nm", self.push * share)

    def _move_obstacles(self) -> None:
        """Put obstacles in front of some joints that touch none, and take others away."""
        rng, angle = self.rng, self.loop.angle
        ahead = angle + rng.uniform(0.03, 0.6, self.count)
        chosen = rng.random(self.count)
        put = (chosen < 0.3) & (angle < self.obstacle)  # a pressed object does not jump ahead of its joint
        self.obstacle = np.where(put, ahead, self.obstacle)
        self.leaves = np.where(put, False, self.leaves | (chosen > 0.6))
        self.loop.change("contact.angle_deg", self.obstacle)
        self.counts["contacts"] += int(put.sum())

    def _fall_silent(self, dt: float) -> None:
        """Begin a gap or a stall now and then; after a frame, or two would make a longer one."""
        draw, after_a_frame = self.rng.random(), self.heard
        if draw < dt / 5.0:
            length = int(self.rng.integers(1, max(int(GAP_S / dt), 2)))  # at 200 Hz, 17 are missing at most
            if after_a_frame:
                self.silent, self.stalled = length, False
                self.counts["gaps"] += 1
        elif draw < dt / 5.0 + dt / 30.0:
            length = int(self.rng.integers(20, 100))
            if after_a_frame:
                self.silent, self.stalled = length, True
                self.counts["stalls"] += 1


def minutes(hand: Hand, hours: float, seed: int) -> Operation:
    """Operate for some hours [h]; a vent is noted, and the next minute begins."""
    total = {"frames": 0, "gaps": 0, "stalls": 0, "pushes": 0, "contacts": 0}
    vents: list[dict[str, Any]] = []
    frames = round(hours * 3600.0 * hand.rate_hz)
    number = 0
    while total["frames"] < frames:
        number += 1
        world = World(hand, seed * 100_003 + number)
        for _ in range(round(MINUTE_S * hand.rate_hz)):
            if not world.frame():
                vents.append({
                    "hour": (total["frames"] + world.counts["frames"]) / hand.rate_hz / 3600.0,
                    "seed": seed * 100_003 + number,
                    "frame": world.counts["frames"],
                    "plant": repr(world.plant),
                    "line": world.loop.controller.safety.fault or world.loop.controller.safety.reason,
                })  # fmt: skip
                break
        total = {key: total[key] + value for key, value in world.counts.items()}
    return Operation(total["frames"] / hand.rate_hz / 3600.0, vents, **total)
