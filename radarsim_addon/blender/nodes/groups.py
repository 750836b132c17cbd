# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups as data-blocks: making them, finding ours, and rebuilding stale ones in place.

A group of ours is told by two custom properties, its kind and its version, never by its name:
a user's group that happens to be called "Radar Material" is left alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

from ...errors import SceneError
from .build import GroupDefinition, draw_tree
from .physical_material import RADAR_PHYSICAL
from .radar_material import RADAR_MATERIAL
from .ring_emitter import RING_EMITTER
from .sheet import RADAR_SHEET

KIND_PROPERTY = "radarsim_kind"
VERSION_PROPERTY = "radarsim_version"

DEFINITIONS: dict[str, GroupDefinition] = {
    d.kind: d for d in (RADAR_MATERIAL, RADAR_PHYSICAL, RADAR_SHEET, RING_EMITTER)
}
"""Every node group that radarsim makes, by kind."""


def group_version(tree: Any) -> int | None:
    """Version of a group of ours; None for anybody else's."""
    version = tree.get(VERSION_PROPERTY)
    if tree.get(KIND_PROPERTY) not in DEFINITIONS or not isinstance(version, int):
        return None
    return version


def find_groups(kind: str) -> list[Any]:
    """All editable groups of a kind in this file, newest version first."""
    groups = [
        tree
        for tree in bpy.data.node_groups
        if tree.library is None
        and tree.get(KIND_PROPERTY) == kind
        and group_version(tree) is not None
    ]
    return sorted(groups, key=lambda tree: -(group_version(tree) or 0))


def new_group(definition: GroupDefinition) -> Any:
    """Make a group; nothing is left behind where its definition fails.

    Blender gives it a numbered name where the plain one is taken.
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


def rebuild_group(tree: Any, definition: GroupDefinition) -> None:
    """Draw a stale group anew in place: users, and values and links by socket name, are kept."""
    # A definition that fails on this Blender must fail on a scratch group, not half-way in the
    # user's one.
    bpy.data.node_groups.remove(new_group(definition))
    users = list(_group_nodes(tree))
    kept = [{socket.identifier for socket in node.inputs} for node in users]
    draw_tree(tree, definition)
    for node, identifiers in zip(users, kept, strict=True):
        # Blender gives users' nodes a new socket before its default is known: they would read 0.
        for spec in definition.sockets:
            socket = node.inputs.get(spec.name) if spec.in_out == "INPUT" else None
            if socket is not None and socket.identifier not in identifiers:
                socket.default_value = spec.default
    tree[VERSION_PROPERTY] = definition.version


def _group_nodes(tree: Any) -> Iterator[Any]:
    """Every node in the file that shows a group."""
    owners = (*bpy.data.materials, *bpy.data.lights, *bpy.data.worlds)
    trees = [owner.node_tree for owner in owners if owner.node_tree is not None]
    for user in (*trees, *bpy.data.node_groups):
        yield from (n for n in user.nodes if getattr(n, "node_tree", None) == tree)


def ensure_group(kind: str) -> Any:
    """The group of a kind, made or rebuilt where it has to be.

    Parameters
    ----------
    kind
        ``"radar_material"``, ``"radar_physical"``, ``"radar_sheet"`` or ``"ring_emitter"``.

    Returns
    -------
    bpy.types.ShaderNodeTree

    Raises
    ------
    SceneError
        The file holds a group of this kind made by a newer radarsim.
    """
    definition = DEFINITIONS[kind]
    groups = find_groups(kind)
    for tree in groups:
        version = group_version(tree) or 0
        if version > definition.version:
            raise SceneError(
                f"Node group {tree.name!r} has version {version}; this radarsim knows up to "
                f"{definition.version}. Update radarsim, or delete the group to get this one."
            )
        if version < definition.version:
            rebuild_group(tree, definition)
    return groups[0] if groups else new_group(definition)


def refresh_groups() -> list[str]:
    """Rebuild every stale group in the file; returns the names of those that were rebuilt.

    Those that are linked from another file are rebuilt in memory: that file is not changed.
    """
    stale = [
        tree
        for tree in bpy.data.node_groups
        if (group_version(tree) or 0) < _version_of(tree.get(KIND_PROPERTY))
    ]
    names = [tree.name for tree in stale]
    for tree in stale:
        if tree.library is not None and group_version(tree) is not None:
            rebuild_group(tree, DEFINITIONS[tree[KIND_PROPERTY]])
    for kind in DEFINITIONS:
        if find_groups(kind):
            ensure_group(kind)
    return names


def _version_of(kind: Any) -> int:
    """The version that this radarsim makes; 0 for what it does not know."""
    definition = DEFINITIONS.get(kind) if isinstance(kind, str) else None
    return 0 if definition is None else definition.version
