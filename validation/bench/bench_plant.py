"""The closed loop, an independent integrator in C, the loops' first calls, and one live sample.

The reference in C is a classical Runge-Kutta integrator of the plain plant's equations, written with vector
instructions. Both run the same motion at the default step, and their trajectories must agree before either is timed.

HAND_FORMER=folder: the tree of another version of this project, whose open loop is run in turn with this one's.
"""

from __future__ import annotations

import ctypes
import json
import os
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
from hand_model.effects import CATALOGUE
from hand_model.effects.effect import EXOGENOUS, Effect
from hand_model.kernel.closed_loop import HISTORY, ClosedLoop
from hand_model.kernel.lanes import LANES, idle_parameters, map_hands
from hand_model.kernel.layout import PHI, P
from hand_model.kernel.open_loop import MeasuredInputs, open_loop
from hand_model.kernel.plant_rows import PLANT_PARAMETERS
from hand_model.kernel.rows import ROW, STATES
from hand_model.kernel.step import steps_per_sample
from hand_sim.plant import resting_state
from validation.bench.result import figure

Reference = Callable[[Array], tuple[float, Array]]

ROOT = Path(__file__).resolve().parents[2]
SOURCE = Path(__file__).with_name("plant_reference.c")
FLAGS = ("-O3", "-march=native")
WIDTHS = (4, 8)
"""Doubles a vector: 256 and 512 bit; the faster one is the reference."""
SAMPLES, PERIOD_S = 1000, 0.005
ANALOG = tuple(effect for effect in CATALOGUE if "valve" not in effect.hooks)
"""Every effect of a hand with analog valves: a switching valve takes the place of others."""
AGREEMENT = (20.0, np.radians(0.005))
"""Largest difference of pressure [Pa] and angle [rad] from the reference in C."""
FITTED, FIT_STEPS_S = 32, (1.3e-3, 2.6e-3)
"""Parameter sets of a fit, and its integration steps."""
MOVED = [ROW["valve.time_constant_s"], ROW["statics.a2_nm_per_pa"]]
"""A number of each stage: every set moves one of them, as a fit does."""
START = """
import json, time
begin = time.process_time()
import numpy as np
from hand_model.description import load_hand
from hand_sim.plant import SimulatedPlant
hand = load_hand({hand!r})
imported = time.process_time()
SimulatedPlant(hand, 200.0).step(np.zeros(hand.valve_count))
print(json.dumps([imported, time.process_time() - imported]))
"""


FITS = """
import json, time
import numpy as np
from hand_model.description import load_hand
from hand_model.effects.effect import EXOGENOUS
from hand_model.kernel.open_loop import MeasuredInputs, open_loop
from hand_model.kernel.rows import STATES
column, u = load_hand("config/hand.yaml").parameters[:, 0], np.array({set_points})
columns, start = np.repeat(column[None], {sets}, axis=0), np.zeros(({sets}, STATES))
for k in range({sets}):
    columns[k, {rows}[k % 2]] *= 1.0 + 1e-3 * k
inputs = MeasuredInputs(u, np.abs(u), np.zeros((len(u), EXOGENOUS)), {period_s})
def once():
    begin = time.process_time()  # of all threads
    open_loop(columns, start, inputs, step_s={step_s}, effects=())
    return time.process_time() - begin
print(json.dumps([once() for _ in range(6)]))
"""
"""The open loop as a fit runs it, in any version: CPU seconds, the first call compiles."""
FORMER = "HAND_FORMER"
"""Environment variable with the folder of the other version."""
FORMER_GOAL = 1.1


def run(quick: bool) -> list[dict[str, Any]]:
    """All results of this bench; quick: few rounds."""
    results = [*against_c(5 if quick else 100), *start_up(1 if quick else 5), one_sample(100 if quick else 2000)]
    if FORMER in os.environ:
        results.append(former_fits(Path(os.environ[FORMER]).resolve(), 1 if quick else 5))
    return results


def former_fits(former: Path, rounds: int) -> dict[str, Any]:
    """The open loop of this version and of another one, in turn. Raises ValueError where there is no such tree."""
    if not (former / "hand_model" / "kernel" / "open_loop.py").is_file():
        raise ValueError(f"{FORMER} is {former}; it must be a tree of this project")
    step_s = FIT_STEPS_S[-1]
    u = set_points()[:, 0].tolist()
    script = FITS.format(set_points=u, sets=FITTED, rows=MOVED, period_s=PERIOD_S, step_s=step_s)
    times = np.array([[_least(script, tree) for tree in (ROOT, former)] for _ in range(rounds)])
    ours, theirs = (float(value) for value in np.median(times, axis=0))
    per_step_ns = 1e9 / (SAMPLES * steps_per_sample(PERIOD_S, step_s) * FITTED)
    name = f"open loop, {FITTED} parameter sets, step {step_s * 1e3:g} ms (reference: the former version)"
    return figure(name, ours * per_step_ns, FORMER_GOAL, "ns CPU/joint-step", theirs * per_step_ns)


def _least(script: str, tree: Path) -> float:
    """Least of the times [s] that a script prints but the first one, run with the code of a tree."""
    environment = os.environ | {"PYTHONPATH": str(tree)}
    done = subprocess.run([sys.executable, "-c", script], cwd=tree, env=environment, capture_output=True, check=True)
    return float(min(json.loads(done.stdout)[1:]))


def against_c(rounds: int) -> list[dict[str, Any]]:
    """Equal trajectories first, then all in turn; ratios are those of the medians."""
    with tempfile.TemporaryDirectory() as folder:
        references = [compile_reference(Path(folder), width) for width in WIDTHS]
        commands = set_points()
        for reference in references:
            check_agreement(ours(())(commands)[1], reference(commands)[1])
        fits = [fit(step_s) for step_s in FIT_STEPS_S]
        timed = [*references, ours(()), ours(ANALOG), ours(ANALOG, laws=True), *fits]
        times = np.array([[run_once(commands)[0] for run_once in timed] for _ in range(rounds)])
    in_c, plain, whole, lawful, *fitted = (float(value) for value in _per_joint_step(np.median(times, axis=0)))
    print(f"plant reference: {compiler()} {' '.join(FLAGS)}")
    unit = "ns CPU/joint-step"
    return [
        figure("closed loop, plain plant", plain, 1.3, unit, in_c),
        figure("closed loop, every effect", whole, 2.6, unit, in_c),
        figure("closed loop, every effect with its law", lawful, 2.6, unit, in_c),
        *(
            figure(f"open loop, {FITTED} parameter sets, step {step_s * 1e3:g} ms", value, None, unit, in_c)
            for step_s, value in zip(FIT_STEPS_S, fitted, strict=True)
        ),
    ]


def _per_joint_step(times: Array) -> Array:
    """Nanoseconds for one step of one joint or parameter set: the faster C, the closed loops, the fits."""
    closed = SAMPLES * steps_per_sample(PERIOD_S) * len(default_hand().joints)
    fits = [SAMPLES * steps_per_sample(PERIOD_S, step_s) * FITTED for step_s in FIT_STEPS_S]
    seconds = np.array([times[: len(WIDTHS)].min(), *times[len(WIDTHS) :]])
    per: Array = seconds / np.array([closed, closed, closed, closed, *fits]) * 1e9
    return per


def start_up(rounds: int) -> list[dict[str, Any]]:
    """CPU time of fresh processes until the simulated hand has taken its first step, without and with a cache."""
    cold, warm = [], []
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as cache_folder:
            cold.append(sum(fresh_process(cache_folder)))
            warm.append(sum(fresh_process(cache_folder)))
    return [
        figure("simulated hand, first start", median(cold), 3.0, "s CPU"),
        figure("simulated hand, start with compiled loops", median(warm), 1.5, "s CPU"),
    ]


def one_sample(calls: int) -> dict[str, Any]:
    """What a live simulated board pays for one period of one hand."""
    loop, commands = new_loop(()), set_points()[None, :1]
    loop.advance(commands)
    times = []
    for _ in range(calls):
        begin = time.process_time()
        loop.advance(commands)
        times.append(time.process_time() - begin)
    return figure("closed loop, one sample of one hand", median(times) * 1e6, None, "us CPU")


@cache
def default_hand() -> Hand:
    """The shipped hand."""
    return load_hand(ROOT / "config" / "hand.yaml")


@cache
def set_points() -> Array:
    """Set-points (SAMPLES, joints) [Pa] that jump ten times a second, from 0 to the supply and a little beyond."""
    jumps = np.random.default_rng(0).uniform(-5e4, 6.5e5, (SAMPLES // 20, len(default_hand().joints)))
    return np.repeat(jumps, 20, axis=0)


def new_loop(effects: tuple[Effect, ...], laws: bool = False) -> ClosedLoop:
    """The shipped hand at rest; every effect compiled in acts, in its textbook form or with its law."""
    hand = default_hand()
    parameters = hand.parameters[None].copy()
    for effect in effects:
        for parameter in (own for own in effect.parameters if laws or not own.law):
            parameters[:, ROW[parameter.key]] += 0.1 * parameter.typical * parameter.scale
    return ClosedLoop(parameters, hand.partner, resting_state(hand)[None], PERIOD_S, effects=effects)


def ours(effects: tuple[Effect, ...], laws: bool = False) -> Reference:
    """The closed loop with a set of effects, as a function like those of the references."""

    def advance(commands: Array) -> tuple[float, Array]:
        loop = new_loop(effects, laws)
        begin = time.thread_time()
        states = loop.advance(commands[None])
        return time.thread_time() - begin, states[0]

    return advance


def fit(step_s: float) -> Reference:
    """The open loop as a fit runs it: many parameter sets of one joint."""
    hand = default_hand()
    columns, start = np.repeat(hand.parameters[:, :1].T, FITTED, axis=0), np.zeros((FITTED, STATES))
    for k in range(FITTED):
        columns[k, MOVED[k % 2]] *= 1.0 + 1e-3 * k

    def predict(commands: Array) -> tuple[float, Array]:
        around = np.zeros((SAMPLES, EXOGENOUS))
        inputs = MeasuredInputs(commands[:, 0], np.abs(commands[:, 0]), around, PERIOD_S)
        begin = time.process_time()  # of all threads
        readings = open_loop(columns, start, inputs, step_s=step_s)
        return time.process_time() - begin, readings

    return predict


def compile_reference(folder: Path, width: int) -> Reference:
    """The integrator in C as a function like `ours`. Raises RuntimeError for rows beyond the plain plant."""
    target = folder / f"plant_{width}.so"
    command = ["cc", *FLAGS, f"-DWIDTH={width}", "-shared", "-fPIC", str(SOURCE), "-o", str(target)]
    subprocess.run(command, check=True)
    library = ctypes.CDLL(str(target))
    rows = ctypes.c_int.in_dll(library, "parameter_rows").value
    if rows != len(PLANT_PARAMETERS):
        raise RuntimeError(f"{SOURCE.name} has {rows} parameter rows; the plain plant has {len(PLANT_PARAMETERS)}")
    hand, steps = default_hand(), steps_per_sample(PERIOD_S)
    lanes = map_hands(hand.partner, 1)
    par = lanes.scatter(hand.parameters[:rows], idle_parameters()[:rows])

    def advance(commands: Array) -> tuple[float, Array]:
        x = lanes.scatter(resting_state(hand), np.zeros(STATES))
        history, head = np.zeros((HISTORY, LANES)), np.zeros(1, dtype=np.int64)
        spread, out = np.zeros((len(commands), LANES)), np.empty((len(commands), STATES, LANES))
        spread[:, lanes.lane] = commands
        arrays = map(pointer, (x.ctypes, par.ctypes, history.ctypes, head.ctypes, spread.ctypes))
        counts = (ctypes.c_long(len(commands)), ctypes.c_long(steps), ctypes.c_double(PERIOD_S / steps))
        begin = time.thread_time()
        library.advance(*arrays, *counts, pointer(out.ctypes))
        return time.thread_time() - begin, out[:, :, lanes.lane]

    return advance


def pointer(data: Any) -> ctypes.c_void_p:
    """Pointer to an array's memory."""
    return ctypes.c_void_p(data.data)


def check_agreement(states: Array, expected: Array) -> None:
    """Raises RuntimeError unless both trajectories (samples, STATES, joints), SI, agree in pressure and angle."""
    difference = np.abs(states - expected).max(axis=(0, 2))
    if not (difference[P] <= AGREEMENT[0] and difference[PHI] <= AGREEMENT[1]):
        problem = f"{difference[P]:.3g} Pa and {np.degrees(difference[PHI]):.3g} deg"
        raise RuntimeError(f"the C reference differs from the closed loop by {problem}; speed means nothing")


def fresh_process(cache_folder: str) -> list[float]:
    """CPU seconds for the imports, and for the first step of the simulated hand."""
    script = START.format(hand=str(ROOT / "config" / "hand.yaml"))
    environment = os.environ | {"NUMBA_CACHE_DIR": cache_folder}
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    times: list[float] = json.loads(done.stdout)
    return times


def compiler() -> str:
    """First line of what the C compiler says of its version. RuntimeError: there is none."""
    if shutil.which("cc") is None:
        raise RuntimeError("the plant bench needs a C compiler named cc")
    return subprocess.run(["cc", "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
