"""Inputs of a joint from a model and readings together: the model gives the shape, the readings what it leaves.

A pressure that turns sharply after a step is no straight line from one sample to the next, and an acceleration taken
from noisy angles alone shakes a joint that friction holds. What a model leaves of the readings is small and smooth; its
noise is reduced, gaps are bridged in it, and added to the model it is what was measured.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hand_identification.free_parameters import Move
from hand_identification.joint_problem import JointProblem, Piece
from hand_model.arrays import Array
from hand_recording.signals import slopes_over, smoothing_span, white_noise, without_noise


def shape_driving(problem: JointProblem, moves: Sequence[Move], z: Array) -> None:
    """Set the driving pressure of every piece by the valve's model at the coordinates z (moves,).

    A piece whose readings are not smoother beside the model than by themselves stays as it is.
    """
    if problem.driven:
        return
    finer = max(1, math.ceil(problem.pieces[0].period_s / problem.step_s - 1e-9))
    columns, starts = problem.columns(moves, z[None])
    fine = replace(problem, pieces=[_finer(piece, finer) for piece in problem.pieces])
    predicted = fine.predict(columns, starts)
    problem.pieces[:] = [
        _shaped(piece, one[0, 0], finer) if piece.use[0].any() else piece
        for piece, one in zip(problem.pieces, predicted, strict=True)
    ]


def accelerations(problem: JointProblem, moves: Sequence[Move], z: Array) -> list[Array]:
    """Acceleration (T,) [rad/s^2] of the joint in every piece, by its model at the coordinates z (moves,)."""
    columns, starts = problem.columns(moves, z[None])
    return [
        _acceleration(piece, predicted[0, 1])
        for piece, predicted in zip(problem.pieces, problem.predict(columns, starts), strict=True)
    ]


def inflow(driving_pa: Array, samples: int, period_s: float) -> Array:
    """Rise of a driving pressure (samples,) [Pa/s], falls left out, mean over the sample around each reading."""
    if samples < 2:
        return np.zeros(samples)
    finer = (len(driving_pa) - 1) // (samples - 1)
    rises = np.maximum(np.diff(driving_pa), 0.0).reshape(samples - 1, finer).sum(axis=1) / period_s
    around = np.concatenate([rises[:1], rises, rises[-1:]])
    return np.asarray(0.5 * (around[1:] + around[:-1]))


def _acceleration(piece: Piece, model_rad: Array) -> Array:
    """Second differences keep the speed that an acceleration between two samples brings."""
    rest = _bridged(piece, piece.angle_rad - model_rad)
    span = smoothing_span(rest, piece.period_s, white_noise(rest))
    bends = np.zeros(len(rest))
    bends[1:-1] = np.diff(model_rad, 2) / piece.period_s**2
    return bends + slopes_over(rest, span, 2, piece.period_s)


def _bridged(piece: Piece, rest: Array) -> Array:
    samples = np.arange(len(rest))
    return np.interp(samples, samples[piece.known], rest[piece.known]) if piece.known.any() else rest


def _finer(piece: Piece, finer: int) -> Piece:
    """The inputs of the valve's stage alone, in steps of a `finer`-th of a sample."""
    samples = len(piece.set_point_pa)
    at = np.arange(finer * (samples - 1) + 1) / finer
    around = [np.interp(at, np.arange(samples), column) for column in piece.exogenous.T]
    pressure = np.interp(at, np.arange(samples), piece.pressure_pa)
    return replace(
        piece,
        period_s=piece.period_s / finer,
        set_point_pa=np.repeat(piece.set_point_pa, finer)[: len(at)],
        driving_pa=pressure,
        exogenous=np.column_stack(around),
    )


def _shaped(piece: Piece, model_pa: Array, finer: int) -> Piece:
    samples = np.arange(len(piece.pressure_pa))
    rest = _bridged(piece, piece.pressure_pa - model_pa[::finer])
    if len(rest) < 3 or not np.mean(np.diff(rest, 2) ** 2) < np.mean(np.diff(piece.pressure_pa, 2) ** 2):
        return piece
    quiet, span = without_noise(rest, piece.period_s, white_noise(rest))
    at = np.arange(len(model_pa)) / finer
    return replace(piece, driving_pa=model_pa + np.interp(at, samples, quiet), span=span, smoothed=quiet != rest)
