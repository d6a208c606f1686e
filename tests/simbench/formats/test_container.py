"""Messages in an MCAP file: what is read is what was written, or it is said to be damaged or cut off."""

from __future__ import annotations

import struct
import subprocess
import sys
import time
import zlib
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from scenarios.errors import BadInput
from simbench.formats.container import CutOff, Entry, LogWriter, read_log
from simbench.formats.mcap_records import MAGIC

ENCODING = "test/1"
ROOT = Path(__file__).parents[3]
FILES = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def entries(count: int = 60) -> list[Entry]:
    """Three topics by turns, some bytes each."""
    return [
        Entry(topic=f"/t{i % 3}", log_ns=10 * i, publish_ns=7 * i, seq=i // 3, data=bytes([i]) * (100 + i))
        for i in range(count)
    ]


def write(path: Path, messages: list[Entry], *, end: bool = True) -> bytes:
    with LogWriter(path, encoding=ENCODING, describe=lambda t: (t, "words"), chunk_bytes=1000) as log:
        for message in messages:
            log.add(
                message.topic, [message.data[:7], message.data[7:]], log_ns=message.log_ns,
                publish_ns=message.publish_ns, seq=message.seq,
            )  # fmt: skip
        if end:
            log.close()
    return path.read_bytes()


def read(path: Path) -> tuple[list[Entry], BadInput | None]:
    found = []
    try:
        for entry in read_log(path, encoding=ENCODING):
            found.append(entry)
    except BadInput as error:
        return found, error
    return found, None


def test_messages_come_back_in_their_order(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", entries())
    assert read(tmp_path / "a.mcap") == (entries(), None)


def test_an_independent_reader_finds_the_same_messages(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", entries())
    with (tmp_path / "a.mcap").open("rb") as file:
        found = [
            (c.topic, m.log_time, m.publish_time, m.sequence, m.data[32:])
            for _, c, m in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False)
        ]
    assert found == [(e.topic, e.log_ns, e.publish_ns, e.seq, e.data) for e in entries()]


def test_a_writer_that_never_ended_leaves_its_whole_chunks(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", entries(), end=False)
    found, error = read(tmp_path / "a.mcap")
    assert isinstance(error, CutOff)
    assert found == entries()[: len(found)] and 45 < len(found) < 60


def test_a_chunk_that_is_called_something_else_is_missed(tmp_path: Path) -> None:
    """Readers skip records that they do not know; the file's own count of its messages tells of it."""
    whole = bytearray(write(tmp_path / "a.mcap", entries()))
    at, chunks = len(MAGIC), []
    while at + 9 < len(whole) - len(MAGIC):
        code, length = struct.unpack_from("<BQ", whole, at)
        chunks += [at] if code == 6 else []
        at += 9 + length
    whole[chunks[-1]] = 0x80  # of private use
    (tmp_path / "b.mcap").write_bytes(whole)
    found, error = read(tmp_path / "b.mcap")
    assert found == entries()[: len(found)] and len(found) < 60
    assert error is not None and f"holds {len(found)} messages, and counts 60" in str(error)


WRITER = """
import sys
from pathlib import Path
from simbench.formats.container import LogWriter
path, words = Path(sys.argv[1]), lambda topic: (topic, "words")
with LogWriter(path, encoding="test/1", describe=words, chunk_bytes=1000) as log:
    for i in range(10**9):
        log.add(f"/t{i % 3}", [bytes([i % 256]) * 100], log_ns=i, publish_ns=i, seq=i // 3)
"""


def test_a_writer_that_is_killed_leaves_all_chunks_but_the_last(tmp_path: Path) -> None:
    path = tmp_path / "killed.mcap"
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], cwd=ROOT)
    try:
        deadline = time.monotonic() + 60
        while (not path.exists() or path.stat().st_size < 200_000) and time.monotonic() < deadline:
            time.sleep(0.01)
    finally:
        process.kill()
        process.wait()
    found, error = read(path)
    assert isinstance(error, CutOff)
    assert len(found) > 1000
    assert all(e.data == bytes([e.log_ns % 256]) * 100 and e.log_ns == i for i, e in enumerate(found))


@FILES
@given(st.data())
def test_a_file_that_is_cut_off_gives_what_came_before_and_says_so(
    tmp_path: Path, data: st.DataObject
) -> None:
    whole = write(tmp_path / "a.mcap", entries())
    (tmp_path / "b.mcap").write_bytes(whole[: data.draw(st.integers(0, len(whole) - 1))])
    found, error = read(tmp_path / "b.mcap")
    assert error is not None
    assert found == entries()[: len(found)]


@FILES
@given(st.data())
def test_a_file_with_changed_bytes_gives_nothing_else_than_was_written(
    tmp_path: Path, data: st.DataObject
) -> None:
    whole = bytearray(write(tmp_path / "a.mcap", entries()))
    for at in data.draw(st.lists(st.integers(0, len(whole) - 1), min_size=1, max_size=4)):
        whole[at] = data.draw(st.integers(0, 255))
    (tmp_path / "b.mcap").write_bytes(whole)
    found, error = read(tmp_path / "b.mcap")
    assert found == entries()[: len(found)]
    assert error is not None or len(found) == len(entries())


@given(st.binary(max_size=400))
@FILES
def test_any_bytes_are_read_or_refused_in_one_sentence(tmp_path: Path, noise: bytes) -> None:
    for content in (noise, b"\x89MCAP0\r\n" + noise):
        (tmp_path / "n.mcap").write_bytes(content)
        found, error = read(tmp_path / "n.mcap")
        assert not found and error is not None and "\n" not in str(error)


def chunk(data: bytes, size: int, crc: int, compression: bytes = b"zstd") -> bytes:
    body = struct.pack("<QQQI", 0, 0, size, crc) + struct.pack("<I", len(compression)) + compression
    body += struct.pack("<Q", len(data)) + data
    header = struct.pack("<I", 0) + struct.pack("<I", 0)
    return (
        b"\x89MCAP0\r\n"
        + b"\x01"
        + struct.pack("<Q", len(header))
        + header
        + b"\x06"
        + struct.pack("<Q", len(body))
        + body
    )


BOMB = zstandard.compress(bytes(64 * 2**20))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (chunk(BOMB, 1000, 0), "checksum of a chunk is wrong"),  # says 1,000 bytes, holds 64 MB
        (chunk(BOMB, 2**40, 0), "are allowed"),
        (chunk(b"x" * 20, 20, zlib.crc32(b"y")), "cannot be unpacked"),
        (chunk(lz4.frame.compress(bytes(64 * 2**20)), 1000, 0, b"lz4"), "checksum of a chunk is wrong"),
        (chunk(b"x" * 20, 20, 0, b"lz4"), "cannot be unpacked"),
        (chunk(b"x" * 20, 20, 0, b"bz2"), "compressed by 'bz2'"),
        (chunk(b"", 0, 0)[:-8] + struct.pack("<Q", 2**62), "cut off"),  # data of 4 EB
        (b"\x89MCAP0\r\n\x06" + struct.pack("<Q", 2**63), "damaged"),
        (b"PK\x03\x04" + bytes(100), "no MCAP file"),
    ],
)  # fmt: skip
def test_hostile_files_cost_one_sentence_and_little_memory(tmp_path: Path, content: bytes, says: str) -> None:
    import tracemalloc

    path = tmp_path / "bomb.mcap"
    path.write_bytes(content)
    tracemalloc.start()
    try:
        found, error = read(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert not found and error is not None and says in str(error), error
    assert peak < 5_000_000


def test_another_encoding_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", entries())
    with pytest.raises(BadInput, match="encoded as 'test/1'"):
        list(read_log(tmp_path / "a.mcap", encoding="other"))
