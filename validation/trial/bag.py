"""Recordings of the trial as rosbag2 MCAP with the messages of the hand, written by rosbags.

`hand record` uses another writer, so the diagnosis reads files that its own package did not write.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from validation.trial.arrays import Array, Flags

LIFETIME_NS = 100_000_000
START_NS = 1_760_000_000_000_000_000
_TYPES = ("JointPressures", "ContactForces", "ValveCommand")


def _definitions() -> Path:
    for folder in Path(__file__).resolve().parents:
        for candidate in (folder / "hand_msgs" / "msg", folder / "share" / "hand_msgs" / "msg"):
            if candidate.is_dir():
                return candidate
        installed = sorted(folder.glob("*/share/hand_msgs/msg"))
        if installed:
            return installed[0]
    raise FileNotFoundError("hand_msgs/msg: the message definitions are missing")


def _store() -> Any:
    store = get_typestore(Stores.ROS2_JAZZY)
    for name in _TYPES:
        text = (_definitions() / f"{name}.msg").read_text(encoding="utf-8")
        store.register(get_types_from_msg(text, f"hand_msgs/msg/{name}"))
    return store


def write_bag(
    path: Path,
    joints: list[str],
    readings: Array,
    u: Array,
    frame_s: float,
    *,
    site: tuple[int, str] | None,
    kept: Flags,
    pressure_late_s: float,
    sent: Flags | None = None,
    jitter_s: Array | None = None,
) -> None:
    """Write one .mcap file.

    readings: (4, frames, joints) of pressure [Pa], angle [rad], speed [rad/s], force [N].  u: set-points (frames,
    joints) [Pa].  site: column and name of a force sensor, None for none.  kept: (frames,), False for lost frames.
    sent: (frames,), frames with a set-point, all where None.  jitter_s: (frames,) added to the stamps of measurements.
    pressure_late_s: offset of the pressures' stamps.  FileNotFoundError: no message definitions.
    """
    store = _store()
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    duration = store.types["builtin_interfaces/msg/Duration"]
    empty = np.zeros(0)

    def head(ns: int) -> Any:
        return header(stamp(*divmod(ns, 1_000_000_000)), "hand")

    folder = path.with_suffix(".bag")
    shutil.rmtree(folder, ignore_errors=True)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        names = {
            "joint_states": "sensor_msgs/msg/JointState",
            "pressures": "hand_msgs/msg/JointPressures",
            "contact_forces": "hand_msgs/msg/ContactForces",
            "valve_command": "hand_msgs/msg/ValveCommand",
        }
        topics = {t: writer.add_connection(f"/hand/{t}", kind, typestore=store) for t, kind in names.items()}

        def put(topic: str, ns: int, **fields: Any) -> None:
            message = store.types[names[topic]](**fields)
            writer.write(topics[topic], ns, store.serialize_cdr(message, names[topic]))

        for k in range(len(u)):
            now = START_NS + round(k * frame_s * 1e9)
            before = now - round(0.8e9 * frame_s)
            if sent is None or sent[k]:
                lasts = duration(0, LIFETIME_NS)
                put("valve_command", before, header=head(before), lifetime=lasts, name=joints, pressure=u[k])
            if not kept[k]:
                continue
            if jitter_s is not None:
                now += round(jitter_s[k] * 1e9)
            pressure, angle, speed, force = readings[:, k]
            put(
                "joint_states",
                now + 200_000,
                header=head(now),
                name=joints,
                position=angle,
                velocity=speed,
                effort=empty,
            )
            late = now + round(pressure_late_s * 1e9)
            put("pressures", now + 300_000, header=head(late), name=joints, pressure=pressure)
            if site is not None:
                put("contact_forces", now + 300_000, header=head(now), name=[site[1]], force=force[[site[0]]])
    shutil.move(next(folder.glob("*.mcap")), path)
    shutil.rmtree(folder)
