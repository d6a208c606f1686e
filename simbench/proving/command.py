"""`simbench doctor --faults`: prove all faults, or some by name, on a few processes."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence

import click

from scenarios.errors import Where
from scenarios.faults import FAULTS
from simbench.campaign import each_of
from simbench.outcome import FAILED, GOOD
from simbench.proving.prove import Proof, prove
from simbench.proving.table import lines

QUICK, FULL = 10, 5000


def prove_faults(names: Sequence[str], draws: int, workers: int | None) -> int:
    """The exit code: 0 where all are proved. BadInput: no such fault."""
    for name in names:
        if name not in FAULTS:
            raise Where(file=None).unknown("fault", name, FAULTS)
    asked = tuple(dict.fromkeys(names)) or tuple(FAULTS)
    begun, proofs = time.perf_counter(), list[Proof]()
    for proof in each_of(_prove, [(name, draws) for name in asked], workers or os.cpu_count() or 1):
        proofs.append(proof)
        state = "proved" if proof.good else "NOT PROVED"
        spent_s = time.perf_counter() - begun
        click.echo(f"[{len(proofs)}/{len(asked)}] {proof.fault}: {state} ({spent_s:.0f} s)", err=True)
    for line in lines(proofs):
        click.echo(line)
    return GOOD if all(proof.good for proof in proofs) else FAILED


def _prove(task: tuple[str, int]) -> Proof:
    return prove(*task)
