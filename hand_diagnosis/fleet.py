"""Many recordings, each diagnosed by itself on the cores of this computer or on a dask cluster: a table of findings.

A recording that has a report of the same file, model and options is not diagnosed again, so an interrupted run
continues where it stopped.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from hand_diagnosis.api import diagnose
from hand_diagnosis.machine_report import write_machine_report
from hand_diagnosis.pages.headline import words_of
from hand_machine.machine import load_machine
from hand_model.description import load_hand
from hand_model.kernel.hooks import equations_key
from hand_recording.signal_files import read_signals

KEY = "made_from"
COLUMNS = ("recording", "verdict", "rank", "joint", "place", "effect", "probability", "statement", "error")
WHOLE = "whole"
"""Of a row, what the machine is called; only for the summary."""


@dataclass(frozen=True, slots=True)
class Job:
    """One recording with everything its report depends on, in plain types, so that it can be sent to another computer.

    tolerance: relative standard deviation of the nominal numbers [-].  of_machine: whether `model` is the file of
    another machine than a hand.  made: version, command, seed and model's hash of the run, to which the entry `made` of
    report.json adds date and duration of this recording; a report that exists keeps its own.
    """

    recording: str
    model: str
    mapping: str | None
    out: str
    tolerance: float
    seed: int
    joints: tuple[str, ...]
    without: tuple[str, ...]
    sensor_curve: bool | None
    of_machine: bool = False
    made: Mapping[str, Any] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """A hash of the recording's file, the model's text, the options and the equations of the catalogue."""
        path = Path(self.recording)
        files = sorted(path.rglob("*")) if path.is_dir() else [path]
        sizes = [(file.name, file.stat().st_size, file.stat().st_mtime_ns) for file in files if file.is_file()]
        model = Path(self.model).read_bytes()
        options = (self.mapping, self.tolerance, self.seed, self.joints, self.without, self.sensor_curve)
        return hashlib.sha256(repr((sizes, model, options, equations_key())).encode()).hexdigest()[:16]


def report_folder(recording: Path, out: Path) -> Path:
    """The folder in `out` for the report of a recording, whichever others there are.

    Its name ends with a hash of the path from `out` to the recording, so that both can be moved together.
    """
    path = os.path.relpath(recording, out)
    return out / f"{recording.stem}_{hashlib.sha256(path.encode()).hexdigest()[:8]}"


def run_job(job: Job) -> list[dict[str, Any]]:
    """Diagnose one recording, unless it has a report already; rows of the table. A bad recording raises nothing."""
    out = Path(job.out)
    stamp = out / KEY
    report = out / "report.json"
    try:
        key = job.key
        if not (report.exists() and stamp.exists() and stamp.read_text(encoding="utf-8") == key):
            (_diagnose_machine if job.of_machine else _diagnose_hand)(job)
            stamp.write_text(key, encoding="utf-8")
        return _rows(job.recording, json.loads(report.read_text(encoding="utf-8")))
    except Exception as error:  # the other recordings are diagnosed whatever this one contains
        return [dict.fromkeys(COLUMNS) | {"recording": job.recording, "verdict": "unusable", "error": str(error)}]


def _made(job: Job, begun_s: float) -> dict[str, Any]:
    """The entry `made` of a report that began at this time [s] of time.monotonic."""
    date = datetime.now(UTC).isoformat(timespec="seconds")
    return {**job.made, "date": date, "duration_s": round(time.monotonic() - begun_s, 1)}


def _diagnose_hand(job: Job) -> None:
    begun_s = time.monotonic()
    hand = load_hand(job.model)
    signals = read_signals([Path(job.recording)], hand, Path(job.mapping) if job.mapping else None)
    report = diagnose(
        signals,
        hand,
        tolerance=job.tolerance,
        seed=job.seed,
        joints=job.joints,
        without=job.without,
        sensor_curve=job.sensor_curve,
        names=[job.recording],
    )
    report.write(job.out, made=_made(job, begun_s))


def _diagnose_machine(job: Job) -> None:
    begun_s = time.monotonic()
    machine = load_machine(Path(job.model), [Path(job.recording)], to_fit=True)
    write_machine_report(
        machine,
        [job.recording],
        Path(job.out),
        tolerance=job.tolerance,
        seed=job.seed,
        without=job.without,
        made=lambda: _made(job, begun_s),
    )


def _rows(recording: str, content: dict[str, Any]) -> list[dict[str, Any]]:
    plain = dict.fromkeys(COLUMNS) | {"recording": recording, "verdict": content["verdict"]}
    plain[WHOLE] = words_of(content).whole.removeprefix("the ")
    named = ("rank", "joint", "place", "effect", "probability", "statement")
    rows = [plain | {key: finding[key] for key in named} for finding in content["findings"]]
    first = len(rows) + 1
    rows += [
        plain | {"rank": first + k, "effect": "unknown"} | {key: left[key] for key in named[1:] if key != "effect"}
        for k, left in enumerate(content["remainder"])
    ]
    return rows or [plain]


@dataclass(frozen=True, slots=True)
class Cluster:
    """A dask scheduler: its address; for tls:// also the files of the authority, of our certificate and of its key."""

    address: str
    ca: Path | None = None
    certificate: Path | None = None
    key: Path | None = None

    def check(self) -> None:
        """Raises ValueError where files and address do not fit, or a file is missing."""
        files = {"--tls-ca": self.ca, "--tls-cert": self.certificate, "--tls-key": self.key}
        given = [name for name, path in files.items() if path is not None]
        if self.address.startswith("tls://") and len(given) < len(files):
            raise ValueError(f"--scheduler {self.address} needs {', '.join(files)}")
        if given and not self.address.startswith("tls://"):
            raise ValueError(f"{given[0]} needs a --scheduler address that begins with tls://, not {self.address}")
        for name, path in files.items():
            if path is not None and not path.is_file():
                raise ValueError(f"{name} {path} is not a file")

    def security(self) -> Any:
        """What dask needs for TLS; None without. Raises ValueError for files that are not PEM."""
        if self.ca is None:
            return None
        from distributed.security import Security  # noqa: PLC0415 - only for fleets

        files = {"tls_ca_file": self.ca, "tls_client_cert": self.certificate, "tls_client_key": self.key}
        security = Security(require_encryption=True, **{name: str(path) for name, path in files.items()})
        try:
            security.get_connection_args("client")
        except OSError as error:  # ssl.SSLError is one
            raise ValueError(f"--tls-ca, --tls-cert and --tls-key cannot be used: {error.args[-1]}") from error
        return security


def run_fleet(jobs: Sequence[Job], workers: int, cluster: Cluster | None) -> Iterator[list[dict[str, Any]]]:
    """Rows of each recording as it is done, on `workers` processes here or on a cluster.

    Raises OSError where the cluster does not answer, ValueError where its certificates cannot be used.
    """
    if workers == 1 and cluster is None:
        yield from map(run_job, jobs)
        return
    from distributed import Client, LocalCluster, as_completed  # noqa: PLC0415 - only for fleets

    local = None
    if cluster is None:
        local = LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address="127.0.0.1:0")
    try:
        where = (local, None) if cluster is None else (cluster.address, cluster.security())
        with Client(where[0], security=where[1], timeout=20) as client:
            waiting = client.map(run_job, list(jobs), pure=False)
            for future in as_completed(waiting):
                yield future.result()
    finally:
        if local is not None:
            local.close()


def write_table(rows: Sequence[dict[str, Any]], out: Path) -> dict[str, Any]:
    """findings.parquet and summary.json: verdicts, effects, and effects by joint, counted over recordings."""
    import pyarrow as pa  # noqa: PLC0415 - only for fleets
    import pyarrow.parquet as pq  # noqa: PLC0415 - as above

    out.mkdir(parents=True, exist_ok=True)
    types = {"rank": pa.int64(), "probability": pa.float64()}
    fields = pa.schema([(name, types.get(name, pa.string())) for name in COLUMNS])
    ordered = sorted(rows, key=lambda row: (row["recording"], row["rank"] or 0))
    pq.write_table(pa.Table.from_pylist(ordered, schema=fields), out / "findings.parquet")
    verdicts = Counter({row["recording"]: row["verdict"] for row in rows}.values())
    found = [row for row in rows if row["effect"]]
    summary = {
        "recordings": len({row["recording"] for row in rows}),
        "verdicts": dict(verdicts),
        "effects": dict(Counter(row["effect"] for row in found).most_common()),
        "by_joint": dict(Counter(f"{row['joint'] or row[WHOLE]}: {row['effect']}" for row in found).most_common()),
    }
    (out / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    return summary
