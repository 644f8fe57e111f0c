"""The valve is slower than its model: a longer time constant, a further one or two, or another one by the error."""

from __future__ import annotations

import math

import numpy as np

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect, Times
from hand_model.effects.operators import second_order_constants
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter

SMALL_SHARE = 0.05
"""Share of the supply pressure up to which an error of the pressure counts as small."""


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Constants of the spool on its way up and down, the reciprocal of the ratio while venting, and small errors."""
    tau, venting, _, _, _, inertia, returning, _, supply = q
    even, odd, slowness = second_order_constants(tau, inertia, h)
    even_down, odd_down, slowness_down = second_order_constants(returning * tau, inertia, h)
    return even, odd, slowness, even_down, odd_down, slowness_down, 1.0 / venting, SMALL_SHARE * supply


@inline
def set_point(q, m, u, p, e, h):  # type: ignore[no-untyped-def]
    """First-order lag ahead of the valve's own: its mean over the step, in which u is constant.

    The law gives the lag an inertia mu, as of a spool on its spring: mu tau^2 s'' + tau s' + s = u, a complex pair of
    poles from mu = 1/4 on. And it feeds the error of the pressure back with the gain k. Without inertia this is,
    with the valve's own lag T, tau T p'' + (tau + T) p' + (1 + k) p = (1 + k) u, stable for every k >= 0. With inertia
    it is stable, whatever T, while k < 1/mu; so k / (1 + k mu) is used. Nothing of it leaves an error at rest. The
    pressure in the middle of the step is extrapolated from the last one. On its way back a spool may have another tau,
    as one that a coil pulls and a spring returns.
    """
    resonance, inertia = q[2], q[5]
    lagged, last, moving = m
    toward = u + resonance / (1.0 + resonance * inertia) * (u - p - 0.5 * (p - last))
    behind = lagged - toward
    down = 1.0 if behind > 0.0 else 0.0  # selected values would be conditional reads, which are not vectorised
    even, odd, slowness = q[9] + down * (q[12] - q[9]), q[10] + down * (q[13] - q[10]), q[11] + down * (q[14] - q[11])
    remaining = (even + odd) * behind + 2.0 * inertia * odd * moving
    going = (even - odd) * moving - 2.0 * odd * behind
    mean = toward + ((behind - remaining) + inertia * (moving - going)) * slowness
    return mean, (toward + remaining, p, going)


@inline
def valve_error(q, error):  # type: ignore[no-untyped-def]
    """Venting has a time constant of its own.

    The law lets the time constant go over from one to the other within an error, and be another one for small errors.
    The rate rises with the error for all values within their bounds.
    """
    venting, blend, small, per_venting, small_pa = q[1], q[3], q[4], q[15], q[16]
    sharp = error if error > 0.0 else error * per_venting
    root = math.sqrt(error * error + blend * blend) + 1e-300
    smooth = error / (1.0 + 0.5 * (venting - 1.0) * (1.0 - error / root))
    return (smooth if blend > 0.0 else sharp) / (1.0 + small * small_pa / (abs(error) + small_pa))


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Share of a small step of the set-point that the pressure has made after the time x [s].

    What is left of it solves the equation of `set_point` with the valve's own lag, from 1 at rest.
    """
    from scipy.linalg import expm  # noqa: PLC0415 - slow to import, and no node draws a curve

    tau, inertia = max(q[0], 1e-6), q[5]
    own = q[7] * (1.0 + q[4]) * (1.0 + 0.5 * (q[1] - 1.0) if q[3] > 0.0 else 1.0)
    gain = q[2] / (1.0 + q[2] * inertia)
    left = np.trim_zeros((1.0 + gain, tau + own, (inertia * tau + own) * tau, inertia * tau * tau * own), "b")
    order = len(left) - 1
    unit = (left[-1] / left[0]) ** (1.0 / order)
    scaled = np.array(left) / unit ** np.arange(order + 1.0)
    rates = np.eye(order, k=1)
    rates[-1] = -scaled[:-1] / scaled[-1]
    return float(1.0 - expm(rates * (x / unit))[0, 0])


EFFECT = Effect(
    name="valve_lag",
    place="valve",
    needs=("valve",),
    parameters=(
        Parameter("valve_lag.time_constant_s", 0.0, 1.0, "second lag of the valve", 1.0, 0.0, 0.03),
        Parameter("valve_lag.venting_ratio", 0.2, 5.0, "time constant while venting over that while filling", 1.0, 1.0),
        Parameter(
            "valve_lag.resonance", 0.0, 50.0, "law: feedback of the pressure into the lag", 1.0, 0.0, 1.0, law=True
        ),
        Parameter(
            "valve_lag.blend_pa",
            0.0,
            2e5,
            "law: error within which filling goes over to venting",
            1.0,
            0.0,
            1e4,
            law=True,
        ),
        Parameter("valve_lag.small", -0.8, 4.0, "law: longer time constant of small errors", 1.0, 0.0, 0.2, law=True),
        Parameter(
            "valve_lag.inertia_ratio",
            0.0,
            6.0,
            "law: inertia of the lag; poles are complex above 0.25",
            1.0,
            0.0,
            0.5,
            law=True,
        ),
        Parameter(
            "valve_lag.returning_ratio", 0.2, 5.0, "law: lag on the way down over that up", 1.0, 1.0, 0.3, law=True
        ),
    ),
    reads=("valve.time_constant_s", "supply.pressure_pa"),
    prepared=("even", "odd", "slowness", "even_down", "odd_down", "slowness_down", "per_venting", "small_pa"),
    memory={"lagged": "pressure", "last": "pressure", "moving": 0.0},
    law_memory=("last", "moving"),
    hooks={"prepare": prepare, "set_point": set_point, "valve_error": valve_error},
    keys=("valve_lag.time_constant_s", "valve.time_constant_s", "valve_lag.venting_ratio"),
    probes=((0.02, Times(1.0), 1.0), (0.08, Times(1.0), 1.0), (0.0, Times(1.6), 1.0), (0.0, Times(0.5), 1.0)),
    spread={"valve_lag.venting_ratio": 0.2},
    shape=("valve.time_constant_s", "valve_lag.venting_ratio"),
    says="the valve is slower than modelled: lags of {time_constant_s} ({venting_ratio} times that while venting)",
    experiments=("steps", "multisine"),
    doc="A valve of second order, or of another time constant than the nominal one, or one while venting.",
    source="Eq. 8's separately identified valve, Martin et al. 2004",
    constitution=Constitution(
        acts_on="pressure behind the valve",
        sign="follows the set-point, without an error at rest",
        monotone="the rate rises with the error; all poles are stable",
        memory="one to three poles, real or a complex pair",
        over=("time", "direction", "pressure error"),
        coefficients=(
            "valve_lag.resonance",
            "valve_lag.blend_pa",
            "valve_lag.small",
            "valve_lag.inertia_ratio",
            "valve_lag.returning_ratio",
        ),
        quantity="the share of a step that the {pressure} has made",
        curve=curve,
        source="Routh's criterion for polynomials of second and third order; Merritt, Hydraulic Control Systems, 1967,"
        " spool valves as a second-order lag; Ljung, System Identification, 1999, process models",
    ),
)
