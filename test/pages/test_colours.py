"""The colours of curves on pages and in figures, as readers with the common deficiencies of colour vision see them."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
import pytest

from hand_diagnosis.pages import figures
from test.pages.colour_vision import DEFICIENCIES, LEAST, seen
from validation.paper import drawing

STYLE = (Path(__file__).resolve().parents[2] / "hand_pages" / "style.css").read_text(encoding="utf-8")


def of_page(theme: int) -> dict[str, str]:
    """Colours of curves by name. theme: 0 light, 1 dark, 2 printed."""
    block = STYLE.split(":root{")[theme + 1].partition("}")[0]
    known = dict(re.findall(r"--(\w+):(#\w+)", block))
    full = {
        name: value if len(value) == 7 else "#" + "".join(2 * c for c in value[1:]) for name, value in known.items()
    }
    return {name: full[name] for name in ("ink", "before", "after", "third", "noise")}


PALETTES = {"light": of_page(0), "dark": of_page(1), "print": of_page(2)}
PALETTES["figures"] = {name: getattr(figures, name) for name in ("INK", "BLUE", "ORANGE", "GREY")}
PALETTES["paper"] = {name: getattr(drawing, name) for name in ("INK", "BLUE", "RED", "PURPLE", "GREY")}


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
@pytest.mark.parametrize("name", PALETTES)
def test_curves_can_be_distinguished(name: str, deficiency: str) -> None:
    """Fails when two colours of curves look alike to a reader with a deficiency."""
    palette = {key: seen(colour, DEFICIENCIES[deficiency]) for key, colour in PALETTES[name].items()}
    distances = {
        pair: float(np.linalg.norm(palette[pair[0]] - palette[pair[1]])) for pair in itertools.combinations(palette, 2)
    }
    closest = min(distances, key=lambda pair: distances[pair])
    assert distances[closest] >= LEAST, (closest, distances[closest])


def test_the_simulation_confuses_red_and_green() -> None:
    """Fails when the simulated reader without a kind of cone distinguishes what such readers confuse."""
    red, green = "#a04000", "#6b6b00"
    apart = {name: float(np.linalg.norm(seen(red, m) - seen(green, m))) for name, m in DEFICIENCIES.items()}
    assert apart["protanopia"] < 0.4 * apart["none"] and apart["deuteranopia"] < 0.4 * apart["none"]


def test_every_kind_of_curve_has_a_line_of_its_own() -> None:
    """Fails when two kinds of curves differ by their colour only."""
    kinds = ("before", "third", "quiet")
    dashes = [re.search(rf"path\.{kind}{{stroke-dasharray:([\d. ]+)}}", STYLE) for kind in kinds]
    assert len({match[1] for match in dashes if match}) == len(kinds)
    assert re.search(r"path\.measured{stroke-width:", STYLE)
