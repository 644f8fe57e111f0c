"""The control law in C, compiled for this machine, with the interface of the Python law."""

from __future__ import annotations

import ctypes
import hashlib
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from hand_control.declared import OUTPUTS, STATE
from hand_model.arrays import Array

ROOT = Path(__file__).resolve().parents[1]
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic")
OPTIONS = ("-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC")


def compiled(kind: str) -> Path:
    """The shared library of the law in `float` or `double`, built into out/c_law where it is missing."""
    firmware = ROOT / "firmware"
    sources = b"".join((firmware / name).read_bytes() for name in ("hand_law.c", "hand_law.h"))
    library = ROOT / "out" / "c_law" / f"{kind}-{hashlib.sha256(sources).hexdigest()[:16]}.so"
    if not library.exists():
        library.parent.mkdir(parents=True, exist_ok=True)
        made = library.with_suffix(f".{os.getpid()}")
        command = ["cc", *OPTIONS, *WARNINGS, f"-DHAND_REAL={kind}", str(firmware / "hand_law.c"), "-o", str(made)]
        subprocess.run(command, check=True)
        made.replace(library)
    return library


class CLaw:
    """The law in C on n joints; `tick` has the arguments of the Python law."""

    def __init__(self, kind: str, g: Array) -> None:
        """Begin with gains (rows, n). kind: float or double."""
        self._law, self._type = ctypes.CDLL(str(compiled(kind))), np.dtype("f4" if kind == "float" else "f8")
        self._real = ctypes.c_float if kind == "float" else ctypes.c_double
        self._n = g.shape[1]
        self.gains = np.ascontiguousarray(g, self._type)
        self.state = np.zeros((len(STATE), self._n), self._type)
        self.out = np.zeros((len(OUTPUTS), self._n), self._type)
        self._law.hand_law_start(self._n, self._pointer(self.gains), self._pointer(self.state))

    def _pointer(self, values: Any) -> Any:
        return values.ctypes.data_as(ctypes.c_void_p)

    def tick(self, inputs: Array, dt: float, integrate: bool = True, drive: bool = True) -> Any:
        """Outputs (rows, joints) of a tick from inputs (rows, joints) after dt [s]; see `hand_control.law.Law.tick`."""
        given = np.ascontiguousarray(inputs, self._type)
        arrays = (self._pointer(values) for values in (self.gains, self.state, given))
        flags = int(integrate), int(drive)
        self._law.hand_law_tick(self._n, *arrays, self._real(dt), *flags, self._pointer(self.out))
        return self.out

    def release(self) -> None:
        """See `hand_control.law.Law.release`."""
        self._law.hand_law_release(self._n, self._pointer(self.state))
