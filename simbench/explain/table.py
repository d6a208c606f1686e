"""An answer as text and as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator

from simbench.explain.answer import Answer
from simbench.explain.attribution import Attribution, Effect
from simbench.score.metrics import METRICS
from simbench.score.statistics import Summary

UNIT = {metric.name: metric.unit for metric in METRICS}
FIELDS = (
    "pipeline", "metric", "unit", "kind", "causes", "mean", "sd", "n", "left_out", "low95", "high95",
    "method", "together_low", "together_high", "counts", "share", "sampling_se", "verdict",
)  # fmt: skip


def words(causes: tuple[str, ...]) -> str:
    """A set of causes; the sets that are not told one by one have none."""
    return " + ".join(causes) or "three and more together"


def number(value: float | None) -> str:
    """Signed, three digits; a minus is a gain."""
    return "–" if value is None else f"{value:+.3f}".replace("-", "−")


def interval(bounds: tuple[float, float] | None) -> str:
    return "" if bounds is None else f"[{number(bounds[0])}, {number(bounds[1])}]"


def percent(share: float | None) -> str:
    return "" if share is None else f"{100.0 * share:.0f} %".replace("-", "−")


def verdict(found: Attribution) -> str:
    """What the numbers say, in a line."""
    if found.verdict == "caused":
        told = [f"{words(e.causes)} {number(e.summary.mean)}" for e in found.named]
        also = f"; also {', '.join(told[1:4])}" if len(told) > 1 else ""
        return f"largest: {told[0]}{also}{f' and {len(told) - 4} more' if len(told) > 4 else ''}"
    return f"{found.verdict}: {found.why}"


def shown(found: Attribution) -> tuple[Effect, ...]:
    """The dividends that a reader is shown: singles, pairs, and larger sets that count."""
    return tuple(e for e in found.dividends if len(e.causes) <= 2 or e.counts)


def as_text(answer: Answer) -> Iterator[str]:
    """Line by line: per metric the total, singles, what counts among larger sets, Shapley values."""
    for found in answer.attributions:
        unit = "" if UNIT[found.metric] == "1" else f" {UNIT[found.metric]}"
        yield f"{found.pipeline}, {found.metric}: {verdict(found)}"
        if found.left_out:
            yield f"  left out, without a value somewhere: seeds {', '.join(map(str, found.left_out))}"
        rows = [("all causes", found.total)]
        rows += [(words(e.causes), e) for e in shown(found) if len(e.causes) == 1 or e.counts]
        if found.remainder is not None:
            rows.append(("three and more together", found.remainder))
        for name, effect in rows:
            mark = "*" if effect.counts else " "
            line = f"  {mark} {name:52s} {number(effect.summary.mean)}{unit} {interval(effect.summary.ci95)}"
            yield f"{line} {percent(effect.share)}".rstrip()
        shares = ", ".join(
            f"{words(e.causes)} {number(e.summary.mean)}"
            + (f" ± {e.sampling_se:.3f}" if e.sampling_se is not None else "")
            for e in found.shapley
        )
        yield f"    Shapley: {shares}"
    for pipeline, metric in answer.valueless:
        yield f"{pipeline}, {metric}: undecided: no run has a value, whatever the causes"
    if answer.pairs is not None:
        enough = "" if answer.reached else "; NOT below 2 % of every total"
        yield f"Shapley values sampled with {answer.pairs} orders and their reverses (± 1 SE){enough}."
    yield "* beyond chance among all dividends and the total at once. + is worse. [ ]: 95 %, of it alone."


def as_csv(answer: Answer) -> str:
    """One line per number with its intervals."""
    text = io.StringIO()
    writer = csv.DictWriter(text, FIELDS, lineterminator="\n", restval="")
    writer.writeheader()
    for found in answer.attributions:
        key = {
            "pipeline": found.pipeline, "metric": found.metric, "unit": UNIT[found.metric],
            "left_out": len(found.left_out), "verdict": found.verdict,
        }  # fmt: skip
        for kind, summary in (("clean loss", found.clean), ("whole loss", found.whole)):
            writer.writerow({**key, "kind": kind, **_summary(summary)})
        for kind, effects in (
            ("total", (found.total,)),
            ("dividend", found.dividends),
            ("remainder", () if found.remainder is None else (found.remainder,)),
            ("shapley", found.shapley),
        ):
            for effect in effects:
                writer.writerow({**key, "kind": kind, **_effect(effect)})
    for row in answer.budget:
        for kind, summary in (("budget clean", row.clean), ("budget whole", row.whole)):
            key = {"pipeline": row.pipeline, "metric": f"budget_{row.axis}_m.{row.part}", "unit": "m"}
            writer.writerow({**key, "kind": kind, **_summary(summary)})
    return text.getvalue()


def _summary(summary: Summary) -> dict[str, object]:
    low, high = summary.ci95 or ("", "")
    return {
        "mean": _exact(summary.mean), "sd": _exact(summary.sd), "n": summary.n, "low95": low, "high95": high,
        "method": summary.method,
    }  # fmt: skip


def _effect(effect: Effect) -> dict[str, object]:
    low, high = effect.together or ("", "")
    return {
        "causes": " + ".join(effect.causes), **_summary(effect.summary), "together_low": low,
        "together_high": high, "counts": int(effect.counts), "share": _exact(effect.share),
        "sampling_se": _exact(effect.sampling_se),
    }  # fmt: skip


def _exact(value: float | None) -> object:
    return "" if value is None else value
