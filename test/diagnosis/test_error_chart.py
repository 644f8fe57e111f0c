"""The chart of the errors of two reports."""

from __future__ import annotations

import math

from hand_diagnosis.pages.error_chart import error_chart
from hand_diagnosis.settings import SETTINGS


def row(before: float, after: float) -> dict[str, float]:
    """An error before and after with a noise of 2."""
    return {"rmse_before": before, "rmse_after": after, "noise_floor": 2.0}


def test_places_are_logarithms_of_multiples_of_the_noise() -> None:
    """Fails when an error is not divided by its noise, a place is not on the axis, or noise does not end at 1."""
    key = ("index_distal", "angle")
    chart = error_chart({key: row(200.0, 2.0)}, {key: row(20.0, 4.0)})
    assert chart is not None
    ((name, a, b),) = chart.rows
    assert name == "index_distal, angle" and a is not None and b is not None

    def place(value: float) -> float:
        return round(100.0 * math.log(value / SETTINGS.chart_low) / math.log(100.0 / SETTINGS.chart_low), 2)

    assert (a.before, a.after, b.before, b.after) == tuple(map(place, (100.0, 1.0, 10.0, 2.0)))
    assert chart.noise == place(1.0)
    assert chart.ticks == ((place(1.0), "1"), (place(10.0), "10"), (place(100.0), "100"))
    assert chart.alt == (
        "A: the largest error is that of index_distal, angle, 100 → 1;"
        " B: the largest error is that of index_distal, angle, 10 → 2 times the noise"
    )


def test_an_error_that_one_report_lacks_has_no_bar() -> None:
    """Fails when a joint of one report only is left out, or its error is shown for both."""
    chart = error_chart({("a", "angle"): row(2.0, 2.0)}, {("b", "angle"): row(0.0, 0.0)})
    assert chart is not None
    (first, second) = chart.rows
    assert first[1] is not None and first[2] is None and second[1] is None and second[2] is not None
    assert second[2].before == 0.0
    assert error_chart({}, {}) is None
