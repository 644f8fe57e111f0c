"""A hand in the 3-D scene: posed by its joint angles, its links coloured by joint."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import viser

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.geometry import Link, geometry_of, link_poses
from hand_studio.hand_meshes import mesh, quaternion

Color = tuple[int, int, int]
PALM, LINK, PRESSED = (120, 128, 140), (196, 201, 208), (213, 94, 0)
UPRIGHT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""The frame of the palm in the scene: fingers up, the inner side of the hand to the viewer."""
GHOST_SCALE, GHOST_OPACITY = 0.93, 0.6
"""A ghost is smaller, so that a measured hand in the same pose hides it."""
STILL_RAD = 4e-3
"""Smaller motions, as those by noise, are not drawn: without a graphics card a browser takes a core to draw."""
SMALLEST_N, LARGEST_N = 0.1, 5.0
"""Forces from which a pad is shown, and at which it is largest."""


class HandView:
    """Meshes of all links of a hand, below a name of the scene."""

    def __init__(self, scene: viser.SceneApi, hand: Hand, name: str, *, ghost: Color | None = None) -> None:
        """Draw the hand at angle 0. ghost: colour of a transparent hand, which is seen only where it is elsewhere.

        Raises ValueError, one line, for a hand without geometry.
        """
        self._hand, self._geometry = hand, geometry_of(hand)
        self._drawn_rad = np.full(len(hand.joints), np.nan)
        self._meshes: dict[str, list[viser.MeshHandle]] = {}
        self._colors: dict[str, Color] = {}
        self.root = scene.add_frame(name, show_axes=False, wxyz=quaternion(UPRIGHT))
        for link in self._geometry.links:
            own = ghost or (PALM if link.joint < 0 else LINK)
            self._meshes[link.name] = _meshes(scene, f"{name}/{link.name}", link, own, ghost is not None)
            self._colors[link.name] = own
        self._pads = {
            frame.name: scene.add_icosphere(f"{name}/{frame.name}", 1.0, PRESSED, subdivisions=2, visible=False)
            for frame in self._geometry.frames
            if frame.kind == "force_site"
        }
        self.pose(np.zeros(len(hand.joints)))

    def pose(self, angle_rad: Array) -> None:
        """Show the hand at angles (joints,) [rad]; joints whose angle is NaN stay where they are drawn."""
        angle = np.where(np.isfinite(angle_rad), angle_rad, np.nan_to_num(self._drawn_rad))
        if np.all(np.abs(angle - self._drawn_rad) < STILL_RAD):
            return
        self._drawn_rad = angle
        poses = link_poses(self._hand, angle)
        for link, meshes in self._meshes.items():
            for handle in meshes:
                handle.wxyz, handle.position = quaternion(poses[link][:3, :3]), poses[link][:3, 3]
        for pad, sphere in self._pads.items():
            sphere.position = poses[pad][:3, 3]

    def press(self, force_n: Mapping[str, float]) -> None:
        """Show a sphere on each force site, by name, whose force [N] is at least SMALLEST_N; its size is the force."""
        for pad, sphere in self._pads.items():
            force = force_n.get(pad, 0.0)
            shown = bool(force >= SMALLEST_N)
            if sphere.visible != shown:
                sphere.visible = shown
            if shown:
                sphere.scale = 0.004 + 0.008 * min(force / LARGEST_N, 1.0)

    def tint(self, colors: Mapping[int, Color]) -> None:
        """Colour the links of some joints, by the index of the joint."""
        for link in self._geometry.links:
            wanted = colors.get(link.joint, self._colors[link.name])
            if wanted != self._colors[link.name]:
                self._colors[link.name] = wanted
                for handle in self._meshes[link.name]:
                    handle.color = wanted


def _meshes(scene: viser.SceneApi, name: str, link: Link, color: Color, ghost: bool) -> list[viser.MeshHandle]:
    handles = []
    for number, shape in enumerate(link.shapes):
        vertices, faces = mesh(shape, GHOST_SCALE if ghost else 1.0)
        handles.append(
            scene.add_mesh_simple(
                f"{name}/{number}",
                vertices.astype(np.float32),
                faces,
                color=color,
                opacity=GHOST_OPACITY if ghost else None,
                flat_shading=shape.kind == "box",
                cast_shadow=False,
            )
        )
    return handles
