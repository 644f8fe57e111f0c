"""Compile the controller into the cache, so that its first start does not: `python -m hand_control`."""

from __future__ import annotations

import argparse

from hand_control.declared import Settings
from hand_control.warm_up import warm_up
from hand_model.description import load_hand
from hand_ros.node import default_config


def main() -> None:
    """Warm up a controller of the installed hand."""
    argparse.ArgumentParser(
        prog="python -m hand_control",
        description="Compile the controller into the cache. Example: python -m hand_control",
    ).parse_args()
    hand = load_hand(default_config("hand.yaml"))
    warm_up(hand, Settings.of(hand, {}))


if __name__ == "__main__":
    main()
