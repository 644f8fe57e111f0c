"""The hand in MuJoCo as a referee: its plain motion, its effects, and the recordings that it writes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from validation.referees import mujoco_hand
from validation.referees.conditions import Conditions
from validation.referees.mujoco_hand import MEANS, Means, Plant, Scene, make, plant_of, simulate, sized
from validation.trial.arrays import Array
from validation.trial.limits import ANGLE, PRESSURE, REPEATABILITY, rms
from validation.trial.motions import set_points
from validation.trial.nominal import UNCERTAIN, Nominal
from validation.trial.plant import ROW, record
from validation.trial.seal import new_key, unseal

CONFIG = Path(__file__).parents[2] / "config" / "hand.yaml"
SEED, FRAMES = 5, 480
QUICK = ("frictionloss", "weight of a link", "object", "second pole")
"""Effects of different kinds; the others take as long each."""


@pytest.fixture(scope="module")
def nominal() -> Nominal:
    return Nominal(CONFIG)


@pytest.fixture(scope="module")
def commands(nominal: Nominal) -> Array:
    """Set-points of 2.4 s for the fingers; the thumb rests."""
    u = np.repeat(set_points("mixed", FRAMES // 2, 0.01, len(nominal.joints), np.random.default_rng(SEED)), 2, axis=0)
    u[:, :3] = 0.0
    return u


def plain(nominal: Nominal) -> Plant:
    return plant_of(nominal, CONFIG, nominal.rows)


def test_the_plain_hand_moves_as_the_equations_say(nominal: Nominal, commands: Array) -> None:
    """Fails when a valve, a torque or the creep is not that of the nominal model: another code computes the same."""
    ours = simulate(plain(nominal), commands)
    none = np.zeros(FRAMES)
    theirs = record(nominal.rows, commands, 0.005, nominal.partner, nominal.neighbour, wander=none)
    apart = np.sqrt(np.mean((ours[:2, :, 3:] - theirs[:2, :, 3:]) ** 2, axis=1))
    assert np.degrees(apart[1]).max() < 1.0 and np.degrees(np.ptp(ours[1, :, 3:], axis=0)).min() > 20.0
    assert apart[0].max() < 3e3


def test_pressure_at_rest_gives_the_angle_of_equation_6(nominal: Nominal) -> None:
    """Fails when gains, biases or the creep of Eqs. 11-13 differ from the nominal model's."""
    p, rows = 1.2e5, nominal.rows
    angle = simulate(plain(nominal), np.full((1600, len(nominal.joints)), p))[1, -1]
    a0, a1, a2, a3 = (rows[ROW[name]] for name in ("a0", "a1", "a2", "a3"))
    still = -(a0 + a2 * p) / (a1 + a3 * p)
    top = (rows[ROW["b1"]] * (p - rows[ROW["p_min"]])) * (1.0 - np.exp(-8.0 / rows[ROW["t_ext"]]))
    crept = -(a0 - a1 * top * rows[ROW["reach"]] + a2 * p) / (a1 + a3 * p)
    assert np.allclose(angle, crept, atol=np.radians(0.1)) and np.all(crept - still > np.radians(0.5))


@pytest.mark.parametrize(
    "means",
    [pytest.param(m, marks=() if m.name in QUICK else pytest.mark.long, id=m.name) for m in MEANS],
)
def test_an_effect_has_the_size_that_is_asked_for(means: Means, nominal: Nominal, commands: Array) -> None:
    """Fails when an effect does not act, acts on another finger, or wrong constants could imitate what it changes.

    Least squares over changes of 3 % of every constant, of the signal itself, is the independent measure.
    """
    print(f"seed {SEED}")
    joint = max(mujoco_hand._able(means, nominal.joints, range(3, 11)))
    u = commands.copy()
    if means.alone:
        u[:, [k for k in range(11) if k != joint]] = 0.0
    where = Scene(nominal, CONFIG, nominal.rows, u, joint)
    size = sized(means, where, 2.0, SEED)
    assert size is not None
    changed = plain(nominal)
    means.apply(changed, joint, size, np.random.default_rng(SEED))
    before, after = simulate(plain(nominal), u), simulate(changed, u)
    other = 10 if joint < 7 else 3
    assert rms(after[1, :, other] - before[1, :, other]) < 0.1 * REPEATABILITY[ANGLE]
    changes = dict.fromkeys(UNCERTAIN, 1.03)
    if means.stage == PRESSURE:
        changes["delay"] = 1.4  # it is known less well than the others
    else:
        changes.pop("lag")
    plain_reading = where.readings(None, 0.0)[means.stage]
    alike = [
        where.readings(None, 0.0, **{name: factor})[means.stage] - plain_reading for name, factor in changes.items()
    ]
    change = where.readings((means, SEED), size)[means.stage] - plain_reading
    factors = np.linalg.lstsq(np.array(alike).T, change, rcond=1e-6)[0]
    left = rms(change - factors @ np.array(alike)) / REPEATABILITY[means.stage]
    whole = rms(change) / REPEATABILITY[means.stage]
    assert left <= 2.3 and whole >= 1.7


def test_a_trial_is_sealed_and_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a case lacks its recording, its truth or its plan."""
    monkeypatch.setattr(mujoco_hand, "USUAL", 0.0)
    monkeypatch.setattr(mujoco_hand, "TRIAL_S", 3.0)
    monkeypatch.setattr(mujoco_hand, "draw", lambda rng: Conditions(duration_s=6.0))
    key = new_key()
    shares: list[float] = []
    make(tmp_path, CONFIG, 3, SEED, key, jobs=1, progress=shares.append)
    truth, _ = unseal(tmp_path, key)
    plan = json.loads((tmp_path / "plan.json").read_text())
    assert len(plan) == len(truth["cases"]) == 3 and shares[-1] == 1.0
    for case in truth["cases"]:
        path = tmp_path / "recordings" / f"case_{case['number']:04d}.mcap"
        assert path.stat().st_size > 10_000 and case["referee"] == "mujoco"
        assert len(case["truth"]) == {"null": 0, "single": 1, "several": 2}[case["kind"]] or case["unplaced"]
