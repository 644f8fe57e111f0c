"""The sentence of a finding: numbers that are not significant are left out or named by their bound."""

from __future__ import annotations

import pytest

from hand_diagnosis.judgement import Number, said
from hand_model.effects import EFFECTS
from hand_model.quantities import HAND

LEVEL = Number("coulomb_friction.torque_nm", 0.0119, 3e-4, "N m", True)
NOTHING = [
    Number("coulomb_friction.breakaway_nm", 7e-6, 9.7e-5, "N m", True),
    Number("coulomb_friction.torque_nm_per_pa", 0.0, 6e-10, "N m/Pa", True),
]
GROWING = Number("coulomb_friction.torque_nm_per_pa", 4e-8, 6e-10, "N m/Pa", True)
SLIDING = Number("coulomb_friction.presliding_deg", 0.0294, 0.01, "deg", True)
BEGINNING = "Coulomb friction of 0.0119 ± 0.0003 N m is missing"


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        ([LEVEL, *NOTHING, SLIDING], f"{BEGINNING} (built up over 0.0294 ± 0.01 deg)"),
        (
            [LEVEL, NOTHING[0], GROWING, SLIDING],
            f"{BEGINNING} (plus 4e-08 ± 6e-10 N m/Pa times the pressure, built up over 0.0294 ± 0.01 deg)",
        ),
    ],
    ids=["two clauses", "one of two that belong together"],
)
def test_clauses_without_a_significant_number_are_left_out(numbers: list[Number], expected: str) -> None:
    """Fails when a number within its error of nothing is spoken as a finding, or a significant one is left out."""
    assert said(EFFECTS["coulomb_friction"], numbers, HAND) == expected


def test_a_parenthesis_of_nothing_is_left_out() -> None:
    """Fails when empty brackets, or a number that is nothing, remain of a template."""
    width = Number("valve_deadband.width_pa", 3000.0, 100.0, "Pa", True)
    softness = Number("valve_deadband.softness", 0.001, 0.01, "1", True)
    assert "(" not in said(EFFECTS["valve_deadband"], [width, softness], HAND)
