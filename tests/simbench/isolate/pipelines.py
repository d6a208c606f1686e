"""Pipelines for the tests of isolation, as text: the test writes them where a user would."""

from __future__ import annotations

from pathlib import Path

BASE = """
import ctypes, os, signal, subprocess, sys, time
import numpy as np
from fusion.messages import FusionOutput, LidarScan, LocalizedObject, Trajectory


class Base:
    reads_images = False

    def reset(self, calibration, categories):
        self.scans = []

    def update(self, message):
        if not isinstance(message, LidarScan):
            return None
        self.scans.append(message)
        return self.answer(message)

    def answer(self, scan):
        return FusionOutput(scan_sensor=scan.sensor, scan_seq=scan.seq, objects=())

    def found(self, scan, **changes):
        values = dict(
            track_id=1, category="car", sensor="front", stamp_ns=scan.stamp_ns, points=np.arange(2),
            position_ego_m=np.array([5.0, 0.0, 0.0]), distance_m=5.0, azimuth_rad=0.0, confidence=1.0,
        )
        one = LocalizedObject(**(values | changes))
        return FusionOutput(scan_sensor=scan.sensor, scan_seq=scan.seq, objects=(one,))

    def trajectories(self):
        return ()

"""


def write(folder: Path, body: str, *, name: str = "mine.py", before: str = "") -> str:
    """A file with a pipeline `Mine`, whose methods are `body`; its reference."""
    lines = "\n".join("    " + line for line in body.strip("\n").splitlines())
    (folder / name).write_text(f"{before}\n{BASE}\nclass Mine(Base):\n{lines}\n", encoding="utf-8")
    return f"{folder / name}:Mine"


def program(folder: Path, body: str) -> str:
    """A program of its own that does `body`: `ask()` reads a question, `say(kind, id, **fields)` answers."""
    (folder / "program.py").write_text(PROGRAM + body, encoding="utf-8")
    return f"exec:python3 {folder / 'program.py'}"


PROGRAM = """
import json, os, signal, struct, sys, time

def ask():
    head = sys.stdin.buffer.read(12)
    if not head:
        sys.exit(0)
    _, header, body = struct.unpack("<4sII", head)
    fields = json.loads(sys.stdin.buffer.read(header))
    sys.stdin.buffer.read(body)
    return fields

def frame(kind, number, **fields):
    text = json.dumps({"kind": kind, "id": number, **fields}).encode()
    return struct.pack("<4sII", b"SBF1", len(text), 0) + text

def raw(data):
    sys.stdout.buffer.write(data)
    sys.stdout.buffer.flush()

def say(kind, number, **fields):
    raw(frame(kind, number, **fields))

def begin():
    say("description", ask()["id"], protocol="simbench-pipeline/1")
    say("ready", ask()["id"])

"""
