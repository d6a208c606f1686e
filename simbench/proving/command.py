"""`simbench doctor --faults`: prove all faults, or some by name, on a few processes."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence

import click

from scenarios.errors import Where
from scenarios.faults import FAULTS
from simbench.campaign.jobs import each_of
from simbench.outcome import FAILED, GOOD
from simbench.proving.prove import Drawn, Proof, Trials, honest_draws, proof_of, trials
from simbench.proving.table import lines

QUICK, FULL = 10, 5000
CHUNK = 125  # draws that one process makes in one go
Task = tuple[str, range | None]
"""A fault's trials, or its honest draws of some seeds."""


def prove_faults(names: Sequence[str], draws: int, workers: int | None) -> int:
    """The exit code: 0 where all are proved. BadInput: no such fault."""
    for name in names:
        if name not in FAULTS:
            raise Where(file=None).unknown("fault", name, FAULTS)
    asked = tuple(dict.fromkeys(names)) or tuple(FAULTS)
    tasks: list[Task] = []
    for name in asked:
        tasks.append((name, None))
        tasks += [(name, range(at, min(at + CHUNK, draws))) for at in range(0, draws, CHUNK)]
    done = each_of(_work, tasks, workers or os.cpu_count() or 1)
    begun, proofs = time.perf_counter(), list[Proof]()
    for name in asked:
        made = next(done)
        assert isinstance(made, Trials)
        honest = [drawn for _ in range(0, draws, CHUNK) for drawn in _draws(next(done))]
        proofs.append(proof_of(name, made, honest))
        state = "proved" if proofs[-1].good else "NOT PROVED"
        spent_s = time.perf_counter() - begun
        left_s = spent_s / len(proofs) * (len(asked) - len(proofs))
        words = f"[{len(proofs)}/{len(asked)}] {name}: {state} (about {left_s / 60:.1f} min left)"
        click.echo(words, err=True)
    for line in lines(proofs):
        click.echo(line)
    return GOOD if all(proof.good for proof in proofs) else FAILED


def _work(task: Task) -> Trials | tuple[Drawn, ...]:
    name, seeds = task
    return trials(name) if seeds is None else honest_draws(name, seeds)


def _draws(found: Trials | tuple[Drawn, ...]) -> tuple[Drawn, ...]:
    assert isinstance(found, tuple)
    return found
