"""Mutants of the firmware: `python -m validation.mutation.c_session NAME SAMPLE SEED` in a copy of the tree.

The tests of each part run once and write the calls that they make with the results that they expect. Each mutant is
compiled and replays these calls; a difference, a crash or an endless loop detects it. Results are JSON lines, as
those of session.py.
"""

from __future__ import annotations

import json
import random
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from validation.c_checks import PARTS, Part
from validation.c_safety import FIRMWARE, HOST, record_tests

OPTIONS = ("-std=c99", "-O0", "-w", f"-I{FIRMWARE}", f"-I{FIRMWARE / 'board'}", f"-I{HOST}")
TIMEOUT_S = 10
_Table = dict[str, tuple[str, ...]]
OPERATORS: dict[str, tuple[str, _Table]] = {
    "comparison": (
        r"(?<=\s)(<=|>=|<|>|==|!=)(?=\s)",
        {"<": ("<=", ">"), "<=": ("<", ">="), ">": (">=", "<"), ">=": (">", "<="), "==": ("!=",), "!=": ("==",)},
    ),
    "logic": (r"(&&|\|\|)", {"&&": ("||",), "||": ("&&",)}),
    "negation": (r"!(?=[\w(])", {"!": ("",)}),
    "condition": (r"\bif \((?=.*\{$)", {}),
    "arithmetic": (
        r"(?<=[\w)\]] )([-+*/^&|%]|<<|>>)(?= [\w(])",
        {"+": ("-",), "-": ("+",), "*": ("/",), "/": ("*",), "^": ("&",), "&": ("|",), "|": ("&",), "%": ("/",)}
        | dict[str, tuple[str, ...]]({"<<": (">>",), ">>": ("<<",)}),
    ),
    "assignment": (r"(?<= )(\+=|-=|\^=|\|=)(?= )", {"+=": ("-=",), "-=": ("+=",), "^=": ("|=",), "|=": ("&=",)}),
    "sign": (r"(?<=[(= ])-(?=[\w(])", {"-": ("",)}),
    "boolean": (r"\b(true|false)\b", {"true": ("false",), "false": ("true",)}),
    "number": (r"(?<![\w.])(0x[0-9A-Fa-f]+|\d+)(?=U\b|\b(?!\.))", {}),
    "constant": (r"\b(?:HAND_[A-Z_]+_(?:US|PA|PERMILLE|PA_PER_S|WINDOW|SIZE|S)|MICRO|MILLI|FULL_TURN_URAD)\b", {}),
    "statement": (
        r"(?<=^ {4})\s*(?!return\b|const\b|break\b|u?int|bool\b|float\b|hand_\w+ \w|else\b)[^\s{}][^{};]*;$",
        {},
    ),
}
"""Operators by name: what they change, and by what; numbers grow by 1, statements are removed."""


class Mutant(NamedTuple):
    """One change of a file: from column start to end of a line."""

    source: Path
    line: int
    start: int
    end: int
    text: str
    operator: str


def main() -> None:
    """Run the mutants of every part and print the result."""
    name, sample, seed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    every = [(part, mutant) for part in PARTS for source in part.sources for mutant in mutants(source)]
    chosen = random.Random(seed).sample(every, sample) if 0 < sample < len(every) else every
    begun_s = time.monotonic()
    with tempfile.TemporaryDirectory(prefix=f"{name}-") as folder:
        result = _run(chosen, Path(folder))
    modules = sorted({f"firmware/{mutant.source.relative_to(FIRMWARE)}" for _, mutant in every})
    _say(**result, modules=modules, total=len(every), seconds=time.monotonic() - begun_s)


def _run(chosen: list[tuple[Part, Mutant]], folder: Path) -> dict[str, Any]:
    benches = {}
    for part in {part.name: part for part, _ in chosen}.values():
        traces = folder / f"{part.name}.traces"
        record_tests(traces, *part.tests)
        benches[part.name] = bench = Bench(part, folder, traces)
        if error := bench.error():
            return {"mutants": 0, "killed": 0, "error": error}
    killed = useless = 0
    survivors: list[dict[str, Any]] = []
    for number, (part, mutant) in enumerate(chosen, 1):
        survived = benches[part.name].survives(mutant)
        useless += survived is None
        killed += survived is False
        if survived:
            survivors.append(_described(mutant))
        if number % 10 == 0:
            _say(progress=f"{number} of {len(chosen)} mutants, {killed} killed")
    return {"mutants": len(chosen) - useless, "killed": killed, "survivors": survivors}


class Bench:
    """The compiled runner of a part, and its traces."""

    def __init__(self, part: Part, folder: Path, traces: Path) -> None:
        """Compile everything but the mutants, into folder."""
        self._part, self._folder, self._traces = part, folder, traces
        self._objects = {path: self._compiled(path) for path in (*part.sources, *part.runner)}

    def _compiled(self, source: Path) -> Path:
        made = self._folder / f"{self._part.name}-{source.stem}.o"
        subprocess.run(["cc", *OPTIONS, "-c", source, "-o", made], check=True, capture_output=True)
        return made

    def error(self) -> str:
        """Why mutants cannot be tested: the unmutated part differs from its traces; else empty."""
        program = self._linked(self._objects)
        fails = program is None or self._fails(program)
        return f"the firmware's part {self._part.name} differs from its traces without a mutation" if fails else ""

    def survives(self, mutant: Mutant) -> bool | None:
        """Whether no trace detects a mutant; None where it does not compile."""
        lines = mutant.source.read_text(encoding="utf-8").splitlines()
        line = lines[mutant.line - 1]
        lines[mutant.line - 1] = line[: mutant.start] + mutant.text + line[mutant.end :]
        mutated = self._folder / f"mutated_{mutant.source.name}"
        mutated.write_text("\n".join([*lines, ""]), encoding="utf-8")
        try:
            made = self._compiled(mutated)
        except subprocess.CalledProcessError:
            return None
        program = self._linked({**self._objects, mutant.source: made})
        return None if program is None else not self._fails(program)

    def _linked(self, objects: dict[Path, Path]) -> Path | None:
        program = self._folder / f"{self._part.name}.program"
        done = subprocess.run(["cc", *objects.values(), "-o", program], check=False, capture_output=True)
        return program if done.returncode == 0 else None

    def _fails(self, program: Path) -> bool:
        def limit() -> None:  # of processor time: a busy machine detects no mutant
            resource.setrlimit(resource.RLIMIT_CPU, (TIMEOUT_S, TIMEOUT_S + 1))

        done = subprocess.run([program, self._traces], check=False, capture_output=True, preexec_fn=limit)
        return done.returncode != 0


def mutants(source: Path) -> Iterator[Mutant]:
    """Every mutant of a C file, line by line; comments, preprocessor lines and tables are left out."""
    text = source.read_text(encoding="utf-8")
    plain = re.sub(r"/\*.*?\*/", lambda comment: re.sub(r"[^\n]", " ", comment[0]), text, flags=re.DOTALL)
    for number, line in enumerate(plain.splitlines(), 1):
        if not line.startswith("#") and "enum" not in line:
            yield from (Mutant(source, number, *change) for change in _changes(line.rstrip()))


def _changes(line: str) -> Iterator[tuple[int, int, str, str]]:
    """Start, end, new text and operator of every change of a line."""
    for operator, (pattern, table) in OPERATORS.items():
        for found in re.finditer(pattern, line):
            start, end = found.span()
            if operator == "condition":
                inside = line[end - 1 : line.rindex("{")].rstrip()
                yield start, line.rindex("{"), f"if (!{inside}) ", operator
            elif operator == "number":
                yield start, end, f"{int(found[0], 0) + 1}", operator
            elif operator == "statement":
                yield start, end, " ;", operator
            elif operator == "constant":
                yield start, end, f"({found[0]} + 1)", operator
                yield start, end, f"({found[0]} - 1)", operator
            else:
                yield from ((start, end, changed, operator) for changed in table[found[0]])


def _described(mutant: Mutant) -> dict[str, Any]:
    before = mutant.source.read_text(encoding="utf-8").splitlines()[mutant.line - 1]
    after = before[: mutant.start] + mutant.text + before[mutant.end :]
    return {
        "module": f"firmware/{mutant.source.relative_to(FIRMWARE)}",
        "line": mutant.line,
        "operator": mutant.operator,
        "before": before.strip(),
        "after": after.strip(),
    }


def _say(**message: Any) -> None:
    print(json.dumps(message), flush=True)


if __name__ == "__main__":
    main()
