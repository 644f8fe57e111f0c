"""A hand that holds because a topic has a second publisher, and goes on when the publisher is gone. Virtual time."""

from __future__ import annotations

import numpy as np
import pytest

from hand_control.supervisor import Phase
from test.control.mode_rig import HAND, INDEX, Rig

HOLD_S = 0.5
"""Less than the 0.6 s after which the node vents."""


@pytest.mark.parametrize("angle_rad", [0.3, 0.9, 1.5])
def test_a_hand_in_motion_goes_on_after_a_hold(angle_rad: float) -> None:
    """Fails when what happened during a hold is taken for what happened within one frame, and latches a fault."""
    rig = Rig()
    rig.command(list(HAND.joints), [angle_rad] * len(HAND.joints))
    rig.run(0.15)
    rig.controller.held = True
    pressures = rig.pressures[-1]
    rig.run(HOLD_S)
    assert np.array_equal(rig.pressures[-1], pressures)
    rig.controller.held = False
    rig.run(1.0)
    assert (rig.controller.safety.phase, rig.controller.safety.fault) == (Phase.ACTIVE, "")
    rig.command(["index_proximal"], [1.2])
    rig.run(2.5)
    assert rig.degrees()[INDEX] == pytest.approx(np.degrees(1.2), abs=2.0)


@pytest.mark.parametrize("first", ["position", "torque"])
def test_a_mode_that_changes_during_a_hold_begins_at_a_pose(first: str) -> None:
    """Fails when the reference is not a number afterwards: the hand would keep its pressures, whatever is commanded."""
    rig = Rig(control_mode=first)
    rig.controller.held = True
    rig.run(0.2)
    rig.mode("torque" if first == "position" else "position")
    rig.run(0.2)
    assert np.isfinite(rig.references[-1]).all()
    rig.controller.held = False
    rig.mode("position")
    rig.run(0.5)
    rig.command(["index_proximal"], [0.8])
    rig.run(2.5)
    assert np.isfinite(rig.references[-1]).all()
    assert rig.degrees()[INDEX] == pytest.approx(np.degrees(0.8), abs=2.0)
