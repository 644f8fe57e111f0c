"""Calibrations of sensors as a hand's description holds them: the line of an angle, the polynomial of a force."""

from __future__ import annotations

from collections.abc import MutableMapping, Sequence
from pathlib import Path
from typing import Any

from hand_model.description import load_hand
from hand_model.yaml_document import YamlDocument, number_text

RATIO = 1e-5
"""Resolution of a ratio of a voltage to the supply; a converter of 16 bits has 1.5e-5."""
COEFFICIENT = 1e-5
"""Relative resolution of a coefficient of the polynomial."""
LINE = ("ratio_at_0_deg", "ratio_at_90_deg")
POLYNOMIAL = "calibration_log_polynomial"


def line_texts(volts: Sequence[float], supply_v: float) -> dict[str, str]:
    """The numbers of `angle_sensor.calibration` by key; volts: at 0 and 90 degrees [V].

    Raises ValueError, one line, for voltages beyond the supply: the line was found in too small a part of the range.
    """
    texts = {}
    for key, voltage in zip(LINE, volts, strict=True):
        if not 0.0 <= voltage <= supply_v:
            raise ValueError(
                f"{key}: the line gives {voltage:.3g} V; the allowed range is 0 to {supply_v:g} V, the supply. Measure"
                " nearer to 0 and 90 degrees, or state the supply by --supply-v"
            )
        texts[key] = number_text(voltage / supply_v, RATIO)
    return texts


def polynomial_texts(coefficients: Sequence[float]) -> list[str]:
    """The numbers of `calibration_log_polynomial`: log10 F as a polynomial of log10 R_S, constant first."""
    return [number_text(value, COEFFICIENT * abs(value)) for value in coefficients]


def write_line(model: Path, joint: str, texts: dict[str, str], out: Path, comment: str) -> None:
    """Write the description `model` with the line of a joint (with its prefix) to `out`, and load it.

    Raises DescriptionError where it does not load, ValueError for a joint that is not there.
    """
    document = YamlDocument(model)
    sensor = document.group(_entry(document, model, "joints", "--joint", joint), "angle_sensor", 1)
    calibration = document.group(sensor, "calibration", len(texts))
    for key, text in texts.items():
        document.set_number(calibration, key, text)
    _save(document, out, comment)


def write_polynomial(model: Path, site: str, texts: Sequence[str], divider_ohm: float, out: Path, comment: str) -> None:
    """Write the description `model` with the polynomial and the divider [ohm] of a force site to `out`, and load it.

    Raises DescriptionError where it does not load, ValueError for a site that is not there.
    """
    document = YamlDocument(model)
    entry = _entry(document, model, "force_sites", "--site", site)
    document.set_numbers(entry, POLYNOMIAL, texts)
    described = document.data.get("force_site_defaults", {}) | entry
    if float(described.get("divider_ohm", 0.0)) != divider_ohm:
        document.set_number(entry, "divider_ohm", number_text(divider_ohm))
    _save(document, out, comment)


def _entry(document: YamlDocument, model: Path, section: str, option: str, name: str) -> MutableMapping[str, Any]:
    """The entry of a section of the description that has this name (with its prefix)."""
    prefix = load_hand(model).prefix
    entries: dict[str, MutableMapping[str, Any]] = {
        prefix + str(entry["name"]): entry for entry in document.data.get(section, [])
    }
    if name not in entries:
        raise ValueError(f"{model}: {option} is {name!r}; the description has: {', '.join(entries) or 'none'}")
    return entries[name]


def _save(document: YamlDocument, out: Path, comment: str) -> None:
    out.write_text(document.text(comment), encoding="utf-8")
    load_hand(out)
