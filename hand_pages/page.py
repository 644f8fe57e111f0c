"""HTML pages from Jinja2 templates; every value is escaped, a name that a template lacks is an error."""

from __future__ import annotations

import base64
import io
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 110
BREAKS = re.compile(r"(\w[_/.]+)(?=[A-Za-z])")
"""Places within a name, not within a number or a mark of HTML."""


def write_html(path: Path, package: str, template: str, **values: Any) -> None:
    """Write a page. template: file name in a package; it may extend base.html.  values: what the template names.

    Raises jinja2.UndefinedError for a name that is not among the values.
    """
    loader = ChoiceLoader([PackageLoader(package, "."), PackageLoader("hand_pages", ".")])
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["data_uri"] = data_uri
    environment.filters["code"] = code
    environment.filters["breakable"] = breakable
    path.write_text(environment.get_template(template).render(**values), encoding="utf-8")


def png(figure: Figure, dpi: int = DPI) -> bytes:
    """A figure as PNG, at so many dots per inch."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    return buffer.getvalue()


def code(text: str) -> Markup:
    """A text whose parts between backticks are shown as code."""
    return Markup(re.sub(r"`([^`]*)`", r"<code>\1</code>", str(escape(text))))


def breakable(text: object) -> Markup:
    """A text of which a long name may be broken after each part."""
    return Markup(BREAKS.sub("\\1<wbr>", str(escape(text))))


def data_uri(picture: bytes) -> str:
    """A PNG as the address of an image inside the page."""
    return f"data:image/png;base64,{base64.b64encode(picture).decode('ascii')}"
