# SPDX-License-Identifier: GPL-3.0-or-later
"""Which path classes to render so that each pixel holds one path, and when no power is left.

In path class (n, t) the transmitter lights only paths with n reflections that passed t transparent
surfaces on the camera's side. With one sample, each pixel holds at most one path of the class, so
its range is exact. An open path class (without upper limits), rendered with the same paths, gives
for each pixel the sum that its path classes must reach. Only classes with remaining power are
rendered.

`trace_replicate` is a generator. It yields a `RenderRequest` and is sent the `View` that Cycles
made of it. So the same plan can be driven by a loop without a window, by a timer in the UI, and by
a closed form in tests. `rows_of_replicate` makes rows of the path table from the result.
`look_beyond` measures the power of the orders above the limit from one render. Does not import bpy.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Generator, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Real
from ...signal.decoding import PathClassPixels, TileReplicate, assemble_rows, log_encoding_ratio
from ...signal.paths import PathRows
from .requests import (
    PathClass,
    Region,
    RenderRequest,
    VertexMark,
    View,
    bounding_region,
    variance_of_sum,
)

#: Least light that float32 holds with all its digits.
_TINY = float(np.finfo(np.float32).tiny)
#: A channel may differ from blue by this much and a pixel still counts as grey: float32 rounding
#: over a few reflections stays below it.
_GREY_TOLERANCE = 1e-5
#: Number of transparent surfaces after which the remaining power is measured.
_TAIL_EVERY = 4
#: Differences of renders below this fraction of the minuend are float32 rounding.
_ROUNDING = 1e-6
#: Orders above the limit whose power is measured, without following their paths.
_PROBED_ORDERS = 4


@dataclass(frozen=True)
class PathClassLayer:
    """Paths of one path class, at most one per pixel."""

    order: int
    depth: int
    #: Their radiance, or 0, (h, w).
    amplitude: Real
    #: The encoded render.
    encoded: View
    #: The same paths without range encoding (coloured scenes).
    plain: View | None = None
    #: Orders above 1: the last vertex in its colours, over those of `white`; of `encoded` if that
    #: is None.
    vertex: View | None = None
    white: View | None = None
    #: The encoded view's position is where the path first scatters.
    position_is_first: bool = True


@dataclass
class TracedReplicate:
    """The result of `trace_replicate` for one tile replicate.

    Powers are sums of amplitude times weight: W per square Blender unit.
    """

    #: Paths by class.
    layers: list[PathClassLayer] = field(default_factory=list)
    #: The first render: what is seen first in each pixel.
    open_view: View | None = None
    #: Power of all orders up to the limit.
    total: float = 0.0
    #: Parts of it in higher orders and behind more transparent surfaces that were not followed.
    truncated_reflections: float = 0.0
    truncated_transparency: float = 0.0
    #: Power of the strongest path.
    strongest: float = 0.0
    #: Number of renders.
    renders: int = 0
    #: Whether the channels differ.
    coloured: bool = False


@dataclass(frozen=True)
class TraceLimits:
    """Limits up to which paths are followed."""

    #: Most reflections.
    max_reflections: int = 1
    #: Most transparent surfaces on the camera's side.
    max_depth: int = 64
    #: Fraction of the total power below which what is left is not followed.
    max_unfollowed_fraction: float = 1e-4
    #: At order 1, rays pass Radar Materials that let power through with certainty.
    deterministic_transmission: bool = False
    #: The range encoding is in the world's volume: materials may be of any kind, coloured ones too.
    world_encoding: bool = False
    #: Channel that is the amplitude in a coloured scene: "R", "G", "B" or "mean".
    amplitude_channel: str = "mean"
    #: Transparent surfaces from which on both polarisations are carried through all of them at
    #: order 1, with `deterministic_transmission`; None: each surface takes the mean.
    polarised_from: int | None = None
    #: Numbers of objects that let no ray through.
    opaque: frozenset[int] = frozenset()
    #: No surface in the scene lets rays through, so all paths have depth 0.
    all_opaque: bool = False
    #: Renders can mark last vertices, see `VertexMark`.
    vertex_marks: bool = False


def trace_replicate(
    limits: TraceLimits, weight: Real
) -> Generator[RenderRequest, View, TracedReplicate]:
    """Follow all paths of one tile replicate. Yield each request, and receive its view by `send`.

    `weight` is that of each pixel's power (its solid angle), (h, w).
    """
    found = TracedReplicate()
    tracer = _Tracer(limits, weight, found)
    lowest, view = 1, None
    if limits.deterministic_transmission:
        anything = yield from tracer.first_order_in_turn()
        if not anything:
            return found
        lowest = 2
        left, view = yield from tracer.orders_from_2()
    else:
        # The world's range encoding leaves paths as they are: the sum needs none. Materials that
        # carry it weigh their lobes by it, so switching it would change the paths.
        left = yield from tracer.open_render(PathClass(order_max=limits.max_reflections))
    # Where nothing is of another depth than 0, the render of an order is that of its only class.
    only = limits.all_opaque and (not limits.world_encoding or not found.coloured)
    for order in range(lowest, limits.max_reflections + 1):
        if tracer.power(np.abs(left)) <= limits.max_unfollowed_fraction * found.total:
            break
        if order == limits.max_reflections == lowest:
            base = left  # what is left holds no other order
        else:
            path_class = PathClass(order_min=order, order_max=order)
            view = yield from tracer.render(
                RenderRequest(path_class, encoded=only or not limits.world_encoding),
                (order, 0),
                echoes=only,
            )
            base = tracer.amplitude(view)
        if tracer.power(base) > 0:
            yield from tracer.depths_of(order, base, view if only else None)
        left = left - base
    found.truncated_reflections = tracer.power(np.maximum(left, 0.0))
    powers = (np.max(layer.amplitude * weight, initial=0.0) for layer in found.layers)
    found.strongest = float(max(powers, default=0.0))
    return found


class _Tracer:
    """The steps of `trace_replicate` with their shared state."""

    def __init__(self, limits: TraceLimits, weight: Real, found: TracedReplicate) -> None:
        self._limits = limits
        self._weight = weight
        self._found = found
        self._marks = MarkedVertices(limits)

    def render(
        self,
        request: RenderRequest,
        path_class: tuple[int, int] | None = None,
        echoes: bool = False,
    ) -> Generator[RenderRequest, View, View]:
        """Request a render. It marks vertices of its path class or of a later one, see
        `MarkedVertices.choose`.
        """
        if path_class is not None:
            mark = self._marks.choose(request, path_class, echoes)
            request = dataclasses.replace(request, mark=mark)
        view = yield request
        self._found.renders += 1
        self._marks.keep(request, view)
        return view

    def power(self, amplitude: Real) -> float:
        return float(np.sum(amplitude * self._weight))

    def amplitude(self, view: View) -> Real:
        """Return the channel that is the amplitude: blue, unless the scene is coloured."""
        return amplitude_of(view, self._limits.amplitude_channel if self._found.coloured else "B")

    def open_render(self, path_class: PathClass) -> Generator[RenderRequest, View, Real]:
        """Return the sum that the path classes must reach. This also shows whether the scene is
        coloured.
        """
        found, limits = self._found, self._limits
        view = yield from self.render(
            RenderRequest(path_class, encoded=not limits.world_encoding), (1, 0)
        )
        found.open_view = view
        if limits.world_encoding:
            scale = view.channels().max(axis=0)
            spread = scale - view.channels().min(axis=0)
            found.coloured = bool(np.any(spread > _GREY_TOLERANCE * scale))
        amplitude = self.amplitude(view)
        found.total = self.power(amplitude)
        return amplitude

    def orders_from_2(self) -> Generator[RenderRequest, View, tuple[Real, View | None]]:
        """Return the amplitudes of all orders from 2 up to the limit, and their view."""
        found, limits = self._found, self._limits
        if limits.max_reflections == 1:
            return np.zeros_like(self._weight), None
        path_class = PathClass(order_min=2, order_max=limits.max_reflections)
        encoded = limits.all_opaque or not limits.world_encoding
        view = yield from self.render(RenderRequest(path_class, encoded=encoded), (2, 0))
        later = self.amplitude(view)
        found.total += self.power(later)
        return later, view

    def depths_of(
        self, order: int, base: Real, only: View | None = None
    ) -> Generator[RenderRequest, View, None]:
        """Render all depths of one order, until they add up to `base`. Lobes are chosen at random.

        `only` is the view of `base` if the depth can only be 0. An empty path class does not end
        this: a wholly transparent layer leaves a gap in the depths.
        """
        left, limits = base.copy(), self._limits
        region = bounding_region(base > 0)
        for depth in range(limits.max_depth + 1):
            path_class = PathClass(order, order, depth, depth)
            layer = yield from self.layer(order, depth, path_class, region, only)
            left -= layer.amplitude
            if self.power(np.abs(left)) <= limits.max_unfollowed_fraction * self._found.total:
                break
            # Below this it is rounding of what was found.
            region = bounding_region(left > _ROUNDING * base)
        self._found.truncated_transparency += self.power(np.maximum(left, 0.0))

    def first_order_in_turn(self) -> Generator[RenderRequest, View, bool]:
        """Render order 1, where rays pass each Radar Material before the path class with certainty.

        The number of depths follows from what the views show, and not from a render of all
        remaining paths. In such a render lobes are chosen at random, and a small target behind a
        pane would be lost whenever the pane's reflection is chosen. Such a render is made only from
        time to time, to end a long chain of layers whose rest may stay unfollowed, and at the end,
        to measure what lies beyond the last path class. Return whether any surface is seen.
        """
        found, limits = self._found, self._limits
        left, in_layers = 0.0, 0.0
        region: Region | None = None
        for depth in range(limits.max_depth + 1):
            if depth and depth % _TAIL_EVERY == 0:
                left = yield from self._tail(depth, region)
                if left <= limits.max_unfollowed_fraction * (in_layers + left):
                    break
            path_class = PathClass(1, 1, depth, depth, surface_depth=depth)
            layer = yield from self.layer(1, depth, path_class, region)
            if depth == 0:
                found.open_view = layer.encoded
            in_layers += self.power(layer.amplitude)
            open_pixels = self._lets_through(layer.encoded)
            left = 0.0
            if not open_pixels.any():
                break
            region = bounding_region(open_pixels)
        else:
            left = yield from self._tail(limits.max_depth + 1, region)
        found.total = in_layers + left
        found.truncated_transparency += left
        index = found.open_view.object_index if found.open_view is not None else None
        return index is None or bool(np.any(index > 0))

    def _tail(self, depth: int, region: Region | None) -> Generator[RenderRequest, View, float]:
        """Return the power of order 1 from this depth on, where lobes are chosen at random."""
        path_class = PathClass(1, 1, depth, None, surface_depth=depth)
        encoded = not self._limits.world_encoding
        view = yield from self.render(RenderRequest(path_class, encoded=encoded, region=region))
        return self.power(self.amplitude(view))

    def _lets_through(self, view: View) -> NDArray[np.bool_]:
        """Return the pixels in which more may lie behind the surface that was seen."""
        if view.object_index is None:
            return np.ones(view.blue.shape, dtype=bool)
        closed = np.isin(view.object_index, [0, *self._limits.opaque])
        return np.asarray(~closed)

    def layer(
        self,
        order: int,
        depth: int,
        path_class: PathClass,
        region: Region | None,
        encoded: View | None = None,
    ) -> Generator[RenderRequest, View, PathClassLayer]:
        coloured = self._found.coloured
        if encoded is None:
            encoded = yield from self.render(
                RenderRequest(path_class, region=region, all_channels=coloured),
                (order, depth),
                echoes=True,
            )
        plain = None
        if coloured:
            plain = yield from self.render(RenderRequest(path_class, encoded=False, region=region))
        amplitude = self.amplitude(plain or encoded)
        least = self._limits.polarised_from
        certain = path_class.surface_depth is not None
        if certain and least is not None and depth >= least and np.any(amplitude > 0):
            view = yield from self.render(
                RenderRequest(path_class, encoded=False, by_polarisation=True, region=region)
            )
            amplitude = mean_of_polarisations(view, amplitude)
        vertex = white = None
        if order > 1 and np.any(amplitude > 0):
            marks = self._marks.found(order, depth, coloured, amplitude)
            if marks is None:
                vertex = yield from self.render(
                    RenderRequest(path_class, vertex=True, region=region, all_channels=coloured),
                    self._marks.after(order, depth),
                )
            else:
                vertex, white = marks
        first = depth == 0 or path_class.surface_depth is not None
        layer = PathClassLayer(order, depth, amplitude, encoded, plain, vertex, white, first)
        if np.any(amplitude > 0):
            self._found.layers.append(layer)
        return layer


def amplitude_of(view: View, channel: str) -> Real:
    """Return the channel that is the amplitude: "R", "G", "B" or "mean" of all."""
    if channel == "mean":
        red, green, blue = view.channels()
        return np.asarray((red + green + blue) / 3)
    planes = {"R": view.red, "G": view.green, "B": view.blue}
    return planes[channel].astype(np.float64)


def mean_of_polarisations(view: View, amplitude: Real) -> Real:
    """Return the amplitude with the mean of both polarisations on each of the two ways.

    The view has p on both ways in red, and s on one of the ways in green and blue. The value for s
    on both ways follows, because the ways are independent factors of a path. `amplitude` stays
    where p passes no power.
    """
    red, green, blue = view.channels()
    with np.errstate(divide="ignore", invalid="ignore"):
        both_s = green * blue / red
    mean = (red + green + blue + both_s) / 4
    return np.where((red > 0) & (amplitude > 0), mean, amplitude)


class MarkedVertices:
    """Marks of last vertices in the renders of one tile replicate.

    The place of a last vertex is the ratio of two renders of the marks of its path class: one with
    places as colours, and a white one. Each render with the same random paths can provide one of
    the two, whatever path class the transmitter lights in it. So a class whose marks have both
    renders needs no render of its own for them.
    """

    def __init__(self, limits: TraceLimits) -> None:
        self._limits = limits
        #: Renders of marks; the second key is whether their blue has range encoding.
        self._views: dict[tuple[VertexMark, bool], View] = {}

    def choose(
        self, request: RenderRequest, path_class: tuple[int, int], echoes: bool = False
    ) -> VertexMark | None:
        """Return what a render should mark: one of the two renders of a path class's marks, or of a
        later class.

        `path_class` has order and depth of the first class that may have remaining power. `echoes`:
        the render is that of the echoes of this class. If the class has none of its marks yet, one
        of them alone is of no use, and the transmitter's colours have to give the vertex. None if
        nothing is left to mark, or if the paths are not those of the renders that provide the other
        half.
        """
        asked = request.path_class
        # Rays that pass surfaces with certainty take other paths than rays that pass at random.
        limits = self._limits
        certain = asked.surface_depth is not None and not limits.all_opaque
        if not limits.vertex_marks or not request.encoded or certain or asked.order_max is None:
            return None
        if path_class[0] == 1:  # its vertex is known
            path_class, echoes = (2, 0), False
        if echoes and (VertexMark(*path_class, False), request.all_channels) not in self._views:
            path_class = self.after(*path_class)
        # A ray meets one more surface than it is reflected by; but if it may only end there, it
        # passes what is transparent before with certainty.
        highest = asked.order_max + limits.all_opaque
        for order, depth in self._classes(*path_class):
            if order > highest:
                return None
            for place in (False, True):
                mark = VertexMark(order, depth, place)
                if (mark, request.all_channels) not in self._views:
                    return mark
        return None

    def keep(self, request: RenderRequest, view: View) -> None:
        """Keep the marks of a render."""
        if request.mark is not None and view.marks is not None:
            self._views[request.mark, request.all_channels] = view.marks

    def found(
        self, order: int, depth: int, all_channels: bool, amplitude: Real
    ) -> tuple[View, View] | None:
        """Return the marks of a path class with places as colours, and the white ones.

        None if one of the two is missing in a pixel with an `amplitude`, (h, w).
        """
        keys = [(VertexMark(order, depth, place), all_channels) for place in (True, False)]
        if not all(key in self._views for key in keys):
            return None
        coloured, white = (self._views[key] for key in keys)
        lit = np.flatnonzero(amplitude > 0)
        whole = all(np.all(view.colours(lit) >= _TINY) for view in (coloured, white))
        return (coloured, white) if whole else None

    def after(self, order: int, depth: int) -> tuple[int, int]:
        """Return the next path class that may have remaining power."""
        return (order + 1, 0) if self._limits.all_opaque else (order, depth + 1)

    def _classes(self, order: int, depth: int) -> Iterator[tuple[int, int]]:
        """Yield this path class and the later ones."""
        limits = self._limits
        while order <= limits.max_reflections and depth <= limits.max_depth:
            yield order, depth
            order, depth = self.after(order, depth)


def rows_of_replicate(
    traced: TracedReplicate,
    shared: TileReplicate,
    metres_per_unit: float,
    vertex_map: tuple[Real, float],
) -> PathRows:
    """Make the rows of all paths of one tile replicate, path class by path class.

    `shared` has the rays and the transmitter. `vertex_map` has origin (3,) and scale of the last
    vertex in the transmitter's colours, in Blender units.
    """
    found = [np.flatnonzero(layer.amplitude > 0) for layer in traced.layers]
    rows = PathRows.zeros(sum(index.size for index in found))
    start = 0
    for layer, index in zip(traced.layers, found, strict=True):
        pixels = _pixels(layer, index, metres_per_unit, vertex_map, traced.coloured)
        assemble_rows(pixels, index, shared, rows[start : start + index.size])
        start += index.size
    return rows


def _pixels(
    layer: PathClassLayer,
    index: Indices,
    metres_per_unit: float,
    vertex_map: tuple[Real, float],
    coloured: bool,
) -> PathClassPixels:
    amplitude = layer.amplitude.take(index)
    encoded = layer.encoded.colours(index)
    mixing = np.full(amplitude.shape, np.nan)
    if coloured and layer.plain is not None:
        plain = layer.plain.colours(index)
        log_ratio = _coloured_ratio(encoded, plain)
    else:
        log_ratio = log_encoding_ratio(encoded[0], encoded[2])
        usable = (encoded[0] > 1e-37) & (encoded[1] > 1e-37)
        # as (G/R)(B/R): R^2 may underflow
        np.divide(encoded[1], encoded[0], out=mixing, where=usable)
        mixing[usable] *= encoded[2][usable] / encoded[0][usable]
    nowhere = np.broadcast_to(np.nan, (amplitude.size, 3))
    position = nowhere
    unknown = np.zeros(amplitude.size, dtype=np.int32)
    first_object = unknown
    view = layer.encoded
    if view.position is not None:
        seen = view.position.reshape(-1, 3).take(index, axis=0)
        position = seen.astype(np.float64) * metres_per_unit
    if view.object_index is not None and layer.position_is_first:
        first_object = view.object_index.take(index)
    vertex = nowhere
    if layer.vertex is not None:
        white = encoded if layer.white is None else layer.white.colours(index)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = layer.vertex.colours(index) / white
        origin, scale = vertex_map
        vertex = (origin + (ratio.T - 1) / scale) * metres_per_unit
    return PathClassPixels(
        order=layer.order,
        depth=layer.depth,
        amplitude=amplitude / metres_per_unit**2,
        log_ratio=log_ratio,
        mixing=mixing,
        position_m=position,
        vertex_m=vertex,
        object=first_object if layer.order == 1 else unknown,
        first_object=first_object,
        position_is_first=layer.position_is_first,
    )


def _coloured_ratio(encoded: Real, plain: Real) -> Real:
    """Return the encoded length from the brightest channel: red and blue decay by 1/k, green by
    2/k.
    """
    rates = np.array([1.0, 2.0, 1.0])[:, None]
    ratios = log_encoding_ratio(encoded, plain) / rates
    best = np.argmax(np.where(np.isfinite(ratios), plain, -1.0), axis=0)
    return np.asarray(np.take_along_axis(ratios, best[None], axis=0)[0])


def ray_origins(traced: TracedReplicate, origin_m: Real) -> Real:
    """Return where the rays of all rows start, (paths, 3) [m], or (3,) if it is one place.

    `origin_m` is that of all pixels, (3,) or (h, w, 3).
    """
    if origin_m.ndim == 1:
        return origin_m
    parts = [origin_m[layer.amplitude > 0] for layer in traced.layers]
    return np.concatenate(parts) if parts else np.empty((0, 3))


def pixel_numbers(traced: TracedReplicate) -> Indices:
    """Return the pixel of each row, counted row by row from 1, (paths,)."""
    parts = [np.flatnonzero(layer.amplitude > 0) + 1 for layer in traced.layers]
    return np.concatenate(parts) if parts else np.empty(0, dtype=np.intp)


@dataclass(frozen=True)
class PowerBeyond:
    """Power of the orders above the limit: W per square Blender unit."""

    #: Their power, and the square of its standard error.
    power: float = 0.0
    variance: float = 0.0
    #: Most power that one ray brought.
    strongest_ray: float = 0.0
    #: Pixels of the frame that share a ray.
    pixels_per_ray: float = 1.0


def look_beyond(
    limits: TraceLimits, weight: Real, pixels_per_ray: float, coloured: bool
) -> Generator[RenderRequest, View, PowerBeyond]:
    """Measure the power of the next `_PROBED_ORDERS` orders, whose paths are not followed.

    `coloured` is the result of `trace_replicate` for the scene.
    """
    view = yield RenderRequest(orders_beyond(limits), encoded=not limits.world_encoding)
    return power_seen_beyond(limits, view, weight, pixels_per_ray, coloured)


def orders_beyond(limits: TraceLimits) -> PathClass:
    """Return the orders whose power is measured."""
    return PathClass(limits.max_reflections + 1, limits.max_reflections + _PROBED_ORDERS)


def power_seen_beyond(
    limits: TraceLimits, view: View, weight: Real, pixels_per_ray: float, coloured: bool
) -> PowerBeyond:
    """Return the power in a view of `orders_beyond`."""
    power = amplitude_of(view, limits.amplitude_channel if coloured else "B") * weight
    strongest = float(power.max(initial=0.0))
    return PowerBeyond(float(power.sum()), variance_of_sum(power), strongest, pixels_per_ray)
