"""docs/model.md: its constants are those of the model; test/validation/test_figures.py compares its table."""

from __future__ import annotations

from pathlib import Path

from hand_model.kernel.closed_loop import HISTORY
from hand_model.kernel.rows import JOINT_PARAMETERS, STEP_S

TEXT = (Path(__file__).resolve().parents[2] / "docs" / "model.md").read_text(encoding="utf-8")


def test_quoted_constants_are_current() -> None:
    """Broken by a step or a memory that the text still gives as before."""
    assert f"at most {STEP_S * 1e3:g} ms" in TEXT
    assert f"The memory holds {HISTORY} samples" in TEXT


def test_names_end_in_their_unit() -> None:
    """Broken by a parameter whose key does not end in its unit."""
    units: tuple[str, ...] = (
        "_s",
        "_pa_per_s",
        "_nm",
        "_nm_per_rad",
        "_per_pa",
        "_pa_rad",
        "_deg",
        "_pa",
        "_kg_m2",
        "_s_per_rad",
    )
    units += ("_m3", "_n", "_s_pa", "_per_s", "_per_h", "_rad2", "_rad3", "_pa2")
    shares: tuple[str, ...] = (".share", ".error", ".exponent", ".softening", ".choking", ".ratio", "_ratio")
    shares += (".second", ".softness", ".turbulent", ".sharpness")  # of nothing but numbers
    shares += (
        ".resonance",
        ".slope_left",
        ".with_pressure",
        ".denser",
        ".knee",
        ".early",
        ".later",
        ".soon",
        ".slowly",
        ".before_inertia",
        ".by_use",
    )
    shares += (".inner_share", ".inner_gap", *(f".{side}_{third}" for side in ("fill", "vent") for third in (1, 2, 3)))
    shares += (
        ".clearing",
        ".travel_slope",
        ".travel_bow",
        ".gradual",
        ".heat_share",
        ".critical",
        ".faster",
        ".unload_2",
        ".unload_4",
        ".knee_4",
        ".knee_8",
        ".offset",
        ".limited",
        ".asymmetry",
        ".slowing",
        ".follows",
        ".inner",
        ".innermost",
        ".by_square",
        ".by_strain",
        ".by_load",
        ".bend",
        ".skew",
        ".small",
        ".per_drive",
        ".per_load",
        ".at_rest",
        ".back",
        ".growth",
        ".damping",
        "_hz",
        ".at_load",
        *(f".{curve}_{k}" for curve in ("steeper", "ahead", "behind") for k in range(1, 5)),
    )
    units += ("_per_rad",)
    for parameter in JOINT_PARAMETERS:
        assert parameter.key.endswith(units + shares), parameter.key
        assert parameter.low < parameter.high
        assert parameter.neutral is None or parameter.low <= parameter.neutral <= parameter.high, parameter.key
