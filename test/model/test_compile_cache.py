"""Compiled functions on disk: two processes at once, and edited sources."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from numba.core import caching

from hand_model import compile_cache
from hand_model.compile_cache import CacheFile, njit, sources_digest

ROOT = Path(__file__).resolve().parents[2]


def two_at_once(kind: Any, folder: Path) -> dict[str, str | None]:
    """What a later process loads after two wrote variants A and B of one function, B while A was being written."""
    first, second, later = (kind(str(folder), "function", "stamp") for _ in range(3))
    write, empty = first._save_data, second._load_index()

    def while_b_is_written(name: str, data: str) -> None:
        second._load_index = lambda: dict(empty)  # it had read the index before
        second.save("B", "code of B")
        write(name, data)

    first._save_data = while_b_is_written
    first.save("A", "code of A")
    return {key: later.load(key) for key in ("A", "B")}


def test_two_processes_never_exchange_their_variants(tmp_path: Path) -> None:
    """Fails when a variant that one process compiles is loaded for another one, as with numba's own files."""
    stock = CacheFile.__mro__[1]
    (tmp_path / "stock").mkdir()
    assert two_at_once(stock, tmp_path / "stock")["B"] == "code of A"
    loaded = two_at_once(CacheFile, tmp_path)
    assert loaded == {"A": "code of A", "B": "code of B"}


KEEP = """
import sys, time
from hand_model.compile_cache import CacheFile
file = CacheFile(sys.argv[1], "function", "stamp")
while time.time() < float(sys.argv[3]):
    pass
for number in range(20):
    file.save(f"{sys.argv[2]} {number}", f"code of {sys.argv[2]} {number}")
"""


def test_processes_that_compile_at_once_keep_all_variants(tmp_path: Path) -> None:
    """Fails when the index that one process writes lacks what another one has just added."""
    begin = str(time.time() + 4.0)  # all have started by then
    command = [sys.executable, "-c", KEEP, str(tmp_path)]
    processes = [subprocess.Popen([*command, str(number), begin], cwd=ROOT) for number in range(3)]
    assert [process.wait(60) for process in processes] == [0, 0, 0]
    later = CacheFile(str(tmp_path), "function", "stamp")
    loaded = [later.load(f"{process} {number}") for process in range(3) for number in range(20)]
    assert loaded == [f"code of {process} {number}" for process in range(3) for number in range(20)]


def test_what_numba_keeps_is_kept_by_this_cache() -> None:
    """Fails when a function of the package is kept in numba's own files, or a module takes njit from numba."""

    def one() -> int:
        return 1

    assert type(njit(cache=True)(one)._cache._cache_file) is CacheFile
    direct = re.compile(r"^\s*(?:from numba import .*\bn?jit\b|import numba$)", re.MULTILINE)
    used = [path for path in ROOT.glob("hand_*/**/*.py") if direct.search(path.read_text(encoding="utf-8"))]
    assert [path.name for path in used if path.name != "fleet.py"] == ["compile_cache.py"]


PRODUCT = """
import sys
import numpy as np
from hand_model.compile_cache import njit
double = njit(lambda x: 2.0 * x)
assert double(np.ones(3)).sum() == 6.0
print("scipy.linalg" in sys.modules)
product = njit(lambda a, b: np.dot(a, b))
print(product(np.full(3, 2.0), np.arange(3.0)), "scipy.linalg" in sys.modules)
"""


def test_a_start_does_not_load_linear_algebra_that_no_function_calls() -> None:
    """Fails when a compiled function of arrays loads scipy.linalg, or one that needs it does not get it."""
    done = subprocess.run([sys.executable, "-c", PRODUCT], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "6.0", "True"]


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A source tree of two packages."""
    for name in ("hand_model", "hand_control"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "part.py").write_text("LIMIT = 1.0\n", encoding="utf-8")
    monkeypatch.setattr(compile_cache, "_ROOT", tmp_path)
    sources_digest.cache_clear()
    yield tmp_path
    sources_digest.cache_clear()


@pytest.mark.parametrize("edited", ["hand_model", "hand_control"])
def test_an_edit_of_another_module_compiles_again(edited: str, tree: Path) -> None:
    """Fails when a constant that a function takes from another module may be an old one."""

    def stamp() -> Any:
        sources_digest.cache_clear()
        return caching.UserProvidedCacheLocator.get_source_stamp(locator)

    locator = caching.UserProvidedCacheLocator.__new__(caching.UserProvidedCacheLocator)
    locator._py_file = str(tree / "hand_control" / "part.py")
    before = stamp()
    assert stamp() == before
    (tree / edited / "other.py").write_text("LIMIT = 2.0\n", encoding="utf-8")
    assert stamp() != before
