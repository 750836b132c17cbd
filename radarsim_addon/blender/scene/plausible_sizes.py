# SPDX-License-Identifier: GPL-3.0-or-later
"""Find objects whose size or up axis does not fit their name, and scenes of implausible extent.

Files of other programs often come in centimetres, millimetres or inches, or with Y up. Ranges and
powers are then wrong although nothing else is. A name says what an object is (`KINDS`): that of the
object, of one that it is parented to, of the instanced collection, or of one that holds the object.
"""

from __future__ import annotations

import math
import re
from collections.abc import Generator
from dataclasses import dataclass, field
from functools import cache
from typing import Literal

import bpy
import numpy as np

from ...arrays import Real
from ...findings import Finding, finding
from .ground_truth import Boxes
from .visibility import joined_parts


@dataclass(frozen=True)
class Kind:
    """A kind of object: its words, and the usual sizes of its largest dimension [m]."""

    name: str
    words: frozenset[str]
    least_m: float
    most_m: float
    #: "tall": higher than it is long; "long": not higher than it is long; None: either.
    shape: Literal["tall", "long"] | None


def _kind(words: str, least_m: float, most_m: float, shape: Literal["tall", "long"] | None) -> Kind:
    return Kind(words.split()[0], frozenset(words.split()), least_m, most_m, shape)


#: Usual sizes. Vehicles: Directive 96/53/EC allows 12 m for a rigid truck, 15 m for a rigid bus and
#: 18.75 m with a trailer; some countries allow 25.25 m. Persons: the 5th percentile of Japanese
#: women and the 95th of US men are 1.45 and 1.87 m (City University of Hong Kong, Online
#: Anthropometry); children are smaller. Cars, two-wheelers, trees and houses: as in streets.
KINDS = (
    _kind("car sedan hatchback suv taxi", 3.0, 6.0, "long"),
    _kind("van minivan minibus", 3.5, 8.0, "long"),
    _kind("truck lorry", 4.5, 25.0, "long"),
    _kind("bus coach", 6.0, 25.0, "long"),
    _kind("motorcycle motorbike", 1.6, 2.8, "long"),
    _kind("bicycle bike", 1.2, 2.2, "long"),
    _kind("person pedestrian human man woman", 1.0, 2.2, "tall"),
    _kind("tree", 2.0, 60.0, "tall"),
    _kind("house", 3.0, 60.0, None),
)
_KIND_OF_WORD = {word: kind for kind in KINDS for word in kind.words}
#: Words that make a name that of a part, or of something else: "Car Wheel", "Bus Stop".
_OTHER_THINGS = frozenset(re.findall(r"[a-z]+", """
    antenna arm armrest axle bark bench blade body bolt branch brake bulb bumper button cab
    cabin camera carrier chair charger counter dash decal disc display dock door driver engine
    exhaust eye face field finger floor foliage foot frame fruit garage glass ground grill hair
    hand handle head headlight hole hood hook horn hub interior jacket key lamp lane leaf leaves
    leg lens licence license light lights line logo mask mirror model mount navigation nut panel
    park parking part pedal phone picture pipe plane plant plate pole port poster props rack
    radar radio rail ramp rim road roof root seat sensor shadow shed shelter shirt shoe sign
    spoiler spoke stair station steering stop street stump suspension tail tank terrain tire
    tires toy track trailer trim trunk tyre tyres vent wall wash wheel wheels window windows
    windscreen windshield wiper wire
"""))  # fmt: skip
#: Sizes may be off by this factor beyond the usual ones.
_SLACK = 1.5
#: Height over length of a "tall" thing that lies, and of a "long" one that stands on its end.
_LIES, _STANDS = 0.4, 1.1
#: Ratios of units that files confuse: centimetres, millimetres and inches to metres, and back.
_UNITS = (0.01, 0.001, 0.0254, 100.0, 1000.0)
#: Objects of one part of the check.
_PART = 128
#: Extents of a scene that are none of a radar's [m].
_LEAST_SCENE_M, _MOST_SCENE_M = 0.01, 1e6


@dataclass
class _Held:
    """Surfaces of one thing: an object with its children, an instance, or a collection."""

    kind: Kind
    name: str
    #: Spans of the boxes of surfaces that are no other thing, and corners of all boxes [m].
    spans: list[Real] = field(default_factory=list)
    corners: list[Real] = field(default_factory=list)


@cache
def kind_of(name: str) -> Kind | None:
    """Return the kind that a name states; None if it states none, or names a part."""
    words = _words(name)
    if not _OTHER_THINGS.isdisjoint(words):
        return None
    return next((_KIND_OF_WORD[word] for word in words if word in _KIND_OF_WORD), None)


def _words(name: str) -> list[str]:
    """Return the words of a name such as "SportsCar_01" in small letters."""
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)]


def check_sizes(surfaces: Boxes, metres_per_unit: float) -> list[Finding]:
    """Find objects whose size or up axis does not fit their name, and implausible scenes."""
    return joined_parts(sizes_in_parts(surfaces, metres_per_unit))


def sizes_in_parts(surfaces: Boxes, metres_per_unit: float) -> Generator[None, None, list[Finding]]:
    """Yield after parts; return `check_sizes`."""
    if not surfaces.rows.size:
        return []
    corners_m = surfaces.corners * metres_per_unit
    span_m = float(np.linalg.norm(np.ptp(corners_m.reshape(-1, 3), axis=0)))
    found = []
    if not _LEAST_SCENE_M <= span_m <= _MOST_SCENE_M:
        found.append(finding("scene-size-implausible", span_m=span_m))
    things = yield from _things(surfaces, corners_m)
    off: dict[Kind, dict[str, float]] = {}
    lying: dict[Kind, dict[str, float]] = {}
    for count, held in enumerate(things):
        if count % _PART == 0:
            yield None
        size_m, height_m, length_m = _sizes(held)
        kind = held.kind
        if size_m > 0 and not kind.least_m / _SLACK <= size_m <= _SLACK * kind.most_m:
            off.setdefault(kind, {})[held.name] = size_m
        if (kind.shape == "tall" and height_m < _LIES * length_m) or (
            kind.shape == "long" and height_m > _STANDS * length_m
        ):
            lying.setdefault(kind, {})[held.name] = height_m / length_m if length_m else math.inf
    for kind, sizes_m in off.items():
        usual = f"{kind.least_m:g} to {kind.most_m:g} m are usual"
        middle_m = float(np.median(list(sizes_m.values())))
        text = f"a {kind.name} of {_span(sizes_m)} m, where {usual}"
        text += f" (scale by {_factor(kind, middle_m):g})"
        found.append(finding("size-implausible", *sizes_m, found=text))
    for kind, ratios in lying.items():
        text = f"a {kind.name} is {_span(ratios)} times as high as long"
        found.append(finding("lies-on-its-side", *ratios, found=text))
    return found


def _span(values: dict[str, float]) -> str:
    least, most = f"{min(values.values()):.3g}", f"{max(values.values()):.3g}"
    return least if least == most else f"{least} to {most}"


def _things(surfaces: Boxes, corners_m: Real) -> Generator[None, None, list[_Held]]:
    """Yield after parts; return what names state. Of all instances of an object by one instancer
    the first counts.
    """
    snapshot, layout = surfaces.snapshot, surfaces.snapshot.layout
    of_collections = _stated_by_collections()
    yield None
    _, firsts = np.unique(surfaces.labels()[1], return_index=True)
    things: dict[str, _Held] = {}
    for count, at in enumerate(firsts.tolist()):
        if count % _PART == 0:
            yield None
        row = int(surfaces.rows[at])
        original, index = snapshot.shapes[layout.shape[row]].original, int(layout.instancer[row])
        owner = _owner(original, None if index < 0 else layout.instancers[index])
        if owner is not None:
            key, name, kind = owner.name_full, owner.name, _kind_of_object(owner)
        elif original.name_full in of_collections:
            (key, kind), name = of_collections[original.name_full], original.name
        else:
            continue
        assert kind is not None
        held = things.setdefault(key, _Held(kind, name))
        held.corners.append(corners_m[at])
        if _OTHER_THINGS.isdisjoint(_words(original.name)):
            held.spans.append(np.ptp(corners_m[at], axis=0))
    return list(things.values())


def _kind_of_object(item: bpy.types.Object) -> Kind | None:
    """Return the kind that the name of an object, or of the collection that it shows, states."""
    shown = item.instance_collection
    return kind_of(item.name) or (None if shown is None else kind_of(shown.name))


def _owner(item: bpy.types.Object, instancer: bpy.types.Object | None) -> bpy.types.Object | None:
    """Return the object that states the kind of a surface: the outermost one of that kind."""
    found, kind = None, None
    for at in (item, instancer):
        while at is not None:
            own = _kind_of_object(at)
            if own is not None and kind in (None, own):
                found, kind = at, own
            at = at.parent
    return found


def _stated_by_collections() -> dict[str, tuple[str, Kind]]:
    """Return a key of the collection that states the kind of an object, and the kind, by the
    object's name.
    """
    found: dict[str, tuple[str, Kind]] = {}
    for collection in bpy.data.collections:
        kind = kind_of(collection.name)
        if kind is not None:
            key = f"collection/{collection.name}"
            found |= {item.name_full: (key, kind) for item in collection.all_objects}
    return found


def _sizes(held: _Held) -> tuple[float, float, float]:
    """Return the size that counts, and height and length of the largest surface [m].

    A thing is too large if one of its surfaces is, and too small if all of it together is: several
    of a kind may be held together, far apart.
    """
    whole = np.ptp(np.concatenate(held.corners), axis=0)
    largest = max(held.spans, key=np.max, default=whole)
    size_m = float(largest.max())
    if size_m <= _SLACK * held.kind.most_m:
        size_m = min(float(whole.max()), held.kind.most_m)
    return size_m, float(largest[2]), float(largest[:2].max())


def _factor(kind: Kind, size_m: float) -> float:
    """Return the factor that makes a size usual: one of confused units, or one of one digit."""
    for factor in _UNITS:
        if kind.least_m <= factor * size_m <= kind.most_m:
            return factor
    factor = math.sqrt(kind.least_m * kind.most_m) / size_m
    return float(f"{factor:.1g}")
