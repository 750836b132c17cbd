# SPDX-License-Identifier: GPL-3.0-or-later
"""Grids of equirectangular views near a pole: places, edges and steps as of any other grid."""

from __future__ import annotations

import dataclasses
import math
import tracemalloc

import numpy as np
import pytest

from radarsim_addon.contract import ReceiverRecord
from radarsim_addon.signal.decoding import pixel_rays
from radarsim_addon.signal.paths import PathRows, edge_variances, steps_of
from radarsim_addon.signal.paths import footprints as ps

SIZE = 64


def view(kind: str, top_deg: float = 89.6, across: float = 0.0128) -> ReceiverRecord:
    """A window of 64 x 64 pixels: perspective, or within a degree of the zenith of a sphere."""
    if kind == "perspective":
        return ReceiverRecord(kind, np.eye(4).tolist(), -0.1, 0.1, -0.1, 0.1, 0.0)
    top, bottom = math.radians(top_deg), math.radians(top_deg - 0.6)
    return ReceiverRecord(kind, np.eye(4).tolist(), 2.0, 2.0 + across, bottom, top, 0.0)


def turned(receiver: ReceiverRecord, angle: float) -> ReceiverRecord:
    """The same view by a pose with other roundings."""
    c, s = math.cos(angle), math.sin(angle)
    pose = np.eye(4)
    pose[:3, :3] = [[c, -s, 0], [s, c, 0], [0, 0, 1]]
    return dataclasses.replace(receiver, matrix_world=pose.tolist())


def rows_of(receiver: ReceiverRecord, wanted: np.ndarray) -> np.ndarray:
    """Rows of the wanted pixels, whose length grows by 0.3 across and by 0.2 up."""
    rays = pixel_rays(receiver, SIZE, SIZE)
    row, col = np.nonzero(wanted)
    rows = PathRows.zeros(row.size)
    rows["direction"] = rays.direction[row, col]
    rows["solid_angle_sr"] = rays.solid_angle_sr[row, col]
    rows["order"], rows["last_object"], rows["power_w"] = 1, 1, 1.0
    rows["length_m"] = 100 + 0.3 * col - 0.2 * row
    return rows


def disc() -> np.ndarray:
    at = np.arange(SIZE) - 30.3
    return at[:, None] ** 2 + at[None, :] ** 2 < 20.0**2


@pytest.mark.parametrize("across", [0.0128, 1.0])
@pytest.mark.parametrize("top_deg", [89.6, 89.99, 90.0])
@pytest.mark.parametrize("angle", [0.0, 1e-7])
def test_places(top_deg: float, across: float, angle: float) -> None:
    """Columns and rows as rendered; with the poses of older tables as far as they tell them."""
    seen = view("equirectangular", top_deg, across)
    wanted = disc()
    row, col = np.nonzero(wanted)
    found_col, found_row = ps.grid_places(rows_of(seen, wanted), turned(seen, angle), 1)
    np.testing.assert_array_equal(found_row, row.max() - row)
    # the pose's rounding over the distance from the axis, in columns
    latitude = seen.top - (row + 0.5) * (seen.top - seen.bottom) / SIZE
    unsure = angle / np.cos(latitude) / (across / SIZE)
    off = np.abs(found_col - (col - col.min()))
    assert np.all(off <= np.ceil(unsure - 0.4))


def test_edges_and_steps_as_in_a_flat_view() -> None:
    """The same pixels of a perspective view have the same neighbours."""
    found = []
    for kind, angle in (("perspective", 0.0), ("equirectangular", 0.0), ("equirectangular", 1e-7)):
        seen = view(kind)
        rows = rows_of(seen, disc())
        label = np.ones(rows.size, dtype=np.int64)
        tracemalloc.start()
        variance = edge_variances(rows, label, rows["power_w"], turned(seen, angle), 1)
        steps = steps_of(rows, turned(seen, angle), 1)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert most < 4e6  # of columns that are rounding it was hundreds of megabytes
        found.append((variance, steps.length_m))
    flat = found[0]
    assert flat[0][1] > 0
    assert np.median(flat[1][:, 0]) == pytest.approx(0.3)
    assert np.median(flat[1][:, 1]) == pytest.approx(0.2)
    for variance, length_m in found[1:]:
        np.testing.assert_allclose(variance, flat[0])
        np.testing.assert_allclose(length_m, flat[1], atol=1e-12)


def test_one_row_and_the_whole_circle() -> None:
    """A row tells its step by itself; a ring has no seam in the middle of what is seen."""
    seen = dataclasses.replace(view("equirectangular"), left=-math.pi, right=math.pi)
    for wanted in (np.arange(SIZE)[:, None] == 5, np.ones((SIZE, 1), dtype=bool)):
        whole = wanted & np.ones((SIZE, SIZE), dtype=bool)
        col, row = ps.grid_places(rows_of(seen, whole), seen, 1)
        assert col.max() + 1 == SIZE
        assert len(set(zip(col.tolist(), row.tolist(), strict=True))) == np.count_nonzero(whole)
    across = np.ones((SIZE, SIZE), dtype=bool)
    across[:, 20:40] = False  # what is seen crosses the image's seam
    col, _ = ps.grid_places(rows_of(seen, across), seen, 1)
    assert col.max() + 1 == SIZE - 20


def test_large_images_lose_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two small objects far apart: gaps between them go first; of lone pixels nothing is lost."""
    wanted = np.zeros((SIZE, SIZE), dtype=bool)
    wanted[2:7, 3:9] = wanted[50:60, 51:62] = True
    seen = view("perspective")
    rows = rows_of(seen, wanted)
    rows["last_object"] = 1 + (rows["length_m"] > rows["length_m"].mean())
    label = rows["last_object"].astype(np.int64)
    expected = edge_variances(rows, label, rows["power_w"], seen, 2), steps_of(rows, seen, 1)
    monkeypatch.setattr(ps, "_MOST_PX", 900)  # of 3420
    found = edge_variances(rows, label, rows["power_w"], seen, 2), steps_of(rows, seen, 1)
    np.testing.assert_allclose(found[0], expected[0])
    np.testing.assert_allclose(found[1].length_m, expected[1].length_m)
    monkeypatch.setattr(ps, "_MOST_PX", 9)
    alone = edge_variances(rows, label, rows["power_w"], seen, 2)
    one = edge_variances(rows[:1], label[:1], rows["power_w"][:1], seen, 2)[label[0]]
    np.testing.assert_allclose(alone[1:], one * np.bincount(label)[1:])
