"""The task of a diagnosis: which joints are diagnosed, by which effects, and each joint's problem made ready.

A joint's problem is ready when its inputs are: the pressure that drives it (shaped by the valve's model), the
acceleration of the joint that shares inertia with it, the neighbour that may be coupled to it, and the flow that all
joints draw from the supply.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hand_diagnosis.problem.data_check import Checked
from hand_diagnosis.problem.evidence import (
    likelihood_below_floor,
    weighted_by_noise,
)
from hand_diagnosis.problem.splits import fit_part
from hand_diagnosis.settings import SETTINGS
from hand_identification.driving import accelerations, inflow, shaken, shape_driving
from hand_identification.free_parameters import FreeParameter, nominal_free_parameters, speed_free_parameters
from hand_identification.joint_data import driving_pressure, joint_problem
from hand_identification.joint_problem import JointProblem, Segment
from hand_identification.map_fit import MapFit, correlation_s, map_fit, start_at
from hand_identification.settings import FITS
from hand_identification.starts import fit_plain
from hand_identification.two_links import bending, linked, motions
from hand_model.arrays import Array
from hand_model.effects import CATALOGUE, EFFECTS
from hand_model.effects.effect import AT_REST, INFLOW, MOTION, NEIGHBOUR, OTHER_MACHINES, PARTNER, Effect
from hand_model.joint_model import JointModel
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_recording.signals import Signals, derivatives

_ANGLE_SENSOR = [ROW[key] for effect in CATALOGUE if effect.place == "angle_sensor" for key in effect.keys]


def effects_without(names: Sequence[str], model: JointModel) -> list[Effect]:
    """The effects of the catalogue that have parameters and exist on a machine, without those named.

    Raises ValueError for unknown names.
    """
    for name in names:
        if name not in EFFECTS:
            raise ValueError(f"--without is {name!r}; the effects are: {', '.join(EFFECTS)}")
    wanted = [effect for effect in CATALOGUE if effect.keys and effect.name not in names]
    return [effect.on_machine(model.lacks) for effect in wanted if _is_possible(effect, model)]


def _is_possible(effect: Effect, model: JointModel) -> bool:
    """Whether a machine has what an effect needs, and the effect changes no number that is exact."""
    if MOTION in model.lacks and effect.place not in AT_REST:
        return False
    exact = {key for key, tolerance in model.tolerances.items() if tolerance == 0.0}
    return model.lacks.isdisjoint(effect.needs) and exact.isdisjoint(effect.keys)


def effects_not_offered(model: JointModel) -> list[str]:
    """A line about the effects that cannot exist on a machine. Those of other machines are no part of a hand's."""
    foreign = OTHER_MACHINES if model.lacks >= OTHER_MACHINES else frozenset()
    own = [effect for effect in CATALOGUE if effect.keys and foreign.isdisjoint(effect.needs)]
    names = [effect.name for effect in own if not _is_possible(effect, model)]
    return [f"effects that this machine cannot have are not offered: {', '.join(names)}"] if names else []


def moving_joints(
    signals: Sequence[Signals], model: JointModel, joints: Sequence[str], unusable: frozenset[str]
) -> list[str]:
    """Those of the joints asked for (all recorded ones, where none is) that are usable and move enough.

    Raises ValueError for a joint that was not recorded.
    """
    recorded = [joint for joint in model.joints if any(joint in recording.joints for recording in signals)]
    for joint in joints:
        if joint not in recorded:
            raise ValueError(f"--joints: {joint!r} was not recorded; the recordings hold: {', '.join(recorded)}")
    able = [joint for joint in joints or recorded if joint not in unusable]
    return [joint for joint in able if any(_is_excited(recording, joint) for recording in signals)]


def _is_excited(recording: Signals, joint: str) -> bool:
    """Whether a joint moves by pressure, or far enough by an external cause; a vented joint that is shaken does not."""
    if joint not in recording.joints:
        return False
    column = recording.joints.index(joint)
    if recording.still:
        return True
    travel = np.ptp(recording.angle_rad[:, column])
    pressed = np.ptp(recording.pressure_pa[:, column]) > SETTINGS.min_excited_pressure_pa or recording.driven
    return bool(
        travel > SETTINGS.min_pushed_travel_rad or (travel > SETTINGS.min_travel_rad and pressed),
    )


def not_judged(checked: Sequence[Checked], diagnosed: Sequence[str], asked: Sequence[str]) -> dict[str, str]:
    """Recorded joints (those asked for, where any are) without a diagnosis, and why."""
    reasons: dict[str, str] = {}
    for each in checked:
        for joint in asked or each.signals.joints:
            if joint not in each.signals.joints or joint in diagnosed:
                continue
            lines = [line.removeprefix(f"{each.signals.name}: ") for line in each.lines]
            own = [line.removeprefix(f"{joint}: ") for line in lines if line.startswith(f"{joint}: ")]
            unusable = joint in each.unusable and own
            reasons[joint] = own[-1] if unusable else "moved too little"
    return reasons


@dataclass(frozen=True, slots=True)
class Prepared:
    """A joint's problem, the free parameters of its nominal numbers, and coordinates (free,) near the best ones."""

    problem: JointProblem
    free: list[FreeParameter]
    start: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """Recordings of a hand or machine, and how they are diagnosed.

    joints: those that are diagnosed.  tolerance: relative standard deviation of the nominal numbers [-].
    looser: factor [-] of the tolerance of single joints.
    floors: repeatability (OUTPUTS,) [Pa, rad, N] of joints, from re-runs.
    bends: whether the inertia of a finger changes with the angle between its phalanges, see two_links.py.
    """

    signals: Sequence[Signals]
    model: JointModel
    joints: Sequence[str]
    effects: Sequence[Effect]
    tolerance: float
    seed: int
    floors: Mapping[str, Array]
    bends: bool = False
    looser: Mapping[str, float] = field(default_factory=dict)
    _rough: dict[str, Prepared] = field(default_factory=dict)
    _inflows: dict[int, Array] = field(default_factory=dict)
    _bending: dict[str, list[Array]] = field(default_factory=dict)

    def with_tolerance(self, factor: float) -> Task:
        """The task with its tolerance times a factor, of which no joint is prepared."""
        return replace(self, tolerance=factor * self.tolerance, _rough={}, _inflows={}, _bending={})

    def prepare(self, joint: str) -> Prepared:
        """The problem of a joint, with the acceleration of its partner as the partner's own model gives it."""
        rough = self._roughly(joint)
        other = self.partner(joint)
        if other and self._holding(joint) == self._holding(other):
            beside = self._roughly(other)
            # The measured acceleration of this joint is noisy and would disturb the partner's model; the modelled one
            # is not.
            quiet = replace(beside.problem, segments=[_copied(segment) for segment in beside.problem.segments])
            put_partner(quiet, accelerations(rough.problem, rough.free, rough.start))
            self._bending[joint] = self._added_by_bending(joint, rough, replace(beside, problem=quiet))
            moved = accelerations(quiet, beside.free, beside.start)
            put_partner(rough.problem, self.with_bending(joint, moved))
        for number, segment in zip(self._holding(joint), rough.problem.segments, strict=True):
            segment.exogenous[:, INFLOW] = self._inflow(number)
        return rough

    def effects_beside(self, problem: JointProblem) -> list[Effect]:
        """The effects without those of a neighbour, where none was recorded that moves.

        A spring from a joint at rest, which its law may bend in any way, is nothing but an elastic torque of this one.
        """
        neighbours = [segment.exogenous[:, NEIGHBOUR] for segment in problem.segments]
        if any(np.ptp(angle) > SETTINGS.min_travel_rad for angle in neighbours):
            return list(self.effects)
        return [effect for effect in self.effects if "other_joint" not in effect.needs]

    def with_bending(self, joint: str, partner_rad_s2: Sequence[Array]) -> list[Array]:
        """Acceleration (T,) [rad/s^2] of a joint's partner in every segment, with what a changing inertia adds to it.

        The joint was prepared before.
        """
        added = self.added_by_bending(joint) if self.bends else []
        return [a + b for a, b in zip(partner_rad_s2, added, strict=True)] if added else list(partner_rad_s2)

    def added_by_bending(self, joint: str) -> list[Array]:
        """What a changing inertia adds to the partner's acceleration of a joint that was prepared; also if not `bends`.

        Empty where the description does not say it, or the partner was not recorded.
        """
        return self._bending.get(joint, [])

    def _added_by_bending(self, joint: str, own: Prepared, other: Prepared) -> list[Array]:
        share, proximal = linked(self.model, self.model.joints.index(joint))
        if share == 0.0:
            return []
        both = [motions(each.problem, each.free, each.start) for each in (own, other)]
        return [bending(share, a, b, proximal=proximal) for a, b in zip(*both, strict=True)]

    def nominal_fits(self) -> list[tuple[JointProblem, MapFit]]:
        """Of every joint, the problem without test data, and the plain model fitted to it within the tolerance."""
        found = []
        for joint in self.joints:
            ready = self.prepare(joint) if self.bends else self._roughly(joint)
            fitted = fit_part(ready.problem)
            fit = map_fit(fitted, ready.free, ready.start, SETTINGS.rough_iterations)
            found.append((fitted, fit.without_slopes()))
        return found

    def partner(self, joint: str) -> str:
        """The joint that shares inertia with one; empty where there is none."""
        index = int(self.model.partner[self.model.joints.index(joint)])
        return self.model.joints[index] if index >= 0 else ""

    def with_test_data(self, ready: Prepared, problem: JointProblem) -> Prepared:
        """A prepared joint with the problem of other test data, and stops free where the data to fit come near them."""
        free = self._free(fit_part(problem))
        known = {parameter.row: float(z) for parameter, z in zip(ready.free, ready.start, strict=True)}
        return Prepared(problem, free, start_at(free, known))

    def _free(self, fitted: JointProblem) -> list[FreeParameter]:
        """What is free in the plain plant of a joint. fitted: its problem without test data."""
        rested, own = initial_rest_angle(self.signals, fitted.joint), self.model.tolerances
        tolerance = self.tolerance * self.looser.get(fitted.joint, 1.0)
        free = nominal_free_parameters(fitted.nominal, tolerance, rested, own, fitted.motion_rad)
        return free if fitted.driven else free + speed_free_parameters(fitted.starts(1)[0, 1:].tolist())

    def _roughly(self, joint: str) -> Prepared:
        if joint not in self._rough:
            problem = joint_problem(self.signals, self.model, joint, self.floors.get(joint, np.array(FITS.floor)))
            fitted = fit_part(problem)
            free = self._free(fitted)
            fit = fit_plain(fitted, free, np.zeros(len(free)), SETTINGS.rough_iterations)
            _choose_neighbour([self.signals[number] for number in self._holding(joint)], joint, problem, fitted, fit)
            shape_driving(problem, free, fit.z)
            other = self.partner(joint)
            if other and not self._holding(other):
                fit = _beside_unrecorded(problem, fit, self.model.parameters[:, self.model.joints.index(other)])
            if self.signals[0].machine:  # how fast a hand's residuals change is known, and its thresholds go with it
                problem.correlation_s = correlation_s(fitted, fit)
            self._rough[joint] = Prepared(problem, free, fit.z)
        return self._rough[joint]

    def _inflow(self, number: int) -> Array:
        """Rise of all pressures of a recording together (T,) [Pa/s]."""
        if number not in self._inflows:
            recording = self.signals[number]
            rises = [
                inflow(self._driving(number, joint), recording.samples, recording.period_s)
                for joint in recording.joints
            ]
            self._inflows[number] = np.asarray(np.sum(rises, axis=0))
        return self._inflows[number]

    def _driving(self, number: int, joint: str) -> Array:
        """Driving pressure of a joint in a recording; shaped by its valve's model where the joint is diagnosed."""
        if joint not in self.joints:
            recording = self.signals[number]
            return driving_pressure(recording, recording.joints.index(joint))[0]
        return self._roughly(joint).problem.segments[self._holding(joint).index(number)].driving_pa

    def _holding(self, joint: str) -> list[int]:
        """Numbers of the recordings that hold a joint; their names need not differ."""
        return [number for number, recording in enumerate(self.signals) if joint in recording.joints]


def _copied(segment: Segment) -> Segment:
    return replace(segment, exogenous=segment.exogenous.copy())


def put_partner(problem: JointProblem, partner_rad_s2: Sequence[Array]) -> None:
    """Set the partner's acceleration (T,) [rad/s^2] in every segment."""
    for segment, acceleration in zip(problem.segments, partner_rad_s2, strict=True):
        segment.exogenous[:, PARTNER] = acceleration


def model_accelerations(problem: JointProblem, fit: MapFit) -> list[Array]:
    """Acceleration (T,) [rad/s^2] of a joint in every segment by its fitted model, without its sensor's faults.

    A joint is moved by the acceleration of its partner (Eq. 8 with the coupling inertia). Taken from the partner's
    measured angle, a fault of that sensor would look like missing physics of this joint.
    """
    columns, starts = problem.columns(fit.free, fit.z[None])
    for row in _ANGLE_SENSOR:
        columns[:, row] = (JOINT_PARAMETERS[row].neutral or 0.0) * JOINT_PARAMETERS[row].scale
    return [
        derivatives(predicted[0, 1][:, None], segment.period_s)[1][:, 0]
        for predicted, segment in zip(problem.predict(columns, starts), problem.segments, strict=True)
    ]


def initial_rest_angle(signals: Sequence[Signals], joint: str) -> bool:
    """Whether a joint was vented, and so at its rest angle, when every recording of it began."""
    return all(
        recording.pressure_pa[0, recording.joints.index(joint)] < SETTINGS.vented_pressure_pa
        for recording in signals
        if joint in recording.joints
    )


def _beside_unrecorded(problem: JointProblem, fit: MapFit, other: Array) -> MapFit:
    """The plain model of a joint, refitted with an unrecorded partner that it shakes, unless that fits clearly worse.

    other: (rows,) the partner's nominal parameters. Nobody knows its pressure: vented is the simplest assumption.
    """
    moved = shaken(problem, other, accelerations(problem, fit.free, fit.z))
    sharp = weighted_by_noise(fit_part(problem), fit)
    still = map_fit(sharp, fit.free, fit.z, SETTINGS.rough_iterations)
    put_partner(problem, moved)  # the arrays of the fitted part are those of the whole problem
    beside = map_fit(sharp, fit.free, fit.z, SETTINGS.rough_iterations)
    before, after = (likelihood_below_floor(sharp, still, each) for each in (still, beside))
    if after > before - SETTINGS.min_partner_gain:
        return beside
    put_partner(problem, [np.zeros_like(acceleration) for acceleration in moved])
    return still


def _choose_neighbour(
    recordings: Sequence[Signals], joint: str, problem: JointProblem, fitted: JointProblem, fit: MapFit
) -> None:
    """Put the angle into the exogenous inputs whose motion best explains what the nominal model leaves.

    fitted: the part of the problem that is not test data, and fit, the nominal model on it.
    """
    best, chosen = 0.0, None
    for name in recordings[0].joints:
        if name == joint or not all(name in recording.joints for recording in recordings):
            continue
        together = [
            _correlation(recording, name, segment, residual[1])
            for recording, segment, residual in zip(recordings, fitted.segments, fit.residuals, strict=False)
        ]
        if float(np.mean(together)) > best:
            best, chosen = float(np.mean(together)), name
    if chosen is not None:
        for recording, segment in zip(recordings, problem.segments, strict=True):
            segment.exogenous[:, NEIGHBOUR] = recording.angle_rad[:, recording.joints.index(chosen)]


def _correlation(recording: Signals, other: str, segment: Segment, residual_rad: Array) -> float:
    """Of the residual (T,) with another joint's angle, without what the joint's own angle and pressure explain."""
    use = segment.use[1]
    angle = recording.angle_rad[: len(use), recording.joints.index(other)][use]
    own = np.column_stack([segment.angle_rad[use], segment.pressure_pa[use] * 1e-5, np.ones(use.sum())])
    remainder = angle - own @ np.linalg.lstsq(own, angle, rcond=None)[0]
    norm = float(np.linalg.norm(remainder)) * float(np.linalg.norm(residual_rad[use]))
    return abs(float(remainder @ residual_rad[use])) / max(norm, 1e-300)
