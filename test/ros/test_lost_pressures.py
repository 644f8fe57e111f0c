"""The controller node without new pressures: what is old is used for a short time, then nothing counts as a frame."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from hand_control.inputs import JointInput
from hand_control.node import ControllerNode
from hand_control.supervisor import FREEZE_S, VENT_S, Phase, Supervisor
from hand_messages.layouts import JOINT_STATE
from hand_model.description import load_hand

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
PERIOD_NS, WATCH_NS, START_NS = 5_000_000, 20_000_000, 10**12


class _States(JointInput):
    """Joint states whose stamp is the time that stands in the bytes."""

    def read(self, raw: bytes) -> tuple[int, list[Any]]:
        return int.from_bytes(raw, "little"), [np.zeros(len(HAND.joints))] * 2


def test_pressures_are_used_for_50_ms_and_then_no_frame_counts() -> None:
    """Fails when a hand whose pressures are lost is driven for more than 170 ms, or vented before 150 ms."""
    safety, vented_ns = Supervisor(phase=Phase.ACTIVE), 0

    def frame(times: Any, *_: object) -> None:
        safety.frame(times.stamp_ns)

    node: Any = SimpleNamespace(
        active=True,
        _states_in=_States(JOINT_STATE, HAND.joints, ("position", "velocity")),
        _pressure_ns=START_NS,
        _pressure=np.zeros(len(HAND.joints)),
        _now_ns=lambda: START_NS,
        _controller=SimpleNamespace(frame=frame, safety=safety),
        keep_fault=lambda _: None,
    )
    for now_ns in range(START_NS, START_NS + 300_000_000, PERIOD_NS):
        ControllerNode._on_joint_states(node, now_ns.to_bytes(8, "little"))
        if (now_ns - START_NS) % WATCH_NS == 0:
            safety.check(now_ns, 0.0)
        if safety.fault and not vented_ns:
            vented_ns = now_ns
    assert safety.fault.startswith("no usable sensor data")
    least_s = FREEZE_S + VENT_S
    assert least_s < (vented_ns - START_NS) * 1e-9 <= least_s + WATCH_NS * 1e-9
