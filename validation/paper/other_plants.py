"""Plants of another form than the laws that are fitted to them: drawn from the referees' families for development.

Material: creep with three retardation times (Prony) and a density of plays, where the model has three zones (Eq. 12).
Statics: a spring that hardens beyond an angle, and the same plays, where the model has four coefficients (Eq. 6).
"""

from __future__ import annotations

import numpy as np

from hand_model.arrays import Array
from hand_model.description import Hand
from hand_recording.signals import Signals
from validation.paper.creep_rig import ANGLE_NOISE_RAD, JOINT, PERIOD_S, PRESSURE_NOISE_PA, set_points
from validation.referees.development import DEVELOPMENT
from validation.referees.forms import Apply, Site
from validation.referees.plant import Laws, T, record, states
from validation.trial.nominal import Nominal
from validation.trial.plant import ROW

LAW_SEED = 1304
"""Of the drawn laws; the seed of a figure draws noise and set-points."""
CREEP_SIZE, MATERIAL_LOOP_SIZE, RIG_LOOP_SIZE, SPRING_SIZE = 6.0, 0.5, 0.2, 0.4
"""In the families' units: creep of 0.6 rad at 3 bar, plays of 10 and 4 mN m/rad, a spring of up to 20 mN m/rad."""
REACH_RAD, TOP_PA = float(np.radians(90.0)), 5e5


def _drawn(family: str, number: int) -> Apply:
    site = Site(np.zeros(len(ROW)), REACH_RAD, TOP_PA)
    found = next(each for each in DEVELOPMENT if each.name == family)
    return found.draw(site, np.random.default_rng([LAW_SEED, number]))


def material_laws(frames: int) -> Laws:
    """Laws of one joint: a spectrum of retardations and plays."""
    laws = Laws(1, frames)
    _drawn("creep of three modes", 0)(laws, 0, CREEP_SIZE)
    _drawn("falling density of the material", 1)(laws, 0, MATERIAL_LOOP_SIZE)
    return laws


def material_recording(hand: Hand, seed: int) -> Signals:
    """The staircase and steps of Fig. 13 on a joint with that material, with the sensors' noise."""
    rng = np.random.default_rng([seed, 13])
    held = set_points(seed)
    nominal = Nominal(hand.path)
    rows = nominal.rows[:, [nominal.joints.index(JOINT)]].copy()
    rows[ROW["reach"]], rows[ROW["coupling"]] = 0.0, 0.0
    laws = material_laws(len(held))
    alone, itself = np.array([-1]), np.array([0])
    out = record(rows, (laws, laws), held[:, None], PERIOD_S, alone, itself)
    count, yes = len(held), np.ones(1, dtype=bool)
    return Signals(
        name="fig13",
        joints=(JOINT,),
        period_s=PERIOD_S,
        set_point_pa=held[:, None],
        pressure_pa=out[0] + PRESSURE_NOISE_PA * rng.standard_normal((count, 1)),
        angle_rad=out[1] + ANGLE_NOISE_RAD * rng.standard_normal((count, 1)),
        force_n=np.full((count, 1), np.nan),
        known=np.ones((count, 1), dtype=bool),
        has_set_point=yes,
        has_pressure=yes,
    )


def spring_torque_nm(angle_rad: Array) -> Array:
    """Torque (n,) [N m] of the hardening spring against flexion at angles (n,)."""
    laws = Laws(1, 1)
    _drawn("hardening spline", 2)(laws, 0, SPRING_SIZE)
    return np.asarray(np.interp(angle_rad, states("spring"), laws.table[T["spring"], 0]))


def play_torque_nm(angle_rad: Array) -> Array:
    """Torque (n,) [N m] of the plays along a path of angles (n,): what is lost on the way there, back on the way."""
    laws = Laws(1, 1)
    _drawn("falling density of the material", 3)(laws, 0, RIG_LOOP_SIZE)
    weights, radii = laws.loops[0, :, 0], laws.loops[1, :, 0]
    state, torque = np.full(len(radii), angle_rad[0]), np.empty(len(angle_rad))
    for k, angle in enumerate(angle_rad):
        state = np.clip(state, angle - radii, angle + radii)
        torque[k] = float(weights @ (angle - state))
    return torque
