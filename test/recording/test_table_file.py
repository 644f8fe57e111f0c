"""Tables of numbers: the same content from every kind of file, and one line for what cannot be used."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from hand_recording.recording_files import RecordingError
from hand_recording.signal_files import uniform_clock
from hand_recording.table_file import read_rig, read_table

TEXT = '\ufefft_s, p_bar,note,angle_rad\n# a comment\n0,1.5,start,0.1\n\n0.5,,"a, b",0.2\n1.0,2.5,,0.3\n'


def test_every_kind_of_file_gives_the_same_numbers(tmp_path: Path) -> None:
    """Fails when a format loses a column, a row or an empty cell, or takes text for numbers."""
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    expected = {"t_s": [0.0, 0.5, 1.0], "p_bar": [1.5, np.nan, 2.5], "angle_rad": [0.1, 0.2, 0.3]}
    (tmp_path / "a.csv").write_text(TEXT, encoding="utf-8")
    pq.write_table(pa.table({**expected, "note": ["start", "a, b", ""]}), tmp_path / "a.parquet")
    with (tmp_path / "a.npz").open("wb") as stream:
        np.savez(stream, t_s=expected["t_s"], p_bar=expected["p_bar"], angle_rad=expected["angle_rad"])
    for suffix in ("csv", "parquet", "npz"):
        numbers = read_table(tmp_path / f"a.{suffix}").numbers
        assert numbers.keys() == expected.keys(), suffix
        for name, values in expected.items():
            assert np.array_equal(numbers[name], values, equal_nan=True), (suffix, name)


def test_columns_are_found_by_quantity_and_converted(tmp_path: Path) -> None:
    """Fails when a unit is converted by another factor, or a column of another quantity is taken."""
    (tmp_path / "a.csv").write_text("p_bar,angle_rad\n1.5,0.1\n2,1.4\n", encoding="utf-8")
    columns = read_rig(tmp_path / "a.csv", ("p_pa", "angle_deg"), ("torque_nm",))
    assert columns.keys() == {"p_pa", "angle_deg"}
    assert columns["p_pa"].tolist() == [150000.0, 200000.0]
    assert np.allclose(columns["angle_deg"], np.degrees([0.1, 1.4]))


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "is empty; a header line and numbers are needed"),
        ("t_s,p_bar\n", "has a header and no numbers"),
        ("t_s,p_bar\n1,2\n3\n", "line 3 has 1 cells; the header has 2"),
        ("t_s,t_s\n1,2\n", "the header names the column 't_s' twice"),
        ("# made by hand\nt_s,p_bar\n\n1,2\n3,x\n", "line 5, column p_bar is 'x'; it must be a finite number"),
        ("t_s,p_bar\n1,2\n3,inf\n", "line 3, column p_bar is 'inf'; it must be a finite number"),
        ("t_s,p_bar\n1,2\n3,\n", "line 3, column p_bar is 'nan' or empty; it must be a finite number"),
        ("t_s,q_bar\n1,2\n", "has no column p_pa; it has: t_s, q_bar"),
    ],
)
def test_what_cannot_be_used_is_one_line(tmp_path: Path, text: str, line: str) -> None:
    """Fails when a broken table is read, or the message names another line, column or cell."""
    path = tmp_path / "a.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match=r"^[^\n]*$") as caught:
        read_rig(path, ("t_s", "p_pa"))
    assert line in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("name", ["nowhere.csv", "noise.npz", "noise.parquet", "noise.csv"])
def test_other_files_are_refused(tmp_path: Path, name: str) -> None:
    """Fails when a missing file, or bytes that are no table, give anything but one line."""
    if name != "nowhere.csv":
        (tmp_path / name).write_bytes(bytes(range(256)) * 4)
    with pytest.raises(RecordingError, match=name):
        read_table(tmp_path / name)


@pytest.mark.parametrize(
    ("step_s", "line"),
    [
        (1e18, "a time is"),
        (1e300, "a time is"),
        (2.0, "its times are 2 s apart; the allowed range is 1e-06 to 1 s; check the unit"),
        (1e-7, "2 s of samples are needed"),
    ],
)
def test_absurd_time_steps_are_refused(step_s: float, line: str) -> None:
    """Fails when a table whose times have another unit or are nonsense is diagnosed, and agrees with everything."""
    with pytest.raises(RecordingError, match=re.escape(line)) as caught:
        uniform_clock(Path("table.csv"), np.arange(2000.0) * step_s)
    assert "table.csv" in str(caught.value)


@pytest.mark.parametrize("step_s", [1e-4, 0.005, 1.0])
def test_usual_time_steps_are_used(step_s: float) -> None:
    """Fails when the clock of a rig between 1 Hz and 10 kHz is refused."""
    kept, grid = uniform_clock(Path("table.csv"), 1.7e9 + np.arange(30_000.0) * step_s)
    assert len(kept) == 30_000
    np.testing.assert_allclose(np.diff(grid), step_s, rtol=1e-2)
