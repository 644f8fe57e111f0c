"""The static curve depends on the direction from which it is reached, at any speed."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.effects.operators import direction, loop_growth
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import DEGREE, Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Reciprocal of the motion over which the loop builds up."""
    return (1.0 / q[1],)


@inline
def _growth(q, a):  # type: ignore[no-untyped-def]
    """Growth of the loop per motion over its scale, and how fast it falls with a, the loop's state along the motion.

    The textbook form falls to 0 at a = 1. So do the four terms of the law, whose weights are not negative: two that
    are stiff after a reversal, and two that stay stiff up to a knee.
    """
    sharp, unload_2, unload_4, knee_4, knee_8 = q[2:7]
    forward, v = max(a, 0.0), 0.5 - 0.5 * a
    v2, f2 = v * v, forward * forward
    f4 = f2 * f2
    added = unload_2 * v2 + unload_4 * v2 * v2 + knee_4 * (1.0 - f4) + knee_8 * (1.0 - f4 * f4)
    falls = unload_2 * v + 2.0 * unload_4 * v * v2 + 4.0 * knee_4 * f2 * forward + 8.0 * knee_8 * f4 * f2 * forward
    return loop_growth(a, 1.0, sharp) + added, ((1.0 - sharp) + 2.0 * sharp * forward) + falls


@inline
def torque(q, m, phi, omega, p, creep_angle, e):  # type: ignore[no-untyped-def]
    """Dahl's loop, or Bouc's and Wen's: a torque against the motion that needs an angle to build up.

    The law adds elements in parallel that stick, then slip (Jenkin), each after its share of the scale.
    """
    height, a, b, c, d, e_, f, per_scale = q[0], q[7], q[8], q[9], q[10], q[11], q[12], q[13]
    loop, z_1, z_2, z_3, z_4, z_5, z_6 = m
    toward = direction(omega)
    stops = a * z_1 + b * z_2 + c * z_3 + d * z_4 + e_ * z_5 + f * z_6
    held = 8.0 * a if z_1 * toward < 1.0 else 0.0
    held += 4.0 * b if z_2 * toward < 1.0 else 0.0
    held += (8.0 / 3.0) * c if z_3 * toward < 1.0 else 0.0
    held += 2.0 * d if z_4 * toward < 1.0 else 0.0
    held += (4.0 / 3.0) * e_ if z_5 * toward < 1.0 else 0.0
    held += f if z_6 * toward < 1.0 else 0.0
    return height * -loop - stops, height * (_growth(q, loop * toward)[0] * per_scale) + held * per_scale


@inline
def moved(q, m, before, after, h):  # type: ignore[no-untyped-def]
    """The loop follows the motion, by the step of `loop_moved` (operators.py)."""
    loop, z_1, z_2, z_3, z_4, z_5, z_6 = m
    on = (after - before) * q[13]
    way = abs(after - before) * q[13]
    toward = 1.0 if after > before else -1.0
    a = loop * toward
    growth, falls = _growth(q, a)
    x = way * falls
    half = 1.0 + 0.5 * x
    return (
        toward * min(a + way * growth * half / (1.0 + x * half), 1.0),
        min(max(z_1 + 8.0 * on, -1.0), 1.0),
        min(max(z_2 + 4.0 * on, -1.0), 1.0),
        min(max(z_3 + (8.0 / 3.0) * on, -1.0), 1.0),
        min(max(z_4 + 2.0 * on, -1.0), 1.0),
        min(max(z_5 + (4.0 / 3.0) * on, -1.0), 1.0),
        min(max(z_6 + on, -1.0), 1.0),
    )


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Stiffness of the loop [N m/rad] at the state x, -1 after a reversal and 1 where it is closed; without stops."""
    return float(q[0] * _growth(q, x)[0] * q[13])


_SHAPES = tuple(
    Parameter(f"hysteresis.{name}", 0.0, 20.0, f"law: {doc}", 1.0, 0.0, 0.5, law=True)
    for name, doc in (
        ("unload_2", "growth with the square of the way back"),
        ("unload_4", "growth with its fourth power"),
        ("knee_4", "growth that the fourth power of the loop ends"),
        ("knee_8", "growth that the eighth power of the loop ends"),
    )
)
_STOPS = tuple(
    Parameter(
        f"hysteresis.stop_{k}_nm",
        0.0,
        1.0,
        f"law: element that slips after {share} of the scale",
        1.0,
        0.0,
        0.003,
        law=True,
    )
    for k, share in enumerate(("1/8", "1/4", "3/8", "1/2", "3/4", "all"), 1)
)
EFFECT = Effect(
    name="hysteresis",
    place="material",
    needs=("elastic_part",),
    parameters=(
        Parameter("hysteresis.torque_nm", 0.0, 1.0, "half the height of the loop", 1.0, 0.0, 0.01),
        Parameter("hysteresis.scale_deg", 2.0, 60.0, "motion after which the loop is closed to 1/e", DEGREE, 8.0, 6.0),
        Parameter("hysteresis.sharpness", 0.0, 1.0, "0 a rounded loop, 1 one with a knee", 1.0, 0.0, 0.17),
        *_SHAPES,
        *_STOPS,
    ),
    prepared=("per_scale",),
    memory=("loop", "stop_1", "stop_2", "stop_3", "stop_4", "stop_5", "stop_6"),
    law_memory=("stop_1", "stop_2", "stop_3", "stop_4", "stop_5", "stop_6"),
    hooks={"prepare": prepare, "torque": torque, "moved": moved},
    keys=("hysteresis.torque_nm", "hysteresis.scale_deg", "hysteresis.sharpness"),
    probes=((0.01, 4.0, 0.0), (0.01, 12.0, 0.0), (0.01, 30.0, 0.0), (0.01, 8.0, 1.0)),
    shape=("hysteresis.scale_deg", "hysteresis.sharpness"),
    says="the static curve has a hysteresis loop of {torque_nm} on either side, built up over {scale_deg}",
    experiments=("slow_triangle", "reversals"),
    doc="Rate-independent hysteresis of elastomer and fabric.",
    source="Dahl, A Solid Friction Model, 1968; Wen, J. Eng. Mech. 102(2), 1976, of the second power where sharp",
    constitution=Constitution(
        acts_on="torque of the joint",
        sign="against the motion since a reversal",
        passive=True,
        monotone="the torque grows along a motion, ever more slowly, up to the height of the loop",
        memory="states that change with the motion only, at any speed",
        over=("state of the loop",),
        coefficients=tuple(parameter.key for parameter in _SHAPES + _STOPS),
        quantity="the stiffness of the loop",
        unit="nm_per_rad",
        curve=curve,
        source="Duhem's operator, Visintin, Differential Models of Hysteresis, 1994, ch. V; Oh and Bernstein, IEEE TAC"
        " 50(5), 2005; Iwan, J. Appl. Mech. 33(4), 1966, for elements in parallel",
    ),
)
