"""What a drive of the raw layout keeps of a simulated recording, worked out in memory, loss by loss.

    one_camera . claimed_times . ids_by_boxes . boxes_by_outline . level_lidar

No file is written and nothing of `kitti_write` is used: loops over objects and KITTI's definitions. Where
the reader has a choice (an object's path between two labels, shares of visibility by level) its own words are
taken.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fusion.geometry import Transform
from fusion.messages import Calibration, Detection, Detections, EgoMotion, LidarScan
from simbench.faults.delivery import in_order_of_arrival
from simbench.formats.labels import SIZES
from simbench.formats.poses import LabelledTrack, RecordedPoses
from simbench.recording import Recording
from simbench.sensors.detector import draw_track_ids
from simbench.truth import ImageTruth, ObjectInfo, ScanTruth, TrueBox

NO_LABEL = ("tree", "post", "building")
RENAMED = {"lidar": "lidar", "imu": "oxts"}
SIGNS = [(a, b, c) for a in (-0.5, 0.5) for b in (-0.5, 0.5) for c in (-0.5, 0.5)]


def one_camera(recording: Recording, camera: str) -> Recording:
    """Without what the other cameras saw."""
    calibration = Calibration(
        T_ego_sensor={n: T for n, T in recording.calibration.T_ego_sensor.items() if n in ("lidar", camera)},
        cameras={camera: recording.calibration.cameras[camera]},
    )
    truth = replace(
        recording.truth,
        images=tuple(i for i in recording.truth.images if i.sensor == camera),
        calibration=calibration,
        reference=None,
    )
    messages = tuple(
        m for m in recording.messages if isinstance(m, LidarScan | EgoMotion) or m.sensor == camera
    )
    return replace(recording, calibration=calibration, messages=messages, truth=truth)


def claimed_times(recording: Recording) -> Recording:
    """A frame has one time for all points, when the LiDAR looks along the camera's axis, and its image; the
    claims are the truth. Objects are where they are about the LiDAR then, turned about the camera's y only,
    and go evenly in between. Points lie ring by ring; motion is what was measured nearest to the frame."""
    (camera,) = recording.calibration.cameras
    truth, told = recording.truth, recording.calibration
    T_camera_lidar = told.T_camera_lidar(camera, "lidar")
    axis = np.arctan2(*T_camera_lidar.rotation[2, 1::-1])
    detections = [m for m in recording.messages if isinstance(m, Detections)]
    motion = [m for m in recording.messages if isinstance(m, EgoMotion)]
    scans, scan_truths, boxes, views, felt = [], [], [], [], []
    tracks: dict[int, list[tuple[int, np.ndarray, float]]] = {}
    known: dict[int, list[int]] = {}
    for scan, about in zip(
        (m for m in recording.messages if isinstance(m, LidarScan)), truth.scans, strict=True
    ):
        x, y, z = scan.xyz_m.astype(float).T
        off = np.angle(np.exp(1j * (np.arctan2(y, x) - axis)))
        ahead = np.abs(off) <= np.deg2rad(10.0)
        half = (np.count_nonzero(ahead) - 1) // 2
        stamp_ns = scan.stamp_ns + int(sorted(scan.offset_ns[ahead])[half])
        true_ns = np.array([sorted(about.fire_ns[ahead])[half]])
        late = [abs(d.stamp_ns - stamp_ns) for d in detections]
        if min(late) > truth.period_ns / 2:
            continue
        image = truth.images[[i.seq for i in truth.images].index(detections[int(np.argmin(late))].seq)]
        message = detections[int(np.argmin(late))]
        elevation = np.arctan2(z, np.hypot(x, y))
        rings = sorted(set(scan.ring.tolist()), key=lambda r: -elevation[scan.ring == r].mean())
        azimuth = np.arctan2(y, x) % (2 * np.pi)
        order = np.array(
            sorted(range(len(x)), key=lambda i: (rings.index(scan.ring[i]), azimuth[i])), dtype=np.int64
        )
        seq, n = len(scans), len(x)
        scans.append(
            replace(
                scan, seq=seq, stamp_ns=stamp_ns, arrival_ns=stamp_ns + truth.period_ns // 2,
                xyz_m=scan.xyz_m[order], intensity=scan.intensity[order],
                offset_ns=np.zeros(n, np.int32), ring=scan.ring[order],
            )
        )  # fmt: skip
        scan_truths.append(
            ScanTruth(
                sensor="lidar", seq=seq, object_id=about.object_id[order], part_id=about.part_id[order],
                true_range_m=np.linalg.norm(scan.xyz_m[order].astype(float), axis=1),
                fire_ns=np.full(n, stamp_ns), incidence_rad=about.incidence_rad[order],
            )
        )  # fmt: skip
        boxes.append(
            replace(
                message, seq=seq, stamp_ns=message.stamp_ns,
                arrival_ns=message.stamp_ns + truth.period_ns // 2,
            )
        )  # fmt: skip
        views.append(
            replace(
                image, seq=seq, capture_ns=message.stamp_ns, T_world_camera=told.T_ego_sensor[camera]
            )
        )  # fmt: skip
        nearest = min(motion, key=lambda m: abs(m.stamp_ns - stamp_ns))
        felt.append(replace(nearest, seq=seq, arrival_ns=nearest.stamp_ns))
        (R_world_lidar,), (at_m,) = truth.poses.sensor("lidar", true_ns)
        for info in truth.objects:
            (R_world_box,), (centre_m,) = truth.poses.object_centre(info.object_id, true_ns)
            local = R_world_box.T @ (at_m - centre_m)
            if info.category in NO_LABEL or (np.abs(local[:2]) < np.array(info.size_m[:2]) / 2).all():
                continue
            in_lidar = R_world_lidar.T @ (centre_m - at_m)
            along = T_camera_lidar.rotation @ R_world_lidar.T @ R_world_box @ [1.0, 0.0, 0.0]
            bottom = np.add(T_camera_lidar.apply(in_lidar), (0.0, info.size_m[2] / 2, 0.0))
            tracks.setdefault(info.object_id, []).append((stamp_ns, bottom, np.arctan2(-along[2], along[0])))
            if (about.object_id == info.object_id).any() or any(
                b.object_id == info.object_id for b in image.boxes
            ):
                known.setdefault(info.object_id, []).append(seq)
    stamps = [scan.stamp_ns for scan in scans]
    spans = {i: range(min(seqs), max(seqs) + 1) for i, seqs in known.items()}
    labelled = {
        i: LabelledTrack(
            t_ns=np.array([tracks[i][f][0] for f in span]),
            bottom_m=np.array([tracks[i][f][1] for f in span]),
            yaw_rad=np.unwrap([tracks[i][f][2] for f in span]),
            height_m=truth.objects[i].size_m[2],
        )
        for i, span in spans.items()
    }
    T_ego_rect = told.T_ego_sensor["lidar"] @ T_camera_lidar.inverse()
    return replace(
        recording,
        messages=in_order_of_arrival([*scans, *felt, *boxes]),
        truth=replace(
            truth,
            scans=tuple(scan_truths),
            images=tuple(views),
            poses=RecordedPoses(told, T_ego_rect, labelled),
            period_ns=int(np.median(np.diff(stamps))),
        ),
    )


def ids_by_boxes(recording: Recording) -> Recording:
    """A point is the object's whose box holds it, the smallest of several, of those labelled in the frame."""
    truth = recording.truth
    scans = {m.seq: m for m in recording.messages if isinstance(m, LidarScan)}
    T_lidar_ego = truth.calibration.T_ego_sensor["lidar"].inverse()
    found = []
    for about in truth.scans:
        scan = scans[about.seq]
        owner, smallest = np.full(len(scan.xyz_m), -1, np.int32), np.full(len(scan.xyz_m), np.inf)
        for info in labelled_at(truth.poses, truth.objects, scan.stamp_ns):
            (R,), (centre,) = truth.poses.object_centre(info.object_id, np.array([scan.stamp_ns]))
            local = (scan.xyz_m.astype(float) - T_lidar_ego.apply(centre)) @ (T_lidar_ego.rotation @ R)
            inside = (np.abs(local) <= np.array(info.size_m) / 2).all(axis=1)
            mine = inside & (np.prod(info.size_m) < smallest)
            owner[mine], smallest[mine] = info.object_id, np.prod(info.size_m)
        found.append(replace(about, object_id=owner))
    return replace(recording, truth=replace(truth, scans=tuple(found)))


def labelled_at(poses: object, objects: tuple[ObjectInfo, ...], t_ns: int) -> list[ObjectInfo]:
    assert isinstance(poses, RecordedPoses)
    tracks = poses._tracks
    return [o for o in objects if o.object_id in tracks and t_ns in tracks[o.object_id].t_ns]


def boxes_by_outline(recording: Recording) -> Recording:
    """Boxes are the outlines of the projected 3-D boxes; how much is seen is one of a few levels; every
    object that is seen is detected, with confidence 1."""
    truth = recording.truth
    (camera,) = recording.calibration.cameras
    lens = recording.calibration.cameras[camera]
    T_camera_ego = recording.calibration.T_ego_sensor[camera].inverse()
    stamps = {m.seq: m.stamp_ns for m in recording.messages if isinstance(m, LidarScan)}
    met = by_first_sight(truth.poses, truth.objects, sorted(stamps.values()))
    drawn = draw_track_ids(tuple(replace(o, object_id=i) for i, o in enumerate(met)), 0)
    track_id = {info.object_id: drawn[i] for i, info in enumerate(met)}
    messages: list[object] = [m for m in recording.messages if not isinstance(m, Detections)]
    views: list[ImageTruth] = []
    for image in truth.images:
        was = {box.object_id: box for box in image.boxes}
        boxes: list[TrueBox] = []
        for info in labelled_at(truth.poses, truth.objects, stamps[image.seq]):
            if info.object_id not in was:
                continue
            (R,), (centre,) = truth.poses.object_centre(info.object_id, np.array([stamps[image.seq]]))
            corner = T_camera_ego.apply(np.array(SIGNS) * info.size_m @ R.T + centre)
            if corner[:, 2].min() < 0.5:
                continue
            uv = lens.project(corner)
            low, high = uv.min(axis=0), uv.max(axis=0)
            x0, y0 = np.maximum(low, 0.0)
            x1, y1 = np.minimum(high, (lens.width_px, lens.height_px))
            if x1 - x0 < 1e-9 or y1 - y0 < 1e-9:
                continue
            cut = 1.0 - (x1 - x0) * (y1 - y0) / np.prod(high - low) >= 0.25
            seen = was[info.object_id].visible_fraction if was[info.object_id].visible_px else 0.0
            share = min((1.0, 0.6, 0.0), key=lambda s: abs(s - seen)) * (0.5 if cut else 1.0)
            box = (float(x0), float(y0), float(x1), float(y1))
            boxes.append(
                TrueBox(
                    object_id=info.object_id, amodal_px=box, visible_px=box if share > 0.0 else None,
                    visible_fraction=share,
                )
            )  # fmt: skip
        shown = [box for box in boxes if box.visible_px is not None]
        views.append(
            replace(image, boxes=tuple(boxes), detection_object_id=tuple(b.object_id for b in shown))
        )
        message = next(m for m in recording.messages if isinstance(m, Detections) and m.seq == image.seq)
        found = tuple(
            Detection(
                track_id=track_id[b.object_id], category=truth.objects[b.object_id].category,
                box_px=b.amodal_px, confidence=1.0,
            )
            for b in shown
        )  # fmt: skip
        messages.append(replace(message, boxes=found))
    return replace(
        recording,
        messages=in_order_of_arrival(messages),
        truth=replace(truth, images=tuple(views)),  # type: ignore[arg-type]
    )


def by_first_sight(
    poses: object, objects: tuple[ObjectInfo, ...], stamps_ns: list[int]
) -> tuple[ObjectInfo, ...]:
    """In the order in which a reader meets them."""
    seen: dict[int, ObjectInfo] = {}
    for t_ns in stamps_ns:
        for info in labelled_at(poses, objects, t_ns):
            seen.setdefault(info.object_id, info)
    return tuple(seen.values())


def level_lidar(recording: Recording) -> Recording:
    """The ego frame lies 1.73 m below the LiDAR, turned as it is; categories have the data set's mean sizes;
    every labelled object is scored."""
    told, truth = recording.calibration, recording.truth
    height = Transform(rotation=np.eye(3), translation_m=np.array([0.0, 0.0, 1.73]))
    T_new_ego = height @ told.T_ego_sensor["lidar"].inverse()
    calibration = Calibration(
        T_ego_sensor={name: T_new_ego @ T for name, T in told.T_ego_sensor.items()}, cameras=told.cameras
    )
    poses = truth.poses
    assert isinstance(poses, RecordedPoses)
    messages = [
        replace(
            m,
            velocity_mps=T_new_ego.rotation @ m.velocity_mps,
            rate_radps=T_new_ego.rotation @ m.rate_radps,
            specific_force_mps2=T_new_ego.rotation @ m.specific_force_mps2,
        )
        if isinstance(m, EgoMotion)
        else m
        for m in recording.messages
    ]
    (camera,) = told.cameras
    images = tuple(replace(i, T_world_camera=calibration.T_ego_sensor[camera]) for i in truth.images)
    stamps = sorted(m.stamp_ns for m in messages if isinstance(m, LidarScan))
    targets = tuple(o.object_id for o in by_first_sight(poses, truth.objects, stamps))
    return replace(
        recording,
        calibration=calibration,
        categories=SIZES,
        messages=tuple(messages),
        truth=replace(
            truth,
            target_id=targets[0],
            targets=targets,
            images=images,
            calibration=calibration,
            poses=RecordedPoses(calibration, T_new_ego @ poses._T_ego_rect, poses._tracks),
        ),
    )
