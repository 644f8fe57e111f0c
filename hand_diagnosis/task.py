"""What is diagnosed and how; and each joint's problem made ready: what drives it, what shakes it, what pulls at it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hand_diagnosis.partners import put_partner
from hand_identification.driving import accelerations, inflow, shape_driving
from hand_identification.free_parameters import FreeParameter, nominal_free_parameters, speed_free_parameters
from hand_identification.joint_data import driving_pressure, joint_problem
from hand_identification.joint_problem import FLOOR, JointProblem, Segment
from hand_identification.map_fit import MapFit, map_fit
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.effects.effect import INFLOW, NEIGHBOUR, Effect
from hand_recording.signals import Signals

RESTED_PA = 5e3
ROUGHLY = 3
"""Iterations of a first fit of the nominal numbers."""


@dataclass(frozen=True, slots=True)
class Prepared:
    """A joint's problem, the free parameters of its nominal numbers, and coordinates (free,) near their best ones."""

    problem: JointProblem
    free: list[FreeParameter]
    start: Array


@dataclass(frozen=True, slots=True)
class Task:
    """Recordings of a hand. tolerance: relative standard deviation of its nominal numbers.

    joints: those that are judged.
    floors: repeatability (OUTPUTS,) SI of joints, from re-runs.
    """

    signals: Sequence[Signals]
    hand: Hand
    joints: Sequence[str]
    effects: Sequence[Effect]
    tolerance: float
    seed: int
    floors: Mapping[str, Array]
    _rough: dict[str, Prepared] = field(default_factory=dict)
    _inflows: dict[int, Array] = field(default_factory=dict)

    def prepare(self, joint: str) -> Prepared:
        """The problem of a joint beside its partner, whose acceleration its own model tells."""
        rough = self._roughly(joint)
        other = self.partner(joint)
        if other and self._holding(joint) == self._holding(other):
            beside = self._roughly(other)
            # The partner's model is shaken by the noise of this joint's acceleration; that of its model has none.
            quiet = replace(beside.problem, segments=[_copied(segment) for segment in beside.problem.segments])
            put_partner(quiet, accelerations(rough.problem, rough.free, rough.start))
            put_partner(rough.problem, accelerations(quiet, beside.free, beside.start))
        for number, segment in zip(self._holding(joint), rough.problem.segments, strict=True):
            segment.exogenous[:, INFLOW] = self._inflow(number)
        return rough

    def partner(self, joint: str) -> str:
        """The joint that is coupled to one by inertia, or none."""
        index = int(self.hand.partner[self.hand.joints.index(joint)])
        return self.hand.joints[index] if index >= 0 else ""

    def _roughly(self, joint: str) -> Prepared:
        if joint not in self._rough:
            problem = joint_problem(self.signals, self.hand, joint, self.floors.get(joint, np.array(FLOOR)))
            free = nominal_free_parameters(problem.nominal, self.tolerance, rested(self.signals, joint))
            if not problem.driven:
                free += speed_free_parameters(problem.starts(1)[0, 1:].tolist())
            fit = map_fit(problem, free, np.zeros(len(free)), ROUGHLY)
            _choose_neighbour([self.signals[number] for number in self._holding(joint)], joint, problem, fit)
            shape_driving(problem, free, fit.z)
            self._rough[joint] = Prepared(problem, free, fit.z)
        return self._rough[joint]

    def _inflow(self, number: int) -> Array:
        """Rise of all pressures of a recording together (T,) [Pa/s]."""
        if number not in self._inflows:
            one = self.signals[number]
            rises = [inflow(self._driving(number, joint), one.samples, one.period_s) for joint in one.joints]
            self._inflows[number] = np.asarray(np.sum(rises, axis=0))
        return self._inflows[number]

    def _driving(self, number: int, joint: str) -> Array:
        """Driving pressure of a joint in a recording; shaped by its valve's model, where it is one of those judged."""
        if joint not in self.joints:
            one = self.signals[number]
            return driving_pressure(one, one.joints.index(joint))[0]
        return self._roughly(joint).problem.segments[self._holding(joint).index(number)].driving_pa

    def _holding(self, joint: str) -> list[int]:
        """Numbers of the recordings that hold a joint; their names need not differ."""
        return [number for number, one in enumerate(self.signals) if joint in one.joints]


def _copied(segment: Segment) -> Segment:
    return replace(segment, exogenous=segment.exogenous.copy())


def rested(signals: Sequence[Signals], joint: str) -> bool:
    """Whether a joint was vented when every recording of it began."""
    return all(one.pressure_pa[0, one.joints.index(joint)] < RESTED_PA for one in signals if joint in one.joints)


def _choose_neighbour(segments: Sequence[Signals], joint: str, problem: JointProblem, fit: MapFit) -> None:
    """Put the angle into e that best explains what the nominal model leaves: what pulls, pulls with its motion."""
    names = [name for name in segments[0].joints if name != joint and all(name in one.joints for one in segments)]
    best, chosen = 0.0, None
    for name in names:
        together = []
        for one, segment, residual in zip(segments, problem.segments, fit.residuals, strict=True):
            use = segment.use[1]
            other = one.angle_rad[use, one.joints.index(name)]
            own = np.column_stack([segment.angle_rad[use], segment.pressure_pa[use] * 1e-5, np.ones(use.sum())])
            rest = other - own @ np.linalg.lstsq(own, other, rcond=None)[0]
            norm = float(np.linalg.norm(rest)) * float(np.linalg.norm(residual[1][use]))
            together.append(abs(float(rest @ residual[1][use])) / max(norm, 1e-300))
        if float(np.mean(together)) > best:
            best, chosen = float(np.mean(together)), name
    if chosen is not None:
        for one, segment in zip(segments, problem.segments, strict=True):
            segment.exogenous[:, NEIGHBOUR] = one.angle_rad[:, one.joints.index(chosen)]
