"""Messages in an MCAP file: chunks with checksums, readable up to the last whole one whatever ended it.

MCAP (mcap.dev) because its files are written as a stream, checked chunk by chunk, and opened by tools that
others wrote. What a message holds is its encoding's business; here it is bytes. A message carries the SHA-256
of its content before the content.

Files may come from anywhere: nothing larger than the file is read, no chunk is unpacked beyond what it says
and what is allowed, and every checksum is checked.
"""

from __future__ import annotations

import hashlib
import os
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from scenarios.errors import BadInput

CHUNK_BYTES = 2**20
MOST_CHUNK_BYTES = 512 * 2**20  # one message may be a picture or a long sweep
DIGEST_BYTES = 32
MAGIC = b"\x89MCAP0\r\n"  # what every MCAP file begins with
LIBRARY = "simbench"


class CutOff(BadInput):
    """The file ends before its end; all whole chunks before were read."""


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
        self._writer = Writer(
            self._file, chunk_size=chunk_bytes, compression=CompressionType.LZ4, enable_data_crcs=True
        )
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
    from mcap.exceptions import McapError
    from mcap.records import Channel, Chunk, Footer, Message
    from mcap.stream_reader import StreamReader, breakup_chunk

    name = str(path)
    channels: dict[int, Any] = {}
    counts: dict[str, int] = {}
    ended = False
    try:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            begin = file.read(len(MAGIC))
            if not MAGIC.startswith(begin):
                raise BadInput("is no MCAP file", file=name)
            file.seek(0)
            bounded = _Bounded(file, size)
            reader = StreamReader(bounded, emit_chunks=True, validate_crcs=True, record_size_limit=size)  # type: ignore[arg-type]
            for record in reader.records:
                ended = ended or isinstance(record, Footer)
                if isinstance(record, Message):
                    raise BadInput("has a message outside of a chunk, which no checksum covers", file=name)
                if isinstance(record, Channel):
                    channels[record.id] = record
                    continue
                if not isinstance(record, Chunk):
                    continue
                for inner in breakup_chunk(_unpacked(record, name)):
                    if isinstance(inner, Channel):
                        channels[inner.id] = inner
                    elif isinstance(inner, Message):
                        entry = _entry(inner, channels, encoding, name)
                        if entry.seq != counts.setdefault(entry.topic, 0):
                            raise BadInput(
                                f"is damaged: message {counts[entry.topic]} of {entry.topic} is missing",
                                file=name,
                            )
                        counts[entry.topic] += 1
                        yield entry
    except FileNotFoundError:
        raise BadInput("no such file", file=name) from None
    except _EndError:
        raise CutOff("is cut off: it ends before its end", file=name) from None
    except BadInput:
        raise
    except OSError as error:
        raise BadInput(f"cannot be read: {error.strerror or error}", file=name) from None
    except (McapError, ValueError, struct.error, KeyError, IndexError, MemoryError, OverflowError) as error:
        raise BadInput(f"is no MCAP file, or is damaged: {_words(error)}", file=name) from None
    if not ended:
        raise CutOff("is cut off: it ends before its end", file=name)


def _entry(message: Any, channels: Mapping[int, Any], encoding: str, name: str) -> Entry:
    channel = channels[message.channel_id]
    if channel.message_encoding != encoding:
        raise BadInput(
            f"{channel.topic[:80]!r} is encoded as {channel.message_encoding[:40]!r}",
            file=name,
            allowed=encoding,
        )
    digest, data = message.data[:DIGEST_BYTES], message.data[DIGEST_BYTES:]
    entry = Entry(
        topic=channel.topic, log_ns=message.log_time, publish_ns=message.publish_time, seq=message.sequence,
        data=data,
    )  # fmt: skip
    if entry.digest != digest:
        raise BadInput(f"message {message.sequence} of {channel.topic} is not what was written", file=name)
    return entry


def _unpacked(chunk: Any, name: str) -> Any:
    """The chunk without its compression, its checksum checked."""
    from mcap.records import Chunk

    size = chunk.uncompressed_size
    if size > MOST_CHUNK_BYTES:
        raise BadInput(f"has a chunk of {size} bytes; {MOST_CHUNK_BYTES} are allowed", file=name)
    data = _decompressed(chunk.compression, chunk.data, size, name)
    if len(data) != size or (zlib.crc32(data) != chunk.uncompressed_crc):
        raise BadInput("is damaged: the checksum of a chunk is wrong", file=name)
    return Chunk(
        compression="", data=data, message_start_time=chunk.message_start_time,
        message_end_time=chunk.message_end_time, uncompressed_crc=chunk.uncompressed_crc,
        uncompressed_size=size,
    )  # fmt: skip


def _decompressed(compression: str, data: bytes, size: int, name: str) -> bytes:
    """Up to one byte more than `size`, whatever the data say of themselves."""
    if compression == "":
        return data
    if compression == "lz4":
        import lz4.frame

        try:
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))
        except (RuntimeError, EOFError) as error:
            raise BadInput(f"is damaged: a chunk cannot be unpacked ({_words(error)})", file=name) from None
    if compression != "zstd":
        raise BadInput(
            f"has chunks compressed by {compression[:40]!r}", file=name, allowed="lz4, zstd or nothing"
        )
    import zstandard

    try:
        with zstandard.ZstdDecompressor(max_window_size=2**27).stream_reader(data) as stream:
            return bytes(stream.read(size + 1))
    except zstandard.ZstdError as error:
        raise BadInput(f"is damaged: a chunk cannot be unpacked ({_words(error)})", file=name) from None


class _EndError(Exception):
    """More was to be read than there is."""


class _Bounded:
    """A file of which no more is asked than it has."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file, self._left = file, size

    def read(self, size: int = -1) -> bytes:
        if size < 0 or size > self._left:
            raise _EndError
        self._left -= size
        return self._file.read(size)


def _words(error: BaseException) -> str:
    return (" ".join(str(error).split()) or type(error).__name__)[:120]
