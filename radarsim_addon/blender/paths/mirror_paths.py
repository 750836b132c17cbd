# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths whose first or last reflections are those of mirrors: kept where the mirror is on the
way.

A render with the transmitter in the place of its image gives all surfaces that see the image as if
nothing were in between. `MirrorPaths.choose` keeps a path if the way from its last scatterer to the
image meets the mirror, and nothing else lies on the way to that point and on from there to the
transmitter. `MirrorPaths.with_both_ways` adds the paths that come back over mirrors: with both
antennas in one place, `mirrors.add_reverse_paths`; with a receiver that stands apart, `WaysBack`. A
path that comes over mirrors to a vertex that another pixel sees is left out, because it is added
there (`VertexView`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from ... import contract
from ...arrays import Mask, Real, are_finite, crosses, distances, dots, norms, take_rows
from ...contract import ReceiverRecord
from ...findings import Finding, finding
from ...signal.motion import PathImages
from ...signal.paths import (
    CURVED_IMAGE_DTYPE,
    IMAGE_DTYPE,
    PATH_DTYPE,
    PathFlag,
    PathRows,
)
from ..materials import surfaces_of
from ..motion import Bodies
from ..plan import Measurement, PathOptions
from ..state import Shape
from ..views import TracedReplicate, pixel_numbers
from .curved_mirrors import CurvedMirrors, CurvedPaths, find_curved_mirrors
from .hit_points import HitPoints
from .mirrors import (
    FLAT,
    ONE_PLACE,
    ImageChain,
    Mirror,
    MirrorPolarisation,
    add_reverse_paths,
    alike_in_both,
    find_blocked,
    find_mirrors,
    first_images,
    in_view,
    measured,
    mirroring_objects,
    reflection,
    second_images,
    ways_over,
)
from .obstacles import BodyMesh, Obstacles


@dataclass(frozen=True)
class VertexView:
    """What a receiver at `receiver_m` sees of last vertices."""

    hits: HitPoints
    obstacles: Obstacles
    receiver: ReceiverRecord
    receiver_m: Real

    def sees(self, rows: PathRows, from_m: Real) -> Mask:
        """Whether a pixel sees last vertices, (n,), on the side on which `from_m`, (3,) or (n,
        3), is.
        """
        last_m = rows["last_scatterer_m"]
        found = in_view(last_m, self.receiver)
        chosen = np.flatnonzero(found)
        from_m = np.broadcast_to(from_m, last_m.shape)
        last_m, from_m, body = last_m[chosen], from_m[chosen], rows["last_body"][chosen]
        ends_m = np.broadcast_to(self.receiver_m, last_m.shape)
        normals = self.hits.normals(body, from_m, last_m)
        seen = dots(normals, from_m - last_m) * dots(normals, ends_m - last_m) > 0
        blocked, through = self.obstacles.block(last_m, ends_m, body)
        found[chosen] = seen & ~blocked & ~through
        return found


@dataclass(frozen=True)
class WaysBack:
    """Finds paths back over mirrors to a receiver that stands apart from the transmitter.

    A pixel that sees a point gives the power of the direct way back. Over a mirror, an element of
    the surface fills another solid angle: its projected area over the squared length of that way. A
    Lambert surface has the same radiance in both directions, so the power is that of the direct way
    times the ratio of the solid angles and the mirror's reflectance. `chains` are the receiver's
    images by their numbers, `lobes` the widths of the narrowest lobes by the bodies' numbers.
    `curved` is None without curved mirrors.
    """

    chains: Mapping[int, ImageChain]
    obstacles: Obstacles
    hits: HitPoints
    lobes: Real
    receiver_m: Real
    transmitter_m: Real
    polarisation: str
    wavelength_m: float
    reflections: int
    curved: CurvedPaths | None

    def added(self, rows: PathRows, images: PathImages) -> tuple[PathRows, float]:
        """Return rows of a tile replicate with the paths back over mirrors.

        Those with a `point` that several paths have are of one scattering. Also returns the power
        of paths that are left out because open objects lie on the way [W].
        """
        seen = rows[rows["point"] > 0]
        last_m = seen["last_scatterer_m"]
        from_m = np.broadcast_to(self.receiver_m, last_m.shape)
        normals = self.hits.normals(seen["last_body"], from_m, last_m)
        own = _projected(normals, self.receiver_m - last_m)
        parts, through_w = [rows], 0.0
        for number, chain in self.chains.items():
            over = _projected(normals, chain.image_m - last_m)
            lobe = self.lobes[seen["last_body"]]
            mine = own * over > 0  # NaN: no normal is known
            mine &= alike_in_both(last_m, self.receiver_m, chain.image_m, lobe)
            mine &= seen["order"] + len(chain.mirrors) <= self.reflections
            known = np.flatnonzero(mine)
            ways = ways_over(chain, last_m[known])
            known = known[ways.rows]
            back = seen[known]
            blocked, through = find_blocked(
                chain, ways, back["last_scatterer_m"], back["last_body"], self.obstacles
            )
            found = reflection(chain, ways, self.polarisation, self.wavelength_m)
            back["power_w"] *= found.power * over[known] / own[known]
            back["mirror_phase_rad"] -= found.phase_rad  # echoes carry exp(+j w t)
            back["mirrors"] += len(chain.mirrors)
            back["order"] += len(chain.mirrors)
            back["receiver_image"] = number
            through_w += float(back["power_w"][through].sum())
            back = back[~(blocked | through)]
            parts.append(measured(back, images, self.receiver_m, self.transmitter_m))
        if self.curved is not None:
            back = seen[seen["order"] < self.reflections]
            back, blocked_w = self.curved.over(back, 0, self.receiver_m)
            through_w += blocked_w
            parts.append(measured(back, images, self.receiver_m, self.transmitter_m))
        return PathRows.joined(parts), through_w

    def alike(self, rows: PathRows, number: int) -> Mask:
        """Whether surfaces scatter nearly alike towards the receiver and an image of it, (n,)."""
        image_m, lobe = self.chains[number].image_m, self.lobes[rows["last_body"]]
        return alike_in_both(rows["last_scatterer_m"], self.receiver_m, image_m, lobe)


def receiver_chains(
    mirrors: Sequence[Mirror],
    receiver_m: Real,
    images: list[ImageChain],
    wavelength_m: float,
    most: int,
    pairs: bool,
) -> tuple[dict[int, ImageChain], list[ImageChain]]:
    """Return the images of the receiver by their numbers, and those that the transmitter has
    not.

    `images` are those of the transmitter, numbered from 1; new ones follow. With `pairs`, images
    over two mirrors in a row are added, `most` in all.
    """
    same = [_on_plane(one, images, wavelength_m) for one in mirrors]
    chains = first_images(same, receiver_m)
    if pairs:
        chains += second_images(chains)[: most - len(chains)]
    numbers = {_planes(chain): number for number, chain in enumerate(images, start=1)}
    found: dict[int, ImageChain] = {}
    new: list[ImageChain] = []
    for chain in chains:
        number = numbers.get(_planes(chain))
        if number is None:
            new.append(chain)
            number = len(images) + len(new)
        found[number] = chain
    return found, new


def _on_plane(mirror: Mirror, images: Sequence[ImageChain], wavelength_m: float) -> Mirror:
    """Return a mirror in the plane that the transmitter's image has, where it is the same."""
    for chain in images:
        other = chain.mirrors[0]
        near = abs(other.offset_m - mirror.offset_m) <= FLAT * wavelength_m
        if len(chain.mirrors) == 1 and near and float(other.normal @ mirror.normal) > 1 - 1e-6:
            return Mirror(
                other.normal, other.offset_m, mirror.triangles_m, mirror.body, mirror.material,
                mirror.objects, mirror.sight_sr,
            )  # fmt: skip
    return mirror


def _planes(chain: ImageChain) -> tuple[tuple[float, ...], ...]:
    return tuple((*mirror.normal.tolist(), mirror.offset_m) for mirror in chain.mirrors)


def _projected(normals: Real, ways_m: Real) -> Real:
    """Solid angle that a unit of area fills at the ends of ways, (n,) [1/m^2]; signed by side."""
    return np.asarray(dots(normals, ways_m) / norms(ways_m) ** 3)


#: Largest error of a mirrored ray at its scatterer, and of its length, over the length: float32.
_MIRRORED = 2e-5
#: Image number of a row that was measured with the light at the receiver.
_AT_RECEIVER = -1


class MirrorPaths:
    """The images of the transmitter in one frame, and the paths over them.

    Blender must evaluate nothing else while rows are chosen. `reach_m` is the distance of the
    farthest surface from the receiver; `meshes` were read before, and more are added.
    """

    def __init__(
        self,
        bodies: Bodies,
        hits: HitPoints,
        metres_per_unit: float,
        receiver: contract.ReceiverRecord,
        transmitter_m: Real,
        reach_m: float,
        measurement: Measurement,
        options: PathOptions,
        meshes: WeakKeyDictionary[Shape, BodyMesh | None],
    ) -> None:
        self.obstacles = Obstacles(bodies, metres_per_unit, meshes)
        self._transmitter_m, self._polarisation = transmitter_m, measurement.polarisation
        self._receiver, self._hits = receiver, hits
        self._receiver_m = np.asarray(receiver.matrix_world, dtype=np.float64)[:3, 3]
        self._view = VertexView(hits, self.obstacles, receiver, self._receiver_m)
        self._read_materials(bodies)
        self._reflections = options.max_reflections
        self._wavelength_m = measurement.waveform.wavelength_m
        most = options.mirror_images if self._reflections > 1 else 0
        self.mirrors: list[Mirror] = []
        self._findings: list[Finding] = []
        curved = self._find_mirrors(most)
        apart_m = float(np.linalg.norm(self._receiver_m - transmitter_m))
        #: Whether a path and its reverse are alike.
        self._one_place = apart_m <= ONE_PLACE * reach_m and receiver.kind != "orthographic"
        #: Paths over curved mirrors, to transmitter and receiver; None without any.
        self._curved: CurvedPaths | None = None
        self._curved_back: CurvedPaths | None = None
        if curved is not None:
            self._find_curved(curved, most)
        self._turned = MirrorPolarisation()
        #: Bodies that scatter otherwise towards an image.
        self._narrow: set[int] = set()
        self.images = first_images(self.mirrors, transmitter_m)
        if self._reflections > 2:
            self._add_second_images(most)
        #: Images of the receiver by their numbers, where it stands apart.
        self._back: WaysBack | None = None
        self._own_images: list[ImageChain] = []
        if receiver.kind == "orthographic" and self.mirrors:
            self._findings.append(finding("mirror-ways-not-in-phase"))
        elif self._reflections > 1 and not self._one_place:
            self._find_ways_back(most)
        self._findings += self._straight_back()
        places_m = [one.image_m for one in self.images]
        if self._curved is not self._curved_back:
            places_m.append(self._receiver_m)
        #: Places of lights that nothing blocks, (n, 3) [m]: those of the images. The last one is at
        #: a receiver that stands apart: curved mirrors may light the points that it sees in shade.
        self.lamps_m: Real = np.array(places_m).reshape(-1, 3)

    def _straight_back(self) -> list[Finding]:
        """Find the mirrors in which the receiver sees the transmitter, a point without a size.

        Physical optics of a conductor: 4 pi A^2 / lambda^2 of its area, and at most that of its
        image, 4 pi (R1 R2 / (R1 + R2))^2.
        """
        found: dict[str, None] = {}
        most_m2 = 0.0
        receiver_m = self._receiver_m[None]
        for chain in self.images if self._receiver.kind != "orthographic" else ():
            ways = ways_over(chain, receiver_m)
            if not ways.rows.size or not in_view(ways.met_m[0], self._receiver)[0]:
                continue
            none = np.zeros(1, dtype=np.intp)
            if find_blocked(chain, ways, receiver_m, none, self.obstacles)[0][0]:
                continue
            found |= dict.fromkeys(chain.objects)
            first_m = float(norms(ways.met_m[0] - receiver_m)[0])
            all_m = float(norms(chain.image_m - receiver_m)[0])
            sides = chain.mirrors[-1].triangles_m[:, 1:] - chain.mirrors[-1].triangles_m[:, :1]
            area_m2 = float(norms(crosses(sides[:, 0], sides[:, 1])).sum()) / 2
            image_m2 = 4 * math.pi * (first_m * (all_m - first_m) / all_m) ** 2
            most_m2 = max(most_m2, min(4 * math.pi * (area_m2 / self._wavelength_m) ** 2, image_m2))
        if not found:
            return []
        level_dbsm = 10 * math.log10(max(most_m2, 1e-30))
        return [finding("mirror-echo-not-formed", *found, expected_dbsm=level_dbsm)]

    def _find_mirrors(self, most: int) -> CurvedMirrors | None:
        """Find the planar mirrors; return the curved ones, None without any."""
        if self._reflections == 1:
            if names := mirroring_objects(self.obstacles):
                self._findings.append(finding("mirrors-need-reflections", *names))
            return None
        self.mirrors, self._findings = find_mirrors(
            self.obstacles, self._transmitter_m, self._wavelength_m, most
        )
        curved, said = find_curved_mirrors(self.obstacles, self._wavelength_m)
        self._findings += said
        if self._reflections == 2 and (self.mirrors or curved is not None):
            names = [name for one in (*self.mirrors, curved) if one for name in one.objects]
            self._findings.append(finding("mirror-both-ways-left-out", *dict.fromkeys(names)))
        rough = [name for one in self.mirrors if one.is_rough for name in one.objects]
        rough += () if curved is None else curved.rough_objects
        if rough:
            self._findings.append(finding("mirror-slightly-rough", *dict.fromkeys(rough)))
        return curved

    def _read_materials(self, bodies: Bodies) -> None:
        surfaces = surfaces_of(bodies.snapshot)
        known = [surfaces.of(shape.materials) for shape in bodies.snapshot.shapes]
        widths = [min((one.lobe_width for one in every), default=math.inf) for every in known]
        #: Width of the narrowest lobe by the body's number, from 1; and that of surfaces without a
        #: clutter model, 0 for others.
        self._lobes = np.append(0.0, np.array(widths)[bodies.shape])
        weighted = np.array([any(one.clutter for one in every) for every in known], dtype=bool)
        self._plain_lobes = np.append(0.0, np.where(weighted, 0.0, widths)[bodies.shape])

    def _find_curved(self, curved: CurvedMirrors, most: int) -> None:
        """Find the paths over curved mirrors, unless they are off or the camera is orthographic."""
        if not most:
            self._findings.append(finding("mirror-curved-off", *curved.objects))
            return
        if self._receiver.kind == "orthographic":
            self._findings.append(finding("mirror-curved-orthographic", *curved.objects))
            return
        self._findings += curved.rounded(self._wavelength_m)
        others = set(mirroring_objects(self.obstacles)).difference(curved.objects)
        if self._reflections > 2 and (others or curved.see_each_other):
            self._findings.append(finding("mirror-curved-in-a-row", *curved.objects))
        self._curved = CurvedPaths(
            curved,
            self.obstacles,
            self._hits,
            self._plain_lobes,
            self._receiver_m,
            self._transmitter_m,
            self._polarisation,
            self._wavelength_m,
        )
        together = self._one_place
        self._curved_back = self._curved if together else self._curved.to(self._receiver_m)

    def _add_second_images(self, most: int) -> None:
        """Add the images over two mirrors in a row, as far as there may be more images."""
        second = second_images(self.images)
        free = most - len(self.images)
        self.images += second[:free]
        if second[free:]:
            names = dict.fromkeys(name for chain in second[free:] for name in chain.objects)
            count = len(second) - free
            self._findings.append(finding("mirror-pairs-left-out", *names, count=count, most=most))

    def _find_ways_back(self, most: int) -> None:
        """Find the images of a receiver that stands apart from the transmitter."""
        mirrors, findings = find_mirrors(self.obstacles, self._receiver_m, self._wavelength_m, most)
        told = {item.code for item in self._findings}
        self._findings += [item for item in findings if item.code not in told]
        chains, self._own_images = receiver_chains(
            mirrors, self._receiver_m, self.images, self._wavelength_m, most, self._reflections > 2
        )
        self.mirrors += mirrors
        self._back = WaysBack(
            chains,
            self.obstacles,
            self._hits,
            self._lobes,
            self._receiver_m,
            self._transmitter_m,
            self._polarisation,
            self._wavelength_m,
            self._reflections,
            self._curved_back,
        )

    @property
    def findings(self) -> list[Finding]:
        """Findings on the mirrors, after all rows."""
        found = list(self._findings)
        found += self._turned.phases()
        found += [] if self._curved is None else self._curved.turned.phases()
        if self._reflections > 2:  # else no path goes over a mirror both out and back
            found += self._turned.finding()
            found += [] if self._curved is None else self._curved.turned.finding()
        if self._narrow and self._receiver.kind != "orthographic":
            found.append(finding("mirror-lobe-narrow", *self._names(self._narrow)))
        if self._curved is not None and self._curved.narrow:
            found.append(finding("mirror-curved-target", *self._names(self._curved.narrow)))
        if self._curved is not None and self._curved.focusing:
            found.append(finding("mirror-focuses", *self._names(self._curved.focusing)))
        return found

    def _names(self, bodies: set[int]) -> dict[str, None]:
        """Names of the objects of bodies, each once."""
        return dict.fromkeys(map(self._name, sorted(bodies)))

    @property
    def dtype(self) -> np.dtype[np.void]:
        """Type of the table's rows."""
        if self._curved is not None:
            return CURVED_IMAGE_DTYPE
        return IMAGE_DTYPE if self.mirrors else PATH_DTYPE

    def _name(self, body: int) -> str:
        """Name of the object of a body, from 1."""
        bodies = self.obstacles.bodies
        return str(bodies.originals[int(bodies.number[body - 1])].name_full)

    @property
    def bodies(self) -> dict[int, str]:
        """Names of the objects of all mirrors by the numbers of their bodies."""
        numbers = {int(n) for mirror in self.mirrors for n in np.unique(mirror.body)}
        numbers |= set() if self._curved is None else set(self._curved.mirrors.names)
        return {number: self._name(number) for number in sorted(numbers)}

    @property
    def shared_bodies(self) -> set[int]:
        """Numbers of the bodies whose planes are those of others, too."""
        shared = [mirror.body for mirror in self.mirrors if mirror.own_body == 0]
        return {int(n) for body in shared for n in np.unique(body)}

    @property
    def records(self) -> list[contract.ImageRecord]:
        """The images, in the order of their numbers from 1; the receiver's own are the last."""
        return [chain.record for chain in (*self.images, *self._own_images)]

    def reflections(self, image: int) -> int:
        """Return how many reflections besides those of mirrors are followed with an image."""
        return self._reflections - 1 if image <= len(self.images) else 1

    def choose(self, image: int, rows: PathRows) -> tuple[PathRows, float]:
        """Return the paths over an image, from 1, among rows measured with it, with power and
        phase.

        Also returns the power of paths left out because open objects lie on the way [W]. With the
        light at the receiver, the paths are those of single scatterings.
        """
        if image > len(self.images):
            rows = rows[rows["point"] > 0]
            rows["transmitter_image"] = _AT_RECEIVER
            return rows, 0.0
        chain = self.images[image - 1]
        points_m = rows["last_scatterer_m"]
        ranged = np.flatnonzero(are_finite(points_m) & (rows["flags"] & PathFlag.NO_RANGE == 0))
        ways = ways_over(chain, take_rows(points_m, ranged))
        met = ranged[ways.rows]
        blocked, through = find_blocked(
            chain, ways, take_rows(points_m, met), rows["last_body"][met], self.obstacles
        )
        through_w = float(rows["power_w"][met[through]].sum())
        free = ~(blocked | through)
        rows = rows[met[free]]
        found = reflection(chain, ways.of(free), self._polarisation, self._wavelength_m)
        self._turned.add(chain.objects, rows["power_w"], found)
        rows["power_w"] *= found.power
        rows["mirror_phase_rad"] = -found.phase_rad  # echoes carry exp(+j w t)
        rows["transmitter_image"] = image
        rows["mirrors"] = len(chain.mirrors)
        rows["order"] += len(chain.mirrors)
        return rows, through_w

    def number(self, rows: PathRows, traced: TracedReplicate, image: int) -> PathRows:
        """Return rows with the columns of images, and with the point (pixel) of single
        scatterings.
        """
        wide = rows.widened(self.dtype)
        once = (rows["order"] == 1) & (rows["transparent_depth"] == 0) & (rows["last_body"] > 0)
        once &= rows["flags"] & PathFlag.NO_RANGE == 0
        if 0 < image <= len(self.images):
            alike = self._alike(rows, image)
            self._narrow.update(np.unique(rows["last_body"][once & ~alike]).tolist())
            if self._back is None:
                once &= alike
        wide["point"] = np.where(once, pixel_numbers(traced), 0)
        return wide

    def with_both_ways(self, rows: PathRows) -> tuple[PathRows, float]:
        """Return rows of a tile replicate with those over curved mirrors, and those back over
        mirrors.

        Also returns the power of paths left out because open objects lie on the way [W].
        """
        if self._receiver.kind == "orthographic":
            return rows, 0.0
        shaded = rows[:0]
        if self._curved is not self._curved_back:
            at_receiver = rows["transmitter_image"] == _AT_RECEIVER
            shaded, rows = rows[at_receiver], rows[~at_receiver]
        gone = self._seen_directly(rows)
        rows = rows[~gone] if gone.any() else rows
        images = PathImages.of(self.records, np.zeros((0, 2), dtype=np.int32))
        through_w = 0.0
        if self._curved is not None:
            direct = rows[(rows["point"] > 0) & (rows["transmitter_image"] == 0)]
            shaded = shaded[~np.isin(shaded["point"], direct["point"])]
            over, through_w = self._curved.over(direct, 1, self._transmitter_m)
            lit, blocked_w = self._curved.over(shaded, 1, self._receiver_m)
            rows = PathRows.joined([rows, over, lit])
            through_w += blocked_w
        if self._back is None:
            every = add_reverse_paths(
                rows, images, self._receiver_m, self._transmitter_m, self._reflections
            )
            return every, through_w
        every, blocked_w = self._back.added(rows, images)
        for image in range(1, len(self.images) + 1):
            of_image = np.flatnonzero((every["transmitter_image"] == image) & (every["point"] > 0))
            every["point"][of_image[~self._alike(every[of_image], image)]] = 0
        _, place, paths = np.unique(every["point"], return_inverse=True, return_counts=True)
        every["point"][paths[place] == 1] = 0
        return every, through_w + blocked_w

    def _alike(self, rows: PathRows, image: int) -> Mask:
        """Whether surfaces scatter nearly alike towards the transmitter and its image, (n,)."""
        lobe = self._lobes[rows["last_body"]]
        image_m = self.lamps_m[image - 1]
        return alike_in_both(rows["last_scatterer_m"], self._transmitter_m, image_m, lobe)

    def _seen_directly(self, rows: PathRows) -> Mask:
        """Rows that come over mirrors to a vertex that another pixel sees."""
        gone = np.zeros(rows.size, dtype=bool)
        once = (rows["transparent_depth"] == 0) & (rows["last_body"] > 0)
        once &= are_finite(rows["last_scatterer_m"])
        back = dict(enumerate(self.images, 1)) if self._back is None else self._back.chains
        for image, chain in back.items():
            scatterers = rows["order"] - rows["mirrors"] == 1 + len(chain.mirrors)
            mine = np.flatnonzero(once & scatterers)
            if not mine.size:
                continue
            # The way over these mirrors has its direction and length; others scatter on the way.
            ends = np.stack([np.full(mine.size, image), rows["transmitter_image"][mine]], axis=-1)
            over = PathImages.of(self.records, ends)
            last_m = rows["last_scatterer_m"][mine]
            seen_m = over.unfolded(0, last_m) - self._receiver_m
            way_m = norms(seen_m) + distances(last_m, over.places(1, self._transmitter_m))
            length_m = rows["length_m"][mine]
            close = norms(crosses(seen_m, rows["direction"][mine])) <= _MIRRORED * length_m
            close &= np.abs(way_m - length_m) <= _MIRRORED * length_m
            mine = mine[close]
            alike = self._alike if self._back is None else self._back.alike
            mine = mine[alike(rows[mine], image)]
            place_m = over.places(0, self._receiver_m)[0]
            gone[mine[self._view.sees(rows[mine], place_m)]] = True
        if self._curved_back is not None:
            scatterers = rows["order"] - rows["mirrors"] == 2
            over_curved = np.isin(rows["first_body"], list(self._curved_back.mirrors.names))
            mine = np.flatnonzero(once & scatterers & over_curved)
            met, points_m = self._curved_back.met(rows[mine])
            mine, points_m = mine[met], points_m[met]
            wide = self._curved_back.alike(rows[mine], points_m)
            gone[mine[wide & self._view.sees(rows[mine], points_m)]] = True
        return gone
