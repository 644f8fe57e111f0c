"""Regenerate the generated sections and pictures of README and docs: python -m validation.figures [--check].

A section stands between `<!-- generated: COMMAND -->` and `<!-- end -->`; a command that makes several sections has
their names behind a `#`. The text comes from docs/figures/results.json, from the code (tables of parameters) or, for
pictures, from the command itself.

Examples: python -m validation.figures
          python -m validation.figures --take out/bench.json
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from validation import hand_picture, tables
from validation.bench.__main__ import BENCHES, missing_tools, quick_results
from validation.faults import page as faults_page
from validation.machines import tables as machine_tables
from validation.mutation import tables as mutants
from validation.results import ROOT, STORE, load, provenance, read_run, store
from validation.trial import document

QUIET = "on a machine without other load"
NOT_STORED = f"No such run {QUIET} is stored yet."
PAGES = ("README.md", "CONTRIBUTING.md", "firmware/README.md", "docs/*.md")
SECTION = re.compile(
    r"(?<!`)<!-- generated: (?P<name>[^>]+?) -->(?P<gap>\n*)(?P<text>.*?)(?P<end>\n*<!-- end -->)", re.DOTALL
)


@dataclass(frozen=True, slots=True)
class Part:
    """One generated section.

    source: its entry of results.json; empty where the code itself is the source.  render: the entry's Markdown.
    picture: name of the picture in docs/figures that the section shows; its text is then not generated.
    exact: the quick form gives the same text as the long one, so the check demands equality.  missing: the text while
    no run is stored; empty where one must be.
    """

    source: str
    render: Callable[[Any], str] | None = None
    picture: str = ""
    exact: bool = False
    missing: str = ""

    def text(self, entries: dict[str, Any]) -> str:
        """The Markdown of the section."""
        assert self.render is not None
        return self.missing if self.missing and self.source not in entries else self.render(entries.get(self.source))


def _bench(name: str) -> str:
    return f"python -m validation.bench --only {name}"


def _code(module: str, function: str) -> Callable[[Any], str]:
    """A table that a module of this tree renders; imported when it is needed."""

    def render(_: Any) -> str:
        return str(getattr(__import__(module, fromlist=[function]), function)()).strip("\n")

    return render


def _settings(key: str) -> Callable[[Any], str]:
    """The table of a group of settings, by its key in report.json."""

    def render(_: Any) -> str:
        from hand_diagnosis.settings_table import IN_FORCE, markdown_table  # noqa: PLC0415 - imported when needed

        return markdown_table(IN_FORCE[key]).strip("\n")

    return render


def _trial(render: Callable[[Any], str]) -> Callable[[Any], str]:
    return lambda entry: f"{render(entry['results']).strip()}\n\n{tables.source_line(entry)}"


PARTS: dict[str, Part] = {
    **{_bench(name): Part(f"bench/{name}", tables.bench_table) for name in BENCHES},
    _bench("loop"): Part("bench/loop", tables.loop_table, missing=NOT_STORED),
    _bench("steps"): Part("bench/steps", tables.steps_sentence, exact=True),
    _bench("demo"): Part("bench/demo", tables.demo_sentence),
    _bench("studio"): Part("bench/studio", tables.studio_sentence),
    _bench("effects"): Part("bench/effects", tables.effects_table),
    _bench("compare"): Part("bench/compare", tables.compare_table),
    "make faults # hazards": Part("faults", faults_page.hazards_table),
    "make faults # results": Part("faults", faults_page.results_table),
    "make faults FULL=1 # results": Part("faults/live", faults_page.results_table, missing=NOT_STORED),
    "make soak HOURS=1": Part("soak", tables.soak_table, missing=f"No hour {QUIET} is stored yet."),
    "make proof # together": Part("proof", tables.proof_table, missing=NOT_STORED),
    "make proof # summary": Part("trial", tables.trial_summary),
    "make proof # scores": Part("trial", _trial(document.scores_table)),
    "make proof # effects": Part("trial", _trial(document.effects_table)),
    "make proof # failures": Part("trial", _trial(document.failures_table)),
    "make proof # confusion": Part("trial", picture="proof_confusion.png"),
    "make proof # reliability": Part("trial", picture="proof_reliability.png"),
    "hand trial make OUT --plant PLANT # runs": Part(
        "referees", lambda entry: document.runs_table(entry["results"]).strip()
    ),
    "hand trial make OUT --plant PLANT # summary": Part("referees", tables.referee_summary),
    "hand trial make OUT --plant PLANT # families": Part(
        "referees", lambda entry: document.families_table(entry["results"]).strip()
    ),
    "python -m validation.trial_rivals FOLDER --train FOLDER": Part("trial_rivals", tables.rivals_table),
    "python -m validation.ablations FOLDER": Part("ablations", tables.ablations_table, missing=NOT_STORED),
    "make proof DATA=folder # machines": Part("reality", _trial(document.reality_table)),
    "make proof DATA=folder # seal": Part("reality", tables.machine_sentence),
    "python -m validation.mutation # groups": Part("mutation", mutants.groups_table),
    "python -m validation.mutation # survivors": Part("mutation", mutants.survivors_table),
    "make machines DATA=folder # results": Part("machines", machine_tables.machines_table),
    "make machines DATA=folder # first runs": Part("machines/first", machine_tables.first_runs_table),
    "make machines DATA=folder # sources": Part("machines", machine_tables.sources_table),
    "python -m hand_model.tables # catalogue": Part("", _code("hand_model.effects", "markdown_table")),
    "python -m hand_model.tables # classes": Part("", _code("hand_model.effects", "class_table")),
    "python -m hand_model.tables # parameters": Part("", _code("hand_model.kernel.rows", "markdown_table")),
    **{
        f"python -m validation.figures # {key}": Part("", _settings(key))
        for key in ("settings", "fit_settings", "reading_settings", "machine_settings")
    },
    "python -m validation.figures # what_if": Part("", _code("hand_studio.choices", "markdown_list")),
    "python -m validation.figures # python": Part("", _code("validation.api_page", "markdown")),
    "python -m validation.figures # commands": Part("", _code("validation.command_page", "markdown")),
    "python -m validation.figures # launch": Part("", _code("validation.node_page", "arguments")),
    "python -m validation.figures # messages": Part("", _code("validation.message_page", "messages")),
    "python -m validation.figures # actions": Part("", _code("validation.message_page", "actions")),
    "python -m validation.figures # nodes": Part("", _code("validation.node_page", "parameters")),
    "python -m validation.figures # hand": Part("", picture=hand_picture.PICTURE),
    "hand reproduce --out out/paper": Part("paper", tables.paper_table),
    "hand reproduce --out out/paper # overview": Part("paper", tables.paper_overview),
    "hand reproduce --only fig14 --out out/paper": Part("", picture="fig14.png"),
}
PICTURES = {"confusion.png": "proof_confusion.png", "reliability.png": "proof_reliability.png"}
"""Pictures of a trial's folder, by their names in docs/figures."""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; exit code 0 done, 1 a check failed, 2 bad usage or bad input."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.figures",
        description="Regenerate the generated sections and pictures of README and docs.",
        epilog="Example: python -m validation.figures --take out/bench.json",
    )
    parser.add_argument("--check", action="store_true", help="change nothing; say which section is not current")
    parser.add_argument(
        "--take", type=Path, action="append", default=[], metavar="RUN",
        help="store a long run's results first: out/bench.json, out/faults.json, out/soak.json, a trial's folder,"
        " mutation.json, machines.json, trial_rivals.json, reality.json; may be repeated",
    )  # fmt: skip
    options = parser.parse_args(arguments)
    if options.check:
        faults = check(load())
        for fault in faults:
            print(fault, file=sys.stderr)
        return 1 if faults else 0
    try:
        for run in options.take:
            take(run)
    except (OSError, ValueError) as error:
        print(f"python -m validation.figures: {error}", file=sys.stderr)
        return 2
    regenerate()
    return 0


def take(run: Path) -> None:
    """Store a long run's results, and a trial's pictures; a shorter trial does not replace a longer one.

    Raises ValueError for what is no run.
    """
    found = read_run(run)
    if "trial" in found:
        stored = load()
        old = stored["trial"]["results"]["recordings"] if "trial" in stored else 0
        new = found["trial"]["results"]["recordings"]
        if new < old:
            print(f"{run}: a trial of {new} recordings does not replace the one of {old} that is stored")
            return
        for name, kept in PICTURES.items():
            (STORE.parent / kept).write_bytes((run / name).read_bytes())
    store(found)
    print(f"stored in {STORE.relative_to(ROOT)}: {', '.join(found)}")


def regenerate() -> None:
    """Run what takes about a minute (the paper's figures, the step response) and fill every page."""
    hand_picture.write()
    quantities = draw_paper()
    fresh = {"paper": {**provenance("hand reproduce --out out/paper"), "results": quantities}}
    fresh["bench/steps"] = {**provenance(_bench("steps")), "results": list(quick_results("steps"))}
    store(fresh)
    entries = load()
    for page in pages():
        text = page.read_text(encoding="utf-8")
        filled = fill(text, entries, page)
        if filled != text:
            page.write_text(filled, encoding="utf-8")
            print(f"written: {page.relative_to(ROOT)}")


def draw_paper() -> list[dict[str, Any]]:
    """Reproduce every figure of the paper; writes docs/figures/fig14.png and returns all quantities."""
    from dataclasses import asdict  # noqa: PLC0415 - only here

    from validation.paper.page import png  # noqa: PLC0415 - as above
    from validation.paper.result import IDS, reproduce  # noqa: PLC0415 - matplotlib and finite elements are slow to load

    quantities = []
    for name in IDS:
        result = reproduce(name, 0, lambda _: None)
        quantities += [asdict(quantity) for quantity in result.quantities]
        if name == "fig14":
            (STORE.parent / "fig14.png").write_bytes(png(result))
    return quantities


def pages() -> list[Path]:
    """README and docs."""
    return [path for pattern in PAGES for path in sorted(ROOT.glob(pattern))]


def sections(text: str) -> Iterator[tuple[str, str]]:
    """Name (the command) and content of each generated section of a page."""
    for found in SECTION.finditer(text):
        yield found["name"], found["text"]


def fill(text: str, entries: dict[str, Any], page: Path) -> str:
    """A page with its sections rendered again. Raises ValueError, with the page, for a name not in PARTS."""

    def replaced(found: re.Match[str]) -> str:
        part = PARTS.get(found["name"])
        if part is None:
            raise ValueError(f"{page.relative_to(ROOT)}: nothing generates {found['name']!r}")
        content = found["text"] if part.render is None else part.text(entries)
        return f"<!-- generated: {found['name']} -->{found['gap']}{content}{found['end']}"

    return SECTION.sub(replaced, text)


def check(entries: dict[str, Any], *, run: bool = True) -> list[str]:
    """One line for each section that is not what its source gives; run: also the quick forms of the benches."""
    faults = []
    for page in pages():
        name, text = str(page.relative_to(ROOT)), page.read_text(encoding="utf-8")
        if len(re.findall("(?<!`)<!-- generated:", text)) != len(list(sections(text))):
            faults.append(f"{name}: a generated section has no <!-- end -->")
        for command, content in sections(text):
            if fault := _fault(command, content, entries, run):
                faults.append(f"{name}: section {command!r}: {fault}")
    return faults


def _fault(command: str, content: str, entries: dict[str, Any], run: bool) -> str:
    part = PARTS.get(command)
    if part is None:
        return "no such command generates a section"
    if part.render is None:
        shown = part.picture in content and (STORE.parent / part.picture).is_file()
        return "" if shown else f"it must show docs/figures/{part.picture}"
    if part.source and part.source not in entries and not part.missing:
        return f"{STORE.relative_to(ROOT)} has no {part.source}"
    if part.text(entries) != content:
        return "the text is not what its source gives; run: python -m validation.figures"
    if not (run and part.source.startswith("bench/") and part.source in entries):
        return ""
    bench = part.source.removeprefix("bench/")
    if missing_tools(bench):
        return ""
    return quick_fault(part, content, entries[part.source], list(quick_results(bench)))


def quick_fault(part: Part, content: str, entry: dict[str, Any], quick: list[dict[str, Any]]) -> str:
    """What the quick form's section has otherwise than the page's; empty where the format is the same."""
    assert part.render is not None
    text = part.render({**entry, "results": quick})
    if part.exact and text != content:
        return f"a run gives {text!r}"
    return "" if layout(text) == layout(content) else f"a quick run gives another format: {layout(text)}"


def layout(text: str) -> tuple[str, ...]:
    """A section's format: headers of its tables, widths of their rows, or its sentences without the numbers."""
    lines = text.splitlines()
    heads = [lines[k - 1] for k, line in enumerate(lines) if re.match(r"\| ?---", line)]
    if heads:
        widths = {line.count("|") for line in lines if line.startswith("|")}
        return (*heads, *map(str, sorted(widths)))
    return tuple(re.sub(r"-?\d[\d.,]*(e[-+]?\d+)?", "#", line) for line in lines)


if __name__ == "__main__":
    sys.exit(main())
