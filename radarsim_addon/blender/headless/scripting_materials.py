# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface for scripts: materials. See :mod:`.scripting`."""

from __future__ import annotations

import atexit
import difflib
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
from ..nodes import assign_to, make_material, preset_material
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
    penetrable: bool | None = None,
    **parameters: Any,
) -> Any:
    """Make a physical radar material from a medium of the library or from a complex index.

    The medium is evaluated at the carrier of the active radar of the current scene, without one at
    that of the paper's radar. A measurement evaluates it again, at its own carrier, so a carrier
    that is changed later, or given to :func:`measure`, needs no new material. An index given by `n`
    and `kappa` is the same at every carrier.

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
    penetrable
        Whether waves enter objects of the material, which must then be closed meshes. False: the
        surface alone reflects. None: they enter, unless the medium is a conductor at the carrier
        with which the material is made.
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
    for key in parameters:
        if near := difflib.get_close_matches(key, material.__kwdefaults__ or (), 1, 0.8):
            raise ConfigError(f"material has no argument {key!r}; did you mean {near[0]}?")
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
        penetrable=penetrable,
        **parameters,
    )


def simple_material(
    preset: str | None = None,
    *,
    name: str | None = None,
    n: float | None = None,
    kappa: float = 0.0,
    specularity: float = 0.5,
    roughness: float = 0.5,
    penetrable: bool | None = None,
) -> Any:
    """Make a simple radar material: the node group Radar Material with four inputs.

    Its index does not follow the carrier, and its roughness is no length.

    Parameters
    ----------
    preset
        Name of a ready material: "metal", "paper_object", "concrete", "ground", "wood" or "glass".
        The file's own is returned where it is unchanged.
    name
        Name of the material in Blender; None: "Radar Material".
    n, kappa
        Index n (from 1) and normalised extinction (from 0), in place of a preset.
    specularity
        Fraction of the reflected power in the specular lobe, 0 to 1.
    roughness
        Width of the specular lobe, 0 to 1, as in Blender.
    penetrable
        Whether waves enter objects of the material. None: they do, unless it is a conductor.

    Returns
    -------
    bpy.types.Material

    Raises
    ------
    ConfigError
        Neither or both of preset and n, an unknown preset, or a number out of bounds.
    """
    if (preset is None) == (n is None):
        raise ConfigError("A simple material needs a preset or n (with kappa), and not both.")
    ensure_registered()
    if n is not None:
        label = name or "Radar Material"
        return make_material(label, n, kappa, specularity, roughness, penetrable=penetrable)
    if (name, kappa, specularity, roughness, penetrable) != (None, 0.0, 0.5, 0.5, None):
        raise ConfigError("A preset has all numbers. Give n and the others in place of the preset.")
    return preset_material(str(preset))


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
