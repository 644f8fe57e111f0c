"""The actuator or its tube loses air."""

from __future__ import annotations

import math

from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter

BAR_PA = 1e5


@inline
def pressure_source(q, p, e):  # type: ignore[no-untyped-def]
    """Laminar or turbulent loss. The valve feeds against it, so the pressure stays below its set-point."""
    lost, turbulent = q
    return -lost * ((1.0 - turbulent) * p + turbulent * math.sqrt(BAR_PA * max(p, 0.0)))


EFFECT = Effect(
    name="leak",
    place="fluid",
    parameters=(
        Parameter("leak.rate_per_s", 0.0, 50.0, "share of the pressure lost in a second, at 1 bar", 1.0, 0.0, 0.1),
        Parameter("leak.turbulent", 0.0, 1.0, "0 a gap, loss with pressure; 1 a hole, with its root", 1.0, 0.0, 0.17),
    ),
    hooks={"pressure_source": pressure_source},
    keys=("leak.rate_per_s", "leak.turbulent"),
    probes=((0.2, 0.0), (1.0, 0.0), (0.2, 1.0), (1.0, 1.0)),
    shape=("leak.turbulent",),
    says="the actuator leaks with a rate of {rate_per_s} at 1 bar (turbulent share {turbulent})",
    experiments=("closed_valve_push", "hold"),
    doc="Leakage to the room: through a gap proportional to gauge pressure, through a hole to its root.",
    source="ideal gas at constant temperature through a laminar gap or an orifice, Beater, Pneumatic Drives, 2007",
)
