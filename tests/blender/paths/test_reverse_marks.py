# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows that have a reverse, between scatterers that are no mirrors; and twice their power."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from radarsim_addon.blender import nodes
from radarsim_addon.signal import iter_path_chunks, open_run, synthesize
from radarsim_addon.signal.decoding import open_frame
from radarsim_addon.signal.detection import object_echoes
from radarsim_addon.signal.maps import expected_power
from radarsim_addon.signal.paths import PathFlag
from radarsim_addon.signal.scattering import FrameSpeckle, antenna_motion
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


def shiny() -> Any:
    """A metal of which half mirrors and half scatters."""
    return nodes.make_material("Shiny", 1e4, 1e4, 0.5, 0.0, penetrable=False)


def corner(right: Callable[[], Any]) -> None:
    """A Lambert wall across the line of sight, and one along it on the right."""
    rs.new_scene()
    across = [(-1.5, 13.0, -1.0), (1.9, 13.0, -1.0), (1.9, 13.0, 1.0), (-1.5, 13.0, 1.0)]
    ph.quad("Across", across, ph.lambert(0.6))
    along = [(2.0, 9.0, -1.0), (2.0, 12.8, -1.0), (2.0, 12.8, 1.0), (2.0, 9.0, 1.0)]
    ph.quad("Right", along, right())
    ph.field_of_view(28.0)


def measured(folder: Path, reflections: int = 2) -> ph.PathRun:
    """Of walls that got no images."""
    options = {"max_reflections": reflections, "mirror_images": 0}
    return ph.run_paths(folder, width_px=64, height_px=64, options=options)


def test_paths_between_scatterers_have_a_reverse(tmp_path: Path) -> None:
    """A wall with both lobes mirrors some rays, which have none, and scatters others."""
    corner(shiny)
    run = measured(tmp_path / "run", 3)
    rows, names = run.table(), run.record().objects
    marked = rows["flags"] & PathFlag.HAS_REVERSE > 0
    assert run.record().flags["has_reverse"] == PathFlag.HAS_REVERSE
    at_shiny = rows["first_object"] == names.index("Right") + 1
    assert not marked[rows["order"] == 1].any()
    assert marked[(rows["order"] > 1) & ~at_shiny].all()
    assert np.count_nonzero((rows["order"] > 2) & at_shiny) > 0
    assert not marked[(rows["order"] > 2) & at_shiny].any()
    two = (rows["order"] == 2) & at_shiny
    onward = rows["last_scatterer_m"] - rows["first_scatterer_m"]
    onward /= np.maximum(np.linalg.norm(onward, axis=1), 1e-9)[:, None]
    mirrored = np.abs(onward - rows["direction"] * (-1, 1, 1)).max(axis=1) < 1e-4
    assert 10 < np.count_nonzero(two & mirrored) < 0.9 * np.count_nonzero(two)
    np.testing.assert_array_equal(marked[two], ~mirrored[two])


def test_smooth_shading_leaves_mirrored_paths_unknown(tmp_path: Path) -> None:
    corner(shiny)
    bpy.data.objects["Right"].data.polygons.foreach_set("use_smooth", [True])
    run = measured(tmp_path / "run")
    rows = run.table()[run.table()["order"] == 2]
    at_shiny = rows["first_object"] == run.record().objects.index("Right") + 1
    marked = rows["flags"] & PathFlag.HAS_REVERSE > 0
    np.testing.assert_array_equal(marked, ~at_shiny)


def test_power_of_second_reflections_is_twice_the_sum(tmp_path: Path) -> None:
    """In expected power, in objects' powers and cross sections, and in speckled echoes."""
    corner(lambda: ph.lambert(0.6))
    runs = [measured(tmp_path / str(most), most) for most in (1, 2)]
    rows = runs[1].table()
    powers = [rows["power_w"][rows["order"] == order].sum() for order in (1, 2)]
    assert powers[1] > 0.01 * powers[0]
    frames = [open_run(run.folder).frame(1) for run in runs]
    one, both = (expected_power(frame, cells_per_sample=16).profile.sum() for frame in frames)
    assert both / one == pytest.approx(1 + 2 * powers[1] / powers[0], rel=2e-3)
    walls = object_echoes(frames[1], 5.3e9, groups={"walls": ["Across", "Right"]})[0]
    assert walls.power_w == pytest.approx(powers[0] + 2 * powers[1], rel=1e-6)
    frame, record, radar = frames[1], runs[1].record(), open_run(runs[1].folder).radar
    speckle = FrameSpeckle(open_frame(frame), 3)
    found = [speckle.apply(part) for part in iter_path_chunks(frame)]
    twice = [part[part.flags & PathFlag.HAS_REVERSE > 0] for part in found]
    antennas = antenna_motion(record.receiver, record.transmitter)
    energy = [
        np.sum(np.abs(
            synthesize(twice, radar, range_limits_m=(0.0, 40.0), speckle_seed=3, antennas=one)
            .plane
        ) ** 2)
        for one in (None, antennas)
    ]  # fmt: skip
    assert energy[1] / energy[0] == pytest.approx(2.0, rel=1e-6)


def test_reverses_outside_the_view_are_named(tmp_path: Path) -> None:
    """The fraction is what a wider view finds on the way by the other wall first."""
    corner(lambda: ph.lambert(0.6))
    wide = measured(tmp_path / "wide")
    ph.field_of_view(16.0)
    narrow = measured(tmp_path / "narrow")
    found = [
        [item for item in run.record().findings if item.code == "reverse-outside-view"]
        for run in (wide, narrow)
    ]
    assert (len(found[0]), len(found[1])) == (0, 1)
    rows = wide.table()
    right = rows["first_object"] == wide.record().objects.index("Right") + 1
    missing_w = rows["power_w"][right & (rows["order"] == 2)].sum()
    named_w = float(found[1][0].numbers["fraction"]) * narrow.record().total_power_w
    assert named_w == pytest.approx(missing_w, rel=0.1)
