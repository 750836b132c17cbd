# SPDX-License-Identifier: GPL-3.0-or-later
"""Files appear whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import atomic_files
from radarsim_addon.atomic_files import (
    AtomicFile,
    cannot_make,
    make_folder,
    replaced,
    write_arrays,
    write_json,
    write_text,
)
from radarsim_addon.errors import OutputError


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_appears_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "map.json"
    path.write_text("before")
    with replaced(path) as temporary:
        assert temporary.suffix == ".json" and temporary.match(atomic_files.TEMPORARY_PATTERN)
        temporary.write_text("after")
        assert path.read_text() == "before"
    assert path.read_text() == "after"
    assert names(tmp_path) == ["map.json"]


@pytest.mark.parametrize("error", [ValueError("x"), KeyboardInterrupt()])
def test_a_failure_leaves_what_was_there(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "map.json"
    path.write_text("before")
    with pytest.raises(type(error)), replaced(path) as temporary:
        temporary.write_text("half")
        raise error
    assert path.read_text() == "before"
    assert names(tmp_path) == ["map.json"]


def test_errors_of_the_disk_are_named(tmp_path: Path) -> None:
    path = tmp_path / "map.json"
    full = pytest.raises(OutputError, match=r"Cannot write .*map\.json: No space left")
    with full, replaced(path):
        raise OSError(28, "No space left on device")
    with pytest.raises(OutputError, match="No such file"):
        write_text(tmp_path / "gone" / "map.json", "")
    (tmp_path / "folder.json").mkdir()
    with pytest.raises(OutputError, match="Cannot write"):
        write_text(tmp_path / "folder.json", "")
    assert names(tmp_path) == ["folder.json"]


def test_a_vanished_temporary_file_is_named(tmp_path: Path) -> None:
    with (
        pytest.raises(OutputError, match="Cannot write"),
        replaced(tmp_path / "a.bin") as temporary,
    ):
        temporary.unlink()
    assert names(tmp_path) == []


@pytest.mark.skipif(os.name != "posix", reason="links need rights elsewhere")
def test_links_are_refused_and_followed_nowhere(tmp_path: Path) -> None:
    target, link = tmp_path / "target.json", tmp_path / "link.json"
    target.write_text("mine")
    link.symlink_to(target)
    with pytest.raises(OutputError, match=r"link\.json is a symbolic link"):
        write_json(link, {})
    link.unlink()
    link.symlink_to(tmp_path / "nowhere")  # one that leads nowhere, too
    with pytest.raises(OutputError, match="symbolic link"):
        write_json(link, {})
    assert target.read_text() == "mine" and link.is_symlink()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("file", r"file: there is a file of this name\. Choose another name"),
        ("file/x", r"file/x: Not a directory\. Choose a folder that you may write to\."),
        ("a" * 300, r"a: File name too long\. Choose a shorter name\."),
    ][: 3 if os.name == "posix" else 1],
)
def test_folders_that_cannot_be_made(tmp_path: Path, name: str, message: str) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match=message):
        make_folder(tmp_path / name)


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="Linux says 'not found' there")
def test_a_parent_that_exists_is_not_said_to_be_missing() -> None:
    with pytest.raises(OutputError, match=r"/proc exists, and no folder can be made in it\."):
        make_folder(Path("/proc/radarsim"))
    error = cannot_make(Path("/no/such/folder"), FileNotFoundError(2, "No such file"))
    assert str(error) == (
        "Cannot make the folder /no/such/folder: /no/such does not exist. "
        "Create it, or choose a folder whose parent exists."
    )


def test_a_link_in_place_of_the_temporary_file_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("secrets.token_hex", lambda _: "known")
    target = tmp_path / "target"
    target.write_text("mine")
    known = AtomicFile(tmp_path / "a.json")
    known.discard()
    known.temporary.symlink_to(target)
    with pytest.raises(OutputError, match="File exists"):
        write_text(tmp_path / "a.json", "yours")
    assert target.read_text() == "mine"


def test_several_writers_of_a_file_do_not_meet(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    with replaced(path) as one, replaced(path) as two:
        assert one != two
        one.write_text("one")
        two.write_text("two")
    assert path.read_text() == "one"  # the last rename wins
    assert names(tmp_path) == ["a.json"]


def test_discarded_files_leave_nothing(tmp_path: Path) -> None:
    file = AtomicFile(tmp_path / "rows")
    file.temporary.write_bytes(b"1")
    file.discard()
    file.discard()
    assert names(tmp_path) == []


def test_data_is_synced_before_it_is_renamed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda handle: (calls.append("fsync"), fsync(handle))[1])
    monkeypatch.setattr(os, "replace", lambda a, b: (calls.append("rename"), replace(a, b))[1])
    write_text(tmp_path / "a.txt", "ä")
    assert calls[:2] == ["fsync", "rename"]
    assert (tmp_path / "a.txt").read_bytes() == "ä".encode()


def test_arrays_and_json(tmp_path: Path) -> None:
    write_arrays(tmp_path / "a.npz", {"range_m": np.arange(3.0)})
    with np.load(tmp_path / "a.npz", allow_pickle=False) as found:
        assert found["range_m"].tolist() == [0.0, 1.0, 2.0]
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "a.json", {"x": float("nan")})
    assert names(tmp_path) == ["a.npz"]


def test_leftovers_are_removed(tmp_path: Path) -> None:
    for name in (".part-12-ab-run.json", "old.exr.part", "run.json"):
        (tmp_path / name).touch()
    atomic_files.remove_temporaries(tmp_path)
    assert names(tmp_path) == ["run.json"]
