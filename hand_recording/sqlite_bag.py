"""A recording in SQLite3, written by rosbags and committed twice a second."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from errno import EIO, ENOSPC
from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer

from hand_model.yaml_document import yaml_text
from hand_recording.bag_contents import METADATA_VERSION, Contents, Topic, TopicCount, metadata, write_metadata

COMMIT_AGE_NS = 500_000_000


class SqliteBag:
    """A BagWriter: the folder NAME with NAME_0.db3, as rosbag2 names it, and metadata.yaml in it."""

    def __init__(self, path: Path) -> None:
        """Start the folder `path`, which must not exist. Raises OSError."""
        path.parent.mkdir(parents=True, exist_ok=True)
        self.contents = Contents()
        self._folder = path
        self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
        self._connections: dict[str, Connection] = {}
        self._now_ns = self._oldest_ns = 0
        self._open = self._failed = False
        with self._writing():
            self._writer.open()
            self._rename(path / f"{path.name}_0.db3")
            self._commit()

    def _rename(self, file: Path) -> None:
        """Give the file that rosbags has made the name, and the record of its ROS distribution, of rosbag2."""
        storage = self._storage
        storage.conn.close()
        storage.path.rename(file)
        storage.path = file
        storage.conn = sqlite3.connect(file)
        storage.cursor = storage.conn.cursor()
        storage.conn.execute("UPDATE schema SET ros_distro = 'jazzy'")

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Turn an error of SQLite into the OSError that it stands for: a full disk, or another failure of writing."""
        try:
            yield
        except sqlite3.Error as error:
            self._failed = True
            code = ENOSPC if "full" in str(error) else EIO
            raise OSError(code, str(error), str(self._folder)) from error

    @property
    def _storage(self) -> Sqlite3Writer:
        assert isinstance(self._writer.storage, Sqlite3Writer)
        return self._writer.storage

    def add_topic(self, topic: Topic) -> None:
        """See BagWriter."""
        with self._writing():
            self._connections[topic.name] = self._writer.add_connection(
                topic.name,
                topic.type,
                msgdef=topic.definition,
                rihs01=topic.type_hash,
                offered_qos_profiles=topic.qos,
            )
        self.contents.topics[topic.name] = TopicCount(topic)

    def write(self, topic: str, raw: bytes, log_ns: int, publish_ns: int, sequence: int = 0) -> None:
        """See BagWriter."""
        if not self._open:
            self._open, self._oldest_ns = True, self._now_ns
        with self._writing():
            self._writer.write(self._connections[topic], log_ns, raw)
        self.contents.topics[topic].add(log_ns, len(raw))

    def tick(self, now_ns: int) -> None:
        """See BagWriter."""
        self._now_ns = now_ns
        if self._open and now_ns - self._oldest_ns >= COMMIT_AGE_NS:
            with self._writing():
                self._commit()

    def close(self) -> None:
        """See BagWriter. Harmless when repeated.

        Raises OSError where the disk is full. After a failure the file is complete up to its last commit, and there is
        no metadata.yaml.
        """
        if self._writer.storage is None:
            return
        storage, self._writer.storage = self._storage, None
        content = metadata("sqlite3", storage.path.name, self.contents)
        try:
            with self._writing():
                if not self._failed:
                    storage.close(METADATA_VERSION, yaml_text(content).strip())
        finally:
            if self._failed:
                with suppress(sqlite3.Error):
                    storage.abort()
        if not self._failed:
            write_metadata(self._folder, content)

    def _commit(self) -> None:
        """Commit the transaction, which rosbags would otherwise keep open until the bag is closed."""
        self._storage.conn.commit()
        self._open = False
