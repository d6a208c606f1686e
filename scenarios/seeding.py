"""Random streams by name: the same seed and path give the same numbers, whatever else is drawn."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

LARGEST_SEED = 2**63 - 1


def stream(seed: int, *path: str | int) -> np.random.Generator:
    """The generator of `path` (words, e.g. "lidar", "noise") under `seed` (0 to 2^63 - 1).

    PCG64 over `SeedSequence(seed, spawn_key=SHA-256 of the words)`. The words are hashed with their lengths,
    so ("ab", "c") and ("a", "bc") differ; 1 and "1" are the same word. Adding a stream moves no other.
    ValueError: the seed is out of range or the path is empty.
    """
    import numpy as np

    if isinstance(seed, bool) or not 0 <= seed <= LARGEST_SEED:
        raise ValueError(f"a seed is a whole number from 0 to 2^63 - 1, not {seed!r}")
    if not path:
        raise ValueError("a stream needs a path of at least one word")
    digest = hashlib.sha256()
    for word in path:
        data = str(word).encode()
        digest.update(len(data).to_bytes(8, "little") + data)
    key = digest.digest()
    spawn_key = tuple(int.from_bytes(key[i : i + 4], "little") for i in range(0, len(key), 4))
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(int(seed), spawn_key=spawn_key)))


def seed_list(text: str) -> tuple[int, ...]:
    """The seeds that a list like 0-3 or 0,2,5 names. ValueError: it is none."""
    found: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        numbers = (first, last) if dash else (first,)
        if not all(word.isascii() and word.isdigit() and len(word) < 19 for word in numbers):
            raise ValueError(f"'{text}' is not a list of seeds; allowed: 0-3 or 0,2,5")
        low, high = int(first), int(last) if dash else int(first)
        if high < low or high - low >= 100_000:
            raise ValueError(f"'{part}' is not a range of seeds from low to high")
        found += [seed for seed in range(low, high + 1) if seed not in found]
    return tuple(found)
