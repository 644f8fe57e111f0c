"""The reproduction as one self-contained page and as PNGs."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from validation.paper.result import Quantity, Reproduction


def png(result: Reproduction) -> bytes:
    """The figure as PNG."""
    buffer = io.BytesIO()
    result.figure.savefig(buffer, format="png", dpi=130)
    return buffer.getvalue()


def write_page(results: Sequence[tuple[Reproduction, bytes]], path: Path) -> None:
    """The page: per figure a heading, the picture, three sentences and its numbers."""
    template = files("validation.paper").joinpath("page.html").read_text(encoding="utf-8")
    contents = "".join(f'<li><a href="#{r.id}">{html.escape(r.title)}</a></li>' for r, _ in results)
    body = "".join(_section(result, picture) for result, picture in results)
    path.write_text(template.replace("<!--contents-->", contents).replace("<!--body-->", body), encoding="utf-8")


def _section(result: Reproduction, picture: bytes) -> str:
    data = base64.b64encode(picture).decode("ascii")
    rows = "".join(_row(quantity) for quantity in result.quantities)
    differs = f"<p><b>Where they differ.</b> {html.escape(result.differs)}</p>" if result.differs else ""
    return (
        f'<section id="{result.id}"><h2>{html.escape(result.title)}</h2>'
        f'<img alt="{html.escape(result.title)}" src="data:image/png;base64,{data}">'
        f"<p><b>The paper.</b> {html.escape(result.shows)}</p><p><b>Ours.</b> {html.escape(result.gets)}</p>{differs}"
        "<table><tr><th>quantity</th><th>paper</th><th>ours</th><th>unit</th><th>note</th></tr>"
        f"{rows}</table></section>"
    )


def _row(quantity: Quantity) -> str:
    paper = "&ndash;" if quantity.paper is None else f"{quantity.paper:.4g}"
    cells = (
        html.escape(quantity.quantity),
        paper,
        f"{quantity.ours:.4g}",
        html.escape(quantity.unit),
        html.escape(quantity.note),
    )
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"
