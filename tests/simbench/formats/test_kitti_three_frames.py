"""Three real frames, where they are: what the reader makes of them, and what comes out. Skipped without."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fusion.messages import LidarScan
from scenarios.fault_set import FaultSet
from scenarios.recorded import parse_recorded_faults
from simbench.case import Job
from simbench.formats.kitti import open_kitti
from simbench.formats.recorded import Player, Recorded
from simbench.run import run_job

DATA = Path(__file__).parents[4] / "shared" / "data" / "kitti"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the three KITTI frames are not here")

OBJECTS = {0: ["pedestrian"], 1: ["truck", "car", "rider"], 2: ["misc", "car"]}


@pytest.fixture(scope="module")
def played() -> dict[int, Recorded]:
    folder = open_kitti(f"kitti:{DATA}")
    assert tuple(folder.names) == (0, 1, 2)
    return {n: Player(folder.drive(n), FaultSet()).play() for n in folder.names}


def test_every_labelled_object_is_there_and_dont_care_is_not(played: dict[int, Recorded]) -> None:
    assert {n: [o.category for o in p.scene.objects] for n, p in played.items()} == OBJECTS


def test_a_sweep_has_64_rings_from_above(played: dict[int, Recorded]) -> None:
    for one in played.values():
        (scan,) = (m for m in one.recording.messages if isinstance(m, LidarScan))
        assert scan.ring[0] == 0 and scan.ring[-1] == 63
        x, y, z = scan.xyz_m.astype(float).T
        elevation = np.arctan2(z, np.hypot(x, y))
        means = np.bincount(scan.ring, weights=elevation) / np.bincount(scan.ring)
        assert (np.diff(means) < 0.0).all()
        assert np.rad2deg(means[0]) == pytest.approx(2.8, abs=1.2)
        assert np.rad2deg(means[-1]) == pytest.approx(-23.6, abs=0.3)


def test_points_in_a_labelled_box_project_into_its_labelled_box(played: dict[int, Recorded]) -> None:
    """Two labels of one object by hand, in 3-D and in the image, joined by the calibration."""
    for one in played.values():
        truth = one.recording.truth
        (scan,) = (m for m in one.recording.messages if isinstance(m, LidarScan))
        camera = truth.calibration.cameras["cam-2"]
        T_camera_lidar = truth.calibration.T_camera_lidar("cam-2", "lidar")
        for box in truth.images[0].boxes:
            mine = scan.xyz_m[truth.scans[0].object_id == box.object_id].astype(np.float64)
            assert len(mine) >= 5
            uv = camera.project(T_camera_lidar.apply(mine))
            x0, y0, x1, y1 = box.amodal_px
            inside = (uv > np.subtract((x0, y0), 2)).all(axis=1) & (uv < np.add((x1, y1), 2)).all(axis=1)
            assert inside.mean() > 0.97


def test_half_the_beams_are_half_the_layers() -> None:
    for number in (0, 1, 2):
        drive = open_kitti(f"kitti:{DATA}").drive(number)
        for percent in (25, 50, 75):
            (receipt,) = Player(drive, parse_recorded_faults([f"lidar.beam_loss={percent}"])).play().receipts
            assert receipt.status == "ok"
            assert receipt.realised == percent
            assert receipt.measured == pytest.approx(percent, abs=4.0)


def test_a_turned_camera_costs_hits_that_the_true_one_had() -> None:
    hits = []
    for faults in ((), ("calibration.rotation_deg={angle_deg: 2, axis: yaw}",)):
        found = 0
        for number in (0, 1, 2):
            job = Job(
                scenario=f"kitti:{DATA}", system="car", seed=number, faults=faults,
                pipelines=("static_projection",),
            )  # fmt: skip
            result = run_job(job)
            assert {case.status for case in result.cases} == {"ok"}
            for case in result.cases:
                assert case.scores is not None
                if case.pipeline == "oracle":
                    assert all(o.hits == o.pairs == 1 for o in case.scores.objects)
                else:
                    found += sum(o.hits for o in case.scores.objects)
        hits.append(found)
    assert hits[0] >= 5 > 3 > hits[1]
