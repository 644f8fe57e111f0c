"""A hydraulic fluid instead of air: the valve feeds volume, whatever the pressure; second case of Eq. 7.

A search does not try it. The description chooses it with `fluid: hydraulic`.
"""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import ANGLE, SPEED, Effect
from hand_model.kernel.inline import inline, inlined
from hand_model.kernel.plant_rows import Parameter
from hand_model.statics import leverage

_leverage = inlined(leverage)


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Pressure per displaced volume [Pa/m^3]."""
    share, growth = q[0], q[1]
    return (share / growth,)


@inline
def pressure_source(q, p, e):  # type: ignore[no-untyped-def]
    """Only the valve changes the volume c_V p + (a2 + a3 phi / 2) phi: motion changes the pressure at once."""
    a2, a3, per_volume = q[2], q[3], q[4]
    return -per_volume * _leverage(e[ANGLE], a2, a3) * e[SPEED]


EFFECT = Effect(
    name="hydraulic",
    place="fluid",
    needs=("chamber",),
    parameters=(
        Parameter("hydraulic.share", 0.0, 1.0, "1: an incompressible fluid, Eq. 7; set by `fluid`", 1.0, 0.0, 1.0),
        Parameter("hydraulic.volume_m3_per_pa", 1e-14, 1e-9, "growth of the chamber with pressure", 1.0, 1.2e-12),
    ),
    reads=("statics.a2_nm_per_pa", "statics.a3_nm_per_pa_rad"),
    prepared=("pa_per_m3",),
    hooks={"prepare": prepare, "pressure_source": pressure_source},
    says="the fluid is a liquid",
    doc="Constant volume of an incompressible fluid in an elastic chamber.",
    source="Eq. 7, Martin et al. 2004, with the volume map tied to Eq. 6 by virtual work",
    constitution=Constitution(
        acts_on="rate of the pressure",
        sign="opposes the change of volume",
        passive=True,
        monotone="in proportion to the speed",
        over=("angle", "speed"),
        source="conservation of volume, Eq. 7, Martin et al. 2004",
    ),
)
