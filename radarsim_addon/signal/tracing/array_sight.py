# SPDX-License-Identifier: GPL-3.0-or-later
"""Power of the paths that elements at the edge of an array do not see, though its origin does.

All channels of an array take the paths of one table, which the antennas' origins see. Rays from the
first and last scatterers of its paths to the outermost elements show which paths an obstacle blocks
there. A path whose way to the origin is blocked too is taken as seen: the render knows better.
Likewise a way over mirrors. Antenna patterns do not count.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Indices, Mask, Real, are_finite
from ...contract import ReceiverRecord, TransmitterRecord
from ...findings import Finding, finding, finding_about
from ..paths import PathRows, has_images
from ..radar import Channel, Element
from .obstacles import Obstacles

#: Rows that are looked at, about, and at least so many of each object.
_ROWS, _OF_OBJECT = 1 << 14, 128
#: An object of fewer rows is not judged by itself.
_FEWEST = 10
#: Hidden fractions of the whole power, and of an object's, above which there is a finding.
_WHOLE, _OBJECT = 0.01, 0.05
_COLUMNS = ("power_w", "last_object", "first_scatterer_m", "last_scatterer_m")
_IMAGES = ("receiver_image", "transmitter_image")


@dataclass(frozen=True)
class HiddenPower:
    """Hidden fractions of the pair of elements with the largest, and of each object's largest.

    `of_objects` has them by the objects' names; `most_of` is the object that the pair of elements
    misses most of, by power.
    """

    fraction: float
    most_of: str
    of_objects: dict[str, float]

    @property
    def findings(self) -> list[Finding]:
        found = []
        if self.fraction > _WHOLE:
            found.append(finding("array-hides-power", self.most_of, fraction=self.fraction))
        hidden = {n: {"fraction": f} for n, f in self.of_objects.items() if f > _OBJECT}
        return [*found, finding_about("array-hides-object", hidden)] if hidden else found


def hidden_power(
    obstacles: Obstacles,
    chunks: Callable[[], Iterable[PathRows]],
    channels: Sequence[Channel],
    receiver: ReceiverRecord,
    transmitter: TransmitterRecord,
) -> HiddenPower:
    """Return how much power of a table the outermost elements of an array do not see.

    `chunks` gives the rows of the table, in the world's axes at the time of the obstacles.
    """
    names = obstacles.model.names
    count = np.zeros(len(names) + 1)
    power_w = np.zeros(len(names) + 1)
    for rows in chunks():
        count += np.bincount(rows["last_object"], minlength=count.size)
        power_w += np.bincount(rows["last_object"], rows["power_w"], count.size)
    rows = _sample(chunks(), count)
    shadow = [
        _shadows(obstacles, rows, column, image, record.matrix_world, elements)
        for column, image, record, elements in (
            ("first_scatterer_m", "receiver_image", receiver, [one.rx for one in channels]),
            ("last_scatterer_m", "transmitter_image", transmitter, [one.tx for one in channels]),
        )
    ]
    number, taken_w = rows["last_object"], rows["power_w"]
    sampled_w = np.bincount(number, taken_w, count.size)
    weight = np.divide(power_w, sampled_w, out=np.zeros(count.size), where=sampled_w > 0)
    worst, most, of_objects = 0.0, 0, np.zeros(count.size)
    for pair in itertools.product(*shadow):
        hidden = np.flatnonzero(pair[0] | pair[1])
        hidden_w = weight * np.bincount(number[hidden], taken_w[hidden], count.size)
        whole = float(hidden_w.sum() / max(power_w.sum(), 1e-300))
        if whole > worst:
            worst, most = whole, int(hidden_w.argmax())
        fraction = np.divide(hidden_w, power_w, out=np.zeros(count.size), where=power_w > 0)
        of_objects = np.maximum(of_objects, fraction)
    judged = np.flatnonzero((of_objects > 0) & (count >= _FEWEST))
    return HiddenPower(
        worst,
        names[most - 1] if most else "",
        {names[n - 1]: float(of_objects[n]) for n in judged.tolist() if n},
    )


def _sample(chunks: Iterable[PathRows], count: Real) -> PathRows:
    """Return rows of each object at random: by order, they would fall into step with pixels."""
    limit = max(_OF_OBJECT, _ROWS // max(int(np.count_nonzero(count)), 1))
    part, rng, taken = limit / np.maximum(count, 1), np.random.default_rng(0), []
    for rows in chunks:
        chosen = np.flatnonzero(rng.random(rows.size) < part[rows["last_object"]])
        names = _COLUMNS + (_IMAGES if has_images(rows) else ())
        taken.append(rows.chosen(chosen, *names))
    return PathRows.joined(taken or [PathRows.zeros(0)])


def _shadows(
    obstacles: Obstacles, rows: PathRows, column: str, image: str,
    pose: Sequence[Sequence[float]], elements: Sequence[Element],
) -> list[Mask]:  # fmt: skip
    """Return for the outermost elements of an antenna which ways from rows they do not see."""
    at = np.asarray(pose, dtype=np.float64)
    axes = at[:3, :3] / np.linalg.norm(at[:3, :3], axis=0)
    straight = are_finite(rows[column]) & (rows["power_w"] > 0)
    if has_images(rows):
        straight &= rows[image] == 0
    asked, found = np.flatnonzero(straight), []

    def of_blocked(mine: Indices, place_m: Real) -> Mask:
        points_m = rows[column][mine]
        return obstacles.opaque_between(points_m, np.broadcast_to(place_m, points_m.shape))

    for place_m in _outermost(np.array([one.position_m for one in elements])):
        mine = asked if place_m.any() else asked[:0]
        mine = mine[of_blocked(mine, at[:3, 3] + axes @ place_m)]
        mine = mine[~of_blocked(mine, at[:3, 3])]
        found.append(np.isin(np.arange(rows.size), mine))
    return found


def _outermost(places_m: Real) -> Real:
    """Return the places that lie farthest in each of the 26 directions of a cube."""
    directions = np.array(list(itertools.product((-1, 0, 1), repeat=3)))
    return np.asarray(places_m[np.unique((directions @ places_m.T).argmax(axis=1))])
