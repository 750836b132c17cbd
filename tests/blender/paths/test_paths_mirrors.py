# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths that go over a planar mirror on their last leg, against images by hand."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.signal import open_run
from radarsim_addon.signal.decoding import frame_paths
from radarsim_addon.signal.paths import IMAGE_DTYPE, PATH_DTYPE, PathRows, motion_of_rows
from radarsim_addon.signal.paths.table_files import frame_motion
from radarsim_addon.signal.radar import Burst

bpy = pytest.importorskip("bpy")

from mathutils import Matrix

from radarsim_addon.blender import nodes
from radarsim_addon.blender.materials import physical_materials as pm
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.mirror_scenes import (
    HEIGHT_M,
    IMAGE_M,
    RANGE_M,
    THREE,
    box,
    measure,
    scene,
    stand_apart,
)

pytestmark = pytest.mark.blender


def gammas(index: complex, sine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Textbook coefficients of ground for H and V at a grazing angle, exp(-j w t)."""
    eps = index**2
    root = np.sqrt(eps - (1 - sine**2))
    return (sine - root) / (sine + root), (eps * sine - root) / (eps * sine + root)


@pytest.mark.parametrize("code", ["world", "materials"])
def test_all_four_families(tmp_path: Path, code: str) -> None:
    scene()
    run = measure(tmp_path, pixels=256, range_encoding=code)
    rows = run.table()
    assert rows.dtype == IMAGE_DTYPE
    over = rows["transmitter_image"] == 1
    seen = rows["direction"][:, 2] > -0.1  # the others see the plate in the mirror
    last_m = rows["last_scatterer_m"]
    radar_m = np.array([0.0, 0.0, HEIGHT_M])
    there_m = np.linalg.norm(last_m - np.where(over[:, None], IMAGE_M, radar_m), axis=1)
    back_m = np.linalg.norm(last_m - np.where(seen[:, None], radar_m, IMAGE_M), axis=1)
    np.testing.assert_allclose(rows["length_m"], there_m + back_m, atol=1e-5)
    np.testing.assert_allclose(rows["length_m"][seen], (there_m + back_m)[seen], atol=1e-9)
    np.testing.assert_array_equal(rows["order"], 1 + over + ~seen)
    # Irradiance under the cosine, and what the mirror reflects on each way.
    radiance = 1 / math.pi * ph.irradiance(there_m) * (RANGE_M / there_m)
    index = 1e4 + 1e4j
    for way, how in ((there_m, over), (back_m, ~seen)):
        lossy = np.mean([np.abs(g) ** 2 for g in gammas(index, 2 * HEIGHT_M / way)], axis=0)
        radiance *= np.where(how, lossy, 1.0)
    # Rows are of pixels that see the plate directly: over the mirror it looks smaller.
    direct_m = np.linalg.norm(last_m - radar_m, axis=1)
    radiance *= np.where(seen, 1.0, (direct_m / back_m) ** 3)
    np.testing.assert_allclose(ph.radiance(rows), radiance * 0.9998, rtol=3e-4)
    families = {(bool(a), bool(b)) for a, b in zip(over, seen, strict=True)}
    assert len(families) == 4
    # The pixels that see the plate in the mirror would count its points a second time.
    assert rows.size == 4 * np.count_nonzero(rows["order"] == 1)
    for name in ("last_object", "last_body"):
        assert set(rows[name]) == {2}, name


def wet_ground() -> Any:
    return pm.make_physical_material(
        "Ground", "index", carrier_hz=5.3e9, n=3.0, k=0.4, penetrable=False
    )


def simple_ground() -> Any:
    return nodes.make_material("Simple", 3.0, 0.4, 1.0, 0.0, penetrable=False)


def sheet() -> Any:
    return pm.make_physical_material(
        "Sheet", "index", carrier_hz=5.3e9, n=2.5, k=0.1, sheet_thickness_m=0.008
    )


def sheet_gammas(index: complex, sine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Airy's sum of all echoes in the sheet, for H and V."""
    root = np.sqrt(index**2 - (1 - sine**2))
    passage = np.exp(4j * math.pi * 5.3e9 / 299_792_458.0 * 0.008 * root)
    first = gammas(index, sine)
    return tuple(r * (1 - passage) / (1 - r**2 * passage) for r in first)


@pytest.mark.parametrize(
    ("ground", "coefficients", "index"),
    [
        (wet_ground, gammas, 3 + 0.4j),
        (simple_ground, gammas, 3 + 0.4j),
        (sheet, sheet_gammas, 2.5 + 0.1j),
    ],
)
def test_phase_and_power_of_each_polarisation(
    tmp_path: Path, ground: Any, coefficients: Any, index: complex
) -> None:
    """Wet ground near its Brewster angle, where H and V differ most; and a pane as one face."""
    for number, (polarisation, which) in enumerate((("horizontal", 0), ("vertical", 1))):
        scene(ground, plate_m=2.0)
        ph.radar_at((0, 0, 12.0)).rotation_euler.x -= math.radians(11)
        folder = tmp_path / str(number)
        run = ph.run_paths(
            folder, width_px=64, height_px=64, polarisation=polarisation, options=THREE
        )
        rows = run.table()
        over = rows[(rows["transmitter_image"] == 1) & (rows["order"] == 2)]
        assert over.size > 10
        way = over["last_scatterer_m"] - np.array([0.0, 0.0, -12.0])
        distance = np.linalg.norm(way, axis=1)
        gamma = coefficients(index, way[:, 2] / distance)[which]
        radiance = 1 / math.pi * ph.irradiance(distance) * way[:, 1] / distance
        found = ph.radiance(over) / 0.9998
        np.testing.assert_allclose(found, radiance * np.abs(gamma) ** 2, rtol=2e-4)
        # Echoes carry exp(+j w t): the conjugate.
        np.testing.assert_allclose(
            np.exp(1j * over["mirror_phase_rad"]), np.conj(gamma) / np.abs(gamma), atol=1e-6
        )
        phases = frame_paths(open_run(folder).frame(1)).mirror_phase_rad
        np.testing.assert_array_equal(phases, rows["mirror_phase_rad"])


def test_scatterer_behind_the_mirror(tmp_path: Path) -> None:
    """A wall as a mirror, the plate on its far side: seen past its edge, but not mirrored."""
    scene(view_deg=4.0)
    ground = bpy.data.objects["Ground"]
    wall = ((-0.1, 5, -9), (-0.1, 20, -9), (-0.1, 20, 9), (-0.1, 5, 9))
    for vertex, place in zip(ground.data.vertices, wall, strict=True):
        vertex.co = place
    rows = measure(tmp_path, pixels=64).table()
    over = rows[rows["transmitter_image"] == 1]
    assert over.size
    # only what is to the right of the wall's plane, on the transmitter's side, is mirrored
    assert over["last_scatterer_m"][:, 0].min() > -0.1
    assert rows["last_scatterer_m"][rows["order"] == 1][:, 0].min() < -0.15


def test_what_is_seen_in_the_mirror_alone(tmp_path: Path) -> None:
    """A plate behind a screen: only the way over the ground on both legs is free."""
    scene()
    box("Screen", (-2, 35, 3.5), (2, 35.5, 5))
    run = measure(tmp_path, pixels=256)
    rows = run.table()
    plate = rows[rows["last_object"] == run.record().objects.index("Plate") + 1]
    assert plate.size
    assert set(plate["order"]) == {3}
    assert set(plate["receiver_image"]) == {0}  # first vertex on the mirror, as seen
    np.testing.assert_allclose(plate["first_scatterer_m"][:, 2], 0, atol=1e-5)
    np.testing.assert_allclose(
        plate["length_m"],
        2 * np.linalg.norm(plate["last_scatterer_m"] - IMAGE_M, axis=1),
        atol=1e-4,
    )


def test_the_underside_is_another_point(tmp_path: Path) -> None:
    """A level plate: its top is seen directly, its underside in the mirror."""
    scene()
    plate = bpy.data.objects["Plate"]
    for vertex, (x, y) in zip(
        plate.data.vertices, ((-2, 38), (2, 38), (2, 42), (-2, 42)), strict=True
    ):
        vertex.co = (x, y, 2.0)
    rows = measure(tmp_path, pixels=256).table()
    top = rows[rows["order"] == 1]
    assert top.size
    assert set(rows["order"]) == {1, 3}
    assert np.all(rows["mirrors"][rows["order"] == 3] == 1)


@pytest.mark.parametrize("bistatic", [False, True])
def test_narrow_lobes_are_kept_as_measured(tmp_path: Path, bistatic: bool) -> None:
    """A glossy plate: over the mirror it scatters otherwise than towards the radar."""
    scene()
    if bistatic:
        stand_apart(6.0, 5.0, HEIGHT_M)
    plate = bpy.data.objects["Plate"]
    plate.data.materials[0] = nodes.make_material("Glossy", 1e4, 1e4, 1.0, 0.4, penetrable=False)
    plate.data.materials.append(ph.rough_metal())  # the narrowest lobe of all slots decides
    run = measure(tmp_path, pixels=256)
    rows = run.table()
    found = {item.code: item for item in run.record().findings}
    assert found["mirror-lobe-narrow"].subjects == ("Plate",)
    assert np.all(rows["receiver_image"] == 0)
    assert np.all(rows["point"][rows["mirrors"] > 0] == 0)
    assert {1, 2, 3} == set(rows["order"])


def test_a_mirror_that_the_receiver_alone_faces(tmp_path: Path) -> None:
    """A wall between the antennas, closed towards the transmitter: its image is the receiver's."""
    scene(ph.rough_metal)
    stand_apart(8.0, 20.0, HEIGHT_M)
    box("Wall", (3.0, 10.0, 0.0), (3.5, 30.0, 8.0))
    bpy.data.objects["Wall"].data.materials[0] = ph.mirror()
    run = measure(tmp_path, pixels=256)
    record, rows = run.record(), run.table()
    number = 1 + [image.normals[0][0] for image in record.images].index(-1.0)
    plate = rows[rows["last_object"] == record.objects.index("Plate") + 1]
    back = plate[(plate["receiver_image"] == number) & (plate["order"] == 2)]
    direct = {row["point"]: row for row in plate[plate["order"] == 1]}
    assert back.size > 5
    image_m = np.array([6.0, 0.0, HEIGHT_M])
    for row in back:
        point = row["last_scatterer_m"]
        ways = [float(np.linalg.norm(point - place)) for place in (image_m, (0, 0, HEIGHT_M))]
        added_m = row["length_m"] - direct[row["point"]]["length_m"]
        assert added_m == pytest.approx(ways[0] - ways[1], abs=1e-5)
        ratio = row["power_w"] / direct[row["point"]]["power_w"]
        assert ratio == pytest.approx((ways[1] / ways[0]) ** 3, rel=1e-3)
    # seen in the wall as well: what the computed paths hold is there once
    seen = plate[(plate["order"] == 2) & (plate["receiver_image"] == 0)]
    seen = seen[seen["mirrors"] == 0]
    assert not np.any(np.abs(seen["first_scatterer_m"][:, 0] - 3.0) < 1e-3)


def test_a_mirror_that_moves_and_turns(tmp_path: Path) -> None:
    """A wall next to the way: paths over it a frame later, predicted and measured again."""
    scene(ph.rough_metal)
    wall = box("Wall", (3.0, 10.0, 0.5), (3.5, 30.0, 8.0))
    wall.data.materials[0] = ph.mirror()
    rs.move_steadily(wall, (2.0, -1.0, 0.0))
    # a second wall in the same plane: both are one mirror, which cannot follow one of them
    other = box("Other", (3.0, 31.0, 0.5), (3.5, 35.0, 8.0))
    other.data.materials[0] = ph.mirror()
    shared = {item.code: item for item in measure(tmp_path / "both", pixels=16).record().findings}
    assert "Wall" in shared["mirror-moves"].subjects
    bpy.data.objects.remove(other)
    for frame, degrees in ((1, 0.0), (25, 10.0)):
        wall.rotation_euler.z = math.radians(degrees)
        wall.keyframe_insert("rotation_euler", index=2, frame=frame)
    for curve in rs.animation_curves(wall.animation_data):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    frame_s = 1 / bpy.context.scene.render.fps
    burst = Burst(5 / frame_s, 6)
    run = ph.run_paths(
        tmp_path / "one", width_px=128, height_px=128, options=THREE, burst=burst, frames=(1, 2)
    )
    record = run.record(1)
    codes = {item.code for item in record.findings if "mirror" in item.code}
    assert codes == {"mirror-phases-apart"}  # metal, and both polarisations
    plate = record.objects.index("Plate") + 1  # and no second scatterer: points tell rows apart
    first, second = (
        table[(table["last_object"] == plate) & (table["order"] == table["mirrors"] + 1)]
        for table in (run.table(1), run.table(2))
    )
    scene_motion = frame_motion(run.folder / contract.frame_dir(1), record)
    assert scene_motion is not None
    predicted = motion_of_rows(first, scene_motion).lengths_m(np.array([frame_s]), slice(None))

    def key(row: np.ndarray) -> tuple[int, ...]:
        place = np.round(row["last_scatterer_m"] * 1e3).astype(int).tolist()
        return (*place, int(row["receiver_image"]), int(row["transmitter_image"]))

    later = {key(row): row["length_m"] for row in second}
    pairs = [
        (before[0], later[key(row)], row["length_m"], row["mirrors"])
        for before, row in zip(predicted, first, strict=True)
        if key(row) in later
    ]
    found, expected, start, mirrors = np.array(pairs).T
    assert set(mirrors) == {0, 1, 2}
    assert np.abs(expected - start)[mirrors > 0].min() > 0.02
    np.testing.assert_allclose(found, expected, atol=2e-5)


def test_rows_of_the_transmitter_stay_bit_by_bit(tmp_path: Path) -> None:
    scene(view_deg=4.0)
    without = measure(tmp_path / "off", pixels=32, mirror_images=0).table()
    assert without.dtype == PATH_DTYPE
    rows = measure(tmp_path / "on", pixels=32).table()
    assert rows.size > without.size
    own = rows[rows["mirrors"] == 0]
    # The motion file has the mirror's body, too: others have other numbers.
    for column in set(PATH_DTYPE.names or ()) - {"first_body", "last_body"}:
        np.testing.assert_array_equal(own[column], without[column])


def test_the_diffuse_rest_of_a_mirror_stays(tmp_path: Path) -> None:
    """Ground that mirrors half of the power and scatters the other half everywhere."""
    scene(lambda: nodes.make_material("Half", 1e4, 1e4, 0.5, 0.0, penetrable=False), view_deg=25)
    on = measure(tmp_path / "on", pixels=128).table()
    off = measure(tmp_path / "off", pixels=128, mirror_images=0).table()

    def scattered(rows: PathRows) -> float:
        """Power of paths that scatter at the ground first and at the plate next."""
        plate = rows["last_scatterer_m"][:, 1] > RANGE_M - 1e-3
        ground = np.abs(rows["first_scatterer_m"][:, 2]) < 1e-4
        way = rows["last_scatterer_m"] - rows["first_scatterer_m"]
        up = way[:, 2] / np.maximum(np.linalg.norm(way, axis=1), 1e-9)
        mirrored = np.abs(up + rows["direction"][:, 2]) < 1e-3
        chosen = (rows["order"] == 2) & plate & ground & ~mirrored
        return float(rows["power_w"][chosen].sum())

    assert scattered(off) > 0
    images = on["mirrors"] == 0
    assert scattered(on[images]) == pytest.approx(scattered(off), rel=1e-12)


def test_slightly_rough_ground(tmp_path: Path) -> None:
    """An RMS height without a slope: the amplitude over the ground falls by Miller and Brown."""
    powers = []
    for height_m in (0.0, 0.02):
        scene(view_deg=2.0)
        material = bpy.data.objects["Ground"].data.materials[0]
        material["radarsim_rms_height_m"] = height_m
        run = measure(tmp_path / str(height_m), pixels=32)
        rows = run.table()
        powers.append([rows["power_w"][rows["order"] == order].sum() for order in (1, 2, 3)])
        codes = [item.code for item in run.record().findings]
        assert ("mirror-slightly-rough" in codes) == (height_m > 0)
    sine = 8 / math.hypot(8, 40)
    x = 2 * (2 * math.pi * 5.3e9 / ph.C0_MPS * 0.02 * sine) ** 2
    rho = math.exp(-x) * float(np.i0(x))
    assert rho < 0.95
    found = np.array(powers[1]) / powers[0]
    np.testing.assert_allclose(found, [1.0, rho**2, rho**4], rtol=2e-3)


def test_slightly_rough_ground_shows_less(tmp_path: Path) -> None:
    """What the receiver sees in the ground alone has the coherent part on both ways."""
    powers = []
    for height_m in (0.0, 0.02):
        scene()
        box("Screen", (-2, 35, 3.5), (2, 35.5, 5))
        bpy.data.objects["Ground"].data.materials[0]["radarsim_rms_height_m"] = height_m
        run = measure(tmp_path / str(height_m), pixels=128)
        rows = run.table()
        plate = rows[rows["last_object"] == run.record().objects.index("Plate") + 1]
        assert set(plate["order"]) == {3}
        powers.append(plate)
    sine = np.abs(powers[0]["direction"][:, 2])
    x = 2 * (2 * math.pi * 5.3e9 / ph.C0_MPS * 0.02 * sine) ** 2
    rho = np.exp(-x) * np.i0(x)
    assert rho.max() < 0.95
    np.testing.assert_allclose(powers[1]["power_w"] / powers[0]["power_w"], rho**4, rtol=1e-3)


def seen_in_the_ground(folder: Path, ground: Any, polarisation: str, tilt_deg: float) -> ph.PathRun:
    """A plate that is visible in the ground alone; all is turned about the line of sight."""
    scene(ground, view_deg=25.0, plate_m=0.8)
    box("Screen", (-2, 35, 3.5), (2, 35.5, 5))
    bpy.context.view_layer.update()
    for item in bpy.context.scene.objects:
        if item.parent is None:
            item.matrix_world = Matrix.Rotation(math.radians(tilt_deg), 4, "Y") @ item.matrix_world
    return ph.run_paths(folder, width_px=96, height_px=96, polarisation=polarisation, options=THREE)


@pytest.mark.parametrize("ground", [simple_ground, wet_ground])
def test_polarisation_of_what_is_seen_in_the_mirror_alone(tmp_path: Path, ground: Any) -> None:
    """Both ways go over the ground, one of them by Cycles: powers are those of one polarisation."""
    found = []
    for polarisation in ("horizontal", "vertical"):
        run = seen_in_the_ground(tmp_path / polarisation, ground, polarisation, 0.0)
        rows = run.table()
        found.append(rows[rows["last_object"] == run.record().objects.index("Plate") + 1])
        assert set(found[-1]["order"]) == {3}
    r_h, r_v = gammas(3 + 0.4j, np.abs(found[0]["direction"][:, 2]))
    expected = np.abs(r_v / r_h) ** 4
    assert expected.max() < 0.5  # 3 dB and more
    np.testing.assert_allclose(found[1]["power_w"] / found[0]["power_w"], expected, rtol=1e-3)


@pytest.mark.parametrize(
    ("tilt_deg", "screen"), [(0.0, False), (0.4, False), (3.0, False), (0.0, True)]
)
def test_the_transmitter_in_a_mirror(tmp_path: Path, tilt_deg: float, screen: bool) -> None:
    """A plate of 0.5 m at 40 m: tilted by more than 0.36 degrees, it sends the wave elsewhere."""
    rs.new_scene()
    ph.field_of_view(20.0)
    plate = ph.plate_at(RANGE_M, 0.5, ph.mirror())
    plate.rotation_euler.x += math.radians(tilt_deg)
    box("Ball", (1, 20, 1), (2, 21, 2))
    if screen:
        box("Screen", (-1, 30, -1), (1, 31, 1))
    run = ph.run_paths(tmp_path, width_px=32, height_px=32, options={"max_reflections": 2})
    told = [one for one in run.record().findings if one.code == "mirror-echo-not-formed"]
    if tilt_deg or screen:
        assert not told
    else:
        assert told[0].subjects == (plate.name,)
        level_m2 = 4 * math.pi * 0.25**2 / (ph.C0_MPS / 5.3e9) ** 2
        assert told[0].numbers["expected_dbsm"] == pytest.approx(
            10 * math.log10(level_m2), abs=0.01
        )


@pytest.mark.parametrize("polarisation", ["average", "vertical"])
@pytest.mark.parametrize("metal", [True, False])
def test_phases_of_both_polarisations(tmp_path: Path, metal: bool, polarisation: str) -> None:
    """A conductor turns the phase of horizontal waves alone; ground, below Brewster, of both."""
    scene(None if metal else simple_ground)
    options = {"max_reflections": 2}
    run = ph.run_paths(
        tmp_path, width_px=48, height_px=48, polarisation=polarisation, options=options
    )
    told = [one for one in run.record().findings if one.code == "mirror-phases-apart"]
    r_h, r_v = gammas(3 + 0.4j, np.array(math.sin(math.atan2(2 * HEIGHT_M, RANGE_M))))
    apart_deg = 180.0 if metal else abs(math.degrees(np.angle(r_v / r_h)))
    if polarisation == "vertical":
        assert not told
    else:
        assert told[0].subjects == ("Ground",)
        assert told[0].numbers["apart_deg"] == pytest.approx(apart_deg, rel=0.03)


@pytest.mark.parametrize("tilt_deg", [25.0, 70.0])
def test_tilted_conductor_that_the_receiver_sees(tmp_path: Path, tilt_deg: float) -> None:
    """The part of the field that stays vertical over E' = 2 (n . E) n - E, on both ways."""
    powers = []
    for angle_deg in (0.0, tilt_deg):
        run = seen_in_the_ground(tmp_path / str(angle_deg), ph.mirror, "vertical", angle_deg)
        rows = run.table()
        powers.append(rows[rows["last_object"] == run.record().objects.index("Plate") + 1])
        told = [one for one in run.record().findings if one.code == "mirror-turns-polarisation"]
        assert bool(told) == (angle_deg > 0)
    assert powers[0].size == powers[1].size > 4
    assert told[0].subjects == ("Ground",)
    assert float(told[0].numbers["fraction"]) == pytest.approx(
        math.sin(2 * math.radians(tilt_deg)) ** 2, abs=0.02
    )
    way = powers[1]["direction"]
    tilt = math.radians(tilt_deg)
    normal = np.array([math.sin(tilt), 0.0, math.cos(tilt)])
    onward = way - 2 * (way @ normal)[:, None] * normal
    upright = [
        (vectors := (0, 0, 1) - u[:, 2:] * u) / np.linalg.norm(vectors, axis=1, keepdims=True)
        for u in (way, onward)
    ]
    field = 2 * (upright[0] @ normal)[:, None] * normal - upright[0]
    kept = np.sum(field * upright[1], axis=1)
    ratio = powers[1]["power_w"] / powers[0]["power_w"]
    np.testing.assert_allclose(ratio, kept**4, rtol=4e-3)  # it reflects 99.9 % at this angle
    assert kept.max() < 0.8
