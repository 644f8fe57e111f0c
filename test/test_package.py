"""The package as ROS tools see it: dependencies, executables, interface package."""

from __future__ import annotations

import ast
import configparser
import re
import xml.etree.ElementTree as ET
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ROSDEP_KEYS = {
    # Read from the public rosdep database (rosdep/base.yaml, rosdep/python.yaml).
    "python3-numpy", "python3-numba", "python3-scipy", "python3-yaml", "python3-serial", "python3-can",
    "python-cobs-pip", "python3-ruamel.yaml",
    "python3-typer", "python3-rich", "python3-matplotlib", "mcap-ros2-support", "python3-rosbags-pip",
    "python3-pytest", "python3-hypothesis",
}  # fmt: skip
JAZZY_PACKAGES = {
    "ament_index_python", "builtin_interfaces", "diagnostic_msgs", "hand_msgs", "launch", "launch_ros",
    "lifecycle_msgs", "rcl_interfaces", "rclpy", "rosgraph_msgs", "sensor_msgs", "std_msgs", "std_srvs",
    "trajectory_msgs",
}  # fmt: skip
IMPORT_TO_KEY = {
    "numpy": "python3-numpy", "scipy": "python3-scipy", "numba": "python3-numba", "yaml": "python3-yaml",
    "ruamel": "python3-ruamel.yaml",
    "serial": "python3-serial", "can": "python3-can", "cobs": "python-cobs-pip",
    "typer": "python3-typer", "rich": "python3-rich",
    "matplotlib": "python3-matplotlib", "mcap": "mcap-ros2-support", "rosbags": "python3-rosbags-pip",
}  # fmt: skip


def exec_depends() -> set[str]:
    return {tag.text or "" for tag in ET.parse(ROOT / "package.xml").getroot().iter("exec_depend")}


def test_every_dependency_is_known_to_rosdep_or_jazzy() -> None:
    """Fails when package.xml names something that `rosdep install` cannot resolve."""
    assert exec_depends() <= ROSDEP_KEYS | JAZZY_PACKAGES


def test_every_import_is_declared() -> None:
    """Fails when the stack imports a library that package.xml does not ask for."""
    used: set[str] = set()
    for path in [*ROOT.glob("hand_*/**/*.py"), *ROOT.glob("validation/**/*.py")]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                used |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                used.add((node.module or "").split(".")[0])
    needed = {IMPORT_TO_KEY.get(name, name) for name in used} & (ROSDEP_KEYS | JAZZY_PACKAGES)
    assert needed <= exec_depends()


def test_executables_land_where_ros2_run_looks() -> None:
    """Fails when an executable is renamed or no longer goes to lib/fluidic_hand."""
    config = configparser.ConfigParser()
    config.read(ROOT / "setup.cfg")
    assert config["install"]["install_scripts"] == "$base/lib/fluidic_hand"
    setup = (ROOT / "setup.py").read_text(encoding="utf-8")
    names = set(re.findall(r'"(\w+) = [\w.]+:main"', setup))
    assert names == {"driver", "simulation", "controller", "recorder", "hand"}


def test_launch_files_start_what_exists_with_parameters_that_exist() -> None:
    """Fails when a launch file names an executable, file or driver parameter that is not there."""
    from hand_driver.node import PARAMETERS  # noqa: PLC0415 - needs ROS, the other tests here do not

    executables = set(re.findall(r'"(\w+) = [\w.]+:main"', (ROOT / "setup.py").read_text(encoding="utf-8")))
    for path in (ROOT / "launch").glob("*.launch.py"):
        text = path.read_text(encoding="utf-8")
        compile(text, path.name, "exec")
        assert set(re.findall(r'executable="(\w+)"', text)) <= executables
        assert all((ROOT / "config" / name).is_file() for name in re.findall(r'"([\w.]+\.yaml)"', text))
        board = re.findall(r'^    "(\w+)": \("', text, re.MULTILINE)
        assert {*board, "hand_description"} <= {parameter.name for parameter in PARAMETERS}


def test_every_package_is_installed() -> None:
    """Fails when a new package is forgotten in setup.py."""
    listed = re.search(r"PACKAGES = \[(.*?)\]", (ROOT / "setup.py").read_text(encoding="utf-8"), re.DOTALL)
    assert listed is not None
    files = [*ROOT.glob("hand_*/**/__init__.py"), *ROOT.glob("validation/**/__init__.py")]
    found = {".".join(path.parent.relative_to(ROOT).parts) for path in files}
    assert set(re.findall(r'"([\w.]+)"', listed.group(1))) == found


def test_interface_is_the_published_one() -> None:
    """Fails when a message or the action changes: other people's bags and nodes depend on them."""
    fields = {path.stem: _fields(path.read_text(encoding="utf-8")) for path in (ROOT / "hand_msgs/msg").glob("*.msg")}
    header = ("std_msgs/Header", "header")
    name = ("string[]", "name")
    floats = [("float64[]", key) for key in ("reference", "position", "error")]
    floats += [("float64[]", key) for key in ("pressure_command", "torque_estimate", "torque_limit")]
    assert fields == {
        "JointPressures": [header, name, ("float64[]", "pressure")],
        "ContactForces": [header, name, ("float64[]", "force")],
        "AdcFrame": [header, ("uint32", "sequence"), ("float64", "supply_voltage"), ("uint16[]", "channel"),
                     ("uint32[]", "counts")],
        "ValveCommand": [header, ("builtin_interfaces/Duration", "lifetime"), name, ("float64[]", "pressure")],
        "Contact": [header, ("string", "name"), ("bool", "touching"), ("float64", "torque"), ("float64", "force"),
                    ("string", "source"), ("float64", "delay")],
        "ControllerState": [header, name, *floats, ("bool[]", "saturated"), ("bool[]", "contact")],
    }  # fmt: skip
    goal = _fields((ROOT / "hand_msgs/action/Grasp.action").read_text(encoding="utf-8").split("---")[0])
    assert goal == [("string", "pattern"), ("float64", "closure"), ("float64", "max_torque")]


def _fields(text: str) -> list[tuple[str, str]]:
    lines = (line.split("#")[0].split() for line in text.splitlines())
    return [(parts[0], parts[1]) for parts in lines if parts]
