"""The ledger's file: what was put in comes back; what is not ours or not whole is refused in a sentence."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from unittest import mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.errors import BadInput
from simbench.campaign.ledger import NAME, Done, Ledger
from simbench.campaign.lock import only_one
from simbench.files import write_artifact

ABOUT = {"suite": "smoke", "seeds": [0, 1]}
GOOD = Done(key="a", value='{"x": 1}')
BAD = Done(key="b", value=None, failure="its worker died 3 times: signal 9", status="died")

DONE = st.one_of(
    st.builds(Done, key=st.text(max_size=5), value=st.text(max_size=30).filter(lambda t: "\0" not in t)),
    st.builds(
        Done, key=st.text(max_size=5), value=st.none(), failure=st.text(max_size=30),
        status=st.sampled_from(["raised", "died", "timeout"]),
    ),
)  # fmt: skip


def surrogates_free(row: Done) -> bool:
    return (
        not any(0xD800 <= ord(c) < 0xE000 for c in f"{row.key}{row.value}{row.failure}")
        and "\0" not in row.key
    )


@settings(max_examples=25)
@given(st.lists(DONE.filter(surrogates_free), unique_by=lambda row: row.key, max_size=6))
def test_rows_come_back_as_they_were_in_the_order_of_their_places(
    tmp_path_factory: pytest.TempPathFactory, rows: list[Done]
) -> None:
    folder = tmp_path_factory.mktemp("ledger")
    with Ledger(folder, ABOUT) as ledger:
        for place, row in reversed(list(enumerate(rows))):
            ledger.add(row, place)
    with Ledger(folder, ABOUT) as again:
        assert list(again.rows()) == rows and len(again) == len(rows)
        assert [again.get(row.key) for row in rows] == rows and all(row.key in again for row in rows)


def test_a_key_that_is_not_there_is_told(tmp_path: Path) -> None:
    with Ledger(tmp_path, ABOUT) as ledger:
        assert "c" not in ledger
        with pytest.raises(KeyError):
            ledger.get("c")


def test_a_row_is_on_the_disk_when_add_returns_and_never_twice(tmp_path: Path) -> None:
    with Ledger(tmp_path, ABOUT) as ledger:
        ledger.add(GOOD, 0)
        with closing(sqlite3.connect(tmp_path / NAME)) as other:  # a reader beside the writer
            assert other.execute("SELECT value FROM rows").fetchall() == [(GOOD.value,)]
            assert other.execute("PRAGMA journal_mode").fetchone() == ("wal",)
        assert ledger._base.execute("PRAGMA synchronous").fetchone() == (2,)
        with pytest.raises(BadInput, match="UNIQUE"):
            ledger.add(GOOD, 1)


def test_the_ledger_of_another_campaign_is_refused_and_says_what_differs(tmp_path: Path) -> None:
    with Ledger(tmp_path, ABOUT) as ledger:
        ledger.add(GOOD, 0)
    before = (tmp_path / NAME).read_bytes()
    with pytest.raises(BadInput, match=r"holds another campaign \(other margin, seeds\); give another --out"):
        Ledger(tmp_path, {**ABOUT, "seeds": [0], "margin": 0.1})
    assert (tmp_path / NAME).read_bytes() == before


def _cut(path: Path) -> None:
    os.truncate(path, path.stat().st_size - 4096 - 100)


def _noise(path: Path) -> None:
    path.write_bytes(b"no database at all" * 1000)


def _middle(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[4096 : 2 * 4096] = b"\xff" * 4096
    path.write_bytes(bytes(data))


def _value(path: Path) -> None:
    data = path.read_bytes()
    assert b'{"x": 1}' in data
    path.write_bytes(data.replace(b'{"x": 1}', b'{"x": 7}'))


def _sql(words: str) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        with closing(sqlite3.connect(path)) as base, base:
            base.execute(words)

    return change


@pytest.mark.parametrize(
    "harm",
    [
        pytest.param(_cut, id="cut off"),
        pytest.param(_noise, id="no database"),
        pytest.param(_middle, id="a page overwritten"),
        pytest.param(_value, id="one digit of a value"),
        pytest.param(_sql("UPDATE rows SET status = 'ok'"), id="a failure made good"),
        pytest.param(_sql("UPDATE rows SET place = 9"), id="a place"),
        pytest.param(_sql("DELETE FROM about"), id="what it is about"),
        pytest.param(_sql("DROP TABLE rows"), id="its rows"),
        pytest.param(_sql("PRAGMA user_version = 2"), id="a later version"),
    ],
)
def test_a_damaged_ledger_is_refused_in_one_sentence_and_left_alone(
    tmp_path: Path, harm: Callable[[Path], None]
) -> None:
    with Ledger(tmp_path, ABOUT) as ledger:
        ledger.add(GOOD, 0)
        ledger.add(BAD, 1)
    harm(tmp_path / NAME)
    before = (tmp_path / NAME).read_bytes()
    with pytest.raises(BadInput, match="is no ledger that can be read") as caught:
        Ledger(tmp_path, ABOUT)
    assert "\n" not in str(caught.value)
    assert (tmp_path / NAME).read_bytes() == before


def test_the_file_of_another_program_is_refused(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / NAME)) as base, base:
        base.execute("CREATE TABLE photos (name TEXT)")
    with pytest.raises(BadInput, match="is no ledger that can be read"):
        Ledger(tmp_path, ABOUT)


def test_a_run_that_ended_before_its_ledger_had_tables_begins(tmp_path: Path) -> None:
    (tmp_path / NAME).touch()
    with Ledger(tmp_path, ABOUT) as ledger:
        assert len(ledger) == 0


def test_a_folder_that_cannot_be_written_costs_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="cannot write"):
        Ledger(tmp_path / "nowhere", ABOUT)
    with pytest.raises(BadInput, match="cannot write to"), only_one(tmp_path / "nowhere"):
        pass


# -- lock and artifacts ------------------------------------------------------------------------------------


def test_one_run_in_a_folder_at_a_time(tmp_path: Path) -> None:
    with only_one(tmp_path):
        with pytest.raises(BadInput, match=f"another run \\(process {os.getpid()}\\) works in"):
            with only_one(tmp_path):
                raise AssertionError("two at a time")
        (tmp_path / "other").mkdir()
        with only_one(tmp_path / "other"):
            pass
    with only_one(tmp_path):
        pass


def test_an_artifact_is_on_the_disk_before_it_has_its_name_and_its_folder_after(tmp_path: Path) -> None:
    said: list[str] = []
    sync, place = os.fsync, Path.replace

    def synced(descriptor: int) -> None:
        said.append("folder" if os.path.isdir(f"/proc/self/fd/{descriptor}") else "file")
        sync(descriptor)

    def replaced(self: Path, target: Path) -> Path:
        said.append("rename")
        return place(self, target)

    with mock.patch("os.fsync", synced), mock.patch.object(Path, "replace", replaced):
        write_artifact(tmp_path / "page.html", b"all of it")
    assert said == ["file", "rename", "folder"]
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]
    assert (tmp_path / "page.html").read_bytes() == b"all of it"
