"""What remains after the best model: noise, a part, or physics outside the catalogue; and where the model misses.

What is left is compared with the noise on training, validation and test data apart (splits.noise_on): an event may
lie in blocks that are fitted, and a slow change after them.

Each signal of a joint is tested as a whole, by direction of motion, in thirds of each state and by frequency. A region
is missed where its error beyond the noise is larger than the repeatability and significant. Squares of blocks are
compared with the noise, so that correlation within a block does not count one event many times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hand_diagnosis.problem import ErrorsOnTest, noise_on, noise_on_test, validation_rmse
from hand_diagnosis.search import posterior_covariance
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import STAGES, JointProblem
from hand_identification.map_fit import MapFit


@dataclass(frozen=True, slots=True)
class Excess:
    """Error [SI] of a signal beyond the noise, before and after, on train, validation or test data.

    independent: samples of the split that count as independent (FITS.correlation_s).  noise: of the split.
    undetermined: what the fit leaves open there, which counts as noise.
    """

    split: str
    before: float
    after: float
    independent: float
    noise: float
    undetermined: float = 0.0

    @property
    def left(self) -> float:
        """Share of the excess error (RMS) that is left, 0 ... 1."""
        return min(self.after / max(self.before, 1e-300), 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class StageResult:
    """One signal on the validation data, SI: error before and after, noise, excess over the noise before and after.

    noise: of reading and measured inputs.  floor: repeatability.  effects: how many were found on the joint.
    independent: as in Excess.  elsewhere: on training and on test data.
    """

    stage: int
    before: float
    after: float
    noise: float
    excess_before: float
    excess_after: float
    floor: float
    effects: int
    independent: float
    elsewhere: tuple[Excess, ...] = ()

    @property
    def name(self) -> str:
        """Of the signal: pressure, angle or force."""
        return STAGES[self.stage]

    @property
    def left(self) -> float:
        """Share of the excess error (RMS) that is left, 0 ... 1."""
        return min(self.excess_after / max(self.excess_before, 1e-300), 1.0)

    @property
    def explained(self) -> float:
        """Share of the mean square beyond the noise that the effects explain, 0 ... 1."""
        return 1.0 - self.left**2

    @property
    def right_name(self) -> float:
        """Probability, 0 ... 1, that no other effect stands behind the names, by what they leave of this signal.

        The worse one of validation and test data counts: a wrong class with a flexible law fails on what it did not
        see. Logistic in log(1 + x^2 / floor^2), and no less than SETTINGS.name_least.
        """
        on_test = [(e.before, e.after) for e in self.elsewhere if e.split == "test"]
        ratio = max(
            (self.floor**2 + after**2) / (self.floor**2 + self._tolerated(before) ** 2)
            for before, after in ((self.excess_before, self.excess_after), *on_test)
        )
        least = SETTINGS.name_least
        return float(least + (1.0 - least) / (1.0 + ratio**SETTINGS.name_sharpness))

    def _tolerated(self, before: float) -> float:
        """Excess error [SI] that a right name may leave of an excess `before` [SI]."""
        return float(np.hypot(SETTINGS.name_excess_floors * self.floor, SETTINGS.tolerated_share * before))

    @property
    def most_left(self) -> Excess:
        """The split on which what is left is most probably other physics; validation data among equals."""
        return max((self._on_validation, *self.elsewhere), key=self._log_odds)

    def _log_odds(self, excess: Excess) -> float:
        """Of other physics, from the likelihood of the error that is left against the largest that is tolerated.

        Where both (hypotheses.log_likelihood) are equal, the odds are even next to effects, else outside_catalogue.
        """
        limit = self._tolerated(excess.before) if self.effects else SETTINGS.unexplained_floors * self.floor
        left, right = (1.0 + (x / self.floor) ** 2 for x in (excess.after, limit))
        gain = 0.5 * excess.independent * float(np.log(left / right)) / SETTINGS.evidence_temperature
        return gain if self.effects else gain - float(np.log(1.0 / SETTINGS.outside_catalogue - 1.0))

    @property
    def other_physics(self) -> float:
        """Probability, 0 ... 1, that what is left is other physics than that named, where most is left."""
        low = SETTINGS.min_probability
        return float(np.clip(0.5 * (1.0 + np.tanh(0.5 * self._log_odds(self.most_left))), low, 1.0 - low))

    @property
    def remains(self) -> bool:
        """Whether what is left is more probably other physics than not."""
        return self._log_odds(self.most_left) > 0.0

    def remains_on(self, split: str) -> bool:
        """The same for training or test data alone."""
        return any(self._log_odds(e) > 0.0 for e in self.elsewhere if e.split == split)

    @property
    def shows_late(self) -> bool:
        """Whether something remains on test data, and nothing or several times less on training data."""
        return any(self._is_beyond_training(e) for e in self.elsewhere if e.split == "test")

    @property
    def shows_held_out(self) -> bool:
        """Whether something remains on validation data, and nothing or several times less on training data."""
        return self._is_beyond_training(self._on_validation)

    def _is_beyond_training(self, excess: Excess) -> bool:
        """Whether something remains of an excess, and nothing or several times less of that on training data."""
        if self._log_odds(excess) <= 0.0:
            return False
        trained = [e.after for e in self.elsewhere if e.split == "train" and self._log_odds(e) > 0.0]
        return all(excess.after > SETTINGS.late_excess * after for after in trained)

    @property
    def _on_validation(self) -> Excess:
        return Excess("validation", self.excess_before, self.excess_after, self.independent, self.noise)

    @property
    def claimed(self) -> bool:
        """Whether the effects remove enough of this signal's error to be findings, not only parts of an unknown.

        What they remove of a test error above the repeatability counts as much: an event in a single validation block
        need not speak against them.
        """
        on_test = [e.left for e in self.elsewhere if e.split == "test" and e.before > self.floor]
        return not self.remains or min(self.left, self.most_left.left, *on_test) <= SETTINGS.max_claim_share


def stage_results(problem: JointProblem, nominal: MapFit, final: MapFit, effects: int) -> list[StageResult]:
    """Pressure, angle and force, those that the recording holds. effects: how many the final model has."""
    before, after = validation_rmse(problem, nominal.squares), validation_rmse(problem, final.squares)
    noise = np.nan_to_num(noise_on(problem, final, problem.validation))
    independent = problem.effective_counts(problem.validation)
    results = []
    for stage in range(len(STAGES)):
        if not np.isfinite(before[stage]):
            continue
        errors, own = (float(before[stage]), float(after[stage])), float(noise[stage])
        beyond = (_beyond(errors[0], own), _beyond(errors[1], own))
        floor, samples = float(problem.floor[stage]), float(independent[stage])
        results.append(
            StageResult(
                stage=stage,
                before=errors[0],
                after=errors[1],
                noise=own,
                excess_before=beyond[0],
                excess_after=beyond[1],
                floor=floor,
                effects=effects,
                independent=samples,
            )
        )
    return results


def with_other_splits(
    results: Sequence[StageResult],
    whole: JointProblem,
    fits: tuple[MapFit, MapFit],
    test: ErrorsOnTest | None,
    *,
    problem: JointProblem,
    free_axis: bool,
) -> list[StageResult]:
    """The results of a problem with what the fits, nominal and final, leave of its training data and of the test data.

    whole: the problem with its test data.  free_axis: see splits.evaluate_test.
    """
    train = ~problem.validation
    counts = problem.block_counts[:, train].sum(axis=1)
    errors = [np.sqrt(fit.squares[:, train].sum(axis=1) / np.maximum(counts, 1.0)) for fit in fits]
    splits = [("train", errors, noise_on(problem, fits[1], train), 0.0 * counts, problem.effective_counts(train))]
    if test is not None:
        covariance = posterior_covariance(problem, fits[1])
        noise, open_ = noise_on_test(whole, problem, fits[1], covariance, free_axis=free_axis)
        samples = test.counts.sum(axis=1) * min(problem.segments[0].period_s / problem.correlation_s, 1.0)
        splits.append(("test", [test.rmse(0), test.rmse(1)], noise, open_, samples))
    found = []
    for result in results:
        k = result.stage
        elsewhere = []
        for name, errors, noise, left_open, samples in splits:
            if np.isfinite(noise[k]) and np.isfinite(errors[1][k]):
                own = float(np.hypot(noise[k], left_open[k]))
                before, after = (_beyond(error[k], own) for error in errors)
                elsewhere.append(Excess(name, before, after, samples[k], float(noise[k]), float(left_open[k])))
        found.append(replace(result, elsewhere=tuple(elsewhere)))
    return found


def _beyond(error: float, noise: float) -> float:
    """Error [SI] beyond the noise."""
    return float(np.sqrt(max(error**2 - noise**2, 0.0)))
