"""The Python interface of the diagnosis; the command `hand diagnose` uses it, too.

    from hand_diagnosis import diagnose, read_recording

    report = diagnose([read_recording("run.mcap", "config/hand.yaml")], "config/hand.yaml")
    print(report.verdict, [finding["effect"] for finding in report.findings])
    report.write("out/diagnosis")

It is stable: names and meanings change only with a new schema of report.json.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from hand_diagnosis.detection import detection_limits
from hand_diagnosis.diagnosis import Diagnosis
from hand_diagnosis.diagnosis import diagnose as run_diagnosis
from hand_diagnosis.pages.page import write_page
from hand_diagnosis.patch import write_patch
from hand_diagnosis.problem import effects_without
from hand_diagnosis.report import document, write_report
from hand_diagnosis.settings import SETTINGS
from hand_model.description import Hand, load_hand
from hand_recording.signal_files import read_signals
from hand_recording.signals import Signals
from hand_recording.version import version


@dataclass(frozen=True, slots=True)
class Report:
    """A diagnosis as report.json holds it, schema 2.

    content: report.json.  diagnosis: the fits behind it, for figures and further analysis; not part of the stable
    interface.  hand: the nominal model.
    """

    content: Mapping[str, Any]
    diagnosis: Diagnosis
    hand: Hand

    @property
    def verdict(self) -> str:
        """agrees, explained, partly_explained, unknown_physics, or unusable where no joint was diagnosed."""
        return str(self.content["verdict"])

    @property
    def findings(self) -> list[dict[str, Any]]:
        """Named effects, the first explains most."""
        return list(self.content["findings"])

    @property
    def remainder(self) -> list[dict[str, Any]]:
        """What is probably physics that no effect of the catalogue explains."""
        return list(self.content["remainder"])

    @property
    def not_judged(self) -> dict[str, str]:
        """The reason for each joint that was recorded and not diagnosed."""
        return {row["joint"]: row["reason"] for row in self.content["not_judged"]}

    @property
    def next_experiment(self) -> dict[str, str] | None:
        """The experiment to record next; None where nothing is uncertain."""
        return self.content["next_experiment"]  # type: ignore[no-any-return]

    def write(self, folder: str | Path, *, page: bool = True, made: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Write report.json, model.yaml and its patch into a folder, made where it is missing, and the page.

        Returns the content of report.json.  made: its entry `made`; by default date, version and the model's hash.
        OSError: not writable.
        """
        out = Path(folder)
        whole = {**self.content, "made": made_now(self.hand) if made is None else dict(made)}
        content, _ = write_report(self.diagnosis, self.hand, self.content["recordings"], out, whole)
        write_patch(content, self.hand.path, out)
        if page:
            write_page(self.diagnosis, content, out, self.hand)
        return content


def made_now(hand: Hand) -> dict[str, Any]:
    """Date, version and the SHA-256 of the file of the model, as they are now; without the hash where it is gone."""
    entry = {"date": datetime.now(UTC).isoformat(timespec="seconds"), "version": version()}
    if hand.path.is_file():
        entry["model_sha256"] = hashlib.sha256(hand.path.read_bytes()).hexdigest()
    return entry


def read_recording(path: str | Path, model: str | Path | Hand, *, mapping: str | Path | None = None) -> Signals:
    """Read a rosbag2 recording, or a CSV or Parquet table through a mapping file, as signals of the model's joints.

    Raises RecordingError or DescriptionError (ValueErrors of one line) for what cannot be used.
    """
    hand = model if isinstance(model, Hand) else load_hand(Path(model))
    return read_signals([Path(path)], hand, None if mapping is None else Path(mapping))[0]


def diagnose(
    recordings: Sequence[Signals],
    model: str | Path | Hand,
    *,
    tolerance: float = SETTINGS.default_tolerance,
    seed: int = 0,
    joints: Sequence[str] = (),
    without: Sequence[str] = (),
    sensor_curve: bool | None = None,
    reruns: Sequence[Signals] = (),
    names: Sequence[str] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> Report:
    """Diagnose recordings of a hand against its model.

    model: hand.yaml, or the hand loaded from it.  tolerance: relative standard deviation of the nominal numbers [-].
    joints: those to diagnose, all that move where none is given.  without: effects left out of the search.
    sensor_curve: whether angles are readings of the described Hall sensors; None: what fits better.  reruns: recordings
    of the same commands.  names: of the recordings in the report, else those of the signals.  progress: called with
    each joint that is done.  Raises ValueError for joints or effects that do not exist, and for a re-run of other
    commands.
    """
    hand = model if isinstance(model, Hand) else load_hand(Path(model))
    result = run_diagnosis(
        recordings,
        hand,
        tolerance=tolerance,
        seed=seed,
        joints=joints,
        without=without,
        sensor_curve=sensor_curve,
        reruns=reruns,
        progress=progress,
    )
    content = document(result, list(names) or [recording.name for recording in recordings], str(hand.path))
    content["detection_limits"] = detection_limits(result, effects_without(without, hand))
    return Report(content, result, hand)
