"""Files from an enemy: one sentence and exit code 2, in bounded memory; no number, and nothing on a terminal
but text. Through what reads them, and through every verb that does."""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from scenarios.errors import BadInput
from scenarios.fault_set import FaultSet
from simbench.cli import main
from simbench.elsewhere.outputs import read_outputs
from simbench.elsewhere.positions import score_positions
from simbench.elsewhere.table import read_table
from simbench.formats.kitti import open_kitti
from simbench.formats.pcd import read_pcd
from simbench.formats.recorded import Player
from simbench.formats.store import first_difference, read_recording
from simbench.recording import Recording
from tests.simbench.formats.hostile import CORPUS
from tests.simbench.formats.hostile_files import CSV, HEADER, JSONL, KITTI, PCD, SCHEMA
from tests.simbench.formats.hostile_parts import good, good_folder

ROOT = Path(__file__).resolve().parents[3]
MOST_MB = 150  # of Python's own memory, in reading any of them
LIMIT = (
    "import resource as r; r.setrlimit(r.RLIMIT_AS, (3 * 2**30,) * 2); from simbench.cli import main; main()"
)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("hostile")
    for name, one in CORPUS.items():
        one.make(folder / name)
    yield folder
    shutil.rmtree(folder)


def one_line(text: str) -> None:
    assert text.rstrip("\n").isprintable() and len(text) < 2500, text[:500]


def call(*words: str) -> Result:
    return CliRunner().invoke(main, list(words), catch_exceptions=False)


def no_number(out: Path) -> None:
    """Nothing in a folder says how good anything was."""
    for path in out.rglob("result.json"):
        assert all(row["value"] is None for row in json.loads(path.read_text(encoding="utf-8"))["rows"])
    for path in out.rglob("*.csv"):
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 1, "a header at most"


def test_there_are_many_kinds() -> None:
    assert len(CORPUS) > 100 and len(CSV) + len(JSONL) + len(PCD) + len(KITTI) > 40


def test_what_is_hostile_is_so_beside_a_recording_that_is_not(tmp_path: Path) -> None:
    """Else all of it might be refused for one reason."""
    stored = read_recording(good_folder())
    assert stored.status == "COMPLETE" and first_difference(stored.recording, good()) is None
    for words in (
        ("verify",), ("view", "--tool", "page"), ("run", "--pipeline", "static_projection", "--jobs", "1"),
    ):  # fmt: skip
        out = () if words == ("verify",) else ("--out", str(tmp_path / words[0]))
        done = call(words[0], str(good_folder()), *words[1:], *out)
        assert done.exit_code == 0, done.output


# -- through what reads them --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CORPUS)
def test_a_hostile_recording_is_one_sentence_or_what_was_written(corpus: Path, name: str) -> None:
    one, started = CORPUS[name], time.monotonic()
    tracemalloc.start()
    try:
        stored = read_recording(corpus / name)
        assert one.says is None or (one.cut and stored.status == "INCOMPLETE"), stored.missing
        if stored.status == "COMPLETE":
            recording = stored.recording
            extra = len(recording.messages) - len(good().messages)
            assert extra == (1 if name == "message-twice" else 0)
            assert (not extra and first_difference(recording, good()) is None) or extra
    except BadInput as error:
        one_line(str(error))
        assert one.says is None or re.search(one.says, str(error)), error
        assert "Error" not in str(error) or "Value error" in str(error)
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < MOST_MB * 1e6 and time.monotonic() - started < 10.0


@pytest.fixture(scope="module")
def recording() -> Recording:
    return read_recording(good_folder()).recording


@pytest.mark.parametrize("name", CSV)
def test_a_hostile_table_is_one_sentence(tmp_path: Path, recording: Recording, name: str) -> None:
    content, says = CSV[name]
    refused(tmp_path / "a.csv", content, says, lambda p: score_positions(recording, read_table(p), str(p)))


@pytest.mark.parametrize("name", JSONL)
def test_hostile_outputs_are_one_sentence(tmp_path: Path, recording: Recording, name: str) -> None:
    content, says = JSONL[name]
    refused(tmp_path / "a.jsonl", content, says, lambda p: read_outputs(p, recording))


@pytest.mark.parametrize("name", PCD)
def test_a_hostile_cloud_is_one_sentence(tmp_path: Path, name: str) -> None:
    content, says = PCD[name]
    refused(tmp_path / "a.pcd", content, says, read_pcd)


def refused(path: Path, content: bytes, says: str, read: object) -> None:
    path.write_bytes(content)
    tracemalloc.start()
    try:
        with pytest.raises(BadInput, match=says) as told:
            read(path)  # type: ignore[operator]
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    one_line(str(told.value))
    assert peak < MOST_MB * 1e6


@pytest.mark.parametrize("name", KITTI)
def test_a_hostile_folder_of_kitti_is_one_sentence(tmp_path: Path, name: str) -> None:
    make, says = KITTI[name]
    root = make(tmp_path / "data")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(BadInput, match=says) as told:
        folder = open_kitti(f"kitti:{root}")
        for number in folder.names:
            Player(folder.drive(number), FaultSet()).play(images=True)
    one_line(str(told.value))
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1000 * MOST_MB


def test_what_is_no_file_has_no_results(tmp_path: Path, recording: Recording) -> None:
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "zero").symlink_to("/dev/zero")
    for name in ("fifo", "zero"):
        for read in (read_table, lambda path: read_outputs(path, recording)):
            with pytest.raises(BadInput, match="no plain file"):
                read(tmp_path / name)


# -- through the command line -------------------------------------------------------------------------------


def told(done: Result, name: str) -> None:
    """One line on the error stream and exit code 2; or INCOMPLETE, where the verb says so."""
    assert "\x1b" not in done.output and "Traceback" not in done.output
    lines = [line for line in done.stderr.splitlines() if "recordings to make" not in line]
    if CORPUS[name].says is None and done.exit_code == 0:
        return
    if CORPUS[name].cut and "INCOMPLETE" in done.output:
        assert done.exit_code in (0, 1, 2, 3), done.output
        return
    assert done.exit_code == 2 and len(lines) == 1, done.output
    assert lines[0].startswith("simbench: ")
    one_line(lines[0])


@pytest.mark.parametrize("name", CORPUS)
def test_every_verb_says_it(corpus: Path, tmp_path: Path, name: str) -> None:
    results = tmp_path / "mine.csv"
    results.write_bytes(HEADER)
    out = tmp_path / "out"
    told(call("verify", str(corpus / name)), name)
    if list(CORPUS).index(name) % 8 and CORPUS[name].says is not None and not CORPUS[name].cut:
        return  # all verbs read it alike: the others are asked of some
    told(call("view", str(corpus / name), "--tool", "page", "--out", str(out / "view")), name)
    scored = call("score", str(corpus / name), "--results", str(results), "--out", str(out / "score"))
    told(scored, name)
    if scored.exit_code != 0:
        no_number(out / "score")
    assert {path.name for path in tmp_path.iterdir()} <= {"mine.csv", "out"}


OVER_RUN = (
    "cut-messages-0.5", "cut-truth-1.0", "flip-chunk-data", "all-points-nan", "target-that-is-none",
    "period-0", "manifest-without-hashes",
)  # fmt: skip


@pytest.mark.parametrize("name", OVER_RUN)
def test_run_gives_no_number(corpus: Path, tmp_path: Path, name: str) -> None:
    out = tmp_path / "out"
    words = ("--pipeline", "static_projection", "--jobs", "1", "--images", "none", "--out", str(out))
    told(call("run", str(corpus / name), *words), name)
    if out.exists():
        no_number(out)


@pytest.mark.parametrize(("suffix", "kinds"), [("csv", CSV), ("jsonl", JSONL)])
def test_score_says_it(tmp_path: Path, suffix: str, kinds: dict[str, tuple[bytes, str]]) -> None:
    for name, (content, says) in kinds.items():
        path = tmp_path / f"mine.{suffix}"
        path.write_bytes(content)
        done = call("score", str(good_folder()), "--results", str(path), "--out", str(tmp_path / "out"))
        (line,) = done.stderr.splitlines()
        assert done.exit_code == 2 and re.search(says, line), (name, done.output[:300])
        one_line(line)
    assert not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize(
    ("verb", "name"),
    [
        ("verify", "fifo-as-messages"), ("view", "dev-zero-as-recording"), ("verify", "zstd-bomb-honest"),
        ("verify", "boxes-by-the-million"),
    ],
)  # fmt: skip
def test_a_process_of_3_gb_says_it_in_time(corpus: Path, tmp_path: Path, verb: str, name: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", LIMIT, verb, str(corpus / name)], cwd=ROOT, timeout=60, text=True,
        capture_output=True, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    one_line(line)


def test_a_table_of_the_schema_alone_is_no_crash(tmp_path: Path, recording: Recording) -> None:
    (tmp_path / "a.csv").write_bytes(HEADER)
    (tmp_path / "a.jsonl").write_bytes(SCHEMA)
    assert read_table(tmp_path / "a.csv") == ()
    assert read_outputs(tmp_path / "a.jsonl", recording) == ((), ())
