"""The hand's constants as a user's file gives them, read with a YAML library alone."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from validation.trial.arrays import Array
from validation.trial.plant import NAMES, ROW

DEGREE = np.pi / 180.0
KEYS: dict[str, tuple[str, str, float]] = {
    "delay": ("valve", "dead_time_s", 1.0),
    "lag": ("valve", "time_constant_s", 1.0),
    "fill": ("valve", "fill_rate_pa_per_s", 1.0),
    "vent": ("valve", "vent_rate_pa_per_s", 1.0),
    "a0": ("statics", "a0_nm", 1.0),
    "a1": ("statics", "a1_nm_per_rad", 1.0),
    "a2": ("statics", "a2_nm_per_pa", 1.0),
    "a3": ("statics", "a3_nm_per_pa_rad", 1.0),
    "reach": ("material", "phi_max_deg", DEGREE),
    "p_min": ("material", "p_min_pa", 1.0),
    "b1": ("material", "b1_per_pa", 1.0),
    "t_ext": ("material", "extension_time_s", 1.0),
    "b0": ("material", "b0_per_pa", 1.0),
    "t_rec": ("material", "recovery_time_s", 1.0),
    "inertia": ("dynamics", "inertia_kg_m2", 1.0),
    "drag": ("dynamics", "viscous_friction_nm_s_per_rad", 1.0),
    "coupling": ("dynamics", "coupling_inertia_kg_m2", 1.0),
    "low": ("end_stop", "low_deg", DEGREE),
    "high": ("end_stop", "high_deg", DEGREE),
    "stop_k": ("end_stop", "stiffness_nm_per_rad", 1.0),
    "stop_d": ("end_stop", "damping_nm_s_per_rad", 1.0),
}
UNCERTAIN = ("lag", "a0", "a1", "a2", "a3", "reach", "t_ext", "t_rec", "inertia", "drag")
"""Rows whose nominal values are wrong by a few percent."""


class Nominal:
    """A hand.yaml as the trial reads it: joints, columns of partners and neighbours, parameters (rows, joints)."""

    def __init__(self, path: Path) -> None:
        """Read a hand.yaml. KeyError for a missing key."""
        self.data: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
        self.joints: list[str] = [joint["name"] for joint in self.data["joints"]]
        self.partner = np.array(
            [self.joints.index(j["coupled_to"]) if "coupled_to" in j else -1 for j in self.data["joints"]]
        )
        count = len(self.joints)
        self.neighbour = np.where(self.partner >= 0, self.partner, np.maximum(np.arange(count) - 1, 0))
        self.rows = np.zeros((len(NAMES), count))
        for name, (group, key, unit) in KEYS.items():
            for j in range(count):
                self.rows[ROW[name], j] = float(self.value(j, group, key)) * unit
        self.pads = [self._pad(joint) for joint in self.joints]
        self.rows[ROW["lever"]] = [self._lever_m(joint) for joint in self.joints]
        self.rows[ROW["supply"]] = float(self.data["supply"]["pressure_pa"])
        self.rows[ROW["stop_at"]] = self.rows[ROW["wall_at"]] = 99.0
        self.rows[ROW["warm_tau"]], self.rows[ROW["loop_scale"]] = 100.0, 0.1

    def _pad(self, joint: str) -> str:
        """Name of the force sensor on a joint; empty for none."""
        return next((site["name"] for site in self.data["force_sites"] if site.get("joint") == joint), "")

    def _lever_m(self, joint: str) -> float:
        usual = float(self.data["force_site_defaults"]["lever_arm_m"])
        sites = (site for site in self.data["force_sites"] if site.get("joint") == joint)
        site: dict[str, Any] = next(sites, {})
        return float(site.get("lever_arm_m", usual))

    def value(self, joint: int, group: str, key: str) -> Any:
        """Value of a key for a joint: its own, else that of joint_defaults, else 0."""
        own = self.data["joints"][joint].get(group, {})
        return own.get(key, self.data["joint_defaults"].get(group, {}).get(key, 0.0))

    def write(self, rows: Array, path: Path, rate_hz: float, extra: dict[int, dict[str, Any]]) -> None:
        """Write a hand.yaml with other rows (rows, joints), SI; extra: further groups of single joints."""
        data = copy.deepcopy(self.data)
        data["board"]["rate_hz"] = rate_hz
        for j, joint in enumerate(data["joints"]):
            for name, (group, key, unit) in KEYS.items():
                joint.setdefault(group, {})[key] = float(rows[ROW[name], j] / unit)
            for group, values in extra.get(j, {}).items():
                joint.setdefault(group, {}).update(values)
        path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
