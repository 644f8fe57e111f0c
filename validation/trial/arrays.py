"""The array types of the trial, which shares no code with the packages that it tries."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers; shape and unit stand where it is used."""
Flags = NDArray[np.bool_]
"""Truth values; shape and meaning stand where it is used."""
