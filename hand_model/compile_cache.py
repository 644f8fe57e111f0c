"""Compiled functions kept on disk: numba's cache, made safe for processes that compile at once and for edited sources.

Numba numbers the files of the compiled variants of one function. Two processes that compile two variants at the same
time may both take the same number, and each later start loads one variant where it asked for the other: another set of
effects, and no error. Here a file is named after what it holds, and is complete before the index names it. Numba also
looks at changes of one source file alone, although a function contains the equations and constants that it takes from
other modules; here it is compiled again when any source of its package or of hand_model has changed.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from numba import carray, get_num_threads, njit, prange, set_num_threads
from numba.core import caching

without_arrays = njit(cache=True, _nrt=False, error_model="numpy")
"""numba.njit of functions that make no arrays, so that nothing counts references, which costs at every call."""
# Threads of a parallel loop that wait for work would keep a core busy, which a running hand may need; read by OpenMP.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
_ROOT = Path(__file__).resolve().parent.parent


@cache
def sources_digest(package: str) -> str:
    """Hash of the sources of a package next to hand_model, and of hand_model itself."""
    digest = hashlib.sha256()
    for folder in sorted({package, "hand_model"}):
        for path in sorted((_ROOT / folder).rglob("*.py")):
            digest.update(path.relative_to(_ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


@contextmanager
def one_thread() -> Iterator[None]:
    """Compiled loops called here use this thread alone, and leave the other cores to other recordings or a hand.

    The few parameter sets of a fit make a parallel loop little faster where two cores of a machine are threads of one.
    """
    before = get_num_threads()
    set_num_threads(1)
    try:
        yield
    finally:
        set_num_threads(before)


@contextmanager
def _alone(lock: str) -> Iterator[None]:
    """Only one process at a time is in here. Without locks (Windows), one of two may have to compile again."""
    with open(lock, "a", encoding="ascii") as file:  # noqa: PTH123 - numba's paths are texts
        with suppress(ImportError):
            import fcntl  # noqa: PLC0415

            fcntl.flock(file, fcntl.LOCK_EX)  # ends when the file is closed
        yield


class CacheFile(caching.IndexDataCacheFile):  # type: ignore[misc]
    """Index and data files of one function."""

    def save(self, key: Any, data: Any) -> None:
        """Keep a compiled variant."""
        digest = hashlib.sha256(repr(key).encode()).hexdigest()[:16]
        name = f"{self._index_name.removesuffix('.nbi')}.{digest}.nbc"
        self._save_data(name, data)
        with _alone(f"{self._index_path}.lock"):
            self._save_index(self._load_index() | {key: name})


def _with_sources(stamp: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """The stamp of a function's source file, and of what the function may contain of other files."""

    def stamp_of_all(locator: Any) -> Any:
        package = Path(locator._py_file).resolve().relative_to(_ROOT).parts[0] if _is_ours(locator._py_file) else ""
        return (stamp(locator), sources_digest(package)) if package else stamp(locator)

    return stamp_of_all


def _is_ours(file: str) -> bool:
    path = Path(file).resolve()
    return path.is_relative_to(_ROOT) and path.relative_to(_ROOT).parts[0].startswith(("hand_", "validation", "test"))


def is_kept(function: Any, signature: str) -> bool:
    """Whether the disk holds a function of `njit(cache=True)`, compiled for a signature from the present sources."""
    return function._cache.load_overload(signature, function.targetctx) is not None


def _load_array_functions() -> None:
    """Load numba's functions of arrays, which every compiled loop needs, without SciPy's linear algebra.

    Numba imports the latter there to see whether it is installed, and once more when a function that calls it is
    compiled. The import takes a large part of a start.
    """
    name = "scipy.linalg.cython_blas"
    if name in sys.modules or "numba.np.arraymath" in sys.modules:
        return
    sys.modules[name] = None  # type: ignore[assignment]  # an import of it fails at once
    try:
        from numba.np import arraymath  # noqa: PLC0415
    finally:
        del sys.modules[name]
    arraymath._HAVE_BLAS = True


_load_array_functions()
if caching.IndexDataCacheFile is not CacheFile:
    caching.IndexDataCacheFile = CacheFile
    _located = caching._SourceFileBackedLocatorMixin
    _located.get_source_stamp = _with_sources(_located.get_source_stamp)

__all__ = [
    "CacheFile",
    "carray",
    "get_num_threads",
    "is_kept",
    "njit",
    "one_thread",
    "prange",
    "sources_digest",
    "without_arrays",
]
