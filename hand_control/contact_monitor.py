"""Contact of each joint, from the model of the law and from force sensors, as events with an onset."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hand_model.arrays import Array, Flags
from hand_model.description import Hand

FORCE_AGE_S = 0.1
"""Readings of the force sensors that are this much older than the frame acted upon, or newer, are not used."""


@dataclass(frozen=True, slots=True)
class Event:
    """A contact begins or ends: joint index, onset_ns, torque_nm, force_n (NaN: no sensor), source, delay_s."""

    joint: int
    touching: bool
    onset_ns: int
    torque_nm: float
    force_n: float
    source: str
    delay_s: float


class ContactMonitor:
    """The present contact of every joint, (n,), and the events since they were last taken."""

    def __init__(self, hand: Hand) -> None:
        """Begin without contact."""
        count = len(hand.joints)
        self.contact: Flags = np.zeros(count, dtype=np.bool_)
        self.events: list[Event] = []
        self._sites = [(k, int(joint)) for k, joint in enumerate(hand.sensors.site_joint) if joint >= 0]
        self._force = np.full(count, np.nan)
        self._pressed: Flags = np.zeros(count, dtype=np.bool_)
        self._pressed_ns = np.zeros(count, dtype=np.int64)
        self._force_ns = 0

    def release(self) -> None:
        """End every contact without an event: the hand is vented."""
        self.contact[:] = False
        self._pressed[:] = False

    def forces(self, stamp_ns: int, force_n: Array, threshold_n: float) -> None:
        """Take readings of the force sites (sites,) [N] in the description's order; NaN where a sensor fails."""
        self._force_ns = stamp_ns
        self._force[:] = np.nan
        for site, joint in self._sites:
            self._force[joint] = np.fmax(self._force[joint], force_n[site])
        pressed = self._force > threshold_n
        self._pressed_ns[pressed & ~self._pressed] = stamp_ns
        # Hysteresis: noise at the threshold must not switch the contact on and off.
        self._pressed = pressed | (self._pressed & (self._force > 0.5 * threshold_n))

    def update(self, stamp_ns: int, by_model: Array, age_s: Array, torque_nm: Array) -> None:
        """Combine the sources. by_model (n,): 1 where the law reports contact; age_s [s] since its onset; torque_nm."""
        if abs(stamp_ns - self._force_ns) * 1e-9 > FORCE_AGE_S:
            self._pressed[:] = False
            self._force[:] = np.nan
        now = (by_model != 0.0) | self._pressed
        changed = np.flatnonzero(now != self.contact)
        for joint in changed:
            self.events.append(self._event(int(joint), stamp_ns, by_model, age_s, torque_nm))
        if len(changed):
            self.contact = now

    def _event(self, joint: int, stamp_ns: int, by_model: Array, age_s: Array, torque_nm: Array) -> Event:
        touching = not self.contact[joint]
        modelled, pressed = bool(by_model[joint] != 0.0), bool(self._pressed[joint])
        onsets = [stamp_ns - round(age_s[joint] * 1e9)] * modelled + [int(self._pressed_ns[joint])] * pressed
        # A reading may be newer than the frame acted upon: a late frame. No contact begins after it is reported.
        onset = min(stamp_ns, *onsets) if touching else stamp_ns
        source = " and ".join(["model"] * modelled + ["force"] * pressed)
        force, torque = float(self._force[joint]), float(torque_nm[joint])
        return Event(
            joint=joint,
            touching=touching,
            onset_ns=onset,
            torque_nm=torque if math.isfinite(torque) else 0.0,
            force_n=force,
            source=source,
            delay_s=(stamp_ns - onset) * 1e-9,
        )

    def take(self) -> list[Event]:
        """The events since the last call."""
        events, self.events = self.events, []
        return events
