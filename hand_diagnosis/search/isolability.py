"""Which effects a recording can separate from each other and from the nominal numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hand_diagnosis.search.hypotheses import probes_at
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit
from hand_identification.posterior import covariance_of
from hand_model.arrays import Array
from hand_model.effects.effect import Effect


@dataclass(frozen=True, slots=True)
class Isolability:
    """Which effects these data can separate, from each other and from a change of the nominal numbers.

    Each probe changes the prediction by s. The part that the nominal numbers can produce within their tolerance is
    removed from s; the cosine between the remainders of two effects says how alike they look.
    names (n,); visible (n,): size of each effect's most visible remainder [sigma of the practical noise].
    absorbed (n,): share [-] that the nominal numbers take.  alike (n, n): largest cosine between probes of two effects.
    """

    names: tuple[str, ...]
    visible: Array
    absorbed: Array
    alike: Array

    def group_of(self, name: str) -> list[str]:
        """The other effects that these data cannot separate from the one named."""
        k = self.names.index(name)
        return [other for i, other in enumerate(self.names) if i != k and self.alike[k, i] > SETTINGS.alike_cosine]


def isolability(problem: JointProblem, fit: MapFit, effects: Sequence[Effect]) -> Isolability:
    """What a recording can separate, from its own sensitivities at a fit that still has them."""
    tried = probes_at(problem, fit, effects)
    names = [effect.name for effect in effects]
    owner = np.array([names.index(effect.name) for effect, _ in tried.probes], dtype=int)
    count, free = len(tried.probes), len(fit.z)
    gram, cross, normal = np.zeros((count, count)), np.zeros((count, free)), np.zeros((free, free))
    stride = max(1, sum(len(segment.angle_rad) for segment in problem.segments) // SETTINGS.isolability_samples)
    thinned = [
        [np.nan_to_num(b[:, :, ::stride] - a[:, ::stride]) for a, b in zip(fit.residuals, changed, strict=True)]
        for _, changed in tried.changed_residuals(problem, SETTINGS.probes_at_once)
    ]
    for index, slopes in enumerate(fit.sensitivity):
        root = np.sqrt(problem.weight * stride)[:, None]
        s = (np.concatenate([part[index] for part in thinned]) * root).reshape(count, -1)
        j = (slopes[:, :, ::stride] * root).reshape(free, -1)
        gram += s @ s.T
        cross += s @ j.T
        normal += j @ j.T
    left = gram - cross @ covariance_of(normal) @ cross.T
    return _isolability(names, owner, gram, left)


def _isolability(names: Sequence[str], owner: NDArray[np.int64], gram: Array, left: Array) -> Isolability:
    """From the products (probes, probes) of the probes, and of their remainders, by the effect that owns each."""
    size = np.sqrt(np.maximum(np.diag(left), 0.0))
    seen = np.where(size > SETTINGS.min_visible_sigma, size, np.inf)  # what is too small is alike to nothing
    cosine = np.abs(left / np.outer(seen, seen))
    count = len(names)
    alike, visible, absorbed = np.eye(count), np.zeros(count), np.ones(count)
    own = [np.flatnonzero(owner == k) for k in range(count)]
    for a in range(count):
        if not len(own[a]):
            continue
        best = own[a][int(np.argmax(size[own[a]]))]
        visible[a] = size[best]
        absorbed[a] = 1.0 - left[best, best] / max(gram[best, best], 1e-12)
        for b in range(count):
            if a != b and len(own[b]):
                alike[a, b] = min(float(cosine[np.ix_(own[a], own[b])].max()), 1.0)
    return Isolability(tuple(names), visible, np.clip(absorbed, 0.0, 1.0), alike)
