"""The controller's settings: one table of node parameters and what they mean once checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_ros.parameters import NodeParameter, ParameterError

_EACH = "one value, or one a joint"
PARAMETERS = (
    NodeParameter("hand_description", "", "path of hand.yaml; empty: the installed one"),
    NodeParameter("grasps", "", "path of grasps.yaml; empty: the installed one"),
    NodeParameter("frame_id", "hand", "frame_id of every message"),
    NodeParameter("enabled_at_start", True, "drive the hand once activated, without a call of enable"),
    NodeParameter("command_lifetime_s", 0.1, "lifetime of set-points at the board", 0.01, 1.0),
    NodeParameter(
        "command_timeout_s", 0.0, "hold after it, vent after twice it; 0: none", 0.0, 3600.0, read_only=False
    ),
    NodeParameter("max_speed_deg_per_s", 400.0, "of the reference", 1.0, 2000.0, read_only=False),
    NodeParameter("reference_bandwidth_rad_per_s", 12.0, "of the shaping filter", 1.0, 100.0, read_only=False),
    NodeParameter("max_jump_deg", 30.0, "largest plausible change between two frames", 1.0, 360.0, read_only=False),
    NodeParameter(
        "path_tolerance_deg", 0.0, "a trajectory is aborted further off its path; 0: never", 0.0, 180.0, read_only=False
    ),
    NodeParameter(
        "goal_tolerance_deg", 0.0, "a trajectory is aborted further off its end; 0: never", 0.0, 180.0, read_only=False
    ),
    NodeParameter("goal_time_s", 1.0, "time to come within the goal's tolerance", 0.01, 60.0, read_only=False),
    NodeParameter("kp_nm_per_rad", [0.15], f"proportional gain, {_EACH}", 0.0, 10.0, read_only=False),
    NodeParameter("ki_nm_per_rad_s", [1.5], f"integral gain, {_EACH}", 0.0, 100.0, read_only=False),
    NodeParameter("kd_nm_s_per_rad", [0.003], f"gain on measured speed, {_EACH}", 0.0, 1.0, read_only=False),
    NodeParameter("integral_limit_nm", [0.6], f"bound of the integral, {_EACH}", 0.0, 10.0, read_only=False),
    NodeParameter(
        "control_mode",
        "position",
        "torque: effort is the wanted torque, position is not used",
        choices=("position", "torque"),
        read_only=False,
    ),
    NodeParameter(
        "anti_windup",
        "conditional_integration",
        "what the integrator does at a limit",
        choices=("conditional_integration", "back_calculation"),
        read_only=False,
    ),
    NodeParameter("tracking_time_s", 0.1, "of back-calculation", 0.005, 10.0, read_only=False),
    NodeParameter("speed_filter_s", 0.01, "time constant of the filter on measured speed", 1e-4, 1.0, read_only=False),
    NodeParameter(
        "max_pressure_rate_pa_per_s",
        1e8,
        "of the set-points, but for a falling torque ceiling",
        1e4,
        1e9,
        read_only=False,
    ),
    NodeParameter(
        "deadband_pa", 300.0, "smallest change of a set-point that is sent; 0: off", 0.0, 5e4, read_only=False
    ),
    NodeParameter("feed_forward", True, "pressure from the model at the reference", read_only=False),
    NodeParameter("creep_compensation", True, "the model follows the creep of the material, Eq. 12", read_only=False),
    NodeParameter(
        "gain_schedule", True, "gains from the model over angle and pressure; else the fixed ones", read_only=False
    ),
    NodeParameter("response_time_s", 0.06, "closed-loop time constant of scheduled gains", 0.01, 2.0, read_only=False),
    NodeParameter("adaptation", True, "the static map follows what free motion shows", read_only=False),
    NodeParameter("adaptation_memory_s", 60.0, "time constant of forgetting", 1.0, 1e5, read_only=False),
    NodeParameter("adaptation_bound", 2.0, "factor by which a constant may change", 1.01, 10.0, read_only=False),
    NodeParameter(
        "map_uncertainty", 0.17, "relative standard deviation of the map at first", 1e-3, 1.0, read_only=False
    ),
    NodeParameter("contact_detection", True, "from motion that differs from the expected", read_only=False),
    NodeParameter(
        "contact_false_alarms_per_hour", 1.0, "rate of false alarms wanted, a joint", 1e-4, 3600.0, read_only=False
    ),
    NodeParameter(
        "contact_torque_std_nm",
        0.004,
        "standard deviation of the torque balance in free motion",
        1e-5,
        1.0,
        read_only=False,
    ),
    NodeParameter(
        "contact_map_error",
        0.03,
        "share of the pressure's torque that identification leaves in it",
        0.0,
        0.5,
        read_only=False,
    ),
    NodeParameter(
        "observer_filter_s", 0.02, "time constant of the torque balance's filters", 0.002, 1.0, read_only=False
    ),
    NodeParameter("force_sensors", True, "contact is also what the force sensors feel", read_only=False),
    NodeParameter("grasp_speed_deg_per_s", 90.0, "of the joint with the longest way", 5.0, 400.0, read_only=False),
    NodeParameter(
        "grasp_torque_nm", 0.06, "torque limit of a closing joint until contact", 0.001, 1.0, read_only=False
    ),
    NodeParameter("contact_force_n", 0.5, "force that is a contact", 0.05, 100.0, read_only=False),
)
_GAINS = ("kp_nm_per_rad", "ki_nm_per_rad_s", "kd_nm_s_per_rad", "integral_limit_nm")


@dataclass(frozen=True, slots=True)
class Settings:
    """Checked settings of one hand; gains are (joints,)."""

    command_lifetime_s: float
    command_timeout_s: float
    max_speed_rad_s: float
    bandwidth_rad_s: float
    max_jump_rad: float
    kp: Array
    ki: Array
    kd: Array
    integral_limit: Array
    torque_mode: bool
    back_calculation: bool
    tracking_time: float
    speed_filter: float
    p_rate: float
    deadband: float
    feed_forward: bool
    creep: bool
    schedule: bool
    response_time: float
    adapt: bool
    memory: float
    adapt_bound: float
    map_uncertainty: float
    detect: bool
    false_alarms_per_hour: float
    residual_std: float
    map_error: float
    observer_filter: float
    path_tolerance_rad: float
    goal_tolerance_rad: float
    goal_time_s: float
    grasp_speed_rad_s: float
    grasp_torque_nm: float
    force_sensors: bool
    contact_force_n: float

    @classmethod
    def of(cls, hand: Hand, values: Mapping[str, Any]) -> Settings:
        """From parameter values; missing ones take their default. Raises ParameterError, and then nothing holds."""
        full = {parameter.name: values.get(parameter.name, parameter.default) for parameter in PARAMETERS}
        for parameter in PARAMETERS:
            if not isinstance(parameter.default, list):
                parameter.check(full[parameter.name])
        kp, ki, kd, integral_limit = (_per_joint(hand, name, full[name]) for name in _GAINS)
        return cls(
            command_lifetime_s=full["command_lifetime_s"],
            command_timeout_s=full["command_timeout_s"],
            max_speed_rad_s=math.radians(full["max_speed_deg_per_s"]),
            bandwidth_rad_s=full["reference_bandwidth_rad_per_s"],
            max_jump_rad=math.radians(full["max_jump_deg"]),
            kp=kp,
            ki=ki,
            kd=kd,
            integral_limit=integral_limit,
            torque_mode=full["control_mode"] == "torque",
            back_calculation=full["anti_windup"] == "back_calculation",
            tracking_time=full["tracking_time_s"],
            speed_filter=full["speed_filter_s"],
            p_rate=full["max_pressure_rate_pa_per_s"],
            deadband=full["deadband_pa"],
            feed_forward=full["feed_forward"],
            creep=full["creep_compensation"],
            schedule=full["gain_schedule"],
            response_time=full["response_time_s"],
            adapt=full["adaptation"],
            memory=full["adaptation_memory_s"],
            adapt_bound=full["adaptation_bound"],
            map_uncertainty=full["map_uncertainty"],
            detect=full["contact_detection"],
            false_alarms_per_hour=full["contact_false_alarms_per_hour"],
            residual_std=full["contact_torque_std_nm"],
            map_error=full["contact_map_error"],
            observer_filter=full["observer_filter_s"],
            path_tolerance_rad=math.radians(full["path_tolerance_deg"]),
            goal_tolerance_rad=math.radians(full["goal_tolerance_deg"]),
            goal_time_s=full["goal_time_s"],
            grasp_speed_rad_s=math.radians(full["grasp_speed_deg_per_s"]),
            grasp_torque_nm=full["grasp_torque_nm"],
            force_sensors=full["force_sensors"],
            contact_force_n=full["contact_force_n"],
        )


def _per_joint(hand: Hand, name: str, values: Any) -> Array:
    declared = next(parameter for parameter in PARAMETERS if parameter.name == name)
    count = len(hand.joints)
    gains = np.array(values, dtype=np.float64)
    if gains.shape not in ((1,), (count,)):
        raise ParameterError(f"parameter {name} has {gains.size} values; it must have 1 or {count}")
    low, high = declared.low or 0.0, declared.high or 0.0
    if not np.all((gains >= low) & (gains <= high)):  # NaN fails both comparisons
        raise ParameterError(f"parameter {name} is {gains.tolist()}; the allowed range is {low:g} to {high:g}")
    return np.broadcast_to(gains, count).copy()
