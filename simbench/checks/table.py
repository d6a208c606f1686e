"""What was found, as a table: one line a relation, and a last one that counts."""

from __future__ import annotations

from collections.abc import Sequence

from simbench.checks.finding import Finding
from simbench.checks.relations import Relation

VERDICT_WIDTH = len("cannot be said")


def line(relation: Relation, finding: Finding, among: Sequence[Relation]) -> str:
    """Name, claim, verdict, and the worst deviation or the reason. `among`: all that the table holds."""
    name = max(len(one.name) for one in among)
    says = max(len(one.says) for one in among)
    return (
        f"{relation.name:{name}s}  {relation.says:{says}s}  {finding.verdict:{VERDICT_WIDTH}s}  {finding.why}"
    )


def last_line(pipeline: str, found: Sequence[Finding]) -> str:
    """How many hold, of how many."""
    holds = sum(finding.verdict == "holds" for finding in found)
    unsaid = sum(finding.verdict == "cannot be said" for finding in found)
    unknown = f", {unsaid} cannot be said" if unsaid else ""
    return f"{pipeline}: {holds} of {len(found)} hold{unknown}"
