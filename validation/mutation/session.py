"""One group of mutants: `python -m validation.mutation.session NAME SAMPLE SEED` in a copy of the tree.

cosmic-ray finds and makes the mutants. The tests of each run in a forked child of this process, which has imported the
libraries once: that takes a fraction of the time of a new interpreter for each mutant. Results are JSON lines.
"""

from __future__ import annotations

import json
import math
import os
import random
import re
import resource
import signal
import sys
import time
from importlib import import_module
from pathlib import Path
from typing import Any

import numba
import numba.extending
import numpy as np
import pytest
from cosmic_ray.commands.init import _all_work_items
from cosmic_ray.config import load_config
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator
from cosmic_ray.work_item import MutationSpec

HERE = Path(__file__).resolve().parent
WAITS = 20
LIBRARIES = ("numpy", "numba", "scipy.optimize", "scipy.interpolate", "scipy.stats", "yaml", "cobs.cobs")
"""What the tests import besides the code under test."""


def main() -> None:
    """Run the mutants of one group and print its result."""
    name, sample, seed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    config = load_config(str(HERE / f"{name}.toml"))
    for library in LIBRARIES:
        import_module(library)
    _leave_uncompiled()
    command, timeout_s = config["test-command"].split(), float(config["timeout"])
    tests = command[command.index("pytest") + 1 :]
    if _tests_fail(tests, 60.0):
        _say(mutants=0, killed=0, error=f"the tests fail without a mutation: {config['test-command']}")
        return
    mutations = _mutations(config)
    chosen = random.Random(seed).sample(mutations, sample) if 0 < sample < len(mutations) else mutations
    begun_s, killed = time.monotonic(), 0
    survivors: list[dict[str, Any]] = []
    for number, mutation in enumerate(chosen, 1):
        survivor = _survivor(mutation, tests, timeout_s)
        killed += survivor is None
        survivors += [survivor] if survivor else []
        if number % 10 == 0:
            _say(progress=f"{number} of {len(chosen)} mutants, {killed} killed")
    modules = sorted({str(mutation.module_path) for mutation in mutations})
    counts = {"mutants": len(chosen), "total": len(mutations), "killed": killed, "survivors": survivors}
    _say(**counts, modules=modules, seconds=time.monotonic() - begun_s)


def _leave_uncompiled() -> None:
    """Let loops run as Python: a mutant runs once, and compiling it would take longer than its tests."""
    numba.njit = _uncompiled
    numba.carray = lambda pointer, shape: np.empty(shape)
    numba.extending.intrinsic = lambda function: lambda *arguments: None


def _uncompiled(*functions: Any, **_options: Any) -> Any:
    """Stand in for numba.njit."""

    def same(function: Any) -> Any:
        function.py_func = function
        function.compile = lambda signature: None
        return function

    return same(functions[0]) if functions else same


def _mutations(config: Any) -> list[MutationSpec]:
    """Every mutation of the group's modules whose operator is not left out."""
    paths = config["module-path"]
    patterns = [paths] if isinstance(paths, str) else paths
    modules = [module for pattern in patterns for module in sorted(Path().glob(pattern))]
    left_out = [re.compile(text) for text in config["filters"]["operators-filter"]["exclude-operators"]]
    last = config["filters"].get("lines-filter", {}).get("skip-from", "")
    lines = {module: _lines(module, last) for module in modules}
    every = (mutation for item in _all_work_items(modules, {}) for mutation in item.mutations)
    inside = (m for m in every if m.start_pos[0] in lines[Path(m.module_path)])
    return [m for m in inside if not any(pattern.match(m.operator_name) for pattern in left_out)]


def _lines(module: Path, last: str) -> set[int]:
    """Numbers of the lines to mutate: no decorators, and nothing from the first line on that begins with `last`."""
    lines = module.read_text(encoding="utf-8").splitlines()
    end = next((number for number, line in enumerate(lines) if last and line.startswith(last)), len(lines))
    return {number for number, line in enumerate(lines[:end], 1) if not line.startswith("@")}


def _survivor(mutation: MutationSpec, tests: list[str], timeout_s: float) -> dict[str, Any] | None:
    """Apply a mutation and run the tests: where it stands and what it changes, None where a test detects it."""
    path = mutation.module_path
    before = path.read_text(encoding="utf-8")
    after = mutate_code(before, get_operator(mutation.operator_name)(**mutation.operator_args), mutation.occurrence)
    path.write_text(after, encoding="utf-8")
    try:
        if _tests_fail(tests, timeout_s):
            return None
    finally:
        path.write_text(before, encoding="utf-8")
    line = mutation.start_pos[0]
    lines = [text.splitlines()[line - 1].strip() for text in (before, after)]
    operator = mutation.operator_name.removeprefix("core/")
    return {"module": str(path), "line": line, "operator": operator, "before": lines[0], "after": lines[1]}


def _tests_fail(tests: list[str], timeout_s: float) -> bool:
    """Whether the tests fail, or take more processor time than timeout_s [s], in a forked child.

    Processor time, because a busy machine would otherwise kill mutants that the tests do not; WAITS times as long for
    a child that waits for ever.
    """
    child = os.fork()
    if child == 0:
        limit = math.ceil(timeout_s)
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.dup2(null, 2)
        os._exit(int(pytest.main(tests)))
    end_s = time.monotonic() + WAITS * timeout_s
    while time.monotonic() < end_s:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return status != 0
        time.sleep(0.01)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return True


def _say(**message: Any) -> None:
    print(json.dumps(message), flush=True)


if __name__ == "__main__":
    main()
