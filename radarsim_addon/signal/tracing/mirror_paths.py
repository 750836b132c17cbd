# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths over mirrors on the way from the transmitter, back to the receiver, or both."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...arrays import Indices, Mask, Real, are_finite, crosses, distances, dots, norms
from ...contract import ImageRecord, ReceiverRecord
from ...findings import Finding, finding
from ...physics.mirrors import Reflected
from ..decoding import in_view
from ..motion import PathImages
from ..paths import (
    CURVED_IMAGE_DTYPE,
    IMAGE_DTYPE,
    PATH_DTYPE,
    PathFlag,
    PathRows,
    has_curved_images,
    planes_of,
)
from .connections import CurvedMirrors, ImageChain, Ways, find_curved_mirrors, image_chains
from .mirrors import Plane, find_planes, mirror_faces, mirroring_objects
from .obstacles import Obstacles

#: Distance of the antennas over that of a scatterer up to which both ways are one.
ONE_PLACE = 0.01
#: Error of the power over mirrors on both ways that is accepted, as a fraction: 0.2 dB.
_LOBE_ERROR = 0.05
#: Power over that of the direct path below which a computed path over a mirror is left out.
_LEAST_POWER = 1e-6
#: Largest error of a mirrored ray at its mirror, and of its length, over the length: float32.
_MIRRORED = 2e-5
#: Image number of a row that was measured with the light at the receiver.
_AT_RECEIVER = -1
#: Change of a level by turned waves above which there is a finding [dB].
_TURNED_DB = 0.5


def alike_in_both(points_m: Real, one_m: Real, other_m: Real, lobe: Real) -> Mask:
    """Return whether points scatter nearly alike towards two places, (3,) or (n, 3), (n,).

    `lobe` is the width alpha of the narrowest lobe of each point's surface: infinite for Lambert, 0
    if unknown. The error of a Gaussian lobe of facets is at most exp(angle^2 / (2 alpha^2)).
    """
    one, other = one_m - points_m, other_m - points_m
    cosine = dots(one, other) / (norms(one) * norms(other))
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    with np.errstate(divide="ignore"):
        return np.asarray(angle**2 / (2 * lobe**2) <= _LOBE_ERROR)


class MirrorPolarisation:
    """Power that mirrors turn into the other polarisation, and by which their two polarisations
    differ in phase, by the objects with the mirrors.
    """

    def __init__(self) -> None:
        self._sums: dict[tuple[str, ...], Real] = {}

    def add(self, objects: tuple[str, ...], power_w: Real, found: Reflected) -> None:
        """Add paths: their powers for perfect mirrors, and what the mirrors do to the waves."""
        sums = self._sums.setdefault(objects, np.zeros(4))
        sums += power_w.sum(), power_w @ found.turned, power_w @ found.power, power_w @ found.apart

    def findings(self, both_ways: bool) -> list[Finding]:
        """Find the mirrors that change the level of a target by their polarisations.

        Next to an equal direct path, an error of the phase of d changes the sum by 2 |sin(d/2)|. A
        target that keeps every polarisation sends a turned wave back to the mirror, which turns it
        again: relative to the direct path, the amplitude of this path is at most the turned
        fraction of the power.
        """
        apart: dict[tuple[str, ...], float] = {}
        turned: dict[tuple[str, ...], float] = {}
        for names, (every_w, turned_w, kept_w, apart_w) in self._sums.items():
            whole_w = max(every_w, math.ulp(0))
            if 20 * math.log10(1 + 2 * math.sqrt(apart_w / whole_w)) > _TURNED_DB:
                apart[names] = apart_w / kept_w
            if both_ways and 20 * math.log10(1 + turned_w / whole_w) > _TURNED_DB:
                turned[names] = turned_w / whole_w
        found = []
        if apart:
            apart_deg = math.degrees(2 * math.asin(math.sqrt(min(max(apart.values()), 1.0))))
            found.append(finding("mirror-phases-apart", *_each_once(apart), apart_deg=apart_deg))
        if turned:
            most = max(turned.values())
            level = {"higher_db": 20 * math.log10(1 + most)}
            level["lower_db"] = -20 * math.log10(max(1 - most, 1e-3))
            turning = _each_once(turned)
            found.append(finding("mirror-turns-polarisation", *turning, fraction=most, **level))
        return found


def _each_once(groups: Iterable[Iterable[str]]) -> dict[str, None]:
    return dict.fromkeys(name for names in groups for name in names)


@dataclass(eq=False)
class MirrorPaths:
    """The mirrors of one frame, and the paths over them.

    `normals` gives those of bodies near points on rays from (3,) or (n, 3), NaN: unknown. `reach_m`
    is the distance of the farthest surface from the receiver. Paths have at most
    `most_reflections`, each antenna at most `most_images`: first those in objects that are
    `wanted`, none in those that are `unwanted`, by number.
    """

    obstacles: Obstacles
    normals: Callable[[Indices, Real, Real], Real]
    receiver: ReceiverRecord
    transmitter_m: Real
    reach_m: float
    polarisation: str
    wavelength_m: float
    most_reflections: int
    most_images: int
    wanted: Collection[int] = ()
    unwanted: Collection[int] = ()

    def __post_init__(self) -> None:
        self._receiver_m = np.asarray(self.receiver.matrix_world, dtype=np.float64)[:3, 3]
        self._flat_view = self.receiver.kind == "orthographic"
        apart_m = float(np.linalg.norm(self._receiver_m - self.transmitter_m))
        #: Whether a path and its reverse are alike.
        self._one_place = apart_m <= ONE_PLACE * self.reach_m and not self._flat_view
        self._turned = MirrorPolarisation()
        #: Bodies that scatter otherwise towards a planar or a curved mirror.
        self._narrow: tuple[set[int], set[int]] = (set(), set())
        model = self.obstacles.model
        widths = [min((s.lobe_width for s in every), default=math.inf) for every in model.surfaces]
        weighted = [any(s.clutter for s in every) for every in model.surfaces]
        #: Widths of the narrowest lobes by the bodies' numbers, from 1, for planar mirrors and for
        #: curved ones; 0: no path over them.
        self._lobes = [
            np.append(0.0, model.of_shapes(each, float))
            for each in (widths, np.where(weighted, 0.0, widths).tolist())
        ]
        unwanted: Collection[int] = self.unwanted
        self._findings: list[Finding] = []
        if self.most_reflections == 1:
            names = mirroring_objects(self.obstacles, unwanted)
            self._findings += [finding("mirrors-need-reflections", *names)] if names else []
            unwanted = range(len(model.names) + 1)
        self._faces = mirror_faces(self.obstacles, unwanted)
        left = self._find_images({model.name(n) for n in self.wanted if n not in unwanted})
        curved, said = find_curved_mirrors(self._faces, self.transmitter_m, self.wavelength_m)
        self._findings += said + self._left_out(curved, left) + self._straight_back()
        #: Paths over curved mirrors to the transmitter; None without any.
        self._curved = None if self._flat_view or not self.most_images else curved
        places_m = [one.image_m for one in self.images]
        if self._curved is not None:
            self._back[-1] = self._curved.to(self._receiver_m)
            if not self._one_place:
                places_m.append(self._receiver_m)
        #: Places of lights that nothing blocks, (n, 3) [m]: those of the images. The last one is at
        #: a receiver that stands apart: curved mirrors may light the points that it sees in shade.
        self.lamps_m: Real = np.array(places_m).reshape(-1, 3)

    def _find_images(self, wanted: Collection[str]) -> list[ImageChain]:
        """Find the images of both antennas; return the pairs of mirrors beyond the limit.

        `wanted` are the names of objects that the user chose.
        """
        antennas_m = [self.transmitter_m]
        if not (self._one_place or self._flat_view):
            antennas_m.append(self._receiver_m)
        most, pairs = self.most_images, self.most_reflections > 2
        planes, said = find_planes(self._faces, antennas_m, self.wavelength_m, most, wanted)
        self._findings += said
        self.images, left = image_chains(planes[0], 0, self.transmitter_m, most, pairs)
        back = [ImageChain.of(one.planes, self._receiver_m) for one in self.images]
        if len(planes) > 1:
            back = image_chains(planes[1], 1, self._receiver_m, most, pairs)[0]
        #: Mirrors of the receiver by their numbers: its images, and curved ones (-1). New images
        #: follow those of the transmitter.
        self._back: dict[int, ImageChain | CurvedMirrors] = {}
        self._every_image = list(self.images)
        numbers = {one.planes: number for number, one in enumerate(self.images, 1)}
        for chain in back:
            if chain.planes not in numbers:
                self._every_image.append(chain)
            self._back[numbers.get(chain.planes, len(self._every_image))] = chain
        return left

    def _left_out(self, curved: CurvedMirrors | None, pairs: list[ImageChain]) -> list[Finding]:
        """Return findings on what the choice of mirrors leaves out, or makes less exact."""
        found, faces, most = [], self._faces, self.most_images
        owns = [plane.own for plane in self._planes]
        owns += [] if curved is None else [curved.own]
        own = np.concatenate([*owns, np.zeros(0, dtype=np.intp)])
        if self.most_reflections == 2 and own.size:
            found.append(finding("mirror-both-ways-left-out", *faces.objects(own)))
        rough = np.array([one.rms_height_m > 0 for one in faces.materials], dtype=bool)
        if known_less := faces.objects(own[rough[faces.material[own]]]):
            found.append(finding("mirror-slightly-rough", *known_less))
        if pairs:
            names = _each_once(chain.objects for chain in pairs)
            found.append(finding("mirror-pairs-left-out", *names, count=len(pairs), most=most))
        if self._flat_view and self.images:
            found.append(finding("mirror-ways-not-in-phase"))
        if curved is None:
            return found
        if not most or self._flat_view:
            return [
                *found,
                finding(
                    "mirror-curved-orthographic" if most else "mirror-curved-off", *curved.objects
                ),
            ]
        found += curved.rounded(self.wavelength_m)
        others = set(faces.names.values()).difference(curved.objects)
        if self.most_reflections > 2 and (others or curved.see_each_other):
            found.append(finding("mirror-curved-in-a-row", *curved.objects))
        return found

    def _straight_back(self) -> list[Finding]:
        """Return findings on mirrors in which the receiver sees the transmitter.

        The transmitter is a point, so this echo is not formed. Physical optics of a conductor gives
        4 pi A^2 / lambda^2 for its area, and at most the level of its image, 4 pi (R1 R2 / (R1 +
        R2))^2.
        """
        found: dict[str, None] = {}
        most_m2 = 0.0
        receiver_m = self._receiver_m[None]
        for chain in () if self._flat_view else self.images:
            ways = chain.ways(receiver_m)
            if not ways.place.size or not in_view(ways.stations_m[0], self.receiver)[0]:
                continue
            if ways.blocked(receiver_m, self.obstacles)[0][0]:
                continue
            found |= dict.fromkeys(chain.objects)
            first_m = float(distances(ways.stations_m[0], self._receiver_m)[0])
            all_m = float(ways.length_m[0])
            area_m2 = float(norms(self._faces.across_m2[chain.planes[-1].own]).sum()) / 2
            image_m2 = 4 * math.pi * (first_m * (all_m - first_m) / all_m) ** 2
            most_m2 = max(most_m2, min(4 * math.pi * (area_m2 / self.wavelength_m) ** 2, image_m2))
        if not found:
            return []
        level_dbsm = 10 * math.log10(max(most_m2, 1e-30))
        return [finding("mirror-echo-not-formed", *found, expected_dbsm=level_dbsm)]

    # -- what the table says of the mirrors --------------------------------------------------------

    @property
    def findings(self) -> list[Finding]:
        """Return the findings on mirrors, after all rows were added."""
        # of two reflections, no path goes over a mirror both out and back
        found = self._findings + self._turned.findings(self.most_reflections > 2)
        model = self.obstacles.model
        focusing = set() if self._curved is None else self._curved.focusing

        def names(bodies: set[int]) -> list[str]:
            numbers = model.number[np.array(sorted(bodies)) - 1].tolist()
            return list(dict.fromkeys(map(model.name, numbers)))

        if self._narrow[False]:
            found.append(finding("mirror-lobe-narrow", *names(self._narrow[False])))
        if self._narrow[True]:
            found.append(finding("mirror-curved-target", *names(self._narrow[True])))
        if focusing:
            found.append(finding("mirror-focuses", *names(focusing)))
        return found

    @property
    def dtype(self) -> np.dtype[np.void]:
        """Type of the table's rows."""
        if self._curved is not None:
            return CURVED_IMAGE_DTYPE
        return IMAGE_DTYPE if self._every_image else PATH_DTYPE

    @property
    def _planes(self) -> list[Plane]:
        return list(dict.fromkeys(plane for one in self._every_image for plane in one.planes))

    @property
    def bodies(self) -> dict[int, str]:
        """Names of the objects of all mirrors by the numbers of their bodies."""
        numbers = {number for plane in self._planes for number in plane.bodies}
        numbers |= set() if self._curved is None else set(self._curved.bodies)
        return {number: self._faces.names[number] for number in sorted(numbers)}

    @property
    def shared_bodies(self) -> set[int]:
        """Numbers of the bodies whose planes also belong to other bodies."""
        every = [plane.bodies for plane in self._planes]
        return {number for bodies in every if len(bodies) > 1 for number in bodies}

    @property
    def records(self) -> list[ImageRecord]:
        """The images, in the order of their numbers from 1. The images of the receiver
        come last.
        """
        return [chain.record for chain in self._every_image]

    @cached_property
    def _path_images(self) -> PathImages:
        return PathImages.of(self.records, np.zeros((0, 2), dtype=np.int32))

    def reflections(self, image: int) -> int:
        """Return how many reflections, in addition to those at mirrors, are followed
        with an image.
        """
        return self.most_reflections - 1 if image <= len(self.images) else 1

    # -- rows --------------------------------------------------------------------------------------

    def number(self, rows: PathRows, pixels: Indices) -> PathRows:
        """Return rows with the columns of images, and with the number of the point (pixel) for
        single scatterings.
        """
        wide = rows.widened(self.dtype)
        once = (rows["order"] == 1) & (rows["transparent_depth"] == 0) & (rows["last_body"] > 0)
        once &= rows["flags"] & PathFlag.NO_RANGE == 0
        wide["point"] = np.where(once, pixels, 0)
        return wide

    def choose(self, image: int, rows: PathRows) -> tuple[PathRows, float]:
        """Return the paths over an image, from 1, among rows that were measured with it, with power
        and phase.

        Also returns the power [W] of paths that are left out because open objects are on the way.
        With the light at the receiver, the paths are those of single scatterings.
        """
        if image > len(self.images):
            rows = rows[rows["point"] > 0]
            rows["transmitter_image"] = _AT_RECEIVER
            return rows, 0.0
        return self._over(self.images[image - 1], rows, "transmitter", image)

    def _over(
        self,
        mirror: ImageChain | CurvedMirrors,
        rows: PathRows,
        end: str,
        number: int,
        direct_m: Real | None = None,
    ) -> tuple[PathRows, float]:
        """Return the paths of rows over a mirror to one antenna, and the power [W] of paths that
        are left out because open objects are on the way.

        Rows have the power of the image. With `direct_m`, they have the power of the direct way to
        this place. Then the surface has the same radiance in both directions, and the ratio is that
        of the irradiances, or of the solid angles.
        """
        places_m, curved = rows["last_scatterer_m"], number < 0
        ways = mirror.ways(places_m)
        body, from_m = rows["last_body"][ways.place], places_m[ways.place]
        found = ways.reflected(self.polarisation, self.wavelength_m)
        spread, least = np.ones(ways.place.size), 0.0
        if direct_m is not None:
            least = _LEAST_POWER
            normals = self.normals(body, self._receiver_m, from_m)
            onto_m, straight_m = ways.stations_m[0] - from_m, direct_m - from_m
            spread = dots(normals, onto_m) / norms(onto_m) / ways.beam_m2
            spread /= dots(normals, straight_m) / norms(straight_m) ** 3
        bright = spread * found.power > least  # NaN: not
        kept = np.flatnonzero(bright & (rows["flags"][ways.place] & PathFlag.NO_RANGE == 0))
        blocked, through = ways.take(kept).blocked(places_m, self.obstacles)
        lost, kept = kept[through], kept[~(blocked | through)]
        through_w = float(rows["power_w"][ways.place[lost]] @ (spread * found.power)[lost])
        if direct_m is not None:
            lobe = self._lobes[curved][body[kept]]
            alike = alike_in_both(from_m[kept], direct_m, ways.stations_m[0, kept], lobe)
            self._narrow[curved].update(np.unique(body[kept[~alike]]).tolist())
            kept = kept[alike]
        ways, found = ways.take(kept), Reflected(*(column[kept] for column in found))
        made = rows[ways.place]
        made["power_w"] *= spread[kept]
        self._add_turned(ways, made["power_w"], found)
        made["power_w"] *= found.power
        made["mirror_phase_rad"] -= found.phase_rad  # echoes carry exp(+j w t)
        made["mirrors"] += mirror.count
        made["order"] += mirror.count
        made[f"{end}_image"] = number
        if curved:  # the planes of one point have different numbers
            offset_m = dots(ways.normals[0], ways.stations_m[0])
            made[f"{end}_plane"] = np.column_stack([ways.normals[0], offset_m])
            first = np.searchsorted(ways.place, ways.place)
            made[f"{end}_image"] = first - np.arange(ways.place.size) - 1
        return made, through_w

    def _add_turned(self, ways: Ways, power_w: Real, found: Reflected) -> None:
        names = self._faces.names
        code = np.zeros(ways.place.size, dtype=np.int64)
        for body in ways.body:
            code = code * (max(names) + 1) + body
        for index in np.unique(code, return_index=True)[1].tolist():
            mine = code == code[index]
            objects = tuple(dict.fromkeys(names[body] for body in ways.body[:, index].tolist()))
            part = Reflected(*(column[mine] for column in found))
            self._turned.add(objects, power_w[mine], part)

    def _measured(self, rows: PathRows) -> PathRows:
        """Put lengths and directions of paths with one scattering into rows over images."""
        numbers = np.stack([rows["receiver_image"], rows["transmitter_image"]], axis=-1)
        over = self._path_images.of_paths(numbers, planes_of(rows))
        point_m = rows["last_scatterer_m"]
        length_m = distances(point_m, over.places(0, self._receiver_m))
        length_m += distances(point_m, over.places(1, self.transmitter_m))
        rows["length_m"] = length_m
        direction = over.unfolded(0, point_m) - self._receiver_m
        rows["direction"] = direction / norms(direction)[:, None]
        return rows

    def with_both_ways(self, rows: PathRows) -> tuple[PathRows, float]:
        """Return rows of a tile replicate with those over curved mirrors, and those back over
        mirrors.

        Also returns the power of paths left out because open objects lie on the way [W].
        """
        if self._flat_view:
            return rows, 0.0
        at_receiver = rows["transmitter_image"] == _AT_RECEIVER
        shaded, rows = rows[at_receiver], rows[~at_receiver]
        rows = rows[~self._seen_directly(rows)]
        through_w = 0.0
        if self._curved is not None:
            direct = rows[(rows["point"] > 0) & (rows["transmitter_image"] == 0)]
            shaded = shaded[~np.isin(shaded["point"], direct["point"])]
            parts = [rows]
            for some, place_m in ((direct, self.transmitter_m), (shaded, self._receiver_m)):
                over, blocked_w = self._over(self._curved, some, "transmitter", -1, place_m)
                parts.append(self._measured(over))
                through_w += blocked_w
            rows = PathRows.joined(parts)
        narrow = self._otherwise(rows)
        back, blocked_w = self._ways_back(rows, ~narrow)
        row, way = _pairs(rows["point"], back["point"])
        few = rows["order"][row] + back["mirrors"][way] <= self.most_reflections
        row, way = row[few], way[few]
        made = rows[row]
        made["power_w"] *= back["power_w"][way]
        for name in ("mirror_phase_rad", "mirrors"):
            made[name] += back[name][way]
        made["order"] += back["mirrors"][way]
        for name in ("receiver_image", *(["receiver_plane"] if has_curved_images(rows) else [])):
            made[name] = back[name][way]
        every = PathRows.joined([rows, self._measured(made)])
        every["point"][np.concatenate([narrow, narrow[row]])] = 0
        every["point"][np.bincount(every["point"])[every["point"]] == 1] = 0
        return every, through_w + blocked_w

    def _ways_back(self, rows: PathRows, alike: Mask) -> tuple[PathRows, float]:
        """Return the ways back over mirrors from points, with their power over that of the direct
        way.

        If both antennas are in one place, they are the ways to the transmitter wherever surfaces
        scatter alike: the reverse path has the same power.
        """
        points, power_w = rows["point"], rows["power_w"]
        if self._one_place:
            direct = (points > 0) & (rows["transmitter_image"] == 0)
            direct_row = np.full(int(points.max(initial=0)) + 1, -1)
            direct_row[points[direct]] = np.flatnonzero(direct)
            base = direct_row[points]
            base[(points == 0) | direct | ~alike] = -1
            base[rows["last_body"][base] != rows["last_body"]] = -1
            over = np.flatnonzero(base >= 0)
            back = rows[over]
            back["power_w"] /= power_w[base[over]]
            back["receiver_image"] = back["transmitter_image"]
            if has_curved_images(rows):
                back["receiver_plane"] = back["transmitter_plane"]
            return back, 0.0
        seen = rows[points > 0]
        _, first, place = np.unique(seen["point"], return_index=True, return_inverse=True)
        once = seen[first]
        once["mirrors"], once["mirror_phase_rad"] = 0, 0.0
        parts, through_w = [once[:0]], 0.0
        for number, mirror in self._back.items():
            few = seen["order"] + mirror.count <= self.most_reflections
            total_w = np.bincount(place, seen["power_w"] * few, first.size)
            once["power_w"] = total_w
            back, blocked_w = self._over(
                mirror, once[total_w > 0], "receiver", number, self._receiver_m
            )
            back["power_w"] /= total_w[np.searchsorted(once["point"], back["point"])]
            parts.append(back)
            through_w += blocked_w
        return PathRows.joined(parts), through_w

    def _otherwise(self, rows: PathRows) -> Mask:
        """Return whether the surface at a point scatters differently towards the transmitter and
        towards its image, (n,).

        The rows go over this image.
        """
        found = (rows["transmitter_image"] > 0) & (rows["point"] > 0)
        some = rows[found]
        last_m, body = some["last_scatterer_m"], some["last_body"]
        images_m = self._lit_from(some)
        narrow = ~alike_in_both(last_m, self.transmitter_m, images_m, self._lobes[0][body])
        self._narrow[0].update(np.unique(body[narrow]).tolist())
        found[found] = narrow
        return found

    def _lit_from(self, rows: PathRows) -> Real:
        """Return the place of the transmitter, or of its image for rows over planes, (n, 3) [m]."""
        numbers = np.stack([rows["transmitter_image"]] * 2, axis=-1)
        return self._path_images.of_paths(numbers).places(1, self.transmitter_m)

    def _seen_directly(self, rows: PathRows) -> Mask:
        """Return which rows come over mirrors to a vertex that another pixel sees
        directly, (n,).
        """
        gone = np.zeros(rows.size, dtype=bool)
        once = (rows["transparent_depth"] == 0) & (rows["last_body"] > 0)
        once &= are_finite(rows["last_scatterer_m"])
        for number, mirror in self._back.items():
            # others scatter on the way
            mine = np.flatnonzero(once & (rows["order"] - rows["mirrors"] == 1 + mirror.count))
            ways = mirror.ways(rows["last_scatterer_m"][mine])
            some = rows[mine[ways.place]]
            last_m, towards_m = some["last_scatterer_m"], ways.stations_m[0]
            length_m = ways.length_m + distances(last_m, self._lit_from(some))
            room_m = ways.room_m + _MIRRORED * some["length_m"]
            same = np.abs(length_m - some["length_m"]) <= room_m
            # across the ray: along the mirror, the same error is larger at grazing incidence
            seen_m = ways.stations_m[-2] - self._receiver_m
            room_m = ways.room_m + _MIRRORED * some["length_m"] * norms(seen_m) / ways.length_m
            same &= norms(crosses(seen_m, some["direction"])) <= room_m
            lobe = self._lobes[number < 0][some["last_body"]]
            same &= alike_in_both(last_m, self._receiver_m, towards_m, lobe)
            same[same] = self._sees(some[same], towards_m[same])
            gone[mine[ways.place[same]]] = True
        return gone

    def _sees(self, rows: PathRows, from_m: Real) -> Mask:
        """Return whether a pixel sees the last vertex, on the side that faces `from_m` (n, 3),
        (n,).
        """
        last_m, body = rows["last_scatterer_m"], rows["last_body"]
        ends_m = np.broadcast_to(self._receiver_m, last_m.shape)
        normals = self.normals(body, from_m, last_m)
        seen = dots(normals, from_m - last_m) * dots(normals, ends_m - last_m) > 0
        seen &= in_view(last_m, self.receiver)
        blocked, through = self.obstacles.block(last_m, ends_m)
        return np.asarray(seen & ~blocked & ~through)


def _pairs(one: Indices, other: Indices) -> tuple[Indices, Indices]:
    """Return the numbers of all pairs with the same value. The numbers of `one` are in rising
    order.
    """
    order = np.argsort(other, kind="stable")
    first = np.searchsorted(other[order], one, "left")
    count = np.searchsorted(other[order], one, "right") - first
    within = np.arange(int(count.sum())) - np.repeat(np.cumsum(count) - count, count)
    return np.repeat(np.arange(len(one)), count), order[np.repeat(first, count) + within]
