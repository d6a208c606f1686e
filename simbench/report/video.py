"""A run as video: per scan the camera that sees the target largest; left the baseline, right the method.

10 scans a second are shown at 2.5 frames a second, four times slowed. VP9 in WebM, which browsers play.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from fusion.camera import PinholeCamera
from fusion.messages import BoxPx
from simbench.case import Images, JobResult
from simbench.exhibit import PairView
from simbench.formats.targets import is_recorded
from simbench.report import palette
from simbench.report.choose import Group, groups_of, pairs_of, shift_px
from simbench.report.overlay import (
    WIDTH,
    Marks,
    common_field,
    cut,
    dot_size,
    jpeg_uri,
    marks_of,
    thinned,
    within,
)
from simbench.report.pictures import Replayed, replay_of
from simbench.report.words import NONE, fault_words, percent, pipeline_words

SLOWED = 4
SHARPER = 2  # pixels of a picture along one of the camera's: edges are averaged, close-ups stay sharp
PANEL_PX = (560, 420)
GAP_PX, HEAD_PX = 8, 64  # the words stand above, where no player lays its controls
NEIGHBOURS = 4  # the zoom is that of the widest field among so many scans before and after
OPTIONS = {"deadline": "realtime", "cpu-used": "8", "row-mt": "1", "crf": "33", "b": "0"}


def video_name(scenario: str, system: str, seed: int) -> str:
    """The file's name in the output folder."""
    return f"overlay-{scenario}-{system}-{seed}.webm"


def find_video(out: Path, scenario: str, system: str, seed: int) -> Path | None:
    """The video of a run, if there is one."""
    path = out / video_name(scenario, system, seed)
    return path if path.is_file() else None


def write_video(result: JobResult, out: Path, images: Images = "raycast") -> Path:
    """Write the video of a result into `out`, return its path. ValueError without a target in view; raises
    gl.RenderingUnavailable where nothing draws."""
    if not result.views:
        raise ValueError("a video needs at least one scan with the target in view")
    path = out / video_name(result.scenario.name, result.job.system, result.job.seed)
    replay = replay_of(result.job)
    rate_hz = Fraction(replay.rate_hz).limit_denominator(1000) / SLOWED
    encode(frames(result, replay, images), path, rate_hz)
    return path


def moves(result: JobResult) -> bool:
    """Whether a video shows more than a picture: several scans with a target, or a simulated drive."""
    scans = {view.scan_seq for view in result.views}
    return len(scans) > (1 if is_recorded(result.job.scenario) else 0)


def encode(pictures: Iterator[UInt8[np.ndarray, "h w 3"]], path: Path, rate_hz: Fraction) -> None:
    """Write pictures of one size (even sides) as VP9."""
    import av
    from av.video.stream import VideoStream

    with av.open(str(path), "w", format="webm", container_options={"fflags": "+bitexact"}) as container:
        stream: VideoStream | None = None
        for picture in pictures:
            if stream is None:
                made = container.add_stream("libvpx-vp9", rate=rate_hz, options=OPTIONS)
                assert isinstance(made, VideoStream)
                stream = made
                stream.height, stream.width = picture.shape[:2]
                stream.pix_fmt = "yuv420p"
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            container.mux(stream.encode(frame))
        if stream is None:
            raise ValueError("a video needs at least one picture")
        container.mux(stream.encode(None))


def poster_uri(path: Path) -> str:
    """A picture from the middle of a video, as a data URI."""
    import av

    with av.open(str(path)) as container:
        pictures = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    return jpeg_uri(pictures[len(pictures) // 2], quality=72)


def shown_views(views: Sequence[PairView]) -> tuple[PairView, ...]:
    """Per scan the view with the largest outline (of equal ones the first camera), in order of time."""
    best: dict[int, PairView] = {}
    for view in sorted(views, key=lambda v: (v.scan_stamp_ns, v.camera)):
        if view.scan_seq not in best or _area(view) > _area(best[view.scan_seq]):
            best[view.scan_seq] = view
    return tuple(best.values())


def _area(view: PairView) -> float:
    x0, y0, x1, y1 = view.outline_px
    return (x1 - x0) * (y1 - y0)


def frames(result: JobResult, replay: Replayed, images: Images) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
    """The pictures of the video, one after another."""
    (group,) = groups_of([result])
    names = [name for name in (group.baseline, group.method) if name is not None]
    views = shown_views(result.views)
    pinholes = replay.pinholes
    marks = [{name: marks_of(v, name, pinholes[v.camera]) for name in names} for v in views]
    fields = _steady(
        [
            (v.camera, common_field(list(m.values()), pinholes[v.camera], PANEL_PX[0] / PANEL_PX[1]))
            for v, m in zip(views, marks, strict=True)
        ],
        pinholes,
    )
    tpr = {name: {key: p.tpr for key, p in pairs_of(result, name).items()} for name in names}
    faults = fault_words(result.faults) if len(result.faults) else "no injected errors"
    with replay.camera(images, SHARPER) as taker:
        for view, drawn, field in zip(views, marks, fields, strict=True):
            picture = taker.take(view.camera, view.capture_ns)
            ground = cut(picture, field, pinholes[view.camera].width_px, PANEL_PX[0])
            panels = [
                (
                    _heading(name, tpr[name].get((view.scan_seq, view.camera, view.target))),
                    paint(ground, drawn[name], field),
                )
                for name in names
            ]
            yield _page(panels, _words(group, view, faults))


def _steady(fields: Sequence[tuple[str, BoxPx]], pinholes: Mapping[str, PinholeCamera]) -> list[BoxPx]:
    """Fields about their own centres, as wide as the widest of the same camera nearby: a calm zoom. Like the
    fields themselves they are moved into the image."""
    steady = []
    for i, (camera, (x0, y0, x1, y1)) in enumerate(fields):
        near = fields[max(0, i - NEIGHBOURS) : i + NEIGHBOURS + 1]
        grow = max((b[2] - b[0]) / (x1 - x0) for name, b in near if name == camera)
        w, h = 0.5 * grow * (x1 - x0), 0.5 * grow * (y1 - y0)
        x = within(0.5 * (x0 + x1), w, float(pinholes[camera].width_px))
        y = within(0.5 * (y0 + y1), h, float(pinholes[camera].height_px))
        steady.append((x - w, y - h, x + w, y + h))
    return steady


def _heading(pipeline: str, tpr: float | None) -> str:
    return f"{pipeline_words(pipeline)}   TPR {percent(tpr, 0)} %"


def _words(group: Group, view: PairView, faults: str) -> str:
    shift = shift_px(view)
    error = NONE if shift is None else f"{shift:.1f}"
    time_s = 1e-9 * view.scan_stamp_ns
    return f"t = {time_s:.1f} s   {view.camera}   shift {error} px   {group.system}: {faults}"


def _page(panels: Sequence[tuple[str, np.ndarray]], top: str) -> UInt8[np.ndarray, "h w 3"]:
    width, height = PANEL_PX
    page = np.full(
        (HEAD_PX + height, len(panels) * width + (len(panels) - 1) * GAP_PX, 3), 255, dtype=np.uint8
    )
    write(page, top, (6, 24), palette.INK, 17, 400)
    for number, (head, picture) in enumerate(panels):
        x = number * (width + GAP_PX)
        page[HEAD_PX:, x : x + width] = picture
        write(page, head, (x + 6, 53), palette.INK, 18, 600)
    return page


def write(picture: np.ndarray, text: str, at: tuple[int, int], colour: str, size: int, weight: int) -> None:
    """Text by OpenCV's own font, which needs none of the system; its baseline starts at `at`."""
    cv2.putText(picture, text, at, _rgb(colour), cv2.FontFace("sans"), size, weight)


@cache
def _rgb(colour: str) -> tuple[int, int, int]:
    blue, green, red = palette.bgr(colour)
    return red, green, blue


FINE = 4  # fractional bits of OpenCV's drawing
SPECK_GRID = 4.0 * 2**FINE
PER_UNIT = PANEL_PX[0] / WIDTH  # pixels of a panel per user unit of a crop
THICK_FROM = 1.9 * 2**FINE


def paint(ground: UInt8[np.ndarray, "h w 3"], marks: Marks, field: BoxPx) -> UInt8[np.ndarray, "h w 3"]:
    """The marks on a copy of the field's picture, as `overlay.crop_svg` draws them."""
    picture = np.ascontiguousarray(ground).copy()
    per_px = picture.shape[1] / (field[2] - field[0])

    def place(uv: np.ndarray) -> np.ndarray:
        flat = (np.asarray(uv, dtype=np.float64).reshape(-1, 2) - field[:2]) * per_px
        near = (flat > -20).all(axis=1) & (flat < np.array(picture.shape[1::-1]) + 20).all(axis=1)
        return np.asarray(np.rint(flat[near] * 2**FINE), dtype=np.int64)

    def corners(box: BoxPx) -> list[tuple[int, int]]:
        flat = np.rint((np.array(box).reshape(2, 2) - field[:2]) * (per_px * 2**FINE)).astype(int)
        return [(int(u), int(v)) for u, v in flat]

    def line(a: tuple[int, int], b: tuple[int, int], colour: str, width: int) -> None:
        cv2.line(picture, a, b, _rgb(colour), width, cv2.LINE_AA, FINE)

    def rectangle(box: BoxPx, colour: str, width: int) -> None:
        a, b = corners(box)
        cv2.rectangle(picture, a, b, _rgb(colour), width, cv2.LINE_AA, FINE)

    for point in thinned(place(marks.other), SPECK_GRID):
        cv2.circle(picture, tuple(point), 18, _rgb(palette.OUTSIDE), -1, cv2.LINE_AA, FINE)
    if marks.aoi is not None:
        rectangle(marks.aoi, palette.AOI, 2)
    if marks.box is not None:
        rectangle(marks.box, palette.BOX, 2)
    targets = np.concatenate([place(marks.right), place(marks.wrong), place(marks.missed)])
    radius = round(0.5 * PER_UNIT * dot_size(targets / (PER_UNIT * 2**FINE)) * 2**FINE)
    rim = 12 if radius > THICK_FROM else 0  # no rims where points are dense: they would merge
    for point in place(marks.missed):
        cv2.circle(picture, tuple(point), radius, _rgb(palette.OUTSIDE), 1, cv2.LINE_AA, FINE)
    for colour, width in ((palette.INK, 4), (palette.WRONG, 2)) if rim else ((palette.WRONG, 1),):
        for u, v in place(marks.wrong).tolist():
            line((u - radius, v - radius), (u + radius, v + radius), colour, width)
            line((u - radius, v + radius), (u + radius, v - radius), colour, width)
    for colour, grown in ((palette.INK, radius + rim), (palette.RIGHT, radius)):
        for point in place(marks.right) if colour == palette.RIGHT or rim else ():
            cv2.circle(picture, tuple(point), grown, _rgb(colour), -1, cv2.LINE_AA, FINE)
    if marks.shift_px is not None:
        a, b = corners((*marks.true_px, *marks.told_px))
        least = 9 * 2**FINE
        tip = least / max(float(np.hypot(b[0] - a[0], b[1] - a[1])), least)
        for colour, width in ((palette.INK, 5), (palette.SHIFT, 3)):
            cv2.arrowedLine(picture, a, b, _rgb(colour), width, cv2.LINE_AA, FINE, tip)
    return picture
