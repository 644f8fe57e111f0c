"""The colours of curves on pages and in figures, as readers with the common deficiencies of colour vision see them."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
import pytest

from hand_diagnosis.pages import figures
from hand_model.arrays import Array
from validation.paper import drawing

STYLE = (Path(__file__).resolve().parents[2] / "hand_pages" / "style.css").read_text(encoding="utf-8")
DEFICIENCIES = {
    "none": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritanopia": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
"""On linear RGB. Machado, Oliveira and Fernandes, A physiologically-based model for simulation of color vision
deficiency, IEEE Trans. Visualization and Computer Graphics 15(6), 2009, severity 1.0."""
XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
WHITE = XYZ.sum(axis=1)
LEAST = 20.0
"""Least distance in CIELAB (CIE 1976); 2 to 3 is just noticeable, and thin lines need many times that."""


def seen(colour: str, deficiency: Array) -> Array:
    """A colour, as #rrggbb, in CIELAB (3,) as it is seen [-]."""
    share = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    ratio = XYZ @ np.clip(deficiency @ linear, 0.0, 1.0) / WHITE
    x, y, z = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3.0 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


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
