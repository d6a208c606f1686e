"""All that can go wrong in a user's pipeline: a status and a sentence, and the bench goes on."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from simbench.capture import Captured
from simbench.case import Case
from simbench.isolate import process
from simbench.isolate.limits import Limits
from simbench.run import run_case
from simbench.score.metrics import METRICS
from tests.simbench.isolate.pipelines import program, write
from tests.simbench.support import recorded, staged

SHORT = Limits(message_s=1.0, case_s=20.0, memory_mb=1024)


@pytest.fixture(scope="module")
def captured() -> Captured:
    return recorded(staged(duration_s=0.5))


@pytest.fixture(autouse=True)
def nothing_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """After every test: no process that it started lives, none is unwaited for, no folder is there. Tests
    before it may have left children that stay to the end, such as multiprocessing's resource tracker."""
    before = children()
    kept = tmp_path / "temporary"
    kept.mkdir()
    monkeypatch.setattr(process.tempfile, "tempdir", str(kept))
    monkeypatch.setenv("SIMBENCH_TEST_OF", str(tmp_path))
    yield
    assert list(kept.iterdir()) == []
    assert marked(f"SIMBENCH_TEST_OF={tmp_path}".encode()) == []
    assert children() <= before  # zombies are children too


def children() -> set[str]:
    """Processes that this one has started and not waited for."""
    threads = Path("/proc/self/task").iterdir()
    return {pid for thread in threads for pid in (thread / "children").read_text("ascii").split()}


def marked(word: bytes) -> list[int]:
    """Processes with a word in their environment; a zombie has none."""
    found = []
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            words = Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
        except OSError:
            continue
        if word in words and int(pid) != os.getpid():
            found.append(int(pid))
    return found


def failed(case: Case, why: str, status: str = "pipeline_error") -> None:
    """It has that status and one sentence; every metric is null and says why; there is no score."""
    assert case.status == status, case.why
    assert why in (case.why or "") and "\n" not in (case.why or ""), case.why
    assert len(case.rows) == len(METRICS) and case.scores is None and case.driven is None
    assert all(row.value is None and row.why == f"{status}: {case.why}" for row in case.rows)


# -- Python: what it raises -------------------------------------------------------------------------------

RAISES = {
    "def __init__(self): raise LookupError('no licence')": "LookupError: no licence (line ",
    "def reset(self, *_): raise LookupError('no camera')": "LookupError: no camera (line",
    "def answer(self, scan): return 1 / 0": "ZeroDivisionError: division by zero (line",
    "def trajectories(self): raise RuntimeError('two\\nlines')": "RuntimeError: two lines (line",
    "def answer(self, scan): sys.exit(3)": "SystemExit: 3 (line",
    "def answer(self, scan): raise KeyboardInterrupt": "KeyboardInterrupt",
    "def trajectories(self): return 5": "TypeError: 'int' object is not iterable",
}


@pytest.mark.parametrize("body", RAISES)
def test_what_it_raises_is_the_reason(captured: Captured, tmp_path: Path, body: str) -> None:
    failed(run_case(write(tmp_path, body), captured, limits=SHORT), RAISES[body])


# -- Python: what it answers ------------------------------------------------------------------------------

ANSWERS = {
    "return 'yes'": "update must return a FusionOutput or None, not str",
    "return self.found(scan, position_ego_m=np.array([np.nan, 0, 0]))": "is not finite",
    "return self.found(scan, confidence=float('inf'))": "is not finite",
    "return self.found(scan, position_ego_m=np.zeros(4))": "position_ego_m has shape (4,), not (3,)",
    "return self.found(scan, points=np.zeros((2, 2), int))": "points has shape (2, 2), not (k,)",
    "return self.found(scan, points=np.array([10**6]))": "points must be indices in 0..",
    "return self.found(scan, points=np.array([-1]))": "points must be indices in 0..",
    "return self.found(scan, points=np.array([0, 0]))": "points holds an index twice",
    "return self.found(scan, track_id=1.5)": "track_id must be an integer, not 1.5",
    "return self.found(scan, track_id=2**80)": "track_id must be an integer of 64 bits",
    "return self.found(scan, category=None)": "category must be text, not None",
    "return self.found(scan, sensor='x' * 10000)": "'sensor' is no text of up to 200 characters",
    "return self.found(scan, distance_m='far')": "distance_m must be a number, not 'far'",
    "return self.found(scan, stamp_ns=0)": "lies outside its sweep",
    "return FusionOutput(scan_sensor='nowhere', scan_seq=0, objects=())": "which was never delivered",
    "return FusionOutput(scan_sensor=scan.sensor, scan_seq=0, objects=())": "a second output",
    "return FusionOutput(scan_sensor='a', scan_seq=0, objects=(3,))": "must be LocalizedObject, not int",
}


@pytest.mark.parametrize("body", ANSWERS)
def test_what_it_may_not_answer_is_said(captured: Captured, tmp_path: Path, body: str) -> None:
    later = "if not scan.stamp_ns: return super().answer(scan)"  # the first scan's stamp 0 is a right one
    text = f"def answer(self, scan):\n    {later}\n    {body}"
    failed(run_case(write(tmp_path, text), captured, limits=SHORT), ANSWERS[body])


def test_malformed_trajectories_are_said(captured: Captured, tmp_path: Path) -> None:
    for n, m in ((3, 2), (2, 3)):
        parts = f"stamp_ns=np.arange(2), position_ego_m=np.zeros(({n}, 3)), inlier=np.ones({m}, bool)"
        body = f"def trajectories(self): return (Trajectory(track_id=1, {parts}),)"
        failed(run_case(write(tmp_path, body), captured, limits=SHORT), "trajectory 1: stamps, positions and")
    failed(
        run_case(write(tmp_path, "def trajectories(self): return ('x',)"), captured, limits=SHORT),
        "trajectories must return Trajectory, not str",
    )


def test_answers_larger_than_a_frame_may_be_are_refused(captured: Captured, tmp_path: Path) -> None:
    body = "def answer(self, scan): return self.found(scan, points=np.zeros(40_000_000, int))"
    case = run_case(write(tmp_path, body), captured, limits=Limits(message_s=20.0, memory_mb=4096))
    failed(case, "bytes is too long")


# -- Python: how its process ends -------------------------------------------------------------------------

ENDS = {
    "os._exit(0)": "its process ended with exit code 0 before it answered message ",
    "os._exit(7)": "its process ended with exit code 7 before it answered message ",
    "ctypes.string_at(0)": "its process was ended by SIGSEGV before it answered message ",
    "os.kill(os.getpid(), signal.SIGKILL)": "its process was ended by SIGKILL before",
    "os.abort()": "its process was ended by SIGABRT before",
    "os.write(2, b'first\\nout of\\x07 luck\\n'); os._exit(1)": "; its last words: out of? luck",
    "os.close(0); os.closerange(3, 64); os._exit(9)": "ended with exit code 9",
    "subprocess.Popen(['sleep', '60']); os._exit(4)": "ended with exit code 4",
    "os.fork() or time.sleep(60); os._exit(5)": "ended with exit code 5",
}


@pytest.mark.parametrize("body", ENDS)
def test_how_its_process_ended_is_said(captured: Captured, tmp_path: Path, body: str) -> None:
    case = run_case(write(tmp_path, f"def answer(self, scan): {body}"), captured, limits=SHORT)
    failed(case, ENDS[body])


def test_a_message_is_named_by_its_place_kind_and_sensor(captured: Captured, tmp_path: Path) -> None:
    body = "def answer(self, scan):\n    if scan.seq == 2: os._exit(0)"
    messages = captured.recording.messages
    at, scan = next((i, m) for i, m in enumerate(messages) if type(m).__name__ == "LidarScan" and m.seq == 2)
    case = run_case(write(tmp_path, body), captured, limits=SHORT)
    failed(case, f"message {at} (LidarScan 2 of '{scan.sensor}')")


# -- Python: time and memory ------------------------------------------------------------------------------

HANGS = {
    "": "time.sleep(60)",
    "ignores SIGTERM": "signal.signal(signal.SIGTERM, signal.SIG_IGN)\n    while True: pass",
    "children ignore it": (
        "subprocess.Popen([sys.executable, '-c', 'import signal, time;"
        " signal.signal(signal.SIGTERM, signal.SIG_IGN); time.sleep(60)'])\n    time.sleep(60)"
    ),
    "children left its session": (
        "subprocess.Popen(['sleep', '60'], start_new_session=True)\n    time.sleep(60)"
    ),
    "a child holds the pipe": "os.fork()\n    time.sleep(60)",
}


@pytest.mark.parametrize("how", HANGS)
def test_a_hang_is_ended_with_all_that_it_started(captured: Captured, tmp_path: Path, how: str) -> None:
    begun = time.monotonic()
    body = f"def answer(self, scan):\n    {HANGS[how]}"
    failed(run_case(write(tmp_path, body), captured, limits=SHORT), "not answered within 1 s", "timeout")
    assert time.monotonic() - begun < 30.0  # of the 60 s that it wanted


def test_the_case_as_a_whole_has_a_limit(captured: Captured, tmp_path: Path) -> None:
    slow = write(tmp_path, "def update(self, message): time.sleep(0.2)")
    case = run_case(slow, captured, limits=Limits(message_s=30.0, case_s=4.0))
    failed(case, "the case took more than 4 s", "timeout")


def test_slow_is_fine_below_the_limit(captured: Captured, tmp_path: Path) -> None:
    slow = write(tmp_path, "def answer(self, scan): time.sleep(0.3)")
    case = run_case(slow, captured, limits=Limits(message_s=20.0))
    assert case.status == "ok" and case.driven is not None
    assert min(case.driven.scan_ms) > 300.0


GROWS = {
    "in steps": "kept = []\n    while True: kept.append(np.ones(10**6)); time.sleep(0.005)",
    "at once": "np.ones(10**10)",
    "in a child": (
        "subprocess.run([sys.executable, '-c', 'import time; x = bytearray(600 * 2**20); time.sleep(60)'])"
    ),
}


@pytest.mark.parametrize("how", GROWS)
def test_unbounded_growth_is_ended(captured: Captured, tmp_path: Path, how: str) -> None:
    body = f"def answer(self, scan):\n    {GROWS[how]}"
    case = run_case(write(tmp_path, body), captured, limits=Limits(message_s=30.0, memory_mb=500))
    assert case.status == "pipeline_error" and case.why
    assert "more than 500 MB of memory" in case.why or "MemoryError" in case.why


# -- Python: noise, stdin, files --------------------------------------------------------------------------

NOISE = {
    "print": "print('hello')",
    "os.write": "os.write(1, b'SBF1' * 5)",
    "C": "libc = ctypes.CDLL(None); libc.puts(b'from C'); libc.fflush(None)",
    "a child": "subprocess.run(['echo', 'from a child'], check=True)",
    "megabytes": "sys.stdout.write('x' * 3_000_000 + chr(10)); os.write(1, b'y' * 3_000_000)",
    "megabytes on stderr": "os.write(2, b'z' * 3_000_000)",
    "reads stdin": "assert sys.stdin.read() == '' and os.read(0, 10) == b''",
}


@pytest.mark.parametrize("how", NOISE)
def test_noise_and_reading_stdin_harm_nothing(captured: Captured, tmp_path: Path, how: str) -> None:
    body = f"def answer(self, scan):\n    {NOISE[how]}\n    return super().answer(scan)"
    quiet = run_case(write(tmp_path, "pass", name="quiet.py"), captured, limits=SHORT)
    case = run_case(write(tmp_path, body), captured, limits=Limits(message_s=20.0))
    assert case.status == "ok", case.why
    assert case.rows == quiet.rows


def test_its_folder_is_empty_and_its_own_and_goes(captured: Captured, tmp_path: Path) -> None:
    body = """
def answer(self, scan):
    if scan.seq == 0:
        assert os.listdir() == [], os.listdir()
        os.mkdir("deep"); open("deep/file", "w").write("x"); os.chmod("deep", 0o000)
        os.symlink("/", "link")
"""
    case = run_case(write(tmp_path, body), captured, limits=SHORT)
    assert case.status == "ok", case.why


def test_a_process_left_behind_by_a_good_run_is_ended(captured: Captured, tmp_path: Path) -> None:
    body = "def trajectories(self):\n    subprocess.Popen(['sleep', '60'])\n    return ()"
    assert run_case(write(tmp_path, body), captured, limits=SHORT).status == "ok"


def test_a_thread_left_behind_by_a_good_run_is_ended(captured: Captured, tmp_path: Path) -> None:
    thread = "import threading; threading.Thread(target=time.sleep, args=(60,)).start()"
    body = f"def trajectories(self):\n    {thread}\n    return ()"
    assert run_case(write(tmp_path, body), captured, limits=SHORT).status == "ok"


# -- programs ---------------------------------------------------------------------------------------------

PROGRAMS = {
    "print('hello world, this is no frame')": "is no frame: no frame begins with b'hello world,'",
    "begin(); ask(); raw(b'SBF1' + b'\\xff' * 8)": "is no frame: a header of 4294967295 bytes is too long",
    "begin(); ask(); raw(struct.pack('<4sII', b'SBF1', 2, 2**31) + b'{}')": "a body of 2147483648 bytes",
    "begin(); ask(); raw(struct.pack('<4sII', b'SBF1', 3, 0) + b'{x}')": "a frame's header is no JSON",
    "begin(); ask(); raw(struct.pack('<4sII', b'SBF1', 3000, 0) + b'[' * 3000)": "header is no JSON",
    "begin(); n = ask()['id']; raw(frame('nothing', n) * 2); ask()": "wrote more than one answer",
    "begin(); n = ask()['id']; say('nothing', n); ask(); say('nothing', n)": "has not the id of the question",
    "begin(); say('ready', ask()['id'])": "is a 'ready', not nothing or output",
    "begin(); say('nothing', ask()['id'], wrong=1)": "it has 'wrong', which is not known",
    "begin(); say('output', ask()['id'])": "there is no field 'scan_sensor'",
    "begin(); say('nothing', ask()['id'], took_ns=-5)": "'took_ns' is no count of nanoseconds",
    "begin(); say('error', ask()['id'], why='out of\\n paper')": "out of paper",
    "begin(); say('error', ask()['id'], why=['x'])": "it answered with an error and no reason",
    "begin(); ask(); sys.stdout.close(); os.close(1); time.sleep(60)": "closed its output before it answered",
    "say('description', ask()['id'], protocol='simbench-pipeline/1'); reset = ask()['id']; os.close(0); "
    "say('ready', reset); time.sleep(60)": "closed its input before it had read all of",
    "begin(); os.close(1); os.kill(os.getpid(), signal.SIGBUS)": "was ended by SIGBUS",
    "say('description', ask()['id'], protocol='other/2')": "it speaks 'other/2', not simbench-pipeline/1",
    "say('description', ask()['id'], protocol='simbench-pipeline/1', reads_images=3)": "'reads_images' is",
    "say('ready', ask()['id'])": "its answer to describe is a 'ready'",
    "while True: raw(b'SBF1')": "is no frame",
}  # fmt: skip


@pytest.mark.parametrize("body", PROGRAMS)
def test_a_program_that_breaks_the_protocol_is_told_how(
    captured: Captured, tmp_path: Path, body: str
) -> None:
    failed(run_case(program(tmp_path, body), captured, limits=SHORT), PROGRAMS[body])


def test_a_program_that_answers_too_few_times_is_out_of_time(captured: Captured, tmp_path: Path) -> None:
    name = program(tmp_path, "begin(); say('nothing', ask()['id']); time.sleep(60)")
    failed(run_case(name, captured, limits=SHORT), "message 1 (", "timeout")


def test_a_program_that_says_more_after_its_last_answer_fails(captured: Captured, tmp_path: Path) -> None:
    arrays = [
        {"name": name, "dtype": dtype, "shape": shape}
        for name, dtype, shape in (
            ("track_id", "i64", [0]), ("count", "i64", [0]), ("stamp_ns", "i64", [0]),
            ("position_ego_m", "f64", [0, 3]), ("inlier", "u8", [0]),
        )
    ]  # fmt: skip
    loop = f"""
begin()
while True:
    told = ask()
    if told["kind"] == "finish": break
    say("nothing", told["id"])
say("trajectories", told["id"], arrays={arrays})
"""
    good = run_case(program(tmp_path, loop), captured, limits=SHORT)
    assert good.status == "ok", good.why
    name = program(tmp_path, loop + "time.sleep(0.1); raw(b'thanks')")
    failed(run_case(name, captured, limits=SHORT), "more than one answer to a question")
