"""The programs of the board sample on this machine: the board behind two descriptors, and the fuzzer.

`python -m validation.c_programs` compiles the fuzzer and prints its path.
"""

from __future__ import annotations

import argparse
from functools import cache
from pathlib import Path

from hand_control.board_config import board_config, header
from hand_model.description import load_hand
from validation.c_board import SOURCES
from validation.c_checks import SANITIZERS
from validation.c_safety import FIRMWARE, HOST, ROOT, build

BOARD = (*SOURCES, FIRMWARE / "hand_safety.c")


@cache
def constants() -> Path:
    """The folder of board_config.h for config/hand.yaml."""
    folder = ROOT / "out" / "firmware"
    folder.mkdir(parents=True, exist_ok=True)
    text = header(board_config(load_hand(ROOT / "config" / "hand.yaml")))
    path = folder / "board_config.h"
    if not path.exists() or path.read_text(encoding="ascii") != text:
        path.write_text(text, encoding="ascii")
    return folder


def host_board() -> Path:
    """The board sample that serves standard input and output."""
    return build("host_board", (*BOARD, FIRMWARE / "board" / "host_main.c"), "-O2", f"-I{constants()}")


def fuzzer(layer: Path = FIRMWARE / "hand_safety.c", folder: Path | None = None) -> Path:
    """The fuzzer under sanitizers, with this file as the safety layer."""
    sources = (*SOURCES, layer, HOST / "fuzz.c")
    return build("fuzz", sources, *SANITIZERS, f"-I{constants()}", folder=folder)


def main() -> None:
    """Compile the fuzzer and print its path."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.c_programs",
        description="Compile the fuzzer of the board sample under sanitizers and print its path.",
        epilog="Example: $(python -m validation.c_programs) 1000000 7",
    )
    parser.parse_args()
    print(fuzzer())


if __name__ == "__main__":
    main()
