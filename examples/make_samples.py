"""Make the sample recordings of this folder again: python examples/make_samples.py [FOLDER]

The index finger moves by the experiments `reversals` and `steps` at once, once by the described hand and once by a hand
with an effect that its description lacks. The slide is a mass on a spring and damper that rubs.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from hand_identification.excitation import EXPERIMENTS
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.kernel.rows import ROW
from hand_recording.loader import load_recording
from hand_recording.replay import record_offline

HERE = Path(__file__).resolve().parent
JOINTS = ("index_proximal", "index_distal")
SECONDS, SEED = 16.0, 20
CONCEALED = {"coulomb_friction.torque_nm": 0.012}
"""The effect of index_distal in index_concealed.csv, SI."""
SLIDE_FRICTION_N = 0.5


def finger(truth: Hand, folder: Path) -> Array:
    """Time [s], then set-point [bar], pressure [bar] and angle [deg] of each joint, (T, 7)."""
    time_s = np.arange(0.0, SECONDS, 1.0 / truth.rate_hz)
    rng = np.random.default_rng(SEED)
    commands = np.zeros((len(time_s), len(truth.joints)))
    for name, shape in zip(JOINTS, ("reversals", "steps"), strict=True):
        commands[:, truth.joints.index(name)] = 4e5 * np.clip(EXPERIMENTS[shape](time_s, rng), 0.0, 1.0)
    path = folder / "finger.mcap"
    path.unlink(missing_ok=True)
    for _ in record_offline(truth, commands, path, seed=SEED):
        pass
    base = load_recording(path).on_time_base(joints=JOINTS)
    parts = [base.time_s[:, None]]
    for k in range(len(JOINTS)):
        scaled = (1e-5 * base.valve_command[:, k], 1e-5 * base.pressure[:, k], np.degrees(base.position[:, k]))
        parts.append(np.stack(scaled, axis=1))
    rows = np.concatenate(parts, axis=1)
    known: Array = rows[np.isfinite(rows).all(axis=1)]
    return known


def slide() -> Array:
    """Time [s], force [N] and position [mm] of the slide, (T, 3); 0.2 kg, 40 N/m, 1 N s/m."""
    step_s, every = 5e-4, 10
    time_s = np.arange(0.0, 15.0, step_s)
    rng = np.random.default_rng(SEED)
    knots = np.arange(0.0, 16.0, 1.0)
    force = np.interp(time_s, knots, rng.uniform(-3.0, 3.0, len(knots)))
    x = v = 0.0
    position = np.empty_like(time_s)
    for k, driving in enumerate(force):
        position[k] = x
        free = v + step_s / 0.2 * (driving - 40.0 * x - 1.0 * v)
        stop = step_s / 0.2 * SLIDE_FRICTION_N
        v = float(np.sign(free) * max(abs(free) - stop, 0.0))
        x += step_s * v
    noisy = 1e3 * position[::every] + 0.02 * rng.standard_normal(len(position[::every]))
    return np.column_stack([time_s[::every], force[::every], noisy])


def main(out: Path) -> None:
    """Write every sample below a folder."""
    hand = load_hand(HERE.parent / "config" / "hand.yaml")
    parameters = hand.parameters.copy()
    for key, value in CONCEALED.items():
        parameters[ROW[key], hand.joints.index("index_distal")] = value
    head = "time_s," + ",".join(f"{name}_{what}" for name in JOINTS for what in ("set_bar", "bar", "deg"))
    for folder in ("recordings", "machine"):
        (out / folder).mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as scratch:
        for name, truth in (("plain", hand), ("concealed", replace(hand, parameters=parameters))):
            rows = finger(truth, Path(scratch))
            path = out / "recordings" / f"index_{name}.csv"
            np.savetxt(path, rows, delimiter=",", header=head, comments="", fmt="%.5g")
    np.savetxt(
        out / "machine" / "slide.csv", slide(), delimiter=",", header="t_s,force_N,x_mm", comments="", fmt="%.5g"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
