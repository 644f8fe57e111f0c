"""How far a replay lies from its recording."""

from __future__ import annotations

import numpy as np

from hand_model.arrays import Array
from hand_recording.loader import Recording
from hand_recording.replay import Replay
from hand_sim.plant import PHI


def replayed_angle_rad(result: Replay) -> Array:
    """Angles (N, joints) [rad] as the driver would have measured them in the replay, without noise."""
    sensors = result.hand.sensors
    angles: Array = sensors.angle_line.angle_rad(sensors.hall.ratio(result.states[:, PHI]))
    return angles


def difference_deg(recording: Recording, result: Replay) -> dict[str, float]:
    """RMS difference [degree] of each joint's measured and replayed angle; NaN where nothing was measured."""
    states = recording["joint_states"]
    _, rows = np.unique(states.stamp_ns, return_index=True)
    columns = [states.names.index(joint) for joint in result.hand.joints]
    measured = states["position"][rows[-len(result.states) :]][:, columns]  # a replay may begin later
    error = np.degrees(measured - replayed_angle_rad(result))
    finite = np.isfinite(error)
    square = np.where(finite, error, 0.0) ** 2
    rms = np.sqrt(square.sum(axis=0) / np.where(finite.any(axis=0), finite.sum(axis=0), np.nan))
    return dict(zip(result.hand.joints, rms.tolist(), strict=True))
