# SPDX-License-Identifier: GPL-3.0-or-later
"""How far below its strongest echo a map is to be trusted."""

from __future__ import annotations

import math

#: Below the strongest cell by more than this is rounding, not an echo: float32 renders. Less where
#: the tolerance of the synthesis is coarse [dB].
MAP_DYNAMICS_DB = 160.0


def dynamics_db(tolerance: float) -> float:
    """How far below the strongest cell an echo can be told from the error of the synthesis [dB]."""
    return min(MAP_DYNAMICS_DB, 20 - 20 * math.log10(tolerance))
