"""The numbers in force as report.json lists them, and the settings as the tables of the documents."""

from __future__ import annotations

import math
from dataclasses import asdict, fields
from typing import Any

from hand_diagnosis.settings import SETTINGS, FitPass, Settings
from hand_identification.settings import FITS, IdentificationSettings
from hand_machine.settings import MACHINE, MachineSettings
from hand_recording.settings import READING, ReadingSettings

AnySettings = Settings | IdentificationSettings | ReadingSettings | MachineSettings
IN_FORCE: dict[str, AnySettings] = {
    "settings": SETTINGS,
    "fit_settings": FITS,
    "reading_settings": READING,
    "machine_settings": MACHINE,
}
"""By their keys in report.json."""


def numbers_in_force() -> dict[str, Any]:
    """All numbers on which a diagnosis depends, splits of the data included, by the keys of IN_FORCE."""
    return {key: document(settings) for key, settings in IN_FORCE.items()}


def document(settings: AnySettings) -> dict[str, Any]:
    """Every value by name, as report.json lists it; infinite values as text, JSON has none."""
    return {name: _plain(value) for name, value in asdict(settings).items()}


def _plain(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return "inf" if value == math.inf else value


def markdown_table(settings: AnySettings) -> str:
    """Settings as a Markdown table, one row each."""
    rows = ["| setting | value | unit | meaning | source | halved | doubled |", "|---|---|---|---|---|---|---|"]
    for entry in fields(settings):
        about = entry.metadata
        value = _shown(getattr(settings, entry.name))
        cells = [about[key] for key in ("unit", "meaning", "source", "halved", "doubled")]
        rows.append(f"| `{entry.name}` | {value} | " + " | ".join(cells) + " |")
    return "\n".join(rows) + "\n"


def _shown(value: Any) -> str:
    if isinstance(value, tuple):
        return ", ".join(_shown(item) for item in value)
    if isinstance(value, FitPass):
        return f"({value.most}, {value.iterations}, {value.tolerance:g}, {value.step_s:g})"
    return f"{value:.6g}"
