"""XML of robot models: numbers, vectors and names as text, for one hand or for a macro of both hands."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass

import numpy as np

from hand_model.arrays import Array

DIGITS = 9
SYMBOL = "${prefix}"
"""The prefix of every name in a macro."""


def number(value: float) -> str:
    """A finite number [any unit] as text of up to DIGITS significant digits."""
    return f"{0.0 if abs(value) < 1e-12 else value:.{DIGITS}g}"


def numbers(values: Array | tuple[float, ...]) -> str:
    """Numbers (n,) [any unit] as text, separated by spaces."""
    return " ".join(number(float(value)) for value in values)


def rpy_from_rotation(rotation: Array) -> Array:
    """Roll, pitch and yaw (3,) [rad] about the fixed axes x, y, z of a rotation (3, 3), as URDF writes it."""
    pitch = float(np.arcsin(np.clip(-rotation[2, 0], -1.0, 1.0)))
    if abs(rotation[2, 0]) > 1.0 - 1e-12:  # x points along z: roll and yaw turn about the same axis
        return np.array([0.0, pitch, np.arctan2(-rotation[0, 1], rotation[1, 1])])
    return np.array([np.arctan2(rotation[2, 1], rotation[2, 2]), pitch, np.arctan2(rotation[1, 0], rotation[0, 0])])


@dataclass(frozen=True, slots=True)
class Style:
    """How names and mirrored numbers are written.

    prefix: of the hand, at the beginning of its names.  symbolic: write ${prefix} and ${reflect * number} for a macro,
    where reflect is 1 for the side of the hand and -1 for the other one.
    """

    prefix: str
    symbolic: bool = False

    def name(self, name: str) -> str:
        """A name of the hand, prefix included, as it is written."""
        return SYMBOL + name.removeprefix(self.prefix) if self.symbolic else name

    def mirrored(self, value: float) -> str:
        """A number [any unit] that has the other sign on the other hand."""
        text = number(value)
        return f"${{reflect * {text}}}" if self.symbolic and text != "0" else text

    def _vector(self, values: Array, changes: tuple[bool, bool, bool]) -> str:
        pairs = zip(values, changes, strict=True)
        return " ".join(self.mirrored(float(v)) if mirror else number(float(v)) for v, mirror in pairs)

    def origin(self, parent: ET.Element, pose: Array) -> None:
        """Add the origin of a joint or of a body, a pose (4, 4) [m]; the plane of mirroring is that of x and z."""
        rpy = rpy_from_rotation(pose[:3, :3])
        xyz = self._vector(pose[:3, 3], (False, True, False))
        ET.SubElement(parent, "origin", xyz=xyz, rpy=self._vector(rpy, (True, False, True)))

    def axis(self, parent: ET.Element, axis: Array) -> None:
        """Add the axis (3,) [-] of a joint, a pseudovector."""
        ET.SubElement(parent, "axis", xyz=self._vector(axis, (True, False, True)))


def document(root: ET.Element, comment: str) -> str:
    """The text of a document with a comment at its beginning."""
    ET.indent(root)
    return f'<?xml version="1.0"?>\n<!-- {comment} -->\n{ET.tostring(root, encoding="unicode")}\n'
