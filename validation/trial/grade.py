"""The grade of one case: the report compared with what was concealed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

WITHIN, STANDARD_ERRORS = 0.15, 2.0
FAMILIES = {
    "time": ("periodic_in_time", "drifts_with_time"),
    "event": ("drifts_with_time",),
    "angle": ("periodic_in_angle", "depends_on_angle"),
    "joint": ("depends_on_another_joint",),
}
"""Families by which a remainder rightly describes a kind of unknown physics; others are asked of no kind."""
FLOORS = 1.25
ONSET_S = 0.5


@dataclass(slots=True)
class Grade:
    """The result of one case; None where a question does not apply to it.

    claims: probability of the first finding of each joint, and whether it is right.  called: effect of the first
    finding.  parameters: key and relative error of each parameter that can be compared.  deviations: key and error in
    the standard errors that the report states.
    """

    number: int
    kind: str
    effect: str
    multiple: float
    motion: str
    called: str
    place: bool | None = None
    joint: bool | None = None
    first: bool | None = None
    first_two: bool | None = None
    both: bool | None = None
    false_alarm: bool | None = None
    unknown_found: bool | None = None
    unknown_family: bool | None = None
    unknown_wrong: bool | None = None
    clean: bool | None = None
    onset: bool | None = None
    parameters: list[tuple[str, float]] = field(default_factory=list)
    deviations: list[tuple[str, float]] = field(default_factory=list)
    claims: list[tuple[float, bool]] = field(default_factory=list)


def grade(case: dict[str, Any], report: dict[str, Any]) -> Grade:
    """Grade a case. Any effect of the truth's isolability class counts as right: the data cannot separate them."""
    truths, findings = case["truth"], _beyond_conditions(report["findings"], case)
    kind = case["kind"] if truths else "null"
    lead: dict[str, Any] = truths[0] if truths else {"effect": "nothing", "multiple": 0.0}
    remainder = report["remainder"]
    called = findings[0]["effect"] if findings else "unknown" if remainder else "agrees"
    done = Grade(case["number"], kind, lead["effect"], lead["multiple"], case["motion"], called)
    done.claims = _claims(truths, findings, remainder, case["without"])
    if kind == "null":
        done.false_alarm = bool(findings or remainder)
        return done
    if kind in {"outside", "deleted"}:
        return _grade_unknown(done, truths[0], report | {"findings": findings}, case["without"])
    done.place = all(any(_place(f, t) for f in findings[: len(truths)]) for t in truths)
    done.joint = all(any(_joint(f, t) for f in findings[: len(truths)]) for t in truths)
    right = [any(_names(f, t) for f in findings[: len(truths)]) for t in truths]
    if kind == "single":
        done.first = right[0]
    else:
        done.both = all(right)
    done.first_two = all(_among_two(findings, t, len(truths)) for t in truths)
    # A remainder next to the right name is no wrong answer; one in its place is.
    done.unknown_wrong = any(
        any(_joint(left, t) for left in remainder) and not any(_names(f, t) for f in findings) for t in truths
    )
    done.clean = _clean(report, truths)
    begun_s = case.get("conditions", {}).get("onset_s")
    if begun_s is not None:
        done.onset = all(any(_begins(f, t, begun_s) for f in findings if _joint(f, t)) for t in truths)
    compared = [errors for t in truths for errors in _parameter(findings, t)]
    done.parameters = [(key, relative) for key, relative, _ in compared]
    done.deviations = [(key, deviation) for key, _, deviation in compared if deviation is not None]
    return done


def _beyond_conditions(findings: list[dict[str, Any]], case: dict[str, Any]) -> list[dict[str, Any]]:
    """The findings without missing frames where the recorder did lose frames: a right statement about no effect."""
    lost = case.get("conditions", {}).get("lost", 0.0) > 0.0
    return [finding for finding in findings if not (lost and finding["effect"] == "dropped_frames")]


def _grade_unknown(done: Grade, truth: dict[str, Any], report: dict[str, Any], without: str) -> Grade:
    """A remainder on the right joint is right; so is another effect of a deleted effect's isolability class."""
    stands_in = set(truth["group"]) - {without}
    left = [entry for entry in report["remainder"] if _joint(entry, truth)]
    right = FAMILIES.get(truth.get("family", ""))
    if left and right:
        done.unknown_family = any(entry.get("family") in right for entry in left)
    done.unknown_found = bool(left) or any(_joint(f, truth) and f["effect"] in stands_in for f in report["findings"])
    return done


def _place(finding: dict[str, Any], truth: dict[str, Any]) -> bool:
    return bool(finding["place"] == truth["place"] or finding["effect"] in truth["group"])


def _joint(finding: dict[str, Any], truth: dict[str, Any]) -> bool:
    return bool(finding["joint"] == truth["joint"])


def _begins(finding: dict[str, Any], truth: dict[str, Any], begun_s: float) -> bool:
    since = finding.get("since")
    return _names(finding, truth) and since is not None and abs(since - begun_s) <= ONSET_S


def _names(finding: dict[str, Any], truth: dict[str, Any]) -> bool:
    return bool(finding["effect"] in truth["group"] and _joint(finding, truth))


def _among_two(findings: list[dict[str, Any]], truth: dict[str, Any], most: int) -> bool:
    own = [f for f in findings if _joint(f, truth)][:2]
    if any(_names(f, truth) for f in own):
        return True
    rivals = [a["effect"] for f in findings[:most] if _joint(f, truth) for a in f["alternatives"][:1]]
    return any(rival in truth["group"] for rival in rivals)


def _claims(
    truths: list[dict[str, Any]], findings: list[dict[str, Any]], remainder: list[dict[str, Any]], without: str
) -> list[tuple[float, bool]]:
    """Probability of the first finding of each joint (where it has none, of its remainder), and whether it is right."""
    claims, seen = [], set()
    for finding in findings:
        if finding["joint"] in seen:
            continue
        seen.add(finding["joint"])
        about = [t for t in truths if _joint(finding, t)]
        claims.append((float(finding["probability"]), any(_names(finding, t) for t in about)))
    for left in remainder:
        if left["joint"] in seen:
            continue
        seen.add(left["joint"])
        concealed = [t["place"] == "unknown" or t["effect"] == without for t in truths if _joint(left, t)]
        claims.append((float(left["probability"]), any(concealed)))
    return claims


def _clean(report: dict[str, Any], truths: list[dict[str, Any]]) -> bool | None:
    """Whether the test errors of the joints with an effect are at most FLOORS noise floors."""
    joints = {t["joint"] for t in truths}
    fits = [f for f in report["fit"] if f["split"] == "test" and (f["joint"] in joints or None in joints)]
    if not fits:
        return None
    return all(f["rmse_after"] <= FLOORS * f["noise_floor"] for f in fits)


def _parameter(findings: list[dict[str, Any]], truth: dict[str, Any]) -> list[tuple[str, float, float | None]]:
    """Key, relative error and error in stated errors of the parameter that both equations have, where it was named."""
    number = truth["number"]
    if number is None:
        return []
    for finding in findings:
        if finding["effect"] == truth["effect"] and _joint(finding, truth):
            reported = finding["parameters"].get(number["key"])
            if reported is not None:
                unit, std = _unit(number["key"]), reported.get("std")
                error = abs(float(reported["value"]) * unit - number["value"])
                deviation = None if not std else error / (float(std) * unit)
                return [(number["key"], error / abs(number["value"]), deviation)]
    return []


def _unit(key: str) -> float:
    return 3.141592653589793 / 180.0 if key.endswith("_deg") else 1.0
