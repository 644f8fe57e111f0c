"""Classes that stand for those of launch and launch_ros, where these are not installed."""

from __future__ import annotations

import runpy
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


class Kept:
    """Keeps its arguments; as a configuration it gives the value of the context."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        self.arguments, self.named = arguments, named
        self.called: dict[str, dict[str, Any]] = {}

    def perform(self, context: dict[str, str]) -> str:
        return context[self.arguments[0]]

    def to_moveit_configs(self) -> Kept:
        return self

    def to_dict(self) -> dict[str, Any]:
        """What the methods of MoveItConfigsBuilder were called with, by their name."""
        return dict(self.called)

    def __getattr__(self, name: str) -> Callable[..., None]:
        if name.startswith("_") or type(self).__name__ != "MoveItConfigsBuilder":
            raise AttributeError(name)
        return lambda **named: self.called.update({name: named})


class AbsentError(LookupError):
    """The package is not installed."""


def names_of(path: Path, monkeypatch: pytest.MonkeyPatch, installed: bool = True) -> dict[str, Any]:
    """The functions of a launch file, run with the classes of this module."""

    def prefix(package: str) -> str:
        if not installed:
            raise AbsentError(package)
        return package

    text = path.read_text(encoding="utf-8")
    foreign = ("from launch", "from ament", "from moveit_configs_utils")
    for line in (line for line in text.splitlines() if line.startswith(foreign)):
        _, module, _, names = line.split(maxsplit=3)
        made: Any = types.ModuleType(module)
        for item in names.split(", "):
            setattr(made, item, type(item, (Kept,), {}))
        made.PackageNotFoundError, made.get_package_prefix = AbsentError, prefix
        monkeypatch.setitem(sys.modules, module, made)
    return runpy.run_path(str(path))


def declared(actions: list[Any]) -> dict[str, dict[str, Any]]:
    """Default and description of every declared argument."""
    found = [action for action in actions if type(action).__name__ == "DeclareLaunchArgument"]
    return {action.arguments[0]: action.named for action in found}
