"""Works of campaigns, as workers import them; the driver of a campaign as a program of its own.

python -m tests.simbench.campaign.tasks FOLDER COUNT WORKERS [CLUSTER]
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from pathlib import Path

from scenarios.load import load_scenario
from simbench.campaign.executor import open_executor
from simbench.campaign.key import task_key
from simbench.campaign.ledger import Ledger
from simbench.campaign.lock import only_one
from simbench.campaign.run import campaign
from simbench.case import Job

ABOUT = {"campaign": "tiny"}


def tiny(number: int) -> str:
    """A row that says all about itself."""
    return json.dumps({"number": number, "square": number * number, "text": "x" * (number % 7)})


def slow(number: int) -> str:
    """The same, in 50 ms."""
    time.sleep(0.05)
    return tiny(number)


def key_of(number: int) -> str:
    return task_key(case={"number": number}, config={}, code="a test's")


def word_key(task: tuple[str, str]) -> str:
    return task_key(case={"task": list(task)}, config={}, code="a test's")


def odd(task: tuple[str, str]) -> str:
    """What a task does is its first word; the second is an argument of it."""
    what, word = task
    match what:
        case "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        case "exit":
            os._exit(int(word))
        case "hang":
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            time.sleep(600)
        case "hang on":
            time.sleep(600)
        case "raise":
            raise KeyError(word)
        case "leave":
            sys.exit(word)
        case "kill once":
            if not Path(word).exists():
                Path(word).touch()
                os.kill(os.getpid(), signal.SIGKILL)
        case "tell":
            Path(word).write_text(str(os.getpid()), encoding="utf-8")
            time.sleep(600 if not Path(word + ".go").exists() else 0)
        case "bad input":
            load_scenario(word)
        case "number":
            return 3  # type: ignore[return-value]
    return json.dumps(task)


def drive(job: Job) -> str:
    """The rows of a real recording, all pipelines."""
    from simbench.result_file import document
    from simbench.results import record_of
    from simbench.run import run_job

    content = document([record_of(run_job(job))], {})
    return json.dumps({name: content[name] for name in ("rows", "cases")}, allow_nan=False)


def main(folder: str, count: str, workers: str, cluster: str | None = None) -> None:
    """All tiny tasks of a folder, one line for each as it is kept."""
    place = Path(folder)
    with only_one(place), Ledger(place, ABOUT) as ledger, open_executor(int(workers), cluster) as executor:
        print("ready", flush=True)
        told = campaign(
            tiny, range(int(count)), key_of, executor, ledger, lambda done: print(done.key, flush=True)
        )
        for _ in told:
            pass


if __name__ == "__main__":
    main(*sys.argv[1:])
