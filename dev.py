#!/usr/bin/env python3
"""One command sets up `.venv` and runs in it. Standard library only; read by any Python 3.8 or later.

    python3 dev.py demo [ARGS]    simbench demo ARGS
    python3 dev.py run CMD...     any command, in the environment (benchmarks: with the rivals)
    python3 dev.py test [ARGS]    pytest ARGS, on all cores
    python3 dev.py check          lock fingerprint, ruff, mypy, import contracts
    python3 dev.py lock [ARGS]    make the locks again; needs uv (ARGS for `uv pip compile`, e.g. --upgrade)

Every package is installed from `requirements.lock` with its hash checked, by uv where it is found, else by
pip: tools, and a Mesa to test `--images gl` with, from `requirements-dev.lock`; what benchmarks compare with
from `requirements-bench.lock`, for scripts under tests/benchmarks only. What is already installed is not
installed again.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

ROOT = os.path.dirname(os.path.abspath(__file__))
VENV = os.path.join(ROOT, ".venv")
PYTHON = os.path.join(VENV, "bin", "python")
STAMP = os.path.join(VENV, "simbench-installed.json")
UNFINISHED = os.path.join(VENV, "simbench-installing")
PYPROJECT = os.path.join(ROOT, "pyproject.toml")
RUN_LOCK = "requirements.lock"
DEV_LOCK = "requirements-dev.lock"
BENCH_LOCK = "requirements-bench.lock"
BENCHMARKS = os.path.join(ROOT, "tests", "benchmarks")
OLDEST, NEWEST = (3, 11), (3, 13)
FINGERPRINT = "# dependencies sha256: "
EXIT_USAGE, EXIT_SETUP = 2, 3


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def fail(text: str, code: int = EXIT_SETUP) -> SystemExit:
    say("dev.py: " + text)
    return SystemExit(code)


# -- the Python to use ----------------------------------------------------------------------------------


def supported(version: tuple[int, int]) -> bool:
    return OLDEST <= version <= NEWEST


def other_python() -> str | None:
    """A supported Python on PATH that runs and can make environments."""
    import shutil
    import subprocess

    for minor in range(NEWEST[1], OLDEST[1] - 1, -1):
        path = shutil.which("python3.%d" % minor)  # noqa: UP031  (short, and plain to old Pythons)
        if path and subprocess.run([path, "-c", "import ensurepip"], capture_output=True).returncode == 0:
            return path
    return None


def use_supported_python(arguments: Sequence[str]) -> None:
    """Goes on under a supported Python, or ends with one sentence."""
    if supported(sys.version_info[:2]):
        return
    found = other_python()
    if found is None:
        raise fail(
            f"needs Python {OLDEST[0]}.{OLDEST[1]} to {NEWEST[0]}.{NEWEST[1]}, and this is "
            f"{sys.version_info[0]}.{sys.version_info[1]}; none of the others is on PATH."
        )
    os.execv(found, [found, os.path.abspath(__file__), *arguments])


# -- the environment ------------------------------------------------------------------------------------


def digest(lock: str) -> str:
    """Changes when the lock, the project's table or the place of the checkout changes."""
    total = hashlib.sha256(ROOT.encode())
    for path in (PYPROJECT, os.path.join(ROOT, lock)):
        with open(path, "rb") as file:
            total.update(file.read())
    return total.hexdigest()


def installed() -> dict[str, str]:
    """Lock name -> digest at the time it was installed; empty where nothing is or an install was cut off."""
    if not os.path.exists(PYTHON) or os.path.exists(UNFINISHED):
        return {}
    try:
        with open(STAMP, encoding="utf-8") as file:
            return dict(json.load(file))
    except (FileNotFoundError, ValueError):
        return {}


def write_stamp(done: dict[str, str]) -> None:
    with open(STAMP + ".new", "w", encoding="utf-8") as file:
        json.dump(done, file)
    os.replace(STAMP + ".new", STAMP)


def installer() -> list[str]:
    """The command that installs, without arguments."""
    import shutil

    uv = shutil.which("uv")
    if uv:
        return [uv, "pip", "install", "--quiet", "--python", PYTHON]
    return [PYTHON, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]


def make_environment() -> None:
    """A `.venv` with an interpreter that runs (and pip, where uv is not there). A sound one is kept."""
    import shutil
    import subprocess

    uv = shutil.which("uv")
    if os.path.exists(PYTHON):
        pip = [PYTHON, "-m", "pip", "--version"]
        if uv or subprocess.run(pip, capture_output=True).returncode == 0:
            return
    if uv:
        subprocess.run(
            [uv, "venv", "--quiet", "--allow-existing", "--python", sys.executable, VENV], check=True
        )
        return
    try:
        import ensurepip  # noqa: F401
        import venv  # noqa: F401
    except ImportError:
        package = f"python{sys.version_info[0]}.{sys.version_info[1]}-venv"
        raise fail(
            "this Python cannot make an environment; install uv, or as root: "
            f"apt-get install --no-install-recommends {package}"
        ) from None
    subprocess.run([sys.executable, "-m", "venv", VENV], check=True)


def install(lock: str) -> None:
    """Installs one lock, and with the runtime lock the project itself, editable."""
    import subprocess

    command = installer()
    locked = ["--require-hashes", "--no-deps", "-r", os.path.join(ROOT, lock)]
    subprocess.run([*command, *locked], check=True, stdin=subprocess.DEVNULL)
    if lock == RUN_LOCK:
        project = ["--no-deps", "--no-build-isolation", "-e", ROOT]
        subprocess.run([*command, *project], check=True, stdin=subprocess.DEVNULL)


def set_up(locks: Sequence[str]) -> None:
    """Makes sure that the locks are installed. A few milliseconds where they are.

    One process installs at a time. While it does, `UNFINISHED` exists; a process that was killed leaves it,
    and the next one starts from an empty `.venv`, because a half-copied package looks installed.
    """
    wanted = {lock: digest(lock) for lock in locks}
    if wanted.items() <= installed().items():
        return
    import fcntl
    import shutil
    import subprocess

    folder = os.open(ROOT, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        done = installed()
        todo = [lock for lock in locks if done.get(lock) != wanted[lock]]
        if not todo:
            return
        say("setting up .venv from " + " and ".join(todo) + " (only when they changed) ...")
        broken = os.path.lexists(PYTHON) and not os.path.exists(PYTHON)
        if os.path.exists(UNFINISHED) or broken:
            shutil.rmtree(VENV)
        os.makedirs(VENV, exist_ok=True)
        with open(UNFINISHED, "w", encoding="utf-8"):
            pass
        write_stamp({lock: value for lock, value in done.items() if lock not in todo})
        try:
            make_environment()
            for lock in todo:
                install(lock)
        except subprocess.CalledProcessError as error:
            os.unlink(UNFINISHED)  # the installer ended by itself and left whole packages
            raise fail(
                f"setting up .venv failed; {os.path.basename(error.cmd[0])} says above why."
            ) from error
        write_stamp({**done, **{lock: wanted[lock] for lock in todo}})
        os.unlink(UNFINISHED)
    finally:
        os.close(folder)


def is_benchmark(command: Sequence[str]) -> bool:
    """Does the command name a file under tests/benchmarks?"""
    folder = os.path.realpath(BENCHMARKS) + os.sep
    return any(os.path.realpath(word).startswith(folder) and os.path.isfile(word) for word in command)


def set_up_rivals() -> None:
    """Installs what benchmarks compare with. Where that fails they go on without and say so themselves."""
    try:
        set_up((RUN_LOCK, BENCH_LOCK))
    except SystemExit:
        say("dev.py: going on without the rivals.")


def environment() -> dict[str, str]:
    """This process's variables, with `.venv` in front."""
    path = os.path.join(VENV, "bin") + os.pathsep + os.environ.get("PATH", os.defpath)
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONHOME"}
    return {**kept, "VIRTUAL_ENV": VENV, "PATH": path}


def become(command: Sequence[str]) -> None:
    """Runs the command in the environment, in place of this process."""
    variables = environment()
    try:
        os.execvpe(command[0], list(command), variables)
    except FileNotFoundError:
        raise fail(f"no command {command[0]!r} in .venv or on PATH.", EXIT_USAGE) from None


# -- locks ----------------------------------------------------------------------------------------------


def fingerprint() -> str:
    """SHA-256 of the tables of pyproject.toml that decide what is installed."""
    import tomllib

    with open(PYPROJECT, "rb") as file:
        tables = tomllib.load(file)
    project = tables["project"]
    deciding = {
        "build": tables["build-system"]["requires"],
        "dependencies": project["dependencies"],
        "groups": tables["dependency-groups"],
        "optional": project.get("optional-dependencies", {}),
        "python": project["requires-python"],
        "uv": tables["tool"]["uv"],
    }
    return hashlib.sha256(json.dumps(deciding, sort_keys=True).encode()).hexdigest()


def stale_locks() -> Iterator[str]:
    """A sentence for each lock whose first line is not the fingerprint of pyproject.toml."""
    expected = FINGERPRINT + fingerprint()
    for lock in (RUN_LOCK, DEV_LOCK, BENCH_LOCK):
        with open(os.path.join(ROOT, lock), encoding="utf-8") as file:
            if file.readline().rstrip("\n") != expected:
                yield f"{lock} was made from other dependencies than pyproject.toml names; run: dev.py lock"


def pinned(lock_text: str, *, marker: str = "") -> list[str]:
    """Names of the packages in a lock; with a marker, of those that only it lets in."""
    found = re.findall(r"^([A-Za-z0-9._-]+)==[^ ;]+(?: ; ([^\\\n]+?))? \\$", lock_text, re.MULTILINE)
    return sorted({name for name, condition in found if not marker or condition == marker})


def compile_lock(
    lock: str, group: str, arguments: Sequence[str], *, left_out: Sequence[str], earlier: Sequence[str]
) -> str:
    """The text of one lock. Pins of the lock that exists are kept where they still fit; what an earlier lock
    pins has the same version in this one, since all go to one `.venv`."""
    import shutil
    import subprocess

    uv = shutil.which("uv") or os.path.join(VENV, "bin", "uv")
    if not os.path.exists(uv):
        raise fail("making the locks needs uv, which is not on PATH.")
    command = [uv, "pip", "compile", "--quiet", "--universal", "--fork-strategy", "fewest"]
    command += ["--python-version", "{}.{}".format(*OLDEST), "--generate-hashes", "--no-emit-index-url"]
    command += ["--no-header", "--group", group, *arguments, "pyproject.toml"]
    for name in left_out:
        command += ["--no-emit-package", name]
    for other in earlier:
        command += ["--constraint", other]
    subprocess.run([*command, "--output-file", lock], check=True, cwd=ROOT)
    with open(os.path.join(ROOT, lock), encoding="utf-8") as file:
        return file.read().partition("\n# The following packages were excluded")[0] + "\n"


def lock_all(arguments: Sequence[str]) -> int:
    import subprocess

    head = f"{FINGERPRINT}{fingerprint()}\n# Made by `python3 dev.py lock` from pyproject.toml.\n"
    run_names: list[str] = []
    done: list[str] = []
    for lock, group in ((RUN_LOCK, "lock"), (DEV_LOCK, "dev"), (BENCH_LOCK, "bench")):
        try:
            text = compile_lock(lock, group, arguments, left_out=run_names, earlier=done)
            never = pinned(text, marker="sys_platform == 'never'")  # MuJoCo's viewers: see pyproject.toml
            text = compile_lock(lock, group, arguments, left_out=[*run_names, *never], earlier=done)
        except subprocess.CalledProcessError as error:
            raise fail("uv could not make " + lock + "; it says above why.") from error
        with open(os.path.join(ROOT, lock), "w", encoding="utf-8") as file:
            file.write(head + text)
        done.append(lock)
        run_names = run_names or [*pinned(text), *never]
    return 0


# -- commands -------------------------------------------------------------------------------------------


def check() -> int:
    """All checks that read the code; each is run, and the failing ones are named at the end."""
    import subprocess

    failed = list(stale_locks())
    set_up((RUN_LOCK, DEV_LOCK))
    tools = (
        ("ruff", "check", "."),
        ("ruff", "format", "--check", "."),
        ("mypy",),
        ("lint-imports", "--no-cache"),
    )
    for tool in tools:
        say("$ " + " ".join(tool))
        program = os.path.join(VENV, "bin", tool[0])
        if subprocess.run([program, *tool[1:]], cwd=ROOT, env=environment()).returncode != 0:
            failed.append("failed: " + " ".join(tool))
    for sentence in failed:
        say("dev.py check: " + sentence)
    return 1 if failed else 0


def pytest_command(arguments: Sequence[str]) -> list[str]:
    """pytest over all cores, unless the arguments choose the workers or ask for a debugger."""
    chosen = any(
        word.startswith(("-n", "--numprocesses", "--pdb")) or word == "no:xdist" for word in arguments
    )
    workers = [] if chosen else ["-n", "auto", "--dist", "loadfile", "--no-loadscope-reorder"]
    return [PYTHON, "-m", "pytest", *workers, *arguments]


def main(arguments: Sequence[str]) -> int:
    verb, rest = (arguments[0], list(arguments[1:])) if arguments else ("", [])
    if verb not in ("demo", "run", "test", "check", "lock") or (verb == "run" and not rest):
        say(str(__doc__))
        return 0 if verb in ("-h", "--help") else EXIT_USAGE
    use_supported_python(arguments)
    if verb == "lock":
        return lock_all(rest)
    if verb == "check":
        return check()
    if verb == "test":
        set_up((RUN_LOCK, DEV_LOCK))
        os.chdir(ROOT)
        become(pytest_command(rest))
    set_up((RUN_LOCK,))
    if verb == "run" and is_benchmark(rest):
        set_up_rivals()
    become([os.path.join(VENV, "bin", "simbench"), "demo", *rest] if verb == "demo" else rest)
    raise AssertionError("unreachable: become() replaces this process")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
