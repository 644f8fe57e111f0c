"""The declaration of the controller's numbers, and the files that are generated from it."""

from __future__ import annotations

import array
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hand_control import generated
from hand_control.declared import CONSTANTS, DECLARED, GAINS, INPUTS, OUTPUTS, STATE, C, G, Row, S, Settings
from hand_control.tuning import gains
from hand_model.description import load_hand
from hand_ros.parameters import NodeParameter, ParameterError

ROOT = Path(__file__).parents[2]
HAND = load_hand(ROOT / "config" / "hand.yaml")


FILES = [
    generated.HEADER,
    generated.YAML,
    generated.DOCUMENT,
    generated.SAFETY_HEADER,
    generated.FIRMWARE_DOCUMENT,
    generated.ROWS,
]


@pytest.mark.parametrize("name", FILES)
def test_the_generated_files_are_those_of_the_declaration(name: str) -> None:
    """Fails when a number is changed in the declaration, or in a generated file, and not in the other."""
    text = (ROOT / name).read_text(encoding="utf-8")
    assert generated.texts(ROOT)[name] == text, f"run {generated.COMMAND}"


def test_a_document_without_its_marks_is_refused() -> None:
    """Fails when the generator writes into a file that has lost the marks of its section."""
    with pytest.raises(ValueError, match="must each stand once"):
        generated._between("text without marks\n", "<!-- ", " -->", "table\n")


@pytest.mark.parametrize("rows", [GAINS, STATE, INPUTS, OUTPUTS], ids=["gains", "state", "inputs", "outputs"])
def test_every_row_is_there_once(rows: tuple[Row, ...]) -> None:
    """Fails when two rows share a name: one would overwrite the other."""
    names = [row.name for row in rows]
    assert len(set(names)) == len(names)


def test_every_parameter_fills_its_row_of_the_gains() -> None:
    """Fails when a parameter is declared with a row and does not reach the law through it."""
    default = gains(HAND, Settings.of(HAND, {}))
    for name, declared in DECLARED.items():
        if not declared.row:
            continue
        if declared.choices:
            changed: object = next(choice for choice in declared.choices if choice != declared.value)
        elif isinstance(declared.value, bool):
            changed = not declared.value
        elif isinstance(declared.value, list):
            changed = [0.5 * declared.value[0]]
        else:
            changed = 0.9 * declared.value
        other = gains(HAND, Settings.of(HAND, {name: changed}))
        differing = {GAINS[row].name for row in np.flatnonzero((other != default).any(axis=1))}
        assert declared.row in differing and differing <= {declared.row, "threshold"}, name


def test_the_model_rows_are_those_of_the_description() -> None:
    """Fails when a row of the gains holds another parameter of hand.yaml than it says, or a rate that is a time."""
    g = gains(HAND, Settings.of(HAND, {}))
    for row in GAINS:
        if row.key:
            assert np.array_equal(g[getattr(G, row.name)], HAND.row(row.key)), row.name
    assert g[G.extension_rate] == pytest.approx(1.0 / HAND.row("material.extension_time_s"))
    assert g[G.recovery_rate] == pytest.approx(1.0 / HAND.row("material.recovery_time_s"))
    assert np.array_equal(g[G.partner], HAND.partner)
    assert np.array_equal(g[G.low], HAND.limits.low_rad) and np.array_equal(g[G.high], HAND.limits.high_rad)
    assert np.array_equal(g[G.p_max], HAND.limits.max_pressure_pa)


def test_rows_that_the_law_addresses_in_sequence_are_in_sequence() -> None:
    """Fails when the changes of the map, or their covariance, no longer lie side by side in the state."""
    assert (S.offset, S.d_a1, S.d_a3, S.d_viscous) == tuple(range(S.offset, S.offset + 4))
    pairs = [f"c{i}{j}" for i in range(4) for j in range(i, 4)]
    assert [getattr(S, pair) for pair in pairs] == list(range(S.c00, S.c00 + 10))


def test_constants_have_their_declared_values() -> None:
    """Fails when a fixed number of the law is not the declared one."""
    assert {name: value for name, (value, _, _) in CONSTANTS.items()} == C._asdict()


@pytest.mark.parametrize(
    ("name", "value", "line"),
    [
        ("kp_nm_per_rad", [0.1, 0.2], "has 2 values; it must have 1 or 11"),
        ("ki_nm_per_rad_s", [float("nan")], "the allowed range is 0 to 100"),
        ("integral_limit_nm", [10.5], "the allowed range is 0 to 10"),
        ("deadband_pa", -1.0, "the allowed range is 0 to 50000"),
        ("control_mode", "speed", "must be one of position, torque"),
        ("adaptation", 1, "must be a bool"),
    ],
)
def test_a_value_outside_its_range_is_refused_in_one_line(name: str, value: object, line: str) -> None:
    """Fails when a setting outside its declared range reaches the law, or the message does not say what is allowed."""
    with pytest.raises(ParameterError, match=line) as caught:
        Settings.of(HAND, {name: value})
    assert name in str(caught.value) and "\n" not in str(caught.value)


def test_gains_of_each_joint_keep_their_order() -> None:
    """Fails when a list with one value per joint is not used joint by joint, or one value not for all of them."""
    values = np.linspace(0.1, 0.2, len(HAND.joints))
    settings = Settings.of(HAND, {"kp_nm_per_rad": values.tolist(), "ki_nm_per_rad_s": [2.0]})
    assert np.array_equal(settings.kp_nm_per_rad, values)
    assert np.array_equal(settings.ki_nm_per_rad_s, np.full(len(HAND.joints), 2.0))


@pytest.mark.parametrize(
    ("default", "given", "taken"),
    [
        (1.5, 2, 2.0),
        (1.5, True, True),
        (3, 2, 2),
        ([1.5], array.array("d", [0.1, 0.2]), [0.1, 0.2]),
        ([1.5], array.array("q", [1, 2]), [1.0, 2.0]),
        ([1.5], [1, 0.5], [1.0, 0.5]),
        ([1.5], [True], [True]),
        (["a"], ["b"], ["b"]),
        ("a", 1, 1),
    ],
)
def test_values_of_parameters_get_their_declared_type(default: Any, given: Any, taken: Any) -> None:
    """Fails when a list from rclpy or an integer for a float is refused, or another type is silently changed."""
    value = NodeParameter("x", default, "").converted(given)
    assert value == taken and type(value) is type(taken)
    if isinstance(taken, list):
        assert [type(element) for element in value] == [type(element) for element in taken]
