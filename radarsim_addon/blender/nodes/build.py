# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader node groups as code.

A group is a `GroupDefinition`: its sockets, and a function that adds its nodes with a
`TreeBuilder`. `groups` makes data-blocks from definitions and updates old ones.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from graphlib import TopologicalSorter
from typing import Any

import bpy

#: Value for an input of a node: an output socket of another node, or a constant.
Source = Any

_COLUMN_WIDTH = 190.0
_ROW_HEIGHT = 170.0


@dataclass(frozen=True)
class SocketSpec:
    """One socket of a group's interface; default and slider limits are for floats only.

    A rebuilt group keeps values and links of users' nodes by `name`.
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


def float_input(
    name: str, description: str, default: float, minimum: float = 0.0, maximum: float = 1e5
) -> SocketSpec:
    """Return a float input without a unit."""
    return SocketSpec(name, "INPUT", "NodeSocketFloat", description, default, minimum, maximum)


def factor_input(name: str, description: str, default: float) -> SocketSpec:
    """Return a float input from 0 to 1, drawn as a slider."""
    return SocketSpec(name, "INPUT", "NodeSocketFloat", description, default, subtype="FACTOR")


@dataclass(frozen=True)
class GroupDefinition:
    """A node group as source code: its interface in order, and the function that adds its nodes.

    `kind` identifies the data-block, whose name users may change. Raise `version` with every change
    of sockets or nodes, except tooltips: groups with a lower version are rebuilt.
    """

    kind: str
    name: str
    version: int
    description: str
    sockets: tuple[SocketSpec, ...]
    draw: Callable[[TreeBuilder], None]


class TreeBuilder:
    """Adds nodes to a tree. Most methods return the output socket of the new node."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree
        self._group_input: Any = None
        self._group_output: Any = None
        self._prefix = ""

    @contextmanager
    def prefixed(self, prefix: str) -> Iterator[None]:
        """Start the labels of nodes added in this context with `prefix` to keep them unique."""
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
        """Add a node of a ``bl_idname``; `label`, its name too, is the quantity that it computes.

        `properties` are set before `inputs`: by name or index of the socket, an output socket,
        which is linked, or a constant.
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
        inputs = dict(enumerate(operands))
        node = self.node("ShaderNodeMath", label, inputs, operation=operation, use_clamp=clamp)
        return node.outputs[0]

    def select(self, label: str, condition: Source, if_zero: Source, if_one: Source) -> Any:
        """Add a Mix node that returns one of two floats exactly, for a condition of 0 or 1."""
        inputs = {0: condition, 2: if_zero, 3: if_one}
        return self.node(
            "ShaderNodeMix", label, inputs, data_type="FLOAT", clamp_factor=True
        ).outputs[0]

    def scene_attribute(self, name: str) -> Any:
        """Return the value of a custom property of the scene, 0 if it is absent.

        Fac would be the mean of three channels, which rounds, so this reads the Vector output.
        """
        vector = self.scene_vector_attribute(name)
        return self.node("ShaderNodeSeparateXYZ", f"{name} value", {0: vector}).outputs["X"]

    def scene_vector_attribute(self, name: str) -> Any:
        """Return the value of a custom property of the scene that holds three numbers."""
        return self._attribute("VIEW_LAYER", name, name)

    def object_vector_attribute(self, label: str, name: str) -> Any:
        """Return the value of a custom property of the shaded object as a vector."""
        return self._attribute("OBJECT", label, name)

    def face_attribute(self, label: str, name: str) -> Any:
        """Return the value of a float attribute of the shaded face; 0 without."""
        return self._attribute("GEOMETRY", label, name, "Fac")

    def _attribute(self, owner: str, label: str, name: str, output: str = "Vector") -> Any:
        return self.node(
            "ShaderNodeAttribute", label, attribute_type=owner, attribute_name=name
        ).outputs[output]

    def vector_math(self, operation: str, label: str, inputs: Mapping[Any, Source]) -> Any:
        """Add a Vector Math node with a vector result."""
        return self.node("ShaderNodeVectorMath", label, inputs, operation=operation).outputs[0]

    def scale(self, label: str, vector: Source, factor: Source) -> Any:
        """Add nodes for a vector times a number."""
        return self.vector_math("SCALE", label, {0: vector, "Scale": factor})

    def dot(self, label: str, first: Source, second: Source) -> Any:
        inputs = {0: first, 1: second}
        node = self.node("ShaderNodeVectorMath", label, inputs, operation="DOT_PRODUCT")
        return node.outputs["Value"]

    def sum_of_squares(self, label: str, x: Source, y: Source) -> Any:
        """Add nodes for x^2 + y^2."""
        y2 = self.math("MULTIPLY", f"{label}: imaginary^2", y, y)
        return self.math("MULTIPLY_ADD", label, x, x, y2)

    def modulus(self, label: str, x: Source, y: Source) -> Any:
        """Add nodes for sqrt(x^2 + y^2)."""
        return self.math("SQRT", label, self.sum_of_squares(f"{label}^2", x, y))

    def glossy(self, label: str, colour: Source, roughness: Source) -> Any:
        """Add a Glossy BSDF with Beckmann's distribution of facets."""
        inputs = {"Color": colour, "Roughness": roughness}
        node = self.node("ShaderNodeBsdfAnisotropic", label, inputs, distribution="BECKMANN")
        return node.outputs[0]

    def transparent(self, label: str, colour: Source) -> Any:
        return self.node("ShaderNodeBsdfTransparent", label, {"Color": colour}).outputs[0]

    def add_shaders(self, label: str, first: Source, second: Source) -> Any:
        return self.node("ShaderNodeAddShader", label, {0: first, 1: second}).outputs[0]

    def group_input(self, name: str) -> Any:
        """Return an output socket of the Group Input node."""
        if self._group_input is None:
            self._group_input = self.node("NodeGroupInput", "Group Input")
        return self._group_input.outputs[name]

    def group_output(self, name: str, source: Source) -> None:
        """Connect a socket to an output of the group."""
        if self._group_output is None:
            self._group_output = self.node("NodeGroupOutput", "Group Output", is_active_output=True)
        self.connect(source, self._group_output.inputs[name])


def arrange(tree: bpy.types.NodeTree) -> None:
    """Place nodes in columns by their distance from the inputs, so that the tree is readable."""
    sources: dict[str, set[str]] = {node.name: set() for node in tree.nodes}
    for link in tree.links:
        sources[link.to_node.name].add(link.from_node.name)
    depth: dict[str, int] = {}
    for name in TopologicalSorter(sources).static_order():
        depth[name] = max((depth[source] + 1 for source in sources[name]), default=0)
    rows: Counter[int] = Counter()
    places: list[float] = []
    for node in tree.nodes:
        column = depth[node.name]
        places += (column * _COLUMN_WIDTH, -rows[column] * _ROW_HEIGHT)
        rows[column] += 1
    # at once: Blender looks at the whole tree again after each node that is set by itself
    tree.nodes.foreach_set("location", places)


def sync_interface(tree: bpy.types.NodeTree, sockets: tuple[SocketSpec, ...]) -> None:
    """Make the interface of a tree equal to a specification.

    A socket of the same name and type keeps its identifier, and so the values and links of users.
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
    # Removing a panel removes its sockets, so move the kept ones out first.
    for item in kept.values():
        if item.parent.index != -1:
            interface.move_to_parent(item, None, 0)
    for item in [item for item in interface.items_tree if item not in kept.values()]:
        interface.remove(item)
    for spec in sockets:
        found = kept.get((spec.in_out, spec.name))
        if found is None:
            found = interface.new_socket(
                spec.name, in_out=spec.in_out, socket_type=spec.socket_type
            )
        spec.apply(found)
    for position, spec in enumerate(sockets):
        item = next(
            i for i in interface.items_tree if (i.in_out, i.name) == (spec.in_out, spec.name)
        )
        interface.move(item, position)


def draw_tree(tree: bpy.types.NodeTree, definition: GroupDefinition) -> None:
    """Rebuild the tree of a group from its definition; nodes that use it keep their values."""
    tree.nodes.clear()
    sync_interface(tree, definition.sockets)
    definition.draw(TreeBuilder(tree))
    arrange(tree)
    if hasattr(tree, "description"):
        tree.description = definition.description
