"""What was written as KITTI and read again scores the same to 1e-6.

Three laws. (1) A recording that was read from KITTI comes back, where every labelled object is seen and its
truncation is what its 3-D box says. (2) Whatever is written, read, written and read again is what was first
read. (3) A simulated recording comes back as `kitti_losses`, without a file, says that the raw layout keeps
it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fusion.messages import Detections, EgoMotion, LidarScan
from scenarios.fault_set import FaultSet
from simbench.case import Job
from simbench.formats.kitti import open_kitti
from simbench.formats.kitti_write import LAYOUTS, WrittenLayout, write_kitti
from simbench.formats.recorded import Player
from simbench.recording import Recording
from simbench.run import Made, recording_of, run_case
from tests.simbench.formats import kitti_losses as losses
from tests.simbench.formats import mini_kitti as mini

CLOSE = {"abs": 1e-6, "rel": 1e-6}
PIPELINES = ("static_projection", "probabilistic")
DATA = Path(__file__).parents[4] / "shared" / "data" / "kitti"


def play(root: Path, number: int) -> Recording:
    return Player(open_kitti(f"kitti:{root}").drive(number), FaultSet()).play().recording


def there_and_back(recording: Recording, folder: Path, layout: WrittenLayout, number: int = 0) -> Recording:
    assert write_kitti(recording, folder, layout=layout, number=number) > 0
    return play(folder / LAYOUTS[layout][0], number)


def scores(recording: Recording) -> dict[tuple[str, str], tuple[float | None, int]]:
    found = {}
    for name in PIPELINES:
        case = run_case(name, Made(recording=recording, receipts=(), shake=""))
        assert case.status == "ok", case.why
        found |= {(name, row.metric): (row.value, row.n) for row in case.rows}
    return found


def check_same(one: Recording, other: Recording) -> None:
    a, b = scores(one), scores(other)
    assert a.keys() == b.keys()
    for key in a:
        assert a[key][1] == b[key][1], key
        assert b[key][0] == (None if a[key][0] is None else pytest.approx(a[key][0], **CLOSE)), key
    assert sum(value is not None for value, _ in a.values()) >= 20


@pytest.fixture(scope="module")
def made() -> dict[str, Recording]:
    """A car and a rider that is shaken, each on its own way."""
    found = {}
    for system, scenario in (("car", "overtake-approach"), ("wearable", "overtake-wobble")):
        job = Job(
            scenario=scenario, system=system, seed=0, pipelines=(),
            changes=(f"systems.{system}.duration_s=0.4",),
        )  # fmt: skip
        found[system] = recording_of(job)[2].recording
    return found


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("kitti")
    partly = replace(mini.CAR, occluded=1)
    mini.write_object(root / "object", {4: (partly, mini.RIDER)})
    mini.write_tracking(root / "tracking", mini.drive(5))
    mini.write_raw(root / "raw", mini.drive(5))
    return root


# -- law 1 ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("layout", "number"), [("object", 4), ("tracking", 0), ("raw", 5)])
def test_what_was_read_from_kitti_scores_the_same_after_writing(
    data: Path, tmp_path: Path, layout: WrittenLayout, number: int
) -> None:
    was = play(data / layout, number)
    now = there_and_back(was, tmp_path / "new", layout, number)
    check_same(was, now)
    for one, other in zip(was.messages, now.messages, strict=True):
        assert (type(one), one.seq, one.stamp_ns, one.arrival_ns) == (
            type(other), other.seq, other.stamp_ns, other.arrival_ns,
        )  # fmt: skip
        if isinstance(one, LidarScan):
            for name in ("xyz_m", "intensity", "ring"):
                np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        if isinstance(one, Detections):
            assert [box.track_id for box in one.boxes] == [box.track_id for box in other.boxes]
            np.testing.assert_allclose(
                [box.box_px for box in one.boxes], [box.box_px for box in other.boxes], atol=1e-9
            )
        if isinstance(one, EgoMotion):
            np.testing.assert_allclose(other.velocity_mps, one.velocity_mps, atol=1e-12)
            np.testing.assert_allclose(other.rate_radps, one.rate_radps, atol=1e-12)
            np.testing.assert_allclose(other.specific_force_mps2, one.specific_force_mps2, atol=1e-12)
    for one, other in zip(was.truth.scans, now.truth.scans, strict=True):
        np.testing.assert_array_equal(one.object_id, other.object_id)
    for one, other in zip(was.truth.images, now.truth.images, strict=True):
        assert [box.visible_fraction for box in one.boxes] == [box.visible_fraction for box in other.boxes]


def test_an_object_that_no_sensor_saw_keeps_its_label(tmp_path: Path) -> None:
    """Behind the camera, beyond the LiDAR: the truth is the label alone."""
    far = replace(mini.CAR, track=11, xyz_m=(-120.0, 3.0, -mini.HEIGHT_M), truncated=99)
    root = mini.write_raw(tmp_path / "raw", [(mini.RIDER, far)] * 2)
    was = play(root, 5)
    assert not any((scan.object_id == 1).any() for scan in was.truth.scans)
    now = there_and_back(was, tmp_path / "new", "raw", 5)
    assert [(o.category, o.size_m) for o in now.truth.objects] == [
        (o.category, o.size_m) for o in was.truth.objects
    ]
    at = np.array([0, 50_000_000])
    for one, other in zip(
        was.truth.poses.object_centre(1, at), now.truth.poses.object_centre(1, at), strict=True
    ):
        np.testing.assert_allclose(one, other, atol=1e-9)


@pytest.mark.skipif(not DATA.is_dir(), reason="the three KITTI frames are not here")
@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_real_frame_scores_the_same_after_writing(tmp_path: Path, number: int) -> None:
    was = play(DATA, number)
    check_same(was, there_and_back(was, tmp_path / "new", "object", number))


# -- law 2 ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("system", "layout"), [("car", "object"), ("car", "tracking"), ("car", "raw"), ("wearable", "raw")]
)
def test_a_second_time_changes_nothing(
    made: dict[str, Recording], tmp_path: Path, system: str, layout: WrittenLayout
) -> None:
    once = there_and_back(made[system], tmp_path / "once", layout)
    check_same(once, there_and_back(once, tmp_path / "twice", layout))


# -- law 3 ------------------------------------------------------------------------------------------------


def kept(recording: Recording, camera: str) -> Recording:
    alone = losses.one_camera(recording, camera)
    return losses.level_lidar(losses.boxes_by_outline(losses.ids_by_boxes(losses.claimed_times(alone))))


@pytest.mark.parametrize(("system", "camera"), [("car", "cam-front"), ("wearable", "cam-centre")])
def test_a_simulated_drive_comes_back_as_the_format_keeps_it(
    made: dict[str, Recording], tmp_path: Path, system: str, camera: str
) -> None:
    check_same(kept(made[system], camera), there_and_back(made[system], tmp_path / "new", "raw"))


def test_what_the_format_keeps_is_not_all(made: dict[str, Recording]) -> None:
    """The law above would say little if nothing were lost."""
    all_of_it = made["car"]
    target = all_of_it.truth.target_id
    part = kept(all_of_it, "cam-front")
    alone = replace(part, truth=replace(part.truth, target_id=target, targets=()))
    assert scores(alone)["static_projection", "tpr"] != scores(all_of_it)["static_projection", "tpr"]
