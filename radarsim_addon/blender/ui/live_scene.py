# SPDX-License-Identifier: GPL-3.0-or-later
"""The evaluated scene as the live preview needs it, read in parts that take a few milliseconds."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import bpy
import numpy as np

from ...arrays import Real
from ...errors import SceneError
from ...messages import Message
from ...signal.draft import (
    DraftPolygons,
    DraftScene,
    DraftSurface,
    mesh_message,
    scene_message,
)
from ...signal.scene import SMOOTH_BELOW, Surface
from ..materials import surface_at
from ..plan import check_unit_scale, shortest_decimal
from ..rig_settings import own_link_budget, read_measurement, settings
from ..scene import (
    VELOCITY_FRAMES,
    active_radar,
    echoing_boxes,
    keyed_move,
    nothing_moves,
    receiver_record,
    scene_extent,
    transmitter_record,
)
from ..state import Shape, Snapshot, take_snapshot
from .fields import tr
from .scene_reading import any_material_echoes, rig_of

# -------------------------------------------------------------------------------------------------
# Materials as the live preview draws them: closed forms with the inputs of their node groups.
# -------------------------------------------------------------------------------------------------


#: Albedo of a surface without a material in Cycles, and of one whose colour is not known.
_DEFAULT_ALBEDO, _GUESSED_ALBEDO = 0.8, 0.5


class LiveMaterial(NamedTuple):
    """A material in the preview.

    guessed: whether its numbers are. mirrors: whether it mirrors. lobe: whether it has a scattered
    lobe, which is left out.
    """

    surface: DraftSurface
    guessed: bool = False
    mirrors: bool = False
    lobe: bool = False


def live_material(
    material: bpy.types.Material,
    carrier_hz: float,
    beyond_band: str,
    polarisation: str,
    any_material: bool,
) -> LiveMaterial:
    """Return a material at a carrier [Hz]; a ConfigError where its medium cannot be evaluated.

    any_material: materials of Cycles echo, too.
    """
    read = surface_at(material, carrier_hz, beyond_band)
    if read.kind == "light":
        return _foreign(read) if any_material else LiveMaterial(DraftSurface("silent"))
    if read.kind == "sheet":
        return LiveMaterial(DraftSurface("silent"), mirrors=True)
    lobe = read.scattered_lobe() is not None
    wanted = ["n", "kappa", "roughness", *(["specularity"] if read.kind == "simple" else [])]
    values = {name: getattr(read, name) for name in wanted}
    known: dict[str, Any] = {
        name: read.unlinked[name] if x is None else x for name, x in values.items()
    }
    clutter, guessed = read.clutter, None in values.values()
    if read.kind == "simple":
        mirrors = read.mirror is not None
        if mirrors:
            known["roughness"] = 0.0
        return LiveMaterial(DraftSurface("simple", **known), guessed, mirrors, lobe)
    smooth = known["roughness"] <= SMOOTH_BELOW
    if smooth:
        known["roughness"] = 0.0
    surface = DraftSurface(
        "physical",
        **known,
        clutter="" if clutter is None else clutter.name,
        clutter_path="" if clutter is None else clutter.path or "",
        clutter_parameters={} if clutter is None else clutter.parameters,
        polarisation=polarisation,
    )
    return LiveMaterial(surface, guessed, smooth and clutter is None, lobe)


def _foreign(read: Surface) -> LiveMaterial:
    """A material of Cycles: a Lambert surface of the colour at its output, as far as known."""
    if read.is_default:
        return LiveMaterial(DraftSurface("lambert", albedo=_DEFAULT_ALBEDO))
    shader = read.output
    if shader is None or shader.kind not in ("Principled", "Diffuse") or shader.albedo is None:
        return LiveMaterial(DraftSurface("lambert", albedo=_GUESSED_ALBEDO), guessed=True)
    exact = shader.kind == "Diffuse"
    return LiveMaterial(DraftSurface("lambert", albedo=shader.albedo), guessed=not exact)


#: Range limits may exceed the scene's extent by this factor, as those of a run.
_RANGE_MARGIN = 1.25
#: Types of objects whose surface Blender does not give as a mesh.
_MESHLESS = {"CURVES", "POINTCLOUD"}
#: Objects whose F-curves are read in one part.
_OWNERS = 256


@dataclass(frozen=True)
class LiveScene:
    """A scene ready to be sent.

    message: to the process that drafts. notes: what the draft leaves out of this scene.
    """

    message: Message
    notes: tuple[str, ...]

    def same(self, other: LiveScene | None) -> bool:
        """Whether another one would give the same draft."""
        if other is None or self.message.fields != other.message.fields:
            return False
        arrays = other.message.arrays
        return all(np.array_equal(a, arrays[name]) for name, a in self.message.arrays.items())


class LiveReader:
    """Reads scenes; meshes that were read are not read again before they change."""

    def __init__(self) -> None:
        self._keys: WeakKeyDictionary[Shape, int] = WeakKeyDictionary()
        self._next = 0

    def read(self, context: bpy.types.Context) -> Iterator[Message | LiveScene | None]:
        """Yield messages with meshes, then the scene; a `RadarSimError` where it cannot be drafted.

        None after a part of a mesh. Stop where the scene changes before the end.
        """
        scene, snapshot = context.scene, take_snapshot(context.evaluated_depsgraph_get())
        rows = echoing_boxes(snapshot, any_material=True).rows
        unseen = [not s.original.visible_camera or s.original.is_holdout for s in snapshot.shapes]
        rows = rows[~snapshot.of_shapes(unseen)[rows]]
        meshless = snapshot.of_shapes([shape.kind in _MESHLESS for shape in snapshot.shapes])[rows]
        rows, left_out = rows[~meshless], int(meshless.sum())
        for index in np.unique(snapshot.layout.shape[rows]).tolist():
            shape = snapshot.shapes[index]
            if shape not in self._keys:
                yield mesh_message(self._next, _polygons(snapshot, shape))
                self._keys[shape], self._next = self._next, self._next + 1
        yield from self._scene(scene, snapshot, rows.tolist(), left_out)

    def _scene(
        self,
        scene: bpy.types.Scene,
        snapshot: Snapshot,
        rows: list[int],
        left_out: int,
    ) -> Iterator[LiveScene | None]:
        radar, rig = active_radar(scene), rig_of(scene, active_radar(scene))
        if rig.camera.data.type != "PERSP":
            raise SceneError(
                f"Camera {rig.camera.name!r} is of type {rig.camera.data.type}, but the live "
                "preview draws perspective views only. Set Camera > Lens > Type to Perspective, or "
                "switch Live Preview off."
            )
        measurement, render = read_measurement(scene), scene.render
        metres = check_unit_scale(shortest_decimal(scene.unit_settings.scale_length))
        shapes, layout = snapshot.shapes, snapshot.layout
        owners = [_owner(snapshot, row) for row in rows]
        yield None
        frame = scene.frame_current_final
        moves, unknown = yield from _moves([*owners, rig.camera, rig.emitter], frame, metres)
        used = [shapes[layout.shape[row]] for row in rows]
        # the other process forgets what a scene does not use
        self._keys = WeakKeyDictionary({shape: self._keys[shape] for shape in used})
        slots = [shape.materials or (None,) for shape in used]
        materials = dict.fromkeys(chain.from_iterable(slots))
        number = {material: index for index, material in enumerate(materials)}
        any_material = any_material_echoes(radar)
        how = measurement.waveform.carrier_hz, settings(radar).beyond_band, measurement.polarisation
        found = [live_material(material, *how, any_material) for material in materials]
        yield None
        matrices = snapshot.matrices[rows].reshape(-1, 4, 4).copy()
        matrices[:, :3] *= metres
        start_m, stop_m = measurement.range_start_m, measurement.range_stop_m
        if not stop_m:
            extent = scene_extent(snapshot, rig, metres, any_material=any_material)
            stop_m = _RANGE_MARGIN * max(extent.from_emitter_m, extent.from_receiver_m)
        fps = render.fps / shortest_decimal(render.fps_base)
        size = measurement.width_px, measurement.height_px
        drafted = DraftScene(
            radar=measurement.radar,
            link_budget=own_link_budget(radar),
            weather=measurement.weather,
            receiver=receiver_record(rig, snapshot, metres, *size),
            transmitter=transmitter_record(rig, snapshot, metres),
            range_limits_m=(start_m, max(stop_m, start_m + 1.0)),
            surfaces=[one.surface for one in found],
            meshes=[self._keys[shape] for shape in used],
            matrices=matrices,
            slots=[[number[material] for material in one] for one in slots],
            moves=moves,
            interval_s=VELOCITY_FRAMES / fps * render.frame_map_new / render.frame_map_old,
        )
        places = (rig.camera.matrix_world.translation, rig.emitter.matrix_world.translation)
        apart = not np.allclose(*places)
        yield LiveScene(scene_message(drafted), _notes(found, unknown, left_out, apart))


def _owner(snapshot: Snapshot, row: int) -> Any:
    """The object whose F-curves move a row: of an instance, its instancer."""
    index = int(snapshot.layout.instancer[row])
    if index >= 0:
        return snapshot.layout.instancers[index]
    return snapshot.shapes[snapshot.layout.shape[row]].original


def _moves(
    owners: list[Any], frame: float, metres: float
) -> Generator[None, None, tuple[Real, int]]:
    """What moves objects, as `keyed_move`, in metres, and how many of them move by other means."""
    moves = np.tile(np.eye(4), (len(owners), 1, 1))
    unknown = set()
    for index, owner in enumerate(owners):
        if index % _OWNERS == 0:
            yield None
        if nothing_moves(owner):
            continue
        move = keyed_move(owner, frame)
        if move is None:
            unknown.add(owner)
        else:
            moves[index] = move
    moves[:, :3, 3] *= metres
    return moves, len(unknown)


def _polygons(snapshot: Snapshot, shape: Shape) -> DraftPolygons:
    """Return the evaluated mesh of a shape."""
    none, flat = np.zeros(0, dtype=np.int32), np.zeros((0, 3), dtype=np.float32)
    mesh = snapshot.mesh(shape)
    if mesh is None or not len(mesh.sides):
        return DraftPolygons(flat, none, none, none, flat)
    points, corners, starts = mesh.vertices, mesh.corner_vertices, mesh.first_corners
    slots, normals = mesh.slots, mesh.corner_normals
    if mesh.cut is not None:
        corners, starts = mesh.triangles.ravel(), 3 * np.arange(len(mesh.triangles), dtype=np.int32)
        slots = slots[mesh.polygons]
        normals = None if normals is None else normals[mesh.cut].reshape(-1, 3)
    shading = flat if normals is None else normals.astype(np.float32)
    return DraftPolygons(points.astype(np.float32), corners, starts, slots, shading)


def _notes(
    materials: list[LiveMaterial], unknown: int, left_out: int, apart: bool
) -> tuple[str, ...]:
    """What a draft of these materials leaves out."""
    guessed = sum(one.guessed for one in materials)
    mirrors = sum(one.mirrors for one in materials)
    lobes = sum(one.lobe for one in materials)
    texts = (
        (mirrors, tr("materials whose mirror-like part is left out: {count}", count=mirrors)),
        (lobes, tr("materials whose scattered lobe is left out: {count}", count=lobes)),
        (guessed, tr("materials taken as diffuse: {count}", count=guessed)),
        (unknown, tr("objects whose velocity is left out: {count}", count=unknown)),
        (left_out, tr("hair and point clouds, which are left out: {count}", count=left_out)),
        (apart, tr("shadows of the transmitter are left out")),
    )
    return tuple(text for count, text in texts if count)
