"""The C of the firmware: branch coverage, sanitizers, mutants, fuzzing."""

from __future__ import annotations

import itertools
import random
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from validation import cortex_m4
from validation.c_checks import BOARD, PARTS, Part, branches, sanitized
from validation.c_programs import fuzzer
from validation.c_safety import FIRMWARE, record_tests, sizes_of
from validation.mutation.c_session import Bench, mutants

MUTANTS, SEED = 80, 5
pytestmark = pytest.mark.skipif(shutil.which("gcov") is None, reason="needs gcc and gcov")


@pytest.fixture(scope="module", params=PARTS, ids=lambda part: part.name)
def part(request: pytest.FixtureRequest) -> Part:
    made: Part = request.param
    return made


@pytest.fixture(scope="module")
def traces(part: Part, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The calls that the tests of the part make, with their results."""
    path = tmp_path_factory.mktemp(part.name) / "traces"
    record_tests(path, *part.tests)
    return path


def test_every_branch_is_taken(part: Part, traces: Path, tmp_path: Path) -> None:
    """Fails when the tests leave out a branch or a line of the firmware."""
    count, missing = branches(part, traces, tmp_path)
    print(f"{part.name}: {count} branches, {len(missing)} not taken")
    assert count > 100
    assert not missing


def test_no_sanitizer_reports_anything(part: Part, traces: Path, tmp_path: Path) -> None:
    """Fails when a call reads or writes outside its arrays, overflows an integer or shifts too far."""
    assert "all equal" in sanitized(part, traces, tmp_path)


def test_small_errors_of_the_code_are_detected(part: Part, traces: Path, tmp_path: Path) -> None:
    """Fails when the tests detect less than 90 % of a sample of mutants: `make mutate` runs all of them."""
    bench = Bench(part, tmp_path, traces)
    assert bench.error() == ""
    every = [mutant for source in part.sources for mutant in mutants(source)]
    verdicts = [bench.survives(mutant) for mutant in random.Random(SEED).sample(every, MUTANTS)]
    killed, survived = verdicts.count(False), verdicts.count(True)
    print(f"seed {SEED}: {killed} of {killed + survived} mutants detected, {len(every)} in all")
    assert killed + survived > 0.8 * MUTANTS, "most mutants must compile"
    assert killed >= 0.9 * (killed + survived)


def fuzz(program: Path, count: int) -> subprocess.CompletedProcess[str]:
    command = [str(program), str(count), str(SEED)]
    return subprocess.run(command, check=False, capture_output=True, text=True, timeout=300)


def test_random_packets_break_no_promise() -> None:
    """Fails when a random or mutated packet, sample or time gets a set-point past the bounds, or upsets a sanitizer."""
    done = fuzz(fuzzer(), 200_000)
    print(f"seed {SEED}: {done.stdout}")
    assert done.returncode == 0, done.stdout + done.stderr
    accepted, driven = map(int, re.findall(r"(\d+) (?:accepted|set-points above 0)", done.stdout))
    assert accepted > 10_000 and driven > 100_000


@pytest.mark.parametrize(
    ("before", "after", "promise"),
    [
        ("= lower_of(allowed_pa, highest_pa);", "= highest_pa;", "a set-point is within"),
        ("s->output_pa[i] = 0;", "s->output_pa[i] = 10;", "a vented board has no set-points"),
        ("drive(s, step_us, HAND_SAFETY_RATE", "drive(s, step_us, 4 * HAND_SAFETY_RATE", "no set-point rises faster"),
        ("(now_us - s->sample_us) <= HAND_SAFETY_VENT_US", "true", "a board without samples is vented"),
        ("if (room > 0) {", "if (room > -1) {\n        return joint->max_pressure_pa;", "the torque limit"),
    ],
)
def test_the_fuzzer_finds_a_broken_promise(tmp_path: Path, before: str, after: str, promise: str) -> None:
    """Fails when the fuzzer passes a layer that lacks a limit."""
    text = (FIRMWARE / "hand_safety.c").read_text(encoding="utf-8")
    assert text.count(before) == 1
    broken = tmp_path / "hand_safety.c"
    broken.write_text(text.replace(before, after), encoding="utf-8")
    done = fuzz(fuzzer(broken, tmp_path), 200_000)
    assert done.returncode == 1 and promise in done.stdout


@pytest.mark.skipif(shutil.which(cortex_m4.COMPILER) is None, reason="needs arm-none-eabi-gcc")
@pytest.mark.skipif(shutil.which(cortex_m4.EMULATOR) is None, reason="needs qemu-system-arm")
def test_a_cortex_m4_decides_as_this_machine_does(part: Part, traces: Path, tmp_path: Path) -> None:
    """Fails when the board does not build for the target, outgrows it, or sends another byte there."""
    if part is not BOARD:
        pytest.skip("the board's calls include those of the layer")
    sizes = cortex_m4.board_sizes(tmp_path)
    print(sizes)
    assert sum(size for name, size in sizes.items() if name.endswith("flash")) < 8e3
    assert sizes["hand_board ram"] < 4e3
    words = np.fromfile(traces, np.uint32)
    ends = np.cumsum([int(line) for line in sizes_of(traces).read_text(encoding="ascii").split()])
    for start, end in itertools.pairwise(ends):
        if 15_000 < end - start < 60_000:  # one of the random streams, which fit its flash
            break
    cortex_m4.replay_board(words[start:end], tmp_path)
    wrong = words[start:end].copy()
    wrong[-1] ^= 1
    with pytest.raises(RuntimeError, match=cortex_m4.EMULATOR):
        cortex_m4.replay_board(wrong, tmp_path)
