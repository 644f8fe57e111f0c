"""The class of an effect: what is certain about its physics, apart from the constitutive function (its law).

A class says what the effect acts on, its sign, whether it is passive, how its law rises or falls, what it remembers,
and on which states its law may depend. The law is the textbook form by default. Some classes have coefficients that
bend it; with their neutral values the textbook form remains, to the last bit. Bounds and basis functions enforce the
constraints: increments that cannot be negative keep a law monotone, non-negative weights keep a spectrum passive.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

STATES = {
    "angle": "rad",
    "angle difference": "rad",
    "speed": "rad_per_s",
    "pressure": "pa",
    "set-point": "pa",
    "pressure error": "pa",
    "pressure difference": "pa",
    "time": "s",
    "travel": "rad",
    "inflow": "pa_per_s",
    "force": "n",
    "direction": "",
    "acceleration": "",
    "state of the loop": "",
}
"""States that a law may depend on, and the ending of a key (quantities.py) that is the SI unit of each."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Constitution:
    """What is certain about an effect.

    acts_on: the quantity that the effect changes.  sign, monotone: in words.  passive: whether it cannot give energy;
    None where energy is not concerned.  memory: in words.  over: states (STATES) that the law may depend on, the one
    of the plotted axis first.  source: textbook, paper or standard from which the constraints come.
    coefficients: keys that a learned law sets free in addition to the keys of the effect, in the order of its table.
    needs: what a machine must have for a coefficient to mean something, by the coefficient's key, keys of effect.NEEDS.
    quantity, unit: name of what the law gives, a template of quantities.Wording.sentence, and the ending of a key that
    is its SI unit.
    curve: (q, x, y) -> value [SI] of the law at the value x of the first state and y of the second one, [SI]; q as the
    equations of the effect get it. None where the class has no learned law.
    travel: (q, angle [rad]) -> size of the law [-] relative to that of `curve`, where it may change over the travel.
    """

    acts_on: str
    sign: str
    monotone: str
    source: str
    over: tuple[str, ...]
    passive: bool | None = None
    memory: str = "none"
    coefficients: tuple[str, ...] = ()
    needs: Mapping[str, str] = field(default_factory=dict)
    quantity: str = ""
    unit: str = ""
    curve: Callable[[tuple[float, ...], float, float], float] | None = None
    travel: Callable[[tuple[float, ...], float], float] | None = None

    def __post_init__(self) -> None:
        """Refuse an incomplete statement with ValueError."""
        for text in ("acts_on", "sign", "monotone", "source", "memory"):
            if not getattr(self, text):
                raise ValueError(f"class: {text} is empty")
        for state in self.over:
            if state not in STATES:
                raise ValueError(f"class: the state is '{state}'; it must be one of {', '.join(STATES)}")
        if bool(self.coefficients) != (self.curve is not None) or (self.curve is not None and not self.quantity):
            raise ValueError("class: coefficients, curve and quantity must be given together")
