# SPDX-License-Identifier: GPL-3.0-or-later
"""A node tree as text that reads well in a diff: one line a node, inputs by what feeds them."""

from __future__ import annotations

from typing import Any

#: What tells nodes of one type apart; everything else is left at its default.
PROPERTIES = ("operation", "use_clamp", "attribute_type", "attribute_name", "distribution")


def dump(tree: Any) -> str:
    """Interface and nodes of a tree, in the order in which they were made.

    Only sockets that matter are listed: linked ones, and constants of nodes that compute. The
    text is the same on all versions of Blender.
    """
    lines = ["interface"]
    for item in tree.interface.items_tree:
        if item.item_type == "PANEL":
            lines.append(f"  panel {item.name!r}")
            continue
        line = f"  {item.in_out.lower()} {item.name!r} {item.socket_type}"
        if item.socket_type == "NodeSocketFloat":
            line += (
                f" = {item.default_value:.7g}, {item.min_value:.7g} to {item.max_value:.7g},"
                f" {item.subtype}"
            )
        lines += [line, f"    {item.description}"]
    lines.append("nodes")
    for node in tree.nodes:
        words = [f"  {node.name!r} {node.bl_idname}"]
        words += [
            f"{name}={getattr(node, name)}"
            for name in PROPERTIES
            if getattr(node, name, False) not in (False, "")
        ]
        lines.append(" ".join(words))
        for index, socket in enumerate(node.inputs):
            if socket.is_linked:
                link = socket.links[0]
                source = f"{link.from_node.name!r}"
                if len([s for s in link.from_node.outputs if s.enabled]) > 1:
                    source += f".{_today(link.from_socket.name)}"
                lines.append(f"    {_label(node, index)} <- {source}")
            elif _matters(node, index):
                lines.append(f"    {_label(node, index)} = {_value(socket)}")
    return "\n".join(lines) + "\n"


def _label(node: Any, index: int) -> str:
    name = node.inputs[index].name
    same = sum(socket.name == name for socket in node.inputs)
    return f"{_today(name)}[{index}]" if same > 1 else _today(name)


def _today(name: str) -> str:
    """A socket's name as Blender 5.2 has it, which renamed some."""
    return "Factor" if name == "Fac" else name


def _matters(node: Any, index: int) -> bool:
    """Whether an unlinked input takes part in what the node computes."""
    socket = node.inputs[index]
    if not socket.enabled or not hasattr(socket, "default_value") or socket.name == "Weight":
        return False
    kind = node.bl_idname
    if kind == "ShaderNodeMath":
        unary = node.operation in {"ABSOLUTE", "SQRT", "EXPONENT"}
        return index < (1 if unary else 3 if node.operation == "MULTIPLY_ADD" else 2)
    return kind in {
        "ShaderNodeMix",
        "ShaderNodeCombineXYZ",
        "ShaderNodeVolumeAbsorption",
        "ShaderNodeEmission",
    }


def _value(socket: Any) -> str:
    value = socket.default_value
    if hasattr(value, "__len__"):
        return "(" + ", ".join(f"{v:.7g}" for v in value) + ")"
    return f"{value:.7g}"
