"""The page asks nothing of a network, runs no script but its own, and says loudly what is missing."""

from __future__ import annotations

import base64
import hashlib
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from simbench.cli import main
from simbench.formats.store import MESSAGES, Stored
from simbench.view.page import SCRIPTS, page_of
from tests.simbench.view.viewed import Elements, block, renamed

EVIL = "</script><script>alert(1)"


def run(*words: str) -> Result:
    return CliRunner().invoke(main, ["view", *words], prog_name="simbench")


# -- safe wherever it is opened -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", [EVIL, "<!--<script>", "a&b <i>\"'", "</script x", "\u2028"])
def test_no_name_of_a_file_becomes_markup(stored: Stored, name: str) -> None:
    plain, elements = Elements(page_of(stored)), Elements(page_of(renamed(stored, name)))
    assert [tag for tag, _ in elements.tags] == [tag for tag, _ in plain.tags]
    assert elements.scripts.keys() == {"look", "seen", "hidden", ""}
    assert elements.scripts[""] == plain.scripts[""]
    for data in ("look", "seen", "hidden"):
        assert not set("<>&") & set(elements.scripts[data]), "not even half a tag"
    (target,) = (o for o in block(page_of(renamed(stored, name)), "hidden")["objects"] if o["target"])
    assert target["name"] == ("?" if name == "\u2028" else name)


def test_words_of_the_manifest_are_escaped(stored: Stored) -> None:
    source = stored.manifest.source.model_copy(update={"scenario": EVIL, "faults": (EVIL,)})
    evil = replace(
        stored, manifest=stored.manifest.model_copy(update={"source": source}), missing=(EVIL,)
    )  # fmt: skip
    page = page_of(evil)
    assert EVIL not in page
    assert [name for name, _ in Elements(page).tags].count("script") == 4


def test_only_the_one_script_of_its_hash_may_run_and_nothing_is_fetched(stored: Stored) -> None:
    page = page_of(stored)
    elements = Elements(page)
    digest = base64.b64encode(hashlib.sha256(elements.scripts[""].encode()).digest()).decode()
    (policy,) = (
        attrs["content"] for tag, attrs in elements.tags
        if tag == "meta" and attrs.get("http-equiv") == "Content-Security-Policy"
    )  # fmt: skip
    rules = dict(rule.strip().split(" ", 1) for rule in str(policy).split(";"))
    assert rules == {
        "default-src": "'none'", "style-src": "'unsafe-inline'", "img-src": "data:",
        "script-src": f"'sha256-{digest}'", "base-uri": "'none'", "form-action": "'none'",
    }  # fmt: skip
    assert not re.search(r"https?:|//[a-z]+\.|url\(|@import|\bfetch\(|XMLHttpRequest|WebSocket", page)
    for tag, attrs in elements.tags:
        assert tag not in ("link", "iframe", "img", "object", "embed", "base")
        assert not {"src", "href", "action", "data"} & set(attrs), tag
        assert not any(name.startswith("on") for name in attrs), tag


def test_scripts_write_no_markup() -> None:
    folder = Path(sys.modules["simbench.view.page"].__file__ or "").parent
    for name in SCRIPTS:
        text = (folder / name).read_text(encoding="utf-8")
        assert not re.search(
            r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|Function\(", text
        )


def test_truth_has_a_block_of_its_own_and_one_door() -> None:
    """All scripts but the one with the door ask `truth()`, which is null while the switch is off."""
    folder = Path(sys.modules["simbench.view.page"].__file__ or "").parent
    texts = {name: (folder / name).read_text(encoding="utf-8") for name in SCRIPTS}
    assert texts["js_read.js"].count('block("hidden")') == 1
    assert "const truth = () => (state.truth ? hidden : null);" in texts["js_read.js"]
    for name in SCRIPTS[1:]:
        assert not re.search(r'(?<![.\w])hidden\b(?!")', re.sub(r"\.hidden\b", "", texts[name])), name


def test_the_same_recording_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    for out in ("one", "two"):
        assert run(str(folder), "--tool", "page", "--out", str(tmp_path / out)).exit_code == 0
    one, two = (tmp_path / out / "recording.html" for out in ("one", "two"))
    assert one.read_bytes() == two.read_bytes()
    code = (
        "import sys; from pathlib import Path; from simbench.view.page import page_of\n"
        "from simbench.formats.store import read_recording\n"
        "sys.stdout.buffer.write(page_of(read_recording(Path(sys.argv[1]))).encode('utf-8'))"
    )
    done = subprocess.run([sys.executable, "-c", code, str(folder)], capture_output=True, check=True)
    assert done.stdout == one.read_bytes(), "in another process too"


# -- what it says -------------------------------------------------------------------------------------------


def test_the_head_says_what_was_recorded(stored: Stored) -> None:
    page = page_of(stored)
    source, messages = stored.manifest.source, stored.manifest.messages
    assert messages is not None
    for text in (
        source.scenario, source.system, f"seed {source.seed}", "timing.trigger_offset_ms=50",
        f"{messages.count} written, SHA-256 {messages.sha256[:12]}…", "COMPLETE", stored.manifest.simbench,
    ):  # fmt: skip
        assert text in page, text
    assert "INCOMPLETE" not in page


def test_a_recording_that_was_cut_off_says_so_on_the_page_and_in_the_terminal(
    folder: Path, tmp_path: Path
) -> None:
    cut = Path(shutil.copytree(folder, tmp_path / "cut"))
    data = (cut / MESSAGES).read_bytes()
    (cut / MESSAGES).write_bytes(data[: len(data) // 2])
    done = run(str(cut), "--tool", "page", "--out", str(tmp_path / "out"))
    assert done.exit_code == 0, done.output
    page = (tmp_path / "out" / "recording.html").read_text(encoding="utf-8")
    said = re.search(r"INCOMPLETE: messages\.mcap: it is cut off after \d+ of \d+ messages", done.stderr)
    assert said and f'role="alert">{said.group(0)}</p>' in page
    assert 1 <= len(block(page, "seen")["sweeps"]) < 6


@pytest.mark.parametrize("tool", [(), ("--tool", "page")])
def test_a_folder_without_a_recording_is_one_sentence(tmp_path: Path, tool: tuple[str, ...]) -> None:
    for place in (tmp_path, tmp_path / "nowhere"):
        done = run(str(place), *tool, "--out", str(tmp_path / "out"))
        assert done.exit_code == 2 and done.stdout == ""
        (line,) = done.stderr.splitlines()
        assert line.startswith("simbench: ") and "holds no recording.json" in line
    assert not (tmp_path / "out").exists()


def test_an_output_that_cannot_be_written_is_one_sentence(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    done = run(str(folder), "--tool", "page", "--out", str(tmp_path / "file"))
    assert done.exit_code == 2 and len(done.stderr.splitlines()) == 1 and "cannot write to" in done.stderr
