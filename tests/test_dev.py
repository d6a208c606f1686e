"""dev.py: what is installed is not installed again, what was cut off is, and bad luck is one sentence."""

from __future__ import annotations

import ast
import importlib.util
import json
import os
import re
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import given
from hypothesis import strategies as st

ROOT = Path(__file__).resolve().parents[1]
LOCKS = ("requirements.lock", "requirements-dev.lock", "requirements-bench.lock")


def load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("dev_under_test", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout with what dev.py reads, and nothing installed."""
    for name in ("dev.py", "pyproject.toml", *LOCKS):
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    return tmp_path


@pytest.fixture
def dev(checkout: Path) -> ModuleType:
    return load(checkout / "dev.py")


class Installer:
    """Stands in for what makes and fills `.venv`; remembers which locks it was asked for."""

    def __init__(self, dev: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
        self.dev, self.asked, self.error = dev, list[str](), None
        self.error: BaseException | None = None
        monkeypatch.setattr(dev, "make_environment", self.make)
        monkeypatch.setattr(dev, "install", self.install)

    def make(self) -> None:
        python = Path(self.dev.PYTHON)
        python.parent.mkdir(parents=True, exist_ok=True)
        python.touch()

    def install(self, lock: str) -> None:
        assert self.dev.installed() == {}, "while it is filled, .venv does not count as installed"
        self.asked.append(lock)
        if self.error is not None:
            raise self.error


@pytest.fixture
def installer(dev: ModuleType, monkeypatch: pytest.MonkeyPatch) -> Installer:
    return Installer(dev, monkeypatch)


# -- what is installed when -------------------------------------------------------------------------------


def test_a_second_call_installs_nothing(dev: ModuleType, installer: Installer) -> None:
    for _ in range(2):
        dev.set_up([dev.RUN_LOCK])
    assert installer.asked == [dev.RUN_LOCK]


def test_test_tools_come_on_top_only_when_asked_for(dev: ModuleType, installer: Installer) -> None:
    dev.set_up([dev.RUN_LOCK])
    dev.set_up([dev.RUN_LOCK, dev.DEV_LOCK])
    dev.set_up([dev.RUN_LOCK])
    assert installer.asked == [dev.RUN_LOCK, dev.DEV_LOCK]


@pytest.mark.parametrize("name", ["requirements.lock", "pyproject.toml"])
def test_a_change_of_lock_or_project_installs_again(
    dev: ModuleType, installer: Installer, checkout: Path, name: str
) -> None:
    dev.set_up([dev.RUN_LOCK])
    with (checkout / name).open("a") as file:
        file.write("# changed\n")
    dev.set_up([dev.RUN_LOCK])
    assert installer.asked == [dev.RUN_LOCK] * 2


def test_an_environment_copied_to_another_place_is_installed_again(
    dev: ModuleType, installer: Installer, monkeypatch: pytest.MonkeyPatch
) -> None:
    dev.set_up([dev.RUN_LOCK])
    monkeypatch.setattr(dev, "ROOT", dev.ROOT + "/.")
    dev.set_up([dev.RUN_LOCK])
    assert installer.asked == [dev.RUN_LOCK] * 2


def test_an_install_that_was_killed_starts_from_an_empty_environment(
    dev: ModuleType, installer: Installer
) -> None:
    dev.set_up([dev.RUN_LOCK])
    half = Path(dev.VENV, "half-a-package")
    half.touch()
    installer.error = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        dev.set_up([dev.RUN_LOCK, dev.DEV_LOCK])
    assert dev.installed() == {}
    installer.error = None
    dev.set_up([dev.RUN_LOCK])
    assert installer.asked == [dev.RUN_LOCK, dev.DEV_LOCK, dev.RUN_LOCK]
    assert not half.exists()


def test_an_installer_that_fails_leaves_no_stamp_but_keeps_what_is_there(
    dev: ModuleType, installer: Installer, capsys: pytest.CaptureFixture[str]
) -> None:
    dev.set_up([dev.RUN_LOCK])
    kept = Path(dev.VENV, "kept")
    kept.touch()
    installer.error = subprocess.CalledProcessError(1, ["/usr/bin/pip"])
    with pytest.raises(SystemExit) as caught:
        dev.set_up([dev.RUN_LOCK, dev.DEV_LOCK])
    assert caught.value.code == dev.EXIT_SETUP
    assert "pip says above why" in capsys.readouterr().err
    assert set(dev.installed()) == {dev.RUN_LOCK}
    assert kept.exists()


def test_a_stamp_that_is_not_readable_counts_as_nothing_installed(
    dev: ModuleType, installer: Installer
) -> None:
    dev.set_up([dev.RUN_LOCK])
    Path(dev.STAMP).write_text("{")
    assert dev.installed() == {}


def test_an_environment_whose_python_is_gone_is_made_again(dev: ModuleType, installer: Installer) -> None:
    dev.set_up([dev.RUN_LOCK])
    Path(dev.PYTHON).unlink()
    Path(dev.PYTHON).symlink_to("/no/such/python")
    dev.set_up([dev.RUN_LOCK])
    assert installer.asked == [dev.RUN_LOCK] * 2
    assert not os.path.islink(dev.PYTHON)


def test_a_second_process_waits_and_then_finds_all_installed(checkout: Path) -> None:
    program = """
import os, pathlib, sys, time
sys.path.insert(0, sys.argv[1])
import dev
def make():
    path = pathlib.Path(dev.PYTHON); path.parent.mkdir(parents=True, exist_ok=True); path.touch()
def install(lock):
    time.sleep(0.5); print("installed")
dev.make_environment, dev.install = make, install
dev.set_up([dev.RUN_LOCK])
"""
    command = [sys.executable, "-c", program, str(checkout)]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    assert sorted(process.communicate()[0] for process in both) == ["", "installed\n"]


def test_installing_checks_hashes_and_resolves_nothing(
    dev: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    commands: list[list[str]] = []
    monkeypatch.setattr(subprocess, "run", lambda command, **_: commands.append(command))
    dev.install(dev.RUN_LOCK)
    dev.install(dev.DEV_LOCK)
    packages, project, tools = commands
    for command in (packages, tools):
        assert {"--require-hashes", "--no-deps"} <= set(command)
    assert project[-4:] == ["--no-deps", "--no-build-isolation", "-e", dev.ROOT]


# -- commands ---------------------------------------------------------------------------------------------


def test_the_second_call_costs_less_than_300_ms(
    dev: ModuleType, installer: Installer, checkout: Path
) -> None:
    dev.set_up([dev.RUN_LOCK])
    Path(dev.PYTHON).unlink()
    Path(dev.PYTHON).symlink_to(sys.executable)
    walls = []
    for _ in range(3):
        started = time.perf_counter()
        subprocess.run([sys.executable, checkout / "dev.py", "run", "true"], check=True)
        walls.append(time.perf_counter() - started)
    assert min(walls) < 0.3, walls


def test_run_puts_the_environment_first_and_keeps_the_exit_status(
    dev: ModuleType, installer: Installer, checkout: Path
) -> None:
    dev.set_up([dev.RUN_LOCK])
    script = "echo $VIRTUAL_ENV; echo $PATH; exit 7"
    done = subprocess.run(
        [sys.executable, checkout / "dev.py", "run", "sh", "-c", script], capture_output=True, text=True
    )
    virtual_env, path = done.stdout.split("\n")[:2]
    assert (done.returncode, virtual_env) == (7, dev.VENV)
    assert path.startswith(f"{dev.VENV}/bin:")


def benchmark(checkout: Path) -> Path:
    """A script under tests/benchmarks that says whether it was started."""
    script = checkout / "tests" / "benchmarks" / "sensors.sh"
    script.parent.mkdir(parents=True)
    script.write_text("echo started $1\n")
    return script


@pytest.mark.parametrize(
    ("words", "with_rivals"),
    [
        (["sh", "tests/benchmarks/sensors.sh", "--json"], True),
        (["sh", "./tests/../tests/benchmarks/sensors.sh"], True),
        (["python", "-m", "pytest"], False),
        (["ls", "tests/benchmarks"], False),
        (["sh", "tests/benchmarks/missing.sh"], False),
        (["sh", "sensors.sh"], False),
    ],
)
def test_only_scripts_of_the_benchmarks_get_the_rivals(
    dev: ModuleType,
    installer: Installer,
    checkout: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: list[str],
    with_rivals: bool,
) -> None:
    benchmark(checkout)
    monkeypatch.chdir(checkout)
    became: list[list[str]] = []
    monkeypatch.setattr(dev, "become", lambda command: became.append(list(command)))
    with pytest.raises(AssertionError, match="unreachable"):
        dev.main(["run", *words])
    assert installer.asked == [dev.RUN_LOCK, *([dev.BENCH_LOCK] if with_rivals else [])]
    assert became == [words]


def test_a_benchmark_is_recognised_from_any_folder(
    dev: ModuleType, checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = benchmark(checkout)
    monkeypatch.chdir(script.parent)
    assert dev.is_benchmark(["sh", script.name])
    monkeypatch.chdir("/")
    assert dev.is_benchmark(["sh", str(script)])


def test_a_benchmark_goes_on_where_the_rivals_cannot_be_installed(
    dev: ModuleType,
    installer: Installer,
    checkout: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    script = benchmark(checkout)
    dev.set_up([dev.RUN_LOCK])
    installer.error = subprocess.CalledProcessError(1, ["/usr/bin/pip"])
    became: list[list[str]] = []
    monkeypatch.setattr(dev, "become", lambda command: became.append(list(command)))
    with pytest.raises(AssertionError, match="unreachable"):
        dev.main(["run", "sh", str(script)])
    assert became == [["sh", str(script)]]
    assert "without the rivals" in capsys.readouterr().err
    assert set(dev.installed()) == {dev.RUN_LOCK}


@pytest.mark.parametrize("arguments", [[], ["run"], ["dmeo"]])
def test_a_wrong_command_prints_the_help_and_installs_nothing(checkout: Path, arguments: list[str]) -> None:
    done = subprocess.run([sys.executable, checkout / "dev.py", *arguments], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert "python3 dev.py demo" in done.stderr
    assert not (checkout / ".venv").exists()


def test_a_command_that_does_not_exist_is_one_sentence(
    dev: ModuleType, installer: Installer, checkout: Path
) -> None:
    dev.set_up([dev.RUN_LOCK])
    command = [sys.executable, checkout / "dev.py", "run", "no-such-command"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)


@pytest.mark.parametrize(
    ("arguments", "own"),
    [([], True), (["tests/x.py", "-k", "a"], True), (["-n0"], False), (["-p", "no:xdist"], False)],
)
def test_tests_run_on_all_cores_unless_told_otherwise(
    dev: ModuleType, arguments: list[str], own: bool
) -> None:
    command = dev.pytest_command(arguments)
    assert ("auto" in command) == own
    assert command[len(command) - len(arguments) :] == arguments


# -- the Python that runs it ------------------------------------------------------------------------------


def test_python_3_8_can_read_it() -> None:
    ast.parse((ROOT / "dev.py").read_text(encoding="utf-8"), feature_version=(3, 8))


@given(st.tuples(st.integers(2, 4), st.integers(0, 30)))
def test_python_3_11_to_3_13_are_supported_and_no_other(version: tuple[int, int]) -> None:
    assert load(ROOT / "dev.py").supported(version) == (version in {(3, 11), (3, 12), (3, 13)})


@pytest.mark.parametrize("version", [(3, 8, 10), (3, 10, 0), (3, 14, 0)])
def test_an_unsupported_python_is_one_sentence(
    dev: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    version: tuple[int, int, int],
) -> None:
    monkeypatch.setattr(sys, "version_info", version)
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(SystemExit) as caught:
        dev.use_supported_python(["demo"])
    printed = capsys.readouterr().err
    assert caught.value.code == dev.EXIT_SETUP
    assert printed.count("\n") == 1
    assert f"needs Python 3.11 to 3.13, and this is 3.{version[1]}" in printed


def test_under_an_unsupported_python_it_goes_on_under_one_that_is_on_path(
    dev: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "python3.13").write_text("#!/bin/sh\nexit 1\n")  # there, but does not run
    (folder / "python3.12").write_text("#!/bin/sh\nexit 0\n")
    for path in folder.iterdir():
        path.chmod(0o755)
    monkeypatch.setattr(sys, "version_info", (3, 9, 2))
    monkeypatch.setenv("PATH", str(folder))
    became: list[list[str]] = []
    monkeypatch.setattr(os, "execv", lambda path, arguments: became.append([path, *arguments]))
    dev.use_supported_python(["demo", "--seeds", "3"])
    python = str(folder / "python3.12")
    assert became == [[python, python, str(tmp_path / "dev.py"), "demo", "--seeds", "3"]]


def test_a_python_without_venv_is_told_which_package_to_install(
    dev: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.setitem(sys.modules, "ensurepip", None)
    with pytest.raises(SystemExit) as caught:
        dev.make_environment()
    printed = capsys.readouterr().err
    assert caught.value.code == dev.EXIT_SETUP
    assert printed.count("\n") == 1
    assert f"apt-get install --no-install-recommends python3.{sys.version_info[1]}-venv" in printed


# -- locks ------------------------------------------------------------------------------------------------


def test_the_locks_fit_to_pyproject(dev: ModuleType) -> None:
    assert list(dev.stale_locks()) == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"numpy>=2', '"numpy>=1'),
        ('requires-python = ">=3.11', 'requires-python = ">=3.12'),
        ('"ruff>=', '"ruff>'),
        ('"editables>=', '"editables>'),
        ("glfw; sys_platform", "glfw; os_name"),
        ('"embreex>=', '"embreex>'),
        ('"lavavu-osmesa>=', '"lavavu-osmesa>'),
    ],
)
def test_a_change_of_dependencies_makes_all_locks_stale(
    dev: ModuleType, checkout: Path, old: str, new: str
) -> None:
    text = (checkout / "pyproject.toml").read_text()
    assert old in text
    (checkout / "pyproject.toml").write_text(text.replace(old, new))
    assert [sentence.split()[0] for sentence in dev.stale_locks()] == list(LOCKS)


def test_a_change_elsewhere_leaves_the_locks_fresh(dev: ModuleType, checkout: Path) -> None:
    text = (checkout / "pyproject.toml").read_text()
    (checkout / "pyproject.toml").write_text(text.replace("line-length = 110", "line-length = 100"))
    assert list(dev.stale_locks()) == []


@pytest.mark.parametrize("name", LOCKS)
def test_every_pin_has_hashes_and_no_host_is_named(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    assert not re.search(r"://|--(extra-)?index-url|--find-links|@ ", text)
    blocks = re.split(r"^(?=[A-Za-z0-9])", text, flags=re.MULTILINE)[1:]
    assert len(blocks) >= 3
    for block in blocks:
        assert re.match(r"[A-Za-z0-9._-]+==\S+", block), block
        assert "--hash=sha256:" in block, block


def test_the_locks_hold_what_pyproject_asks_for_and_not_the_same_package_twice(dev: ModuleType) -> None:
    tables = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))

    def names(requirements: list[str | dict[str, str]]) -> set[str]:
        found = (text for text in requirements if isinstance(text, str))
        return {re.split(r"[^A-Za-z0-9._-]", text)[0].lower() for text in found}

    run, tools, rivals = (set(dev.pinned((ROOT / lock).read_text())) for lock in LOCKS)
    groups = tables["dependency-groups"]
    assert names(tables["project"]["dependencies"]) | names(groups["lock"]) <= run
    assert names(groups["dev"]) <= tools
    assert names(groups["bench"]) <= rivals
    assert not run & tools and not run & rivals
    assert not {"pynput", "taichi", "torch", "jax"} & rivals, "heavy, and not on the way that is measured"
    assert not {"glfw", "mujoco-studio", "aiohttp", "jupyter-server-proxy"} & (run | tools | rivals)


def pin(lock: str, package: str) -> str:
    """The line of a package in a lock, with its version and hashes; empty where it has none."""
    found = re.search(rf"^{package}==.*\n(?: +--hash.*\n)+", (ROOT / lock).read_text(), re.MULTILINE)
    return found[0].replace(" \\\n", "\n") if found else ""


def test_the_mesa_wheel_comes_with_the_tools_and_the_rivals_but_never_with_the_demo(dev: ModuleType) -> None:
    wheel = "lavavu-osmesa"
    assert not pin(dev.RUN_LOCK, wheel)
    assert pin(dev.DEV_LOCK, wheel) == pin(dev.BENCH_LOCK, wheel) != ""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = [project["dependencies"], *project.get("optional-dependencies", {}).values()]
    assert "osmesa" not in str(asked), "pip would pull Jupyter with it"


def test_pins_under_a_marker_are_told_apart(dev: ModuleType) -> None:
    text = (
        "a==1 \\\n    --hash=sha256:0\nb-c==2.0 ; sys_platform == 'never' \\\n    --hash=sha256:1\n# via a\n"
    )
    assert dev.pinned(text) == ["a", "b-c"]
    assert dev.pinned(text, marker="sys_platform == 'never'") == ["b-c"]


def test_the_stamp_is_json_of_lock_names(dev: ModuleType, installer: Installer) -> None:
    dev.set_up([dev.RUN_LOCK])
    assert json.loads(Path(dev.STAMP).read_text()) == {dev.RUN_LOCK: dev.digest(dev.RUN_LOCK)}
