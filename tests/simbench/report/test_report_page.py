"""The page as a stranger's browser gets it: whole, honest, and with the numbers of the rows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from simbench.case import ORACLE, JobResult
from simbench.paper import TABLE_II
from simbench.report.choose import groups_of, mean_of_runs
from simbench.report.figures import budget_means
from simbench.report.page import write_report
from simbench.report.tables import COLUMNS
from tests.simbench.report.make import PIPELINES, SCENARIO, crashed, result, without_target

VOID = {"meta", "br", "img", "input", "link", "hr"}
BOTH = [result(seed, errors=errors) for seed in (0, 1) for errors in ((), ("demo",))]


class Page(HTMLParser):
    """Checks that tags are closed in order; keeps text, attributes and the cells of the numbers tables."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.cells: dict[tuple[str, str, str, str], str] = {}
        self._row: tuple[str, str] | None = None
        self._cell: str | None = None
        self._group = ""
        self.feed(text)
        self.close()
        assert self.open == [], self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.tags.append((tag, given))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "table":
            self._group = given.get("data-group") or ""
        if tag == "tr":
            self._cell = None
            self._row = (
                (given["data-pipeline"] or "", given["data-side"] or "") if "data-pipeline" in given else None
            )
        if tag in ("td", "small"):
            self._cell = given.get("data-metric") if tag == "td" else None

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open[-1] == tag, (tag, self.open[-3:])
        self.open.pop()

    def handle_data(self, data: str) -> None:
        self.words.append(data)
        if self._cell and self._row:
            self.cells.setdefault((self._group, *self._row, self._cell), data.strip())

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


def make(
    results: Sequence[JobResult], folder: Path, command: str = "simbench demo", images: str = "none"
) -> str:
    where = write_report(
        results,
        folder,
        command=command,
        images=images,
        environment={"python": "3", "packages": {"numpy": "2"}},
    )
    assert where == folder / "report.html"
    return where.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    return make(BOTH, tmp_path_factory.mktemp("report"))


def test_the_page_is_whole_and_loads_nothing_from_elsewhere(page: str) -> None:
    found = Page(page)
    assert "http:" not in page and "https:" not in page and "//cdn" not in page
    assert not any(tag == "script" or any(key.startswith("on") for key in given) for tag, given in found.tags)
    links = [given.get(key) or "" for _, given in found.tags for key in ("src", "href") if key in given]
    assert all(link.startswith(("#", "data:")) for link in links), links
    policy = next(given for tag, given in found.tags if given.get("http-equiv") == "Content-Security-Policy")
    assert "default-src 'none'" in (policy["content"] or "")
    targets = {given["id"] for _, given in found.tags if given.get("id")}
    assert {link[1:] for link in links if link.startswith("#") and "p" != link[1:2]} - targets == set()


def test_nothing_is_printed_as_none_or_nan(page: str) -> None:
    words = Page(page).text
    assert "None" not in words and not re.search(r"\bnan\b", words)


def test_every_number_of_the_table_is_the_mean_of_the_rows(page: str) -> None:
    (group,) = groups_of(BOTH)
    cells = Page(page).cells
    checked = 0
    for pipeline in (*PIPELINES, ORACLE):
        for side in ("clean", "faulted"):
            for column in COLUMNS[:-1]:
                runs = [r for r in BOTH if bool(len(r.faults)) == (side == "faulted")]
                values = [
                    row.value
                    for r in runs
                    for c in r.cases
                    if c.pipeline == pipeline
                    for row in c.rows
                    if row.metric == column.metric and row.value is not None
                ]
                assert len(values) == 2
                expected = f"{column.factor * sum(values) / 2:.{column.digits}f}"
                assert cells["group-1", pipeline, side, column.metric] == expected
                checked += 1
    assert checked == 4 * 2 * (len(COLUMNS) - 1)
    assert (
        cells["group-1", "probabilistic", "clean", "latency_ms.p50"] == "3.0"
    )  # of 2, 3, 4: the first warms up
    assert cells["group-1", ORACLE, "clean", "latency_ms.p50"] == "–"
    assert mean_of_runs(group, "clean", ORACLE, "tpr") is not None


def test_the_dots_stand_at_the_rows_values(page: str) -> None:
    """Read back from the SVG: the six grid lines (0 to 100 %) give the scale, markers the values."""
    svg = page[page.index('aria-label="TPR per run') :]
    svg = svg[: svg.index("</svg>")]
    flat = re.findall(r'd="M [\d.]+ ([\d.]+) \nL [\d.]+ \1 \n"[^>]*stroke: #d5dae1', svg)
    lines = sorted({float(y) for y in flat})
    assert len(lines) == 6
    heights = [
        100 * (lines[-1] - float(y)) / (lines[-1] - lines[0])
        for y in re.findall(r'<use [^>]*y="([\d.]+)"', svg)
    ]
    values = [
        row.value
        for r in BOTH
        for case in r.cases
        if case.pipeline in ("static_projection", "probabilistic")
        for row in case.rows
        if row.metric == "tpr" and row.value is not None
    ]
    paper = TABLE_II[SCENARIO, "car"]
    assert len(values) == 8
    for value in (*values, paper.baseline, paper.fusion):
        assert min(abs(height - 100 * value) for height in heights) < 0.05


def test_the_budget_in_the_figure_adds_up() -> None:
    (group,) = groups_of(BOTH)
    means = budget_means(group.results("faulted"), "probabilistic")
    total = np.sum([v for part, v in means.items() if part != "total"], axis=0)
    assert means["total"].shape == (2, 2)
    np.testing.assert_allclose(total, means["total"], atol=1e-12)


def test_the_same_results_give_the_same_bytes(page: str, tmp_path: Path) -> None:
    assert make(BOTH, tmp_path) == page


def test_two_runs_are_an_illustration_without_intervals(page: str) -> None:
    text = Page(page).text
    assert "n = 2 runs: illustration" in text
    assert "[" not in "".join(Page(page).cells.values())
    assert "p =" not in text


def test_from_six_runs_on_there_are_intervals(tmp_path: Path) -> None:
    text = make([result(seed) for seed in range(6)], tmp_path)
    assert "n = 6 runs" in text and "illustration" not in text
    assert re.search(r"<small>\[[\d.]+, [\d.]+\]</small>", text)


def test_the_page_says_which_calibration_the_pipelines_were_told(page: str, tmp_path: Path) -> None:
    assert "told the true calibration" in Page(page).text and "calibration: found" not in page
    text = Page(make([result(), result(found_in="a.yaml")], tmp_path)).text
    assert "told the true calibration" in text and "told the calibration that was found" in text
    assert "calibration: found" in text and "-approach, car, calibration found" in text


def test_names_are_escaped_wherever_they_come_from(tmp_path: Path) -> None:
    evil = "<b>&\"'x"
    bad = result(errors=("demo",), pipelines=(evil, "<i>two"), crash=("<i>two",))
    bad = replace(bad, cases=(bad.cases[0], crashed("<i>two", why=f"ValueError: {evil}"), *bad.cases[2:]))
    named = replace(bad, scenario=bad.scenario.model_copy(update={"name": evil}), shake=f"shake: {evil}")
    text = make([named], tmp_path, command=f"simbench run '{evil}' </pre><script>alert(1)</script>")
    Page(text)
    assert "<b>&" not in text and "<i>two" not in text and "<script" not in text
    assert "&lt;b&gt;" in text


@pytest.mark.parametrize(
    "results",
    [
        pytest.param([result()], id="only clean, one seed"),
        pytest.param([result(errors=("demo",))], id="only faulted"),
        pytest.param([result(0), result(1, errors=("demo",))], id="sides of different seeds"),
        pytest.param([without_target()], id="no target"),
        pytest.param([*BOTH, without_target()], id="with and without target"),
        pytest.param([result(pipelines=("static_projection",))], id="one pipeline"),
        pytest.param([result(crash=PIPELINES), result(errors=("demo",))], id="clean side crashed"),
        pytest.param([replace(result(), views=())], id="nothing in view"),
        pytest.param(
            [result(system=s, errors=e) for s in ("car", "wearable") for e in ((), ("demo",))],
            id="two systems",
        ),
    ],
)
def test_the_page_stands_in_every_odd_situation(results: list[JobResult], tmp_path: Path) -> None:
    found = Page(make(results, tmp_path))
    assert found.text.count("Numbers") >= 1
    assert "None" not in found.text and not re.search(r"\bnan\b", found.text)


def test_a_crash_is_shown_with_its_status_and_reason(tmp_path: Path) -> None:
    text = Page(make([result(), result(errors=("demo",), crash=("probabilistic",))], tmp_path)).text
    assert "1 of 8 cases failed" in text
    assert "pipeline_error" in text and "KeyError: 'x' (line 3 of update)" in text


def test_badges_count_the_receipts_by_status(tmp_path: Path) -> None:
    results = [result(0, errors=("demo",)), result(1, errors=("demo",), measured=40.0)]
    text = Page(make([*results, result(2, errors=("demo",), measured=None)], tmp_path)).text
    for status in ("ok", "mismatch", "unverifiable"):
        assert f"receipts {status}: 1 of 3" in text
    assert "car shake: ISO 8608 class E" in text


def test_receipts_are_listed_with_all_their_numbers(page: str) -> None:
    text = Page(page).text
    assert "timing.trigger_offset_ms mean delay 50 50 50.1 0.5 ms by hand ok" in text


def test_what_could_not_be_drawn_again_is_said(page: str) -> None:
    assert "Pictures and histogram could not be made again" in Page(page).text


def test_the_page_says_how_to_make_it_again_and_what_it_does_not_show(page: str) -> None:
    text = Page(page).text
    assert "simbench demo" in text and "packages numpy" in text and "seeds 0, 1" in text
    assert "simulated detector" in text and "assumed" in text and "no vignetting" in text


def test_a_video_in_the_folder_is_linked_and_others_are_not(tmp_path: Path) -> None:
    from fractions import Fraction

    from simbench.report.video import encode, video_name

    picture = np.full((48, 64, 3), 120, dtype=np.uint8)
    encode(iter([picture] * 3), tmp_path / video_name(SCENARIO, "car", 1), Fraction(5, 2))
    encode(iter([picture] * 3), tmp_path / video_name(SCENARIO, "car", 7), Fraction(5, 2))
    found = Page(make(BOTH, tmp_path))
    videos = [given for tag, given in found.tags if tag == "video"]
    assert [v["src"] for v in videos] == ["overlay-overtake-approach-car-1.webm"]
    assert (videos[0]["poster"] or "").startswith("data:image/jpeg;base64,")


def test_a_report_without_results_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="at least one result"):
        make([], tmp_path)
    assert list(tmp_path.iterdir()) == []
