"""The referees: their plant, their laws, the held-back half, and recordings under drawn conditions."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from validation.referees import development, held_back, make, unknown_kinds
from validation.referees.conditions import Conditions, draw
from validation.referees.forms import Family
from validation.referees.plant import FRAME_S, Laws, record
from validation.referees.scene import Joints, cut, limit
from validation.trial.limits import Projector, rms
from validation.trial.motions import set_points
from validation.trial.nominal import Nominal
from validation.trial.plant import record as record_trial
from validation.trial.seal import new_key, unseal

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "config" / "hand.yaml"
SEED, COUNT = 8, 5
SELDOM = {"supply_droop", "ageing"}
"""Not visible where only two joints of the hand fill, or within 15 s."""


@pytest.fixture(scope="module")
def joint() -> Joints:
    """A joint that makes a mixed motion of 15 s."""
    nominal, rng = Nominal(CONFIG), np.random.default_rng(SEED)
    u = np.repeat(set_points("mixed", 1500, 0.01, len(nominal.joints), rng), 2, axis=0)
    return cut(nominal.rows, u, nominal.partner, nominal.neighbour, 4)


def test_without_laws_the_plant_is_that_of_the_trial(joint: Joints) -> None:
    """Fails when the equations that every hand has differ between the two plants, or a neutral law acts."""
    laws = Laws(joint.q.shape[1], len(joint.u))
    ours = record(joint.q, (laws, laws), joint.u, FRAME_S, joint.partner, joint.neighbour, step_s=5e-4)
    none = np.zeros(len(joint.u))
    theirs = record_trial(joint.q, joint.u, FRAME_S, joint.partner, joint.neighbour, wander=none, step_s=5e-4)
    assert np.allclose(ours[:3], theirs[:3], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("family", development.DEVELOPMENT, ids=lambda family: family.name)
def test_a_family_is_visible_and_vanishes(family: Family, joint: Joints) -> None:
    """Fails when a law does not act, acts without a size, or its limit is not where its effect is as large as noise."""
    print(f"seed {SEED}")
    law = family.draw(joint.site(), np.random.default_rng(SEED))
    projector = Projector(joint, family.stage)
    size = limit(law, family.stage, family.most, joint, projector)

    def seen(at: float) -> float:
        return rms(projector.remainder(joint.readings(law, at)[family.stage] - projector.plain))

    assert seen(1e-6 * min(size, 1.0)) < 0.3
    if family.effect not in SELDOM:
        assert seen(size) == pytest.approx(1.0, abs=0.35)


def test_a_law_begins_at_its_frame(joint: Joints) -> None:
    """Fails when an effect with an onset acts before it, or never."""
    plain, laden = Laws(joint.q.shape[1], len(joint.u)), Laws(joint.q.shape[1], len(joint.u))
    family = next(family for family in development.DEVELOPMENT if family.name == "load")
    family.draw(joint.site(), np.random.default_rng(SEED))(laden, 0, 3.0)
    fixed = (FRAME_S, joint.partner, joint.neighbour)
    without = record(joint.q, (plain, plain), joint.u, *fixed, step_s=5e-4)
    begun = record(joint.q, (plain, laden), joint.u, *fixed, since=1500, step_s=5e-4)
    change = np.abs(begun - without)[1, :, 0]
    assert change[:1501].max() == 0.0 and change[1600:].max() > 1e-3


def test_the_halves_share_nothing_and_the_held_back_one_is_frozen(tmp_path: Path) -> None:
    """Fails when a family or kind is in both halves, or a changed file of the held-back half can be run."""
    names = [{f.name for f in half} for half in (development.DEVELOPMENT, held_back.HELD_BACK)]
    kinds = [{k.name for k in half} for half in (unknown_kinds.DEVELOPMENT, unknown_kinds.HELD_BACK)]
    assert not names[0] & names[1] and not kinds[0] & kinds[1]
    assert sum(len(half) for half in kinds) >= 20 and len(kinds[1]) >= 10
    assert {f.effect for f in held_back.HELD_BACK} >= {f.effect for f in development.DEVELOPMENT} - {
        "constant_load", "angle_lag", "pressure_gain",
    }  # fmt: skip
    make.of_half("held_back")
    frozen = make.FROZEN
    try:
        make.FROZEN = tmp_path / "frozen.json"
        make.FROZEN.write_text(json.dumps({"forms.py": "0"}), encoding="utf-8")
        (tmp_path / "forms.py").write_text("changed = 1", encoding="utf-8")
        with pytest.raises(ValueError, match="is not the frozen one"):
            make.of_half("held_back")
    finally:
        make.FROZEN = frozen


def test_drawn_cases_are_recorded_under_their_conditions(tmp_path: Path) -> None:
    """Fails when a recording lacks joints or commands, has another rate or no jitter, or the truth is readable."""
    key, seed = new_key(), 20
    print(f"seed {seed}")
    make.make(tmp_path, CONFIG, COUNT, seed, key, "development", jobs=1, progress=lambda _: None)
    truth, _ = unseal(tmp_path, key)
    plan = (tmp_path / "plan.json").read_text(encoding="utf-8")
    assert "coulomb" not in plan and len(json.loads(plan)) == COUNT
    for case in truth["cases"]:
        how = case["conditions"]
        path = tmp_path / "recordings" / f"case_{case['number']:04d}.mcap"
        if path.stat().st_size > 3_000_000:
            continue
        with AnyReader([path]) as reader:
            stamps, joints, commands = [], 0, 0
            for connection, _, raw in reader.messages():
                if connection.topic == "/hand/valve_command":
                    commands += 1
                elif connection.topic == "/hand/joint_states":
                    message: Any = reader.deserialize(raw, connection.msgtype)
                    stamps.append(message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec)
                    joints = len(message.name)
        gaps = np.diff(stamps)
        assert joints == how["joints"]
        assert commands == pytest.approx(100.0 * how["duration_s"], abs=2)
        assert np.median(gaps) == pytest.approx(1.0 / how["rate_hz"], rel=0.2)
        assert (len(gaps) + 1) / (how["rate_hz"] * how["duration_s"]) == pytest.approx(1.0 - how["lost"], abs=0.03)
        assert (np.std(gaps[gaps < 1.5 / how["rate_hz"]]) > 1e-6 + 0.3 * how["jitter_s"]) == (how["jitter_s"] > 0.0)


def test_conditions_are_those_that_are_named() -> None:
    """Fails when a drawn condition leaves its range, or the usual one is called unusual."""
    rng = np.random.default_rng(SEED)
    assert Conditions().labels() == ["off 3%, default tolerance", "4 joints"]
    for _ in range(200):
        how = draw(rng)
        assert how.off in {0.03, 0.1, 0.2} and how.stated >= 0.05
        assert 0.0 <= how.jitter_s <= 3e-3 and 0.0 <= how.lost <= 0.05
        assert 25 <= how.rate_hz <= 200 and 0.49 < how.noise < 5.1 and how.joints in {1, 4, 11}


def test_a_tendon_to_an_unrecorded_joint_is_not_concealed() -> None:
    """Fails when a trial asks for a coupling of which the recording has one end only."""
    nominal = Nominal(CONFIG)
    tendon = next(family for family in development.DEVELOPMENT if family.effect == "joint_coupling")
    other = next(family for family in development.DEVELOPMENT if family.effect == "stiffening")
    neighbour = int(nominal.neighbour[1])
    assert not make._recorded(tendon, 1, [1], nominal)
    assert make._recorded(tendon, 1, [1, neighbour], nominal)
    assert make._recorded(other, 1, [1], nominal)
