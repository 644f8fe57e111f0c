"""The field of a diametrically magnetised magnet in the plane, by finite elements.

Without currents H = -grad psi and B = mu0 (H + M), so that psi solves

    integral grad psi . grad v  +  (1/R) integral_outer psi v  =  integral_magnet M . grad v

The outer circle carries the condition of a decaying dipole, psi ~ 1/r, which is exact for the leading term. The magnet
is symmetric about the x axis and magnetised along y, so psi is odd in y and the upper half plane suffices. The mesh is
a tensor grid of angle and layer, bent so that its lines follow the contour; one of them is the circle of the sensor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skfem import Basis, BilinearForm, ElementQuad2, FacetBasis, LinearForm, MeshQuad, MeshQuad2, condense, solve
from skfem.helpers import dot, grad

from hand_model.arrays import Array

MU_0 = 4e-7 * np.pi
LAYERS = (4, 8, 5, 10)
"""Elements across hole, magnet, gap and the air beyond the sensor."""
HOLE = 0.02
"""Radius of the hole that the polar grid leaves at its centre, as a share of the inner radius."""
FAR = 8.0
"""Radius of the outer circle over the sensor's."""


@dataclass(frozen=True, slots=True)
class Magnet:
    """A ring or a part of one, in metres; angles from the x axis, the middle of the part, where B_n passes zero.

    outer_m: contour radius at equally spaced angles from 0 to 180 degrees; one value: a circle.
    span_rad: 2 pi a whole ring, pi a half-ring.  remanence_t: mu0 M.
    """

    outer_m: Array
    inner_m: float
    sensor_m: float
    span_rad: float = 2.0 * np.pi
    remanence_t: float = 1.0

    def contour_m(self, angle_rad: Array) -> Array:
        """Radius (n,) [m] of the contour at angles (n,) 0 ... pi."""
        outer = np.atleast_1d(self.outer_m)
        radius: Array = np.interp(angle_rad, np.linspace(0.0, np.pi, len(outer)), outer)
        return radius

    def __post_init__(self) -> None:
        """Raise ValueError unless hole, contour and sensor lie one outside the other."""
        outer = np.atleast_1d(self.outer_m)
        if not 0.0 < self.inner_m < outer.min() <= outer.max() < self.sensor_m:
            raise ValueError(
                f"magnet: the radii are {self.inner_m * 1e3:g} (hole), {outer.min() * 1e3:g} to {outer.max() * 1e3:g}"
                f" (contour) and {self.sensor_m * 1e3:g} mm (sensor); they must increase in this order from above 0"
            )


def radial_field(magnet: Magnet, elements: int = 60) -> tuple[Array, Array]:
    """B_n [T] on the sensor's circle at angles 0 ... pi: (angles (n,), field (n,)); odd about 0.

    elements: over the half circle; the error of B_n falls with their square, see docs/paper.md.
    """
    span = 0.5 * magnet.span_rad
    edges = np.linspace(0.0, np.pi, elements + 1)
    if span < np.pi:  # a grid line on the magnet's edge
        edges[np.argmin(np.abs(edges - span))] = span
    flat = _flat(edges)
    mesh = _bent(flat, magnet)
    basis = Basis(mesh, ElementQuad2(), intorder=4)
    inside = _magnet_elements(flat, span)
    matrix = _stiffness.assemble(basis) + _outer_term(mesh, magnet)
    load = _magnetisation.assemble(Basis(mesh, ElementQuad2(), intorder=4, elements=inside), m=magnet.remanence_t)
    on_axis = basis.get_dofs(lambda x: np.abs(x[1]) < 1e-9 * magnet.sensor_m)
    psi = solve(*condense(matrix, load, D=on_axis))
    return _on_sensor_circle(basis, psi, magnet, edges)


@BilinearForm
def _stiffness(u, v, _):  # type: ignore[no-untyped-def]
    return dot(grad(u), grad(v))


@BilinearForm
def _decay(u, v, w):  # type: ignore[no-untyped-def]
    return u * v / np.sqrt(w.x[0] ** 2 + w.x[1] ** 2)


@LinearForm
def _magnetisation(v, w):  # type: ignore[no-untyped-def]
    return w["m"] * grad(v)[1]


def _bent(flat: MeshQuad, magnet: Magnet) -> MeshQuad2:
    """Elements with curved sides: with straight ones a circle would be a polygon, and the field off by 5e-4."""
    curved = MeshQuad2.from_mesh(flat)
    angle, layer = curved.p
    contour = magnet.contour_m(angle)
    knots = np.array(
        [
            np.full_like(angle, HOLE * magnet.inner_m),
            np.full_like(angle, magnet.inner_m),
            contour,
            np.full_like(angle, magnet.sensor_m),
            np.full_like(angle, FAR * magnet.sensor_m),
        ]
    )
    index = np.minimum(layer.astype(int), 3)
    share = layer - index
    at = np.arange(len(angle))
    low, high = knots[index, at], knots[index + 1, at]
    # Beyond the sensor the layers grow in proportion to the radius.
    radius = np.where(index == 3, low * (high / low) ** share, low + share * (high - low))
    return MeshQuad2(np.array([radius * np.cos(angle), radius * np.sin(angle)]), curved.t)


def _flat(edges: Array) -> MeshQuad:
    """The grid before it is bent: angle by position in the layers, 0 ... 4 over hole, magnet, gap, air."""
    layers = [k + np.linspace(0.0, 1.0, n, endpoint=False) for k, n in enumerate(LAYERS)]
    return MeshQuad.init_tensor(edges, np.concatenate([*layers, [4.0]]))


def _magnet_elements(flat: MeshQuad, span: float) -> NDArray[np.int64]:
    middle = flat.p[:, flat.t].mean(axis=1)
    inside: NDArray[np.int64] = np.flatnonzero((middle[1] > 1.0) & (middle[1] < 2.0) & (middle[0] < span))
    return inside


def _outer_term(mesh: MeshQuad2, magnet: Magnet):  # type: ignore[no-untyped-def]
    far = FAR * magnet.sensor_m
    facets = mesh.facets_satisfying(lambda x: np.hypot(x[0], x[1]) > 0.98 * far, boundaries_only=True)
    return _decay.assemble(FacetBasis(mesh, ElementQuad2(), facets=facets, intorder=4))


def _on_sensor_circle(basis: Basis, psi: Array, magnet: Magnet, edges: Array) -> tuple[Array, Array]:
    """B_n from psi on the circle: outside, psi is a series in sin(k angle) / r^k, fitted to its values there."""
    radius = np.hypot(*basis.doflocs)
    on = np.flatnonzero(np.abs(radius - magnet.sensor_m) < 1e-6 * magnet.sensor_m)
    angle = np.arctan2(basis.doflocs[1, on], basis.doflocs[0, on])
    order = np.argsort(angle)
    angle, value = angle[order], psi[on][order]
    # B_n = -mu0 dpsi/dr; with psi in units of remanence mu0 is contained.
    harmonics = np.arange(1, len(edges) // 2)
    table = np.sin(np.outer(angle, harmonics))
    weights = np.linalg.lstsq(table, value, rcond=None)[0]
    field = table @ (weights * harmonics / magnet.sensor_m)
    return angle, field


def disc_field(radius_m: float, remanence_t: float, distance_m: float, angle_rad: Array) -> Array:
    """B_n (n,) [T] at angles (n,) of a uniformly magnetised disc (an infinite cylinder) outside it, exact: a
    two-dimensional dipole.
    """
    field: Array = 0.5 * remanence_t * (radius_m / distance_m) ** 2 * np.sin(angle_rad)
    return field
