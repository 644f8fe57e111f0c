"""The equations of the plain plant as functions of scalars: static torque, creep and the pulsed pressure valve.

Fast checks at single points against formulas computed here; test_statics.py, test_material.py and
test_switching_valve.py hold the properties and the behaviour in the kernel.
"""

from __future__ import annotations

import numpy as np
import pytest
from pytest import approx

from hand_model import material, pressure_loop, statics

A0, A1, A2, A3, PHI_MAX = -0.01, -0.0573, 1.12e-6, -5.6e-7, 1.05
POINTS = ((0.0, 0.0, 0.0), (3e5, 0.7, 0.4), (5e5, -0.2, 1.0))
"""Pressure [Pa], angle [rad], creeping ratio."""


@pytest.mark.parametrize(("p", "phi", "creep"), POINTS)
def test_static_map_is_equation_11(p: float, phi: float, creep: float) -> None:
    """Fails when a term of Eq. 11, its inverse in the pressure, its rest angle or its slope is wrong."""
    expected = A0 + A1 * phi - A1 * creep * PHI_MAX + A2 * p + A3 * phi * p
    coefficients = (A0, A1, A2, A3, PHI_MAX)
    assert statics.torque(p, phi, creep, *coefficients) == approx(expected, abs=1e-15)
    assert statics.pressure_for_torque(expected, phi, creep, *coefficients) == approx(p, abs=1e-6)
    assert statics.equilibrium_angle(p, creep, expected, *coefficients) == approx(phi, abs=1e-12)
    assert statics.leverage(phi, A2, A3) == approx(A2 + A3 * phi)
    assert statics.stiffness(p, A1, A3) == approx(A1 + A3 * p)


@pytest.mark.parametrize(("p", "phi"), [(0.0, 0.0), (3e5, 0.7), (1e5, -0.3)])
def test_volume_belongs_to_the_static_map_by_virtual_work(p: float, phi: float) -> None:
    """Fails when the volume does not grow with the angle by dM/dp, with the pressure by c_V, or starts elsewhere."""
    volume = statics.chamber_volume(p, phi, 2e-6, 1.2e-12, A2, A3)
    assert volume == approx(2e-6 + 1.2e-12 * p + A2 * phi + A3 * phi * phi / 2.0, rel=1e-12)


def test_creep_has_three_zones() -> None:
    """Fails when extension, hold or recovery has another target, another rate or another boundary than Eqs. 12, 13."""
    p_min, b1, b0, extension_s, recovery_s = 5e4, 1 / 5.5e5, 1 / 4.5e5, 25.0, 40.0
    for p, creep, rate in (
        (3e5, 0.1, (b1 * (3e5 - p_min) - 0.1) / extension_s),
        (3e5, b1 * (3e5 - p_min), 0.0),
        (3e5, 0.5 * (b1 * (3e5 - p_min) + b0 * 3e5), 0.0),
        (3e5, b0 * 3e5, 0.0),
        (3e5, 0.9, (b0 * 3e5 - 0.9) / recovery_s),
        (0.0, 0.3, -0.3 / recovery_s),
    ):
        result = material.creep_rate(p, creep, p_min, b1, 1.0 / extension_s, b0, 1.0 / recovery_s)
        assert result == approx(rate, abs=1e-15)


def test_flow_is_that_of_iso_6358() -> None:
    """Fails when the flow is not choked below the critical ratio, not elliptic above, or enters another volume."""
    for ratio, share in ((0.0, 1.0), (0.3, 1.0), (0.65, np.sqrt(0.75)), (1.0, 0.0), (1.2, 0.0)):
        assert pressure_loop.subsonic(ratio, 0.3, 1.0 / 0.7) == approx(share, abs=1e-12)
        rate = pressure_loop.open_rate(5e5, ratio * 5e5, 3e-10, 0.3, 2e-6)
        assert rate == approx(1e5 * 3e-10 * 5e5 * share / 2e-6, abs=1e-3)


def test_pulse_asks_for_the_error_over_the_response_time() -> None:
    """Fails when a share, its sign, the dead-band, the shortest pulse or what is saved up is wrong."""
    response, deadband, period, shortest, fill, vent = 0.03, 500.0, 0.01, 5e-4, 4e6, 2e6

    def pulse(error: float, saved: float = 0.0) -> tuple[float, float]:
        share, kept = pressure_loop.pulse(error, saved, response, deadband, period, shortest, fill, vent)
        return float(share), float(kept)

    assert pulse(3e4) == approx((3e4 / 0.03 / 4e6, 0.0))
    assert pulse(-3e4) == approx((-3e4 / 0.03 / 2e6, 0.0))
    assert pulse(3e4, 0.1) == approx((3e4 / 0.03 / 4e6 + 0.1, 0.0))
    assert pulse(1e6) == (1.0, 0.0)
    assert pulse(-1e6) == (-1.0, 0.0)
    assert pulse(4e3) == approx((0.0, 4e3 / 0.03 / 4e6))  # 0.33 ms: too short, saved up
    assert pulse(4e3, 0.02) == approx((4e3 / 0.03 / 4e6 + 0.02, 0.0))
    assert pulse(-1.5e3, 0.01) == approx((0.0, -1.5e3 / 0.03 / 2e6 + 0.01))
    assert pulse(1.19e3, 0.04) == (0.0, 0.0)  # below 0.6 of what the shortest pulse fills, 1.2 kPa
    assert pulse(1.21e3, 0.04)[0] > 0.04
    assert pulse(-0.59e3, -0.06) == (0.0, 0.0)  # and of what it vents, 0.6 kPa
    assert pulse(-0.61e3, -0.06)[0] < -0.06
    exactly = 5e-4 / 1e-2 * 0.03 * 4e6
    assert pulse(exactly)[0] == approx(0.05)
    still = pressure_loop.pulse(-600.0, 0.0, response, deadband, period, 0.0, fill, 0.0)
    assert still == (-1.0, 0.0)  # a valve without flow is opened wholly, not divided by
    for error, share in ((0.5, 0.5 / 0.03 / 4e6), (-0.5, 0.0), (-0.9, -0.9 / 0.03 / 4e7)):  # each valve its own pulse
        small = pressure_loop.pulse(error, 0.0, 0.03, 0.0, period, 3e-8, 4e6, 4e7)
        assert small[0] + small[1] == approx(share)
    for error, flow, share in ((0.036, 1.5, 0.8), (-0.036, 1.5, -0.8), (0.015, 0.5, 0.5), (-0.015, 0.5, -0.5)):
        assert pressure_loop.pulse(error, 0.0, 0.03, 0.0, period, 0.0, flow, flow)[0] == approx(share)
    for error, flow in ((0.01, 4e6), (-0.01, 4e7)):
        assert pressure_loop.pulse(error, 0.0, 0.03, 0.0, period, 0.0, 4e6, 4e7)[0] == approx(error / 0.03 / flow)
    wide = pressure_loop.pulse(499.0, 0.3, response, deadband, period, 0.0, fill, vent)
    assert wide == (0.0, 0.0)
    assert pressure_loop.pulse(500.0, 0.3, response, deadband, period, 0.0, fill, vent)[0] > 0.3
