"""Which effects these data can tell apart, from each other and from a mere change of the nominal numbers.

Each effect's probe changes the prediction by s. What the nominal numbers could do as well, within their tolerance, is
taken out of s. What is left, in sigma of the practical noise, is how visible the effect is; the cosine between what is
left of two effects is how alike they look. 1 means that no amount of this data separates them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hand_diagnosis.screen import AT_ONCE
from hand_identification.free_parameters import probe_values
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array
from hand_model.effects.effect import Effect

ALIKE = 0.95
"""Cosine from which two effects are reported as a group."""
ENOUGH = 20_000
"""Samples from which a longer recording is thinned out."""
HIDDEN = 0.5
"""Sigma below which a probe shows nothing that could be compared."""


@dataclass(frozen=True, slots=True)
class Isolability:
    """names (n,); visible (n,): sigma of each effect's first probe; absorbed (n,): share taken by nominal numbers.

    alike (n, n): largest cosine between the probes of two effects.
    """

    names: tuple[str, ...]
    visible: Array
    absorbed: Array
    alike: Array

    def group_of(self, name: str) -> list[str]:
        """Effects that these data cannot separate from one, itself left out."""
        k = self.names.index(name)
        return [other for i, other in enumerate(self.names) if i != k and self.alike[k, i] > ALIKE]


def isolability(problem: JointProblem, fit: MapFit, effects: Sequence[Effect]) -> Isolability:
    """At a fit, from the sensitivities of the very recording."""
    base, starts = problem.columns(fit.free, fit.z[None])
    probes = [(k, values) for k, effect in enumerate(effects) for values in probe_values(effect, base[0])]
    columns = np.repeat(base, len(probes), axis=0)
    for column, (_, values) in zip(columns, probes, strict=True):
        for row, value in values.items():
            column[row] = value
    coordinates = len(fit.z)
    gram, cross = np.zeros((len(probes), len(probes))), np.zeros((len(probes), coordinates))
    normal = np.zeros((coordinates, coordinates))
    stride = max(1, sum(len(segment.angle_rad) for segment in problem.segments) // ENOUGH)
    parts = [columns[begin : begin + AT_ONCE] for begin in range(0, len(probes), AT_ONCE)]
    thinned = [_thinned_change(problem, fit, part, starts, stride) for part in parts]
    for index, slopes in enumerate(fit.sensitivity):
        root = np.sqrt(problem.weight * stride)[:, None]
        s = (np.concatenate([part[index] for part in thinned]) * root).reshape(len(probes), -1)
        j = (slopes[:, :, ::stride] * root).reshape(coordinates, -1)
        gram += s @ s.T
        cross += s @ j.T
        normal += j @ j.T
    left = gram - cross @ np.linalg.inv(normal + np.eye(coordinates)) @ cross.T
    return _summary([effect.name for effect in effects], [k for k, _ in probes], gram, left)


def _thinned_change(problem: JointProblem, fit: MapFit, columns: Array, starts: Array, stride: int) -> list[Array]:
    """Changes of the residuals (k, OUTPUTS, T / stride) by segment."""
    changed = problem.residuals(columns, np.repeat(starts, len(columns), axis=0))
    pairs = zip(fit.residuals, changed, strict=True)
    return [np.nan_to_num((other - residual)[:, :, ::stride]) for residual, other in pairs]


def _summary(names: Sequence[str], owner: Sequence[int], gram: Array, left: Array) -> Isolability:
    size = np.sqrt(np.maximum(np.diag(left), 0.0))
    seen = np.where(size > HIDDEN, size, np.inf)  # what cannot be seen looks like nothing
    cosine = np.abs(left / np.outer(seen, seen))
    count = len(names)
    alike, visible, absorbed = np.eye(count), np.zeros(count), np.ones(count)
    owners = np.array(owner, dtype=int)
    for a in range(count):
        mine = np.flatnonzero(owners == a)
        if not len(mine):
            continue
        best = mine[int(np.argmax(size[mine]))]
        visible[a] = size[best]
        absorbed[a] = 1.0 - left[best, best] / max(gram[best, best], 1e-12)
        for b in range(count):
            theirs = np.flatnonzero(owners == b)
            if a != b and len(theirs):
                alike[a, b] = min(float(cosine[np.ix_(mine, theirs)].max()), 1.0)
    return Isolability(tuple(names), visible, np.clip(absorbed, 0.0, 1.0), alike)
