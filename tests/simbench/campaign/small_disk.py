"""A campaign on a disk that fills up.

    python -m tests.simbench.campaign.small_disk FOLDER limit|tmpfs

limit: no file may grow above 300 kB. tmpfs: the ledger is made on 600 kB of memory, mounted for this process,
and copied to FOLDER in the end. Exit code 77: nothing may be mounted.
"""

from __future__ import annotations

import ctypes
import os
import resource
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path

from scenarios.errors import BadInput
from simbench.campaign.ledger import Done, Ledger
from simbench.campaign.local import Here
from simbench.campaign.run import campaign
from simbench.files import write_artifact
from tests.simbench.campaign.tasks import ABOUT, key_of, tiny

LIMIT_BYTES, DISK_BYTES = 300_000, 600_000
CLONE_NEWNS, CLONE_NEWUSER, MS_PRIVATE, MS_REC = 0x20000, 0x10000000, 1 << 18, 1 << 14


def long(number: int) -> str:
    """A row of 2 kB."""
    return tiny(number) + " " * 2000


def on(folder: Path, numbers: Iterable[int]) -> list[Done]:
    """Go on in a folder."""
    with Ledger(folder, ABOUT) as ledger:
        return list(campaign(long, numbers, key_of, Here(), ledger))


def _mounted(place: Path) -> bool:
    """A small tmpfs at a place, for this process only."""
    libc = ctypes.CDLL(None, use_errno=True)
    if os.geteuid() != 0 and libc.unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0:
        return False
    if os.geteuid() == 0 and libc.unshare(CLONE_NEWNS) != 0:
        return False
    libc.mount(b"none", b"/", None, MS_REC | MS_PRIVATE, None)
    size = f"size={DISK_BYTES}".encode()
    return bool(libc.mount(b"tmpfs", os.fsencode(place), b"tmpfs", 0, size) == 0)


def main(folder: str, what: str) -> int:
    """The exit code of a command."""
    place = Path(folder)
    if what == "tmpfs":
        place = Path(folder) / "small"
        place.mkdir()
        if not _mounted(place):
            return 77
    else:
        resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT_BYTES, resource.RLIM_INFINITY))
    code = 0
    try:
        on(place, range(3000))
    except BadInput as error:
        print(f"simbench: {error}", file=sys.stderr)
        code = 2
    try:
        write_artifact(place / "page.html", b"x" * 2 * DISK_BYTES)
    except BadInput as error:
        left = [path.name for path in place.iterdir() if "page" in path.name]
        print(f"artifact: {error} {left or 'nothing is left of it'}")
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    if what == "tmpfs":
        for path in place.glob("ledger.sqlite*"):
            shutil.copy(path, folder)
    with Ledger(Path(folder), ABOUT) as ledger:
        print(f"kept: {len(ledger)}")
    return code


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
