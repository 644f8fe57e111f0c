"""The kernel's cache on disk: fresh where an equation changed, elsewhere where the package cannot be written."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import hand_model

RUN = """
import numpy as np
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.lanes import idle_parameters
from hand_model.kernel.rows import STATES
par = np.repeat(idle_parameters()[None, :, None], 2, axis=2)
loop = ClosedLoop(par, np.array([-1, -1]), np.zeros((1, STATES, 2)), 0.01)
print(loop.advance(np.full((1, 2000, 2), 1e5))[0, -1, 1, 0])
"""


def angle_after_a_run(folder: Path, cache: Path) -> float:
    """Final angle of an idle joint under pressure, from the copy of hand_model in folder, in a fresh process."""
    environment = os.environ | {"XDG_CACHE_HOME": str(cache), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("NUMBA_CACHE_DIR", None)
    command = [sys.executable, "-c", RUN]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return float(done.stdout)


def test_changed_equation_is_compiled_again(tmp_path: Path) -> None:
    """Broken by a kernel cached from before an edit of another module: wrong physics, silently.

    The package's own cache folder cannot be made here (a file stands in its place), as where it is installed
    read-only; the cache must then go to the user's folder.
    """
    source = Path(str(hand_model.__file__)).parent
    package = tmp_path / "hand_model"
    shutil.copytree(source, package, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in (package, package / "kernel"):
        (folder / "__pycache__").write_text("in the way of a folder", encoding="utf-8")
    cache = tmp_path / "cache"

    before = angle_after_a_run(tmp_path, cache)
    assert 0.05 < before < 0.15
    assert list(cache.rglob("closed_loop*.nbi")), "no cache in the user's folder"
    assert angle_after_a_run(tmp_path, cache) == before

    statics = package / "statics.py"
    text = statics.read_text(encoding="utf-8")
    statics.write_text(text.replace("+ (a2 + a3 * phi) * p", "+ 0.5 * (a2 + a3 * phi) * p"), encoding="utf-8")
    halved = angle_after_a_run(tmp_path, cache)
    assert abs(halved - before / 2) < 1e-3


ORDER = """
import hashlib, sys
import numpy as np
from hand_model.effects import EFFECTS
from hand_model.kernel import closed_loop
from hand_model.kernel.lanes import idle_parameters
from hand_model.kernel.rows import STATES
par = np.repeat(np.repeat(idle_parameters()[None, :, None], 16, axis=2), 3, axis=0)
par *= np.random.default_rng(3).uniform(0.98, 1.0, par.shape)
commands = np.random.default_rng(4).uniform(0.0, 5e5, (3, 300, 16))
sets = {"plain": (), "friction": (EFFECTS["coulomb_friction"],)}
for run in sys.argv[1:]:
    name, _, parallel = run.partition(":")
    closed_loop.PARALLEL_STEPS = 0 if parallel else 10**12
    state = np.zeros((3, STATES, 16))
    loop = closed_loop.ClosedLoop(par, np.full(16, -1), state, 0.005, effects=sets[name])
    print(hashlib.sha256(loop.advance(commands).tobytes()).hexdigest())
"""


def test_the_same_bits_whatever_was_compiled_when(tmp_path: Path) -> None:
    """Broken by a result that depends on which loops came from the cache, or on effects compiled in but off."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    hashes = []
    for order in (["plain"], ["plain"], ["plain:p"], ["friction", "plain"], ["plain:p", "friction:p"]):
        command = [sys.executable, "-c", ORDER, *order]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        hashes += done.stdout.split()
    assert len(hashes) == 7
    assert len(set(hashes)) == 1, hashes
