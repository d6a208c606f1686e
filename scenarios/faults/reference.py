"""What the GNSS reference says of where the target is: the paper's "ground truth" as a sensor."""

from __future__ import annotations

from scenarios.faults.spec import FaultSpec, Severity

SPECS: tuple[type[FaultSpec], ...] = ()
SEVERITIES: tuple[Severity, ...] = ()
