"""Means of groups of samples where a recording has far more of them than it shows."""

from __future__ import annotations

import numpy as np
import pytest

from hand_machine.reading import Readings
from hand_machine.settings import MACHINE
from hand_machine.thinning import thinned

SEED = 3
RATE_HZ = 1000.0


def _recording(seconds: float, ripple: float = 0.0, noise: float = 1e-3) -> Readings:
    """A slow sine of the position, and a force that follows it, with a ripple of 72 Hz and noise."""
    rng = np.random.default_rng(SEED)
    time_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    position = np.sin(2.0 * np.pi * 0.3 * time_s)
    force = position + ripple * np.sin(2.0 * np.pi * 72.0 * time_s) + noise * rng.standard_normal(len(time_s))
    signals = {"input": 0.0 * time_s, "position": position, "force": force}
    return Readings(time_s, signals, np.ones(len(time_s), dtype=bool), ("read",))


def test_a_long_slow_recording_is_thinned_to_means() -> None:
    """Broken by samples that are dropped instead of averaged, a wrong time, or a recording that stays as long."""
    print(f"seed {SEED}")
    whole = _recording(60.0)
    (means,) = thinned([whole])
    group = round(means.period_s * RATE_HZ)
    assert group == -(-60000 // MACHINE.most_samples)
    assert len(means.time_s) == 60000 // group
    np.testing.assert_allclose(means.time_s[:2], [whole.time_s[:group].mean(), whole.time_s[group : 2 * group].mean()])
    for name, values in whole.signals.items():
        np.testing.assert_allclose(means.signals[name][7], values[7 * group : 8 * group].mean(), atol=1e-12)
    left = means.signals["force"] - means.signals["position"]
    assert np.std(left) == pytest.approx(1e-3 / np.sqrt(group), rel=0.05)
    assert means.notes[0] == "read"
    assert f"means of {group} samples" in means.notes[-1]


def test_what_changes_fast_is_kept() -> None:
    """Broken by means that hide a ripple which the samples show."""
    whole = _recording(60.0, ripple=0.2)
    assert thinned([whole])[0] is whole


def test_few_samples_stay_as_they_are() -> None:
    """Broken by a short recording whose times become coarser for no gain."""
    whole = _recording(MACHINE.most_samples / RATE_HZ)
    assert thinned([whole])[0] is whole


def test_a_mean_is_known_only_where_all_its_samples_are() -> None:
    """Broken by bridged readings that count."""
    whole = _recording(60.0)
    whole.known[1000] = False
    (means,) = thinned([whole])
    group = round(means.period_s * RATE_HZ)
    assert np.flatnonzero(~means.known).tolist() == [1000 // group]
