"""The data check before any physics: gaps, spikes, rails, wrong units, swapped channels.

What is wrong with the data is said, and is not taken for physics: single samples are left out, and a joint whose
channel is in another unit, swapped or mostly missing is not judged at all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from hand_model.arrays import Array, Flags
from hand_model.description import Hand
from hand_model.kernel.rows import ROW
from hand_model.statics import equilibrium_angle
from hand_recording.interpolation import bridge
from hand_recording.signals import Signals, white_noise

FARTHEST_RAD, HIGHEST_PA = 2.0 * np.pi, 2e6
"""No joint is there, no actuator survives it."""
SPIKES = 0.05
"""Share of impossible samples up to which they are single errors, not another unit."""
MOSTLY_MISSING = 0.5
RAIL_S = 0.1
"""A noisy signal that keeps its very highest or lowest value for so long is at a rail."""
SCALE, NOTHING = 5.0, 3e-3
"""Factor between what was measured and what was asked or expected from which it is another unit, and below which it
is; a joint that is held or a valve that hardly opens is no unit."""
EXCITED_PA, EXPECTED_RAD = 2e4, np.radians(10.0)
OTHER, CLOSER = 0.9, 0.1
"""Correlation with another joint's channel from which, and by how much above the own one's, channels are swapped."""


@dataclass(frozen=True, slots=True)
class Checked:
    """Signals whose bad samples are marked unknown, lines for the reader, joints that must not be judged."""

    signals: Signals
    lines: tuple[str, ...]
    unusable: frozenset[str]


def check(signals: Signals, hand: Hand) -> Checked:
    """Look at one recording before it is diagnosed."""
    lines, unusable = [], set[str]()
    if signals.machine:
        return Checked(signals, tuple(f"{signals.name}: {line}" for line in _gaps(signals)), frozenset())
    for joint, line in (*_missing(signals), *_units(signals, hand), *_swapped(signals)):
        lines.append(f"{signals.name}: {line}; not judged")
        unusable.add(joint)
    kept, spikes = _without_spikes(signals, unusable)
    kept, rails = _without_rails(kept, unusable)
    lines += [f"{signals.name}: {line}" for line in (*_gaps(signals), *spikes, *rails)]
    return Checked(kept, tuple(lines), frozenset(unusable))


def _gaps(signals: Signals) -> list[str]:
    """The longest stretch without any reading."""
    lost = np.asarray(~signals.known.any(axis=1))
    runs = list(_runs(lost))
    if not runs:
        return []
    start, end = max(runs, key=lambda run: run[1] - run[0])
    span = (end - start) * signals.period_s
    return [f"{len(runs)} gaps, the longest of {span:.3g} s at {start * signals.period_s:.3g} s; bridged, not judged"]


def _missing(signals: Signals) -> Iterator[tuple[str, str]]:
    for j, joint in enumerate(signals.joints):
        share = 1.0 - float(signals.known[:, j].mean())
        if share > MOSTLY_MISSING:
            yield joint, f"{joint}: {share:.0%} of its readings are missing or not finite"


def _units(signals: Signals, hand: Hand) -> Iterator[tuple[str, str]]:
    for j, joint in enumerate(signals.joints):
        angle, pressure = signals.angle_rad[:, j], signals.pressure_pa[:, j]
        far = float(np.mean(np.abs(angle) > FARTHEST_RAD))
        if far > SPIKES:
            yield joint, f"{joint}: angles up to {np.abs(angle).max():.3g} rad; degrees?"
            continue
        asked = float(np.quantile(signals.set_point_pa[:, j], 0.95))
        given = float(np.quantile(np.abs(pressure), 0.95))
        if signals.has_set_point[j] and signals.has_pressure[j] and asked > EXCITED_PA:
            ratio = given / asked
            if given > HIGHEST_PA or not NOTHING < ratio < SCALE:
                yield joint, f"{joint}: pressures are {ratio:.2g} times their set-points; another unit?"
                continue
        expected, seen = _expected_travel(hand, joint, pressure), float(np.ptp(np.quantile(angle, [0.02, 0.98])))
        if signals.has_pressure[j] and expected > EXPECTED_RAD and seen > SCALE * expected:
            yield joint, f"{joint}: it moves {seen / expected:.2g} times as far as the model; another unit?"


def _expected_travel(hand: Hand, joint: str, pressure: Array) -> float:
    """How far the nominal statics (Eq. 6) would move the joint between its lowest and highest pressure [rad]."""
    column = hand.parameters[:, hand.joints.index(joint)]
    a0, a1, a2, a3 = column[ROW["statics.a0_nm"] : ROW["statics.a3_nm_per_pa_rad"] + 1]
    low, high = column[ROW["end_stop.low_deg"]], column[ROW["end_stop.high_deg"]]
    ends = np.clip(np.quantile(pressure, [0.02, 0.98]), 0.0, hand.supply_pressure_pa)
    angles = [float(np.clip(equilibrium_angle(p, 0.0, 0.0, a0, a1, a2, a3, 0.0), low, high)) for p in ends]
    return angles[1] - angles[0]


def _swapped(signals: Signals) -> Iterator[tuple[str, str]]:
    """Joints whose pressure follows another joint's set-point, or whose angle another joint's pressure."""
    for what, cause, effect, able in (
        ("pressure follows the set-point", signals.set_point_pa, signals.pressure_pa, signals.has_set_point),
        ("angle follows the pressure", signals.pressure_pa, signals.angle_rad, signals.has_pressure),
    ):
        moving = np.flatnonzero(able & (np.ptp(cause, axis=0) > EXCITED_PA) & (effect.std(axis=0) > 0.0))
        if len(moving) < 2:
            continue
        count = len(moving)
        related = np.corrcoef(cause[:, moving], effect[:, moving], rowvar=False)[:count, count:]
        for k, j in enumerate(moving):
            other = int(np.argmax(related[:, k]))
            if related[other, k] > max(OTHER, related[k, k] + CLOSER):
                joint = signals.joints[j]
                yield joint, f"{joint}: its {what} of {signals.joints[moving[other]]}; swapped channels?"


def _without_spikes(signals: Signals, unusable: set[str]) -> tuple[Signals, list[str]]:
    """Impossible single samples, bridged and marked unknown."""
    bad = (np.abs(signals.angle_rad) > FARTHEST_RAD) | (np.abs(signals.pressure_pa) > HIGHEST_PA)
    bad[:, [joint in unusable for joint in signals.joints]] = False
    if not bad.any():
        return signals, []
    lines = [
        f"{joint}: {int(bad[:, j].sum())} impossible readings (beyond ±{np.degrees(FARTHEST_RAD):.0f} degrees or"
        f" {HIGHEST_PA * 1e-5:.0f} bar); left out"
        for j, joint in enumerate(signals.joints)
        if bad[:, j].any()
    ]
    angle, _ = bridge(np.where(bad, np.nan, signals.angle_rad))
    pressure, _ = bridge(np.where(bad, np.nan, signals.pressure_pa))
    return replace(signals, angle_rad=angle, pressure_pa=pressure, known=signals.known & ~bad), lines


def _without_rails(signals: Signals, unusable: set[str]) -> tuple[Signals, list[str]]:
    """Stretches in which a noisy signal keeps its extreme value exactly, marked unknown."""
    known, lines = signals.known.copy(), []
    shortest = max(3, round(RAIL_S / signals.period_s))
    for j, joint in enumerate(signals.joints):
        if joint in unusable:
            continue
        for name, values in (("angle", signals.angle_rad[:, j]), ("pressure", signals.pressure_pa[:, j])):
            if white_noise(values) == 0.0:
                continue  # without noise, rest looks the same
            for extreme in (float(values.min()), float(values.max())):
                runs = [run for run in _runs((values == extreme) & signals.known[:, j]) if run[1] - run[0] >= shortest]
                for start, end in runs:
                    known[start:end, j] = False
                if runs:
                    total = sum(end - start for start, end in runs) * signals.period_s
                    lines.append(f"{joint}: {name} at a rail ({extreme:.4g}) for {total:.3g} s; left out")
    return replace(signals, known=known), lines


def _runs(flags: Flags) -> Iterator[tuple[int, int]]:
    """Start and end of each stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
