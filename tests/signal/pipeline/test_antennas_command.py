# SPDX-License-Identifier: GPL-3.0-or-later
"""What ``radarsim antennas`` refuses."""

from pathlib import Path

import pytest

from radarsim_addon.signal.pipeline import main


def test_a_carrier_in_hertz_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "link_budget.json"
    file.write_text('{"transmitter": {"kind": "array", "parameters": {"columns": 8, "rows": 1}}}')
    assert main(["antennas", str(file), "--carrier-ghz", "77e9"]) == 2
    assert "77 for a carrier of 77e9 Hz" in capsys.readouterr().err
