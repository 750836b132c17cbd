# SPDX-License-Identifier: GPL-3.0-or-later
"""Powers of paths over surfaces whose lobe Cycles does not have: clutter, directive lobes.

Cycles renders a Lambert lobe in place of it, and each vertex there has a weight, see
:mod:`.surface_lobes`. Orders 1 and 2 are weighted at all vertices; of higher ones vertices are
unknown.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...array_types import Indices, Mask, Real
from ...findings import Finding, finding
from ...physics.constants import SPEED_OF_LIGHT_MPS, STANDARD_EARTH_RADIUS_M
from ...signal.paths import PathRows
from ...vectors import dots, norms
from ..materials import clutter_of, scattered_lobe_of
from ..motion import Bodies
from ..nodes.clutter_lobe import CLUTTER_ROW, table_angles_rad
from ..nodes.group_search import group_input
from .hit_points import HitPoints
from .rough_mirrors import RoughMirrors
from .surface_lobes import ClutterLobe, DirectiveLobe, clutter_lobe, is_mirrored

#: Rows that are weighted at a time: their arrays stay in the processor's cache.
_ROWS_AT_ONCE = 16384
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
        self._rough = RoughMirrors(hits, bodies, wavelength_m)
        self._surfaces: list[ClutterLobe | DirectiveLobe] = []
        known: dict[str, int] = {}
        self._several: set[str] = set()
        of_shape = np.zeros(len(bodies.snapshot.shapes), dtype=np.intp)
        for number, shape in enumerate(bodies.snapshot.shapes):
            for material in {one for one in shape.materials if one is not None}:
                clutter, lobe = clutter_of(material), scattered_lobe_of(material)
                if group_input(material, CLUTTER_ROW) is None:
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

    def apply(self, rows: PathRows, origin_m: Real, transmitter_m: Real) -> None:
        """Multiply powers of labelled, refined rows; rays start at `origin_m`, (3,) or (n, 3)."""
        origins_m = np.broadcast_to(origin_m, (rows.size, 3))
        self._rough.keep_coherent(rows, origins_m)
        if not self._surfaces:
            return
        clutter_alone = all(isinstance(one, ClutterLobe) for one in self._surfaces)
        for order in (1, 2):
            first, last = (self._of_body[rows[name]] > 0 for name in ("first_body", "last_body"))
            concerned = np.flatnonzero((rows["order"] == order) & (first | last))
            if clutter_alone and order == 1 and np.all(origins_m[concerned] == transmitter_m):
                continue  # backscatter is exact
            for start in range(0, concerned.size, _ROWS_AT_ONCE):
                part = concerned[start : start + _ROWS_AT_ONCE]
                self._apply_part(rows, part, origins_m[part], transmitter_m, order)

    def _apply_part(
        self, rows: PathRows, part: Indices, start_m: Real, transmitter_m: Real, order: int
    ) -> None:
        """Multiply powers of some rows of one order, whose rays start at `start_m`, (n, 3)."""
        mine = rows[part]
        first_m, last_m = mine["first_scatterer_m"], mine["last_scatterer_m"]
        before_m = start_m if order == 1 else first_m
        weight = self._weights(mine["last_body"], last_m, before_m, transmitter_m, order == 1)
        if order == 2:
            weight *= self._weights(mine["first_body"], first_m, start_m, last_m, True)
        rows["power_w"][part] *= weight

    def _weights(
        self, bodies: Indices, vertex_m: Real, before_m: Real, after_m: Real, seen_first: bool
    ) -> Real:
        """Weights of vertices on bodies between two points, (n,); 1 without such a lobe.

        `seen_first`: the receiver sees the vertex itself, and the albedo is not limited.
        """
        weight, surface = np.ones(bodies.size), self._of_body[bodies]
        chosen = np.flatnonzero(surface)
        if not chosen.size:
            return weight
        vertex_m, before_m = vertex_m[chosen], before_m[chosen]
        after_m = np.broadcast_to(after_m, (bodies.size, 3))[chosen]
        back, onward = _unit(before_m - vertex_m), _unit(after_m - vertex_m)
        # the first vertex is known along its ray, the last one along that of the transmitter
        known_from_m = before_m if seen_first else after_m
        normal = self._hits.normals(bodies[chosen], known_from_m, vertex_m)
        normal = np.where(dots(normal, back)[:, None] < 0, -normal, normal)
        for number, one in enumerate(self._surfaces, start=1):
            here = np.flatnonzero(surface[chosen] == number)
            n, s, i = normal[here], back[here], onward[here]
            sines = dots(n, s), dots(n, i)
            fits = (sines[0] > 0) & (sines[1] > 0)  # not through the surface, and with a normal
            if one.alpha == 0:
                fits &= ~is_mirrored(n, s, i)
            weight[chosen[here[fits]]] = one.weights(n[fits], s[fits], i[fits], seen_first)
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
    return np.asarray(vectors / norms(vectors)[:, None])
