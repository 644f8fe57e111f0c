"""What a reader sees first: the answer as a sentence, its numbers, and the errors of every joint and signal."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from hand_diagnosis.pages.drawing import tint
from hand_diagnosis.settings import SETTINGS
from hand_model.quantities import unit_words
from hand_pages.numbers import with_error

PROPER = {"coulomb": "Coulomb", "hall": "Hall", "fsr": "FSR"}
"""Words of effects' names that are written otherwise in a sentence."""
NAMED = 2
"""Findings and remainders named in the title."""
TOGETHER = 3
"""Joints that were not diagnosed for one reason and still have a row each."""
LIKELIHOODS = tuple(
    zip((*SETTINGS.likelihood_limits, 0.0), ("very probable", "probable", "possible", "improbable"), strict=True)
)
"""Least probability of each word."""
SPLITS = ("test", "validation", "train")
"""The data whose error counts most, first."""
WORDS = {"train": "training", "validation": "validation", "test": "test"}
Report = Mapping[str, Any]


class Words(NamedTuple):
    """What the machine of a report and its joints are called."""

    whole: str = "the hand"
    axis: str = "joint"


def words_of(report: Report) -> Words:
    """The words of a report; those of a hand where it has none."""
    return Words(**report.get("words", {}))


def common_words(several: Iterable[Words]) -> Words:
    """The words of several reports; those of a hand where they differ or there is no report."""
    every = set(several)
    return every.pop() if len(every) == 1 else Words()


def effect_words(effect: str) -> str:
    """The name of an effect in words."""
    return " ".join(PROPER.get(word, word) for word in effect.split("_"))


def in_words(text: str, report: Report) -> str:
    """A sentence of a report with the names of its effects in words; the keys of parameters, as leak.rate, stay."""
    findings = report["findings"]
    names = {name for each in findings for name in (each["effect"], *each["tied_with"])}
    names |= {row["effect"] for each in findings for row in each["alternatives"]}
    for name in names:
        text = re.sub(rf"\b{name}\b(?!\.\w)", effect_words(name), text)
    return text


def title(report: Report, whole: str = "the hand", axis: str = "joint") -> str:
    """The answer of a report in one line. whole, axis: what the machine and its joints are called."""
    likely = [finding for finding in report["findings"] if _share(finding) >= SETTINGS.even_probability]
    unlikely = [finding for finding in report["findings"] if _share(finding) < SETTINGS.even_probability]
    parts = [_finding(finding, whole) for finding in likely]
    parts += [_remainder(left) for left in report["remainder"]]
    parts += [f"perhaps {_finding(finding, whole)}" for finding in unlikely]
    parts = parts[:NAMED]
    more = len(report["findings"]) + len(report["remainder"]) - len(parts)
    if more > 0:
        parts.append(f"and {more} more")
    parts += _hardly_checked(report)
    missing = len(report["not_judged"])
    if not report["fit"]:
        parts.insert(0, "Nothing could be diagnosed")
    elif not report["remainder"] and all(finding["effect"] == "dropped_frames" for finding in report["findings"]):
        parts.insert(0, _agreement(report, missing, axis))
    if missing:
        total = missing + len({row["joint"] for row in report["fit"]})
        parts.append(f"{missing} of {total} {plural(axis)} not diagnosed")
    return "; ".join(parts)


def likelihood(probability: float) -> str:
    """A probability [-] in words."""
    return next(word for least, word in LIKELIHOODS if probability >= least)


def counted(number: int, noun: str) -> str:
    """A number of joints, axes or other things in words."""
    return f"{number} {noun if number == 1 else plural(noun)}"


def plural(noun: str) -> str:
    """Joints, axes or other things."""
    return {"axis": "axes", "entry": "entries"}.get(noun, f"{noun}s")


def _agreement(report: Report, missing: int, axis: str) -> str:
    """What agrees: the whole hand or machine, or else the joints by name or number."""
    joints = list(dict.fromkeys(row["joint"] for row in report["fit"]))
    if not missing:
        return "Model and recording agree: no effect of the catalogue is missing"
    if len(joints) <= NAMED:
        return f"{' and '.join(joints)} agree{'s' if len(joints) == 1 else ''} with the model"
    return f"{counted(len(joints), axis)} agree with the model"


def _hardly_checked(report: Report) -> list[str]:
    """Of signals with findings: those of which the fit leaves so much open that test data are hardly a check."""
    named = {(finding["joint"], finding.get("where", {}).get("signal")) for finding in report["findings"]}
    worst: dict[str, Report] = {}
    for row in report["fit"]:
        about = row.get("split") == "test" and (row["joint"], row["signal"]) in named
        if about and _open_share(row) > max(_open_share(worst.get(row["joint"])), SETTINGS.hardly_checked):
            worst[row["joint"]] = row
    return [
        f"test data hardly check {joint}: the fit leaves {row['undetermined']:.2g} {row['unit']} of the"
        f" {row['signal']} open"
        for joint, row in worst.items()
    ]


def _open_share(row: Report | None) -> float:
    """Share of the error before the findings that the fit leaves open; 0 without a row."""
    return row.get("undetermined", 0.0) / max(row["rmse_before"], 1e-300) if row else 0.0


def _share(finding: Report) -> float:
    """Probability that one of the names of a finding is right."""
    tied = [row["probability"] for row in finding["alternatives"] if row["effect"] in finding["tied_with"]]
    return float(finding["probability"] + sum(tied))


def _finding(finding: Report, whole: str) -> str:
    where = finding["joint"] or whole
    shares = {row["effect"]: row["probability"] for row in finding["alternatives"]}
    if finding["tied_with"]:
        names = [(finding["effect"], finding["probability"])]
        names += [(name, shares.get(name, 0.0)) for name in finding["tied_with"]]
        text = " or ".join(f"{effect_words(name)} ({share:.0%})" for name, share in names)
        return f"{where}: {text}, which this recording cannot distinguish"
    number = main_number(finding)
    return (
        f"{where}: {effect_words(finding['effect'])}{f' of {number}' if number else ''} ({finding['probability']:.0%})"
    )


def _remainder(left: Report) -> str:
    return f"{left['joint']}: {left['rms']:.2g} {left['unit']} of the {left['signal']} that no known effect explains"


def main_number(finding: Report) -> str:
    """The first number of a finding that the data determine, with its error and unit; "" where there is none.

    A number within two standard errors of 0 adds no information to the name of the effect.
    """
    for number in finding["parameters"].values():
        if number["determined"] and abs(number["value"]) > 2.0 * number["std"]:
            return f"{with_error(number['value'], number['std'])} {unit_words(number['unit'])}".rstrip()
    return ""


def ties(report: Report) -> list[tuple[str, str, str]]:
    """For each tie a sentence with the names that this recording cannot distinguish, a command, and a sentence.

    The command records what separates them; "" where there is none. The last sentence says why it does, or why no
    experiment separates them.
    """
    found = []
    for finding in report["findings"]:
        if not finding["tied_with"]:
            continue
        names = " or ".join(effect_words(name) for name in (finding["effect"], *finding["tied_with"]))
        sentence = f"{finding['joint'] or 'everywhere'}: {names}: this recording cannot distinguish them."
        tie = finding["tie"]
        why = f"{tie['name'].replace('_', ' ')} {tie['why']}" if "name" in tie else tie["why"]
        why = in_words(why, report)
        how = f" What to do: {tie['how']}." if "how" in tie else ""
        found.append((sentence, tie.get("command", ""), f"{why[:1].upper()}{why[1:]}.{how}"))
    return found


def errors(report: Report) -> dict[tuple[str, str], dict[str, Any]]:
    """By joint and signal the row of `fit` that counts most: of test data, else of validation data."""
    best: dict[tuple[str, str], dict[str, Any]] = {}
    for split in reversed(SPLITS):
        best |= {(row["joint"], row["signal"]): row for row in report["fit"] if row["split"] == split}
    return best


def tiles(report: Report, axis: str = "joint") -> list[tuple[str, str]]:
    """The numbers of the answer, each with the words below it. axis: what a joint of the machine is called."""
    known = errors(report)
    remains = [
        (
            f"{left['rms']:.3g} {left['unit']}",
            f"of the {left['signal']} of {left['joint']} that no known effect explains",
        )
        for left in report["remainder"][:1]
    ]
    if report["findings"]:
        return _finding_tiles(report["findings"][0], known) + remains
    if not known:
        return []
    joints = len({joint for joint, _ in known})
    (joint, signal), worst = max(known.items(), key=lambda item: multiple(item[1], "rmse_before"))
    ratio = multiple(worst, "rmse_before")
    after = f"{worst['rmse_before']:.3g} {worst['unit']}"
    return [
        *remains,
        (f"{joints} of {joints + len(report['not_judged'])}", f"{plural(axis)} compared with the model"),
        (after, f"largest {WORDS[worst['split']]} error: {signal} of {joint}, {short(ratio)} times the noise"),
    ]


def _finding_tiles(finding: Report, known: Mapping[tuple[str, str], Report]) -> list[tuple[str, str]]:
    signal = finding["where"]["signal"]
    rows = [row for (joint, name), row in known.items() if name == signal and finding["joint"] in {None, joint}]
    shown = []
    if rows:
        row = max(rows, key=lambda each: multiple(each, "rmse_before"))
        fall = f"{row['rmse_before']:.3g} → {row['rmse_after']:.3g} {row['unit']}"
        data = WORDS[row["split"]]
        shown.append(
            (fall, f"{data} error of the {signal} of {row['joint']}; noise {row['noise_floor']:.2g} {row['unit']}")
        )
    number = main_number(finding)
    if number:
        shown.append((number, effect_words(finding["effect"])))
    share = finding["probability"]
    shown.append((f"{share:.0%}", f"probability of {effect_words(finding['effect'])}: {likelihood(share)}"))
    shown.append((f"{finding['explains']:.0%}", f"of the mismatch of the {signal} explained"))
    return shown


def multiple(row: Report, key: str) -> float:
    """An error of a row of `fit` [multiples of its noise]."""
    return float(row[key]) / max(float(row["noise_floor"]), 1e-300)


def short(value: float) -> str:
    """A positive number [-] with two digits, or all digits before the point."""
    return f"{value:.0f}" if len(f"{value:.0f}") > 1 else f"{value:.2g}"


def heat_map(report: Report) -> tuple[list[str], list[tuple[str, list[dict[str, Any] | None], str]]]:
    """The names of the signals, and a row per joint: name, a cell per signal, and why it was not diagnosed.

    More than TOGETHER joints that were not diagnosed for the same reason are one row. A cell has the error before and
    after in multiples of the noise, with the opacity of its tint.
    """
    known = errors(report)
    signals = list(dict.fromkeys(row["signal"] for row in report["fit"]))
    joints = list(dict.fromkeys(row["joint"] for row in report["fit"]))
    rows = [(joint, [_cell(known.get((joint, signal))) for signal in signals], "") for joint in joints]
    for reason, names in by_reason(report["not_judged"]):
        if len(names) > TOGETHER:
            rows.append((f"{len(names)} others", [None] * len(signals), f"{reason}: {', '.join(names)}"))
        else:
            rows += [(name, [None] * len(signals), reason) for name in names]
    return signals, rows


def by_reason(not_judged: Sequence[Report]) -> list[tuple[str, list[str]]]:
    """The reasons for which joints were not diagnosed, each with its joints."""
    groups: dict[str, list[str]] = {}
    for row in not_judged:
        groups.setdefault(row["reason"], []).append(row["joint"])
    return list(groups.items())


def _cell(row: Report | None) -> dict[str, Any] | None:
    if row is None:
        return None
    before, after = multiple(row, "rmse_before"), multiple(row, "rmse_after")
    values = f"{row['rmse_before']:.3g} → {row['rmse_after']:.3g} {row['unit']}, noise {row['noise_floor']:.2g}"
    return {"before": short(before), "after": short(after), "tint": round(tint(before), 2), "values": values}


def worst_by_joint(report: Report) -> dict[str, float | None]:
    """The largest error of each joint before, in multiples of the noise; None where it was not diagnosed."""
    worst: dict[str, float | None] = {row["joint"]: None for row in report["not_judged"]}
    for (joint, _), row in errors(report).items():
        worst[joint] = max(worst.get(joint) or 0.0, multiple(row, "rmse_before"))
    return worst
