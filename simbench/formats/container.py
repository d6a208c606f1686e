"""Messages in an MCAP file: chunks with checksums, readable up to the last whole one whatever ended it.

MCAP (mcap.dev) because its files are written as a stream, checked chunk by chunk, and opened by tools that
others wrote. What a message holds is its encoding's business; here it is bytes. A message carries the SHA-256
of its content before the content.

Files may come from anywhere (`mcap_records.py` reads them), and every checksum is checked.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from scenarios.errors import BadInput
from simbench.formats.mcap_records import CutOff, Found, read_records

__all__ = ["CutOff", "Entry", "LogWriter", "read_log"]

CHUNK_BYTES = 2**20
DIGEST_BYTES = 32
MOST_GROWTH = 50  # times the file's size, unpacked: what `LogWriter` writes grows to two to ten times
LIBRARY = "simbench"


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One message. log_ns: when it arrived; publish_ns: what its stamp claims, at least 0. seq: counts the
    topic's messages from 0, without a gap."""

    topic: str
    log_ns: int
    publish_ns: int
    seq: int
    data: bytes

    @property
    def digest(self) -> bytes:
        """SHA-256 of the content."""
        return hashlib.sha256(self.data).digest()


class LogWriter:
    """Writes an MCAP file, chunk by chunk. encoding: what messages are; schemas: a name and a description by
    topic. A context manager; without `close` the file has no end, and its whole chunks are there."""

    def __init__(
        self,
        path: Path,
        *,
        encoding: str,
        describe: Callable[[str], tuple[str, str]],
        chunk_bytes: int = CHUNK_BYTES,
    ) -> None:
        from mcap.writer import CompressionType, Writer

        self._file = path.open("wb")
        self._writer = Writer(self._file, chunk_size=chunk_bytes, compression=CompressionType.LZ4)
        self._writer.start(profile="", library=LIBRARY)
        self._encoding, self._describe = encoding, describe
        self._channels: dict[str, int] = {}
        self._all = hashlib.sha256()

    def __enter__(self) -> LogWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def add(
        self, topic: str, content: Sequence[bytes | memoryview], *, log_ns: int, publish_ns: int, seq: int
    ) -> None:
        """Write one message (see `Entry`), its content in pieces."""
        if topic not in self._channels:
            name, text = self._describe(topic)
            schema = self._writer.register_schema(name=name, encoding="", data=text.encode("utf-8"))
            self._channels[topic] = self._writer.register_channel(
                topic=topic, message_encoding=self._encoding, schema_id=schema
            )
        hashed = hashlib.sha256()
        for piece in content:
            hashed.update(piece)
        self._all.update(hashed.digest())
        self._writer.add_message(
            channel_id=self._channels[topic], log_time=log_ns, publish_time=publish_ns, sequence=seq,
            data=b"".join((hashed.digest(), *content)),
        )  # fmt: skip
        self._file.flush()  # whole chunks are out of this process, whatever becomes of it

    def close(self) -> str:
        """End the file; the hash of all messages in their order, in hexadecimal."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()
        return self._all.hexdigest()


def read_log(path: Path, *, encoding: str) -> Iterator[Entry]:
    """All messages, chunk by chunk. BadInput: this is no such file, or it is damaged. CutOff: it ends too
    early; what came before is whole."""
    name = str(path)
    counts: dict[str, int] = {}
    for found in read_records(path, checked=True, most_growth=MOST_GROWTH):
        if not isinstance(found, Found):
            continue
        entry = _entry(found, encoding, name)
        if entry.seq != counts.setdefault(entry.topic, 0):
            missing = f"message {counts[entry.topic]} of {entry.topic[:80]} is missing"
            raise BadInput(f"is damaged: {missing}", file=name)
        counts[entry.topic] += 1
        yield entry


def _entry(found: Found, encoding: str, name: str) -> Entry:
    channel = found.channel
    if channel.message_encoding != encoding:
        raise BadInput(
            f"{channel.topic[:80]!r} is encoded as {channel.message_encoding[:40]!r}",
            file=name,
            allowed=encoding,
        )
    digest, data = found.data[:DIGEST_BYTES], found.data[DIGEST_BYTES:]
    entry = Entry(
        topic=channel.topic, log_ns=found.log_ns, publish_ns=found.publish_ns, seq=found.sequence, data=data
    )
    if entry.digest != digest:
        raise BadInput(f"message {found.sequence} of {channel.topic[:80]} is not what was written", file=name)
    return entry
