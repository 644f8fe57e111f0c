"""What an effect of the catalogue is: parameters, equations hooked into the chain, how to try it, how to say it.

An effect is one file of this package. Its equations are functions of scalars, compiled into the chain (chain.py) at
the hook they name; its parameters are rows of the parameter array whose neutral value switches it off. An effect
that is a wrong number of the plain plant rather than a new term names that number among its keys instead.

Hooks. w: parameters and, from row MEMORY_ROW on, memory, (rows, lanes); i: the lane; e: what is measured around the
joint, a tuple; h: step [s].

    set_point(w, i, u, p, e, h) -> u        [Pa], in the order of the files
    valve_error(w, i, error) -> error          [Pa], set-point minus pressure as the valve feels it
    pressure_rate(w, i, rate, p, u, e)      [Pa/s]
    pressure_reading(w, i, p) -> reading       [Pa]; pressure_true is its inverse
    actuator_pressure(w, i, p, h) -> p         [Pa], at the actuator, from that at the sensor
    torque(w, i, phi, omega, p, e)          -> torque [N m] added, stiffness -d torque / d phi [N m/rad]
    damping(w, i, omega) -> d                  [N m s/rad] added
    dry(w, i, omega, p) -> torque              [N m], magnitude of dry friction added
    moved(w, i, before, after, h) -> 0.0       keep memory of a motion from one angle to another [rad]
    angle_reading(w, i, phi, h) -> reading     [rad]
    force_reading(w, i, force, h) -> reading   [N]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from numba import njit

from hand_model.plant_parameters import PLANT_PARAMETERS, Parameter

TIME, NEIGHBOUR, INFLOW, PARTNER, ANGLE, SPEED, ACCELERATION = range(7)
"""Columns of e: time [s]; angle of a neighbouring joint [rad]; sum of all pressure rises of the hand [Pa/s];
acceleration of the coupled phalanx [rad/s^2]; the joint's measured angle [rad], speed and acceleration."""
EXOGENOUS = 7
ATMOSPHERE_PA = 101325.0
TINY_S = 1e-9
MEMORY_ROW = 128
"""Row of the working array at which the memory of the effects begins; above the number of parameters."""


class Times(float):
    """A probe that is a factor on the nominal value."""


HOOKS = (
    "set_point",
    "valve_error",
    "pressure_rate",
    "pressure_reading",
    "pressure_true",
    "actuator_pressure",
    "torque",
    "damping",
    "dry",
    "moved",
    "angle_reading",
    "force_reading",
)

FAST = {"contract", "nnan", "nsz", "arcp"}
"""What the chain's arithmetic may do: contract, ignore NaN and signed zeros, multiply by a reciprocal."""
inline = njit(forceinline=True, fastmath=FAST, error_model="numpy")
"""Equations of effects are compiled into the chain."""


@inline
def sine_cosine(x):  # type: ignore[no-untyped-def]
    """Sine and cosine of |x| <= 2.5 rad to 1e-4, as polynomials that a compiler can vectorise."""
    q = x * x
    s = x * (1.0 - q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0 * (1.0 - q / 110.0)))))
    c = 1.0 - q / 2.0 * (1.0 - q / 12.0 * (1.0 - q / 30.0 * (1.0 - q / 56.0 * (1.0 - q / 90.0 * (1.0 - q / 132.0)))))
    return s, c


@inline
def decay(x):  # type: ignore[no-untyped-def]
    """exp(-x) for x >= 0 to 5e-6, so that a compiler can vectorise it: by the series of an eighth."""
    y = 0.125 * x
    root = 1.0 / (1.0 + y * (1.0 + y * (0.5 + y * (1.0 / 6.0 + y * (1.0 / 24.0 + y / 120.0)))))
    square = root * root
    return (square * square) * (square * square)


@inline
def followed(y, before, now, tau, h):  # type: ignore[no-untyped-def]
    """A first-order lag after h [s] in which its input went straight from before to now; exact."""
    behind = tau * (now - before) / h
    return now - behind + (y - before + behind) * decay(h / (tau + TINY_S))


@inline
def followed_twice(w, i, rows, now, tau, share, h):  # type: ignore[no-untyped-def]
    """Two lags in series, of which the second has a share of tau; rows: of the last input, of the first, of both."""
    before, between, last = rows
    second = share * tau
    first = followed(w[between, i], w[before, i], now, tau - second, h)
    w[last, i] = followed(w[last, i], w[between, i], first, second, h)
    w[before, i], w[between, i] = now, first
    return w[last, i]


@inline
def loop_growth(z, toward, sharp):  # type: ignore[no-untyped-def]
    """Growth of a loop z (-1 ... 1) per motion over its scale: Dahl's, or Bouc and Wen's with a knee (sharp 1)."""
    a = z * toward
    forward = max(a, 0.0)
    return 1.0 - (1.0 - sharp) * a - sharp * forward * forward


@inline
def loop_torque(z, omega, scale, sharp):  # type: ignore[no-untyped-def]
    """Share of its height by which a loop pushes, and its stiffness [1/rad]."""
    toward = min(max(omega * 1e6, -1.0), 1.0)
    return -z, loop_growth(z, toward, sharp) / scale


@inline
def loop_moved(z, before, after, scale, sharp):  # type: ignore[no-untyped-def]
    """A loop after a motion [rad], its growth taken implicitly (linearised)."""
    way = abs(after - before) / scale
    toward = 1.0 if after > before else -1.0
    a = z * toward
    slower = (1.0 - sharp) + 2.0 * sharp * max(a, 0.0)
    return toward * min(a + way * loop_growth(z, toward, sharp) / (1.0 + way * slower), 1.0)


@dataclass(frozen=True, slots=True)
class Effect:
    """One entry of the catalogue.

    keys: the parameters that a fit may move, own ones and numbers of the plain plant.
    probes: starting points of a search, each a value per key in the key's unit, or Times(factor) of the nominal one.
    spread: for a number of the plain plant, the standard deviation of its logarithm that the effect may bring; 0.7
    where none is given. A parameter with a typical size is spread by that.
    expected: where a thing is expected whose neutral place is out of reach, in the key's unit.
    shape: keys that say where, when or in which form something acts, not how much; a smaller effect has the same.
    says: a sentence with the keys' last parts in braces, in the unit of the key.
    experiments: excitations that show it, the best first.  source: where the equations come from.
    starts: memory rows that begin at the first "angle" or "pressure" instead of 0.
    everywhere: whether it is one cause for the whole hand rather than for a joint.
    """

    name: str
    place: str
    keys: tuple[str, ...]
    probes: tuple[tuple[float, ...], ...]
    says: str
    experiments: tuple[str, ...]
    doc: str
    source: str
    hooks: dict[str, Callable[..., Any]] = field(default_factory=dict)
    spread: dict[str, float] = field(default_factory=dict)
    expected: dict[str, float] = field(default_factory=dict)
    shape: tuple[str, ...] = ()
    starts: tuple[tuple[int, str], ...] = ()
    everywhere: bool = False


_parameters: list[Parameter] = []
_memory = 0


def declare(*parameters: Parameter) -> tuple[int, ...]:
    """Take up parameters of an effect; returns their rows."""
    first = len(PLANT_PARAMETERS) + len(_parameters)
    _parameters.extend(parameters)
    return tuple(range(first, first + len(parameters)))


def remember(rows: int = 1) -> int:
    """Take up memory of an effect; returns its first row."""
    global _memory  # noqa: PLW0603 - the one counter of the catalogue, counted once at import
    _memory += rows
    return MEMORY_ROW + _memory - rows


CREPT = remember()
"""Row in which the chain puts the angle to which the material has crept, A phi_max of Eq. 11 [rad], before torques."""


def declared() -> tuple[tuple[Parameter, ...], int]:
    """All parameters taken up, and the number of memory rows."""
    return tuple(_parameters), _memory
