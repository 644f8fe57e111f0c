"""The firmware on a Cortex-M4: flash, RAM and cycles of one tick of the law, and the board sample in an emulator.

The cycles of an instruction are those of the table in the Cortex-M4 technical reference manual (ARM DDI 0439), and
every taken branch counts the longest refill of the pipeline: an upper bound for memory without wait states.
"""

from __future__ import annotations

import itertools
import re
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hand_control.declared import GAINS, INPUTS, OUTPUTS, STATE, Settings
from hand_control.tuning import gains
from hand_model.arrays import Array
from hand_model.description import load_hand
from validation.paper.step_rig import reference

ROOT = Path(__file__).parents[1]
FIRMWARE = ROOT / "firmware"
TARGET = ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")
OPTIONS = (*TARGET, "-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno", "-ffreestanding")
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror")
INCLUDES = (f"-I{FIRMWARE}", f"-I{FIRMWARE / 'board'}", f"-I{FIRMWARE / 'host'}")
COMPILER, EMULATOR = "arm-none-eabi-gcc", "qemu-system-arm"
TICKS, DT_S = 60, 0.005
CLOCK_HZ, RATE_HZ = 168e6, 1000.0
CYCLES = {
    "vdiv.f32": 14,
    "vsqrt.f32": 14,
    "ldr": 2,
    "ldrd": 3,
    "str": 2,
    "strd": 3,
    "vldr": 2,
    "vstr": 2,
}
REFILL = 3
SHARE = "share of a tick at 1 kHz, 168 MHz"


def measure() -> dict[str, float]:
    """Flash and RAM [B] of the law, cycles of its longest tick, and their share of the period at RATE_HZ [%]."""
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        (work / "data.h").write_text(data_header(), encoding="ascii")
        law, elf = work / "hand_law.o", work / "law.elf"
        _call(COMPILER, *OPTIONS, "-c", FIRMWARE / "hand_law.c", "-o", law)
        _call(
            COMPILER, *OPTIONS, "-nostdlib", f"-I{FIRMWARE}", f"-I{work}", "-T", FIRMWARE / "target" / "link.ld",
            FIRMWARE / "target" / "main.c", law, "-o", elf, "-lgcc",
        )  # fmt: skip
        flash = float(_call("arm-none-eabi-size", law).splitlines()[1].split()[0])
        log = work / "trace.log"
        _call(
            EMULATOR, "-M", "mps2-an386", "-nographic", "-semihosting", "-singlestep", "-d", "exec,nochain", "-D", log,
            "-kernel", elf,
        )  # fmt: skip
        cycles = longest_tick(log, _call("arm-none-eabi-objdump", "-d", "--no-show-raw-insn", elf))
    rows = np.array([len(names) for names in (GAINS, STATE, INPUTS, OUTPUTS)])
    ram = float(4 * 11 * rows.sum())
    return {
        "flash": flash,
        "ram": ram,
        "cycles": float(cycles),
        SHARE: 100.0 * cycles * RATE_HZ / CLOCK_HZ,
    }


def board_sizes(folder: Path) -> dict[str, float]:
    """Flash of safety layer and board sample, and RAM of one board [B], compiled with every warning as an error."""
    sizes = {}
    for name in ("hand_safety.c", "board/hand_wire.c", "board/hand_board.c"):
        made = folder / f"{Path(name).stem}.o"
        _call(COMPILER, *OPTIONS, *WARNINGS, *INCLUDES, "-c", FIRMWARE / name, "-o", made)
        sizes[f"{made.stem} flash"] = float(_call("arm-none-eabi-size", made).splitlines()[1].split()[0])
    probe = folder / "probe.c"
    probe.write_text('#include "hand_board.h"\nhand_board board;\nhand_safety safety;\n', encoding="ascii")
    _call(COMPILER, *OPTIONS, *INCLUDES, "-c", probe, "-o", folder / "probe.o")
    for line in _call("arm-none-eabi-nm", "-S", folder / "probe.o").splitlines():
        _, size, _, name = line.split()
        sizes[f"hand_{name} ram"] = float(int(size, 16))
    return sizes


def replay_board(words: NDArray[np.uint32], folder: Path) -> None:
    """Replay a trace (words,) of `validation.c_board` on the emulated Cortex-M4. RuntimeError: a result differs."""
    values = ",".join(f"{word}u" for word in words.tolist())
    text = f"#define TRACE_WORDS {len(words)}u\nstatic const uint32_t trace[] = {{{values}}};\n"
    (folder / "trace.h").write_text(text, encoding="ascii")
    elf = folder / "board.elf"
    _call(
        COMPILER, *OPTIONS, *WARNINGS, *INCLUDES, f"-I{folder}", "-nostdlib", "-T", FIRMWARE / "target" / "link.ld",
        FIRMWARE / "target" / "board_main.c", FIRMWARE / "host" / "board_replay.c", FIRMWARE / "hand_safety.c",
        FIRMWARE / "board" / "hand_wire.c", FIRMWARE / "board" / "hand_board.c", "-o", elf, "-lgcc",
    )  # fmt: skip
    _call(EMULATOR, "-M", "mps2-an386", "-nographic", "-semihosting", "-kernel", elf)


def data_header() -> str:
    """The hand's gains and TICKS ticks of a step between 30 and 80 degrees, as C arrays."""
    hand = load_hand(ROOT / "config" / "hand.yaml")
    settings = Settings.of(hand, {})
    target = reference(settings)[:, 590 : 590 + TICKS]
    count = len(hand.joints)
    rng = np.random.default_rng(0)
    lines = []
    for k in range(TICKS):
        rows = [np.full(count, target[r, k]) for r in range(3)]
        angle = target[0, max(k - 4, 0)] + 3e-4 * rng.standard_normal(count)
        rows += [hand.limits.max_torque_nm, angle, 5e4 + 2e3 * k + 100.0 * rng.standard_normal(count)]
        lines.append(np.concatenate(rows))
    return (
        f"#define JOINTS {count}\n#define TICKS {TICKS}\n#define DT {DT_S}f\n"
        f"static const float gains[] = {{{_numbers(gains(hand, settings).ravel())}}};\n"
        f"static const float inputs[] = {{{_numbers(np.concatenate(lines))}}};\n"
    )


def _numbers(values: Array) -> str:
    return ", ".join(f"{value:.9e}f" for value in values)


def longest_tick(trace: Path, listing: str) -> int:
    """Cycles of the longest call of hand_law_tick in a trace of single instructions."""
    cost: dict[int, int] = {}
    start = 0
    for line in listing.splitlines():
        if found := re.match(r"([0-9a-f]+) <hand_law_tick>:", line):
            start = int(found[1], 16)
        if found := re.match(r"\s*([0-9a-f]+):\s+(\S+)(?:\s+(.*))?", line):
            cost[int(found[1], 16)] = _cycles(found[2], found[3] or "")
    addresses = sorted(cost)
    after = dict(itertools.pairwise(addresses))
    longest = spent = 0
    last = -1
    for line in trace.read_text(encoding="ascii", errors="replace").splitlines():
        found = re.search(r"\[[0-9a-f]+/([0-9a-f]+)/", line)
        if not found:
            continue
        address = int(found[1], 16)
        if address == start:
            longest, spent = max(longest, spent), 0
        if last >= 0 and after.get(last) != address:
            spent += REFILL
        spent += cost.get(address, 1)
        last = address
    return longest  # the last call includes the end of the program and does not count


def _cycles(name: str, operands: str) -> int:
    plain = name.removesuffix(".w").removesuffix(".n")
    if plain.startswith(("push", "pop", "ldm", "stm", "vpush", "vpop", "vldm", "vstm")):
        return 1 + max(operands.count(",") + 1, 1) + 16 * operands.count("-")
    return CYCLES.get(plain, 1)


def _call(*command: object) -> str:
    done = subprocess.run([str(part) for part in command], check=False, capture_output=True, text=True, timeout=120)
    if done.returncode != 0:
        raise RuntimeError(f"{command[0]}: {done.stderr.strip() or done.returncode}")
    return done.stdout
