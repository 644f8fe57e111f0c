"""Eq. 10 against Eqs. 11 to 13: a continuous retardation spectrum and the three-zone law on the same creep."""

from __future__ import annotations

import numpy as np

from hand_model.arrays import Array, Flags
from hand_model.kernel.rows import ROW
from hand_model.material import creep_course
from hand_model.statics import torque
from hand_pages.plots import Curve, Kind, Panel, Plot
from validation.paper.creep_rig import PERIOD_S, description, problem
from validation.paper.drawing import BLUE, GREY, RED, nth_shown, panels
from validation.paper.result import Progress, Quantity, Reproduction
from validation.paper.retardation import Prony, fit_prony

TERMS = (1, 2, 3, 4, 6, 8)
SHORTEST_S, LONGEST_S = 8.0, 100.0
TRAIN_SHARE = 0.65
STATIC_KEYS = ("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad")


def reproduce(seed: int, progress: Progress) -> Reproduction:
    """The shift of the rest angle by Eq. 6, as a sum of first-order lags of the pressure and as the three-zone law."""
    task = problem(description(), seed)
    segment, nominal = task.segments[0], task.nominal
    shift = _shift_rad(nominal, segment.pressure_pa, segment.angle_rad)
    quiet = _settled(segment.set_point_pa)
    split = round(TRAIN_SHARE * len(shift))
    train, test = quiet.copy(), quiet.copy()
    train[split:], test[:split] = False, False
    zones = nominal[ROW["material.phi_max_deg"]] * _three_zones(nominal, segment.pressure_pa)
    errors, fits = [], []
    for index, terms in enumerate(TERMS):
        fits.append(_fit(segment.pressure_pa, shift, terms, train))
        errors.append(_rms_deg(fits[-1].response(segment.pressure_pa, PERIOD_S) - shift, test))
        progress((index + 1) / len(TERMS))
    zone_error = _rms_deg(zones - shift, test)
    best = int(np.argmin(errors))
    figure, (left, right) = panels(1, 2, 9.5, 3.8)
    time_s = np.arange(len(shift)) * PERIOD_S
    shown = np.where(quiet, shift, np.nan)
    left.plot(time_s, np.degrees(shown), ".", ms=1, color=GREY, label="from the recording")
    left.plot(time_s, np.degrees(zones), color=BLUE, lw=1.0, label="three zones, Eq. 12")
    prony = np.degrees(fits[best].response(segment.pressure_pa, PERIOD_S))
    left.plot(time_s, prony, color=RED, lw=1.0, label=f"spectrum, {TERMS[best]} terms")
    left.axvline(split * PERIOD_S, color=GREY, lw=0.8, ls="--")
    left.set(xlabel="time [s]", ylabel="shift of the rest angle [deg]")
    left.legend(frameon=False, fontsize=7)
    right.plot(TERMS, errors, "o-", color=RED, label="spectrum")
    right.axhline(zone_error, color=BLUE, label="three zones")
    right.set(xlabel="terms of Eq. 10", ylabel="error on test data [deg]", ylim=(0, None))
    right.legend(frameon=False)
    gets = f"On test data the error of the three zones is {zone_error:.2f} degree, that of the best spectrum"
    gets += f" ({TERMS[best]} terms) {errors[best]:.2f}."
    nth = nth_shown(len(shift))
    drawn: tuple[tuple[str, Kind, Array], ...] = (
        ("from the recording", "measured", np.degrees(shown)),
        ("three zones, Eq. 12", "after", np.degrees(zones)),
        (f"spectrum, {TERMS[best]} terms", "before", prony),
    )
    curves = [Curve(name, kind, (0.0, nth * PERIOD_S), values[::nth]) for name, kind, values in drawn]
    test_span = (split * PERIOD_S, len(shift) * PERIOD_S, "test")
    counts, level = np.array(TERMS, dtype=float), np.full(len(TERMS), zone_error)
    of_terms = [Curve("spectrum", "before", counts, np.array(errors)), Curve("three zones", "after", counts, level)]
    plots = (
        Plot(
            label="time [s]",
            panels=[Panel("shift of the rest angle [deg]", curves)],
            alt=gets,
            caption="Yellow: test data.",
            spans=[test_span],
        ),
        Plot(label="terms of Eq. 10", panels=[Panel("error on test data [deg]", of_terms, zero=True)], alt=gets),
    )
    return Reproduction(
        "prony",
        "Equation 10: a continuous spectrum instead of three zones",
        "The paper gives the continuous retardation spectrum as the general form and uses three zones instead.",
        gets,
        "The recording is simulated with the three-zone law, which keeps its shape where a linear spectrum relaxes;"
        " on a linear material the spectrum would have the smaller error.",
        figure,
        (
            Quantity("prony_zones", "error on test data, three zones", "deg", None, zone_error),
            *(
                Quantity(f"prony_{n}", f"error on test data, {n} terms", "deg", None, e)
                for n, e in zip(TERMS, errors, strict=True)
            ),
        ),
        plots,
    )


def _fit(pressure_pa: Array, shift: Array, terms: int, train: Flags) -> Prony:
    times = np.geomspace(SHORTEST_S, LONGEST_S, terms) if terms > 1 else np.array([30.0])
    return fit_prony(pressure_pa, shift, times, PERIOD_S, train)


def _shift_rad(nominal: Array, pressure_pa: Array, angle_rad: Array) -> Array:
    """The product A phi_max (T,) [rad] of Eq. 11 for which the torque at rest is zero."""
    a0, a1, a2, a3 = (float(nominal[ROW[f"statics.{key}"]]) for key in STATIC_KEYS)
    shift: Array = torque(pressure_pa, angle_rad, 0.0, a0, a1, a2, a3, 0.0) / a1
    return shift


def _settled(held: Array) -> Flags:
    """Samples (T,) a second or more after a step, where the joint is at rest."""
    last = np.zeros(len(held), dtype=int)
    changes = np.flatnonzero(np.diff(held, prepend=held[0] + 1.0) != 0.0)
    last[changes] = changes
    last = np.maximum.accumulate(last)
    settled: Flags = (np.arange(len(held)) - last) * PERIOD_S > 1.0
    return settled


def _three_zones(nominal: Array, pressure_pa: Array) -> Array:
    """Creeping ratio (T,) by Eq. 12 from the relaxed state."""
    keys = ("p_min_pa", "b1_per_pa", "extension_time_s", "b0_per_pa", "recovery_time_s")
    law = tuple(float(nominal[ROW[f"material.{key}"]]) for key in keys)
    return creep_course(pressure_pa, law, PERIOD_S)[:-1]


def _rms_deg(error_rad: Array, use: Flags) -> float:
    return float(np.degrees(np.sqrt(np.mean(error_rad[use] ** 2))))
