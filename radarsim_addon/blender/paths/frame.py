# SPDX-License-Identifier: GPL-3.0-or-later
"""One radar frame of the acquisition "paths": its tiles measured, refined, joined into a table."""

from __future__ import annotations

import dataclasses
import hashlib
import math
import time
from collections.abc import Generator, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ... import contract
from ...sidecar import file_sha256, write_record
from ...signal.paths import COLUMN_GROUPS, PATH_FLAGS, PathRows, write_table
from ..motion import BurstMotion
from ..plan import FINEST_PITCH, Instant
from ..views import ViewWindow
from .error_budget import CellGrid, ErrorBudget, ShiftPowers
from .inset_tiles import add_inset_tiles
from .missed_objects import missed_objects_warning
from .quality import QualitySums
from .screen_boxes import ViewBoxes, projected_bounds
from .small_object_ranking import MOST_TILED, in_sight, rank_by_error, small_boxes
from .task import PathTask
from .tile_checkpoints import TileCheckpoints, TileRecord
from .tiles import Tile

if TYPE_CHECKING:
    from .path_job import PathJob

#: Share of the squared error that one round of refinement goes for.
_ROUND_SHARE = 0.8
#: Share of a time budget that tiles laid over small objects may take: refinement needs the rest.
_SHARE_FOR_TILES = 0.5
#: Pixels across of the renders that tell how long a small one takes.
_TRIED_PX = 8
#: Objects that a warning names.
_MOST_NAMED = 5


def _uncertain(errors: dict[int, float], names: Sequence[str], target: float) -> list[str]:
    """Objects that the error target, a mean over all of them, leaves much more uncertain."""
    worse = sorted((n for n, e in errors.items() if e > 2 * target), key=lambda n: -errors[n])
    if not worse:
        return []
    named = ", ".join(f"{names[n - 1]!r} ({100 * errors[n]:.2g} %)" for n in worse[:_MOST_NAMED])
    if len(worse) > _MOST_NAMED:
        named += f" and {len(worse) - _MOST_NAMED} more"
    text = (
        "The error target is one over all objects. The power of these is more than twice as "
        f"uncertain: {named}. Lower the target, or raise the shifts."
    )
    return [text]


@dataclasses.dataclass(frozen=True)
class _Measured:
    """A tile that was measured, and where its rows are."""

    tile: Tile
    key: str
    quality: QualitySums


class FrameWork:
    """Tiles of one radar frame: measured, refined, joined into one table."""

    def __init__(
        self,
        job: PathJob,
        frame: int,
        instant: Instant,
        camera: contract.ReceiverRecord,
        emitter: contract.TransmitterRecord,
        motion: BurstMotion,
    ) -> None:
        self._job, self._frame, self._instant = job, frame, instant
        self._camera, self._emitter, self._motion = camera, emitter, motion
        self._poses = motion.poses
        self._emitter_m = np.array(emitter.matrix_world, dtype=np.float64)[:3, 3]
        self._folder = job.folder / contract.burst_dir(frame, motion.render)
        self._tiles: dict[int, _Measured] = {}
        self._next_number = 0
        # Carrier and burst are none of the run's fingerprint, because whole frames bear them.
        asked = job.measurement
        carrier_hz = asked.waveform.carrier_hz
        self._parts = TileCheckpoints(
            self._folder, f"{job.options!r} {asked.seed} {carrier_hz!r} {asked.burst!r}"
        )
        #: What lies beyond the last order, over the whole frame whatever is refined in it.
        self._further: list[QualitySums] = []
        self._renders, self._seconds = 0, 0.0
        resolution_m = job.measurement.waveform.range_resolution_m
        reach_m = job.plan.rings * job.measurement.ring_step_m
        self._grid = CellGrid(
            resolution_m,
            min(int(reach_m / resolution_m) + 1, 1 << 20),
            ranges=job.options.error_scope != "objects",
        )
        self._budget = ErrorBudget(self._grid.first_object, job.options.error_scope)
        self._whole = ViewWindow(
            camera.left,
            camera.right,
            camera.bottom,
            camera.top,
            asked.width_px,
            asked.height_px,
            sphere=camera.kind == "equirectangular",
        )
        #: Small objects in sight, and how many of them got tiles of their own.
        self._small, self._tiled = 0, 0

    def run(self) -> Generator[PathTask, None, None]:
        """All renders of the frame; its table and record are written at the end.

        Measured tiles stay on disk until then: where a run is stopped, the next one takes them.
        """
        job = self._job
        uniform = tiles = Tile(self._whole).split(job.options.tile_px)
        if job.options.refines:
            chosen = yield from self._choose(uniform)
            tiles = add_inset_tiles(uniform, chosen.areas(self._whole), self._whole, job.options)
        job.total += len(tiles) - len(uniform)
        for tile in tiles:
            yield from self._measure(tile)
        reached = "all tiles"
        if job.options.refines:
            reached = yield from self._refine()
        self._write(reached)
        self._parts.remove()

    def _choose(self, uniform: Sequence[Tile]) -> Generator[PathTask, None, ViewBoxes]:
        """Boxes of the small objects that get tiles of their own."""
        scene = self._job.path_scene
        assert scene is not None
        boxes = projected_bounds(self._poses, scene.objects, self._camera, scene.hidden)
        small = chosen = small_boxes(boxes, self._whole)
        most = MOST_TILED
        if len(small) and self._job.options.time_limit_s:
            most = yield from self._affordable_tiles(uniform[0])
        if len(small) > most:
            start_s = time.monotonic()
            seen = np.zeros(len(small), dtype=bool)
            for number, tile in enumerate(uniform):
                camera, view = yield from self._job.look_tasks(
                    self._frame, self._instant, number, tile.window
                )
                units = self._job.plan.metres_per_unit
                seen |= in_sight(small, camera, tile.window, view, scene.opaque, units)
            self._renders += len(uniform)
            self._seconds += time.monotonic() - start_s
            chosen = rank_by_error(
                small, seen, boxes, self._whole, self._camera, self._emitter_m, most
            )
        self._small, self._tiled = len(small), len(chosen)
        return chosen

    def _affordable_tiles(self, tile: Tile) -> Generator[PathTask, None, int]:
        """Tiles that may be laid over objects within a share of the time budget.

        A small tile takes as long as its renders take to begin, and that grows with the number of
        objects. The second render of two tells; the first one builds what all others use.
        """
        options, window = self._job.options, tile.window
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
            yield from self._job.look_tasks(self._frame, self._instant, 0, few)
        now_s = time.monotonic()
        self._renders += 2
        self._seconds += now_s - start_s
        a_tile_s = options.replicates * (now_s - last_s)
        return min(MOST_TILED, int(_SHARE_FOR_TILES * options.time_limit_s / a_tile_s))

    def _refine(self) -> Generator[PathTask, None, str]:
        """Split the worst tiles until a limit is reached; returns which one it was."""
        options = self._job.options
        while True:
            if (
                options.max_standard_error
                and self._budget.relative_error() <= options.max_standard_error
            ):
                return "error target"
            open_tiles = [
                number
                for number, measured in self._tiles.items()
                if measured.tile.level < options.max_refinement_level
                and measured.tile.window.pitch / 2 >= FINEST_PITCH
            ]
            open_error = math.sqrt(sum(self._budget.squared_errors(open_tiles).values()))
            if open_error <= options.max_standard_error:
                # The others are as fine as may be, and the error is theirs.
                return "finest pixels"
            worst = self._budget.worst(open_tiles, _ROUND_SHARE)
            if not worst:
                return "finest pixels"
            for number in worst:
                if options.time_limit_s and self._seconds > options.time_limit_s:
                    return "time budget"
                # The parts take the tile's place only when all of them are measured.
                parts = self._tiles[number].tile.halved()
                self._job.total += len(parts)
                for part in parts:
                    yield from self._measure(part)
                del self._tiles[number], self._budget.powers[number]

    def _measure(self, tile: Tile) -> Generator[PathTask, None, None]:
        number, self._next_number = self._next_number, self._next_number + 1
        own = None if tile.own is None else hashlib.sha256(tile.own.tobytes()).hexdigest()
        key = self._parts.key(dataclasses.astuple(tile.window), tile.level, own)
        record = self._parts.find(key)
        if record is None:
            record, powers = yield from self._trace(tile, number, key)
            self._job.done += 1
        else:  # an earlier session measured it
            replicates = self._parts.replicates(key, record)
            powers = [
                self._grid.shift_powers(rows, len(record.rows), self._camera) for rows in replicates
            ]
            self._job.found_done()
        quality, further = record.sums()
        self._tiles[number] = _Measured(tile, key, quality)
        self._further.append(further)
        self._budget.powers[number] = self._grid.powers(powers)
        self._renders += record.renders
        self._seconds += record.seconds

    def _trace(
        self, tile: Tile, number: int, key: str
    ) -> Generator[PathTask, None, tuple[TileRecord, list[ShiftPowers]]]:
        """Measure a tile shift by shift, each written before the next one."""
        job = self._job
        start_s = time.monotonic()
        count = job.options.replicates
        quality, further = QualitySums(), QualitySums()
        powers: list[ShiftPowers] = []
        rows_of: list[int] = []
        renders = 0
        with self._parts.writer(key) as part:
            for shift in range(count):
                rows, traced = yield from job.view_tasks(
                    self._frame, self._instant, number, tile, shift, self._emitter_m
                )
                renders += traced.renders
                quality.add_view(traced, job.watts_per_unit / count)
                # One shift of each tile of the unrefined frame asked for more than its paths.
                further.add_beyond(traced, job.watts_per_unit)
                self._motion.label(rows)
                quality.add_rows(rows)
                powers.append(self._grid.shift_powers(rows, count, self._camera))
                rows_of.append(rows.size)
                part.add(rows)
            digest = part.finish()
        record = TileRecord(
            rows_of,
            digest,
            quality.numbers(),
            further.numbers(),
            sorted(quality.seen),
            sorted(quality.echoing),
            renders,
            time.monotonic() - start_s,
        )
        self._parts.keep(key, record)
        return record, powers

    def _chunks(self) -> Iterator[PathRows]:
        """All rows, a part at a time."""
        for number, measured in self._tiles.items():
            yield from self._parts.chunks(measured.key, number)

    def _write(self, reached: str) -> None:
        job = self._job
        table = self._folder / contract.PATHS_TABLE
        for chunk in self._chunks():
            self._motion.collect(chunk)
        self._motion.sample()
        rows = write_table(table, (self._motion.complete(part) for part in self._chunks()))
        motion_file = self._motion.write(self._folder, self._instant.time_s, job.versions)
        parts = [*(measured.quality for measured in self._tiles.values()), *self._further]
        quality = QualitySums.joined(parts)
        wavelength_m = job.measurement.waveform.wavelength_m
        scene = job.path_scene
        assert scene is not None
        warnings = quality.warnings(wavelength_m, scene.objects)
        unseen = missed_objects_warning(
            self._poses,
            scene.objects,
            quality.seen | quality.echoing | scene.hidden,
            self._camera,
            self._whole,
        )
        if unseen:
            warnings.append(unseen)
        if self._tiled < self._small:
            warnings.append(
                f"{self._small:,} small objects are in view and {self._tiled} of them got tiles of "
                "their own: those in sight of fewest pixels whose echo counts. The others are "
                "measured by the rays of the frame. Raise the resolution for those."
            )
        warnings += self._motion.warnings
        # where it was not met, `reached` says so
        met = self._budget.relative_error() <= job.options.max_standard_error
        if job.options.max_standard_error and met and job.options.refine_for != "ranges":
            warnings += _uncertain(
                self._budget.object_errors(), scene.objects, job.options.max_standard_error
            )
        record = contract.PathsRecord(
            frame=self._frame,
            time_s=self._instant.time_s,
            metres_per_unit=job.plan.metres_per_unit,
            range_encoding_length_m=job.plan.range_encoding_length_m,
            extinction_length_m=job.plan.extinction_length_m,
            range_encoding="world" if job.code_world else "materials",
            coloured=quality.coloured,
            amplitude_channel=job.options.amplitude_channel,
            carrier_hz=job.measurement.waveform.carrier_hz,
            receiver=self._camera,
            transmitter=self._emitter,
            width_px=job.measurement.width_px,
            height_px=job.measurement.height_px,
            max_reflections=job.options.max_reflections,
            max_unfollowed_fraction=job.options.max_unfollowed_fraction,
            seed=job.measurement.seed,
            tiles=len(self._tiles),
            replicates=job.options.replicates,
            small_objects=self._small,
            small_objects_tiled=self._tiled,
            finest_refinement_level=max((m.tile.level for m in self._tiles.values()), default=0),
            renders=self._renders,
            render_time_s=self._seconds,
            path_count=rows,
            column_groups=COLUMN_GROUPS,
            flags=PATH_FLAGS,
            objects=scene.objects,
            total_power_w=quality.total_w,
            truncated_reflections_fraction=quality.share(quality.left_order_w),
            truncated_reflections_stderr=quality.truncated_reflections_stderr,
            truncated_transparency_fraction=quality.share(quality.left_depth_w),
            mixed_power_fraction=quality.share(quality.mixed_w),
            unranged_power_fraction=quality.share(quality.no_code_w),
            mixed_bias_bound_m=quality.mixed_bias_bound_m,
            length_sigma_m=quality.length_sigma_m,
            length_sigma_wavelengths=quality.length_sigma_m / wavelength_m,
            relative_error=self._budget.relative_error(),
            error_scope=job.options.error_scope,
            stop_reason=reached,
            table_file=table.name,
            table_sha256=file_sha256(table),
            motion_file=motion_file.name,
            motion_sha256=file_sha256(motion_file),
            warnings=warnings,
            versions=job.versions,
        )
        job.frame_warnings.add(self._frame, record.warnings)
        known = f"{100 * record.relative_error:.2g} %" if rows else "unknown"
        job.summary = (
            f"{rows:,} paths, standard error {known}, lengths known to "
            f"{record.length_sigma_wavelengths:.2g} wavelengths; ended by {reached}"
        )
        write_record(self._folder / contract.PATHS_FILE, record)
