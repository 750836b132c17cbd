# SPDX-License-Identifier: GPL-3.0-or-later
"""Overlays: where their lines and labels are. Drawing itself needs a window (tests/gui)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Matrix, Vector

from radarsim_addon import blender as radarsim
from radarsim_addon.blender.plan import PRESETS
from radarsim_addon.blender.ui import overlays
from radarsim_addon.blender.ui import overlays as ol
from radarsim_addon.physics.antennas import Aperture, Gaussian, PlanarArray
from radarsim_addon.signal.radar import array_preset
from tests.blender import radar_scenes as rs
from tests.blender import recording

NAMES = ("view", "beams", "elements", "rings", "unambiguous", "velocities", "cell", "paths")
AHEAD = np.array([0.0, 0.0, -1.0])


@pytest.fixture
def shown(addon: Any) -> Iterator[Any]:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    state = bpy.context.window_manager.radarsim
    before = [getattr(state, f"overlay_{name}") for name in NAMES]
    assert before == [True, False, True, False, False, False, False, True]
    yield state
    for name, value in zip(NAMES, before, strict=True):
        setattr(state, f"overlay_{name}", value)


def found() -> tuple[dict[str, overlays.Lines], list[Any]]:
    bpy.context.view_layer.update()
    lines, labels = overlays.overlay_lines(recording.context())
    return {item.kind: item for item in lines}, labels


@pytest.mark.parametrize(
    ("longest_m", "expected"),
    [
        (120.0, [20, 40, 60, 80, 100, 120]), (35.0, [5, 10, 15, 20, 25, 30, 35]),
        (22e3, [2e3 * n for n in range(1, 12)]), (1.0, [0.2, 0.4, 0.6, 0.8, 1.0]),
    ],
)  # fmt: skip
def test_rings_have_round_ranges(longest_m: float, expected: list[float]) -> None:
    assert ol.ring_ranges(longest_m) == pytest.approx(expected)


@pytest.mark.parametrize(("azimuth", "elevation"), [(60.0, 12.0), (3.0, 25.0), (100.0, 20.0)])
def test_a_beam_ends_at_half_its_width(azimuth: float, elevation: float) -> None:
    """Of a Gaussian beam the half-power contour crosses the axes at half the beamwidths."""
    ends = ol.beam(Gaussian(math.radians(azimuth), math.radians(elevation)), AHEAD, 50.0)
    np.testing.assert_allclose(np.linalg.norm(ends, axis=1), 50.0, rtol=1e-12)
    across = np.degrees(np.arctan2(np.abs(ends[:, 0]), -ends[:, 2]))
    up = np.degrees(np.arctan2(np.abs(ends[:, 1]), -ends[:, 2]))
    assert across.max() == pytest.approx(azimuth / 2, rel=2e-3)
    assert up.max() == pytest.approx(elevation / 2, rel=2e-3)


@pytest.mark.parametrize(
    "antenna",
    [
        Aperture(0.3, 0.2, 0.03),
        PlanarArray(8, 4, 0.015, 0.015, 0.03, steer_azimuth_rad=0.3, element_exponent=1.0),
    ],
)
def test_beams_of_apertures_and_steered_arrays(antenna: Any) -> None:
    azimuth = 0.3 if isinstance(antenna, PlanarArray) else 0.0
    axis = np.array([math.sin(azimuth), 0.0, -math.cos(azimuth)])
    ends = ol.beam(antenna, axis, 1.0)
    np.testing.assert_allclose(antenna.gain(ends), antenna.gain(axis) / 2, rtol=1e-6)


def test_the_view_is_the_cameras(shown: Any) -> None:
    """90 degrees across, 512 x 109 pixels: 24.1 degrees up; the frame lies on the range limit."""
    radarsim.add_radar((0.0, 0.0, 2.0))
    lines, labels = found()
    assert set(lines) == {"view"} and not labels
    ends = lines["view"].ends
    lengths = np.linalg.norm(ends, axis=1)
    assert set(np.round(lengths[:8:2], 9)) == {0.0}
    np.testing.assert_allclose(lengths[8:], 120.0, rtol=1e-6)
    frame = ends[8:] / -ends[8:, 2:]
    assert math.degrees(math.atan(frame[:, 0].max())) == pytest.approx(45.0, abs=1e-3)
    assert frame[:, 1].max() == pytest.approx(109 / 512, rel=1e-5)


def test_elements_of_an_array_stand_at_their_antennas(shown: Any) -> None:
    """Transmitters at the transmitter, the others at the receiver, in metres; virtual ones are
    drawn once. A single element has no mark.
    """
    bpy.context.scene.unit_settings.scale_length = 0.1
    rig = radarsim.add_radar((0.0, 0.0, 20.0), preset="automotive_77ghz")
    assert set(found()[0]) == {"view"}
    settings = radarsim.settings(rig)
    settings.array, settings.prf_hz = "3x4", 2000.0
    lines, labels = found()
    measurement, _ = overlays.current_measurement(bpy.context.scene)
    assert measurement is not None
    array = array_preset("3x4", measurement.waveform.wavelength_m)
    places: dict[str, Any] = {
        "transmitters": [one.position_m for one in array.transmitters],
        "receivers": [one.position_m for one in array.receivers],
        "virtual": np.unique(array.virtual_m.round(9), axis=0),
    }
    assert set(lines) == {"view", *places}
    for kind, expected in places.items():
        item, ends = lines[kind], 4 if kind == "virtual" else 8
        middles = item.ends.reshape(-1, ends, 3).mean(axis=1)
        order = np.lexsort(np.round(middles.T, 7))
        of = np.asarray(expected)
        np.testing.assert_allclose(middles[order], of[np.lexsort(of.T.round(7))], atol=1e-9)
    first = lines["receivers"].matrix @ Vector(lines["receivers"].ends[:8].mean(axis=0))
    # ten units a metre
    away = (first - Vector((0, 0, 20))).length
    assert away == pytest.approx(10 * np.linalg.norm(places["receivers"][0]), rel=1e-3)
    assert [label.text for label, _ in labels] == ["12 channels within 8.03 mm"]
    shown.overlay_elements = False
    assert set(found()[0]) == {"view"}


def test_lines_stand_in_the_scene_in_metres(shown: Any) -> None:
    """A unit of 100 m, the radar at (1, 2, 3), looking along +X: 60 m are 0.6 units."""
    shown.overlay_rings = shown.overlay_unambiguous = True
    bpy.context.scene.unit_settings.scale_length = 100.0
    radarsim.add_radar((1.0, 2.0, 3.0), look_at=(5.0, 2.0, 3.0))
    lines, labels = found()
    assert {"view", "rings", "unambiguous"} == set(lines)
    texts = {label.text: matrix @ Vector(label.place) for label, matrix in labels}
    assert list(texts)[1:] == ["20 m", "40 m", "60 m", "80 m", "100 m", "120 m"]
    np.testing.assert_allclose(texts["60 m"], [1.6, 2.0, 3.0], atol=1e-5)
    np.testing.assert_allclose(texts["128 m unambiguous"], [1 + 1.2791, 2.0, 3.0], atol=1e-3)
    first = lines["rings"].matrix @ Vector(lines["rings"].ends[0])
    assert (first - Vector((1, 2, 3))).length == pytest.approx(0.2, rel=1e-5)


@pytest.mark.parametrize("preset", PRESETS)
def test_all_overlays_of_every_radar(shown: Any, preset: str) -> None:
    for name in NAMES:
        setattr(shown, f"overlay_{name}", True)
    radarsim.add_radar(preset=preset)
    rs.add_plate(50.0)
    lines, _ = found()
    beams = set() if preset == "paper" else {"transmitter", "receiver"}
    assert set(lines) == {"view", "rings", "unambiguous", "cell"} | beams
    for item in lines.values():
        assert np.isfinite(item.ends).all()
        assert item.ends.shape[1] == 3 and len(item.ends) % 2 == 0
    assert "overlay_beams" in recording.drawn(overlays.RADARSIM_PT_overlays).fields


def test_orthographic_and_panoramic_receivers_have_no_pyramid(shown: Any) -> None:
    radarsim.add_radar()
    for kind in ("ORTHO", "PANO"):
        bpy.context.scene.camera.data.type = kind
        assert "view" not in found()[0]


def test_what_moves_has_an_arrow_as_long_as_its_way_in_a_second(shown: Any) -> None:
    """A car with 8 m/s and a child of it, in units of 10 m; a wall that is stationary."""
    shown.overlay_velocities = True
    bpy.context.scene.unit_settings.scale_length = 10.0
    radarsim.add_radar()
    wall, car = rs.add_plate(9.0), rs.add_plate(3.0)
    car.name, wall.name = "Car", "Wall"
    mast = rs.add_plate(0.0, 0.1)
    mast.name, mast.parent = "Mast", car
    rs.move_steadily(car, (0.48, 0.64, 0.0))  # 0.8 units a second
    lines, labels = found()
    arrows = lines["velocities"]
    assert len(arrows.ends) == 2 * 6
    assert sorted(label.text for label, _ in labels) == ["8 m/s", "8 m/s"]
    for ends in (arrows.ends[:6], arrows.ends[6:]):
        start, tip, *head = (np.array(arrows.matrix @ Vector(end)) for end in ends)
        np.testing.assert_allclose(
            np.linalg.norm(head[1] - tip), 0.8 / 7 * math.hypot(1, 0.5), rtol=1e-4
        )
        np.testing.assert_allclose(start, [0.0, 3.0, 0.0], atol=1e-5)
        np.testing.assert_allclose(tip - start, [0.48, 0.64, 0.0], atol=1e-4)


def test_the_cell_at_the_cursor_is_a_range_resolution_thick(shown: Any) -> None:
    """The cursor 40 m away, 10 m up, in a view of 90 degrees: two arcs of one elevation."""
    shown.overlay_view, shown.overlay_cell = False, True
    radar = radarsim.add_radar((1.0, 2.0, 3.0), look_at=(5.0, 2.0, 3.0))
    bpy.context.scene.cursor.location = (41.0, 2.0, 13.0)
    lines, labels = found()
    assert set(lines) == {"cell"}
    distance = np.linalg.norm(lines["cell"].ends, axis=1)
    range_m = math.hypot(40.0, 10.0)
    resolution_m = 299_792_458.0 / 2 / 300e6
    edges_m = np.array([range_m - resolution_m / 2, range_m + resolution_m / 2])
    assert np.abs(distance[:, None] - edges_m).min(axis=1).max() < 1e-4
    assert {int(np.abs(edges_m - one).argmin()) for one in distance} == {0, 1}
    np.testing.assert_allclose(lines["cell"].ends[:, 1] / distance, 10.0 / range_m, atol=1e-5)
    azimuth = np.degrees(np.arctan2(lines["cell"].ends[:, 0], -lines["cell"].ends[:, 2]))
    assert azimuth.max() == pytest.approx(45.0, abs=1e-3) == -azimuth.min()
    ((label, matrix),) = labels
    assert label.text.startswith("41.23 m: cell 0.5 m x ") and label.text.endswith("m/s")
    np.testing.assert_allclose(matrix @ Vector(label.place), (41.0, 2.0, 13.0), atol=1e-4)
    assert radar is not None


def test_lines_are_made_again_only_where_something_changes(
    shown: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a stand-in for the graphics card, which a background Blender does not have."""
    monkeypatch.setattr(ol, "batch_for_shader", lambda _, kind, values: values["pos"])
    monkeypatch.setattr(ol, "_shader", lambda: None)
    radar = radarsim.add_radar()
    plate = rs.add_plate(50.0)
    for name in NAMES:
        setattr(shown, f"overlay_{name}", True)
    recording.context()
    first = ol._drawing(recording.context())
    assert ol._drawing(recording.context()) is first
    for change in (
        lambda: setattr(shown, "overlay_rings", False),
        lambda: setattr(radar, "location", (0.0, 0.0, 5.0)),
        lambda: setattr(bpy.context.scene.cursor, "location", (1.0, 20.0, 0.0)),
        lambda: setattr(radar.radarsim, "range_stop_m", 60.0),
        lambda: setattr(radar.radarsim.transmitter, "azimuth_beamwidth_deg", 20.0),
        lambda: rs.move_steadily(plate, (0.0, 3.0, 0.0)),
    ):
        change()
        bpy.context.view_layer.update()
        later = ol._drawing(recording.context())
        assert later is not first and ol._drawing(recording.context()) is later
        first = later
    assert "3 m/s" in later.texts and len(later.texts) == len(later.places)
    ol._drawings.clear()


def test_labels_are_where_their_places_are_seen() -> None:
    """As Blender's own function finds them, all at once."""
    random = np.random.default_rng(3)
    places = random.uniform(-30.0, 30.0, (200, 3))
    lens = Matrix.Translation((0, 0, -40.0)) @ Matrix.Rotation(0.4, 4, "X")
    perspective = Matrix(((1.5, 0, 0, 0), (0, 2.0, 0, 0), (0, 0, -1, -0.2), (0, 0, -1, 0))) @ lens
    region = SimpleNamespace(width=900, height=600)
    data = SimpleNamespace(perspective_matrix=perspective)
    found, inside = ol.projected(places, perspective, region.width, region.height)
    assert 20 < inside.sum() < 180
    for place, at, seen in zip(places, found, inside, strict=True):
        expected = location_3d_to_region_2d(region, data, Vector(place))
        if seen:
            np.testing.assert_allclose(at, expected, atol=1e-2)
        else:
            assert expected is None or not (0 <= expected.x <= 900 and 0 <= expected.y <= 600)


def test_labels_do_not_pile_up() -> None:
    places = np.array([[0, 0], [20, 5], [41, 0], [0, 11], [85, 0], [60, -20.0]])
    sizes = np.array([[40, 10], [40, 10], [40, 10], [40, 10], [10, 10], [40, 30.0]])
    assert ol.without_overlap(places, sizes) == [0, 2, 3, 4]
