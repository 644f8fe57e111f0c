"""The diagnosis as documented: the catalogue's table is current."""

from __future__ import annotations

from pathlib import Path

from hand_model.effects import CATALOGUE, markdown_table

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "diagnosis.md"
NAMES = """
supply_droop valve_lag valve_delay valve_deadband valve_flow_limit valve_hysteresis leak tube_lag gas_compression creep
hysteresis stiffening ageing thermal_drift coulomb_friction viscous_friction backlash end_stop gravity added_inertia
joint_coupling contact constant_load angle_offset angle_gain hall_misalignment angle_lag pressure_offset pressure_gain
fsr_drift fsr_hysteresis fsr_gain clock_offset dropped_frames
"""


def test_the_table_is_current() -> None:
    """Fails when an effect changed and docs/diagnosis.md did not: paste hand_model.effects.markdown_table()."""
    text = DOCUMENT.read_text(encoding="utf-8")
    begin = text.index("\n", text.index("<!-- catalogue: begin")) + 1
    assert text[begin : text.index("<!-- catalogue: end")] == markdown_table()


def test_the_names_are_the_published_ones() -> None:
    """Fails when an effect is renamed, added or lost: the names are part of the interface."""
    assert {effect.name for effect in CATALOGUE} - {"hydraulic", "switching_valve"} == set(NAMES.split())
