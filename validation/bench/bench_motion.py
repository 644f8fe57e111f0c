"""Motion and contact of the control law on plants of another form, whose constants are up to 30 % off its model.

The plants are those of `rough_plant`; dead time and lag of the valve are drawn, too. Torques at an obstacle are those
that the obstacle takes, not those of the actuator. Medians and 95th percentiles are over the joints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hand_control.declared import OUT, G, Settings, U
from hand_control.law import Law
from hand_control.shaping import Shaper, approach_speed
from hand_model.arrays import Array, Flags
from hand_model.description import Hand, load_hand
from validation.bench.result import figure
from validation.bench.rough_plant import FRICTION, LOAD, PHI, WALL, WALL_AT, WALL_K, P, Q, RoughPlants, draw, partners
from validation.paper.step_rig import many_gains

SEED, RATE_HZ = 20261123, 200.0
ERROR, IDENTIFIED = 0.3, 0.02
KNOWN = 0.299
"""Error of a model that knows each plant, its dead time too, within 30 %; at ERROR it is that of the description."""
DEAD_TIMES_S, SWING_DEG = (0.05, 0.08), 1.0
"""Dead times of the valve, and the motion in the last second of a rest from which a joint oscillates."""
NOISE_RAD, NOISE_PA = float(np.radians(0.03)), 150.0
LOW_RAD, HIGH_RAD = float(np.radians(30.0)), float(np.radians(80.0))
SETTLED_DEG, HOLD_S = 1.0, 2.5
RAMPS_DEG_PER_S = (0.3, 1.0, 3.0, 10.0)
STIFFNESSES = (5.0, 20.0, 100.0)
LOAD_NM = 0.03
FRICTIONS_NM = (0.003, 0.005, 0.010)
FREE_HOURS, FREE_STEP_S = 100.0, 1.5
"""Joint-hours of steps without an obstacle, and the time between two steps."""
FREE_FRICTION_NM, FREE_LOAD_NM = 0.005, 0.02
RELEASED = 0.05
"""Share of the held torque below which an obstacle counts as released."""


def run(quick: bool) -> list[dict[str, Any]]:
    """All figures on 8 hands of 11 joints; quick: on one hand, the shorter runs only."""
    print(f"seed {SEED}")
    hand = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
    bench = Bench(hand, Settings.of(hand, {}), 1 if quick else 8, SEED)
    results = [*bench.steps(1.0), *bench.contacts(20.0, ERROR)]
    if quick:
        return [*results, *bench.stick_slip(FRICTIONS_NM[-1]), *bench.free_motion(0.05), *bench.dead_time(0.05, ERROR)]
    results += bench.steps(5.0)
    for dead_time_s in DEAD_TIMES_S:
        results += [*bench.dead_time(dead_time_s, ERROR), *bench.dead_time(dead_time_s, KNOWN)]
    for speed in RAMPS_DEG_PER_S:
        results += bench.ramp(speed)
    for stiffness in STIFFNESSES:
        results += bench.contacts(stiffness, IDENTIFIED)
    results += [*bench.contacts(5.0, ERROR), *bench.contacts(100.0, ERROR)]
    results += bench.contacts(20.0, IDENTIFIED, LOAD_NM)
    for friction in FRICTIONS_NM:
        results += bench.stick_slip(friction)
    return results + bench.free_motion(FREE_HOURS)


@dataclass(frozen=True, slots=True)
class Sample:
    """One tick, arrays (n,): reference, true angle [rad], torque on the obstacle [N m], whether contact is reported."""

    time_s: float
    reference: Array
    angle: Array
    wall: Array
    contact: Flags


def up_and_down(time_s: float) -> tuple[float, float]:
    """Angle [rad] and speed [rad/s] of the target at a time: 30 and 80 degrees in turn."""
    return (HIGH_RAD if int(time_s / HOLD_S) % 2 else LOW_RAD), 0.0


def until_last(condition: Flags) -> Array:
    """Number of samples [-] up to the last one in which a condition (samples, n) holds, (n,); 0 where it never does."""
    return np.where(condition.any(axis=0), len(condition) - condition[::-1].argmax(axis=0), 0)


def swings_deg(angle: Array, rests: int) -> Array:
    """Range (rests, n) [deg] of angles (samples, n) [rad] in the last second of each rest but the first."""
    ends = [round((number + 1) * HOLD_S * RATE_HZ) for number in range(1, rests + 1)]
    return np.degrees([np.ptp(angle[end - round(RATE_HZ) : end], axis=0) for end in ends])


class Bench:
    """The law of many hands on rough plants."""

    def __init__(self, hand: Hand, settings: Settings, hands: int, seed: int) -> None:
        """Use one description and its settings for `hands` hands."""
        self.hand, self.settings, self.hands, self.seed = hand, settings, hands, seed
        self.joints = hands * len(hand.joints)

    def ticks(
        self,
        q: Array,
        error: float,
        limit: Array,
        target: Callable[[float], tuple[Any, float]],
        seconds: float,
        noise: float = 1.0,
    ) -> Iterator[Sample]:
        """Control plants q (ROWS, n) towards target(t) -> angle [rad] and speed [rad/s], from 2 s before t = 0.

        limit: torque limits (n,) [N m].  error: largest relative error of the law's model of each plant [-]; at
        ERROR it is the model of the description.
        noise: factor on the noise of the sensors [-].
        """
        rng = np.random.default_rng([self.seed, 3])
        g = many_gains(self.hand, self.settings, self.hands)
        if error < ERROR:
            names = {"viscous": "drag", "valve_lag": "lag", "dead_time": "delay"}
            for name in ("a0", "a1", "a2", "a3", "inertia", "viscous", "valve_lag", "dead_time"):
                off = rng.uniform(1.0 - error, 1.0 + error, self.joints)
                g[getattr(G, name)] = q[Q[names.get(name, name)]] * off
        law, plants = Law(g), RoughPlants(q, partners(self.hand, self.hands), 1.0 / RATE_HZ)
        shaper = Shaper(self.joints, law.inputs, (g[G.low], g[G.high]))
        shaper.latch(plants.state[PHI])
        law.inputs[U.limit] = limit
        for k in range(-round(2.0 * RATE_HZ), round(seconds * RATE_HZ)):
            angle, speed = target(max(k, 0) / RATE_HZ)
            self.shape(shaper, law, angle, speed if k >= 0 else 0.0)
            law.inputs[U.position] = plants.state[PHI] + noise * NOISE_RAD * rng.standard_normal(self.joints)
            law.inputs[U.pressure] = plants.state[P] + noise * NOISE_PA * rng.standard_normal(self.joints)
            out = law.tick(law.inputs, 1.0 / RATE_HZ)
            plants.advance(out[OUT.pressure])
            if k >= 0:
                state = plants.state.copy()
                yield Sample(k / RATE_HZ, shaper.r.copy(), state[PHI], state[WALL], out[OUT.contact] != 0.0)

    def shape(self, shaper: Shaper, law: Law, angle: Any, speed: float) -> None:
        """Advance the reference as the controller does: angle [rad] or angles (n,), speed [rad/s]."""
        n = self.joints
        inertia = law.gains[G.inertia] + law.gains[G.coupling]
        top = approach_speed(inertia, law.inputs[U.limit], self.settings)
        shaper.step(np.broadcast_to(angle, n), np.full(n, speed), self.settings, 1.0 / RATE_HZ, top)

    def limits(self) -> Array:
        """The configured torque limits (n,) [N m]."""
        return np.tile(self.hand.limits.max_torque_nm, self.hands)

    def steps(self, noise: float) -> list[dict[str, Any]]:
        """Steps from 30 to 80 degrees and back, four of each: settling time, overshoot, unsettled.

        noise: factor on the noise of the sensors [-].
        """
        q = draw(self.hand, self.hands, ERROR, np.random.default_rng([self.seed, 1]))
        angle = np.array([s.angle for s in self.ticks(q, ERROR, self.limits(), up_and_down, 9 * HOLD_S, noise)])
        length = round(HOLD_S * RATE_HZ)
        settle, over = [], []
        for number in range(1, 9):
            part = np.degrees(angle[number * length : (number + 1) * length])
            goal, sign = (80.0, 1.0) if number % 2 else (30.0, -1.0)
            outside = np.abs(part - goal) > SETTLED_DEG
            settle.append(until_last(outside) / RATE_HZ)
            over.append(np.maximum((sign * (part - goal)).max(axis=0), 0.0) / 50.0)
        settled, share = np.array(settle), np.array(over)
        name = f"steps of 50 degrees, noise x {noise:g}"
        return [
            figure(f"{name}: settling time, median", np.median(settled), 0.45, "s"),
            figure(f"{name}: settling time, 95th percentile", np.quantile(settled, 0.95), 0.6, "s"),
            figure(f"{name}: overshoot, 95th percentile", 100 * np.quantile(share, 0.95), 3.0, "%"),
            figure(f"{name}: largest overshoot", 100 * share.max(), None, "%"),
            figure(f"{name}: not settled in {HOLD_S:g} s", 100 * (settled >= HOLD_S - 0.01).mean(), 0.0, "%"),
        ]

    def dead_time(self, dead_time_s: float, error: float) -> list[dict[str, Any]]:
        """The same steps with valves of this dead time [s]: rests whose last second is a swing.

        error: largest relative error of the law's model [-], as in `ticks`.
        """
        q = draw(self.hand, self.hands, ERROR, np.random.default_rng([self.seed, 1]))
        q[Q["delay"]] = dead_time_s
        angle = np.array([s.angle for s in self.ticks(q, error, self.limits(), up_and_down, 9 * HOLD_S)])
        swing = swings_deg(angle, 8)
        known = "known within 30 %" if error < ERROR else "of which the model does not know"
        name = f"valve with a dead time of {1e3 * dead_time_s:g} ms {known}"
        goal = 2.0 if dead_time_s == DEAD_TIMES_S[0] else None
        return [
            figure(f"{name}: rests that oscillate by {SWING_DEG:g} deg", 100 * (swing > SWING_DEG).mean(), goal, "%"),
            figure(f"{name}: motion at rest, 95th percentile", np.quantile(swing, 0.95), None, "deg"),
        ]

    def ramp(self, speed_deg_per_s: float) -> list[dict[str, Any]]:
        """A slow ramp from 30 degrees, at most 50 s: RMS and largest error, time with a false contact."""
        q = draw(self.hand, self.hands, ERROR, np.random.default_rng([self.seed, 1]))
        speed, seconds = np.radians(speed_deg_per_s), min(50.0 / speed_deg_per_s, 50.0)

        def target(t: float) -> tuple[float, float]:
            return LOW_RAD + speed * t, speed

        errors, flagged = [], []
        for s in self.ticks(q, ERROR, self.limits(), target, seconds):
            if s.time_s > 0.5:  # the ramp has begun
                errors.append(np.degrees(s.angle - LOW_RAD - speed * s.time_s))
                flagged.append(s.contact)
        error = np.array(errors)
        rms = np.sqrt(np.mean(error**2, axis=0))
        name = f"ramp of {speed_deg_per_s:g} deg/s"
        return [
            figure(f"{name}: RMS error, median", float(np.median(rms)), 0.3, "deg"),
            figure(f"{name}: RMS error, 95th percentile", float(np.quantile(rms, 0.95)), 0.3, "deg"),
            figure(f"{name}: largest error", float(np.abs(error).max()), None, "deg"),
            figure(f"{name}: time with a false contact", 100 * float(np.mean(flagged)), None, "%"),
        ]

    def contacts(self, stiffness: float, error: float, load_nm: float = 0.0) -> list[dict[str, Any]]:
        """Step onto an obstacle, press, and step back after 4 s: torques on it, detection, release.

        stiffness: of the obstacle [N m/rad].  error: largest relative error of the law's model [-], as in `ticks`.
        load_nm: size [N m] of a load that the model lacks; it resists every other joint and helps the rest.
        Raises RuntimeError where no joint reaches its obstacle.
        """
        rng = np.random.default_rng([self.seed, 2])
        q = draw(self.hand, self.hands, ERROR, rng)
        q[WALL_AT], q[WALL_K] = rng.uniform(np.radians(20.0), np.radians(70.0), self.joints), stiffness
        q[LOAD] = load_nm * np.where(np.arange(self.joints) % 2, 1.0, -1.0)
        limit = rng.uniform(0.05, 0.2, self.joints)
        touch_s, press_s = 0.2, 4.0

        def target(t: float) -> tuple[float, float]:
            return (1.6 if touch_s <= t < press_s else 0.1), 0.0

        wall, found, times = [], [], []
        for s in self.ticks(q, error, limit, target, press_s + 2.0):
            wall.append(s.wall)
            found.append(s.contact)
            times.append(s.time_s)
        torque, flag, time = np.array(wall), np.array(found), np.array(times)
        met = torque > 0.0
        begin = np.argmax(met, axis=0)
        pressing = time < press_s
        held = torque[(time > press_s - 1.0) & pressing].mean(axis=0)
        touched = met.any(axis=0) & (held > 0.0)
        if not touched.any():
            raise RuntimeError("no joint reached its obstacle")
        after = time[:, None] >= time[begin][None]
        detected = np.argmax(flag & after, axis=0)
        delay = np.where((flag & after & pressing[:, None]).any(axis=0), time[detected] - time[begin], np.inf)
        loaded = torque[~pressing] > RELEASED * held
        release = until_last(loaded) / RATE_HZ
        peak = torque[pressing].max(axis=0) / limit
        ratio = held / limit
        name = f"obstacle of {stiffness:g} N m/rad, model within {100 * error:g} %"
        name += f", load of {1e3 * load_nm:g} mN m" if load_nm else ""
        goals = (1.3 if stiffness <= 20.0 else 2.0, 0.9 if error < ERROR else 0.7, 1.1 if error < ERROR else 1.3)
        return [
            figure(f"{name}: peak over the limit, median", np.median(peak[touched]), None, ""),
            figure(f"{name}: peak over the limit, 95th percentile", np.quantile(peak[touched], 0.95), goals[0], ""),
            figure(f"{name}: held over the limit, 5th percentile", np.quantile(ratio[touched], 0.05), None, ""),
            figure(f"{name}: held over the limit, 95th percentile", np.quantile(ratio[touched], 0.95), goals[2], ""),
            figure(f"{name}: release, median", np.median(release[touched]), None, "s"),
            figure(f"{name}: release, 95th percentile", np.quantile(release[touched], 0.95), 0.3, "s"),
            figure(f"{name}: detection, median", np.median(delay[touched]), 0.1 if stiffness == 5.0 else None, "s"),
            figure(f"{name}: not detected", 100 * np.isinf(delay[touched]).mean(), None, "%"),
        ]

    def stick_slip(self, friction_nm: float) -> list[dict[str, Any]]:
        """Steps of 2 degrees every 4 s under Coulomb friction: motion and error in the last 2 s of each."""
        q = draw(self.hand, self.hands, ERROR, np.random.default_rng([self.seed, 1]))
        q[FRICTION] = friction_nm
        each = 4.0

        def target(t: float) -> tuple[float, float]:
            return LOW_RAD + np.radians(2.0) * (int(t / each) % 4), 0.0

        angle, aim = [], []
        for s in self.ticks(q, ERROR, self.limits(), target, 5 * each):
            angle.append(np.degrees(s.angle))
            aim.append(np.degrees(target(s.time_s)[0]))
        length = round(each * RATE_HZ)
        moved, off = [], []
        for number in range(1, 5):
            late = slice((number + 1) * length - length // 2, (number + 1) * length)
            part = np.array(angle[late])
            moved.append(np.ptp(part, axis=0))
            off.append(np.abs(part - np.array(aim[late])[:, None]).mean(axis=0))
        name = f"steps of 2 degrees, friction {1e3 * friction_nm:g} mN m"
        return [
            figure(f"{name}: motion at rest, median", np.median(moved), None, "deg"),
            figure(f"{name}: motion at rest, 95th percentile", np.quantile(moved, 0.95), 0.1, "deg"),
            figure(f"{name}: error at rest, 95th percentile", np.quantile(off, 0.95), None, "deg"),
        ]

    def free_motion(self, hours: float) -> list[dict[str, Any]]:
        """Steps to random angles without an obstacle: reports of contact. hours: time of one joint [h].

        The model lacks friction, Stribeck peak and load of each joint; all of its constants are off, creep is on.
        """
        rng = np.random.default_rng([self.seed, 4])
        q = draw(self.hand, self.hands, ERROR, rng)
        q[FRICTION] = FREE_FRICTION_NM * rng.uniform(0.5, 1.0, self.joints)
        q[LOAD] = FREE_LOAD_NM * rng.uniform(-1.0, 1.0, self.joints)
        seconds = 3600.0 * hours / self.joints
        aims = rng.uniform(0.1, 1.5, (int(seconds / FREE_STEP_S) + 1, self.joints))

        def target(t: float) -> tuple[Array, float]:
            return aims[int(t / FREE_STEP_S)], 0.0

        reports = 0
        before: Flags = np.zeros(self.joints, dtype=np.bool_)
        for s in self.ticks(q, ERROR, self.limits(), target, seconds):
            reports += int((s.contact & ~before).sum())
            before = s.contact
        name = f"free motion, friction up to {1e3 * FREE_FRICTION_NM:g} mN m, loads up to {1e3 * FREE_LOAD_NM:g} mN m"
        return [
            figure(f"{name}: time of one joint", hours, None, "h"),
            figure(f"{name}: false contacts", reports / hours, 0.01, "1/h"),
        ]
