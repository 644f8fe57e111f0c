"""Contact of each joint, from the model of the law and from force sensors, as events with an onset."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hand_model.arrays import Array, Flags
from hand_model.compile_cache import without_arrays
from hand_model.description import Hand

FORCE_AGE_S = 0.1
"""Readings of the force sensors that are this much older than the frame acted upon, or newer, are not used."""


@without_arrays
def _press(site_joint, force_n, stamp_ns, threshold_n, force, pressed, pressed_ns):  # type: ignore[no-untyped-def]
    """Take the forces of the sites (sites,) [N] as the largest one of each joint, and whether it is pressed.

    Hysteresis: noise at the threshold must not switch the contact on and off.
    """
    for joint in range(len(force)):
        force[joint] = math.nan
    for site, joint in enumerate(site_joint):
        if joint >= 0 and (math.isnan(force[joint]) or force_n[site] > force[joint]):
            force[joint] = force_n[site]
    for joint in range(len(force)):
        now = force[joint] > threshold_n
        if now and not pressed[joint]:
            pressed_ns[joint] = stamp_ns
        pressed[joint] = now or (pressed[joint] and force[joint] > 0.5 * threshold_n)


@without_arrays
def _is_changed(by_model, pressed, contact):  # type: ignore[no-untyped-def]
    """Whether a joint (n,) touches now, by the model or by its sensor, and did not before, or the reverse."""
    changed = False
    for joint in range(len(contact)):
        changed |= (by_model[joint] != 0.0 or pressed[joint]) != contact[joint]
    return changed


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
        self._site_joint = np.array(hand.sensors.site_joint, dtype=np.int64)
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
        _press(self._site_joint, force_n, stamp_ns, threshold_n, self._force, self._pressed, self._pressed_ns)

    def update(self, stamp_ns: int, by_model: Array, age_s: Array, torque_nm: Array) -> None:
        """Combine the sources. by_model (n,): 1 where the law reports contact; age_s [s] since its onset; torque_nm."""
        if abs(stamp_ns - self._force_ns) * 1e-9 > FORCE_AGE_S:
            self._pressed[:] = False
            self._force[:] = np.nan
        if not _is_changed(by_model, self._pressed, self.contact):
            return
        now = (by_model != 0.0) | self._pressed
        for joint in np.flatnonzero(now != self.contact):
            self.events.append(self._event(int(joint), stamp_ns, by_model, age_s, torque_nm))
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
