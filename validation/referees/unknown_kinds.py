"""Physics that no catalogue holds: in time, over an angle, in events, between joints, in sensors and in software.

Each kind changes the laws of a joint, or its readings. The second half is for tests: it is run, not looked at.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from validation.referees.plant import CROSS, EVENT, FRAME_S, WANDER, Laws
from validation.referees.shapes import Rng, harmonics
from validation.trial.arrays import Array

Change = Callable[[Laws, int, float, Rng], None]
Reading = Callable[[Array, float, Rng], Array]


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind. family: as a remainder describes it.

    change: (laws, joint, size, rng).  reading: (readings (3, frames) of pressure, angle and speed of the joint, size,
    rng) -> the readings.  Sizes are 1 at about ten times the repeatability.
    """

    name: str
    family: str
    change: Change | None = None
    reading: Reading | None = None


def _time(laws: Laws) -> Array:
    return np.asarray(np.arange(laws.frames) * FRAME_S, dtype=np.float64)


def _sine(laws: Laws, j: int, size: float, rng: Rng) -> None:
    laws.added[EVENT, :, j] = 0.006 * size * np.sin(2.0 * math.pi * rng.uniform(0.7, 4.0) * _time(laws))


def _chirp(laws: Laws, j: int, size: float, rng: Rng) -> None:
    t = _time(laws)
    laws.added[EVENT, :, j] = 0.006 * size * np.sin(2.0 * math.pi * (0.4 * t + 0.5 * rng.uniform(0.05, 0.15) * t * t))


def _walk(laws: Laws, j: int, size: float, rng: Rng) -> None:
    keep, x = math.exp(-FRAME_S / rng.uniform(0.8, 3.0)), 0.0
    for k in range(laws.frames):
        x = keep * x + math.sqrt(1.0 - keep * keep) * rng.standard_normal()
        laws.added[WANDER, k, j] = 0.006 * size * x


def _pushes(laws: Laws, j: int, size: float, rng: Rng) -> None:
    t = _time(laws)
    for at in rng.uniform(2.0, t[-1] - 1.0, 5):
        width = rng.uniform(0.1, 0.4)
        laws.added[EVENT, :, j] += _sign(rng) * 0.02 * size * np.exp(-(((t - at) / width) ** 2))


def _sign(rng: Rng) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _square(laws: Laws, j: int, size: float, rng: Rng) -> None:
    t, period = _time(laws), rng.uniform(3.0, 6.0)
    laws.added[EVENT, :, j] = 0.006 * size * np.sign(np.sin(2.0 * math.pi * t / period))


def _teeth(laws: Laws, j: int, size: float, rng: Rng) -> None:
    teeth, phase = rng.uniform(9.0, 22.0), rng.uniform(0.0, 6.28)
    laws.tabulate("ripple", j, lambda x: 0.006 * size * np.sin(teeth * x + phase))


def _detents(laws: Laws, j: int, size: float, rng: Rng) -> None:
    at = rng.uniform(0.2, 1.2, 3)
    laws.tabulate(
        "ripple", j, lambda x: sum(-0.02 * size * ((x - a) / 0.05) * np.exp(-(((x - a) / 0.05) ** 2)) for a in at)
    )


def _cross(laws: Laws, j: int, size: float, rng: Rng) -> None:
    laws.added[CROSS, :, j] = 0.01 * size * np.sin(2.0 * math.pi * rng.uniform(0.05, 0.2) * _time(laws))


def _breath(laws: Laws, j: int, size: float, rng: Rng) -> None:
    t = _time(laws)
    laws.added[EVENT, :, j] = 0.006 * size * (np.sin(0.5 * t) + 0.5 * np.sin(1.7 * t + 1.0)) ** 3


def _stiffness_snaps(laws: Laws, j: int, size: float, rng: Rng) -> None:
    edges = np.sort(rng.uniform(0.05, 0.95, 6))
    laws.tabulate("ageing", j, lambda x: 0.05 * size * (np.searchsorted(edges, x) % 2))


def _ramp_event(laws: Laws, j: int, size: float, rng: Rng) -> None:
    t, at = _time(laws), rng.uniform(6.0, 12.0)
    laws.added[EVENT, :, j] = 0.008 * size * np.clip(t - at, 0.0, 2.0) * (t < at + rng.uniform(5.0, 8.0))


def _hums(laws: Laws, j: int, size: float, rng: Rng) -> None:
    t = _time(laws)
    on = np.sin(2.0 * math.pi * t / rng.uniform(4.0, 8.0)) > 0.3
    laws.added[EVENT, :, j] = 0.01 * size * on * np.sin(2.0 * math.pi * rng.uniform(5.0, 9.0) * t)


def _fine_ripple(laws: Laws, j: int, size: float, rng: Rng) -> None:
    shape = harmonics(rng, (15, 30, 45), 0.5)
    laws.tabulate("ripple", j, lambda x: 0.005 * size * shape(x))


def _cross_sum(laws: Laws, j: int, size: float, rng: Rng) -> None:
    laws.added[CROSS, :, j] = _sign(rng) * 0.006 * size
    laws.added[EVENT, :, j] = 0.004 * size * np.sin(2.0 * math.pi * 0.3 * _time(laws))


def _bit(channel: int, weight: float) -> Reading:
    """A converter whose bit of a weight is lost."""

    def reading(r: Array, size: float, rng: Rng) -> Array:
        out, step = r.copy(), weight * size
        lost = np.floor(r[channel] / step) % 2 == 1
        out[channel] = r[channel] - step * lost
        return out

    return reading


def _repeats(r: Array, size: float, rng: Rng) -> Array:
    """A driver that repeats its last angle now and then, for several frames."""
    out, k = r.copy(), 0
    while k < r.shape[1]:
        k += int(rng.integers(60, 240))
        run = int(rng.integers(6, 8 + round(8 * size)))
        out[1, k : k + run] = out[1, k - 1] if k - 1 < r.shape[1] else 0.0
        k += run
    return out


def _crosstalk(r: Array, size: float, rng: Rng) -> Array:
    """An angle that takes up a share of the pressure's rate."""
    out = r.copy()
    out[1] += 2e-9 * size * np.gradient(r[0], FRAME_S)
    return out


def _spikes(r: Array, size: float, rng: Rng) -> Array:
    out = r.copy()
    at = rng.random(r.shape[1]) < 0.005
    out[1] += at * 0.02 * size * rng.standard_normal(r.shape[1])
    return out


def _aliased(r: Array, size: float, rng: Rng) -> Array:
    """A pressure that carries a hum of the mains, under-sampled."""
    t = np.arange(r.shape[1]) * FRAME_S
    out = r.copy()
    out[0] += 1.5e3 * size * np.sin(2.0 * math.pi * rng.uniform(0.5, 3.0) * t)
    return out


def _wrong_rate(r: Array, size: float, rng: Rng) -> Array:
    """Angles of a slower or faster clock than the stamps say."""
    n = r.shape[1]
    at = np.clip(np.arange(n) * (1.0 + 2e-3 * size), 0, n - 1)
    out = r.copy()
    out[1] = np.interp(at, np.arange(n), r[1])
    return out


def _glued(laws: Laws, j: int, size: float, rng: Rng) -> None:
    """A cable that pulls at one place while the joint bends, until it comes loose."""
    at = rng.uniform(0.3, 0.9)
    laws.tabulate("held", j, lambda x: 0.02 * size * np.clip(x - at, 0.0, 0.15) / 0.15 * (x < at + 0.15))


DEVELOPMENT: tuple[Kind, ...] = (
    Kind("shaken base", "time", _sine),
    Kind("wandering load", "time", _walk),
    Kind("pushes", "event", _pushes),
    Kind("teeth", "angle", _teeth),
    Kind("coupling that comes and goes", "joint", _cross),
    Kind("stiffness that snaps", "event", _stiffness_snaps),
    Kind("lost bit of the angle", "sensor", None, _bit(1, 0.008)),
    Kind("repeated angles", "software", None, _repeats),
    Kind("hum in the pressure", "sensor", None, _aliased),
    Kind("cable that comes loose", "angle", _glued),
)
HELD_BACK: tuple[Kind, ...] = (
    Kind("chirp", "time", _chirp),
    Kind("square load", "time", _square),
    Kind("detents", "angle", _detents),
    Kind("breathing mount", "time", _breath),
    Kind("load for a while", "event", _ramp_event),
    Kind("hum that starts and stops", "time", _hums),
    Kind("fine ripple", "angle", _fine_ripple),
    Kind("load from the neighbour", "joint", _cross_sum),
    Kind("lost bit of the pressure", "sensor", None, _bit(0, 1.2e3)),
    Kind("angle with crosstalk", "sensor", None, _crosstalk),
    Kind("spikes", "sensor", None, _spikes),
    Kind("stamps of another clock", "software", None, _wrong_rate),
)
