# SPDX-License-Identifier: GPL-3.0-or-later
"""Text that others give is read up to a limit, whatever the file system says of its size."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from radarsim_addon import contract
from radarsim_addon.errors import RadarSimError
from radarsim_addon.physics.checks import read_csv
from radarsim_addon.sidecar import read_record
from radarsim_addon.signal.radar import load_radar, read_system
from radarsim_addon.textfile import TextTooLongError, read_text

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
