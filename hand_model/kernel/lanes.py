"""Joints to lanes: the layout of the closed loop's arrays.

A block is LANES = 16 joints wide, so that the compiler fills vector registers. Coupled phalanges are in lanes l and
l + 8 of one block; joints without a partner take the remaining lanes. Unused lanes hold a joint that stays at rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW

LANES = 16
HALF = LANES // 2
_IDLE = {
    "valve.time_constant_s": 1.0,
    "valve.fill_rate_pa_per_s": 1e9,
    "valve.vent_rate_pa_per_s": 1e9,
    "statics.a1_nm_per_rad": -1.0,
    "statics.a2_nm_per_pa": 1e-6,
    "dynamics.inertia_kg_m2": 1.0,
    "dynamics.viscous_friction_nm_s_per_rad": 1.0,
    "end_stop.low_deg": -1.0,
    "end_stop.high_deg": 1.0,
    "end_stop.engagement_deg": 0.1,
    "supply.pressure_pa": 6e5,
}
"""Parameters of an unused lane, in SI whatever the unit in the key."""


@dataclass(frozen=True, slots=True)
class LaneMap:
    """Where each joint lives: block[j] and lane[j], int64 (joints,); blocks is their number."""

    block: NDArray[np.int64]
    lane: NDArray[np.int64]
    blocks: int

    def scatter(self, values: Array, fill: Array) -> Array:
        """Put (rows, joints) into (blocks, rows, LANES); fill (rows,) goes to unused lanes."""
        lanes = np.empty((self.blocks, values.shape[0], LANES))
        lanes[:] = fill[None, :, None]
        lanes[self.block, :, self.lane] = values.T
        return lanes

    def gather(self, lanes: Array) -> Array:
        """Take (blocks, rows, LANES) back to (rows, joints)."""
        return np.ascontiguousarray(lanes[self.block, :, self.lane].T)


def map_hands(partner: NDArray[np.int64], hands: int, *, apart: bool = False) -> LaneMap:
    """Lay out the joints of `hands` equal hands, hand by hand.

    partner: (joints,) index of the coupled joint or -1.  apart: every hand gets a block of its own, which effects
    between its joints need. Raises ValueError where partners are not mutual, or a hand does not fit into its block.
    """
    if not apart:
        offset = np.arange(hands)[:, None] * len(partner)
        return _map_lanes(np.where(partner < 0, -1, partner + offset).ravel())
    one_hand = _map_lanes(partner)
    if one_hand.blocks > 1:
        raise ValueError(f"{len(partner)} joints have effects between them; the allowed range is 1 to {LANES} joints")
    block = np.repeat(np.arange(hands), len(partner))
    return LaneMap(block, np.tile(one_hand.lane, hands), hands)


def neighbour_lanes(lanes: LaneMap, partner: NDArray[np.int64], hands: int) -> NDArray[np.int64]:
    """Lane (blocks, LANES) of each joint's neighbour: its partner, or else the joint before it in the hand.

    Lanes without a neighbour in their own block name themselves.
    """
    neighbours = np.tile(np.arange(LANES), (lanes.blocks, 1))
    joints = len(partner)
    before = np.where(partner >= 0, partner, np.maximum(np.arange(joints) - 1, 0))
    other = (before + np.arange(hands)[:, None] * joints).ravel()
    same = lanes.block[other] == lanes.block
    neighbours[lanes.block[same], lanes.lane[same]] = lanes.lane[other[same]]
    return neighbours


def _map_lanes(partner: NDArray[np.int64]) -> LaneMap:
    """Lay out joints; partner[j] is the joint coupled with j, or -1. Raises ValueError if not mutual."""
    count = len(partner)
    block = np.zeros(count, dtype=np.int64)
    lane = np.zeros(count, dtype=np.int64)
    pairs = [(j, int(partner[j])) for j in range(count) if partner[j] > j]
    if any(partner[b] != a for a, b in pairs) or sum(partner >= 0) != 2 * len(pairs):
        raise ValueError("coupled joints must name each other, in pairs")
    for slot, (a, b) in enumerate(pairs):
        block[a] = block[b] = slot // HALF
        lane[a], lane[b] = slot % HALF, slot % HALF + HALF
    taken = set(zip(block[partner >= 0].tolist(), lane[partner >= 0].tolist(), strict=True))
    free = (place for n in range(count) for place in ((n, k) for k in range(LANES)) if place not in taken)
    for j in np.flatnonzero(partner < 0):
        block[j], lane[j] = next(free)
    return LaneMap(block, lane, int(block.max(initial=0)) + 1)


def idle_parameters() -> Array:
    """Parameters (rows,), SI, of an unused lane: a slow, damped joint that stays at rest."""
    values = np.array([parameter.neutral_si for parameter in JOINT_PARAMETERS])
    for key, value in _IDLE.items():
        values[ROW[key]] = value
    return values
