"""The table of real runs that the study of attribution draws from: 5 causes, all 32 sets of them, 10 seeds,
on the first 2.5 s of an overtake, where the target is 15 to 28 m away.

    python3 dev.py run python tests/benchmarks/attribution_table.py --out FOLDER [--seeds 0-9] [--jobs 2]

Resumable: the ledger in FOLDER keeps every recording. Writes FOLDER/attribution.json: losses by pipeline and
metric (minus precision; metres), a row by set of causes, a column by seed. `attribution.json` beside this
file is such a table, measured once.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).resolve().parents[2])  # in place of this folder

from simbench.explain.causes import Question, question_of_scenario
from simbench.explain.values import Measured
from simbench.stress.ledger import Ledger, Outcome

FAULTS = (
    "calibration.rotation_deg=2",
    "detector.edge_error=0.2",
    "lidar.range_noise_cm=30",
    "motion.vibration_deg=2",
    "timing.trigger_offset_ms=80",
)
PIPELINES = ("static_projection", "probabilistic")
METRICS = ("precision", "mae_m.raw", "mae_m.smooth", "gross_rate.smooth")


def question(seeds: range) -> Question:
    """What is measured."""
    return question_of_scenario(
        "overtake-approach", system="car", pipelines=PIPELINES, faults=FAULTS,
        changes=("systems.car.duration_s=2.5",), boxes=None, seeds=seeds,
        chosen=tuple(fault.partition("=")[0] for fault in FAULTS),
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", default="0-9")
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    first, _, last = asked.seeds.partition("-")
    asked.out.mkdir(parents=True, exist_ok=True)
    told = [0]

    def done(outcomes: tuple[Outcome, ...]) -> None:
        told[0] += 1
        print(told[0], *outcomes[0].point, outcomes[0].seed, outcomes[0].status, file=sys.stderr)

    what = question(range(int(first), int(last or first) + 1))
    measured = Measured(what, Ledger(asked.out, {"attribution": FAULTS}), asked.jobs, done)
    masks = range(1 << len(what.causes))
    measured.measure(masks)
    losses = {
        pipeline: {
            metric: [
                [round(value, 6) if value == value else None for value in row]
                for row in measured.losses(pipeline, metric, masks).tolist()
            ]
            for metric in METRICS
        }
        for pipeline in PIPELINES
    }
    table = {"causes": list(what.causes), "seeds": list(what.seeds), "losses": losses}
    (asked.out / "attribution.json").write_text(json.dumps(table) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
