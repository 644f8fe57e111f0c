"""The package as pip and ROS tools see it: dependencies, executables, data files, interface package."""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from functools import cache
from importlib import metadata
from pathlib import Path

import pytest

from hand_robot.state_publisher import PACKAGE

ROOT = Path(__file__).resolve().parent.parent
NODE_PACKAGES = (
    "hand_model", "hand_messages", "hand_ros", "hand_driver", "hand_control", "hand_robot", "hand_sim",
    "hand_recording", "hand_tool",
)  # fmt: skip
"""What a robot runs; package.xml must name all that these import, as keys of rosdep or packages of Jazzy."""
ROSDEP = {
    "numpy": "python3-numpy", "scipy": "python3-scipy", "numba": "python3-numba", "pyyaml": "python3-yaml",
    "ruamel-yaml": "python3-ruamel.yaml", "pyserial": "python3-serial", "python-can": "python3-can",
    "cobs": "python-cobs-pip", "typer": "python3-typer", "rich": "python3-rich", "jinja2": "python3-jinja2",
    "matplotlib": "python3-matplotlib", "mcap": "mcap-ros2-support", "rosbags": "python3-rosbags-pip",
    "pytest": "python3-pytest", "hypothesis": "python3-hypothesis",
}  # fmt: skip
"""rosdep's key for a distribution of PyPI, from the public database (rosdep/python.yaml). A missing entry fails."""
BROUGHT_BY = {"llvmlite": "numba", "zstandard": "mcap", "apsw": "rosbags"}
"""Distributions without a key of their own: the one that requires them has one. The test checks that it does."""
TOOL = "# tool"


def canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def requirements(name: str) -> dict[str, str]:
    """Canonical names of a requirements file and their lines."""
    lines = (ROOT / name).read_text(encoding="utf-8").splitlines()
    wanted = [line.strip() for line in lines if line.strip() and not line.lstrip().startswith("#")]
    return {canonical(re.split(r"[\[=<>~! ]", line)[0]): line for line in wanted}


def files() -> dict[str, str]:
    """Every requirement of the tree, with its line."""
    return {key: line for path in ROOT.glob("requirements*.txt") for key, line in requirements(path.name).items()}


def imported(path: Path) -> set[str]:
    """Names of the modules that a file imports, wherever in it; "ruamel.yaml" as well as "ruamel"."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names.add(node.module)
    return names


@cache
def tree() -> dict[str, set[str]]:
    """Top-level modules that are neither of Python nor of this tree, with the folders of the tree that import them."""
    own = {path.parent.name for path in ROOT.glob("*/__init__.py")} | {"test"}
    users: dict[str, set[str]] = {}
    parts = [path for path in ROOT.glob("[!.]*/") if path.name not in {"build", "install", "log", "out"}]
    for path in (path for part in parts for path in part.rglob("*.py")):
        for module in {name.split(".")[0] for name in imported(path)} - own - set(sys.stdlib_module_names):
            users.setdefault(module, set()).add(path.relative_to(ROOT).parts[0])
    return users


@cache
def distributions() -> dict[str, set[str]]:
    """Canonical names of the distributions that provide a top-level module."""
    return {module: {canonical(name) for name in names} for module, names in metadata.packages_distributions().items()}


@cache
def depends(manifest: str = "package.xml") -> set[str]:
    """What a manifest of this tree needs to run."""
    return {item.text or "" for item in ET.parse(ROOT / manifest).getroot().iter("exec_depend")}


def required_by(name: str) -> set[str]:
    return {canonical(re.split(r"[\[=<>~!; (]", line)[0]) for line in metadata.requires(name) or ()}


def test_every_import_is_declared_for_pip() -> None:
    """Fails when a module is imported whose distribution is in no requirements file, hence in no extra.

    A module that no distribution provides here is a package of ROS; a manifest of this tree names it.
    """
    manifests = [*ROOT.glob("*/package.xml"), *ROOT.glob("test/interfaces/*/package.xml")]
    manifests += ROOT.glob("interfaces/*/package.xml")
    own = {item.text for path in manifests for item in ET.parse(path).getroot().iter("name")}
    declared = {name for name, line in files().items() if TOOL not in line}
    for module, users in sorted(tree().items()):
        found = distributions().get(module, set())
        if module in own or (not found and module in depends() | depends("moveit/package.xml")):
            continue
        assert found & declared, f"{module}, imported by {sorted(users)}, comes from {sorted(found) or 'nowhere'}"


def test_every_import_of_a_node_is_declared_for_rosdep() -> None:
    """Fails when a package that a robot runs imports what `rosdep install` would not install."""
    for module, users in sorted(tree().items()):
        if not users & {*NODE_PACKAGES, "launch"} or module in depends():
            continue
        names = distributions()[module] & set(files())
        (name,) = (key for key in names if not key.startswith("ros-"))
        carrier = BROUGHT_BY.get(name, name)
        assert carrier == name or name in required_by(carrier), f"{carrier} does not require {name}"
        assert ROSDEP[carrier] in depends(), f"{module}, imported by {sorted(users)}: {ROSDEP[carrier]}"


def test_every_import_of_the_moveit_configuration_is_declared() -> None:
    """Fails when the launch file of MoveIt imports a package that its manifest leaves out, or is not read at all."""
    imports = {module for module, users in tree().items() if "moveit" in users}
    assert {"launch", "moveit_configs_utils"} <= imports <= depends("moveit/package.xml")


def test_nothing_is_declared_that_nothing_imports() -> None:
    """Fails when a requirement or a dependency outlives its last import, or a tool's line does not say what runs it."""
    used = {name for module in tree() for name in distributions().get(module, set())}
    for name, line in files().items():
        if TOOL in line:
            assert re.search(rf"{TOOL}: \w.+", line), line
            assert name not in used or name in {"setuptools", "pytest"}, f"{name} is imported; it is no tool"
        else:
            assert name in used, f"{name} is required and never imported"
    keys = {ROSDEP[BROUGHT_BY.get(name, name)] for name in used if name in ROSDEP or name in BROUGHT_BY}
    assert depends() <= keys | set(tree()) | {PACKAGE}  # which launch files start


def test_what_make_demo_installs_takes_at_most_700_mb() -> None:
    """Fails when a requirement of the stack, with all that it requires, makes .venv larger than README says."""
    lines = {**requirements("requirements.txt"), **requirements("requirements-ros.txt"), "pip": "pip"}
    waiting, sizes, block = list(lines.values()), {}, 4096
    while waiting:
        name, extras = re.match(r"([\w.-]+)(?:\[([\w,]+)\])?", waiting.pop()).groups()  # type: ignore[union-attr]
        try:
            found = metadata.distribution(name)
        except metadata.PackageNotFoundError:  # for another Python or system
            continue
        if extras is None and name in sizes:
            continue
        paths = (Path(str(file.locate())) for file in found.files or ())
        sizes[name] = sum(-(-path.stat().st_size // block) * block for path in paths if path.is_file())
        wanted = re.compile(rf"extra == .({(extras or 'none').replace(',', '|')})\b")
        waiting += [line for line in found.requires or () if "extra ==" not in line or wanted.search(line)]
    assert set(requirements("requirements.txt")) <= {canonical(name) for name in sizes}
    assert 300 < sum(sizes.values()) / 2**20 < 700


def test_packages_that_need_extras_are_above_the_nodes() -> None:
    """Fails when a node or the plain tool imports, even in a function, what only an extra installs."""
    plain = set(requirements("requirements.txt")) | set(requirements("requirements-ros.txt"))
    for module, users in tree().items():
        found = distributions().get(module, set())
        if found & set(files()) and not found & plain:
            assert not users & set(NODE_PACKAGES), f"{module} is imported by {sorted(users)}"


def test_executables_land_where_they_belong() -> None:
    """Fails when a node leaves lib/fluidic_hand, or something besides `hand` lands in bin."""
    setup = (ROOT / "setup.py").read_text(encoding="utf-8")
    assert re.findall(r'"console_scripts": \[(.*?)\]', setup) == ['"hand = hand_tool.main:main"']
    nodes = sorted((ROOT / "tools" / "nodes").iterdir())
    assert [path.name for path in nodes] == ["controller", "driver", "frame_publisher", "recorder", "simulation"]
    for path in nodes:
        assert os.access(path, os.X_OK), path
        (module,) = re.findall(r"^from ([\w.]+) import main$", path.read_text(encoding="utf-8"), re.MULTILINE)
        assert (ROOT / Path(*module.split("."))).with_suffix(".py").is_file()


def test_every_package_is_installed() -> None:
    """Fails when a new package is forgotten in setup.py."""
    listed = re.search(r"PACKAGES = \[(.*?)\]", (ROOT / "setup.py").read_text(encoding="utf-8"), re.DOTALL)
    assert listed is not None
    inits = [*ROOT.glob("hand_*/**/__init__.py"), *ROOT.glob("validation/**/__init__.py")]
    found = {".".join(path.parent.relative_to(ROOT).parts) for path in inits}
    assert set(re.findall(r'"([\w.]+)"', listed.group(1))) == found


def test_every_package_is_in_the_glossary_and_in_the_architecture() -> None:
    """Fails when a new package, or a new part of validation, is described in neither of the two."""
    packages = {path.parent.name for path in ROOT.glob("hand_*/__init__.py")} | {"hand_msgs", "validation"}
    parts = {f"validation/{path.parent.name}" for path in ROOT.glob("validation/*/__init__.py")}
    glossary, architecture = (
        set(re.findall(r"^\| `([\w/]+)` \|", (ROOT / "docs" / name).read_text(encoding="utf-8"), re.MULTILINE))
        for name in ("glossary.md", "architecture.md")
    )
    assert packages <= glossary
    assert packages - {"validation"} | parts <= architecture


def test_version_and_maintainer_stand_in_package_xml_alone() -> None:
    """Fails when the two packages disagree, or setup.py or pyproject.toml repeat what package.xml says."""
    names = ("version", "maintainer", "license")
    ours, theirs = (
        {name: ET.parse(path).getroot().findtext(name) for name in names}
        for path in (ROOT / "package.xml", ROOT / "hand_msgs" / "package.xml")
    )
    assert ours == theirs
    assert f"## [{ours['version']}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert str(ours["version"]) not in (ROOT / "setup.py").read_text(encoding="utf-8")
    assert "project" not in tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


CLEAN = ("PYTHONPATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "LD_LIBRARY_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE")


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`bin` of a new virtual environment with the wheel of this tree; it sees our libraries, but not ROS."""
    folder = tmp_path_factory.mktemp("installed")
    environment = {name: value for name, value in os.environ.items() if name not in CLEAN}
    environment["HAND_WITHOUT_VALIDATION"] = "1"  # as for a robot
    source = folder / "source"
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True).stdout
    for name in filter(None, listed.split("\0")):  # a build leaves files next to its sources
        if (ROOT / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
            (source / name).chmod((ROOT / name).stat().st_mode)

    def run(*command: str) -> None:
        subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True, timeout=300)

    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
    run(*pip, "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", str(folder), str(source))
    run(sys.executable, "-m", "venv", "--without-pip", str(folder / "venv"))
    (wheel,) = folder.glob("fluidic_hand-*.whl")
    python = folder / "venv" / "bin" / "python"
    run(*pip, "--python", str(python), "install", "--no-deps", "--no-compile", str(wheel))
    site = folder / "venv" / "lib" / f"python{sys.version_info[0]}.{sys.version_info[1]}" / "site-packages"
    libraries = folder / "libraries"
    libraries.mkdir()
    ours = next(Path(path) for path in sys.path if (Path(path) / "typer").is_dir())
    for entry in ours.iterdir():
        if not entry.name.startswith(("rclpy", "ament", "ros_", "sensor_msgs", "std_msgs", "hand_")):
            (libraries / entry.name).symlink_to(entry)
    (site / "libraries.pth").write_text(f"{libraries}\n", encoding="utf-8")
    return python.parent


def hand(installed: Path, cwd: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the installed `hand` without the environment of ROS or of this tree."""
    environment = {name: value for name, value in os.environ.items() if name not in CLEAN}
    command = [str(installed / "hand"), *arguments]
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300, check=False)


def test_pip_installs_a_working_hand_without_ros(installed: Path, tmp_path: Path) -> None:
    """Fails when pip installs no module, model or template that hand needs, or validation against the wish."""
    assert hand(installed, tmp_path, "--version").stdout.startswith("hand ")
    made = hand(
        installed, tmp_path, "excite", "steps", "--duration", "3", "--joints", "index_distal", "--out", "a.mcap"
    )
    assert made.returncode == 0, made.stderr
    assert str(installed.parent / "share" / "fluidic_hand" / "config" / "hand.yaml") in made.stderr
    assert hand(installed, tmp_path, "simulate", "a.mcap", "--out", "again.mcap").returncode == 0
    for words, line in (
        (("record", "--out", "nothing"), "needs ROS 2 Jazzy"),
        (("reproduce", "--out", "b"), "pip install"),
    ):
        refused = hand(installed, tmp_path, *words)
        assert refused.returncode == 2 and line in refused.stderr
        assert len(refused.stderr.splitlines()) == 1
    assert not list(installed.parent.glob("lib/python3*/site-packages/validation"))


@pytest.mark.long
def test_what_pip_installs_diagnoses_and_identifies(installed: Path, tmp_path: Path) -> None:
    """Fails when an installation by pip lacks what a diagnosis or an identification reads: pages, schema, settings."""
    words = ("excite", "steps", "--duration", "3", "--joints", "index_distal", "--out", "a.mcap")
    assert hand(installed, tmp_path, *words).returncode == 0
    named = hand(installed, tmp_path, "diagnose", "a.mcap", "--joints", "index_distal", "--out", "found", "--json")
    assert named.returncode == 0 and json.loads(named.stdout)["verdict"] == "agrees", named.stderr
    assert (tmp_path / "found" / "report.html").stat().st_size > 10_000
    words = ("identify", "dynamics", "a.mcap", "--joints", "index_distal", "--out", "model.yaml", "--json")
    fitted = hand(installed, tmp_path, *words)
    assert fitted.returncode == 0 and "index_distal" in fitted.stdout, fitted.stderr


TYPED = (
    *("hand_diagnosis", "hand_model", "hand_recording", "hand_machine", "hand_identification"),
    *("hand_messages", "hand_pages", "hand_ros", "hand_sim"),
)
"""Packages of the Python interface, and those whose types it shows or uses."""


def test_a_type_checker_sees_the_types_of_the_installed_interface(installed: Path) -> None:
    """Fails when the wheel lacks py.typed in a package of the interface, so that mypy takes all its names for Any."""
    from mypy.modulefinder import FindModuleCache, ModuleNotFoundReason, SearchPaths  # noqa: PLC0415 - seconds
    from mypy.options import Options  # noqa: PLC0415 - as above

    (site,) = installed.parent.glob("lib/python*/site-packages")
    cache = FindModuleCache(SearchPaths((), (), (str(site),), ()), None, Options())
    found = {module: cache.find_module(module) for module in [*TYPED, "hand_diagnosis.api", "hand_model.description"]}
    assert {module: path for module, path in found.items() if not isinstance(path, str)} == {}
    assert all(Path(str(path)).is_relative_to(site) for path in found.values())
    assert isinstance(cache.find_module("validation"), ModuleNotFoundReason)  # no interface, and no py.typed


def test_pip_puts_only_hand_on_the_path(installed: Path) -> None:
    """Fails when pip installs a node into bin, or `ros2 run` would not find one in lib/fluidic_hand."""
    scripts = {path.name for path in installed.iterdir()}
    assert {name for name in scripts if not name.lower().startswith(("python", "activate"))} == {"hand"}
    nodes = sorted((installed.parent / "lib" / "fluidic_hand").iterdir())
    assert [path.name for path in nodes] == ["controller", "driver", "frame_publisher", "recorder", "simulation"]
    assert all(os.access(path, os.X_OK) for path in nodes)


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
        "BoardState": [header, ("uint8", "protocol"), ("bool", "link_up"), ("uint16", "status"),
                       ("float64", "supply_voltage"), ("uint32", "set_point_sequence"), ("float64", "set_point_age"),
                       name, ("float64[]", "set_point"), ("string", "fault"), ("string[]", "channel_fault")],
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
