"""A hand's description with some of a joint's numbers replaced: the YAML that load_hand reads back."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from hand_model.description import Hand, load_hand
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW

Changes = Mapping[str, Mapping[str, float]]
"""Values by joint (with its prefix) and key, SI."""


def write_model(hand: Hand, changes: Changes, out: Path, comment: str) -> Hand:
    """Write the description with the changes to `out` and load it back. DescriptionError where it would not load.

    A rescaling that Eq. 12 does not notice keeps the creeping ratio within 0 ... 1 (A and phi_max share a scale).
    """
    document: dict[str, Any] = yaml.safe_load(hand.path.read_text(encoding="utf-8"))
    entries = {hand.prefix + entry["name"]: entry for entry in document["joints"]}
    for joint, values in changes.items():
        index = hand.joints.index(joint)
        full = {key: float(hand.parameters[ROW[key], index]) for key in ROW} | dict(values)
        for key, value in _consistent(full, values).items():
            group, _, name = key.partition(".")
            if group == "supply":
                document["supply"][name] = value
                continue
            entries[joint].setdefault(group, {})[name] = value / JOINT_PARAMETERS[ROW[key]].scale
        _share_coupling(hand, entries, joint, values)
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120)
    out.parent.mkdir(parents=True, exist_ok=True)
    lines = "".join(f"# {line}\n" for line in comment.splitlines())
    out.write_text(lines + text, encoding="utf-8")
    return load_hand(out)


def _consistent(full: Mapping[str, float], values: Mapping[str, float]) -> dict[str, float]:
    """The changes, with creep rescaled where A would pass 1 at supply pressure or extend below its recovery line."""
    changed = dict(values)
    if not any(key.startswith("material.") for key in values):
        return changed
    b0, b1 = full["material.b0_per_pa"], full["material.b1_per_pa"]
    span = full["supply.pressure_pa"] - full["material.p_min_pa"]
    scale = min(1.0, (1.0 - 1e-12) / (b1 * span))
    changed["material.b1_per_pa"] = b1 * scale
    changed["material.b0_per_pa"] = max(b0, b1) * scale
    changed["material.phi_max_deg"] = full["material.phi_max_deg"] / scale
    return changed


def _share_coupling(hand: Hand, entries: Mapping[str, Any], joint: str, values: Mapping[str, float]) -> None:
    """Both phalanges of a finger name the same coupling inertia."""
    key = "dynamics.coupling_inertia_kg_m2"
    partner = int(hand.partner[hand.joints.index(joint)])
    if key in values and partner >= 0:
        entries[hand.joints[partner]].setdefault("dynamics", {})["coupling_inertia_kg_m2"] = values[key]
