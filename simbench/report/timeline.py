"""The timeline as a picture: one lane per sensor, 1280 px wide, as SVG by matplotlib.

Each shown sweep has a colour, and the image that is paired with it has the same: a pair that belongs to two
instants shows as an arrow, from the middle of the exposure to the firing along the camera's axis.
"""

from __future__ import annotations

import io
from itertools import pairwise
from typing import Any

import numpy as np

from simbench.report import palette
from simbench.report.figures import STYLE
from simbench.report.words import signed_ms
from simbench.timeline import CROSSING_M, CROSSING_MPS, Exposures, Sweeps, Ticks, Timeline

WIDTH_PX = 1280
LEFT_PX, RIGHT_PX = 150, 368  # for the names, for the numbers
TOP_PX, BOTTOM_PX = 76, 96
LIDAR_PX, CAMERA_PX, TICKS_PX, GAP_PX = 128, 50, 20, 12
SPIN_INSET_PX = 10
NUMBERS_PX = (92, 198, 274, 340)  # right edges of the columns, from the lanes' right end
BEFORE, AFTER, FARTHEST = 0.12, 0.25, 2.0  # shown beyond the sweeps, in periods: at least; at most
SWEEP_COLOURS = (palette.METHOD, palette.RAW)
UNPAIRED = "#B9C1CB"
BAND = "#F4F6F8"


def svg(timeline: Timeline) -> str:
    """The picture. Same timeline, same bytes."""
    import matplotlib

    with matplotlib.rc_context(dict(STYLE)):  # type: ignore[arg-type]
        from matplotlib.backends.backend_svg import FigureCanvasSVG
        from matplotlib.figure import Figure

        page = _Page(timeline)
        figure = Figure(figsize=(WIDTH_PX / 72, page.height_px / 72), facecolor=palette.PAPER)
        FigureCanvasSVG(figure)
        page.draw(figure)
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    size = f'width="{WIDTH_PX}pt" height="{page.height_px}pt"'
    picture = text.getvalue().replace(size, size.replace("pt", "px"), 1)
    return picture.replace("'DejaVu Sans'", "'DejaVu Sans', Verdana, sans-serif")


class _Page:
    """One axes over all lanes: x in ms since the first shown sweep, y in px from the top of the lanes."""

    figure: Any
    axes: Any

    def __init__(self, timeline: Timeline) -> None:
        self.timeline = timeline
        cameras, ticks = len(timeline.cameras), len(timeline.ticks)
        self.lanes_px = LIDAR_PX + GAP_PX * (1 + cameras + ticks) + CAMERA_PX * cameras + TICKS_PX * ticks
        self.height_px = TOP_PX + self.lanes_px + BOTTOM_PX
        starts = timeline.lidar.start_ns
        shown = np.flatnonzero((starts >= timeline.from_ns) & (starts < timeline.to_ns))
        self.colour_of = {int(s): SWEEP_COLOURS[i % 2] for i, s in enumerate(shown)}
        self.low_ms, self.high_ms = self._limits_ms()
        self.px_per_ms = (WIDTH_PX - LEFT_PX - RIGHT_PX) / (self.high_ms - self.low_ms)

    def _limits_ms(self) -> tuple[float, float]:
        """From the first exposure to the last delivery of the images that belong to the shown sweeps."""
        timeline, period_ms = self.timeline, self.timeline.lidar.period_ns * 1e-6
        sweeps_ms = (timeline.to_ns - timeline.from_ns) * 1e-6
        low, high = -BEFORE * period_ms, sweeps_ms + AFTER * period_ms
        for camera in timeline.cameras:
            for f in (int(camera.paired[s]) for s in self.colour_of if camera.paired[s] >= 0):
                opened_ns = int(camera.mid_ns[f]) - (camera.exposure_ns + camera.readout_ns) // 2
                low = min(low, self.ms(opened_ns) - 0.05 * period_ms)
                high = max(high, self.ms(int(camera.arrival_ns[f])) + 0.05 * period_ms)
        return max(low, -FARTHEST * period_ms), min(high, sweeps_ms + FARTHEST * period_ms)

    def ms(self, t_ns: float) -> float:
        return (t_ns - self.timeline.from_ns) * 1e-6

    def visible(self, t_ns: float) -> bool:
        return self.low_ms <= self.ms(t_ns) <= self.high_ms

    def draw(self, figure: Any) -> None:
        self.figure = figure
        inner_px = WIDTH_PX - LEFT_PX - RIGHT_PX
        share = (LEFT_PX / WIDTH_PX, BOTTOM_PX / self.height_px)
        self.axes = figure.add_axes((*share, inner_px / WIDTH_PX, self.lanes_px / self.height_px))
        self.axes.set_xlim(self.low_ms, self.high_ms)
        self.axes.set_ylim(self.lanes_px, 0)
        self._heading()
        self._lidar(self.timeline.lidar)
        top = LIDAR_PX + GAP_PX
        for camera in self.timeline.cameras:
            self._camera(camera, top)
            top += CAMERA_PX + GAP_PX
        for ticks in self.timeline.ticks:
            self._ticks(ticks, top)
            top += TICKS_PX + GAP_PX
        self._legend()

    # -- around the lanes ---------------------------------------------------------------------------------

    def _heading(self) -> None:
        axes, timeline = self.axes, self.timeline
        for side in ("left", "top", "right"):
            axes.spines[side].set_visible(False)
        axes.set_yticks([])
        axes.grid(visible=True, axis="x", zorder=0)
        axes.tick_params(axis="x", length=0, pad=6)
        axes.set_xlabel(f"ms since the first firing of sweep {min(self.colour_of) + 1}", labelpad=5)
        numbers = " and ".join(str(s + 1) for s in self.colour_of)
        plural = "sweep" if len(self.colour_of) == 1 else "sweeps"
        words = f"{plural} {numbers} of {len(timeline.lidar.start_ns)}; faults: {timeline.faults}"
        self._text(20, 28 - TOP_PX, timeline.title, fontsize=16, fontweight="bold")
        self._text(20, 52 - TOP_PX, words, color=palette.MUTED)
        if timeline.cameras:
            target = f"a target crosses at\n{CROSSING_MPS:g} m/s, {CROSSING_M:g} m away"
            for head, column in (
                ("fires after\nmid-exposure", 0),
                ("fires after\nits stamp", 1),
                (target, 3),
            ):
                self._number(head, column, LIDAR_PX, color=palette.MUTED, va="bottom", fontsize=9.5)
            self._number("mean of the run", 3, LIDAR_PX - 38, va="bottom", fontsize=10)

    def _text(self, x_px: float, y_px: float, text: str, **style: Any) -> None:
        """Text on the page; y from the top of the lanes."""
        place = (x_px / WIDTH_PX, 1.0 - (TOP_PX + y_px) / self.height_px)
        self.figure.text(*place, text, **{"va": "center", "fontsize": 10.5, **style})

    def _number(self, text: str, column: int, y_px: float, **style: Any) -> None:
        self._text(WIDTH_PX - RIGHT_PX + 16 + NUMBERS_PX[column], y_px, text, ha="right", **style)

    def _lane(self, top: float, height: float, name: str, note: str = "") -> None:
        self.axes.axhspan(top, top + height, color=BAND, zorder=0, linewidth=0)
        middle = top + height / 2
        self._text(LEFT_PX - 14, middle - (7 if note else 0), name, ha="right", fontsize=11)
        self._text(LEFT_PX - 14, middle + 8, note, ha="right", fontsize=9, color=palette.MUTED)

    # -- lanes --------------------------------------------------------------------------------------------

    def _spin_px(self, since_ns: float) -> float:
        """How far down the spin's line is, that long after the first firing."""
        return SPIN_INSET_PX + (LIDAR_PX - 2 * SPIN_INSET_PX) * since_ns / self.timeline.lidar.period_ns

    def _lidar(self, lidar: Sweeps) -> None:
        """The spin as a falling line: one turn from top to bottom, a dot where it passes a camera's axis."""
        self._lane(0, LIDAR_PX, lidar.name, f"one turn in {lidar.period_ns * 1e-6:g} ms")
        for s, (begin, end) in enumerate(zip(lidar.start_ns.tolist(), lidar.last_ns.tolist(), strict=True)):
            if self.ms(end) < self.low_ms or self.ms(begin) > self.high_ms:
                continue
            colour = self.colour_of.get(s, UNPAIRED)
            x, y = (self.ms(begin), self.ms(end)), (self._spin_px(0), self._spin_px(end - begin))
            self.axes.plot(x, y, color=colour, linewidth=2.2, zorder=3)
            self._stamp(begin, LIDAR_PX, colour)
            self._delivery(int(lidar.arrival_ns[s]), LIDAR_PX, colour)

    def _camera(self, camera: Exposures, top: float) -> None:
        self._lane(top, CAMERA_PX, camera.name, f"stamp: {camera.stamp.replace('_', ' ')}")
        colours = {int(camera.paired[s]): colour for s, colour in self.colour_of.items()}
        for f in range(len(camera.mid_ns)):
            colour = colours.get(f, UNPAIRED)
            self._exposure(camera, f, top, colour)
            self._stamp(int(camera.stamp_ns[f]), top + CAMERA_PX, colour)
            self._delivery(int(camera.arrival_ns[f]), top + CAMERA_PX, colour)
        heights = self._arrow_heights_px(camera)
        for (s, colour), height in zip(self.colour_of.items(), heights, strict=True):
            self._passing(camera, s, top + height, colour)
        self._numbers(camera, top + CAMERA_PX / 2)

    def _arrow_heights_px(self, camera: Exposures) -> list[float]:
        """Of each shown sweep's arrow in the lane: side by side in the middle, or one below the other."""
        spans = []
        for s in self.colour_of:
            mid_ns = camera.mid_ns[camera.paired[s]] if camera.paired[s] >= 0 else camera.passed_ns[s]
            spans.append(sorted((int(mid_ns), int(camera.passed_ns[s]))))
        overlap = any(a[1] > b[0] and b[1] > a[0] for a, b in pairwise(spans))
        return [CAMERA_PX * ((0.34 if i % 2 == 0 else 0.78) if overlap else 0.5) for i in range(len(spans))]

    def _exposure(self, camera: Exposures, f: int, top: float, colour: str) -> None:
        """Rows from top to bottom: a rolling shutter leans."""
        half, read, mid = camera.exposure_ns / 2, camera.readout_ns / 2, float(camera.mid_ns[f])
        if self.visible(mid - half - read) or self.visible(mid + half + read):
            x = [mid - read - half, mid - read + half, mid + read + half, mid + read - half]
            y0, y1 = top + 4, top + CAMERA_PX - 4
            self.axes.fill(
                [self.ms(t) for t in x], [y0, y0, y1, y1], color=colour, alpha=0.85, linewidth=0.8, zorder=2
            )

    def _passing(self, camera: Exposures, s: int, middle: float, colour: str) -> None:
        """A thread from the spin down to the lane, and the arrow of the hidden offset."""
        passed = int(camera.passed_ns[s])
        x, spin = self.ms(passed), self._spin_px(passed - int(self.timeline.lidar.start_ns[s]))
        ring = {"color": palette.PAPER, "markeredgecolor": colour}
        self.axes.plot((x, x), (spin, middle), color=colour, linewidth=0.7, linestyle=(0, (1, 3)), zorder=1)
        self.axes.plot(x, spin, "o", color=colour, markeredgecolor=palette.PAPER, markersize=5, zorder=4)
        self.axes.plot(x, middle, "o", **ring, markersize=6, markeredgewidth=1.6, zorder=6)
        label = {"va": "center", "fontsize": 9, "zorder": 7, "clip_on": True}
        if camera.paired[s] < 0:
            self.axes.text(x + 9 / self.px_per_ms, middle, "no image", **label)
            return
        mid = self.ms(int(camera.mid_ns[camera.paired[s]]))
        words = signed_ms(x - mid)
        length_px = abs(x - mid) * self.px_per_ms
        if length_px > 14:
            arrow = {"arrowstyle": "-|>", "color": palette.INK, "linewidth": 1.1, "shrinkA": 0, "shrinkB": 4}
            self.axes.annotate(
                "", (x, middle), (mid, middle), zorder=5, arrowprops=arrow, annotation_clip=True
            )
        if length_px > 70:
            self.axes.text((x + mid) / 2, middle - 9, words, ha="center", **label)
        else:
            self.axes.text(max(x, mid) + 9 / self.px_per_ms, middle, words, ha="left", **label)

    def _numbers(self, camera: Exposures, middle: float) -> None:
        if camera.apart_m is None or camera.apart_px is None:
            self._number("no image is paired", 1, middle, color=palette.MUTED)
            return
        for column, late_ms in enumerate((camera.fires_after_mid_ms, camera.fires_after_stamp_ms)):
            varies = float(np.ptp(late_ms)) > 0.005
            self._number(signed_ms(float(late_ms.mean())), column, middle - (7 if varies else 0))
            if varies:
                span = f"{late_ms.min():.0f} to {late_ms.max():.0f}".replace("-", "−")
                self._number(span, column, middle + 9, color=palette.MUTED, fontsize=9)
        self._number(f"{camera.apart_m * 1e3:.0f} mm", 2, middle)
        self._number(f"{camera.apart_px:.1f} px", 3, middle)

    def _ticks(self, ticks: Ticks, top: float) -> None:
        self._lane(top, TICKS_PX, ticks.name)
        for t in ticks.taken_ns.tolist():
            if self.visible(t):
                x = self.ms(t)
                self.axes.plot((x, x), (top + 4, top + TICKS_PX - 4), color=palette.INK, linewidth=1.3)
        for t in ticks.delivered_ns.tolist() if ticks.delivered_ns is not None else ():
            self._delivery(t, top + TICKS_PX, palette.MUTED, markersize=4.5, markeredgewidth=1.0)
        self._text(
            WIDTH_PX - RIGHT_PX + 16, top + TICKS_PX / 2, ticks.words, color=palette.MUTED, fontsize=9.5
        )

    # -- marks --------------------------------------------------------------------------------------------

    def _stamp(self, t_ns: float, bottom: float, colour: str) -> None:
        if self.visible(t_ns):
            self.axes.plot(self.ms(t_ns), bottom, "^", color=colour, markersize=8, zorder=8, clip_on=False)

    def _delivery(self, t_ns: float, bottom: float, colour: str, **size: float) -> None:
        if self.visible(t_ns):
            look = {"color": palette.PAPER, "markeredgecolor": colour, "zorder": 8, "clip_on": False}
            self.axes.plot(
                self.ms(t_ns), bottom, "v", **look, **{"markersize": 7, "markeredgewidth": 1.4, **size}
            )

    def _legend(self) -> None:
        from matplotlib.lines import Line2D
        from matplotlib.patches import Polygon

        def mark(sign: str, **look: Any) -> Line2D:
            hollow = {"color": palette.PAPER, "markeredgecolor": palette.INK, "linestyle": ""}
            return Line2D([], [], marker=sign, **{**hollow, "markersize": 7, **look})

        entries = {
            "the LiDAR's spin, a colour per sweep and its images": Line2D(
                [], [], color=palette.METHOD, linewidth=2.2
            ),
            "exposure, top row to bottom row": Polygon([(0, 0), (1, 0), (1, 1)], color=palette.MUTED),
            "columns along the camera's axis fire": mark("o", markeredgewidth=1.6),
            "what the stamp claims": mark("^", color=palette.INK, markersize=8),
            "delivered": mark("v", markeredgewidth=1.4),
        }
        self.figure.legend(
            entries.values(), entries.keys(), loc="lower left", ncols=len(entries), handletextpad=0.5,
            bbox_to_anchor=(12 / WIDTH_PX, 8 / self.height_px), columnspacing=1.8, fontsize=10,
        )  # fmt: skip
