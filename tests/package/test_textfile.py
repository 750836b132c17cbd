# SPDX-License-Identifier: GPL-3.0-or-later
"""Text that others give is read up to a limit, whatever the file system says of its size."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from radarsim_addon import contract
from radarsim_addon.atomic_files import TextTooLongError, read_text, refusal_to_open
from radarsim_addon.errors import RadarSimError
from radarsim_addon.physics.checks import read_csv
from radarsim_addon.signal import open_run
from radarsim_addon.signal.radar import load_radar, read_system
from radarsim_addon.typed_json import read_record

ENDLESS = Path("/dev/zero")


def test_byte_order_marks_go_and_umlauts_stay(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(b"\xef\xbb\xbfW\xc3\xa4nde")
    assert read_text(path, 9) == "Wände"
    with pytest.raises(TextTooLongError, match="more than 8 bytes"):
        read_text(path, 8)


@pytest.mark.skipif(not ENDLESS.exists(), reason="the system has no endless file")
@pytest.mark.parametrize(
    "read",
    [
        load_radar,
        read_system,
        lambda path: read_csv(path, [("frequency_hz", "level")]),
        lambda path: read_record(path, contract.RunRecord),
    ],
    ids=["radar", "system", "table", "record"],
)
def test_an_endless_file_is_refused_by_name(read: Callable[[Path], object]) -> None:
    with pytest.raises(RadarSimError, match=r"/dev/zero.* more than \d+ bytes"):
        read(ENDLESS)


def test_a_file_that_cannot_be_read_is_told_from_one_that_is_missing(tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    whole.touch()
    assert refusal_to_open(whole) == ""
    assert refusal_to_open(tmp_path / "none") == "does not exist"
    assert refusal_to_open(tmp_path) == "is a folder"
    if ENDLESS.exists():
        assert refusal_to_open(ENDLESS) == "is no ordinary file"
    if os.name == "posix":
        assert refusal_to_open(tmp_path / ("a" * 300)) == "cannot be read: File name too long"


@pytest.mark.skipif(getattr(os, "geteuid", lambda: 1)() != 0, reason="only root changes the user")
def test_permissions_are_named() -> None:
    """Also where the folder around the file is closed, for which Path.exists raises."""
    with tempfile.TemporaryDirectory() as name:  # tmp_path lies in a folder of one user
        Path(name).chmod(0o755)
        inside = Path(name) / "closed" / "a.txt"
        inside.parent.mkdir(0o700)
        inside.touch()
        refused_as_another_user(inside)


def refused_as_another_user(inside: Path) -> None:
    os.seteuid(65534)
    try:
        assert refusal_to_open(inside) == "cannot be read: Permission denied"
        with pytest.raises(RadarSimError, match=r"cannot be read: Permission denied\. Check its"):
            open_run(inside.parent)
        with pytest.raises(RadarSimError, match="closed/run cannot be read: Permission denied"):
            open_run(inside.parent / "run")
    finally:
        os.seteuid(0)
