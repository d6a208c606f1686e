"""Which part of a data set a drive belongs to: train, val or test.

What is drawn together stays together: all recordings of one scenario and seed, whatever rig or error, are in
the same part. The part follows from name and seed alone, so that it stays when the set grows; shares are hit
as well as chance hits them.
"""

from __future__ import annotations

import hashlib
from itertools import accumulate

from scenarios.errors import BadInput

NAMES = ("train", "val", "test")
Shares = tuple[float, float, float]


def parse_shares(text: str) -> Shares:
    """Of `80,10,10`: percent of train, val and test. BadInput: not three numbers that make 100."""
    try:
        shares = tuple(float(part) for part in text.split(","))
    except ValueError:
        shares = ()
    if len(shares) != 3 or not all(0.0 <= s <= 100.0 for s in shares) or abs(sum(shares) - 100.0) > 1e-9:
        raise BadInput(
            f"--split: '{text}' is not three shares", allowed="percent of train, val, test, as 80,10,10"
        )
    return shares[0], shares[1], shares[2]


def part_of(scenario: str, seed: int, shares: Shares | None) -> str:
    """The part of a drive; '' without shares."""
    if shares is None:
        return ""
    digest = hashlib.sha256(f"{scenario}\n{seed}".encode()).digest()
    at = int.from_bytes(digest[:8], "big") / 2**64 * 100.0
    return next((name for name, end in zip(NAMES, accumulate(shares), strict=True) if at < end), NAMES[-1])
