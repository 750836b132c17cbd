# SPDX-License-Identifier: GPL-3.0-or-later
"""Powers of paths over surfaces whose lobe Cycles does not have: clutter, directive lobes.

Cycles renders a Lambert lobe in place of it, and each vertex there has a weight, see
:mod:`.surface_lobes`. Orders 1 and 2 are weighted at all vertices; of higher ones vertices are
unknown.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np

from ...array_types import Indices, Mask, Real
from ...findings import Finding, finding
from ...physics.constants import SPEED_OF_LIGHT_MPS, STANDARD_EARTH_RADIUS_M
from ...signal.paths import Columns, PathRows, chosen_rows, read_columns
from ...vectors import dots, norms, take_rows
from ..materials import clutter_of, scattered_lobe_of
from ..motion import Bodies
from ..nodes.clutter_lobe import CLUTTER_ROW, table_angles_rad
from ..nodes.group_search import group_input
from .better_direction import BetterDirection
from .hit_points import HitPoints, Normals
from .reverse_marks import ReverseMarks
from .seen_mirrors import SeenMirrors
from .surface_lobes import ClutterLobe, DirectiveLobe, clutter_lobe, is_mirrored

#: Rows that are weighted at a time: their arrays stay in the processor's cache.
_ROWS_AT_ONCE = 16384
#: Columns that are read, and those besides where there are several reflections.
_READ = "order", "last_scatterer_m", "direction", "last_body"
_READ_OF_SEVERAL = "first_scatterer_m", "first_body"
#: Rows of a frame from which the findings are told.
_LOOKED_AT = 4096
#: Error of sigma0 by the flat model above which it is told [dB].
_CURVED_DB = 0.5


class ClutterWeights:
    """Weights the rows of a frame whose vertices lie on surfaces with such a lobe.

    Parameters
    ----------
    hits
        Finds the normals where rays hit.
    bodies
        Those whose numbers the rows have.
    carrier_hz, polarisation
        Of the run.
    """

    def __init__(
        self, hits: HitPoints, bodies: Bodies, carrier_hz: float, polarisation: str
    ) -> None:
        self._hits, self._carrier_hz = hits, carrier_hz
        wavelength_m = SPEED_OF_LIGHT_MPS / carrier_hz
        self._seen_mirrors = SeenMirrors(hits, bodies, polarisation, wavelength_m)
        self._reverses = ReverseMarks(hits, bodies)
        #: Paths in the direction in which they are sampled well.
        self.better = BetterDirection(bodies, wavelength_m)
        self._surfaces: list[ClutterLobe | DirectiveLobe] = []
        known: dict[str, int] = {}
        self._several: set[str] = set()
        models, lobes = cache(clutter_of), cache(scattered_lobe_of)  # a material is asked once
        rows_of = cache(lambda material: group_input(material, CLUTTER_ROW))
        of_shape = np.zeros(len(bodies.snapshot.shapes), dtype=np.intp)
        for number, shape in enumerate(bodies.snapshot.shapes):
            for material in {one for one in shape.materials if one is not None}:
                clutter, lobe = models(material), lobes(material)
                if rows_of(material) is None:
                    clutter = None
                if clutter is None and lobe is None:
                    continue
                if len(set(shape.materials)) > 1:
                    self._several.add(shape.original.name_full)
                    continue
                if material.name_full not in known:
                    known[material.name_full] = len(self._surfaces) + 1
                    if clutter is not None:
                        table_db = clutter.sigma0_db(carrier_hz, table_angles_rad(), polarisation)
                        self._surfaces.append(clutter_lobe(material, clutter.model, table_db))
                    elif lobe is not None:
                        self._surfaces.append(DirectiveLobe.of(lobe, polarisation, wavelength_m))
                of_shape[number] = known[material.name_full]
        #: Number of the surface of each body, from 1; 0: none. Body 0 is unknown.
        self._of_body = np.concatenate([[0], of_shape[bodies.shape]]).astype(np.intp)

    def __bool__(self) -> bool:
        return bool(self._surfaces or self._several)

    def apply(self, rows: PathRows, normals: Normals, origin_m: Real, transmitter_m: Real) -> None:
        """Multiply powers of labelled, refined rows with the normals that refining met, and mark
        those that have a reverse.

        Rays start at `origin_m`, (3,) or (n, 3).
        """
        origins_m = np.broadcast_to(origin_m, (rows.size, 3))
        if not self._surfaces:
            self._mark_reverses_and_correct_mirrors(rows, normals, origins_m)
            return
        known = normals.all()
        for start in range(0, rows.size, _ROWS_AT_ONCE):  # which stay in the cache
            some = slice(start, start + _ROWS_AT_ONCE)
            part, ends = rows[some], [one[some] for one in known]
            read = read_columns(part, _READ)
            if np.any(read["order"] > 1):  # else both ends are one
                read |= read_columns(part, _READ_OF_SEVERAL)
                found = Normals(part.size)
                found.add(np.arange(part.size), *ends)
                self._mark_reverses_and_correct_mirrors(part, found, origins_m[some])
            start_m = origin_m if origin_m.ndim == 1 else origin_m[some]
            self._apply_part(part, read, ends, start_m, transmitter_m)

    def _mark_reverses_and_correct_mirrors(
        self, rows: PathRows, normals: Normals, origins_m: Real
    ) -> None:
        self._reverses.mark(rows, normals, origins_m)
        self._seen_mirrors.correct(rows, normals, origins_m)

    def _apply_part(
        self,
        rows: PathRows,
        read: Columns,
        normals: Sequence[Real],
        origin_m: Real,
        transmitter_m: Real,
    ) -> None:
        """Multiply powers of some rows, which have these columns, and normals at both ends."""
        clutter_alone = all(isinstance(one, ClutterLobe) for one in self._surfaces)
        orders, met = read["order"], self._of_body.take(read["last_body"]) > 0
        if np.any(several := orders > 1):
            met[several] |= self._of_body.take(read["first_body"][several]) > 0
        for order in (1, 2) if several.any() else (1,):
            part = np.flatnonzero((orders == order) & met)
            start_m = origin_m if origin_m.ndim == 1 else origin_m[part]
            # backscatter is exact
            exact = clutter_alone and order == 1 and bool(np.all(start_m == transmitter_m))
            if exact or not part.size:
                continue
            mine, (first_n, last_n) = chosen_rows(read, part), normals
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
        """Weights of vertices on bodies, (n,); 1 without such a lobe.

        Rays from `known_from_m` meet them with the normals known, of any length or NaN. `back` are
        unit vectors towards the vertices before, and those after are at `after_m`. `seen_first`:
        the receiver sees the vertex itself, and the albedo is not limited.
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

    # -- what to know of the result ----------------------------------------------------------------

    def findings(self, chunks: Iterable[PathRows], receiver_m: Real) -> list[Finding]:
        """Find what a user should know of the clutter in the rows of a frame."""
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
            found += self._seen_findings(np.concatenate(seen)[::step], receiver_m)
        return found

    def _seen_findings(self, rows: PathRows, receiver_m: Real) -> list[Finding]:
        """Of rows of order 1: angles at which a model does not hold, and the Earth's curvature."""
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
    """Find from which range on a level surface would curve away below the ray."""
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
    """Make vectors of length 1, in their place."""
    vectors /= norms(vectors)[:, None]
    return vectors
