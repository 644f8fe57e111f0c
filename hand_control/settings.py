"""The controller's settings: one table of node parameters and what they mean once checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hand_model.description import Hand
from hand_ros.parameters import NodeParameter, ParameterError

Array = NDArray[np.float64]

_EACH = "one value, or one a joint"
PARAMETERS = (
    NodeParameter("hand_description", "", "path of hand.yaml; empty: the installed one"),
    NodeParameter("frame_id", "hand", "frame_id of every message"),
    NodeParameter("enabled_at_start", True, "drive the hand once activated, without a call of enable"),
    NodeParameter("command_lifetime_s", 0.1, "lifetime of set-points at the board", 0.01, 1.0),
    NodeParameter(
        "command_timeout_s", 0.0, "hold after it, vent after twice it; 0: none", 0.0, 3600.0, read_only=False
    ),
    NodeParameter("max_speed_deg_per_s", 400.0, "of the reference", 1.0, 2000.0, read_only=False),
    NodeParameter("reference_bandwidth_rad_per_s", 12.0, "of the shaping filter", 1.0, 100.0, read_only=False),
    NodeParameter("max_jump_deg", 30.0, "largest plausible change between two frames", 1.0, 360.0, read_only=False),
    NodeParameter("kp_nm_per_rad", [0.15], f"proportional gain, {_EACH}", 0.0, 10.0, read_only=False),
    NodeParameter("ki_nm_per_rad_s", [1.5], f"integral gain, {_EACH}", 0.0, 100.0, read_only=False),
    NodeParameter("kd_nm_s_per_rad", [0.003], f"gain on measured speed, {_EACH}", 0.0, 1.0, read_only=False),
    NodeParameter("integral_limit_nm", [0.3], f"bound of the integral, {_EACH}", 0.0, 10.0, read_only=False),
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

    @classmethod
    def of(cls, hand: Hand, values: Mapping[str, Any]) -> Settings:
        """From parameter values; missing ones take their default. Raises ParameterError, and then nothing holds."""
        full = {parameter.name: values.get(parameter.name, parameter.default) for parameter in PARAMETERS}
        for parameter in PARAMETERS:
            if not isinstance(parameter.default, list):
                parameter.check(full[parameter.name])
        return cls(
            full["command_lifetime_s"],
            full["command_timeout_s"],
            math.radians(full["max_speed_deg_per_s"]),
            full["reference_bandwidth_rad_per_s"],
            math.radians(full["max_jump_deg"]),
            *(_per_joint(hand, name, full[name]) for name in _GAINS),
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
