"""An enabled controller on a plant with the noise of the sensors, in virtual time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hand_control.controller import Controller, Times
from hand_control.declared import Settings
from hand_model.arrays import Array
from hand_model.description import load_hand
from hand_sim.plant import OMEGA, PHI, HandPlant, P

CONFIG = Path(__file__).parents[2] / "config"
HAND = load_hand(CONFIG / "hand.yaml")
COUNT = len(HAND.joints)
INDEX = HAND.joints.index("index_proximal")
STEP_NS = 5_000_000
STEP_S = 0.005
RATE = 3.0  # N m/s, the default
NOISE_RAD, NOISE_PA = 1e-4, 100.0


class Rig:
    """An enabled controller on a plant, with the noise of the sensors."""

    def __init__(self, seed: int = 0, **values: Any) -> None:
        self.values = values
        self.controller = Controller(HAND, Settings.of(HAND, values))
        self.plant = HandPlant(HAND, STEP_S)
        self.rng = np.random.default_rng(seed)
        self.now_ns = 0
        self.pressures: list[Array] = []
        self.references: list[Array] = []
        self.tick: Any = None
        self.controller.enable(True)
        self.run(0.2)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.now_ns += STEP_NS
            state = self.plant.state
            angle = state[PHI] + NOISE_RAD * self.rng.standard_normal(COUNT)
            pressure = state[P] + NOISE_PA * self.rng.standard_normal(COUNT)
            self.tick = self.controller.frame(Times(*3 * [self.now_ns]), angle, state[OMEGA].copy(), pressure)
            self.pressures.append(self.tick.pressure_command.copy())
            self.references.append(self.tick.reference.copy())
            self.plant.advance(self.pressures[-1][None])

    def mode(self, mode: str) -> None:
        self.values["control_mode"] = mode
        self.controller.configure(Settings.of(HAND, self.values))

    def command(self, names: list[str], position: list[float], effort: list[float] | None = None) -> None:
        self.controller.command(self.now(), names, position, effort or [])

    def now(self) -> Times:
        return Times(0, self.now_ns, self.now_ns)

    def commands(self) -> Any:
        return next(h for h in self.controller.health(self.now_ns) if h.name == "commands")

    def degrees(self) -> Array:
        angles: Array = np.degrees(self.plant.state[PHI])
        return angles
