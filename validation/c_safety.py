"""The safety layer in C against `hand_control.safety_rules`: recorded calls, replayed by the compiled layer.

A `Trace` calls the Python rules and records every call with its result. `Trace.replay` runs the same calls through
the C layer, which compares every result, state, fault, flag and set-point. With TRACES=FILE in the environment each
replayed trace is also appended to FILE, for the runs that need another build: coverage, mutants, sanitizers, target.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import struct
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hand_control import safety_rules
from hand_control.safety_rules import Answer, JointLimits, SafetyLayer

ROOT = Path(__file__).resolve().parents[1]
FIRMWARE = ROOT / "firmware"
HOST = FIRMWARE / "host"
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror")
OPTIONS = ("-std=c99", *WARNINGS, f"-I{FIRMWARE}", f"-I{HOST}", f"-I{FIRMWARE / 'board'}")
LAYER = (FIRMWARE / "hand_safety.c", HOST / "replay.c")
EVENTS = (
    "start", "command", "session", "sample", "heartbeat", "arm", "vent", "reset", "tick", "step", "integer", "ceiling",
    "damage",
)  # fmt: skip
"""Kinds of events, in the order of replay.c."""
NO_INTEGER = 0x7FFFFFFF


def build(name: str, sources: Sequence[Path], *options: str, folder: Path | None = None, compiler: str = "cc") -> Path:
    """Compile sources into out/firmware (or folder), where the same build is missing; its path, else RuntimeError."""
    folder = folder or ROOT / "out" / "firmware"
    headers = sorted(path for path in FIRMWARE.rglob("*.[ch]"))
    text = b"".join(path.read_bytes() for path in [*headers, *sources]) + " ".join((compiler, *options)).encode()
    made = folder / f"{hashlib.sha256(text).hexdigest()[:16]}-{name}"
    if not made.exists():
        folder.mkdir(parents=True, exist_ok=True)
        partial = made.with_suffix(f".{os.getpid()}{made.suffix}")
        command = [compiler, *OPTIONS, *options, *map(str, sources), "-o", str(partial)]
        done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=folder)
        if done.returncode != 0:
            raise RuntimeError(f"{compiler} fails for {name}:\n{done.stderr}")
        partial.replace(made)
    return made


@cache
def _library() -> ctypes.CDLL:
    library = ctypes.CDLL(str(build("replay.so", LAYER, "-O2", "-shared", "-fPIC")))
    library.hand_replay.restype = library.hand_replay_compared.restype = ctypes.c_size_t
    library.hand_replay.argtypes = (ctypes.c_void_p, ctypes.c_size_t)
    return library


def replay(words: NDArray[np.uint32]) -> tuple[int, int]:
    """Replay events (words,) in C: number of the first event that differs (0: none), and number of events compared."""
    given = np.ascontiguousarray(words)
    differs = int(_library().hand_replay(given.ctypes.data, len(given)))
    return differs, int(_library().hand_replay_compared())


def record_tests(traces: Path, *tests: str) -> None:
    """Run tests, without the lock of real time, and write all traces that they replay into one file.

    Raises RuntimeError where they fail.
    """
    environment = os.environ | {"TRACES": str(traces)}
    command = [sys.executable, "-m", "pytest", "-q", "--noconftest", "-p", "no:cacheprovider", *tests]
    done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=ROOT, env=environment)
    if done.returncode != 0:
        raise RuntimeError(f"the tests fail: {' '.join(tests)}\n{done.stdout}")


def keep(words: NDArray[np.uint32]) -> None:
    """Append a trace (words,) to the file that TRACES names, if any, and its length to a second file."""
    if "TRACES" in os.environ:
        path = Path(os.environ["TRACES"])
        with path.open("ab") as file, sizes_of(path).open("a", encoding="ascii") as sizes:
            file.write(words.tobytes())
            sizes.write(f"{len(words)}\n")


def sizes_of(traces: Path) -> Path:
    """The file with the lengths of the traces in a file."""
    return traces.with_suffix(".sizes")


class Trace:
    """The Python rules, with every call recorded. Times [us] do not wrap here and wrap in C."""

    def __init__(self, joints: Sequence[JointLimits]) -> None:
        """Start a layer."""
        self.words: list[int] = []
        self.lines: list[str] = []
        self._all = tuple(joints)
        self.layer = SafetyLayer(self._all)
        rows = [value for joint in joints for value in _row(joint)]
        self._record("start", self.layer.good, len(joints), *rows)

    def _record(self, event: str, result: int, *arguments: int) -> None:
        layer = self.layer
        flags = layer.late + 2 * layer.integrate + 4 * layer.torque_limited + 8 * layer.rate_limited
        after = (int(result), int(layer.state), int(layer.fault), flags, len(layer.output_pa), *layer.output_pa)
        self.words += [EVENTS.index(event), *map(int, arguments), *after]
        self.lines.append(f"{event} {arguments} -> {after}")

    def command(self, now_us: int, sequence: int, lifetime_us: int, pressure_pa: Sequence[int]) -> Answer:
        """See SafetyLayer.command."""
        answer = self.layer.command(now_us, sequence, lifetime_us, pressure_pa)
        self._record("command", answer, now_us, sequence, lifetime_us, len(pressure_pa), *pressure_pa)
        return answer

    def new_session(self) -> None:
        """See SafetyLayer.new_session."""
        self.layer.new_session()
        self._record("session", 0)

    def sample(
        self, now_us: int, sequence: int, pressure_pa: Sequence[int], angle_urad: Sequence[int], valid: bool = True
    ) -> bool:
        """See SafetyLayer.sample."""
        result = self.layer.sample(now_us, sequence, valid, pressure_pa, angle_urad)
        self._record("sample", result, now_us, sequence, valid, *pressure_pa, *angle_urad)
        return result

    def heartbeat(self, now_us: int, number: int) -> bool:
        """See SafetyLayer.heartbeat."""
        result = self.layer.heartbeat(now_us, number)
        self._record("heartbeat", result, now_us, number)
        return result

    def arm(self, now_us: int) -> bool:
        """See SafetyLayer.arm."""
        result = self.layer.arm(now_us)
        self._record("arm", result, now_us)
        return result

    def vent(self) -> None:
        """See SafetyLayer.vent."""
        self.layer.vent()
        self._record("vent", 0)

    def reset(self) -> bool:
        """See SafetyLayer.reset."""
        result = self.layer.reset()
        self._record("reset", result)
        return result

    def tick(self, now_us: int) -> list[int]:
        """See SafetyLayer.tick."""
        result = self.layer.tick(now_us)
        self._record("tick", 1, now_us)
        return list(result)

    def step(self, dt_s: float) -> float:
        """See safety_rules.law_step."""
        result = safety_rules.law_step(dt_s)
        self._record("step", _bits(result), _bits(dt_s))
        return result

    def integer(self, value: float, scale: float) -> int | None:
        """See safety_rules.integer."""
        result = safety_rules.integer(value, scale)
        self._record("integer", NO_INTEGER if result is None else result, _bits(value), _bits(scale))
        return result

    def ceiling(self, joint: int, angle_urad: int) -> int:
        """See JointLimits.torque_ceiling."""
        result = self._all[joint].torque_ceiling(angle_urad)
        self._record("ceiling", result, joint, angle_urad)
        return result

    def damage(self, state: int) -> None:
        """Overwrite the state, as a fault of the memory would."""
        self.layer.state = state
        self._record("damage", 0, state)

    def replay(self) -> int:
        """Compare with the C layer; the number of events. AssertionError names the first event that differs."""
        words = np.array(self.words, dtype=np.int64).astype(np.uint32)
        keep(words)
        differs, compared = replay(words)
        assert differs == 0, f"event {differs} differs in C: " + "\n".join(self.lines[max(differs - 5, 0) : differs])
        assert compared == len(self.lines)
        return compared


def _row(joint: JointLimits) -> tuple[int, ...]:
    return tuple(int(getattr(joint, name)) for name in joint.__slots__)


def _bits(value: float) -> int:
    with np.errstate(over="ignore"):
        return int(struct.unpack("<I", np.float32(value).tobytes())[0])
