"""Static torque of the flexible fluidic actuator, Eq. 6, with creep, Eq. 11, and its inverses.

Torques are positive in flexion [N m], angles in rad, pressures gauge [Pa]; the creeping ratio A is within 0 and 1.
Eq. 11 is used as a1 (phi - A phi_max): positive creep reduces the restoring torque (a1 < 0).
All functions take floats or arrays that broadcast, in compiled loops and in NumPy.
"""

from __future__ import annotations

from hand_model.compile_cache import njit

_equation = njit(cache=True, forceinline=True, fastmath={"contract"})


@_equation
def torque(p, phi, creep, a0, a1, a2, a3, phi_max):  # type: ignore[no-untyped-def]
    """Actuator torque M_a [N m] (Eq. 11; Eq. 6 where creep or phi_max is 0)."""
    return a0 + a1 * (phi - creep * phi_max) + (a2 + a3 * phi) * p


@_equation
def pressure_for_torque(tau, phi, creep, a0, a1, a2, a3, phi_max):  # type: ignore[no-untyped-def]
    """Pressure [Pa] at which the actuator gives tau [N m] at phi; the inverse of Eq. 11 in p.

    The caller limits phi to angles with a2 + a3 phi > 0; beyond them no pressure gives the torque.
    """
    return (tau - a0 - a1 * (phi - creep * phi_max)) / (a2 + a3 * phi)


@_equation
def equilibrium_angle(p, creep, load, a0, a1, a2, a3, phi_max):  # type: ignore[no-untyped-def]
    """Angle [rad] at which the actuator at p [Pa] holds a load [N m] at rest (Eq. 8 with M_a = load)."""
    return -(a0 - load - a1 * creep * phi_max + a2 * p) / (a1 + a3 * p)


@_equation
def leverage(phi, a2, a3):  # type: ignore[no-untyped-def]
    """Torque per pressure dM_a/dp [N m/Pa] at phi, from Eq. 6."""
    return a2 + a3 * phi


@_equation
def chamber_volume(p, phi, v0, c_v, a2, a3):  # type: ignore[no-untyped-def]
    """V_a [m^3] at p [Pa] and phi; by virtual work and Eq. 6, dV_a/dphi = dM_a/dp = a2 + a3 phi.

    v0: volume vented at 0 [m^3].  c_v: its growth with pressure [m^3/Pa].
    """
    return v0 + c_v * p + (a2 + 0.5 * a3 * phi) * phi


@_equation
def stiffness(p, a1, a3):  # type: ignore[no-untyped-def]
    """dM_a/dphi [N m/rad] at constant pressure, from Eq. 6; negative where the joint is stable."""
    return a1 + a3 * p
