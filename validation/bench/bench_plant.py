"""The plant kernel beside the same equations in C, its first call in a fresh process, and one live sample."""

from __future__ import annotations

import ctypes
import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.kernel.rows import JOINT_PARAMETERS
from hand_model.lanes import LANES, idle_parameters, map_lanes
from hand_model.plant import STATES, Plant
from hand_sim.plant import resting_state

Advance = Callable[[Plant, Array], tuple[float, Array]]

ROOT = Path(__file__).resolve().parents[2]
SOURCE = Path(__file__).with_name("plant_reference.c")
FLAGS = ("-O3", "-march=native")
WIDTHS = (4, 8)
"""Doubles a vector: 256 and 512 bit; the faster one is the reference."""
SAMPLES, PERIOD_S = 1000, 0.005
FIRST_CALL = """
import json, time
begin = time.perf_counter()
import numpy as np
import numba
loaded = time.perf_counter()
from hand_model import plant
imported = time.perf_counter()
from hand_model.lanes import LANES, idle_parameters
par = np.repeat(idle_parameters()[None, :, None], LANES, axis=2)
one = plant.Plant(par, np.zeros((1, plant.STATES, LANES)), 0.005)
ready = time.perf_counter()
one.advance(np.zeros((1, 1, LANES)))
print(json.dumps([loaded - begin, imported - loaded, time.perf_counter() - ready]))
"""


def run(quick: bool) -> list[dict[str, Any]]:
    return [against_c(10 if quick else 100), *first_call(1 if quick else 5), one_sample(100 if quick else 2000)]


def against_c(rounds: int) -> dict[str, Any]:
    """Equal trajectories first, then both in turn; the ratio is the median of the rounds' ratios."""
    with tempfile.TemporaryDirectory() as folder:
        candidates = [compile_reference(Path(folder), width) for width in WIDTHS]
        commands = set_points()
        _, expected = ours(new_plant(), commands)
        for reference in candidates:
            check_equal(expected, reference(new_plant(), commands)[1])
        times = np.array([[f(new_plant(), commands)[0] for f in (ours, *candidates)] for _ in range(rounds)])
    best = 1 + int(np.argmin(np.median(times[:, 1:], axis=0)))
    steps = SAMPLES * new_plant().steps * len(default_hand().joints)
    print(f"plant reference: {compiler()} {' '.join(FLAGS)}, {WIDTHS[best - 1]} doubles a vector")
    own, other = (float(np.median(times[:, k])) / steps * 1e9 for k in (0, best))
    ratio = float(np.median(times[:, 0] / times[:, best]))
    return entry("plant kernel", own, "ns/joint-step", goal=1.3, reference=other, ratio=ratio)


def first_call(rounds: int) -> list[dict[str, Any]]:
    """Fresh processes with a warm cache: the kernel's first call, and what importing it takes."""
    runs = [fresh_process() for _ in range(rounds + 1)][1:]
    library, module, call = (median(times) for times in zip(*runs, strict=True))
    return [
        entry("plant kernel first call, cached", call, "s", goal=0.5),
        entry("plant kernel import", module, "s"),
        entry("numba and numpy import", library, "s"),
    ]


def one_sample(calls: int) -> dict[str, Any]:
    """What a live simulated board pays for one period of one hand in the kernel."""
    plant, commands = new_plant(), set_points()[:, :1]
    plant.advance(commands)
    times = []
    for _ in range(calls):
        begin = time.perf_counter()
        plant.advance(commands)
        times.append(time.perf_counter() - begin)
    return entry("plant kernel, one sample of one hand", median(times) * 1e6, "us", goal=15.0)


def entry(
    name: str,
    own: float,
    unit: str,
    goal: float | None = None,
    reference: float | None = None,
    ratio: float | None = None,
) -> dict[str, Any]:
    return {"name": name, "ours": own, "reference": reference, "ratio": ratio, "goal": goal, "unit": unit}


@cache
def default_hand() -> Hand:
    return load_hand(ROOT / "config" / "hand.yaml")


def new_plant() -> Plant:
    hand = default_hand()
    lanes = map_lanes(hand.partner)
    par = lanes.scatter(hand.parameters, idle_parameters())
    return Plant(par, lanes.scatter(resting_state(hand), np.zeros(STATES)), PERIOD_S)


def set_points() -> Array:
    """Set-points (1, SAMPLES, LANES) that jump ten times a second, from 0 to the supply and a little beyond."""
    jumps = np.random.default_rng(0).uniform(-5e4, 6.5e5, (1, SAMPLES // 20, LANES))
    return np.repeat(jumps, 20, axis=1)


def ours(plant: Plant, commands: Array) -> tuple[float, Array]:
    begin = time.perf_counter()
    states = plant.advance(commands)
    return time.perf_counter() - begin, states


def compile_reference(folder: Path, width: int) -> Advance:
    """The C kernel as a function like `ours`."""
    target = folder / f"plant_{width}.so"
    command = ["cc", *FLAGS, f"-DWIDTH={width}", "-shared", "-fPIC", str(SOURCE), "-o", str(target)]
    subprocess.run(command, check=True)
    library = ctypes.CDLL(str(target))
    rows = ctypes.c_int.in_dll(library, "parameter_rows").value
    if rows != len(JOINT_PARAMETERS):
        raise RuntimeError(f"{SOURCE.name} has {rows} parameter rows, the model {len(JOINT_PARAMETERS)}: bring it up")

    def advance(plant: Plant, commands: Array) -> tuple[float, Array]:
        begin = time.perf_counter()
        out = np.empty((1, commands.shape[1], STATES, LANES))
        x, par, history, heads = (array.ctypes for array in (plant.x, plant.par, plant.history, plant.heads))
        counts = (ctypes.c_long(commands.shape[1]), ctypes.c_long(plant.steps), ctypes.c_double(plant.h))
        library.advance(*map(pointer, (x, par, history, heads, commands.ctypes)), *counts, pointer(out.ctypes))
        return time.perf_counter() - begin, out

    return advance


def pointer(data: Any) -> ctypes.c_void_p:
    return ctypes.c_void_p(data.data)


def check_equal(expected: Array, states: Array, tolerance: float = 1e-9) -> None:
    """Raise unless both trajectories agree, relative to each state's largest value."""
    scale = np.abs(expected).max(axis=(0, 1, 3))
    worst = float((np.abs(states - expected).max(axis=(0, 1, 3)) / scale).max())
    if not worst <= tolerance:
        raise RuntimeError(f"the C reference differs from the kernel by {worst:.2g} relative; speed means nothing")


def fresh_process() -> list[float]:
    """Seconds for importing numba and NumPy, for importing the kernel, for its first call."""
    done = subprocess.run([sys.executable, "-c", FIRST_CALL], cwd=ROOT, capture_output=True, text=True, check=True)
    times: list[float] = json.loads(done.stdout)
    return times


def compiler() -> str:
    if shutil.which("cc") is None:
        raise RuntimeError("the plant bench needs a C compiler named cc")
    return subprocess.run(["cc", "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
