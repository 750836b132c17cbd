# SPDX-License-Identifier: GPL-3.0-or-later
"""Ring sampling: one Cycles render for each ring and snapshot, written as an EXR file.

`RingJob` limits the transmitter's light to one ring of ranges after another, and renders. Each EXR
is written under a temporary name, checked (`verify_exr`), and renamed; its sidecar is written last.
So a file with a sidecar is complete whenever a run is killed, and the next run resumes there.

With one reflection, a pixel receives power in a ring only if its ray meets a surface within that
ring. All other pixels are exactly 0. Therefore `regions_by_ring` projects the surfaces into the
view, and each ring renders only the rectangle of pixels that it can fill. `Shells` projects boxes
first, then triangles. It cuts triangles until their parts are small in the view or lie in one ring.
"""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ... import contract
from ...arrays import Indices, Mask, Real, Single
from ...atomic_files import AtomicFile, disk_of
from ...contract import CHANNELS
from ...errors import FrameFileError, OutputError, RadarSimError, RenderError
from ...findings import Finding, finding, merge
from ...signal.runs import CHUNK_LINES, ZIP, ExrHeader, read_header
from ...typed_json import file_sha256, write_record
from ..materials import found_inside
from ..nodes.shader_trees import moves_faces
from ..plan import Plan, Task, instant_at
from ..run import MeasurementJob, shared_folder
from ..scene import check_particles_are_baked, ground_truth, moved_by_scripts
from ..state import Snapshot
from ..views import Region, ViewWindow, set_border


class RingJob(MeasurementJob):
    """A run that measures rings, the sampling mode of the paper."""

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        super().__init__(*arguments, **keywords)
        self._pending: list[Task] = []
        self._scene_written: int | None = None
        self._regions: list[Region] | None = None

    def _config_findings(self) -> list[Finding]:
        found = [*super()._config_findings(), *merge(self._inside_by_frame())]
        held = self._held_by_scripts()
        return [*found, finding("rendered-at-whole-frames", *held)] if held else found

    def _refuse_unmeasurable(self, snapshot: Snapshot) -> None:
        super()._refuse_unmeasurable(snapshot)
        if self._measurement.snapshots > 1:
            check_particles_are_baked(
                snapshot,
                "Without the motion of particles, take one snapshot (--snapshots 1).",
            )

    def _held_by_scripts(self) -> list[str]:
        """Return objects that scripts hold between the snapshots of a frame and move after it."""
        first, *later = self.plan.instants(self._measurement.frames[0])
        if not later or not moved_by_scripts():
            return []
        moments = (first, *later, instant_at(first.frame + 1.0, self._fps()))
        then, soon, next_frame = (
            {one.name: shown.matrix_of(one).tolist() for one in shown.layout.objects}
            for shown in map(self._time.show, moments)
        )
        return [n for n, at in then.items() if at == soon.get(n) and at != next_frame.get(n, at)]

    def _inside_by_frame(self) -> Iterator[Finding]:
        """Find antennas inside walls and other interiors in each frame, before any render, because
        sidecars of rings have no findings.
        """
        assert self._settings is not None
        if not self._settings.interiors.delay:  # nothing has an interior
            return
        for frame in self._measurement.frames:
            snapshot = self._time.show(self.plan.instants(frame)[0])
            antennas = ground_truth.antenna_positions(snapshot, self.rig)
            for one in found_inside(snapshot, antennas):
                yield one.in_frame(frame)

    def _plan_renders(self) -> None:
        tasks = list(self.plan.tasks(self.own_frames))
        self._pending = [task for task in tasks if not self._is_done(task)]
        self.total = len(tasks)
        self.done = self.total - len(self._pending)

    def _is_done(self, task: Task) -> bool:
        return shared_folder.is_done(self.folder, task, self.fingerprint)

    def pending(self) -> Iterator[Task]:
        groups = itertools.groupby(self._pending, key=lambda task: task.frame)
        tasks = {frame: list(group) for frame, group in groups}
        for frame in self._claimed(list(tasks)):
            self.frame_lost = False
            for task in tasks[frame]:
                if self._is_done(task):  # by another process, meanwhile
                    self.done += 1
                elif not self.frame_lost:
                    yield task

    def start(self, task: Task) -> None:
        """Set time and ring for a render, and record the antennas."""
        assert self._settings is not None
        if self._scene_written != task.frame:
            shared_folder.make_frame_folder(self.folder, task.frame)
            self._write_scene(task.frame)
            self._scene_written = task.frame
            self._records = None  # of another moment
        if self._records is None or not self._time.shows(task.instant):
            snapshot = self._time.show(task.instant)
            self._records = self._antenna_records(snapshot, self.plan.metres_per_unit)
            self._regions = regions_by_ring(snapshot, self.plan, *self._records)
        self._settings.set_ring(task.ring_min_m, task.ring_max_m)
        render = self._scene.render
        render.use_border = self._regions is not None
        if self._regions is not None:
            size_px = self._measurement.width_px, self._measurement.height_px
            set_border(render, self._regions[task.ring], *size_px)

    def render(self, task: Task) -> None:
        try:
            result = bpy.ops.render.render(scene=self._scene.name)
        except RuntimeError as error:
            raise RenderError(
                f"Cycles failed at {task.exr_path}: {str(error).strip()} "
                "Render an ordinary image of this scene with Cycles to see whether that works."
            ) from error
        if "FINISHED" not in result:
            raise RenderError(f"The render of {task.exr_path} was cancelled. Start it again.")

    def finish(self, task: Task) -> None:
        """Write, check and rename the EXR, then write its sidecar. No incomplete file remains."""
        assert self._records is not None
        final = self.folder / task.exr_path
        # Blender would make the folder again, without the rest of the run.
        shared_folder.check_there(self.folder, task.frame)
        try:
            file = AtomicFile(final)
            try:
                save_render(self._scene, file.temporary)
                verify_exr(file.temporary, self._measurement.width_px, self._measurement.height_px)
                if not self.keeps_frame():  # another process has taken over: it renders this one
                    return
                file.commit()
            finally:
                file.discard()
            write_record(self.folder / task.sidecar_path, self._record_of(task, final))
        except RadarSimError:
            shared_folder.check_there(self.folder, task.frame)
            raise
        self._rendered += 1
        self.done += 1

    def _record_of(self, task: Task, exr: Path) -> contract.RenderRecord:
        """Return the sidecar of a finished render."""
        assert self._records is not None
        receiver, transmitter = self._records
        plan, measurement = self.plan, self.plan.measurement
        return contract.RenderRecord(
            sampling_mode="rings",
            frame=task.frame,
            snapshot_index=task.snapshot_index,
            time_s=task.instant.time_s,
            ring=task.ring,
            ring_min_m=task.ring_min_m,
            ring_max_m=task.ring_max_m,
            width_px=measurement.width_px,
            height_px=measurement.height_px,
            metres_per_unit=plan.metres_per_unit,
            range_encoding_length_m=plan.range_encoding_length_m,
            extinction_length_m=plan.extinction_length_m,
            receiver=receiver,
            transmitter=transmitter,
            samples=measurement.samples,
            seed=measurement.seed,
            max_reflections=measurement.max_reflections,
            exr_file=exr.name,
            exr_sha256=file_sha256(exr),
            run_fingerprint=self.fingerprint,
            versions=self.versions,
        )


def regions_by_ring(
    snapshot: Snapshot,
    plan: Plan,
    receiver: contract.ReceiverRecord,
    transmitter: contract.TransmitterRecord,
) -> list[Region] | None:
    """Return the pixels that each ring can fill at its moment; None if all may be filled.

    They are known for one reflection, if Cycles renders the faces that Blender evaluates.
    """
    asked = plan.measurement
    if asked.max_reflections > 1 or receiver.kind != "perspective":
        return None
    found = ground_truth.rendered_surfaces(snapshot)
    snapshot, units = found.snapshot, plan.metres_per_unit
    shapes = [snapshot.shapes[i] for i in np.unique(snapshot.layout.shape[found.rows])]
    # Cycles renders curves and point clouds, which have no faces, as hair and spheres.
    if any(one.kind in {"CURVES", "POINTCLOUD"} or not _as_evaluated(one) for one in shapes):
        return None
    pose = np.array(receiver.matrix_world, dtype=np.float64)
    place, axes = pose[:3, 3], pose[:3, :3]
    corners = found.corners * units
    size_px = asked.width_px, asked.height_px
    view = ViewWindow(receiver.left, receiver.right, receiver.bottom, receiver.top, *size_px)
    source = (np.array(transmitter.matrix_world, dtype=np.float64)[:3, 3] - place) @ axes
    edges = [ring * asked.ring_step_m for ring in range(plan.rings + 1)]
    reach = max(float(np.abs(part).max(initial=0.0)) for part in (corners, place, corners - place))
    shells = Shells(view, source, edges, reach)
    large = found.rows[shells.take((corners - place) @ axes)]
    for shape in np.unique(snapshot.layout.shape[large]):
        triangles = _triangles(snapshot, int(shape))
        if triangles is None:
            return None
        for row in large[snapshot.layout.shape[large] == shape]:
            matrix = snapshot.matrix(row)
            world = (triangles @ matrix[:3, :3].T + matrix[:3, 3]) * units
            if not shells.take_triangles((world - place) @ axes):
                return None
    return shells.regions()


def _triangles(snapshot: Snapshot, shape: int) -> Real | None:
    """Return the triangles of a shape in its own axes, (m, 3, 3) [Blender units]; None without."""
    mesh = snapshot.mesh(snapshot.shapes[shape])
    return None if mesh is None else mesh.vertices[mesh.triangles]


def _as_evaluated(shape: Any) -> bool:
    """Return whether Cycles renders the faces that Blender evaluates, without bending rays."""
    item = shape.original
    return (
        not len(item.particle_systems)
        and not any(modifier.type == "SUBSURF" for modifier in item.modifiers)
        and not any(map(moves_faces, shape.materials))
    )


# -------------------------------------------------------------------------------------------------
# Parts of a perspective view in which surfaces at given ranges can be seen. All points are in the
# receiver's axes, so that u = x / -z and v = y / -z.
# -------------------------------------------------------------------------------------------------


#: A surface in several rings is cut until its parts are this fraction of the view wide.
_VIEW_PART = 1 / 128
#: Cuts in halves after which a part stands for the whole view: it touches the receiver.
_MOST_CUTS = 20
#: Parts above which the whole view is rendered.
_MOST_PARTS = 1 << 21
#: Rounding of ranges in Cycles, relative to the largest coordinate, with a wide margin.
_ROUNDING = 1e-5
#: Pixels around a surface that are rendered too.
_MARGIN_PX = 2
#: Where each of four parts of a triangle has its corners: weights of the triangle's corners.
_QUARTERS = np.array(
    [
        [[2, 0, 0], [1, 1, 0], [1, 0, 1]],
        [[0, 2, 0], [0, 1, 1], [1, 1, 0]],
        [[0, 0, 2], [1, 0, 1], [0, 1, 1]],
        [[1, 1, 0], [0, 1, 1], [1, 0, 1]],
    ]
) / 2  # fmt: skip


class Shells:
    """Bounds of the pixels in which a view shows surfaces of each ring.

    `edges_m` are the edges of the n rings, ranges from the transmitter, (n + 1,). `reach_m` is the
    largest coordinate in the scene, from which rounding follows.
    """

    def __init__(
        self, view: ViewWindow, transmitter_m: Real, edges_m: Sequence[float], reach_m: float
    ) -> None:
        self._view, self._source = view, transmitter_m
        self._edges = np.asarray(edges_m, dtype=np.float64)
        self._slack = _ROUNDING * reach_m
        rings = len(self._edges) - 1
        #: Left, right, bottom, top of each ring; empty where left is above right.
        self._bounds = np.tile([np.inf, -np.inf, np.inf, -np.inf], (rings, 1))

    def take(self, parts: Real) -> Mask:
        """Add the convex hulls of m sets of points, (m, p, 3) [m], that need not be cut.

        Return those not added, (m,): they may be seen in a ring, and are large.
        """
        first, last = self._rings(parts)
        open_parts = (first <= last) & self._in_view(parts)
        depth = -parts[..., 2]
        front = open_parts & (depth.min(axis=1) > 0)
        u, v = (parts[front][..., axis] / depth[front] for axis in (0, 1))
        box = np.stack([u.min(axis=1), u.max(axis=1), v.min(axis=1), v.max(axis=1)], axis=1)
        view = self._view
        small = (box[:, 1] - box[:, 0] <= (view.right - view.left) * _VIEW_PART) & (
            box[:, 3] - box[:, 2] <= (view.top - view.bottom) * _VIEW_PART
        )
        first, last = first[front], last[front]
        fine = small | (first == last)
        self._add(first[fine], last[fine], box[fine])
        open_parts[np.flatnonzero(front)[fine]] = False
        return open_parts

    def take_triangles(self, triangles: Real) -> bool:
        """Add triangles, (m, 3, 3) [m], and cut them as often as necessary. Return False if there
        are too many.
        """
        for _ in range(_MOST_CUTS):
            triangles = triangles[self.take(triangles)]
            if not len(triangles):
                return True
            if len(triangles) > _MOST_PARTS:
                return False
            triangles = np.einsum("qij,mjk->mqik", _QUARTERS, triangles).reshape(-1, 3, 3)
        first, last = self._rings(triangles)
        view = self._view
        whole = (view.left, view.right, view.bottom, view.top)
        self._add(first, last, np.broadcast_to(whole, (len(first), 4)))
        return True

    def regions(self) -> list[Region]:
        """Return the pixels of each ring: one pixel for a ring in which nothing can be seen."""
        return [self._region(bounds) for bounds in self._bounds.tolist()]

    def _region(self, bounds: list[float]) -> Region:
        view = self._view
        left, right, bottom, top = bounds
        left, right = ((u - view.left) / view.step_u for u in (left, right))
        top, bottom = ((view.top - v) / view.step_v for v in (top, bottom))
        ends = []
        for low, high, count in ((left, right, view.width_px), (top, bottom, view.height_px)):
            low, high = max(low - _MARGIN_PX, 0.0), min(high + _MARGIN_PX, float(count))
            if not low < high:
                return Region(0, 1, 0, 1)
            ends += [int(low), int(np.ceil(high))]
        return Region(*ends)

    def _rings(self, parts: Real) -> tuple[Indices, Indices]:
        """Return the first and the last ring into which each part may reach."""
        points = parts - self._source
        centre = points.mean(axis=1)
        radius = np.linalg.norm(points - centre[:, None], axis=2).max(axis=1)
        height = _heights(points)
        # a disc around the centre, or a ball where the points lie in no plane
        across = np.sqrt(np.maximum(np.einsum("ij,ij->i", centre, centre) - height**2, 0.0))
        nearest = np.hypot(height, np.maximum(across - radius, 0.0)) - self._slack
        farthest = np.linalg.norm(points, axis=2).max(axis=1) + self._slack
        rings = len(self._edges) - 1
        first = np.searchsorted(self._edges, nearest, side="right") - 1
        last = np.searchsorted(self._edges, farthest, side="right") - 1
        # wholly nearer or farther than all rings: none
        return np.maximum(first, 0), np.minimum(last, rings - 1)

    def _in_view(self, parts: Real) -> Mask:
        """Return which parts may be in view, (n,).

        A part is out of view if all its corners are outside of one side of the widened view.
        """
        view, (x, y, z) = self._view, np.moveaxis(parts, 2, 0)
        du, dv = _MARGIN_PX * view.step_u, _MARGIN_PX * view.step_v
        sides = (
            -z,
            x + z * (view.left - du),
            -(x + z * (view.right + du)),
            y + z * (view.bottom - dv),
            -(y + z * (view.top + dv)),
        )
        seen = np.ones(len(parts), dtype=bool)
        for inside in sides:
            seen &= inside.max(axis=1) > 0
        return seen

    def _add(self, first: Indices, last: Indices, box: Real) -> None:
        """Extend the bounds of the rings from first to last by a box of each part, (m, 4)."""
        for step in range(int((last - first).max(initial=-1)) + 1):
            reached = first + step <= last
            ring = (first + step)[reached]
            for column, widen in enumerate((np.minimum, np.maximum) * 2):
                widen.at(self._bounds[:, column], ring, box[reached, column])


def _heights(points: Real) -> Real:
    """Return the distances of planes of triangles from the origin, (m,); 0 for other parts."""
    if points.shape[1] != 3:
        return np.zeros(len(points))
    normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    size = np.linalg.norm(normal, axis=1)
    height = np.abs(np.einsum("ij,ij->i", normal, points[:, 0]))
    return np.asarray(np.divide(height, size, out=np.zeros(len(points)), where=size > 0))


# -------------------------------------------------------------------------------------------------
# EXR files: written by Blender, checked here.
# -------------------------------------------------------------------------------------------------


def verify_exr(path: Path, width_px: int, height_px: int) -> None:
    """Check that a file is complete: right channels, type and size, every pixel finite.

    A full disk leaves a truncated file, and Blender does not report it when it renders in the
    background. A Blender program has no EXR library that is safe to import, so the pixels are
    decompressed here; only a plain float32 ZIP image, as Blender writes it, is accepted.
    OutputError: the file is missing or incomplete. RenderError: it has NaN or infinite pixels.
    """
    if not path.exists():
        raise OutputError(
            f"Blender has not written {path}. {disk_of(path).capitalize()} is full, or the folder "
            "was removed. Make room and render again."
        )
    try:
        header = read_header(path)
        if header.channels != dict.fromkeys(CHANNELS, "float"):
            raise ValueError(f"channels {header.channels}, expected float {sorted(CHANNELS)}")
        if header.compression != ZIP:
            raise ValueError("not ZIP compressed")
        size = header.width_px, header.height_px
        if size != (width_px, height_px):
            raise ValueError(f"{size[0]} x {size[1]} pixels, expected {width_px} x {height_px}")
        finite = all(np.isfinite(values).all() for values in _pixels(path, header))
    except (OSError, ValueError, zlib.error, FrameFileError) as error:
        raise OutputError(
            f"Blender has written {path} incompletely ({error}). The disk is probably full: "
            f"{disk_of(path)}. Make room and render again."
        ) from error
    if not finite:
        raise RenderError(
            f"Cycles has rendered NaN or infinite pixels into {path}, which have no power. Look "
            "for a material or a transmitter power near 1e38, or an object at the antenna."
        )


def _pixels(path: Path, header: ExrHeader) -> Iterator[Single]:
    """Yield the values of each chunk: decompress, reverse the predictor, join both halves."""
    data = path.read_bytes()
    for row, (start, length) in header.chunks.items():
        rows = min(CHUNK_LINES[ZIP], header.height_px - row)
        size = 4 * rows * header.width_px * len(CHANNELS)
        packed = data[start : start + length]
        if length == size:  # stored as it is where ZIP gains nothing
            yield np.frombuffer(packed, dtype="<f4")
            continue
        raw = np.frombuffer(zlib.decompress(packed), dtype=np.uint8)
        if raw.size != size:
            raise ValueError("a chunk has a wrong length")
        # Predictor: each byte is the difference from the one before, plus 128.
        steps = raw.astype(np.int64)
        steps[1:] -= 128
        values = np.cumsum(steps).astype(np.uint8)
        half = (size + 1) // 2
        merged = np.empty_like(values)
        merged[0::2], merged[1::2] = values[:half], values[half:]
        yield merged.view("<f4")


def save_render(scene: bpy.types.Scene, path: Path) -> None:
    """Write the last render in the scene's format, in place of an existing file."""
    result = next((i for i in bpy.data.images if i.type == "RENDER_RESULT"), None)
    if result is None:
        raise RenderError(
            "Blender has no render result, so the frame is incomplete. Start the run again."
        )
    try:
        # write_still would expand # and {} in folder names.
        result.save_render(str(path), scene=scene)
    except RuntimeError as error:
        raise OutputError(
            f"Blender cannot write {path}: {str(error).strip()} Choose an output folder that is "
            f"writable, or make room on {disk_of(path)}."
        ) from error
