"""A finger whose inertia changes with its bend is no unknown physics, and a constant inertia is recognised as such.

The plant is that of links.py, which is independent of the kernel.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hand_diagnosis.diagnosis import diagnose
from hand_identification.two_links import Motion, bending, linked
from hand_model.description import Hand, load_hand
from hand_model.geometry import mass_matrix
from hand_model.kernel.rows import ROW
from test.diagnosis.links import FINGER, PERIOD_S, changing_inertia, finger, recorded, run, waves
from test.diagnosis.recordings import CONFIG

SEED = 2


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand(CONFIG)


def test_the_added_acceleration_has_the_torques_of_lagrange(hand: Hand) -> None:
    """Fails when a term has the wrong sign, size or joint: d/dt (dT/dw) - dT/dx of the links, by finite differences.

    T is the kinetic energy by `mass_matrix`, from which that of the middle angle is subtracted.
    """
    time = np.arange(2000) * 1e-3
    pair = [hand.joints.index(name) for name in FINGER]
    x = np.stack([0.6 + 0.5 * np.sin(7.0 * time), 0.8 + 0.6 * np.sin(11.0 * time + 1.0)], axis=1)
    w = np.gradient(x, time, axis=0)

    def matrix(angles: np.ndarray) -> np.ndarray:
        every = np.full(len(hand.joints), np.radians(45.0))
        middle = mass_matrix(hand, every)[np.ix_(pair, pair)]
        every[pair] = angles
        return np.asarray(mass_matrix(hand, every)[np.ix_(pair, pair)] - middle)

    chosen = np.arange(2, 1998, 37)
    motion = [Motion(x[:, k], w[:, k], np.gradient(w[:, k], time)) for k in range(2)]
    for k in range(2):
        share, proximal = linked(hand, pair[k])
        assert proximal == (k == 0)
        added = bending(share, motion[k], motion[1 - k], proximal=proximal)
        torque = -hand.row("dynamics.coupling_inertia_kg_m2")[pair[k]] * added
        lever, ends = 1e-4 * np.eye(2)[k], []
        for n in chosen:
            momentum = [matrix(x[m]) @ w[m] for m in (n - 1, n + 1)]
            energies = [0.5 * w[n] @ matrix(x[n] + sign * lever) @ w[n] for sign in (-1, 1)]
            ends.append((momentum[1] - momentum[0])[k] / 2e-3 - (energies[1] - energies[0]) / 2e-4)
        np.testing.assert_allclose(torque[chosen], -np.array(ends), atol=2e-3 * np.abs(ends).max())


def test_joints_without_links_in_one_plane_have_none(hand: Hand) -> None:
    """Fails when a joint without partner or a hand without `geometry` gets an inertia that changes."""
    assert linked(hand, hand.joints.index("thumb_opposition"))[0] == 0.0
    assert linked(replace(hand, geometry=None), hand.joints.index(FINGER[0]))[0] == 0.0


@pytest.mark.parametrize("share", [1.0, 0.0], ids=["changing", "constant"])
def test_the_inertia_of_a_finger_is_no_unknown_physics(hand: Hand, share: float) -> None:
    """Fails when two rigid links leave a remainder of other physics, or a constant inertia counts as theirs.

    Without the torques of the bend, both joints leave a remainder with a probability of 0.99.
    """
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    numbers, u = finger(hand, rng, 0.03), waves(rng, 20.0)
    h = share * changing_inertia(hand)
    p, x = run(numbers, u, h)
    if h:
        plain = run(numbers, u, 0.0)[1]
        assert np.degrees(np.sqrt(np.mean((x - plain) ** 2, axis=0))).min() > 0.1  # visible above the practical floor
    found = diagnose([recorded(u, p, x, rng)], hand, tolerance=0.05, seed=0, sensor_curve=False)
    assert found.verdict == "agrees" and not found.remainder
    assert any("changes with the angle of the distal joint" in line for line in found.check) == bool(h)
    if h:
        assert all(name in " ".join(found.check) for name in FINGER)


def test_the_plant_of_these_tests_has_the_inertias_of_the_model(hand: Hand) -> None:
    """Fails when the plant runs with other numbers than the description: at rest under a constant pressure, Eq. 6."""
    numbers = finger(hand, np.random.default_rng(SEED), 0.0)
    assert numbers["dynamics.inertia_kg_m2"][0] == hand.parameters[ROW["dynamics.inertia_kg_m2"], 3]
    u = np.full((round(4.0 / PERIOD_S), 2), 5e4)
    numbers["material.b1_per_pa"], numbers["material.b0_per_pa"] = np.zeros(2), np.ones(2)
    _, x = run(numbers, u, changing_inertia(hand))
    a0, a1, a2, a3 = (numbers[f"statics.{k}"] for k in ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad"))
    np.testing.assert_allclose(x[-1], -(a0 + a2 * 5e4) / (a1 + a3 * 5e4), rtol=1e-3)
