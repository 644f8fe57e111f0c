"""The settings of the pages that show reports; see settings.py."""

from __future__ import annotations

from dataclasses import dataclass

from hand_diagnosis.law_settings import LawSettings
from hand_recording.settings import CHOICE, setting


@dataclass(frozen=True, slots=True, kw_only=True)
class PageSettings(LawSettings):
    """The settings of pages, and those from the data to the law of an effect; SI units."""

    # fmt: off
    # Pages
    missed_share: float = setting(0.5, "-", "Share of the largest error of a block from which a page shows the block as"
        " one in which the effect is missed.", CHOICE, "Most of the recording is shown.", "Only the largest errors.")
    missed_gap_blocks: float = setting(0.5, "blocks", "Stretches nearer than this are shown as one.", CHOICE,
        "More and shorter stretches.", "Stretches include blocks without the effect.")
    even_probability: float = setting(0.5, "-", "Probability below which a finding follows what remains, and is called"
        " possible.", CHOICE, "Improbable findings come first.", "Only certain findings come first.")
    same_commands_pa: float = setting(1000.0, "Pa", "RMS difference of two set-points above which recordings are of"
        " different motions.", CHOICE, "Delays of commands count as another motion.", "Other motions are compared.")
    page_samples: int = setting(700_000, "samples", "Samples of all curves over time of a page.", CHOICE,
        "Coarser curves.", "Pages above 3 MB.")
    page_noise: float = setting(1.5, "-", "Multiple of the noise up to which a page calls an error noise.",
        CHOICE, "Errors of noise are called large.", "Small errors are called noise.")
    page_curves: int = setting(5, "curves", "Curves over time of a signal that are counted for it.", CHOICE,
        "Larger pages.", "Coarser curves.")
    full_tint: float = setting(100.0, "-", "Error in multiples of the noise from which the tint of a joint is full.",
        CHOICE, "Stronger tints.", "Weaker tints.")
    strongest_tint: float = setting(0.55, "-", "Opacity of the full tint.", CHOICE, "Tints are hardly seen.",
        "Text on it is not readable.")
    unjudged_tint: float = setting(0.5, "-", "Opacity of the grey of a joint that was not diagnosed.", CHOICE,
        "It is hardly seen.", "It looks like a finding.")
    chart_low: float = setting(0.5, "-", "The axis of errors begins there at the latest, in multiples of the noise.",
        CHOICE, "Shorter bars.", "No visible change.")
    chart_high: float = setting(2.0, "-", "The axis of errors ends there at the earliest, in multiples of the noise.",
        CHOICE, "No visible change.", "Shorter bars.")
    drawing_margin_mm: float = setting(12.0, "mm", "Margin of the drawing of the hand.", CHOICE, "No visible change.",
        "A smaller hand.")
    likelihood_limits: tuple[float, float, float] = setting((0.9, 0.66, 0.33), "-", "Least probability that is called"
        " very probable, probable and possible.", "Mastrandrea et al., Guidance note for lead authors of the IPCC fifth"
        " assessment report, 2010, Table 1", "Weak findings sound certain.", "Not possible above 1.")
    compared_motion_s: float = setting(20.0, "s", "Duration of the simulated motion of two compared models.", CHOICE,
        "Creep is not seen.", "Slower.")
    compared_motion_pa: float = setting(4e5, "Pa", "Its largest set-point, as that of `hand excite`.", CHOICE,
        "Joints move over a part of their range.", "Limited by the supply.")
    compared_least: tuple[float, float] = setting((0.05, 0.3), "deg, kPa", "RMS differences of angle and pressure from"
        " which a joint is drawn.", "the practical floor", "Plots of equal curves.", "Small differences are not drawn.")
    hardly_checked: float = setting(0.5, "-", "Share of the test error before the findings that the fit may leave open;"
        " of more, the headline says that test data hardly check it.", CHOICE, "It says so of fits that test data do"
        " check.", "Test data that check nothing pass for a success.")
    # fmt: on
