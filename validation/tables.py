"""Stored results as the Markdown that README and docs print: one function a section, each ending in its source line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Entry = Mapping[str, Any]
"""One source of docs/figures/results.json: results, with command, date, commit and machine."""
Result = Mapping[str, Any]
"""One result of a bench, with the keys of `validation.bench.result.KEYS`."""


def source_line(entry: Entry) -> str:
    """The sentence that names the command behind a section."""
    machine = f", on {entry['machine']}" if entry.get("machine") else ""
    return f"Made by `{entry['command']}` on {entry['date']}{machine}, at commit {entry['commit']}."


def markdown(header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def number(value: float | None) -> str:
    """Three significant digits of a value [any unit], thousands in groups; empty for None."""
    if value is None:
        return ""
    return f"{float(f'{value:.3g}'):,.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"


def bench_table(entry: Entry) -> str:
    """Any bench: this project's value, the reference's, and the goal."""
    rows = []
    for result in entry["results"]:
        own = f"{number(result['ours'])} {result['unit']}".strip()
        other = "" if result["reference"] is None else f"{number(result['reference'])} {result['unit']}".strip()
        of = "value" if result["ratio"] is None else "ratio"
        goal = "" if result["goal"] is None else f"{of} ≤ {number(result['goal'])}"
        rows.append((result["name"], own, other, number(result["ratio"]), goal))
    table = markdown(("result", "this project", "reference", "ratio", "goal"), rows)
    return f"{table}\n\n{source_line(entry)}"


def loop_table(entry: Entry) -> str:
    """The control loop at each rate that was measured."""
    values = {result["name"]: float(result["ours"]) for result in entry["results"]}
    rates = sorted({int(name.split()[1]) for name in values if name.startswith("loop ")})
    rows = [
        (
            f"{rate} Hz",
            f"{100.0 * values[f'loop {rate} Hz missed periods']:.2f} %",
            f"{values[f'loop {rate} Hz latency p50']:.2f} / {values[f'loop {rate} Hz latency p99']:.2f} ms",
            f"{values[f'loop {rate} Hz CPU']:.2f} cores",
        )
        for rate in rates
    ]
    header = ("rate", "periods missed", "frame acquired to valve command, p50 / p99", "CPU, both processes")
    return f"{markdown(header, rows)}\n\n{source_line(entry)}"


def soak_table(entry: Entry) -> str:
    """The simulated hand in motion for hours: motions, latches, missed periods, memory and CPU of each process."""
    soak = entry["results"]
    rows = [
        (name, f"{mb:.0f} MB", f"{soak['growth_mb'][name]:+.1f} MB", f"{soak['cpu'][name]:.2f} cores")
        for name, mb in soak["rss_mb"].items()
    ]
    latches = {0: "no latch", 1: "one latch"}.get(len(soak["latches"]), f"{len(soak['latches'])} latches")
    text = (
        f"In {soak['hours']:g} h the hand made {soak['motions']:,} motions, with {latches};"
        f" {100 * soak['missed_frames']:.2f} % of the periods had no frame,"
        f" {100 * soak['missed_commands']:.2f} % no command; the recording grew by"
        f" {soak['file_mb_per_hour']:.0f} MB an hour, in the second half {soak['file_growth_ratio']:.2f} times as fast"
        " as in the first."
    )
    faults = "".join(f"\n- not passed: {fault}" for fault in soak["faults"])
    header = ("process", "largest memory", "growth after the warm-up", "CPU")
    return f"{text}\n{faults}\n{markdown(header, rows)}\n\n{source_line(entry)}"


def steps_sentence(entry: Entry) -> str:
    """Settling time and overshoot at the default rate."""
    at_default = [result for result in entry["results"] if " 200 Hz" in result["name"]]
    settling, overshoot = (
        next(float(result["ours"]) for result in at_default if result["name"].endswith(what))
        for what in ("settling time", "overshoot")
    )
    return (
        f"A step from 30 to 80 degrees settles within 1 degree in {settling:.2f} s on every joint, with"
        f" {overshoot:.2f} % overshoot (`{entry['command']}`)."
    )


def demo_sentence(entry: Entry) -> str:
    """How often the end of the demo is right, and how long it takes."""
    wrong, middle_s, longest_s, cpu_s, others = (result["ours"] for result in entry["results"])
    rows = entry["results"][0]["rows"]
    right = round((1.0 - wrong) * len(rows))
    return (
        f"Of {len(rows)} effects that were drawn and concealed, {right} were named first and in their joint. The"
        f" diagnosis took {middle_s:.1f} s at the median and {longest_s:.1f} s at most, or {cpu_s:.1f} s of processor"
        f" time, while other programs used {100.0 * others:.0f} % of the machine. {source_line(entry)}"
    )


def studio_sentence(entry: Entry) -> str:
    """How long the studio takes to show a hand that moves."""
    wall_s, cpu_s, others = (result["ours"] for result in entry["results"])
    return (
        f"`hand studio --sim` shows a simulated hand that moves {wall_s:.1f} s after the command, of which its"
        f" processes use {cpu_s:.1f} s of processor time; the browser drew without a graphics card, and other programs"
        f" used {100.0 * others:.0f} % of the machine. {source_line(entry)}"
    )


def effects_table(entry: Entry) -> str:
    """Each effect alone at twice its detection limit."""
    rows = []
    for row in entry["results"][0]["rows"]:
        if row["shown"]:
            instead = ", ".join(f"`{name}`" for name in row["instead"])
            counts = (row["shown"], row["first"], row["joint"], row["place"], f"{row['probability']:.2f}")
            rows.append((f"`{row['effect']}`", *counts, instead))
        else:
            rows.append((f"`{row['effect']}`", 0, "", "", "", "", "not visible in any recording"))
    header = ("hidden", "recordings", "first", "joint", "place", "probability", "named instead")
    total, first, joint, place = (
        sum(row[key] for row in entry["results"][0]["rows"]) for key in ("shown", "first", "joint", "place")
    )
    sums = f"Of all {total} recordings, the effect is named first in {first}; the joint is correct in {joint},"
    sums = f"{sums} the place in {place}."
    return f"{markdown(header, rows)}\n\n{sums} {source_line(entry)}"


def compare_table(entry: Entry) -> str:
    """The diagnosis and other methods on the same recordings: validation errors beyond the noise [deg]."""
    rows = [
        (
            f"`{row['hidden']}`",
            f"{row['nominal']:.2f}",
            f"{row['reidentified']:.2f}",
            f"{row['sparse']:.2f}",
            f"{row['friction']:.2f} ({row['best_friction']})",
            f"{row['ours']:.3f}",
            f"`{row['named']}`, {'right' if row['joint'] else 'wrong'}",
        )
        for row in entry["results"][0]["rows"]
    ]
    header = (
        "hidden", "nominal", "re-identified", "sparse regression", "best friction", "diagnosis", "named first, joint",
    )  # fmt: skip
    return f"{markdown(header, rows)}\n\n{source_line(entry)}"


def trial_summary(entry: Entry) -> str:
    """One sentence on the blind trial."""
    result = entry["results"]
    scores = result["scores"]
    place, joint, first, alarm = (scores[name] for name in ("place", "joint", "first", "false_alarm"))
    alarms = round(alarm["value"] * alarm["count"]) or "none"
    return (
        f"Of {result['recordings']} recordings of an independent plant, {place['count']} with an effect are graded:"
        f" the place is correct in {100 * place['value']:.0f} % of them and the joint in {100 * joint['value']:.0f} %."
        f" The first finding names the effect in {100 * first['value']:.0f} % of the {first['count']} recordings with a"
        f" single effect. Of {alarm['count']} recordings without an effect,"
        f" {alarms} gave a false alarm (`{entry['command']}`)."
    )


def referee_summary(entry: Entry) -> str:
    """One sentence on each plant of others: the newest run."""
    newest = {run["plant"]: run for run in entry["results"]}
    return "\n".join(_run_sentence(plant, run) for plant, run in newest.items())


def _run_sentence(plant: str, run: Mapping[str, Any]) -> str:
    scores = run["scores"]
    place, first, alarm = (scores[name] for name in ("place", "first", "false_alarm"))
    return (
        f"- {plant}: place right in {100 * place['value']:.0f} % of {place['count']}, effect first in"
        f" {100 * first['value']:.0f} % of {first['count']}, false alarms in {100 * alarm['value']:.0f} % of"
        f" {alarm['count']} ({run['made']['date']}, commit {run['made']['commit']})."
    )


def paper_table(entry: Entry) -> str:
    """Every quantity of `hand reproduce`, with the paper's value where the paper prints one."""
    rows = [
        (
            f"`{row['id'].split('_')[0]}`",
            row["quantity"],
            "" if row["paper"] is None else f"{row['paper']:.3g}",
            f"{row['ours']:.3g}",
            row["unit"],
            row["note"],
        )
        for row in entry["results"]
    ]
    table = markdown(("figure", "quantity", "paper", "this code", "unit", "note"), rows)
    return f"{table}\n\n{source_line(entry)}"


def paper_overview(entry: Entry) -> str:
    """A row for everything that the paper shows or recommends."""
    from validation.paper.overview import HEADER, rows  # noqa: PLC0415 - imports nothing heavy, but belongs to the paper

    return f"{markdown(HEADER, rows({row['id']: row['ours'] for row in entry['results']}))}\n\n{source_line(entry)}"


def machine_sentence(entry: Entry) -> str:
    """What the diagnosis finds on the first machine: friction under pressure, and both validation errors."""
    first = entry["results"][0]
    values = {key: value for finding in first["findings"] for key, value in finding["parameters"].items()}
    # Keys end in the machine's units; results from before that have those of a hand.
    names = (("force_n", "torque_nm"), ("force_n_per_input", "torque_nm_per_pa"), ("presliding_mm", "presliding_deg"))
    level, slope, sliding = (
        next(values[f"coulomb_friction.{name}"] for name in pair if f"coulomb_friction.{name}" in values)
        for pair in names
    )
    return (
        f"The diagnosis finds Coulomb friction of {level['value']:.3g} {level['unit']} that grows with pressure"
        f" ({slope['value']:.2g} {slope['unit']}) and builds up over {sliding['value']:.2g} {sliding['unit']} of"
        f" motion. The validation error falls from {first['before']:.3g} to {first['after']:.3g} {first['unit']}"
        f" (`{entry['command']}`)."
    )


def rivals_table(entry: Entry) -> str:
    """Rivals on the recordings of a trial: their errors on test data, and the names of those that give any."""
    results = entry["results"]
    rows = []
    for name in dict.fromkeys((*results["fits"], *results["names"])):
        fit, given = results["fits"].get(name), results["names"].get(name)
        errors = (number(fit["median"]), f"{fit['clean']:.0%} of {fit['joints']}") if fit else ("predicts nothing", "")
        shares = ["gives no names", "", "", ""]
        if given:
            shares = ["" if given[key] is None else f"{given[key]:.0%}" for key in ("first", "place", "joint")]
            shares.append("" if given["log_score"] is None else f"{given['log_score']:.2f}")
        rows.append((name, *errors, *shares))
    header = ("method", "median error / noise", "joints at most 1.25", "effect first", "place", "joint", "log score")
    count = f"{results['recordings']} recordings, forest trained on {results['trained_on']} others."
    return f"{markdown(header, rows)}\n\n{count} {source_line(entry)}"


def ablations_table(entry: Entry) -> str:
    """Scores of the diagnosis without one part at a time, on the same recordings."""
    from validation.ablations import WHOLE  # noqa: PLC0415 - the diagnosis is slow to load

    results, whole = entry["results"], entry["results"][WHOLE]
    shares = ("place", "joint", "first", "both", "false_alarm", "unknown_found", "unknown_wrong", "clean", "ece")
    rows = []
    for part in (WHOLE, *(part for part in results if part != WHOLE)):
        row = results[part]
        cells = ["" if row[key]["value"] is None else f"{row[key]['value']:.0%}" for key in shares]
        score = row["log_score"]["value"]
        time = row["cpu_s"] / whole["cpu_s"]
        rows.append((part, *cells, "" if score is None else f"{score:.2f}", f"{time:.2f}"))
    header = (
        "without", "place", "joint", "effect first", "both of two", "false alarms", "unknown found", "known as unknown",
        "test error", "calibration error", "log score", "CPU time",
    )  # fmt: skip
    of = ", ".join(f"{whole[key]['count']} for {word}" for key, word in (("place", "place"), ("false_alarm", "alarms")))
    return f"{markdown(header, rows)}\n\n{whole['recordings']} recordings ({of}). {source_line(entry)}"


def proof_table(entry: Entry) -> str:
    """The scores of all plants, those that count together first."""
    from validation.proof import counted, head_of, rows_of  # noqa: PLC0415 - it imports this module through the figures

    results = entry["results"]
    count = sum(results["plants"][plant]["recordings"] for plant in counted(results))
    whole = sum(run["recordings"] for run in results["plants"].values())
    text = f"{count} of {whole} recordings are of plants that count. It took {results['minutes']:.0f} minutes."
    return f"{markdown(head_of(results), rows_of(results))}\n\n{text} {source_line(entry)}"
