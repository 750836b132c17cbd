# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the models of a material do not hold: bands of media, and Kirchhoff's surfaces."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from typing import Any

import bpy

from ...errors import ConfigError
from ...findings import Finding, finding
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ...physics.rough import kirchhoff_limits
from .physical_materials import MEDIUM, is_physical, medium_of, surface_of


def _beyond_its_band(material: Any, carrier_hz: float, beyond_band: str = "hold") -> list[Finding]:
    """Find that a physical material is used outside the band of its medium."""
    medium = medium_of(material) if is_physical(material) else None
    if medium is None or beyond_band == "refuse":
        return []
    found = medium.model.out_of_band(carrier_hz, **medium.parameters)
    if found is None:
        return []
    return [
        finding(
            "medium-beyond-band",
            material.name,
            carrier_hz=carrier_hz,
            medium=medium.name,
            band=medium.model.band_text,
            edge_hz=found.edge_hz,
            beyond_band=beyond_band,
            reflection_db=found.reflection_db,
            absorption_ratio=found.absorption_ratio,
            error_class=found.error_class,
        )
    ]


def media_beyond_their_band(
    carrier_hz: float, beyond_band: str = "hold", materials: Iterable[Any] | None = None
) -> list[Finding]:
    """Find the physical materials whose medium is not defined at a carrier.

    Parameters
    ----------
    carrier_hz
        Carrier [Hz].
    beyond_band
        What a medium does outside its band.
    materials
        Materials of rendered objects. None: those of the file that are used.

    Returns
    -------
    list of Finding
        One for each material; the panel and the run tell unknown media.
    """
    found = []
    if materials is None:
        materials = [item for item in bpy.data.materials if item.users > item.use_fake_user]
    for material in materials:
        if MEDIUM in material:
            with contextlib.suppress(ConfigError):
                found += _beyond_its_band(material, carrier_hz, beyond_band)
    return found


def limits_of(material: Any, carrier_hz: float) -> tuple[Finding, ...]:
    """Find why the model of a material's rough surface does not hold at a carrier."""
    surface = surface_of(material)
    if surface is None or surface.rms_height_m == 0 or surface.correlation_length == 0:
        return ()
    found = kirchhoff_limits(
        surface.rms_height_m, surface.correlation_length, SPEED_OF_LIGHT_MPS / carrier_hz
    )
    return tuple(item.about(material.name) for item in found)
