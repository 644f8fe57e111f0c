"""What a diagnosis needs of a described machine: a hand of many joints, or another machine of one axis."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array


class JointModel(Protocol):
    """Joints and their parameters.

    path: the description's file.  joints: names.  parameters: (rows of JOINT_PARAMETERS, joints), SI.
    partner: (joints,) index of the joint that shares inertia, or -1.
    """

    @property
    def path(self) -> Path:
        """The description's file."""
        ...

    @property
    def joints(self) -> tuple[str, ...]:
        """Names, in the order of every array."""
        ...

    @property
    def parameters(self) -> Array:
        """(rows of JOINT_PARAMETERS, joints), SI."""
        ...

    @property
    def partner(self) -> NDArray[np.int64]:
        """(joints,) index of the joint that shares inertia, or -1."""
        ...

    @property
    def lacks(self) -> frozenset[str]:
        """What it does not have of what effects may need, keys of NEEDS."""
        ...

    @property
    def tolerances(self) -> Mapping[str, float]:
        """Relative standard deviations [-] of parameters that have their own, by key; 0 where a number is exact."""
        ...

    def lever_arm_m(self, joint: int) -> float:
        """Lever arm [m] of the force sensor of a joint; 1 where it has none."""
        ...
