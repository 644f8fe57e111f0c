"""The silicone creeps: the rest angle follows the pressure over tens of seconds. Its law is part of the plain plant."""

from __future__ import annotations

from hand_model.effects.effect import Effect, Times

_KEYS = ("phi_max_deg", "extension_time_s", "recovery_time_s", "p_min_pa", "b1_per_pa", "b0_per_pa")

EFFECT = Effect(
    name="creep",
    place="material",
    keys=tuple(f"material.{key}" for key in _KEYS),
    probes=(
        (60.0, 25.0, 40.0, Times(1.0), Times(1.0), Times(1.0)),
        (30.0, 8.0, 12.0, Times(1.0), Times(1.0), Times(1.0)),
        (40.0, 80.0, 100.0, Times(1.0), Times(1.0), Times(1.0)),
        (Times(1.5), Times(1.0), Times(1.0), Times(1.0), Times(1.0), Times(1.0)),
        (Times(0.5), Times(1.0), Times(1.0), Times(1.0), Times(1.0), Times(1.0)),
    ),
    spread={"material.p_min_pa": 0.3, "material.b1_per_pa": 0.2, "material.b0_per_pa": 0.2},
    shape=("material.extension_time_s", "material.recovery_time_s"),
    says="the material creeps by up to {phi_max_deg}, with time constants of {extension_time_s} under"
    " {pressure} and {recovery_time_s} in recovery",
    experiments=("staircase", "hold"),
    doc="Viscoelastic shift of the rest angle in three zones: extension, hold, recovery.",
    source="Eqs. 11-13, Martin et al. 2004",
)
