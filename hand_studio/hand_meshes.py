"""Triangles of the shapes of a hand. Pure: geometry in, arrays out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array
from hand_model.geometry import Shape

SEGMENTS, RINGS = 20, 5
"""Around the axis of a capsule; from a pole to the equator of its ends."""
Triangles = NDArray[np.int32]
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_BOX = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])


def mesh(shape: Shape, scale: float = 1.0) -> tuple[Array, Triangles]:
    """Vertices (n, 3) [m] in the frame of the link, and faces (m, 3), counter-clockwise from outside.

    scale: factor of the size about the middle of the shape [-].
    """
    vertices, faces = _box(shape.size_m) if shape.kind == "box" else _capsule(*shape.size_m)
    return scale * vertices @ shape.pose[:3, :3].T + shape.pose[:3, 3], faces


def _box(size_m: tuple[float, ...]) -> tuple[Array, Triangles]:
    """Each side has vertices of its own, so that its edges are sharp."""
    vertices = (_CORNERS * size_m)[_BOX.ravel()]
    first = 4 * np.arange(len(_BOX))[:, None, None]
    return vertices, (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(np.int32)


def _capsule(length_m: float, radius_m: float) -> tuple[Array, Triangles]:
    """Rings of SEGMENTS vertices along x, the first and the last of which are a pole."""
    quarter = np.linspace(0.0, np.pi / 2.0, RINGS)
    along = np.concatenate([-length_m / 2.0 - radius_m * np.cos(quarter), length_m / 2.0 + radius_m * np.sin(quarter)])
    width = radius_m * np.concatenate([np.sin(quarter), np.cos(quarter)])
    turn = np.arange(SEGMENTS) * (2.0 * np.pi / SEGMENTS)
    vertices = np.stack(
        [np.repeat(along, SEGMENTS), np.outer(width, np.cos(turn)).ravel(), np.outer(width, np.sin(turn)).ravel()],
        axis=1,
    )
    ring, place = np.meshgrid(np.arange(2 * RINGS - 1), np.arange(SEGMENTS), indexing="ij")
    here, beyond = ring * SEGMENTS, (ring + 1) * SEGMENTS
    after = (place + 1) % SEGMENTS
    corners = [here + place, beyond + place, beyond + after, here + place, beyond + after, here + after]
    return vertices, np.stack(corners, axis=-1).reshape(-1, 3)[:, ::-1].astype(np.int32)


def quaternion(rotation: Array) -> Array:
    """The unit quaternion (4,) [-], w first, of a rotation (3, 3): Bar-Itzhack, J. Guidance 23(6), 2000."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    matrix = np.array(
        [
            [xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, xx - yy - zz, xy + yx, xz + zx],
            [xz - zx, xy + yx, yy - xx - zz, yz + zy],
            [yx - xy, xz + zx, yz + zy, zz - xx - yy],
        ]
    )
    result: Array = np.linalg.eigh(matrix)[1][:, -1]
    return result
