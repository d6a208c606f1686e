"""Documents that repeat what code defines are checked against the code."""

from __future__ import annotations

import re
import shlex
from dataclasses import fields
from pathlib import Path
from typing import get_args

import pytest
from click.testing import CliRunner

from fusion.messages import Measurement
from scenarios.faults import FAULTS
from scenarios.load import list_scenarios
from scenarios.scenario import Bend, CameraSensor, Surface, Sway
from scenarios.scenario import Path as ScenarioPath
from simbench.cli import main
from simbench.score.metrics import as_markdown

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"


def test_the_metrics_document_holds_the_specification_word_for_word() -> None:
    assert as_markdown() in (DOCS / "metrics.md").read_text(encoding="utf-8")


def test_the_fault_document_names_every_fault_and_every_field() -> None:
    text = (DOCS / "faults.md").read_text(encoding="utf-8")
    for name, spec in FAULTS.items():
        assert f"`{name}`" in text
        for field in spec.model_fields:
            assert f"`{field}`" in text, f"{name}: {field}"


def test_the_fault_document_shows_a_picture_of_every_fault_in_its_family() -> None:
    text = (DOCS / "faults.md").read_text(encoding="utf-8")
    shown = re.findall(r"!\[([\w.]+)\]\((faults/[\w.]+)\)", text)
    assert sorted(name for name, _ in shown) == sorted(FAULTS)
    for name, path in shown:
        assert Path(path).stem == name
        family = text.index(f"### {name.partition('.')[0]}:")
        place = text.index(f"]({path})")
        assert family < place and "\n### " not in text[family + 4 : place]
    files = sorted((DOCS / "faults").iterdir())
    assert [file.name for file in files] == sorted(Path(path).name for _, path in shown)
    assert sum(file.stat().st_size for file in files) < 1_500_000


def test_the_scenario_document_names_every_scenario_and_every_word_of_a_path_and_a_bend() -> None:
    text = (DOCS / "scenarios.md").read_text(encoding="utf-8")
    assert set(list_scenarios()) == set(re.findall(r"^\| `([a-z-]+)` \|", text, re.MULTILINE))
    for field in (*ScenarioPath.model_fields, *Sway.model_fields, *Bend.model_fields, *Surface.model_fields):
        assert re.search(rf"\b{field}\b", text), field


def rows_of(text: str) -> dict[str, str]:
    """The rows of all tables by the code word in their first cell."""
    return {word: rest for word, rest in re.findall(r"^\| `(\w+)` \|(.*)$", text, re.MULTILINE)}


def test_the_pipeline_document_names_every_message_and_every_field() -> None:
    rows = rows_of((DOCS / "pipeline.md").read_text(encoding="utf-8"))
    for message in get_args(Measurement):
        for field in fields(message):
            if field.name not in ("sensor", "seq", "stamp_ns", "arrival_ns"):
                assert f"`{field.name}`" in rows[message.__name__], f"{message.__name__}: {field.name}"


def test_the_frames_document_says_what_every_stamp_of_a_camera_claims() -> None:
    rows = rows_of((DOCS / "frames.md").read_text(encoding="utf-8"))
    for stamp in get_args(CameraSensor.model_fields["stamp"].annotation):
        assert stamp in rows


COMMANDS = [
    (path.name, shlex.split(command))
    for path in (ROOT / "README.md", *sorted(DOCS.glob("*.md")))
    for command in re.findall(
        r"^python3 dev\.py run simbench (.+)$", path.read_text(encoding="utf-8"), re.MULTILINE
    )
]


@pytest.mark.parametrize(("document", "words"), COMMANDS, ids=lambda value: " ".join(value)[:60])
def test_the_command_line_knows_every_command_of_the_documents(document: str, words: list[str]) -> None:
    verb, *rest = words
    assert verb in main.commands, document
    with main.commands[verb].make_context(verb, rest) as context:  # refuses unknown options and bad values
        assert context.params is not None


def test_the_timelines_example_in_the_documents_runs(tmp_path: Path) -> None:
    found = [words for _, words in COMMANDS if words[0] == "timeline"]
    assert len(found) >= 2
    for words in found:
        done = CliRunner().invoke(main, [*words, "--out", str(tmp_path)])
        assert done.exit_code == 0, done.output
        assert (tmp_path / "timeline.svg").is_file()
