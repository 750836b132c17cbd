# SPDX-License-Identifier: GPL-3.0-or-later
"""The evaluated scene as the live preview needs it, read in parts that take a few milliseconds.

What the viewport hides and renders show is not evaluated. `_unevaluated` has it nevertheless, where
its mesh and its F-curves are all that counts.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any
from weakref import WeakKeyDictionary

import bpy
import numpy as np

from ...arrays import Indices, Mask, Real, distances
from ...messages import Message
from ...signal.draft import DraftScene, mesh_message, scene_message
from ...signal.radar import Radar
from ...signal.scene import Mesh, Surface
from ..materials import slot_materials, surface_at
from ..plan import check_unit_scale, shortest_decimal
from ..rig_settings import own_link_budget, read_measurement, settings
from ..scene import (
    VELOCITY_FRAMES,
    Rig,
    active_radar,
    antenna_positions,
    differs_in_viewport,
    hidden_members,
    hidden_objects,
    keyed_worlds,
    nothing_moves,
    ray_flags,
    receiver_record,
    rendered_objects,
    rendered_rows,
    scene_extent,
    transmitter_record,
)
from ..state import Shape, Snapshot, context_snapshot, mesh_counts, read_mesh
from .fields import tr
from .scene_reading import any_material_echoes, rig_of

#: Range limits may exceed the scene's extent by this factor, as those of a run.
_RANGE_MARGIN = 1.25
#: Types of objects whose surface Blender does not give as a mesh.
_MESHLESS = {"CURVES", "POINTCLOUD"}
_NONE = np.empty(0, dtype=np.int32)
_EMPTY = Mesh(np.empty((0, 3)), _NONE, _NONE, _NONE, _NONE)
#: Objects whose F-curves are read in one part.
_OWNERS = 64
#: Objects that are compared in one part.
_COMPARED = 256
#: What Blender fills unused numbers of instances with.
_UNUSED = 2**31 - 1


@dataclass(frozen=True)
class LiveScene:
    """A scene ready to be sent.

    message: to the process that drafts. notes: what the draft leaves out of this scene. pulses: of
    its burst.
    """

    message: Message
    notes: tuple[str, ...]
    pulses: int

    def same(self, other: LiveScene | None) -> bool:
        """Return whether two scenes give the same draft."""
        if other is None or self.message.fields != other.message.fields:
            return False
        arrays = other.message.arrays
        return all(np.array_equal(a, arrays[name]) for name, a in self.message.arrays.items())


@dataclass(frozen=True)
class _Objects:
    """What is drafted: rows of a snapshot, then objects that the viewport hides."""

    snapshot: Snapshot
    rows: Indices
    #: With poses now and `VELOCITY_FRAMES` later, (2, 4, 4) each [Blender units].
    hidden: dict[Any, Real]
    #: How many others have no surface that can be read, and are hidden by the viewport.
    meshless: int
    lost: int

    @cached_property
    def shapes(self) -> list[Shape]:
        """Shape of each row."""
        shapes = self.snapshot.shapes
        return [shapes[index] for index in self.snapshot.layout.shape[self.rows].tolist()]

    @property
    def materials(self) -> list[tuple[Any, ...]]:
        """Materials by slot, one at least."""
        hidden = (slot_materials(item) for item in self.hidden)
        return [one or (None,) for one in chain((s.materials for s in self.shapes), hidden)]

    @property
    def matrices(self) -> Real:
        """(n, 4, 4) [Blender units]."""
        parts = [worlds[:1] for worlds in self.hidden.values()]
        return np.concatenate([self.snapshot.matrices_of(self.rows), *parts])

    @property
    def flags(self) -> Mask:
        """As `ray_flags`."""
        layout, layer = self.snapshot.layout, self.snapshot.view_layer
        own = ray_flags([one.original for one in self.snapshot.shapes], layer)
        # the last one stands for no instancer
        maker = np.append(ray_flags(layout.instancers, layer), np.ones((3, 1), bool), axis=1)
        shown = own[:, layout.shape[self.rows]] & maker[:, layout.instancer[self.rows]]
        return np.append(shown, ray_flags([*self.hidden], layer), axis=1)

    def hidden_corners(self, echoing: set[Any]) -> Real:
        """Return the corners of hidden objects with a material of these, (k, 3) [Blender units]."""
        corners = [
            np.array(item.bound_box) @ pose[:3, :3].T + pose[:3, 3]
            for item, (pose, _) in self.hidden.items()
            if not echoing.isdisjoint(slot_materials(item) or (None,))
        ]
        return np.concatenate([np.zeros((0, 3)), *corners])

    def count_other(self, render: bpy.types.RenderSettings) -> Generator[None, None, int]:
        """Yield after parts; return the number of objects whose settings in the viewport differ
        from those for renders.
        """
        items = [*{*self.snapshot.layout.instancers, *(one.original for one in self.shapes)}]
        found = 0
        for start in range(0, len(items), _COMPARED):
            yield
            found += sum(differs_in_viewport(o, render) for o in items[start : start + _COMPARED])
        return found


class LiveReader:
    """Reads scenes; meshes that were read are not read again before they change."""

    def __init__(self) -> None:
        self._keys: WeakKeyDictionary[Shape, int] = WeakKeyDictionary()
        #: Those of objects that the viewport hides, by `_mesh_stamp`.
        self._hidden_keys: dict[tuple[int, ...], int] = {}
        self._next = 0

    def read(self, context: bpy.types.Context) -> Iterator[Message | LiveScene | None]:
        """Yield messages with meshes, then the scene. `RadarSimError` if no draft of the scene is
        possible.

        None follows each part that takes long, so that the caller can stop when the scene changes.
        """
        scene, snapshot = context.scene, context_snapshot(context)
        rendered = rendered_objects(snapshot.view_layer)
        yield None
        rows = rendered_rows(snapshot, rendered)
        yield None
        meshless = snapshot.of_shapes([shape.kind in _MESHLESS for shape in snapshot.shapes])[rows]
        poses = {
            item: _unevaluated(item, scene.frame_current_final)
            for item in hidden_objects(snapshot, rendered)
        }
        known = {item: worlds for item, worlds in poses.items() if worlds is not None}
        yield None
        lost = len(poses) - len(known) + len(hidden_members(snapshot))
        objects = _Objects(snapshot, rows[~meshless], known, int(meshless.sum()), lost)
        for shape in dict.fromkeys(objects.shapes):
            if shape not in self._keys:
                mesh = snapshot.mesh(shape) or _EMPTY
                yield None
                yield mesh_message(self._next, mesh)
                self._keys[shape], self._next = self._next, self._next + 1
        for item in known:
            if _mesh_stamp(item) not in self._hidden_keys:
                yield mesh_message(self._next, read_mesh(item.data))
                self._hidden_keys[_mesh_stamp(item)], self._next = self._next, self._next + 1
        yield None
        radar = active_radar(scene)
        rig = rig_of(scene, radar)
        motion = _Motion(objects, rig, scene.frame_current_final)
        yield from motion.read()
        # the other process forgets what a scene does not use
        self._keys = WeakKeyDictionary({shape: self._keys[shape] for shape in objects.shapes})
        stamps = [_mesh_stamp(item) for item in known]
        self._hidden_keys = {stamp: self._hidden_keys[stamp] for stamp in stamps}
        yield None
        keys = [self._keys[shape] for shape in objects.shapes]
        keys += [self._hidden_keys[stamp] for stamp in stamps]
        yield from _scene(scene, radar, rig, objects, motion, keys)


def _scene(
    scene: bpy.types.Scene,
    radar: Any,
    rig: Rig,
    objects: _Objects,
    motion: _Motion,
    keys: list[int],
) -> Iterator[LiveScene | None]:
    """Yield the scene of objects, whose meshes have these keys, after its parts."""
    measurement, render = read_measurement(scene), scene.render
    snapshot = objects.snapshot
    metres = check_unit_scale(shortest_decimal(scene.unit_settings.scale_length))
    how = measurement.waveform.carrier_hz, settings(radar).beyond_band
    materials = objects.materials
    surfaces = {one: surface_at(one, *how) for one in dict.fromkeys(chain.from_iterable(materials))}
    any_material = any_material_echoes(radar)
    echoing = {key: one for key, one in surfaces.items() if any_material or one.is_radar}
    number = {material: index for index, material in enumerate(echoing)}
    yield None
    seen, lit, may_echo = objects.flags
    yield None
    matrices, moves = objects.matrices, motion.moves()
    other = yield from objects.count_other(render)
    yield None
    start_m, stop_m = measurement.range_start_m, measurement.range_stop_m
    if not stop_m:
        extent = scene_extent(snapshot, rig, metres, any_material=any_material)
        hidden = objects.hidden_corners(set(echoing))
        far = [distances(hidden, one).max(initial=0.0) for one in antenna_positions(snapshot, rig)]
        farthest_m = max(extent.from_emitter_m, extent.from_receiver_m, metres * max(far))
        stop_m = _RANGE_MARGIN * farthest_m
    matrices[:, :3] *= metres
    moves[:, :3, 3] *= metres
    fps = render.fps / shortest_decimal(render.fps_base)
    size = measurement.width_px, measurement.height_px
    drafted = DraftScene(
        radar=Radar(measurement.waveform, measurement.burst),  # one channel, for speed
        link_budget=own_link_budget(radar),
        weather=measurement.weather,
        polarisation=measurement.polarisation,
        receiver=receiver_record(rig, snapshot, metres, *size),
        transmitter=transmitter_record(rig, snapshot, metres),
        range_limits_m=(start_m, max(stop_m, start_m + 1.0)),
        surfaces=[*echoing.values()],
        meshes=keys,
        matrices=matrices,
        slots=[
            [number.get(material, -1) if echoes else -1 for material in one]
            for one, echoes in zip(materials, may_echo.tolist(), strict=True)
        ],
        met=np.stack([seen, lit]),
        moves=moves,
        interval_s=VELOCITY_FRAMES / fps * render.frame_map_new / render.frame_map_old,
    )
    notes = _notes(drafted.surfaces, objects, other, len(motion.unknown))
    yield LiveScene(scene_message(drafted), notes, measurement.radar.burst.pulses)


class _Motion:
    """What moves objects and antennas in `VELOCITY_FRAMES`, by F-curves: nothing is evaluated."""

    def __init__(self, objects: _Objects, rig: Rig, frame: float) -> None:
        self._snapshot, self._rows, self._frame = objects.snapshot, objects.rows, frame
        self._others = [*objects.hidden, rig.camera, rig.emitter]
        layout = self._snapshot.layout
        by = layout.instancer[self._rows]
        pairs = layout.shape[self._rows] * (len(layout.instancers) + 1) + by
        #: Which row belongs to which pair of an object and its instancer, -1 for none.
        _, first, self._pair_of = np.unique(pairs, return_index=True, return_inverse=True)
        self._pairs = [
            (self._snapshot.shapes[layout.shape[row]].original, int(layout.instancer[row]))
            for row in self._rows[first].tolist()
        ]
        #: Of what is keyed: world space, (4, 4) [Blender units].
        self._moves: dict[Any, Real] = {}
        #: What moves by other means.
        self.unknown: set[Any] = set()

    def read(self) -> Iterator[None]:
        """Read the F-curves, and yield after parts."""
        poses: dict[Any, Real] = {}
        makers = self._snapshot.layout.instancers
        items = [item for item, _ in self._pairs] + [makers[n] for _, n in self._pairs if n >= 0]
        for index, item in enumerate(dict.fromkeys([*items, *self._others])):
            if index % _OWNERS == 0:
                yield None
            if nothing_moves(item):
                continue
            worlds = keyed_worlds(item, (self._frame, self._frame + VELOCITY_FRAMES))
            if worlds is None:
                self.unknown.add(item)
            elif not np.array_equal(*worlds):
                poses[item] = worlds
        if poses:
            now, later = np.stack([*poses.values()], axis=1)
            self._moves = dict(zip(poses, later @ np.linalg.pinv(now), strict=True))
        yield None

    def moves(self) -> Real:
        """Return the moves of all objects, then of receiver and transmitter, (n + 2, 4, 4)."""
        still, instancers = np.eye(4), self._snapshot.layout.instancers
        of_pairs = [self._moves.get(item, still) for item, _ in self._pairs]
        found = np.array(of_pairs).reshape(-1, 4, 4)[self._pair_of]
        order = np.argsort(self._pair_of, kind="stable")
        ends = np.cumsum(np.bincount(self._pair_of, minlength=len(self._pairs)))
        for number, (item, maker) in enumerate(self._pairs):
            if maker >= 0:
                mine = order[ends[number - 1] if number else 0 : ends[number]]
                found[mine] = self._of_instances(item, instancers[maker], self._rows[mine])
        return np.concatenate([found, [self._moves.get(item, still) for item in self._others]])

    def _of_instances(self, item: Any, maker: Any, rows: Indices) -> Real:
        """Return the moves of instances of an object by an instancer, (4, 4) or (n, 4, 4)."""
        outer: Real = self._moves.get(maker, np.eye(4))
        if any(system.settings.type == "EMITTER" for system in maker.particle_systems):
            self.unknown.add(maker)
        inner = self._moves.get(item)
        if maker.instance_type != "COLLECTION":
            as_maker = item == maker or (item.parent == maker and item.animation_data is None)
            if inner is not None and not as_maker:
                self.unknown.add(item)
            return outer
        if self._snapshot.layout.numbers[rows, 1].min() < _UNUSED:  # of an instancer within it
            makers = _makers_in(maker.instance_collection)
            self.unknown.update(one for one in makers if not nothing_moves(one))
        if inner is None:
            return outer
        # The instancer has the world of the original in axes of its own.
        axes = self._snapshot.matrices_of(rows) @ np.linalg.pinv(self._snapshot.matrix_of(item))
        return np.asarray(outer @ axes @ inner @ np.linalg.pinv(axes))


def _makers_in(collection: bpy.types.Collection) -> Iterator[Any]:
    """Yield the objects of a collection that instance other objects, also in collections that they
    instance.
    """
    for item in collection.all_objects:
        if item.instance_type == "COLLECTION" and item.instance_collection is not None:
            yield item
            yield from _makers_in(item.instance_collection)


def _unevaluated(item: bpy.types.Object, frame: float) -> Real | None:
    """Return the poses of an object that Blender has not evaluated, now and `VELOCITY_FRAMES`
    later, (2, 4, 4) [Blender units].

    None if its shape or motion comes from more than its mesh and its F-curves.
    """
    if item.type != "MESH" or item.instance_type != "NONE" or item.data.shape_keys is not None:
        return None
    if any(modifier.show_render for modifier in item.modifiers) or not mesh_counts(item.data)[-1]:
        return None
    return keyed_worlds(item, (frame, frame + VELOCITY_FRAMES))


def _mesh_stamp(item: bpy.types.Object) -> tuple[int, ...]:
    """Return a value that changes when the mesh of an unevaluated object changes."""
    return item.data.as_pointer(), *mesh_counts(item.data)


def _notes(
    surfaces: Sequence[Surface], objects: _Objects, other: int, unknown: int
) -> tuple[str, ...]:
    """Return notes on what a draft of these surfaces and objects leaves out.

    `other` objects have other settings in the viewport than for renders. `unknown` objects have an
    unknown velocity.
    """
    radar = [one for one in surfaces if one.is_radar]
    mirrors = sum(
        one.is_mirror_like and not (one.kind == "physical" and one.clutter) for one in radar
    )
    lobes = sum(one.scattered_lobe() is not None for one in radar)
    guessed = sum(one.is_guessed for one in surfaces)
    meshless, lost = objects.meshless, objects.lost
    texts = (
        (mirrors, tr("materials whose mirror-like part is left out: {count}", count=mirrors)),
        (lobes, tr("materials whose scattered lobe is left out: {count}", count=lobes)),
        (guessed, tr("materials taken as diffuse: {count}", count=guessed)),
        (unknown, tr("objects whose velocity is left out: {count}", count=unknown)),
        (meshless, tr("hair and point clouds, which are left out: {count}", count=meshless)),
        (lost, tr("objects that the viewport hides, which are left out: {count}", count=lost)),
        (other, tr("objects drawn as in the viewport, not as in renders: {count}", count=other)),
    )
    return tuple(text for count, text in texts if count)
