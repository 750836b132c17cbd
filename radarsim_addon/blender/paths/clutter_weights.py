# SPDX-License-Identifier: GPL-3.0-or-later
"""Powers of paths over surfaces whose lobe Cycles does not have, or has with another power.

In: labelled rows with normals at their vertices. Out: the same rows with their powers multiplied by
the weights of their vertices (`ClutterWeights.apply`). Cycles renders a lobe in place of the true
one, and a vertex has the weight: true lobe over rendered lobe.

Clutter model: the lobe of `nodes.physical_material.add_clutter_lobe` is exact in backscatter. Into
another direction it is a Lambert lobe of the albedo rho that is seen. With the grazing angles psi_s
towards the previous vertex (on the receiver's side) and psi_i towards the next one, the weight is

    w = (f + sigma_b / (4 pi sin psi_i sin psi_s)) / (f + rho(psi_s) / pi)

with f the scattering of the rough interface, and sigma_b = sqrt(sigma0(psi_i) sigma0(psi_s)), which
is reciprocal.

Directive lobe: the scattered fraction of the power at psi_i, in the lobe of
`physics.rough.directive_lobe`, replaces the Lambert lobe of a simple material, or that of the table
of a slightly rough mirror.

Paths of one and two reflections are weighted at all vertices; of longer ones vertices are unknown,
and a finding gives their power.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Mask, Real, are_finite, dots, norms, take_rows
from ...errors import ConfigError
from ...findings import Finding, finding
from ...physics.clutter import ClutterModel
from ...physics.constants import SPEED_OF_LIGHT_MPS, STANDARD_EARTH_RADIUS_M
from ...physics.fresnel import unpolarised_reflectance
from ...physics.mirrors import MirrorMaterial, coherent_reflection
from ...physics.rough import directive_lobe, facet_scattering
from ...signal.decoding import in_view
from ...signal.paths import PathFlag, PathRows, has_images
from ...signal.scene import SMOOTH_BELOW, Mesh, ScatteredLobe, SceneModel, Surface
from ..materials import EXACT_FACETS
from ..nodes.physical_material import TABLE_WIDTH, table_angles_rad
from ..nodes.radar_material import EXTINCTION, INDEX, ROUGHNESS
from .hit_points import HitPoints, Normals
from .view_tracer import ViewTracer

#: Rows that are weighted at a time: their arrays stay in the processor's cache.
_ROWS_AT_ONCE = 16384
_ENDS = "direction", "first_scatterer_m", "last_scatterer_m", "first_body", "last_body"
#: Rows of a frame that the findings are based on.
_LOOKED_AT = 4096
#: Error of sigma0 by the flat model above which there is a finding [dB].
_CURVED_DB = 0.5


class ClutterWeights:
    """Weights the rows of a frame. `hits` finds normals; rows have the numbers of `bodies`."""

    def __init__(
        self, hits: HitPoints, model: SceneModel, carrier_hz: float, polarisation: str
    ) -> None:
        self._hits, self._carrier_hz = hits, carrier_hz
        wavelength_m = SPEED_OF_LIGHT_MPS / carrier_hz
        self._seen_mirrors = SeenMirrors(hits, model, polarisation, wavelength_m)
        self._reverses = ReverseMarks(hits, model)
        #: Paths in the direction in which they are sampled well.
        self.better = BetterDirection(model, wavelength_m)
        self._surfaces: list[ClutterLobe | DirectiveLobe] = []
        known: dict[Surface, int] = {}
        self._several: set[str] = set()
        of_shape = np.zeros(len(model.surfaces), dtype=np.intp)
        for number, every in enumerate(model.surfaces):
            for surface in set(every):
                clutter = surface.clutter if surface.has_clutter_row else None
                lobe = surface.scattered_lobe()
                if clutter is None and lobe is None:
                    continue
                if len(set(every)) > 1:
                    owners = np.unique(model.number[model.shape == number])
                    self._several.update(map(model.name, owners[owners > 0].tolist()))
                    continue
                if surface not in known:
                    known[surface] = len(self._surfaces) + 1
                    if clutter is not None:
                        table_db = clutter.sigma0_db(carrier_hz, table_angles_rad(), polarisation)
                        self._surfaces.append(clutter_lobe(surface, clutter.model, table_db))
                    elif lobe is not None:
                        self._surfaces.append(DirectiveLobe.of(lobe, polarisation, wavelength_m))
                of_shape[number] = known[surface]
        #: Number of the surface of each body, from 1; 0: none. Body 0 is unknown.
        self._of_body = np.concatenate([[0], of_shape[model.shape]]).astype(np.intp)

    def __bool__(self) -> bool:
        return bool(self._surfaces or self._several)

    def apply(self, rows: PathRows, normals: Normals, origin_m: Real, transmitter_m: Real) -> None:
        """Multiply the powers of rows by the weights of their clutter lobes, and mark rows that
        have a reverse.

        The rows are labelled and refined. `normals` are the normals that the refinement found. Rays
        start at `origin_m`, (3,) or (n, 3) [m].
        """
        origins_m = np.broadcast_to(origin_m, (rows.size, 3))
        if not self._surfaces:
            self._mark_reverses_and_correct_mirrors(rows, normals, origins_m)
            return
        known = normals.all()
        for start in range(0, rows.size, _ROWS_AT_ONCE):
            some = slice(start, start + _ROWS_AT_ONCE)
            part, ends = rows[some], [one[some] for one in known]
            if np.any(part["order"] > 1):  # else both ends are one
                found = Normals(part.size)
                found.add(np.arange(part.size), *ends)
                self._mark_reverses_and_correct_mirrors(part, found, origins_m[some])
            start_m = origin_m if origin_m.ndim == 1 else origin_m[some]
            self._apply_part(part, ends, start_m, transmitter_m)

    def _mark_reverses_and_correct_mirrors(
        self, rows: PathRows, normals: Normals, origins_m: Real
    ) -> None:
        self._reverses.mark(rows, normals, origins_m)
        self._seen_mirrors.correct(rows, normals, origins_m)

    def _apply_part(
        self,
        rows: PathRows,
        normals: Sequence[Real],
        origin_m: Real,
        transmitter_m: Real,
    ) -> None:
        """Multiply the powers of some rows; `normals` are those at the first and last vertex."""
        clutter_alone = all(isinstance(one, ClutterLobe) for one in self._surfaces)
        orders, met = rows["order"], self._of_body.take(rows["last_body"]) > 0
        if np.any(several := orders > 1):
            met[several] |= self._of_body.take(rows["first_body"][several]) > 0
        for order in (1, 2) if several.any() else (1,):
            part = np.flatnonzero((orders == order) & met)
            start_m = origin_m if origin_m.ndim == 1 else origin_m[part]
            # backscatter is exact
            exact = clutter_alone and order == 1 and bool(np.all(start_m == transmitter_m))
            if exact or not part.size:
                continue
            mine, (first_n, last_n) = rows.chosen(part, *_ENDS), normals
            if part.size < rows.size:
                first_n, last_n = (take_rows(each, part) for each in normals)
            last_m, back = mine["last_scatterer_m"], -mine["direction"]
            end = mine["last_body"], last_m
            if order == 1:
                weight = self._weights(*end, start_m, last_n, back, transmitter_m, True)
            else:
                # the last vertex is known along the ray of the transmitter
                first_m = mine["first_scatterer_m"]
                before = _unit(first_m - last_m)
                weight = self._weights(*end, transmitter_m, last_n, before, transmitter_m, False)
                first = mine["first_body"], first_m
                weight *= self._weights(*first, start_m, first_n, back, last_m, True)
            if part.size < rows.size:
                rows["power_w"][part] *= weight
            else:
                rows["power_w"] *= weight

    def _weights(
        self,
        bodies: Indices,
        vertex_m: Real,
        known_from_m: Real,
        normal: Real,
        back: Real,
        after_m: Real,
        seen_first: bool,
    ) -> Real:
        """Return the weight of each vertex, (n,). It is 1 on bodies that have no clutter lobe.

        Rays from `known_from_m` meet the vertices. `normal` has the normals that are known, of any
        length; NaN: unknown. `back` are unit vectors to the vertex before each one, and `after_m`
        is the place of the vertex after it. `seen_first` is True if the receiver sees the vertex
        directly: then the rendered albedo has no upper limit.
        """
        weight, surface = np.ones(bodies.size), self._of_body.take(bodies)
        bodies = np.where(surface > 0, bodies, 0)
        if not bodies.any():
            return weight
        normal = self._hits.normals(bodies, known_from_m, vertex_m, normal)
        onward, sine_s = _unit(after_m - vertex_m), dots(normal, back)
        if np.any(sine_s < 0):  # seen from the back
            side = np.copysign(1.0, sine_s)
            normal, sine_s = normal * side[:, None], sine_s * side
        sines = sine_s, dots(normal, onward)
        # not through the surface, and with a normal
        through = ~(sine_s > 0) | ~(sines[1] > 0)
        for number, one in enumerate(self._surfaces, start=1):
            fits = (surface == number) & ~through
            if one.alpha == 0:
                fits &= ~is_mirrored(sines, back, onward)
            if fits.all():
                return one.weights(sines, normal, back, onward, seen_first)
            here = np.flatnonzero(fits)
            n, s, i = (take_rows(vectors, here) for vectors in (normal, back, onward))
            weight[here] = one.weights((sine_s[here], sines[1][here]), n, s, i, seen_first)
        return weight

    def findings(self, chunks: Iterable[PathRows], receiver_m: Real) -> list[Finding]:
        """Return the findings about clutter in the rows of a frame."""
        found = [finding("clutter-of-several-materials", *sorted(self._several))]
        found = found if self._several else []
        if not self._surfaces:
            return found
        seen: list[PathRows] = []
        total = later = 0.0
        for rows in chunks:
            total += float(rows["power_w"].sum())
            first, last = (self._of_body[rows[name]] for name in ("first_body", "last_body"))
            met = (first > 0) | (last > 0)
            later += float(rows["power_w"][met & (rows["order"] > 2)].sum())
            seen.append(rows[met & (rows["order"] == 1)])
        if later > 0.01 * total:
            found.append(finding("clutter-of-higher-orders", fraction=later / total))
        count = sum(part.size for part in seen)
        if count:
            step = -(-count // _LOOKED_AT)
            found += self._seen_findings(PathRows.joined(seen)[::step], receiver_m)
        return found

    def _seen_findings(self, rows: PathRows, receiver_m: Real) -> list[Finding]:
        """Return findings for rows of one reflection: grazing angles at which a model does not
        hold, and the curvature of the Earth.
        """
        found = []
        surface = self._of_body[rows["last_body"]]
        point_m = rows["last_scatterer_m"]
        normal = self._hits.normals(rows["last_body"], point_m - rows["direction"], point_m)
        grazing = np.arcsin(np.minimum(np.abs(dots(normal, rows["direction"])), 1.0))
        range_m = norms(point_m - receiver_m)
        for number, one in enumerate(self._surfaces, start=1):
            mine = (surface == number) & np.isfinite(grazing)
            if not isinstance(one, ClutterLobe) or not mine.any():
                continue
            psi, reach_m = grazing[mine], range_m[mine]
            outside = ~one.model.is_valid(one.model.band_hz[0], psi)
            if outside.any():
                found.append(_beyond_angles(one, psi, outside))
            found += _curvature(one, psi, reach_m)
        return found


def _beyond_angles(one: ClutterLobe, grazing_rad: Real, outside: Mask) -> Finding:
    low_deg, high_deg = np.degrees(one.model.grazing_rad)
    return finding(
        "clutter-beyond-angles",
        one.material,
        fraction=float(np.mean(outside)),
        model=one.model.name,
        least_deg=float(np.degrees(grazing_rad.min())),
        most_deg=float(np.degrees(grazing_rad.max())),
        low_deg=float(low_deg),
        high_deg=float(high_deg),
    )


def _curvature(one: ClutterLobe, grazing_rad: Real, range_m: Real) -> list[Finding]:
    """Find the range from which on the curvature of the Earth changes sigma0 of a level surface too
    much.
    """
    curved = np.maximum(grazing_rad - range_m / (2 * STANDARD_EARTH_RADIUS_M), 1e-7)
    error_db = 10 * np.log10(one.sigma0(np.sin(grazing_rad)) / one.sigma0(np.sin(curved)))
    beyond = np.abs(error_db) > _CURVED_DB
    if not beyond.any():
        return []
    return [
        finding(
            "clutter-on-flat-earth",
            one.material,
            range_m=float(range_m[beyond].min()),
            error_db=float(np.abs(error_db).max()),
            furthest_m=float(range_m.max()),
        )
    ]


def _unit(vectors: Real) -> Real:
    """Divide vectors by their lengths, in place, and return them."""
    vectors /= norms(vectors)[:, None]
    return vectors


# -------------------------------------------------------------------------------------------------
# Lobes that Cycles does not have, and the weights of those that it renders instead.
# -------------------------------------------------------------------------------------------------


#: Cosine between the direction of a mirrored ray and a segment above which a smooth surface has
#: reflected it like a mirror: 1 minus the square of what Cycles rounds, over 2.
_MIRRORED = 1 - 1e-9
#: An index at which all is reflected.
_CONDUCTOR = complex(1e12)

#: Sines of grazing angles towards the vertex before and the one after, (n,) each.
Sines = tuple[Real, Real]


def is_mirrored(sines: Sines, back: Real, onward: Real) -> Mask:
    """Return whether a smooth surface mirrors each direction `back` into the direction `onward`,
    (n,).

    Both are unit vectors from the vertex. `sines` are their scalar products with the normal.
    """
    found = 2 * sines[0]
    found *= sines[1]
    found -= dots(back, onward)
    return np.asarray(found >= _MIRRORED)


@dataclass(frozen=True)
class _Table:
    """sigma0 by grazing angle, as the lobe of a table gives it: linear between its columns."""

    table_db: Real

    @cached_property
    def _steps(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Interpolation table: ln sigma0 half a column before each column and after the last one,
        and the differences.
        """
        levels = np.pad(self.table_db * (np.log(10) / 10), 1, mode="edge").astype(np.float32)
        return levels[:-1], np.diff(levels)

    def log_sigma0(self, sine: Real) -> NDArray[np.float32]:
        """Return ln sigma0 for sines of grazing angles, (n,).

        float32 differs by at most 1e-4 dB from the same interpolation in float64.
        """
        angle = np.minimum(sine, 1.0)
        np.arcsin(angle, out=angle)
        angle *= 2 / np.pi * TABLE_WIDTH**3
        column = angle.astype(np.float32)
        np.cbrt(column, out=column)
        column += np.float32(0.5)
        left = column.astype(np.intp)
        levels, steps = self._steps
        column -= np.trunc(column)
        column *= steps.take(left)
        column += levels.take(left)
        return column

    def sigma0(self, sine: Real) -> Real:
        return np.exp(self.log_sigma0(sine), dtype=np.float64)

    def albedo(self, sigma0: Real, sine: Real, seen_first: bool) -> Real:
        """Return the albedo of the rendered lobe. Cycles limits it to 1, except at the first
        vertex.
        """
        found = sigma0 / (4 * sine**2)
        return found if seen_first else np.minimum(found, 1.0)


@dataclass(frozen=True)
class ClutterLobe(_Table):
    """Lobe of a material with a clutter model; `alpha` and `index` are those of its rough
    interface.
    """

    material: str
    model: ClutterModel
    index: complex
    alpha: float

    def weights(
        self, sines: Sines, normal: Real, back: Real, onward: Real, seen_first: bool
    ) -> Real:
        """Return the true lobe over the rendered lobe at each vertex, (n,).

        `back` and `onward` are unit vectors to the vertices before and after. `sines` are their
        scalar products with the normal. `seen_first` is True if the receiver sees the vertex
        directly: then the rendered albedo has no upper limit.
        """
        sine_s, sine_i = sines
        level_s, level_i = self.log_sigma0(sine_s), self.log_sigma0(sine_i)
        # the true lobe over a Lambert lobe of the albedo that is seen
        ratio = np.exp((level_i - level_s) / 2) * sine_s / sine_i
        if self.alpha == 0 and seen_first:
            return ratio
        seen = np.exp(level_s, dtype=np.float64)
        lambert, rendered = (self.albedo(seen, sine_s, both) / np.pi for both in (True, seen_first))
        facets: Real | float = 0.0
        if self.alpha > 0:
            facets = facet_scattering(self.index, self.alpha, normal, back, onward, EXACT_FACETS)
        return np.asarray((facets + lambert * ratio) / (facets + rendered))


@dataclass(frozen=True)
class DirectiveLobe(_Table):
    """Directive lobe of a material; the table is empty for a simple material."""

    lobe: ScatteredLobe
    polarisation: str
    wavelength_m: float

    @classmethod
    def of(cls, lobe: ScatteredLobe, polarisation: str, wavelength_m: float) -> DirectiveLobe:
        table_db = np.zeros(0)
        if lobe.from_table:
            table_db = _as_rendered(lobe.rendered_db(table_angles_rad(), wavelength_m))
        return cls(table_db, lobe, polarisation, wavelength_m)

    @property
    def alpha(self) -> float:
        """Width of the glossy lobe; 0 for a mirror."""
        return self.lobe.alpha

    def weights(
        self, sines: Sines, normal: Real, back: Real, onward: Real, seen_first: bool
    ) -> Real:
        """Return the true lobe over the rendered lobe at each vertex, as `ClutterLobe.weights`
        does.

        The lobe is not reciprocal: the wave comes from the direction `onward`.
        """
        lobe, sine_s = self.lobe, sines[0]
        facets = np.zeros(sine_s.size)
        if self.table_db.size:
            albedo = self.albedo(self.sigma0(sine_s), sine_s, seen_first)
        else:
            seen = unpolarised_reflectance(lobe.mirror.index, np.minimum(sine_s, 1.0))
            albedo = (1 - lobe.mirror.share) * seen
            if lobe.alpha > 0:
                facets = facet_scattering(_CONDUCTOR, lobe.alpha, normal, back, onward)
                facets = lobe.mirror.share * seen * facets
        scattered = lobe.scattered(onward, normal, self.polarisation, self.wavelength_m)
        directive = directive_lobe(lobe.exponent, normal, onward, back)
        return (facets + scattered * directive) / (facets + albedo / np.pi)


def clutter_lobe(surface: Surface, model: ClutterModel, table_db: Real) -> ClutterLobe:
    """Return the lobe of a material with a clutter model. `table_db` is its table of sigma0 in the
    run.
    """
    needed = {ROUGHNESS: surface.roughness, INDEX: surface.n, EXTINCTION: surface.kappa}
    for name, value in needed.items():
        if value is None:
            raise ConfigError(
                f"Material {surface.name!r} has a clutter model and a link at {name}, so the "
                "scattering into other directions is unknown. Remove the link."
            )
    roughness = surface.roughness or 0.0
    alpha = roughness**2 if roughness > SMOOTH_BELOW else 0.0
    return ClutterLobe(_as_rendered(table_db), surface.name, model, surface.index, alpha)


def _as_rendered(table_db: Real) -> Real:
    """Return a table as the image in Blender stores it, rounded to float32."""
    return table_db.astype(np.float32).astype(np.float64)


class ReverseMarks:
    """Marks rows whose reverse is a path of its own.

    Rays end at scatterers that are no mirrors, because the transmitter is a point. So a path has a
    reverse if it has not been mirrored at its first scatterer. (`signal.tracing` handles a mirror
    there with images of the transmitter.)
    """

    def __init__(self, hits: HitPoints, model: SceneModel) -> None:
        self._hits, self._model = hits, model

    @cached_property
    def _by_body(self) -> tuple[Mask, Mask]:
        """For each body, by its number: whether it may mirror, and whether its shading normals
        differ from those of its faces. Number 0 is the unknown body.
        """
        model = self._model
        mirrors = np.array([any(s.is_mirror_like for s in every) for every in model.surfaces], bool)
        rounded = np.zeros(len(mirrors), dtype=bool)
        for number in np.flatnonzero(mirrors).tolist():
            rounded[number] = is_smooth_shaded(model.meshes[number])
        unknown = mirrors.any()
        return np.append(unknown, mirrors[model.shape]), np.append(unknown, rounded[model.shape])

    def mark(self, rows: PathRows, found: Normals, origins_m: Real) -> None:
        """Set the flag HAS_REVERSE in labelled, refined rows. Rays start at `origins_m`, (n, 3)
        [m].
        """
        several = np.flatnonzero(rows["order"] > 1)
        if not several.size:
            return
        mine = rows[several]
        may_mirror, rounded = self._by_body
        ranged = mine["flags"] & PathFlag.NO_RANGE == 0
        mirrors = may_mirror[mine["first_body"]]
        marked = ranged & ~mirrors
        known = ranged & mirrors & (mine["order"] == 2) & ~rounded[mine["first_body"]]
        chosen = np.flatnonzero(known & are_finite(mine["first_scatterer_m"]))
        if chosen.size:
            mine, number = mine[chosen], several[chosen]
            first_m, along = mine["first_scatterer_m"], mine["direction"]
            onward = mine["last_scatterer_m"] - first_m
            normals = self._hits.normals(
                mine["first_body"], origins_m[number], first_m, found.all()[0][number]
            )
            with np.errstate(invalid="ignore"):
                onward /= norms(onward)[:, None]
                sines = -dots(normals, along), dots(normals, onward)
                away = is_mirrored(sines, -along, onward)
            marked[chosen] = ~away & are_finite(normals) & are_finite(onward)
        rows["flags"][several[marked]] |= np.uint16(PathFlag.HAS_REVERSE)


def is_smooth_shaded(mesh: Mesh | None) -> bool:
    """Return whether a mesh has shading normals that differ from the normals of its faces. `mesh`
    may be None.
    """
    return mesh is not None and mesh.corner_normals is not None


#: Ratio of the widths of two lobes from which on they differ.
_WIDER = 2.0
#: Distance of the antennas up to which they are in one place [wavelengths].
_TOGETHER = 1e-3


class BetterDirection:
    """Replaces rows that end at a narrow lobe by the reverse paths, which are sampled well.

    Cycles chooses the ray from a path's first scatterer by the lobe there, and evaluates the last
    lobe towards the transmitter. So few rays find a path that ends at the narrow lobe, and each has
    a large power. With the antennas in one place, the reverse path begins at that lobe and has the
    same power. Both directions are taken from the rows of this reverse path: the rows, and copies
    with both scatterers exchanged. Where a scatterer is outside the field of view, the table has no
    reverse path, and the row stays as it is.
    """

    def __init__(self, model: SceneModel, wavelength_m: float) -> None:
        self._together_m, known = _TOGETHER * wavelength_m, model.surfaces
        #: Whether rays pass through no surface, where both directions could be different rows.
        self._opaque = all(
            one.is_opaque if one.is_radar else one.reciprocal_lobe > 0
            for one in {one for every in known for one in every}
        )
        widths = np.array([min((o.reciprocal_lobe for o in every), default=0.0) for every in known])
        several = np.array([len(set(every)) > 1 for every in known], dtype=bool)
        widths[several] = 0.0
        for number in np.flatnonzero((widths > 0) & np.isfinite(widths)).tolist():
            if is_smooth_shaded(model.meshes[number]):
                widths[number] = 0.0  # normals of light and of faces differ
        #: Widths of lobes by the body's number, from 1; 0: unknown.
        self._widths = np.append(0.0, widths[model.shape])

    def in_better_direction(self, rows: PathRows, tracer: ViewTracer) -> PathRows:
        """Return the rows of a tile replicate, with both directions of each pair of paths taken
        from the direction that has less noise.

        If there is no pair, or if objects are not opaque, these are the rows themselves.
        """
        receiver = tracer.receiver
        place_m = np.asarray(receiver.matrix_world, dtype=np.float64)[:3, 3]
        apart_m = float(np.linalg.norm(tracer.transmitter_m - place_m))
        parallel = receiver.kind == "orthographic"
        if parallel or apart_m > self._together_m or not self._opaque:
            return rows
        first, last = (self._widths.take(rows[name]) for name in ("first_body", "last_body"))
        both = self._usable(rows) & (first > 0) & (last > 0)
        poor = np.flatnonzero(both & (first >= _WIDER * last))
        good = np.flatnonzero(both & (last >= _WIDER * first))
        poor, good = (
            some[in_view(rows["last_scatterer_m"][some], receiver)] for some in (poor, good)
        )
        if not poor.size + good.size:
            return rows
        back = rows[good]
        for name in ("scatterer_m", "body", "object", "surface_point"):
            back[f"first_{name}"], back[f"last_{name}"] = (
                rows[f"{end}_{name}"][good] for end in ("last", "first")
            )
        along = back["first_scatterer_m"] - place_m
        back["direction"] = along / norms(along)[:, None]
        return PathRows.joined([rows[np.delete(np.arange(rows.size), poor)], back])

    def _usable(self, rows: PathRows) -> Mask:
        """Return which rows have two reflections, known vertices and a reverse that is a path of
        its own.
        """
        found = (rows["order"] == 2) & (rows["transparent_depth"] == 0)
        found &= rows["flags"] & (PathFlag.HAS_REVERSE | PathFlag.NO_RANGE) == PathFlag.HAS_REVERSE
        for name in ("first_scatterer_m", "last_scatterer_m"):
            found &= are_finite(rows[name])
        if has_images(rows):
            for name in ("transmitter_image", "receiver_image", "mirrors"):
                found &= rows[name] == 0
        return np.asarray(found)


class SeenMirrors:
    """Corrects the power that the receiver sees in mirrors.

    Cycles follows a ray over a mirror with the power of both polarisations behind it, as at a
    smooth surface. The receiver takes the polarisation of the run, and the coherent part of the
    wave from a slightly rough mirror.
    """

    def __init__(
        self, hits: HitPoints, model: SceneModel, polarisation: str, wavelength_m: float
    ) -> None:
        self._hits, self._wavelength_m = hits, wavelength_m
        self._polarisation = polarisation
        known = model.surfaces
        found = [_mirror(every) for every in known]
        self._mirrors = list(dict.fromkeys(one for one in found if one is not None))
        numbers = np.array([-1 if one is None else self._mirrors.index(one) for one in found], int)
        heights_m = np.array(
            [0.0 if one is None or one.share < 1 else one.rms_height_m for one in found]
        )
        #: By the body's number, from 1: number of the mirror, -1 for others; RMS height, 0 for
        #: other surfaces [m]; and whether a lobe has the rest of the power.
        self._numbers = np.append(-1, numbers[model.shape])
        self._heights_m = np.append(0.0, heights_m[model.shape])
        scatters = np.array([any(one.scattered_lobe() for one in e) for e in known], dtype=bool)
        self._scatters = np.append(False, scatters[model.shape])

    def correct(self, rows: PathRows, found: Normals, origins_m: Real) -> None:
        """Multiply the powers of rows whose first vertex is on a mirror by what the run's
        polarisation receives.

        The rows are labelled and refined. Rays start at `origins_m`, (n, 3) [m]. In paths of more
        than two reflections, it is unknown whether the surface has mirrored or scattered the wave.
        Such rows contain both parts, as if the mirror image had lost nothing, so this method
        reduces their sum. These rows keep the power of both polarisations, because the next mirror
        may turn the polarisation back.
        """
        if not self._mirrors:
            return
        seen = (self._numbers[rows["first_body"]] >= 0) & (rows["order"] > 1)
        chosen = np.flatnonzero(seen & are_finite(rows["first_scatterer_m"]))
        if not chosen.size:
            return
        mine = rows[chosen]
        bodies, first_m, along = mine["first_body"], mine["first_scatterer_m"], mine["direction"]
        known = found.all()[0][chosen]
        normals = self._hits.normals(bodies, origins_m[chosen], first_m, known)
        sine = np.abs(dots(normals, along))
        factor = coherent_reflection(self._heights_m[bodies], sine, self._wavelength_m) ** 2
        lobe, two = self._scatters[bodies], mine["order"] == 2
        onward = mine["last_scatterer_m"] - first_m
        with np.errstate(invalid="ignore"):
            onward = onward / norms(onward)[:, None]
            sines = -dots(normals, along), dots(normals, onward)
            mirrored = is_mirrored(sines, -along, onward)
        factor[lobe & two & ~mirrored] = 1.0
        factor[lobe & ~two] = 1 / (2 - factor[lobe & ~two])
        for number, mirror in enumerate(self._mirrors):
            here = np.flatnonzero(two & mirrored & (self._numbers[bodies] == number))
            wave = along[here], normals[here], self._polarisation
            rendered = np.maximum(mirror.rendered_power(*wave), np.finfo(float).tiny)
            smooth = replace(mirror, rms_height_m=0.0)
            factor[here] *= smooth.reflection(*wave, self._wavelength_m).power / rendered
        rows["power_w"][chosen] *= np.where(np.isfinite(factor), factor, 1.0)


def _mirror(surfaces: Sequence[Surface]) -> MirrorMaterial | None:
    """Return the mirror that all materials of a body share; None if they differ, or have another
    lobe.
    """
    known = {None if one.clutter else one.mirror for one in surfaces}
    return known.pop() if len(known) == 1 else None
