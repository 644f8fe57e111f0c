"""A recording in SQLite3, written by rosbags and committed twice a second."""

from __future__ import annotations

from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer

from hand_recording.bag_contents import Contents, Topic, TopicCount

COMMIT_AGE_NS = 500_000_000


class SqliteBag:
    """A BagWriter: the folder NAME with NAME.db3 and metadata.yaml in it."""

    def __init__(self, path: Path) -> None:
        """Start the folder `path`, which must not exist. Raises OSError."""
        path.parent.mkdir(parents=True, exist_ok=True)
        self.contents = Contents()
        self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
        self._writer.open()
        self._connections: dict[str, Connection] = {}
        self._now_ns = self._oldest_ns = 0
        self._open = False
        self._commit()

    def add_topic(self, topic: Topic) -> None:
        """See BagWriter."""
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
        self._writer.write(self._connections[topic], log_ns, raw)
        self.contents.topics[topic].add(log_ns, len(raw))

    def tick(self, now_ns: int) -> None:
        """See BagWriter."""
        self._now_ns = now_ns
        if self._open and now_ns - self._oldest_ns >= COMMIT_AGE_NS:
            self._commit()

    def close(self) -> None:
        """See BagWriter. Harmless when repeated."""
        if self._writer.storage is not None:
            self._writer.close()

    def _commit(self) -> None:
        """Commit the transaction, which rosbags would otherwise keep open until the bag is closed."""
        assert isinstance(self._writer.storage, Sqlite3Writer)
        self._writer.storage.conn.commit()
        self._open = False
