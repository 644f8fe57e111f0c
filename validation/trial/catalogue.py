"""What the trial can conceal: every effect, its place, its rows of the plant, and the expected parameter."""

from __future__ import annotations

import math
from dataclasses import dataclass

from validation.trial.arrays import Array
from validation.trial.plant import ROW

DEGREE = math.pi / 180.0


@dataclass(frozen=True, slots=True)
class Concealed:
    """An effect with its name and place as `hand diagnose` reports them.

    sizes: rows and their increments at size 1.  fixed: rows that are set to a value at any size.  stage: index of the
    signal it acts on, 0 pressure, 1 angle, 2 force.  everywhere: it acts on all joints.  needs: what else the case
    needs.  truth: key and value (SI) at size 1 of the parameter that `hand diagnose` should report, where the plant's
    equation has it.  most: largest size at which it still is this effect.  signed: both signs occur.
    """

    name: str
    place: str
    sizes: dict[str, float]
    fixed: dict[str, float]
    stage: int = 1
    everywhere: bool = False
    needs: str = ""
    truth: tuple[str, float] | None = None
    most: float = 1e6
    signed: bool = False

    def apply(self, q: Array, joint: int, size: float) -> None:
        """Add the effect to the parameters q (rows, joints) of a joint."""
        where = slice(None) if self.everywhere else joint
        for name, unit in self.sizes.items():
            q[ROW[name], where] += unit * size
        for name, value in self.fixed.items():
            q[ROW[name], where] = value


def _single(name: str, place: str, row: str, unit: float, **options: object) -> Concealed:
    return Concealed(name, place, {row: unit}, options.pop("fixed", {}), **options)  # type: ignore[arg-type]


KNOWN: tuple[Concealed, ...] = (
    _single("supply_droop", "supply", "droop", 0.02, fixed={"droop_share": 0.5}, stage=0, everywhere=True, most=1e3),
    _single("valve_lag", "valve", "lag_more", 0.01, stage=0, most=15.0, truth=("valve.time_constant_s", 0.0105)),
    _single("valve_delay", "valve", "delay_more", 0.01, stage=0, most=4.5, truth=("valve.dead_time_s", 0.01)),
    _single("valve_deadband", "valve", "band", 2e3, stage=0),
    Concealed("valve_flow_limit", "valve", {}, {}, stage=0, needs="inverse:choke:4.0", most=40.0),
    _single("valve_hysteresis", "valve", "bouc_valve", 2e3, stage=0, truth=("valve_hysteresis.width_pa", 2e3)),
    _single("leak", "fluid", "leak", 0.1, stage=0),
    _single("tube_lag", "fluid", "tube", 0.02, most=15.0, truth=("tube_lag.time_constant_s", 0.02)),
    _single("gas_compression", "fluid", "volume", 0.3, stage=0, most=4.0),
    Concealed("creep", "material", {"mode_1": 0.2, "mode_2": 0.4}, {}, needs="no_creep"),
    _single(
        "hysteresis",
        "material",
        "loop",
        0.005,
        fixed={"loop_scale": 0.12},
        most=10.0,
        truth=("hysteresis.torque_nm", 0.005),
    ),
    _single("stiffening", "material", "expo", 0.005, most=20.0),
    _single("ageing", "material", "age", 1e-3, most=15.0),
    _single("thermal_drift", "material", "warm", 0.005, fixed={"warm_tau": 12.0}, signed=True),
    _single("coulomb_friction", "joint", "lugre", 0.003, truth=("coulomb_friction.torque_nm", 0.003)),
    _single(
        "viscous_friction", "joint", "square_drag", 1e-3, truth=("viscous_friction.quadratic_nm_s2_per_rad2", 1e-3)
    ),
    _single("backlash", "joint", "gap", 0.5 * DEGREE, truth=("backlash.gap_deg", 0.5 * DEGREE)),
    Concealed("end_stop", "joint", {}, {"stop_soft": 2.0}, needs="nearer:stop_at", most=20.0),
    _single("gravity", "joint", "weight", 0.01, fixed={"weight_phase": 0.4}, most=15.0),
    _single("added_inertia", "joint", "mass", 5e-5),
    _single("joint_coupling", "joint", "tendon", 0.005, most=5.0),
    Concealed("contact", "environment", {}, {"wall_k": 0.8}, needs="nearer:wall_at", most=20.0),
    _single(
        "constant_load", "environment", "load", 0.01, most=10.0, truth=("constant_load.torque_nm", 0.01), signed=True
    ),
    _single(
        "angle_offset",
        "angle_sensor",
        "offset",
        DEGREE,
        signed=True,
        most=15.0,
        truth=("angle_offset.offset_deg", DEGREE),
    ),
    _single("angle_gain", "angle_sensor", "gain", 0.02, signed=True, most=10.0),
    _single("hall_misalignment", "angle_sensor", "eccentric", 0.5 * DEGREE, fixed={"eccentric_phase": 0.8}, most=20.0),
    _single("angle_lag", "angle_sensor", "late", 0.01, most=15.0, truth=("angle_lag.time_constant_s", 0.01)),
    _single(
        "pressure_offset",
        "pressure_sensor",
        "p_offset",
        2e3,
        stage=0,
        signed=True,
        truth=("pressure_offset.offset_pa", 2e3),
    ),
    _single("pressure_gain", "pressure_sensor", "p_gain", 0.02, stage=0, signed=True, most=10.0),
    _single("fsr_gain", "force_sensor", "force_gain", 0.05, stage=2, needs="known_wall", most=10.0),
    _single("fsr_drift", "force_sensor", "force_creep", 0.05, stage=2, needs="known_wall", most=10.0),
    _single("fsr_hysteresis", "force_sensor", "force_loop", 0.02, stage=2, needs="known_wall", most=15.0),
    Concealed("clock_offset", "timing", {}, {}, needs="clock", most=15.0, truth=("clock_offset.offset_s", 0.01)),
    Concealed("dropped_frames", "timing", {}, {}, needs="drop"),
)
FOREIGN: tuple[Concealed, ...] = (
    _single("shaking_base", "unknown", "shake", 0.005, fixed={"shake_hz": 2.3}),
    _single("cogging", "unknown", "ripple", 0.005),
    _single("wandering_load", "unknown", "wander", 0.01),
    _single("valve_chatter", "unknown", "chatter", 1e3, stage=0),
    _single("snapping_elasticity", "unknown", "switch", 0.1),
)
BY_NAME = {concealed.name: concealed for concealed in (*KNOWN, *FOREIGN)}
