"""The import layers of the design: who may import whom, and where rclpy may appear."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ROBOT = {"hand_model", "hand_messages", "hand_ros", "hand_driver", "hand_sim"}
BELOW: dict[str, set[str]] = {
    "hand_model": set(),
    "hand_messages": set(),
    "hand_pages": set(),
    "hand_ros": {"hand_messages"},
    "hand_client": {"hand_model", "hand_messages", "hand_ros"},
    "hand_driver": {"hand_model", "hand_messages", "hand_ros"},
    "hand_control": {"hand_model", "hand_messages", "hand_ros"},
    "hand_robot": {"hand_model", "hand_messages", "hand_ros", "hand_control"},
    "hand_sim": {"hand_model", "hand_messages", "hand_ros", "hand_driver"},
    "hand_recording": ROBOT,
    "hand_machine": ROBOT | {"hand_recording"},
    "hand_identification": ROBOT | {"hand_recording", "hand_machine"},
    "hand_diagnosis": ROBOT | {"hand_pages", "hand_recording", "hand_machine", "hand_identification"},
    "hand_studio": ROBOT | {"hand_client", "hand_recording"},
    "hand_tool": ROBOT
    | {
        "hand_studio",
        "hand_client",
        "hand_control",
        "hand_robot",
        "hand_pages",
        "hand_recording",
        "hand_machine",
        "hand_identification",
        "hand_diagnosis",
        "validation",
    },
}
"""From below to above; a package that is not there yet is passed over."""
VALIDATION_COMMANDS = {"trial.py", "reproduce.py", "magnet.py"}
ROS = {"rclpy", "ament_index_python"}
NODE_MODULES = {"node.py", "live_node.py"}
VALIDATION_PROGRAMS = {
    "bench/bench_codec.py",  # rclpy's own serialization, the reference
    "bench/bench_loop.py",
    "bench/loop_reference.py",  # a process that must share no code with the nodes
    "faults/floods.py",
    "faults/live.py",
    "faults/rogue.py",  # a second publisher, in a process of its own
    "faults/rogue_calls.py",  # calls without a pause
    "faults/soak.py",
}
"""Modules of `validation` with a reason of their own to import ROS."""
GENERATED = ("_msgs", "_srvs", "_interfaces")
PACKAGES = [package for package in BELOW if (ROOT / package).is_dir()]


def imported(tree: ast.AST) -> Iterator[str]:
    """Dotted names of the modules that a tree imports, wherever in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module
        elif isinstance(node, ast.ImportFrom) and node.level:
            yield "relative import"


def modules_imported(path: Path) -> set[str]:
    """Dotted names of all modules that a file imports."""
    return set(imported(ast.parse(path.read_text(encoding="utf-8"))))


def imports(path: Path) -> set[str]:
    """Top-level packages that a file imports."""
    return {name.split(".")[0] for name in modules_imported(path)}


def ours(names: set[str]) -> set[str]:
    """The packages of this tree among the names, without the generated interface package."""
    return {name for name in names if name == "validation" or (name.startswith("hand_") and name != "hand_msgs")}


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).glob("**/*.py"))


def test_every_package_has_its_layer() -> None:
    """Fails when a package is added without a place in the order, or when a file of a former package comes back."""
    found = {path.parent.name for path in ROOT.glob("hand_*/__init__.py")}
    assert found == set(PACKAGES)


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_point_down(package: str) -> None:
    """Fails when a package imports one of its own level or above."""
    assert modules(package)
    for path in modules(package):
        reached = ours(imports(path)) - {package}
        assert reached <= BELOW[package], f"{path.relative_to(ROOT)} imports {sorted(reached - BELOW[package])}"


def test_only_their_commands_import_validation_and_only_when_they_run() -> None:
    """Fails when `hand` needs `validation` to start, or when another module begins to use it."""
    for path in modules("hand_tool"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        if "validation" not in {name.split(".")[0] for name in imported(tree)}:
            continue
        assert path.name in VALIDATION_COMMANDS, path.name
        for statement in tree.body:
            if isinstance(statement, ast.FunctionDef | ast.ClassDef) or "TYPE_CHECKING" in ast.dump(statement):
                continue
            at_start = {name for name in imported(statement) if name.split(".")[0] == "validation"}
            assert not at_start, f"{path.name} imports {sorted(at_start)} when it is loaded"


def test_the_trial_shares_no_code_with_what_it_tries() -> None:
    """Fails when the blind trial or its referees import anything of this tree but themselves."""
    paths = [*modules("validation/trial"), *modules("validation/referees")]
    assert paths
    for path in paths:
        names = {name for name in modules_imported(path) if ours({name.split(".")[0]})}
        foreign = {name for name in names if not name.startswith(("validation.trial", "validation.referees"))}
        assert not foreign, f"{path.name} imports {sorted(foreign)}"


@pytest.mark.parametrize("package", PACKAGES)
def test_one_ros_module_a_package(package: str) -> None:
    """Fails when rclpy or generated messages spread beyond a package's one node module."""
    ros = [p for p in modules(package) if any(n in ROS or n.endswith(GENERATED) for n in imports(p))]
    assert len(ros) <= 1, f"several ROS modules: {[str(p.relative_to(ROOT)) for p in ros]}"
    assert all(path.name in NODE_MODULES for path in ros)


def test_the_ros_programs_of_validation_are_listed() -> None:
    """Fails when rclpy spreads in `validation` beyond the programs that are compared with the nodes or attack them."""
    ros = {path for path in modules("validation") if any(n in ROS or n.endswith(GENERATED) for n in imports(path))}
    assert {path.relative_to(ROOT / "validation").as_posix() for path in ros} == VALIDATION_PROGRAMS


@pytest.mark.parametrize("package", ["hand_model", "hand_messages"])
def test_pure_packages_read_no_clock_and_no_ros(package: str) -> None:
    """Fails when physics or messages start to depend on time of day, ROS or random state of their own."""
    for path in modules(package):
        assert not imports(path) & {"time", "datetime", "random", "threading", *ROS}, path.name


def test_no_relative_imports() -> None:
    """Fails when a module hides its layer behind a relative import."""
    for package in [*PACKAGES, "validation"]:
        for path in modules(package):
            assert "relative import" not in imports(path), path


def test_tests_share_helpers_in_modules_of_their_own() -> None:
    """Fails when a test imports a conftest or another test's module, or a bench outside the test of the benches."""
    for path in sorted((ROOT / "test").glob("**/*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.ImportFrom) or not node.module:
                continue
            names = {node.module.split(".")[-1], *(alias.name for alias in node.names)}
            if node.module.split(".")[0] == "test":
                assert "conftest" not in names, f"{path.relative_to(ROOT)} imports {node.module}"
                assert not any(name.startswith("test_") for name in names), f"{path.relative_to(ROOT)}: {node.module}"
            if node.module.startswith("validation.bench"):
                assert path.parent.name == "validation", f"{path.relative_to(ROOT)} imports {node.module}"
