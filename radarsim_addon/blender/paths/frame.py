# SPDX-License-Identifier: GPL-3.0-or-later
"""One radar frame of the sampling mode "paths": measure its tiles, refine them, write the table.

`FrameWork.measure` first divides the field of view into tiles of equal pixels, and lays finer ones
over small objects in sight and over glints. It measures every tile replicate by replicate (with
sub-pixel offsets). Each render gives rows of the path table. `RowFinisher` adds what Cycles does
not provide: the body on which each vertex lies, the vertices in float64, powers of lobes that
Cycles does not have. With mirrors, each replicate is rendered once more for each image of the
transmitter, with the transmitter at that image (`MirrorViews`). Then the tiles with the largest
share of the error are halved, until the error target, the time limit or the finest pixels are
reached. `FrameWork.write` writes the table with the motion of its rows, and the sidecar with what a
user should know of the frame.
"""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import math
import time
from collections.abc import Callable, Collection, Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import bpy
import numpy as np

from ... import contract
from ...arrays import Mask, Real
from ...findings import Finding, finding, finding_about, merge
from ...signal.paths import (
    MOST_UNCERTAIN,
    PATH_DTYPE,
    PathRows,
    TableFile,
    column_groups,
    replicate_offset_px,
    write_table,
)
from ...signal.scene import SMOOTH_BELOW
from ...signal.tracing import MirrorPaths, hidden_power
from ...typed_json import file_sha256, write_record
from ..materials import read_surface
from ..motion import BurstMotion
from ..plan import FINEST_PITCH, PathOptions
from ..state import slot_materials
from ..views import TracedReplicate, ViewWindow, pixel_numbers
from .clutter_weights import ClutterWeights
from .error_budget import (
    MOST_TILED,
    CellGrid,
    ErrorBudget,
    in_sight,
    missed_objects_findings,
    rank_by_error,
    small_boxes,
    uncertain_objects,
)
from .glints import SmoothFaces, find_glints
from .hit_points import HitPoints
from .measured_tiles import MeasuredTiles, NewTile, QualitySums, TileCheckpoints
from .tiles import Tile, ViewBoxes, add_inset_tiles, lay_in_steps, projected_bounds
from .view_tracer import PathTask, ViewTracer


class Progress(Protocol):
    """What a frame reports while its tiles are measured."""

    def add_tiles(self, count: int) -> None:
        """Report that there are `count` tiles in addition to those expected."""

    def replicates_measured(self, count: int, *, earlier: bool) -> None:
        """Report that replicates of a tile are measured; `earlier`: an earlier session did it."""


#: Pixels of views whose rows are treated together: of few rows numpy is all overhead, and many do
#: not stay in the processor's cache.
_PIXELS_TOGETHER = 1 << 15
#: Fraction of the squared error that one round of refinement is for.
_ROUND_SHARE = 0.8
#: Fraction of a time limit that inset tiles may take: refinement needs the rest.
_SHARE_FOR_TILES = 0.5
#: Objects and instances above which tiles are larger: each costs a render as much as 30 rays, so
#: that many cost a tenth of the rays of a tile.
_MANY_BODIES = 250
#: Pixels across of the renders that measure how long a small one takes.
_TRIED_PX = 8


class FrameWork:
    """Tiles of one radar frame: measured, refined, joined into one table in `folder`.

    `motion` is that of the bodies over the burst. `no_echo` finds why a frame has no echo, from the
    names of the objects that were seen.
    """

    def __init__(
        self,
        tracer: ViewTracer,
        motion: BurstMotion,
        hits: HitPoints,
        clutter: ClutterWeights,
        mirrors: MirrorPaths,
        folder: Path,
        progress: Progress,
        no_echo: Callable[[Sequence[str]], list[Finding]],
    ) -> None:
        self._no_echo = no_echo
        self._tracer, self._motion, self._progress = tracer, motion, progress
        self._finisher = RowFinisher(motion, hits, clutter)
        self._clutter, self._mirrors = clutter, mirrors
        self._dtype = mirrors.dtype
        self._run, self._receiver = tracer.run, tracer.receiver
        self._options = tracer.run.options
        self._folder = folder
        self._next_number = 0
        asked, receiver = self._run.measurement, self._receiver
        carrier_hz = asked.waveform.carrier_hz
        # The run's fingerprint has neither carrier nor burst, because whole frames bear them.
        stamp = f"{self._run.fingerprint} {carrier_hz!r} {asked.burst!r}"
        self._parts = TileCheckpoints(folder, stamp, self._dtype)
        #: Power beyond the last order, over the whole frame whatever is refined in it.
        self._beyond = QualitySums()
        self._renders, self._seconds = 0, 0.0
        resolution_m = asked.waveform.range_resolution_m
        reach_m = self._run.plan.rings * asked.ring_step_m
        grid = CellGrid(
            resolution_m,
            min(int(reach_m / resolution_m) + 1, 1 << 20),
            ranges=self._options.error_scope != "objects",
        )
        self._budget = ErrorBudget(grid.first_object, self._options.error_scope)
        # Blender's window draws by Python, too, and would wait for a thread that computes.
        threaded, count = bpy.app.background, self._options.replicates
        self._tiles = MeasuredTiles(self._parts, grid, self._budget, receiver, count, threaded)
        self._whole = ViewWindow.of(receiver, asked.width_px, asked.height_px)
        #: Small objects in sight, and how many of them got tiles of their own.
        self._small, self._tiled = 0, 0
        # Found now, because Blender evaluates other moments later.
        self._smooth = SmoothFaces(
            mirrors.obstacles, receiver, tracer.transmitter, self._whole, carrier_hz
        )
        self._glints, self._said = find_glints(
            mirrors.obstacles,
            receiver,
            np.vstack([tracer.transmitter_m, tracer.lamps_m]),
            self._whole,
            self._run.scene.hidden,
        )

    # -- renders -----------------------------------------------------------------------------------

    def measure(self) -> Generator[PathTask, None, str]:
        """Make all renders; return the limit that ended it. If stopped, call `keep_tiles`."""
        try:
            reason = yield from self._measure_all()
            self._tiles.wait()
        finally:
            self._tiles.end()
        return reason

    def _measure_all(self) -> Generator[PathTask, None, str]:
        side = self._options.tile_px
        many = len(self._motion.bodies) > _MANY_BODIES and not self._options.refines
        large = 2 * side if many and side == PathOptions.tile_px else side
        uniform = tiles = Tile(self._whole).split(large)
        if self._options.refines:
            chosen = yield from self._choose(uniform)
            tiles = add_inset_tiles(uniform, chosen.areas(self._whole), self._whole, self._options)
        wanted = [(one.pitch, area) for one in self._glints for area in one.areas]
        tiles = lay_in_steps(tiles, wanted, self._whole, side)
        self._progress.add_tiles(len(tiles) - len(Tile(self._whole).split(side)))
        for tile in tiles:
            yield from self._measure(tile)
        self._tiles.wait()
        found = self._tiles.quality()
        if found.seen - {0}:
            start_s = time.monotonic()
            beyond = yield from self._tracer.beyond_tasks(self._whole, found.coloured)
            self._beyond.add_beyond(beyond, self._run.watts_per_unit, found.strongest_path)
            self._renders += self._tracer.renders_beyond
            self._seconds += time.monotonic() - start_s
        if not self._options.refines:
            return "all tiles"
        return (yield from self._refine())

    def keep_tiles(self) -> None:
        """Write the measured tiles to disk, so that a later session can use them."""
        self._parts.write()

    def _choose(self, uniform: Sequence[Tile]) -> Generator[PathTask, None, ViewBoxes]:
        """Return the boxes of the small objects that get tiles of their own."""
        scene = self._run.scene
        boxes = projected_bounds(self._motion.poses, scene.objects, self._receiver, scene.hidden)
        small = chosen = small_boxes(boxes, self._whole)
        most = MOST_TILED
        if len(small) and self._options.time_limit_s:
            most = yield from self._affordable_tiles(uniform[0])
        if len(small) > most:
            seen = yield from self._in_sight(small, uniform)
            chosen = rank_by_error(
                small, seen, boxes, self._whole, self._receiver, self._tracer.transmitter_m, most
            )
        self._small, self._tiled = len(small), len(chosen)
        return chosen

    def _in_sight(
        self, small: ViewBoxes, uniform: Sequence[Tile]
    ) -> Generator[PathTask, None, Mask]:
        """Return whether the receiver may see a part of each box, (n,)."""
        start_s = time.monotonic()
        scene, units = self._run.scene, self._run.plan.metres_per_unit
        seen = np.zeros(len(small), dtype=bool)
        for number, tile in enumerate(uniform):
            receiver, view = yield from self._tracer.look_tasks(number, tile.window)
            seen |= in_sight(small, receiver, tile.window, view, scene.opaque, units)
        self._renders += len(uniform)
        self._seconds += time.monotonic() - start_s
        return seen

    def _affordable_tiles(self, tile: Tile) -> Generator[PathTask, None, int]:
        """Return the number of inset tiles that can be rendered in a fraction of the time limit.

        The cost of a small tile is the overhead of its renders, which grows with the number of
        objects. This method renders twice and takes the time of the second render, because the
        first one also builds data that all later renders use.
        """
        options, window = self._options, tile.window
        start_s = last_s = time.monotonic()
        width, height = min(window.width_px, _TRIED_PX), min(window.height_px, _TRIED_PX)
        few = dataclasses.replace(
            window,
            right=window.left + width * window.step_u,
            bottom=window.top - height * window.step_v,
            width_px=width,
            height_px=height,
        )
        for _ in range(2):
            last_s = time.monotonic()
            yield from self._tracer.look_tasks(0, few)
        self._renders += 2
        self._seconds += time.monotonic() - start_s
        a_tile_s = options.replicates * (time.monotonic() - last_s)
        return min(MOST_TILED, int(_SHARE_FOR_TILES * options.time_limit_s / a_tile_s))

    def _refine(self) -> Generator[PathTask, None, str]:
        """Halve the pixels of the worst tiles until a limit is reached; return the name of this
        limit.
        """
        options = self._options
        while True:
            if (
                options.max_standard_error
                and self._budget.relative_error() <= options.max_standard_error
            ):
                return "error target"
            open_tiles = [
                number
                for number, measured in self._tiles.tiles.items()
                if measured.tile.level < options.max_refinement_level
                and measured.tile.window.pitch / 2 >= FINEST_PITCH
            ]
            open_error = math.sqrt(sum(self._budget.squared_errors(open_tiles).values()))
            if open_error <= options.max_standard_error:
                # The error comes from tiles that are as fine as may be.
                return "finest pixels"
            worst = self._budget.worst(open_tiles, _ROUND_SHARE)
            if not worst:
                return "finest pixels"
            for number in worst:
                if options.time_limit_s and self._seconds > options.time_limit_s:
                    return "time budget"
                # The parts take the tile's place only when all of them are measured.
                parts = self._tiles.tiles[number].tile.halved()
                self._progress.add_tiles(len(parts))
                for part in parts:
                    yield from self._measure(part)
                self._tiles.wait()
                self._tiles.remove(number)

    def _measure(self, tile: Tile) -> Generator[PathTask, None, None]:
        number, self._next_number = self._next_number, self._next_number + 1
        own = None if tile.own is None else hashlib.sha256(tile.own.tobytes()).hexdigest()
        key = self._parts.key(dataclasses.astuple(tile.window), tile.level, own)
        record = self._parts.find(key)
        if record is None:
            yield from self._trace(NewTile(number, tile, key))
        else:
            self._renders += record.renders
            self._seconds += record.seconds
            self._tiles.take_again(number, tile, key, record)
            self._progress.replicates_measured(len(record.rows), earlier=True)

    def _trace(self, new: NewTile) -> Generator[PathTask, None, None]:
        """Measure the replicates of a tile, one after the other."""
        start_s = time.monotonic()
        count, watts_per_unit = self._options.replicates, self._run.watts_per_unit
        renders, done = 0, 0
        waiting: list[tuple[PathRows, Real]] = []
        mirrored = self._dtype != PATH_DTYPE
        pixels = new.tile.window.width_px * new.tile.window.height_px
        together = 1 if mirrored else max(_PIXELS_TOGETHER // pixels, 1)
        if not mirrored:
            offsets_px = [replicate_offset_px(number) for number in range(count)]
            self._run.scene.look_together(new.tile.window, offsets_px)
        try:
            for replicate in range(count):
                whole = replicate == 0 and new.tile.window == self._whole
                rows, origin_m, traced = yield from self._tracer.replicate_tasks(
                    new.number, new.tile, replicate, whole=whole
                )
                renders += traced.renders
                new.quality.add_view(traced, watts_per_unit / count)
                waiting.append((rows, origin_m))
                if len(waiting) < min(together, count - done):
                    continue
                views = self._finisher.finish(waiting, self._tracer.transmitter_m)
                waiting = []
                if mirrored:
                    images = MirrorViews(self._tracer, self._finisher, self._mirrors)
                    rows, made = yield from images.measure(
                        new.number, new.tile, replicate, views[0], traced, new.quality
                    )
                    views = [rows]
                    renders += made
                better = self._clutter.better
                views = [better.in_better_direction(rows, self._tracer) for rows in views]
                self._tiles.add_rows(new, views)
                done += len(views)
                self._progress.replicates_measured(len(views), earlier=False)
        except BaseException as error:
            self._tiles.drop(new, error)
            raise
        seconds = time.monotonic() - start_s
        self._renders += renders
        self._seconds += seconds
        self._tiles.keep(new, renders, seconds)

    # -- the table ---------------------------------------------------------------------------------

    def write(self, stop_reason: str) -> contract.PathsRecord:
        """Write the table, the motion and their record, and remove the tiles."""
        table = self._write_table()
        motion_file = self._motion.write(
            self._folder, self._tracer.instant.time_s, self._run.versions
        )
        quality = QualitySums.joined([self._tiles.quality(), self._beyond])
        record = contract.PathsRecord(
            **self._run.record_fields(),
            **quality.record_fields(self._run.measurement.waveform.wavelength_m),
            frame=self._tracer.frame,
            time_s=self._tracer.instant.time_s,
            receiver=self._receiver,
            transmitter=self._tracer.transmitter,
            tiles=len(self._tiles.tiles),
            small_objects=self._small,
            small_objects_tiled=self._tiled,
            finest_refinement_level=max(
                (m.tile.level for m in self._tiles.tiles.values()), default=0
            ),
            renders=self._renders,
            render_time_s=self._seconds,
            path_count=table.rows,
            relative_error=self._budget.relative_error(),
            stop_reason=stop_reason,
            table_file=contract.PATHS_TABLE,
            column_sha256=table.column_sha256,
            motion_file=motion_file.name,
            motion_sha256=file_sha256(motion_file),
            column_groups=column_groups(self._dtype.names or ()),
            images=list(self._motion.images),
            array_reach_m=self._run.measurement.radar.array_reach_m,
            findings=self._findings(quality),
        )
        write_record(self._folder / contract.PATHS_FILE, record)
        self._parts.remove()
        return record

    def _write_table(self) -> TableFile:
        bodies = set().union(*(measured.quality.bodies for measured in self._tiles.tiles.values()))
        mirrors = self._mirrors.bodies
        self._motion.images = self._mirrors.records
        self._motion.collect(bodies | set(mirrors), self._tiles.chunks())
        self._motion.sample()
        shared = self._mirrors.shared_bodies
        self._moving = [
            name
            for body, name in mirrors.items()
            if self._motion.deforms(body) or (body in shared and self._motion.moves(body))
        ]
        table = self._folder / contract.PATHS_TABLE
        parts = (self._motion.complete(part) for part in self._tiles.chunks())
        rows = sum(measured.rows for measured in self._tiles.tiles.values())
        return write_table(table, parts, rows, self._dtype)

    def _findings(self, quality: QualitySums) -> list[Finding]:
        scene, target = self._run.scene, self._options.max_standard_error
        wavelength_m = self._run.measurement.waveform.wavelength_m
        findings = [
            part
            for item in quality.findings(wavelength_m, scene.objects, target)
            for part in by_surface(item, self._mirrors.bodies.values())
        ]
        if quality.total_w == 0:
            seen = [scene.objects[n - 1] for n in sorted(quality.seen) if n > 0]
            findings += self._no_echo(seen)
        met = quality.seen | quality.echoing | scene.hidden
        findings += missed_objects_findings(
            self._motion.poses, scene.objects, met, self._receiver, self._whole
        )
        if self._tiled < self._small:
            findings.append(
                finding("small-objects-share-tiles", small=self._small, tiled=self._tiled)
            )
        findings += self._said + self._motion.findings + self._mirrors.findings
        errors = self._budget.object_errors()
        uncertain = {
            scene.objects[number - 1]: {"stderr_fraction": error}
            for number, error in errors.items()
            if error > MOST_UNCERTAIN
        }
        if uncertain:
            findings.append(finding_about("power-uncertain", uncertain))
        mean, first = self._budget.totals()[0], self._budget.first_object or 0
        powers_w = {scene.objects[number - 1]: float(mean[first + number]) for number in errors}
        findings += self._smooth.findings(powers_w, scene.objects)
        if self._moving:
            findings.append(finding("mirror-moves", *self._moving))
        if self._clutter:
            receiver_m = np.array(self._receiver.matrix_world)[:3, 3]
            findings += self._clutter.findings(self._tiles.chunks(), receiver_m)
        if len(self._run.measurement.channels) > 1:
            findings += hidden_power(
                self._mirrors.obstacles,
                self._tiles.chunks,
                self._run.measurement.channels,
                self._receiver,
                self._tracer.transmitter,
            ).findings
        # Where the target was not met, `stop_reason` says so.
        if (
            target
            and self._budget.relative_error() <= target
            and self._options.refine_for != "ranges"
        ):
            findings += uncertain_objects(errors, scene.objects, target)
        return [item.in_frame(self._tracer.frame) for item in merge(findings)]


@dataclass(frozen=True)
class RowFinisher:
    """Labels and corrects the rows of one radar frame."""

    motion: BurstMotion
    hits: HitPoints
    clutter: ClutterWeights

    def finish(self, views: Sequence[tuple[PathRows, Real]], transmitter_m: Real) -> list[PathRows]:
        """Return the rows of each view with bodies, vertices, lengths and powers.

        `views` has the rows of each view, which this method may change, and the start of their
        rays, (3,) or (n, 3) [m], with the same number of dimensions in all views. `transmitter_m`
        is the place of the transmitter, or of its mirror image.
        """
        rows_of, origins_m = zip(*views, strict=True)
        if len(views) == 1:
            rows, origin_m = views[0]
        else:
            rows = PathRows.joined(rows_of)
            one_place = origins_m[0].ndim == 1
            origin_m = origins_m[0] if one_place else np.concatenate(origins_m)
        self.motion.label(rows)
        normals = self.hits.refine(rows, origin_m, transmitter_m)
        self.clutter.apply(rows, normals, origin_m, transmitter_m)
        edges = np.cumsum([0, *(one.size for one in rows_of)]).tolist()
        return [rows[start:stop] for start, stop in itertools.pairwise(edges)]


@dataclass(frozen=True)
class MirrorViews:
    """Measures tile replicates over the mirrors of a frame."""

    tracer: ViewTracer
    finisher: RowFinisher
    mirrors: MirrorPaths

    def measure(
        self,
        number: int,
        tile: Tile,
        replicate: int,
        own: PathRows,
        traced: TracedReplicate,
        quality: QualitySums,
    ) -> Generator[PathTask, None, tuple[PathRows, int]]:
        """Render with all images; return the rows of the tile replicate, and the number of renders.

        `own` are the rows without images, and `traced` is their source. Changes of power go to
        `quality`.
        """
        rows, renders = [self.mirrors.number(own, pixel_numbers(traced))], 0
        for image, place_m in enumerate(self.mirrors.lamps_m, start=1):
            found, origin_m, traced = yield from self.tracer.replicate_tasks(
                number, tile, replicate, image, self.mirrors.reflections(image)
            )
            renders += traced.renders
            (found,) = self.finisher.finish([(found, origin_m)], place_m)
            found = self.mirrors.number(found, pixel_numbers(traced))
            found, through_w = self.mirrors.choose(image, found)
            quality.through_mirrored_w += through_w
            quality.total_w += through_w
            rows.append(found)
        every, through_w = self.mirrors.with_both_ways(PathRows.joined(rows))
        quality.through_mirrored_w += through_w
        quality.total_w += through_w
        quality.total_w += float(every["power_w"].sum() - own["power_w"].sum())
        return every, renders


def by_surface(item: Finding, images: Collection[str] = ()) -> list[Finding]:
    """Divide a finding about objects without an echo into rough objects and mirrors.

    Mirrors that have mirror images (`images`) are left out, because their echoes are computed.
    """
    if item.code != "object-without-echo":
        return [item]
    named = (one for one in bpy.data.objects if one.name_full in item.subjects)
    rough = set()
    for one in named:
        known = [read_surface(slot).roughness for slot in slot_materials(one)]
        if known and all(x is not None and x > SMOOTH_BELOW for x in known):
            rough.add(one.name_full)
    others = [name for name in item.subjects if name not in rough and name not in images]
    found = [finding("rough-object-without-echo", *sorted(rough))] if rough else []
    return found + ([finding("object-without-echo", *others)] if others else [])
