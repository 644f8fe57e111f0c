"""The settings of the fit of a joint: floors, blocks, priors, steps; documented as in hand_recording/settings.py."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hand_recording.settings import CHOICE, LIMIT, setting


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentificationSettings:
    """The settings of the least-squares problem of a joint and of its fit; SI units."""

    # fmt: off
    # Floors and independent samples
    floor_pa: float = setting(
        300.0, "Pa", "Practical repeatability of a pressure, correlated over correlation_s; smaller differences have no"
        " cause that is named.", LIMIT, "Effects of the size of daily changes are found.", "Small effects are missed.")
    floor_rad: float = setting(
        math.radians(0.05), "rad", "The same of an angle.", LIMIT, "As above.", "As above.")
    floor_n: float = setting(0.05, "N", "The same of a force.", LIMIT, "As above.", "As above.")
    min_floors_taken: float = setting(
        0.6, "floors", "Error that an effect must remove (root of the fall of the mean square).", CHOICE,
        "Effects below the repeatability are claimed.", "Small effects are missed.")
    correlation_s: float = setting(
        0.5, "s", "Distance of samples that count as independent.", CHOICE,
        "False findings from correlated errors.", "Small effects need longer recordings.")
    uncorrelated: float = setting(
        0.05, "-", "Autocorrelation below which residuals count as uncorrelated.", CHOICE,
        "Fewer independent samples.", "More independent samples than there are.")
    max_lag_share: float = setting(
        0.25, "-", "Largest lag of that autocorrelation, in lengths of the recording.", CHOICE,
        "Short recordings count as less correlated.", "Lags with few samples decide.")

    # Samples that count
    settling_s: float = setting(
        0.5, "s", "Time after the start during which the unknown initial state matters; not evaluated.", CHOICE,
        "The initial state influences errors.", "Short recordings lose data.")
    touching_n: float = setting(
        0.3, "N", "Forces are evaluated only above this.", CHOICE, "Noise counts as contact.",
        "Light contacts are ignored.")
    starting_s: float = setting(
        0.15, "s", "Length of the polynomial through the first angles.", CHOICE,
        "Noisier first speed.", "Turns within it falsify the first speed.")
    starting_order: int = setting(
        4, "-", "Order of that polynomial.", CHOICE, "Curved starts have a wrong speed.", "Noisier first speed.")
    in_motion_rad_s: float = setting(
        0.3, "rad/s", "A slower first speed counts as rest.", CHOICE, "Noise counts as a first speed.",
        "Slow starts are taken for rest.")

    # Validation data
    block_s: float = setting(
        1.25, "s", "Length of the blocks into which a recording is divided for validation data and the bootstrap.",
        CHOICE,
        "Blocks are correlated.", "Fewer blocks, less significant differences.")
    min_blocks: int = setting(
        6, "blocks", "Least blocks of a recording.", CHOICE, "Short recordings have one or two validation blocks.",
        "Blocks of short recordings are correlated.")
    validation_every_block: int = setting(
        3, "blocks", "One of so many blocks is validation data.", CHOICE, "Every block is validation data.",
        "Less certain choices.")

    # Free parameters and their priors
    max_tolerances: float = setting(
        3.0, "tolerances", "Bounds of a nominal number around its nominal value.", CHOICE,
        "Wrong numbers look like effects.", "Effects pass as wrong numbers.")
    least_dead_time_s: float = setting(
        0.002, "s", "Least dead time to which the relative tolerance is applied: one step.", CHOICE,
        "Dead times of 0 are hardly free.", "They are wider.")
    least_torque_nm: float = setting(
        0.01, "N m", "Least offset a0 to which the relative tolerance is applied.", CHOICE,
        "Offsets of 0 are hardly free.", "They are wider.")
    dead_time_tolerance: float = setting(
        0.4, "-", "Relative tolerance of the dead time: a set-point waits for the board's tick, which adds to it.",
        CHOICE,
        "The tick looks like a delay.", "Delays pass as the tick.")
    stop_tolerance: float = setting(
        0.05, "-", "Largest tolerance of the angle of an end stop, relative to the larger of it and half the range.",
        CHOICE, "Stops a little off look like effects.", "Stops that are clearly off pass as wrong numbers.")
    impact_margin: float = setting(
        0.05, "range", "Distance from an end stop from which a fast joint is about to hit it.", CHOICE,
        "Impacts on stops that are nearer count.", "Fast motion near a stop is left out.")
    impact_rad_s: float = setting(
        1.0, "rad/s", "Speed towards an end stop from which the joint hits it.", CHOICE,
        "Slow contacts are left out.", "Soft impacts count.")
    impact_s: float = setting(
        0.15, "s", "Time after an impact in which the angle does not count: how it passes depends on the material.",
        CHOICE, "Stops of another material look like unknown physics.", "Fewer data.")
    effect_spread: float = setting(
        3.0, "typical sizes", "Standard deviation of the prior of an effect's parameter.", CHOICE,
        "Large effects are underestimated.", "Lower evidence of every effect.")
    log_spread: float = setting(
        0.7, "log", "The same of the logarithm of a number that has only a ratio.", CHOICE,
        "Ratios of 2 are unlikely.", "Lower evidence of such effects.")
    absent_share: float = setting(
        0.1, "typical sizes", "Size below which a model lacks a number.", CHOICE,
        "Small numbers are scaled, though their effect is new.", "Small numbers count as absent.")
    rested_creep: float = setting(
        0.1, "-", "Standard deviation of the initial creeping ratio of a joint that begins at rest without pressure.",
        CHOICE, "Creep left from before is not fitted.", "Less exact material.")
    unrested_creep: float = setting(
        0.3, "-", "The same of any other joint.", CHOICE, "Creep at the start is underestimated.",
        "Less exact material.")
    first_speed_rad_s: float = setting(
        0.1, "rad/s", "Standard deviation of an estimated first speed.", CHOICE, "Its error looks like an effect.",
        "Less exact starts.")
    first_speed_share: float = setting(
        0.05, "-", "What a share of that speed adds to it.", CHOICE, "As above.", "As above.")
    max_coordinate: float = setting(
        8.0, "prior standard deviations", "Largest coordinate of a fit.", CHOICE, "Very large effects are not reached.",
        "Fits leave the range of their numbers.")

    # Steps between the rows of a table
    step_shares: tuple[tuple[float, ...], ...] = setting(
        ((-0.45, -0.15, 0.15, 0.45), (-0.15, 0.0, 0.15), (-0.05, 0.0, 0.05)), "rows",
        "Times of a step at an unknown time that are tried, around the best one of the round before.", CHOICE,
        "Steps are placed less exactly.", "Slower.")
    step_window_s: float = setting(
        0.1, "s", "Readings behind such a step that say when it came.", CHOICE,
        "Noise of the readings moves the steps.", "What the valve lacks moves the steps.")
    step_gain: float = setting(
        0.9, "-", "Squared errors of the pressures of a table with set-points between its rows, over those with"
        " set-points at the rows, from which they stay there.", CHOICE,
        "Set-points between rows count as errors of the model.", "Not possible above 1.")
    step_tolerance: float = setting(
        0.2, "-", "Relative standard deviation of the numbers of the valve while that is decided.", CHOICE,
        "Wrong numbers look like late set-points.", "Late set-points look like wrong numbers.")
    step_iterations: int = setting(
        4, "iterations", "Iterations of those fits.", CHOICE, "As above.", "Slower.")
    step_rounds: int = setting(
        2, "rounds", "Rounds in which steps are placed and the numbers fitted.", CHOICE, "Less exact.", "Slower.")
    step_samples: int = setting(
        3, "samples", "Readings that do at least.", CHOICE, "As above.", "As above.")

    # Steps of a fit
    integration_step_s: float = setting(
        2.6e-3, "s", "Largest integration step where a fit names none.", CHOICE, "Slower.", "Less exact.")
    difference: float = setting(
        0.002, "prior standard deviations", "Step of the finite differences.", CHOICE, "Rounding errors.",
        "Slopes of curved terms are less exact.")
    longest_step: float = setting(
        0.7, "prior standard deviations", "Longest change of a coordinate in a step.", CHOICE, "More iterations.",
        "Steps beyond the range in which slopes hold.")
    longest_bold: float = setting(
        4.0, "prior standard deviations", "The same of one bold trial.", CHOICE, "More iterations of large effects.",
        "The trial fails more often.")
    longest_careful: float = setting(
        0.15, "prior standard deviations", "The same of one careful trial.", CHOICE,
        "More iterations where it is needed.",
        "Fits of stiff terms end early.")
    dampings: tuple[float, ...] = setting(
        (0.0, 1e-3, 1e-2, 0.1, 1.0, 30.0), "-", "Dampings of the trial steps; with the two trials above they fill eight"
        " lanes.", CHOICE, "Ill-conditioned fits end early.", "More iterations.")
    fallback_shares: tuple[float, ...] = setting(
        (1.0, 0.9, 0.7, 0.5, 0.3, 0.1, 0.0), "-", "Shares of the way to a start that are tried until its simulation is"
        " finite.", CHOICE, "Starts are given up too early.", "Slower.")
    longest_scale: float = setting(
        0.7, "-", "Largest logarithm of the common factor by which all torques return to their prior.", CHOICE,
        "Torques that are all far too large stay so.", "No other result.")
    least_scale_gain: float = setting(
        1.0, "nats", "Least fall of the cost by the prior for which that is tried.", CHOICE, "Slower.",
        "Torques keep a common error.")
    idle_information: float = setting(
        0.01, "-", "Information of the data in a number, relative to that of its prior, below which it is idle.",
        CHOICE, "Stops that a fit has stepped away from stay there.", "Numbers that the data show a little lose that.")
    idle_difference: float = setting(
        0.01, "sigma", "Difference of an idle number from its expected value that is left as it is.", CHOICE, "Slower.",
        "Stops stay a little wrong.")
    idle_cost: float = setting(
        1.0, "cost", "Rise of the cost below which an idle number gets its expected value.", CHOICE,
        "Stops that a fit has stepped away from stay there.", "Numbers that fit better are lost.")
    iterations: int = setting(
        12, "iterations", "Iterations of a fit where none are given.", CHOICE, "Fits end early.", "No other result.")
    tolerance: float = setting(
        0.02, "cost", "Fall of the cost below which a fit ends.", CHOICE, "Slower.", "Fits end early.")
    relative_tolerance: float = setting(
        1e-4, "-", "The same relative to the cost.", CHOICE, "Slower.", "Fits end early.")
    first_iterations: int = setting(
        4, "iterations", "Iterations from every one of several starts.", CHOICE, "The wrong start is continued.",
        "Slower.")
    last_iterations: int = setting(
        25, "iterations", "Iterations from the two best of them.", CHOICE, "Fits end early.", "No other result.")
    diverged: float = setting(
        1e60, "-", "Size of a residual at which its simulation has diverged.", CHOICE, "No other result.",
        "No other result.")

    # Starts elsewhere, and standard errors
    released_every: int = setting(
        4, "points", "One of so many points elsewhere releases the nominal numbers.", CHOICE,
        "Fewer points change effects.", "Shifted numbers hold fits in a wrong minimum.")
    bound_share: float = setting(
        0.5, "-", "Probability that a number elsewhere is drawn at one of its bounds.", CHOICE,
        "Effects that end at a bound are missed.", "No other numbers are tried.")
    error_group_blocks: tuple[int, int] = setting(
        (1, 4), "blocks", "Blocks of a group in the standard errors; a recording is a group, too.", CHOICE,
        "Standard errors are too small where errors are slow.", "Too few groups in short recordings.")
    least_error_groups: int = setting(
        3, "groups", "Fewer groups give no information on their scatter.", CHOICE, "Random standard errors.",
        "Short recordings have none.")
    # fmt: on

    @property
    def floor(self) -> tuple[float, float, float]:
        """Practical repeatability of pressure, angle and force (Pa, rad, N)."""
        return self.floor_pa, self.floor_rad, self.floor_n

    @property
    def wide(self) -> dict[str, float]:
        """Relative tolerances [-] of numbers that are less certain than a nominal number, by key."""
        return {
            "valve.dead_time_s": self.dead_time_tolerance,
        }

    @property
    def least_sizes(self) -> dict[str, float]:
        """Least sizes [SI] of nominal numbers to which the relative tolerance is applied, by key."""
        return {"valve.dead_time_s": self.least_dead_time_s, "statics.a0_nm": self.least_torque_nm}

    @property
    def trials(self) -> tuple[tuple[float, float], ...]:
        """Damping [-] and longest change [prior standard deviations] of the trial steps, simulated together."""
        return (
            *((damping, self.longest_step) for damping in self.dampings),
            (0.0, self.longest_bold),
            (0.0, self.longest_careful),
        )


FITS = IdentificationSettings()
"""The settings in force."""
