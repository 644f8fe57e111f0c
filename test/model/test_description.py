"""The description of the hand: what it reads and how it refuses."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hand_model.description import DescriptionError, load_hand
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW

NEW_KEY = ("schema: 1\n", "schema: 1\nstray: 1\n")
# (what is changed) -> what the one line must say: where, what stands there, what is allowed.
BAD = {
    "misspelt key": (("rate_hz: 200", "rat_hz: 200"), "board.rat_hz", "did you mean rate_hz?"),
    "another unit": (("{low_deg: -10", "{low_rad: -0.2"), "joint_defaults.limits.low_rad", "did you mean low_deg?"),
    "a multiple unit": (("dead_time_s: 0.005", "dead_time_ms: 5"), "valve.dead_time_ms", "did you mean dead_time_s?"),
    "misspelt group": (("  valve: {", "  valves: {"), "joint_defaults.valves", "did you mean valve?"),
    "stray key": (NEW_KEY, "stray is not a known key", "known here: schema, name"),
    "missing key": (("watchdog_s: 0.1", ""), "board.watchdog_s is missing", "a number from 0.005 to 1"),
    "missing group": (("{channel: 0}\n    pressure_sensor: {channel: 11}", "{channel: 0}"), "channel is missing"),
    "missing schema": (("schema: 1\n", ""), "schema is missing", "it must be 1"),
    "another schema": (("schema: 1\n", "schema: 2\n"), "schema is 2", "it must be 1"),
    "too large": (("time_constant_s: 0.05", "time_constant_s: 50"), "time_constant_s is 50", "0.001 to 2"),
    "wrong sign": (("a1_nm_per_rad: -0.0573", "a1_nm_per_rad: 0.0573"), "a1_nm_per_rad is 0.0573", "-10 to -1e-06"),
    "nan": (("a0_nm: -0.010", "a0_nm: .nan"), "a0_nm is nan", "-5 to 5"),
    "inf": (("a0_nm: -0.010", "a0_nm: -.inf"), "a0_nm is -inf", "-5 to 5"),
    "text": (("a0_nm: -0.010", "a0_nm: ten"), "a0_nm is 'ten'", "a number from -5 to 5"),
    "nan as text": (("a0_nm: -0.010", "a0_nm: nan"), "a0_nm is 'nan'", "a number from -5 to 5"),
    "with its unit": (("a0_nm: -0.010", "a0_nm: 5 mNm"), "a0_nm is '5 mNm'", "a number from -5 to 5"),
    "quoted": (("rate_hz: 200", 'rate_hz: "200"'), "board.rate_hz is '200'", "a number from 20 to 2000"),
    "base 60": (("rate_hz: 200", "rate_hz: 3:20"), "board.rate_hz is '3:20'", "a number from 20 to 2000"),
    "yes": (("rate_hz: 200", "rate_hz: yes"), "board.rate_hz is 'yes'", "a number from 20 to 2000"),
    "true": (("rate_hz: 200", "rate_hz: true"), "board.rate_hz is True", "a number from 20 to 2000"),
    "nothing": (("rate_hz: 200", "rate_hz:"), "board.rate_hz is nothing", "a number from 20 to 2000"),
    "list": (("rate_hz: 200", "rate_hz: [200]"), "board.rate_hz is [200]", "a number from 20 to 2000"),
    "huge": (("rate_hz: 200", f"rate_hz: {'9' * 400}"), "board.rate_hz is 999", "20 to 2000"),
    "beyond int": (("rate_hz: 200", f"rate_hz: {'9' * 5000}"), "is not YAML", "4300 digits"),
    "not whole": (("adc_bits: 16", "adc_bits: 16.0"), "board.adc_bits is 16.0", "a whole number from 8 to 16"),
    "duplicate key": (("rate_hz: 200", "rate_hz: 200\n  rate_hz: 300"), "line 17", "'rate_hz' is there twice"),
    "number as key": (("schema: 1\n", "schema: 1\n5: 1\n"), "line 5", "a key must be text"),
    "list as key": (("schema: 1\n", "schema: 1\n? [a]\n: 1\n"), "line 5", "a key must be text"),
    "list for a mapping": (
        ("supply:\n  pressure_pa: 6.0e+5\n  sensor_voltage_v: 5.0", "supply: [6.0e+5]"),
        "supply is [600000.0]",
        "it must be a mapping",
    ),
    "text for a mapping": (("angle_sensor: {channel: 0}", "angle_sensor: x"), "angle_sensor is 'x'", "a mapping"),
    "null joint": (("  - name: thumb_opp", "  -\n  - name: thumb_opp"), "joints[0] is nothing", "it must be a mapping"),
    "unnamed joint": (
        ("  - name: thumb_opposition\n    dyn", "  - dyn"),
        "joints[0].name is missing",
        "it must be a name",
    ),
    "name with a space": (("name: thumb_opposition", "name: the thumb"), "name is 'the thumb'", "letters, digits"),
    "number as a name": (("name: thumb_opposition", "name: 5"), "joints[0].name is 5", "letters, digits"),
    "joint twice": (("name: thumb_distal", "name: thumb_proximal"), "name is 'thumb_proximal'", "there twice"),
    "site twice": (("{name: palm_pad", "{name: thumb_distal_pad"), "name is 'thumb_distal_pad'", "there twice"),
    "unknown partner": (("coupled_to: thumb_distal", "coupled_to: thumb_tip"), "'thumb_tip'", "thumb_distal, index_"),
    "itself as partner": (("coupled_to: thumb_distal", "coupled_to: thumb_proximal"), "'thumb_proximal'", "one of"),
    "one-sided partner": (("coupled_to: thumb_distal", "coupled_to: index_distal"), "'index_distal'", "must name"),
    "two inertias": (("coupling_inertia_kg_m2: 4.0e-5", "coupling_inertia_kg_m2: 3e-5"), "3e-05", "which is 4e-05"),
    "lonely inertia": (
        ("viscous_friction_nm_s_per_rad: 8.0e-3}", "coupling_inertia_kg_m2: 1e-5}"),
        "thumb_opposition].dynamics.coupling_inertia_kg_m2 is 1e-05",
        "must be 0",
    ),
    "unknown joint of a site": (("palm_pad, channel", "palm_pad, joint: palm, channel"), "joint is 'palm'", "one of"),
    "channel twice": (("channel: 32}", "channel: 31}"), "channel is 31", "each of 0 to 32 is for one"),
    "channel gap": (("channel: 32}", "channel: 33}"), "palm_pad].channel is 33", "0 to 32"),
    "limits crossed": (("{low_deg: -10", "{low_deg: 100"), "limits.low_deg is 100", "must be below high_deg"),
    "stops crossed": (("    low_deg: -10", "    low_deg: 100"), "end_stop.low_deg is 100", "must be below high_deg"),
    "beyond supply": (("max_pressure_pa: 6.0e+5", "max_pressure_pa: 7e5"), "max_pressure_pa is 700000.0", "to 600000"),
    "no leverage": (("a3_nm_per_pa_rad: -5.6e-7", "a3_nm_per_pa_rad: -8e-7"), "high_deg is 100", "80.21"),
    "unstable": (
        ("a3_nm_per_pa_rad: -5.6e-7", "a3_nm_per_pa_rad: 1e-7"),
        "a3_nm_per_pa_rad is 1e-07",
        "below 9.55e-08",
    ),
    "ill-posed creep": (("b0_per_pa: 2.2222222222222222e-6", "b0_per_pa: 1e-6"), "b0_per_pa is 1e-06", "at least"),
    "creep beyond 1": (("b1_per_pa: 1.8181818181818182e-6", "b1_per_pa: 2e-6"), "b1_per_pa is 2e-06", "1.81818e-06"),
    "too fast to integrate": (
        ("viscous_friction_nm_s_per_rad: 4.0e-3", "viscous_friction_nm_s_per_rad: 0.1"),
        "joint_defaults.dynamics.inertia_kg_m2 is 3e-05",
        "at least 3.73e-05",
    ),
    "slow board": (("rate_hz: 200", "rate_hz: 2"), "board.rate_hz is 2", "the allowed range is 20 to 2000"),
    "short lifetime": (("watchdog_s: 0.1", "watchdog_s: 0.005"), "board.watchdog_s is 0.005", "at least 0.015 s"),
    "limits in radians": (
        ("limits: {low_deg: -10, high_deg: 100", "limits: {low_deg: -0.175, high_deg: 1.745"),
        "joint_defaults.limits.high_deg is 1.745",
        "at least 10 degrees above low_deg, -0.175; are these limits in radians?",
    ),
    "no travel": (("{low_deg: -10", "{low_deg: 91"), "limits.high_deg is 100", "at least 10 degrees above low_deg, 91"),
    "stop below the limit": (
        ("    low_deg: -10\n    high_deg: 100", "    low_deg: -10\n    high_deg: 70"),
        "limits.high_deg is 100",
        "at most 75: the end stop begins at 70",
    ),
    "stop above the limit": (
        ("    low_deg: -10\n    high_deg: 100", "    low_deg: 0\n    high_deg: 100"),
        "limits.low_deg is -10",
        "at least -5: the end stop begins at 0",
    ),
    "heavy joint": (("inertia_kg_m2: 1.2e-4", "inertia_kg_m2: 1.0"), "inertia_kg_m2 is 1", "range is 1e-07 to 0.05"),
    "no friction": (
        ("viscous_friction_nm_s_per_rad: 4.0e-3", "viscous_friction_nm_s_per_rad: 0"),
        "dynamics.viscous_friction_nm_s_per_rad is 0",
        "at least 2.6e-06",
    ),
    "short span": (
        ("span_pa: 8.75e+5", "span_pa: 5e5"),
        "joint_defaults.pressure_sensor.span_pa is 500000",
        "at least 6.667e+05: the sensor ends at 4.5e+05 Pa, the supply is 600000 Pa",
    ),
    "high zero": (("ratio_at_zero: 0.1", "ratio_at_zero: 0.5"), "span_pa is 875000", "at least 1.2e+06"),
    "low reference": (("adc_reference_v: 5.12", "adc_reference_v: 3.0"), "span_pa is 875000", "at least 1.2e+06"),
    "flat calibration": (
        ("noise_v: 3.0e-4", "noise_v: 0\n    calibration: {ratio_at_0_deg: 0.5, ratio_at_90_deg: 0.5}"),
        "ratio_at_90_deg is 0.5",
        "by 0.01 or more",
    ),
    "short polynomial": (
        ("lever_arm_m: 0.025", "lever_arm_m: 0.025\n  calibration_log_polynomial: [1, 2, .nan, 0]"),
        "calibration_log_polynomial is [1, 2, nan, 0]",
        "a list of 4 numbers",
    ),
}


@pytest.mark.parametrize("case", BAD.values(), ids=BAD)
def test_bad_input_is_one_clear_line(case: tuple[Any, ...], variant: Any) -> None:
    """Broken by an error that is no DescriptionError, spans lines, or does not name file, key, value or range."""
    change, *parts = case
    path = variant(change)
    with pytest.raises(DescriptionError) as caught:
        load_hand(path)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{path}: ")
    for part in parts:
        assert part in message


BROKEN = {
    "empty": (b"", "is empty"),
    "comments only": (b"# nothing\n", "is empty"),
    "UTF-16": ("schema: 1".encode("utf-16"), "is not UTF-8 text"),
    "control characters": (b"\x00\x01", "is not YAML"),
    "open bracket": (b"a: [1, 2\nb: }", "line 2"),
    "tab": (b"a:\n\t- b", "line 2"),
    "a list": (b"- 1\n", "the file is [1]; it must be a mapping"),
    "a word": (b"hello", "the file is 'hello'; it must be a mapping"),
    "two documents": (b"a: 1\n---\nb: 2", "line 2"),
    "recursion": (b"a: &a [*a]", "line 1"),
    "depth": (b"[" * 5000, "is not YAML"),
    "a Python object": (b'a: !!python/object/apply:os.system ["true"]', "line 1"),
}


@pytest.mark.parametrize("case", BROKEN.values(), ids=BROKEN)
def test_broken_file_is_one_clear_line(case: tuple[bytes, str], tmp_path: Path) -> None:
    """Broken by any other exception for a file that is no description at all."""
    path = tmp_path / "hand.yaml"
    path.write_bytes(case[0])
    with pytest.raises(DescriptionError) as caught:
        load_hand(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert case[1] in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("watchdog_s: 0.1", "watchdog_s: 0.015"),
        ("rate_hz: 200", "rate_hz: 30"),
        ("    low_deg: -10\n    high_deg: 100", "    low_deg: -5\n    high_deg: 95"),
        ("limits: {low_deg: -10, high_deg: 100", "limits: {low_deg: 0, high_deg: 10"),
        ("span_pa: 8.75e+5", "span_pa: 6.67e5"),
        ("inertia_kg_m2: 1.2e-4", "inertia_kg_m2: 0.05"),
        ("dynamics: {inertia_kg_m2: 3.0e-5, viscous_friction_nm_s_per_rad: 4.0e-3}",
         "dynamics: {inertia_kg_m2: 3.0e-5, viscous_friction_nm_s_per_rad: 0}\n  coulomb_friction: {torque_nm: 0.01}"),
    ],
)  # fmt: skip
def test_values_at_the_bounds_are_accepted(old: str, new: str, variant: Any) -> None:
    """Broken by a relation between values that refuses what it states as allowed."""
    assert load_hand(variant((old, new))).valve_count == 11


FLOODS = {
    "keys": b"".join(b"key_%d: 1\n" % k for k in range(60_000)),
    "short keys": b"".join(b"%x: 1\n" % k for k in range(100_000)),
    "one list": b"a: [" + b"1," * 200_000 + b"1]",
    "nested": b"a: " + b"{b: [" * 20 + b"1" + b"]}" * 20 + b"\nc: [" + b"[]," * 100_000 + b"1]",
}


@pytest.mark.parametrize("content", FLOODS.values(), ids=FLOODS)
def test_a_file_of_many_keys_is_refused_before_most_of_it_is_parsed(content: bytes, tmp_path: Path) -> None:
    """Broken by a parser that builds all nodes of a file: 200,000 keys take 20 s of the processor."""
    path = tmp_path / "hand.yaml"
    path.write_bytes(content)
    begun = time.process_time()
    with pytest.raises(DescriptionError, match="more than 40000 keys and values; at most so many are allowed"):
        load_hand(path)
    assert time.process_time() - begun < 8.0


def test_a_large_file_is_refused_unread(tmp_path: Path) -> None:
    """Broken by reading a file of any size into memory."""
    path = tmp_path / "hand.yaml"
    path.write_bytes(b"".join(b"key_%d: 1\n" % k for k in range(200_000)))
    begun = time.process_time()
    with pytest.raises(DescriptionError, match="is larger than 1000000 bytes, the largest file that is read"):
        load_hand(path)
    assert time.process_time() - begun < 0.2


def test_missing_file_and_directory(tmp_path: Path) -> None:
    """Broken by a traceback of open() where the path leads nowhere or to a folder."""
    with pytest.raises(DescriptionError, match=r"none\.yaml: cannot be read: No such file"):
        load_hand(tmp_path / "none.yaml")
    with pytest.raises(DescriptionError, match=r"cannot be read: Is a directory"):
        load_hand(tmp_path)


def test_list_without_entries(variant: Any) -> None:
    """Broken by a hand without joints or sites that fails later, elsewhere."""
    path = variant()
    head, _, _ = path.read_text(encoding="utf-8").partition("force_sites:\n")
    path.write_text(head + "force_sites: []\n", encoding="utf-8")
    with pytest.raises(DescriptionError, match=r"force_sites is \[\]; it must be a list with at least one entry"):
        load_hand(path)


@pytest.mark.parametrize("text", ["8e5", "8.0e5", "800000", "8E+5", "+8.e5", "0800000"])
def test_numbers_as_people_write_them(text: str, variant: Any) -> None:
    """Broken by YAML 1.1 rules, under which 8e5 is text and 0800000 octal."""
    hand = load_hand(variant(("span_pa: 8.75e+5", f"span_pa: {text}")))
    assert hand.sensors.pressure.ratio_per_pa[0] == 1.0 / 8e5


def test_joint_overrides_defaults_key_by_key(variant: Any) -> None:
    """Broken by a group of a joint that replaces the default group, or a default that wins over the joint."""
    hand = load_hand(
        variant(
            ("    dynamics: {inertia_kg_m2: 1.2e-4", "    statics: {a0_nm: 0.5}\n    dynamics: {inertia_kg_m2: 1.2e-4")
        )
    )
    assert hand.row("statics.a0_nm")[:2].tolist() == [0.5, -0.01]
    assert hand.row("statics.a2_nm_per_pa")[0] == 1.12e-6
    assert hand.row("dynamics.inertia_kg_m2")[[0, 2]].tolist() == [1.2e-4, 3e-5]


def test_error_names_the_place_of_the_value(variant: Any) -> None:
    """Broken by blaming joint_defaults for a joint's own value."""
    with pytest.raises(DescriptionError, match=r"joints\[thumb_opposition\]\.dynamics\.inertia_kg_m2 is 7"):
        load_hand(variant(("dynamics: {inertia_kg_m2: 1.2e-4", "dynamics: {inertia_kg_m2: 7")))


def test_units_become_si(variant: Any) -> None:
    """Broken by degrees that reach an array."""
    hand = load_hand(variant(("phi_max_deg: 60", "phi_max_deg: 90")))
    assert hand.row("material.phi_max_deg")[0] == pytest.approx(math.pi / 2)
    assert hand.limits.high_rad[0] == pytest.approx(math.radians(100))
    assert hand.sensors.hall.zero_rad[0] == pytest.approx(math.pi / 4)


def test_optional_groups_default_to_neutral(variant: Any) -> None:
    """Broken by an effect that acts although the file leaves it out, or a parameter that silently defaults."""
    hand = load_hand(variant())
    for parameter in JOINT_PARAMETERS:
        if parameter.key.split(".")[0] in ("contact", "constant_load"):
            assert parameter.neutral is not None
            np.testing.assert_allclose(hand.row(parameter.key), parameter.neutral * parameter.scale)
    assert ROW["constant_load.torque_nm"] != ROW["contact.angle_deg"]


def test_prefix_is_on_joints_and_sites(variant: Any) -> None:
    """Broken by a prefix that reaches some names only."""
    hand = load_hand(variant(('joint_prefix: ""', "joint_prefix: left_")))
    assert len(hand.joints) == hand.valve_count == 11
    assert all(name.startswith("left_") for name in (*hand.joints, *hand.sensors.sites))


def test_shipped_hand_is_the_published_one(hand: Any) -> None:
    """Broken by a change of joint order, channels or coupling in config/hand.yaml: bags and boards depend on it."""
    fingers = [
        f"{finger}_{place}" for finger in ("index", "middle", "ring", "little") for place in ("proximal", "distal")
    ]
    assert hand.joints == ("thumb_opposition", "thumb_proximal", "thumb_distal", *fingers)
    assert hand.sensors.angle_channel.tolist() == list(range(11))
    assert hand.sensors.pressure_channel.tolist() == list(range(11, 22))
    assert hand.sensors.force_channel.tolist() == list(range(22, 33))
    assert hand.partner.tolist() == [-1, 2, 1, 4, 3, 6, 5, 8, 7, 10, 9]
    assert hand.sensors.sites[-1] == "palm_pad"
    assert hand.sensors.site_joint.tolist() == [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, -1]
