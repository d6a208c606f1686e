"""One camera crop with the LiDAR's points on it, as scalable inline SVG.

Right (mapped, inside the paper's window): green dot. Wrong (mapped, outside it): red cross. Not mapped:
blue, a ring where the point is on the target and a speck elsewhere. White: the delivered box. Yellow,
dashed: the AOI. The arrow goes from where the target's points truly are in the image to where the told
calibration puts them.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from markupsafe import Markup

from fusion.aoi import AoiConfig, clip, enlarge
from fusion.camera import PinholeCamera, inside_box
from fusion.messages import BoxPx
from simbench.exhibit import PairView
from simbench.report import palette
from simbench.report.choose import shift_px

WIDTH, HEIGHT = 400.0, 272.0  # user units of a crop; about one per screen pixel
AOI_CONFIG = AoiConfig()
MARGIN = 0.22  # around what must be seen, as a share of it
SMALLEST_DOT, LARGEST_DOT, HALO_FROM = 2.4, 4.6, 3.2
GRID = 3.0  # specks nearer than this, in user units, are drawn once


@dataclass(frozen=True, kw_only=True, eq=False)
class Marks:
    """What to draw, in pixels of the camera."""

    right: Float[np.ndarray, "right 2"]
    wrong: Float[np.ndarray, "wrong 2"]
    missed: Float[np.ndarray, "missed 2"]  # on the target, not mapped
    other: Float[np.ndarray, "other 2"]
    box: BoxPx | None
    aoi: BoxPx | None
    outline: BoxPx
    true_px: tuple[float, float]
    told_px: tuple[float, float]
    shift_px: float | None


def marks_of(view: PairView, pipeline: str | None, camera: PinholeCamera) -> Marks:
    """Marks of a view for one pipeline, of what lies in the image. Without an answer nothing is mapped."""
    uv = view.uv_px
    mapped = view.mapped.get(pipeline or "", np.zeros(len(uv), dtype=bool))
    seen = inside_box(uv, (0.0, 0.0, float(camera.width_px), float(camera.height_px)))
    return Marks(
        right=uv[seen & mapped & view.right],
        wrong=uv[seen & mapped & ~view.right],
        missed=uv[seen & ~mapped & view.on_target],
        other=uv[seen & ~mapped & ~view.on_target],
        box=view.box_px,
        aoi=None if view.box_px is None else clip(enlarge(view.box_px, AOI_CONFIG), camera),
        outline=view.outline_px,
        true_px=view.true_px,
        told_px=view.told_px,
        shift_px=shift_px(view),
    )


def common_field(marks: list[Marks], camera: PinholeCamera, aspect: float = WIDTH / HEIGHT) -> BoxPx:
    """The part of the image that shows every given target with its AOI and arrow; aspect: width : height.

    It is moved into the image, and never larger than it takes to show all of it."""
    boxes = [m.aoi or m.outline for m in marks] + [m.outline for m in marks]
    dots = [p for m in marks for p in (m.true_px, m.told_px) if np.isfinite(p).all()]
    x0 = min([b[0] for b in boxes] + [p[0] for p in dots])
    y0 = min([b[1] for b in boxes] + [p[1] for p in dots])
    x1 = max([b[2] for b in boxes] + [p[0] for p in dots])
    y1 = max([b[3] for b in boxes] + [p[1] for p in dots])
    width, height = (1.0 + 2.0 * MARGIN) * (x1 - x0), (1.0 + 2.0 * MARGIN) * (y1 - y0)
    width = min(max(width, height * aspect), max(camera.width_px, camera.height_px * aspect))
    height = width / aspect
    x = within(0.5 * (x0 + x1), 0.5 * width, float(camera.width_px))
    y = within(0.5 * (y0 + y1), 0.5 * height, float(camera.height_px))
    return (x - 0.5 * width, y - 0.5 * height, x + 0.5 * width, y + 0.5 * height)


def within(middle: float, half: float, side: float) -> float:
    """The middle of an interval, moved so that it lies in [0, side]; centred where it is longer."""
    return 0.5 * side if 2.0 * half >= side else min(max(middle, half), side - half)


def cut(
    picture: UInt8[np.ndarray, "h w 3"], field: BoxPx, width_px: int, wide_px: int
) -> UInt8[np.ndarray, "a b 3"]:
    """The field (pixels of a camera `width_px` wide) out of its picture, `wide_px` wide; dark beyond it."""
    scale = wide_px / (field[2] - field[0])
    shrink = int(picture.shape[1] / width_px / scale)
    if shrink > 1:  # average first: a warp would skip pixels
        size = (picture.shape[1] // shrink, picture.shape[0] // shrink)
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    per_px = picture.shape[1] / width_px
    tall_px = round((field[3] - field[1]) * scale)
    # Output pixel (i, j) has its centre at (i + 0.5, j + 0.5) user pixels; OpenCV puts centres on integers.
    inverse = np.array(
        [
            [per_px / scale, 0.0, per_px * (field[0] + 0.5 / scale) - 0.5],
            [0.0, per_px / scale, per_px * (field[1] + 0.5 / scale) - 0.5],
        ]
    )
    plain = tuple(reversed(palette.bgr(palette.PLAIN)))
    how = cv2.INTER_CUBIC if per_px <= scale else cv2.INTER_LINEAR
    return cv2.warpAffine(
        picture,
        inverse,
        (wide_px, tall_px),
        flags=how | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=plain,
    )


def jpeg_uri(rgb: UInt8[np.ndarray, "h w 3"], quality: int = 86) -> str:
    """A picture as a data URI."""
    done, data = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise RuntimeError("OpenCV could not encode a picture")
    return "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode("ascii")


def crop_svg(marks: Marks, field: BoxPx, picture: str | None, label: str) -> Markup:
    """The crop. `picture`: data URI of exactly the field, None for a plain ground."""
    per_px = WIDTH / (field[2] - field[0])

    def place(uv: np.ndarray) -> np.ndarray:
        flat = (np.asarray(uv, dtype=np.float64).reshape(-1, 2) - field[:2]) * per_px
        inside = (flat > -6).all(axis=1) & (flat[:, 0] < WIDTH + 6) & (flat[:, 1] < HEIGHT + 6)
        return flat[inside]

    parts = [
        Markup('<svg class="crop" viewBox="0 0 {:g} {:g}" role="img" aria-label="{}">').format(
            WIDTH, HEIGHT, label
        )
    ]
    if picture is None:
        parts.append(_rect((0, 0, WIDTH, HEIGHT), f'fill="{palette.PLAIN}"'))
        parts.append(_rect(_box(marks.outline, field, per_px), 'class="outline"'))
    else:
        parts.append(
            Markup('<image href="{}" width="{:g}" height="{:g}" preserveAspectRatio="none"/>').format(
                picture, WIDTH, HEIGHT
            )
        )
    size = dot_size(np.concatenate([place(marks.right), place(marks.wrong), place(marks.missed)]))
    parts.append(_dots(thinned(place(marks.other), GRID), "other"))
    if marks.aoi is not None:
        parts.append(_rect(_box(marks.aoi, field, per_px), 'class="aoi"'))
    if marks.box is not None:
        parts.append(_rect(_box(marks.box, field, per_px), 'class="box"'))
    parts.append(_rings(place(marks.missed), size))
    parts.append(_crosses(place(marks.wrong), size))
    if size > HALO_FROM:
        parts.append(_dots(place(marks.right), "halo", size + 1.4))
    parts.append(_dots(place(marks.right), "right", size))
    parts.append(_arrow(marks, field, per_px))
    return Markup("").join([*parts, Markup("</svg>")])


def _box(box: BoxPx, field: BoxPx, per_px: float) -> BoxPx:
    return (
        (box[0] - field[0]) * per_px,
        (box[1] - field[1]) * per_px,
        (box[2] - field[0]) * per_px,
        (box[3] - field[1]) * per_px,
    )


def _rect(box: BoxPx, style: str) -> Markup:
    x0, y0, x1, y1 = (f"{v:.1f}" for v in (box[0], box[1], box[2] - box[0], box[3] - box[1]))
    return Markup(f'<rect x="{x0}" y="{y0}" width="{x1}" height="{y1}" {style}/>')


def dot_size(uv: np.ndarray) -> float:
    """Diameter of a dot in user units: 0.7 of the usual distance to the nearest of the other points [k 2], so
    that the picture stays visible between them."""
    if len(uv) < 2:
        return LARGEST_DOT
    from scipy.spatial import cKDTree

    nearest = cKDTree(uv).query(uv, k=2)[0][:, 1]
    return float(np.clip(0.7 * np.median(nearest), SMALLEST_DOT, LARGEST_DOT))


def _path(steps: list[str], style: str, width: float | None = None) -> Markup:
    if not steps:
        return Markup("")
    wide = "" if width is None else f' stroke-width="{width:.1f}"'
    return Markup(f'<path class="{style}"{wide} d="{"".join(steps)}"/>')


def _dots(uv: np.ndarray, style: str, size: float | None = None) -> Markup:
    return _path([f"M{u:.1f} {v:.1f}h0" for u, v in uv], style, size)


def _rings(uv: np.ndarray, size: float) -> Markup:
    r = 0.5 * size
    arcs = f"a{r:.1f} {r:.1f} 0 1 0 {2 * r:.1f} 0a{r:.1f} {r:.1f} 0 1 0-{2 * r:.1f} 0"
    return _path([f"M{u - r:.1f} {v:.1f}{arcs}" for u, v in uv], "missed", 0.3 * size)


def _crosses(uv: np.ndarray, size: float) -> Markup:
    r = 0.52 * size
    arms = f"l{2 * r:.1f} {2 * r:.1f}m{-2 * r:.1f} 0l{2 * r:.1f} {-2 * r:.1f}"
    steps = [f"M{u - r:.1f} {v - r:.1f}{arms}" for u, v in uv]
    under = _path(steps, "under", 0.42 * size + 1.2) if size > HALO_FROM else Markup("")
    return under + _path(steps, "wrong", 0.42 * size)


def thinned(uv: np.ndarray, grid: float) -> np.ndarray:
    """One of the points [k 2] per square cell of the grid: the first."""
    _, first = np.unique(np.floor(uv / grid).astype(np.int64), axis=0, return_index=True)
    return uv[np.sort(first)]


def _arrow(marks: Marks, field: BoxPx, per_px: float) -> Markup:
    if marks.shift_px is None:
        return Markup("")
    x0, y0, x1, y1 = _box((*marks.true_px, *marks.told_px), field, per_px)
    length = float(np.hypot(x1 - x0, y1 - y0))
    steps = [f"M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}"]
    if length > 9.0:
        du, dv = (x1 - x0) / length, (y1 - y0) / length
        for side in (-1.0, 1.0):
            a, b = x1 - 8 * du + side * 4.5 * dv, y1 - 8 * dv - side * 4.5 * du
            steps.append(f"M{x1:.1f} {y1:.1f}L{a:.1f} {b:.1f}")
    left = x1 > 0.72 * WIDTH
    text_x = x1 - 9 if left else x1 + 9
    text_y = min(max(y1 + (12 if y1 >= y0 else -6), 16), HEIGHT - 8)
    anchor = "end" if left else "start"
    return (
        _path(steps, "under", 4.6)
        + _path(steps, "shift")
        + Markup(
            f'<circle class="origin" cx="{x0:.1f}" cy="{y0:.1f}" r="3"/>'
            f'<text class="px" x="{text_x:.1f}" y="{text_y:.1f}" text-anchor="{anchor}">'
            f"{marks.shift_px:.1f} px</text>"
        )
    )
