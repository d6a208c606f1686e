"""The canary: one case beside every run that must fail. If it passes, the bench is blind, the run an error.

An offset of the cameras' clocks is asked for and not injected. Its receipt must not match, and no score may
come out.
"""

from __future__ import annotations

from functools import lru_cache

from scenarios.fault_set import FaultSet
from scenarios.faults import ClockOffset
from simbench.case import Job
from simbench.faults.proof import receipts
from simbench.run import Clock, Made, judge
from simbench.stage import record, stage

JOB = Job(
    scenario="overtake-approach", system="car", seed=0, pipelines=("static_projection",),
    size_px=(96, 60), changes=("systems.car.duration_s=0.3",),
)  # fmt: skip
ASKED = FaultSet(specs=(ClockOffset(offset_ms=50.0),), label="canary")
MUST_BE = "receipt_mismatch"


@lru_cache(maxsize=4)
def canary(asked: FaultSet = ASKED) -> str | None:
    """None where the canary case failed as it must; else what is wrong, as a sentence. About a second, once a
    process. asked: the error that is not injected."""
    staged = stage(JOB)
    captured = record(JOB, staged)
    found = receipts(captured, staged.rig, asked, staged.system.duration_s)
    made = Made(recording=captured.recording, receipts=found, shake="")
    cases, _, _ = judge(JOB, made, (), Clock())
    passed = sorted({f"{case.pipeline} ({case.status})" for case in cases if case.status != MUST_BE})
    if not passed and cases:
        return None
    names = " and ".join(spec.name for spec in asked) or "nothing"
    return (
        f"the canary passed: {names} was asked for and not injected, and nobody noticed: "
        f"{', '.join(passed) or 'no case came out'}; no number of this run can be trusted"
    )
