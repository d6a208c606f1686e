"""The named sets of errors take effect on the rigs that they are for."""

from __future__ import annotations

import pytest

from scenarios.fault_set import list_fault_sets
from simbench.case import Job
from simbench.faults.receipt import OK
from simbench.run import recording_of

RIGS = {"paper-car": ("car",), "paper-wearable": ("wearable",)}


@pytest.mark.parametrize(
    ("name", "system"),
    [(name, system) for name in list_fault_sets() for system in RIGS.get(name, ("car", "wearable"))],
)
def test_every_receipt_of_a_named_set_matches(name: str, system: str) -> None:
    job = Job(
        scenario="overtake-approach", system=system, seed=0, pipelines=(), faults=(name,),
        changes=(f"systems.{system}.duration_s=2",),
    )  # fmt: skip
    _, faults, made = recording_of(job)
    asked = [receipt for receipt in made.receipts if receipt.requested != 0.0]
    assert {receipt.fault for receipt in asked} == {spec.name for spec in faults.specs}
    bad = [(r.quantity, r.requested, r.measured, r.note) for r in made.receipts if r.status != OK]
    assert not bad
