# SPDX-License-Identifier: GPL-3.0-or-later
"""Lengths of paths between the elements of a channel, from those between the antennas' origins.

    l_ij = l - |rx - P_first| - |P_last - tx| + |rx_j - P_first| + |P_last - tx_i|

at every moment, spherical wavefronts included. The differences are formed without cancellation, so
that the length keeps the digits of the path's own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...array_types import Real
from ...errors import ConfigError
from ..motion import (
    AntennaMotion,
    JoinedMotion,
    KinematicMotion,
    LinearMotion,
    PathImages,
    PathMotion,
    Rows,
    axes_of,
    join_motion,
    leg_change,
    places_m,
)
from ..radar import Channel, Element
from .paths import Paths

#: Rows times times that are computed at once: 12 MB for each array of vectors.
_BLOCK = 1 << 19


@dataclass(frozen=True)
class ChannelMotion:
    """`PathMotion` of paths between two elements (`channel`) of the antennas.

    `reference` is between the antennas' origins, whose motion is `antennas`; the vertices at t are
    (n, 3) [m]; `images` are those over which the paths go.
    """

    reference: PathMotion
    channel: Channel
    antennas: AntennaMotion
    first_scatterer_m: Real
    last_scatterer_m: Real
    images: PathImages | None = None

    @property
    def moving(self) -> NDArray[np.bool_]:
        """See `PathMotion`."""
        turns = (self.antennas.receiver.moving and self.channel.rx.displaced) or (
            self.antennas.transmitter.moving and self.channel.tx.displaced
        )
        return np.asarray(self.reference.moving | self.moving_vertices.any(axis=-1) | turns)

    @property
    def moving_vertices(self) -> NDArray[np.bool_]:
        """See `PathMotion`."""
        return self.reference.moving_vertices

    @property
    def scatterers_move(self) -> NDArray[np.bool_]:
        """See `PathMotion`."""
        return self.reference.scatterers_move

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        """See `PathMotion`."""
        lengths = np.array(self.reference.lengths_m(times_s, rows))
        index = np.arange(self.first_scatterer_m.shape[0])[rows]
        step = max(1, _BLOCK // max(np.size(times_s), 1))
        for end, element in enumerate((self.channel.rx, self.channel.tx)):
            for start in range(0, index.size if element.displaced else 0, step):
                part = slice(start, start + step)
                lengths[part] += self._leg_change(times_s, index[part], end, element)
        return lengths

    def _leg_change(
        self, times_s: Real, rows: NDArray[np.intp], end: int, element: Element
    ) -> Real:
        """Length of a leg to the element less that to the origin, (rows, times) [m]."""
        body = (self.antennas.receiver, self.antennas.transmitter)[end]
        points = (self.first_scatterer_m, self.last_scatterer_m)[end][rows]
        offset_m = axes_of(body, times_s) @ np.asarray(element.position_m)
        moved = self.reference.displacements_m(times_s, rows, end, points)
        if self.images is not None:
            images = self.images.select(rows)
            points, moved = images.unfolded(end, points), images.unturned(end, moved)
        arm = points[:, None] + moved
        arm = arm - places_m(body, times_s)
        if end == 0 and self.antennas.orthographic:
            # rays along the boresight: a plane wavefront
            return np.broadcast_to(
                np.einsum("ti,ti->t", offset_m, axes_of(body, times_s)[:, :, 2]), arm.shape[:2]
            )
        flat = np.broadcast_to(-offset_m, arm.shape).reshape(-1, 1, 3)
        return leg_change(arm.reshape(-1, 3), flat).reshape(arm.shape[:2])

    def displacements_m(self, times_s: Real, rows: Rows, end: int, points_m: Real) -> Real:
        """See `PathMotion`."""
        return self.reference.displacements_m(times_s, rows, end, points_m)

    def select(self, rows: Rows) -> ChannelMotion:
        """See `PathMotion`."""
        return ChannelMotion(
            self.reference.select(rows),
            self.channel,
            self.antennas,
            self.first_scatterer_m[rows],
            self.last_scatterer_m[rows],
            None if self.images is None else self.images.select(rows),
        )


def channel_lengths(
    paths: Paths, channel: Channel, antennas: AntennaMotion | None = None
) -> PathMotion:
    """Return the lengths over a burst of paths between the elements of a channel.

    Parameters
    ----------
    paths
        n paths between the antennas' origins.
    channel
        Elements; at the origins the lengths are those of the paths.
    antennas
        Motion of the antennas; needed where an element is away from its origin.

    Returns
    -------
    PathMotion
        Of n paths.

    Raises
    ------
    ConfigError
        An element is away from the origin and a vertex, its motion, or the antennas are unknown.
    """
    if not channel.displaced:
        return paths.lengths
    if antennas is None:
        raise ConfigError(
            "Elements away from the antenna's origin need the antennas' poses, which are unknown. "
            "Give them: antennas=scattering.antenna_motion(receiver, transmitter)."
        )
    geometry = paths.geometry
    known = np.zeros(len(paths), dtype=bool)
    if geometry is not None:
        known = np.ones(len(paths), dtype=bool)
        if channel.rx.displaced:
            known &= np.isfinite(geometry.first_scatterer_m).all(axis=-1)
        if channel.tx.displaced:
            known &= np.isfinite(geometry.last_scatterer_m).all(axis=-1)
    if geometry is None or not known.all():
        raise ConfigError(
            f"{np.count_nonzero(~known)} of {len(paths)} paths have no known first or last "
            "scatterer, so that their lengths to displaced antenna elements cannot be computed. "
            "Measure by paths, or leave those paths out."
        )
    lengths, start, found = paths.lengths, 0, []
    for part in lengths.parts if isinstance(lengths, JoinedMotion) else (lengths,):
        if isinstance(part, LinearMotion) and part.moving.any():
            raise ConfigError(
                f"{np.count_nonzero(part.moving)} paths move at a range rate alone, so that their "
                "lengths to displaced antenna elements are not known. Measure by paths, with "
                "motion."
            )
        rows = slice(start, start + part.moving.size)
        first, last = geometry.first_scatterer_m[rows], geometry.last_scatterer_m[rows]
        if isinstance(part, KinematicMotion):
            # of a surface's speckle the length is over its scatterers
            first, last = part.first_scatterer_m, part.last_scatterer_m
        images = None if geometry.images is None else geometry.images.select(rows)
        found.append(ChannelMotion(part, channel, antennas, first, last, images))
        start = rows.stop
    return join_motion(found)
