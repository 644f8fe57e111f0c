"""The command `hand` as a new user meets it: help, version, bad input, which model is used, how long it takes."""

from __future__ import annotations

import hashlib
import inspect
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command
from typer.testing import CliRunner, Result

from hand_identification.excitation import EXPERIMENTS
from hand_model.description import load_hand
from hand_model.effects.effect import PLACES
from hand_recording.installed import differing_source
from hand_recording.replay import record_offline
from hand_recording.version import version
from hand_tool import excite, magnet, new_effect, reproduce
from hand_tool.cli import app
from validation.magnet.contour import METHODS
from validation.paper.result import IDS

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "config" / "hand.yaml"
HEAVY = ("numpy", "scipy", "numba", "matplotlib", "rosbags", "mcap", "yaml", "rclpy", "rich.progress")


def hand(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def process(*arguments: str, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "hand_tool", *arguments]
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | {"PYTHONPATH": path}
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=120, check=False)


def commands(group: TyperGroup, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], TyperCommand]]:
    """Every subcommand with the words that call it."""
    for name, command in group.commands.items():
        if isinstance(command, TyperGroup):
            yield from commands(command, (*words, name))
        else:
            assert isinstance(command, TyperCommand)
            yield (*words, name), command


_ROOT_COMMAND = get_command(app)
assert isinstance(_ROOT_COMMAND, TyperGroup)
COMMANDS = dict(commands(_ROOT_COMMAND))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("recording") / "steps.mcap"
    hand_model = load_hand(CONFIG)
    for _ in record_offline(hand_model, np.full((200, len(hand_model.joints)), 1e5), out, seed=1):
        pass
    return out


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_help_has_an_example_exit_codes_and_no_open_end(words: tuple[str, ...]) -> None:
    """Fails when the help of a subcommand lacks an example or exit codes, a sentence is cut, or -h is unknown."""
    result = hand(*words, "-h")
    assert result.exit_code == 0
    assert f"Example: hand {' '.join(words)}" in " ".join(result.output.split())
    assert "Exit codes" in result.output
    assert "…" not in result.output
    first = (COMMANDS[words].help or "").split("\n\n")[0]
    assert first.endswith("."), first
    assert "..." not in first


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_options_are_consistent(words: tuple[str, ...]) -> None:
    """Fails when a subcommand lacks --quiet or --verbose, or an option has no help."""
    options = {name: option for option in COMMANDS[words].params for name in option.opts}
    assert {"--quiet", "--verbose"} <= set(options)
    assert all(getattr(option, "help", None) for option in options.values())


def test_lists_in_help_texts_are_the_real_ones() -> None:
    """Fails when a name is added that the help, which imports nothing, does not show."""
    assert tuple(EXPERIMENTS) == excite.NAMES
    assert tuple(IDS) == reproduce.NAMES
    assert tuple(METHODS) == magnet.METHODS
    assert tuple(PLACES) == new_effect.PLACES


def test_version_is_that_of_package_xml() -> None:
    """Fails when the version is written in a second place."""
    text = (ROOT / "package.xml").read_text(encoding="utf-8")
    assert f"<version>{version()}</version>" in text
    assert process("--version").stdout == f"hand {version()}\n"


def test_help_loads_no_library_that_takes_long() -> None:
    """Fails when the module of a subcommand imports at its top what only its work needs."""
    code = f"import hand_tool.cli, sys; print([name for name in {HEAVY!r} if name in sys.modules])"
    shown = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "[]"


def test_completion_of_the_shell() -> None:
    """Fails when the completion script is not offered."""
    shown = process("--show-completion", "bash")
    assert shown.returncode == 0
    assert "_HAND_COMPLETE" in shown.stdout


EMPTY = "is empty"
CASES: dict[str, tuple[tuple[str, ...], str]] = {
    "recording does not exist": (("simulate", "nowhere.mcap", "--out", "x.mcap"), "nowhere.mcap does not exist"),
    "recording is empty": (("simulate", "empty.mcap", "--out", "x.mcap"), EMPTY),
    "recording is something else": (("simulate", "text.mcap", "--out", "x.mcap"), "text.mcap"),
    "recording is an empty folder": (("simulate", "folder", "--out", "x.mcap"), "folder is an empty folder"),
    "output exists": (("simulate", "text.mcap", "--out", "text.mcap"), "text.mcap exists already"),
    "output below a file": (("simulate", "text.mcap", "--out", "text.mcap/x"), "text.mcap is a file"),
    "output cannot be written": (("excite", "steps", "--out", "/proc/none/x.mcap"), "/proc/none"),
    "model is a folder": (("excite", "steps", "--out", "x.mcap", "--model", "folder"), "folder is a folder"),
    "model is empty": (("excite", "steps", "--out", "x.mcap", "--model", "empty.yaml"), EMPTY),
    "no such experiment": (("excite", "stpes", "--out", "x.mcap"), "it must be one of staircase"),
    "no port": (("emulate-board",), "--serial"),
    "two ports": (("emulate-board", "--serial", "a", "--can", "b"), "--serial"),
    "wrong probability": (("emulate-board", "--serial", "a", "--drop", "1.5"), "the allowed range is 0 to 1"),
    "model of the board": (("emulate-board", "--serial", "a", "--model", "text.mcap"), "text.mcap"),
    "model of the demo": (("demo", "--model", "nowhere.yaml"), "nowhere.yaml does not exist"),
    "demo into a file": (("demo", "--out", "text.mcap"), "text.mcap is a file"),
    "nothing to repair": (("record", "--repair", "nowhere"), "nowhere does not exist"),
    "record over a file": (("record", "--out", "text.mcap"), "text.mcap exists already"),
    "diagnose nothing": (("diagnose", "nowhere.mcap", "--out", "x"), "nowhere.mcap does not exist"),
    "diagnose a text": (("diagnose", "text.mcap", "--out", "x"), "text.mcap"),
    "diagnose into a file": (("diagnose", "text.mcap", "--out", "empty.yaml"), "empty.yaml is a file"),
    "diagnose with tolerance 2": (("diagnose", "text.mcap", "--out", "x", "--tolerance", "2"), "above 0 to 1"),
    "diagnose with 0 processes": (("diagnose", "text.mcap", "--out", "x", "--jobs", "0"), "1 to 256"),
    "mapping does not exist": (("diagnose", "text.mcap", "--out", "x", "--map", "none.yaml"), "none.yaml"),
    "machine does not exist": (("diagnose", "text.mcap", "--out", "x", "--machine", "none.yaml"), "none.yaml"),
    "rig does not exist": (("identify", "angle", "nowhere.csv"), "nowhere.csv does not exist"),
    "rig is empty": (("identify", "force", "empty.yaml"), EMPTY),
    "rig is a folder": (("identify", "angle", "folder"), "folder is a folder"),
    "static map of nothing": (("identify", "statics", "nowhere.csv"), "nowhere.csv does not exist"),
    "dynamics of nothing": (("identify", "dynamics", "nowhere.mcap", "--out", "x"), "nowhere.mcap does not exist"),
    "no such figure": (("reproduce", "--out", "x", "--only", "fig99"), "it must be one of table1"),
    "figures into a file": (("reproduce", "--out", "text.mcap"), "text.mcap is a file"),
    "no such method": (("magnet", "--out", "x", "--method", "luck"), "it must be one of ga"),
    "magnet into a file": (("magnet", "--out", "text.mcap"), "text.mcap is a file"),
    "trial into a full folder": (("trial", "make", "full"), "full is not empty"),
    "missing trial": (("trial", "run", "folder"), "plan.json is missing"),
    "score of nothing": (("trial", "score", "nowhere", "--key", "k"), "nowhere does not exist"),
    "no machines": (("trial", "reality", "nowhere", "--out", "x"), "nowhere"),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name in ("empty.mcap", "empty.yaml"):
        (tmp_path / name).touch()
    (tmp_path / "text.mcap").write_text("this is no recording\n", encoding="utf-8")
    (tmp_path / "folder").mkdir()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").touch()
    return tmp_path


@pytest.mark.parametrize("case", CASES)
def test_bad_input_is_one_line_and_exit_code_2(case: str, folder: Path) -> None:
    """Fails when bad input gives a traceback, several lines, another exit code, or a file that was not asked for."""
    arguments, line = CASES[case]
    before = sorted(folder.rglob("*"))
    result = hand(*arguments)
    assert result.exit_code == 2, result.output
    printed = [text for text in result.output.splitlines() if text.strip()]
    assert len(printed) == 1, printed
    assert printed[0].startswith(f"hand {arguments[0]}")
    assert line in printed[0]
    assert sorted(folder.rglob("*")) == before


def test_a_missing_file_is_reported_before_libraries_are_loaded(folder: Path) -> None:
    """Fails when input and output paths are checked after imports that take seconds."""
    code = (
        "import sys\nfrom hand_tool.cli import run\ncode = run(sys.argv[1:])\n"
        f"print(code, [name for name in {HEAVY!r} if name in sys.modules])"
    )
    for arguments in (
        ("simulate", "nowhere.mcap", "--out", "x"),
        ("diagnose", "nowhere.mcap", "--out", "x"),
        ("identify", "dynamics", "nowhere.mcap", "--out", "x"),
        ("excite", "steps", "--out", "text.mcap"),
        ("reproduce", "--out", "text.mcap"),
    ):
        command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{code}", *arguments]
        shown = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
        assert shown.stdout.strip() == "2 []", (arguments, shown.stdout)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("recrod",), "'record'"),
        (("record", "--duration", "abc"), "'--duration'"),
        (("simulate",), "'recording'"),
        (("simulate", "--modle", "x"), "--model"),
        (("identify", "angel", "x"), "'angle'"),
        (("trial", "run", "a", "--jbos", "2"), "--jobs"),
        (("simulate", "nowhere.mcap", "--out", "x.mcap"), "nowhere.mcap"),
    ],
)
def test_the_process_prints_one_line(arguments: tuple[str, ...], line: str, tmp_path: Path) -> None:
    """Fails when the process answers bad usage with a box, a traceback, standard output or another code than 2."""
    result = process(*arguments, cwd=tmp_path)
    assert result.returncode == 2
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1, result.stderr
    assert line in result.stderr


def test_which_model_was_used(recording: Path, tmp_path: Path) -> None:
    """Fails when the model file or its hash is not printed, or --json or --quiet do not do what they say."""
    digest = hashlib.sha256(CONFIG.read_bytes()).hexdigest()
    arguments = ("simulate", str(recording), "--model", str(CONFIG))
    shown = hand(*arguments, "--out", str(tmp_path / "a.mcap"))
    assert shown.exit_code == 0, shown.output
    assert f"model: {CONFIG} (sha256 {digest[:8]})" in shown.stderr
    shown = hand(*arguments, "--out", str(tmp_path / "b.mcap"), "--json")
    assert shown.stderr == ""
    assert json.loads(shown.stdout)["model_file"] == {"path": str(CONFIG), "sha256": digest}
    assert hand(*arguments, "--out", str(tmp_path / "c.mcap"), "--quiet").stderr == ""


def with_helpers(function: Callable[..., object]) -> str:
    """The source of a command and of the functions of hand_tool that it calls."""
    text = inspect.getsource(function)
    called = (function.__globals__.get(name) for name in set(re.findall(r"\b(\w+)\(", text)))
    helpers = (each for each in called if inspect.isfunction(each) and each.__module__.startswith("hand_tool."))
    return text + "".join(inspect.getsource(each) for each in helpers)


def uses_a_model(words: tuple[str, ...]) -> bool:
    """Whether a command takes a description of a hand or a machine, or reads the installed one."""
    about = " ".join(f"{each.name}: {getattr(each, 'help', '')}" for each in COMMANDS[words].params)
    source = with_helpers(inspect.unwrap(COMMANDS[words].callback or hand))
    return bool(re.search(r"\bmodel: |hand\.yaml", about)) or "choose_model(" in source


def test_the_search_finds_commands_that_use_a_model() -> None:
    """Fails when the search of the next test passes over a command."""
    found = {" ".join(words) for words in COMMANDS if uses_a_model(words)}
    assert {"simulate", "patch", "compare", "reproduce", "identify angle", "identify force", "trial make"} <= found
    assert found.isdisjoint({"record", "stop", "magnet"})


@pytest.mark.parametrize("words", [words for words in COMMANDS if uses_a_model(words)], ids=" ".join)
def test_every_command_that_uses_a_model_prints_it(words: tuple[str, ...]) -> None:
    """Fails when a command reads or changes a model and does not print which file it is, with its hash."""
    source = with_helpers(inspect.unwrap(COMMANDS[words].callback or hand))
    assert re.search(r"\b(?:chosen|model)\.print\(", source)


def test_verbose_shows_where_an_error_arose(folder: Path) -> None:
    """Fails when --verbose hides the traceback, or the line is not the last one."""
    shown = hand("simulate", "text.mcap", "--out", "x.mcap", "--verbose")
    assert shown.exit_code == 2
    assert "Traceback" in shown.stderr
    assert shown.stderr.splitlines()[-1].startswith("hand simulate: ")


def test_an_outdated_copy_of_the_model_is_noticed(tmp_path: Path) -> None:
    """Fails when an edit of config/hand.yaml has no effect and nobody says so."""
    source = tmp_path / "source"
    (source / "config").mkdir(parents=True)
    for name in ("package.xml", "setup.py", "config/hand.yaml"):
        shutil.copy(ROOT / name, source / name)
    installed = source / "install" / "share" / "fluidic_hand" / "config" / "hand.yaml"
    installed.parent.mkdir(parents=True)
    shutil.copy(CONFIG, installed)
    assert differing_source(installed, tmp_path) is None
    with (source / "config" / "hand.yaml").open("a", encoding="utf-8") as stream:
        stream.write("# edited\n")
    assert differing_source(installed, tmp_path) == source / "config" / "hand.yaml"
    installed.unlink()
    installed.symlink_to(source / "config" / "hand.yaml")
    assert differing_source(installed, source) is None


PRINTED = """
import os
from hand_model import compile_cache
print(os.environ["OMP_WAIT_POLICY"])
"""


@pytest.mark.parametrize(("given", "expected"), [({}, "passive"), ({"OMP_WAIT_POLICY": "active"}, "active")])
def test_threads_that_wait_do_not_occupy_a_core(given: dict[str, str], expected: str) -> None:
    """Fails when the threads of the compiled loops spin while they wait, or a choice of the user is replaced."""
    environment = {name: value for name, value in os.environ.items() if name != "OMP_WAIT_POLICY"} | given
    command = [sys.executable, "-c", PRINTED]
    done = subprocess.run(command, env=environment, text=True, capture_output=True, cwd=ROOT, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, expected), done.stderr
