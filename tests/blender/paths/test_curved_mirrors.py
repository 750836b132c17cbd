# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths over spheres and cylinders that mirror, against closed forms and Cycles' own rays."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from radarsim_addon.signal.paths import CURVED_IMAGE_DTYPE, PATH_DTYPE

bpy = pytest.importorskip("bpy")

from mathutils import Vector

from radarsim_addon.blender import nodes
from radarsim_addon.blender.materials import physical_materials as pm
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = [pytest.mark.blender, pytest.mark.slow]

#: Radar at the origin, plate across the boresight, ball to its right.
RADAR_M, PLATE_M = np.zeros(3), 40.0
BALL_M, RADIUS_M = np.array([6.0, 25.0, 0.0]), 1.0
INDEX = 3 + 0.4j


def wet() -> Any:
    """Smooth wet ground, which does not let waves through."""
    return pm.make_physical_material(
        "Wet", "index", carrier_hz=5.3e9, n=INDEX.real, k=INDEX.imag, penetrable=False
    )


def scene(
    material: Any = None, *, view_deg: float = 12.0, place_m: Any = BALL_M, plate_m: float = 1.0
) -> Any:
    """A plate and a smooth ball; returns the ball."""
    rs.new_scene()
    ph.field_of_view(view_deg)
    ph.radar_at(tuple(RADAR_M))
    bpy.ops.mesh.primitive_uv_sphere_add(
        segments=64, ring_count=32, radius=RADIUS_M, location=tuple(place_m)
    )
    ball = bpy.context.object
    ball.name = "Ball"
    ball.data.materials.append(ph.mirror() if material is None else material())
    bpy.ops.object.shade_smooth()
    ph.plate_at(PLATE_M, plate_m, ph.rough_metal())
    return ball


def measure(folder: Path, *, pixels: int = 48, **options: Any) -> ph.PathRun:
    polarisation = options.pop("polarisation", "average")
    return ph.run_paths(
        folder,
        width_px=pixels,
        height_px=pixels,
        polarisation=polarisation,
        options={"max_reflections": 3, **options},
    )


def codes(run: ph.PathRun) -> set[str]:
    """Of mirrors, but for their phases: they are metal, with both polarisations."""
    found = {item.code for item in run.record().findings if item.code.startswith("mirror")}
    return found - {"mirror-phases-apart"}


def coefficient(cosine: float) -> complex:
    """Textbook coefficient across the plane of incidence, exp(-j w t)."""
    root = np.sqrt(INDEX**2 - (1 - cosine**2))
    return complex((cosine - root) / (cosine + root))


def on_ball(end: np.ndarray, antenna: np.ndarray) -> np.ndarray:
    """Point of a sphere from which the way to the antenna and an end is shortest, (3,)."""

    def point(x: np.ndarray) -> np.ndarray:
        across = np.array([-1.0, *x])  # from the middle towards the boresight
        return np.asarray(BALL_M + RADIUS_M * across / np.linalg.norm(across))

    def length(x: np.ndarray) -> float:
        return float(np.linalg.norm(end - point(x)) + np.linalg.norm(point(x) - antenna))

    found = minimize(length, (0.0, 0.0), method="Nelder-Mead", options={"xatol": 1e-9})
    return point(found.x)


def over_ball(end: np.ndarray, antenna: np.ndarray) -> tuple[float, float, complex, np.ndarray]:
    """Longer way than the direct one to a plate across the boresight, level over that one [dB],
    phase factor, and direction from the antenna.
    """
    point = on_ball(end, antenna)
    before, after, away = (np.linalg.norm(v) for v in (point - antenna, end - point, end - antenna))
    cosine = -((point - antenna) @ (point - BALL_M)) / RADIUS_M / before
    beam = (1 + after * (1 / before + 2 / (RADIUS_M * cosine))) * (
        1 + after * (1 / before + 2 * cosine / RADIUS_M)
    )
    # ways are nearly level, so the field is across the plane of incidence
    gamma = coefficient(cosine)
    cosines = (end - point)[1] / after / ((end - antenna)[1] / away)
    level = 10 * math.log10((away / before) ** 2 / beam * cosines * abs(gamma) ** 2)
    turn = gamma.conjugate() / abs(gamma)
    return before + after - away, level, turn, (point - antenna) / before


@pytest.mark.parametrize("apart", [False, True])
def test_all_families_over_a_ball(tmp_path: Path, apart: bool) -> None:
    """Lengths, powers by the divergence of a sphere, phases of upright polarisation."""
    scene(wet, view_deg=2.0)
    antennas = [RADAR_M, np.array([-12.0, 10.0, 0.0]) if apart else RADAR_M]
    move_transmitter(antennas[1])
    run = measure(tmp_path, pixels=34, polarisation="vertical")
    rows = run.table()
    assert rows.dtype == CURVED_IMAGE_DTYPE
    assert codes(run) == {"mirror-rounded"}
    assert {g.version for n, g in run.record().column_groups.items() if n == "scattering"} == {2}
    direct = rows[rows["order"] == 1]
    assert direct.size > 500
    assert rows.size == 4 * direct.size
    assert set(rows["last_object"]) == {run.record().objects.index("Plate") + 1}
    for number in range(0, direct.size, 24):
        mine = rows[rows["point"] == direct["point"][number]]
        family = {(int(one["receiver_image"]), int(one["transmitter_image"])): one for one in mine}
        assert set(family) == {(0, 0), (0, -1), (-1, 0), (-1, -1)}
        end = direct["last_scatterer_m"][number]
        ways = [over_ball(end, antenna) for antenna in antennas]
        for key in ((0, -1), (-1, 0), (-1, -1)):
            one = family[key]
            over = [way for way, image in zip(ways, key, strict=True) if image]
            times = len(over)
            found = 10 * np.log10(one["power_w"] / direct["power_w"][number])
            assert found == pytest.approx(sum(way[1] for way in over), abs=0.05 * times)
            extra = one["length_m"] - direct["length_m"][number]
            assert extra == pytest.approx(sum(way[0] for way in over), abs=1e-5)
            phase = np.exp(1j * one["mirror_phase_rad"])
            assert phase == pytest.approx(math.prod(way[2] for way in over), abs=0.02)
            assert (one["mirrors"], one["order"]) == (times, 1 + times)
        np.testing.assert_allclose(family[-1, 0]["direction"], ways[0][3], atol=1e-5)


def move_transmitter(place: np.ndarray) -> None:
    emitter = next(one for one in bpy.data.objects if one.type == "LIGHT")
    emitter.matrix_world.translation = Vector(place)


def test_cylinder(tmp_path: Path) -> None:
    """An upright column: in plan a circle, along the axis a plane."""
    scene(view_deg=2.0)
    bpy.data.objects.remove(bpy.data.objects["Ball"])
    bpy.ops.mesh.primitive_cylinder_add(
        vertices=64, radius=RADIUS_M, depth=30, location=tuple(BALL_M)
    )
    column = bpy.context.object
    column.data.materials.append(ph.mirror())
    for face in column.data.polygons:
        face.use_smooth = len(face.vertices) == 4
    rows = measure(tmp_path, pixels=34).table()
    over = rows[(rows["transmitter_image"] == -1) & (rows["receiver_image"] == 0)]
    direct = {int(one["point"]): one for one in rows[rows["order"] == 1]}
    assert over.size > 500
    for one in over[::24]:
        end = one["last_scatterer_m"]
        away = np.linalg.norm(end)
        # The column unrolls: both ways have one slope, so lengths in plan decide.
        angles = np.linspace(-math.pi, 0, 20_001)
        for _ in range(3):
            plan = BALL_M[:2] + RADIUS_M * np.stack([np.cos(angles), np.sin(angles)], axis=1)
            lengths = np.linalg.norm(plan, axis=1) + np.linalg.norm(end[:2] - plan, axis=1)
            best = angles[np.argmin(lengths)]
            angles = best + (angles - angles.mean()) * 1e-3
        plan = BALL_M[:2] + RADIUS_M * np.array([math.cos(best), math.sin(best)])
        share = np.linalg.norm(plan) / lengths.min()
        point = np.array([*plan, share * end[2]])
        before, after = np.linalg.norm(point), np.linalg.norm(end - point)
        assert one["length_m"] - away == pytest.approx(before + after, abs=1e-5)
        # Nearly level ways: the beam widens as over a circle in plan, and as over a plane.
        normal = (plan - BALL_M[:2]) / RADIUS_M
        cosine = -(plan @ normal) / np.linalg.norm(plan)
        beam = (1 + after / before) * (1 + after * (1 / before + 2 / (RADIUS_M * cosine)))
        spread = (away / before) ** 2 / beam * ((end - point)[1] / after) / (end[1] / away)
        found = one["power_w"] / direct[int(one["point"])]["power_w"]
        assert 10 * np.log10(found / spread / 0.9998) == pytest.approx(0, abs=0.05)


def test_cycles_sees_as_much_in_the_ball(tmp_path: Path) -> None:
    """The receiver's own rays over the ball, which paths by Newton replace, have the same power."""
    ball = scene(view_deg=70.0, place_m=np.array([7.0, 22.0, 0.0]))
    ball.scale = (4, 4, 4)
    bpy.data.objects.remove(bpy.data.objects["Plate"])
    # turned so that the radar and the ball see it at like angles
    corners = [(-8 + 1.8 * u, 20 + 2.4 * u, v) for u, v in ((-1, -3), (1, -3), (1, 3), (-1, 3))]
    ph.quad("Plate", corners, ph.rough_metal())
    pixels = 512
    off = measure(tmp_path / "off", pixels=pixels, mirror_images=0)
    assert codes(off) == {"mirror-curved-off"}
    assert off.table().dtype == PATH_DTYPE
    traced = off.table()[off.table()["order"] == 2]
    rows = measure(tmp_path / "on", pixels=pixels).table()
    back = rows[(rows["receiver_image"] == -1) & (rows["transmitter_image"] == 0)]
    assert traced.size > 150
    ratio = back["power_w"].sum() / traced["power_w"].sum()
    assert 10 * math.log10(ratio) == pytest.approx(0, abs=0.15)
    assert not np.any((rows["order"] == 2) & (rows["mirrors"] == 0))


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> None:
    middle, half = np.add(low, high) / 2, np.subtract(high, low) / 2
    bpy.ops.mesh.primitive_cube_add(size=2, location=tuple(middle))
    item = bpy.context.object
    item.scale = half
    item.data.materials.append(ph.rough_metal())


@pytest.mark.parametrize(
    ("low", "high", "free"),
    [
        ((1.5, 31, -3), (4.5, 31.2, 3), False),  # between ball and plate
        ((7.2, 26, -3), (9.0, 27, 3), True),  # behind the ball
    ],
)
def test_obstacles(tmp_path: Path, low: Any, high: Any, free: bool) -> None:
    scene(view_deg=1.0)
    box(low, high)
    rows = measure(tmp_path, pixels=16).table()
    assert np.any(rows["order"] == 1)
    assert np.any(rows["mirrors"] > 0) == free


def test_what_the_ball_alone_shows_stays(tmp_path: Path) -> None:
    """A plate beyond the field of view: its image in the ball is measured, and nothing is added."""
    scene(view_deg=14.0, place_m=np.array([1.0, 15.0, 0.0]), plate_m=9.0)
    bpy.data.objects["Plate"].location.x = -14.0
    rows = measure(tmp_path, pixels=256).table()
    assert rows.size > 3
    assert set(rows["order"]) == {2}
    assert set(rows["mirrors"]) == {0}


def inside_out() -> None:
    """A bowl: half of a ball, open towards the ways to the plate."""
    ball = bpy.data.objects["Ball"]
    mesh = ball.data
    keep = [face.index for face in mesh.polygons if face.center.x > 0.1]
    faces = [tuple(mesh.polygons[n].vertices) for n in keep]
    bowl = bpy.data.meshes.new("Bowl")
    bowl.from_pydata([4 * v.co for v in mesh.vertices], [], faces)
    for face in bowl.polygons:
        face.use_smooth = True
    bowl.materials.append(mesh.materials[0])
    ball.data = bowl


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    ball = scene(view_deg=6.0)
    assert codes(measure(tmp_path / "one", pixels=8, max_reflections=1)) == {
        "mirrors-need-reflections"
    }
    assert codes(measure(tmp_path / "two", pixels=8, max_reflections=2)) == {
        "mirror-both-ways-left-out", "mirror-rounded",
    }  # fmt: skip
    ball.data.materials[0] = ph.principled("Paint", (0.5, 0.5, 0.5), 0.0)
    run = measure(tmp_path / "foreign", pixels=8, range_encoding="world")
    assert codes(run) == {"mirror-curved"}
    assert run.table().dtype == PATH_DTYPE
    scene(view_deg=6.0)
    ph.radar_at((0, 0, 0))
    bpy.data.objects["Ball"].data.shade_flat()
    assert "mirror-curved" not in codes(measure(tmp_path / "flat", pixels=8))


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (inside_out, "mirror-curved-in-a-row"),
        (lambda: coarse(6), "mirror-curved"),
        (inside_out, "mirror-focuses"),
        (lambda: glossy(), "mirror-curved-target"),
    ],
)
def test_mirrors_and_targets_without_paths(tmp_path: Path, change: Any, expected: str) -> None:
    scene(view_deg=6.0)
    change()
    run = measure(tmp_path, pixels=8)
    assert expected in codes(run)
    rows = run.table()
    assert rows.dtype == PATH_DTYPE or not np.any(rows["transmitter_image"] < 0)


def coarse(sides: int) -> None:
    """A column of few sides that is shaded smooth."""
    bpy.data.objects.remove(bpy.data.objects["Ball"])
    bpy.ops.mesh.primitive_cylinder_add(vertices=sides, radius=1, depth=9, location=tuple(BALL_M))
    bpy.context.object.data.materials.append(ph.mirror())
    bpy.ops.object.shade_smooth()


def glossy() -> None:
    plate = bpy.data.objects["Plate"]
    plate.data.materials[0] = nodes.make_material("Glossy", 1e4, 1e4, 1.0, 0.4, penetrable=False)


def test_the_ball_lights_what_the_transmitter_does_not(tmp_path: Path) -> None:
    """A wall between the transmitter and the plate: the paths via the ball on transmit stay."""
    tables = []
    for name in ("free", "shaded"):
        scene(wet, view_deg=1.0)
        move_transmitter(np.array([-12.0, 10.0, 0.0]))
        if name == "shaded":
            box((-7.5, 24, -3), (-5.0, 24.2, 3))
        rows = measure(tmp_path / name, pixels=8).table()
        over = rows[rows["transmitter_image"] < 0]
        tables.append(over[np.lexsort((over["mirrors"], over["point"]))])
        assert np.any(rows["transmitter_image"] == 0) == (name == "free")
    free, shaded = tables
    assert free.size == shaded.size > 100
    for column, bound in (("power_w", 1e-5), ("length_m", 1e-9), ("mirror_phase_rad", 1e-9)):
        np.testing.assert_allclose(shaded[column], free[column], rtol=bound)
    assert np.array_equal(shaded["receiver_image"], free["receiver_image"])


def test_orthographic_cameras_are_named(tmp_path: Path) -> None:
    scene(view_deg=6.0)
    bpy.context.scene.camera.data.type = "ORTHO"
    run = measure(tmp_path, pixels=8)
    assert "mirror-curved-orthographic" in codes(run)
