"""A finer scan never loses precision beyond noise.

The same drives with twice the columns: every object has twice the points, and so has all that is not the
object, so the share of mapped points that are right should not fall. Only pairs of scan and camera that are
eligible at both resolutions count, as a finer scan makes more distant ones eligible. Range noise is drawn
anew, so single runs differ: `does not hold` where the whole 99 % interval of the mean difference over seeds,
paired by seed, lies below 0. There is no margin: a loss that seeds can tell from noise is a loss.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from simbench.checks.drives import COLUMNS, recorded, told
from simbench.checks.finding import NOTHING, Finding, PipelineError, ask, said_nothing
from simbench.checks.paired import interval, too_few
from simbench.drive import Driven
from simbench.plugins import Factory
from simbench.recording import Recording
from simbench.score.contract import ContractError
from simbench.score.objects import score_objects

Pair = tuple[int, str]  # scan and camera


@dataclass(frozen=True, kw_only=True)
class Precisions:
    """Of one seed: precision by pair, coarse and fine."""

    seed: int
    coarse: dict[Pair, float]
    fine: dict[Pair, float]

    @property
    def gain(self) -> float | None:
        """Mean over the pairs that both have; None where there is none."""
        both = [pair for pair in self.coarse if pair in self.fine]
        return sum(self.fine[pair] - self.coarse[pair] for pair in both) / len(both) if both else None


def find(factory: Factory, seeds: Sequence[int]) -> Finding:
    """The answers to every seed's drive at both resolutions."""
    found, anything = list[Precisions](), False
    for seed in seeds:
        by_pair = []
        for columns in (COLUMNS, 2 * COLUMNS):
            recording = recorded(seed, columns=columns)
            driven = ask(factory, told(recording))
            anything |= not said_nothing((driven,))
            by_pair.append(precisions(recording, driven))
        found.append(Precisions(seed=seed, coarse=by_pair[0], fine=by_pair[1]))
    return judge(found) if anything else NOTHING


def precisions(recording: Recording, driven: Driven) -> dict[Pair, float]:
    """Precision by eligible pair; no mapped point counts 0. PipelineError: a contract is broken."""
    try:
        scores = score_objects(recording, driven.outputs, driven.trajectories)
    except ContractError as error:
        raise PipelineError(str(error)) from error
    return {
        (pair.scan_seq, pair.camera): pair.n_correct / pair.n_mapped if pair.n_mapped else 0.0
        for pair in scores.pairs
    }


def judge(found: Sequence[Precisions]) -> Finding:
    """What the seeds say."""
    gains = {one.seed: gain for one in found if (gain := one.gain) is not None}
    if few := too_few(list(gains.values()), len(found), "pairs that are eligible at both resolutions"):
        return few
    low, high = interval(list(gains.values()))
    worst = min(gains, key=lambda seed: gains[seed])
    why = (
        f"precision changes by {sum(gains.values()) / len(gains):+.3f} [{low:+.3f}, {high:+.3f}] "
        f"over {len(gains)} seeds, the least {gains[worst]:+.3f} (seed {worst})"
    )
    return Finding(verdict="does not hold" if high < 0.0 else "holds", why=why)
