"""What the LiDAR makes of what it hits."""

from __future__ import annotations

from scenarios.faults.spec import FaultSpec, Severity

SPECS: tuple[type[FaultSpec], ...] = ()
SEVERITIES: tuple[Severity, ...] = ()
