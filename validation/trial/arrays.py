"""The array types of the trial, which shares no code with the packages that it tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Real numbers; shape and unit are documented at each use."""
Flags = NDArray[np.bool_]
"""Boolean values; shape and meaning are documented at each use."""
