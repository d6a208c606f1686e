"""The timeline for a terminal, by rich: a strip of characters per sensor, and the table of hidden offsets."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simbench.report.words import NONE, signed_ms
from simbench.timeline import CROSSING_M, CROSSING_MPS, Exposures, Timeline

if TYPE_CHECKING:
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

FIRST, SPIN, OPEN, PASSED, STAMP, DELIVERED, TICK, EMPTY = "┣", "━", "█", "◆", "▲", "▽", "╵", "·"
COLOURS = ("blue", "dark_orange")
QUIET = "grey50"
BEFORE, AFTER = 0.15, 0.6  # shown beyond the sweeps, in periods
NAME_WIDTH, LEAST_WIDTH = 18, 40


def text(timeline: Timeline, width: int) -> Group:
    """What `rich` prints, `width` characters wide: the strips, what the signs mean, the numbers."""
    from rich.console import Group
    from rich.text import Text

    strips = Strips(timeline, max(width - NAME_WIDTH - 1, LEAST_WIDTH))
    first = int(strips.shown[0]) + 1
    numbers = " and ".join(str(int(s) + 1) for s in strips.shown)
    total = len(timeline.lidar.start_ns)
    head = Text(f"{timeline.title}: sweeps {numbers} of {total}, faults {timeline.faults}", style="bold")
    signs = (
        f"{FIRST}{SPIN} a sweep, {OPEN} exposure, {PASSED} fires along the camera's axis, "
        f"{STAMP} what the stamp claims, {DELIVERED} delivered, {TICK} sample; "
        f"ms since the first firing of sweep {first}; a colour per sweep and the images paired with it"
    )
    return Group(head, Text(), *strips.lines(), Text(signs, style=QUIET), Text(), table(timeline))


def table(timeline: Timeline) -> Table:
    """The hidden offset of every camera, mean over the run."""
    from rich.table import Table

    found = Table(box=None, pad_edge=False, header_style="bold")
    found.add_column("camera", no_wrap=True, min_width=NAME_WIDTH - 2)
    crossing = f"at {CROSSING_MPS:g} m/s, {CROSSING_M:g} m away"
    for head in ("fires after mid-exposure", "fires after its stamp", "moves", crossing, "sweeps with image"):
        found.add_column(head, justify="right")
    for camera in timeline.cameras:
        found.add_row(camera.name, *_numbers(camera))
    return found


def _numbers(camera: Exposures) -> tuple[str, ...]:
    count = f"{int((camera.paired >= 0).sum())} of {len(camera.paired)}"
    if camera.apart_m is None or camera.apart_px is None:
        return NONE, NONE, NONE, NONE, count
    late = [_spread(ms) for ms in (camera.fires_after_mid_ms, camera.fires_after_stamp_ms)]
    return *late, f"{camera.apart_m * 1e3:.0f} mm", f"{camera.apart_px:.1f} px", count


def _spread(late_ms: np.ndarray) -> str:
    mean = signed_ms(float(late_ms.mean()))
    if float(np.ptp(late_ms)) <= 0.005:
        return mean
    return f"{mean} ({late_ms.min():.0f} to {late_ms.max():.0f})".replace("-", "−")


class Strips:
    """Characters over time: `width` cells from a little before the shown sweeps to some time after them."""

    def __init__(self, timeline: Timeline, width: int) -> None:
        self.timeline, self.width = timeline, width
        period = timeline.lidar.period_ns
        self.low_ns = timeline.from_ns - round(BEFORE * period)
        self.cell_ns = (timeline.to_ns + round(AFTER * period) - self.low_ns) / width
        starts = timeline.lidar.start_ns
        self.shown = np.flatnonzero((starts >= timeline.from_ns) & (starts < timeline.to_ns))
        self.colour_of = {int(s): COLOURS[i % 2] for i, s in enumerate(self.shown)}

    def lines(self) -> list[Text]:
        """One or two lines per sensor, the scale last."""
        lines = self._lidar()
        for camera in self.timeline.cameras:
            lines += self._camera(camera)
        for ticks in self.timeline.ticks:
            line = Line(ticks.name, self)
            for t in ticks.taken_ns:
                line.put(int(t), TICK, "default")
            lines.append(line.text())
        return [*lines, self._scale()]

    def _lidar(self) -> list[Text]:
        lidar = self.timeline.lidar
        spin, said = Line(lidar.name, self), Line("", self)
        for s, begin in enumerate(lidar.start_ns):
            colour = self.colour_of.get(s, QUIET)
            spin.fill(int(begin), int(lidar.last_ns[s]), SPIN, colour)
            spin.put(int(begin), FIRST, colour)
            said.put(int(begin), STAMP, colour)
            said.put(int(lidar.arrival_ns[s]), DELIVERED, colour)
        return [spin.text(), said.text()]

    def _camera(self, camera: Exposures) -> list[Text]:
        took, said = Line(camera.name, self), Line("", self)
        colours = {int(camera.paired[s]): colour for s, colour in self.colour_of.items()}
        half_ns = (camera.exposure_ns + camera.readout_ns) // 2
        for f, mid in enumerate(int(t) for t in camera.mid_ns):
            colour = colours.get(f, QUIET)
            took.fill(mid - half_ns, mid + half_ns, OPEN, colour)
            said.put(int(camera.stamp_ns[f]), STAMP, colour)
            said.put(int(camera.arrival_ns[f]), DELIVERED, colour)
        for s, colour in self.colour_of.items():
            took.put(int(camera.passed_ns[s]), PASSED, f"bold {colour}")
        return [took.text(), said.text()]

    def _scale(self) -> Text:
        line = Line("ms", self, empty=" ")
        step_ns = self.timeline.lidar.period_ns // 4
        for k in range(-1, 1 + int((self.width * self.cell_ns) // step_ns)):
            at_ns = self.timeline.from_ns + k * step_ns
            for i, sign in enumerate(f"{k * step_ns * 1e-6:g}"):
                line.put(at_ns + round(i * self.cell_ns), sign, QUIET)
        return line.text()


class Line:
    """A named row of cells."""

    def __init__(self, name: str, strips: Strips, empty: str = EMPTY) -> None:
        self.name, self.strips = name, strips
        self.cells = [(empty, QUIET)] * strips.width

    def put(self, t_ns: int, sign: str, style: str) -> None:
        """A sign at an instant; nothing where that is not shown."""
        cell = int((t_ns - self.strips.low_ns) // self.strips.cell_ns)
        if 0 <= cell < len(self.cells):
            self.cells[cell] = (sign, style)

    def fill(self, begin_ns: int, end_ns: int, sign: str, style: str) -> None:
        """A sign from one instant to another, at least once."""
        low_ns, cell_ns = self.strips.low_ns, self.strips.cell_ns
        for cell in range(int((begin_ns - low_ns) // cell_ns), int((end_ns - low_ns) // cell_ns) + 1):
            if 0 <= cell < len(self.cells):
                self.cells[cell] = (sign, style)

    def text(self) -> Text:
        """The row with its name before it."""
        from rich.text import Text

        return Text.assemble(f"{self.name[:NAME_WIDTH]:{NAME_WIDTH}s} ", *self.cells)
