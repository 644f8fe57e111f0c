"""What in the balance of forces shows wrong signs or units, absolute pressure, swapped loads or another machine.

Each check refuses only what no effect of the catalogue explains, and its line says what to change.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hand_machine.balance import balance, motion
from hand_machine.description import MachineDescription
from hand_machine.reading import Readings
from hand_machine.settings import MACHINE
from hand_model.arrays import Array
from hand_model.effects.effect import ATMOSPHERE_PA
from hand_recording.recording_files import RecordingError

MIN_KNOWN = 5
"""Samples from which a regression on the motion is determined."""
UNITS = {1e3: "milli- or kilo-units, as mm", 180.0 / np.pi: "degrees", 1e5: "bar"}
"""Units that are often forgotten, by the ratio of forces that follows, or its inverse."""


def check_plausible(described: MachineDescription, path: Path, table: Readings) -> None:
    """Refuse a recording whose force is that of the nominal model with the other sign or in another unit.

    Only where the two are alike: what the model lacks may be as large as what it has. Raises RecordingError, one line.
    """
    _check_period(described, path, table)
    forces = balance(described, table)
    if forces is None or table.known.sum() < MIN_KNOWN:
        return
    _check_gauge(described, path, table)
    driving, passive = (force[table.known] for force in forces)
    measured, expected = (
        (table.signals["force"][table.known], driving - passive)
        if described.imposed
        else (
            driving,
            passive,
        )
    )
    if np.std(measured) == 0.0 or np.std(expected) == 0.0:
        return
    needed = float(np.std(expected) / np.std(measured))
    if described.imposed and needed > MACHINE.max_force_ratio:
        raise RecordingError(
            f"{path}: the model needs {needed:.2g} times the measured force for this motion; check that the recording"
            f" is of the machine that {described.path.name} describes, and the units of force and position (key scale)"
        )
    alike = float(np.corrcoef(measured, expected)[0, 1])
    pair = ("force", "the motion and input") if described.imposed else ("input", "the motion")
    if alike < -MACHINE.alike:
        raise RecordingError(
            f"{path}: the {pair[0]} has the opposite sign of what the model expects from {pair[1]} (correlation"
            f" {alike:.2f}); change the sign of columns.{pair[0]}.scale or columns.position.scale"
        )
    ratio = float(np.std(measured) / np.std(expected))
    if alike > MACHINE.alike and not 1.0 / MACHINE.max_force_ratio < ratio < MACHINE.max_force_ratio:
        raise RecordingError(
            f"{path}: the {pair[0]} is {ratio:.2g} times what the model expects from {pair[1]}; check the units of the"
            f" columns {pair[0]} and position (key scale) and the numbers of the model{_unit_advice(ratio)}"
        )
    _check_numbers(described, path, table)


def _unit_advice(ratio: float) -> str:
    """The unit whose factor a ratio of forces is."""
    for factor, unit in UNITS.items():
        if any(1.0 / MACHINE.unit_error < each / factor < MACHINE.unit_error for each in (ratio, 1.0 / ratio)):
            return f"; {factor:.3g} is the factor of {unit}"
    return ""


def _check_gauge(described: MachineDescription, path: Path, table: Readings) -> None:
    """Refuse an input that reads the atmosphere where it is vented, and whose force is too large by that of it."""
    column = described.columns.get("input")
    forces = balance(described, table)
    if column is None or column.pressure or forces is None:
        return
    lowest = float(np.quantile(table.signals["input"][table.known], MACHINE.vented_quantile))
    least, most = MACHINE.vented_range
    if not least * ATMOSPHERE_PA < lowest < most * ATMOSPHERE_PA:
        return
    driving, passive = forces
    measured = table.signals["force"] if described.imposed else np.zeros(len(passive))
    excess = (driving - passive - measured)[table.known]
    of_air = described.gain * ATMOSPHERE_PA
    left = float(np.std(excess)) / max(float(np.sqrt(np.mean(excess**2))), 1e-300)
    if abs(float(np.median(excess)) / of_air - 1.0) < MACHINE.absolute_share and left < MACHINE.left_share:
        raise RecordingError(
            f"{path}: the input seems to be an absolute pressure: it is never below {lowest:.3g} Pa, and the model"
            f" needs {ATMOSPHERE_PA:.0f} Pa less; state columns.input.pressure: absolute, or gauge if it is"
        )


def _check_numbers(described: MachineDescription, path: Path, table: Readings) -> None:
    """Refuse a recording that other numbers explain, at least two of them far from those of the file."""
    found = _fitted(described, table)
    if found is None:
        return
    values, errors, shares = found
    far = []
    for name, value in values.items():
        stated = float(getattr(described, name))
        if stated * shares[name] < MACHINE.least_force_share or value <= MACHINE.other_machine_errors * errors[name]:
            continue
        if not 1.0 / MACHINE.other_machine_ratio < value / stated < MACHINE.other_machine_ratio:
            far.append(f"{name} {value:.3g} instead of {stated:.3g}")
    if len(far) >= 2:
        raise RecordingError(
            f"{path} seems to be of another machine than {described.path.name} describes: its motion fits"
            f" {' and '.join(far)}; check that recording and machine file belong together"
        )


def _fitted(described: MachineDescription, table: Readings) -> tuple[dict[str, float], ...] | None:
    """Numbers of the machine by linear regression, their standard errors, and the share of the force that one unit of
    each has; None where they explain too little.

    Dry friction, viscous friction and a constant load are fitted as well. The gain is that of the file, unless the rig
    measures the force.
    """
    moved = motion(table)
    if moved is None:
        return None
    x, v, a = (part[table.known] for part in moved)
    target = described.gain * table.signals["input"][table.known]
    if described.imposed:
        target = target - table.signals["force"][table.known]
    if not np.ptp(target) > 0.0:  # a released axis shows no force
        return None
    terms = {"stiffness": x, "damping": v, "inertia": a}
    terms |= {"weight": np.sin(x)} if described.weight > 0.0 else {}
    columns = np.column_stack([*terms.values(), np.sign(v), np.ones(len(x))])
    sizes = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
    found, _, rank, _ = np.linalg.lstsq(columns / sizes, target, rcond=1e-6)
    left = target - columns / sizes @ found
    if rank < columns.shape[1] or np.var(left) > (1.0 - MACHINE.other_machine_explained) * np.var(target):
        return None
    normal = np.linalg.inv((columns / sizes).T @ (columns / sizes))
    errors = np.sqrt(np.diag(normal) * np.var(left) * _correlation(left)) / sizes
    shares = np.std(columns, axis=0) / np.std(target)
    return tuple(dict(zip(terms, each.tolist(), strict=False)) for each in (found / sizes, errors, shares))


def _correlation(left: Array) -> float:
    """Samples of a residual (T,) that count as one independent sample, by its neighbours (first-order process)."""
    near = float(np.mean(left[1:] * left[:-1]) / max(float(np.mean(left**2)), 1e-300))
    return (1.0 + near) / max(1.0 - near, 1e-6)


def check_loads(described: MachineDescription, recordings: Sequence[Path], tables: Sequence[Readings]) -> None:
    """Refuse two recordings whose numbers under `recordings` fit much better exchanged. Raises RecordingError."""
    own = [described.recordings.get(path.name, {}) for path in recordings]
    for i in range(len(tables)):
        for k in range(i):
            if own[i] == own[k]:
                continue
            pairs = ((i, i), (k, k)), ((i, k), (k, i))
            stated, swapped = (
                [_unexplained(described.with_load_of(recordings[load]), tables[run]) for run, load in pair]
                for pair in pairs
            )
            if all(new < MACHINE.left_share * old for new, old in zip(swapped, stated, strict=True)):
                raise RecordingError(
                    f"{recordings[i].name} and {recordings[k].name} seem to be swapped: each fits the numbers that"
                    f" {described.path.name} states for the other under recordings; exchange them there"
                )


def _unexplained(described: MachineDescription, table: Readings) -> float:
    """RMS force [N or N m] that the model with any friction and constant load lacks; 0 for a short recording."""
    forces, moved = balance(described, table), motion(table)
    if forces is None or moved is None or table.known.sum() < MIN_KNOWN:
        return 0.0
    driving, passive = forces
    lacking = driving - passive - (table.signals["force"] if described.imposed else 0.0)
    speed = moved[1]
    columns = np.column_stack([np.ones(len(speed)), np.sign(speed), speed / max(float(np.abs(speed).max()), 1e-300)])
    known = table.known
    left = lacking[known] - columns[known] @ np.linalg.lstsq(columns[known], lacking[known], rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)))


def _check_period(described: MachineDescription, path: Path, table: Readings) -> None:
    """Refuse samples too far apart for the nominal model's own oscillation (Shannon, 1949)."""
    if described.stiffness == 0.0 or described.inertia == 0.0:
        return
    natural = float(np.sqrt(described.stiffness / described.inertia))
    damping_ratio = described.damping / (2.0 * np.sqrt(described.stiffness * described.inertia))
    if damping_ratio < 1.0 and natural * table.period_s > np.pi:
        raise RecordingError(
            f"{path}: samples are {table.period_s:.3g} s apart, and the model oscillates at {natural / 2.0 / np.pi:.3g}"
            " Hz; check columns.time.scale, stiffness and inertia"
        )
