"""Every number that decides something in the diagnosis, in one frozen class.

Those up to the fits are in fit_settings, those of the learned laws in law_settings, those of pages in page_settings.

Each setting states its meaning, its unit, where it comes from, and what changes when it is halved or doubled. Settings
whose source is TRIALS were adjusted on blind trials whose effects and seeds are not those of the published proof. The
values are written to report.json, and docs/settings.md has the table that `settings_table` makes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from hand_diagnosis.fit_settings import FitPass
from hand_diagnosis.page_settings import PageSettings
from hand_recording.settings import CHOICE, FORMS, TRIALS, setting

__all__ = ["SETTINGS", "FitPass", "Settings"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings(PageSettings):
    """The settings of a diagnosis; `about` of a field is its documentation. SI units."""

    # fmt: off
    # Acceptance of an effect
    max_effects: int = setting(
        4, "effects", "Effects that are accepted on one joint at most.", CHOICE,
        "Joints with three effects stay unknown.", "More parameters imitate what no effect explains.")
    min_log_evidence: float = setting(
        6.0, "log", "Log evidence by which an effect must beat the model without it.", CHOICE,
        "False findings.", "Small effects are missed.")
    strong_log_evidence: float = setting(
        10.0, "log", "Log evidence that accepts an effect whose fall of the validation error is not significant by"
        " itself, because few blocks show the effect.", CHOICE,
        "False findings from single blocks.", "Rare events, as contacts, are missed.")
    tie_log_evidence: float = setting(
        5.0, "log", "Log evidence by which two effects must differ; closer ones are one finding with both names.",
        CHOICE, "Wrong names of twins.", "Effects that the data separate are called alike.")
    near_log_evidence: float = setting(
        12.0, "log", "Log evidence behind the first effect up to which others are compared with it below the practical"
        " floor.", CHOICE, "Twins of other forms are separated less often.", "Slower.")
    pair_leaders: int = setting(
        2, "hypotheses", "Leaders of a round that no effect wins, each of which is tried with a second one.",
        CHOICE, "Pairs that hide each other are missed.", "Slower where physics is unknown.")
    tie_recordings: int = setting(
        10, "recordings", "Recordings of one experiment that may be asked for to break a tie.",
        CHOICE, "More ties are left without an experiment.", "Experiments are proposed that nobody repeats so often.")
    shorter_correlation: float = setting(
        0.7, "-", "Share of a machine's correlation time below which that of its best model's errors replaces it, in a"
        " second search.", CHOICE, "Short recordings show less.", "Machines are searched twice for little.")
    min_relative_improvement: float = setting(
        0.03, "-", "Fall of the validation error, relative to itself, that an effect must bring.", CHOICE,
        "Effects of no practical size are claimed.", "Small effects next to larger ones are missed.")
    further_starts: int = setting(
        1, "fits", "Further starts of the fit of an accepted effect.", CHOICE,
        "Local minima go unnoticed.", "Slower.")
    start_jitter: float = setting(
        0.5, "prior standard deviations", "How far the further starts are off.", CHOICE,
        "They end in the same local minimum.", "They end in others more often.")
    restart_iterations: int = setting(
        12, "iterations", "Iterations of the fits from further starts.", CHOICE,
        "They end too early to compare.", "Slower.")
    min_listed_floors: float = setting(
        0.2, "floors", "Error, in repeatability floors, that an improvement must remove to be listed as too small to"
        " claim.", CHOICE, "Longer lists.", "Shorter lists.")
    listed_improvements: int = setting(
        3, "improvements", "Length of that list.", CHOICE, "Shorter lists.", "Longer lists.")
    refit_weight: float = setting(
        400.0, "-", "Largest weight of the data in the last fit, relative to that of the practical floor; it is that of"
        " the white noise.", CHOICE, "Priors keep structure that the numbers explain.", "Noise moves the numbers.")
    refit_iterations: int = setting(
        12, "iterations", "Iterations of the last fit.", CHOICE, "It ends early.", "Slower.")
    min_correlated_ratio: float = setting(
        1.05, "-", "RMS of a residual over its white noise from which it is correlated, so that laws are freed and"
        " close names compared below the practical floor.", CHOICE, "Slower.", "Correlated residuals are left.")
    bootstrap_draws: int = setting(
        400, "draws", "Draws of the paired block bootstrap of the validation error.", CHOICE,
        "Less exact intervals.", "Slower.")
    bootstrap_tail: float = setting(0.025, "-", "Probability outside the interval, at each end.", "95 % interval",
        "Small effects are missed.", "False findings.")
    min_sharing_joints: float = setting(
        0.5, "-", "Share of the diagnosed joints that must show an effect of the whole hand.", CHOICE,
        "An effect of few joints is put on the hand.", "Not possible above 1.")

    max_causes: int = setting(
        2, "-", "Most causes of the whole hand.", CHOICE, "Several together are missed.", "Slower.")
    cause_starts: int = setting(
        3, "-", "Probes of a cause of the whole hand from which all joints are fitted at once.", CHOICE,
        "A cause may be missed.", "Slower.")
    cause_iterations: tuple[int, int] = setting(
        (4, 30), "-", "Iterations of these fits: from each start, and of the best ones.", CHOICE,
        "Fits may end early.", "Slower.")

    cause_step: float = setting(
        0.1, "std", "Step of its numbers that model.yaml keeps, in the standard deviation of each while others stay.",
        CHOICE, "Longer numbers.", "The prediction changes by rounding.")

    # Test data
    test_share: float = setting(
        0.2, "-", "Last part of each recording that is test data.", CHOICE,
        "The test error is less certain.", "Less is left to fit and to choose by.")
    min_test_s: float = setting(
        2.5, "s", "Shorter test data are not taken from a recording, whose rest is needed for choices.", CHOICE,
        "Test errors of a few samples.", "Short recordings have no test data.")
    late_excess: float = setting(
        3.0, "-", "Excess error on test data, relative to that on training data, from which other data are fitted.",
        CHOICE, "Slower.", "What only the end of a recording shows has no name.")
    test_warm_up_s: float = setting(
        600.0, "s", "Time before the test data in which the memory of a driven joint's model settles; warming is"
        " slowest.", CHOICE, "Long recordings begin with a wrong temperature.", "Slower.")
    min_recordings_to_spare: int = setting(
        3, "recordings", "Recordings from which a whole one is test data.", CHOICE,
        "Half of two recordings is not fitted.", "The test data are parts of fitted recordings.")
    min_test_blocks: int = setting(
        3, "blocks", "Blocks of test data without which nothing is withdrawn.", CHOICE,
        "Single blocks decide.", "Short recordings never withdraw a finding.")
    min_elasticity_nm_per_rad: float = setting(
        1e-5, "N m/rad", "An axis with less elasticity keeps its state; it is estimated again for test data.", CHOICE,
        "No other result.", "Weak springs count as none.")

    # What the data can separate
    alike_cosine: float = setting(
        0.95, "-", "Cosine between two effects' sensitivities from which the data do not separate them.", CHOICE,
        "All effects count as alike.", "Not possible above 1.")
    isolability_samples: int = setting(
        20_000, "samples", "Samples from which a longer recording is thinned out for it.", CHOICE,
        "Less exact cosines.", "More memory.")
    min_visible_sigma: float = setting(
        0.5, "sigma", "A probe below it is too small to be compared.", CHOICE,
        "Noise is compared.", "Small effects look like nothing.")

    # What remains, and where
    unexplained_floors: float = setting(
        1.3, "floors", "Error beyond the noise, in repeatability floors, from which a joint without effects is not"
        " explained.", TRIALS, "False `unknown` findings.", "Small unknown physics is missed.")
    tolerated_share: float = setting(
        0.1, "-", "Share of the nominal excess error (RMS) that right names may leave, in addition to"
        " name_excess_floors: real laws differ in form.", FORMS,
        "Right effects of another form stand next to a remainder.", "A second effect passes as an error of form.")
    max_claim_share: float = setting(
        0.6, "-", "Share of the excess error (RMS) above which what an effect removes is not a finding.", CHOICE,
        "Effects next to a larger unknown are not named.", "Effects that fit any residual a little are named.")
    time_margin: float = setting(
        0.25, "-", "Share of variance by which time must explain more than any state.", CHOICE,
        "Drifts are reported where a state matters.", "Drifts are put on a state.")
    state_bins: int = setting(
        20, "bins", "Bins of a state over which a residual is averaged.", CHOICE,
        "Narrow structure is averaged out.", "Noise counts as structure.")
    moving_rad_s: float = setting(
        0.1, "rad/s", "Speed from which a joint moves in one direction.", CHOICE,
        "Noise of the speed mixes the directions.", "Slow motion is left out.")
    least_direction_share: float = setting(
        0.1, "-", "Share of a recording's travel from which it shows a direction of motion.", CHOICE,
        "Recordings are left out whose direction others hardly show.", "A short way back counts as a direction.")
    standing_rad_s: float = setting(
        0.05, "rad/s", "Speed below which a joint stands.", CHOICE,
        "Noise counts as motion.", "Slow motion counts as rest.")
    min_stage_samples: int = setting(
        10, "samples", "Samples that a recording must have of a signal to be described.", CHOICE,
        "Descriptions of a few samples.", "Short recordings are left out.")
    min_missed_sigma: float = setting(
        3.5, "standard errors", "Excess over the noise from which a region is missed; some thirty are tested.",
        "Bonferroni over 30 regions at 1.5 %", "False regions.", "Weak regions go unreported.")
    min_region_samples: int = setting(
        5, "samples, blocks", "Samples of a block in a region, and blocks, that a test needs.", CHOICE,
        "Unstable tests.", "Rare regions are not tested.")
    band_edges_hz: tuple[float, ...] = setting(
        (0.0, 0.2, 2.0, math.inf), "Hz", "Edges of the frequency bands: creep and drift, motion, transients.", CHOICE,
        "Slow motion counts as transient.", "Transients count as motion.")
    slow_hz: float = setting(
        0.2, "Hz", "Centroid of a residual's spectrum below which it is called slow.", CHOICE,
        "Creep is described by a frequency.", "Slow motion is called slow drift.")
    min_tone_share: float = setting(
        0.5, "-", "Share of a remainder's variance in one line of its spectrum from which it is periodic in time.",
        CHOICE, "Periodic motion makes remainders periodic.", "Only pure tones are called periodic.")
    scanned_turns: tuple[float, float] = setting(
        (2.0, 4096.0), "periods", "Repetitions over the range of the angle that are looked for before the search.",
        CHOICE, "Fine teeth are not found.", "Scanning takes longer.")
    turn_bins: float = setting(
        8.0, "bins", "Bins of the angle in the finest repetition that is looked for.", CHOICE,
        "Fine teeth lose a part of their size.", "Scanning takes longer.")
    turn_lines: int = setting(
        8, "-", "Lines of that periodogram in one repetition over the range.", CHOICE,
        "A period between two lines is found less exactly.", "Scanning takes longer.")
    samples_a_turn: float = setting(
        4.0, "samples", "Least number of samples in a repetition at the usual speed.", CHOICE,
        "Repetitions that the recorder barely sees are taken for periods.", "Fine teeth are found in slow motion only.")
    reversal_speed: float = setting(
        0.05, "standard deviations", "Speed around which the direction of motion changes, for that periodogram.",
        CHOICE,
        "Noise of the speed at rest looks like reversals.", "Friction at reversals is smoothed and leaves lines.")
    spike_quantiles: tuple[float, float] = setting(
        (0.01, 0.99), "-", "Torques outside these quantiles are clipped for that periodogram.", CHOICE,
        "Blows hide a period.", "Sharp teeth are clipped.")
    min_tone_periods: float = setting(
        8.0, "periods", "Periods that a recording must hold of such a line.", CHOICE,
        "Drifts are called periodic.", "Slow periodic remainders are not recognised.")
    noise_seed: int = setting(
        20, "-", "Seed of the second draw of input noise.", CHOICE, "Another draw.", "Another draw.")
    undetermined_draws: int = setting(
        8, "draws", "Draws of the parameters, as far as a fit leaves them open, that predict the test data.", CHOICE,
        "A less certain floor of the test error.", "Slower.")
    noise_parts: tuple[int, ...] = setting(
        (1, 2, 5, 10, 20), "-", "The fastest 1/n of the samples, whose noise is estimated apart.", CHOICE,
        "Jitter of fast samples is averaged out.", "Parts too small to estimate.")
    noise_part_samples: int = setting(
        4, "samples", "Samples of the smallest part for which the parts are estimated apart.", CHOICE,
        "Unstable estimates.", "Jitter of fast samples is averaged out in short recordings.")
    noise_latest_samples: float = setting(
        10.0, "samples", "Most by which a sample may be taken at a wrong time; more says that the signal was at rest.",
        CHOICE, "Jitter of fast samples counts as noise of all.", "A signal that moves once has absurd noise there.")
    median_of_noise: float = setting(
        0.6745, "-", "Median magnitude of a unit normal variable.", "definition", "Meaningless.", "Meaningless.")
    third_difference_variance: float = setting(
        20.0, "-", "Variance of third differences of unit white noise, 1 + 9 + 9 + 1.", "definition",
        "Meaningless.", "Meaningless.")

    # Onset
    onset_prior: float = setting(
        0.1, "-", "Prior odds of an effect that begins or ends inside a recording against one that is always there.",
        CHOICE, "Onsets where effects are only weakly excited.", "Onsets are missed.")
    min_onset_probability: float = setting(
        0.5, "-", "Probability above which effects begin or end inside a recording.", "even odds",
        "Onsets where effects are only weakly excited.", "Onsets are missed.")
    min_onset_gain: float = setting(
        4.0, "log", "Gain in log likelihood from which a time is tried as an onset.", CHOICE,
        "Slower, no other result.", "Onsets are missed.")
    min_onset_s: float = setting(
        2.0, "s", "Least time from an onset to the beginning and the end of the fitted data.", CHOICE,
        "Onsets in the transient at the beginning.", "Early and late onsets are missed.")
    min_onset_recording_s: float = setting(
        8.0, "s", "Fitted data of a recording below which no onset is sought.", CHOICE,
        "Onsets from too little data.", "Onsets in short recordings are missed.")
    sound_share: float = setting(
        0.25, "-", "Share of a recording that first counts as free of effects where an onset is sought.", CHOICE,
        "Too short to fit the nominal numbers.", "Early onsets are missed.")
    onset_refinements: int = setting(
        3, "-", "Repetitions of a fit and the search of the best time.", CHOICE,
        "Coarse times.", "Slower, no other result.")
    rough_onset_s: float = setting(
        0.3, "s", "Error of the first time of an onset; samples within it are left out at first.", CHOICE,
        "A joint that is still moving to its new place looks like other effects.", "Quick effects are seen too little.")
    end_prior: float = setting(
        0.2, "-", "Prior odds of an effect that ends inside a recording against one that begins there.", CHOICE,
        "Effects that end are taken for others that begin.", "Effects that begin are taken for others that end.")
    onset_steps: int = setting(
        41, "-", "Times tried over a recording with a plant that changes there, then again near the best one.", CHOICE,
        "Times between which the fit is better are missed.", "Slower, no other result.")
    onset_grids: int = setting(
        3, "-", "Grids of such times, each within a step of the best time of the one before.", CHOICE,
        "Coarse times.", "Slower, no other result.")
    onset_candidates: int = setting(
        2, "-", "Times at which a search with an onset is tried.", CHOICE,
        "Onsets are missed.", "Slower, no other result.")

    # Findings
    bound_margin: float = setting(
        0.001, "-", "Relative distance of a number from a bound of its range up to which it ended there.", CHOICE,
        "Bounds that a fit just misses go unreported.", "Numbers near a bound are reported.")
    evidence_temperature: float = setting(
        2.5, "-", "Log evidences are divided by it before probabilities are formed: equations that are only nearly"
        " right exaggerate differences.", TRIALS, "Overconfident findings.", "Timid findings.")
    outside_catalogue: float = setting(
        0.04, "-", "Probability of effects outside the catalogue where none is found.", TRIALS,
        "Unknown physics is missed.", "Remainders on sound joints.")
    name_excess_floors: float = setting(2.0, "floors", "Error beyond the noise, in repeatability floors, that right"
        " names may leave on data not fitted; a larger one is a remainder.", FORMS,
        "Right effects of another form stand next to a remainder.", "A second effect passes as an error of form.")
    name_sharpness: float = setting(2.5, "-", "How fast the odds of a name fall with that error: power of 1 + its"
        " square.", FORMS, "Names depend less on what they leave.", "Names depend more on it.")
    name_least: float = setting(0.2, "-", "Probability of the best name where all of the error is left: a law of"
        " another form misses much, too.", FORMS, "Timid findings.", "Overconfident stand-ins for missing effects.")
    min_probability: float = setting(
        0.01, "-", "Probabilities of effects stay between it and one minus it.", CHOICE,
        "No visible change.", "No visible change.")
    min_alternative: float = setting(
        0.02, "-", "Alternatives of a smaller probability are left out.", CHOICE,
        "Longer lists.", "Shorter lists.")
    determined_deviation: float = setting(
        0.5, "prior standard deviations", "Posterior deviation below which the data determine a parameter.", CHOICE,
        "More parameters are marked.", "Parameters of the prior pass as measured.")
    min_change_sigma: float = setting(
        2.0, "standard errors", "Change of a nominal number from which it is listed.", CHOICE,
        "Longer lists.", "Shorter lists.")
    min_change_tolerances: float = setting(
        0.1, "tolerances", "Least change of a nominal number that is listed.", CHOICE,
        "Longer lists.", "Shorter lists.")
    strong_correlation: float = setting(
        0.8, "-", "Correlation of two estimates from which the page lists the pair.", CHOICE,
        "Longer lists.", "Not possible above 1.")
    figure_bins: int = setting(
        24, "bins", "Bins of the residual over a state in figures.", CHOICE, "Coarser curves.", "Noisier curves.")
    min_separation_gain: float = setting(
        1.5, "-", "Multiple of the recorded motion's own separation that an experiment must reach to be proposed.",
        CHOICE, "Experiments that add little are proposed.", "Useful experiments are not proposed.")
    spectrum_edges_hz: tuple[float, ...] = setting(
        (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4, 12.8, 50.0), "Hz",
        "Bands in which the spectra of two motions are compared.", CHOICE,
        "No other experiment is proposed.", "No other experiment is proposed.")
    default_tolerance: float = setting(
        0.05, "-", "Relative standard deviation of the nominal numbers where none is given.", CHOICE,
        "Good models need a larger tolerance by hand.", "Changed numbers pass as tolerance.")
    experiment_s: float = setting(
        40.0, "s", "Length of a simulated experiment.", CHOICE, "Creep is not excited.", "Slower.")
    experiment_smoothing_s: float = setting(
        0.4, "s", "Length over which corners of a simulated motion of a rig are rounded.", CHOICE,
        "Accelerations that no rig gives.", "Reversals are lost.")
    experiment_overshoot: float = setting(
        1.0, "recorded travels", "Travel beyond the recorded one up to which a simulated experiment counts.", CHOICE,
        "Experiments that move a little further are not proposed.", "Those that drive an axis away are.")
    min_experiment_pressure_pa: float = setting(
        5e4, "Pa", "Least amplitude of a simulated experiment.", CHOICE,
        "Weak experiments are simulated.", "Stronger than some recordings.")
    # Detection limits
    limit_shares: tuple[float, ...] = setting((1.0 / 1024.0, 1.0 / 256.0, 1.0 / 64.0, 1.0 / 16.0, 0.25, 1.0), "-",
        "Shares of an effect's usual size that are tried for its detection limit.", CHOICE,
        "Smaller limits are found.", "Effects that show only beyond their usual size get a limit.")
    limit_samples: int = setting(10_000, "samples", "Samples of a joint's recordings that its detection limits use.",
        CHOICE, "Larger limits of long recordings.", "Slower pages of long recordings.")
    limit_halvings: int = setting(3, "-", "Halvings, of the logarithm, of the interval that holds a detection limit.",
        CHOICE, "Coarser limits, up to a factor 1.4 too large.", "Finer limits, slower pages.")
    limit_min_coordinate: float = setting(0.01, "-", "Least prior coordinate of an amount in Occam's factor.", CHOICE,
        "Smaller guard.", "Larger guard.")
    stated_parts: int = setting(3, "parts", "Numbers that were put back to their nominal values return by one part of"
        " so many, and one, at a time, until the evidence is that of the fit.", CHOICE,
        "Numbers are stated that are not needed.", "Slower.")
    # Certificates
    certificate_share: float = setting(0.1, "-", "Share of the test error that an attack must take away.", CHOICE,
        "Differences of form make findings partial.", "Half of a second effect passes.")
    certificate_samples: int = setting(1500, "samples", "Training samples of an attack, and validation samples.",
        CHOICE, "Weaker attacks.", "Slower.")
    certificate_least_samples: int = setting(200, "samples", "Fewer of either are too few for one.", CHOICE,
        "Attacks that learn noise.", "Short recordings have no certificate.")
    certificate_inducing: int = setting(120, "points", "Inducing points of the Gaussian process.", CHOICE,
        "It misses narrow structure.", "Slower.")
    certificate_lengths: tuple[float, ...] = setting((0.15, 0.5, 1.5), "standard deviations", "Lengths of its kernel.",
        CHOICE, "It misses slow dependences.", "It misses narrow structure.")
    certificate_jitter: float = setting(1e-6, "-", "Added to the kernel's diagonal.", CHOICE, "Unstable factors.",
        "No other result.")
    certificate_ridges: tuple[float, ...] = setting((1e-4, 1e-3, 1e-2, 0.1, 1.0), "-", "Regularisations that are tried,"
        " relative to features of unit variance.", CHOICE, "Attacks that learn noise.", "Weaker attacks.")
    certificate_lags_s: tuple[float, ...] = setting((0.03, 0.1, 0.3, 1.0, 3.0, 10.0), "s", "Time constants of the"
        " lagged inputs.", CHOICE, "Slow memory passes.", "Fast memory passes.")
    certificate_plays: tuple[float, ...] = setting((0.01, 0.05, 0.15), "-", "Half widths of plays among them, relative"
        " to the range of the state.", CHOICE, "Wide plays pass.", "Narrow plays pass.")
    certificate_ahead_pa: float = setting(2e3, "Pa", "Distance of set-point and pressure within which an attack"
        " resolves its sign and size evenly.", CHOICE, "Noise is resolved.", "Small dead bands pass.")
    certificate_range: tuple[float, float] = setting((-4.0, 4.0), "standard deviations", "Range of the inputs, beyond"
        " which an attack does not extrapolate.", CHOICE, "Rare states are lost.", "Products grow outside the data.")
    certificate_least_deviation: float = setting(1e-9, "-", "Deviation of an input, relative to its mean, up to which"
        " it is constant.", CHOICE, "No other result.", "No other result.")
    # Laws of remainders
    remainder_least_angle_rad: float = setting(0.05, "rad", "Range of an angle over which a curve is fitted.", CHOICE,
        "Curves over noise.", "Small motions get no curve.")
    remainder_least_pressure_pa: float = setting(1e4, "Pa", "The same of a pressure.", CHOICE, "As above.", "As above.")
    remainder_tone_share: float = setting(0.1, "-", "Share of a remainder's variance in one line of its spectrum from"
        " which a harmonic of time is tried.", CHOICE, "Slower.", "Weak tones get no law.")
    remainder_turns: tuple[float, float] = setting((3.0, 24.0), "turns", "Harmonics of the angle that are tried, in"
        " turns over its range.", CHOICE, "Curves are taken for slow harmonics.", "Faster ones are found, slower.")
    remainder_turn_step: float = setting(0.25, "turns", "Step between the harmonics that are tried.", CHOICE,
        "Slower.", "A harmonic between two steps is found less exactly.")
    remainder_turn_bound: float = setting(3.0, "prior sd", "How far the frequency of a harmonic may go from the one"
        " found.", CHOICE, "The fit ends at the bound.", "Another harmonic may be taken.")
    remainder_turn: float = setting(0.25, "turns", "Prior deviation of a harmonic over the whole range.", CHOICE,
        "The frequency found by the residual stays.", "A neighbouring minimum may be taken.")
    # fmt: on


SETTINGS = Settings()
"""The settings in force."""
