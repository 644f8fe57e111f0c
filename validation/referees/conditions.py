"""Conditions under which a recording is made: what a laboratory cannot choose, drawn for every case."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from validation.referees.shapes import Rng

DEFAULT_TOLERANCE = 0.05


@dataclass(frozen=True, slots=True)
class Conditions:
    """off: standard deviation of the nominal numbers [-].  stated: tolerance that the diagnosis is given [-].

    jitter_s: standard deviation of the stamps.  lost: share of lost frames.  rate_hz: of the recorder; commands are
    sent at 100 Hz.  noise: factor.  duration_s.  joints: number of recorded joints.  onset: share of the recording
    after which the effects begin, 0 for always there.
    """

    off: float = 0.03
    stated: float = DEFAULT_TOLERANCE
    jitter_s: float = 0.0
    lost: float = 0.0
    rate_hz: int = 100
    noise: float = 1.0
    duration_s: float = 30.0
    joints: int = 4
    onset: float = 0.0

    def labels(self) -> list[str]:
        """What differs from the usual condition, for the table of scores."""
        out = [f"off {self.off:.0%}, {'stated' if self.stated != DEFAULT_TOLERANCE else 'default'} tolerance"]
        out += ["jitter"] * (self.jitter_s > 0.0) + ["lost frames"] * (self.lost > 0.0)
        out += [f"recorder at {self.rate_hz} Hz"] * (self.rate_hz != 100) + ["onset"] * (self.onset > 0.0)
        out += ["noise x 2 and more"] * (self.noise >= 2.0) + [f"{self.joints} joints"]
        return out + ["shorter than 20 s"] * (self.duration_s < 20.0) + ["longer than 60 s"] * (self.duration_s > 60.0)


def draw(rng: Rng) -> Conditions:
    """Draw the conditions of a case; about half of the cases have the usual one in each respect."""
    off = float(rng.choice([0.03, 0.03, 0.10, 0.20]))
    stated = max(DEFAULT_TOLERANCE, off) if rng.random() < 0.5 else DEFAULT_TOLERANCE

    def half(unusual: float, usual: float) -> float:
        return unusual if rng.random() < 0.4 else usual

    return Conditions(
        off=off,
        stated=stated,
        jitter_s=half(float(rng.uniform(5e-4, 3e-3)), 0.0),
        lost=half(float(rng.uniform(0.0, 0.05)), 0.0),
        rate_hz=int(half(float(rng.choice([25, 50, 200])), 100.0)),
        noise=half(float(np.exp(rng.uniform(np.log(0.5), np.log(5.0)))), 1.0),
        duration_s=half(float(rng.choice([15.0, 60.0, 120.0, 600.0], p=[0.4, 0.3, 0.25, 0.05])), 30.0),
        joints=int(rng.choice([1, 4, 4, 11])),
        onset=float(rng.uniform(0.35, 0.65)) if rng.random() < 0.12 else 0.0,
    )
