"""The whole flow from a command to the files that it leaves, on a short drive."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scenarios.load import load_scenario
from simbench.case import Job
from simbench.run import run_job
from simbench.sensors import gl
from tests.simbench.support import write_scenario


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> str:
    scenario = load_scenario("overtake-recede").resolve(0)
    systems = {
        name: system.model_copy(update={"duration_s": 0.6}) for name, system in scenario.systems.items()
    }
    cut = scenario.model_copy(update={"name": "short", "systems": systems})
    return str(write_scenario(tmp_path_factory.mktemp("flow"), cut))


def test_pictures_change_no_row(short: str) -> None:
    """`--images gl` renders; boxes and scores do not depend on it."""
    try:
        gl.provision()
    except gl.RenderingUnavailable as why:
        pytest.skip(str(why))
    for system in ("car", "wearable"):
        rows = []
        for images in ("none", "gl"):
            job = Job(
                scenario=short, system=system, seed=0, pipelines=("static_projection", "probabilistic"),
                faults=("demo",), images=images, size_px=(160, 100),  # type: ignore[arg-type]
            )  # fmt: skip
            result = run_job(job)
            assert {case.status for case in result.cases} == {"ok"}
            rows.append([case.rows for case in result.cases])
        assert rows[0] == rows[1]


def test_a_run_leaves_result_tables_scenario_and_report(short: str, tmp_path: Path) -> None:
    from click.testing import CliRunner

    from simbench.cli import main

    out = tmp_path / "out"
    words = ["run", short, "--system", "car", "--seeds", "0-1", "--images", "none", "--jobs", "1"]
    done = CliRunner().invoke(main, [*words, "--size", "320x200", "--out", str(out)])
    assert done.exit_code == 0, done.output
    made = {path.name for path in out.iterdir()}
    assert {"result.json", "pairs.csv", "frames.csv", "report.html"} <= made
    assert {"scenario-short-0.yaml", "scenario-short-1.yaml"} <= made
    content = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert {case["pipeline"] for case in content["cases"]} == {
        "static_projection", "static_projection_ground", "probabilistic", "robust", "oracle",
    }  # fmt: skip
    assert {case["status"] for case in content["cases"]} == {"ok"}
