"""What acts on a joint besides its actuator: smooth end stops, obstacles. Eq. 8's M_d, in parts."""

from __future__ import annotations

from numba import njit


@njit(cache=True, forceinline=True, fastmath={"contract", "nnan", "nsz"})
def one_sided(depth, speed, stiffness, damping, engagement, per_engagement):  # type: ignore[no-untyped-def]
    """Torque [N m] of a stop pressed to a depth [rad] at a speed [rad/s] into it; 0 outside.

    Stiffness grows linearly over the engagement depth [rad], so torque is once continuously differentiable;
    the damper engages with it and never pulls (after Hunt and Crossley, 1975). A part of Eq. 8's M_d.
    per_engagement is 1 / engagement: a kernel divides once only.
    """
    inside = max(depth, 0.0)
    soft = min(inside, engagement)
    share = soft * per_engagement
    spring = stiffness * (0.5 * soft * share + (inside - soft))
    return max(spring + damping * share * speed, 0.0)
