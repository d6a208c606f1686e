"""Streams by name: equal paths agree, different paths are independent, and the numbers never change."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.seeding import stream

SEEDS = st.integers(0, 2**63 - 1)
PATHS = st.lists(st.text(max_size=6), min_size=1, max_size=4).map(tuple)


@given(seed=SEEDS, path=PATHS)
def test_the_same_seed_and_path_give_the_same_numbers(seed: int, path: tuple[str, ...]) -> None:
    assert np.array_equal(stream(seed, *path).random(4), stream(seed, *path).random(4))


@given(seed=SEEDS, a=PATHS, b=PATHS)
def test_different_paths_give_different_numbers(seed: int, a: tuple[str, ...], b: tuple[str, ...]) -> None:
    same = bool(np.array_equal(stream(seed, *a).random(4), stream(seed, *b).random(4)))
    assert same == (a == b)


@given(seed=SEEDS.filter(lambda s: s > 0), path=PATHS)
def test_different_seeds_give_different_numbers(seed: int, path: tuple[str, ...]) -> None:
    assert not np.array_equal(stream(seed, *path).random(4), stream(seed - 1, *path).random(4))


def test_words_are_not_run_together() -> None:
    assert stream(1, "ab", "c").random() != stream(1, "a", "bc").random()
    assert stream(1, "a", "").random() != stream(1, "a").random()
    assert stream(1, "a", 2).random() == stream(1, "a", "2").random()


def test_the_stream_is_pcg64_spawned_by_the_sha256_of_the_words() -> None:
    digest = hashlib.sha256(b"\x05\0\0\0\0\0\0\0lidar\x05\0\0\0\0\0\0\0noise").digest()
    key = tuple(np.frombuffer(digest, "<u4").tolist())
    oracle = np.random.Generator(np.random.PCG64(np.random.SeedSequence(7, spawn_key=key)))
    assert np.array_equal(stream(7, "lidar", "noise").random(8), oracle.random(8))


@pytest.mark.parametrize("seed", [-1, 2**63, True])
def test_a_seed_out_of_range_is_refused(seed: int) -> None:
    with pytest.raises(ValueError, match="seed"):
        stream(seed, "x")


def test_a_path_without_words_is_refused() -> None:
    with pytest.raises(ValueError, match="path"):
        stream(1)
