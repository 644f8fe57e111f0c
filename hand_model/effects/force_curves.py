"""How the force of a spring, a stop or an obstacle rises with the displacement, and by how much a law makes it steeper.

All are functions of scalars without branches, so that a compiler vectorises them over lanes.
"""

from __future__ import annotations

from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter

DEPTHS = (0.01, 0.03, 0.1)
"""Depths, as shares of the range between the stops, at which the slope of a stop or an obstacle changes."""


@inline
def engaged(depth, engagement, per_engagement):  # type: ignore[no-untyped-def]
    """Displacement [rad] of a spring that engages over a depth [rad], 0 outside, and its slope over the depth [-].

    per_engagement: 1 / engagement.
    """
    inside = max(depth, 0.0)
    soft = min(inside, engagement)
    share = soft * per_engagement
    return 0.5 * soft * share + (inside - soft), share


@inline
def steeper(x, edges, shares):  # type: ignore[no-untyped-def]
    """What a force-displacement curve of slope 1 gains up to a displacement x >= 0 [rad], and its slope there.

    shares: by how much it is steeper up to each of three edges [rad], and beyond. With none below -1 the curve with
    what it gains does not fall.
    """
    a, b, c = edges
    first, second, third, beyond = shares
    gained = first * min(x, a) + second * min(max(x - a, 0.0), b - a)
    gained += third * min(max(x - b, 0.0), c - b) + beyond * max(x - c, 0.0)
    inner, outer = first if x < a else second, third if x < c else beyond
    return gained, inner if x < b else outer


@inline
def pressed(depth, speed, spring, span, law):  # type: ignore[no-untyped-def]
    """What the law of a stop adds to its push at a depth [rad] and a speed into it [rad/s]: push, slope and damping.

    spring: stiffness, damping and engagement of the stop.  span: range of the joint [rad].  law: shares as in
    `steeper`, and the damping over the push [s/rad], by which the push may vanish and never pulls.
    """
    stiffness, damping, engagement = spring
    first, second, third, beyond, per_push = law
    x, share = engaged(depth, engagement, 1.0 / engagement)
    edges = DEPTHS[0] * span, DEPTHS[1] * span, DEPTHS[2] * span
    gained, slope = steeper(x, edges, (first, second, third, beyond))
    plain = max(stiffness * x + damping * share * speed, 0.0)
    whole, steep = stiffness * (x + gained), stiffness * (share + slope * share)
    push = stiffness * gained + per_push * speed * whole
    acts = 1.0 if push > -plain else 0.0
    return max(push, -plain), acts * (stiffness * slope * share + per_push * speed * steep), acts * (per_push * whole)


def stop_law(effect: str) -> tuple[Parameter, ...]:
    """Coefficients of a law of `pressed`. None is negative: the curve rises, and the damping takes energy."""
    up_to = [f"up to {share:.0%} of the range" for share in DEPTHS]
    slopes = tuple(
        Parameter(f"{effect}.steeper_{k}", 0.0, 200.0, f"law: share steeper {where}", 1.0, 0.0, 3.0, law=True)
        for k, where in enumerate((*up_to, "further in"), 1)
    )
    damping = f"{effect}.per_push_s_per_rad"
    return (*slopes, Parameter(damping, 0.0, 10.0, "law: damping over the push", 1.0, 0.0, 0.1, law=True))
