"""Write the tables of parameters and effects in the documents anew: `python -m hand_model.tables [TREE]`.

docs/model.md holds the parameters, docs/diagnosis.md the catalogue, each between two comments.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from hand_model.effects import markdown_table as effect_table
from hand_model.kernel.rows import markdown_table as parameter_table

TABLES: tuple[tuple[str, str, Callable[[], str]], ...] = (
    ("docs/model.md", "parameters", parameter_table),
    ("docs/diagnosis.md", "catalogue", effect_table),
)
"""Document, name in the comments that enclose the table, and the table."""


def with_table(text: str, name: str, table: str) -> str:
    """A document's text with the table between its comments replaced. Raises ValueError where a comment is missing."""
    begin, end = text.find(f"<!-- {name}: begin"), text.find(f"<!-- {name}: end -->")
    if not 0 <= begin < end:
        raise ValueError(f"the comments '{name}: begin' and '{name}: end' are not there")
    first = text.index("-->\n", begin) + len("-->\n")
    return text[:first] + table + text[end:]


def main(tree: Path) -> None:
    """Write the tables of a source tree."""
    for document, name, table in TABLES:
        path = tree / document
        path.write_text(with_table(path.read_text(encoding="utf-8"), name, table()), encoding="utf-8")
        print(f"{path}: {name}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
