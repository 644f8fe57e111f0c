"""What a fitted model leaves, and what that means: errors against noise, onsets, findings, remainders, certificates."""

from hand_diagnosis.judgement.certificate import GAUSSIAN_PROCESS, LAGGED_INPUTS, Certificate, certify
from hand_diagnosis.judgement.confirmation import CONTRADICTED, confirm_laws, tested, without_repeating
from hand_diagnosis.judgement.findings import Finding, JointResult, joint_findings, ranked_findings
from hand_diagnosis.judgement.left_out import (
    LeftOut,
    error_rows,
    leave_one_out,
    number_lines,
    with_stated_numbers,
    withdrawn_rows,
)
from hand_diagnosis.judgement.notes import bound_notes, errors_by_split, exchange_notes
from hand_diagnosis.judgement.onset import Onset, search_with_onset, unswitched, with_onset
from hand_diagnosis.judgement.remainder import Remainder, remainders, verdict
from hand_diagnosis.judgement.remainder_law import RemainderLaw, described, learn_remainder
from hand_diagnosis.judgement.residual_structure import Region, describe, locate, states_of
from hand_diagnosis.judgement.stage_errors import Excess, StageResult, stage_results, with_other_splits
from hand_diagnosis.judgement.statement import Number, said

__all__ = [
    "CONTRADICTED",
    "GAUSSIAN_PROCESS",
    "LAGGED_INPUTS",
    "Certificate",
    "Excess",
    "Finding",
    "JointResult",
    "LeftOut",
    "Number",
    "Onset",
    "Region",
    "Remainder",
    "RemainderLaw",
    "StageResult",
    "bound_notes",
    "certify",
    "confirm_laws",
    "describe",
    "described",
    "error_rows",
    "errors_by_split",
    "exchange_notes",
    "joint_findings",
    "learn_remainder",
    "leave_one_out",
    "locate",
    "number_lines",
    "ranked_findings",
    "remainders",
    "said",
    "search_with_onset",
    "stage_results",
    "states_of",
    "tested",
    "unswitched",
    "verdict",
    "with_onset",
    "with_other_splits",
    "with_stated_numbers",
    "withdrawn_rows",
    "without_repeating",
]
