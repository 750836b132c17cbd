# SPDX-License-Identifier: GPL-3.0-or-later
"""Building shader node groups in code: what a group looks like, and the pen that draws it.

A group is a :class:`GroupDefinition`: its sockets, and a function that draws its nodes with a
:class:`TreeBuilder`. :mod:`.groups` turns definitions into data-blocks and keeps old ones fresh.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import bpy

#: What an input of a node may be set to: another node's output, or a constant.
Source = Any

_COLUMN_WIDTH = 190.0
_ROW_HEIGHT = 170.0


@dataclass(frozen=True)
class SocketSpec:
    """One socket of a group's interface.

    Parameters
    ----------
    name
        Label, also the key by which values and links survive a rebuild.
    in_out
        ``"INPUT"`` or ``"OUTPUT"``.
    socket_type
        ``"NodeSocketFloat"``, ``"NodeSocketShader"``...
    description
        Tooltip, with the unit.
    default, minimum, maximum
        Of a float socket; the limits bind sliders, not links.
    subtype
        Blender's unit or widget: ``"NONE"``, ``"FACTOR"``, ``"DISTANCE"``...
    """

    name: str
    in_out: str
    socket_type: str
    description: str
    default: float = 0.0
    minimum: float = 0.0
    maximum: float = 1.0
    subtype: str = "NONE"

    def apply(self, item: Any) -> None:
        """Write everything but the name and the type to an interface socket."""
        item.description = self.description
        if self.socket_type == "NodeSocketFloat":
            item.subtype = self.subtype
            item.min_value = self.minimum
            item.max_value = self.maximum
            item.default_value = self.default


@dataclass(frozen=True)
class GroupDefinition:
    """A node group as source code.

    Parameters
    ----------
    kind
        Identifier kept in the data-block, independent of the name that users may change.
    name
        Name of a new data-block.
    version
        Raised with every change to sockets or nodes: groups with a lower one are rebuilt.
    description
        Tooltip of the group as a whole.
    sockets
        Interface, in order.
    draw
        Draws the nodes of an empty tree.
    """

    kind: str
    name: str
    version: int
    description: str
    sockets: tuple[SocketSpec, ...]
    draw: Callable[[TreeBuilder], None]


class TreeBuilder:
    """Adds nodes to a tree; every method returns an output socket to feed to the next one."""

    def __init__(self, tree: Any) -> None:
        self.tree = tree
        self._group_input: Any = None
        self._group_output: Any = None
        self._prefix = ""

    @contextmanager
    def prefixed(self, prefix: str) -> Iterator[None]:
        """Labels of the nodes made within begin with `prefix`: labels are unique in a tree."""
        before, self._prefix = self._prefix, prefix
        try:
            yield
        finally:
            self._prefix = before

    def node(
        self,
        idname: str,
        label: str,
        inputs: Mapping[Any, Source] | None = None,
        **properties: Any,
    ) -> Any:
        """Add a node.

        Parameters
        ----------
        idname
            ``bl_idname`` of the node.
        label
            What the node computes: its label, and its name in snapshots.
        inputs
            Socket (name or index) to an output socket, which is linked, or to a constant.
        properties
            Attributes of the node, set before the inputs.
        """
        node = self.tree.nodes.new(idname)
        node.name = node.label = self._prefix + label
        for name, value in properties.items():
            setattr(node, name, value)
        for key, source in (inputs or {}).items():
            self.connect(source, node.inputs[key])
        return node

    def connect(self, source: Source, target: Any) -> None:
        """Link an output socket to an input, or set the input to a constant."""
        if isinstance(source, bpy.types.NodeSocket):
            self.tree.links.new(source, target)
        else:
            target.default_value = source

    def math(self, operation: str, label: str, *operands: Source, clamp: bool = False) -> Any:
        """Scalar Math node."""
        node = self.node(
            "ShaderNodeMath",
            label,
            dict(enumerate(operands)),
            operation=operation,
            use_clamp=clamp,
        )
        return node.outputs[0]

    def select(self, label: str, condition: Source, if_zero: Source, if_one: Source) -> Any:
        """Exact choice between two floats by a condition that is 0 or 1 (Mix node)."""
        node = self.node(
            "ShaderNodeMix",
            label,
            {0: condition, 2: if_zero, 3: if_one},
            data_type="FLOAT",
            clamp_factor=True,
        )
        return node.outputs[0]

    def scene_attribute(self, name: str) -> Any:
        """Value of a custom property of the scene, 0 where it is absent.

        The Vector output is taken: Fac is the mean of three channels, which rounds.
        """
        split = self.node(
            "ShaderNodeSeparateXYZ", f"{name} value", {0: self.scene_vector_attribute(name)}
        )
        return split.outputs["X"]

    def scene_vector_attribute(self, name: str) -> Any:
        """Value of a custom property of the scene that holds three numbers."""
        node = self.node(
            "ShaderNodeAttribute", name, attribute_type="VIEW_LAYER", attribute_name=name
        )
        return node.outputs["Vector"]

    def vector_math(self, operation: str, label: str, inputs: Mapping[Any, Source]) -> Any:
        """Vector Math node with a vector result."""
        return self.node("ShaderNodeVectorMath", label, inputs, operation=operation).outputs[0]

    def group_input(self, name: str) -> Any:
        """Output socket of the Group Input node."""
        if self._group_input is None:
            self._group_input = self.node("NodeGroupInput", "Group Input")
        return self._group_input.outputs[name]

    def group_output(self, name: str, source: Source) -> None:
        """Feed an output of the group."""
        if self._group_output is None:
            self._group_output = self.node("NodeGroupOutput", "Group Output", is_active_output=True)
        self.connect(source, self._group_output.inputs[name])


def arrange(tree: Any) -> None:
    """Place nodes in columns by their distance from the inputs, so that the tree reads well."""
    depth: dict[str, int] = {node.name: 0 for node in tree.nodes}
    links = [(link.from_node.name, link.to_node.name) for link in tree.links]
    for _ in tree.nodes:  # longest path in an acyclic graph: at most one sweep per node
        changed = False
        for source, target in links:
            if depth[target] < depth[source] + 1:
                depth[target] = depth[source] + 1
                changed = True
        if not changed:
            break
    rows: dict[int, int] = {}
    for node in tree.nodes:
        column = depth[node.name]
        row = rows.get(column, 0)
        rows[column] = row + 1
        node.location = (column * _COLUMN_WIDTH, -row * _ROW_HEIGHT)


def sync_interface(tree: Any, sockets: tuple[SocketSpec, ...]) -> None:
    """Make a tree's interface equal to the specification, keeping sockets of same name and type.

    A kept socket keeps its identifier, and with it the values and links of every user's node.
    """
    interface = tree.interface
    wanted = {(spec.in_out, spec.name): spec for spec in sockets}
    kept: dict[tuple[str, str], Any] = {}
    for item in list(interface.items_tree):
        key = (getattr(item, "in_out", ""), item.name)
        spec = wanted.get(key)
        if item.item_type != "SOCKET" or spec is None or key in kept:
            continue
        if item.socket_type == spec.socket_type:
            kept[key] = item
    # Panels hold sockets: lift the kept ones out before the rest goes.
    for item in kept.values():
        if item.parent.index != -1:
            interface.move_to_parent(item, None, 0)
    doomed = [item for item in interface.items_tree if item not in kept.values()]
    for item in doomed:
        interface.remove(item)
    for spec in sockets:
        found = kept.get((spec.in_out, spec.name))
        if found is None:
            found = interface.new_socket(
                spec.name, in_out=spec.in_out, socket_type=spec.socket_type
            )
        spec.apply(found)
    # Outputs and inputs are listed in the order of the specification.
    for position, spec in enumerate(sockets):
        item = next(
            i for i in interface.items_tree if (i.in_out, i.name) == (spec.in_out, spec.name)
        )
        interface.move(item, position)


def draw_tree(tree: Any, definition: GroupDefinition) -> None:
    """Empty a group's tree and draw it anew from its definition; users' nodes keep their values."""
    tree.nodes.clear()
    sync_interface(tree, definition.sockets)
    definition.draw(TreeBuilder(tree))
    arrange(tree)
    if hasattr(tree, "description"):
        tree.description = definition.description
