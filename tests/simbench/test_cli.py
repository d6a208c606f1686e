"""The command line: fast help, examples that run, and bad input that costs one sentence and nothing else."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from unittest import mock

import click
import pytest
from click.testing import CliRunner, Result

from scenarios.fault_set import parse_fault_arguments
from scenarios.faults import FAULTS
from scenarios.load import load_scenario
from simbench.case import Job
from simbench.cli import main
from simbench.learn import resize
from simbench.reproduce.plan import Size
from simbench.stage import Stage, stage
from simbench.suite.side import write_side
from tests.simbench.cheats import named
from tests.simbench.reproduce.made_up import made_up_row
from tests.simbench.suite.sides import runs, side
from tests.simbench.support import staged, write_scenario

VERBS = sorted(main.commands)


def run(*words: str) -> Result:
    return CliRunner().invoke(main, words, prog_name="simbench")


def cut(job: Job) -> Stage:
    """A job of half a second with a coarse LiDAR and small pictures."""
    at = stage(job)
    coarse = staged(
        job.system, job.seed, scenario=job.scenario, duration_s=0.5, columns=128, size_px=(160, 100),
        background=True,
    )  # fmt: skip
    return replace(coarse, faults=at.faults)


@pytest.fixture
def short() -> Iterator[None]:
    with mock.patch("simbench.run.stage", cut):
        yield


# -- help and examples ------------------------------------------------------------------------------------


@pytest.mark.parametrize("words", [["--help"], ["run", "--help"]], ids=" ".join)
def test_help_is_there_at_once(words: list[str]) -> None:
    code = f"import sys; sys.argv = ['simbench', *{words!r}]; from simbench.cli import main; main()"
    spent = []
    for _ in range(5):
        begun = time.perf_counter()
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        spent.append(time.perf_counter() - begun)
        assert "Usage: simbench" in done.stdout
    print(f"simbench {' '.join(words)}: {min(spent):.2f} s at best")
    assert min(spent) < 1.0


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys; from simbench.cli import main\n"
        "try: main(['run', '--help'])\n"
        "except SystemExit: pass\n"
        "heavy = ('numpy', 'mujoco', 'numba', 'scipy', 'cv2', 'pydantic', 'yaml', 'rich', 'matplotlib')\n"
        "print('loaded:', *[name for name in heavy if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1].strip() == "loaded:"


def example(verb: str) -> list[str]:
    found = re.search(r"Example: simbench (.+)", main.commands[verb].help or "")
    assert found, f"'{verb}' has no example"
    return shlex.split(found.group(1))


def with_option(words: list[str], name: str, value: str) -> list[str]:
    """The words with an option set, whether they had it or not."""
    if name in words:
        at = words.index(name)
        return [*words[:at], name, value, *words[at + 2 :]]
    return [*words, name, value]


def option_names(command: click.Command) -> set[str]:
    return {name for parameter in command.params for name in parameter.opts}


# The example of check is the document's, which tests/simbench/checks/test_command.py runs.
@pytest.mark.parametrize("verb", [verb for verb in VERBS if verb != "check"])
def test_every_verb_has_an_example_that_runs(
    short: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, verb: str
) -> None:
    words = example(verb)
    if verb in ("baseline", "compare", "plan", "init"):  # these work in the user's folder
        monkeypatch.chdir(tmp_path)
        of_smoke = {"clean/overtake-approach/car/none/robust": runs([0.9, 0.8, 0.85])}
        (tmp_path / "out" / "run").mkdir(parents=True)
        for name in ("out/run/values.json", "baseline.json"):
            write_side(side(of_smoke, suite="smoke"), tmp_path / name, commands=True)
    if verb in ("verify", "view"):
        monkeypatch.chdir(tmp_path)
        made = ("--system", "car", "--seeds", "0", "--jobs", "1", "--set", "systems.car.duration_s=0.6")
        assert run("generate", "overtake-approach", *made, "--out", "out/generate").exit_code == 0
    assert words[0] == verb
    small = {"--seeds": "0", "--images": "none", "--jobs": "1", "--out": str(tmp_path / "out")}
    if verb == "learn":
        small |= {"--seeds": "100000", "--out": str(tmp_path / "shapes.json")}
    if verb == "calibrate":
        small |= {"--poses": "6", "--size": "480x300"}
    for name, value in small.items():
        if name in option_names(main.commands[verb]):
            words = with_option(words, name, value)

    def shortened(scenario: object, system: str, scale: float) -> object:
        changed = resize(scenario, system, scale)  # type: ignore[arg-type]
        systems = dict(changed.systems)
        systems[system] = systems[system].model_copy(update={"duration_s": 0.8})  # type: ignore[index]
        return changed.model_copy(update={"systems": systems})

    tiny = Size(
        name="quick",
        seeds=1,
        boards=1,
        variants=1,
        scenes=1,
        groups=1,
        map=1,
        strips=1,
        claims=1,
        fit_points=0,
    )
    with (
        mock.patch("simbench.reproduce.plan.QUICK", tiny),
        mock.patch("simbench.reproduce.campaign.row_of", made_up_row),
        mock.patch("simbench.learn.resize", shortened),
        mock.patch("simbench.learn.SCENARIOS", (("overtake-recede", "car"),)),
    ):
        done = run(*words)
    assert done.exit_code == 0, done.output
    assert done.exception is None


@pytest.mark.parametrize("verb", VERBS)
def test_the_help_of_every_verb_is_short_and_shows_its_options(verb: str) -> None:
    done = run(verb, "--help")
    assert done.exit_code == 0
    for name in option_names(main.commands[verb]):
        if name.startswith("--"):
            assert name in done.output


# -- bad input --------------------------------------------------------------------------------------------


@pytest.fixture
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


def refused(done: Result, *parts: str) -> None:
    assert done.exit_code == 2, (done.exit_code, done.output, done.exception)
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("simbench: "), line
    assert "Traceback" not in line
    for part in parts:
        assert part in line, line


OFFSET, NONE = "timing.trigger_offset_ms", ("--images", "none")
BAD_WORDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "scenario": (("overtake-aproach",), ("did you mean 'overtake-approach'?",)),
    "pipeline": (("overtake-approach", "--pipeline", "probabilistc"), ("did you mean 'probabilistic'?",)),
    "pipeline file": (("overtake-approach", "--pipeline", "mine.py:Mine"), ("there is no file", "mine.py")),
    "fault": (("overtake-approach", "--faults", "timing.triger_offset_ms=5"), (f"did you mean '{OFFSET}'?",)),
    "fault set": (("overtake-approach", "--faults", "dem"), ("did you mean 'demo'?",)),
    "field of a fault": (("overtake-approach", "--faults", "motion.flex_deg={rms: 1}"), ("'rms_deg'",)),
    "wrong type": (("overtake-approach", "--faults", f"{OFFSET}=fast"), ("must be a number", "'fast'")),
    "not a number": (("overtake-approach", "--faults", f"{OFFSET}=.nan"), ("not finite",)),
    "infinite": (("overtake-approach", "--faults", f"{OFFSET}=.inf"), ("not finite",)),
    "negative strength": (("overtake-approach", "--faults", "motion.flex_deg=-1"), ("rms_deg", "-1")),
    "no value": (("overtake-approach", "--faults", f"{OFFSET}="), ("needs a value",)),
    "camera": (
        ("overtake-approach", "--faults", f"{OFFSET}={{offset_ms: 5, sensors: [cam-frnt]}}"),
        ("did you mean 'cam-front'?",),
    ),
    "missing file": (("nowhere.yaml",), ("nowhere.yaml: no such file",)),
    "missing fault file": (("overtake-approach", "--faults", "nowhere.yaml"), ("no such file",)),
    "system": (("overtake-approach", "--system", "cr"), ("'cr'", "'car'")),
    "system that a scenario lacks": (
        ("static-board", "--system", "wearable"),
        ("'wearable'", "allowed: car"),
    ),
    "seeds": (("overtake-approach", "--seeds", "one"), ("--seeds", "'one'")),
    "seeds backwards": (("overtake-approach", "--seeds", "3-1"), ("--seeds", "'3-1'")),
    "seeds in superscript": (("overtake-approach", "--seeds", "²"), ("--seeds",)),
    "no seeds": (("overtake-approach", "--seeds", ""), ("--seeds",)),
    "a negative seed": (("overtake-approach", "--seeds", "-1"), ("--seeds",)),
    "a seed too large": (("overtake-approach", "--seeds", "9999999999999999999999"), ("seed",)),
    "size": (("overtake-approach", "--size", "960"), ("--size", "'960'")),
    "size zero": (("overtake-approach", "--size", "0x0"), ("--size", "'0x0'")),
    "jobs": (("overtake-approach", "--jobs", "0"), ("--jobs", "0")),
    "images": (("overtake-approach", "--images", "all"), ("--images", "'all'")),
    "option": (("overtake-approach", "--image", "none"), ("--images",)),
}


@pytest.mark.parametrize("which", BAD_WORDS)
def test_a_bad_word_is_one_sentence_and_nothing_is_written(empty_folder: Path, which: str) -> None:
    words, parts = BAD_WORDS[which]
    refused(run("run", *words, *([] if "--images" in words else NONE)), *parts)
    assert list(empty_folder.iterdir()) == []


def broken_scenario(change: Callable[[str], str]) -> str:
    """The text of a good scenario file with something wrong in it."""
    text = (Path(__file__).parents[2] / "scenarios/catalogue/overtake-approach.yaml").read_text("utf-8")
    changed = change(text)
    assert changed != text
    return changed


BAD_FILES: dict[str, tuple[Callable[[str], str], str]] = {
    "unknown key": (lambda t: t.replace("duration_s: 5.2", "duration: 5.2"), "did you mean 'duration_s'?"),
    "wrong type": (lambda t: t.replace("duration_s: 5.2", "duration_s: long"), "must be a number"),
    "not a number": (lambda t: t.replace("duration_s: 5.2", "duration_s: .nan"), "not finite"),
    "negative speed": (lambda t: t.replace("[12.25, 12.75]", "[-12.25, 12.75]"), "speed_mps"),
    "zero frames": (lambda t: t.replace("duration_s: 5.2", "duration_s: 0.01"), "duration_s"),
    "no duration": (lambda t: t.replace("duration_s: 5.2", "duration_s: 0"), "duration_s"),
    "an actor inside another": (
        lambda t: t.replace("[[28.5, {uniform: [-3.2, -2.8]}]]", "[[0.5, 0.1]]"),
        "rider",
    ),
    "target that is no actor": (lambda t: t.replace("target: rider", "target: ridr"), "'ridr'"),
    "no such rig": (lambda t: t.replace("car-six-cameras", "car-six-camera"), "'car-six-cameras'"),
    "unknown fault": (lambda t: t + "\nfaults: {timing.trigger_ofset_ms: 5}\n", OFFSET),
    "not YAML": (lambda t: t + "\n]", ""),
    "a key twice": (lambda t: t + "\nname: other\n", "name"),
}


@pytest.mark.parametrize("which", BAD_FILES)
def test_a_bad_file_is_one_sentence_with_file_and_line(empty_folder: Path, which: str) -> None:
    change, part = BAD_FILES[which]
    (empty_folder / "mine.yaml").write_text(broken_scenario(change), encoding="utf-8")
    refused(run("run", "mine.yaml", *NONE), "mine.yaml", part)
    assert [path.name for path in empty_folder.iterdir()] == ["mine.yaml"]


def test_an_output_that_cannot_be_written_is_refused_before_the_run(empty_folder: Path) -> None:
    (empty_folder / "file").write_text("", encoding="utf-8")
    for out in ("file", "file/below"):
        with mock.patch("simbench.campaign.jobs.run_jobs", side_effect=AssertionError("it ran")):
            done = run("run", "overtake-approach", "--seeds", "0", *NONE, "--out", out)
        refused(done, "cannot write to", out)
    assert [path.name for path in empty_folder.iterdir()] == ["file"]


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_is_refused(empty_folder: Path) -> None:
    empty_folder.chmod(0o500)
    refused(run("run", "overtake-approach", "--seeds", "0", *NONE, "--out", "out"), "cannot write to")


def test_learning_on_seeds_of_evaluation_is_refused(empty_folder: Path) -> None:
    refused(run("learn", "--seeds", "0", "--out", "shapes.json"), "seed 0 is for evaluation")
    assert list(empty_folder.iterdir()) == []


@pytest.mark.parametrize(
    "words", [("describe", "overtake-aproach"), ("list", "rig"), ("rum",), ("describe",)]
)
def test_other_verbs_refuse_bad_words_too(empty_folder: Path, words: tuple[str, ...]) -> None:
    refused(run(*words))


def test_nothing_selected_has_a_code_of_its_own(empty_folder: Path) -> None:
    done = run("run", "smoke", "-k", "nothing-like-it")
    assert done.exit_code == 5
    assert len(done.stderr.splitlines()) == 1 and "nothing selected" in done.stderr
    assert list(empty_folder.iterdir()) == []


# -- what commands give -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(FAULTS))
def test_describe_fault_tells_formula_fields_and_what_every_severity_is(name: str) -> None:
    done = run("describe", "fault", name)
    assert done.exit_code == 0 and done.output.startswith(name + "\n")
    assert "Unit:" in done.output and "Source:" in done.output
    for field in FAULTS[name].model_fields:
        assert f"\n  {field} = " in done.output
    for level in re.findall(rf"^  [1-5]  ({re.escape(name)}=.*)$", done.output, re.MULTILINE):
        assert len(parse_fault_arguments([level]).specs) == 1, "each is what --faults takes"


def test_an_unknown_fault_is_told_what_was_meant() -> None:
    done = run("describe", "fault", "timing.triger_offset_ms")
    assert done.exit_code == 2 and "did you mean 'timing.trigger_offset_ms'?" in done.stderr


@pytest.mark.parametrize("name", ["overtake-approach", "static-board", "empty-road"])
@pytest.mark.parametrize("seed", [0, 3])
def test_describe_prints_a_file_that_loads_to_the_same_scenario(tmp_path: Path, name: str, seed: int) -> None:
    done = run("describe", name, "--seed", str(seed))
    assert done.exit_code == 0
    path = tmp_path / f"{name}.yaml"
    path.write_text(done.stdout, encoding="utf-8")
    for other_seed in (0, 17):
        assert load_scenario(str(path)).resolve(other_seed) == load_scenario(name).resolve(seed)


@pytest.mark.parametrize("kind", ["scenarios", "rigs", "sensors", "faults", "pipelines", "metrics"])
def test_list_names_what_there_is(kind: str) -> None:
    done = run("list", kind)
    assert done.exit_code == 0
    assert len(done.stdout.splitlines()) >= 3
    assert all(line == line.rstrip() and line for line in done.stdout.splitlines())


def test_json_is_the_result_and_nothing_else_on_stdout(short: None, tmp_path: Path) -> None:
    words = ["run", "overtake-recede", "--system", "car", "--seeds", "0", "--jobs", "1", *NONE, "--json"]
    done = run(*words, "--pipeline", "static_projection", "--out", str(tmp_path / "out"))
    assert done.exit_code == 0, done.output
    content = json.loads(done.stdout)
    assert content == json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert "recordings to make" in done.stderr


@pytest.mark.parametrize(
    ("pipeline", "patch", "code"),
    [
        ("static_projection", None, 0),
        (named("Raises")[0], None, 1),
        ("static_projection", "simbench.run.receipts", 3),
    ],
)
def test_the_exit_code_is_that_of_the_worst_case(
    short: None, tmp_path: Path, pipeline: str, patch: str | None, code: int
) -> None:
    out = tmp_path / "out"
    words = ["run", "overtake-recede", "--system", "car", "--seeds", "0", "--jobs", "1", *NONE]
    with mock.patch(patch or "simbench.run.nothing", side_effect=RuntimeError("bug"), create=patch is None):
        done = run(*words, "--pipeline", pipeline, "--out", str(out))
    assert done.exit_code == code, done.output
    assert (out / "result.json").is_file() and (out / "report.html").is_file()


def test_a_run_compares_the_paper_with_ours_and_the_demo_stays_with_the_paper() -> None:
    planned: list[Job] = []
    papers = ("static_projection", "static_projection_ground", "probabilistic")
    with mock.patch("simbench.commands.run.execute", lambda jobs, *_: planned.extend(jobs)):
        assert run("run", "overtake-recede", "--seeds", "0").exit_code == 0
        assert {job.pipelines for job in planned} == {(*papers, "robust")}
        planned.clear()
        assert run("demo").exit_code == 0
        assert {job.pipelines for job in planned} == {papers}


def test_a_scenario_may_be_named_twice_without_counting_twice(short: None, tmp_path: Path) -> None:
    scenario = load_scenario("overtake-recede").resolve(0)
    path = str(write_scenario(tmp_path, scenario))
    planned: list[Job] = []
    with mock.patch("simbench.commands.run.execute", lambda jobs, *_: planned.extend(jobs)):
        assert run("run", path, path, "--system", "car", "--seeds", "0,0", *NONE).exit_code == 0
    assert len(planned) == 1
