"""Which detections belong to a scan.

The detections paired with a scan are, per camera, those whose claimed stamp is nearest to the scan's stamp
(ties: the earlier one) and no farther from it than half a LiDAR period (both ends count).

A scan waits until its pairing is settled: every camera has delivered a stamp at or after the scan's, so that
no nearer one can come (stamps of one camera ascend), or MAX_WAIT_NS have passed since the scan arrived. Time
is the arrival of messages: whichever message comes next settles what is due, one scan at a time, the oldest
first. A camera that let a scan run into the limit is not waited for again until it is heard. The contract has
no flush: a scan that is still waiting when the messages end gets no answer.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from itertools import pairwise
from statistics import median

from fusion.messages import Detections, LidarScan

DEFAULT_PERIOD_NS = 100_000_000  # 10 Hz, the paper's LiDAR; used until the scans have told their own
MAX_WAIT_NS = 250_000_000  # what a fusion can afford to wait for a late camera
_NEVER_NS = -(2**63)
_REMEMBERED = 32  # messages per sensor: 3 s at 10 Hz, far more than half a period


class Pairing:
    """The last detections of every camera, and the scans that wait. `cameras`: whom to wait for."""

    def __init__(self, default_period_ns: int = DEFAULT_PERIOD_NS, cameras: Iterable[str] = ()) -> None:
        self._default_period_ns = default_period_ns
        self._detections: dict[str, deque[Detections]] = {}
        self._stamps_ns: dict[str, deque[int]] = {}
        self._known: set[tuple[str, int]] = set()
        self._waiting: deque[LidarScan] = deque()
        self._awaited = set(cameras)

    def add(self, detections: Detections) -> None:
        """Remember one image's detections."""
        self._detections.setdefault(detections.sensor, deque(maxlen=_REMEMBERED)).append(detections)
        self._awaited.add(detections.sensor)

    def hold(self, scan: LidarScan) -> None:
        """Put a scan in the queue; one that was delivered before (same sensor and seq) is left out."""
        key = (scan.sensor, scan.seq)
        if key in self._known:
            return
        self._known.add(key)
        self._stamps_ns.setdefault(scan.sensor, deque(maxlen=_REMEMBERED)).append(scan.stamp_ns)
        self._waiting.append(scan)

    def settle(self, now_ns: int) -> tuple[LidarScan, tuple[Detections, ...]] | None:
        """The oldest waiting scan with its detections, once it is settled at arrival time `now_ns`."""
        if not self._waiting:
            return None
        scan = self._waiting[0]
        missing = {name for name in self._awaited if self._newest_ns(name) < scan.stamp_ns}
        if missing and now_ns < scan.arrival_ns + MAX_WAIT_NS:
            return None
        self._awaited -= missing
        self._waiting.popleft()
        return scan, self._nearest(scan)

    def _newest_ns(self, camera: str) -> int:
        return max((d.stamp_ns for d in self._detections.get(camera, ())), default=_NEVER_NS)

    def _nearest(self, scan: LidarScan) -> tuple[Detections, ...]:
        """At most one message per camera, in the order of the cameras' names."""
        half_ns, stamp_ns = self.period_ns(scan.sensor) / 2, scan.stamp_ns
        nearest = (
            min(recent, key=lambda d: (abs(d.stamp_ns - stamp_ns), d.stamp_ns))
            for _, recent in sorted(self._detections.items())
        )
        return tuple(d for d in nearest if abs(d.stamp_ns - stamp_ns) <= half_ns)

    def period_ns(self, lidar: str) -> float:
        """Median time between this LiDAR's distinct stamps; the default until there are three such times.

        The median because a dropped scan doubles one of them; three because one of two may be a drop.
        """
        stamps_ns = sorted(set(self._stamps_ns.get(lidar, ())))
        if len(stamps_ns) < 4:
            return float(self._default_period_ns)
        return float(median(b - a for a, b in pairwise(stamps_ns)))
