"""The results of a trial and of real machines as the tables that docs/proof.md prints."""

from __future__ import annotations

from typing import Any

from validation.trial.score import GOALS, LABELS, met, shown


def _percent(share: float, digits: int = 1) -> str:
    return f"{100.0 * share:.{digits}f} %"


def scores_table(result: dict[str, Any]) -> str:
    """The run and its scores, from scores.json."""
    timing = result["timing"]
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(result["kinds"].items()))
    lines = [
        f"Master seed {result['seed']}, commitment `{result['commitment']}`."
        f" {result['recordings']} recordings ({kinds}); {result['graded']} are graded:"
        " the null cases and those at 2 and 5 times the detection limit."
        f" The diagnosis took {timing['seconds'] / 60:.0f} minutes in {timing['jobs']} processes.",
        "",
        "| score | value | 95 % interval | cases | goal | result |",
        "|---|---|---|---|---|---|",
    ]
    for name, score in result["scores"].items():
        if score["value"] is None:
            continue
        goal = GOALS.get(name)
        wanted = f"{goal[0]} {_percent(goal[1], 0)}" if goal else ""
        interval = f"{_percent(score['low'])} to {_percent(score['high'])}" if "low" in score else ""
        reached = {True: "reached", False: "**not reached**", None: ""}[met(name, score["value"])]
        lines.append(
            f"| {LABELS[name]} | {shown(name, score['value'])} | {interval} | {score['count']} | {wanted} | {reached} |"
        )
    shares = ", ".join(
        f"{LABELS[name]} {_percent(score['value'], 0)} of {score['count']}"
        for name, score in result["at_the_limit"].items()
        if score["value"] is not None
    )
    lines += ["", f"At the detection limit itself (not graded): {shares}."]
    return "\n".join(lines) + "\n"


REFEREE_GOALS = {
    "place": (">=", 0.95), "joint": (">=", 0.98), "first": (">=", 0.88), "both": (">=", 0.75),
    "false_alarm": ("<=", 0.02), "unknown_found": (">=", 0.85), "unknown_wrong": ("<=", 0.08), "clean": (">=", 0.80),
    "ece": ("<=", 0.06), "log_score": None,
}  # fmt: skip
"""Goals on plants, forms and conditions that were not looked at."""


def runs_table(runs: list[dict[str, Any]]) -> str:
    """Every run against plants of others: a row a run, by plant and in the order in which they were made."""
    plants = [run["plant"] for run in runs]
    ordered = sorted(runs, key=lambda run: plants.index(run["plant"]))
    heads = ["plant", "date", "commit", *(LABELS[name] for name in REFEREE_GOALS)]
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    lines.append("| goal | | | " + " | ".join(goal_of(name) for name in REFEREE_GOALS) + " |")
    for run in ordered:
        cells = [score_cell(name, run["scores"][name]) for name in REFEREE_GOALS]
        lines.append(
            f"| {run['plant']} | {run['made']['date']} | {run['made']['commit']} | " + " | ".join(cells) + " |"
        )
    lines.append("")
    for run in ordered:
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(run["kinds"].items()))
        lines.append(
            f"- {run['plant']}, {run['made']['date']}: commit {run['made']['commit']}, master seed {run['seed']},"
            f" commitment `{run['commitment']}`, {run['recordings']} recordings ({kinds})."
        )
    return "\n".join(lines) + "\n"


def goal_of(name: str) -> str:
    """The goal of a score on plants that were not looked at, or nothing."""
    goal = REFEREE_GOALS[name]
    return f"{goal[0]} {_percent(goal[1], 0)}" if goal else ""


def score_cell(name: str, score: dict[str, Any]) -> str:
    """A score with its 95 % interval, or how many it is of; nothing where nothing was asked."""
    if score["value"] is None:
        return ""
    if "low" not in score:
        return f"{shown(name, score['value'])} of {score['count']}"
    low, high = 100.0 * score["low"], 100.0 * score["high"]
    return f"{_percent(score['value'], 0)} ({low:.0f} to {high:.0f}) of {score['count']}"


def families_table(runs: list[dict[str, Any]]) -> str:
    """How often the effect was named first, for each family of laws of the newest run of each plant."""
    newest = {run["plant"]: run for run in runs}
    rows = ["| plant | family | cases | joint | first | clean |", "|---|---|---|---|---|---|"]
    for plant, run in newest.items():
        for name, group in run["by_group"].items():
            if name.startswith("family: ") and group["joint"]["count"]:
                cells = (_hits(group[score]) for score in ("joint", "first", "clean"))
                count = group["joint"]["count"]
                rows.append(f"| {plant} | {name.removeprefix('family: ')} | {count} | " + " | ".join(cells) + " |")
    return "\n".join(rows) + "\n"


def _hits(score: dict[str, Any]) -> str:
    return "" if score["value"] is None else f"{round(score['value'] * score['count'])} of {score['count']}"


def effects_table(result: dict[str, Any]) -> str:
    """How often the first finding was correct, for each effect that was hidden alone."""
    rows = ["| effect hidden alone | cases | first |", "|---|---|---|"]
    for name, counts in result["by_effect"].items():
        rows.append(f"| `{name}` | {counts['cases']} | {counts['first']} |")
    if result["unplaced"]:
        names = ", ".join(f"`{name}` {count}" for name, count in sorted(result["unplaced"].items()))
        rows += [
            "",
            f"Not visible in any motion within the usual size of the effect, and graded as null cases: {names}.",
        ]
    return "\n".join(rows) + "\n"


def failures_table(result: dict[str, Any]) -> str:
    """Every class of failure with an example."""
    rows = ["| kind | hidden | named first | cases | example |", "|---|---|---|---|---|"]
    for failure in result["failures"]:
        example = f"case {failure['example']}, {failure['motion']}"
        rows.append(
            f"| {failure['kind']} | `{failure['effect']}` | `{failure['called']}` | {failure['count']} | {example} |"
        )
    return "\n".join(rows) + "\n"


def reality_table(results: list[dict[str, Any]]) -> str:
    """Real machines: what was found, and the validation errors with those of the baselines."""
    rows = [
        "| machine | verdict | known | found | decoys accepted | nominal | diagnosis | best of six | SINDy | unit |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for machine in results:
        baselines = dict(machine["baselines"])
        sparse = baselines.pop("SINDy discrepancy")
        name, best = min(baselines.items(), key=lambda item: item[1]["validation"])
        rows.append(
            f"| {machine['machine']} | {machine['verdict']} | {', '.join(machine['known'])} | {_found(machine)} |"
            f" {', '.join(machine['decoys_taken']) or 'none'} | {machine['before']:.3g} | {machine['after']:.3g} |"
            f" {best['validation']:.3g} ({name}) | {sparse['validation']:.3g} | {machine['unit']} |"
        )
    rows += ["", "| machine | parameter | diagnosis | published | source |", "|---|---|---|---|---|"]
    for machine in results:
        for number in machine["published"]:
            ours = number["ours"]
            measured = f"{ours['value']:.3g} ± {ours['std']:.1g} {ours['unit']}" if ours else "not found"
            rows.append(
                f"| {machine['machine']} | `{number['key']}` | {measured} | {number['published']:.3g} |"
                f" {number['source']} |"
            )
    for machine in results:
        rows += ["", f"{machine['machine']}:"]
        rows += [f"- {finding['statement']}" for finding in machine["findings"]]
    return "\n".join(rows) + "\n"


def _found(machine: dict[str, Any]) -> str:
    names = [*machine["found"], *(f"{name} (a part)" for name in machine["found_in_part"])]
    return ", ".join(names) or "none"
