"""Make the sample recordings of this folder again: python examples/make_samples.py [FOLDER]

The index finger moves by the experiments `reversals` and `steps` at once, once by the described hand and once by a hand
with an effect that its description lacks. The tables have this finger. The MCAP recordings have the whole hand;
they are small, because they are shorter and their board sends BAG_HZ frames a second. The slide is a mass on a spring
and damper that rubs.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from hand_identification.excitation import EXPERIMENTS
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.kernel.rows import ROW
from hand_recording.loader import load_recording
from hand_recording.replay import record_offline
from hand_robot.urdf import description_text

HERE = Path(__file__).resolve().parent
JOINTS = ("index_proximal", "index_distal")
SECONDS, SEED = 16.0, 20
BAG_S, BAG_HZ = 9.0, 100.0
TOPICS = [
    f"/hand/{name}" for name in ("robot_description", "joint_states", "pressures", "contact_forces", "valve_command")
]
"""Of the MCAP recordings."""
CONCEALED = {"coulomb_friction.torque_nm": 0.012}
"""The effect of index_distal in index_concealed.csv, SI."""
SLIDE_FRICTION_N = 0.5


def record(truth: Hand, seconds: float, path: Path, urdf: str) -> None:
    """Record a hand whose finger moves. urdf: of the hand as it is described."""
    time_s = np.arange(0.0, seconds, 1.0 / truth.rate_hz)
    rng = np.random.default_rng(SEED)
    commands = np.zeros((len(time_s), len(truth.joints)))
    for name, shape in zip(JOINTS, ("reversals", "steps"), strict=True):
        commands[:, truth.joints.index(name)] = 4e5 * np.clip(EXPERIMENTS[shape](time_s, rng), 0.0, 1.0)
    for _ in record_offline(truth, commands, path, SEED, urdf=urdf):
        pass


def compress(recording: Path, out: Path) -> None:
    """Copy TOPICS of an MCAP recording with the better compression."""
    with recording.open("rb") as source, out.open("wb") as target:
        writer = Writer(target, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="fluidic_hand")
        channels: dict[int, int] = {}
        for schema, channel, copied in make_reader(source).iter_messages(TOPICS):
            if channel.id not in channels:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, "cdr", kind, channel.metadata)
            writer.add_message(channels[channel.id], copied.log_time, copied.data, copied.publish_time)
        writer.finish()


def table(path: Path) -> Array:
    """Time [s], then set-point [bar], pressure [bar] and angle [deg] of each joint of a recording, (T, 7)."""
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
    urdf = description_text(hand)
    head = "time_s," + ",".join(f"{name}_{what}" for name in JOINTS for what in ("set_bar", "bar", "deg"))
    for folder in ("recordings", "machine"):
        (out / folder).mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as scratch:
        for name, truth in (("plain", hand), ("concealed", replace(hand, parameters=parameters))):
            path = out / "recordings" / f"index_{name}.csv"
            record(truth, SECONDS, Path(scratch) / f"{name}.mcap", urdf)
            record(replace(truth, rate_hz=BAG_HZ), BAG_S, Path(scratch) / f"short_{name}.mcap", urdf)
            compress(Path(scratch) / f"short_{name}.mcap", path.with_suffix(".mcap"))
            np.savetxt(path, table(Path(scratch) / f"{name}.mcap"), delimiter=",", header=head, comments="", fmt="%.5g")
    np.savetxt(
        out / "machine" / "slide.csv", slide(), delimiter=",", header="t_s,force_N,x_mm", comments="", fmt="%.5g"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
