"""A recording written to disk message by message, and the memory that it takes."""

from __future__ import annotations

import multiprocessing
import re
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np

from tests.benchmarks import frames

JPEG_QUALITY = 95


@dataclass(frozen=True, kw_only=True)
class Written:
    """What a recording took: the process's peak resident memory, files, and bytes on disk."""

    peak_rss_mb: float
    files: int
    disk_mb: float


def record(recording_s: float, image_px: tuple[int, int] | None, spawn: bool) -> Written:
    """Record into a folder for temporary files that is deleted afterwards. With `spawn` in a fresh process,
    whose memory counts from its start."""
    with tempfile.TemporaryDirectory(prefix="simbench-benchmark-") as folder:
        if spawn:
            with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
                peak_rss_mb = pool.submit(write_recording, folder, recording_s, image_px).result()
        else:
            peak_rss_mb = write_recording(folder, recording_s, image_px)
        sizes = [path.stat().st_size for path in Path(folder).iterdir()]
    return Written(peak_rss_mb=peak_rss_mb, files=len(sizes), disk_mb=sum(sizes) / 1e6)


def write_recording(folder: str, recording_s: float, image_px: tuple[int, int] | None) -> float:
    """Every scan with its truth, every picture (JPEG), its ids (PNG) and its depth (float16): one file each,
    as soon as it is there. Returns the process's peak resident memory in MB."""
    session = frames.set_up(effects=False, image_px=image_px, duration_s=recording_s)
    count = session.rig.sweeps(recording_s)
    for number in range(count):
        scan, truth, pictures = frames.take(session, number)
        stem = Path(folder, f"{number:05d}")
        np.savez(f"{stem}-scan.npz", **{**asdict(scan), **{f"true_{k}": v for k, v in asdict(truth).items()}})
        for name, frame in pictures.items():
            _write(f"{stem}-{name}.jpg", frame.rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
            _write(f"{stem}-{name}-ids.png", (frame.object_id + 1).astype(np.uint16), [])
            np.save(f"{stem}-{name}-depth.npy", frame.depth_m.astype(np.float16))
    return peak_rss_mb()


def _write(path: str, picture: np.ndarray, options: list[int]) -> None:
    if not cv2.imwrite(path, picture, options):
        raise OSError(f"{path} could not be written")


def peak_rss_mb() -> float:
    """Highest resident memory of this process so far, by Linux's own count.

    Not `ru_maxrss`: a process inherits that from the one that started it.
    """
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    found = re.search(r"^VmHWM:\s+(\d+) kB$", status, re.MULTILINE)
    if found is None:
        raise OSError("/proc/self/status has no VmHWM")
    return int(found[1]) * 1024 / 1e6
