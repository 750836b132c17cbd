# SPDX-License-Identifier: GPL-3.0-or-later
"""Several walls, panes and hollow rooms: both polarisations through all of them, at every angle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.materials import make_physical_material
from radarsim_addon.blender.nodes import attributes
from radarsim_addon.blender.state import evaluated_snapshot
from radarsim_addon.physics.fresnel import slab_power
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender.slab_scene import walls_of

pytestmark = [pytest.mark.blender, pytest.mark.slow]

CARRIER_HZ = 5.3e9
WAVELENGTH_M = ph.C0_MPS / CARRIER_HZ
BOUND_DB = 0.02
EQUAL = [4.2 + 0j] * 2
MIXED = [5.24 + 0.57j, 6.31 + 0.11j, 1.99 + 0.09j, 2.7 + 0.05j]


def passage(eps: complex, thickness_m: float, angle_deg: float) -> tuple[np.ndarray, float]:
    """Power through a wall, s and p, |1 - r^2|^2 exp(-2 k0 Im(q) d); and the longer path [m]."""
    cosine = math.cos(math.radians(angle_deg))
    q = np.sqrt(eps - 1 + cosine**2 + 0j)
    r = np.array([(cosine - q) / (cosine + q), (eps * cosine - q) / (eps * cosine + q)])
    loss = math.exp(-4 * math.pi * q.imag * thickness_m / WAVELENGTH_M)
    return np.abs(1 - r**2) ** 2 * loss, thickness_m * (q.real - cosine)


def medium(name: str, eps: complex, **keywords: Any) -> Any:
    return make_physical_material(
        name,
        "permittivity",
        carrier_hz=CARRIER_HZ,
        eps_real=eps.real,
        eps_imag=eps.imag,
        **keywords,
    )


def slab(y: float, thickness_m: float, angle_deg: float, material: Any) -> None:
    """A wall across +Y about a height of 0, tilted; without thickness one face."""
    half, depth = 30.0, thickness_m / 2
    corners = [(x, s * depth, z) for s in (-1, 1) for z in (-half, half) for x in (-half, half)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 2, 6, 4), (1, 5, 7, 3), (0, 4, 5, 1), (2, 3, 7, 6)]
    mesh = bpy.data.meshes.new("Wall")
    mesh.from_pydata(corners, [], faces if thickness_m else faces[:1])
    mesh.materials.append(material)
    item = bpy.data.objects.new("Wall", mesh)
    bpy.context.scene.collection.objects.link(item)
    item.location = (0, y, 0)
    item.rotation_euler = (math.radians(angle_deg), 0, 0)


def measured(folder: Path, emitter_y: float | None = None) -> tuple[float, float]:
    """Power and mean length of the plate at 100 m."""
    if emitter_y is not None:
        bpy.data.objects["Radar Emitter"].location = (0, 0, -emitter_y)  # ahead of the rig
    rows = ph.run_paths(folder, width_px=8, height_px=8).table()
    rows = rows[rows["last_scatterer_m"][:, 1] > 99]
    return rows["power_w"].sum(), np.average(rows["length_m"], weights=rows["power_w"])


def through(
    folder: Path, walls: Sequence[tuple[float, float, Any]], angle_deg: float, **keywords: Any
) -> tuple[float, float]:
    """Power ratio [dB] and longer range [m] that walls (y, thickness, material maker) cause."""
    found = []
    for number, used in enumerate(([], walls)):
        rs.new_scene()
        ph.field_of_view(0.2)
        rs.add_plate(100.0)
        for y, thickness_m, make in used:
            slab(y, thickness_m, angle_deg, make())
        found.append(measured(folder / str(number), **keywords))
    (bare_w, bare_m), (power_w, length_m) = found
    return 10 * math.log10(power_w / bare_w), length_m - bare_m


@pytest.mark.parametrize("angle_deg", [37.0, 58.0, 70.0])
@pytest.mark.parametrize("media", [EQUAL, MIXED])
def test_walls_in_a_row(tmp_path: Path, media: list[complex], angle_deg: float) -> None:
    walls, powers, longer_m = [], np.ones(2), 0.0
    for number, eps in enumerate(media):
        thickness_m = 0.05 + 0.01 * number
        walls.append((20.0 + 12 * number, thickness_m, lambda eps=eps: medium("Wall", eps)))
        once, more_m = passage(eps, thickness_m, angle_deg)
        powers, longer_m = powers * once, longer_m + more_m
    got_db, got_m = through(tmp_path, walls, angle_deg)
    assert got_db == pytest.approx(20 * math.log10(powers.mean()), abs=BOUND_DB)
    assert got_m == pytest.approx(2 * longer_m, abs=2e-4)


@pytest.mark.parametrize("emitter_y", [60.0, 12.0])
def test_each_way_has_its_own_mean(tmp_path: Path, emitter_y: float) -> None:
    """Walls at 20, 40 and 70 m: all before the receiver, one or all before the transmitter."""
    places = (20.0, 40.0, 70.0)
    got_db, _ = through(
        tmp_path,
        [(y, 0.05, lambda: medium("Wall", 4.2)) for y in places],
        58.0,
        emitter_y=emitter_y,
    )
    once, _ = passage(4.2, 0.05, 58.0)
    ways = [np.mean(once ** sum(y > start for y in places)) for start in (0.0, emitter_y)]
    assert got_db == pytest.approx(10 * math.log10(ways[0] * ways[1]), abs=BOUND_DB)


def test_panes_and_a_wall(tmp_path: Path) -> None:
    """Two thin panes with interference, and a wall behind them."""
    angle_deg, pane_m = 58.0, 0.008
    pane = lambda: medium("Pane", 6.31 + 0.11j, sheet_thickness_m=pane_m)  # noqa: E731
    walls = [(20.0, 0.0, pane), (32.0, 0.0, pane), (50.0, 0.05, lambda: medium("Wall", 4.2))]
    got_db, _ = through(tmp_path, walls, angle_deg)
    airy = slab_power(
        np.sqrt(6.31 + 0.11j), pane_m, WAVELENGTH_M, math.cos(math.radians(angle_deg))
    )
    panes = np.array([airy.transmitted_s, airy.transmitted_p]) ** 2
    want = np.mean(panes * passage(4.2, 0.05, angle_deg)[0])
    assert got_db == pytest.approx(20 * math.log10(want), abs=BOUND_DB)


def test_vertical_and_horizontal_need_no_further_render(tmp_path: Path) -> None:
    """Walls tilted about X: vertical is p throughout, horizontal is s."""
    for number, name in enumerate(("horizontal", "vertical")):
        powers = []
        for used in (False, True):
            rs.new_scene()
            ph.field_of_view(0.2)
            rs.add_plate(100.0)
            if used:
                for y in (20.0, 40.0):
                    slab(y, 0.05, 58.0, medium("Wall", 4.2))
            run = ph.run_paths(
                tmp_path / f"{name} {used}", width_px=8, height_px=8, polarisation=name
            )
            rows = run.table()
            powers.append(rows["power_w"][rows["last_scatterer_m"][:, 1] > 99].sum())
        once, _ = passage(4.2, 0.05, 58.0)
        want_db = 40 * math.log10(once[number])
        assert 10 * math.log10(powers[1] / powers[0]) == pytest.approx(want_db, abs=BOUND_DB)


@pytest.mark.parametrize(
    ("case", "paths"),
    [("one reflection", None), ("foreign", "all paths"), ("several", "paths of several")],
)
def test_walls_that_average_separately_are_said(
    tmp_path: Path, case: str, paths: str | None
) -> None:
    """With their error, where polarisations cannot be carried along."""
    rs.new_scene()
    ph.field_of_view(2.0)
    rs.add_plate(60.0)
    for y in (20.0, 40.0):
        slab(y, 0.05, 30.0, medium("Wall", 4.2))
    if case == "foreign":
        rs.add_plate(30.0, preset=None).data.materials.append(ph.lambert(0.5))
    options = {"max_reflections": 2} if case == "several" else {}
    run = ph.run_paths(tmp_path, width_px=4, height_px=4, options=options)
    said = [f for f in run.job.findings if f.code == "walls-averaged-separately"]
    if paths is None:
        assert said == []
        return
    (item,) = said
    assert len(item.subjects) == 2 and str(item.numbers["paths"]).startswith(paths)
    for angle_deg in (30.0, 60.0):
        once, _ = passage(4.2, 0.0, angle_deg)
        loss_db = 20 * math.log10(np.mean(once**2) / np.mean(once) ** 2)
        assert item.numbers[f"loss_{angle_deg:.0f}_db"] == pytest.approx(loss_db, rel=1e-4)


@pytest.mark.parametrize("kind", ["plate", "room", "instances"])
def test_walls_of_one_object_average_separately_too(tmp_path: Path, kind: str) -> None:
    rs.new_scene()
    ph.field_of_view(2.0)
    rs.add_plate(60.0)
    if kind == "room":
        room((10.0, 10.0, 10.0), 30.0, 0.2, 4.2)
    else:
        slab(20.0, 0.05, 30.0, medium("Wall", 4.2))
    if kind == "instances":
        first = rs.instance_of(bpy.data.objects["Wall"])
        rs.instance_of(first.instance_collection, (0.0, 15.0, 0.0))
    run = ph.run_paths(tmp_path, width_px=4, height_px=4, options={"max_reflections": 2})
    said = [one for one in run.job.findings if one.code == "walls-averaged-separately"]
    assert len(said) == (kind != "plate")


def room(
    size: tuple[float, float, float], turn_deg: float, thickness_m: float, eps: complex
) -> Any:
    """A box about (0, 20, 0) that Solidify makes hollow, turned about Z."""
    bpy.ops.mesh.primitive_cube_add(location=(0, 20, 0), rotation=(0, 0, math.radians(turn_deg)))
    item = bpy.context.object
    item.data.transform(np.diag([s / 2 for s in size] + [1.0]).tolist())
    solidify = item.modifiers.new("Walls", "SOLIDIFY")
    solidify.thickness, solidify.offset, solidify.use_even_offset = thickness_m, -1, True
    item.data.materials.append(medium("Room", eps))
    return item


def instanced(item: Any, scale: float) -> None:
    """Move an object into a collection that only an instance of another scale shows."""
    item.location = (0, 0, 0)
    rs.instance_of(item, (0, 20, 0)).scale = (scale,) * 3


@pytest.mark.parametrize(
    ("turn_deg", "target_y", "walls", "scale"),
    [(0, 20, 1, 1), (25, 20, 1, 1), (40, 20, 1, 1), (40, 40, 2, 1), (40, 40, 2, 2.5)],
)
def test_hollow_room(
    tmp_path: Path, turn_deg: float, target_y: float, walls: int, scale: float
) -> None:
    """A plate in a room, and behind it; flat enough that floor and ceiling are most of it."""
    thickness_m, eps = 0.2, 4.2 + 0.1j
    found = []
    for used in (False, True):
        rs.new_scene()
        ph.field_of_view(0.3)
        rs.add_plate(target_y, 2.0)
        if used:
            item = room(
                (10.0 / scale, 10.0 / scale, 3.0 / scale), turn_deg, thickness_m / scale, eps
            )
            if scale != 1:
                instanced(item, scale)
        run = ph.run_paths(tmp_path / str(used), width_px=8, height_px=8)
        rows = run.table()
        rows = rows[np.abs(rows["last_scatterer_m"][:, 1] - target_y) < 0.1]
        power_w = rows["power_w"].sum()
        found.append((power_w, np.average(rows["length_m"], weights=rows["power_w"])))
    assert "not-a-layer" not in {item.code for item in run.job.findings}
    assert attributes.OBJECT_SHELL_THICKNESS not in item  # restored
    once, longer_m = passage(eps, thickness_m, turn_deg)
    got_db = 10 * math.log10(found[1][0] / found[0][0])
    assert got_db == pytest.approx(20 * math.log10(np.mean(once**walls)), abs=BOUND_DB)
    assert found[1][1] - found[0][1] == pytest.approx(2 * walls * longer_m, abs=2e-4)


def test_what_is_a_shell() -> None:
    rs.new_scene()

    def walls(*scale: float) -> Any:
        hollow.scale = scale
        bpy.context.view_layer.update()
        found = walls_of(hollow, evaluated_snapshot(bpy.context.view_layer))
        assert found is not None
        return found

    hollow = room((10.0, 10.0, 3.0), 30.0, 0.2, 4.2)
    for scale in ((2.0, 2.0, 2.0), (2.0, 1.0, 1.0), (-1.0, 1.0, 1.0)):
        found = walls(*scale)
        assert found.one_thickness == pytest.approx(0.2, rel=2e-5)
        assert found.share == pytest.approx(1.0) and found.wall.all()
    hollow.modifiers["Walls"].thickness = 1.4  # a block with a small cavity
    assert walls(1.0, 1.0, 1.0).share < 0.75
    hollow.modifiers.clear()  # solid
    assert not walls(1.0, 1.0, 1.0).wall.any()
