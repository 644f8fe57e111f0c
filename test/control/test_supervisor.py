"""The safety state machine: every age tier, latch and message, with the declared numbers written out."""

from __future__ import annotations

import pytest

from hand_control.supervisor import Phase, Supervisor
from hand_messages.health import Level

MS = 1_000_000
SILENCE = "no usable sensor data for 100 ms; check the driver and the line to the board"


def armed(now_ns: int = 0) -> Supervisor:
    made = Supervisor()
    made.enable()
    made.arm(now_ns)
    made.frame(now_ns)
    return made


def test_a_new_supervisor_is_vented_and_says_why() -> None:
    """Fails when a hand is driven before it was enabled."""
    made = Supervisor()
    assert (made.phase, made.reason, made.fault) == (Phase.VENTED, "not enabled", "")
    status = made.health(0)
    assert (status.name, status.level, status.message) == ("safety", Level.OK, "vented: not enabled")


@pytest.mark.parametrize(
    ("age_ms", "level"), [(0, Level.OK), (20, Level.OK), (21, Level.WARN), (51, Level.WARN), (100, Level.WARN)]
)
def test_ages_below_the_last_tier_keep_control(age_ms: int, level: Level) -> None:
    """Fails when late data vents too early, or is not warned of from 20 ms on."""
    made = armed()
    made.check(age_ms * MS, 0.0)
    assert made.phase is Phase.ACTIVE and made.fault == ""
    status = made.health(age_ms * MS)
    assert status.level is level and status.name == "safety"
    assert status.message == ("controlling" if level is Level.OK else "sensor data is late")


def test_silence_of_more_than_100_ms_vents_and_latches() -> None:
    """Fails when 100 ms of silence leave the hand under pressure, or the fault does not stay until the reset."""
    made = armed()
    made.check(100 * MS + 1000, 0.0)
    assert made.phase is Phase.VENTED
    assert made.fault == made.reason == SILENCE
    made.frame(200 * MS)
    made.check(201 * MS, 0.0)
    assert made.phase is Phase.VENTED
    status = made.health(201 * MS)
    assert status.level is Level.ERROR
    assert status.message == f"vented: {SILENCE}; call reset, then enable"
    with pytest.raises(ValueError, match=r"not enabled: a fault is latched \(no usable sensor data.*call reset first"):
        made.enable()
    assert made.reset() == SILENCE
    assert (made.phase, made.fault, made.reason) == (Phase.VENTED, "", "not enabled since the reset")
    made.enable()
    assert made.phase.name == "ARMING"


@pytest.mark.parametrize(("after_s", "named"), [(0.0, True), (0.9, True), (1.1, False)])
def test_a_second_publisher_is_named_in_the_latch_of_a_silence(after_s: float, named: bool) -> None:
    """Fails when a flood that hides the measurements leaves a line about the board, or a later visitor is accused."""
    safety, cause = Supervisor(), "second publisher: joint_states from /hand/rogue; stop it"
    safety.enable()
    safety.arm(0)
    safety.frame(0)
    safety.explain_silence(0, cause)
    assert not safety.fault
    safety.check(round(0.2e9), 0.0)
    assert safety.fault == SILENCE
    safety.explain_silence(round((0.2 + after_s) * 1e9), cause)
    assert safety.fault == (f"no usable sensor data for 100 ms; {cause}" if named else SILENCE)


def test_another_fault_keeps_its_line_next_to_a_second_publisher() -> None:
    """Fails when a second publisher takes the place of a fault that has nothing to do with it."""
    safety = Supervisor()
    safety.enable()
    safety.arm(0)
    safety.trip("emergency stop")
    safety.explain_silence(0, "second publisher: joint_states from /hand/rogue; stop it")
    assert safety.fault == "emergency stop"


def test_a_reset_without_a_fault_changes_nothing() -> None:
    """Fails when a reset replaces the reason of a vent that was no fault."""
    made = armed()
    made.vent("vent was called")
    assert made.reset() == "" and made.reason == "vent was called"


def test_arming_waits_and_warns() -> None:
    """Fails when an enabled hand without a measurement counts as driven, or trips before it is."""
    made = Supervisor()
    made.enable()
    made.check(10**12, 0.0)
    made.check(10**12 + 2000 * MS, 0.0)
    status = made.health(10**12)
    assert (made.phase, status.level, made.fault) == (Phase.ARMING, Level.WARN, "")
    assert status.message == "waiting for a first complete measurement"


def test_a_hand_that_cannot_be_measured_is_enabled_for_two_seconds() -> None:
    """Fails when a hand begins to move minutes after `enable`, the reason is not given, or a fault is latched."""
    made = Supervisor()
    made.enable()
    made.check(0, 0.0)
    made.enable()  # again: it does not wait for longer
    made.check(2000 * MS + 1, 0.0)
    assert (made.phase, made.fault) == (Phase.VENTED, "")
    line = "no complete measurement within 2 s; no frame arrives; check the driver and the line to the board"
    assert made.health(2001 * MS).message == f"vented: {line}; then call enable"
    made.enable()
    made.check(9000 * MS, 0.0)
    made.lacks = "index_proximal: its angle (channel 3) is not a number"
    made.check(11_001 * MS, 0.0)
    assert made.reason == f"no complete measurement within 2 s; {made.lacks}; then call enable"
    made.enable()
    assert made.phase is Phase.ARMING and made.lacks == ""


def test_a_hand_enabled_at_the_start_waits_for_its_first_frame() -> None:
    """Fails when the nodes must start within two seconds of each other, or a hand without measurements waits on."""
    made = Supervisor()
    made.enable(patient=True)
    for now_s in range(100):
        made.check(now_s * 1000 * MS, 0.0)
    assert made.phase.name == "ARMING"
    made.frame(100_000 * MS)
    made.check(100_000 * MS, 0.0)
    made.check(102_000 * MS, 0.0)
    assert made.phase.name == "ARMING"
    made.check(102_000 * MS + 1, 0.0)
    assert made.phase.name == "VENTED"
    made.enable()
    made.check(200_000 * MS, 0.0)
    made.check(202_001 * MS, 0.0)
    assert made.phase.name == "VENTED"  # a call of enable is not patient


def test_enabling_again_forgets_the_ages_of_the_last_time() -> None:
    """Fails when an old frame or command of an earlier run trips the new one, or enabling restarts a running hand."""
    made = armed()
    made.command(0)
    made.vent("vent was called")
    made.enable()
    assert made.frame_ns is None and made.command_ns is None
    assert made.frame_age_s(10**12) == 0.0 and not made.command_held(10**12, 0.5)
    made.command(0)
    assert made.command_held(501 * MS, 0.5)
    made.arm(5 * MS)
    assert [made.phase, made.reason, made.command_ns] == [Phase.ACTIVE, "", 5 * MS]
    made.frame(6 * MS)
    made.enable()
    assert made.phase is Phase.ACTIVE and made.frame_ns == 6 * MS


@pytest.mark.parametrize(("gap_ms", "integrates"), [(5, True), (50, True), (51, False)])
def test_integrators_stop_after_a_gap_of_more_than_50_ms(gap_ms: int, integrates: bool) -> None:
    """Fails when the tick after a gap integrates, or one after a usual period does not."""
    made = armed(7 * MS)
    assert made.frame((7 + gap_ms) * MS) is integrates


def test_the_first_frame_does_not_integrate() -> None:
    """Fails when the first frame, whose gap is unknown, lets the integrators run."""
    made = Supervisor()
    made.enable()
    assert not made.frame(5 * MS)


def test_the_age_of_a_frame_is_in_seconds() -> None:
    """Fails when the age has another unit, sign or origin."""
    assert armed(2 * MS).frame_age_s(5 * MS) == pytest.approx(3e-3)


def test_a_command_is_held_after_the_timeout_and_vented_after_twice_of_it() -> None:
    """Fails when a command time-out is ignored, comes early, or is not that of the newest command."""
    made = armed()
    made.command(100 * MS)
    for now_ms in (101, 1599, 1600):
        assert not made.command_held(now_ms * MS, 1.5)
    assert made.command_held(1601 * MS, 1.5)
    made.frame(3099 * MS)
    for now_ms in (1601, 3099, 3100):
        made.check(now_ms * MS, 1.5)
        assert made.phase is Phase.ACTIVE
    made.check(3101 * MS, 1.5)
    assert (made.phase.name, made.fault) == ("VENTED", "no command for 3 s; check the node that sends the commands")


def test_no_timeout_holds_a_command_for_ever() -> None:
    """Fails when a time-out of 0 holds or vents."""
    made = armed()
    made.command(0)
    made.frame(10**12)
    made.check(10**12, 0.0)
    assert made.phase is Phase.ACTIVE and not made.command_held(10**12, 0.0)


def test_a_vent_on_request_does_not_hide_a_fault() -> None:
    """Fails when a later fault or vent replaces the reason of a latched fault."""
    made = armed()
    made.trip("first")
    made.trip("second")
    made.vent("requested")
    assert (made.phase, made.fault, made.reason) == (Phase.VENTED, "first", "first")


def test_a_vent_on_request_replaces_the_reason_of_another() -> None:
    """Fails when a vent without a fault keeps an outdated reason, or latches."""
    made = armed()
    made.vent("one")
    made.vent("two")
    assert (made.phase, made.fault, made.reason) == (Phase.VENTED, "", "two")
    driven = armed()
    driven.fault = "latched"
    driven.vent("requested")
    assert (driven.phase, driven.reason) == (Phase.VENTED, "requested")
