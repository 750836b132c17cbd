# SPDX-License-Identifier: GPL-3.0-or-later
"""Search for the Radar Material group of a material, at its output or nested in groups."""

from __future__ import annotations

from typing import Any, NamedTuple

from .groups import KIND_PROPERTY
from .physical_material import KIND as PHYSICAL_KIND
from .radar_material import KIND
from .sheet import KIND as SHEET_KIND

MATERIAL_KINDS = (KIND, PHYSICAL_KIND, SHEET_KIND)
"""Groups that encode the range, choose lobes by the path class, and have the inputs of an index."""
#: Maximum number of groups and reroutes that are followed, to stop at a loop.
_MAX_STEPS = 64


class FoundGroup(NamedTuple):
    """A node with a group of radarsim, and the group nodes around it, outermost first."""

    node: Any
    enclosing: tuple[Any, ...] = ()


def find_group(material: Any) -> FoundGroup | None:
    """Return the group that reaches the output's Surface through reroutes and groups; else None."""
    if material is None or material.node_tree is None:
        return None
    for output in material.node_tree.nodes:
        if output.bl_idname == "ShaderNodeOutputMaterial":
            found = _follow(output.inputs["Surface"])
            if found is not None:
                return found
    return None


def group_node(material: Any) -> Any | None:
    """Return the node of the Radar Material group of a material; None without one."""
    found = find_group(material)
    return None if found is None else found.node


def group_input(material: Any, name: str) -> Any | None:
    """Return the socket that sets an input of the material's group, or of the groups around it.

    None if another node is linked, or the group has no such input.
    """
    found = find_group(material)
    if found is None:
        return None
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


def holds_group(tree: Any) -> bool:
    """Return whether a radarsim group is in a node tree or in a group of it."""
    waiting, seen = [tree], set()
    while waiting:
        tree = waiting.pop()
        if tree is None or tree.as_pointer() in seen:
            continue
        if tree.get(KIND_PROPERTY) in MATERIAL_KINDS:
            return True
        seen.add(tree.as_pointer())
        waiting += [getattr(node, "node_tree", None) for node in tree.nodes]
    return False


def _follow(socket: Any) -> FoundGroup | None:
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
