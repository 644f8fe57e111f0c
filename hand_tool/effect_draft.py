"""The draft of an effect from the law of a remainder in a report.json."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

HOOKS = {
    "unnamed_torque": ("torque", "q, phi, omega, p, creep_angle, e", "torque of the joint"),
    "unnamed_pressure": ("set_point", "q, u, p, e, h", "set-point of the valve"),
}
"""Hook, its arguments and what it changes, by the effect that carried the law."""
STATES = {
    "depends_on_angle": "angle",
    "depends_on_speed": "speed",
    "depends_on_pressure": "pressure",
    "depends_on_set_point": "set-point",
    "drifts_with_time": "time",
    "depends_on_another_joint": "angle of another joint",
    "periodic_in_time": "time",
    "periodic_in_angle": "angle",
}
EXPRESSIONS = {
    "torque": {"angle": "phi", "speed": "omega", "pressure": "p"},
    "set_point": {"angle": "e[ANGLE]", "pressure": "p", "set-point": "u"},
}
SI = ("N m", "Pa")
EVERY = 3
"""Every third point of the curve becomes a knot."""


def drafted(report: Path, joint: str) -> dict[str, str]:
    """The fields of the template for the law of the first remainder that has one, of a joint where one is given.

    Raises ValueError, one line, where the file is no report or holds no such law.
    """
    left = _remainder(report, joint)
    law, state = left["law"], STATES[left["family"]]
    hook, arguments, acts_on = HOOKS[law["effect"]]
    if law["unit"] not in SI:
        raise ValueError(f"{report}: the law is in {law['unit']}; a draft is made from a report about a hand")
    shared = {"time": "e[TIME]", "angle of another joint": "e[NEIGHBOUR]"}
    x = (EXPRESSIONS[hook] | shared)[state]
    points = [(float(row[0]), float(row[1])) for row in law["points"]]
    lines = _harmonic(points, x) if left["family"].startswith("periodic") else _curve(points, x)
    slope = "-share * rise" if x == "phi" else "0.0"
    lines.append(f"return share * value, {slope}" if hook == "torque" else "return u + share * value")
    return {
        "DOC": f"{left['joint']}: {law['statement']}.",
        "HOOK": hook,
        "ARGUMENTS": arguments,
        "UNIT": law["unit"],
        "STATE": state,
        "STATE_UNIT": law["over_unit"],
        "EQUATION": "\n".join(f"    {line}" for line in lines),
        "PLACE": left["place"],
        "OTHERS": str("NEIGHBOUR" in x),
        "ACTS": acts_on,
        "OVER": "angle" if state == "angle of another joint" else state,
    }


def _remainder(report: Path, joint: str) -> dict[str, Any]:
    try:
        content = json.loads(report.read_text(encoding="utf-8"))
        rows = [row for row in content["remainder"] if row["law"]]
    except (OSError, ValueError, KeyError, TypeError) as error:
        reason = " ".join(str(error).split())
        raise ValueError(f"--from is '{report}', which is no report.json of hand diagnose: {reason}") from None
    for row in rows:
        if joint in ("", row["joint"]):
            return dict(row)
    of = f" of {joint}" if joint else ""
    having = ", ".join(str(row["joint"]) for row in rows) or "none"
    raise ValueError(f"--from is '{report}': no remainder{of} has a law; joints with one: {having}")


def _curve(points: list[tuple[float, float]], x: str) -> list[str]:
    """Source of the linear spline through every third point: `value`, and `rise` per unit of the state."""
    knots = points[::EVERY]
    low, last = knots[0][0], len(knots) - 1
    per = last / (knots[-1][0] - low)
    lines = [f"at = min(max({per:.6g} * ({x} - {low:.6g}), 0.0), {last}.0)", "value, rise = 0.0, 0.0"]
    lines += [f"value, rise = knot({y:.4g}, at - {k}.0, value, rise)" for k, (_, y) in enumerate(knots)]
    return [*lines, f"rise *= {per:.6g} if 0.0 < at < {last}.0 else 0.0"]


def _harmonic(points: list[tuple[float, float]], x: str) -> list[str]:
    """Source of the harmonic through points over one turn, the last of which is the first again."""
    rate, once = 2.0 * math.pi / (points[-1][0] - points[0][0]), points[:-1]
    sine = 2.0 * sum(y * math.sin(rate * at) for at, y in once) / len(once)
    cosine = 2.0 * sum(y * math.cos(rate * at) for at, y in once) / len(once)
    return [
        f"s, c = sine_cosine({rate:.6g} * {x})",
        f"value, rise = {sine:.4g} * s + {cosine:.4g} * c, {rate:.6g} * ({sine:.4g} * c - {cosine:.4g} * s)",
    ]
