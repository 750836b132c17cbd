# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface for scripts: materials. See :mod:`.scripting`."""

from __future__ import annotations

import atexit
from collections.abc import Iterable
from typing import Any

import bpy

from ...errors import ConfigError, SceneError
from ..materials import (  # noqa: F401
    make_physical_material,
    set_clutter,
    set_clutter_fluctuation,
    set_mirror,
    set_scattered_lobe,
)
from ..nodes import assign_to
from ..rig_settings import RADAR_PROPERTY, carrier_hz, register, unregister
from ..scene import replace_material, suggest_materials
from ..state import evaluated_depsgraph


def ensure_registered() -> None:
    """Register the settings of radars and materials, unless the extension has done so."""
    # The extension, where it is enabled, has registered the settings already.
    if not hasattr(bpy.types.Object, RADAR_PROPERTY):
        register()
        # Blender 4.5 as a module hangs at exit with properties that have functions of Python.
        atexit.register(unregister)


def material(
    medium: str | None = None,
    *,
    name: str | None = None,
    n: float | None = None,
    kappa: float = 0.0,
    rms_height_m: float = 0.0,
    correlation_length_m: float = 0.0,
    rms_slope: float = 0.0,
    sheet_thickness_m: float = 0.0,
    **parameters: Any,
) -> Any:
    """Make a radar material from a medium of the library or from a complex index.

    Parameters
    ----------
    medium
        Name of a medium, such as "concrete" or "itu_concrete"; its index follows the carrier.
    name
        Name of the material in Blender; None: that of the medium.
    n, kappa
        Complex index of refraction n + j kappa, in place of a medium; kappa is 0 or positive.
    rms_height_m, correlation_length_m, rms_slope
        Roughness of the surface [m, m, 1]; all 0: smooth.
    sheet_thickness_m
        More than 0: a thin pane, one face with interference [m].
    **parameters
        Parameters of the medium, such as ``temperature_c``.

    Returns
    -------
    bpy.types.Material

    Raises
    ------
    ConfigError
        Neither or both of medium and n, an unknown medium or parameter, a number out of bounds.
    """
    if (medium is None) == (n is None):
        raise ConfigError("A material needs a medium or n (with kappa), and not both.")
    if medium is None:
        medium, parameters = "index", {"n": n, "k": kappa, **parameters}
    elif not isinstance(medium, str):
        raise ConfigError(
            f"Medium is {medium!r}; expected a name, such as 'concrete'. Give an index as n=2.5."
        )
    elif kappa:
        raise ConfigError(
            f"kappa is {kappa!r}, but the medium {medium!r} has its own. Leave out kappa, or give "
            "n in place of the medium."
        )
    known = medium.removeprefix("itu_")  # of Recommendation ITU-R P.2040
    ensure_registered()
    return make_physical_material(
        name or f"Radar {known.replace('_', ' ')}",
        known,
        carrier_hz=carrier_hz(bpy.context.scene),
        rms_height_m=rms_height_m,
        correlation_length_m=correlation_length_m,
        rms_slope=rms_slope,
        sheet_thickness_m=sheet_thickness_m,
        **parameters,
    )


def assign_material(objects: Any, material: Any) -> list[Any]:
    """Give objects a material, in all their material slots.

    Parameters
    ----------
    objects : bpy.types.Object or iterable of them
        Objects that cannot carry a material are passed over.
    material : bpy.types.Material

    Returns
    -------
    list of bpy.types.Object : those that have the material now

    Raises
    ------
    SceneError
        None of the objects can carry a material.
    """
    if not isinstance(material, bpy.types.Material):
        raise SceneError(f"{material!r} is no material; expected what radarsim.material returns.")
    chosen = [objects] if isinstance(objects, bpy.types.Object) else objects
    if isinstance(chosen, str) or not isinstance(chosen, Iterable):
        raise SceneError(f"{objects!r} is no object; expected objects of the scene.")
    return assign_to(chosen, material)


def assign_by_name(scene: Any = None) -> dict[str, str]:
    """Put radar materials in the place of the optical ones whose names are known.

    Parameters
    ----------
    scene : bpy.types.Scene, optional
        None: the current one.

    Returns
    -------
    dict of str
        Radar material by optical material; the others are as they were.
    """
    ensure_registered()
    scene = bpy.context.scene if scene is None else scene
    layer = scene.view_layers[0]
    taken = {}
    for material, ready in suggest_materials(evaluated_depsgraph(layer)).items():
        if ready:
            replace_material(material, ready, carrier_hz(scene), evaluated_depsgraph(layer))
            taken[material.name] = ready
    return taken
