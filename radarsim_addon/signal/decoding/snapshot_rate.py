# SPDX-License-Identifier: GPL-3.0-or-later
"""Range rate per pixel from two snapshots (Eq. 12 of the paper, with this project's sign).

    v = (r(t + dt) - r(t)) / dt,      f_D = -2 v / lambda

v is positive when the range grows: a receding target has negative Doppler and stands on the left
of a map, as in the paper's Fig. 9; Eq. 12 as printed has the other sign.

Differencing along a fixed ray gives the range rate of the material only where the surface moves
along the ray: a sphere spinning in place reads zero, and so does flat ground below a moving radar.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...array_types import Mask, Real
from ...errors import ConfigError
from ..paths import Flags, PathFlag
from .ring_pixels import Decoded

#: Default limit of a believable |range rate| [m/s]. Above it, the pixel saw another surface in the
#: second snapshot: the background appearing behind a target's edge.
MAX_RANGE_RATE_MPS = 300.0


def range_rate(
    first: Decoded,
    second: Decoded,
    snapshot_interval_s: float,
    neighbours: Sequence[tuple[Decoded, Decoded]] = (),
    max_range_rate_mps: float = MAX_RANGE_RATE_MPS,
) -> tuple[Real, Flags]:
    """Compute the range rate of every pixel of one ring (Eq. 12).

    Parameters
    ----------
    first, second
        The ring at t and at t + delta t.
    snapshot_interval_s
        Time between the snapshots [s].
    neighbours
        The rings before and behind, each at both times. An echo that has none of its own ring in
        the second snapshot (or an unbelievable one) is looked for there, among echoes that were not
        there at t.
    max_range_rate_mps
        Largest |range rate| that is accepted [m/s].

    Returns
    -------
    rate_mps, flags
        Arrays (height, width). The rate is positive when receding, and 0 where a flag says that
        it is unknown (`PathFlag.SINGLE_SNAPSHOT`, `PathFlag.RANGE_RATE_REJECTED`); such echoes
        count as stationary.

    Raises
    ------
    ConfigError
        The time or the limit is not positive.
    """
    if not snapshot_interval_s > 0:
        raise ConfigError(
            f"Time between the snapshots is {snapshot_interval_s!r} s; expected a positive time."
        )
    if not max_range_rate_mps > 0:
        raise ConfigError(f"Speed limit is {max_range_rate_mps!r} m/s; expected a positive number.")
    limit_m = max_range_rate_mps * snapshot_interval_s
    start = first.range_m
    step = np.full(start.shape, np.inf)
    same = first.mask & second.mask
    step[same] = (second.range_m - start)[same]
    unsure: Mask = first.mask & (np.abs(step) > limit_m)
    nearest = np.full(start.shape, np.inf)
    for before, after in neighbours:
        arrived = unsure & after.mask & ~before.mask
        candidate = np.where(arrived, after.range_m - start, np.inf)
        nearest = np.where(np.abs(candidate) < np.abs(nearest), candidate, nearest)
    crossed = unsure & (np.abs(nearest) <= limit_m)
    step[crossed] = nearest[crossed]

    seen = same | np.isfinite(nearest)
    flags = np.zeros(start.shape, dtype=np.uint16)
    flags[crossed] |= PathFlag.CROSSED_SHELL
    flags[first.mask & ~seen] |= PathFlag.SINGLE_SNAPSHOT
    flags[first.mask & seen & (np.abs(step) > limit_m)] |= PathFlag.RANGE_RATE_REJECTED
    known = first.mask & (np.abs(step) <= limit_m)
    rate = np.zeros(start.shape)
    rate[known] = step[known] / snapshot_interval_s
    return rate, flags
