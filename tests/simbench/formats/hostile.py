"""Recordings from an enemy, one kind a line, and what must be said of each.

    python tests/simbench/formats/hostile.py OUT

writes them all, a folder each, to try them on other tools. Results and other files from an enemy are in
`hostile_files.py`.
"""

from __future__ import annotations

import os
import struct
import sys
import zlib
from pathlib import Path

import lz4.frame
import numpy as np
import zstandard

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from simbench.formats.store import MANIFEST, MESSAGES, TRUTH
from tests.simbench.formats import hostile_parts as parts
from tests.simbench.formats.hostile_makes import (
    Hostile,
    bad,
    claims,
    cut,
    flipped,
    huge_array,
    items,
    manifest,
    many_boxes,
    mcap,
    more,
    nested,
    noise,
    one_of_another,
    png,
    png_bomb,
    put,
    raw_header,
    rehashed_crc,
    renamed,
    source,
    special,
    specs,
    swapped,
    text,
    truth_as_messages,
    twice_posed,
    unhashed,
    unknown_channel,
    untargeted,
    without,
)
from tests.simbench.formats.hostile_parts import CHUNK, ESCAPE, field, frame_changed, numbers

ZSTD, LZ4 = zstandard.compress(bytes(2**26)), lz4.frame.compress(bytes(2**26))
LATE = 2**63 - 1

CORPUS: dict[str, Hostile] = {
    # -- the bytes of a file
    **{
        f"cut-{name.partition('.')[0]}-{share}": bad(cut(name, share), says, cut=True)
        for name, share, says in (
            (MESSAGES, 0.0, "cut off before its calibration"), (MESSAGES, 0.5, "cut off"),
            (MESSAGES, 1.0, "cut off"), (TRUTH, 0.0, "cut off before"), (TRUTH, 0.5, "cut off"),
            (TRUTH, 1.0, "cut off"),
        )
    },
    "cut-manifest": bad(cut(MANIFEST, 0.5), "no JSON"),
    "flip-magic": bad(flipped(0, 2), "no MCAP file"),
    "flip-header": bad(flipped(parts.HEADER, 5), None),
    "flip-chunk-start": bad(flipped(CHUNK, 3), None),
    "flip-chunk-size": bad(flipped(CHUNK, 17), "checksum"),
    "flip-chunk-crc": bad(flipped(CHUNK, 25), "checksum"),
    "flip-chunk-compression": bad(flipped(CHUNK, 33), "compressed by"),
    "flip-chunk-length": bad(flipped(CHUNK, 36), ""),
    "flip-chunk-data": bad(flipped(CHUNK, 5000), ""),
    "flip-truth-data": bad(flipped(CHUNK, 5000, TRUTH), ""),
    "flip-message-index": bad(flipped(parts.INDEX, 3), None),
    "flip-data-end": bad(flipped(parts.DATA_END, 1), ""),
    "flip-chunk-index": bad(flipped(parts.CHUNK_INDEX, 9), None),
    "flip-footer": bad(flipped(parts.FOOTER, 2), None),
    "wrong-magic": bad(text(MESSAGES, b"PK\x03\x04" + bytes(1000)), "no MCAP file"),
    "crc-made-right": bad(rehashed_crc, "not what was written"),
    "hash-made-right": bad(unhashed, "its hash is another"),
    "zstd-bomb": bad(mcap(lambda: parts.mcap(parts.chunk(ZSTD, 1000, 0, b"zstd"))), "checksum"),
    "zstd-bomb-honest": bad(
        mcap(lambda: parts.mcap(parts.chunk(ZSTD, 2**26, zlib.crc32(bytes(2**26)), b"zstd") * 40)),
        "unpacks to more than|more messages than|damaged",
    ),
    "lz4-bomb": bad(mcap(lambda: parts.mcap(parts.chunk(LZ4, 1000, 0, b"lz4"))), "checksum"),
    "chunk-of-exabytes": bad(
        mcap(lambda: parts.mcap(parts.chunk(ZSTD, 2**63, 0, b"zstd"))), "are allowed"
    ),
    "record-of-exabytes": bad(
        mcap(lambda: parts.mcap(struct.pack("<BQ", CHUNK, 2**63))), "damaged|cut off"
    ),
    "channel-unknown": bad(mcap(unknown_channel), "damaged"),
    "message-outside-a-chunk": bad(
        mcap(lambda: parts.mcap(parts.record(5, struct.pack("<HIQQ", 0, 0, 0, 0)))),
        "outside of a chunk",
    ),
    # -- which messages
    "message-twice": bad(items(lambda found: [*found, *found[-1:]]), None),
    "messages-in-another-order": bad(items(swapped), "arrived before the one"),
    "sweep-with-the-number-of-another": bad(items(one_of_another), "another one has its number"),
    "message-without-truth": bad(items(without("image_truth", 3), TRUTH), "has no truth"),
    "sweep-without-truth": bad(items(without("scan_truth", 1), TRUTH), "has no truth"),
    "no-calibration": bad(items(without("told", 0)), "does not begin with a calibration"),
    "no-poses-of-a-body": bad(items(without("poses", 2), TRUTH), "nobody says where"),
    "frame-of-eight-bytes": bad(
        items(lambda found: [*found, parts.Message("/x/y", 2**40, 0, b"SBF1\0\0\0\0")]), "a head of 8"
    ),
    # -- the header of a frame
    "json-bomb": bad(frame_changed("lidar_scan", nested), "no JSON"),
    "array-of-2-to-the-96": bad(frame_changed("lidar_scan", huge_array), "its body ends before"),
    "negative-count": bad(frame_changed("lidar_scan", specs(shape=[-1, 3])), "no shape"),
    "dtype-unknown": bad(frame_changed("lidar_scan", specs(dtype="O")), "no dtype"),
    "array-of-no-name": bad(frame_changed("lidar_scan", specs(name=3)), "no text as its name"),
    "field-twice": bad(raw_header(b'"seq"', b'"seq": 1, "seq"'), "a field twice"),
    "nan-in-a-header": bad(raw_header(b'"seq": 0', b'"seq": NaN'), "holds NaN"),
    "number-of-5000-digits": bad(raw_header(b'"seq": 0', b'"seq": ' + b"9" * 5000), "no JSON"),
    "header-in-utf-16": bad(frame_changed("lidar_scan", lambda h, b: ("{}".encode("utf-16"), b)), ""),
    "field-unknown": bad(field("lidar_scan", "\x1b[31mred", 1), "which is not known"),
    "frame-of-another-kind": bad(field("lidar_scan", "kind", "finish"), "is no message"),
    # -- names
    "sensor-up-and-away": bad(renamed("../../../../tmp/owned"), "name is none"),
    "sensor-with-an-absolute-path": bad(renamed("/tmp/owned"), "name is none"),
    "sensor-with-nul": bad(field("lidar_scan", "sensor", "li\0dar"), "name is none"),
    "sensor-with-escapes": bad(field("lidar_scan", "sensor", ESCAPE), "name is none"),
    "sensor-without-a-name": bad(renamed(""), "name is none"),
    "sensor-of-10-mb": bad(field("lidar_scan", "sensor", "x" * 10**7), "too long"),
    "topic-of-escapes": bad(
        items(lambda found: [*found, parts.Message(ESCAPE * 900, 2**40, 0, b"junk" * 9)]), "letters"
    ),
    "kind-of-escapes": bad(field("lidar_scan", "kind", ESCAPE), "is no message"),
    "category-of-escapes": bad(field("detections", "category", ["car", ESCAPE]), "track or category"),
    "object-of-escapes": bad(field("truth_about", "name", [ESCAPE, "rider"]), "has the name"),
    "scenario-up-and-away": bad(source(scenario="../../../../etc/passwd"), None),
    "scenario-of-escapes": bad(source(scenario=ESCAPE), "cannot be printed"),
    "scenario-in-capitals": bad(source(scenario="a/My Drive (2).yaml"), None),
    "seed-of-400-digits": bad(source(seed=10**400), "seed"),
    # -- the manifest
    "manifest-nested": bad(text(MANIFEST, b"[" * 900_000), "no JSON"),
    "manifest-of-2-mb": bad(text(MANIFEST, b" " * 2_000_000), "larger than"),
    "manifest-in-utf-16": bad(text(MANIFEST, '{"schema": 1}'.encode("utf-16")), "no JSON"),
    "manifest-without-hashes": bad(manifest(messages=None, truth=None), "holds no hash"),
    "manifest-that-counts-more": bad(
        more, "has not the messages"
    ),
    # -- what is no file
    **{
        f"{what}-as-{name.partition('.')[0]}": bad(special(name, place), says)
        for what, place, says in (
            ("fifo", os.mkfifo, "no plain file"), ("folder", os.mkdir, "no plain file"),
            ("dev-zero", lambda path: path.symlink_to("/dev/zero"), "no plain file"),
            ("circle", lambda path: path.symlink_to(path.name), ""), ("nothing", lambda path: None, "no"),
        )
        for name in (MESSAGES, TRUTH, MANIFEST)
    },
    # -- what is measured
    "point-nan": bad(numbers("lidar_scan", "xyz_m", put((5, 1), np.nan)), "not finite"),
    "point-infinite": bad(numbers("lidar_scan", "xyz_m", put((5, 1), -np.inf)), "not finite"),
    "point-1e30-m-away": bad(numbers("lidar_scan", "xyz_m", put((5, 1), 1e30)), "too far away"),
    "all-points-nan": bad(numbers("lidar_scan", "xyz_m", put(..., np.nan)), "not finite"),
    "intensity-nan": bad(numbers("lidar_scan", "intensity", put(3, np.nan)), "an intensity"),
    "ring-negative": bad(numbers("lidar_scan", "ring", put(3, -7)), "a ring"),
    "fired-before-the-stamp": bad(numbers("lidar_scan", "offset_ns", put(3, -(2**31))), "fired"),
    "no-points": bad(
        frame_changed("lidar_scan", lambda h, b: (
            h | {"arrays": [s | {"shape": [0, *s["shape"][1:]]} for s in h["arrays"]]}, b""
        )), "another number of points",
    ),
    "stamp-at-the-end-of-time": bad(field("lidar_scan", "stamp_ns", LATE), "beyond"),
    "stamp-where-nothing-is-known": bad(field("lidar_scan", "stamp_ns", 10**10), "no poses are known"),
    "stamp-before-all-time": bad(field("detections", "stamp_ns", -LATE), "beyond"),
    "stamp-of-65-bits": bad(field("lidar_scan", "stamp_ns", 2**64), "64 bits"),
    "arrival-at-the-end-of-time": bad(field("ego_motion", "arrival_ns", LATE), "beyond"),
    "arrival-out-of-order": bad(field("ego_motion", "arrival_ns", 0, 5), "arrived before"),
    "number-negative": bad(field("detections", "seq", -1), "negative"),
    "speed-nan": bad(numbers("ego_motion", "velocity_mps", put(0, np.nan)), "velocity_mps"),
    "picture-of-2-to-the-62-px": bad(numbers("camera_png", "png", claims), "times their size"),
    "picture-bomb": bad(png(png_bomb), "times their size"),
    "picture-that-is-none": bad(png(lambda: b"GIF89a" * 20), "neither PNG nor JPEG"),
    "picture-of-another-size": bad(
        png(lambda: noise(16, 8)), "16 x 8 pixels, its camera has 384 x 256"
    ),
    "box-nan": bad(numbers("detections", "box_px", put((0, 2), np.nan)), "box 0"),
    "box-inside-out": bad(numbers("detections", "box_px", put((0, 2), -9.0)), "wrong way round"),
    "confidence-7": bad(numbers("detections", "confidence", put(0, 7.0)), "confidence of 7"),
    "track-at-the-end-of-numbers": bad(
        numbers("detections", "track_id", put(0, -(2**63))), "of no track"
    ),
    "boxes-by-the-million": bad(frame_changed("detections", many_boxes), "are allowed"),
    "camera-that-nobody-knows": bad(field("detections", "sensor", "cam-x"), "no such camera"),
    "lidar-that-nobody-knows": bad(field("lidar_scan", "sensor", "lidar-x"), "does not say where"),
    "detections-by-the-lidar": bad(field("detections", "sensor", "lidar"), "no such camera"),
    # -- calibrations
    "rotation-that-is-none": bad(numbers("told", "rotation", put((0, 0), 2.0)), "orthonormal"),
    "rotation-nan": bad(numbers("told", "rotation", put(..., np.nan)), "orthonormal"),
    "lidar-a-light-year-away": bad(numbers("told", "translation_m", put((0, 0), 1e16)), "far away"),
    "focal-length-0": bad(numbers("told", "intrinsics_px", put((0, 0), 0.0)), "calibration of"),
    "lens-nan": bad(numbers("told", "distortion", put((0, 0), np.nan)), "calibration of"),
    "camera-of-2-to-the-62-px": bad(numbers("told", "size_px", put(0, 2**31)), "pixels"),
    "category-of-size-nan": bad(numbers("told", "mean_m", put((0, 0), np.nan)), "size that is none"),
    "true-rotation-that-is-none": bad(numbers("true", "rotation", put((0, 0), 2.0)), "orthonormal"),
    "true-focal-length-negative": bad(
        numbers("true", "intrinsics_px", put((0, 1), -50.0)), "calibration of"
    ),
    # -- the truth
    "truth-told-twice": bad(items(lambda found: [found[0], *found], TRUTH), "there are two"),
    "poses-told-twice": bad(items(twice_posed, TRUTH), "there are two"),
    "period-0": bad(field("truth_about", "period_ns", 0), "period"),
    "period-negative": bad(field("truth_about", "period_ns", -(10**8)), "period"),
    "target-that-is-none": bad(field("truth_about", "target_id", 99), "target 99 is no object"),
    "target-true": bad(field("truth_about", "target_id", True), "target_id"),
    "target-untold": bad(frame_changed("truth_about", untargeted), "target_id"),
    "targets-that-are-none": bad(
        numbers("truth_about", "targets", lambda _: np.array([1, 99])), "target 99 is no object"
    ),
    "two-objects-of-one-id": bad(numbers("truth_about", "object_id", put(..., 1)), "one object_id"),
    "object-of-size-nan": bad(numbers("truth_about", "size_m", put((0, 0), np.nan)), "size that is"),
    "object-of-size-0": bad(numbers("truth_about", "size_m", put((1, 2), 0.0)), "size that is"),
    "pose-nan": bad(numbers("poses", "translation_m", put((3, 0), np.nan), 1), "not finite"),
    "pose-turned-to-nothing": bad(numbers("poses", "rotation", put(0, 0.0), 1), "no rotation"),
    "pose-times-that-fall": bad(numbers("poses", "t_ns", lambda t: t[::-1].copy()), "do not rise"),
    "pose-times-that-overflow": bad(
        numbers("poses", "t_ns", lambda t: np.concatenate([[-(2**63)], t[1:-1], [LATE]])), "beyond|rise"
    ),
    "poses-that-end-too-early": bad(
        numbers("poses", "t_ns", lambda t: t - 10**10), "do not reach"
    ),
    "truth-of-another-count": bad(
        frame_changed("scan_truth", lambda h, b: (
            h | {"arrays": [s | {"shape": [0]} for s in h["arrays"]]}, b""
        )), "another number of points",
    ),
    "point-on-no-object": bad(numbers("scan_truth", "object_id", put(0, 77)), "object that is none"),
    "true-range-nan": bad(numbers("scan_truth", "true_range_m", put(0, np.nan)), "true range"),
    "fired-at-the-end-of-time": bad(field("scan_truth", "first_fire_ns", LATE), ""),
    "fired-before-the-first": bad(
        numbers("scan_truth", "fire_offset_ns", put(3, -(2**31))), "count from the first firing"
    ),
    "fired-before-all-time": bad(field("scan_truth", "first_fire_ns", -(2**63)), ""),
    "image-taken-at-the-end-of-time": bad(field("image_truth", "capture_ns", LATE), ""),
    "image-truth-of-a-lidar": bad(field("image_truth", "sensor", "lidar"), ""),
    "detection-of-no-object": bad(
        numbers("image_truth", "detection_object_id", put(0, 55)), "object that is none"
    ),
    "detections-of-another-count": bad(
        numbers("image_truth", "detection_object_id", lambda _: np.array([-1] * 9)), "number of detections"
    ),
    "box-half-visible": bad(numbers("image_truth", "visible_px", put((0, 1), np.nan)), "not finite"),
    "two-truths-of-one-sweep": bad(field("scan_truth", "seq", 1, 0), "two truths of one sweep"),
    "reference-nan": bad(numbers("reference", "position_ego_m", put((0, 0), np.nan)), "reference"),
    "fix-at-the-end-of-time": bad(numbers("reference", "available_ns", put(0, LATE)), "fix"),
    "truth-among-the-messages": bad(
        truth_as_messages, "its hash is another|no message|begin with"
    ),
}  # fmt: skip


def main() -> None:
    out = Path(sys.argv[1])
    out.mkdir(parents=True)
    for name, one in CORPUS.items():
        one.make(out / name)
    print(f"{len(CORPUS)} recordings in {out}")


if __name__ == "__main__":
    main()
