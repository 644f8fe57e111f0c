"""Grasp shapes: the shipped file is complete and well inside the limits; a wrong file is one clear line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hand_control.grasps import Approach, Grasp, Grasping, Outcome, load_grasps
from hand_control.object_width import object_width_m
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.geometry import link_poses
from hand_model.yaml_reader import DescriptionError

CONFIG = Path(__file__).resolve().parents[2] / "config"
HAND = load_hand(CONFIG / "hand.yaml")
GRASPS = load_grasps(CONFIG / "grasps.yaml", HAND)


def index(joint: str) -> int:
    return HAND.joints.index(joint)


def test_shipped_patterns() -> None:
    """Fails with a pattern that is missing, or by one that names itself otherwise."""
    assert set(GRASPS) >= {"open", "cylindrical", "tripod", "lateral", "hook", "pinch"}
    assert all(grasp.name == name for name, grasp in GRASPS.items())


@pytest.mark.parametrize("name", GRASPS)
def test_shipped_angles_are_well_inside_the_limits(name: str) -> None:
    """Fails with an angle below 5 or above 80 degrees: control needs room on both sides of it."""
    for closure in (0.0, 1.0):
        angles = np.degrees(GRASPS[name].shape(closure))
        assert angles.shape == (len(HAND.joints),)
        assert angles.min() >= 5.0 - 1e-9 and angles.max() <= 80.0 + 1e-9


def test_shapes_are_what_they_are_called() -> None:
    """Fails with angles on the wrong joints: opposed thumb, flexed fingers, fingers out of the way."""
    closed = {name: np.degrees(grasp.shape(1.0)) for name, grasp in GRASPS.items()}
    opposition = index("thumb_opposition")
    assert closed["tripod"][opposition] > 50.0 and closed["cylindrical"][opposition] > 50.0
    assert closed["lateral"][opposition] < 30.0
    assert all(closed["cylindrical"][index(f"{f}_proximal")] > 50.0 for f in ("index", "middle", "ring", "little"))
    assert closed["tripod"][index("ring_proximal")] > closed["tripod"][index("middle_proximal")]
    assert closed["hook"][index("index_distal")] > 2.0 * closed["hook"][index("index_proximal")]
    assert closed["pinch"][index("middle_proximal")] < 15.0 < closed["pinch"][index("index_proximal")]
    assert closed["open"].max() < 15.0


@given(name=st.sampled_from(sorted(GRASPS)), closure=st.floats(0.0, 1.0))
def test_closure_goes_straight_from_open_to_closed(name: str, closure: float) -> None:
    """Fails with a closure that is not in proportion, or ends elsewhere than at the closed angles."""
    grasp = GRASPS[name]
    middle = (1.0 - closure) * grasp.open_rad + closure * grasp.closed_rad
    np.testing.assert_allclose(grasp.shape(closure), middle, atol=1e-12)


@pytest.mark.parametrize("closure", [-0.01, 1.01, float("nan"), float("inf")])
def test_closure_out_of_range(closure: float) -> None:
    """Fails with a closure that takes joints beyond their closed angles."""
    with pytest.raises(ValueError, match=r"closure is .*; the allowed range is 0 to 1"):
        GRASPS["hook"].shape(closure)


def test_shape_is_a_fresh_array() -> None:
    """Fails with a shape that hands out the pattern's own memory."""
    grasp = Grasp("flat", np.zeros(2), np.ones(2))
    grasp.shape(0.0)[:] = 9.0
    grasp.shape(1.0)[:] = 9.0
    np.testing.assert_array_equal(grasp.open_rad, [0.0, 0.0])
    np.testing.assert_array_equal(grasp.closed_rad, [1.0, 1.0])


@pytest.fixture
def left_hand(tmp_path: Path) -> Hand:
    text = (CONFIG / "hand.yaml").read_text(encoding="utf-8")
    path = tmp_path / "left.yaml"
    path.write_text(text.replace('joint_prefix: ""', "joint_prefix: left_"), encoding="utf-8")
    return load_hand(path)


def test_names_in_the_file_have_no_prefix(left_hand: Hand) -> None:
    """Fails with a file that fits one of two hands only."""
    assert left_hand.joints[0] == "left_thumb_opposition"
    np.testing.assert_array_equal(
        load_grasps(CONFIG / "grasps.yaml", left_hand)["tripod"].shape(1.0), GRASPS["tripod"].shape(1.0)
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("open_deg: 5\npatterns:\n  fist: {elbow: 40}\n", ["patterns.fist.elbow", "not a known key", "index_distal"]),
        (
            "open_deg: 5\npatterns:\n  fist: {index_dital: 40}\n",
            ["patterns.fist.index_dital", "did you mean index_distal"],
        ),
        ("open_deg: 5\npatterns:\n  fist: {index_distal: 101}\n", ["patterns.fist.index_distal", "101", "-10 to 100"]),
        ("open_deg: 5\npatterns:\n  fist: {index_distal: -11}\n", ["patterns.fist.index_distal", "-11", "-10 to 100"]),
        (
            "open_deg: 5\npatterns:\n  fist: {index_distal: .nan}\n",
            ["patterns.fist.index_distal", "nan", "-10 to 100"],
        ),
        (
            "open_deg: 5\npatterns:\n  fist: {index_distal: far}\n",
            ["patterns.fist.index_distal", "far", "-10 to 100"],
        ),
        ("open_deg: 200\npatterns:\n  fist: {}\n", ["open_deg", "200", "-10 to 100"]),
        ("patterns:\n  fist: {}\n", ["open_deg", "missing"]),
        ("open_deg: 5\n", ["patterns", "missing"]),
        ("open_deg: 5\npatterns: 3\n", ["patterns", "3", "mapping"]),
        ("open_deg: 5\npatterns:\n  fist: 3\n", ["patterns.fist", "3", "mapping"]),
        ("open_deg: 5\nshapes: {}\n", ["shapes", "not a known key"]),
        (
            "open_deg: 5\npatterns:\n  fist: {preshape: {elbow: 40}}\n",
            ["patterns.fist.preshape.elbow", "not a known key"],
        ),
        (
            "open_deg: 5\npatterns:\n  fist: {index_distal: 40, preshape: {index_distal: 41}}\n",
            ["patterns.fist.preshape.index_distal", "41", "5 to 40"],
        ),
        (
            "open_deg: 5\npatterns:\n  fist: {index_distal: 40, begins: {index_distal: 1}}\n",
            ["patterns.fist.begins.index_distal", "1", "0 to 0.9"],
        ),
        ("open_deg: 5\npatterns:\n  fist: {begins: 3}\n", ["patterns.fist.begins", "3", "mapping"]),
        ("", ["empty"]),
    ],
)
def test_wrong_file_is_one_line(tmp_path: Path, text: str, said: list[str]) -> None:
    """Fails with a file that is taken as it is, or a message without file, key, value and range."""
    path = tmp_path / "wrong.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DescriptionError) as error:
        load_grasps(path, HAND)
    line = str(error.value)
    assert "\n" not in line
    for part in [str(path), *said]:
        assert part in line


def test_missing_file(tmp_path: Path) -> None:
    """Fails with a traceback where a file is missing."""
    with pytest.raises(DescriptionError, match=r"none\.yaml: cannot be read"):
        load_grasps(tmp_path / "none.yaml", HAND)


def test_a_contact_near_the_shape_is_held_before_the_grasp_is_done() -> None:
    """Fails when a grasp ends while the torque limit of a joint that met something late is still rising."""
    start = np.zeros(len(HAND.joints))
    shape = GRASPS["cylindrical"].shape(1.0)
    grasping = Grasping(HAND, shape, 0.1, start, Approach(1.0, 0.05))
    contact = np.zeros(len(HAND.joints), dtype=np.bool_)
    joint, dt = index("thumb_proximal"), 0.005
    while grasping.progress < 1.0:
        grasping.step(dt, shape, contact)
    for _ in range(30):
        grasping.step(dt, shape, contact)
    assert grasping.outcome is Outcome.RUNNING
    contact[joint] = True
    limits = []
    while grasping.outcome is Outcome.RUNNING:
        limits.append(grasping.step(dt, shape, contact)[1][joint])
    assert grasping.outcome is Outcome.DONE
    assert limits[0] < 0.06 and limits[-1] == 0.1


def targets(name: str, start: Array, seconds: float) -> Array:
    """Targets (samples, joints) [rad] of a grasp of the shipped file that meets nothing, 200 a second."""
    grasp, none = GRASPS[name], np.zeros(len(HAND.joints), dtype=np.bool_)
    approach = Approach(1.0, 0.05, grasp.preshape(1.0), grasp.begins)
    grasping = Grasping(HAND, grasp.shape(1.0), 0.1, start, approach)
    out = [grasping.step(0.005, start, none)[0] for _ in range(round(200 * seconds))]
    return np.array(out)


def test_the_thumb_is_opposed_before_the_fingers_close() -> None:
    """Fails when fingers close while the thumb is still on its way, or a joint is faster than it may be."""
    start = GRASPS["open"].shape(1.0)
    path = targets("tripod", start, 4.0)
    thumb, finger = index("thumb_opposition"), index("index_proximal")
    closing = int(np.argmax(path[:, finger] > start[finger] + 1e-9))
    assert path[closing - 1, thumb] == pytest.approx(GRASPS["tripod"].closed_rad[thumb], abs=0.006)
    assert closing == pytest.approx(200 * (GRASPS["tripod"].closed_rad[thumb] - start[thumb]), abs=2)
    assert float(np.abs(np.diff(path, axis=0)).max()) <= 0.005 + 1e-9
    np.testing.assert_allclose(path[-1], GRASPS["tripod"].shape(1.0))


def test_joints_that_begin_late_arrive_with_the_others() -> None:
    """Fails when the thumb of the lateral grasp moves before half of the closing time, or arrives later."""
    start = GRASPS["open"].shape(1.0)
    path = targets("lateral", start, 4.0)
    shape = GRASPS["lateral"].shape(1.0)
    thumb, finger = index("thumb_proximal"), index("middle_proximal")
    arrived = [int(np.argmax(np.abs(path[:, joint] - shape[joint]) < 1e-9)) for joint in (thumb, finger)]
    assert arrived[0] == arrived[1]
    moving = int(np.argmax(path[:, thumb] > start[thumb] + 1e-9))
    assert moving == pytest.approx(0.5 * arrived[1], abs=2)


def test_the_thumb_swings_back_once_the_fingers_open() -> None:
    """Fails when the release of an object begins with the opposition of the thumb, which would drag the object."""
    start = GRASPS["tripod"].shape(1.0)
    path = targets("open", start, 4.0)
    thumb, finger = index("thumb_opposition"), index("index_proximal")
    back = int(np.argmax(path[:, thumb] < start[thumb] - 1e-9))
    assert np.degrees(path[0, finger] - path[back, finger]) > 15.0


def test_a_joint_that_is_near_its_shape_does_not_go_back_to_the_preshape() -> None:
    """Fails when a hand that is closed further than the preshape opens first."""
    start = GRASPS["pinch"].shape(1.0)
    assert float(np.abs(targets("pinch", start, 1.0) - start).max()) < 1e-9


def test_the_width_of_an_object_between_thumb_and_finger() -> None:
    """Fails when the width is not that of the pads; the geometry of the test is that of the file, in other formulas."""
    position, contact = GRASPS["pinch"].shape(1.0), np.zeros(len(HAND.joints), dtype=np.bool_)
    contact[[index("thumb_distal"), index("index_distal")]] = True
    tips = link_poses(HAND, position)
    apart = float(np.linalg.norm(tips["thumb_tip"][:3, 3] - tips["index_tip"][:3, 3]))
    width = object_width_m(HAND, position, contact)
    # A pad lies half a link from its tip and half a thickness from the axis: 21 mm and 8 mm of the finger, 17 and 8.
    assert abs(width - apart) < np.hypot(0.021, 0.0075) + np.hypot(0.017, 0.008)
    closer = position.copy()
    closer[index("index_proximal")] += 0.05
    assert object_width_m(HAND, closer, contact) < width - 1e-4
    contact[index("thumb_distal")] = False
    assert np.isnan(object_width_m(HAND, position, contact))
    contact[index("index_proximal")] = True  # two pads of one finger are not opposed
    assert np.isnan(object_width_m(HAND, position, contact))
