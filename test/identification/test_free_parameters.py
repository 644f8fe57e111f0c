"""Free parameters: of effects whose nominal numbers are zero, and many of them at once."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from hand_identification.free_parameters import effect_free_parameters, values_of
from hand_model.description import load_hand
from hand_model.effects import CATALOGUE
from hand_model.effects.effect import Effect
from hand_model.kernel.rows import ROW

CONFIG = Path(__file__).parents[2] / "config" / "hand.yaml"


@pytest.mark.parametrize("effect", CATALOGUE, ids=[effect.name for effect in CATALOGUE])
def test_a_number_that_is_zero_has_coordinates(effect: Effect) -> None:
    """Fails when an effect cannot be fitted where a number that it changes is 0, as the damping of a stop may be."""
    for key in effect.keys:
        nominal = load_hand(CONFIG).parameters[:, 0]
        nominal[ROW[key]] = 0.0
        for parameter in effect_free_parameters(effect, nominal):
            for value in (float(nominal[parameter.row]), parameter.low, parameter.centre):
                assert math.isfinite(parameter.coordinate(value)), parameter.key


def test_values_of_many_are_those_of_each() -> None:
    """Fails when a logarithmic parameter is taken as a linear one, a value leaves its bounds, or has no way back."""
    nominal, rng = load_hand(CONFIG).parameters[:, 0], np.random.default_rng(8)
    free = [each for effect in CATALOGUE if effect.keys for each in effect_free_parameters(effect, nominal)]
    assert {parameter.log for parameter in free} == {True, False}
    z = rng.normal(0.0, 4.0, (5, len(free)))
    each = np.column_stack([parameter.value(z[:, k]) for k, parameter in enumerate(free)])
    np.testing.assert_array_equal(values_of(free, z), each)
    assert values_of([], np.zeros((3, 0))).shape == (3, 0)
    for column, parameter in zip(each.T, free, strict=True):
        assert np.all((column >= parameter.low) & (column <= parameter.high)), parameter.key
    gentle = 0.01 * rng.uniform(-1.0, 1.0, len(free))
    back = [
        parameter.coordinate(value) for parameter, value in zip(free, values_of(free, gentle[None])[0], strict=True)
    ]
    inside = [p.low < v < p.high for p, v in zip(free, values_of(free, gentle[None])[0], strict=True)]
    assert {p.log for p, within in zip(free, inside, strict=True) if within} == {True, False}
    np.testing.assert_allclose(np.array(back)[inside], gentle[inside], atol=1e-9)
