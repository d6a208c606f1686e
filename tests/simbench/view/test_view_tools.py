"""Rerun where it is installed; and the page in a browser, where there is one."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest
from click.testing import CliRunner, Result

from simbench.cli import main
from simbench.formats.store import Stored
from simbench.view.page import page_of
from tests.simbench.view.viewed import scans, with_pictures

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def run(*words: str) -> Result:
    return CliRunner().invoke(main, ["view", *words], prog_name="simbench")


# -- which tool ---------------------------------------------------------------------------------------------


def test_without_rerun_it_is_the_page_and_asking_for_rerun_says_how_to_get_it(
    folder: Path, tmp_path: Path
) -> None:
    with mock.patch("simbench.view.rerun_log.version", side_effect=PackageNotFoundError):
        done = run(str(folder), "--out", str(tmp_path / "page"))
        assert done.exit_code == 0 and "open it in a browser" in done.stdout
        done = run(str(folder), "--tool", "rerun", "--out", str(tmp_path / "rerun"))
    assert [path.name for path in (tmp_path / "page").iterdir()] == ["recording.html"]
    assert done.exit_code == 2 and len(done.stderr.splitlines()) == 1
    assert "pip install 'simbench[view]'" in done.stderr and not (tmp_path / "rerun").exists()


def test_with_rerun_it_is_rerun_unless_the_page_is_asked_for(folder: Path, tmp_path: Path) -> None:
    def write(_: Stored, path: Path) -> None:
        path.write_bytes(b"RRF2")

    with (
        mock.patch("simbench.view.rerun_log.version", return_value="0.41"),
        mock.patch("simbench.view.rerun_log.write_rerun", write),
    ):
        done = run(str(folder), "--out", str(tmp_path / "a"))
        assert done.exit_code == 0 and "open it with: rerun " in done.stdout
        assert run(str(folder), "--tool", "page", "--out", str(tmp_path / "b")).exit_code == 0
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["recording.rrd"]
    assert [path.name for path in (tmp_path / "b").iterdir()] == ["recording.html"]


def test_a_file_of_reruns_holds_all_messages_at_their_arrival(stored: Stored, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    chunk: Any = pytest.importorskip("rerun.chunk")  # reads what was written; in newer versions only
    from simbench.view.rerun_log import write_rerun

    pictured = with_pictures(stored)
    write_rerun(pictured, tmp_path / "recording.rrd")
    assert [path.name for path in tmp_path.iterdir()] == ["recording.rrd"]
    points: dict[int, int] = {}
    rows: dict[str, int] = {}
    for part in chunk.RrdReader(str(tmp_path / "recording.rrd")).store().stream():
        batch, path = part.to_record_batch(), str(part.entity_path)
        rows[path] = rows.get(path, 0) + (0 if part.is_static else batch.num_rows)
        if path == "/ego/lidar/points":
            found = batch.column("Points3D:positions")
            at = batch.column("arrival")
            points |= {at[i].value: len(found[i].values) for i in range(batch.num_rows)}
    assert points == {scan.arrival_ns: len(scan.xyz_m) for scan in scans(stored)}
    for camera in stored.recording.calibration.cameras:
        count = sum(m.sensor == camera for m in stored.recording.messages)
        assert rows[f"/ego/{camera}/picture"] == rows[f"/ego/{camera}/picture/boxes"] == count
        assert rows[f"/ego/{camera}"] == 0, "its pose does not change"
    assert rows["/ego/truth/boxes"] == 6


# -- the page in a browser ----------------------------------------------------------------------------------

LISTEN = """
const told = {words: [], dashes: 0, errors: []};
addEventListener("error", (e) => told.errors.push(String(e.message)));
const P = CanvasRenderingContext2D.prototype, fill = P.fillText, dash = P.setLineDash;
P.fillText = function (text, ...more) { told.words.push(text); return fill.call(this, text, ...more); };
P.setLineDash = function (s) { if (s.length) told.dashes += 1; return dash.call(this, s); };
"""
ACT = """
const say = () => Object.assign(told, {
  where: document.getElementById("where").textContent, hash: location.hash,
  text: document.getElementById("strip").textContent, fill: document.body.innerText});
const press = (key) => document.body.dispatchEvent(new KeyboardEvent("keydown", {key, bubbles: true}));
%s
say();
document.documentElement.setAttribute("data-told", JSON.stringify(told));
"""


def browse(page: str, folder: Path, hash_: str, act: str = "") -> dict[str, Any]:
    """What a browser drew and said. The page's policy would refuse this script: it is taken out, no more."""
    page, count = re.subn(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", page)
    assert count == 1
    page = page.replace("<body>", f"<body><script>{LISTEN}</script>", 1)
    page = page.replace("</body></html>", f"<script>{ACT % act}</script></body></html>")
    (folder / "page.html").write_text(page, encoding="utf-8")
    assert CHROMIUM is not None
    done = subprocess.run(
        [
            CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-sync",
            "--disable-background-networking", "--disable-component-update", "--window-size=1280,1000",
            f"--user-data-dir={folder / 'profile'}", "--virtual-time-budget=2000", "--dump-dom",
            f"file://{folder / 'page.html'}{hash_}",
        ],
        capture_output=True, text=True, timeout=100,
    )  # fmt: skip
    found = re.search(r'data-told="([^"]*)"', done.stdout)
    assert found, done.stderr[-2000:]
    told: dict[str, Any] = json.loads(found.group(1).replace("&quot;", '"').replace("&amp;", "&"))
    assert told["errors"] == []
    return told


@pytest.mark.skipif(CHROMIUM is None, reason="no browser")
def test_with_truth_off_nothing_of_it_is_drawn(stored: Stored, tmp_path: Path) -> None:
    page, names = page_of(stored), {info.name for info in stored.recording.truth.objects}
    on = browse(page, tmp_path, "#sweep=3")
    assert "rider (target)" in on["words"] and names & set(on["words"]) and on["dashes"] > 0
    assert "truly taken" in on["text"] and "True boxes: at the true time" in on["fill"]
    off = browse(page, tmp_path, "#sweep=3&truth=0")
    words = set(off["words"])
    assert not any(name in word for name in names - {"car"} for word in words if not word[-1].isdigit())
    assert not names & words and "rider (target)" not in words and off["dashes"] == 0
    assert "truly taken" not in off["text"] and "Truth is switched off" in off["fill"]
    assert any(re.fullmatch(r"rider \d+", word) for word in words), "the detector's boxes are drawn"


@pytest.mark.skipif(CHROMIUM is None, reason="no browser")
def test_keys_slider_and_address_choose_the_sweep(stored: Stored, tmp_path: Path) -> None:
    page = page_of(stored)
    told = browse(page, tmp_path, "#sweep=99", 'press("ArrowLeft"); press("ArrowLeft"); press("ArrowRight");')
    assert told["where"] == "Sweep 5 of 6" and told["hash"] == "#sweep=4", "99 is the last"
    move = 'const slider = document.getElementById("slider"); slider.value = 5;'
    told = browse(page, tmp_path, "", move + 'slider.dispatchEvent(new Event("input")); press("t");')
    assert told["where"] == "Sweep 6 of 6" and told["hash"] == "#sweep=5&truth=0"
    assert np.isclose(float(re.findall(r"stamp (\d\.\d+) s", told["fill"])[0]), 0.5)
