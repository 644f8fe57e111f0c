"""The diagnosis of a hand or machine: every joint, what several joints show together, findings and verdict."""

from hand_diagnosis.diagnosis.changed_numbers import claimed_values, valid_changes
from hand_diagnosis.diagnosis.hand import Diagnosis, diagnose
from hand_diagnosis.diagnosis.joint import JointDiagnosis

__all__ = ["Diagnosis", "JointDiagnosis", "claimed_values", "diagnose", "valid_changes"]
