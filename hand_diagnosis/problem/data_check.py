"""The data check before any physics: gaps, spikes, saturation, wrong units, swapped channels; and repeatability.

Faults of the data are reported and are not taken for physics: single samples are left out, and a joint whose channel
has another unit, is swapped or is mostly missing is excluded. What two recordings of the same commands differ by, no
model can explain; it sets the repeatability below which nothing is claimed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hand_diagnosis.settings import SETTINGS
from hand_identification.settings import FITS
from hand_model.arrays import Array, Flags
from hand_model.joint_model import JointModel
from hand_model.kernel.open_loop import OUTPUTS
from hand_model.kernel.rows import ROW
from hand_model.statics import equilibrium_angle
from hand_recording.interpolation import bridge, longest_gap_s
from hand_recording.signals import Signals, white_noise


@dataclass(frozen=True, slots=True)
class Checked:
    """Signals whose bad samples are marked unknown, lines for the reader, joints that are excluded."""

    signals: Signals
    lines: tuple[str, ...]
    unusable: frozenset[str]

    def without_unusable(self) -> Signals:
        """The signals with every sample of the unusable joints marked unknown."""
        at_fault = [joint in self.unusable for joint in self.signals.joints]
        return replace(self.signals, known=self.signals.known & ~np.array(at_fault, dtype=bool))


def check(signals: Signals, model: JointModel) -> Checked:
    """Check one recording, (T, joints), before it is diagnosed.

    That of another machine was checked when it was read (hand_machine/reading.py): the ranges of a hand do not apply.
    """
    lines, unusable = [], set[str]()
    if signals.machine:
        return Checked(signals, (), frozenset())
    refused = [(joint, f"{joint}: {why}") for joint, why in signals.refused]
    for joint, line in (*refused, *_missing(signals), *_units(signals, model), *_swapped(signals)):
        lines.append(f"{signals.name}: {line}; excluded")
        unusable.add(joint)
    kept, spikes = _without_spikes(signals, unusable)
    kept, rails = _without_rails(kept, unusable)
    lines += [f"{signals.name}: {line}" for line in (*_lost(signals), *_gaps(signals), *spikes, *rails)]
    return Checked(kept, tuple(lines), frozenset(unusable))


def _lost(signals: Signals) -> list[str]:
    """Frames that are missing because a host or a link was too slow."""
    if signals.dropped <= SETTINGS.max_lost_share:
        return []
    return [
        f"{signals.dropped:.0%} of its frames are missing; the host or the link was too slow, and findings about"
        " timing, valves and unknown effects are uncertain"
    ]


def _gaps(signals: Signals) -> list[str]:
    """The longest stretch without any reading; single lost frames are none."""
    shortest = longest_gap_s(signals.period_s) / signals.period_s
    runs = [run for run in _runs(np.asarray(~signals.known.any(axis=1))) if run[1] - run[0] + 1 > shortest]
    if not runs:
        return []
    start, end = max(runs, key=lambda run: run[1] - run[0])
    span = (end - start) * signals.period_s
    return [f"{len(runs)} gaps, the longest of {span:.3g} s at {start * signals.period_s:.3g} s; bridged, not used"]


def _missing(signals: Signals) -> Iterator[tuple[str, str]]:
    for j, joint in enumerate(signals.joints):
        share = 1.0 - float(signals.known[:, j].mean())
        if share > SETTINGS.max_missing_share:
            yield joint, f"{joint}: {share:.0%} of its readings are missing or not finite"


def _units(signals: Signals, model: JointModel) -> Iterator[tuple[str, str]]:
    for j, joint in enumerate(signals.joints):
        angle, pressure = signals.angle_rad[:, j], signals.pressure_pa[:, j]
        if float(np.mean(np.abs(angle) > SETTINGS.max_plausible_angle_rad)) > SETTINGS.max_spike_share:
            yield joint, f"{joint}: angles up to {np.abs(angle).max():.3g} rad; recorded in degrees?"
            continue
        ratio = _pressure_ratio(signals, j)
        if ratio is not None:
            yield joint, f"{joint}: pressures are {ratio:.2g} times their set-points; recorded in another unit?"
            continue
        expected, seen = _expected_travel(model, joint, pressure), float(np.ptp(np.quantile(angle, _ends())))
        compared = signals.has_pressure[j] and expected > SETTINGS.unit_check_travel_rad
        if compared and seen > SETTINGS.max_unit_ratio * expected:
            yield joint, f"{joint}: it moves {seen / expected:.2g} times as far as the model; recorded in another unit?"


def _pressure_ratio(signals: Signals, j: int) -> float | None:
    """Measured over commanded pressure of a joint, where it is implausible; None where it is not."""
    commanded = float(np.quantile(signals.set_point_pa[:, j], SETTINGS.level_quantile))
    measured = float(np.quantile(np.abs(signals.pressure_pa[:, j]), SETTINGS.level_quantile))
    both = signals.has_set_point[j] and signals.has_pressure[j]
    if not both or not commanded > SETTINGS.unit_check_pressure_pa:
        return None
    ratio = measured / commanded
    usual = SETTINGS.min_unit_ratio < ratio < SETTINGS.max_unit_ratio
    return ratio if measured > SETTINGS.max_plausible_pressure_pa or not usual else None


def _ends() -> list[float]:
    return [SETTINGS.travel_quantile, 1.0 - SETTINGS.travel_quantile]


def _expected_travel(model: JointModel, joint: str, pressure_pa: Array) -> float:
    """Travel [rad] of the nominal statics (Eq. 6) between the lowest and highest pressure (T,)."""
    column = model.parameters[:, model.joints.index(joint)]
    a0, a1, a2, a3 = column[ROW["statics.a0_nm"] : ROW["statics.a3_nm_per_pa_rad"] + 1]
    low, high = column[ROW["end_stop.low_deg"]], column[ROW["end_stop.high_deg"]]
    ends = np.clip(np.quantile(pressure_pa, _ends()), 0.0, column[ROW["supply.pressure_pa"]])
    angles = [float(np.clip(equilibrium_angle.py_func(p, 0.0, 0.0, a0, a1, a2, a3, 0.0), low, high)) for p in ends]
    return angles[1] - angles[0]


def _swapped(signals: Signals) -> Iterator[tuple[str, str]]:
    """Joints whose pressure follows another joint's set-point, or whose angle follows another joint's pressure."""
    for what, cause, effect, able in (
        ("pressure follows the set-point", signals.set_point_pa, signals.pressure_pa, signals.has_set_point),
        ("angle follows the pressure", signals.pressure_pa, signals.angle_rad, signals.has_pressure),
    ):
        driven = np.ptp(cause, axis=0) > SETTINGS.unit_check_pressure_pa
        moving = np.flatnonzero(able & driven & (effect.std(axis=0) > 0.0))
        if len(moving) < 2:
            continue
        count = len(moving)
        related = np.corrcoef(cause[:, moving], effect[:, moving], rowvar=False)[:count, count:]
        for k, j in enumerate(moving):
            other = int(np.argmax(related[:, k]))
            if related[other, k] > max(SETTINGS.swapped_correlation, related[k, k] + SETTINGS.swapped_margin):
                joint = signals.joints[j]
                yield joint, f"{joint}: its {what} of {signals.joints[moving[other]]}; swapped channels?"


def _without_spikes(signals: Signals, unusable: set[str]) -> tuple[Signals, list[str]]:
    """Implausible single samples, bridged and marked unknown."""
    angle_limit, pressure_limit = SETTINGS.max_plausible_angle_rad, SETTINGS.max_plausible_pressure_pa
    bad = (np.abs(signals.angle_rad) > angle_limit) | (np.abs(signals.pressure_pa) > pressure_limit)
    bad[:, [joint in unusable for joint in signals.joints]] = False
    if not bad.any():
        return signals, []
    limits = f"beyond ±{np.degrees(angle_limit):.0f} degrees or {pressure_limit:.3g} Pa"
    lines = [
        f"{joint}: {int(bad[:, j].sum())} impossible readings ({limits}); left out"
        for j, joint in enumerate(signals.joints)
        if bad[:, j].any()
    ]
    angle, _ = bridge(np.where(bad, np.nan, signals.angle_rad))
    pressure, _ = bridge(np.where(bad, np.nan, signals.pressure_pa))
    own = None if signals.own is None else signals.own.within(angle_limit, pressure_limit)
    return replace(signals, angle_rad=angle, pressure_pa=pressure, known=signals.known & ~bad, own=own), lines


def _without_rails(signals: Signals, unusable: set[str]) -> tuple[Signals, list[str]]:
    """Stretches in which a noisy signal keeps its extreme value exactly (saturation), marked unknown."""
    known, lines = signals.known.copy(), []
    shortest = max(3, round(SETTINGS.min_rail_s / signals.period_s))
    for j, joint in enumerate(signals.joints):
        if joint in unusable:
            continue
        for name, values in (("angle", signals.angle_rad[:, j]), ("pressure", signals.pressure_pa[:, j])):
            if white_noise(values) == 0.0:
                continue  # a signal without noise at rest looks the same
            for extreme in (float(values.min()), float(values.max())):
                runs = [run for run in _runs((values == extreme) & signals.known[:, j]) if run[1] - run[0] >= shortest]
                for start, end in runs:
                    known[start:end, j] = False
                if runs:
                    total = sum(end - start for start, end in runs) * signals.period_s
                    lines.append(f"{joint}: {name} saturated at {extreme:.4g} for {total:.3g} s; left out")
    return replace(signals, known=known), lines


def _runs(flags: Flags) -> Iterator[tuple[int, int]]:
    """Start and end of each stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def repeatability(signals: Sequence[Signals], reruns: Sequence[Signals]) -> dict[str, Array]:
    """Repeatability (OUTPUTS,) [Pa, rad, N] of each joint: the largest of its re-runs, at least the practical floor.

    An axis of a machine that turns further than once repeats to the same share of its travel.
    Raises ValueError, one line, for a re-run whose commands are those of no recording.
    """
    found: dict[str, Array] = {}
    for recording in (each for each in signals if each.machine):
        for k, joint in enumerate(recording.joints):
            turns = max(float(np.ptp(recording.angle_rad[:, k])) / (2.0 * np.pi), 1.0)
            found[joint] = np.maximum(found.get(joint, np.array(FITS.floor)), np.array(FITS.floor) * (1.0, turns, 1.0))
    for rerun in reruns:
        first = next((recording for recording in signals if _lag(recording, rerun) is not None), None)
        if first is None:
            names = ", ".join(recording.name for recording in signals)
            raise ValueError(f"{rerun.name} is not a re-run: its set-points match none of {names}")
        lag = _lag(first, rerun) or 0
        for joint in first.joints:
            if joint in rerun.joints:
                differing = _difference(first, rerun, joint, lag)
                found[joint] = np.maximum(found.get(joint, np.array(FITS.floor)), differing)
    return found


def _lag(first: Signals, rerun: Signals) -> int | None:
    """Samples by which the commands of a re-run come later; None where the commands differ."""
    alike = np.isclose(first.period_s, rerun.period_s, rtol=SETTINGS.rerun_period_tolerance)
    if not alike or first.joints != rerun.joints:
        return None
    most = round(SETTINGS.rerun_max_lag_s / first.period_s)
    errors = {}
    for lag in range(-most, most + 1):
        a, b = _overlap(first.set_point_pa, rerun.set_point_pa, lag)
        if len(a) > most:
            errors[lag] = float(np.sqrt(np.mean((a - b) ** 2)))
    if not errors:
        return None
    best = min(errors, key=lambda lag: errors[lag])
    return best if errors[best] <= SETTINGS.rerun_max_difference * float(first.set_point_pa.std()) else None


def _overlap(first: NDArray[Any], second: NDArray[Any], lag: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """The parts of two signals that overlap where the second comes `lag` samples later."""
    a, b = (first, second[lag:]) if lag >= 0 else (first[-lag:], second)
    count = min(len(a), len(b))
    return a[:count], b[:count]


def _difference(first: Signals, rerun: Signals, joint: str, lag: int) -> Array:
    """Scatter (OUTPUTS,) of one run: RMS difference of two runs over the root of two, without white noise."""
    i, j = first.joints.index(joint), rerun.joints.index(joint)
    scatter = np.zeros(OUTPUTS)
    known = _overlap(first.known[:, i], rerun.known[:, j], lag)
    for stage, (a, b) in enumerate(
        (
            (first.pressure_pa[:, i], rerun.pressure_pa[:, j]),
            (first.angle_rad[:, i], rerun.angle_rad[:, j]),
            (first.force_n[:, i], rerun.force_n[:, j]),
        )
    ):
        early, late = _overlap(a, b, lag)
        change = np.where(known[0] & known[1], early - late, np.nan)[round(FITS.settling_s / first.period_s) :]
        change = change[np.isfinite(change)]
        if len(change) > 3:
            scatter[stage] = np.sqrt(max(float(np.mean(change**2)) - white_noise(change) ** 2, 0.0) / 2.0)
    return scatter
