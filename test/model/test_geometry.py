"""The shape of the hand: forward kinematics, the mirror image, masses, and the refusal of bad values."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hand_model.arrays import Array
from hand_model.description import DescriptionError, Hand, load_hand
from hand_model.geometry import MIDDLE_RAD, bending_inertia, geometry_of, link_poses, mass_matrix

SEED = 20261123
FINGERS = ("index", "middle", "ring", "little")


def angles(hand: Hand, rng: np.random.Generator, *shape: int) -> Array:
    """Random angles (*shape, joints) [rad] within the limits."""
    result: Array = rng.uniform(hand.limits.low_rad, hand.limits.high_rad, (*shape, len(hand.joints)))
    return result


@pytest.mark.parametrize("finger", FINGERS)
def test_a_finger_is_a_planar_chain(hand: Hand, finger: str) -> None:
    """Broken by a wrong axis, sign, order of links or length: the closed form of two links in the plane of x and z."""
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    angle = angles(hand, rng)
    links = {link.name: link for link in geometry_of(hand).links}
    first, second = links[f"{finger}_proximal_link"], links[f"{finger}_distal_link"]
    a = angle[hand.joints.index(f"{finger}_proximal")]
    b = a + angle[hand.joints.index(f"{finger}_distal")]
    along = np.array([np.cos([a, b]), [0.0, 0.0], -np.sin([a, b])]).T
    expected = first.origin[:3, 3] + first.size_m[0] * along[0] + second.size_m[0] * along[1]
    poses = link_poses(hand, angle)
    np.testing.assert_allclose(poses[f"{finger}_tip"][:3, 3], expected, atol=1e-12)
    pad = hand.sensors.sites.index(f"{finger}_distal_pad")
    distance = poses[f"{finger}_distal_pad"][:3, 3] - poses[f"{finger}_distal_link"][:3, 3]
    assert distance @ along[1] == pytest.approx(hand.sensors.lever_arm_m[pad])
    normal = poses[f"{finger}_distal_pad"][:3, 2]
    np.testing.assert_allclose(normal, [-np.sin(b), 0.0, -np.cos(b)], atol=1e-12)


def test_the_thumb_turns_as_scipy_composes_it(hand: Hand) -> None:
    """Broken by a wrong order of roll, pitch and yaw, or by a joint that turns about another axis than its own."""
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    angle = angles(hand, rng)
    base = Rotation.from_euler("xyz", [-90.0, 0.0, 54.0], degrees=True)
    along_hand = Rotation.from_rotvec([-angle[0], 0.0, 0.0])
    flexed = [Rotation.from_rotvec([0.0, turn, 0.0]) for turn in (angle[1], angle[1] + angle[2])]
    place = np.array([0.010, 0.038, -0.024]) + (along_hand * base).apply([0.046, 0.0, 0.0])
    for length, turn in zip((0.032, 0.034), flexed, strict=True):
        place = place + (along_hand * base * turn).apply([length, 0.0, 0.0])
    # The axis in the file has four digits, so that it differs from the long axis of the hand by 2e-5 rad.
    np.testing.assert_allclose(link_poses(hand, angle)["thumb_tip"][:3, 3], place, atol=1e-5)


def test_many_poses_at_once_are_those_one_by_one(hand: Hand) -> None:
    """Broken by a mix-up of the leading dimensions."""
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    angle = angles(hand, rng, 3, 2)
    together = link_poses(hand, angle)
    for i, j in itertools.product(range(3), range(2)):
        for name, single in link_poses(hand, angle[i, j]).items():
            np.testing.assert_allclose(together[name][i, j], single, atol=1e-15)


def test_every_pose_is_a_rotation_and_flexing_curls_to_the_palm(hand: Hand) -> None:
    """Broken by a matrix that is not orthonormal, or by a finger whose positive angle bends it to the back."""
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    for matrix in link_poses(hand, angles(hand, rng)).values():
        np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1.0)
    open_hand, bent = (link_poses(hand, np.full(11, angle)) for angle in (0.0, 1.0))
    for finger in FINGERS:
        assert bent[f"{finger}_tip"][2, 3] < open_hand[f"{finger}_tip"][2, 3] - 0.03
    opposed = link_poses(hand, np.eye(11)[0] * np.pi / 2)
    assert opposed["thumb_tip"][2, 3] < open_hand["thumb_tip"][2, 3] - 0.05


@pytest.mark.parametrize("how", ["by its prefix", "by the key"])
def test_a_left_hand_is_the_mirror_image(hand: Hand, variant: Any, how: str) -> None:
    """Broken by a reflected position, rotation or axis of the wrong sign; all frames carry the prefix."""
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    angle = angles(hand, rng)
    prefix = "left_" if how == "by its prefix" else ""
    change = (("geometry:\n", "geometry:\n  side: left\n"),) if not prefix else ()
    left, right = link_poses(load_hand(variant(*change), prefix), angle), link_poses(hand, angle)
    assert list(left) == [prefix + name for name in right]
    mirror = np.diag([1.0, -1.0, 1.0])
    for name, matrix in right.items():
        np.testing.assert_allclose(left[prefix + name][:3, 3], mirror @ matrix[:3, 3], atol=1e-12)
        np.testing.assert_allclose(left[prefix + name][:3, :3], mirror @ matrix[:3, :3] @ mirror, atol=1e-12)


def test_masses_have_the_inertias_of_the_model(hand: Hand) -> None:
    """Broken by masses or lengths that disagree with the inertia about the proximal joint and the coupling inertia."""
    matrix = mass_matrix(hand, np.full(len(hand.joints), MIDDLE_RAD))
    inertia, coupling = hand.row("dynamics.inertia_kg_m2"), hand.row("dynamics.coupling_inertia_kg_m2")
    for proximal, distal in [(i, int(hand.partner[i])) for i in range(len(hand.joints)) if hand.partner[i] > i]:
        assert matrix[proximal, proximal] == pytest.approx(inertia[proximal], rel=0.01)
        assert matrix[proximal, distal] == pytest.approx(coupling[proximal], rel=0.01)
    # What the links lack is the moving part of the actuator, which is not negative and smaller than the rest.
    left_over = inertia - matrix.diagonal()
    assert np.all(left_over > -0.01 * inertia) and np.all(left_over < 0.5 * inertia)


def test_the_mass_matrix_is_that_of_a_double_pendulum(hand: Hand) -> None:
    """Broken by a wrong Jacobian: the closed form of two bodies in a plane."""
    angle = np.zeros(len(hand.joints))
    p, d = hand.joints.index("index_proximal"), hand.joints.index("index_distal")
    angle[[p, d]] = 0.4, 0.9
    links = {link.joint: link for link in geometry_of(hand).links}
    m1, m2, i1, i2 = links[p].mass_kg, links[d].mass_kg, links[p].inertia_kg_m2[1], links[d].inertia_kg_m2[1]
    length, c1, c2 = links[p].size_m[0], links[p].center_m[0], links[d].center_m[0]
    own = i2 + m2 * c2**2
    shared = own + m2 * length * c2 * np.cos(0.9)
    whole = i1 + m1 * c1**2 + own + m2 * (length**2 + 2 * length * c2 * np.cos(0.9))
    found = mass_matrix(hand, angle)[np.ix_([p, d], [p, d])]
    np.testing.assert_allclose(found, [[whole, shared], [shared, own]], rtol=1e-12)


def test_the_inertia_that_changes_is_mass_times_both_lengths(hand: Hand) -> None:
    """Broken by another form than m l c cos(x), by indices in the wrong order, or by axes that are not parallel."""
    links = {link.joint: link for link in geometry_of(hand).links}
    p, d = hand.joints.index("index_proximal"), hand.joints.index("index_distal")
    expected = links[d].mass_kg * links[p].size_m[0] * links[d].center_m[0]
    assert bending_inertia(hand, p, d) == pytest.approx(expected, rel=1e-9)
    assert bending_inertia(hand, d, p) == 0.0
    assert bending_inertia(hand, hand.joints.index("thumb_opposition"), hand.joints.index("thumb_distal")) == 0.0


BAD = {
    "unknown joint": (("- joint: ring_distal", "- joint: rng_distal"), "joint is 'rng_distal'", "must be one of"),
    "two links of a joint": (("- joint: ring_distal", "- joint: ring_proximal"), "moves another link already"),
    "child first": (("parent: thumb_proximal", "parent: index_distal"), "parent is 'index_distal'", "must be one of"),
    "no mass": (("mass_kg: 0.0505", "mass_kg: 0"), "mass_kg is 0", "0.0001 to 5"),
    "millimetres": (("length_m: 0.034", "length_m: 34"), "length_m is 34", "0.001 to 0.5"),
    "no axis": (("axis: [-0.5878, 0, 0.8090]", "axis: [0, 0, 0]"), "has the length 0", "from 0.001 to 1000"),
    "far origin": (("[0.010, 0.038, -0.024]", "[20, 26, -20]"), "origin_m is [20.0, 26.0, -20.0]", "from -1 to 1"),
    "same frame": (("tip_frame: ring_tip", "tip_frame: index_tip"), "has the frame index_tip twice"),
    "unknown side": (("geometry:\n", "geometry:\n  side: both\n"), "geometry.side is 'both'", "right, left"),
    "misspelt": (("width_m: 0.022", "widht_m: 0.022"), "widht_m is not a known key", "did you mean width_m?"),
}


@pytest.mark.parametrize("case", BAD.values(), ids=BAD)
def test_bad_geometry_is_one_clear_line(case: tuple[Any, ...], variant: Any) -> None:
    """Broken by an error that spans lines or does not name file, key, value or range."""
    change, *parts = case
    path = variant(change)
    with pytest.raises(DescriptionError) as caught:
        load_hand(path)
    message = str(caught.value)
    assert "\n" not in message and message.startswith(f"{path}: ")
    for part in parts:
        assert part in message


def test_a_joint_without_a_link_is_named(variant: Any) -> None:
    """Broken by a hand of which a joint moves no link."""
    text = variant().read_text(encoding="utf-8")
    start = text.index("    - joint: little_distal")
    path = variant((text[start:], ""))
    with pytest.raises(DescriptionError, match="has no link for little_distal; every joint must have one"):
        load_hand(path)


def test_a_description_without_geometry_is_a_hand_without_poses(tmp_path: Path, hand: Hand) -> None:
    """Broken by a description of version 0.2.0 that is refused, or by poses that are made up for it."""
    text = hand.path.read_text(encoding="utf-8")
    path = tmp_path / "hand.yaml"
    path.write_text(text[: text.index("geometry:")], encoding="utf-8")
    plain = load_hand(path)
    assert plain.geometry is None
    with pytest.raises(ValueError, match="geometry is missing"):
        link_poses(plain, np.zeros(11))


def test_angles_of_another_hand_are_refused(hand: Hand) -> None:
    """Broken by angles of ten joints that are taken for those of eleven."""
    with pytest.raises(ValueError, match="its last dimension must be 11"):
        link_poses(hand, np.zeros(10))
