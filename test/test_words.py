"""Plain words: no archaic or private expression in documents, docstrings, comments and messages.

The list below is short on purpose. It holds expressions that readers did not understand, each with the words to use
instead. docs/glossary.md holds the terms of the project.
"""

from __future__ import annotations

import ast
import io
import os
import re
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
GENERATED = {"build", "install", "log", "out", "__pycache__"}
TEXTS = {
    ".md",
    ".html",
    ".yaml",
    ".yml",
    ".toml",
    ".cfg",
    ".sh",
    ".bash",
    ".c",
    ".h",
    ".dbc",
    ".msg",
    ".action",
    ".xml",
}
TEXT_FILES = {"Makefile", "Dockerfile", "hand", "run"}


@dataclass(frozen=True, slots=True)
class Word:
    """An expression to avoid. pattern: a blank also stands for a line break.  instead: what to write."""

    pattern: str
    instead: str
    example: str

    def found(self, text: str) -> Iterator[int]:
        """Offsets in a text."""
        expression = re.compile(self.pattern.replace(" ", r"\s+"), re.IGNORECASE)
        return (match.start() for match in expression.finditer(text))


WORDS = (
    Word(r"\bforet(?:ell|old)\w*", "predict", "the span that foretells readings"),
    Word(r"\b(?:tells?|told|telling)\b", "report, give, distinguish, separate", "which tells a leak from a lag"),
    Word(r"\bth(?:at|ey) (?:is|are) none\b", "NaN or infinite values", "numbers that\nare none"),
    Word(
        r"\b(?:is|are) no (?:numbers?|hand|re-run|units?|angles?|physics)\b",
        "is not a ...",
        "a reading that is no number",
    ),
    Word(r"\bfor sure\b", "significantly", "they improve for sure"),
    Word(r"\bsa(?:ys?|id) nothing\b", "give no information", "such a test says nothing"),
    Word(r"\banew\b", "again", "it is fitted anew"),
    Word(r"\bworth (?:a|saying|claiming)\b", "large enough to be reported", "something worth saying"),
    Word(r"\bmend(?:s|ed|ing)?\b", "repair", "a recording that was mended"),
    Word(r"\bjudg(?:es?|ed|ing)\b", "check, evaluate, grade, include", "a joint is not judged"),
    Word(r"\b(?:one|two|value) an? (?:joint|recording|hand|file|effect)\b", "per joint", "one value, or one a joint"),
    Word(r"\bsuperfluous\b", "redundant", "superfluous effects"),
    Word(r"\bpolish\w*", "refit", "the fit is polished"),
    Word(r"\bdoubt\w*", "reset the covariance; may be wrong", "the map is doubted"),
    Word(r"\b(?:feels?|felt)\b", "measure, receive", "what a joint feels"),
    Word(r"\bbeside\b", "next to, compared with, in addition to", "the controller beside a PID"),
    Word(r"\blet go\b", "release", "a joint that is let go"),
    Word(
        r"\b(?:thereof|therein|thereby|whereof|wherein|whereby|whence|hitherto|lest|ere)\b",
        "plain words",
        "lest it moves",
    ),
    Word(r"\bmany terms come near\b", "more parameters fit more residual", "many terms come near anything"),
    Word(r"\b(?:audits?|sub-?agents?)\b|\bissue #?\d", "the reason itself", "as issue 3 asks"),
    Word(r"(?<![\w.~$\]}/])/(?:home|root|work|mnt|Users)/", "a relative path", "see /home/somebody/notes"),
    Word(r"\bhand_ident\b(?!`)", "hand_recording or hand_identification", "import hand_ident"),
)


def files() -> list[Path]:
    """Every text of the tree that people write, this file left out."""
    found = []
    for folder, below, names in os.walk(ROOT):
        below[:] = sorted(name for name in below if not name.startswith(".") and name not in GENERATED)
        found += [Path(folder, name) for name in sorted(names)]
    return [path for path in found if path != Path(__file__).resolve() and readable(path)]


def readable(path: Path) -> bool:
    """Whether a file holds prose: Python, a document, a configuration."""
    return path.suffix in {".py", *TEXTS} or path.name in TEXT_FILES


@cache
def prose() -> list[tuple[Path, int, str]]:
    """Every passage with its file and first line: strings and comments of Python and C, the whole of other files."""
    found = []
    for path in files():
        text = path.read_text(encoding="utf-8")
        parts = (
            passages(text) if path.suffix == ".py" else c_passages(text) if path.suffix in {".c", ".h"} else [(1, text)]
        )
        names = names_of_tests(text) if path.suffix == ".py" else ()
        found += [(path.relative_to(ROOT), line, part) for line, part in (*parts, *names)]
    return found


def names_of_tests(source: str) -> Iterator[tuple[int, str]]:
    """Line and words of the names of test functions, which the report of a test run shows as sentences."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            yield node.lineno, node.name.replace("_", " ")


def passages(source: str) -> Iterator[tuple[int, str]]:
    """Strings of Python source, and its comments with those of successive lines together."""
    comment: list[str] = []
    first = last = 0
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        line = token.start[0]
        if token.type == tokenize.COMMENT:
            if comment and line > last + 1:
                yield first, "\n".join(comment)
                comment = []
            first = first if comment else line
            comment.append(token.string.lstrip("#"))
            last = line
        elif token.type == tokenize.STRING or tokenize.tok_name[token.type] == "FSTRING_MIDDLE":
            yield line, token.string
    if comment:
        yield first, "\n".join(comment)


def c_passages(source: str) -> Iterator[tuple[int, str]]:
    """Comments and strings of C source."""
    for match in re.finditer(r'/\*.*?\*/|//[^\n]*|"[^"\n]*"', source, re.DOTALL):
        yield 1 + source.count("\n", 0, match.start()), match[0]


@pytest.mark.parametrize("word", WORDS, ids=lambda word: word.example)
def test_no_such_expression_in_the_tree(word: Word) -> None:
    """Fails when a document, docstring, comment or message uses an expression of the list."""
    found = [
        f"{path}:{line + text.count(chr(10), 0, start)}: {text[start : start + 50].split(chr(10))[0]}"
        for path, line, text in prose()
        for start in word.found(text)
    ]
    assert not found, f"write instead: {word.instead}\n" + "\n".join(found)


@pytest.mark.parametrize("word", WORDS, ids=lambda word: word.example)
def test_the_search_finds_each_expression(word: Word) -> None:
    """Fails when a pattern no longer matches its example in a document, a docstring, a comment or a message."""
    as_comment = "\n".join(f"# {line}" for line in word.example.split("\n"))
    for source in (f'"""{word.example}"""\n', f"{as_comment}\nx = 1\n", f"print(f'''{word.example} {{1}}''')\n"):
        assert any(any(word.found(text)) for _, text in passages(source)), source


def test_the_search_reads_names_of_tests() -> None:
    """Fails when the name of a test passes with an expression of the list, or that of another function counts."""
    source = "def test_a_joint_is_not_judged(): ...\ndef judged(): ...\n"
    (name,) = names_of_tests(source)
    assert name == (1, "test a joint is not judged") and any(any(word.found(name[1])) for word in WORDS)


def test_names_in_code_are_not_prose() -> None:
    """Fails when the search reads identifiers, so that a function's name counts as a sentence."""
    assert list(passages("anew = judged + told\n")) == []
    assert [text for _, text in c_passages("int doubt; /* felt */ // told\n")] == ["/* felt */", "// told"]


def test_no_loop_variable_is_called_one() -> None:
    """Fails when a loop or comprehension calls its variable `one` and not by the name of the thing."""
    found = [
        f"{path.relative_to(ROOT)}:{target.lineno}"
        for path in files()
        if path.suffix == ".py"
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.For | ast.comprehension)
        for target in ast.walk(node.target)
        if isinstance(target, ast.Name) and target.id == "one"
    ]
    assert found == []


def test_the_search_reads_the_whole_tree() -> None:
    """Fails when a folder of the tree is left out of the search."""
    read = {path.relative_to(ROOT).as_posix() for path in files()}
    assert {"README.md", "CHANGELOG.md", "docs/glossary.md", "config/hand.yaml", "firmware/hand_law.c"} <= read
    assert {"hand_model/__init__.py", "validation/__init__.py", "test/conftest.py", "Makefile"} <= read
