"""The end of the demo: an effect that nobody chose is concealed in a recording, and `hand diagnose` looks for it.

The effect, its size and its joint are drawn from a seed. They stay in this process: the diagnosis is another one, and
gets the recording and the model without the effect.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hand_diagnosis.pages.headline import effect_words
from hand_identification.excitation import EXPERIMENTS
from hand_model.description import Hand
from hand_model.kernel.rows import ROW
from hand_model.quantities import HAND, unit_words
from hand_recording.replay import record_offline
from hand_robot.urdf import description_text
from hand_tool.processes import ProcessError

CONCEALED = {
    "coulomb_friction.torque_nm": (0.006, 0.014),
    "backlash.gap_deg": (1.5, 3.0),
    "tube_lag.time_constant_s": (0.03, 0.08),
    "valve_hysteresis.width_pa": (5e3, 1.2e4),
    "stiffening.cubic_nm_per_rad3": (0.01, 0.03),
}
"""Parameter that makes an effect act, with the range of its size in the unit of its name."""
SECONDS, HIGHEST_PA = 12.0, 4e5
MOTIONS = ("reversals", "steps")
"""Experiments of the first and the second joint of a finger."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What was concealed, and what the diagnosis found.

    key, value: the parameter that was changed, in the unit of its name.  found: effect, joint and probability of each
    finding.  right: whether the first one is the effect in its joint.  errors: test error of the joint's signals before
    and after, and noise floor, each with its unit.  seconds: time of the diagnosis.
    """

    seed: int
    joint: str
    effect: str
    key: str
    value: float
    verdict: str
    found: list[dict[str, Any]]
    right: bool
    errors: list[dict[str, Any]]
    seconds: float

    def as_json(self) -> dict[str, Any]:
        """The outcome for summary.json."""
        return asdict(self)

    @property
    def concealed(self) -> str:
        """What was concealed, in a few words."""
        unit = HAND.units.quantity(self.key).unit
        factor, unit = (1e-3, "kPa") if unit == "Pa" else (1.0, unit)
        return f"{effect_words(self.effect)} of {factor * self.value:.3g} {unit_words(unit)} in {self.joint}"

    @property
    def shown_errors(self) -> list[tuple[str, ...]]:
        """A row for each signal of the joint: signal, test error before and after, noise and unit."""
        keys = ("rmse_before", "rmse_after", "noise_floor")
        return [(row["signal"], *(f"{row[key]:.3g}" for key in keys), row["unit"]) for row in self.errors]

    @property
    def answer(self) -> str:
        """The first finding with its probability, and whether it is right."""
        if not self.found:
            return f"nothing that has a name ({self.verdict}); wrong"
        first = self.found[0]
        where = first["joint"] or "the whole hand"
        name, right = effect_words(first["effect"]), "right" if self.right else "wrong"
        return f"{name} ({first['probability']:.0%}) in {where}; {right}"


def conceal_and_diagnose(hand: Hand, model: Path, folder: Path, seed: int) -> Outcome:
    """Draw an effect, record a motion of one finger that has it, and diagnose the recording.

    model: the description without the effect.  folder: gets recording.mcap and the files of the diagnosis.
    Raises ProcessError where the diagnosis fails.
    """
    rng = np.random.default_rng(seed)
    key = str(rng.choice(sorted(CONCEALED)))
    value = float(rng.uniform(*CONCEALED[key]))
    fingers = sorted({joint.rpartition("_")[0] for joint in hand.joints if joint.endswith("_distal")})
    finger = str(rng.choice(fingers))
    moved = [f"{finger}_proximal", f"{finger}_distal"]
    joint = str(rng.choice(moved))
    recording = folder / "recording.mcap"
    folder.mkdir(parents=True, exist_ok=True)
    recording.unlink(missing_ok=True)
    truth, commands = _with(hand, key, joint, value), _set_points(hand, moved, rng)
    for _ in record_offline(truth, commands, recording, seed, urdf=description_text(hand)):
        pass
    begun = time.monotonic()
    report = _diagnose(recording, model, folder, moved)
    found = [{name: finding[name] for name in ("effect", "joint", "probability")} for finding in report["findings"]]
    effect = key.partition(".")[0]
    return Outcome(
        seed=seed,
        joint=joint,
        effect=effect,
        key=key,
        value=value,
        verdict=report["verdict"],
        found=found,
        right=bool(found) and (found[0]["effect"], found[0]["joint"]) == (effect, joint),
        errors=[row for row in report["fit"] if row["split"] == "test" and row["joint"] == joint],
        seconds=time.monotonic() - begun,
    )


def _with(hand: Hand, key: str, joint: str, value: float) -> Hand:
    """The hand with one number changed; value in the unit of the key's name."""
    parameters = hand.parameters.copy()
    parameters[ROW[key], hand.joints.index(joint)] = np.radians(value) if key.endswith("_deg") else value
    return replace(hand, parameters=parameters)


def _set_points(hand: Hand, moved: list[str], rng: np.random.Generator) -> np.ndarray:
    """Set-points (T, joints) [Pa] that move one finger."""
    time_s = np.arange(0.0, SECONDS, 1.0 / hand.rate_hz)
    commands = np.zeros((len(time_s), len(hand.joints)))
    for joint, motion in zip(moved, MOTIONS, strict=True):
        commands[:, hand.joints.index(joint)] = HIGHEST_PA * np.clip(EXPERIMENTS[motion](time_s, rng), 0.0, 1.0)
    return commands


def _diagnose(recording: Path, model: Path, folder: Path, joints: list[str]) -> dict[str, Any]:
    """report.json of `hand diagnose` in a process of its own."""
    command = [sys.executable, "-m", "hand_tool", "diagnose", str(recording), "--model", str(model), "--quiet"]
    ran = subprocess.run(
        [*command, "--joints", ",".join(joints), "--out", str(folder)], capture_output=True, text=True, check=False
    )
    if ran.returncode != 0:
        raise ProcessError(f"hand diagnose ended with code {ran.returncode}: {ran.stderr.strip()}")
    report: dict[str, Any] = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    return report
