"""What was proved, as a table: one line a fault, and what failed below it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from simbench.proving.prove import CRASHED, SAME, Proof

HEAD = ("fault", "mutants seen", "honest draws", "verified", "z mean", "z SD", "severities")


def lines(proofs: Sequence[Proof]) -> Iterator[str]:
    """The table, ready to print."""
    rows = [HEAD, *(_row(proof) for proof in proofs)]
    width = [max(len(row[i]) for row in rows) for i in range(len(HEAD))]
    for row in rows:
        yield "  ".join(f"{word:{w}s}" for word, w in zip(row, width, strict=True)).rstrip()
    for proof in proofs:
        for why in failures(proof):
            yield f"FAILED {proof.fault}: {why}"
    good = sum(proof.good for proof in proofs)
    mutants = sum(len(proof.tried) - _same(proof) for proof in proofs)
    missed = sum(len(proof.missed) for proof in proofs)
    yield f"{good} of {len(proofs)} faults are proved; {mutants - missed} of {mutants} mutants are seen"


def failures(proof: Proof) -> Iterator[str]:
    """What does not hold of a fault, one sentence each."""
    for name in proof.missed:
        yield f"no receipt sees the mutant '{name}'"
    if proof.bad > proof.bad_by_chance:
        yield f"{proof.bad} of {proof.receipts} receipts of honest draws do not match"
    if not proof.verified:
        yield "no receipt verifies the fault: its effect is never seen"
    for quantity in proof.off_draw:
        yield f"'{quantity}' is on average not drawn as asked for"
    if proof.rises is False:
        yield f"a higher severity is not more: {', '.join(map(_number, proof.effects))}"
    for one in proof.errs:
        if not one.holds:
            yield (
                f"the estimator of '{one.quantity}' errs otherwise than it says: z has mean {one.mean:.2f}, "
                f"SD {one.sd:.2f} over {one.n} draws"
            )


def _row(proof: Proof) -> tuple[str, ...]:
    asked = len(proof.tried) - _same(proof)
    crashed = sum(tried.outcome == CRASHED for tried in proof.tried)
    seen = f"{asked - len(proof.missed)} of {asked}" + (f" ({crashed} crash)" if crashed else "")
    otherwise = "bounded" if proof.bounded else "exact"
    return (
        proof.fault,
        seen,
        f"{proof.draws}, {proof.bad} bad",
        f"{proof.verified} of {proof.receipts}",
        otherwise if proof.z_mean is None else f"{proof.z_mean:+.3f}",
        otherwise if proof.z_sd is None else f"{proof.z_sd:.2f}",
        {True: "rise", False: "DO NOT RISE", None: "words"}[proof.rises],
    )


def _same(proof: Proof) -> int:
    return sum(tried.outcome == SAME for tried in proof.tried)


def _number(value: float | None) -> str:
    return "nothing" if value is None else f"{value:.3g}"
