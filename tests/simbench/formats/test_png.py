"""Pictures come back bit by bit, whoever encoded them and when; what is no picture is refused unopened."""

from __future__ import annotations

import io
import struct
import threading
import tracemalloc
import zlib
from pathlib import Path
from unittest import mock

import matplotlib.image
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fusion.messages import CameraImage
from simbench.case import Job
from simbench.formats.picture_size import picture_size
from simbench.formats.png import Pictures, decode, encode
from simbench.formats.store import Source, read_recording, write_recording
from simbench.run import recording_of

PICTURES = st.tuples(st.integers(1, 9), st.integers(1, 9)).flatmap(
    lambda size: arrays(np.uint8, (*size, 3), elements=st.integers(0, 255))
)


@given(PICTURES, st.booleans())
@settings(deadline=None)
def test_a_picture_comes_back_bit_by_bit(rgb: np.ndarray, grey: bool) -> None:
    rgb = np.repeat(rgb[..., :1], 3, axis=2) if grey else rgb
    assert np.array_equal(decode(encode(rgb)), rgb)
    assert picture_size(encode(rgb)) == (rgb.shape[1], rgb.shape[0])


def test_another_decoder_sees_the_same_colours() -> None:
    rgb = np.random.Generator(np.random.PCG64(3)).integers(0, 256, (12, 20, 3)).astype(np.uint8)
    other = matplotlib.image.imread(io.BytesIO(encode(rgb)), format="png")
    assert np.array_equal((other * 255).round().astype(np.uint8), rgb)


def header(width: int, height: int) -> bytes:
    """A PNG that claims a size and holds one byte."""
    parts = [(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)), (b"IDAT", zlib.compress(b"0"))]
    body = b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in parts
    )
    return b"\x89PNG\r\n\x1a\n" + body


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (header(60_000, 60_000), "60000 x 60000 pixels"),
        (header(2**31, 2**31), "pixels; 100000000 are allowed"),
        (header(0, 0), "cannot be decoded"),
        (header(10, 10)[:30], "cannot be decoded"),
        (b"GIF89a" + bytes(40), "no PNG"),
        (b"", "no PNG"),
    ],
)
def test_what_is_no_picture_costs_no_memory(data: bytes, says: str) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=says):
            decode(data)
        assert tracemalloc.get_traced_memory()[1] < 5_000_000
    finally:
        tracemalloc.stop()


def test_a_picture_that_changed_after_it_was_taken_is_encoded_as_it_is() -> None:
    taken = np.zeros((4, 5, 3), dtype=np.uint8)
    with Pictures() as pictures:
        take = pictures.beside(lambda motion, camera, seq, mid_ns: taken)
        assert take(None, "front", 0, 0) is taken  # type: ignore[arg-type]
        changed = taken + np.uint8(9)
        assert np.array_equal(decode(pictures.png(changed)), changed)
        assert pictures.png(taken) == encode(taken)


def test_a_picture_is_encoded_once_and_when_it_is_taken() -> None:
    taken, begun = np.zeros((4, 5, 3), dtype=np.uint8), threading.Event()

    def counted(rgb: np.ndarray) -> bytes:
        assert not begun.is_set(), "encoded twice"
        begun.set()
        return encode(rgb)

    with mock.patch("simbench.formats.png.encode", counted), Pictures() as pictures:
        pictures.beside(lambda motion, camera, seq, mid_ns: taken)(None, "front", 0, 0)  # type: ignore[arg-type]
        assert begun.wait(10.0), "not before it is asked for"
        assert pictures.png(taken) == encode(taken)


def test_a_recording_with_pictures_comes_back_bit_by_bit(tmp_path: Path) -> None:
    """Once the pictures are encoded when they are taken, once when they are written: the same bytes."""
    job = Job(
        scenario="overtake-approach", system="car", seed=0, pipelines=(), images="raycast", size_px=(96, 60),
        changes=("systems.car.duration_s=0.3",),
    )  # fmt: skip
    source = Source(scenario="overtake-approach", system="car", seed=0, images="raycast")
    with Pictures() as pictures:
        made = recording_of(job, pictures.beside)[2].recording
        one = write_recording(made, tmp_path / "a", source, as_png=pictures.png)
    assert one == write_recording(made, tmp_path / "b", source)
    found = read_recording(tmp_path / "a").recording.messages
    was = [m for m in made.messages if isinstance(m, CameraImage)]
    now = [m for m in found if isinstance(m, CameraImage)]
    assert len(was) == len(now) > 5
    for image, again in zip(was, now, strict=True):
        assert np.array_equal(image.rgb, again.rgb)
        assert (image.sensor, image.seq, image.stamp_ns, image.arrival_ns) == (
            again.sensor, again.seq, again.stamp_ns, again.arrival_ns,
        )  # fmt: skip
