"""A copy of a hand's description with some numbers replaced: the patched model.yaml that load_hand reads back.

The copy keeps the comments, the order and the number formats of the original; only the lines of changed numbers
differ, so that `diff hand.yaml model.yaml` is a patch that can be reviewed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hand_model.description import Hand, load_hand
from hand_model.description_checks import STOP_MARGIN_DEG, least_friction
from hand_model.kernel.plant_rows import DEGREE
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_model.yaml_document import YamlDocument, number_text

Changes = Mapping[str, Mapping[str, float]]
"""Numbers by joint (with its prefix) and key of JOINT_PARAMETERS, SI."""
SAME = 1e-9
"""Relative difference up to which a number counts as unchanged."""
LIMIT_SHARE = 5e-3
"""Share of the angle up to which pressure flexes a joint by which a limit stays below it; numbers are rounded."""
EXACT = 1e-7
"""Relative resolution of a number that follows from others, and the distance that it keeps from its limit."""


def write_model(hand: Hand, changes: Changes, out: Path, comment: str, *, resolutions: Changes | None = None) -> Hand:
    """Write the description of `hand` with the changes to `out`, and load it back.

    comment: lines to put at the top.  resolutions: standard deviation of each changed number while the others keep
    their values, SI; numbers are rounded to a tenth of it (hand_model/yaml_document.py).
    Creep is rescaled by a factor that Eq. 12 does not notice (A and phi_max share a scale), so that the creeping
    ratio stays within 0 ... 1.  Raises DescriptionError where the result would not load, OSError where it cannot be
    written.
    """
    document = YamlDocument(hand.path)
    entries = {hand.prefix + str(entry["name"]): entry for entry in document.data["joints"]}
    for joint, values in changes.items():
        nominal = {key: float(hand.parameters[ROW[key], hand.joints.index(joint)]) for key in ROW}
        texts = _texts(nominal, values, (resolutions or {}).get(joint, {}))
        for key, text in texts.items():
            group, _, name = key.partition(".")
            for entry in _entries_of(hand, entries, joint, key):
                keys = sum(other.startswith(f"{group}.") for other in texts)
                section = document.data["supply"] if group == "supply" else document.group(entry, group, keys)
                document.set_number(section, name, text)
        for name, angle_deg in _reachable(hand, joint, values).items():
            document.set_number(document.group(entries[joint], "limits", 1), name, number_text(angle_deg))
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(document.text(comment), encoding="utf-8")
    return load_hand(out)


def _texts(nominal: Mapping[str, float], values: Mapping[str, float], known: Mapping[str, float]) -> dict[str, str]:
    """The numbers that differ from the nominal ones as they shall stand in the file. known: resolutions, SI."""

    def text(key: str, value: float, resolution: float) -> str:
        scale = JOINT_PARAMETERS[ROW[key]].scale
        return number_text(value / scale, resolution / scale)

    rounded = {
        key: float(text(key, value, known.get(key, math.nan))) * JOINT_PARAMETERS[ROW[key]].scale
        for key, value in values.items()
    }
    wanted = _consistent({**nominal, **rounded}, rounded)
    return {
        key: text(key, value, known.get(key, math.nan) if value == rounded.get(key) else EXACT * abs(value))
        for key, value in wanted.items()
        if not math.isclose(value, nominal[key], rel_tol=SAME)
    }


def _reachable(hand: Hand, joint: str, values: Mapping[str, float]) -> dict[str, float]:
    """Limits [degree] of a joint that must move: to a stop found well inside, or to where pressure still flexes it."""
    column, moved = hand.joints.index(joint), {}
    limits = (("low_deg", hand.limits.low_rad, 1.0), ("high_deg", hand.limits.high_rad, -1.0))
    for name, limit, inward in limits:
        stop = values.get(f"end_stop.{name}")
        if stop is not None and inward * (stop - limit[column]) / DEGREE > 0.9 * STOP_MARGIN_DEG:
            moved[name] = stop / DEGREE
    slope, change = (
        values.get(key, float(hand.parameters[ROW[key], column]))
        for key in ("statics.a2_nm_per_pa", "statics.a3_nm_per_pa_rad")
    )
    if change < 0.0:
        flexing = (1.0 - LIMIT_SHARE) * slope / -change  # beyond -a2/a3, pressure would extend the joint (Eq. 6)
        if moved.get("high_deg", hand.limits.high_rad[column] / DEGREE) > flexing / DEGREE:
            moved["high_deg"] = math.floor(flexing / DEGREE * 10.0) / 10.0
    return moved


def _consistent(full: Mapping[str, float], values: Mapping[str, float]) -> dict[str, float]:
    """The changes, with creep rescaled where A would pass 1 at supply pressure or extend below its recovery line.

    A joint without any friction gets the least that a description allows.
    """
    changed = dict(values)
    inertia, elasticity = full["dynamics.inertia_kg_m2"], full["statics.a1_nm_per_rad"]
    damping = least_friction(inertia, elasticity, full["coulomb_friction.torque_nm"]) * (1.0 + EXACT)
    if full["dynamics.viscous_friction_nm_s_per_rad"] < damping:
        changed["dynamics.viscous_friction_nm_s_per_rad"] = damping
    if not any(key.startswith("material.") for key in values):
        return changed
    b0, b1 = full["material.b0_per_pa"], full["material.b1_per_pa"]
    highest = b1 * (full["supply.pressure_pa"] - full["material.p_min_pa"])
    scale = (1.0 - EXACT) / highest if highest > 1.0 + SAME else 1.0
    changed["material.b1_per_pa"] = b1 * scale
    changed["material.b0_per_pa"] = max(b0, b1) * scale
    changed["material.phi_max_deg"] = full["material.phi_max_deg"] / scale
    return changed


def _entries_of(hand: Hand, entries: Mapping[str, Any], joint: str, key: str) -> list[Any]:
    """The entries of the file that name a number: of the joint, and of its partner where they share an inertia."""
    partner = int(hand.partner[hand.joints.index(joint)])
    if key == "dynamics.coupling_inertia_kg_m2" and partner >= 0:
        return [entries[joint], entries[hand.joints[partner]]]
    return [entries[joint]]
