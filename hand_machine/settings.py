"""The settings of the way from a machine file and its recordings to a model; see hand_recording/settings.py.

The allowed ranges of a machine file and what `--suggest-map` proposes are no settings of a diagnosis.
"""

from __future__ import annotations

from dataclasses import dataclass

from hand_recording.settings import CHOICE, LIMIT, setting


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineSettings:
    """The settings of recordings of other machines than a hand; SI units of the machine."""

    # fmt: off
    # Readings
    min_samples: int = setting(
        100, "samples", "Fewest samples of a recording; the last fifth is test data.", CHOICE,
        "No effect can be confirmed on so few test samples.", "Short recordings are refused.")
    irregular_share: float = setting(
        0.2, "-", "Share of the period by which intervals differ that are called irregular, and share of them that is"
        " reported.", CHOICE, "Jitter is reported.", "Irregular times are not reported.")
    max_missing_readings: float = setting(
        0.5, "-", "A signal with a larger share of missing readings is refused.", CHOICE,
        "Signals with a quarter of gaps are refused.", "No signal is refused for gaps.")
    after_input_gap_s: float = setting(
        0.5, "s", "Time after a gap of the input in which its effect is unknown; not evaluated.", CHOICE,
        "The unknown input influences errors.", "More data are lost.")
    grid_rounding_periods: float = setting(
        1e-3, "periods", "Distance within which a time is that of the grid.", CHOICE, "Rounded times are interpolated.",
        "No other result.")

    # Readings that are repeated
    least_repeated: float = setting(
        0.4, "-", "Least share of rows that repeat the one before in a held signal.", CHOICE,
        "Coarse encoders count as held.", "Held signals count as steps.")
    least_held_steps: float = setting(
        4.0, "steps", "Least step of a held signal, in steps of its resolution.", CHOICE,
        "Coarse encoders count as held.", "Slow held signals count as steps.")
    most_held: float = setting(
        3.0, "-", "Longest repetition, in typical ones, that stands for missing readings.", CHOICE,
        "Held readings count as rest.", "Rest counts as missing readings.")

    # Spikes
    longest_spike: int = setting(
        3, "samples", "Longest spike; what stays away for longer may be motion.", CHOICE, "Longer spikes remain.",
        "Short motion is removed.")
    spike_return_share: float = setting(
        0.5, "-", "Share of a spike's height within which the signal is back after it.", CHOICE, "Spikes on a motion"
        " remain.", "Steps count as spikes.")
    spike_steps: float = setting(
        6.0, "-", "Least height of a spike in usual steps of the signal.", CHOICE, "Fast motion is removed.",
        "Small spikes remain.")
    spike_step_quantile: float = setting(
        0.99, "-", "Quantile of the steps that is a usual one.", CHOICE, "Fast motion is removed.",
        "Not possible above 1.")
    spike_range: float = setting(
        0.02, "-", "Least height of a spike in shares of the signal's range.", CHOICE, "Noise is removed.",
        "Small spikes remain.")
    input_spike_range: float = setting(
        2.0, "-", "The same of an input, whose pulses are real.", CHOICE, "Pulses are removed.", "Spikes remain.")
    range_quantile: float = setting(
        0.005, "-", "Share of the readings beyond either end of a range.", CHOICE, "Spikes widen the range.",
        "Rare motion is outside.")
    miss_quantile: float = setting(
        0.95, "-", "Quantile of how far readings miss the motion around them that is usual.", CHOICE,
        "Fast motion is removed.", "Not possible above 1.")
    misses: float = setting(
        6.0, "-", "Least height of a spike of a position in usual misses.", CHOICE, "Fast motion is removed.",
        "Small spikes remain.")
    resolution_steps: float = setting(
        4.0, "steps", "Least height of such a spike in steps of the resolution.", CHOICE,
        "Steps of an encoder are removed.",
        "Small spikes remain.")
    miss_range: float = setting(
        0.002, "-", "Least height of such a spike in shares of the range.", CHOICE, "Noise is removed.",
        "Small spikes remain.")
    well_sampled: float = setting(
        0.01, "-", "Largest median miss, in shares of the range, of a motion that its neighbours predict.", CHOICE,
        "Spikes of fast motion remain.", "Fast motion is removed.")
    spike_passes: int = setting(
        3, "passes", "Passes over a position; each removes the nearest spike of a group.", CHOICE, "Groups remain.",
        "Slower.")

    # Many samples
    most_samples: int = setting(
        10000, "samples", "Samples of all recordings together from which means of groups are used.", CHOICE,
        "Faster; coarser times.", "Slower.")
    min_thinned_samples: int = setting(
        2000, "samples", "Fewest means of a recording.", CHOICE, "Coarser times of short recordings.", "Slower.")
    thinned_share: float = setting(
        0.005, "-", "Share of a signal's range that means may lose, as the practical noise floor of a force.", CHOICE,
        "Slower.", "Fast changes are lost.")

    # Derivatives
    balance_half_window_s: float = setting(
        0.05, "s", "Half the window of derivatives for the balance of forces.", CHOICE, "Noisier balance.",
        "Fast motion is flattened.")
    window_growth: float = setting(
        1.35, "-", "Ratio of one window of derivatives to the next that is tried.", CHOICE, "Not possible below 1.",
        "Coarser choice.")
    longest_window_s: float = setting(
        0.3, "s", "Longest window; what an axis does within it is lost.", CHOICE,
        "Noisier accelerations of slow motion.",
        "Fast motion is flattened.")
    min_window_samples: int = setting(
        50, "samples", "Fewest samples inside the longest window that is compared.", CHOICE, "Random choice.",
        "Short recordings have short windows.")
    window_doubt: float = setting(
        3.0, "standard errors", "By which two windows must differ more than their noise explains.", CHOICE,
        "Shorter windows: noisier.", "Longer windows: flatter.")
    window_as_good: float = setting(
        1.01, "-", "What a window may leave of the force, relative to the best one.", CHOICE, "Not possible below 1.",
        "Shorter windows: noisier.")
    turning_speed: float = setting(
        0.05, "standard deviations", "Speed around which the direction of motion changes.", CHOICE,
        "Noise at rest counts as motion.", "Slow motion counts as rest.")

    # Scales and tolerances of the model
    effect_share: float = setting(
        0.1, "-", "Share of the torque of a finger that effects may have.", CHOICE, "Large effects are unlikely.",
        "Small effects are missed.")
    lacking_quantile: float = setting(
        0.99, "-", "Quantile of the force that the nominal model lacks that is its size.", CHOICE,
        "Effects of short duration are unlikely.", "Not possible above 1.")
    gain_over_travel: float = setting(
        0.05, "-", "Relative standard deviation of the gain at one end of the travel from that at the other.", CHOICE,
        "Changes of area or lever look like effects.", "Effects pass as such a change.")
    warming_s: float = setting(
        600.0, "s", "Shortest recording in which a machine may warm up or age: short-time duty of IEC 60034-1 (S2).",
        LIMIT, "Drift is offered for shorter recordings.", "It is offered for longer ones only.")
    least_damping: float = setting(
        1e-4, "N m s/rad", "Damping of a finger where the file gives none; a start of fits.", CHOICE,
        "No other result.",
        "No other result.")
    least_speed_loss: float = setting(
        1e-3, "-", "Share of its speed that a free axis loses by this damping in its longest recording, at most.",
        CHOICE, "No other result.", "No other result.")
    least_stiffness: float = setting(
        1e-6, "N m/rad", "The same of the stiffness.", CHOICE, "No other result.", "No other result.")
    least_inertia: float = setting(
        1e-9, "kg m^2", "The same of the inertia.", CHOICE, "No other result.", "No other result.")

    # Is it this machine, in these units?
    alike: float = setting(
        0.8, "-", "Correlation of two forces from which their ratio means something.", CHOICE,
        "Recordings with large effects are refused.", "Wrong signs pass.")
    max_force_ratio: float = setting(
        20.0, "-", "Largest plausible ratio of two such forces; units are off by 57 (degrees) or more.", CHOICE,
        "Wrong numbers are called wrong units.", "Degrees for radians pass.")
    unit_error: float = setting(
        1.3, "-", "Largest factor between a ratio of forces and a unit that the line proposes.", CHOICE,
        "Not possible below 1.", "Wrong units are proposed.")
    vented_range: tuple[float, float] = setting(
        (0.85, 1.1), "atmospheres", "Lowest readings of an absolute pressure sensor that is vented.", LIMIT,
        "Gauge pressures are refused.", "Absolute pressures pass.")
    vented_quantile: float = setting(
        0.01, "-", "Quantile of the readings that is the lowest one.", CHOICE, "Noise decides.",
        "Short vents are missed.")
    absolute_share: float = setting(
        0.15, "-", "Relative distance from the force of the atmosphere at which the lacking force is taken for it.",
        CHOICE, "Absolute pressures pass.", "Gauge pressures are refused.")
    left_share: float = setting(
        0.5, "-", "Share of the error that a correction leaves at most where it is believed.", CHOICE,
        "Swapped loads pass.", "Right recordings are refused.")
    other_machine_ratio: float = setting(
        4.0, "-", "Least ratio of a number to the stated one that shows another machine.", CHOICE,
        "Wrong numbers are refused.", "Other machines pass.")
    other_machine_explained: float = setting(
        0.95, "-", "Share of the variance that the other numbers must explain.", CHOICE,
        "Effects count as another machine.", "Not possible above 1.")
    other_machine_errors: float = setting(
        10.0, "standard errors", "Least difference of each such number, in at least two of them.", CHOICE,
        "Noise counts as another machine.", "Other machines pass.")
    least_force_share: float = setting(
        0.02, "-", "Share of the force from which a stated number counts.", CHOICE,
        "Numbers that do not matter decide.", "Other machines pass.")
    # fmt: on


MACHINE = MachineSettings()
"""The settings in force."""
