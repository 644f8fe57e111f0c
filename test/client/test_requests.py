"""Words of a user for a running hand: what is accepted, and one line for what is not."""

from __future__ import annotations

import math

import pytest

from hand_client.requests import parse_moves
from hand_model.description import Hand, load_hand

HAND = "config/hand.yaml"


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand(HAND)


def test_angles_are_in_rad_or_in_degrees(hand: Hand) -> None:
    """Fails when a unit is mixed up, or the names of a hand with a prefix need it."""
    assert parse_moves(["index_proximal=0.8", "thumb_distal=45deg"], hand) == {
        "index_proximal": 0.8,
        "thumb_distal": pytest.approx(math.pi / 4),
    }
    assert parse_moves(["index_distal=0.1"], load_hand(HAND, "left_")) == {"left_index_distal": 0.1}


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["index_proximal"], ["'index_proximal' is not of the form JOINT=ANGLE"]),
        (["idex_proximal=0.8"], ["'idex_proximal' is unknown", "did you mean index_proximal?"]),
        (["nose=0.8"], ["'nose' is unknown; the joints are thumb_opposition"]),
        (["index_proximal=0.1", "index_proximal=0.2"], ["index_proximal is given twice"]),
        (["index_proximal=fast"], ["index_proximal is 'fast'", "a number in rad"]),
        (["index_proximal=nan"], ["index_proximal is 'nan'", "a number in rad"]),
        (["index_proximal=inf"], ["index_proximal is 'inf'", "a number in rad"]),
    ],
)
def test_wrong_words_are_refused_by_name(hand: Hand, words: list[str], parts: list[str]) -> None:
    """Fails when a wrong request is sent, or its line does not name what is wrong."""
    with pytest.raises(ValueError, match=r"index|nose") as refused:
        parse_moves(words, hand)
    assert all(part in str(refused.value) for part in parts) and "\n" not in str(refused.value)


def test_every_joint_is_refused_outside_its_own_limits(hand: Hand) -> None:
    """Fails when the limits of another joint are used, the limit itself is refused, or the range is not stated."""
    for name, low, high in zip(hand.joints, hand.limits.low_rad, hand.limits.high_rad, strict=True):
        assert parse_moves([f"{name}={float(high)!r}"], hand) == {name: float(high)}
        for angle in (float(low) - 1e-6, float(high) + 1e-6):
            with pytest.raises(ValueError, match=f"{name} is .*the allowed range is {low:.3f} to {high:.3f} rad"):
                parse_moves([f"{name}={angle!r}"], hand)
