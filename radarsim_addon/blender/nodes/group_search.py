# SPDX-License-Identifier: GPL-3.0-or-later
"""The Radar Material group that a material scatters by, at its output or nested in groups."""

from __future__ import annotations

from typing import Any, NamedTuple

from .groups import KIND_PROPERTY
from .physical_material import KIND as PHYSICAL_KIND
from .radar_material import KIND
from .sheet import KIND as SHEET_KIND

MATERIAL_KINDS = (KIND, PHYSICAL_KIND, SHEET_KIND)
"""Groups that carry the range code, have lobes chosen by the gate, and the inputs of an index."""
#: Groups and reroutes that are followed; a loop has more.
_MOST_STEPS = 64


class FoundGroup(NamedTuple):
    """A node that shows a group of ours, and the group nodes that it is nested in, outermost
    first."""

    node: Any
    enclosing: tuple[Any, ...] = ()


def find_group(material: Any) -> FoundGroup | None:
    """The Radar Material group, simple, physical or sheet, that feeds the output's Surface.

    Reroutes and other groups that pass its shader on unchanged are looked through; None where
    something else is between (a Mix Shader), or there is none.
    """
    if material is None or material.node_tree is None:
        return None
    for output in material.node_tree.nodes:
        if output.bl_idname == "ShaderNodeOutputMaterial":
            found = _follow(output.inputs["Surface"])
            if found is not None:
                return found
    return None


def group_node(material: Any) -> Any | None:
    """Its node alone; None where there is none."""
    found = find_group(material)
    return None if found is None else found.node


def group_input(material: Any, name: str) -> Any | None:
    """The socket where an input of the material's group is set by a number.

    Where the groups around it pass the input on, that is a socket of the outermost. None where
    something else is linked, or the group has no such input.
    """
    found = find_group(material)
    if found is None:
        return None
    socket, enclosing = found.node.inputs.get(name), found.enclosing
    for _ in range(_MOST_STEPS):
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
    """Whether a group of ours is anywhere in a node tree, groups within included."""
    return _holds(tree, set())


def _holds(tree: Any, seen: set[int]) -> bool:
    if tree is None or tree.as_pointer() in seen:
        return False
    seen.add(tree.as_pointer())
    if tree.get(KIND_PROPERTY) in MATERIAL_KINDS:
        return True
    return any(_holds(getattr(node, "node_tree", None), seen) for node in tree.nodes)


def _follow(socket: Any) -> FoundGroup | None:
    """The group of ours whose shader arrives at an input unchanged."""
    enclosing: tuple[Any, ...] = ()
    for _ in range(_MOST_STEPS):
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
