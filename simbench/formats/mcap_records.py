"""The records of any MCAP file that nobody vouches for, one by one.

Nothing larger than the file is read, no chunk is unpacked beyond what it says and what is allowed, all chunks
together not beyond what a file of that size can honestly hold, and every checksum that is there is checked.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from scenarios.errors import BadInput
from simbench.files import open_plain

if TYPE_CHECKING:
    from mcap.records import Channel, Metadata, Schema

MOST_CHUNK_BYTES = 512 * 2**20  # one message may be a picture or a long sweep
MOST_GROWTH = 1000  # times the file's size, of all chunks together; zeros grow more, no recording does
FREE_BYTES = 64 * 2**20  # that may be unpacked whatever the file's size
MAGIC = b"\x89MCAP0\r\n"  # what every MCAP file begins with
BYTES_A_RECORD = 4  # of the file, at least, however well it is packed
FREE_RECORDS = 100_000
COMPRESSIONS = ("lz4", "zstd", "")
_HEAD = struct.Struct("<BQ")  # opcode, length
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_SCHEMA_CODE, _CHANNEL_CODE, _MESSAGE_CODE = 3, 4, 5


class CutOff(BadInput):
    """The file ends before its end; all whole chunks before were read."""


@dataclass(frozen=True, kw_only=True)
class Found:
    """One message as it lies in the file. schema: None where its channel names none."""

    channel: Channel
    schema: Schema | None
    sequence: int
    log_ns: int
    publish_ns: int
    data: bytes


def read_records(
    path: Path, *, checked: bool, most_chunk_bytes: int = MOST_CHUNK_BYTES, most_growth: int = MOST_GROWTH
) -> Iterator[Found | Metadata]:
    """All messages, and the metadata records between them, in the order of the file.

    checked: every message must be covered by a checksum; else those that are there must be right.
    most_growth: how many times its size the file may unpack to. BadInput: this is no such file, or it is
    damaged. CutOff: it ends too early; what came before is whole.
    """
    from mcap.exceptions import McapError

    name = str(path)
    ended = False
    try:
        with open_plain(path) as file:
            size = os.fstat(file.fileno()).st_size
            begin = file.read(len(MAGIC))
            if not MAGIC.startswith(begin):
                raise BadInput("is no MCAP file", file=name)
            file.seek(0)
            bounded = _Bounded(file, size)
            reading = _Reading(
                name=name, checked=checked, most=most_chunk_bytes, size=size, growth=most_growth
            )
            yield from reading.records(bounded, size)
            ended = reading.ended
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


class _Reading:
    """What is known of a file of `size` bytes while it is read. bytes_left: that may still be unpacked;
    records_left: that may still be met in chunks. found: messages so far."""

    def __init__(self, *, name: str, checked: bool, most: int, size: int, growth: int) -> None:
        self.name, self.checked, self.most, self.growth = name, checked, most, growth
        self.bytes_left = FREE_BYTES + growth * size
        self.records_left = FREE_RECORDS + size // BYTES_A_RECORD
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self.found = 0
        self.ended = False

    def records(self, file: _Bounded, size: int) -> Iterator[Found | Metadata]:
        from mcap.records import Channel, Chunk, Footer, Message, Metadata, Schema, Statistics
        from mcap.stream_reader import StreamReader

        most = max(size, 2 * self.most)  # what is longer is no record; what only ends too late is cut off
        reader = StreamReader(file, emit_chunks=True, validate_crcs=True, record_size_limit=most)  # type: ignore[arg-type]
        for record in reader.records:
            self.ended = self.ended or isinstance(record, Footer)
            if isinstance(record, Message):
                if self.checked:
                    raise BadInput(
                        "has a message outside of a chunk, which no checksum covers", file=self.name
                    )
                yield self._found(
                    record.channel_id, record.sequence, record.log_time, record.publish_time, record.data
                )
            elif isinstance(record, Channel):
                self.channels[record.id] = record
            elif isinstance(record, Schema):
                self.schemas[record.id] = record
            elif isinstance(record, Metadata):
                yield record
            elif isinstance(record, Statistics):
                if self.checked and record.message_count != self.found:  # a chunk was passed over
                    counts = f"holds {self.found} messages, and counts {record.message_count}"
                    raise BadInput(f"is damaged: {counts}", file=self.name)
            elif isinstance(record, Chunk):
                yield from self._messages(self._unpacked(record))

    def _messages(self, data: bytes) -> Iterator[Found]:
        """The messages of an unpacked chunk, one at a time: there may be millions."""
        from mcap.data_stream import ReadDataStream
        from mcap.records import Channel, Schema

        at = 0
        while at < len(data):
            code, length = _HEAD.unpack_from(data, at)
            begin, at = at + _HEAD.size, at + _HEAD.size + length
            self.records_left -= 1
            if at > len(data):
                raise ValueError("a record reaches beyond its chunk")
            if self.records_left < 0:
                raise BadInput("has more messages than a file of its size can hold", file=self.name)
            if code == _MESSAGE_CODE:
                if length < _MESSAGE.size:
                    raise ValueError(f"a message of {length} bytes")
                channel_id, sequence, log_ns, publish_ns = _MESSAGE.unpack_from(data, begin)
                content = data[begin + _MESSAGE.size : at]
                yield self._found(channel_id, sequence, log_ns, publish_ns, content)
            elif code == _CHANNEL_CODE:
                channel = Channel.read(ReadDataStream(BytesIO(data[begin:at])))
                self.channels[channel.id] = channel
            elif code == _SCHEMA_CODE:
                schema = Schema.read(ReadDataStream(BytesIO(data[begin:at])))
                self.schemas[schema.id] = schema

    def _found(self, channel: int, sequence: int, log_ns: int, publish_ns: int, data: bytes) -> Found:
        known = self.channels[channel]
        schema = self.schemas[known.schema_id] if known.schema_id else None
        self.found += 1
        return Found(
            channel=known, schema=schema, sequence=sequence, log_ns=log_ns, publish_ns=publish_ns, data=data
        )

    def _unpacked(self, chunk: Any) -> bytes:
        """A chunk's records without their compression, their checksum checked."""
        size = chunk.uncompressed_size
        if size > self.most:
            raise BadInput(f"has a chunk of {size} bytes; {self.most} are allowed", file=self.name)
        self.bytes_left -= size
        if self.bytes_left < 0:
            raise BadInput(f"unpacks to more than {self.growth} times its size", file=self.name)
        if chunk.compression not in COMPRESSIONS:
            raise BadInput(
                f"has chunks compressed by '{chunk.compression[:40]}'", file=self.name,
                allowed=", ".join(word or "nothing" for word in COMPRESSIONS),
            )  # fmt: skip
        data = _decompressed(chunk.compression, chunk.data, size, self.name)
        told = chunk.uncompressed_crc
        if len(data) != size or (zlib.crc32(data) != told and (self.checked or told)):
            raise BadInput("is damaged: the checksum of a chunk is wrong", file=self.name)
        return data


def _decompressed(compression: str, data: bytes, size: int, name: str) -> bytes:
    """Up to one byte more than `size`, whatever the data say of themselves."""
    if compression == "":
        return data
    import lz4.frame
    import zstandard

    try:
        if compression == "lz4":
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))
        with zstandard.ZstdDecompressor(max_window_size=2**27).stream_reader(data) as stream:
            return bytes(stream.read(size + 1))
    except (RuntimeError, EOFError, zstandard.ZstdError) as error:
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
