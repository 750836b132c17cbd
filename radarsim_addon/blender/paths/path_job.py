# SPDX-License-Identifier: GPL-3.0-or-later
"""Acquisition "paths": one path per pixel, tile by tile, until the error or the time is reached.

Driven like :class:`.run.MeasurementJob`: ``pending`` yields renders, each goes through
``start``, ``render`` and ``finish``. Which render comes next depends on the last one.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ... import contract
from ...errors import RadarSimError, SchemaError
from ...physics.radar_equation import effective_area_m2
from ...sidecar import file_sha256, read_record
from ...signal.decoding import pixel_rays
from ...signal.paths import PathRows, shift_px
from ..materials import SURFACE_TYPES, assigned_materials
from ..motion import BurstMotion, SamplingPlan
from ..nodes import is_radar_material
from ..plan import Extent, Instant, Measurement, PathOptions, Plan, make_plan
from ..run import MeasurementJob, MeasurementSettings, output_folder
from ..scene import receiver_record, transmitter_record
from ..state import evaluated_depsgraph
from ..views import (
    Gate,
    PathScene,
    RenderRequest,
    TracedView,
    TraceLimits,
    View,
    ViewWindow,
    rows_of_view,
    trace_view,
    view_seed,
)
from .frame import FrameWork
from .task import PathTask
from .tile_checkpoints import TileCheckpoints
from .tiles import Tile

#: Ranges may exceed the scene's geometric extent by optical delays.
_RANGE_MARGIN = 1.25


class PathJob(MeasurementJob):
    """A run that measures paths. Parameters as `MeasurementJob`, and how paths are followed."""

    unit = "tiles"
    any_projection = True
    blocking = True

    def __init__(
        self,
        scene: Any,
        view_layer: Any,
        measurement: Measurement,
        folder: Path,
        options: PathOptions,
        **keywords: Any,
    ) -> None:
        # One sample a pixel; bounces follow from the order.
        measurement = dataclasses.replace(
            measurement, samples=1, max_reflections=options.max_reflections
        )
        super().__init__(scene, view_layer, measurement, folder, **keywords)
        self.options = options
        self.path_scene: PathScene | None = None
        self._view: View | None = None
        self.code_world = _needs_world_code(view_layer, options)

    @property
    def measurement(self) -> Measurement:
        """What is asked for."""
        return self._measurement

    # -- before the first render -------------------------------------------------------------------

    def _surveyed(self, frame: int) -> tuple[float, ...]:
        # what flies away in the burst stays in the window
        return (float(frame), frame + self._span_s * self._fps())

    def _make_plan(self, extent: Extent) -> Plan:
        # One "ring" as wide as the scene: the range window, and what the code has to reach.
        reach_m = max(extent.from_emitter_m, extent.from_receiver_m) * _RANGE_MARGIN
        self._measurement = dataclasses.replace(
            self._measurement, rings=1, ring_step_m=max(reach_m, self._metres_per_unit() * 1e-3)
        )
        return make_plan(
            self._measurement,
            self._metres_per_unit(),
            self._fps(),
            extent,
            sampling_mode="paths",
            options=repr(self.options) + (" world" if self.code_world else " materials"),
            visibility_updates=self.options.visibility_updates,
        )

    def _make_settings(self) -> MeasurementSettings:
        return MeasurementSettings(
            self._scene, self._view_layer, self.rig, self.plan, any_material=self.code_world
        )

    def _plan_renders(self) -> None:
        self.total = self.done = 0  # `prepare` counts the tiles once the scene is known

    def prepare(self) -> None:
        """As `MeasurementJob.prepare`, and the scene set for one path per pixel."""
        super().prepare()
        try:
            self.path_scene = PathScene(
                self._scene,
                self._view_layer,
                self.rig.camera,
                self.rig.emitter,
                self.plan.metres_per_unit,
                self.plan.range_encoding_length_m,
                self.code_world,
            )
            self.path_scene.apply()
        except BaseException:
            self.restore()
            raise
        frames = self._measurement.frames
        self._frames_left = [n for n in frames if not self._is_done(n)]
        side = self.options.tile_px
        tiles = -(-self._measurement.width_px // side) * -(-self._measurement.height_px // side)
        # More where tiles are refined: the total grows as they are split.
        renders = self.options.visibility_updates
        self.total = tiles * len(frames) * renders
        kept = [
            (frame, render)
            for frame in frames
            for render in range(renders)
            if self._render_is_done(frame, render)
        ]
        self.done = self._done_before = tiles * len(kept)
        for frame, render in kept:  # a kill may have left them
            TileCheckpoints(self.folder / contract.burst_dir(frame, render), "").remove()

    @property
    def _span_s(self) -> float:
        """Length of a burst [s]."""
        burst = self._measurement.burst
        return burst.pulses / burst.prf_hz

    def _is_done(self, frame: int) -> bool:
        renders = range(self.options.visibility_updates)
        return all(self._render_is_done(frame, render) for render in renders)

    def _render_is_done(self, frame: int, render: int) -> bool:
        folder = self.folder / contract.burst_dir(frame, render)
        try:
            record = read_record(folder / contract.PATHS_FILE, contract.PathsRecord)
            motion = read_record(folder / contract.MOTION_FILE, contract.MotionRecord)
            return (
                file_sha256(folder / record.table_file) == record.table_sha256
                and file_sha256(folder / contract.MOTION_FILE) == record.motion_sha256
                # a longer burst than before is sampled anew
                and motion.duration_s >= self._span_s * (1 - 1e-9)
            )
        except (RadarSimError, SchemaError, OSError):
            return False

    # -- renders -----------------------------------------------------------------------------------

    def pending(self) -> Iterator[Any]:
        """Renders that are still to be made; each depends on the ones before."""
        for frame in self._frames_left:
            try:
                yield from self._frame_tasks(frame)
            except (OSError, RadarSimError):
                # What cannot be written or found is no error of its own where all is gone.
                output_folder.check_there(self.folder, frame)
                raise
        self.total = self.done

    def start(self, task: Any) -> None:
        """Set the gates of a render."""
        assert self.path_scene is not None
        self.path_scene.begin(task.request, self._vertex_map)

    def render(self, task: Any) -> None:
        """Render and wait for the end (not for use in the UI)."""
        assert self.path_scene is not None
        self.path_scene.render()

    def finish(self, task: Any) -> None:
        """Read what was rendered."""
        assert self.path_scene is not None
        self._view = self.path_scene.end()
        self._rendered += 1

    @property
    def seconds_left(self) -> float | None:
        """Estimate from the tiles of this session; refinement may add more of them."""
        measured = self.done - self._done_before
        if measured <= 0:
            return None
        return (time.monotonic() - self._started_s) / measured * (self.total - self.done)

    def restore(self) -> None:
        """Give the user's scene back."""
        if self.path_scene is not None:
            self.unrestored += self.path_scene.restore()
        super().restore()

    # -- one radar frame ---------------------------------------------------------------------------

    def _frame_tasks(self, frame: int) -> Generator[PathTask, None, None]:
        assert self.path_scene is not None
        output_folder.make_frame_folder(self.folder, frame)
        self._write_scene(frame)
        for render in range(self.options.visibility_updates):
            if not self._render_is_done(frame, render):
                output_folder.make_frame_folder(self.folder, frame, render)
                yield from self._render_tasks(frame, render)

    def _render_tasks(self, frame: int, render: int) -> Generator[PathTask, None, None]:
        """One of the renders of a burst."""
        assert self.path_scene is not None
        units = self.plan.metres_per_unit
        last = self.options.visibility_updates - 1
        sampling = SamplingPlan(
            frame,
            self._fps(),
            self._span_s,
            units,
            self._measurement.waveform.wavelength_m,
            self.options.motion_samples,
            render / last if last else 0.0,
        )
        motion = BurstMotion(
            self._show,
            self.rig,
            self.path_scene.objects,
            sampling,
            self.path_scene.kind,
            frozen=self.options.motion == "off",
            render=render,
        )
        depsgraph = motion.begin()
        camera = receiver_record(
            self.rig, depsgraph, units, self._measurement.width_px, self._measurement.height_px
        )
        emitter = transmitter_record(self.rig, depsgraph, units)
        self.path_scene.place(depsgraph)
        self._vertex_map = _vertex_map(self.plan.extent, camera, units)
        work = FrameWork(self, frame, sampling.rendered[1], camera, emitter, motion)
        yield from work.run()

    def found_done(self) -> None:
        """A tile that an earlier session measured."""
        self.done += 1
        self._done_before += 1

    @property
    def watts_per_unit(self) -> float:
        """Received power of a unit of radiance times solid angle, per square Blender unit [W]."""
        area_m2 = float(effective_area_m2(self._measurement.waveform.wavelength_m))
        return area_m2 / self.plan.metres_per_unit**2

    def look_tasks(
        self, frame: int, instant: Instant, number: int, window: ViewWindow
    ) -> Generator[PathTask, None, tuple[contract.ReceiverRecord, View]]:
        """One render of a part of the unrefined frame, for what is seen first in each pixel."""
        assert self.path_scene is not None
        record = self.path_scene.look(window, (0.0, 0.0), self._measurement.seed)
        yield PathTask(frame, instant, number, 0, RenderRequest(Gate(order_max=1)))
        assert self._view is not None
        return record, self._view

    def view_tasks(
        self,
        frame: int,
        instant: Instant,
        number: int,
        tile: Tile,
        shift: int,
        emitter_m: NDArray[np.float64],
    ) -> Generator[PathTask, None, tuple[PathRows, TracedView]]:
        """All renders of one view; returns its rows, and what was found."""
        assert self.path_scene is not None
        options, window = self.options, tile.window
        seed = view_seed(self._measurement.seed, window, shift)
        record = self.path_scene.look(window, shift_px(shift), seed)
        rays = pixel_rays(record, window.width_px, window.height_px)
        limits = TraceLimits(
            max_reflections=options.max_reflections,
            max_depth=options.max_depth,
            residual=options.max_unfollowed_fraction,
            deterministic_transmission=not self.code_world,
            world_code=self.code_world,
            amplitude=options.amplitude_channel,
            # What lies beyond is asked once, of the whole frame: finer tiles would ask it again.
            probe=shift == 0 and tile.level == 0,
            opaque=self.path_scene.opaque,
        )
        trace = trace_view(limits, rays.solid_angle_sr)
        request = next(trace)
        while True:
            yield PathTask(frame, instant, number, shift, request)
            assert self._view is not None
            view = self._view
            if tile.own is not None and not request.probe:
                view = view.only(tile.own)
            try:
                request = trace.send(view)
            except StopIteration as stop:
                traced: TracedView = stop.value
                break
        rows = rows_of_view(
            traced,
            rays,
            record,
            emitter_m,
            self.plan.range_encoding_length_m,
            self.plan.metres_per_unit,
            self._vertex_map,
            float(effective_area_m2(self._measurement.waveform.wavelength_m)),
            1 / options.replicates,
            number,
            shift,
        )
        return rows, traced


def _vertex_map(
    extent: Extent, camera: contract.ReceiverRecord, metres_per_unit: float
) -> tuple[NDArray[np.float64], float]:
    """Origin and scale that bring every point of the scene to colours from 1/2 to 3/2."""
    position = np.array(camera.matrix_world, dtype=np.float64)[:3, 3] / metres_per_unit
    reach = max(extent.from_receiver_m + extent.baseline_m, 1e-6) / metres_per_unit
    return position.astype(np.float32).astype(np.float64), float(np.float32(0.5 / reach))


def _needs_world_code(view_layer: Any, options: PathOptions) -> bool:
    """Whether something that can echo has another material than the Radar Material."""
    if options.range_encoding != "auto":
        return options.range_encoding == "world"
    for item in bpy.data.objects:
        if item.type not in SURFACE_TYPES or item.hide_render:
            continue
        if not item.material_slots:
            return True
        if any(
            s.material is None or not is_radar_material(s.material) for s in item.material_slots
        ):
            return True
    # What geometry nodes set shows in the evaluated object alone.
    return any(
        material is not None and not is_radar_material(material)
        for worn in assigned_materials(evaluated_depsgraph(view_layer))
        for material in worn.materials
    )
