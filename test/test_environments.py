"""Dockerfile, devcontainer, pre-commit and Makefile: what they name exists, and they agree with each other.

The container cannot be built where these tests run; hadolint checks its form in `make lint`.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parent.parent
BUILD = "--base-paths src src/fluidic_hand/hand_msgs"


def instructions(path: Path) -> list[tuple[str, str]]:
    """Instructions of a Dockerfile with their arguments, continuation lines joined."""
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.lstrip().startswith("#")]
    joined = "\n".join(lines).replace("\\\n", " ")
    return [(line.split(None, 1)[0], line.split(None, 1)[1]) for line in joined.splitlines() if line.strip()]


def test_everything_that_the_dockerfile_copies_or_runs_is_there() -> None:
    """Fails when a file moves and the Dockerfile still names its old place."""
    found = instructions(ROOT / "Dockerfile")
    assert found[0] == ("FROM", "ros:jazzy")
    for name, arguments in found:
        if name == "COPY":
            for source in shlex.split(arguments)[:-1]:
                assert (ROOT / source).exists(), source
    places = dict(found)
    (entry,) = json.loads(places["ENTRYPOINT"])
    script = ROOT / Path(entry).relative_to("/ws/src/fluidic_hand")
    assert os.access(script, os.X_OK)
    assert subprocess.run(["bash", "-n", str(script)], check=False).returncode == 0
    program, verb, package, launch = json.loads(places["CMD"])
    assert (program, verb, package) == ("ros2", "launch", "fluidic_hand")
    assert (ROOT / "launch" / launch).is_file()


def test_the_container_follows_the_route_of_the_documents() -> None:
    """Fails when docs/use.md, Dockerfile and devcontainer build the workspace in different ways."""
    readme = (ROOT / "docs" / "use.md").read_text(encoding="utf-8")
    docker = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    container = json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text(encoding="utf-8"))
    for text in (readme, docker, container["postCreateCommand"]):
        assert BUILD in text
    install = "rosdep install --from-paths src src/fluidic_hand/hand_msgs --ignore-src -y"
    assert install in readme
    assert install in docker
    folder = ROOT / ".devcontainer"
    assert (folder / container["build"]["dockerfile"]).resolve() == ROOT / "Dockerfile"
    assert (folder / container["build"]["context"]).resolve() == ROOT


def test_the_build_context_leaves_out_what_was_built() -> None:
    """Fails when the container would get a virtual environment or a build of the host."""
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").split()
    assert {".venv", "build", "install", "log", "out", ".git"} <= set(ignored)


def test_pre_commit_runs_the_tools_of_the_gate() -> None:
    """Fails when a hook's program is no tool of requirements-dev.txt, or a lint of the gate has no hook."""
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"]
    assert [repository["repo"] for repository in hooks] == ["local"]
    entries = [shlex.split(hook["entry"]) for hook in hooks[0]["hooks"]]
    tools = (ROOT / "requirements-dev.txt").read_text(encoding="utf-8")
    assert all(f"\n{Path(entry[0]).name}==" in tools for entry in entries)
    lint = next(line for line in (ROOT / "Makefile").read_text(encoding="utf-8").splitlines() if "ruff check" in line)
    for tool in ("ruff format", "ruff check", "mypy"):
        assert tool in lint
        assert any(" ".join([Path(entry[0]).name, *entry[1:]]).startswith(tool) for entry in entries)


def test_make_knows_its_targets_and_files() -> None:
    """Fails when a target has no line in `make help`, or the Makefile names a file or module that is not there."""
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    (phony,) = re.findall(r"^\.PHONY: (.*)$", text, re.MULTILINE)
    shown = subprocess.run(["make", "--silent", "help"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    listed = {line.split()[1] for line in shown.splitlines()}
    assert listed | {"help", "lint"} == set(phony.split())
    for name in re.findall(r"requirements[\w-]*\.txt|tools/\w+\.\w+", text):
        assert (ROOT / name).is_file(), name
    for module in re.findall(r"python -m (validation[\w.]*)", text):
        path = ROOT / Path(*module.split("."))
        assert path.with_suffix(".py").is_file() or (path / "__main__.py").is_file(), module


def test_every_requirements_file_is_installed_by_make() -> None:
    """Fails when `make test` forgets a requirements file, or `make demo` installs more than what runs."""
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    (running,) = re.findall(r"^RUNNING := (.*)$", text, re.MULTILINE)
    (checking,) = re.findall(r"^CHECKING := (.*)$", text, re.MULTILINE)
    assert running.split() == ["requirements-ros.txt", "requirements.txt"]
    assert {*running.split(), *checking.split()} == {path.name for path in ROOT.glob("requirements*.txt")}


def test_the_readme_is_one_screen() -> None:
    """Fails when the README grows beyond 50 lines, loses its picture, or has other than two commands to begin with."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 50
    assert "](docs/pictures/studio_model.png)" in text
    assert "Two commands" in text and re.findall(r"^    (make \w+)", text, re.MULTILINE) == ["make demo", "make studio"]


def test_the_gate_is_the_readmes_command() -> None:
    """Fails when the gate runs commands other than those of the README."""
    assert (ROOT / ".ci" / "run").read_text(encoding="utf-8").rstrip().endswith("exec make test")
    assert "make test" in (ROOT / "README.md").read_text(encoding="utf-8")
    assert "rerun" not in tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["pytest"][
        "ini_options"
    ].get("addopts", "")
