"""The numbers and rules of the safety layer in C, declared once: `firmware/hand_safety.h` and its table are generated.

Ages and bounds that the controller has as well are taken from its modules, so both vent after the same time.
`python -m hand_control.declared --write` writes the header and the table, `--check` compares them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hand_control.declared import C
from hand_control.frame_checks import OVER, OVER_S
from hand_control.supervisor import FREEZE_S, VENT_S, WARN_S
from hand_model.description import Hand
from hand_model.yaml_document import yaml_text

LIFETIME_S = 1.0
"""Longest lifetime of set-points; the driver refuses a longer one as well."""
SEQUENCE_WINDOW = 1 << 31
"""A sequence number that is not 1 to this number - 1 ahead of the last one is refused, as docs/protocol.md says."""
RAMP_S = 0.5
RAMP_PA_PER_S = 1.2e6
"""After arming, set-points rise at most at this rate for RAMP_S: full pressure then takes 0.5 s. The ramps of the
controller and of the driver are slower and act first: the driver takes a reduced set-point for a fault of the board."""
FILL_PA_PER_S = 1.0e7
"""Fastest fill rate of a valve in config/hand.yaml."""
RATE_MARGIN = 5.0
"""A set-point rises by this multiple of FILL_PA_PER_S at most. The law leads the pressure by up to three times the fill
rate; at 200 Hz the full range takes three ticks, and the driver takes a third reduced echo for a fault of a valve."""
TORQUE_MARGIN = 0.1
"""Share above the torque limit at which the layer limits: its model is fully crept, the law's is not."""
HIGHEST_PA = 2.0e6
"""Pressures beyond are neither accepted as limits nor believed as measurements."""


class Number(NamedTuple):
    """One number in C. text: its value in C.  value: the same in `unit`."""

    text: str
    value: float
    unit: str
    meaning: str


def _us(time_s: float, meaning: str) -> Number:
    return Number(f"{round(time_s * 1e6)}U", round(time_s * 1e6), "us", meaning)


def _integer(value: float, unit: str, meaning: str) -> Number:
    return Number(f"{round(value)}", round(value), unit, meaning)


NUMBERS: dict[str, Number] = {
    "warn_us": _us(WARN_S, "an older sample is late"),
    "freeze_us": _us(FREEZE_S, "samples further apart stop the integrators"),
    "vent_us": _us(VENT_S, "an older sample vents"),
    "heartbeat_us": _us(VENT_S, "an older heartbeat vents"),
    "lifetime_us": _us(LIFETIME_S, "longest lifetime of a command"),
    "step_us": _us(C.max_dt, "longest step between two ticks or samples that is used"),
    "step_s": Number(f"{C.max_dt!r}F", C.max_dt, "s", "the same for the dt of a law;"),
    "least_step_s": Number(f"{C.min_dt!r}F", C.min_dt, "s", "a shorter one counts as 0"),
    "over_permille": _integer(OVER * 1e3, "1/1000", "share by which a measured pressure may exceed its limit,"),
    "over_us": _us(OVER_S, "for so long"),
    "ramp_us": _us(RAMP_S, "duration of the ramp after arming,"),
    "ramp_pa_per_s": _integer(RAMP_PA_PER_S, "Pa/s", "with this rate"),
    "rate_pa_per_s": _integer(
        RATE_MARGIN * FILL_PA_PER_S, "Pa/s", "largest rise of a set-point; a fall is not limited"
    ),
    "torque_permille": _integer(TORQUE_MARGIN * 1e3, "1/1000", "share by which a torque may exceed its limit"),
    "highest_pa": _integer(HIGHEST_PA, "Pa", "pressures beyond are not plausible"),
    "sequence_window": Number(f"{SEQUENCE_WINDOW}U", SEQUENCE_WINDOW, "", "a sequence number further ahead is refused"),
}
"""By the name that Python and C use, in C after HAND_SAFETY_ and in capitals."""


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule: what may happen, how it is detected, after which time, and the state that follows."""

    hazard: str
    detection: str
    time: str
    state: str
    rearm: str
    test: str


_AGAIN = "reset, then arm"
_REFUSED = "command refused whole; the last one keeps its lifetime"


def _ms(name: str) -> str:
    return f"{NUMBERS[name].value * 1e-3:g} ms"


RULES: tuple[Rule, ...] = (
    Rule("the sender of set-points stops", "age of the command against its lifetime", "lifetime, at most 1 s",
         "vented, fault latched", _AGAIN, "test_a_command_ends_with_its_lifetime"),
    Rule("a command with an unlimited lifetime", f"lifetime 0 or above {_ms('lifetime_us')}", "at once", _REFUSED, "-",
         "test_a_lifetime_out_of_bounds_is_refused"),
    Rule("the acquisition stops, repeats a sample or fails", "age of the newest sample that counts",
         f"late {_ms('warn_us')}, integrators stop {_ms('freeze_us')}, vent {_ms('vent_us')}",
         "vented, fault latched", _AGAIN, "test_the_tiers_of_the_age_of_a_sample"),
    Rule("the loop that computes or receives set-points hangs", "heartbeat number does not change",
         _ms("heartbeat_us"), "vented, fault latched", _AGAIN, "test_a_heartbeat_that_stands_still_vents"),
    Rule("a replayed or delayed command", "sequence number not 1 to 2^31 - 1 after the last one", "at once",
         _REFUSED, "-", "test_a_replayed_command_is_refused"),
    Rule("a set-point out of range", "below 0 or above the joint's pressure limit", "at once", _REFUSED, "-",
         "test_a_set_point_out_of_range_is_refused"),
    Rule("a set-point that rises too fast", f"rise above {NUMBERS['rate_pa_per_s'].value:g} Pa/s", "at once",
         "set-point reduced", "-", "test_the_rise_of_a_set_point_is_bounded"),
    Rule("pressure returns at once after an outage", "armed less than 0.5 s ago", "at once",
         f"set-point rises from the measured pressure at most {RAMP_PA_PER_S:g} Pa/s", "-",
         "test_pressure_returns_along_a_ramp_from_the_measured_one"),
    Rule("a torque above the joint's limit", f"Eq. 11, fully crept, limit + {TORQUE_MARGIN:.0%}", "at once",
         "set-point reduced", "-", "test_the_torque_of_a_set_point_is_bounded"),
    Rule("an actuator above its pressure limit", f"measured pressure above limit + {OVER:.0%}", _ms("over_us"),
         "vented, fault latched", f"pressure below the limit; {_AGAIN}", "test_a_measured_over_pressure_vents"),
    Rule("an implausible measurement", f"beyond {HIGHEST_PA:g} Pa or one turn, conversion failed", "at once",
         "sample does not count", "-", "test_an_implausible_sample_does_not_count"),
    Rule("the clock goes back or stands still", "interval of two ticks", "at once",
         "back: vented, fault latched; still: no set-point rises", _AGAIN, "test_a_clock_that_goes_back_vents"),
    Rule("a time step that is not finite, zero, negative or long", "dt of the law", "at once",
         f"0, or {C.max_dt:g} s for a long one, is used", "-", "test_the_step_of_a_law_is_bounded"),
    Rule("the board restarts, or the layer's memory is damaged", "state is not ramping or driving", "at once",
         "vented", "arm", "test_a_damaged_state_is_vented"),
    Rule("limits that cannot be used", "signs, ranges and leverage at the start", "at once",
         "vented for good", "correct the limits", "test_limits_that_cannot_be_used_keep_the_hand_vented"),
)  # fmt: skip
"""Every rule of the layer, in the order of the table."""

LIMITS = (
    "max_pressure_pa",
    "max_torque_nnm",
    "a0_nnm",
    "a1_nnm_per_rad",
    "a2_pnm_per_pa",
    "a3_pnm_per_pa_rad",
    "phi_max_urad",
    "low_urad",
    "high_urad",
)
"""The fields of hand_safety_joint in C, in their order."""


def joint_limits(hand: Hand) -> NDArray[np.int32]:
    """Limits of every joint, (n, LIMITS), in the integer units of the layer; ValueError for more than 32 bits."""
    rows = (
        hand.limits.max_pressure_pa,
        hand.limits.max_torque_nm * 1e9,
        hand.row("statics.a0_nm") * 1e9,
        hand.row("statics.a1_nm_per_rad") * 1e9,
        hand.row("statics.a2_nm_per_pa") * 1e12,
        hand.row("statics.a3_nm_per_pa_rad") * 1e12,
        hand.row("material.phi_max_deg") * 1e6,
        hand.limits.low_rad * 1e6,
        hand.limits.high_rad * 1e6,
    )
    exact = np.rint(np.array(rows)).T
    if not (np.abs(exact) < 2**31).all():
        joint, column = np.argwhere(~(np.abs(exact) < 2**31))[0]
        raise ValueError(f"{hand.joints[joint]}: {LIMITS[column]} is {exact[joint, column]:g}; it must be below 2^31")
    return exact.astype(np.int32)


def header_section() -> str:
    """Definitions of the numbers, in C."""
    lines = []
    for name, number in NUMBERS.items():
        unit = f"[{number.unit}] " if number.unit else ""
        lines.append(f"#define HAND_SAFETY_{name.upper()} ({number.text}) /* {unit}{number.meaning} */")
    return "\n".join([*lines, ""])


def rule_table() -> str:
    """The table of the rules, in Markdown."""
    lines = ["| hazard | detection | time | state | to drive again |", "|---|---|---|---|---|"]
    lines += [f"| {rule.hazard} | {rule.detection} | {rule.time} | {rule.state} | {rule.rearm} |" for rule in RULES]
    return "\n".join([*lines, ""])


def rule_rows() -> str:
    """The same rules as rows of docs/safety.md, in YAML."""
    head = (
        "# Rows of docs/safety.md, generated from hand_control/safety_numbers.py by python -m hand_control.declared.\n"
    )
    rows = [
        {
            "hazard": f"on a microcontroller: {rule.hazard}",
            "detection": rule.detection,
            "time": rule.time,
            "state": rule.state,
            "rearm": rule.rearm,
            "test": f"test/control/test_safety_layer.py::{rule.test}",
        }
        for rule in RULES
    ]
    return head + yaml_text(rows)
