"""Finding the files of a recording, and one-line errors where there is nothing to read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path, PurePath

import yaml
from mcap.writer import MCAP0_MAGIC

from hand_recording.bag_contents import METADATA

_SQLITE_MAGIC = b"SQLite format 3\x00"
_MAGIC = {".mcap": MCAP0_MAGIC, ".db3": _SQLITE_MAGIC}


class RecordingError(ValueError):
    """A recording cannot be read; the message is one line that names the file and the reason."""

    def __init__(self, message: str) -> None:
        # Names of topics and types come from the file and may contain any character.
        super().__init__("".join(letter if letter.isprintable() else "?" for letter in message))


@dataclass(frozen=True)
class RecordingFiles:
    """Storage files in their order. compressed: whether rosbag2 compressed messages or whole files."""

    path: Path
    files: tuple[Path, ...]
    compressed: bool = False

    @property
    def storage(self) -> str:
        """File name suffix: .mcap or .db3."""
        return self.files[0].suffix


def locate(path: Path) -> RecordingFiles:
    """The storage files of a rosbag2 folder or a bare .mcap or .db3 file. Raises RecordingError."""
    if not path.exists():
        raise RecordingError(f"{path} does not exist")
    found = _in_folder(path) if path.is_dir() else RecordingFiles(path, (path,))
    if not found.compressed:
        for file in found.files:
            _check(file)
    return found


def _in_folder(folder: Path) -> RecordingFiles:
    metadata = folder / METADATA
    if not metadata.is_file():
        if any(any(folder.glob(f"*{ending}")) for ending in (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")):
            raise RecordingError(
                f"{folder} was never closed (no {METADATA}); repair it with: hand record --repair {folder}"
            )
        raise RecordingError(f"{folder} is not a recording: it contains no {METADATA}")
    try:
        content = yaml.safe_load(metadata.read_text(encoding="utf-8"))["rosbag2_bagfile_information"]
        files = tuple(folder / PurePath(name).name for name in content["relative_file_paths"])
        compressed = str(content.get("compression_mode") or "none").lower() != "none"
    except (OSError, UnicodeDecodeError, yaml.YAMLError, KeyError, TypeError, AttributeError) as error:
        raise RecordingError(f"{metadata} is not rosbag2 metadata: {_brief(error)}") from error
    missing = [file.name for file in files if not file.is_file()]
    if missing or not files:
        raise RecordingError(f"{folder} lacks its file {', '.join(missing) or '(none is listed)'}")
    return RecordingFiles(folder, files, compressed)


def _check(file: Path) -> None:
    if file.suffix == ".zstd":
        raise RecordingError(
            f"{file} is one compressed file of a recording; give its folder, {file.parent}, or unpack it with: zstd -d"
        )
    if file.suffix not in _MAGIC:
        raise RecordingError(f"{file} is not a recording: neither a folder nor a .mcap or .db3 file")
    magic = _MAGIC[file.suffix]
    with file.open("rb") as stream:
        head = stream.read(len(magic))
        if not head:
            raise RecordingError(f"{file} is empty (0 bytes)")
        if head != magic:
            raise RecordingError(f"{file} is not a {file.suffix} file: it begins with other bytes")
        if file.suffix == ".mcap":
            stream.seek(-min(len(magic), file.stat().st_size), 2)
            if stream.tell() < len(magic) or stream.read() != magic:
                raise RecordingError(f"{file} is cut off: no end mark; repair it with: hand record --repair {file}")


def damaged(file: Path, error: Exception) -> RecordingError:
    """The error for a file whose bytes a library could not read."""
    remedy = (
        f"; the undamaged messages can be saved with: hand record --repair {file}" if file.suffix == ".mcap" else ""
    )
    return RecordingError(f"{file} is damaged: {_brief(error)}{remedy}")


def _brief(error: Exception) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}"[:120] if text else type(error).__name__
