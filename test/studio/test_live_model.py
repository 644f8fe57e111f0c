"""The model next to a running hand, on frames of a simulated hand with noise, and on the messages that carry them."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from hand_client.samples import Sample, Samples
from hand_driver.board import Frame, Status
from hand_driver.measurement import Converter
from hand_model.description import Hand, load_hand
from hand_model.effects import EFFECTS
from hand_model.kernel.rows import ROW
from hand_sim.plant import SimulatedPlant
from hand_studio.choices import (
    CHOICES,
    CURVES,
    FRAMES,
    KINDS,
    MACHINES,
    PARAMETERS,
    reason_of,
    slider_label,
    slider_range,
)
from hand_studio.live_model import SHOWN_S, LiveModel
from hand_studio.tint import FULL, LARGE, NOISE, PLAIN, tint

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
RUBBING = HAND.joints.index("index_proximal")
SITED = HAND.sensors.site_joint >= 0
SEED, SECONDS = 5, 4.0
PERIOD_NS = 5_000_000


def changed(key: str, value: float) -> Hand:
    """The hand with another value, SI, of a parameter of one joint; an obstacle begins at 30 degrees."""
    parameters = HAND.parameters.copy()
    parameters[ROW["contact.angle_deg"], RUBBING] = np.radians(30.0)
    parameters[ROW[key], RUBBING] = value
    return replace(HAND, parameters=parameters)


@cache
def frames(key: str = "", value: float = 0.0, seconds: float = SECONDS) -> tuple[Sample, ...]:
    """What a driver measures of a hand that moves all joints; key and value: of its concealed parameter."""
    print(f"seed {SEED}")
    truth = changed(key, value) if key else HAND
    plant, converter = SimulatedPlant(truth, HAND.rate_hz, SEED), Converter(HAND, 0.01)
    made: list[Sample] = []
    joints = np.arange(len(HAND.joints))
    for k in range(round(seconds * HAND.rate_hz)):
        rise = min(max(k / 100.0 - 1.0, 0.0), 1.0)
        set_point = rise * (1.2e5 + 1.0e5 * np.sin((2.0 + 0.3 * joints) * k / HAND.rate_hz))
        before = made[-1].set_point_pa if made else np.zeros(len(joints))
        counts, supply_v, status = plant.step(before)
        measured = converter.convert(Frame(k, 5000 * k, supply_v, Status(0) | status, counts, 0))
        force = np.full(len(joints), np.nan)
        force[HAND.sensors.site_joint[SITED]] = measured.force[SITED]
        made.append(Sample(k * PERIOD_NS, measured.position, measured.pressure, set_point, force))
    return tuple(made)


def largest_mismatch(samples: tuple[Sample, ...]) -> np.ndarray:
    """The largest mismatch of each joint (joints,) after the first second."""
    model, largest = LiveModel(HAND), np.zeros(len(HAND.joints))
    for start in range(0, len(samples), 10):
        model.add(samples[start : start + 10])
        if start > 200:
            largest = np.maximum(largest, np.abs(model.mismatch))
    return largest


def test_a_hand_like_its_model_has_no_tint_and_the_ghost_is_in_it() -> None:
    """Fails when noise alone tints a joint, or the ghost of a correct model is elsewhere than the hand."""
    assert largest_mismatch(frames()).max() < NOISE
    model = LiveModel(HAND)
    model.add(frames())
    (measured, ghost), *_ = model.curves(RUBBING)[1]
    assert len(measured) == len(frames())
    assert np.sqrt(np.mean((measured - ghost) ** 2)) < np.radians(0.2)


@pytest.mark.parametrize(
    ("key", "value"), [("coulomb_friction.torque_nm", 0.012), ("constant_load.torque_nm", 0.02)], ids=["rubs", "loaded"]
)
def test_a_joint_with_an_effect_that_the_model_lacks_is_tinted(key: str, value: float) -> None:
    """Fails when an effect is not seen while it happens, or joints of other fingers are tinted with it."""
    mismatch = largest_mismatch(frames(key, value))
    others = [j for j in range(len(HAND.joints)) if j not in (RUBBING, HAND.partner[RUBBING])]
    assert mismatch.argmax() == RUBBING and mismatch[RUBBING] > 20.0 * NOISE
    assert mismatch[others].max() < NOISE


def test_what_if_moves_the_ghost_fast_enough_to_follow_a_slider() -> None:
    """Fails when the concealed effect, put into the model, does not bring it to the hand, or that takes over 0.1 s of
    CPU for the whole plot.
    """
    rubbing = frames("coulomb_friction.torque_nm", 0.012, SHOWN_S + 0.5)
    model = LiveModel(HAND)
    model.add(rubbing)
    assert len(model.curves(RUBBING)[0]) == SHOWN_S * HAND.rate_hz

    def off() -> float:
        (measured, ghost), *_ = model.curves(RUBBING)[1]
        return float(np.sqrt(np.mean((measured - ghost) ** 2)))

    before, taken = off(), []
    for _ in range(5):
        begun = time.process_time()
        model.change(changed("coulomb_friction.torque_nm", 0.012).parameters)
        model.curves(RUBBING)
        taken.append(time.process_time() - begun)
    assert off() < np.radians(0.2) < 0.3 * before
    assert min(taken) < 0.1
    model.change(HAND.parameters)
    assert off() == pytest.approx(before, rel=0.2)


def off(model: LiveModel, joint: int, kind: int) -> float:
    """RMS difference of a measured signal of a joint from the ghost's, SI; kind: its place among the curves."""
    measured, ghost = model.curves(joint)[1][kind]
    return float(np.sqrt(np.nanmean((measured - ghost) ** 2)))


def test_the_pressure_is_shown_and_a_clock_that_differs_shifts_it() -> None:
    """Fails when another joint's pressure is shown, or what-if of a timing effect does not move the curve of its model.

    A sine of 1e5 Pa that is stamped 0.05 s late is off by 1e5 Pa * speed * 0.05 s / sqrt(2), RMS.
    """
    model = LiveModel(HAND)
    model.add(frames())
    assert off(model, RUBBING, 1) < 2e3
    model.change(changed("clock_offset.offset_s", 0.05).parameters)
    assert off(model, RUBBING, 1) == pytest.approx(1e5 * (2.0 + 0.3 * RUBBING) * 0.05 / np.sqrt(2.0), rel=0.15)
    assert off(model, RUBBING, 0) < np.radians(0.2)
    parameters = changed("clock_offset.offset_s", 0.05).parameters
    parameters[ROW["clock_offset.share"], RUBBING] = 0.0
    model.change(parameters)
    assert off(model, RUBBING, 0) > np.radians(0.3)


def test_what_if_of_a_force_sensor_changes_the_force_of_the_model() -> None:
    """Fails when forces go to another joint, the model expects another force, or what-if leaves its reading alone."""
    touching = frames("contact.stiffness_nm_per_rad", 0.4)
    model = LiveModel(HAND)
    model.add(touching)
    (_, _, (measured, before)) = model.curves(RUBBING)[1]
    pressed = np.nan_to_num(measured) > 0.3
    print("N", np.nanmax(measured), "RMS N", np.sqrt(np.mean((measured - before)[pressed] ** 2)))
    assert pressed.sum() > 100
    assert np.sqrt(np.mean((measured - before)[pressed] ** 2)) < 0.15 * np.nanmax(measured)
    model.change(changed("fsr_gain.error", 0.5).parameters)
    (_, _, (_, after)) = model.curves(RUBBING)[1]
    assert after == pytest.approx(1.5 * before, rel=1e-6)
    unsited = next(joint for joint in range(len(HAND.joints)) if joint not in HAND.sensors.site_joint)
    assert len(model.curves(unsited)[1]) == 2


def test_lost_frames_do_not_move_the_model_away() -> None:
    """Fails when the model counts frames and not time, or goes on after a long gap as if nothing had happened."""
    model = LiveModel(HAND)
    kept = [sample for k, sample in enumerate(frames()) if k % 50 not in (7, 8, 30)]
    model.add(kept)
    (measured, ghost), *_ = model.curves(RUBBING)[1]
    assert np.sqrt(np.nanmean((measured - ghost) ** 2)) < np.radians(0.5)
    model.add([replace(frames()[0], stamp_ns=kept[-1].stamp_ns + 2_000_000_000)])
    assert model.ghost_rad is None


def test_set_points_act_from_the_frame_after_theirs_until_their_lifetime() -> None:
    """Fails when the order of the messages of a frame matters, or a set-point outlives its lifetime."""
    samples = Samples(("a", "b"))
    for k in range(40):
        stamp = k * PERIOD_NS
        if k == 2:
            samples.command(stamp, 100_000_000, ("b", "a"), (2.0, 1.0))
        samples.angles(stamp, ("a", "b"), (0.1 * k, 0.0))
        if k != 5:
            samples.pressures(stamp, ("a", "b"), (10.0 * k, 0.0))
    taken = samples.take(35 * PERIOD_NS)
    assert [round(s.stamp_ns / PERIOD_NS) for s in taken] == [k for k in range(36) if k != 5]
    commanded = [round(s.stamp_ns / PERIOD_NS) for s in taken if s.set_point_pa.tolist() == [1.0, 2.0]]
    assert commanded == [k for k in range(3, 23) if k != 5]
    assert [round(s.stamp_ns / PERIOD_NS) for s in samples.take(99 * PERIOD_NS)] == [36, 37, 38, 39]


def test_sliders_stay_in_the_allowed_range_and_hold_what_was_found() -> None:
    """Fails when a slider offers a value that the description of a hand would refuse, or has no room."""
    assert {"coulomb_friction", "leak", "backlash", "gravity", "creep"} <= set(CHOICES)
    for key, parameter in PARAMETERS.items():
        base = float(HAND.parameters[ROW[key], 0]) / parameter.scale
        low, high = slider_range(key, base)
        assert parameter.low <= low < high <= parameter.high, key
        assert low - 1e-9 * abs(low) <= base <= high + 1e-9 * abs(high), key
    assert tint(0.9 * NOISE) == PLAIN and tint(-2.0 * LARGE) == FULL


def test_every_effect_is_offered_or_left_out_for_its_reason() -> None:
    """Fails when an effect that a hand can have and that has a size is missing, or a reason is wrong."""
    left = {name: reason_of(effect) for name, effect in EFFECTS.items() if name not in CHOICES}
    assert left == {
        **dict.fromkeys(
            (
                *("cogging", "command_delay", "directional_friction", "drive_elasticity", "drive_gain", "drive_lag"),
                *("drive_saturation", "gear_friction", "spring"),
            ),
            MACHINES,
        ),
        **dict.fromkeys(("hydraulic", "switching_valve"), KINDS),
        **dict.fromkeys(("unnamed_pressure", "unnamed_torque"), CURVES),
        "dropped_frames": FRAMES,
    }


def test_a_slider_has_words_and_a_unit() -> None:
    """Fails when a label shows the key of a file, or two sliders of an effect have the same label."""
    assert slider_label("coulomb_friction", "coulomb_friction.torque_nm") == "torque [N m]"
    assert slider_label("valve_lag", "valve.time_constant_s") == "valve time constant [s]"
    assert slider_label("stiffening", "stiffening.mixed_nm_per_pa_rad2") == "mixed [N m/(Pa rad²)]"
    assert slider_label("fsr_gain", "fsr_gain.error") == "error"
    for name in CHOICES:
        labels = [slider_label(name, key) for key in EFFECTS[name].keys]
        assert len(set(labels)) == len(labels) and not any("_" in label for label in labels), labels
