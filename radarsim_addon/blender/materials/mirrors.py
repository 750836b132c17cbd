# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials that are mirrors at the carrier: what they reflect, read from their inputs.

Widths of lobes are alpha of a Beckmann lobe, sqrt(2) times the RMS slope: infinite for a Lambert
surface, 0 for a mirror and where the width is not known.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any

import bpy

from ...errors import ConfigError, SceneError
from ...physics.mirrors import MirrorMaterial
from ..nodes.groups import KIND_PROPERTY, group_input, group_kind, group_node
from ..nodes.physical_material import PHYSICAL_KIND, SHEET_KIND, SMOOTH_BELOW, THICKNESS
from ..nodes.radar_material import EXTINCTION, INDEX, KIND, ROUGHNESS, SPECULARITY
from .clutter import clutter_of
from .physical_materials import inputs_at, surface_of

#: Roughness up to which Cycles takes a lobe for a mirror, and finds no Point light in it.
SHARP = 0.0037
#: Index from which on a surface reflects all power at all angles but the most grazing.
_METAL = 1000.0
#: If a Principled BSDF has a lower albedo or metallic part, most of the echo of a sphere comes from
#: its specular lobe.
_DARK = 0.2
#: Glossy BSDFs of one lobe that depends on both directions alike.
_RECIPROCAL = {"ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfGlossy", "ShaderNodeBsdfMetallic"}
#: Custom property of a material: exponent of its scattered lobe.
LOBE_EXPONENT = "radarsim_lobe_exponent"
#: BSDFs with a reflecting lobe of their Roughness.
_GLOSSY = {
    "ShaderNodeBsdfAnisotropic",
    "ShaderNodeBsdfGlass",
    "ShaderNodeBsdfGlossy",
    "ShaderNodeBsdfMetallic",
}


def mirror_of(material: Any) -> MirrorMaterial | None:
    """Return the mirror properties of a Radar Material, with its inputs set for the carrier.

    None if the material is too rough, has no specular part, or has an input that a node sets: the
    mirror may then vary over the surface.
    """
    kind = group_kind(material)
    if kind not in (KIND, PHYSICAL_KIND, SHEET_KIND):
        return None
    third = THICKNESS if kind == SHEET_KIND else ROUGHNESS
    sockets = (group_input(material, name) for name in (INDEX, EXTINCTION, third))
    values = [float(socket.default_value) for socket in sockets if socket is not None]
    if len(values) < 3:
        return None
    n, kappa, roughness = values
    if kind == SHEET_KIND:
        sheet = MirrorMaterial(complex(n, kappa), 1.0, True, sheet_wavelengths=values[2])
        return sheet if sheet.sheet_wavelengths > 0 else None
    surface = surface_of(material)
    height_m = 0.0 if surface is None else surface.rms_height_m
    if kind == PHYSICAL_KIND:
        smooth = roughness <= SMOOTH_BELOW
        return MirrorMaterial(complex(n, kappa), 1.0, True, height_m) if smooth else None
    specularity = group_input(material, SPECULARITY)
    if specularity is None or specularity.default_value <= 0 or roughness > SHARP:
        return None
    share = float(specularity.default_value)
    return MirrorMaterial(complex(n, kappa), share, False, height_m)


def ground_mirror(
    material: Any, carrier_hz: float, beyond_band: str, rms_height_m: float | None = None
) -> MirrorMaterial:
    """Return the coherent reflection of a ground at a carrier, whose material may be rough.

    The material is not changed. `rms_height_m` is in place of the material's. Raises SceneError if
    it is no Radar Material, or neither smooth nor of a known RMS height; ConfigError if the medium
    cannot be evaluated.
    """
    name = "none" if material is None else repr(material.name)
    physical = group_kind(material) == PHYSICAL_KIND
    values = inputs_at(material, carrier_hz, beyond_band) if physical else None
    if values:
        surface = surface_of(material)
        height_m = rms_height_m
        if height_m is None:
            height_m = 0.0 if surface is None else surface.rms_height_m
            if height_m == 0 and values[ROUGHNESS] > SMOOTH_BELOW:
                raise SceneError(
                    f"The ground's material {name} has a slope and no RMS height, so its coherent "
                    "reflection is unknown. Set RMS Height of the material, or --rms-height."
                )
        return MirrorMaterial(complex(values[INDEX], values[EXTINCTION]), 1.0, True, height_m)
    found = mirror_of(material)
    if found is None or found.sheet_wavelengths > 0:
        raise SceneError(
            f"The ground's material is {name}, which is no mirror with numbers of its own: "
            "expected a physical Radar Material, or a simple one with roughness 0 and Specularity "
            "above 0. Choose such a material, or name another ground by --ground."
        )
    return found if rms_height_m is None else replace(found, rms_height_m=rms_height_m)


def is_mirror_like(material: Any) -> bool:
    """Return whether a material, any, has a lobe that Cycles takes for a mirror.

    False where a node sets the roughness.
    """
    kind = group_kind(material)
    if kind is None:
        return any(map(_is_sharp, _foreign_shaders(material)))
    if kind == SHEET_KIND:
        return True
    limit = SMOOTH_BELOW if kind == PHYSICAL_KIND else SHARP
    roughness, specularity = (group_input(material, name) for name in (ROUGHNESS, SPECULARITY))
    shiny = specularity is None or specularity.default_value > 0
    return bool(shiny and roughness is not None and roughness.default_value <= limit)


def _foreign_shaders(material: Any) -> list[Any]:
    """Return the shader nodes that reach the output of a material, through mixes and groups."""
    if material is None or material.node_tree is None:
        return []
    output = material.node_tree.get_output_node("CYCLES")
    waiting = [] if output is None else [output.inputs["Surface"]]
    found: dict[int, Any] = {}
    while waiting:
        for link in waiting.pop().links:
            node = link.from_node
            if node.mute or node.as_pointer() in found:
                continue
            found[node.as_pointer()] = node
            waiting += [socket for socket in node.inputs if socket.type == "SHADER"]
            tree = getattr(node, "node_tree", None)
            if tree is not None and tree.get(KIND_PROPERTY) is None:
                ends = [one for one in tree.nodes if one.bl_idname == "NodeGroupOutput"]
                waiting += [s for one in ends for s in one.inputs if s.type == "SHADER"]
    return list(found.values())


def _is_sharp(shader: Any) -> bool:
    """Return whether a BSDF of Blender mirrors, by those of its inputs that no node sets."""

    def below(name: str) -> bool:
        socket = shader.inputs[name]
        return not socket.is_linked and float(socket.default_value) <= SHARP

    def above_0(name: str) -> bool:
        socket = shader.inputs[name]
        return socket.is_linked or float(socket.default_value) > 0

    if shader.bl_idname != "ShaderNodeBsdfPrincipled":
        return shader.bl_idname in _GLOSSY and below("Roughness")
    coated = above_0("Coat Weight") and below("Coat Roughness")
    return coated or (below("Roughness") and (above_0("Metallic") or above_0("Specular IOR Level")))


def lobe_width(material: Any) -> float:
    """Return the width of the narrowest lobe in which a material scatters."""
    width = _lobe_width(material)
    exponent = None if material is None else material.get(LOBE_EXPONENT)
    # a facet turns the mirrored wave by twice its own angle
    return width if exponent is None else min(1 / math.sqrt(exponent), width)


def glint_slope(material: Any) -> float:
    """Return the RMS slope of the narrowest lobe that can outshine the rest of a material.

    0 for diffuse surfaces, clutter models, mirrors, and where a node sets the roughness.
    """
    if group_node(material) is not None:
        width = lobe_width(material)
        return width / math.sqrt(2) if SHARP**2 < width <= 1 else 0.0
    widths = []
    for shader in _foreign_shaders(material):
        roughness = shader.inputs.get("Roughness")
        if shader.bl_idname == "ShaderNodeBsdfPrincipled":
            metallic, colour = shader.inputs["Metallic"], shader.inputs["Base Color"]
            bright = not colour.is_linked and max(colour.default_value[:3]) > _DARK
            if bright and not metallic.is_linked and metallic.default_value < _DARK:
                continue  # the diffuse part returns 16 times what the lobe does, and more
        elif shader.bl_idname not in _GLOSSY:
            continue
        if roughness is not None and not roughness.is_linked and roughness.default_value > SHARP:
            widths.append(float(roughness.default_value) ** 2)
    return min(widths, default=0.0) / math.sqrt(2)


def reciprocal_lobe(material: Any) -> float:
    """Return the width of the lobe of a material that scatters alike in both directions.

    0 also where Fresnel's equations are those of one of the two directions.
    """
    if material is not None and material.get(LOBE_EXPONENT) is not None:
        return 0.0
    kind = group_kind(material)
    if kind is None:
        return _reciprocal_shader(material)
    sockets = [group_input(material, name) for name in (INDEX, EXTINCTION, ROUGHNESS)]
    values = [float(one.default_value) for one in sockets if one is not None]
    if len(values) < len(sockets):
        return 0.0
    index, extinction, roughness = values
    if kind == PHYSICAL_KIND:
        smooth = roughness <= SMOOTH_BELOW
        if clutter_of(material) is not None:
            return math.inf if smooth else 0.0
        return 0.0 if smooth else roughness**2
    if kind != KIND or abs(complex(index, extinction)) < _METAL:
        return 0.0
    width = _lobe_width(material)
    return width if roughness > SHARP or math.isinf(width) else 0.0


def _reciprocal_shader(material: Any) -> float:
    """Return the width of such a lobe if the output of a material is one BSDF of Blender's."""
    shaders = [] if material is None else _foreign_shaders(material)
    if not shaders:
        return _foreign_lobe_width(material)
    shader = shaders[0]
    roughness, normal = (shader.inputs.get(name) for name in ("Roughness", "Normal"))
    if len(shaders) > 1 or roughness is None or (normal is not None and normal.is_linked):
        return 0.0
    if shader.bl_idname == "ShaderNodeBsdfDiffuse":
        return math.inf
    known = shader.bl_idname in _RECIPROCAL and not roughness.is_linked
    alpha = float(roughness.default_value) ** 2
    return alpha if known and roughness.default_value > SHARP else 0.0


def _lobe_width(material: Any) -> float:
    """Return the same as `lobe_width` without a scattered lobe."""
    kind = group_kind(material)
    if kind is None:
        return _foreign_lobe_width(material)
    if clutter_of(material) is not None:  # scatters by the geometric mean of both angles
        return math.inf
    specularity, roughness = (group_input(material, name) for name in (SPECULARITY, ROUGHNESS))
    if kind == KIND:
        if specularity is None:
            return 0.0
        if specularity.default_value == 0:
            return math.inf
    return 0.0 if roughness is None else float(roughness.default_value) ** 2


def _foreign_lobe_width(material: Any) -> float:
    """Return the width of the lobe if the output of a material is a Diffuse or Principled BSDF."""
    if material is None or material.node_tree is None:
        return math.inf  # Blender's default surface
    output = material.node_tree.get_output_node("CYCLES")
    links = () if output is None else output.inputs["Surface"].links
    shader = links[0].from_node if links else None
    if shader is None or shader.inputs.get("Roughness") is None:
        return 0.0
    if shader.bl_idname == "ShaderNodeBsdfDiffuse":
        return math.inf
    roughness = shader.inputs["Roughness"]
    if shader.bl_idname != "ShaderNodeBsdfPrincipled" or roughness.is_linked:
        return 0.0
    return float(roughness.default_value) ** 2


# Objects that the user has marked as mirrors, or as none.

#: Custom property of an object.
MIRROR = "radarsim_mirror"
#: Value, name and description of each choice, the first where nothing is chosen.
MIRROR_CHOICES = (
    ("auto", "Automatic", "Where it is smooth and planar, in the order of what the radar sees"),
    ("first", "First", "Before all others, if the number of mirror images does not do for all"),
    ("never", "Never", "No image of the transmitter, whatever its material"),
)
_NAMES = tuple(name for name, _, _ in MIRROR_CHOICES)


def mirror_choice(item: Any) -> str:
    """Return whether an object gets images of the transmitter: 'auto', 'first' or 'never'."""
    found = item.get(MIRROR)
    return found if found in _NAMES else _NAMES[0]


def set_mirror(item: Any, choice: str = "first") -> None:
    """Mark an object as a mirror for paths to the transmitter, or as none.

    Parameters
    ----------
    item : bpy.types.Object
        With its instances.
    choice
        'first': its smooth planar faces get images of the transmitter before those of others.
        'never': they get none. 'auto': by what the transmitter sees in them.

    Raises
    ------
    ConfigError
        Another choice.
    """
    if choice not in _NAMES:
        raise ConfigError(f"Mirror choice {choice!r}; expected one of {', '.join(_NAMES)}.")
    item[MIRROR] = choice


def set_mirrors(scene: Any, patterns: str, choice: str) -> None:
    """Mark the objects of a scene that a command line names, as `set_mirror` does.

    `patterns` are names, which may contain * and ?, separated by commas. Raises ConfigError for a
    name that no object has.
    """
    items = list(scene.objects)
    for pattern in (one.strip() for one in patterns.split(",")):
        chosen = [item for item in items if fnmatchcase(item.name, pattern)]
        if not chosen:
            raise ConfigError(
                f"No object of the scene is called {pattern!r}, which is to be a mirror "
                f"({choice}). Give names of objects; they may contain * and ?."
            )
        for item in chosen:
            set_mirror(item, choice)


def mirror_property() -> Any:
    """Return the choice as a property of objects, for the window."""

    def read(item: Any) -> int:
        return _NAMES.index(mirror_choice(item))

    def write(item: Any, number: int) -> None:
        set_mirror(item, _NAMES[number])

    return bpy.props.EnumProperty(
        name="Mirror Images",
        description="Choose whether the object gets images of the transmitter",
        items=MIRROR_CHOICES,
        get=read,
        set=write,
    )
