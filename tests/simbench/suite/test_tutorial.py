"""docs/tutorial.md, command by command: a gate that fails, passes, and catches a change for the worse."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from simbench.case import Job
from simbench.cli import main
from simbench.run import Made, _record

ROOT = Path(__file__).resolve().parents[3]
TEXT = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"```(console|python)\n(.*?)```", re.DOTALL)
BODY = re.compile(r"(# --- change from here ---\n).*?(    # --- to here ---)", re.DOTALL)


def each_drive_once() -> Callable[..., Made]:
    """Recorded by the first of the four runs. That each makes the same ones is asked in test_suite_run.py."""
    kept: dict[Job, Made] = {}

    def recorded(job: Job, *of: Any) -> Made:
        drive = replace(job, pipelines=())
        if drive not in kept:
            kept[drive] = _record(job, *of)
        return kept[drive]

    return recorded


@pytest.mark.timeout(900)
def test_every_command_of_the_tutorial_does_what_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("simbench.run._record", each_drive_once())
    codes: list[int] = []
    for kind, text in BLOCK.findall(TEXT):
        if kind == "python":  # what the reader puts between the marks
            path = Path("my_fusion.py")
            path.write_text(BODY.sub(lambda m, new=text: m[1] + new + m[2], path.read_text("utf-8")), "utf-8")
            continue
        for line in text.splitlines():
            command, _, says = line.removeprefix("$ ").partition("    # exit code ")
            words = shlex.split(command)
            if words[0] == "cd":
                monkeypatch.chdir(words[1])
                continue
            assert words[0] == "simbench"
            # Six runs of 0.8 s instead of eight of three: the verdicts are the same, the numbers are not.
            for path in Path(".").glob("suite.yaml"):
                short = (
                    path.read_text("utf-8").replace("duration_s=3", "duration_s=0.8").replace("0-7", "0-5")
                )
                path.write_text(short, "utf-8")
            jobs = ["--jobs", "1"] if words[1] == "run" else []
            done = CliRunner().invoke(main, [*words[1:], *jobs], prog_name="simbench")
            assert done.exit_code == int(says or 0), f"{line}\n{done.output}"
            codes.append(done.exit_code)
    assert codes == [0, 1, 0, 0, 1, 0]


def test_a_starter_is_never_written_over_what_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("suite.yaml").write_text("mine", "utf-8")
    done = CliRunner().invoke(main, ["init"], prog_name="simbench")
    assert done.exit_code == 2
    assert "suite.yaml is there already" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["suite.yaml"]


def test_the_ci_file_of_the_starter_is_the_one_of_the_docs() -> None:
    starter = (ROOT / "simbench" / "starter" / "simbench.yml").read_text("utf-8")
    docs = (ROOT / "docs" / "ci.md").read_text("utf-8")
    assert starter.partition("\n")[2].strip() in docs
