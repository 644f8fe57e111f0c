"""Static torque of the flexible fluidic actuator, Eq. 6, with creep, Eq. 11, and its inverses.

Torques positive in flexion [N m], angles [rad], pressures gauge [Pa], creeping ratio A in 0 ... 1.
Eq. 11 is used as a1 (phi - A phi_max): positive creep reduces the restoring torque (a1 < 0).
All functions take floats or arrays that broadcast, and serve numba kernels and NumPy alike.
"""

from __future__ import annotations

from numba import njit


@njit(cache=True, forceinline=True, fastmath={"contract"})
def torque(p, phi, creep, a0, a1, a2, a3, phi_max):  # type: ignore[no-untyped-def]
    """Actuator torque M_a [N m] (Eq. 11; Eq. 6 where creep or phi_max is 0)."""
    return a0 + a1 * (phi - creep * phi_max) + (a2 + a3 * phi) * p


@njit(cache=True, forceinline=True, fastmath={"contract"})
def pressure_for_torque(tau, phi, creep, a0, a1, a2, a3, phi_max):  # type: ignore[no-untyped-def]
    """Pressure [Pa] at which the actuator gives tau [N m] at phi; the inverse of Eq. 11 in p.

    Where the actuator has lost its leverage (a2 + a3 phi <= 0) no pressure gives it; the caller
    limits phi to angles where a2 + a3 phi > 0.
    """
    return (tau - a0 - a1 * (phi - creep * phi_max)) / (a2 + a3 * phi)


@njit(cache=True, forceinline=True, fastmath={"contract"})
def equilibrium_angle(p, creep, load, a0, a1, a2, a3, phi_max):  # type: ignore[no-untyped-def]
    """Angle [rad] at which the actuator at p [Pa] holds a load [N m] at rest (Eq. 8 with M_a = load)."""
    return -(a0 - load - a1 * creep * phi_max + a2 * p) / (a1 + a3 * p)


@njit(cache=True, forceinline=True, fastmath={"contract"})
def leverage(phi, a2, a3):  # type: ignore[no-untyped-def]
    """Torque per pressure dM_a/dp [N m/Pa] at phi, from Eq. 6."""
    return a2 + a3 * phi


@njit(cache=True, forceinline=True, fastmath={"contract"})
def chamber_volume(p, phi, v0, c_v, a2, a3):  # type: ignore[no-untyped-def]
    """V_a [m^3] at p [Pa] and phi; by virtual work and Eq. 6, dV_a/dphi = dM_a/dp = a2 + a3 phi.

    v0: volume vented at 0 [m^3].  c_v: its growth with pressure [m^3/Pa].
    """
    return v0 + c_v * p + (a2 + 0.5 * a3 * phi) * phi


@njit(cache=True, forceinline=True, fastmath={"contract"})
def stiffness(p, a1, a3):  # type: ignore[no-untyped-def]
    """dM_a/dphi [N m/rad] at constant pressure, from Eq. 6; negative where the joint is stable."""
    return a1 + a3 * p
