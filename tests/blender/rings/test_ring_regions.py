# SPDX-License-Identifier: GPL-3.0-or-later
"""Rings rendered only where they can be seen: the same files, to the bit."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.nodes import assign_radar_material, make_material
from radarsim_addon.blender.rings import ring_job
from radarsim_addon.blender.rings.ring_job import Shells
from radarsim_addon.blender.views import ViewWindow
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


def brute_force(
    view: ViewWindow, source: np.ndarray, triangles: np.ndarray, edges: np.ndarray
) -> list[np.ndarray]:
    """Pixels of each ring by intersecting every ray with every triangle (Moeller, Trumbore)."""
    u = view.left + (np.arange(view.width_px) + 0.5) * view.step_u
    v = view.top - (np.arange(view.height_px) + 0.5) * view.step_v
    rays = np.stack([*np.meshgrid(u, v), -np.ones((v.size, u.size))], axis=-1)
    found = [np.zeros((v.size, u.size), dtype=bool) for _ in edges[1:]]
    for a, b, c in triangles:
        normal = np.cross(b - a, c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = (a @ normal) / (rays @ normal)
        points = rays * depth[..., None]
        inside = depth > 0
        for start, end in ((a, b), (b, c), (c, a)):
            inside &= np.cross(end - start, points - start) @ normal >= 0
        ranges = np.linalg.norm(points - source, axis=-1)
        for ring, pixels in enumerate(found):
            pixels |= inside & (edges[ring] <= ranges) & (ranges < edges[ring + 1])
    return found


def test_regions_hold_all_that_rays_meet() -> None:
    """Random triangles, also around and behind the receiver; the regions are not much larger."""
    random = np.random.default_rng(4)
    lit, needed, taken = 0, 0, 0
    for _ in range(80):
        left, bottom = random.uniform(-1.0, 0.2, 2)
        view = ViewWindow(left, left + 1.2, bottom, bottom + 0.8, 72, 48)
        source = random.normal(0, 1.5, 3)
        size = np.exp(random.uniform(-1, 3))
        centres = random.normal(0, 5, (6, 1, 3)) - (0, 0, 6)
        triangles = centres + random.normal(0, size, (6, 3, 3))
        edges = np.arange(11) * 2.0
        shells = Shells(view, source, edges, float(np.abs(triangles).max()))
        assert shells.take_triangles(triangles)
        met = brute_force(view, source, triangles, edges)
        for pixels, region in zip(met, shells.regions(), strict=True):
            box = [np.flatnonzero(pixels.any(axis=axis)) for axis in (0, 1)]
            if not pixels.any():
                continue
            lit += 1
            needed += math.prod(int(np.ptp(ends)) + 5 for ends in box)
            taken += (region.right - region.left) * (region.bottom - region.top)
            pixels[region.top : region.bottom, region.left : region.right] = False
            assert not pixels.any()
    assert lit > 200
    assert taken < 1.25 * needed


def street() -> None:
    """A ground, a block that lets waves through, a target that moves, an instance of a plate."""
    rs.new_scene()
    ground = rs.add_plate(0.0, size=80.0)
    ground.rotation_euler, ground.location = (math.radians(90), 0, 0), (3.0, 30.0, -1.5)
    half = make_material("Half", n=1.4, kappa=0.5, specularity=0.5, roughness=0.6)
    for y, size in ((9.0, 2.0), (15.0, 3.0)):
        rs.add_plate(y, size=size, tilt_deg=20.0, preset=None).data.materials.append(half)
    target = rs.add_plate(12.5, size=1.0)
    target.location.x = -1.5
    rs.move_steadily(target, (0.0, 60.0, 0.0))
    field = bpy.data.objects.new("Field", bpy.data.meshes.new("Field"))
    field.data.from_pydata([(2.0, 18.0, 0.0), (3.0, 21.0, 1.0)], [], [])
    bpy.context.scene.collection.objects.link(field)
    stone = rs.add_plate(0.0, size=0.7)
    stone.parent, field.instance_type = field, "VERTS"
    assign_radar_material([stone], "metal")
    bpy.context.scene.camera.data.shift_x = 0.1


def test_rings_have_the_same_bits_as_whole_renders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both snapshots, several samples a pixel, behind what lets waves through."""
    size: dict[str, Any] = {"width_px": 48, "height_px": 32, "snapshots": 2, "samples": 2}
    street()
    render = bpy.context.scene.render
    render.use_border, render.border_min_x, render.border_max_y = True, 0.25, 0.75
    rs.run(tmp_path / "parts", **size)
    left = render.use_border, render.border_min_x, render.border_max_y
    assert left == (True, 0.25, 0.75)
    regions: list[Any] = []
    measure = ring_job.regions_by_ring

    def whole(*arguments: Any) -> None:
        regions.extend(measure(*arguments) or ())

    monkeypatch.setattr(ring_job, "regions_by_ring", whole)
    street()
    rs.run(tmp_path / "whole", **size)
    lit = 0
    for snapshot in (0, 1):
        pairs = [rs.images(tmp_path / n, snapshot_index=snapshot) for n in ("parts", "whole")]
        for part, all_of_it in zip(*pairs, strict=True):
            assert all(part[name].tobytes() == all_of_it[name].tobytes() for name in all_of_it)
            lit += any(plane.any() for plane in part.values())
    assert lit >= 10
    pixels = [(one.right - one.left) * (one.bottom - one.top) for one in regions]
    assert len(pixels) >= 12
    assert np.mean(pixels) < 0.5 * 48 * 32


def test_displaced_faces_and_second_reflections_need_the_whole_view(tmp_path: Path) -> None:
    """What is rendered there is not what is evaluated, or may be seen anywhere."""
    street()
    material = bpy.data.objects["Plate"].data.materials[0]
    for changes, expected in (({}, True), ({"max_reflections": 2}, False), ({}, False)):
        with rs.job_for(tmp_path, overwrite=True, **changes) as job:
            task = next(iter(job.pending()))
            job.start(task)
            assert bpy.context.scene.render.use_border is expected
        if changes:
            nodes, links = material.node_tree.nodes, material.node_tree.links
            output = next(n for n in nodes if n.bl_idname == "ShaderNodeOutputMaterial")
            bumps = nodes.new("ShaderNodeDisplacement")
            links.new(bumps.outputs[0], output.inputs["Displacement"])
