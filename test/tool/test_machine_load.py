"""The load of the machine: what this command used, and what other programs used."""

from __future__ import annotations

import os
from pathlib import Path

from hand_tool.machine_load import BUSY, Load, LoadMeter

TICKS = os.sysconf("SC_CLK_TCK")


def stat(path: Path, user_s: int, idle_s: int) -> Path:
    """A file like /proc/stat with these times of all cores."""
    path.write_text(f"cpu  {user_s * TICKS} 0 0 {idle_s * TICKS} 0 0 0 0 0 0\ncpu0 1 2 3\n", encoding="ascii")
    return path


def test_the_rest_is_used_by_others(tmp_path: Path) -> None:
    """Fails when the load of others is not what remains of the busy time, or idle time counts as busy."""
    meter = LoadMeter(stat(tmp_path / "stat", 1000, 500))
    stat(tmp_path / "stat", 1060, 540)
    load = meter.load()
    assert load is not None and load.cores == os.cpu_count()
    assert abs(load.own + load.others - 0.6) < 1e-9
    assert load.own < 0.05 and load.disturbs
    assert str(load).startswith("60 % of ")


def test_an_unknown_load_is_none(tmp_path: Path) -> None:
    """Fails when a system without the file, or no time at all, gives a number."""
    assert LoadMeter(tmp_path / "absent").load() is None
    assert LoadMeter(stat(tmp_path / "stat", 10, 10)).load() is None
    assert not Load(2, 0.9, BUSY).disturbs
