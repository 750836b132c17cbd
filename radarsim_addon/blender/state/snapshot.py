# SPDX-License-Identifier: GPL-3.0-or-later
"""All objects and instances of a scene at one moment, as arrays that one walk fills.

`walk` looks at all of them. Blender reports what each evaluation has changed: `take_snapshot` reads
those objects again (`read_again`), and walks through the scene only where instances may have
changed. Few of many objects move from one moment to the next, so a `Snapshot` keeps the arrays of
the last walk, and apart from them the rows that were read since. Lengths are Blender units.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import bpy
import numpy as np
from bpy.app.handlers import persistent
from numpy.typing import NDArray

from ...arrays import Indices, Mask, Real
from ...signal.scene import Mesh
from .meshes import MESHED, OF_POINTS, evaluated_mesh, points_of, read_mesh, read_numbers

#: Identifies an instance among those of its object: the instancer's name, then Blender's numbers.
#: Empty for the object itself.
Key = tuple[Any, ...]


class EvaluatedObject(NamedTuple):
    """One object, or one instance of it.

    Blender reuses the data of instances: read what you need before the next object.
    """

    evaluated: bpy.types.Object
    original: bpy.types.Object
    #: Original object that makes the instance; None for the object itself.
    instancer: Any
    key: Key
    matrix_world: Any
    #: Whether Blender draws the object itself, and not only its instances.
    visible: bool

    @property
    def label(self) -> str:
        """Name of the object, with its instancer: ``instancer/object``."""
        name: str = self.original.name_full
        instancer = name if self.instancer is None else self.instancer.name_full
        return name if instancer == name else f"{instancer}/{name}"

    @property
    def matrix(self) -> Real:
        """World matrix in float64, (4, 4)."""
        return np.array(self.matrix_world, dtype=np.float64)

    @property
    def box(self) -> Real:
        """Corners of the bounding box in the object's own axes, (8, 3)."""
        return np.array([tuple(corner) for corner in self.evaluated.bound_box], dtype=np.float64)


def evaluated_objects(depsgraph: bpy.types.Depsgraph) -> Iterator[EvaluatedObject]:
    """Yield all objects and instances in Blender's order, each one valid until the next one."""
    for item in depsgraph.object_instances:
        instancer = item.parent.original if item.is_instance else None
        yield EvaluatedObject(
            item.object,
            item.object.original,
            instancer,
            () if instancer is None else (instancer.name_full, *item.persistent_id),
            item.matrix_world,
            item.show_self,
        )


@dataclass(frozen=True, eq=False)
class Walked:
    """What one walk has found; what follows from it is computed once."""

    #: Index of each one's shape, (n,).
    shape: Indices
    #: Corners of the shapes' bounding boxes, (shapes, 8, 3).
    boxes: Real
    #: World matrices, (n, 4, 4).
    matrices: Real

    @cached_property
    def corners(self) -> Real:
        """Corners of the bounding boxes in world space, (n, 8, 3)."""
        return box_corners(self.boxes[self.shape], self.matrices)

    @cached_property
    def spheres(self) -> Real:
        """Centres of the boxes in world space, and distances of their corners, (n, 4)."""
        return box_spheres(self.corners)

    @cached_property
    def largest(self) -> Real:
        """Largest size of a number in each matrix, (n,); NaN where one is NaN."""
        return np.asarray(np.abs(self.matrices).max(axis=(1, 2), initial=0.0))


def box_corners(boxes: Real, matrices: Real) -> Real:
    """Return the corners of boxes (n, 8, 3) of these matrices (n, 4, 4) in world space."""
    return np.asarray(boxes @ matrices[:, :3, :3].transpose(0, 2, 1) + matrices[:, None, :3, 3])


def box_spheres(corners: Real) -> Real:
    """Return centres and radii (n, 4) of boxes with these corners (n, 8, 3)."""
    centre = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1, initial=0.0)
    return np.column_stack([centre, radius])


#: Numbers by which Blender tells the instances of an instancer apart.
_NUMBERS = 8
#: Snapshots keep what has moved apart from the rest up to one in so many rows.
_FEW = 8
#: Rows of a part of a walk, and most parts.
_ROWS, _MOST_PARTS = 128, 40
#: Walks that evaluations may end early in a row; the next one is made at once.
_RESTARTS = 3
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


@dataclass(eq=False)
class Shape:
    """What an object and its instances share, unless Geometry Nodes give them other data."""

    original: bpy.types.Object
    #: Type of the evaluated object.
    kind: str
    #: Tells its evaluated data from others; 0 without data.
    address: int
    #: Whether the data is that of the evaluated object, and not made for instances.
    own: bool
    #: Originals by slot, None for an empty one.
    materials: tuple[Any, ...]
    #: Corners of the bounding box in the object's own axes, (8, 3).
    box: Real
    #: Number of the first instance in Blender's order.
    first: int
    #: What `Snapshot.face_count` has read.
    faces: int | None = None
    #: What `Snapshot.mesh` has read.
    mesh: Mesh | None = None


@dataclass(frozen=True, eq=False)
class Layout:
    """Which objects and instances there are, n in Blender's order."""

    #: Index of each one's shape, (n,).
    shape: Indices
    #: Original objects that make instances.
    instancers: list[Any]
    #: Index of each one's instancer, (n,); -1 for an object itself.
    instancer: Indices
    #: Blender's numbers of the instances, (n, 8).
    numbers: NDArray[np.int32]
    #: Whether Blender draws the object itself, and not only its instances, (n,).
    visible: Mask
    #: Original objects that are there themselves, or make instances.
    objects: list[Any]
    #: Row of each original object that is there itself.
    row_of: dict[Any, int]
    #: Original objects that make instances, and those that have some, with what decides on it.
    instanced: dict[Any, tuple[Any, ...]]

    def key(self, row: int) -> Key:
        """Return the key of an instance among those of its object; empty for the object itself."""
        index = int(self.instancer[row])
        return () if index < 0 else (self.instancers[index].name_full, *self.numbers[row].tolist())

    def keys(self, rows: Indices) -> list[Key]:
        """Return the key of each of these rows."""
        used = np.unique(self.instancer[rows]).tolist()
        names = {index: self.instancers[index].name_full for index in used if index >= 0}
        pairs = zip(self.instancer[rows].tolist(), self.numbers[rows].tolist(), strict=True)
        return [() if index < 0 else (names[index], *numbers) for index, numbers in pairs]


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Objects and instances at one moment; `walked` has the arrays by these names.

    Where rows will do, ask for these: `matrices` and `corners` are copies of all.
    """

    #: At that moment.
    depsgraph: bpy.types.Depsgraph
    #: Shared by successive snapshots with the same objects and instances.
    layout: Layout
    shapes: list[Shape]
    walked: Walked
    #: Rows that were read again since, ascending, (k,), and their world matrices, (k, 4, 4).
    moved: Indices
    moved_matrices: Real

    @cached_property
    def matrices(self) -> Real:
        return self._of_all(self.walked.matrices, self.moved_matrices)

    @cached_property
    def corners(self) -> Real:
        return self._of_all(self.walked.corners, self._moved_corners)

    @cached_property
    def spheres(self) -> Real:
        return self._of_all(self.walked.spheres, box_spheres(self._moved_corners))

    @cached_property
    def largest(self) -> Real:
        moved = np.abs(self.moved_matrices).max(axis=(1, 2), initial=0.0)
        return self._of_all(self.walked.largest, moved)

    def matrix(self, row: int) -> Real:
        """Return the world matrix of a row, (4, 4)."""
        at = int(np.searchsorted(self.moved, row))
        again = at < self.moved.size and self.moved[at] == row
        found: Real = self.moved_matrices[at] if again else self.walked.matrices[row]
        return found

    def matrices_of(self, rows: Indices) -> Real:
        """Return the world matrices of some rows, (m, 4, 4)."""
        return self._of_rows(rows, self.walked.matrices, self.moved_matrices)

    def corners_of(self, rows: Indices) -> Real:
        """Return the corners of the bounding boxes of some rows in world space, (m, 8, 3)."""
        return self._of_rows(rows, self.walked.corners, self._moved_corners)

    @cached_property
    def _moved_corners(self) -> Real:
        boxes = [self.shapes[index].box for index in self.layout.shape[self.moved].tolist()]
        return box_corners(np.array(boxes).reshape(-1, 8, 3), self.moved_matrices)

    def _of_all(self, walked: Real, moved: Real) -> Real:
        if not self.moved.size:
            return walked
        found = walked.copy()
        found[self.moved] = moved
        return found

    def _of_rows(self, rows: Indices, walked: Real, moved: Real) -> Real:
        found = walked[rows]
        if self.moved.size:
            at = np.minimum(np.searchsorted(self.moved, rows), self.moved.size - 1)
            again = self.moved[at] == rows
            found[again] = moved[at[again]]
        return found

    def of_shapes(self, values: list[Any], dtype: Any = bool) -> NDArray[Any]:
        """Return the value of the shape of each object and instance. `values` has one value per
        shape.
        """
        return np.array(values, dtype=dtype)[self.layout.shape]

    def label(self, row: int) -> str:
        """Return the name of the object with its instancer: ``instancer/object``.

        If Blender draws the faces of a text, curve or metaball as an instance, or if Geometry Nodes
        instance something within an object, the object is its own instancer.
        """
        name: str = self.shapes[self.layout.shape[row]].original.name_full
        index = int(self.layout.instancer[row])
        instancer = name if index < 0 else self.layout.instancers[index].name_full
        return name if instancer == name else f"{instancer}/{name}"

    @cached_property
    def own_shapes(self) -> dict[bpy.types.Object, Shape]:
        """Shapes of the original objects, without those that only instances have."""
        return {shape.original: shape for shape in self.shapes if shape.own}

    def evaluated(self, original: bpy.types.Object) -> bpy.types.Object:
        """Return an object as it was evaluated."""
        return original.evaluated_get(self.depsgraph)

    @property
    def view_layer(self) -> bpy.types.ViewLayer:
        """What was evaluated."""
        return self.depsgraph.view_layer

    @property
    def scene(self) -> bpy.types.Scene:
        """The scene of the view layer."""
        return self.depsgraph.scene

    def points_within(self, items: Iterable[bpy.types.Object]) -> dict[str, bytes]:
        """Return the points of hair and point clouds that nodes make within objects of other types,
        by the names of the objects.

        `items` are the objects that may have nodes.
        """
        found: dict[str, bytes] = {}
        if not any(modifier.type == "NODES" for item in items for modifier in item.modifiers):
            return found
        for one in self.depsgraph.object_instances:
            item = one.object
            if item.type in OF_POINTS and item.original.type not in OF_POINTS:
                points = points_of(item).tobytes()
                if points:
                    found[item.name] = found.get(item.name, b"") + points
        return found

    def matrix_of(self, original: bpy.types.Object) -> Real:
        """Return the world matrix of an object, (4, 4)."""
        row = self.layout.row_of.get(original)
        if row is not None:
            return self.matrix(row)
        # only instances of it are there
        return np.array(original.evaluated_get(self.depsgraph).matrix_world, dtype=np.float64)

    def mesh_of(self, original: bpy.types.Object) -> Mesh | None:
        """Return the evaluated mesh of an object, as `mesh`."""
        shape = self.own_shapes.get(original)
        return None if shape is None else self.mesh(shape)

    def mesh(self, shape: Shape) -> Mesh | None:
        """Return the evaluated mesh of a shape, which is read once; None without a surface."""
        if shape.kind not in MESHED:
            return None
        if shape.mesh is None:
            with self._evaluated(shape) as mesh:
                if mesh is not None:
                    shape.mesh = read_mesh(mesh)
                    shape.faces = len(shape.mesh.sides)
        return shape.mesh

    def face_count(self, shape: Shape) -> int:
        """Return the number of polygons of a shape; 0 without a surface."""
        if shape.faces is None:
            with self._evaluated(shape) as mesh:
                shape.faces = 0 if mesh is None else len(mesh.polygons)
        return shape.faces

    def _evaluated(self, shape: Shape) -> contextlib.AbstractContextManager[bpy.types.Mesh | None]:
        if shape.own:
            return evaluated_mesh(shape.original.evaluated_get(self.depsgraph))
        return self._mesh_of_instances(shape)

    @contextlib.contextmanager
    def _mesh_of_instances(self, shape: Shape) -> Iterator[Any]:
        # Blender frees the object of an instance with the iterator that gave it.
        for row, item in enumerate(self.depsgraph.object_instances):
            if row == shape.first:
                with evaluated_mesh(item.object) as mesh:
                    yield mesh
                return
        raise ReferenceError(f"{shape.original.name} is no longer evaluated")


def _shape(
    evaluated: bpy.types.Object, original: bpy.types.Object, address: int, own: bool, first: int
) -> Shape:
    box = np.empty(24, dtype=np.float32)
    evaluated.bound_box.foreach_get(box)
    corners = box.reshape(8, 3).astype(np.float64)
    return Shape(original, evaluated.type, address, own, slot_materials(evaluated), corners, first)


def slot_materials(item: bpy.types.Object) -> tuple[Any, ...]:
    """Return the original materials in the slots of an object; None for an empty slot.

    For an evaluated object, they include the materials that Geometry Nodes assign.
    """
    return tuple(slot.material and slot.material.original for slot in item.material_slots)


def walk(
    depsgraph: bpy.types.Depsgraph, last: Snapshot | None, changed: Any
) -> Generator[None, None, Snapshot]:
    """Read all objects and instances, and yield after parts, between which Blender must evaluate
    nothing. Shapes of the last snapshot are reused, except those of `changed` objects.
    """
    instances = depsgraph.object_instances
    count = len(instances)
    yield
    matrices = read_numbers(instances, "matrix_world", 16, np.float32, count)
    yield
    numbers = read_numbers(instances, "persistent_id", _NUMBERS, np.int32, count)
    yield
    visible = read_numbers(instances, "show_self", 1, np.bool_, count)
    yield
    repeated = read_numbers(instances, "is_instance", 1, np.bool_, count)
    known = () if last is None else last.shapes
    yield
    old = {(one.original, one.address): one for one in known if one.original not in changed}
    shapes: dict[Any, int] = {}
    found: list[Shape] = []
    instancers: dict[Any, int] = {}
    row_of: dict[Any, int] = {}
    shape, instancer = np.empty(count, dtype=np.intp), np.full(count, -1, dtype=np.intp)
    for start, stop in _parts_of(count):
        yield
        # Blender frees what an iterator gave, so that none is kept from part to part.
        for row, item in enumerate(itertools.islice(instances, start, stop), start):
            one = item.object
            original, data = one.original, one.data
            address = 0 if data is None else data.as_pointer()
            index = shapes.get((original, address))
            if index is None:
                index = shapes[original, address] = len(found)
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
    yield
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
    yield
    if last is not None and _same(last, layout, found):
        layout = last.layout
    yield
    # Blender has the columns of a matrix one after another.
    matrices = matrices.reshape(-1, 4, 4).transpose(0, 2, 1).astype(np.float64)
    return _walked(depsgraph, layout, found, np.ascontiguousarray(matrices))


def _parts_of(count: int) -> Iterator[tuple[int, int]]:
    """Yield start and stop of the parts of a walk. An iterator passes all rows before `start`, so
    that there are few parts.
    """
    rows = max(_ROWS, count // _MOST_PARTS)
    for start in range(0, count, rows):
        yield start, min(start + rows, count)


def _walked(
    depsgraph: bpy.types.Depsgraph, layout: Layout, shapes: list[Shape], matrices: Real
) -> Snapshot:
    """Return a snapshot in which everything is as a walk found it."""
    boxes = np.array([shape.box for shape in shapes]).reshape(-1, 8, 3)
    walked = Walked(layout.shape, boxes, matrices)
    return Snapshot(
        depsgraph, layout, shapes, walked, np.empty(0, dtype=np.intp), np.empty((0, 4, 4))
    )


def _objects(depsgraph: bpy.types.Depsgraph) -> list[Any]:
    return [item.original for item in depsgraph.objects]


def is_there(layout: Layout, depsgraph: bpy.types.Depsgraph) -> bool:
    """Return whether the file still has the objects of a layout, and they make
    instances as before.
    """
    try:
        alike = _instancing(layout.instanced) == layout.instanced
    except ReferenceError:  # removed
        return False
    return alike and _objects(depsgraph) == layout.objects


def _instancing(objects: Iterable[Any]) -> dict[Any, tuple[Any, ...]]:
    return {item: tuple(getattr(item, name) for name in _DECIDING) for item in objects}


def _same(last: Snapshot, layout: Layout, shapes: list[Shape]) -> bool:
    """Return whether the objects and instances are those of the last snapshot."""
    before = last.layout
    pairs = ((getattr(before, name), getattr(layout, name)) for name in _ARRAYS)
    return (
        before.instancers == layout.instancers
        and before.objects == layout.objects
        and [one.original for one in last.shapes] == [one.original for one in shapes]
        and all(np.array_equal(one, other) for one, other in pairs)
    )


def read_again(last: Snapshot, changed: dict[Any, bool]) -> Snapshot:
    """Return a snapshot in which some objects are read again. These objects neither make nor have
    instances.
    """
    layout, shapes = last.layout, last.shapes
    changed = {item: other for item, other in changed.items() if item in layout.row_of}
    if not changed:
        return dataclasses.replace(last)
    if any(changed.values()):
        shapes = shapes.copy()
    now = dict(zip(last.moved.tolist(), last.moved_matrices, strict=True))
    for original, other in changed.items():
        row = layout.row_of[original]
        evaluated = original.evaluated_get(last.depsgraph)
        now[row] = np.array(evaluated.matrix_world, dtype=np.float64)
        if other:
            data = evaluated.data
            address = 0 if data is None else data.as_pointer()
            shapes[layout.shape[row]] = _shape(evaluated, original, address, True, row)
    moved = np.array(sorted(now), dtype=np.intp)
    again = np.stack([now[row] for row in moved.tolist()])
    found = Snapshot(last.depsgraph, layout, shapes, last.walked, moved, again)
    if moved.size > len(last.walked.matrices) / _FEW:
        return _walked(last.depsgraph, layout, shapes, found.matrices)
    return found


# Blender looks each of these up by its name.
_Collection, _Scene, _Object = bpy.types.Collection, bpy.types.Scene, bpy.types.Object


class _Latest:
    """The last snapshot, and what Blender has evaluated since."""

    def __init__(self) -> None:
        self.snapshot: Snapshot | None = None
        #: Objects to be read again; True where more than their pose has changed.
        self.changed: dict[Any, bool] = {}
        #: Objects that may have other materials.
        self.shaded: set[Any] = set()
        self.layout_changed = self.scene_changed = self.evaluated = False
        #: A walk that is under way, and its depsgraph; how many were given up since the last one.
        self.walking: tuple[Generator[None, None, Snapshot], bpy.types.Depsgraph] | None = None
        self.restarts = 0

    def note(self, depsgraph: bpy.types.Depsgraph) -> None:
        if self.walking is not None and self.walking[1] == depsgraph:
            self.walking, self.restarts = None, self.restarts + 1
        if self.snapshot is None or self.snapshot.depsgraph != depsgraph:
            return
        layout = self.snapshot.layout
        for update in depsgraph.updates:
            self.evaluated = True
            evaluated = update.id
            if isinstance(evaluated, _Collection):
                self.layout_changed = True
            elif isinstance(evaluated, _Scene):  # a setting, or what is hidden
                self.scene_changed = True
            elif isinstance(evaluated, _Object):
                item = evaluated.original
                geometry = update.is_updated_geometry
                # A change of the scene reports all its objects, as shaded again.
                if geometry or update.is_updated_transform:
                    self.layout_changed |= item in layout.instanced
                    # Also where only instances are there: a new mesh may be where an old one was.
                    self.changed[item] = geometry or self.changed.get(item, False)
                if update.is_updated_shading:
                    self.shaded.add(item)
                self.scene_changed |= item in layout.instanced or item not in layout.row_of

    def take(self, depsgraph: bpy.types.Depsgraph) -> Snapshot:
        found = self.take_part(depsgraph)
        while found is None:
            found = self.take_part(depsgraph)
        return found

    def take_part(self, depsgraph: bpy.types.Depsgraph) -> Snapshot | None:
        """Do a part of what the next snapshot needs; return the snapshot after the last part."""
        followed = follow_evaluations()
        if self.walking is None or self.walking[1] != depsgraph or not followed:
            last, found = self.snapshot, None
            if last is not None and last.depsgraph == depsgraph and followed:
                try:
                    found = self._brought_up_to_date(last)
                except ReferenceError:  # an object was removed
                    last = None
            else:
                last = None
            if found is not None:
                return self._finish(found)
            self.walking = walk(depsgraph, last, self.changed), depsgraph
        walking, self.walking = self.walking, None  # it is over where it fails
        try:
            next(walking[0])
            while self.restarts > _RESTARTS:
                next(walking[0])
        except StopIteration as end:
            return self._finish(end.value)
        self.walking = walking
        return None

    def _finish(self, found: Snapshot) -> Snapshot:
        self.snapshot, self.changed, self.shaded = found, {}, set()
        self.layout_changed = self.scene_changed = self.evaluated = False
        self.restarts = 0
        return found

    def _brought_up_to_date(self, last: Snapshot) -> Snapshot | None:
        """Return the snapshot after changes of objects; None where all have to be read."""
        if not self.evaluated:
            return last
        for shape in last.shapes if self.shaded else ():
            if shape.own and shape.original in self.shaded:
                shape.materials = slot_materials(shape.original.evaluated_get(last.depsgraph))
        moved = self.scene_changed and not is_there(last.layout, last.depsgraph)
        return None if self.layout_changed or moved else read_again(last, self.changed)

    def forget(self) -> None:
        self.snapshot = self.walking = None


_latest = _Latest()
_watchers: list[Callable[[Any], None]] = []


def watch_evaluations(function: Callable[[Any], None]) -> Callable[[], None]:
    """Register a function that is called after each evaluation by Blender; return a function that
    ends this.

    The function gets the depsgraph, or None if evaluations may have been missed.
    """
    follow_evaluations()
    _watchers.append(function)

    def stop() -> None:
        if function in _watchers:
            _watchers.remove(function)

    return stop


@persistent
def _note_evaluation(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    _latest.note(depsgraph)
    for function in _watchers:
        function(depsgraph)


@persistent
def _forget(*_: Any) -> None:
    _latest.forget()


def follow_evaluations() -> bool:
    """Register for Blender's reports of evaluations; return whether they were registered before."""
    missing = [(hooks, function) for hooks, function in _reports() if function not in hooks]
    for hooks, function in missing:
        hooks.append(function)
    for watcher in _watchers if missing else ():
        watcher(None)
    return not missing


def ignore_evaluations() -> None:
    """End Blender's reports of evaluations until the next snapshot is taken."""
    for hooks, function in _reports():
        if function in hooks:
            hooks.remove(function)
    _latest.forget()


def forget_snapshot() -> None:
    """Have the next snapshot read all objects and meshes, whatever Blender has reported."""
    _latest.forget()


def read_all_again() -> None:
    """Make Blender evaluate all data again, and the next snapshot read all of it."""
    for name in dir(bpy.data):
        items = getattr(bpy.data, name)
        if isinstance(items, bpy.types.bpy_prop_collection):
            for item in items:
                item.update_tag()
                tree = getattr(item, "node_tree", None)
                if tree is not None:
                    tree.update_tag()
    forget_snapshot()


def _reports() -> tuple[tuple[Any, Any], ...]:
    """Return Blender's lists of handlers, each with the handler to add."""
    handlers = bpy.app.handlers
    return (
        (handlers.depsgraph_update_post, _note_evaluation),
        (handlers.frame_change_post, _note_evaluation),
        (handlers.load_pre, _forget),
        (handlers.undo_pre, _forget),
        (handlers.redo_pre, _forget),
    )


def take_snapshot(depsgraph: bpy.types.Depsgraph) -> Snapshot:
    """Return all objects and instances of a depsgraph, which must be up to date.

    Until Blender evaluates something else, this is the same snapshot.
    """
    return _latest.take(depsgraph)


def latest_snapshot(view_layer: bpy.types.ViewLayer) -> Snapshot:
    """Return all objects and instances of a view layer, which must be up to date."""
    return take_snapshot(view_layer.depsgraph)


def part_of_snapshot(context: bpy.types.Context) -> Snapshot | None:
    """Do a part of the work of `context_snapshot`; return its snapshot after the last part. The
    first part evaluates an edit.
    """
    return _latest.take_part(context.evaluated_depsgraph_get())


def evaluated_snapshot(view_layer: bpy.types.ViewLayer) -> Snapshot:
    """Bring a view layer up to date; return all of its objects and instances."""
    view_layer.update()
    return latest_snapshot(view_layer)


def context_snapshot(context: bpy.types.Context) -> Snapshot:
    """Return all objects and instances of the window's view layer, up to date."""
    return take_snapshot(context.evaluated_depsgraph_get())
