"""What if: sliders for the effects of the catalogue, and the parameters that they give."""

from __future__ import annotations

import threading
from functools import partial
from typing import Any

import numpy as np
import viser

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.effects import EFFECTS
from hand_model.kernel.open_loop import HAND_EFFECTS
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_model.quantities import HAND

ALL = "all joints"
STEPS = 200
PARAMETERS = {parameter.key: parameter for parameter in JOINT_PARAMETERS}
CHOICES = tuple(effect.name for effect in HAND_EFFECTS if effect.keys)
"""Effects that can be tried."""


def slider_range(key: str, base: float) -> tuple[float, float]:
    """From where to where a slider of a parameter goes, in the unit of its key; base: the value that was found [same].

    Up to five typical sizes from the base; a number without a typical size, from a third to three times the base.
    """
    parameter = PARAMETERS[key]
    span = 5.0 * parameter.typical if parameter.typical else 2.0 * abs(base) or 0.1 * (parameter.high - parameter.low)
    low = base - span if parameter.typical or not base else base - 2.0 / 3.0 * abs(base)
    return max(parameter.low, low), min(parameter.high, base + span)


class WhatIf:
    """Adds its controls to the page, at the place where it is made."""

    def __init__(self, gui: viser.GuiApi, hand: Hand, base: Array) -> None:
        """base: parameters (rows, joints), SI, that Reset restores."""
        self._gui, self._hand, self._base = gui, hand, base
        self._lock, self._new = threading.Lock(), False
        self._parameters = base.copy()
        self._effect = gui.add_dropdown("effect", CHOICES, initial_value="constant_load")
        self._joint = gui.add_dropdown("at", (ALL, *hand.joints))
        self._folder = gui.add_folder("What if")
        self._sliders: dict[str, Any] = {}
        self._reset = gui.add_button("Reset to what was found")
        for choice in (self._effect, self._joint):
            choice.on_update(lambda _: self._show_sliders())
        self._reset.on_click(lambda _: self._restore())
        self._show_sliders()

    def take(self) -> Array | None:
        """The parameters (rows, joints), SI, where they have changed since the last call."""
        with self._lock:
            new, self._new = self._new, False
            return self._parameters.copy() if new else None

    def _joints(self) -> list[int]:
        chosen = self._joint.value
        return list(range(len(self._hand.joints))) if chosen == ALL else [self._hand.joints.index(chosen)]

    def _show_sliders(self) -> None:
        for slider in self._sliders.values():
            slider.remove()
        self._sliders = {}
        joint = self._joints()[0]
        with self._folder:
            for key in EFFECTS[self._effect.value].keys:
                scale, row = PARAMETERS[key].scale, ROW[key]
                low, high = slider_range(key, float(self._base[row, joint]) / scale)
                value = float(np.clip(self._parameters[row, joint] / scale, low, high))
                unit = HAND.units.quantity(key).unit
                label = key.partition(".")[2]
                slider = self._gui.add_slider(label, low, high, (high - low) / STEPS, value, hint=f"{key} [{unit}]")
                slider.on_update(partial(self._set, key))
                self._sliders[key] = slider

    def _set(self, key: str, event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
        with self._lock:
            self._parameters[ROW[key], self._joints()] = float(event.target.value) * PARAMETERS[key].scale
            self._new = True

    def _restore(self) -> None:
        with self._lock:
            self._parameters, self._new = self._base.copy(), True
        self._show_sliders()
