"""What the model makes of a force sensor: the reading that follows from the measured motion and pressure. Pure.

Eq. 8 gives the torque that an obstacle must exert for the measured motion, and the lever of the sensor its force; the
effects of force sensors then change the reading. The diagnosis compares the same prediction with the measured force.
"""

from __future__ import annotations

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.kernel.hooks import HAND_EFFECTS
from hand_model.kernel.open_loop import READINGS, MeasuredInputs, open_loop, surroundings_of
from hand_recording.interpolation import bridge
from hand_recording.signals import derivatives
from hand_studio.window import Window


def has_force(hand: Hand, joint: int) -> bool:
    """Whether a force sensor is on the link that a joint moves."""
    return bool(np.any(hand.sensors.site_joint == joint))


def force_reading(hand: Hand, parameters: Array, window: Window, joint: int, state: Array) -> Array:
    """The reading (T,) [N] of the sensor on a joint that a model expects; NaN without a sensor.

    parameters: (rows, joints) SI.  state: (STATES, joints) at the start of the window.
    """
    if not has_force(hand, joint):
        return np.full(len(window.angle_rad), np.nan)
    partner = int(hand.partner[joint])
    angle = bridge(window.angle_rad[:, [joint, partner] if partner >= 0 else [joint]])[0]
    speed, acceleration = derivatives(angle, window.period_s)
    beside = (angle[:, 1], acceleration[:, 1]) if partner >= 0 else (0.0, 0.0)
    e = surroundings_of(window.time_s, (angle[:, 0], speed[:, 0], acceleration[:, 0]), *beside)
    pressure = bridge(window.pressure_pa[:, joint])[0]
    inputs = MeasuredInputs(window.set_point_pa[:, joint], pressure, e, window.period_s)
    start, lever_m = state[None, :, joint], hand.lever_arm_m(joint)
    # By a loop that is compiled already: while a page is live, nothing may be compiled.
    readings = open_loop(
        parameters[None, :, joint], np.ascontiguousarray(start), inputs, lever_m=lever_m, effects=HAND_EFFECTS
    )
    force: Array = readings[0, READINGS.index("force")]
    return force
