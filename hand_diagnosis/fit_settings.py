"""The settings of the data check, the screening and the fits; see settings.py."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hand_recording.settings import CHOICE, LIMIT, setting


@dataclass(frozen=True, slots=True)
class FitPass:
    """One pass of fits over the hypotheses of a round.

    most: number of hypotheses.  iterations: at most.  tolerance: fall of the cost [-] below which a fit ends.
    step_s: largest integration step [s]; a longer step is faster and less exact.
    """

    most: int
    iterations: int
    tolerance: float
    step_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """The settings from the data to the fit of a hypothesis; SI units."""

    # fmt: off
    # Data check
    max_plausible_angle_rad: float = setting(
        2.0 * math.pi, "rad", "Larger angles are not readings of a joint.", LIMIT,
        "Angles beyond half a turn are left out.", "Readings in degrees may pass as angles.")
    max_plausible_pressure_pa: float = setting(
        2e6, "Pa", "Larger pressures are not readings of an actuator.", LIMIT,
        "Recordings of strong supplies lose samples.", "Spikes of the ADC enter the fit.")
    max_spike_share: float = setting(
        0.05, "-", "Up to this share of implausible samples they count as single errors, not as another unit.", CHOICE,
        "More joints are reported as recorded in another unit.", "A wrong unit may pass as spikes.")
    max_missing_share: float = setting(
        0.5, "-", "A joint with a larger share of missing readings is not diagnosed.", CHOICE,
        "Joints with a quarter of gaps are not diagnosed.", "No joint is excluded for gaps.")
    min_rail_s: float = setting(
        0.1, "s", "A noisy signal that keeps its extreme value exactly for this long is saturated.", CHOICE,
        "Coarse quantisation may count as saturation.", "Short saturation enters the fit.")
    max_unit_ratio: float = setting(
        5.0, "-", "Measured over expected size above which another unit is suspected.", CHOICE,
        "Joints with strongly wrong nominal models are refused.", "A wrong unit enters the fit.")
    min_unit_ratio: float = setting(
        3e-3, "-", "Measured over commanded pressure below which another unit is suspected.", CHOICE,
        "kPa read as Pa (1e-3) still shows.", "Valves that hardly open are refused.")
    unit_check_pressure_pa: float = setting(
        2e4, "Pa", "Range of pressure or set-points from which units and channels can be compared.", CHOICE,
        "Noise may look like swapped channels.", "Weakly driven joints are not checked.")
    unit_check_travel_rad: float = setting(
        math.radians(10.0), "rad", "Expected travel from which the measured travel can be compared.", CHOICE,
        "Small loads look like another unit.", "Slightly moved joints are not checked.")
    travel_quantile: float = setting(
        0.02, "-", "Share of samples left out at each end of a range before it is compared.", CHOICE,
        "Single spikes widen the range.", "Short excursions are ignored.")
    max_lost_share: float = setting(
        0.05, "-", "Share of missing frames above which they are reported.", CHOICE,
        "Small losses are reported.", "A tenth of the frames may be missing unsaid.")
    level_quantile: float = setting(
        0.95, "-", "Quantile of a signal that stands for its level.", CHOICE,
        "Meaningless: the median would stand for the level.", "Not possible above 1.")
    swapped_correlation: float = setting(
        0.9, "-", "Correlation with another joint's channel from which channels count as swapped.", CHOICE,
        "Joints that move alike are refused.", "Not possible above 1.")
    swapped_margin: float = setting(
        0.1, "-", "By how much that correlation must exceed the one with the joint's own channel.", CHOICE,
        "Joints that move alike are refused.", "Swapped channels of similar motion are not seen.")
    rerun_max_difference: float = setting(
        0.02, "-", "RMS difference of two runs' set-points, relative to their standard deviation, up to which they are"
        " the same commands.", CHOICE, "Re-runs with lost commands are refused.", "Other commands pass as a re-run.")
    rerun_max_lag_s: float = setting(
        2.0, "s", "A re-run may begin this much earlier or later.", CHOICE,
        "Late re-runs are refused.", "The alignment takes twice as long.")
    rerun_period_tolerance: float = setting(
        0.01, "-", "Relative difference of two sampling periods up to which they are the same.", CHOICE,
        "Re-runs of another clock are refused.", "Misaligned ends count as scatter.")

    # Which joints are diagnosed, and how their readings are taken
    min_travel_rad: float = setting(
        math.radians(2.0), "rad", "A joint that moves less is not diagnosed.", CHOICE,
        "Joints at the level of their noise are diagnosed.", "Stiff joints are not diagnosed.")
    min_pushed_travel_rad: float = setting(
        math.radians(10.0), "rad", "A joint without pressure is diagnosed only above this travel.", CHOICE,
        "Vented joints that are shaken are diagnosed.", "Joints moved by hand are not diagnosed.")
    min_excited_pressure_pa: float = setting(
        1e4, "Pa", "Range of pressure from which a joint counts as excited by it.", CHOICE,
        "Valve noise counts as excitation.", "Gently driven joints are not diagnosed.")
    curve_vote_joints: int = setting(
        5, "joints", "Number of joints that decide whether angles are readings of the described Hall sensors.", CHOICE,
        "One faulty joint can decide.", "The decision takes twice as long.")
    curve_vote_margin: float = setting(
        0.1, "-", "Logarithm of the ratio of costs above which the nominal model alone decides.", CHOICE,
        "Effects may decide instead of the sensors' curve.", "More recordings need the slower comparison.")
    vented_pressure_pa: float = setting(
        5e3, "Pa", "A joint that begins below this pressure begins at its rest angle.", CHOICE,
        "Noise makes the initial creep free.", "Creep at the start is underestimated.")
    rough_iterations: int = setting(
        3, "iterations", "Iterations of fits that prepare inputs or compare two variants.", CHOICE,
        "Inputs keep the error of the nominal model.", "Preparation takes twice as long.")
    min_partner_gain: float = setting(
        4.0, "log", "Log likelihood by which the partner's modelled acceleration must beat its measured one.", CHOICE,
        "Noise decides.", "A faulty sensor on one phalanx shows on the other.")
    bending_leaders: int = setting(
        3, "hypotheses", "Hypotheses of a first round with which a bend of the finger is asked for again.", CHOICE,
        "An effect hides the bend.", "Slower.")
    max_dropped_share: float = setting(
        2e-3, "-", "Share of missing frames from which they are a finding.", CHOICE,
        "Single lost frames are findings.", "Losses of a radio link go unreported.")
    dropped_frames_probability: float = setting(
        0.99, "-", "Probability of that finding; the stamps show it directly.", CHOICE,
        "Understates what is counted.", "Not possible above 1.")

    min_tolerance_joints: int = setting(
        3, "joints", "Joints from which most of them decide about a larger tolerance of the nominal numbers; of fewer,"
        " the evidence with one effect each decides.", CHOICE,
        "An effect on one joint of two may pass as a wrong number.", "Slower.")
    tolerance_moved: float = setting(
        0.9, "tolerances", "RMS change of those nominal numbers of the middle joint that the data determine, from which"
        " a larger tolerance is tried.", CHOICE, "Slower: larger tolerances are tried for right models.",
        "Wrong numbers look like effects.")
    tolerance_factors: tuple[float, ...] = setting(
        (2.0, 4.0), "-", "Larger tolerances that are tried, relative to the given one.", CHOICE,
        "Numbers that are far off look like effects.", "Small effects pass as wrong numbers.")
    tolerance_log_evidence: float = setting(
        3.0, "log", "Log evidence of a larger tolerance from which it replaces the given one of one or two joints, if"
        " their models then leave no more than noise: odds of 20 to 1.", CHOICE,
        "Small effects pass as wrong numbers.", "Wrong numbers look like effects.")
    rough_leaders: int = setting(
        3, "hypotheses", "Of one or two joints: effects that are fitted on before a larger tolerance is believed.",
        CHOICE, "An effect passes as wrong numbers.", "Slower, no other result.")
    # Screening and fitting of hypotheses
    probes_at_once: int = setting(
        32, "probes", "Probes simulated together.", CHOICE, "Slower on many cores.", "More memory.")
    probes_at_once_long: int = setting(
        16, "probes", "The same for long recordings.", CHOICE, "Slower.", "More memory.")
    long_recording_samples: int = setting(
        60_000, "samples", "Samples from which a recording is long.", CHOICE, "Slower.", "More memory.")
    max_probe_share: float = setting(
        3.0, "-", "Multiple of a probe up to which its linear extrapolation is used.", CHOICE,
        "Large effects are underrated.", "Nonlinear effects are overrated.")
    min_promised_gain: float = setting(
        8.0, "cost", "Fall of the cost that a probe must promise for a fit.", CHOICE,
        "More fits of no use.", "Small effects are not fitted.")
    min_promised_share: float = setting(
        0.1, "-", "Share of the cost that the best probe must promise; else starting points are simulated too.", CHOICE,
        "Large nonlinear effects may be missed.", "The search takes longer.")
    hidden_share: float = setting(
        0.8, "-", "Share of a probe's square that the nominal numbers imitate, from which its effect is tried by a"
        " short fit where it promises too little to be fitted.", CHOICE,
        "Slower.", "Effects that the nominal numbers have hidden are not fitted.")
    hidden_gain: float = setting(
        0.3, "-", "Share of the best promise that such a fit must bring.", CHOICE,
        "More fits of no use.", "Hidden effects are not fitted.")
    hidden_iterations: int = setting(
        3, "iterations", "Iterations of such a fit.", CHOICE, "Hidden effects are not fitted.", "Slower.")
    start_share_low: float = setting(
        0.1, "-", "Least share of the way to a probe at which a fit starts.", CHOICE,
        "Fits start too close to the neutral value.", "Small effects start too large.")
    start_share_high: float = setting(
        2.0, "-", "Largest such share.", CHOICE, "Large effects need more iterations.", "Some fits diverge.")
    probes_tried: int = setting(
        6, "probes", "Probes of an effect from which its fit may start.", CHOICE,
        "Local minima of effects with several shapes.", "The search takes longer.")
    probe_shares: tuple[float, ...] = setting(
        (0.1, 0.3, 1.0, 2.5, 6.0), "-", "Shares of the way to each probe at which starts are simulated.", CHOICE,
        "Large effects start too far away.", "Small effects start too far away.")
    horizons: tuple[float, ...] = setting(
        (0.15, 0.4), "-", "Shares of every recording of an axis that was released to which a start is fitted first.",
        CHOICE, "Late swings are fitted by wrong turns.", "Slower.")
    restart_points: int = setting(
        160, "points", "Points elsewhere in the numbers of a leading effect that leaves more than noise.", CHOICE,
        "Right effects stay in a wrong minimum.", "The search takes longer.")
    restart_fits: int = setting(
        4, "fits", "Number of the cheapest of them from which its fit starts again.", CHOICE,
        "Right effects stay in a wrong minimum.", "The search takes longer.")
    restart_reach: float = setting(
        2.5, "prior standard deviations", "Range of these points around the mode of the prior.", CHOICE,
        "Large effects are not reached.", "Most points are useless.")
    restart_change: float = setting(
        0.01, "-", "Relative change of the cost at such a point below which its numbers do not act.", CHOICE,
        "Fits return to where they were.", "Useful points are left out.")
    nominal_iterations: int = setting(
        8, "iterations", "Iterations of a fit of the nominal numbers, or of a known set of effects.", CHOICE,
        "The nominal model keeps avoidable error.", "Slower, no other result.")
    passes: tuple[FitPass, ...] = setting(
        (FitPass(8, 7, 2.0, 5.2e-3), FitPass(5, 10, 0.5, 5.2e-3), FitPass(3, 20, 0.02, 2.6e-3)),
        "hypotheses, iterations, cost, s", "Passes of fits in each round; the first ones are coarse.", CHOICE,
        "With half the hypotheses the right one is sometimes left out.", "Twice the time, no other result.")
    max_evidence_gap: float = setting(
        60.0, "log", "Log evidence behind the best hypothesis from which another is not fitted to the end.", CHOICE,
        "Slowly converging effects lose.", "More fits of no use.")

    # fmt: on
