"""The figure of distances and the numbers beside it: when they are shown, and what they say."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from simbench.case import JobResult
from simbench.distances import Curve, Distances, TrueCurve
from simbench.report.agreement import agreement_lines, drawn_pipelines
from simbench.report.choose import groups_of
from simbench.report.distance_figure import distance_figure
from simbench.report.page import write_report
from tests.simbench.report.make import result

METHOD = "probabilistic"


def curve(name: str, camera: str, metres: list[float], pipeline: str = METHOD, first: int = 0) -> Curve:
    scans = np.arange(first, first + len(metres))
    return Curve(
        pipeline=pipeline, object_name=name, camera=camera, scan_seq=scans, t_ns=scans * 100_000_000,
        distance_m=np.array(metres),
    )  # fmt: skip


def true(*names: str) -> tuple[TrueCurve, ...]:
    t_ns = np.arange(4) * 100_000_000
    return tuple(TrueCurve(object_name=n, t_ns=t_ns, distance_m=np.full(4, 9.0)) for n in names)


TWO = (
    curve("rider", "left", [10.0, 11.0, 12.0]),
    curve("rider", "right", [10.1, 11.3, 12.0]),  # apart 0.1, 0.3, 0
    curve("walker", "left", [5.0, 5.0]),
    curve("walker", "right", [5.5, 5.0], first=1),  # apart 0.5 in scan 1
)


def with_curves(*curves: Curve, seed: int = 0, **given: object) -> JobResult:
    return replace(
        result(seed, **given),  # type: ignore[arg-type]
        distances=Distances(true=true("rider", "walker", "nobody"), curves=curves),
    )


def lines_of(*results: JobResult) -> dict[tuple[str, str], tuple[int, float | None, float | None, str]]:
    (group,) = groups_of(results)
    return {
        (line.words, line.side): (line.compared, line.median_m, line.largest_m, line.largest_of)
        for line in agreement_lines(group)
    }


def test_a_line_has_the_median_and_the_largest_difference_of_all_objects() -> None:
    compared, median_m, largest_m, of = lines_of(with_curves(*TWO))["six steps", "clean"]
    assert compared == 4  # 0, 0.1, 0.3, 0.5
    assert median_m == pytest.approx(0.2) and largest_m == pytest.approx(0.5)
    assert of == "walker, 0.1 s"


def test_runs_weigh_alike_and_the_largest_of_all_names_its_run() -> None:
    far = (*TWO[:2], TWO[2], curve("walker", "right", [9.0, 5.0], first=1))  # 0, 0.1, 0.3, 4
    wide = (*TWO[:2], curve("walker", "left", [5.0] * 3), curve("walker", "right", [9.0] * 3))
    found = lines_of(with_curves(*far), with_curves(*wide, seed=1))["six steps", "clean"]
    assert found[0] == 4 + 6
    assert found[1] == pytest.approx((0.2 + (0.3 + 4.0) / 2) / 2)
    assert found[2:] == (4.0, "walker, 0.1 s, seed 0")


def test_pipelines_that_say_nothing_have_a_line_without_numbers() -> None:
    found = lines_of(with_curves(*TWO), with_curves(*TWO, errors=("demo",)))
    assert found["raw box", "clean"] == (0, None, None, "")
    assert found["six steps", "faulted"][0] == 4


def test_one_object_or_one_camera_each_is_no_figure_and_no_table() -> None:
    assert lines_of(with_curves(*TWO[:2])) == {}
    assert lines_of(with_curves(TWO[0], TWO[2])) == {}
    assert lines_of(with_curves(*TWO[:3])) == {}  # of two objects only one is seen by two
    assert lines_of(result()) == {}


def test_a_case_without_a_score_is_not_compared() -> None:
    assert lines_of(with_curves(*TWO, crash=(METHOD,))) == {}


def test_the_method_is_drawn_and_ours_beside_it() -> None:
    for given, drawn in (
        (("static_projection", METHOD), (METHOD,)),
        (("static_projection", METHOD, "robust"), (METHOD, "robust")),
        (("robust",), ("robust",)),
        (("mine.py:Mine",), ("mine.py:Mine",)),
    ):
        (group,) = groups_of([result(pipelines=given)])
        assert drawn_pipelines(group) == drawn


def test_the_figure_has_a_mark_for_every_value_and_only_objects_that_were_seen() -> None:
    svg = distance_figure(true("rider", "walker", "nobody"), TWO, "Distances")
    legend_cameras, values, differences = 2, 3 + 3 + 2 + 2, 4
    # matplotlib's tick marks are <use> too, and have no fill or stroke of their own here: none is drawn
    assert len(re.findall(r"<use ", svg)) == legend_cameras + values + differences
    assert ">rider<" in svg and ">walker<" in svg and "nobody" not in svg
    assert ">left<" in svg and ">right<" in svg
    assert svg == distance_figure(true("rider", "walker", "nobody"), TWO, "Distances")


def test_a_scan_without_a_value_breaks_the_line_of_its_curve() -> None:
    def moves(*curves: Curve) -> int:
        svg = distance_figure(true("rider"), curves, "Distances")
        return max(path.count("M") for path in re.findall(r'<path d="([^"]*)"[^>]*stroke-width: 0.8', svg))

    whole = curve("rider", "left", [10.0, 11.0, 12.0, 13.0])
    gap = replace(whole, scan_seq=np.array([0, 1, 3, 4]), t_ns=np.array([0, 1, 3, 4]) * 100_000_000)
    assert moves(gap) == moves(whole) + 1


def test_the_page_shows_figure_and_table_only_where_cameras_can_be_compared(tmp_path: Path) -> None:
    def page(made: JobResult) -> str:
        where = write_report([made], tmp_path, command="simbench run", images="none", environment={})
        return where.read_text(encoding="utf-8")

    text = page(with_curves(*TWO))
    assert 'aria-label="Distances by six steps"' in text and 'table class="agreement"' in text
    assert re.search(r"<td>4</td><td>0\.200</td><td>0\.500<small>walker, 0\.1 s</small>", text)
    without = page(with_curves(*TWO[:2]))
    assert "Distances by" not in without and 'class="agreement"' not in without
