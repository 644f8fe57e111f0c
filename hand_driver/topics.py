"""The topics of the driver as bytes: their names, types and order, defined once."""

from __future__ import annotations

import numpy as np

from hand_driver.board import Frame
from hand_driver.measurement import Measurement
from hand_messages.cdr import Layout
from hand_messages.layouts import ADC_FRAME, CONTACT_FORCES, JOINT_PRESSURES, JOINT_STATE
from hand_model.description import Hand

TOPICS = {
    "pressures": JOINT_PRESSURES,
    "joint_states": JOINT_STATE,
    "contact_forces": CONTACT_FORCES,
    "adc": ADC_FRAME,
}
"""In the order of publishing: when joint_states triggers the controller, it has the pressures of the same frame."""


class FrameTopics:
    """Serializes the topics of one hand's frames."""

    def __init__(self, hand: Hand, frame_id: str) -> None:
        """Prepare the messages with the names of this hand."""
        channels = {"channel": hand.channel_count, "counts": hand.channel_count}
        self._pressures = Layout(JOINT_PRESSURES, frame_id, hand.joints)
        self._joint_states = Layout(JOINT_STATE, frame_id, hand.joints)
        self._forces = Layout(CONTACT_FORCES, frame_id, hand.sensors.sites)
        self._adc = Layout(ADC_FRAME, frame_id, lengths=channels)
        self._channels = np.arange(hand.channel_count, dtype=np.uint16)

    def encode(self, stamp_ns: int, frame: Frame, measured: Measurement) -> tuple[bytes, ...]:
        """One message per topic, in the order of TOPICS."""
        return (
            self._pressures.encode(stamp_ns, pressure=measured.pressure),
            self._joint_states.encode(
                stamp_ns, position=measured.position, velocity=measured.velocity, effort=measured.effort
            ),
            self._forces.encode(stamp_ns, force=measured.force),
            self._adc.encode(
                stamp_ns,
                sequence=frame.sequence,
                supply_voltage=frame.supply_voltage_v,
                channel=self._channels,
                counts=frame.counts,
            ),
        )
