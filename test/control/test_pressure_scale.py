"""A pressure sensor at another scale from the start, in the first rise after arming, and healthy sensors next to it."""

from __future__ import annotations

import secrets
from pathlib import Path

import numpy as np
import pytest

from hand_control.frame_checks import FOLLOWING, STEEP_RISE, STUCK_LOW, PressureWatch
from hand_model.arrays import Array
from hand_model.description import load_hand

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
COUNT, DT_S, JOINT = len(HAND.joints), 0.005, 3
LAG_S = float((HAND.row("valve.time_constant_s") + HAND.row("valve.dead_time_s"))[JOINT])
CAREFUL_PA_PER_S, REST_PA, NOISE_PA = 1.5e5, 4e3, 3e2


def verdicts(
    scale: float = 1.0,
    offset_pa: float = 0.0,
    lag: float = 1.0,
    noise: float = 1.0,
    most_pa: float = 6e4,
    rate_pa_per_s: float = CAREFUL_PA_PER_S,
    rest_s: float = 1.0,
) -> tuple[list[int], Array]:
    """Verdicts of a rest and a rise to most_pa [Pa], where it stays, and the true pressures [Pa].

    scale, offset_pa: of the sensor of one joint.  lag: of its valve, over that of the description.  noise: over the
    usual one.
    """
    seed = secrets.randbits(32)
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    frames = round((rest_s + 2.0) / DT_S)
    asked = REST_PA + np.clip(rate_pa_per_s * (np.arange(frames) * DT_S - rest_s), 0.0, most_pa - REST_PA)
    watch, true, found = PressureWatch(HAND), np.empty(frames), []
    pressure_pa = REST_PA
    for frame, command_pa in enumerate(asked):
        pressure_pa += -np.expm1(-DT_S / (lag * LAG_S)) * (command_pa - pressure_pa)
        true[frame] = pressure_pa
        measured = np.full(COUNT, pressure_pa) + noise * NOISE_PA * rng.standard_normal(COUNT)
        measured[JOINT] = scale * measured[JOINT] + offset_pa
        if frame == 0:
            watch.start(measured)
        verdict, joint = watch.check(np.full(COUNT, command_pa), measured, DT_S)
        assert verdict == FOLLOWING or joint == JOINT
        found.append(verdict)
    return found, true


@pytest.mark.parametrize("rate_pa_per_s", [6e4, CAREFUL_PA_PER_S, 5e5])
def test_a_doubled_pressure_is_found_before_it_has_risen_by_a_fifth_of_a_bar(rate_pa_per_s: float) -> None:
    """Fails when a doubled reading is found later in the first rise, or by another line."""
    found, true = verdicts(2.0, rate_pa_per_s=rate_pa_per_s)
    at = next(k for k, verdict in enumerate(found) if verdict != FOLLOWING)
    assert found[at] == STEEP_RISE
    assert true[at] < REST_PA + (2e4 if rate_pa_per_s <= CAREFUL_PA_PER_S else 4e4)


def test_a_halved_pressure_is_reported_at_rest() -> None:
    """Fails when half of a small pressure counts as the noise of a valve, or the report ends while it lasts."""
    found, _ = verdicts(0.5, most_pa=3e4)
    assert set(found) == {FOLLOWING, STUCK_LOW} and found[-1] == STUCK_LOW


@pytest.mark.parametrize(
    "healthy",
    [
        {},
        {"lag": 2.0},
        {"lag": 0.5, "rate_pa_per_s": 1e6},
        {"noise": 5.0},
        {"noise": 5.0, "lag": 2.0, "rate_pa_per_s": 2e6, "most_pa": 4e5},
        {"offset_pa": 8e3},
        {"offset_pa": 8e3, "rest_s": 0.0},
        {"offset_pa": -5e3},
        {"scale": 1.2},
        {"scale": 0.85},
    ],
    ids=str,
)
def test_no_scale_is_suspected_where_the_sensor_is_right(healthy: dict[str, float]) -> None:
    """Fails when a slow or quick valve, noise, an offset or a small error of the scale counts as another scale."""
    assert set(verdicts(**healthy)[0]) == {FOLLOWING}
