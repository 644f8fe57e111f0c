"""`hand diagnose` and `hand excite` as a user runs them: bags, tables, pages, bad input."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from hand_diagnosis import diagnose
from hand_diagnosis.experiments import best_experiment, separation_sigma
from hand_diagnosis.report import schema
from hand_diagnosis.search import Hypothesis
from hand_identification.excitation import EXPERIMENTS, pressure_ceiling_pa, set_points
from hand_identification.free_parameters import effect_free_parameters
from hand_identification.joint_data import joint_problem
from hand_identification.map_fit import map_fit
from hand_model.description import Hand, load_hand
from hand_model.effects import CATALOGUE, EFFECTS
from hand_model.kernel.rows import ROW
from hand_pages.numbers import with_error
from hand_recording.loader import load_recording
from hand_recording.replay import record_offline
from test.diagnosis.recordings import CONFIG, changed, excitation, hand_tool, off_by_a_little, record, recorded_alone
from validation.browser import Browser

CONTRAST = """names => {
  const light = text => {
    const hex = text.trim().replace(/^#(.)(.)(.)$/, "#$1$1$2$2$3$3");
    const linear = c => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
    const part = k => linear(parseInt(hex.slice(k, k + 2), 16) / 255);
    return 0.2126 * part(1) + 0.7152 * part(3) + 0.0722 * part(5);
  };
  const style = getComputedStyle(document.documentElement), value = name => light(style.getPropertyValue("--" + name));
  const ratio = (a, b) => (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  return names.map(name => ratio(value(name), value("paper")));
}"""
"""Contrast of the page's colours with its background, as WCAG 2.2 defines it."""
TABLE_S = 24.0
"""Length of a table."""


@pytest.fixture(scope="module")
def rubbing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag of a hand with friction in index_proximal, through ADC and calibration."""
    out = tmp_path_factory.mktemp("bag") / "rubbing.mcap"
    hand = load_hand(CONFIG)
    truth = changed(hand, "index_proximal", coulomb_friction__torque_nm=0.012)
    for _ in record_offline(truth, excitation(np.random.default_rng(3), 40.0, 11), out, seed=3):
        pass
    return out


@pytest.fixture(scope="module")
def report(rubbing: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("report")
    joints = "index_proximal,index_distal"
    command = ["diagnose", str(rubbing), "--model", str(CONFIG), "--out", str(out), "--joints", joints, "--ask"]
    result = hand_tool(*command)
    assert result.exit_code == 0, result.output
    lines = [line for line in result.stdout.splitlines() if line.strip()]
    assert lines[0] == "verdict: explained"
    assert len(lines) <= 15
    return out


def test_report_json_is_valid_and_names_the_friction(report: Path) -> None:
    """Fails when report.json leaves its schema, or a bag's readings (Hall curve, ADC) are taken for physics."""
    content = json.loads((report / "report.json").read_text(encoding="utf-8"))
    jsonschema.validate(content, schema())
    assert [(f["joint"], f["effect"]) for f in content["findings"]] == [("index_proximal", "coulomb_friction")]
    assert content["sensor_curve"]
    held = [r for r in content["fit"] if r["split"] == "test" and r["signal"] == "angle"]
    assert all(r["rmse_after"] < 0.06 for r in held)


def test_the_patched_model_runs_and_has_the_friction(report: Path) -> None:
    """Fails when model.yaml does not load or lacks what was found."""
    patched = load_hand(report / "model.yaml")
    j = patched.joints.index("index_proximal")
    assert patched.parameters[ROW["coulomb_friction.torque_nm"], j] == pytest.approx(0.012, rel=0.1)
    assert np.all(np.delete(patched.parameters[ROW["coulomb_friction.torque_nm"]], j) == 0.0)


def test_the_patch_gives_the_model_that_was_found(report: Path, tmp_path: Path) -> None:
    """Fails when the patch changes more or less than model.yaml does, loses a comment, or hides a standard error."""
    model = tmp_path / "hand.yaml"
    model.write_text(CONFIG.read_text(encoding="utf-8"), encoding="utf-8")
    shown = hand_tool("patch", str(model), str(report / "patch.yaml"))
    assert shown.exit_code == 0, shown.output
    assert shown.stdout.startswith((report / "patch.diff").read_text(encoding="utf-8"))
    assert model.read_text(encoding="utf-8") == CONFIG.read_text(encoding="utf-8")  # only shown
    assert hand_tool("patch", str(model), str(report / "patch.yaml"), "--write").exit_code == 0
    found = load_hand(report / "model.yaml").parameters
    assert load_hand(model).parameters == pytest.approx(found, rel=1e-12, abs=0.0)
    assert not np.array_equal(found, load_hand(CONFIG).parameters)
    comments = [line for line in CONFIG.read_text(encoding="utf-8").splitlines() if "#" in line]
    assert [line for line in model.read_text(encoding="utf-8").splitlines() if "#" in line] == comments
    (number,) = [
        line for line in (report / "patch.yaml").read_text(encoding="utf-8").splitlines() if " torque_nm:" in line
    ]
    assert "new; ± " in number and "N m, coulomb_friction (" in number


@pytest.fixture(scope="module")
def page(report: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """The page in a browser, as wide as a telephone."""
    browser = Browser(tmp_path_factory.mktemp("browser"), "about:blank")
    browser.emulate((360, 700))
    browser.open((report / "report.html").as_uri())
    browser.until("document.querySelectorAll('figure.plot > svg').length === 3")
    yield browser
    browser.close()


def test_the_page_stands_alone(report: Path) -> None:
    """Fails when the page needs the network, exceeds 3 MB, or a picture for documents is missing."""
    text = (report / "report.html").read_text(encoding="utf-8")
    assert not re.search(r"(src|href)=[\"'](https?:|//)|@import|<script [^>]*src", text)
    assert "default-src 'none'" in text
    assert len(text.encode()) < 3_000_000
    assert (report / "index_proximal.png").read_bytes()[:4] == b"\x89PNG"


def test_the_title_is_the_answer(report: Path, page: Browser) -> None:
    """Fails when the reader has to search for effect, joint, number, errors, probability or origin of the page."""
    content = json.loads((report / "report.json").read_text(encoding="utf-8"))
    (finding,) = content["findings"]
    number = finding["parameters"]["coulomb_friction.torque_nm"]
    title = page.run("document.querySelector('h1').innerText")
    assert title.startswith(f"index_proximal: Coulomb friction of {with_error(number['value'], number['std'])} N m")
    assert page.run("document.title") == title
    (test,) = [
        r for r in content["fit"] if (r["joint"], r["split"], r["signal"]) == ("index_proximal", "test", "angle")
    ]
    tiles = page.run("[...document.querySelectorAll('.tiles b')].map(b => b.innerText)")
    assert tiles[0] == f"{test['rmse_before']:.3g} → {test['rmse_after']:.3g} deg"
    assert f"{finding['probability']:.0%}" in tiles
    made = page.run("document.querySelector('.made').innerText")
    assert content["made"]["model_sha256"][:16] in made and content["made"]["date"] in made
    heat = page.run("document.querySelector('.heat').innerText")
    patch = page.run("document.querySelector('#patch').innerText")
    assert (report / "patch.diff").read_text(encoding="utf-8").splitlines()[-1].strip() in patch
    assert f"hand patch {CONFIG} {report / 'patch.yaml'} --write" in patch
    before = test["rmse_before"] / test["noise_floor"]
    assert "index_distal" in heat and f"{before:.0f} → " in heat


def test_the_plots_answer_and_say_their_result(page: Browser) -> None:
    """Fails when a plot has no alternative text, a curve cannot be switched off, or keys do not zoom."""
    alt = page.run("document.querySelector('figure.plot').getAttribute('aria-label')")
    assert "angle of index_proximal over time: the validation error falls from" in alt
    assert page.run("document.querySelector('.drawing svg').getAttribute('aria-label')").startswith(
        "The hand; the nominal model misses index_proximal most"
    )
    first = "document.querySelector('figure.plot')"
    assert page.run(f"{first}.querySelectorAll('path.curve.before[d]').length") == 3  # in the key and two panels
    assert page.run(f"{first}.querySelectorAll('rect.test').length") == 2
    assert page.run(f"{first}.querySelectorAll('rect.validation').length") > 2
    page.click("nominal model")
    assert page.run(f"{first}.querySelectorAll('path.curve.before').length") == 1
    assert page.run(f"{first}.querySelectorAll('button')[1].getAttribute('aria-pressed')") == "false"
    page.click("nominal model")
    shown = f"[...{first}.querySelectorAll('text')].map(t => t.textContent).join()"
    whole = page.run(shown)
    page.run(f"{first}.focus()")
    page.key("+")
    assert page.run(shown) != whole
    page.key("0")
    assert page.run(shown) == whole


def test_an_effect_can_be_switched_off(report: Path, page: Browser) -> None:
    """Fails when a switch is not reached by the keyboard, or the residual without its effect is not drawn or stated."""
    first = "document.querySelector('figure.plot')"
    button, note = (
        f"{first}.querySelector('.switches button')",
        f"{first}.querySelector('.switches + output').innerText",
    )
    curves = f"[...{first}.querySelectorAll('path.curve.after')].map(c => c.getAttribute('d')).join()"
    assert page.run(f"{button}.innerText") == "Coulomb friction"
    having, said = page.run(curves), page.run(note)
    page.run(f"{button}.focus()")
    page.key(" ")
    assert page.run(f"{button}.getAttribute('aria-pressed')") == "false"
    lacking, says = page.run(curves), page.run(note)
    assert lacking != having
    assert said.startswith("With all effects found: ") and says.startswith("Without Coulomb friction: ")
    with_it, without = (float(re.search(r"model (\S+) deg", text)[1]) for text in (said, says))  # type: ignore[index]
    content = json.loads((report / "report.json").read_text(encoding="utf-8"))
    rows = [r for r in content["fit"] if (r["joint"], r["signal"]) == ("index_proximal", "angle")]
    assert min(r["rmse_after"] for r in rows) <= 1.01 * with_it <= 1.03 * max(r["rmse_after"] for r in rows)
    assert without > 5.0 * with_it
    page.key(" ")
    assert page.run(curves) == having


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_the_page_can_be_read_on_a_telephone_and_in_the_dark(page: Browser, dark: bool) -> None:
    """Fails when the page scrolls sideways at 360 px, or its text has too little contrast."""
    page.emulate((360, 700), dark=dark)
    assert page.run("document.documentElement.scrollWidth") == 360
    names = ("ink", "quiet", "link", "before", "after")
    ratios = page.run(f"({CONTRAST})({json.dumps(names)})")
    assert min(ratios) >= 4.5, dict(zip(names, ratios, strict=True))  # WCAG 2.2, 1.4.3


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag in which index_proximal alone moves, with friction."""
    out = tmp_path_factory.mktemp("alone") / "one.mcap"
    hand = load_hand(CONFIG)
    truth = changed(hand, "index_proximal", coulomb_friction__torque_nm=0.012)
    set_point = excitation(np.random.default_rng(6), 40.0, 11) * (np.arange(11) == hand.joints.index("index_proximal"))
    for _ in record_offline(truth, set_point, out, seed=3):
        pass
    return out


def test_a_table_gives_the_same_finding(alone: Path, tmp_path: Path) -> None:
    """Fails when units, signs or times of a mapped CSV are not applied."""
    base = load_recording(alone).on_time_base()
    few = base.time_s < base.time_s[0] + TABLE_S
    j = base.joints.index("index_proximal")
    rows = np.column_stack(
        [
            1e3 * base.time_s,
            1e-5 * base.valve_command[:, j],
            1e-5 * base.pressure[:, j],
            -np.degrees(base.position[:, j]),
        ]
    )
    table = tmp_path / "rig.csv"
    np.savetxt(
        table, rows[few & np.isfinite(rows).all(axis=1)], delimiter=",", header="t,u,p,phi", comments="", fmt="%.6f"
    )
    mapping = tmp_path / "map.yaml"
    mapping.write_text(
        "time: {column: t, unit: ms}\njoints:\n  index_proximal:\n    set_point: {column: u, unit: bar}\n"
        "    pressure: {column: p, unit: bar}\n    angle: {column: phi, unit: deg, sign: -1}\n",
        encoding="utf-8",
    )
    out = tmp_path / "out"
    result = hand_tool(
        "diagnose", str(table), "--map", str(mapping), "--model", str(CONFIG), "--out", str(out), "--json"
    )
    assert result.exit_code == 0, result.output
    content = json.loads(result.output)
    (friction,) = [finding for finding in content["findings"] if finding["effect"] == "coulomb_friction"]
    assert content["findings"][0] is friction
    assert friction["parameters"]["coulomb_friction.torque_nm"]["value"] == pytest.approx(0.012, rel=0.1)


def test_one_joint_alone_separates_its_sensors_curve_from_friction(alone: Path, tmp_path: Path) -> None:
    """Fails when friction hides the sensor's curve, which then passes for a stiffening and an obstacle."""
    result = hand_tool("diagnose", str(alone), "--model", str(CONFIG), "--out", str(tmp_path), "--json")
    assert result.exit_code == 0, result.output
    content = json.loads(result.output)
    assert content["sensor_curve"] is True
    assert [finding["effect"] for finding in content["findings"]] == ["coulomb_friction"]


BAD = {
    "no file": (("nowhere.mcap",), "nowhere.mcap"),
    "empty": (("empty.mcap",), "empty.mcap"),
    "text": (("text.mcap",), "text.mcap"),
    "no map": (("table.csv",), "--map"),
    "tolerance": (("text.mcap", "--tolerance", "0"), "above 0 to 1"),
    "column": (("table.csv", "--map", "map.yaml"), "no column 'phi'"),
    "other model": (("text.mcap", "--model", "nowhere.yaml"), "nowhere.yaml"),
    "effect": (("{bag}", "--without", "fricton"), "fricton"),
    "joint": (("{bag}", "--joints", "toe"), "'toe' was not recorded"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line(case: str, rubbing: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when bad input gives a traceback, a finding, or another exit code than 2."""
    monkeypatch.chdir(tmp_path)
    Path("empty.mcap").touch()
    Path("text.mcap").write_text("no recording\n", encoding="utf-8")
    Path("table.csv").write_text("t,p\n0,1\n1,2\n2,3\n", encoding="utf-8")
    Path("map.yaml").write_text(
        "time: {column: t}\njoints: {index_distal: {angle: {column: phi}, pressure: {column: p}}}\n", encoding="utf-8"
    )
    arguments, line = BAD[case]
    result = hand_tool("diagnose", *(a.format(bag=rubbing) for a in arguments), "--out", "out")
    said = [text for text in result.output.splitlines() if text.strip()]
    assert result.exit_code == 2, result.output
    assert len(said) == 1, said
    assert line in said[0]


def test_three_samples_are_refused(tmp_path: Path, hand: Hand) -> None:
    """Fails when a recording that is too short is diagnosed."""
    out = tmp_path / "short.mcap"
    for _ in record_offline(hand, np.zeros((3, 11)), out, seed=0):
        pass
    result = hand_tool("diagnose", str(out), "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert "are needed" in result.output


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_experiments_keep_their_limits(name: str, hand: Hand) -> None:
    """Fails when an experiment leaves pressure, torque or shape limits, or moves a joint not asked for."""
    commands = set_points(name, hand, ["index_distal", "ring_proximal"], 20.0, 3.5e5, 1)
    moved = [hand.joints.index(joint) for joint in ("index_distal", "ring_proximal")]
    assert commands.min() >= 0.0
    assert commands.max() <= 3.5e5
    assert np.all(np.delete(commands, moved, axis=1) == 0.0)
    for j in moved:
        ceiling = pressure_ceiling_pa(hand, j)
        a0, a1, a2, a3 = hand.parameters[ROW["statics.a0_nm"] : ROW["statics.a3_nm_per_pa_rad"] + 1, j]
        angles = np.linspace(hand.limits.low_rad[j], hand.limits.high_rad[j], 30)
        torque = a0 + a1 * angles + (a2 + a3 * angles) * ceiling
        assert torque.max() <= hand.limits.max_torque_nm[j] + 1e-9


def test_excite_records_what_diagnose_reads(tmp_path: Path) -> None:
    """Fails when the recording of an experiment is incomplete."""
    out = tmp_path / "steps.mcap"
    result = hand_tool("excite", "steps", "--joints", "index_distal", "--duration", "6", "--out", str(out), "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.output)["samples"] == 1200
    assert len(load_recording(out)["joint_states"]) == 1200
    for arguments, line in ((("stpes",), "staircase"), (("steps", "--duration", "1"), "2 to 3600")):
        refused = hand_tool("excite", *arguments, "--out", str(tmp_path / "x.mcap"))
        assert refused.exit_code == 2
        assert line in refused.output


def test_the_next_experiment_is_a_command_that_runs(
    tmp_path: Path, hand: Hand, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when --ask prints a command that is not valid, or a report names two experiments for one question.

    A leak through a gap, a span error of the pressure and a supply that is too low for the valve are alike in this
    recording of one joint.
    """
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(102)
    nominal = off_by_a_little(hand, rng)
    signals = record(changed(hand, "index_distal", leak__rate_per_s=0.5), rng, 30.0)
    made = diagnose([signals], nominal, joints=["index_distal"], sensor_curve=False)
    first, asked = made.findings[0], made.next_experiment
    assert asked is not None
    assert asked["name"] == first["alternatives"][0]["separate_by"]
    assert f"{first['effect']} (" in asked["why"] and "in simulation they differ by" in asked["why"]
    assert asked["name"] not in first["statement"]
    for finding in made.findings:
        assert bool(finding["tied_with"]) == (finding["tie"] is not None)
    words = asked["command"].split()
    assert words[:3] == ["hand", "excite", asked["name"]]
    assert "--live" in words
    offline = [word for word in words[1:] if word != "--live"]
    result = hand_tool(*offline, "--duration", "3", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.output)["joints"] == ["index_distal"]


def test_a_motion_that_separates_no_better_is_not_asked_for(hand: Hand) -> None:
    """Fails when the experiment that was just recorded is proposed again."""
    commands = np.zeros((4000, 11))
    j, seed = hand.joints.index("index_distal"), 5
    print(f"seed {seed}")
    commands[:, j] = 4e5 * EXPERIMENTS["steps"](np.arange(0.0, 40.0, 0.01), np.random.default_rng(seed))
    problem = joint_problem([recorded_alone(hand, commands)], hand, "index_distal")
    free = effect_free_parameters(EFFECTS["valve_lag"], problem.nominal)
    here, there = (map_fit(problem, free, z * np.ones(len(free)), 1) for z in (0.0, 0.3))
    one, other = (Hypothesis(EFFECTS["valve_lag"], fit, 0.0, 0, (0.0, 0.0)) for fit in (here, there))
    proposed = best_experiment(problem, one, other)
    own = separation_sigma(problem, here, there, "steps")
    assert proposed is None or (proposed[0] != "steps" and proposed[1] > 1.2 * own)


def test_every_experiment_that_effects_ask_for_exists_or_is_a_rearrangement() -> None:
    """Fails when the catalogue asks for an experiment that nobody can run."""
    by_hand = {"second_attitude", "stops", "neighbour_moves", "free_space"}
    for effect in CATALOGUE:
        assert set(effect.experiments) <= set(EXPERIMENTS) | by_hand, effect.name
