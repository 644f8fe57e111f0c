"""Write the numbers of a trial into its page: python -m validation.trial.document TRIAL PAGE [REALITY]."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

from validation.trial.score import GOALS, SAYS, met


def main() -> None:
    """Fill the page's marked parts from scores.json, and from reality.json where it is given; copy the pictures."""
    if len(sys.argv) not in {3, 4}:
        print("usage: python -m validation.trial.document TRIAL PAGE [REALITY]", file=sys.stderr)
        sys.exit(2)
    trial, page = Path(sys.argv[1]), Path(sys.argv[2])
    result = json.loads((trial / "scores.json").read_text(encoding="utf-8"))
    text = page.read_text(encoding="utf-8")
    text = fill(text, "scores", scores_table(result))
    text = fill(text, "effects", effects_table(result))
    text = fill(text, "failures", failures_table(result))
    if len(sys.argv) == 4:
        text = fill(text, "reality", reality_table(json.loads(Path(sys.argv[3]).read_text(encoding="utf-8"))))
    page.write_text(text, encoding="utf-8")
    figures = page.parent / "figures"
    figures.mkdir(exist_ok=True)
    for name in ("confusion.png", "reliability.png"):
        shutil.copy(trial / name, figures / f"proof_{name}")


def fill(text: str, part: str, content: str) -> str:
    """Replace what stands between a part's markers. ValueError where they are not there."""
    begin, end = f"<!-- {part}: begin, written by make proof -->\n", f"<!-- {part}: end -->"
    before, found, rest = text.partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise ValueError(f"the page has no part {part!r}")
    return before + begin + content + end + after


def scores_table(result: dict[str, Any]) -> str:
    """The run and its scores."""
    timing = result["timing"]
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(result["kinds"].items()))
    lines = [
        f"Master seed {result['seed']}, commitment `{result['commitment']}`."
        f" {result['recordings']} recordings ({kinds}); {result['graded']} are graded:"
        " null cases and those at 2 and 5 times the limit."
        f" Diagnosis took {timing['seconds'] / 60:.0f} minutes on {timing['jobs']} processes.",
        "",
        "| | value | 95 % interval | cases | goal | |",
        "|---|---|---|---|---|---|",
    ]
    for name, one in result["scores"].items():
        if one["value"] is None:
            continue
        goal = GOALS.get(name)
        wanted = f"{goal[0]} {goal[1]:.0%}" if goal else ""
        span = f"{one['low']:.1%} to {one['high']:.1%}" if "low" in one else ""
        reached = {True: "reached", False: "**not reached**", None: ""}[met(name, one["value"])]
        says = SAYS.get(name, "expected calibration error")
        lines.append(f"| {says} | {one['value']:.1%} | {span} | {one['count']} | {wanted} | {reached} |")
    limit = result["at_the_limit"]
    shares = ", ".join(
        f"{SAYS[name]} {one['value']:.0%} of {one['count']}" for name, one in limit.items() if one["value"] is not None
    )
    lines += ["", f"At the detection limit itself (1 times, not graded): {shares}."]
    return "\n".join(lines) + "\n"


def effects_table(result: dict[str, Any]) -> str:
    """First place by effect."""
    rows = ["| concealed alone | cases | first |", "|---|---|---|"]
    for name, one in result["by_effect"].items():
        rows.append(f"| `{name}` | {one['cases']} | {one['first']} |")
    if result["unplaced"]:
        names = ", ".join(f"`{name}` {count}" for name, count in sorted(result["unplaced"].items()))
        rows += ["", f"Not shown by any drawn motion within its usual size, and so recorded as null: {names}."]
    return "\n".join(rows) + "\n"


def failures_table(result: dict[str, Any]) -> str:
    """Every class of failure with an example."""
    rows = ["| kind | concealed | called first | cases | example |", "|---|---|---|---|---|"]
    for one in result["failures"]:
        example = f"case {one['example']}, {one['motion']}"
        rows.append(f"| {one['kind']} | `{one['effect']}` | `{one['called']}` | {one['count']} | {example} |")
    return "\n".join(rows) + "\n"


def reality_table(results: list[dict[str, Any]]) -> str:
    """Real machines: what was found, and the errors beside the baselines'."""
    rows = [
        "| machine | verdict | known | found | decoys taken | nominal | ours | best of six | SINDy | unit |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for one in results:
        base = dict(one["baselines"])
        sparse = base.pop("SINDy discrepancy")
        name, best = min(base.items(), key=lambda item: item[1]["held_out"])
        rows.append(
            f"| {one['machine']} | {one['verdict']} | {', '.join(one['known'])} | {_found(one)} |"
            f" {', '.join(one['decoys_taken']) or 'none'} | {one['before']:.3g} | {one['after']:.3g} |"
            f" {best['held_out']:.3g} ({name}) | {sparse['held_out']:.3g} | {one['unit']} |"
        )
    rows += ["", "| machine | number | ours | published | source |", "|---|---|---|---|---|"]
    for one in results:
        for number in one["published"]:
            ours = number["ours"]
            told = f"{ours['value']:.3g} ± {ours['std']:.1g} {ours['unit']}" if ours else "not found"
            rows.append(
                f"| {one['machine']} | `{number['key']}` | {told} | {number['published']:.3g} | {number['source']} |"
            )
    for one in results:
        rows += ["", f"{one['machine']}:"]
        rows += [f"- {finding['statement']}" for finding in one["findings"]]
    return "\n".join(rows) + "\n"


def _found(one: dict[str, Any]) -> str:
    names = [*one["found"], *(f"{name} (a part)" for name in one["found_in_part"])]
    return ", ".join(names) or "none"


if __name__ == "__main__":
    main()
