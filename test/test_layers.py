"""The import layers of the design: who may import whom, and where rclpy may appear."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
BELOW = {
    "hand_model": set(),
    "hand_ros": set(),
    "hand_driver": {"hand_model", "hand_ros"},
    "hand_control": {"hand_model", "hand_ros"},
    "hand_sim": {"hand_model", "hand_ros", "hand_driver"},
    "hand_ident": {"hand_model", "hand_ros", "hand_driver", "hand_sim"},
    "hand_magnet": {"hand_model"},
    "hand_paper": {"hand_model", "hand_control", "hand_sim", "hand_ident", "hand_magnet"},
    "hand_diagnosis": {"hand_model", "hand_ros", "hand_driver", "hand_sim", "hand_ident"},
    "hand_trial": set(),
    "hand_tool": {
        "hand_model",
        "hand_ros",
        "hand_driver",
        "hand_control",
        "hand_sim",
        "hand_ident",
        "hand_magnet",
        "hand_paper",
        "hand_diagnosis",
        "hand_trial",
    },
}
ROS = {"rclpy", "ament_index_python"}
NODE_MODULES = {"node.py", "recorder_node.py", "live_node.py"}
GENERATED = ("_msgs", "_srvs", "_interfaces")


def imports(path: Path) -> set[str]:
    """Top-level packages a module imports, wherever in the file."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names.add(node.module.split(".")[0])
        elif isinstance(node, ast.ImportFrom) and node.level:
            names.add("relative import")
    return names


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).glob("**/*.py"))


@pytest.mark.parametrize("package", BELOW)
def test_imports_point_down(package: str) -> None:
    """Fails when a package imports one beside or above it."""
    assert modules(package)
    for path in modules(package):
        reached = {name for name in imports(path) if name.startswith("hand_") and name != "hand_msgs"} - {package}
        assert reached <= BELOW[package], f"{path.relative_to(ROOT)} imports {sorted(reached - BELOW[package])}"


@pytest.mark.parametrize("package", BELOW)
def test_one_ros_module_a_package(package: str) -> None:
    """Fails when rclpy or generated messages spread beyond a package's one node module."""
    ros = [p for p in modules(package) if any(n in ROS or n.endswith(GENERATED) for n in imports(p))]
    assert len(ros) <= 1, f"several ROS modules: {[str(p.relative_to(ROOT)) for p in ros]}"
    assert all(path.name in NODE_MODULES for path in ros)


def test_model_reads_no_clock_and_no_ros() -> None:
    """Fails when the physics starts to depend on time of day, ROS or random state of its own."""
    for path in modules("hand_model"):
        assert not imports(path) & {"time", "datetime", "random", "threading"}, path.name


def test_no_relative_imports() -> None:
    """Fails when a module hides its layer behind a relative import."""
    for package in BELOW:
        for path in modules(package):
            assert "relative import" not in imports(path), path
