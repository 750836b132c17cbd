# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim merge`` without Blender: the plan of the whole run."""

from pathlib import Path

from radarsim_addon.contract import RUN_FILE
from radarsim_addon.signal.pipeline import main
from tests.signal.synthetic import Setup, points, write_run

SETUP = Setup(rings=2, frames=(1, 2))


def test_a_merged_plan_is_that_of_its_parts(tmp_path: Path) -> None:
    """Byte for byte: counts stay whole numbers, for readers that ask for such."""
    part = write_run(tmp_path / "part", SETUP, points(SETUP, []))
    assert main(["merge", str(tmp_path / "whole"), str(part)]) == 0
    assert (tmp_path / "whole" / RUN_FILE).read_bytes() == (part / RUN_FILE).read_bytes()
