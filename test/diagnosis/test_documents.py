"""The names of the effects as published; test/validation/test_figures.py compares the table of the catalogue."""

from __future__ import annotations

from hand_model.effects import CATALOGUE

NAMES = """
supply_droop valve_lag valve_delay valve_deadband valve_flow_limit valve_hysteresis leak tube_lag gas_compression creep
hysteresis stiffening ageing thermal_drift coulomb_friction viscous_friction backlash end_stop gravity added_inertia
joint_coupling contact constant_load angle_offset angle_gain hall_misalignment angle_lag pressure_offset pressure_gain
fsr_drift fsr_hysteresis fsr_gain clock_offset dropped_frames unnamed_pressure unnamed_torque
directional_friction cogging drive_saturation drive_lag command_delay gear_friction spring drive_gain drive_elasticity
"""


def test_the_names_are_the_published_ones() -> None:
    """Fails when an effect is renamed, added or lost: the names are part of the interface."""
    assert {effect.name for effect in CATALOGUE} - {"hydraulic", "switching_valve"} == set(NAMES.split())
