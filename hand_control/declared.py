"""Every number of the controller and of its law, declared once: name, unit, value, range, meaning.

The fields of `Settings` are the node's parameters. GAINS, STATE, INPUTS and OUTPUTS name the rows of the law's arrays,
CONSTANTS its fixed numbers. The C header, config/controller.yaml and the table in docs/control.md are generated from
here: `python -m hand_control.declared --write` writes them, `--check` compares them.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from collections import namedtuple
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hand_model.arrays import Array
from hand_model.compile_cache import njit
from hand_model.description import Hand
from hand_ros.parameters import NodeParameter, ParameterError

compiled = njit(_nrt=False, error_model="numpy")
"""Compiles a function of the law. It allocates nothing, so arrays need no reference counts; x / 0 is not an error."""
inlined = njit(_nrt=False, error_model="numpy", forceinline=True)
"""The same for a function that is compiled into its callers."""
RUN_TIME, START = "run time", "start"
EACH = "; one value, or one per joint in the order of hand.yaml"


@dataclass(frozen=True, slots=True)
class Declared:
    """What `Settings` says of one parameter.

    low, high: allowed range of a number, both included.  choices: allowed texts.  changes: when it can change.
    row: the row of the law's gains that it fills.  on: the text that sets a switch row to 1.
    """

    unit: str
    value: Any
    low: float | None
    high: float | None
    meaning: str
    row: str = ""
    changes: str = RUN_TIME
    choices: tuple[str, ...] = ()
    on: str = ""


def _number(unit: str, value: float, low: float, high: float, meaning: str, **more: str) -> Any:
    return dataclasses.field(metadata={"declared": Declared(unit, value, low, high, meaning, **more)})  # type: ignore[arg-type]


def _per_joint(unit: str, value: float, low: float, high: float, meaning: str, row: str) -> Any:
    declared = Declared(unit, [value], low, high, meaning + EACH, row)
    return dataclasses.field(metadata={"declared": declared})


def _switch(value: bool, meaning: str, **more: str) -> Any:
    return dataclasses.field(metadata={"declared": Declared("", value, None, None, meaning, **more)})  # type: ignore[arg-type]


def _text(value: str, meaning: str) -> Any:
    return dataclasses.field(metadata={"declared": Declared("", value, None, None, meaning, changes=START)})


def _choice(on: str, row: str, meaning: str, *choices: str) -> Any:
    declared = Declared("", choices[0], None, None, meaning, row, choices=choices, on=on)
    return dataclasses.field(metadata={"declared": declared})


@dataclass(frozen=True, slots=True)
class Settings:
    """Checked values of the controller node's parameters; the gains of each joint are (joints,)."""

    hand_description: str = _text("", "path of hand.yaml; if empty, the installed file")
    grasps: str = _text("", "path of grasps.yaml; if empty, the installed file")
    joint_prefix: str = _text("", "beginning of the names of joints and frames; if empty, joint_prefix of hand.yaml")
    frame_id: str = _text("", "frame_id of every message; if empty, the palm, or the namespace without geometry")
    gripper_pattern: str = _text("cylindrical", "grasp pattern that the action gripper_cmd closes and opens")
    enabled_at_start: bool = _switch(False, "drive the hand once activated, without a call of `enable`", changes=START)
    state_file: str = _text(
        "", "file that keeps a latched fault; if empty, NAMESPACE.NODE.json in $ROS_HOME/fluidic_hand or ~/.ros/..."
    )
    heartbeat_timeout_s: float = _number(
        "s", 0.0, 0.0, 60.0, "age of the last message on `heartbeat` that vents the hand; 0: not needed", changes=START
    )
    command_lifetime_s: float = _number(
        "s", 0.1, 0.01, 1.0, "lifetime of set-points at the board; the board vents after it", changes=START
    )
    command_timeout_s: float = _number(
        "s", 0.0, 0.0, 3600.0, "age at which a command is held; after twice this age the hand is vented; 0: never"
    )
    max_speed_deg_per_s: float = _number("deg/s", 400.0, 1.0, 2000.0, "largest speed of the reference")
    max_acceleration_deg_per_s2: float = _number(
        "deg/s^2", 15000.0, 100.0, 1e6, "largest acceleration of the reference"
    )
    max_torque_rate_nm_per_s: float = _number(
        "N m/s", 3.0, 0.01, 1000.0, "largest rate of the target in torque mode, and of a rising torque limit"
    )
    reference_bandwidth_rad_per_s: float = _number("rad/s", 13.0, 1.0, 100.0, "bandwidth of the reference filter")
    contact_stiffness_nm_per_rad: float = _number(
        "N m/rad", 30.0, 0.0, 1e5,
        "stiffness of objects: on its first impact the torque stays below the limit of the joint; 0: any speed",
        row="contact_stiffness",
    )  # fmt: skip
    max_jump_deg: float = _number("deg", 30.0, 1.0, 360.0, "largest plausible change of an angle within 7.5 ms")
    path_tolerance_deg: float = _number(
        "deg", 0.0, 0.0, 180.0, "a trajectory with a larger error on its path is aborted; 0: never"
    )
    goal_tolerance_deg: float = _number(
        "deg", 0.0, 0.0, 180.0, "a trajectory with a larger error at its end is aborted; 0: never"
    )
    goal_time_s: float = _number("s", 1.0, 0.01, 60.0, "time allowed to come within the tolerance of the goal")
    kp_nm_per_rad: Array = _per_joint("N m/rad", 0.15, 0.0, 10.0, "fixed proportional gain", "kp")  # noqa: RUF009
    ki_nm_per_rad_s: Array = _per_joint("N m/(rad s)", 1.5, 0.0, 100.0, "fixed integral gain", "ki")  # noqa: RUF009
    kd_nm_s_per_rad: Array = _per_joint("N m s/rad", 0.003, 0.0, 1.0, "fixed gain on the measured speed", "kd")  # noqa: RUF009
    integral_limit_nm: Array = _per_joint("N m", 0.6, 0.0, 10.0, "bound of the integral", "i_max")  # noqa: RUF009
    control_mode: str = _choice(
        "torque", "torque_mode",
        "in mode torque, the effort of a command is the wanted torque (none: zero), and its position is ignored",
        "position", "torque",
    )  # fmt: skip
    anti_windup: str = _choice(
        "back_calculation", "back_calculation", "what the integrator does at a limit of the pressure",
        "conditional_integration", "back_calculation",
    )  # fmt: skip
    tracking_time_s: float = _number("s", 0.1, 0.005, 10.0, "tracking time of back-calculation", row="tracking_time")
    speed_filter_s: float = _number(
        "s", 0.01, 1e-4, 1.0, "time constant of the filter on the measured speed", row="speed_filter"
    )
    max_pressure_rate_pa_per_s: float = _number(
        "Pa/s", 1e8, 1e4, 1e9, "largest rate of the set-points; a falling torque ceiling is exempt", row="p_rate"
    )
    deadband_pa: float = _number(
        "Pa", 300.0, 0.0, 5e4, "smallest change of a set-point that is sent; 0: every change", row="deadband"
    )
    feed_forward: bool = _switch(True, "add the pressure of the model at the reference", row="feed_forward")
    creep_compensation: bool = _switch(True, "the model includes the creep of the material, Eq. 12", row="creep")
    gain_schedule: bool = _switch(
        True, "gains follow the model over angle and pressure; otherwise the fixed gains act", row="schedule"
    )
    response_time_s: float = _number(
        "s", 0.06, 0.01, 2.0, "closed-loop time constant of the scheduled gains", row="response_time"
    )
    adaptation: bool = _switch(True, "estimate changes of the static map during free motion", row="adapt")
    adaptation_memory_s: float = _number("s", 60.0, 1.0, 1e5, "time constant of forgetting", row="memory")
    adaptation_bound: float = _number(
        "", 2.0, 1.01, 10.0, "largest factor by which a constant of the map may change", row="adapt_bound"
    )
    map_uncertainty: float = _number(
        "", 0.17, 1e-3, 1.0, "relative standard deviation of the map at the start", row="map_uncertainty"
    )
    load_uncertainty_nm: float = _number(
        "N m", 0.02, 1e-4, 1.0, "standard deviation of an unknown load at the start", row="load_std"
    )
    contact_detection: bool = _switch(True, "detect contact from the torque balance of the motion", row="detect")
    contact_false_alarms_per_hour: float = _number(
        "1/h", 1.0, 1e-4, 3600.0, "wanted rate of false alarms per joint; it sets the row `threshold`"
    )
    contact_torque_std_nm: float = _number(
        "N m",
        0.004,
        1e-5,
        1.0,
        "standard deviation of the torque balance in free motion, until the controller has observed it",
        row="residual_std",
    )
    contact_map_error: float = _number(
        "", 0.015, 0.0, 0.5, "relative error of the pressure's torque that identification leaves", row="map_error"
    )
    observer_filter_s: float = _number(
        "s", 0.02, 0.002, 1.0, "time constant of the filters of the torque balance", row="observer_filter"
    )
    force_sensors: bool = _switch(True, "a force above `contact_force_n` is a contact, too")
    grasp_speed_deg_per_s: float = _number(
        "deg/s", 90.0, 5.0, 400.0, "closing speed of the joint with the longest way in a grasp"
    )
    grasp_torque_nm: float = _number("N m", 0.06, 0.001, 1.0, "torque limit of a closing joint until contact")
    contact_force_n: float = _number("N", 0.5, 0.05, 100.0, "force from which a force sensor reports contact")

    @classmethod
    def of(cls, hand: Hand, values: Mapping[str, Any]) -> Settings:
        """Settings of a hand from parameter values; missing ones take their default.

        Raises ParameterError, one line, for the first value that is not allowed.
        """
        full = {name: values.get(name, declared.value) for name, declared in DECLARED.items()}
        for parameter in PARAMETERS:
            if isinstance(parameter.default, list):
                full[parameter.name] = _of_each_joint(hand, parameter, full[parameter.name])
            else:
                parameter.check(full[parameter.name])
        return cls(**full)

    def row(self, name: str) -> Any:
        """What the parameter writes into its row of the gains: its value, or 1 and 0 for a switch."""
        declared, value = DECLARED[name], getattr(self, name)
        return float(value == declared.on) if declared.choices else value


def _described(declared: Declared) -> str:
    return f"{declared.meaning} [{declared.unit}]" if declared.unit else declared.meaning


DECLARED: dict[str, Declared] = {f.name: f.metadata["declared"] for f in dataclasses.fields(Settings)}
"""What is declared of every parameter, by name."""
PARAMETERS = tuple(
    NodeParameter(name, d.value, _described(d), d.low, d.high, d.choices, read_only=d.changes == START)
    for name, d in DECLARED.items()
)
"""The same as declarations of the node."""


@dataclass(frozen=True, slots=True)
class Row:
    """One row of an array of the law: name, unit, meaning.  key: its parameter in hand.yaml, where it has one."""

    name: str
    unit: str
    meaning: str
    key: str = ""


MODEL_ROWS = (
    Row("a0", "N m", "static map, Eq. 6", "statics.a0_nm"),
    Row("a1", "N m/rad", "static map, Eq. 6", "statics.a1_nm_per_rad"),
    Row("a2", "N m/Pa", "static map, Eq. 6", "statics.a2_nm_per_pa"),
    Row("a3", "N m/(Pa rad)", "static map, Eq. 6", "statics.a3_nm_per_pa_rad"),
    Row("phi_max", "rad", "angle of full creep, Eq. 11", "material.phi_max_deg"),
    Row("p_min", "Pa", "least pressure of extension, Eq. 12", "material.p_min_pa"),
    Row("b1", "1/Pa", "creep of extension, Eq. 12", "material.b1_per_pa"),
    Row("extension_rate", "1/s", "inverse of material.extension_time_s"),
    Row("b0", "1/Pa", "creep of recovery, Eq. 12", "material.b0_per_pa"),
    Row("recovery_rate", "1/s", "inverse of material.recovery_time_s"),
    Row("inertia", "kg m^2", "inertia J, Eq. 8", "dynamics.inertia_kg_m2"),
    Row("viscous", "N m s/rad", "viscous friction d, Eq. 8", "dynamics.viscous_friction_nm_s_per_rad"),
    Row("coupling", "kg m^2", "coupling inertia with the partner", "dynamics.coupling_inertia_kg_m2"),
    Row("partner", "", "index of the coupled joint, -1: none"),
    Row("valve_lag", "s", "time constant of the valve", "valve.time_constant_s"),
    Row("dead_time", "s", "dead time of the valve", "valve.dead_time_s"),
    Row("lead_2", "s^2", "by which the acceleration of a reference is anticipated: lags and dead time of the valve"),
    Row("low", "rad", "lower limit of the angle"),
    Row("high", "rad", "upper limit of the angle"),
    Row("p_max", "Pa", "upper limit of the pressure"),
)
"""Rows that the description of the hand fills."""
THRESHOLD = Row("threshold", "", "threshold h of the contact detector, from the rate of false alarms")
GAINS = (
    *MODEL_ROWS,
    *(Row(d.row, "0 or 1" if isinstance(d.value, bool) or d.choices else d.unit, f"parameter {name}")
      for name, d in DECLARED.items() if d.row),
    THRESHOLD,
)  # fmt: skip
"""Rows of the gains: the model of each joint, the parameters of the law, and the derived threshold."""
_COVARIANCE = tuple(
    Row(f"c{i}{j}", "", "covariance of the load [N m] and the relative changes") for i in range(4) for j in range(i, 4)
)  # fmt: skip
STATE = (
    Row("integral", "N m", "integral of the error"),
    Row("free_integral", "N m", "integral before the contact"),
    Row("command", "Pa", "last command"),
    Row("take_over", "0 or 1", "the integral takes over a change of the gains in the next tick"),
    Row("creep", "", "creeping ratio, Eq. 12"),
    Row("last_angle", "rad", "angle of the last tick"),
    Row("speed", "rad/s", "filtered speed"),
    Row("phi_1", "rad", "angle, filtered once"),
    Row("phi_2", "rad", "angle, filtered twice"),
    Row("p_1", "Pa", "pressure, filtered once"),
    Row("p_2", "Pa", "pressure, filtered twice"),
    Row("q_1", "Pa rad", "pressure times angle, filtered once"),
    Row("q_2", "Pa rad", "pressure times angle, filtered twice"),
    Row("acceleration", "rad/s^2", "acceleration, filtered twice"),
    Row("offset", "N m", "load, in which an error of a0 is included: the balance cannot separate them"),
    Row("d_a1", "", "relative change of a1"),
    Row("d_a3", "", "relative change of a3"),
    Row("d_viscous", "", "relative change of viscous"),
    *_COVARIANCE,
    Row("misfit", "(N m)^2", "mean square of negative torque balances, which no obstacle causes"),
    Row("bias", "N m", "slow part of the torque balance"),
    Row("sum", "", "sum of the contact detector"),
    Row("age", "s", "time since the onset of contact"),
    Row("contact", "0 or 1", "in contact"),
    Row("released", "s", "time without torque while in contact"),
    Row("started", "0 or 1", "the filters have their first sample"),
    Row("pause", "s", "time until adaptation may continue"),
    Row("moving", "s", "time of motion against a reported contact"),
    Row("wanted", "Pa", "wanted pressure, filtered at rest"),
    Row("stood", "s", "time without a slip, at rest"),
    Row("stood_error", "rad", "error with which it stood last, at rest"),
    Row("stood_integral", "N m", "integral with which it began to stand"),
    Row("kept_error", "rad", "error that the integral leaves at rest, after a slip"),
    Row("peak", "rad", "largest error of the present half swing, at rest"),
    Row("last_peak", "rad", "size of that of the half swing before"),
    Row("swing_time", "s", "time since the error changed its sign, at rest"),
    Row("slower", "s", "by which swings have lengthened the response time"),
    Row("load", "N m", "torque of the found physics at the measured state, from the caller"),
    Row("drag", "N m", "torque of its friction and damping, from the caller"),
    Row("spread", "N m", "uncertain part of its friction, from the caller"),
    Row("ahead", "N m", "torque of the found physics at the reference, from the caller"),
    Row("found_1", "N m", "load and drag, filtered once"),
    Row("found_2", "N m", "load and drag, filtered twice"),
)
INPUTS = (
    Row("reference", "rad", "filtered reference"),
    Row("speed", "rad/s", "speed of the reference"),
    Row("acceleration", "rad/s^2", "acceleration of the reference"),
    Row("limit", "N m", "torque limit, or the wanted torque in torque mode"),
    Row("position", "rad", "measured angle"),
    Row("pressure", "Pa", "measured pressure"),
)
OUTPUTS = (
    Row("pressure", "Pa", "command"),
    Row("torque", "N m", "estimated actuator torque, Eq. 11"),
    Row("saturated", "0 or 1", "the command was limited"),
    Row("contact", "0 or 1", "in contact"),
    Row("contact_torque", "N m", "torque balance: what an obstacle holds"),
    Row("contact_age", "s", "time since the onset of contact"),
)
CONSTANTS: dict[str, tuple[float, str, str]] = {
    "min_dt": (1e-5, "s", "lower bound of dt; a shorter one counts as 0, because speeds are differences over dt"),
    "max_dt": (0.05, "s", "upper bound of dt; a longer gap carries no information about the motion within it"),
    "min_leverage": (1e-9, "N m/Pa", "smallest torque per pressure that a torque is divided by"),
    "noise": (3e-4, "rad", "noise of the angle sensor: the integrator ignores smaller errors with a dead-band"),
    "rest_reference": (2e-3, "rad/s", "a joint is to rest while its reference is slower; the dead-band acts only then"),
    "rest_speed": (0.3, "rad/s", "in torque mode, a joint is at rest while its measured speed is smaller"),
    "rest_error": (0.01, "rad", "at rest, with an error below this, the wanted pressure is filtered"),
    "rest_filter": (0.05, "s", "with this time constant"),
    "slip_speed": (0.05, "rad/s", "at rest, a joint that is faster slips,"),
    "stand_time": (0.1, "s", "and stands after so long below that speed"),
    "stuck_error": (0.005, "rad", "with a larger error, the integral of a joint that stands at rest grows faster,"),
    "stuck_gain": (4.0, "", "by this factor, so that friction yields soon"),
    "given_back": (0.5, "", "share of what the integral gained while the joint stood that it loses once it slips"),
    "most_kept": (0.02, "rad", "largest error that the integral leaves after a slip past the reference"),
    "swing_error": (
        0.009,
        "rad",
        "a joint whose reference rests swings where its error has a larger peak on one side,",
    ),
    "swing_half": (0.5, "s", "changes its side within this time,"),
    "swing_decay": (0.6, "", "and has a peak of more than this share of that before;"),
    "swing_step": (0.25, "", "each such swing lengthens the response time and the dead time by this share,"),
    "most_slower": (5.0, "", "up to this multiple of the response time"),
    "min_speed": (0.05, "rad/s", "a slower joint gives adaptation no information"),
    "gate": (3.0, "", "standard deviations beyond which a balance is taken for contact, not for the map"),
    "stopping": (0.5, "", "a joint stops when its speed falls below this share of the filtered speed"),
    "margin": (0.035, "rad", "closer to a limit of its angle, a joint may press on its end stop"),
    "balance_std": (0.004, "N m", "standard deviation of the balance by noise and neglected accelerations"),
    "common": (1.0, "", "variance of the error of a2 over that of the other constants of the map, at the start"),
    "most_scale": (
        0.2,
        "",
        "largest relative change of the torque scale by what the changes of the map have in common",
    ),
    "most_load": (0.1, "N m", "largest load"),
    "most_impact": (0.5, "", "largest share of a torque limit that is kept back for the impact of the partner"),
    "still_time": (0.05, "s", "time constant with which the load follows the negative balance of a joint that stands"),
    "load_drift": (1e-3, "N m/s^0.5", "random walk of the load"),
    "pause_time": (0.1, "s", "adaptation pauses so long after contact, saturation or a stop: memory of the filters"),
    "leverage_share": (0.97, "", "adaptation of a3 may take this share of the leverage at the upper limit"),
    "least_variance": (1e-12, "", "smallest variance of a relative change that a correction is divided by"),
    "allowance": (2.0, "", "K of the CUSUM: half the smallest contact worth detecting, in standard deviations"),
    "free_allowance": (3.0, "", "K of a joint that follows its reference, or whose reference does not flex clearly"),
    "misfit_time": (5.0, "s", "time constant of the mean square of negative balances"),
    "most_residual": (4.0, "", "largest of them over the standard deviation that is configured"),
    "residual_factor": (3.0, "", "variance of the balance over their mean square"),
    "least_residual": (0.7, "", "standard deviation of the balance over the configured one, at least"),
    "bias_time": (1.0, "s", "time constant of the slow part of the balance"),
    "release": (1.5, "", "standard deviations of torque below which a contact may end"),
    "release_time": (0.1, "s", "a contact ends after so long below `release`"),
    "moving_speed": (0.3, "rad/s", "a contact is contradicted by a reference that is faster,"),
    "moving_share": (0.5, "", "by a joint that has more than this share of its speed,"),
    "moving_time": (0.1, "s", "for so long"),
}
"""Fixed numbers of the law, in Python and in C: value, unit, meaning."""


def _names(kind: str, names: Sequence[str], values: Sequence[float]) -> Any:
    """A named tuple: compiled code reads its fields as constants."""
    return namedtuple(kind, names)(*values)  # type: ignore[misc, arg-type]


def _rows(kind: str, rows: Sequence[Row]) -> Any:
    return _names(kind, [row.name for row in rows], range(len(rows)))


G, S, U, OUT = _rows("G", GAINS), _rows("S", STATE), _rows("U", INPUTS), _rows("OUT", OUTPUTS)
"""Row numbers by name: of the gains, the state, the inputs and the outputs of the law."""
C = _names("C", list(CONSTANTS), [value for value, _, _ in CONSTANTS.values()])
"""CONSTANTS by name."""


def bounded_dt(dt: float) -> float:
    """The time [s] that a step may take: 0 for a dt below C.min_dt or not finite, and at most C.max_dt."""
    return min(float(dt), C.max_dt) if C.min_dt <= dt < math.inf else 0.0  # NaN fails the comparison


def _of_each_joint(hand: Hand, declared: NodeParameter, values: Any) -> Array:
    count = len(hand.joints)
    given = np.array(values, dtype=np.float64)
    if given.shape not in ((1,), (count,)):
        raise ParameterError(f"parameter {declared.name} has {given.size} values; it must have 1 or {count}")
    low, high = declared.low or 0.0, declared.high or 0.0
    if not np.all((given >= low) & (given <= high)):  # NaN fails both comparisons
        raise ParameterError(f"parameter {declared.name} is {given.tolist()}; the allowed range is {low:g} to {high:g}")
    return np.broadcast_to(given, count).copy()


if __name__ == "__main__":
    from hand_control.generated import main

    sys.exit(main())
