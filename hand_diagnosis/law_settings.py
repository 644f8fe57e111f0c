"""The settings of the learned laws: their fits and their curves; see settings.py."""

from __future__ import annotations

from dataclasses import dataclass

from hand_diagnosis.fit_settings import FitSettings
from hand_recording.settings import CHOICE, setting


@dataclass(frozen=True, slots=True, kw_only=True)
class LawSettings(FitSettings):
    """The settings from the data to the law of an effect; SI units."""

    # fmt: off
    # Learned laws
    law_leaders: int = setting(8, "hypotheses", "Hypotheses of a round whose laws are fitted coarsely; those near"
        " the best one (max_evidence_gap) are fitted on.", CHOICE, "The right class may lose by its form.", "Slower.")
    law_probe_gain: float = setting(1.3, "-", "Gain that a probe of a law must promise, over that of the textbook form,"
        " for a fit that begins with the law.", CHOICE, "Laws where textbook forms do.", "Other forms are missed.")
    rival_share: float = setting(0.5, "-", "Share of the leader's fall of the cost from which the law of a rival is"
        " freed where the leader leaves nothing.", CHOICE, "Slower.", "The right class may lose by its form.")
    law_min_excess: float = setting(1.0, "floors", "Validation error beyond the noise, in repeatability floors, that"
        " the leader leaves where laws are freed.", CHOICE, "Slower.", "Laws stay those of textbooks.")
    law_random_starts: int = setting(24, "starts", "Random starts among those of the fit of a law.", CHOICE,
        "Fits from far away fail more often.", "Slower.")
    law_start_of_one: float = setting(1.0, "prior sd", "Size of starts in which one coefficient acts.", CHOICE,
        "Coefficients without gradient at 0 are missed.", "Starts at the bounds.")
    law_start_of_all: float = setting(0.3, "prior sd", "Size of starts in which all coefficients act.", CHOICE,
        "As above.", "Starts at the bounds.")
    law_smaller_start: float = setting(0.3, "-", "Share of the textbook form's sizes at which other starts begin.",
        CHOICE, "Starts near the effect's absence.", "Starts too near the textbook form.")
    law_random_spread: float = setting(0.7, "prior sd", "Standard deviation of the random starts.", CHOICE,
        "Starts near the textbook form.", "Many starts at the bounds.")
    law_fits: tuple[int, int, int] = setting((3, 8, 3), "fits", "Starts other than the textbook form that are fitted"
        " coarsely, in a whole fit, and best of them, continued.", CHOICE, "The wrong fit is continued.", "Slower.")
    law_iterations: tuple[int, int] = setting((8, 25), "iterations", "Iterations of these fits, at most.", CHOICE,
        "Fits end early.", "Slower.")
    completion_starts: int = setting(1, "starts", "Starts of the last fit of all laws next to the fit found.", CHOICE,
        "Worse minima are kept.", "Slower.")
    completion_jitter: tuple[float, ...] = setting((0.3, 1.0, 2.0), "prior sd", "How far these starts are off.", CHOICE,
        "They end in the same minimum.", "They end in others more often.")
    completion_iterations: int = setting(25, "iterations", "Iterations of these fits, at most.", CHOICE,
        "Fits end early.", "Slower.")
    completion_tolerance: float = setting(1e-3, "-", "Fall of the cost that ends them.", CHOICE, "Slower.",
        "Fits end early.")
    completion_differences: tuple[float, ...] = setting((0.1, 0.002), "prior sd", "Finite differences of"
        " these fits, one after the other: wide ones see past the steps that sticking makes in the cost.", CHOICE,
        "Fits of dry friction end early.", "Slower.")
    completion_min_excess: float = setting(0.5, "floors", "Validation error beyond the noise, in repeatability"
        " floors, from which the laws found are fitted once more.", CHOICE, "Slower.", "Worse minima are kept.")
    completion_unnoticed: float = setting(0.2, "floors", "Error of another signal, in repeatability floors, next to"
        " which a rise does not matter.", CHOICE, "Fits are refused for noise.", "Other signals may get worse.")
    law_surplus_errors: float = setting(1.0, "standard errors", "A coefficient this close to neutral is tried"
        " without.", CHOICE, "More coefficients than needed.", "Slower; the evidence decides in any case.")
    law_coarse_tolerance: float = setting(0.5, "-", "Fall of the cost that ends the coarse fits.", CHOICE, "Slower.",
        "The wrong fit is continued.")
    law_points: int = setting(25, "points", "Points of a law's curve.", CHOICE, "Coarser curves.", "Longer files.")
    law_draws: int = setting(80, "draws", "Draws from the posterior for the band of a curve.", CHOICE,
        "Rougher bands.", "Slower.")
    law_band: tuple[float, float] = setting((0.025, 0.975), "-", "Quantiles of these draws: a 95 % band.", CHOICE,
        "Wider bands.", "Narrower bands.")
    law_range_share: float = setting(0.995, "-", "Share of the readings of a state over which a law is shown.", CHOICE,
        "Curves end early.", "Not possible above 1.")
    law_reversal_share: float = setting(0.25, "-", "Share of the range of the angle over which a law after a reversal"
        " is shown.", CHOICE, "Curves end early.", "Mostly flat.")
    law_settled: float = setting(8.0, "time constants", "Length of a shown step response.", CHOICE,
        "Cut off.", "Mostly flat.")
    law_tube_differences: float = setting(4.0, "-", "Largest shown pressure difference along a tube, in changes from"
        " sample to sample.", CHOICE, "Curves end early.", "Curves show what did not occur.")
    law_constant_share: float = setting(0.05, "-", "Relative change below which a law is called constant.", CHOICE,
        "Small changes are described.", "Changes of 10 % are not described.")
    law_most_share: float = setting(0.9, "-", "Share of its change that a law has made at the state that its sentence"
        " names.", CHOICE, "States too early are named.", "Not possible above 1.")
    # fmt: on
