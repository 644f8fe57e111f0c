"""Eq. 6 and Eq. 11 and their inverses, and the torque of stops."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from pytest import approx

from hand_model.kernel.terms import one_sided
from hand_model.statics import equilibrium_angle, pressure_for_torque, stiffness, torque

A0, A1, A2, A3, PHI_MAX = -0.010, -0.0573, 1.12e-6, -5.6e-7, np.radians(60)
pressures = st.floats(0.0, 6e5)
angles = st.floats(np.radians(-10), np.radians(100))
ratios = st.floats(0.0, 1.0)


def test_published_points() -> None:
    """Broken by a wrong sign or coefficient: Fig. 9 shows -0.1 N m at (0, 90 deg), just under 0.6 at (5e5, 0)."""
    assert torque(0.0, np.pi / 2, 0.0, A0, A1, A2, A3, PHI_MAX) == approx(-0.1, abs=1e-3)
    assert torque(5e5, 0.0, 0.0, A0, A1, A2, A3, PHI_MAX) == approx(0.55, abs=1e-12)


def test_creep_reduces_the_restoring_torque() -> None:
    """Broken by Eq. 11's sign as printed: positive A must raise the torque and the angle."""
    assert torque(2e5, 0.5, 0.4, A0, A1, A2, A3, PHI_MAX) > torque(2e5, 0.5, 0.0, A0, A1, A2, A3, PHI_MAX)
    assert equilibrium_angle(2e5, 0.4, 0.0, A0, A1, A2, A3, PHI_MAX) > equilibrium_angle(
        2e5, 0.0, 0.0, A0, A1, A2, A3, PHI_MAX
    )


@given(pressures, angles, ratios)
def test_pressure_inverts_torque(p: float, phi: float, creep: float) -> None:
    """Broken by an inverse that forgets a term of Eq. 11."""
    tau = torque(p, phi, creep, A0, A1, A2, A3, PHI_MAX)
    assert pressure_for_torque(tau, phi, creep, A0, A1, A2, A3, PHI_MAX) == approx(p, abs=1e-6)


@given(pressures, ratios, st.floats(-0.2, 0.2))
def test_equilibrium_balances_the_load(p: float, creep: float, load: float) -> None:
    """Broken by an equilibrium at which the actuator's torque is not the load."""
    phi = equilibrium_angle(p, creep, load, A0, A1, A2, A3, PHI_MAX)
    assert torque(p, phi, creep, A0, A1, A2, A3, PHI_MAX) == approx(load, abs=1e-12)


@given(pressures, angles, ratios)
def test_stiffness_is_the_slope(p: float, phi: float, creep: float) -> None:
    """Broken by a stiffness that is not dM/dphi (Eq. 11 is linear in phi, so a secant is exact)."""
    rise = torque(p, phi + 0.1, creep, A0, A1, A2, A3, PHI_MAX) - torque(p, phi, creep, A0, A1, A2, A3, PHI_MAX)
    assert stiffness(p, A1, A3) == approx(rise / 0.1, rel=1e-9)


def test_arrays_broadcast_like_floats() -> None:
    """Broken by a signature that numba or NumPy broadcasts another way."""
    p, phi = np.linspace(0, 5e5, 6)[:, None], np.linspace(0, 1.5, 4)
    table = torque(p, phi, 0.2, A0, A1, A2, A3, PHI_MAX)
    assert table.shape == (6, 4)
    assert table[3, 2] == approx(torque(p[3, 0], phi[2], 0.2, A0, A1, A2, A3, PHI_MAX))


stop_parameters = (st.floats(0.0, 50.0), st.floats(0.0, 1.0), st.floats(1e-3, 0.5))


@given(st.floats(-1.0, 0.0), st.floats(-50.0, 50.0), *stop_parameters)
def test_stop_is_silent_outside(depth: float, speed: float, stiffness: float, damping: float, width: float) -> None:
    """Broken by a stop that acts, or a damper that brakes, before contact."""
    assert one_sided(depth, speed, stiffness, damping, width) == 0.0


@given(st.floats(0.0, 1.0), st.floats(-50.0, 50.0), *stop_parameters)
def test_stop_never_pulls(depth: float, speed: float, stiffness: float, damping: float, width: float) -> None:
    """Broken by a damper that holds the joint back while it leaves."""
    assert one_sided(depth, speed, stiffness, damping, width) >= 0.0


def test_stop_engages_smoothly_and_then_linearly() -> None:
    """Broken by a kink: the slope must run from 0 to the full stiffness over the engagement, then stay."""
    width, stiffness = 0.02, 5.0
    depth = np.linspace(-0.01, 0.06, 7001)
    spring = np.array([one_sided(x, 0.0, stiffness, 0.0, width) for x in depth])
    slope = np.gradient(spring, depth)
    np.testing.assert_allclose(slope[1:-1], stiffness * np.clip(depth / width, 0.0, 1.0)[1:-1], atol=2e-3)
