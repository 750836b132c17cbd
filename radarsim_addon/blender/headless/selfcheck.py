# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim selfcheck``: whether Cycles on a device behaves as measurements require.

Each fact is tested on a small scene whose answer is known. A function of `CASES` builds the scene
in the current, empty file, renders it with `PathScene`, and yields its facts. The receiver is at
the origin and looks along +Y; lengths are in metres.
"""

from __future__ import annotations

import json
import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...arrays import Real
from ...errors import RadarSimError
from ...physics.fresnel import unpolarised_reflectance
from ...signal.decoding import PixelRays, pixel_rays
from ...terminal import error_line
from ..nodes import make_material
from ..rig_settings import RADAR_PROPERTY, register, settings
from ..run.scene_state import (
    Device,
    Verdict,
    cache_file,
    check,
    choose_device,
    chosen_device,
    keep,
)
from ..scene import setup_rig
from ..state import evaluated_snapshot
from ..views import PathClass, RenderRequest, View, ViewWindow
from ..views.requests import Region, VertexMark
from .console import quiet_blender
from .session import leave_blender, make_job

_SIDE_PX = 24
#: Half the width of the field of view, tangent.
_TANGENT = 0.35
_TRANSMITTER_M = (0.9, 0.0, 0.4)
_WALL_M, _FLOOR_M = 10.0, -2.0
_EIRP_W = 1e6
_METAL = complex(1e4, 1e4)
_PANE = complex(1.5, 0.02)
_PANE_M = (4.0, 4.3)
#: Corners of the opaque plate that shades a part of the wall, not seen by the receiver.
_SHADE = ((1.1, 2.0, -0.1), (1.5, 2.0, -0.1), (1.5, 2.0, 0.7), (1.1, 2.0, 0.7))
#: Float32 roundings of a few reflections, relative.
_ROUNDING = 1e-4


@dataclass(frozen=True)
class Fact:
    """A tested fact: the largest deviation that was found, and the largest that is allowed."""

    name: str
    deviation: float
    bound: float

    @property
    def holds(self) -> bool:
        """Whether the deviation is within the bound; NaN is not."""
        return self.deviation <= self.bound


def measure_facts(folder: Path) -> Iterator[Fact]:
    """Measure all facts on the device of the scene; `folder` is for the runs."""
    if not hasattr(bpy.types.Object, RADAR_PROPERTY):
        register()
    device = bpy.context.scene.cycles.device
    for number, case in enumerate(CASES):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        bpy.context.scene.cycles.device = device
        yield from case(folder / str(number))


def _corner(folder: Path) -> Iterator[Fact]:
    """A wall and a floor of metal, and a plate that shades a part of the wall."""
    metal = make_material("Metal", _METAL.real, _METAL.imag, specularity=0.0)
    _wall(metal)
    _floor(metal)
    _mesh("Shade", list(_SHADE), metal)
    with _Looking(folder, 2) as look:
        first_m, on_wall, cosine = _first_surfaces(look.rays)
        clear = _clear(first_m)
        one = look.render(PathClass(1, 1))
        position = one.position
        pitch = 2 * _TANGENT / _SIDE_PX
        if position is None or one.object_index is None:
            yield Fact("render passes", math.inf, 0.0)
            return
        distance = np.linalg.norm(first_m, axis=-1)
        missed = np.linalg.norm(position - first_m, axis=-1) / (distance * pitch)
        yield Fact("pixel centres", _worst(missed), 1e-3)
        index = np.where(on_wall, look.number("Wall"), look.number("Floor"))
        yield Fact("object numbers", float(np.mean(one.object_index != index)), 0.02)
        power = _lambert(first_m, on_wall, cosine)
        lit, shaded = clear > 0, clear < 0
        yield Fact("power of one reflection", _worst(one.blue[lit] / power[lit] - 1), 1e-3)
        yield Fact("shadows", _worst(one.blue[shaded] / power[shaded]), 0.0)
        length_m = distance + np.linalg.norm(first_m - _TRANSMITTER_M, axis=-1)
        yield from look.encoding("one reflection", one, length_m, lit)

        two = look.render(PathClass(2, 2))
        both = look.render(PathClass(1, 2))
        sums = (one.blue + two.blue)[lit] / both.blue[lit] - 1
        yield Fact("reflections counted", _worst(sums), _ROUNDING)
        echoes = two.blue > 0
        yield Fact("second reflections", float(not 0.2 < np.mean(echoes) < 1.0), 0.0)
        vertex = look.render(PathClass(2, 2), vertex=True)
        last_m = look.last_vertex_m(vertex, two)
        yield Fact("last vertex", _worst(_on_corner(last_m)[echoes]), 1e-2)
        way_m = distance + np.linalg.norm(last_m - first_m, axis=-1)
        way_m += np.linalg.norm(last_m - _TRANSMITTER_M, axis=-1)
        yield from look.encoding("two reflections", two, way_m, echoes, 1e-2)
        # Nothing is transparent: rays that end after one reflection meet the same last surfaces.
        yield from look.marked("", PathClass(2, 2), PathClass(1, 1), _on_corner)
        part = Region(3, 17, 5, 19)
        cropped = look.render(PathClass(1, 1), region=part)
        inside = np.s_[part.top : part.bottom, part.left : part.right]
        again = look.render(PathClass(1, 1))
        yield Fact("parts of a frame", _worst(cropped.blue[inside] - one.blue[inside]), 0.0)
        yield Fact("renders repeated", _worst(again.blue - one.blue), 0.0)


def _pane(folder: Path) -> Iterator[Fact]:
    """A wall seen through a pane with an interior, nearly at normal incidence."""
    _wall(make_material("Metal", _METAL.real, _METAL.imag, specularity=0.0))
    near, far = _PANE_M
    _glass(-3.0)
    with _Looking(folder, 1, tangent=0.01, transmitter_m=(0.0, 0.0, 0.0)) as look:
        wall = look.render(PathClass(1, 1, 2, 2, surface_depth=2))
        front = look.render(PathClass(1, 1, 0, 0, surface_depth=0))
        tail = look.render(PathClass(1, 1, 3, None, surface_depth=3))
        thickness_m = far - near
        index = _PANE
        passed = 1 - float(unpolarised_reflectance(index, 1.0))
        # Lambda is 1 m, two ways
        passed_power = passed**4 * math.exp(-2 * 4 * math.pi * index.imag * thickness_m)
        direct = float(unpolarised_reflectance(_METAL, 1.0)) / math.pi
        direct *= _EIRP_W / (4 * math.pi * _WALL_M**2)
        yield Fact("through a pane", _worst(wall.blue / (direct * passed_power) - 1), 2e-3)
        length_m = 2 * (_WALL_M + (index.real - 1) * thickness_m)
        distance_m = np.full(wall.blue.shape, length_m)
        yield from look.encoding("a pane", wall, distance_m, wall.blue > 0, 5e-3)
        face = (1 - passed) / math.pi * _EIRP_W / (4 * math.pi * near**2)
        yield Fact("transparent surfaces counted", _worst(front.blue / face - 1), 2e-3)
        yield Fact("nothing behind the last surface", _worst(tail.blue / direct), 0.0)


def _corner_behind_pane(folder: Path) -> Iterator[Fact]:
    """A wall and a floor behind a pane that ends above the floor. Lobes are chosen at random."""
    metal = make_material("Metal", _METAL.real, _METAL.imag, specularity=0.0)
    _wall(metal)
    _floor(metal)
    _glass(_FLOOR_M + 0.1)
    with _Looking(folder, 2) as look:
        both = PathClass(2, 2, 2, 2), PathClass(2, 2)
        yield from look.marked(" behind a pane", *both, _on_corner)


def _foreign(folder: Path) -> Iterator[Fact]:
    """Materials of any kind: a world volume encodes the range, and emission is not received."""
    albedo = 0.6
    diffuse = _shader("Diffuse", "ShaderNodeBsdfDiffuse", "Color", (albedo,) * 3 + (1.0,))
    _wall(diffuse)
    shine = _shader("Shine", "ShaderNodeEmission", "Strength", 1e6)
    _mesh("Shine", [(-9.0, 5.0, 3.0), (-5.0, 5.0, 3.0), (-5.0, 8.0, 3.0), (-9.0, 8.0, 3.0)], shine)
    with _Looking(folder, 1, tangent=0.15) as look:
        direction = look.rays.direction
        first_m = direction * (_WALL_M / direction[..., 1:2])
        plain = look.render(PathClass(1, 1), encoded=False)
        to_m = np.array(_TRANSMITTER_M) - first_m
        distance_m = np.linalg.norm(to_m, axis=-1)
        power = albedo / math.pi * _EIRP_W / (4 * math.pi) / distance_m**2
        power *= -to_m[..., 1] / distance_m
        yield Fact("light of the transmitter alone", _worst(plain.blue / power - 1), 1e-3)
        length_m = np.linalg.norm(first_m, axis=-1) + distance_m
        one = look.render(PathClass(1, 1))
        yield from look.encoding("the world", one, length_m, one.blue > 0)


def _wall(material: bpy.types.Material) -> None:
    corners = [(-30.0, _WALL_M, -30.0), (30.0, _WALL_M, -30.0), (30.0, _WALL_M, 30.0),
               (-30.0, _WALL_M, 30.0)]  # fmt: skip
    _mesh("Wall", corners, material)


def _floor(material: bpy.types.Material) -> None:
    corners = [(x, y, _FLOOR_M) for x, y in ((-30, -30), (30, -30), (30, 30), (-30, 30))]
    _mesh("Floor", corners, material)


def _glass(foot_m: float) -> None:
    """Add a pane that begins at this height [m]."""
    # Not about the axis: a ray through the edge of two triangles would count both.
    corners = [(x, y, z) for x in (-3.0, 4.0) for y in _PANE_M for z in (foot_m, 3.0)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    glass = make_material("Pane", _PANE.real, _PANE.imag, specularity=0.0)
    _mesh("Pane", corners, glass, faces)


def _mesh(
    name: str, corners: list[Any], material: bpy.types.Material, faces: Any = ((0, 1, 2, 3),)
) -> None:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, mesh))


def _shader(name: str, kind: str, socket: str, value: Any) -> Any:
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    node = tree.nodes.new(kind)
    node.inputs[socket].default_value = value
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


# Expected values.


def _first_surfaces(rays: PixelRays) -> tuple[Real, Any, Real]:
    """Return where rays meet the wall or the floor, which of both, and the cosine of incidence."""
    direction = rays.direction
    wall = _WALL_M / direction[..., 1]
    with np.errstate(divide="ignore"):
        floor = np.where(direction[..., 2] < 0, _FLOOR_M / direction[..., 2], np.inf)
    on_wall = wall < floor
    cosine = np.where(on_wall, direction[..., 1], -direction[..., 2])
    return direction * np.minimum(wall, floor)[..., None], on_wall, cosine


def _on_corner(points_m: Real) -> Real:
    """Return the distance of points from the wall or the floor."""
    off = np.abs(points_m[..., 1] - _WALL_M), np.abs(points_m[..., 2] - _FLOOR_M)
    return np.asarray(np.minimum(*off))


def _clear(first_m: Real) -> Real:
    """Return 1 where the way to the transmitter clearly passes the plate, -1 where it is clearly
    blocked, 0 in between.
    """
    start = np.array(_TRANSMITTER_M)
    along = (_SHADE[0][1] - start[1]) / (first_m[..., 1] - start[1])
    x, z = (start[axis] + along * (first_m[..., axis] - start[axis]) for axis in (0, 2))
    low, high = _SHADE[0], _SHADE[2]
    outside = np.maximum.reduce([low[0] - x, x - high[0], low[2] - z, z - high[2]])
    crosses = (along > 0) & (along < 1)
    return np.where(~crosses | (outside > 0.02), 1.0, np.where(outside < -0.02, -1.0, 0.0))


def _lambert(first_m: Real, on_wall: Any, cosine: Real) -> Real:
    """Return the radiance of the lit metal towards the receiver."""
    to_m = np.array(_TRANSMITTER_M) - first_m
    distance_m = np.linalg.norm(to_m, axis=-1)
    lit = np.where(on_wall, -to_m[..., 1], to_m[..., 2]) / distance_m
    reflected = unpolarised_reflectance(_METAL, cosine) / math.pi
    return np.asarray(reflected * lit * _EIRP_W / (4 * math.pi) / distance_m**2)


def _worst(deviation: Any) -> float:
    return float(np.max(np.abs(deviation))) if np.size(deviation) else math.inf


class _Looking:
    """A scene that is set for a measurement, and one view of it."""

    def __init__(
        self,
        folder: Path,
        order: int,
        *,
        tangent: float = _TANGENT,
        transmitter_m: tuple[float, ...] = _TRANSMITTER_M,
    ) -> None:
        scene = bpy.context.scene
        rig = setup_rig(scene)
        view = settings(rig)
        given = {"sampling_mode": "paths", "max_reflections": order, "width_px": _SIDE_PX}
        for name, value in {**given, "height_px": _SIDE_PX, "motion": "off"}.items():
            setattr(view, name, value)
        light = next(item for item in rig.children if item.type == "LIGHT")
        light.data.energy = _EIRP_W
        x, y, z = transmitter_m
        light.location = (x, z, -y)  # the rig looks along its -Z with +Y up
        scene.camera.data.angle = 2 * math.atan(tangent)
        self._job: Any = make_job(scene, bpy.context.view_layer, folder, radar=rig)
        self._window = ViewWindow(-tangent, tangent, -tangent, tangent, _SIDE_PX, _SIDE_PX)

    def __enter__(self) -> _Looking:
        self._job.prepare()
        scene = self._job.path_scene
        scene.place(evaluated_snapshot(bpy.context.view_layer))
        record = scene.look(self._window, (0.0, 0.0), 1)
        self.rays = pixel_rays(record, _SIDE_PX, _SIDE_PX)
        return self

    def __exit__(self, *_: Any) -> None:
        self._job.restore()

    def number(self, name: str) -> int:
        """Return the number of an object in the render pass of object numbers."""
        return int(self._job.path_scene.objects.index(name)) + 1

    def render(self, path_class: PathClass, **request: Any) -> View:
        scene = self._job.path_scene
        scene.begin(RenderRequest(path_class, **request), (np.zeros(3), 0.02))
        scene.render()
        view: View = scene.end()
        return view

    def last_vertex_m(self, vertex: View, view: View) -> Real:
        """Return the last vertices from the colours of the transmitter's light."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.moveaxis(vertex.channels() / view.channels() - 1, 0, -1) / 0.02)

    def marked(
        self, where: str, echoes: PathClass, other: PathClass, off: Callable[[Real], Real]
    ) -> Iterator[Fact]:
        """Test the light of the surfaces: it gives last vertices, and does not change echoes.

        Its two halves come in renders of two path classes. `off` is the distance of points from
        their true places.
        """
        if not self._job.path_scene.vertex_marks:
            return
        depth = echoes.depth_max or 0
        plain = self.render(echoes)
        placed = self.render(echoes, mark=VertexMark(2, depth, True))
        white = self.render(other, mark=VertexMark(2, depth, False))
        own = self.render(echoes, mark=VertexMark(2, depth, False))
        changed = placed.channels() - plain.channels()
        yield Fact(f"echoes with marked vertices{where}", _worst(changed), 0.0)
        lit = plain.blue > 0
        if placed.marks is None or white.marks is None or own.marks is None:
            yield Fact(f"marked vertices{where}", math.inf, 0.0)
            return
        apart = (white.marks.channels() - own.marks.channels())[:, lit]
        yield Fact(f"marks in other renders{where}", _worst(apart), 0.0)
        last_m = self.last_vertex_m(placed.marks, white.marks)
        yield Fact(f"marked vertices{where}", _worst(off(last_m)[lit]), 1e-3)

    def encoding(
        self, what: str, view: View, length_m: Real, pixels: Any, bound_m: float = 1e-3
    ) -> Iterator[Fact]:
        """Compare the lengths of both range encodings with the true lengths."""
        k_m = self._job.plan.range_encoding_length_m
        with np.errstate(divide="ignore", invalid="ignore"):
            red = -k_m * np.log(view.red / view.blue)
            green = -k_m / 2 * np.log(view.green / view.blue)
        yield Fact(f"range code, {what}", _worst((red - length_m)[pixels]), bound_m)
        yield Fact(f"second range code, {what}", _worst((green - length_m)[pixels]), bound_m)


#: Scenes, each with the facts that it shows.
CASES = (_corner, _pane, _corner_behind_pane, _foreign)


def verdict_here(device: Device) -> Verdict:
    """Measure all facts in this process; a case that raises an exception is a failed fact."""
    facts: dict[str, tuple[float, float]] = {}
    failed = []
    with tempfile.TemporaryDirectory(prefix="radarsim_") as name, quiet_blender():
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        try:
            choose_device(bpy.context.scene, device)
            for fact in measure_facts(Path(name)):
                shown = fact.deviation if math.isfinite(fact.deviation) else 1e300
                facts[fact.name] = shown, fact.bound
                if not fact.holds:
                    failed.append(fact.name)
        except (RadarSimError, RuntimeError) as error:
            failed.append(f"renders without an error ({str(error).strip()[:200]})")
    return Verdict(facts, tuple(failed))


def check_here(path: str) -> None:
    """Check the device that a file names, replace the file by the verdict, and end the process."""
    data = json.loads(Path(path).read_text(encoding="utf-8"))
    keep(Path(path), verdict_here(Device(data["kind"], tuple(data["ids"]))))
    leave_blender(0)


def main(kind: str) -> int:
    """Check a device again, save the verdict and print it. Return 1 if a fact fails."""
    scene = bpy.context.scene
    device = Device(kind)
    started_s = time.perf_counter()
    try:
        if kind != "CPU":
            choose_device(scene, device)
            device = chosen_device(scene)
    except RadarSimError as error:
        print(error_line(error), file=sys.stderr)
        return error.exit_code
    verdict = check(device)
    keep(cache_file(device), verdict)
    for name, (deviation, bound) in verdict.facts.items():
        mark = "FAILED" if name in verdict.failed else "holds"
        print(f"{mark:7} {name:45} {deviation:9.2g}, at most {bound:g}")
    for name in verdict.failed:
        if name not in verdict.facts:
            print(f"FAILED  {name}")
    count, seconds = len(verdict.failed), time.perf_counter() - started_s
    ended = f"{count} facts fail" if count else "all facts hold"
    print(f"{kind}, Blender {bpy.app.version_string}: {ended} ({seconds:.1f} s)")
    return 1 if verdict.failed else 0
