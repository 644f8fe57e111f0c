"""What README and docs claim: links and paths lead somewhere, commands and their options exist and have help."""

from __future__ import annotations

import importlib.util
import itertools
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from hand_robot.launch_nodes import ARGUMENTS
from hand_tool.cli import app

ROOT = Path(__file__).resolve().parents[1]
PAGES = [
    ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "firmware/README.md", "examples/README.md")
]
PAGES += sorted((ROOT / "docs").glob("*.md"))
NAMES = [page.relative_to(ROOT).as_posix() for page in PAGES]
WRITTEN = ("out/", "build/", "install/", "log/", ".venv")
"""Folders that commands write."""
PARSER: Any = typer.main.get_command(app)
COMMANDS = re.compile(r"(hand|make|python3? -m|ros2 run|ros2 launch) ")


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def without_code(text: str) -> str:
    """A page without its code blocks and code spans."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"^ {4}.*$", "", text, flags=re.MULTILINE)
    return re.sub(r"`[^`\n]*`", "", text)


def anchors(text: str) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    titles = re.findall(
        r"^#+ +(.+?) *$", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE), re.MULTILINE
    )
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("name", NAMES)
def test_every_link_leads_somewhere(name: str) -> None:
    """Fails when a relative link names a file or a heading that is not there."""
    page, text = ROOT / name, text_of(name)
    for target in re.findall(r"\]\(([^)\s]+)\)", without_code(text)):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), f"{name}: {target}"
        if anchor:
            assert anchor in anchors(file.read_text(encoding="utf-8")), f"{name}: {target}"


def code_spans(text: str) -> list[str]:
    return re.findall(r"`([^`\n]+)`", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE))


@cache
def tracked() -> tuple[set[str], set[str], set[str]]:
    """Paths of the tree, their folders, and their file names."""
    done = subprocess.run(["git", "-C", str(ROOT), "ls-files"], capture_output=True, text=True, check=True)
    files = {line for line in done.stdout.splitlines() if (ROOT / line).exists()}
    files |= {path.relative_to(ROOT).as_posix() for path in [*ROOT.glob("*/*.py"), *ROOT.glob("*/*/*.py")]}
    folders = {parent.as_posix() for file in files for parent in Path(file).parents}
    return files, folders, {Path(file).name for file in files}


def expanded(path: str) -> list[str]:
    """`a/{b,c}.py` as two paths."""
    found = re.search(r"\{([^}]*)\}", path)
    if found is None:
        return [path]
    return [path.replace(found[0], part, 1) for part in found[1].split(",")]


def missing_paths(name: str) -> list[str]:
    """Code spans of a page that look like files of the tree and are none."""
    files, folders, names = tracked()
    top = {path.split("/")[0] for path in files if "/" in path}
    wrong = []
    for span in code_spans(text_of(name)):
        if not re.fullmatch(r"[\w./{},*-]+", span) or span.startswith(WRITTEN) or re.search("NN|NAME", span):
            continue
        for path in expanded(span):
            bare = path.rstrip("/")
            beside = (Path(name).parent / bare).as_posix()
            if bare.split("/")[0] in top and "/" in path:
                there = bare in files or bare in folders or beside in files or any(ROOT.glob(bare))
            elif path.endswith(".py"):
                there = Path(path).name in names
            else:
                continue
            if not there:
                wrong.append(path)
    return wrong


@pytest.mark.parametrize("name", [name for name in NAMES if name != "CHANGELOG.md"])
def test_every_path_of_the_tree_exists(name: str) -> None:
    """Fails when a document names a file or folder of this tree that was moved, renamed or removed."""
    assert missing_paths(name) == []


def commands(name: str) -> Iterator[str]:
    """Command lines of a page: in code blocks and in code spans, without comments and prompts."""
    text = text_of(name)
    fenced = re.findall(r"^```\w*\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    lines = [line for block in fenced for line in block.splitlines()]
    lines += [line[4:] for line in text.splitlines() if line.startswith("    ")]
    lines += code_spans(text)
    lines += [found.split(" # ")[0] for found in re.findall(r"<!-- generated: (.+?) -->", text)]
    for line in lines:
        stripped = re.sub(r"(^|\s)#.*", "", line).strip()
        if COMMANDS.match(stripped):
            yield re.split(r" (?:&&|\||>|;) ", stripped)[0]


def all_commands() -> list[tuple[str, str]]:
    return [(name, line) for name in NAMES if name != "CHANGELOG.md" for line in dict.fromkeys(commands(name))]


def test_commands_are_found() -> None:
    """Fails when the search for commands finds none, so that the tests below would test nothing."""
    found = {line.split()[0] for _, line in all_commands()}
    assert {"hand", "make", "python", "ros2"} <= found
    assert len(all_commands()) > 30


@pytest.mark.parametrize(("page", "line"), all_commands())
def test_every_command_exists(page: str, line: str) -> None:
    """Fails when a document names a subcommand, option, make target, module or executable that is not there."""
    words = shlex.split(line.replace("…", "..."))
    if words[0] == "hand":
        check_hand(words[1:])
    elif words[0] == "make":
        check_make(words[1:])
    elif words[0].startswith("python"):
        check_module(words[2], words[3:])
    else:
        check_ros(words)


def check_hand(words: list[str]) -> None:
    """The subcommand and its options, by the command line's own parser."""
    command = PARSER
    context: Any = typer.Context(command, info_name="hand")
    while hasattr(command, "get_command") and words and not words[0].startswith("-"):
        name, *words = words
        child = command.get_command(context, name)
        assert child is not None, f"hand has no subcommand {name}"
        context = typer.Context(child, info_name=name, parent=context)
        command = child
    known = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
    known |= set(command.get_help_option_names(context))
    for word in words:
        if word.startswith("--") or re.fullmatch(r"-[a-z]", word):
            assert word.split("=")[0] in known, f"{command.name} has no option {word}"


def check_make(words: list[str]) -> None:
    """Targets of the Makefile; NAME=VALUE sets a variable that it uses."""
    makefile = text_of("Makefile")
    for word in words:
        variable = re.match(r"([A-Z]+)=", word)
        if variable:
            assert (
                f"$({variable[1]}" in makefile or f"{variable[1]} ?=" in makefile or f",$({variable[1]}" in makefile
            ), word
        elif re.fullmatch(r"[a-z]+", word):
            assert re.search(rf"^{word}:", makefile, re.MULTILINE), f"no target {word}"


@cache
def help_of(module: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", module, "--help"], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, f"python -m {module} --help: {done.stderr}"
    return done.stdout


def check_module(module: str, words: list[str]) -> None:
    """The module, and its options by its help."""
    assert importlib.util.find_spec(module) is not None, module
    if not module.startswith(("validation", "hand_")):
        return
    text = help_of(module)
    for word in words:
        if word.startswith("--"):
            assert word.split("=")[0] in text, f"python -m {module} has no option {word}"


VIEWERS = ("foxglove_bridge", "plotjuggler")
"""Packages of other projects that the documents start."""


def check_ros(words: list[str]) -> None:
    """Executables, launch files and the parameters that are set, of this package; of a viewer, how it is installed."""
    if words[2] in VIEWERS:
        assert f"`ros-jazzy-{words[2].replace('_', '-')}" in text_of("docs/integration.md"), words[2]
        return
    if words[1] == "launch" and words[2].endswith(".launch.py"):  # a file of this tree
        words = [*words[:2], str(Path(words[2]).parent), Path(words[2]).name, *words[3:]]
    kind, package, name = words[1:4]
    folders = {"fluidic_hand": ROOT / "launch", "fluidic_hand_moveit_config": ROOT / "moveit" / "launch"}
    assert package in folders or (ROOT / package).is_dir()
    if kind == "launch":
        launch = folders.get(package, ROOT / package) / name
        assert launch.is_file(), name
        known = {each.name for each in ARGUMENTS} if launch.parent == ROOT / "launch" else set()
        for word in words[4:]:
            argument = word.partition(":=")[0]
            assert argument in known or f'"{argument}"' in launch.read_text(encoding="utf-8"), word
        return
    assert name in executables(), f"no executable {name}"
    sources = "".join(path.read_text(encoding="utf-8") for path in ROOT.glob("hand_*/*.py"))
    for before, word in itertools.pairwise(words):
        if before == "-p":
            assert f'"{word.partition(":=")[0]}"' in sources, f"no parameter {word}"
        if before == "--params-file":
            assert (ROOT / word).is_file(), word


NAMESPACE = re.compile(r"namespace(?::=|=| )/?(\w+)")
PREFIX = re.compile(r"prefix(?::=|=| )(\w+)")


def layouts_of_another_hand(section: str) -> list[str]:
    """Layouts that a section opens or makes although it starts a hand of another namespace or prefix."""
    lines = [
        line for line in section.splitlines() if re.search(r"(?:hand (?:up|studio)|ros2 launch fluidic_hand) ", line)
    ]
    started = {(tuple(NAMESPACE.findall(line)), tuple(PREFIX.findall(line))) for line in lines} - {((), ())}
    if not started:
        return []
    made = [line for line in section.splitlines() if re.search(r"--format (?:foxglove|plotjuggler|rviz)", line)]
    wrong = [line for line in made if (tuple(NAMESPACE.findall(line)), tuple(PREFIX.findall(line))) not in started]
    return wrong + re.findall(r"config/layouts/\S+", section)


@pytest.mark.parametrize("name", [name for name in NAMES if name != "CHANGELOG.md"])
def test_the_layouts_are_those_of_the_hand_that_was_started(name: str) -> None:
    """Fails when a section starts a hand with a namespace or prefix and opens the layout of another one."""
    for section in re.split(r"^## ", text_of(name), flags=re.MULTILINE):
        assert layouts_of_another_hand(section) == [], section.splitlines()[0]


def test_a_layout_of_another_hand_is_found() -> None:
    """Fails when the search passes over the shipped layout, or over one with another prefix."""
    start = "    hand up --sim --namespace left_hand --joint-prefix left_\n"
    make = "    hand urdf --format foxglove --prefix {} --namespace left_hand\n"
    assert layouts_of_another_hand(start + make.format("left_")) == []
    assert layouts_of_another_hand(start + make.format("right_")) == [make.format("right_").strip("\n")]
    assert layouts_of_another_hand(start + "open `config/layouts/hand.rviz`")


def executables() -> set[str]:
    """Names that `ros2 run fluidic_hand` knows: console scripts and installed scripts."""
    scripts = set(re.findall(r'"(\w+) *= *hand_\w+\.node:main"', text_of("setup.py")))
    return scripts | {path.stem for path in (ROOT / "tools" / "nodes").glob("*")}


def subcommands(command: Any, names: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Every command of `hand`, groups included."""
    yield names
    if hasattr(command, "list_commands"):
        context: Any = typer.Context(command, info_name="hand")
        for name in command.list_commands(context):
            yield from subcommands(command.get_command(context, name), (*names, name))


@pytest.mark.parametrize("names", [names for names in subcommands(PARSER) if names])
def test_every_help_has_an_example(names: tuple[str, ...]) -> None:
    """Fails when a command's --help does not run or shows no example, or when the example is no command of the tool."""
    done = CliRunner().invoke(app, [*names, "--help"])
    assert done.exit_code == 0, done.output
    examples = re.findall(r"Examples?: +(hand [^│\n]*)", done.output)
    if hasattr(command_named(names), "list_commands") and not examples:
        return  # a group: its commands have the examples
    assert examples, f"hand {' '.join(names)} --help has no example"
    for example in examples:
        first = re.split(r" (?:&&|\||>|;) ", example)[0].strip().rstrip("\\")
        check_hand(shlex.split(first.replace("'", ""))[1:])


def command_named(names: tuple[str, ...]) -> Any:
    command = PARSER
    for name in names:
        command = command.get_command(typer.Context(command, info_name="hand"), name)
    return command


@pytest.mark.parametrize("module", sorted({line.split()[2] for _, line in all_commands() if line.startswith("python")}))
def test_every_module_of_the_tree_has_an_example(module: str) -> None:
    """Fails when a module that a document runs has no --help, or no example in it."""
    if module.startswith(("validation", "hand_")):
        assert f"python -m {module}" in help_of(module) and "xample" in help_of(module)


def test_the_examples_of_wrong_claims_are_found() -> None:
    """Fails when the checks above pass for a subcommand, option, target or module that does not exist."""
    for check, words in (
        (check_hand, ["diagnoze", "a.mcap"]), (check_hand, ["diagnose", "a.mcap", "--ouput", "x"]),
        (check_make, ["tests"]),
        (check_ros, ["ros2", "run", "fluidic_hand", "drivers"]),
    ):  # fmt: skip
        with pytest.raises(AssertionError):
            check(words)
    with pytest.raises((AssertionError, ModuleNotFoundError)):
        check_module("validation.benches", [])
    assert expanded("a/{b,c}.py") == ["a/b.py", "a/c.py"]
    assert anchors("# A title, with `code`\n") == {"a-title-with-code"}


DURATION = (
    r"(?:about |some |under |below |up to |nearly |more than |less than )?"
    r"(?:(?:an?|half an?|one|two|three|five|some|ten|a few|[\d.]+) (?:minutes?|hours?)"
    r"|(?:a few|half a|[\d.]+) (?:ms|s|milliseconds?|seconds?|min|h))\b"
)
TAKES = re.compile(
    rf"(?<!should )\b(?:takes?|costs?|starts? in|starts? within|in about)\b[^.:;()|]{{0,30}} \(?{DURATION}",
    re.IGNORECASE,
)
BEHIND = re.compile(
    rf"\((?:[^()]*[,;] )?{DURATION}(?: of processor time)?(?:[,;] [^()]*)?\)|(?:,| #) {DURATION}", re.IGNORECASE
)
READ = re.compile("tutorial|ways into the software")
"""How long a text takes to read is not measured."""


GENERATED = re.compile(r"<!-- generated(?![^\n]*: end -->).*?<!-- (?:end|generated by [^\n]*: end) -->", re.DOTALL)
"""A generated section: from `generated: COMMAND` to `end`, or from `generated by COMMAND: begin` to `: end`."""


def passages(text: str) -> Iterator[str]:
    """Lines of code, of tables and of headings, and the sentences of paragraphs and lists, which go over lines."""
    paragraph: list[str] = []
    for line in [*text.splitlines(), ""]:
        alone = re.match(r" {4}|\t|\||#|```", line)
        if paragraph and (alone or not line.strip() or re.match(r"\s*(?:[-*]|\d+\.) ", line)):
            yield from re.split(r"(?<=[.!?]) (?=[A-Z`])", " ".join(paragraph))
            paragraph = []
        if alone:
            yield line
        elif line.strip():
            paragraph.append(line.strip())


def unmeasured(text: str) -> list[str]:
    """Passages that say how long a command takes, or put a time behind a command.

    Measured times are in generated sections, which come from stored results.
    """
    every = [passage for passage in passages(GENERATED.sub("", text)) if not READ.search(passage)]
    return [each for each in every if TAKES.search(each) or (COMMANDS.search(each) and BEHIND.search(each))]


@pytest.mark.parametrize("name", [name for name in NAMES if name != "CHANGELOG.md"] + ["Makefile"])
def test_no_page_says_how_long_a_command_takes_unless_it_is_measured(name: str) -> None:
    """Fails when a page gives a time of a command, of the studio's start or of the demo, that no stored result has."""
    assert unmeasured(text_of(name)) == []


@pytest.mark.parametrize(
    "claim",
    [
        "`make proof` is the blind trial, about an hour.",
        "    hand reproduce --out out/paper    # the figures of the paper, about a minute",
        "`python -m validation.bench --only effects` (prints its seed, 8 minutes) tests each effect.",
        "The studio starts within 8 s.",
        "The demo takes 3.5 minutes on a fresh machine.",
        "`python -m validation.bench --only control` (two minutes; part of `make bench`) prints its seed.",
        "`python -m validation.bench --only control`\n(two minutes) prints its seed.",
        "    make proof                      # under an hour on two cores; CASES=40 for a short run",
        "Nodes do what the first line of a log\ncosts (45 ms) before they move anything.",
        "The first start takes on a small board half a minute.",
    ],
)
def test_a_time_that_is_not_measured_is_found(claim: str) -> None:
    """Fails when the search for times passes over a way in which one could be written."""
    assert unmeasured(claim)


def test_a_time_in_a_generated_section_is_measured() -> None:
    """Fails when a section from stored results counts, or when the text after one of either kind is passed over."""
    for before, after in (("generated: make x", "end"), ("generated by make x: begin", "generated by make x: end")):
        section = f"<!-- {before} -->\nThe demo takes 3 minutes.\n<!-- {after} -->\n"
        assert unmeasured(section) == []
        assert unmeasured(f"{section}The demo takes an hour.\n\n<!-- generated: make y -->\n<!-- end -->\n")


def test_every_folder_of_tests_is_in_the_table() -> None:
    """Fails when a folder of test/ has no row in docs/testing.md, or a row has no folder."""
    table = text_of("docs/testing.md").partition("| remark |")[2].partition("\n\n")[0]
    rows = [row.split("|")[1] for row in table.splitlines() if row.count("|") > 2 and "---" not in row]
    named = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    assert named == {path.name for path in (ROOT / "test").iterdir() if path.is_dir() and path.name[0] not in "._"}
