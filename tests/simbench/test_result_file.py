"""`result.json` record by record: the same as at once, and no more memory than one record needs."""

from __future__ import annotations

import json
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import pytest

from scenarios.errors import BadInput
from simbench import result_file
from simbench.result_file import Record, document, write_result

KEY = {"scenario": "s", "system": "car", "pipeline": "p", "faults": "none", "calibration": "true"}


def record(seed: int, padding: int = 0) -> Record:
    """A value in four of five; none in a padded one, of which no interval is made."""
    key = {**KEY, "seed": seed}
    row = {**key, "metric": "precision", "value": None if padding or seed % 5 == 4 else 0.5 + 0.001 * seed}
    return {
        "rows": [{**row, "unit": "1", "better": "higher"}],
        "cases": [{**key, "status": "ok", "why": "x" * padding}],
        "timings": [{**key, "metric": "latency_ms.p50", "value": 1.5}],
    }


def test_parts_hold_all_records_in_order_and_the_summary_counts_runs(tmp_path: Path) -> None:
    path = write_result(tmp_path, map(record, range(25)), {"python": "3"}, verdict={"outcome": "PASS"})
    content = json.loads(path.read_text(encoding="utf-8"))
    assert list(content) == ["schema", "rows", "cases", "summary", "timings", "environment", "verdict"]
    assert [row["seed"] for row in content["rows"]] == list(range(25))
    (summary,) = content["summary"]
    assert (summary["n"], summary["missing"], summary["method"]) == (20, 5, "bca")
    assert content.pop("verdict") == {"outcome": "PASS"}
    assert content == document(map(record, range(25)), {"python": "3"})
    assert list(tmp_path.iterdir()) == [path]


def test_nothing_at_all_is_a_whole_document_too() -> None:
    content = document([], {})
    assert (content["rows"], content["cases"], content["summary"], content["timings"]) == ([], [], [], [])


def test_memory_does_not_grow_with_the_records(tmp_path: Path) -> None:
    def peak(count: int) -> int:
        tracemalloc.start()
        write_result(tmp_path, (record(seed, padding=20_000) for seed in range(count)), {})
        try:
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    few, many = peak(400), peak(4000)  # 8 and 80 MB
    assert many < few + 2_000_000


def test_records_that_break_off_leave_the_file_as_it_was(tmp_path: Path) -> None:
    def broken() -> Iterator[Record]:
        yield record(0)
        raise BadInput("the ledger is gone")

    path = write_result(tmp_path, [record(7)], {})
    before = path.read_bytes()
    with pytest.raises(BadInput, match="is gone"):
        write_result(tmp_path, broken(), {})
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_what_does_not_fit_into_memory_waits_on_the_disk_beside_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = document(map(record, range(50)), {})
    monkeypatch.setattr(result_file, "IN_MEMORY", 100)
    assert json.loads(write_result(tmp_path, map(record, range(50)), {}).read_bytes()) == whole
