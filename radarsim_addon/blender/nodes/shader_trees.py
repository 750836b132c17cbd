# SPDX-License-Identifier: GPL-3.0-or-later
"""What Cycles makes of the shader nodes of any material: volumes, displacement, reflection.

Other rooms use these functions, or have a material read as a `Surface`. They do not follow links
between nodes themselves.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import bpy

from ..state import SettingsRestorer

_SCATTERING_NODES = {
    "ShaderNodeSubsurfaceScattering",
    "ShaderNodeVolumePrincipled",
    "ShaderNodeVolumeScatter",
}


def trees_within(tree: bpy.types.NodeTree, *, muted: bool = True) -> Iterator[Any]:
    """Yield a node tree, or None for nothing, and the groups in it, each once.

    `muted` says whether groups of muted nodes count.
    """
    waiting, met = [tree], set()
    while waiting:
        tree = waiting.pop()
        if tree is None or tree in met:
            continue
        met.add(tree)
        yield tree
        waiting += [getattr(one, "node_tree", None) for one in tree.nodes if muted or not one.mute]


def _output(material: bpy.types.Material) -> Any | None:
    """Return the output that Cycles renders; None without nodes or an empty slot (None)."""
    if material is None or material.node_tree is None:
        return None
    return material.node_tree.get_output_node("CYCLES")


def is_fog(material: bpy.types.Material) -> bool:
    """Return whether a material has a volume and no surface."""
    output = _output(material)
    return output is not None and (
        output.inputs["Volume"].is_linked and not output.inputs["Surface"].is_linked
    )


def scatters_inside(material: bpy.types.Material) -> bool:
    """Return whether a node of a material scatters light in the interior of objects."""
    for node in material.node_tree.nodes:
        if node.bl_idname in _SCATTERING_NODES:
            return True
        weight = node.inputs.get("Subsurface Weight")
        if weight is not None and (weight.is_linked or weight.default_value > 0):
            return True
    return False


def reflects(material: bpy.types.Material) -> bool:
    """Return whether a material, or Blender's own where there is none, has a reflecting shader."""
    if material is None or material.node_tree is None:
        return True
    output = _output(material)
    waiting = [] if output is None else [link.from_node for link in output.inputs["Surface"].links]
    met = set()
    while waiting:
        node = waiting.pop()
        if node in met:
            continue
        met.add(node)
        kind = node.bl_idname
        if kind == "ShaderNodeSubsurfaceScattering" or (
            kind.startswith("ShaderNodeBsdf") and kind != "ShaderNodeBsdfTransparent"
        ):
            return True
        inner = getattr(node, "node_tree", None)
        waiting += [] if inner is None else list(inner.nodes)
        waiting += [link.from_node for socket in node.inputs for link in socket.links]
    return False


def displaces(material: bpy.types.Material) -> bool:
    """Return whether a material moves the surface itself, not only its normals."""
    output = _output(material)
    return (
        output is not None
        and material.displacement_method != "BUMP"
        and bool(output.inputs["Displacement"].is_linked)
    )


def moves_faces(material: bpy.types.Material) -> bool:
    """Return whether a material may displace faces, or send rays elsewhere."""
    tree = material and material.node_tree
    return bool(tree) and (
        any(link.to_socket.name == "Displacement" for link in tree.links)
        or any(node.bl_idname == "ShaderNodeBsdfRayPortal" for node in tree.nodes)
    )


def displacing_nodes(tree: bpy.types.NodeTree) -> list[Any]:
    """Return all nodes that the displacement of a material's active outputs depends on."""
    outputs = [one for one in tree.nodes if one.type == "OUTPUT_MATERIAL" and one.is_active_output]
    found: dict[Any, None] = {}
    waiting = _before(one.inputs["Displacement"] for one in outputs)
    while waiting:
        node = waiting.pop()
        if node not in found:
            found[node] = None
            waiting += _before(node.inputs)
    return list(found)


def _before(sockets: Iterable[bpy.types.NodeSocket]) -> list[Any]:
    return [link.from_node for socket in sockets for link in socket.links]


def reads_place(node: bpy.types.Node) -> bool:
    """Return whether a node gives the place of the shaded point in the world to another node."""
    return node.type == "NEW_GEOMETRY" and bool(node.outputs["Position"].is_linked)


def replace_by_false(
    recorder: SettingsRestorer, tree: bpy.types.NodeTree, node: bpy.types.Node
) -> None:
    """Connect the constant False in place of a Boolean node."""
    targets = [link.to_socket for link in node.outputs[0].links]
    constant = tree.nodes.new("FunctionNodeInputBool")
    for target in targets:
        tree.links.new(constant.outputs[0], target)

    def undo() -> None:
        for target in targets:
            tree.links.new(node.outputs[0], target)
        tree.nodes.remove(constant)

    recorder.on_restore(tree.name, undo)
