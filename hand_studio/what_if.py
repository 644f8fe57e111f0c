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
from hand_model.kernel.rows import ROW
from hand_studio.choices import CHOICES, PARAMETERS, slider_label, slider_range

ALL = "all joints"
STEPS = 200


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

    def begin_with(self, base: Array) -> None:
        """Use other parameters (rows, joints), SI, which Reset restores from now on."""
        self._base = base.copy()
        self._restore()

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
                step, about = (high - low) / STEPS, f"{key} of the model's file: {PARAMETERS[key].doc}"
                slider = self._gui.add_slider(slider_label(self._effect.value, key), low, high, step, value, hint=about)
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
