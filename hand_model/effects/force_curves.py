"""How the force of a spring, a stop or an obstacle rises with the displacement, and by how much a law makes it steeper.

All are functions of scalars without branches, so that a compiler vectorises them over lanes.
"""

from __future__ import annotations

from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter

DEPTHS = (0.03, 0.1, 0.4)
"""Depths, as shares of the range between the stops, between which the slope of a stop or an obstacle changes."""


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
def steeper(x, nodes, shares):  # type: ignore[no-untyped-def]
    """What a force-displacement curve of slope 1 gains up to a displacement x >= 0, and its slope there [-].

    shares: by how much it is steeper at 0 and at each of three nodes; in between the slope changes in proportion to the
    displacement, and beyond the last node not any more. x and the nodes have one unit, which is that of the gain. With
    no share below -1 the curve with what it gains does not fall.
    """
    a, b, c = nodes
    zero, first, second, third = shares
    t, u, v = min(x, a), min(max(x - a, 0.0), b - a), min(max(x - b, 0.0), c - b)
    i, j, k = (first - zero) * (1.0 / a), (second - first) * (1.0 / (b - a)), (third - second) * (1.0 / (c - b))
    gained = (zero + 0.5 * i * t) * t + (first + 0.5 * j * u) * u
    gained += (second + 0.5 * k * v) * v + third * max(x - c, 0.0)
    return gained, zero + i * t + (j * u + k * v)


@inline
def pressed(depth, speed, spring, span, law):  # type: ignore[no-untyped-def]
    """What the law of a stop adds to its push at a depth [rad] and a speed into it [rad/s]: push, slope and damping.

    spring: stiffness, damping and engagement of the stop.  span: range of the joint [rad].  law: shares as in
    `steeper`, and the damping over the push [s/rad], by which the push may vanish and never pulls.
    """
    stiffness, damping, engagement = spring
    x, share = engaged(depth, engagement, 1.0 / engagement)
    shares, slope = steeper(x * (1.0 / span), DEPTHS, law[:4])
    gained, per_push = span * shares, law[4]
    plain = max(stiffness * x + damping * share * speed, 0.0)
    whole, steep = stiffness * (x + gained), stiffness * (share + slope * share)
    push = stiffness * gained + per_push * speed * whole
    acts = 1.0 if push > -plain else 0.0
    return max(push, -plain), acts * (stiffness * slope * share + per_push * speed * steep), acts * (per_push * whole)


def stop_law(effect: str) -> tuple[Parameter, ...]:
    """Coefficients of a law of `pressed`. None is negative: the curve rises, and the damping takes energy."""
    depths = [f"{share:.0%} of the range" for share in DEPTHS]
    slopes = tuple(
        Parameter(f"{effect}.steeper_{k}", 0.0, 200.0, f"law: share steeper at {where}", 1.0, 0.0, 3.0, law=True)
        for k, where in enumerate(("the surface", *depths), 1)
    )
    damping = f"{effect}.per_push_s_per_rad"
    return (*slopes, Parameter(damping, 0.0, 10.0, "law: damping over the push", 1.0, 0.0, 0.1, law=True))
