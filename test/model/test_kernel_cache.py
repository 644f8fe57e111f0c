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
from hand_model.lanes import LANES, idle_parameters
from hand_model.plant import PHI, STATES, Plant
par = np.repeat(idle_parameters()[None, :, None], LANES, axis=2)
print(Plant(par, np.zeros((1, STATES, LANES)), 0.01).advance(np.full((1, 2000, LANES), 1e5))[0, -1, PHI, 0])
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
    (package / "__pycache__").write_text("in the way of a folder", encoding="utf-8")
    cache = tmp_path / "cache"

    before = angle_after_a_run(tmp_path, cache)
    assert 0.05 < before < 0.15
    assert list(cache.rglob("plant._kernel*.nbi")), "no cache in the user's folder"
    assert angle_after_a_run(tmp_path, cache) == before

    statics = package / "statics.py"
    text = statics.read_text(encoding="utf-8")
    statics.write_text(text.replace("+ (a2 + a3 * phi) * p", "+ 0.5 * (a2 + a3 * phi) * p"), encoding="utf-8")
    halved = angle_after_a_run(tmp_path, cache)
    assert abs(halved - before / 2) < 1e-3


ORDER = """
import hashlib, sys
import numpy as np
from hand_model import plant
from hand_model.lanes import LANES, idle_parameters
par = np.repeat(np.repeat(idle_parameters()[None, :, None], LANES, axis=2), 3, axis=0)
par *= np.random.default_rng(3).uniform(0.98, 1.0, par.shape)
commands = np.random.default_rng(4).uniform(0.0, 5e5, (3, 300, LANES))
for parallel in sys.argv[1]:
    plant.PARALLEL_STEPS = 0 if parallel == "p" else 10**12
    hands = plant.Plant(par, np.zeros((3, plant.STATES, LANES)), 0.005)
    print(hashlib.sha256(hands.advance(commands).tobytes()).hexdigest())
"""


def test_the_same_bits_whatever_was_compiled_when(tmp_path: Path) -> None:
    """Broken by a result that depends on which kernels came from the cache and which were compiled in the process."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    hashes = []
    for order in ("s", "s", "p", "ps", "sp"):
        command = [sys.executable, "-c", ORDER, order]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        hashes += done.stdout.split()
    assert len(hashes) == 7
    assert len(set(hashes)) == 1, hashes
