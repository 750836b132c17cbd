# SPDX-License-Identifier: GPL-3.0-or-later
"""All objects and instances of a scene at one moment, as arrays that one walk fills.

Blender reports what each evaluation has changed. The next snapshot reads those objects again, and
walks through the scene only where instances may have changed.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import Any

import bpy
import numpy as np
from bpy.app.handlers import persistent
from numpy.typing import NDArray

from ...array_types import Indices, Mask, Real
from .evaluated import Key, evaluated_mesh

#: Numbers by which Blender tells the instances of an instancer apart.
_NUMBERS = 8
#: Settings of an object that decide on instances.
_DECIDING = (
    "instance_type",
    "instance_collection",
    "hide_viewport",
    "parent",
    "show_instancer_for_viewport",
    "use_instance_faces_scale",
    "use_instance_vertices_rotation",
    "instance_faces_scale",
)
#: Arrays of a `Layout`.
_ARRAYS = ("shape", "instancer", "numbers", "visible")


@dataclasses.dataclass(eq=False)
class Shape:
    """What an object and its instances share, unless Geometry Nodes give them other data.

    Attributes
    ----------
    original : bpy.types.Object
    kind
        Type of the evaluated object.
    address
        Tells its evaluated data from others; 0 without data.
    own
        Whether the data is that of the evaluated object, and not made for instances.
    materials : tuple of bpy.types.Material or None
        Originals by slot.
    box : ndarray, shape (8, 3)
        Corners of the bounding box in the object's own axes [Blender units].
    first
        Number of the first instance in Blender's order.
    """

    original: Any
    kind: str
    address: int
    own: bool
    materials: tuple[Any, ...]
    box: Real
    first: int


@dataclasses.dataclass(frozen=True, eq=False)
class Layout:
    """Which objects and instances there are, n in Blender's order.

    Attributes
    ----------
    shape
        Index of each one's shape, (n,).
    instancers
        Original objects that make instances.
    instancer
        Index of each one's instancer, (n,); -1 for an object itself.
    numbers
        Blender's numbers of the instances, (n, 8).
    visible
        Whether Blender draws the object itself, and not only its instances, (n,).
    objects
        Original objects that are there themselves, or make instances.
    row_of
        Row of each original object that is there itself.
    instanced
        Original objects that make instances, and those that have some, with what decides on it.
    """

    shape: Indices
    instancers: list[Any]
    instancer: Indices
    numbers: NDArray[np.int32]
    visible: Mask
    objects: list[Any]
    row_of: dict[Any, int]
    instanced: dict[Any, tuple[Any, ...]]

    def key(self, row: int) -> Key:
        """Return the key of an instance among those of its object; empty for the object itself."""
        index = int(self.instancer[row])
        return () if index < 0 else (self.instancers[index].name_full, *self.numbers[row].tolist())


@dataclasses.dataclass(frozen=True, eq=False)
class Snapshot:
    """Objects and instances at one moment, in Blender units.

    Attributes
    ----------
    depsgraph : bpy.types.Depsgraph
        At that moment.
    layout
        Shared by successive snapshots with the same objects and instances.
    shapes
        See `Shape`.
    matrices
        World matrices, shape (n, 4, 4).
    """

    depsgraph: Any
    layout: Layout
    shapes: list[Shape]
    matrices: Real

    @cached_property
    def corners(self) -> Real:
        """Corners of the bounding boxes in world space, shape (n, 8, 3)."""
        boxes = np.array([shape.box for shape in self.shapes]).reshape(-1, 8, 3)
        turned = boxes[self.layout.shape] @ self.matrices[:, :3, :3].transpose(0, 2, 1)
        return np.asarray(turned + self.matrices[:, None, :3, 3])

    def of_shapes(self, values: list[Any], dtype: Any = bool) -> NDArray[Any]:
        """Return for each object and instance the value that its shape has."""
        return np.array(values, dtype=dtype)[self.layout.shape]

    def label(self, row: int) -> str:
        """Return the name of the object, with its instancer: ``instancer/object``."""
        name: str = self.shapes[self.layout.shape[row]].original.name_full
        index = int(self.layout.instancer[row])
        return name if index < 0 else f"{self.layout.instancers[index].name_full}/{name}"

    @contextlib.contextmanager
    def mesh(self, shape: Shape) -> Iterator[Any]:
        """Provide the evaluated mesh of a shape during a context; None without a surface."""
        if shape.own:
            with evaluated_mesh(shape.original.evaluated_get(self.depsgraph)) as mesh:
                yield mesh
            return
        # Blender frees the object of an instance with the iterator that gave it.
        for row, item in enumerate(self.depsgraph.object_instances):
            if row == shape.first:
                with evaluated_mesh(item.object) as mesh:
                    yield mesh
                return
        raise ReferenceError(f"{shape.original.name} is no longer evaluated")


class _Latest:
    """The last snapshot, and what Blender has evaluated since."""

    def __init__(self) -> None:
        self.snapshot: Snapshot | None = None
        #: Objects to be read again; True where more than their pose has changed.
        self.changed: dict[Any, bool] = {}
        #: Objects that may have other materials.
        self.shaded: set[Any] = set()
        self.layout_changed = self.scene_changed = self.evaluated = False

    def note(self, depsgraph: Any) -> None:
        """Note what Blender has just evaluated."""
        if self.snapshot is None or self.snapshot.depsgraph != depsgraph:
            return
        layout = self.snapshot.layout
        for update in depsgraph.updates:
            self.evaluated = True
            item = update.id.original
            if isinstance(item, bpy.types.Collection):
                self.layout_changed = True
            elif isinstance(item, bpy.types.Scene):  # a setting, or what is hidden
                self.scene_changed = True
            elif isinstance(item, bpy.types.Object):
                geometry, there = update.is_updated_geometry, item in layout.row_of
                # A change of the scene reports all its objects, as shaded again.
                if geometry or update.is_updated_transform:
                    self.layout_changed |= item in layout.instanced
                    if there:
                        self.changed[item] = geometry or self.changed.get(item, False)
                if update.is_updated_shading:
                    self.shaded.add(item)
                self.scene_changed |= item in layout.instanced or not there

    def take(self, depsgraph: Any) -> Snapshot:
        """Return the snapshot of now."""
        last = self.snapshot
        followed = follow_evaluations()
        if last is not None and last.depsgraph == depsgraph and followed:
            try:
                last = self._brought_up_to_date(last)
            except ReferenceError:  # an object was removed
                last = _walk(depsgraph)
        else:
            last = _walk(depsgraph)
        self.snapshot, self.changed, self.shaded = last, {}, set()
        self.layout_changed = self.scene_changed = self.evaluated = False
        return last

    def _brought_up_to_date(self, last: Snapshot) -> Snapshot:
        for shape in last.shapes:
            if shape.own and shape.original in self.shaded:
                shape.materials = _materials(shape.original.evaluated_get(last.depsgraph))
        moved = self.scene_changed and not _is_there(last.layout, last.depsgraph)
        if self.layout_changed or moved:
            return _walk(last.depsgraph, last, self.changed)
        return _read_again(last, self.changed) if self.evaluated else last

    def forget(self) -> None:
        """Drop the snapshot."""
        self.snapshot = None


_latest = _Latest()


@persistent
def _note_evaluation(_scene: Any, depsgraph: Any) -> None:
    _latest.note(depsgraph)


@persistent
def _forget(*_: Any) -> None:
    _latest.forget()


def follow_evaluations() -> bool:
    """Have Blender report evaluations.

    Returns
    -------
    bool
        Whether it did so before.
    """
    missing = [(hooks, function) for hooks, function in _reports() if function not in hooks]
    for hooks, function in missing:
        hooks.append(function)
    return not missing


def ignore_evaluations() -> None:
    """Have Blender report evaluations no longer, until the next snapshot is taken."""
    for hooks, function in _reports():
        if function in hooks:
            hooks.remove(function)
    _latest.forget()


def _reports() -> tuple[tuple[Any, Any], ...]:
    """Lists of handlers, and what belongs into each."""
    handlers = bpy.app.handlers
    return (
        (handlers.depsgraph_update_post, _note_evaluation),
        (handlers.frame_change_post, _note_evaluation),
        (handlers.load_pre, _forget),
        (handlers.undo_pre, _forget),
        (handlers.redo_pre, _forget),
    )


def take_snapshot(depsgraph: Any) -> Snapshot:
    """Return all objects and instances of a depsgraph.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Returns
    -------
    Snapshot
        The same one until Blender evaluates something else.
    """
    return _latest.take(depsgraph)


def _shape(evaluated: Any, original: Any, address: int, own: bool, first: int) -> Shape:
    box = np.array([tuple(corner) for corner in evaluated.bound_box], dtype=np.float64)
    return Shape(original, evaluated.type, address, own, _materials(evaluated), box, first)


def _materials(evaluated: Any) -> tuple[Any, ...]:
    return tuple(slot.material and slot.material.original for slot in evaluated.material_slots)


def _walk(depsgraph: Any, last: Snapshot | None = None, changed: Any = ()) -> Snapshot:
    """Look at all objects and instances; shapes of the last time that are not `changed` stay."""
    instances = depsgraph.object_instances
    count = len(instances)
    matrices = _read(instances, "matrix_world", np.float32, 16, count)
    numbers = _read(instances, "persistent_id", np.int32, _NUMBERS, count)
    visible = _read(instances, "show_self", np.bool_, 1, count)
    repeated = _read(instances, "is_instance", np.bool_, 1, count)
    known = () if last is None else last.shapes
    old = {(one.original, one.address): one for one in known if one.original not in changed}
    shapes: dict[Any, int] = {}
    found: list[Shape] = []
    instancers: dict[Any, int] = {}
    row_of: dict[Any, int] = {}
    shape, instancer = np.empty(count, dtype=np.intp), np.full(count, -1, dtype=np.intp)
    for row, item in enumerate(instances):
        one = item.object
        original, data = one.original, one.data
        index = shapes.get((original, data))
        if index is None:
            index = shapes[original, data] = len(found)
            address = 0 if data is None else data.as_pointer()
            before = old.get((original, address))
            if before is None:
                own = data == original.evaluated_get(depsgraph).data
                before = _shape(one, original, address, own, row)
            else:
                before.first = row
            found.append(before)
        shape[row] = index
        if repeated[row]:
            instancer[row] = instancers.setdefault(item.parent.original, len(instancers))
        else:
            row_of[original] = row
    having = {found[index].original for index in np.unique(shape[instancer >= 0]).tolist()}
    layout = Layout(
        shape,
        list(instancers),
        instancer,
        numbers,
        visible[:, 0],
        _objects(depsgraph),
        row_of,
        _instancing([*having, *instancers]),
    )
    if last is not None and _same(last, layout, found):
        layout = last.layout
    # Blender has the columns of a matrix one after another.
    matrices = matrices.reshape(-1, 4, 4).transpose(0, 2, 1).astype(np.float64)
    return Snapshot(depsgraph, layout, found, np.ascontiguousarray(matrices))


def _objects(depsgraph: Any) -> list[Any]:
    return [item.original for item in depsgraph.objects]


def _is_there(layout: Layout, depsgraph: Any) -> bool:
    """Whether the objects of a layout are still all, and make instances as before."""
    try:
        alike = _instancing(layout.instanced) == layout.instanced
    except ReferenceError:  # removed
        return False
    return alike and _objects(depsgraph) == layout.objects


def _instancing(objects: Iterable[Any]) -> dict[Any, tuple[Any, ...]]:
    return {item: tuple(getattr(item, name) for name in _DECIDING) for item in objects}


def _same(last: Snapshot, layout: Layout, shapes: list[Shape]) -> bool:
    """Whether there are the same objects and instances as the last time."""
    before = last.layout
    pairs = ((getattr(before, name), getattr(layout, name)) for name in _ARRAYS)
    return (
        before.instancers == layout.instancers
        and before.objects == layout.objects
        and [one.original for one in last.shapes] == [one.original for one in shapes]
        and all(np.array_equal(one, other) for one, other in pairs)
    )


def _read(items: Any, name: str, dtype: type[np.generic], width: int, count: int) -> NDArray[Any]:
    values = np.empty(count * width, dtype=dtype)
    items.foreach_get(name, values)
    return values.reshape(count, width)


def _read_again(last: Snapshot, changed: dict[Any, bool]) -> Snapshot:
    """Return a snapshot with some objects read again, which neither make nor have instances."""
    layout, shapes, matrices = last.layout, last.shapes, last.matrices
    if changed:
        matrices = matrices.copy()
    if any(changed.values()):
        shapes = shapes.copy()
    for original, other in changed.items():
        row = layout.row_of[original]
        evaluated = original.evaluated_get(last.depsgraph)
        matrices[row] = evaluated.matrix_world
        if other:
            data = evaluated.data
            address = 0 if data is None else data.as_pointer()
            shapes[layout.shape[row]] = _shape(evaluated, original, address, True, row)
    return Snapshot(last.depsgraph, layout, shapes, matrices)
