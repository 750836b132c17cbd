# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups as data-blocks: make, find and update them, and find those of a material.

Two custom properties, kind and version, identify a radarsim group. The name does not: a user's
group with the name "Radar Material" is not changed. A material's group may be at its output or
nested in groups.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import bpy

from ...errors import SceneError
from ..state import SettingsRestorer
from .build import GroupDefinition, draw_tree
from .physical_material import PHYSICAL_KIND, RADAR_PHYSICAL, RADAR_SHEET, SHEET_KIND
from .radar_material import KIND, RADAR_MATERIAL, RING_EMITTER, RING_EMITTER_KIND
from .shader_trees import trees_within

KIND_PROPERTY = "radarsim_kind"
VERSION_PROPERTY = "radarsim_version"

#: Every node group that radarsim makes, by kind.
DEFINITIONS: dict[str, GroupDefinition] = {
    d.kind: d for d in (RADAR_MATERIAL, RADAR_PHYSICAL, RADAR_SHEET, RING_EMITTER)
}


def group_version(tree: bpy.types.NodeTree) -> int | None:
    """Return the version of a radarsim group; None for other groups."""
    version = tree.get(VERSION_PROPERTY)
    if tree.get(KIND_PROPERTY) not in DEFINITIONS or not isinstance(version, int):
        return None
    return version


def find_groups(kind: str) -> list[Any]:
    """Return all editable groups of a kind in this file, newest version first."""
    groups = [
        tree
        for tree in bpy.data.node_groups
        if tree.library is None
        and tree.get(KIND_PROPERTY) == kind
        and group_version(tree) is not None
    ]
    return sorted(groups, key=lambda tree: -(group_version(tree) or 0))


def new_group(definition: GroupDefinition) -> Any:
    """Make a group; remove it again if its definition fails.

    Blender adds a number to the name if it is in use.
    """
    tree = bpy.data.node_groups.new(definition.name, "ShaderNodeTree")
    try:
        draw_tree(tree, definition)
        tree[KIND_PROPERTY] = definition.kind
        tree[VERSION_PROPERTY] = definition.version
    except BaseException:
        bpy.data.node_groups.remove(tree)
        raise
    return tree


def rebuild_group(tree: bpy.types.NodeTree, definition: GroupDefinition) -> None:
    """Rebuild a stale group in place. Users, and values and links by socket name, are kept."""
    # Test the definition on a new group first: a failure must not leave the old one half-built.
    bpy.data.node_groups.remove(new_group(definition))
    users = list(_group_nodes(tree))
    kept = [{socket.identifier for socket in node.inputs} for node in users]
    draw_tree(tree, definition)
    for node, identifiers in zip(users, kept, strict=True):
        # Blender adds a new socket to users' nodes before it knows the default: it would be 0.
        for spec in definition.sockets:
            socket = node.inputs.get(spec.name) if spec.in_out == "INPUT" else None
            if socket is not None and socket.identifier not in identifiers:
                socket.default_value = spec.default
    tree[VERSION_PROPERTY] = definition.version


def _group_nodes(tree: bpy.types.NodeTree) -> Iterator[Any]:
    """Yield all nodes in the file that use a group."""
    owners = (*bpy.data.materials, *bpy.data.lights, *bpy.data.worlds)
    trees = [owner.node_tree for owner in owners if owner.node_tree is not None]
    for user in (*trees, *bpy.data.node_groups):
        yield from (n for n in user.nodes if getattr(n, "node_tree", None) == tree)


def ensure_group(kind: str) -> Any:
    """Return the group of a kind, a key of `DEFINITIONS`; make or rebuild it if necessary.

    Raises SceneError if the file contains a group of this kind from a newer radarsim.
    """
    definition = DEFINITIONS[kind]
    groups = find_groups(kind)
    for tree in groups:
        version = group_version(tree) or 0
        if version > definition.version:
            raise SceneError(
                f"Node group {tree.name!r} has version {version}. This radarsim supports versions "
                f"up to {definition.version}. Update radarsim, or delete the group."
            )
        if version < definition.version:
            rebuild_group(tree, definition)
    return groups[0] if groups else new_group(definition)


def refresh_groups() -> list[str]:
    """Rebuild all stale groups in the file; return their names.

    Groups that are linked from another file are rebuilt in memory; that file is not changed.
    """
    stale = []
    for tree in bpy.data.node_groups:
        definition = DEFINITIONS.get(str(tree.get(KIND_PROPERTY)))
        if definition is not None and (group_version(tree) or 0) < definition.version:
            stale.append(tree)
    names = [tree.name for tree in stale]
    for tree in stale:
        if tree.library is not None and group_version(tree) is not None:
            rebuild_group(tree, DEFINITIONS[tree[KIND_PROPERTY]])
    for kind in DEFINITIONS:
        if find_groups(kind):
            ensure_group(kind)
    return names


#: Groups that encode the range, choose lobes by the path class, and have the inputs of an index.
MATERIAL_KINDS = (KIND, PHYSICAL_KIND, SHEET_KIND)
#: Maximum number of groups and reroutes that are followed, to stop at a loop.
_MAX_STEPS = 64


class FoundGroup(NamedTuple):
    """A node with a group of radarsim, and the group nodes around it, outermost first."""

    node: bpy.types.Node
    enclosing: tuple[Any, ...] = ()


def find_group(material: bpy.types.Material) -> FoundGroup | None:
    """Return the group that reaches the output's Surface through reroutes and groups; else None."""
    if material is None or material.node_tree is None:
        return None
    for output in material.node_tree.nodes:
        if output.bl_idname == "ShaderNodeOutputMaterial":
            found = _follow(output.inputs["Surface"])
            if found is not None:
                return found
    return None


def group_node(material: bpy.types.Material) -> Any | None:
    """Return the node of the Radar Material group of a material; None without one."""
    found = find_group(material)
    return None if found is None else found.node


def group_kind(material: bpy.types.Material) -> str | None:
    """Return the kind of the Radar Material group of a material; None without one."""
    node = group_node(material)
    return None if node is None else node.node_tree.get(KIND_PROPERTY)


def ring_emitters(light: bpy.types.Light) -> list[Any]:
    """Return the nodes of a light that have the Ring Emitter."""
    nodes = () if light.node_tree is None else light.node_tree.nodes
    groups = [node for node in nodes if node.type == "GROUP" and node.node_tree is not None]
    return [node for node in groups if node.node_tree.get(KIND_PROPERTY) == RING_EMITTER_KIND]


def group_input(material: bpy.types.Material, name: str) -> Any | None:
    """Return the socket that sets an input of the material's group, or of the groups around it.

    None if another node is linked, or the group has no such input.
    """
    found = find_group(material)
    return None if found is None else input_socket(found, name)


def input_socket(found: FoundGroup, name: str) -> Any | None:
    """Return the socket that sets an input of a group, as `group_input` does."""
    socket, enclosing = found.node.inputs.get(name), found.enclosing
    for _ in range(_MAX_STEPS):
        if socket is None or not socket.is_linked:
            return socket
        link = socket.links[0]
        if link.from_node.bl_idname == "NodeReroute":
            socket = link.from_node.inputs[0]
        elif link.from_node.bl_idname == "NodeGroupInput" and enclosing:
            socket = _by_identifier(enclosing[-1].inputs, link.from_socket.identifier)
            enclosing = enclosing[:-1]
        else:
            return None
    return None


def input_number(found: FoundGroup, name: str) -> float | None:
    """Return the number that an input of a group is set to; None where a node sets it."""
    socket = input_socket(found, name)
    return None if socket is None else float(socket.default_value)


def set_input(
    socket: bpy.types.NodeSocket, value: float, recorder: SettingsRestorer | None
) -> None:
    """Set the number of an input, permanently without a recorder, if it has another one."""
    if recorder is not None:
        recorder.set(socket, "default_value", value)
    elif socket.default_value != value:
        socket.default_value = value


def shaders_at_output(material: bpy.types.Material) -> tuple[list[Any], Any | None]:
    """Return the shader nodes that reach the output of a material, through mixes and groups.

    Then the node that is linked to the output, muted or not; None without.
    """
    output = None if material.node_tree is None else material.node_tree.get_output_node("CYCLES")
    if output is None:
        return [], None
    waiting = [output.inputs["Surface"]]
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
    links = output.inputs["Surface"].links
    return list(found.values()), links[0].from_node if links else None


def holds_group(tree: bpy.types.NodeTree) -> bool:
    """Return whether a radarsim group is in a node tree or in a group of it."""
    return any(one.get(KIND_PROPERTY) in MATERIAL_KINDS for one in trees_within(tree))


def _follow(socket: bpy.types.NodeSocket) -> FoundGroup | None:
    """Return the radarsim group whose shader arrives at an input unchanged."""
    enclosing: tuple[Any, ...] = ()
    for _ in range(_MAX_STEPS):
        if socket is None or not socket.is_linked:
            return None
        link = socket.links[0]
        node, identifier = link.from_node, link.from_socket.identifier
        tree = getattr(node, "node_tree", None)
        if node.bl_idname == "NodeReroute":
            socket = node.inputs[0]
        elif node.bl_idname == "NodeGroupInput" and enclosing:
            socket = _by_identifier(enclosing[-1].inputs, identifier)
            enclosing = enclosing[:-1]
        elif tree is None:
            return None
        elif tree.get(KIND_PROPERTY) in MATERIAL_KINDS:
            return FoundGroup(node, enclosing)
        else:
            outputs = [n for n in tree.nodes if n.bl_idname == "NodeGroupOutput"]
            active = next((n for n in outputs if n.is_active_output), None)
            if active is None:
                return None
            socket = _by_identifier(active.inputs, identifier)
            enclosing = (*enclosing, node)
    return None


def _by_identifier(sockets: Any, identifier: str) -> Any | None:
    return next((socket for socket in sockets if socket.identifier == identifier), None)
