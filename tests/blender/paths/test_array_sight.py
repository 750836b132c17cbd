# SPDX-License-Identifier: GPL-3.0-or-later
"""A render for an array names what its outermost elements do not see; for one element it costs
nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import blender as radarsim
from radarsim_addon import contract
from radarsim_addon.blender.paths import frame
from radarsim_addon.blender.scene import active_radar
from radarsim_addon.signal.radar import array_preset
from radarsim_addon.typed_json import read_record
from scripts.validation import scenes

pytestmark = [pytest.mark.blender, pytest.mark.slow]


def measured(folder: Path, **values: Any) -> contract.PathsRecord:
    run = radarsim.measure(
        active_radar(bpy.context.scene), folder, frames=[1], width_px=128, height_px=128,
        replicates=2, carrier_hz=scenes.CARRIER_HZ, pulses=16, **values,
    )  # fmt: skip
    return read_record(run.path / contract.frame_dir(1) / contract.PATHS_FILE, contract.PathsRecord)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_an_edge_near_the_array_is_a_finding(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The edge is at 2 m, the wall at 10 m: an element at d to the side loses 4 d of 3 m."""
    scenes.new_scene(40.0)
    for name, y, left, right in (("Screen", 2.0, 0.4, 3.0), ("Wall", 10.0, -1.0, 5.0)):
        corners = [(left, y, -3), (right, y, -3), (right, y, 3), (left, y, 3)]
        scenes.add_mesh(name, corners, [(0, 1, 2, 3)], scenes.lambert(0.5))
    record = measured(tmp_path / "array", array="1x8")
    (found,) = (item for item in record.findings if item.code == "array-hides-object")
    elements = array_preset("1x8", scenes.wavelength()).receivers
    side_m = elements[-1].position_m[0]
    assert found.subjects == ("Wall",) and found.frames == (1,)
    assert found.numbers["fraction"] == pytest.approx(4 * side_m / 3, abs=0.02)
    assert record.array_reach_m == pytest.approx(side_m)
    monkeypatch.setattr(frame, "hidden_power", None)
    alone = measured(tmp_path / "alone")
    assert alone.array_reach_m == 0
    assert not any(item.code.startswith("array-") for item in alone.findings)
