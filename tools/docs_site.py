"""A hook of mkdocs: links of the documents to files outside docs/ become the names of these files."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
OUTSIDE = re.compile(r"\[(?P<text>[^\]]+)\]\(\.\./(?P<path>[^)#\s]+)[^)]*\)")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The text of a page with such links as text. Raises FileNotFoundError for one that leads nowhere."""

    def named(link: re.Match[str]) -> str:
        if not (ROOT / link["path"]).exists():
            raise FileNotFoundError(f"a document links to {link['path']}, which does not exist")
        return f"{link['text']} (`{link['path']}`)"

    return OUTSIDE.sub(named, markdown)
