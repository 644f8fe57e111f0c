"""The pressure-control valve made of two switching valves: the flow through each, and the loop that pulses them.

Flow by ISO 6358-1: m' = C rho_0 p1 psi(p2 / p1), psi = 1 while choked (p2/p1 <= b), else the quarter ellipse
sqrt(1 - ((p2/p1 - b) / (1 - b))^2). Into a volume V at room temperature (isothermal, rho_0 R T_0 = P_0 = 1e5 Pa) the
pressure rises by P_0 C p1 psi / V.

Once a PWM period the loop asks for the rate (u - p) / R, R its response time, divides it by what the open valve would
give now, and opens the fill or the vent valve for that share of the period. Shares shorter than the valve can switch
are saved up until they are long enough, so no small error is left standing; within the dead-band, which is never below
what the shortest pulse moves, nothing does.
"""

from __future__ import annotations

import math

from hand_model.kernel.inline import inline

REFERENCE_PA = 1.0e5
"""rho_0 R T_0 of ISO 8778 reference conditions."""


@inline
def subsonic(ratio, critical, per_span):  # type: ignore[no-untyped-def]
    """psi of ISO 6358-1: flow as a share of the choked one at p2 / p1; per_span is 1 / (1 - critical)."""
    x = min(max((ratio - critical) * per_span, 0.0), 1.0)
    return math.sqrt(1.0 - x * x)


@inline
def open_rate(upstream_abs, downstream_abs, conductance, critical, volume):  # type: ignore[no-untyped-def]
    """Pressure rate [Pa/s] of a volume [m^3] through an open valve between absolute pressures [Pa].

    conductance: sonic conductance C [m^3/(s Pa)].  critical: critical pressure ratio b.
    """
    psi = subsonic(downstream_abs / upstream_abs, critical, 1.0 / (1.0 - critical))
    return REFERENCE_PA * conductance * upstream_abs * psi / volume


@inline
def pulse(error, saved, response, deadband, period, shortest, fill, vent):  # type: ignore[no-untyped-def]
    """Share of the next PWM period to open, positive to fill and negative to vent, and what is saved up.

    error: set-point minus pressure [Pa].  saved: share saved up so far.  response, period, shortest: [s].
    deadband: [Pa].  fill, vent: pressure rates [Pa/s] of the open valves now.
    """
    # The shortest pulse must not lead further away than the error was, or the pressure would cycle.
    step = shortest * (fill if error > 0.0 else vent)
    if abs(error) < max(deadband, 0.6 * step):
        return 0.0, 0.0
    rate = error / response
    share = rate / max(fill, 1.0) if rate > 0.0 else rate / max(vent, 1.0)
    share = min(max(share + saved, -1.0), 1.0)
    if abs(share) * period < shortest:
        return 0.0, share
    return share, 0.0
