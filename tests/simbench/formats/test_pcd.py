"""PCD files hold what was put in, bit by bit, by the format's own description; whatever else is refused."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fusion.messages import LidarScan
from scenarios.errors import BadInput
from scenarios.fault_set import FaultSet
from simbench.formats.kitti import open_kitti
from simbench.formats.pcd import read_pcd, read_truth_pcd, write_pcd, write_pcd_folder, write_truth_pcd
from simbench.formats.recorded import Player
from simbench.truth import ScanTruth
from tests.simbench.formats import mini_kitti as mini

# By the format's page: entries in this order, then the points, one after the other, each as the entries say.
HEADER = """# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z intensity t ring
SIZE 4 4 4 4 4 2
TYPE F F F F I I
COUNT 1 1 1 1 1 1
WIDTH 3
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS 3
DATA binary
"""
BY_HAND = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "t", "ring"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<i4", "<i2"],
        "offsets": [0, 4, 8, 12, 16, 20],
        "itemsize": 22,
    }
)


def scan_of(xyz: np.ndarray, intensity: np.ndarray, t: np.ndarray, ring: np.ndarray) -> LidarScan:
    return LidarScan(
        sensor="lidar", seq=0, stamp_ns=0, arrival_ns=0, xyz_m=xyz.astype(np.float32),
        intensity=intensity.astype(np.float32), offset_ns=t.astype(np.int32), ring=ring.astype(np.int16),
    )  # fmt: skip


def three() -> LidarScan:
    return scan_of(
        np.array([[1.5, -2.0, 0.25], [30.0, 4.0, -1.0], [np.float32(0.1), 0.0, 0.0]]),
        np.array([0.0, 0.5, 1.0]), np.array([0, 97_656, 99_902_343]), np.array([0, 63, -1]),
    )  # fmt: skip


@st.composite
def scans(draw: st.DrawFn) -> LidarScan:
    n = draw(st.integers(0, 30))
    return scan_of(
        draw(hnp.arrays(np.float32, (n, 3))),  # NaN and infinity too
        draw(hnp.arrays(np.float32, n)),
        draw(hnp.arrays(np.int32, n)),
        draw(hnp.arrays(np.int16, n)),
    )


def test_a_file_by_hand(tmp_path: Path) -> None:
    write_pcd(three(), tmp_path / "a.pcd")
    raw = (tmp_path / "a.pcd").read_bytes()
    assert raw.startswith(HEADER.encode())
    points = np.frombuffer(raw[len(HEADER) :], dtype=BY_HAND)
    assert points["x"].tolist() == [1.5, 30.0, float(np.float32(0.1))]
    assert points["y"].tolist() == [-2.0, 4.0, 0.0]
    assert points["z"].tolist() == [0.25, -1.0, 0.0]
    assert points["intensity"].tolist() == [0.0, 0.5, 1.0]
    assert points["t"].tolist() == [0, 97_656, 99_902_343]
    assert points["ring"].tolist() == [0, 63, -1]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(scans())
def test_a_sweep_comes_back_bit_by_bit(tmp_path: Path, scan: LidarScan) -> None:
    write_pcd(scan, tmp_path / "a.pcd")
    found = read_pcd(tmp_path / "a.pcd")
    for name in ("xyz_m", "intensity", "offset_ns", "ring"):
        mine, theirs = getattr(scan, name), getattr(found, name)
        assert (mine.dtype, mine.shape, mine.tobytes()) == (theirs.dtype, theirs.shape, theirs.tobytes())
        assert not theirs.flags.writeable


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data(), st.integers(0, 20))
def test_the_truth_comes_back_bit_by_bit(tmp_path: Path, data: st.DataObject, n: int) -> None:
    truth = ScanTruth(
        sensor="lidar", seq=0, object_id=data.draw(hnp.arrays(np.int32, n)),
        part_id=data.draw(hnp.arrays(np.int32, n)), true_range_m=data.draw(hnp.arrays(np.float64, n)),
        fire_ns=np.zeros(n, np.int64), incidence_rad=np.zeros(n, np.float32),
    )  # fmt: skip
    write_truth_pcd(truth, tmp_path / "t.pcd")
    found = read_truth_pcd(tmp_path / "t.pcd")
    for name in ("object_id", "part_id", "true_range_m"):
        mine, theirs = getattr(truth, name), getattr(found, name)
        assert (mine.dtype, mine.tobytes()) == (theirs.dtype, theirs.tobytes())


def test_a_folder_has_a_file_for_every_sweep_and_its_truth(tmp_path: Path) -> None:
    root = mini.write_tracking(tmp_path / "kitti", mini.drive(3))
    recording = Player(open_kitti(f"kitti:{root}").drive(0), FaultSet()).play().recording
    assert write_pcd_folder(recording, tmp_path / "new") == 3
    found = sorted(str(p.relative_to(tmp_path / "new")) for p in (tmp_path / "new").rglob("*.*"))
    names = [f"lidar/{i:06d}.pcd" for i in range(3)]
    assert found == [*names, "lidar/stamps.csv", *(f"truth/{name}" for name in names)]
    stamps = (tmp_path / "new/lidar/stamps.csv").read_text().splitlines()
    assert stamps[:2] == ["seq,stamp_ns,arrival_ns", "0,0,50000000"]
    for name, scan, truth in zip(
        names, (m for m in recording.messages if isinstance(m, LidarScan)), recording.truth.scans, strict=True
    ):
        np.testing.assert_array_equal(read_pcd(tmp_path / "new" / name).xyz_m, scan.xyz_m)
        hits = read_truth_pcd(tmp_path / "new/truth" / name)
        np.testing.assert_array_equal(hits.object_id, truth.object_id)
        np.testing.assert_array_equal(hits.true_range_m, truth.true_range_m)
        assert (hits.object_id >= 0).any()


# -- what is refused --------------------------------------------------------------------------------------


def bad(path: Path, raw: bytes) -> str:
    path.write_bytes(raw)
    with pytest.raises(BadInput) as caught:
        read_pcd(path)
    text = str(caught.value)
    assert str(path) in text and "\n" not in text
    return text


POINTS = bytes(66)


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("VERSION 0.7", "VERSION 0.6", "0.7"),
        ("FIELDS x y z intensity t ring", "FIELDS x y z rgb t ring", "FIELDS"),
        ("SIZE 4 4 4 4 4 2", "SIZE 8 4 4 4 4 2", "SIZE"),
        ("SIZE 4 4 4 4 4 2", "SIZE -4 4 4 4 4 2", "SIZE"),
        ("TYPE F F F F I I", "TYPE F F F F U I", "TYPE"),
        ("COUNT 1 1 1 1 1 1", "COUNT 1 1 1 1 1 1000000000", "COUNT"),
        ("VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 1 0 0 1 0 0 0", "VIEWPOINT"),
        ("POINTS 3", "POINTS 4", "WIDTH 3 times HEIGHT 1"),
        ("POINTS 3", "POINTS -3", "whole number"),
        ("POINTS 3", "POINTS 3.0", "whole number"),
        ("POINTS 3", "POINTS " + "9" * 400, "whole number"),
        ("WIDTH 3", "WIDTH \N{ARABIC-INDIC DIGIT THREE}", "no PCD header"),
        ("DATA binary", "DATA ascii", "allowed: binary"),
        ("DATA binary", "DATA binary_compressed", "allowed: binary"),
        ("HEIGHT 1\n", "", "has no HEIGHT"),
        ("HEIGHT 1\n", "HEIGHT 1\nHEIGHT 1\n", "comes twice"),
        ("HEIGHT 1\n", "SHAPE 1\n", "no entry"),
        ("DATA binary\n", "", "no whole PCD header"),
        ("HEIGHT 1\n", "HEIGHT 1\n" + "# a comment\n" * 400, "no whole PCD header"),
        ("HEIGHT 1\n", "HEIGHT " + "1" * 5000 + "\n", "no whole PCD header"),
    ],
)
def test_a_header_that_is_not_ours(tmp_path: Path, old: str, new: str, word: str) -> None:
    text = HEADER.replace(old, new, 1)
    assert text != HEADER
    assert word in bad(tmp_path / "a.pcd", text.encode() + POINTS)


def test_more_points_are_claimed_than_there_are(tmp_path: Path) -> None:
    many = HEADER.replace("WIDTH 3", "WIDTH 999999999999").replace("POINTS 3", "POINTS 999999999999")
    assert "claims 999999999999 points" in bad(tmp_path / "a.pcd", many.encode() + POINTS)


@pytest.mark.parametrize("change", [-66, -1, 1, 22])
def test_a_file_that_is_cut_off_or_goes_on(tmp_path: Path, change: int) -> None:
    assert f"holds {66 + change} bytes" in bad(tmp_path / "a.pcd", HEADER.encode() + bytes(66 + change))


def test_more_bytes_than_are_allowed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simbench.formats.pcd.MOST_BYTES", 65)
    assert "more than" in bad(tmp_path / "a.pcd", HEADER.encode() + POINTS)


def test_every_cut_of_a_file_is_refused(tmp_path: Path) -> None:
    raw = HEADER.encode() + POINTS
    for end in range(len(raw)):
        bad(tmp_path / "a.pcd", raw[:end])


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=300), st.integers(0, 300))
def test_any_bytes_are_a_sweep_or_one_sentence(tmp_path: Path, raw: bytes, at: int) -> None:
    whole = HEADER.encode() + POINTS
    path = tmp_path / "a.pcd"
    path.write_bytes(whole[:at] + raw + whole[at + len(raw) :])
    try:
        found = read_pcd(path)
    except BadInput as error:
        assert "\n" not in str(error)
    else:
        assert len(found.xyz_m) == len(found.ring)


def test_what_is_no_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name, word in (("nothing", "no such file"), (".", "not a file"), ("pipe", "not a file")):
        with pytest.raises(BadInput, match=word):
            read_pcd(tmp_path / name)
