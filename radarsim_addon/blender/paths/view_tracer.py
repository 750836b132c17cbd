# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders of parts of the field of view, and the rows of the path table that come out of them.

`ViewTracer` yields a `PathTask` for each render. The driver calls `start`, `render` and `finish` of
the job with it before the next one: a loop headless, a timer in the user interface. Which renders a
tile replicate needs (one for each path class) is up to `views.trace_replicate`; the rows come from
`views.rows_of_replicate`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Generator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ... import contract
from ...arrays import Real
from ...physics.radar_equation import effective_area_m2
from ...signal.decoding import TileReplicate, pixel_rays
from ...signal.paths import PATH_FLAGS, PathRows, replicate_offset_px
from ...signal.tracing import ONE_PLACE
from ..materials import Interiors
from ..plan import Instant, Measurement, PathOptions, Plan
from ..views import (
    PathClass,
    PathScene,
    PowerBeyond,
    RenderRequest,
    TracedReplicate,
    TraceLimits,
    View,
    ViewWindow,
    look_beyond,
    orders_beyond,
    power_seen_beyond,
    ray_origins,
    replicate_seed,
    rows_of_replicate,
    trace_replicate,
)
from .obstacles import DelayedWays
from .tiles import Tile


@dataclass(frozen=True)
class PathRun:
    """What all frames of a run share: the scene, and the options.

    `world_encoding`: a world volume carries the range encoding instead of the materials;
    `deterministic`: Radar Materials choose their lobes by the path class; `polarising`: waves pass
    materials in the mean of two polarisations; `interiors`: how those of objects are computed.
    """

    scene: PathScene
    plan: Plan
    measurement: Measurement
    options: PathOptions
    world_encoding: bool
    deterministic: bool
    polarising: bool
    interiors: Interiors
    versions: dict[str, str]
    fingerprint: str

    @cached_property
    def effective_area_m2(self) -> float:
        """Effective area of an isotropic receiver, lambda^2 / (4 pi) [m^2]."""
        return float(effective_area_m2(self.measurement.waveform.wavelength_m))

    @property
    def watts_per_unit(self) -> float:
        """Received power of radiance times solid angle of 1, per square Blender unit [W]."""
        return self.effective_area_m2 / self.plan.metres_per_unit**2

    def record_fields(self) -> dict[str, Any]:
        """Return the fields of `contract.PathsRecord` that are the same in all frames."""
        measurement, options, plan = self.measurement, self.options, self.plan
        return {
            "metres_per_unit": plan.metres_per_unit,
            "range_encoding_length_m": plan.range_encoding_length_m,
            "extinction_length_m": plan.extinction_length_m,
            "range_encoding": "world" if self.world_encoding else "materials",
            "amplitude_channel": options.amplitude_channel,
            "carrier_hz": measurement.waveform.carrier_hz,
            "width_px": measurement.width_px,
            "height_px": measurement.height_px,
            "max_reflections": options.max_reflections,
            "max_unfollowed_fraction": options.max_unfollowed_fraction,
            "seed": measurement.seed,
            "replicates": options.replicates,
            "error_scope": options.error_scope,
            "objects": self.scene.objects,
            "flags": PATH_FLAGS,
            "versions": self.versions,
            "run_fingerprint": self.fingerprint,
        }


@dataclass(frozen=True)
class PathTask:
    """One render of a tile replicate, as the drivers of a job see it.

    Without a request it is a pause before something else that takes time, called `stage`.
    """

    tracer: ViewTracer
    tile: int
    replicate: int
    request: RenderRequest | None
    stage: str = ""

    @property
    def frame(self) -> int:
        return self.tracer.frame

    @property
    def instant(self) -> Instant:
        return self.tracer.instant

    @property
    def exr_path(self) -> str:
        """Name of this render in error messages. (There is no file.)"""
        return f"{contract.frame_dir(self.frame)}, tile {self.tile}, replicate {self.replicate}"


class ViewTracer:
    """Makes the renders of one radar frame at one instant, to which the run's scene is set.

    `ways` are those to the transmitter; None if nothing delays what is seen directly.
    """

    def __init__(
        self,
        run: PathRun,
        frame: int,
        instant: Instant,
        receiver: contract.ReceiverRecord,
        transmitter: contract.TransmitterRecord,
        ways: DelayedWays | None,
    ) -> None:
        self.run, self.frame, self.instant = run, frame, instant
        self.receiver, self.transmitter = receiver, transmitter
        self.transmitter_m: Real = np.array(transmitter.matrix_world, dtype=np.float64)[:3, 3]
        #: Places of lights that nothing blocks, (n, 3) [m]: images of the transmitter.
        self.lamps_m: Real = np.empty((0, 3))
        self._vertex_map = _vertex_map(run.plan, receiver)
        self._finished: list[View] = []
        self._ways = ways
        #: The orders beyond the last one in the frame's first render, and the weights of its rays.
        self._beyond: tuple[View, Real] | None = None
        #: Renders that were made for these orders alone.
        self.renders_beyond = 0

    def start(self, request: RenderRequest) -> None:
        self.run.scene.begin(request, self._vertex_map)

    def finish(self) -> None:
        self._finished.append(self.run.scene.end())

    def _render(
        self, tile: int, replicate: int, request: RenderRequest
    ) -> Generator[PathTask, None, View]:
        yield PathTask(self, tile, replicate, request)
        return self._finished.pop()

    def look_tasks(
        self, number: int, window: ViewWindow
    ) -> Generator[PathTask, None, tuple[contract.ReceiverRecord, View]]:
        """Render a part of the frame once, before refinement, to find the first surface in each
        pixel.
        """
        self.run.scene.lamps.shine(0)
        receiver = self.run.scene.look(window, (0.0, 0.0), self.run.measurement.seed)
        view = yield from self._render(number, 0, RenderRequest(PathClass(order_max=1)))
        return receiver, view

    def beyond_tasks(
        self, whole: ViewWindow, coloured: bool
    ) -> Generator[PathTask, None, PowerBeyond]:
        """Return the power of paths with more than the largest number of reflections.

        It comes from the first render of the whole frame, or else from a render with few rays.
        """
        if self._beyond is not None:
            return power_seen_beyond(self._limits(), *self._beyond, 1.0, coloured)
        run, window = self.run, whole.with_few_rays()
        run.scene.lamps.shine(0)
        seed = replicate_seed(run.measurement.seed, window, 0)
        receiver = run.scene.look(window, (0.0, 0.0), seed)
        rays = pixel_rays(receiver, window.width_px, window.height_px)
        shared = whole.width_px * whole.height_px / rays.solid_angle_sr.size
        asked = look_beyond(self._limits(), rays.solid_angle_sr, shared, coloured)
        view = yield from self._render(0, 0, next(asked))
        self.renders_beyond += 1
        try:
            asked.send(view)
        except StopIteration as stop:
            found: PowerBeyond = stop.value
        return found

    def replicate_tasks(
        self,
        number: int,
        tile: Tile,
        replicate: int,
        image: int = 0,
        reflections: int = 0,
        whole: bool = False,
    ) -> Generator[PathTask, None, tuple[PathRows, Real, TracedReplicate]]:
        """Make all renders of a tile replicate. Return its rows, the start of their rays, and the
        trace.

        With `image` above 0, the transmitter is at the place of this mirror image, nothing blocks
        it, and paths have at most `reflections` reflections. If the tile is the `whole` frame, its
        first render also gets a second view, of paths with more reflections, where that is
        possible.
        """
        run, window = self.run, tile.window
        run.scene.lamps.shine(image)
        seed = replicate_seed(run.measurement.seed, window, replicate)
        receiver = run.scene.look(window, replicate_offset_px(replicate), seed)
        rays = pixel_rays(receiver, window.width_px, window.height_px)
        limits = self._limits()
        if image:
            limits = dataclasses.replace(limits, max_reflections=reflections)
        trace = trace_replicate(limits, rays.solid_angle_sr)
        request = next(trace)
        views = run.scene.has_second_view and limits.all_opaque and not run.world_encoding
        if whole and views and request.mark is None:
            request = dataclasses.replace(request, beyond=orders_beyond(limits))
        while True:
            view = yield from self._render(number, replicate, request)
            if view.beyond is not None:
                self._beyond = view.beyond, rays.solid_angle_sr
            if tile.own is not None:
                view = view.only(tile.own)
            try:
                request = trace.send(view)
            except StopIteration as stop:
                traced: TracedReplicate = stop.value
                break
        shared = TileReplicate(
            rays,
            self.lamps_m[image - 1] if image else self.transmitter_m,
            run.plan.range_encoding_length_m,
            receiver.near_clip_m,
            run.effective_area_m2,
            1 / run.options.replicates,
            number,
            replicate,
            run.interiors.delay,
            run.interiors.sigma,
            run.interiors.absorption_sigma * run.plan.metres_per_unit,
            None if self._ways is None else self._ways.to,
        )
        rows = rows_of_replicate(traced, shared, run.plan.metres_per_unit, self._vertex_map)
        return rows, ray_origins(traced, rays.origin_m), traced

    def _polarised_from(self) -> int | None:
        """Return the transparent depth from which on both polarisations are traced separately;
        None: never.

        The material of a single wall takes the mean of both polarisations itself. If both antennas
        are in one place, both ways pass the same walls.
        """
        run = self.run
        if not (run.polarising and run.deterministic):
            return None
        place_m = np.asarray(self.receiver.matrix_world, dtype=np.float64)[:3, 3]
        apart_m = float(np.linalg.norm(self.transmitter_m - place_m))
        together = apart_m <= ONE_PLACE * run.plan.extent.from_receiver_m
        return 2 if together and self.receiver.kind != "orthographic" else 0

    def _limits(self) -> TraceLimits:
        run = self.run
        return TraceLimits(
            max_reflections=run.options.max_reflections,
            max_depth=run.options.max_depth,
            max_unfollowed_fraction=run.options.max_unfollowed_fraction,
            deterministic_transmission=run.deterministic,
            world_encoding=run.world_encoding,
            amplitude_channel=run.options.amplitude_channel,
            polarised_from=self._polarised_from(),
            opaque=run.scene.opaque,
            all_opaque=run.scene.all_opaque,
            vertex_marks=run.scene.vertex_marks,
        )


def _vertex_map(plan: Plan, receiver: contract.ReceiverRecord) -> tuple[Real, float]:
    """Return the origin and the scale that map every point of the scene to colours from
    1/2 to 3/2.
    """
    units = plan.metres_per_unit
    position = np.array(receiver.matrix_world, dtype=np.float64)[:3, 3] / units
    reach = max(plan.extent.from_receiver_m + plan.extent.baseline_m, 1e-6) / units
    return position.astype(np.float32).astype(np.float64), float(np.float32(0.5 / reach))
