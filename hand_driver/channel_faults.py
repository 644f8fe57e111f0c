"""Which channels measure nothing and why, one line each: the sensor, the channel, the evidence and what to check.

The driver publishes the lines in board_state, before the frame whose values are not numbers, so that the controller
latches the cause and not only its effect.
"""

from __future__ import annotations

from collections.abc import Sequence

from hand_driver.board import Frame, Status
from hand_driver.channel_watch import ChannelWatch
from hand_driver.measurement import channel_names, within_supply
from hand_model.description import Hand

SHOWN = 32
"""Most channels that are named; a line counts the rest."""


class ChannelFaults:
    """The lines of one hand."""

    def __init__(self, hand: Hand) -> None:
        """Know the names of its channels and its supply."""
        self._channel = {name: channel for channel, name in channel_names(hand).items()}
        self._full = hand.sensors.adc.full_scale
        self._supply_v = hand.sensors.supply_voltage_v

    def lines(self, frame: Frame, at_rail: Sequence[str], watch: ChannelWatch | None) -> tuple[str, ...]:
        """Of a frame. at_rail: names of the sensors at a rail.  watch: where it believes a channel no longer."""
        if not within_supply(frame.supply_voltage_v, self._supply_v):
            return (
                f"every channel: the supply of the sensors is {frame.supply_voltage_v:.2f} V, {self._supply_v:g} V are"
                " described; check this supply and its wiring",
            )
        if frame.status & Status.ADC_FAULT:
            return ("every channel: the board reports a failed conversion; check the converter and its supply",)
        if watch is not None and watch.common_fault:
            return (watch.common_fault,)
        lines = [self._rail(name, frame) for name in at_rail] + list(() if watch is None else watch.lines)
        if len(lines) > SHOWN:
            lines[SHOWN:] = [f"and {len(lines) - SHOWN} more channels: see the driver's status `channels`"]
        return tuple(lines)

    def _rail(self, name: str, frame: Frame) -> str:
        channel = self._channel[name]
        return (
            f"{name} (channel {channel}): at the rail, {frame.counts[channel]} of {self._full} counts;"
            " check for a broken wire or a short"
        )
