"""What a report says about the fit of a joint in addition to findings: errors by split, exchanged test data, bounds."""

from __future__ import annotations

import numpy as np

from hand_diagnosis.judgement.findings import JointResult
from hand_diagnosis.judgement.remainder_law import RemainderLaw
from hand_diagnosis.problem import stretch_of_test
from hand_identification.settings import FITS
from hand_model.kernel.plant_rows import PLANT_PARAMETERS


def errors_by_split(joint: JointResult, stage: int, law: RemainderLaw | None) -> dict[str, tuple[float, float]]:
    """RMS errors [SI] of a signal by split, of the nominal model and of model.yaml."""
    problem, counts = joint.search.problem, joint.search.problem.block_counts
    fits = (joint.search.nominal, joint.search.final if law is None else law.fit)
    errors = {}
    for split, blocks in (("train", ~problem.validation), ("validation", problem.validation)):
        total = max(float(counts[stage, blocks].sum()), 1.0)
        before, after = (float(np.sqrt(fit.squares[stage, blocks].sum() / total)) for fit in fits)
        errors[split] = (before, after)
    if joint.test is not None and np.isfinite(joint.test.rmse(0)[stage]):
        before, after = (float(joint.test.rmse(k)[stage]) for k in (0, 1))
        errors["test"] = (before, after if law is None or law.test is None else law.test[1])
    return errors


def exchange_notes(result: JointResult) -> list[str]:
    """A line where not the last part of the recording is test data."""
    if result.whole is None or result.whole.spared is None:
        return []
    begin, end = stretch_of_test(result.whole)
    why = "only the last part of the recording shows what is found"
    return [f"{result.joint}: {why}, so it is fitted; the test data are {begin:.1f} to {end:.1f} s"]


def bound_notes(result: JointResult) -> list[str]:
    """Nominal numbers that reached their bounds: a model that is this far off needs another tolerance."""
    fit, own = result.search.final, result.search.effect_keys.union(FITS.wide)
    far = [
        parameter.key
        for parameter, z in zip(fit.free, fit.z, strict=True)
        if parameter.row < len(PLANT_PARAMETERS) and parameter.key not in own and abs(z) > FITS.max_tolerances - 1e-6
    ]
    keys = ", ".join(result.wording.units.quantity(key).key for key in far)
    reason = f"ends {FITS.max_tolerances:g} tolerances from its nominal value; a larger --tolerance may be needed"
    return [f"{result.joint}: {keys} {reason}"] if far else []
