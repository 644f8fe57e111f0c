"""How a setting is documented, and the settings of the way from a recording to signals on one clock.

Every setting states its meaning, unit and source, and what changes when it is halved or doubled. The values are written
to report.json, and docs/settings.md has the table. Formats of files and limits of memory are no settings.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

CHOICE = "engineering choice"
TRIALS = "calibrated on blind trials"
FORMS = "log score of development forms (validation/development.py)"
LIMIT = "physical limit of hand and actuators"


def setting(value: Any, unit: str, meaning: str, source: str, halved: str, doubled: str) -> Any:
    """A field of the settings with its documentation; value in the unit [text] that the field names."""
    about = {"unit": unit, "meaning": meaning, "source": source, "halved": halved, "doubled": doubled}
    return field(default=value, metadata=about)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingSettings:
    """The settings that turn stamps and readings into signals without gaps; SI units."""

    # fmt: off
    # Length and rate of a recording
    max_samples: int = setting(
        1_000_000, "samples", "Largest number of samples of a recording (83 minutes at 200 Hz).", CHOICE,
        "Recordings above 41 minutes are refused.", "Fits need twice the memory.")
    min_recording_s: float = setting(
        2.0, "s", "Shortest recording of a hand.", CHOICE, "Recordings that are mostly settling are read.",
        "Short recordings are refused.")
    nominal_rate_range: tuple[float, float] = setting(
        (0.8, 1.25), "-", "Measured over nominal rate within which the nominal rate counts.", CHOICE,
        "Not possible: the range would not contain 1.", "Boards at half or twice the rate are read at the nominal one.")
    longest_gap_s: float = setting(
        0.05, "s", "Readings farther apart are a gap, within which a signal is not known.", CHOICE,
        "Single lost frames are gaps.", "Straight lines replace turns of a finger.")
    longest_gap_periods: float = setting(
        3.5, "periods", "The same in sample periods; both must be exceeded.", CHOICE,
        "Single lost frames of slow recordings are gaps.", "Straight lines replace motion.")
    radians_range_deg: tuple[float, float] = setting(
        (0.2, 3.2), "deg", "A column of degrees that varies by more than the first number and never exceeds the second"
        " one is taken for radians, and the table is refused.", CHOICE, "Columns of radians pass.",
        "Small motions are refused.")
    max_table_angle_deg: float = setting(
        360.0, "deg", "Largest angle in a table.", LIMIT, "Angles of a wrong zero are refused.", "Wrong units pass.")

    # Stamps that scatter around a steady clock
    min_scatter_periods: float = setting(
        0.02, "periods", "Scatter of stamps below which readings stay at their stamps.", CHOICE,
        "The comparison is made for scatter that does not matter.", "Errors of readings by their stamps remain.")
    max_scatter_periods: float = setting(
        0.35, "periods", "Scatter beyond which a table has no steady clock; times spread evenly scatter by 0.29.",
        CHOICE,
        "Clocks of busy hosts are not found.", "Samples at random times get a clock.")
    max_complete_scatter_periods: float = setting(
        0.45, "periods", "The same where hardly a tick is without a row.", CHOICE,
        "Clocks of busy hosts are not found at high rates.", "Samples at random times get a clock.")
    complete_clock: float = setting(
        0.01, "-", "Share of ticks without a row up to which a clock counts as complete.", CHOICE,
        "Clocks with a few lost rows are not found.", "Samples at random times get a clock.")
    noise_seed: int = setting(
        0, "-", "Seed of the noise by which clocks, and lines between readings, are tried.", CHOICE, "Another draw.",
        "Another draw.")
    own_reading_periods: float = setting(
        0.75, "periods", "Distance within which a reading is that of a time.", CHOICE,
        "Readings of irregular tables count as interpolated.", "Interpolated samples count as readings.")
    clearly_smoother: float = setting(
        0.9, "-", "Ratio of roughnesses from which one of two clocks is the right one.", CHOICE,
        "No clock is ever decided.", "Not possible above 1: noise decides.")
    motion_share: float = setting(
        0.99, "-", "Share of the third differences that count for the roughness, without the largest (spikes).", CHOICE,
        "Jitter during fast motion is not seen.", "Not possible above 1.")
    pressure_on_grid_periods: float = setting(
        0.02, "periods", "Distance of pressure stamps from the ticks that is ignored.", CHOICE,
        "Slower reading of some recordings.", "Pressures are late by up to that share.")
    steady_pressure_periods: float = setting(
        0.1, "periods", "Largest scatter of that distance at which each tick gets its nearest pressure.", CHOICE,
        "Steps of pressure are smoothed by interpolation.", "Pressures are put at wrong times.")
    delay_quantiles: tuple[float, float, float] = setting(
        (0.1, 0.5, 0.9), "-", "Quantiles of that distance that give its value and scatter.", CHOICE,
        "Single late frames count as scatter.", "Not possible above 1.")

    # Set-points
    faster_rate: float = setting(
        1.25, "-", "Ratio of two rates that is clearly above 1.", CHOICE,
        "Not possible: equal rates would differ.", "Boards at twice the sample rate are not recognised.")
    multiple_tolerance: float = setting(
        0.02, "-", "Relative deviation from a whole multiple that an error of the clocks explains.", CHOICE,
        "Times of the board's ticks are unknown more often.", "Set-points act at wrong ticks.")
    part_s: float = setting(
        2.5e-3, "s", "Parts of a sample in which set-points act where the ticks of the board are unknown.", CHOICE,
        "Slower.", "Set-points act later, up to one such part.")
    lost_step_pa: float = setting(
        5e3, "Pa", "Change of a set-point over a missing row of a table, beyond its slope: a lost step.", CHOICE,
        "Fast but smooth set-points are left out, too.", "Steps at unknown times count as errors of the model.")
    jump_share: float = setting(
        0.3, "-", "Share of the change of a set-point from row to row, beyond its slope, from which it jumped.", CHOICE,
        "Fast but smooth set-points are taken for steps.", "Steps that follow each other are taken for slopes.")
    lost_step_s: float = setting(
        0.3, "s", "Time after a lost step for which the readings of its joint are left out.", CHOICE,
        "Slow valves have not settled.", "More readings are left out than need be.")
    clearly_beyond_chance: float = setting(
        2.0, "-", "Relative difference of two errors, times the root of the samples, that is no chance.", CHOICE,
        "Chance decides when set-points came into force.", "The stamps of rows count although pressures differ.")
    most_between_rows: float = setting(
        0.15, "-", "Share of the rows of a table between which set-points step, up to which the pressures say when.",
        CHOICE, "Joints with quick steps are not diagnosed.", "Hardly a reading is left that does not place a step.")
    late_commands_s: float = setting(
        0.02, "s", "Set-points sent later than this after the stamp of their frame are reported.", CHOICE,
        "Controllers of normal speed are reported.", "Busy hosts are not reported.")
    late_quantile: float = setting(
        0.95, "-", "Quantile of these delays that is compared.", CHOICE, "Few late commands are not reported.",
        "Not possible above 1.")

    # Clocks of different topics
    foreign_clock_ns: float = setting(
        1e9, "ns", "Publish times farther from the stamps are those of another clock.", CHOICE,
        "Delays of half a second count as another clock.", "Clocks that differ by a second are not recognised.")
    clock_offset_ns: float = setting(
        2e6, "ns", "Smallest difference of two topics' delays that is reported as different clocks.", CHOICE,
        "Delays of drivers are reported.", "Offsets of 4 ms are not reported.")
    clock_quartiles: tuple[float, float, float] = setting(
        (0.25, 0.5, 0.75), "-", "Quantiles of a delay that give its value and scatter.", CHOICE,
        "Offsets in noisy delays are not reported.", "Not possible above 1.")
    clock_blocks: int = setting(
        20, "blocks", "Parts of a recording whose promptest frames give the rate of a player's clock.", CHOICE,
        "Less exact rate.", "Busy hosts change the rate.")
    small_delay_quantile: float = setting(
        0.1, "-", "Quantile of the frames' delays that counts as that of a host that is not busy.", CHOICE,
        "Single early frames decide.", "Delays of a busy host remain.")
    player_rate_range: tuple[float, float] = setting(
        (0.01, 100.0), "-", "Plausible rates of a player.", CHOICE, "Slower replays are read by their stamps.",
        "Faster replays are read with their clock.")

    calendar_s: tuple[float, float] = setting(
        (1e9, 1e10), "s since 1970", "Stamps of a clock that knows the date, 2001 to 2286.", CHOICE,
        "Clocks that start at zero date recordings.", "Recordings before 2033 have no date.")

    # Derivatives, noise and smoothing
    smoothing_s: float = setting(
        0.045, "s", "Window over which speed and acceleration are computed from angles of a hand.", CHOICE,
        "Noisier accelerations.", "Fast motion of a finger is flattened.")
    noise_quantile: float = setting(
        0.9, "-", "Quantile at which differences and cross-validation errors are clipped.", CHOICE,
        "Noise is underestimated where readings are quantised.", "Not possible above 1.")
    quiet_noise_share: float = setting(
        0.3, "-", "Share of the clipped RMS of differences that is noise at least, where most of them are 0.", CHOICE,
        "Quantised signals count as more exact.", "They count as noisier.")
    input_windows_s: tuple[float, ...] = setting(
        (0.07, 0.15, 0.3, 0.6, 1.2), "s", "Windows of the smoothing of an input to choose from.", CHOICE,
        "More noise of inputs remains.", "Inputs of fast motion are not smoothed.")
    kept_edge_deviations: float = setting(
        3.5, "standard deviations", "Where smoothing changes a signal by more than this, the signal is kept.", CHOICE,
        "Noise remains.", "Edges of steps are smoothed.")
    window_confidence: float = setting(
        3.0, "standard deviations", "Half width of the confidence intervals by which the window of a sample is chosen.",
        CHOICE, "Shorter windows: more noise.", "Longer windows: edges are smoothed.")
    # fmt: on


READING = ReadingSettings()
"""The settings in force."""
