"""The plot of a law on the page of a report."""

from __future__ import annotations

import json

import numpy as np

from hand_diagnosis.pages.page_plots import law_plot
from hand_diagnosis.search import LawCurve

SPEED = np.array([0.0, 1.0, 2.0])
LEVEL = np.array([9.0, 12.0, 12.5])
POINTS = np.column_stack([SPEED, LEVEL, LEVEL - 1.0, LEVEL + 2.0, np.full(3, 11.0)])


def test_a_learned_law_is_drawn_with_its_band_and_the_textbook_form() -> None:
    """Fails when band or textbook form is missing, curves are exchanged, or a textbook law is drawn twice."""
    drawn = {}
    for form in ("learned", "textbook"):
        law = LawCurve(
            form=form,
            over=("speed", "load"),
            quantity="friction",
            unit="mN m",
            over_unit="rad/s",
            points=POINTS,
            statement="friction rises",
        )
        plot = law_plot("Coulomb friction", law)
        assert (plot.label, plot.panels[0].label) == ("speed [rad/s]", "friction [mN m]")
        assert plot.alt == "law of Coulomb friction: friction rises"
        drawn[form] = json.loads(plot.json())
    assert drawn["learned"]["axes"] == [SPEED.tolist()]
    law, textbook = drawn["learned"]["panels"][0]["series"]
    assert [law[key] for key in ("y", "low", "high")] == [LEVEL.tolist(), (LEVEL - 1).tolist(), (LEVEL + 2).tolist()]
    assert (law["name"], law["kind"]) == ("learned law, 95 % band", "after")
    assert (textbook["name"], textbook["kind"], textbook["y"]) == ("textbook form", "quiet", [11.0, 11.0, 11.0])
    assert [each["name"] for each in drawn["textbook"]["panels"][0]["series"]] == ["textbook law, 95 % band"]
