"""Files of this tree that are made from config/hand.yaml, and their comparison with it.

Example: python -m hand_robot.kept_files --write
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from hand_control.grasps import load_grasps
from hand_model.description import load_hand
from hand_model.yaml_document import yaml_text
from hand_robot.layouts import foxglove_text, plotjuggler_text, rviz_text
from hand_robot.moveit import moveit_files
from hand_robot.ros2_control import controllers
from hand_robot.srdf import Placed
from hand_robot.urdf import macro_text

ROOT = Path(__file__).resolve().parents[1]
COMMAND = "python -m hand_robot.kept_files --write"
TWO_HANDS, ARM_PREFIX = "examples/two_hands", "robot1_"


def kept_files(root: Path) -> dict[str, str]:
    """The text of every such file by its path below `root`, a source tree with config/hand.yaml.

    Raises DescriptionError, one line, for a description that cannot be read.
    """
    hand = load_hand(root / "config" / "hand.yaml")
    made = moveit_files([Placed(hand, load_grasps(root / "config" / "grasps.yaml", hand))])
    return {
        "urdf/hand_macro.xacro": macro_text(hand),
        "config/controllers.yaml": f"# Made by: {COMMAND}\n{yaml_text(controllers(hand))}",
        "config/layouts/hand.foxglove.json": foxglove_text(hand),
        "config/layouts/hand.plotjuggler.xml": plotjuggler_text(hand),
        "config/layouts/hand.rviz": rviz_text(hand),
        **{f"moveit/config/{name}": text for name, text in made.items()},
        **{f"{TWO_HANDS}/moveit/{name}": text for name, text in _two_hands(root).items()},
    }


def _two_hands(root: Path) -> dict[str, str]:
    """The files for MoveIt of examples/two_hands, with the prefix of its documentation."""
    placed = []
    for side in ("left", "right"):
        prefix = f"{ARM_PREFIX}{side}_"
        hand = load_hand(root / "config" / "hand.yaml", prefix)
        grasps = load_grasps(root / "config" / "grasps.yaml", hand)
        placed.append(Placed(hand, grasps, f"{prefix}hand", f"{prefix}tool0"))
    return moveit_files(placed, "two_hands")


def main() -> int:
    """Exit code 0 where every file is current or was written, 1 where one differs, 2 for bad input."""
    parser = argparse.ArgumentParser(
        prog="python -m hand_robot.kept_files",
        description="Compare the files that are made from config/hand.yaml with it, or write them.",
        epilog=f"Example: {COMMAND}",
    )
    parser.add_argument("--write", action="store_true", help="write the files of this checkout that differ")
    write = parser.parse_args().write
    try:
        texts = kept_files(ROOT)
    except (ValueError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    differing = [
        name
        for name, text in texts.items()
        if not (ROOT / name).is_file() or (ROOT / name).read_text(encoding="utf-8") != text
    ]
    for name in differing:
        if write:
            (ROOT / name).write_text(texts[name], encoding="utf-8")
        print(f"{name}: {'written' if write else f'differs from hand.yaml; run {COMMAND}'}")
    return 1 if differing and not write else 0


if __name__ == "__main__":
    raise SystemExit(main())
