"""report.html: the diagnosis for a person who has two minutes, in one file; and the figures as PNGs."""

from __future__ import annotations

import base64
import html
import io
import itertools
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hand_diagnosis.diagnose import Diagnosis, JointDiagnosis
from hand_diagnosis.isolability import ALIKE
from hand_diagnosis.verdict import describe, states_of
from hand_identification.joint_problem import SHOWN, STAGES, UNITS
from hand_model.arrays import Array

VERDICTS = {
    "agrees": "Model and recording agree.",
    "explained": "What the model left out is found and explains the difference.",
    "partly_explained": "A part of the difference is explained.",
    "unknown_physics": "Something is missing that no known effect explains.",
}
Units = Mapping[str, tuple[float, str]]
HAND_UNITS: Units = {name: (scale, unit) for name, scale, unit in zip(STAGES, SHOWN, UNITS, strict=True)}
BINS = 24
MOVING_RAD_S = 0.05
CORRELATED = 0.8
INK, BLUE, RED, GREY = "#1a1a1a", "#1f6f9f", "#c0392b", "#888888"


def write_page(diagnosis: Diagnosis, content: dict[str, Any], out: Path, units: Units = HAND_UNITS) -> None:
    """report.html and a PNG for every joint with a finding (or the worst joint where there is none).

    units: factor from SI and name of the unit in which each signal is shown.
    """
    joints = _shown(diagnosis)
    pictures = {}
    for one in joints:
        pictures[one.joint] = _png(_figure(one, units))
        (out / f"{one.joint}.png").write_bytes(pictures[one.joint])
    body = _head(diagnosis, content) + "".join(_joint(one, pictures[one.joint], content, units) for one in joints)
    body += _next(content) + _details(content)
    template = files("hand_diagnosis").joinpath("report.html").read_text(encoding="utf-8")
    (out / "report.html").write_text(template.replace("<!--body-->", body), encoding="utf-8")


def _shown(diagnosis: Diagnosis) -> list[JointDiagnosis]:
    found = [finding.joint for finding in diagnosis.findings]
    shown = [one for one in diagnosis.joints if one.joint in found or one.search.accepted]
    return shown or list(diagnosis.joints[:1])


def _head(diagnosis: Diagnosis, content: dict[str, Any]) -> str:
    items = "".join(
        f"<li><b>{html.escape(f['effect'].replace('_', ' '))}</b> <span class=p>{f['probability']:.0%}</span><br>"
        f"{html.escape(f['statement'])}</li>"
        for f in content["findings"]
    )
    listing = f"<ol>{items}</ol>" if items else "<p>No effect of the catalogue is missing from the model.</p>"
    names = ", ".join(html.escape(name) for name in content["recordings"])
    model = html.escape(Path(content["model"]).name)
    return (
        f"<h1>{VERDICTS[diagnosis.verdict]}</h1>"
        f"<p class=sub>{names} against {model}, {len(diagnosis.joints)} joints judged</p>{listing}"
    )


def _joint(one: JointDiagnosis, picture: bytes, content: dict[str, Any], units: Units) -> str:
    data = base64.b64encode(picture).decode("ascii")
    rivals = "".join(
        f"<tr><td>{html.escape(h.effect.name)}</td><td>{h.log_evidence - one.search.nominal_evidence:+.0f}</td>"
        f"<td>{_fall(one, h, units)}</td></tr>"
        for h in (one.search.rounds[0] if one.search.rounds else [])
    )
    evidence = "<p>No hypothesis promised an improvement.</p>"
    if rivals:
        head = "<tr><th>hypothesis</th><th>log evidence over the nominal model</th><th>held-out error</th></tr>"
        evidence = f"<table>{head}{rivals}</table>"
    numbers = "".join(
        f"<tr><td>{html.escape(key)}</td><td>{p['value']:.4g}</td><td>{p['std']:.2g}</td><td>{html.escape(p['unit'])}</td>"
        f"<td>{_remark(f['effect'], p['determined'])}</td></tr>"
        for f in content["findings"]
        if f["joint"] == one.joint
        for key, p in f["parameters"].items()
    )
    head = "<tr><th>parameter</th><th>value</th><th>std</th><th>unit</th><th></th></tr>"
    table = f"<table>{head}{numbers}</table>" if numbers else ""
    return (
        f"<section><h2>{html.escape(one.joint)}</h2><img alt='measured and simulated {html.escape(one.joint)}'"
        f" src='data:image/png;base64,{data}'>{table}<details><summary>Evidence</summary>{evidence}</details></section>"
    )


def _remark(effect: str, determined: bool) -> str:
    if effect == "unknown":
        return "explains a part, not claimed"
    return "" if determined else "not determined by these data"


def _fall(one: JointDiagnosis, hypothesis: Any, units: Units) -> str:
    problem, stage = one.search.problem, hypothesis.stage
    scale, unit = units[STAGES[stage]]
    held = problem.held_out
    count = max(float(problem.block_counts[stage, held].sum()), 1.0)
    values = [
        scale * float(np.sqrt(fit.squares[stage, held].sum() / count)) for fit in (one.search.nominal, hypothesis.fit)
    ]
    return f"{values[0]:.3g} &rarr; {values[1]:.3g} {unit}"


def _next(content: dict[str, Any]) -> str:
    chosen = content["next_experiment"]
    if chosen is None:
        return ""
    name = html.escape(chosen["name"].replace("_", " "))
    return f"<section><h2>What to record next</h2><p><b>{name}</b>: {html.escape(chosen['why'])}.</p></section>"


def _details(content: dict[str, Any]) -> str:
    fits = "".join(
        f"<tr><td>{html.escape(r['joint'])}</td><td>{r['signal']}</td><td>{r['split'].replace('_', ' ')}</td>"
        f"<td>{r['rmse_before']:.4g}</td><td>{r['rmse_after']:.4g}</td><td>{r['noise_floor']:.3g}</td><td>{r['unit']}</td></tr>"
        for r in content["fit"]
    )
    changes = "".join(
        f"<tr><td>{html.escape(r['joint'])}</td><td>{html.escape(r['parameter'])}</td>"
        f"<td>{'' if r['relative_change'] is None else format(r['relative_change'], '+.1%')}</td></tr>"
        for r in content["parameter_changes"]
    )
    small = "".join(f"<li>{html.escape(one['statement'])}</li>" for one in content["not_claimable"]) or "<li>none</li>"
    check = "".join(f"<li>{html.escape(line)}</li>" for line in content["data_check"]) or "<li>nothing unusual</li>"
    return (
        "<details><summary>Fit of every joint</summary><table><tr><th>joint</th><th>signal</th><th>data</th>"
        f"<th>before</th><th>after</th><th>noise</th><th>unit</th></tr>{fits}</table></details>"
        f"<details><summary>Improvements too small to be claimed</summary><ul>{small}</ul></details>"
        "<details><summary>Nominal numbers that moved within their tolerance</summary><table><tr><th>joint</th>"
        f"<th>parameter</th><th>change</th></tr>{changes}</table></details>"
        f"<details><summary>Where the nominal model misses, and where it does not</summary>{_where(content)}</details>"
        f"<details><summary>Parameters that only the data together determine</summary>{_correlated(content)}</details>"
        f"<details><summary>What these data can tell apart</summary>{_alike(content)}</details>"
        f"<details><summary>Data check</summary><ul>{check}</ul></details>"
    )


def _where(content: dict[str, Any]) -> str:
    """Every region, those that are missed in bold."""
    rows = "".join(
        f"<tr><td>{html.escape(r['joint'])}</td><td>{r['signal']}</td><td>{html.escape(r['state'])}: {r['part']}</td>"
        f"<td>{r['rms']:.3g}</td><td>{r['noise']:.3g}</td><td>{r['unit']}</td><td>{r['sigma']:.1f}</td>"
        f"<td>{'<b>missed</b>' if r['missed'] else 'as noise'}</td></tr>"
        for r in content["located"]
    )
    head = "".join(
        f"<th>{name}</th>" for name in ("joint", "signal", "where", "RMS", "noise", "unit", "standard errors above", "")
    )
    return f"<table><tr>{head}</tr>{rows}</table>"


def _correlated(content: dict[str, Any]) -> str:
    """Pairs of parameters whose estimates lean on each other."""
    rows = ""
    for one in content["correlations"]:
        names, matrix = one["parameters"], one["matrix"]
        for i, k in itertools.combinations(range(len(names)), 2):
            if abs(matrix[i][k]) > CORRELATED:
                cells = (
                    html.escape(one["joint"]),
                    html.escape(names[i]),
                    html.escape(names[k]),
                    f"{matrix[i][k]:+.2f}",
                )
                rows += "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"
    head = "<tr><th>joint</th><th>parameter</th><th>parameter</th><th>correlation</th></tr>"
    return f"<table>{head}{rows}</table>" if rows else f"<p>No two estimates are correlated beyond {CORRELATED:g}.</p>"


def _alike(content: dict[str, Any]) -> str:
    """For each joint with findings: how visible each effect is, and which look the same."""
    parts = []
    for one in content["isolability"]:
        rows = ""
        for k, name in enumerate(one["effects"]):
            same = [o for i, o in enumerate(one["effects"]) if i != k and one["alike"][k][i] > ALIKE]
            rows += (
                f"<tr><td>{name}</td><td>{one['visible_sigma'][k]:.1f}</td><td>{one['absorbed_by_nominal'][k]:.0%}</td>"
                f"<td>{', '.join(same)}</td></tr>"
            )
        head = "<tr><th>effect</th><th>visible [sigma]</th><th>absorbed by nominal numbers</th><th>looks like</th></tr>"
        parts.append(f"<h3>{html.escape(one['joint'])}</h3><table>{head}{rows}</table>")
    return "".join(parts) or "<p>Nothing was found that could be confused.</p>"


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return buffer.getvalue()


def _figure(one: JointDiagnosis, units: Units) -> Figure:
    """Measured, before and after on the stage that gained most; residuals over time and over the telling state."""
    stage = max(one.results, key=lambda r: r.excess_before / (r.noise + 1e-12)).stage if one.results else 1
    segment = one.search.problem.segments[0]
    scale, unit = units[STAGES[stage]]
    time_s = np.arange(len(segment.angle_rad)) * segment.period_s
    use = segment.use[stage]
    measured = scale * segment.measured[stage]
    figure = Figure(figsize=(9.5, 6.4), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 3, height_ratios=(3, 2))
    top, left, right = (figure.add_subplot(grid[where]) for where in (np.s_[0, :], np.s_[1, :2], np.s_[1, 2]))
    shade = one.search.problem.held_out[segment.block]
    for axis in (top, left):
        axis.fill_between(time_s, 0, 1, where=shade, transform=axis.get_xaxis_transform(), color="#f0f0f0", lw=0)
    for axis in (top, left, right):
        axis.spines[["top", "right"]].set_visible(False)
    top.plot(time_s, measured, color=INK, lw=1.4, label="measured")
    for fit, colour, label in (
        (one.search.nominal, RED, "nominal model"),
        (one.search.final, BLUE, "with the findings"),
    ):
        residual = np.where(use, scale * fit.residuals[0][stage], np.nan)
        top.plot(time_s, measured - residual, color=colour, lw=0.9, label=label)
        left.plot(time_s, residual, color=colour, lw=0.7)
    top.set(ylabel=f"{STAGES[stage]} [{unit}]", title=f"{one.joint} (grey: held-out data)")
    top.margins(y=0.15)
    top.legend(frameon=False, ncols=3, loc="upper right")
    left.set(xlabel="time [s]", ylabel=f"measured - model [{unit}]")
    _over_state(right, one, stage, units)
    return figure


def _over_state(axis: Axes, one: JointDiagnosis, stage: int, units: Units) -> None:
    """Mean residuals over the state that tells most, by direction of motion: effects switched off, and on."""
    problem = one.search.problem
    segment = problem.segments[0]
    use = segment.use[stage]
    if use.sum() <= BINS:
        return
    states = states_of(segment, use)
    bare = one.search.with_effects_off()
    name = describe(problem, bare, stage).state
    values, speed = states[name], states["speed"]
    scale, (per_state, unit) = units[STAGES[stage]][0], _state_unit(name, units)
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, BINS + 1)))
    for fit, colour in ((bare, RED), (one.search.final, BLUE)):
        residual = scale * fit.residuals[0][stage][use]
        for moving, style, label in ((speed > MOVING_RAD_S, "-", "flexing"), (speed < -MOVING_RAD_S, ":", "extending")):
            at, mean = _binned(values[moving], residual[moving], edges)
            axis.plot(per_state * at, mean, style, color=colour, lw=1.2, label=label)
    axis.axhline(0.0, color=GREY, lw=0.5)
    axis.set(xlabel=f"{name} [{unit}]")
    axis.locator_params(axis="x", nbins=4)
    axis.legend(*(part[:2] for part in axis.get_legend_handles_labels()), frameon=False, fontsize="small")


def _state_unit(name: str, units: Units) -> tuple[float, str]:
    """Factor from SI and unit in which a state is shown."""
    if name == "time":
        return 1.0, "s"
    scale, unit = units["pressure" if name in {"pressure", "set-point"} else "angle"]
    return scale, f"{unit}/s" if name == "speed" else unit


def _binned(values: Array, residual: Array, edges: Array) -> tuple[Array, Array]:
    """Centres of the bins that hold enough, and their means."""
    index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    count = np.bincount(index, minlength=len(edges) - 1)
    sums = np.bincount(index, residual, minlength=len(edges) - 1)
    enough = count >= 5
    return 0.5 * (edges[1:] + edges[:-1])[enough], sums[enough] / count[enough]
