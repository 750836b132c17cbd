# SPDX-License-Identifier: GPL-3.0-or-later
"""All objects and instances of a scene at one moment, as arrays that one walk fills.

`walk` looks at all of them; `read_again` only at some, where instances are as they were.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import bpy
import numpy as np
from bpy.app.handlers import persistent
from numpy.typing import NDArray

from ...arrays import Indices, Mask, Real

# -------------------------------------------------------------------------------------------------
# Objects, instances and meshes as Blender evaluates them at one moment. Does not import bpy.
# -------------------------------------------------------------------------------------------------


#: Identifies an instance among those of its object: the instancer's name, then Blender's numbers.
#: Empty for the object itself.
Key = tuple[Any, ...]

#: Types of objects of which Blender makes meshes; it refuses hair curves and point clouds.
_MESHED = {"MESH", "CURVE", "SURFACE", "META", "FONT"}


class EvaluatedObject(NamedTuple):
    """One object, or one instance of it, in Blender units.

    Blender reuses the data of instances: read what you need before the next object.

    Attributes
    ----------
    evaluated, original, instancer : bpy.types.Object
        `instancer` is the original object that makes the instance; None for the object itself.
    key
        Identifies the instance among those of its object; empty for the object itself.
    matrix_world : mathutils.Matrix
        4x4.
    visible
        Whether Blender draws the object itself, and not only its instances.
    """

    evaluated: Any
    original: Any
    instancer: Any
    key: Key
    matrix_world: Any
    visible: bool

    @property
    def label(self) -> str:
        """Name of the object, with its instancer: ``instancer/object``."""
        name: str = self.original.name_full
        instancer = name if self.instancer is None else self.instancer.name_full
        return name if instancer == name else f"{instancer}/{name}"

    @property
    def matrix(self) -> Real:
        """World matrix in float64, shape (4, 4)."""
        return np.array(self.matrix_world, dtype=np.float64)

    @property
    def box(self) -> Real:
        """Corners of the bounding box in the object's own axes, shape (8, 3)."""
        return np.array([tuple(corner) for corner in self.evaluated.bound_box], dtype=np.float64)


def evaluated_depsgraph(view_layer: Any) -> Any:
    """Return the depsgraph of a view layer.

    Parameters
    ----------
    view_layer : bpy.types.ViewLayer

    Returns
    -------
    bpy.types.Depsgraph
        Up to date.
    """
    view_layer.update()
    return view_layer.depsgraph


def evaluated_objects(depsgraph: Any) -> Iterator[EvaluatedObject]:
    """Yield all objects and instances of a depsgraph in Blender's order.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Up to date.

    Yields
    ------
    EvaluatedObject
        Valid until the next one.
    """
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


class evaluated_mesh:
    """Provide the mesh of an evaluated object during a context; None without a surface.

    Parameters
    ----------
    evaluated : bpy.types.Object
        Of any type.
    """

    __slots__ = ("_evaluated", "_made")

    def __init__(self, evaluated: Any) -> None:
        self._evaluated = evaluated
        self._made: Any = None

    def __enter__(self) -> Any:
        evaluated = self._evaluated
        kind = evaluated.type
        if kind not in _MESHED:
            return None
        if kind == "MESH" and evaluated.mode == "OBJECT" and not evaluated.modifiers:
            return evaluated.data  # what Blender would copy
        self._made = evaluated.to_mesh()
        return self._made

    def __exit__(self, *_: object) -> None:
        if self._made is not None:
            self._evaluated.to_mesh_clear()


def read_numbers(
    items: Any, name: str, width: int = 1, dtype: type[np.generic] = np.float32
) -> NDArray[Any]:
    """Return a property of all elements of a mesh.

    Parameters
    ----------
    items : bpy.types.bpy_prop_collection
        For example the vertices of a mesh.
    name
        Property.
    width
        Numbers per element.
    dtype
        Type in which Blender stores the property.

    Returns
    -------
    ndarray
        Shape (elements, width).
    """
    values = np.empty(len(items) * width, dtype=dtype)
    items.foreach_get(name, values)
    return values.reshape(-1, width)


def read_triangles(mesh: Any) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return the vertices and triangles of a mesh.

    Parameters
    ----------
    mesh : bpy.types.Mesh

    Returns
    -------
    ndarray, ndarray
        Vertices (n, 3), object axes, Blender units, and vertex indices (m, 3).
    """
    mesh.calc_loop_triangles()
    triangles = read_numbers(mesh.loop_triangles, "vertices", 3, np.int32)
    return read_numbers(mesh.vertices, "co", 3), triangles


# -------------------------------------------------------------------------------------------------
# What one walk through all objects and instances has found. Does not import bpy.
# -------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Walked:
    """What one walk has found; what follows from it is computed once.

    Attributes
    ----------
    shape
        Index of each one's shape, (n,).
    boxes
        Corners of the shapes' bounding boxes, (shapes, 8, 3).
    matrices
        World matrices, (n, 4, 4).
    """

    shape: Indices
    boxes: Real
    matrices: Real

    @cached_property
    def corners(self) -> Real:
        """Corners of the bounding boxes in world space, shape (n, 8, 3)."""
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
    """Return the centres of boxes, of which these are the corners, and the radii, (n, 4)."""
    centre = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1, initial=0.0)
    return np.column_stack([centre, radius])


#: Vertices (n, 3), object axes, Blender units, and vertex indices (m, 3).
Triangles = tuple[NDArray[np.float32], NDArray[np.int32]]
#: Vertices and triangles of a mesh that a snapshot keeps, at most.
_KEPT = 512
#: Numbers by which Blender tells the instances of an instancer apart.
_NUMBERS = 8
#: Snapshots keep what has moved apart from the rest up to one in so many rows.
_FEW = 8
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
    faces
        What `Snapshot.face_count` has read.
    triangles : tuple of ndarray, optional
        What `Snapshot.triangles` has read, of a small mesh.
    """

    original: Any
    kind: str
    address: int
    own: bool
    materials: tuple[Any, ...]
    box: Real
    first: int
    faces: int | None = None
    triangles: Triangles | None = None


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

    def keys(self, rows: Indices) -> list[Key]:
        """Return the key of each of these rows."""
        used = np.unique(self.instancer[rows]).tolist()
        names = {index: self.instancers[index].name_full for index in used if index >= 0}
        pairs = zip(self.instancer[rows].tolist(), self.numbers[rows].tolist(), strict=True)
        return [() if index < 0 else (names[index], *numbers) for index, numbers in pairs]


@dataclasses.dataclass(frozen=True, eq=False)
class Snapshot:
    """Objects and instances at one moment, in Blender units.

    Few of many objects move from one moment to the next, so that most are as the last walk found
    them. Where rows will do, ask for these: `matrices` and `corners` are copies of all.

    Attributes
    ----------
    depsgraph : bpy.types.Depsgraph
        At that moment.
    layout
        Shared by successive snapshots with the same objects and instances.
    shapes
        See `Shape`.
    walked
        What the last walk found.
    moved, moved_matrices
        Rows that were read again since, ascending, (k,), and their world matrices, (k, 4, 4).
    """

    depsgraph: Any
    layout: Layout
    shapes: list[Shape]
    walked: Walked
    moved: Indices
    moved_matrices: Real

    @cached_property
    def matrices(self) -> Real:
        """World matrices, shape (n, 4, 4)."""
        return self._of_all(self.walked.matrices, self.moved_matrices)

    @cached_property
    def corners(self) -> Real:
        """Corners of the bounding boxes in world space, shape (n, 8, 3)."""
        return self._of_all(self.walked.corners, self._moved_corners)

    @cached_property
    def spheres(self) -> Real:
        """Spheres around all boxes: centres in world space, and radii, shape (n, 4)."""
        return self._of_all(self.walked.spheres, box_spheres(self._moved_corners))

    @cached_property
    def largest(self) -> Real:
        """Largest size of a number in each matrix, shape (n,); NaN where one is NaN."""
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
        """Corners of the boxes of the rows that were read again, (k, 8, 3)."""
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
        """Return for each object and instance the value that its shape has."""
        return np.array(values, dtype=dtype)[self.layout.shape]

    def label(self, row: int) -> str:
        """Return the name of the object, with its instancer: ``instancer/object``.

        An object is its own instancer where Blender draws the faces of a text, curve or metaball,
        and what Geometry Nodes instance within it.
        """
        name: str = self.shapes[self.layout.shape[row]].original.name_full
        index = int(self.layout.instancer[row])
        instancer = name if index < 0 else self.layout.instancers[index].name_full
        return name if instancer == name else f"{instancer}/{name}"

    def mesh(self, shape: Shape) -> contextlib.AbstractContextManager[Any]:
        """Provide the evaluated mesh of a shape during a context; None without a surface."""
        if shape.own:
            return evaluated_mesh(shape.original.evaluated_get(self.depsgraph))
        return self._mesh_of_instances(shape)

    def face_count(self, shape: Shape) -> int:
        """Return the number of polygons of a shape; 0 without a surface."""
        if shape.faces is None:
            with self.mesh(shape) as mesh:
                shape.faces = 0 if mesh is None else len(mesh.polygons)
        return shape.faces

    def triangles(self, shape: Shape) -> Triangles:
        """Return the vertices and triangles of a shape; none without a surface."""
        if shape.triangles is not None:
            return shape.triangles
        with self.mesh(shape) as mesh:
            if mesh is None:
                return np.empty((0, 3), np.float32), np.empty((0, 3), np.int32)
            found = read_triangles(mesh)
        if sum(map(len, found)) <= _KEPT:
            shape.triangles = found
        return found

    def vertices(self, shape: Shape) -> NDArray[np.float32]:
        """Return the vertices of a shape, (n, 3), object axes; none without a surface."""
        if shape.triangles is None:
            with self.mesh(shape) as mesh:
                if mesh is not None and len(mesh.vertices) > _KEPT:
                    return read_numbers(mesh.vertices, "co", 3)
        return self.triangles(shape)[0]

    @contextlib.contextmanager
    def _mesh_of_instances(self, shape: Shape) -> Iterator[Any]:
        # Blender frees the object of an instance with the iterator that gave it.
        for row, item in enumerate(self.depsgraph.object_instances):
            if row == shape.first:
                with evaluated_mesh(item.object) as mesh:
                    yield mesh
                return
        raise ReferenceError(f"{shape.original.name} is no longer evaluated")


def _shape(evaluated: Any, original: Any, address: int, own: bool, first: int) -> Shape:
    box = np.empty(24, dtype=np.float32)
    evaluated.bound_box.foreach_get(box)
    corners = box.reshape(8, 3).astype(np.float64)
    return Shape(original, evaluated.type, address, own, materials_of(evaluated), corners, first)


def materials_of(evaluated: Any) -> tuple[Any, ...]:
    """Return the originals of the materials by slot, None for an empty one."""
    return tuple(slot.material and slot.material.original for slot in evaluated.material_slots)


def walk(depsgraph: Any, last: Snapshot | None = None, changed: Any = ()) -> Snapshot:
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
    return _walked(depsgraph, layout, found, np.ascontiguousarray(matrices))


def _walked(depsgraph: Any, layout: Layout, shapes: list[Shape], matrices: Real) -> Snapshot:
    """Return a snapshot in which all is as a walk found it."""
    boxes = np.array([shape.box for shape in shapes]).reshape(-1, 8, 3)
    walked = Walked(layout.shape, boxes, matrices)
    return Snapshot(
        depsgraph, layout, shapes, walked, np.empty(0, dtype=np.intp), np.empty((0, 4, 4))
    )


def _objects(depsgraph: Any) -> list[Any]:
    return [item.original for item in depsgraph.objects]


def is_there(layout: Layout, depsgraph: Any) -> bool:
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


def read_again(last: Snapshot, changed: dict[Any, bool]) -> Snapshot:
    """Return a snapshot with some objects read again, which neither make nor have instances."""
    if not changed:
        return dataclasses.replace(last)
    layout, shapes = last.layout, last.shapes
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


# -------------------------------------------------------------------------------------------------
# The last snapshot of a scene, brought up to date.
#
# Blender reports what each evaluation has changed. The next snapshot reads those objects again, and
# walks through the scene only where instances may have changed.
# -------------------------------------------------------------------------------------------------


# Blender looks each of them up by its name.
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

    def note(self, depsgraph: Any) -> None:
        """Note what Blender has just evaluated."""
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
                last = walk(depsgraph)
        else:
            last = walk(depsgraph)
        self.snapshot, self.changed, self.shaded = last, {}, set()
        self.layout_changed = self.scene_changed = self.evaluated = False
        return last

    def _brought_up_to_date(self, last: Snapshot) -> Snapshot:
        if not self.evaluated:
            return last
        for shape in last.shapes if self.shaded else ():
            if shape.own and shape.original in self.shaded:
                shape.materials = materials_of(shape.original.evaluated_get(last.depsgraph))
        moved = self.scene_changed and not is_there(last.layout, last.depsgraph)
        if self.layout_changed or moved:
            return walk(last.depsgraph, last, self.changed)
        return read_again(last, self.changed)

    def forget(self) -> None:
        """Drop the snapshot."""
        self.snapshot = None


_latest = _Latest()


_watchers: list[Callable[[Any], None]] = []


def watch_evaluations(function: Callable[[Any], None]) -> Callable[[], None]:
    """Have a function called after each evaluation of Blender.

    Parameters
    ----------
    function
        Is given the depsgraph, or None where evaluations may have been missed.

    Returns
    -------
    callable
        Ends it; may be called again.
    """
    follow_evaluations()
    _watchers.append(function)

    def stop() -> None:
        if function in _watchers:
            _watchers.remove(function)

    return stop


@persistent
def _note_evaluation(_scene: Any, depsgraph: Any) -> None:
    _latest.note(depsgraph)
    for function in _watchers:
        function(depsgraph)


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
    for watcher in _watchers if missing else ():
        watcher(None)
    return not missing


def ignore_evaluations() -> None:
    """Have Blender report evaluations no longer, until the next snapshot is taken."""
    for hooks, function in _reports():
        if function in hooks:
            hooks.remove(function)
    _latest.forget()


def read_all_again() -> None:
    """Have Blender evaluate all data again, and the next snapshot read all of it."""
    for name in dir(bpy.data):
        items = getattr(bpy.data, name)
        if isinstance(items, bpy.types.bpy_prop_collection):
            for item in items:
                item.update_tag()
                tree = getattr(item, "node_tree", None)
                if tree is not None:
                    tree.update_tag()
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
