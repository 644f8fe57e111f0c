"""Numbers on pages."""

from __future__ import annotations

import pytest

from hand_pages.numbers import with_error
from hand_pages.page import breakable


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (66.06, 12.07, "66 ± 12"),
        (0.0119, 3e-4, "0.0119 ± 0.0003"),
        (197.0, 60.0, "200 ± 60"),
        (0.005031, 4e-6, "0.005031 ± 0.000004"),
        (1.98e-6, 4e-7, "(2.0 ± 0.4)e-6"),
        (1.2345e6, 2e4, "(1.23 ± 0.02)e6"),
        (-0.001, 0.6, "0.0 ± 0.6"),
        (2.5, 0.0, "2.5 ± 0"),
        (2.5, float("nan"), "2.5 ± nan"),
    ],
)
def test_an_error_has_one_digit_and_its_value_the_same_place(value: float, std: float, text: str) -> None:
    """Fails when a page shows 1e+01 for 12, digits below the error, or -0."""
    assert with_error(value, std) == text


def test_a_long_name_breaks_between_its_parts_only() -> None:
    """Fails when a table on a telephone breaks coulomb into coulom and b, or a number at its point."""
    assert breakable("coulomb_friction.torque_nm") == "coulomb_<wbr>friction.<wbr>torque_<wbr>nm"
    assert breakable("0.0119 <b> & a/b") == "0.0119 &lt;b&gt; &amp; a/<wbr>b"
