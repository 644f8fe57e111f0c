"""Numbers of a plain joint for tests of equations."""

from __future__ import annotations

SUPPLY_PA = 6e5
PLAIN = {
    "supply.pressure_pa": SUPPLY_PA,
    "valve.fill_rate_pa_per_s": 4e6,
    "valve.vent_rate_pa_per_s": 3e6,
    "statics.a0_nm": -0.01,
    "statics.a1_nm_per_rad": -0.05,
    "statics.a2_nm_per_pa": 4e-7,
    "statics.a3_nm_per_pa_rad": -1e-7,
    "valve.time_constant_s": 0.02,
    "dynamics.viscous_friction_nm_s_per_rad": 2e-3,
    "end_stop.low_deg": -0.2,
    "end_stop.high_deg": 1.7,
    "end_stop.stiffness_nm_per_rad": 1.0,
    "end_stop.damping_nm_s_per_rad": 2e-3,
    "end_stop.engagement_deg": 0.02,
    "contact.angle_deg": 0.9,
    "contact.stiffness_nm_per_rad": 0.5,
    "contact.damping_nm_s_per_rad": 1e-3,
    "contact.engagement_deg": 0.02,
    "material.phi_max_deg": 0.5,
    "material.p_min_pa": 5e4,
    "material.b1_per_pa": 1.8e-6,
    "material.extension_time_s": 25.0,
    "dynamics.inertia_kg_m2": 4e-4,
    "gravity.sine_nm": 0.06,
    "gravity.cosine_nm": -0.02,
    "spring.stiffness_nm_per_rad": 0.03,
    "constant_load.torque_nm": 0.01,
    "drive_gain.error": 0.0,
    "drive_saturation.limit_nm": 1e3,
    "drive_saturation.stiffness_nm_per_rad": 0.0,
    "drive_saturation.damping_nm_s_per_rad": 0.0,
}
"""Numbers of the plain plant and of other effects that equations read, SI."""
