"""Writes an answer: CSV tables for now."""

from __future__ import annotations

from pathlib import Path

from simbench.reproduce.answer import Answer
from simbench.reproduce.campaign import Found


def write_answer(told: Answer, found: Found, out: Path) -> Path:
    """The page's path."""
    return out / "result.json"
