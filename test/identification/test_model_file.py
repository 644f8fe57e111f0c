"""Patched descriptions: a user's comments and order stay, and what is written is what is read back."""

from __future__ import annotations

import difflib
from pathlib import Path

import numpy as np
import pytest

from hand_identification.model_file import write_model
from hand_model.description import load_hand
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_model.yaml_document import YamlDocument, number_text, yaml_text
from hand_model.yaml_loader import load_yaml

CONFIG = Path(__file__).parents[2] / "config" / "hand.yaml"
INERTIA = "dynamics.inertia_kg_m2"
THUMB = "inertia_kg_m2: 1.2e-4, viscous_friction_nm_s_per_rad: 8.0e-3"
CHANGES = {
    "index_distal": {INERTIA: 4.2168e-5, "statics.a0_nm": -0.0123456, "coulomb_friction.torque_nm": 0.012071},
    "thumb_proximal": {"dynamics.coupling_inertia_kg_m2": 4.4e-5},
}
RESOLUTIONS = {"index_distal": {INERTIA: 3e-7, "statics.a0_nm": 2e-4, "coulomb_friction.torque_nm": 4e-4}}


@pytest.mark.parametrize("path", sorted(CONFIG.parent.glob("*.yaml")), ids=lambda path: path.name)
def test_a_file_that_is_not_changed_is_written_byte_for_byte(path: Path) -> None:
    """Fails when reading and writing a file loses a comment, its order, a quote or the format of a number."""
    assert YamlDocument(path).text() == path.read_text(encoding="utf-8")


def test_a_patch_touches_only_the_lines_of_changed_numbers(tmp_path: Path) -> None:
    """Fails when a patched model loses comments or order, reformats other lines, or writes unjustified digits."""
    out = tmp_path / "model.yaml"
    write_model(load_hand(CONFIG), CHANGES, out, "first line\nsecond line", resolutions=RESOLUTIONS)
    before, after = (path.read_text(encoding="utf-8").splitlines() for path in (CONFIG, out))
    assert after[:2] == ["# first line", "# second line"]
    changed = [line for line in difflib.ndiff(before, after[2:]) if line[0] in "+-"]
    assert sorted(changed) == sorted(
        [
            "-     dynamics: {coupling_inertia_kg_m2: 4.0e-5}",
            "+     dynamics: {coupling_inertia_kg_m2: 4.0e-5, inertia_kg_m2: 4.217e-5}",
            "+     statics: {a0_nm: -0.01235}",
            "+     coulomb_friction: {torque_nm: 0.01207}",
            f"-     dynamics: {{{THUMB}, coupling_inertia_kg_m2: 4.0e-5}}",
            f"+     dynamics: {{{THUMB}, coupling_inertia_kg_m2: 4.4e-5}}",
            "-     dynamics: {coupling_inertia_kg_m2: 4.0e-5}",
            "+     dynamics: {coupling_inertia_kg_m2: 4.4e-5}",
        ]
    )


def test_reading_back_gives_the_same_description(tmp_path: Path) -> None:
    """Fails when a written number is another one after reading, or another number changed with it."""
    hand = load_hand(CONFIG)
    patched = write_model(hand, CHANGES, tmp_path / "model.yaml", "a test", resolutions=RESOLUTIONS)
    expected = hand.parameters.copy()
    j, thumb = hand.joints.index("index_distal"), hand.joints.index("thumb_proximal")
    for key, value in CHANGES["index_distal"].items():
        expected[ROW[key], j] = value
        step = 0.1 * RESOLUTIONS["index_distal"][key]
        assert abs(patched.parameters[ROW[key], j] - value) <= 0.5 * step * (1 + 1e-9), key
    expected[ROW["dynamics.coupling_inertia_kg_m2"], [thumb, hand.partner[thumb]]] = 4.4e-5
    assert np.array_equal(patched.parameters[:, thumb], expected[:, thumb])
    differs = np.argwhere(patched.parameters != hand.parameters)
    assert len(differs) == 5
    again = write_model(patched, {}, tmp_path / "again.yaml", "")
    assert (tmp_path / "again.yaml").read_bytes() == (tmp_path / "model.yaml").read_bytes()
    assert np.array_equal(again.parameters, patched.parameters)


@pytest.mark.parametrize("p_min_pa", [1.234567e4, 4.99999e4, 9e4])
def test_creep_stays_within_its_limits_when_rounded(tmp_path: Path, p_min_pa: float) -> None:
    """Fails when rounding makes the creeping ratio pass 1, or the written creep another one than was identified."""
    hand = load_hand(CONFIG)
    j = hand.joints.index("ring_distal")
    changes = {"ring_distal": {"material.p_min_pa": p_min_pa, "material.b0_per_pa": 1.8181818e-6}}
    coarse = {"ring_distal": {"material.p_min_pa": 7e3, "material.b0_per_pa": 3e-7}}
    patched = write_model(hand, changes, tmp_path / "model.yaml", "", resolutions=coarse)
    b0, b1 = (patched.row(f"material.{name}_per_pa")[j] for name in ("b0", "b1"))
    span = patched.row("supply.pressure_pa")[j] - patched.row("material.p_min_pa")[j]
    assert b1 * span <= 1.0
    assert b0 >= b1
    product = patched.row("material.phi_max_deg")[j] * b1
    assert product == pytest.approx(hand.row("material.phi_max_deg")[j] * hand.row("material.b1_per_pa")[j], rel=3e-8)


def test_a_new_group_stands_before_the_comment_on_the_next_entry(tmp_path: Path) -> None:
    """Fails when a new group separates a comment from the entry that it is about."""
    lines = CONFIG.read_text(encoding="utf-8").splitlines(keepends=True)
    at = next(k for k, line in enumerate(lines) if "name: thumb_distal" in line)
    own = tmp_path / "own.yaml"
    own.write_text("".join([*lines[:at], "  # the tip\n", *lines[at:]]), encoding="utf-8")
    changes = {"thumb_proximal": {"coulomb_friction.torque_nm": 0.02}}
    write_model(load_hand(own), changes, tmp_path / "model.yaml", "")
    text = (tmp_path / "model.yaml").read_text(encoding="utf-8")
    assert "  # the tip\n  - name: thumb_distal\n" in text
    assert text.index("coulomb_friction") < text.index("# the tip")


@pytest.mark.parametrize(
    ("value", "resolution", "text"),
    [
        (0.0123456789, 4e-4, "0.01235"),
        (1.8181818e-6, 3e-8, "1.818e-6"),
        (3e-5, float("nan"), "3.0e-5"),
        (123456.789, 10.0, "123457.0"),
        (0.012345678901, float("nan"), "0.0123457"),
        (-5.0, 100.0, "-5.0"),
        (0.0, 1.0, "0.0"),
    ],
)
def test_numbers_have_the_digits_that_their_resolution_justifies(value: float, resolution: float, text: str) -> None:
    """Fails when a number is written with fewer digits than its resolution needs, or with many more."""
    assert number_text(value, resolution) == text


def test_written_numbers_read_back_as_numbers(tmp_path: Path) -> None:
    """Fails when a text that number_text or yaml_text writes is read as anything but that very number."""
    print("seed 7")
    values = [float(x) for x in np.random.default_rng(7).lognormal(0.0, 12.0, 300)] + [0.0, 1e16, 5e-324, 1e22]
    path = tmp_path / "numbers.yaml"
    path.write_text(yaml_text({"values": values}), encoding="utf-8")
    assert load_yaml(path)["values"] == values
    for value in values[:300]:
        assert float(number_text(value)) == pytest.approx(value, rel=5.1e-6)


def test_every_parameter_can_be_written(tmp_path: Path) -> None:
    """Fails when a parameter of the model, put at its nominal value plus one part in a thousand, does not come back."""
    hand = load_hand(CONFIG)
    keys = [p.key for p in JOINT_PARAMETERS if p.key.partition(".")[0] in ("statics", "dynamics", "valve", "end_stop")]
    j = hand.joints.index("thumb_opposition")
    changed = [key for key in keys if hand.row(key)[j] != 0.0 and "low" not in key and "high" not in key]
    changes = {"thumb_opposition": {key: 1.001 * hand.row(key)[j] for key in changed}}
    patched = write_model(hand, changes, tmp_path / "model.yaml", "")
    for key in changed:
        assert patched.row(key)[j] == pytest.approx(1.001 * hand.row(key)[j], rel=5.1e-6), key


def test_a_nearer_end_stop_becomes_the_limit_of_the_joint(tmp_path: Path) -> None:
    """Broken by a model with an end stop found well inside the limits that does not load, or still allows the rest."""
    hand = load_hand(CONFIG)
    changes = {"index_distal": {"end_stop.high_deg": np.radians(70.0), "end_stop.low_deg": np.radians(-7.0)}}
    patched = write_model(hand, changes, tmp_path / "model.yaml", "")
    joint = hand.joints.index("index_distal")
    assert np.degrees(patched.limits.high_rad[joint]) == pytest.approx(70.0)
    assert np.degrees(patched.limits.low_rad[joint]) == pytest.approx(-10.0)
    others = np.arange(len(hand.joints)) != joint
    np.testing.assert_array_equal(patched.limits.high_rad[others], hand.limits.high_rad[others])


def test_friction_identified_as_zero_is_written_as_the_least(tmp_path: Path) -> None:
    """Broken by a model without friction, which its own loader refuses."""
    hand = load_hand(CONFIG)
    changes = {"index_distal": {"dynamics.viscous_friction_nm_s_per_rad": 0.0}}
    patched = write_model(hand, changes, tmp_path / "model.yaml", "")
    friction = patched.row("dynamics.viscous_friction_nm_s_per_rad")[hand.joints.index("index_distal")]
    assert 0.0 < friction < 1e-5


def test_a_limit_stays_where_pressure_flexes_the_joint(tmp_path: Path) -> None:
    """Broken by a model whose statics turn round within the limits, which its own loader refuses."""
    hand = load_hand(CONFIG)
    joint, a2 = hand.joints.index("index_distal"), hand.row("statics.a2_nm_per_pa")
    changes = {"index_distal": {"statics.a3_nm_per_pa_rad": float(-a2[joint] / np.radians(90.0))}}
    patched = write_model(hand, changes, tmp_path / "model.yaml", "")
    assert 88.0 < np.degrees(patched.limits.high_rad[joint]) < 90.0
    assert patched.row("statics.a3_nm_per_pa_rad")[joint] == pytest.approx(-a2[joint] / np.radians(90.0), rel=1e-5)
    others = np.arange(len(hand.joints)) != joint
    np.testing.assert_array_equal(patched.limits.high_rad[others], hand.limits.high_rad[others])
