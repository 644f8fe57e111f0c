"""model.yaml of a machine: its file with every number that the diagnosis changed, and the effects with their laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from hand_diagnosis.diagnosis import Diagnosis, JointDiagnosis
from hand_diagnosis.judgement import Number
from hand_diagnosis.search import standard_errors
from hand_identification.free_parameters import START_CREEP
from hand_machine.description import MachineDescription
from hand_machine.found_model import Found, number_notes, write_found_model
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW

SAME = 1e-9
"""Relative change below which a number counts as unchanged."""


def write_machine_model(
    diagnosis: Diagnosis, described: MachineDescription, recordings: Sequence[str], out: Path
) -> dict[str, str]:
    """Write model.yaml of a machine's diagnosis; returns standard error and unit of its numbers, by name.

    recordings: their names, for the comment at the top.

    All numbers of the last fit are written, however little they changed: they belong together. Where an effect is not
    claimed, they are those of the nominal model fitted without effects. Raises OSError where it cannot be written.
    """
    found = found_in(diagnosis, diagnosis.joints[0]) if diagnosis.joints else Found({}, {}, {}, frozenset())
    comment = f"Diagnosed from {', '.join(recordings)}: {diagnosis.verdict}. Nominal: {described.path.name}."
    write_found_model(described, diagnosis.wording.units, found, out, comment)
    return number_notes(diagnosis.wording.units, found)


def found_in(diagnosis: Diagnosis, joint: JointDiagnosis) -> Found:
    """Values, standard deviations and resolutions [SI of the model] of the axis, by key."""
    search = joint.reported
    claimed = len(joint.claimed()) == len(search.accepted)
    fit, own = (search.final, search.effect_keys) if claimed else (search.nominal, frozenset[str]())
    columns, _ = search.problem.columns(fit.free, fit.z[None])
    deviations = standard_errors(search.problem, fit)
    moved = [(p, s) for p, s in zip(fit.free, deviations, strict=True) if p.row < START_CREEP]
    values = {p.key: float(columns[0, p.row]) for p, _ in moved}
    nominal = {key: float(search.problem.nominal[ROW[key]]) for key in values}
    found = Found(
        {key: value for key, value in values.items() if abs(value - nominal[key]) > SAME * abs(nominal[key])},
        {p.key: p.deviation(values[p.key], float(s)) for p, s in moved} | _said(diagnosis, joint),
        fit.resolutions(columns[0]),
        own,
    )
    for law in [left.learned for left in diagnosis.remainder if left.joint == joint.joint and left.learned]:
        found = replace(
            found,
            values={**found.values, **law.values()},
            resolutions={**found.resolutions, **law.resolutions()},
            own=found.own | frozenset(law.values()),
        )
    return found


def _said(diagnosis: Diagnosis, joint: JointDiagnosis) -> dict[str, float]:
    """Standard errors [SI of the model] that the findings quote, by key; they include more than those of one fit."""
    own = [number for finding in diagnosis.findings if finding.joint == joint.joint for number in finding.numbers]
    return {
        key: _si(joint, key, number) for number in own for key in joint.search.effect_keys if _is(joint, key, number)
    }


def _is(joint: JointDiagnosis, key: str, number: Number) -> bool:
    return joint.wording.units.quantity(key).key == number.key


def _si(joint: JointDiagnosis, key: str, number: Number) -> float:
    return number.std * JOINT_PARAMETERS[ROW[key]].scale / joint.wording.units.quantity(key).factor
