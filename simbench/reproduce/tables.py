"""Tables II and III and the MAE: the paper's cells beside ours, by its protocol and by ours.

By its protocol: frames (pairs of a sweep and a camera) drawn at random from all runs, as many as the paper
drew; drawn again many times, so that one sees what such a draw is worth. By ours: every eligible pair counts
within its run, every run weighs the same, intervals are over runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from simbench.paper import PASSES, PaperMae, PaperTpr
from simbench.reproduce.collect import Run
from simbench.reproduce.protocol import Dependence, Drawn, Frames, chosen_rows, dependence, draw
from simbench.score.statistics import Paired, Summary, paired, summarize

DRAWS = 1000
COLUMNS = (
    "before", "before_sd", "after", "after_sd", "t", "p_two_sided", "p_one_sided", "half_t", "half_p",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Over many draws: median, 2.5th and 97.5th percentiles. n: draws that gave a value."""

    median: float
    low: float
    high: float
    n: int


@dataclass(frozen=True, kw_only=True)
class TprTable:
    """A row of Tables II and III. drawn: by the paper's protocol, one spread per column; before, after, gain:
    by ours."""

    printed: PaperTpr
    pairs: int
    runs: int
    drawn: dict[str, Spread]
    dependence: Dependence
    before: Summary
    after: Summary
    gain: Paired


@dataclass(frozen=True, kw_only=True)
class MaeTable:
    """Mean of MAE X and MAE Y of one rig. drawn: the paper's (frames drawn from both scenarios, against the
    held GNSS fix); gnss: the same against all frames, by run; exact: against the exact centre, by run."""

    printed: PaperMae
    frames: int
    drawn: Spread | None
    gnss: Summary
    exact: Summary


def frames_of(before: Sequence[Run], after: Sequence[Run]) -> Frames:
    """The TPR of every pair that both pipelines were asked for, by seed."""
    first = {(run.seed, p.scan_seq, p.camera): p.tpr for run in before for p in run.pairs}
    second = {(run.seed, p.scan_seq, p.camera): p.tpr for run in after for p in run.pairs}
    both = [key for key in first if key in second]
    return Frames(
        before=np.array([first[key] for key in both], dtype=np.float64),
        after=np.array([second[key] for key in both], dtype=np.float64),
        run=np.array([key[0] for key in both], dtype=np.int64),
    )


def tpr_table(
    printed: PaperTpr, before: Sequence[Run], after: Sequence[Run], rng: np.random.Generator
) -> TprTable:
    """A row of Tables II and III. ValueError: there is no pair."""
    frames = frames_of(before, after)
    if not len(frames.before):
        raise ValueError("no pair of a sweep and a camera is eligible")
    one, two = _by_seed(before, "tpr"), _by_seed(after, "tpr")
    return TprTable(
        printed=printed,
        pairs=len(frames.before),
        runs=len(two),
        drawn=_drawn(draw(frames, printed.n, rng, DRAWS)),
        dependence=dependence(frames, printed.n, PASSES),
        before=summarize(one, rng),
        after=summarize(two, rng),
        gain=paired(one, two, rng),
    )


def mae_table(printed: PaperMae, runs: Sequence[Run], rng: np.random.Generator) -> MaeTable:
    """The MAE of one rig over both scenarios. Runs of two scenarios may share a seed: each is a run."""
    errors = [
        float(np.abs(frame.gnss_m).mean()) for run in runs for frame in run.frames if frame.gnss_m is not None
    ]
    values = np.array(errors, dtype=np.float64)
    means = values[chosen_rows(len(values), printed.n, rng, DRAWS)].mean(axis=1) if errors else values
    number = dict(enumerate(runs))
    return MaeTable(
        printed=printed,
        frames=len(values),
        drawn=_spread(means),
        gnss=summarize({i: run.metrics.get("mae_m.smooth.gnss") for i, run in number.items()}, rng),
        exact=summarize({i: run.metrics.get("mae_m.smooth") for i, run in number.items()}, rng),
    )


def missed_few(runs: Sequence[Run], t1_points: int) -> float | None:
    """The paper's Eq. 5: the share of pairs in which fewer than t1 of the object's points are missed; None:
    there is no pair."""
    pairs = [pair for run in runs for pair in run.pairs]
    return float(np.mean([pair.n_missed < t1_points for pair in pairs])) if pairs else None


def premise(runs: Sequence[Run]) -> tuple[float | None, int]:
    """The premise of hypothesis 2: of the pairs whose TPR is above 0.5, the share in which the representative
    point is on the object; and how many there are."""
    above = [pair.hit for run in runs for pair in run.pairs if pair.tpr > 0.5]
    return (float(np.mean(above)) if above else None), len(above)


def _by_seed(runs: Sequence[Run], metric: str) -> dict[int, float | None]:
    return {run.seed: run.metrics.get(metric) for run in runs}


def _drawn(drawn: Drawn) -> dict[str, Spread]:
    columns = {name: getattr(drawn, name) for name in COLUMNS}
    found = {name: _spread(values[np.isfinite(values)]) for name, values in columns.items()}
    return {name: spread for name, spread in found.items() if spread is not None}


def _spread(values: Float64[np.ndarray, " n"]) -> Spread | None:
    if not len(values):
        return None
    low, median, high = np.percentile(values, [2.5, 50.0, 97.5])
    return Spread(median=float(median), low=float(low), high=float(high), n=len(values))
