"""Rows of the trial plant's parameters: the plain joint, and every concealed effect, 0 where it is absent."""

from __future__ import annotations

PLAIN = (
    "delay", "lag", "fill", "vent", "a0", "a1", "a2", "a3", "reach", "p_min", "b1", "t_ext", "b0", "t_rec",
    "inertia", "drag", "coupling", "low", "high", "stop_k", "stop_d", "supply", "lever",
)  # fmt: skip
EFFECTS = (
    "droop", "droop_share", "lag_more", "delay_more", "band", "choke", "bouc_valve", "leak", "tube", "volume",
    "mode_1", "mode_2", "loop", "loop_scale", "expo", "age", "warm", "warm_tau", "lugre", "breakaway", "square_drag",
    "gap", "stop_at", "stop_soft", "weight", "weight_phase", "mass", "tendon", "wall_at", "wall_k", "wall_plain",
    "load", "eccentric", "eccentric_phase", "gain", "offset", "late", "p_gain", "p_offset",
    "shake", "shake_hz", "ripple", "wander", "chatter", "switch", "force_gain", "force_creep", "force_loop",
)  # fmt: skip
NAMES = (*PLAIN, *EFFECTS)
ROW = {name: index for index, name in enumerate(NAMES)}
