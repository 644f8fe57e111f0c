"""Two hands are compared in all that hand.yaml can state."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

from hand_diagnosis.pages.hand_entries import OF_WHOLE, WHOLE, entries
from hand_model import description, geometry_description, sensor_description
from hand_model.description import load_hand
from hand_model.kernel.rows import JOINT_PARAMETERS
from test.diagnosis.recordings import CONFIG

GROUPS = {"schema", "joint_defaults", "joints", "force_site_defaults", "force_sites", "palm", "links"}
"""Keys that hold others, or the version of the format."""


def test_no_key_of_the_file_is_left_out() -> None:
    """Fails when hand.yaml can state something that a comparison of two models does not see."""
    keys = {part for _, key in entries(load_hand(CONFIG)) for part in re.split(r"[.\[]", key)}
    known = [*description._TOP, *description._SUPPLY, *description._BOARD, *description._JOINT, *description._LIMITS]
    known += [*sensor_description._HALL, *sensor_description._CALIBRATION, *sensor_description._PRESSURE]
    known += [*sensor_description._SITE, *geometry_description.GEOMETRY, *geometry_description._LINK]
    assert set(known) - GROUPS <= keys, set(known) - GROUPS - keys
    of_joint = {key for part, key in entries(load_hand(CONFIG)) if part == "index_distal"}
    assert {parameter.key for parameter in JOINT_PARAMETERS} - set(OF_WHOLE) <= of_joint


def other_hand() -> dict[str, Any]:
    """The content of hand.yaml with everything changed at the first joint, the first site and the last finger."""
    hand: dict[str, Any] = yaml.safe_load(CONFIG.read_text(encoding="utf-8"))
    hand |= {"name": "other", "joint_prefix": "left_", "fluid": "hydraulic", "valve_kind": "switching"}
    hand["supply"] = {"pressure_pa": 5.9e5, "sensor_voltage_v": 4.9}
    hand["board"] = {"rate_hz": 190, "watchdog_s": 0.11, "adc_bits": 15, "adc_reference_v": 5.0}
    limits = {"low_deg": -9, "high_deg": 99, "max_torque_nm": 0.5}
    hand["joint_defaults"]["limits"]["max_pressure_pa"] = 5.8e5
    angle: dict[str, Any] = {
        "channel": 1,
        "field_t": 0.11,
        "field_max_t": 0.06,
        "zero_deg": 44,
        "third_harmonic": 0.0,
        "noise_v": 0.0,
    }
    angle["calibration"] = {"ratio_at_0_deg": 0.3, "ratio_at_90_deg": 0.7}
    pressure = {"channel": 12, "ratio_at_zero": 0.05, "span_pa": 9e5, "noise_v": 0.0}
    first, second = hand["joints"][:2]
    first |= {"limits": limits, "angle_sensor": angle, "pressure_sensor": pressure}
    second |= {"angle_sensor": {"channel": 0}, "pressure_sensor": {"channel": 11}}
    for joint in hand["joints"][1:3]:
        del joint["coupled_to"], joint["dynamics"]["coupling_inertia_kg_m2"]
    site = {"joint": "thumb_distal", "channel": 23, "lever_arm_m": 0.02, "position_m": [0.02, 0.001, -0.01]}
    site |= {"c0": 5.1, "c1": 0.7, "divider_ohm": 1e4, "threshold_n": 0.2, "noise_v": 0.0}
    hand["force_sites"][0] |= site | {"calibration_log_polynomial": [7.0, -1.0, 0.1, 0.01]}
    hand["force_sites"][1] |= {"channel": 22}
    size = {"length_m": 0.05, "width_m": 0.03, "thickness_m": 0.02, "mass_kg": 0.04}
    hand["geometry"]["palm"] = size
    place = {"parent": "ring_proximal", "origin_m": [0.01, 0.02, 0.03], "rpy_deg": [10, 20, 30], "axis": [0, 0.6, 0.8]}
    hand["geometry"]["links"][-2] |= size | place
    hand["geometry"]["links"][-1]["tip_frame"] = "end"
    return hand


def test_what_differs_is_found_and_what_is_equal_is_not(tmp_path: Path) -> None:
    """Fails when a change of limits, sensors, board, supply or geometry is not seen, or all of a mirrored hand is."""
    (tmp_path / "other.yaml").write_text(yaml.safe_dump(other_hand()), encoding="utf-8")
    both = [entries(load_hand(path)) for path in (CONFIG, tmp_path / "other.yaml")]
    assert both[0].keys() == both[1].keys()
    differ = {key for key in both[0] if both[0][key] != both[1][key]}
    for part, prefix in ((WHOLE, ""), ("thumb_opposition", "limits"), ("thumb_opposition", "angle_sensor")):
        left = {key for key in both[0] if key[0] == part and key[1].startswith(prefix)} - differ
        assert left <= {(WHOLE, "order of the joints")}, left
    for part, prefix in (("thumb_opposition", "pressure_sensor"), ("thumb_proximal_pad", ""), ("palm", "")):
        assert {key for key in both[0] if key[0] == part and key[1].startswith(prefix)} <= differ
    moved = {key for key in both[0] if key[0] == "little_proximal" and key[1].startswith("geometry")}
    assert moved - differ <= {("little_proximal", "geometry.axis.x")}
    assert ("little_distal", "geometry.tip_frame") in differ and ("thumb_proximal", "coupled_to") in differ
    same = {"middle_proximal", "middle_distal", "middle_proximal_pad", "middle_distal_pad"}
    assert {key for key in differ if key[0] in same} == {
        (joint, "limits.max_pressure_pa") for joint in list(same) if "pad" not in joint
    }
