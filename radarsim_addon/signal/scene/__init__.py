# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene that a radar measures, without Blender: what its surfaces are.

`surface` says what a material is at the carrier, as numbers that are read once, and what follows
from them: whether it mirrors, how wide its lobes are, what passes it.
"""

from .surface import (
    SHARP,
    SMOOTH_BELOW,
    Clutter,
    Kind,
    RoughSurface,
    ScatteredLobe,
    Shader,
    Surface,
    is_conductor,
)

__all__ = [
    "SHARP",
    "SMOOTH_BELOW",
    "Clutter",
    "Kind",
    "RoughSurface",
    "ScatteredLobe",
    "Shader",
    "Surface",
    "is_conductor",
]
