"""Documents that repeat what code defines are checked against the code."""

from __future__ import annotations

from pathlib import Path

from scenarios.faults import FAULTS
from simbench.score.metrics import as_markdown

DOCS = Path(__file__).resolve().parents[1] / "docs"


def test_the_metrics_document_holds_the_specification_word_for_word() -> None:
    assert as_markdown() in (DOCS / "metrics.md").read_text(encoding="utf-8")


def test_the_fault_document_names_every_fault_and_every_field() -> None:
    text = (DOCS / "faults.md").read_text(encoding="utf-8")
    for name, spec in FAULTS.items():
        assert f"`{name}`" in text
        for field in spec.model_fields:
            assert f"`{field}`" in text, f"{name}: {field}"
