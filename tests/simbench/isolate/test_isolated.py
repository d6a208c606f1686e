"""Isolation changes no score; a user's code finds what is the user's, and no truth."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from dataclasses import fields
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from click.testing import CliRunner

from fusion.messages import LidarScan
from scenarios.errors import BadInput
from simbench import truth
from simbench.capture import Captured
from simbench.cli import main
from simbench.isolate import process
from simbench.isolate.ask import check_pipeline_name, describe, reads_images, runs_apart
from simbench.isolate.frames import Frame, pack
from simbench.isolate.limits import DEFAULT, Limits
from simbench.isolate.reference import command_of, is_ours
from simbench.isolate.told import message_frame, reset_frame
from simbench.plugins import pipeline_names
from simbench.run import run_case
from tests.simbench.isolate.pipelines import BASE, write
from tests.simbench.support import digest, recorded, staged

ROOT = Path(__file__).resolve().parents[3]
EXAMPLE = ROOT / "docs" / "external_pipeline.py"


@pytest.fixture(scope="module")
def captured() -> Captured:
    return recorded(staged(duration_s=1.0, columns=256))


@pytest.fixture(scope="module")
def rich() -> Captured:
    """Enough points on the target for every pipeline to find something."""
    return recorded(staged(duration_s=1.0, columns=1024, size_px=None))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


# -- the same scores --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", pipeline_names())
def test_ours_answer_the_same_byte_for_byte(rich: Captured, name: str) -> None:
    here, apart = (run_case(name, rich, isolate) for isolate in ("none", "all"))
    assert here.status == apart.status == "ok", apart.why
    assert here.driven and apart.driven and here.driven is not apart.driven
    for one in ("outputs", "trajectories"):
        assert digest(getattr(here.driven, one)) == digest(getattr(apart.driven, one))
    assert digest(here.rows, here.scores) == digest(apart.rows, apart.scores)
    assert any(output.objects for output in here.driven.outputs), "an empty answer proves nothing"


def test_time_is_counted_where_the_pipeline_is(captured: Captured, tmp_path: Path) -> None:
    name = write(
        tmp_path, "def answer(self, scan): time.sleep(0.05)\ndef timings_ns(self): return {'a': [1, 2]}"
    )
    driven = run_case(name, captured).driven
    assert driven is not None
    assert len(driven.scan_ms) == 10 and min(driven.scan_ms) >= 50.0
    assert driven.step_ns == {"a": (1, 2)}


def test_which_pipelines_run_apart() -> None:
    assert [runs_apart("robust", isolate) for isolate in ("users", "all", "none")] == [False, True, False]
    assert [runs_apart("a.py:B", isolate) for isolate in ("users", "all", "none")] == [True, True, False]
    assert [runs_apart("exec:a", isolate) for isolate in ("users", "all", "none")] == [True, True, True]
    assert all(is_ours(name) for name in pipeline_names()) and not is_ours("fusion.pipelines.robust:Robust")


# -- what the user's code finds ---------------------------------------------------------------------------


def test_neighbours_and_packages_of_the_users_folder_are_found(
    captured: Captured, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for place in ("deep", "package", "elsewhere"):
        (folder / place).mkdir()
    (folder / "deep" / "neighbour.py").write_text("A = 1")
    (folder / "package" / "__init__.py").write_text("B = 2")
    (folder / "elsewhere" / "far.py").write_text("C = 3")
    monkeypatch.setenv("PYTHONPATH", "elsewhere")
    monkeypatch.setenv("MY_LICENCE", "4")
    monkeypatch.setenv("PYTHONHASHSEED", "6640")  # as dask's workers have it
    before = "import os, neighbour, package, far\nassert neighbour.A + package.B + far.C == 6\n"
    before += "assert os.environ['MY_LICENCE'] == '4' and os.environ['PYTHONHASHSEED'] == '0'"
    write(folder / "deep", "pass", before=before)
    case = run_case("./deep/mine.py:Mine", captured)
    assert case.status == "ok", case.why
    (folder / "package" / "mine.py").write_text(BASE + "\nclass Mine(Base):\n    pass\n")
    case = run_case("package.mine:Mine", captured)
    assert case.status == "ok", case.why


def test_the_truth_is_in_no_frame_and_in_no_module(captured: Captured, tmp_path: Path) -> None:
    asked: list[Frame] = []
    ask = process.Process.ask

    def heard(self: process.Process, frame: Frame, *rest: object) -> process.Answer:
        asked.append(frame)
        return ask(self, frame, *rest)  # type: ignore[arg-type]

    body = """
def trajectories(self):
    heavy = [m for m in sys.modules if m.split('.')[0] in ('mujoco', 'numba', 'scipy', 'cv2', 'pydantic')]
    assert not heavy, heavy
    bench = [m for m in sys.modules if m.startswith('simbench.') and not m.startswith('simbench.isolate')]
    assert bench == ['simbench.plugins'], bench
    return ()
"""
    with mock.patch.object(process.Process, "ask", heard):
        case = run_case(write(tmp_path, body), captured)
    assert case.status == "ok", case.why
    recording = captured.recording
    told = [reset_frame(recording.calibration, recording.categories), *map(message_frame, recording.messages)]
    assert [pack(f) for f in asked] == [
        pack(f) for f in (Frame(kind="describe"), *told, Frame(kind="finish"))
    ]
    # No array of the truth is in these bytes; a message's own array is, so the search finds what is there.
    sent = b"".join(map(pack, asked))
    scans = [scan for scan in recording.truth.scans if len(scan.fire_ns) > 8]
    assert scans and recording.messages
    for scan in scans:
        for field in fields(truth.ScanTruth):
            value = getattr(scan, field.name)
            if isinstance(value, np.ndarray) and len(np.unique(value)) > 8:
                assert value.tobytes() not in sent, field.name
    assert all(m.xyz_m.tobytes() in sent for m in recording.messages if isinstance(m, LidarScan))


def test_a_worker_that_is_killed_leaves_no_pipeline_behind(tmp_path: Path) -> None:
    note = tmp_path / "pid"
    body = f"def reset(self, *_):\n    open({str(note)!r}, 'w').write(str(os.getpid()))\n    time.sleep(60)"
    code = (
        "import sys; from simbench.isolate.drive import drive_isolated\n"
        "from simbench.isolate.limits import DEFAULT; from fusion.messages import Calibration\n"
        "drive_isolated(sys.argv[1], Calibration(T_ego_sensor={}, cameras={}), {}, (), DEFAULT)"
    )
    words = [sys.executable, "-c", code, write(tmp_path, body)]
    with subprocess.Popen(
        words, env={**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(tmp_path)}
    ) as worker:
        until = time.monotonic() + 60.0
        while not (note.is_file() and note.read_text()) and time.monotonic() < until:
            time.sleep(0.02)
        pid = int(note.read_text())
        assert Path(f"/proc/{pid}").exists()
        worker.kill()
    until = time.monotonic() + 60.0
    while Path(f"/proc/{pid}/environ").exists() and state(pid) not in "ZX" and time.monotonic() < until:
        time.sleep(0.02)
    assert state(pid) in "ZX"


def state(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return "X"


# -- before anything runs ---------------------------------------------------------------------------------


def test_whether_images_are_read_is_asked_of_the_process(folder: Path) -> None:
    write(folder, "pass")
    assert reads_images("mine.py:Mine") is False
    write(folder, "reads_images = True", name="other.py")
    assert reads_images("other.py:Mine") is True
    assert reads_images(f"exec:python3 {EXAMPLE}") is False
    assert "mine" not in sys.modules and "simbench_user_mine" not in sys.modules


def test_a_file_that_was_changed_is_asked_again(folder: Path) -> None:
    write(folder, "pass")
    assert describe("mine.py:Mine").reads_images is False
    write(folder, "reads_images = True")
    os.utime(folder / "mine.py", ns=(1, 1))
    assert describe("mine.py:Mine").reads_images is True


BAD = {
    "nowhere.py:Mine": "pipeline 'nowhere.py:Mine': there is no file nowhere.py.",
    "mine.py:Mien": "has no 'Mien'; did you mean 'Mine'?",
    "mine.py:number": "is not callable (allowed: a class, or a function that makes one).",
    "quits.py:Mine": "cannot be loaded: its process ended with exit code 3 before it answered describe.",
    "exits.py:Mine": "cannot be imported: SystemExit: 4.",
    "raises.py:Mine": "cannot be imported: RuntimeError: no licence.",
    "crashes.py:Mine": "cannot be loaded: its process was ended by SIGSEGV before it answered describe",
    "syntax.py:Mine": "cannot be imported: SyntaxError",
    "no_such_module:Mine": "cannot be imported: ModuleNotFoundError",
    "exec:": "names no program",
    "exec:'": "is no command line: No closing quotation",
    "exec:no-such-program-anywhere": "there is no program no-such-program-anywhere",
    "exec:echo hello": "cannot be loaded: its process ended with exit code 0",
    "probabilistc": "did you mean 'probabilistic'?",
}


@pytest.mark.parametrize("name", BAD)
def test_a_pipeline_that_cannot_be_loaded_is_one_sentence_and_exit_code_2(folder: Path, name: str) -> None:
    write(folder, "pass", before="number = 3")
    for file, text in {
        "quits": "import os; os._exit(3)",
        "exits": "import sys; sys.exit(4)",
        "raises": "raise RuntimeError('no licence')",
        "crashes": "import ctypes; ctypes.string_at(0)",
        "syntax": "def f(:",
    }.items():
        (folder / f"{file}.py").write_text(text)
    done = CliRunner().invoke(main, ["run", "overtake-approach", "--pipeline", name, "--out", "out"])
    assert done.exit_code == 2
    (line,) = done.stderr.splitlines()
    assert BAD[name] in line and str(folder) not in line
    assert not (folder / "out").exists()
    with pytest.raises(BadInput):
        check_pipeline_name(name)


# -- a program of its own ---------------------------------------------------------------------------------


def test_the_documents_program_runs_and_says_what_it_should(captured: Captured, folder: Path) -> None:
    shutil.copy(EXAMPLE, folder / "mine.py")
    text = EXAMPLE.read_text(encoding="utf-8")
    assert "import simbench" not in text and "import fusion" not in text and "import numpy" not in text
    case = run_case("exec:python3 mine.py", captured)
    assert case.status == "ok", case.why
    assert case.driven is not None and case.scores is not None
    found = [(o.scan_seq, one) for o in case.driven.outputs for one in o.objects]
    assert len(found) >= 5
    scans = {m.seq: m for m in captured.recording.messages if hasattr(m, "xyz_m")}
    for seq, one in found:
        xyz = scans[seq].xyz_m
        ahead = np.flatnonzero((xyz[:, 0] > 0.0) & (np.abs(xyz[:, 1]) < 1.0))
        assert one.points.tolist() == [ahead[np.argmin(xyz[ahead, 0])]]
        np.testing.assert_array_equal(one.position_ego_m, xyz[one.points[0]].astype(float))
    assert case.driven.scan_ms and min(case.driven.scan_ms) > 0.0


def test_the_commands_words_for_files_are_the_users(folder: Path) -> None:
    (folder / "tool").write_text("#!/bin/sh\n")
    (folder / "tool").chmod(0o755)
    (folder / "data.bin").touch()
    words = command_of("exec:./tool --from data.bin 'a b' none.bin").words
    assert words == (str(folder / "tool"), "--from", str(folder / "data.bin"), "a b", "none.bin")


# -- the command line -------------------------------------------------------------------------------------


def test_a_case_that_hangs_ends_the_others_go_on(folder: Path) -> None:
    write(folder, "def answer(self, scan): time.sleep(60)")
    words = (
        "run overtake-approach --system car --seeds 0 --images none --out out --jobs 1 --alone "
        "--set systems.car.duration_s=0.5 --message-timeout 0.8 --case-timeout 50 --memory 900 "
        "--pipeline mine.py:Mine --pipeline static_projection"
    )
    done = CliRunner().invoke(main, words.split())
    assert done.exit_code == 1, done.output
    content = json.loads((folder / "out" / "result.json").read_text())
    status = {case["pipeline"]: case["status"] for case in content["cases"]}
    assert status == {"mine.py:Mine": "timeout", "static_projection": "ok", "oracle": "ok"}
    for row in content["rows"]:
        assert row["pipeline"] != "mine.py:Mine" or (row["value"] is None and "within 0.8 s" in row["why"])
    summary = {(r["pipeline"], r["metric"]): r for r in content["summary"]}
    assert summary["mine.py:Mine", "precision"]["n"] == 0
    again = next(case["command"] for case in content["cases"] if case["pipeline"] == "mine.py:Mine")
    assert "--message-timeout 0.8 --case-timeout 50 --memory 900" in again


def test_the_limits_of_the_command_line_are_those_of_the_bench() -> None:
    usual = {p.name: p.default for p in main.commands["run"].params}
    assert Limits(**{n: usual[n] for n in ("message_s", "case_s", "memory_mb")}) == DEFAULT
