# SPDX-License-Identifier: GPL-3.0-or-later
"""Dynamic range of a map: levels further below its strongest echo are errors."""

from __future__ import annotations

import math

#: Levels further below the strongest cell are rounding of float32 renders [dB]. The range is
#: smaller with a coarse tolerance of the synthesis.
MAP_DYNAMICS_DB = 160.0


def dynamics_db(tolerance: float) -> float:
    """Return how far below the strongest cell an echo exceeds the error of the synthesis.

    Parameters
    ----------
    tolerance
        Relative L2 error of the echoes' spectrum.

    Returns
    -------
    float
        Dynamic range [dB], at most `MAP_DYNAMICS_DB`.
    """
    return min(MAP_DYNAMICS_DB, 20 - 20 * math.log10(tolerance))
