"""The verdict of a soak, from samples: growth, missed periods and latches are found, and noise is not."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import pytest

from validation.faults.closed_loop import description
from validation.faults.soak import MOST_GROWTH_MB, NAMES, Sample, Soak, evaluate
from validation.figures import PARTS
from validation.results import read_run

RATE_HZ = int(description().rate_hz)


def soak(growth_mb: float = 0.0, frames: int = RATE_HZ, commands: int = RATE_HZ, latch: str = "") -> Soak:
    """An hour of samples, ten seconds apart, in which one process grows from the first sample to the last."""
    result = Soak(1.0, 0, latches=[latch] if latch else [])
    for number in range(360):
        memory = dict.fromkeys(NAMES, 100.0 + number % 2) | {"recorder": 90.0 + growth_mb * number / 359}
        cpu = dict.fromkeys(NAMES, 0.2)
        result.samples.append(
            Sample(
                time_s=10.0 * (number + 1),
                rss_mb=memory,
                cpu=cpu,
                passed_s=10.0,
                frames=10 * frames,
                commands=10 * commands,
                file_mb=0.2 * number,
            )
        )
    return evaluate(result)


def test_an_even_hour_has_no_fault() -> None:
    """Fails when noise of the memory or a recording that grows evenly counts as a fault."""
    result = soak()
    assert result.faults == []
    assert result.file_mb_per_hour == pytest.approx(72.0, rel=0.01)
    assert result.file_growth_ratio == pytest.approx(1.0, abs=0.02)
    assert (result.missed_frames, result.missed_commands) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("result", "line"),
    [
        (soak(growth_mb=1.2 * MOST_GROWTH_MB), "recorder grew by"),
        (soak(frames=RATE_HZ - 4), "2.00% of the periods have no frame"),
        (soak(commands=RATE_HZ - 4), "2.00% of the periods have no command"),
        (soak(latch="index_distal: angle jumped"), "latched: index_distal: angle jumped"),
    ],
)
def test_each_fault_is_named(result: Soak, line: str) -> None:
    """Fails when growth, missed periods or a latch pass."""
    assert [fault for fault in result.faults if line in fault] and len(result.faults) == 1


def test_a_run_without_samples_is_not_passed() -> None:
    """Fails when a soak that measured nothing has no fault."""
    assert "only 0 samples" in evaluate(Soak(1.0, 0)).faults[0]


def test_an_hour_is_stored_and_shown(tmp_path: Path) -> None:
    """Fails when a soak cannot be stored, a short one can, or the page hides its length, its machine or its latches."""
    about = {"command": "x", "date": "2026-01-02", "commit": "abc1234", "machine": "2 cores"}
    path = tmp_path / "soak.json"
    path.write_text(json.dumps({**about, "soak": asdict(soak(latch="index_distal: angle jumped"))}), encoding="utf-8")
    stored = read_run(path)
    text = PARTS["make soak HOURS=1"].text(stored)
    assert "In 1 h the hand made" in text and "with one latch" in text
    assert "not passed: latched: index_distal: angle jumped" in text
    assert "| recorder | 90 MB | +0.0 MB | 0.20 cores |" in text
    assert text.endswith("Made by `make soak HOURS=1` on 2026-01-02, on 2 cores, at commit abc1234.")
    assert "stored yet" in PARTS["make soak HOURS=1"].text({})
    path.write_text(json.dumps({**about, "soak": asdict(Soak(0.005, 0))}), encoding="utf-8")
    with pytest.raises(ValueError, match=r"holds 0\.005 h of motion; run make soak HOURS=1 or more"):
        read_run(path)
