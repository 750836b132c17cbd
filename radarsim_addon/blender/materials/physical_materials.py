# SPDX-License-Identifier: GPL-3.0-or-later
"""Physical materials: a medium of the library and a rough surface, stored in the material.

The user's values are custom properties of the material, in SI units and float64. They are available
in each Blender, with and without the add-on, and survive saving and appending:

=================================  =================================================================
``radarsim_medium``                name of the model in `physics.materials` ("concrete", "index"...)
``radarsim_medium_<parameter>``    parameters of the model, by name
``radarsim_medium_path``           CSV file of the model "table"
``radarsim_rms_height_m``          RMS height h of the surface [m]
``radarsim_correlation_length_m``  correlation length l of a Gaussian surface [m]
``radarsim_rms_slope``             RMS slope m, if h and l do not give it by m = sqrt(2) h/l
``radarsim_sheet_thickness_m``     thickness of a thin pane that is modelled as one face [m]
=================================  =================================================================

Any material can have the three properties of the surface; `surface_of` reads them.
`update_material` computes the index n + jk at the carrier from the medium when the carrier changes
and when a run starts.
"""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterable
from typing import Any

import bpy
import numpy as np

from ...errors import ConfigError, RadarSimError
from ...findings import Finding, finding
from ...physics.checks import real_array
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ...physics.materials import TABLE, material_model
from ...physics.rough import cycles_roughness, slope_from_roughness
from ...physics.rough_transmission import transmission_factors
from ..nodes.group_search import find_group, group_input, group_node, holds_group
from ..nodes.groups import KIND_PROPERTY, ensure_group
from ..nodes.materials import is_conductor, link_group
from ..nodes.physical_material import (
    EXTINCTION,
    GRAZING_TRANSMISSION,
    INDEX,
    KIND,
    ROUGHNESS,
    SMOOTH_BELOW,
    TRANSMISSION,
)
from ..nodes.sheet import KIND as SHEET_KIND
from ..nodes.sheet import THICKNESS
from ..state import SettingsRestorer
from .assignments import slot_materials
from .medium import Medium, Surface

MEDIUM = "radarsim_medium"
PARAMETER_PREFIX = "radarsim_medium_"
PATH = "radarsim_medium_path"
RMS_HEIGHT = "radarsim_rms_height_m"
CORRELATION_LENGTH = "radarsim_correlation_length_m"
RMS_SLOPE = "radarsim_rms_slope"
SHEET_THICKNESS = "radarsim_sheet_thickness_m"

EXACT_FACETS = bpy.app.version >= (5, 0, 0)
"""Whether Cycles evaluates Fresnel's equations at each facet; see `ATTR_FACET_FRESNEL`."""


# -- reading and writing ---------------------------------------------------------------------------


def medium_of(material: Any) -> Medium | None:
    """Return the medium of a material; None for a simple or foreign one."""
    name = material.get(MEDIUM)
    if not isinstance(name, str) or not name:
        return None
    if name == TABLE:
        return Medium(name, {}, str(material.get(PATH, "")))
    parameters = {}
    for parameter in material_model(name).parameters:
        value = material.get(PARAMETER_PREFIX + parameter.name)
        if value is not None:
            parameters[parameter.name] = float(value)
    return Medium(name, parameters)


def surface_of(material: Any) -> Surface | None:
    """Return the surface of a material.

    Parameters
    ----------
    material : bpy.types.Material or None

    Returns
    -------
    Surface or None
        None if all three properties are missing. Without a slope, that of the Roughness of a Radar
        Material is used.
    """
    keys = (RMS_HEIGHT, CORRELATION_LENGTH, RMS_SLOPE)
    if material is None:
        return None
    values = [float(material.get(key, 0.0)) for key in keys]
    if not any(value > 0 for value in values):
        return None
    surface = Surface(*values)
    roughness = group_input(material, ROUGHNESS)
    if surface.slope == 0 and roughness is not None:
        slope = float(slope_from_roughness(roughness.default_value))
        return Surface(surface.rms_height_m, surface.correlation_length_m, slope)
    return surface


def is_physical(material: Any) -> bool:
    """Return whether a material has one of the physical groups: the material's, or the sheet's.

    Parameters
    ----------
    material : bpy.types.Material or None

    Returns
    -------
    bool
        False for None.
    """
    return _kind_of(material) in (KIND, SHEET_KIND)


def has_rough_facets(material: Any) -> bool:
    """Return whether a material has facets whose channels Cycles rounds separately.

    Parameters
    ----------
    material : bpy.types.Material or None

    Returns
    -------
    bool
        Then from order 2 on the world should encode the range.
    """
    if not EXACT_FACETS or _kind_of(material) != KIND:
        return False
    socket, surface = group_input(material, ROUGHNESS), surface_of(material)
    return (
        socket is None
        or socket.default_value > SMOOTH_BELOW
        or (surface is not None and surface.slope > 0)
    )


def is_sheet(material: Any) -> bool:
    """Return whether a material is a thin pane with interference."""
    return _kind_of(material) == SHEET_KIND


def _kind_of(material: Any) -> str | None:
    """Return the kind of the radarsim group of a material; None without a group."""
    node = group_node(material)
    return None if node is None else node.node_tree.get(KIND_PROPERTY)


def make_physical_material(
    name: str,
    medium: str,
    *,
    carrier_hz: float,
    rms_height_m: float = 0.0,
    correlation_length_m: float = 0.0,
    rms_slope: float = 0.0,
    path: str | None = None,
    penetrable: bool | None = None,
    sheet_thickness_m: float = 0.0,
    **parameters: float,
) -> Any:
    """Make a material from a medium of the library and a rough or smooth surface.

    Parameters
    ----------
    name
        Name of the data-block. Blender adds a number if it is in use.
    medium, path, parameters
        As in `physics.materials.material`.
    carrier_hz
        Carrier for the first evaluation [Hz]. A run evaluates the medium at its own carrier.
    rms_height_m, correlation_length_m, rms_slope
        Surface. All 0: smooth.
    penetrable
        Link the interior. None: yes, unless the medium is a conductor at this carrier.
    sheet_thickness_m
        Above 0: a thin pane of smooth faces, modelled as one face with interference [m].

    Returns
    -------
    bpy.types.Material

    Raises
    ------
    ConfigError
        Unknown medium or parameter, carrier outside the band, or slope too steep.
    """
    numbers = {
        RMS_HEIGHT: rms_height_m,
        CORRELATION_LENGTH: correlation_length_m,
        RMS_SLOPE: rms_slope,
        SHEET_THICKNESS: sheet_thickness_m,
    }
    for key, value in {**numbers, **parameters}.items():
        if np.ndim(value):
            raise ConfigError(f"{key} is {value!r}; expected one number.")
    for key, value in numbers.items():
        real_array(key.removeprefix("radarsim_"), value, minimum=0.0)
    if not isinstance(name, str):
        raise ConfigError(f"The name of a material is {name!r}; expected text.")
    index = Medium(medium, parameters, path).index(carrier_hz)
    material = bpy.data.materials.new(name)
    material[MEDIUM] = medium
    if path is not None:
        material[PATH] = path
    for key, value in parameters.items():
        material[PARAMETER_PREFIX + key] = float(value)
    for key, value in numbers.items():
        if value > 0:
            material[key] = float(value)
    try:
        make_physical(material, not is_conductor(index) if penetrable is None else penetrable)
        update_material(material, carrier_hz)
    except BaseException:
        bpy.data.materials.remove(material)
        raise
    return material


def make_physical(material: Any, penetrable: bool = True) -> None:
    """Replace the nodes of a material by the physical group; with a thickness, by the sheet's."""
    if float(material.get(SHEET_THICKNESS, 0.0)) > 0:
        link_group(material, ensure_group(SHEET_KIND), False)
    else:
        link_group(material, ensure_group(KIND), penetrable)


# -- values at a carrier ---------------------------------------------------------------------------


def inputs_at(material: Any, carrier_hz: float, beyond_band: str = "hold") -> dict[str, float]:
    """Return the group's inputs at a carrier by socket name. A ConfigError names the material."""
    medium = medium_of(material)
    if medium is None:
        return {}
    try:
        index = medium.index(carrier_hz, beyond_band)
        if is_sheet(material):
            wavelengths = float(material.get(SHEET_THICKNESS, 0.0)) * carrier_hz
            thickness = wavelengths / SPEED_OF_LIGHT_MPS
            return {INDEX: index.real, EXTINCTION: index.imag, THICKNESS: thickness}
        slope = (surface_of(material) or Surface()).slope
        roughness = float(cycles_roughness(slope))
        through, through_grazing = 1.0, 1.0
        if not is_conductor(index):
            through, through_grazing = transmission_factors(index, slope, EXACT_FACETS)
    except RadarSimError as error:
        raise ConfigError(f"Material {material.name!r}: {error}") from error
    return {
        INDEX: index.real,
        EXTINCTION: index.imag,
        ROUGHNESS: roughness,
        TRANSMISSION: through,
        GRAZING_TRANSMISSION: through_grazing,
    }


def update_material(material: Any, carrier_hz: float, beyond_band: str = "hold") -> None:
    """Set the inputs of a physical material for a carrier; linked sockets do not change.

    Raises ConfigError as `inputs_at`, or for a linked file with a group of an older radarsim.
    """
    for socket, value in _inputs_to_set(material, carrier_hz, beyond_band):
        _put(socket, value, None)


def _put(socket: Any, value: float, recorder: SettingsRestorer | None) -> None:
    if recorder is not None:
        recorder.set(socket, "default_value", value)
    elif socket.default_value != value:
        socket.default_value = value


def _inputs_to_set(material: Any, carrier_hz: float, beyond_band: str) -> list[tuple[Any, float]]:
    """Return the sockets of a physical material and their values at a carrier."""
    node = group_node(material)
    if node is None or not is_physical(material):
        return []
    found = []
    for name, value in inputs_at(material, carrier_hz, beyond_band).items():
        if node.inputs.get(name) is None:
            library = material.library
            where = "this file" if library is None else repr(library.filepath)
            raise ConfigError(
                f"Material {material.name!r}: its node group {node.node_tree.name!r} is from "
                f"another radarsim and has no input {name!r}. Open {where} with this radarsim and "
                "save it, or append the material instead of linking it."
            )
        socket = group_input(material, name)
        if socket is not None:
            found.append((socket, value))
    return found


def update_materials(
    carrier_hz: float,
    recorder: SettingsRestorer | None = None,
    assigned: Collection[Any] | None = None,
    beyond_band: str = "hold",
) -> list[Finding]:
    """Evaluate all physical materials of the file at a carrier.

    Materials that are linked from another file are set in memory; that file is not changed.

    Parameters
    ----------
    carrier_hz
        Carrier [Hz].
    recorder
        Records the changes. None: they are permanent.
    assigned
        Materials of rendered objects. None: those in the slots of all objects of the file.
    beyond_band
        What a medium does outside its band.

    Returns
    -------
    list of Finding
        Assigned materials with a medium that keep their numbers, because their group is not at
        the output. Others that cannot be evaluated keep theirs, too, and change no result.

    Raises
    ------
    ConfigError
        A material of a rendered object cannot be evaluated, or two of them use one node group with
        different numbers.
    """
    if assigned is None:
        assigned = _in_slots(bpy.data.objects)
    findings = []
    owners: dict[int, tuple[Any, float]] = {}
    # Assigned materials are first: their numbers have priority in a common node group.
    for material in sorted(bpy.data.materials, key=lambda m: (m not in assigned, m.name_full)):
        try:
            for socket, value in _inputs_to_set(material, carrier_hz, beyond_band):
                other, before = owners.setdefault(socket.as_pointer(), (material, value))
                if value != before:
                    raise ConfigError(_shared(other, material))
                _put(socket, value, recorder)
        except ConfigError:
            if material in assigned:
                raise
        if material in assigned and _keeps_numbers(material):
            findings.append(finding("medium-not-connected", material.name))
    return findings


def _shared(first: Any, second: Any) -> str:
    found = find_group(second)
    nested = found is not None and bool(found.enclosing)
    tree = found.enclosing[-1].node_tree if found and nested else second.node_tree
    return (
        f"Materials {first.name!r} and {second.name!r} need different numbers in the node group "
        f"{tree.name!r}, which both use. Make it a single-user copy in one of them, or connect the "
        "inputs of the Radar Material to inputs of the group."
    )


def _keeps_numbers(material: Any) -> bool:
    """Return whether a material with a medium has our group, but not at its output."""
    return (
        material.node_tree is not None
        and medium_of(material) is not None
        and find_group(material) is None
        and holds_group(material.node_tree)
    )


def refresh_materials(carrier_hz: float, beyond_band: str = "hold") -> None:
    """Evaluate all physical materials; one that cannot be evaluated keeps its numbers.

    Parameters
    ----------
    carrier_hz
        Carrier [Hz].
    beyond_band
        What a medium does outside its band.
    """
    for material in bpy.data.materials:
        with contextlib.suppress(ConfigError):
            update_material(material, carrier_hz, beyond_band)


def _in_slots(objects: Iterable[Any]) -> set[Any]:
    return {
        material
        for item in objects
        if not item.hide_render
        for material in slot_materials(item)
        if material is not None
    }
