"""Parameters of the plain plant of a joint, each declared once: key in the YAML file, unit, bounds, meaning.

Their order is the order of the first rows of every parameter array. The parameters of the effects follow (rows.py).
Equation numbers are those of Martin et al., Int. J. Humanoid Robotics 1(3), 2004.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

DEGREE = math.pi / 180.0
STEP_S = 0.5e-3
"""Largest integration step of the plant [s]; the description refuses a joint whose dynamics are too fast for it."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of a joint's model.

    key: "group.name" in the YAML file; the name ends in the unit of the value in the file.
    low, high: allowed range, in the unit of the file.  scale: factor from that unit to SI.
    neutral: the value, in the unit of the file, that switches the effect off where the parameter belongs to an
    optional effect; it is also the default of a file that omits the group.  None: the file must give the value.
    typical: common size of the effect, in the unit of the file; a search uses it as prior scale and first trial.
    law: whether it is a coefficient of a learned law; its neutral value leaves the textbook form.
    """

    key: str
    low: float
    high: float
    doc: str
    scale: float = 1.0
    neutral: float | None = None
    typical: float = 0.0
    law: bool = False

    @property
    def neutral_si(self) -> float:
        """The neutral value in SI; 0 where the parameter has none."""
        return (self.neutral or 0.0) * self.scale


PLANT_PARAMETERS: tuple[Parameter, ...] = (
    Parameter("valve.dead_time_s", 0.0, 0.05, "command to first reaction of the pressure", 1.0, None, 0.01),
    Parameter("valve.time_constant_s", 0.001, 2.0, "first-order lag of the pressure valve"),
    Parameter("valve.fill_rate_pa_per_s", 1e3, 1e9, "fastest pressure rise the valve can feed"),
    Parameter("valve.vent_rate_pa_per_s", 1e3, 1e9, "fastest pressure fall the valve can exhaust"),
    Parameter("statics.a0_nm", -5.0, 5.0, "Eq. 6, torque at zero pressure and angle"),
    Parameter("statics.a1_nm_per_rad", -10.0, -1e-6, "Eq. 6, elasticity of the chamber; extends the joint"),
    Parameter("statics.a2_nm_per_pa", 1e-8, 1e-4, "Eq. 6, torque per pressure at zero angle"),
    Parameter("statics.a3_nm_per_pa_rad", -1e-4, 1e-4, "Eq. 6, change of that torque with the angle"),
    Parameter("material.phi_max_deg", 0.0, 180.0, "Eq. 11, rest angle shift at full creep", DEGREE, 0.0, 40.0),
    Parameter("material.p_min_pa", 1.0, 6e5, "Eq. 12, pressure below which nothing creeps", 1.0, 5e4),
    Parameter("material.b1_per_pa", 1e-8, 1e-3, "Eq. 12, creeping ratio per pressure, extension", 1.0, 1 / 5.5e5),
    Parameter("material.extension_time_s", 0.01, 1e5, "Eq. 13, b1/b3, time constant of extension", 1.0, 25.0),
    Parameter("material.b0_per_pa", 1e-8, 1e-3, "Eq. 12, creeping ratio per pressure, recovery", 1.0, 1 / 4.5e5),
    Parameter("material.recovery_time_s", 0.01, 1e5, "Eq. 13, b0/b2, time constant of recovery", 1.0, 40.0),
    Parameter("dynamics.inertia_kg_m2", 1e-7, 1.0, "Eq. 8, J about this joint, all joints beyond it locked"),
    Parameter("dynamics.viscous_friction_nm_s_per_rad", 0.0, 10.0, "Eq. 8, d"),
    Parameter("dynamics.coupling_inertia_kg_m2", 0.0, 1.0, "inertia shared with the partner phalanx", 1.0, 0.0),
    Parameter("end_stop.low_deg", -180.0, 180.0, "angle at which the extension stop begins", DEGREE, None, 15.0),
    Parameter("end_stop.high_deg", -180.0, 360.0, "angle at which the flexion stop begins", DEGREE, None, 15.0),
    Parameter("end_stop.stiffness_nm_per_rad", 0.0, 100.0, "of both stops, fully engaged"),
    Parameter("end_stop.damping_nm_s_per_rad", 0.0, 1.0, "of both stops, fully engaged"),
    Parameter("end_stop.engagement_deg", 0.01, 30.0, "penetration over which a stop engages", DEGREE),
    Parameter("constant_load.torque_nm", -10.0, 10.0, "Eq. 8, M_d; positive resists flexion", 1.0, 0.0, 0.03),
    Parameter("contact.angle_deg", -30.0, 360.0, "angle at which an obstacle begins", DEGREE, 360.0, 40.0),
    Parameter("contact.stiffness_nm_per_rad", 0.0, 100.0, "of the obstacle, fully engaged", 1.0, 0.0, 0.5),
    Parameter("contact.damping_nm_s_per_rad", 0.0, 1.0, "of the obstacle, fully engaged", 1.0, 0.0),
    Parameter("contact.engagement_deg", 0.01, 30.0, "penetration over which the obstacle engages", DEGREE, 1.0),
    Parameter("supply.pressure_pa", 1e3, 2e6, "of the whole hand, gauge; no valve delivers more"),
)

PLANT_ROW: dict[str, int] = {parameter.key: row for row, parameter in enumerate(PLANT_PARAMETERS)}
"""Row of a parameter of the plain plant by its key."""
