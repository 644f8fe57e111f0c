"""Commands that need `validation` on a machine where it is not installed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WITHOUT = """
import sys
class Hide:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "validation":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Hide())
from hand_tool.main import main
sys.argv[0] = "hand"
main()
"""


@pytest.mark.parametrize(
    "arguments",
    [
        ("trial", "make", "{tmp}/trial"),
        ("trial", "reality", "{tmp}", "--out", "{tmp}/out"),
        ("trial", "score", str(ROOT), "--key", "x"),
        ("reproduce", "--out", "{tmp}/paper"),
        ("magnet", "--out", "{tmp}/magnet"),
    ],
)
def test_one_line_says_what_to_install(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    """Fails when a command without `validation` ends in a traceback, in another exit code, or without the remedy."""
    filled = [argument.format(tmp=tmp_path) for argument in arguments]
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT, *filled], cwd=ROOT, capture_output=True, text=True, check=False
    )
    lines = done.stderr.strip().splitlines()
    assert done.returncode == 2, done.stderr
    assert len(lines) == 1
    assert lines[0].startswith(f"hand {arguments[0]}")
    assert "validation" in lines[0]
    assert "pip install" in lines[0]
    assert not list(tmp_path.iterdir())
