"""Update the tables of parameters and effects in the documents: `python -m hand_model.tables [TREE]`.

docs/model.md holds the parameters, docs/diagnosis.md the catalogue, and docs/effects.md the classes, each between the
comments of a generated section.
`python -m validation.figures` writes them too, with all other sections.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from pathlib import Path

from hand_model.effects import class_table
from hand_model.effects import markdown_table as effect_table
from hand_model.kernel.rows import markdown_table as parameter_table

TABLES: tuple[tuple[str, str, Callable[[], str]], ...] = (
    ("docs/model.md", "parameters", parameter_table),
    ("docs/diagnosis.md", "catalogue", effect_table),
    ("docs/effects.md", "classes", class_table),
)
"""Document, name of the section, and the table."""


def with_table(text: str, name: str, table: str) -> str:
    """A document's text with the table of a section replaced. Raises ValueError where the section is missing."""
    begin = f"<!-- generated: python -m hand_model.tables # {name} -->"
    section = re.compile(rf"{re.escape(begin)}.*?<!-- end -->", re.DOTALL)
    if section.search(text) is None:
        raise ValueError(f"there is no section between {begin!r} and '<!-- end -->'")
    return section.sub(lambda _: f"{begin}\n\n{table.strip()}\n\n<!-- end -->", text)


def main(tree: Path) -> None:
    """Write the tables of a source tree."""
    for document, name, table in TABLES:
        path = tree / document
        path.write_text(with_table(path.read_text(encoding="utf-8"), name, table()), encoding="utf-8")
        print(f"{path}: {name}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="python -m hand_model.tables",
        description="Update the tables of parameters and effects in the documents.",
        epilog="Example: python -m hand_model.tables",
    )
    parser.add_argument("tree", nargs="?", type=Path, default=Path(), help="source tree; default: this folder")
    main(parser.parse_args().tree)
