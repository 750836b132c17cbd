# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups as data-blocks: make, find and update them.

Two custom properties, kind and version, identify a radarsim group. The name does not: a user's
group with the name "Radar Material" is not changed.
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
    """Return the version of a radarsim group.

    Parameters
    ----------
    tree : bpy.types.NodeTree

    Returns
    -------
    int or None
        None for other groups.
    """
    version = tree.get(VERSION_PROPERTY)
    if tree.get(KIND_PROPERTY) not in DEFINITIONS or not isinstance(version, int):
        return None
    return version


def find_groups(kind: str) -> list[Any]:
    """Return all editable groups of a kind in this file.

    Parameters
    ----------
    kind
        Key of `DEFINITIONS`.

    Returns
    -------
    list of bpy.types.NodeTree
        Newest version first.
    """
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


def rebuild_group(tree: Any, definition: GroupDefinition) -> None:
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


def _group_nodes(tree: Any) -> Iterator[Any]:
    """Yield all nodes in the file that use a group."""
    owners = (*bpy.data.materials, *bpy.data.lights, *bpy.data.worlds)
    trees = [owner.node_tree for owner in owners if owner.node_tree is not None]
    for user in (*trees, *bpy.data.node_groups):
        yield from (n for n in user.nodes if getattr(n, "node_tree", None) == tree)


def ensure_group(kind: str) -> Any:
    """Return the group of a kind; make or rebuild it if necessary.

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
        The file contains a group of this kind from a newer radarsim.
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
    """Rebuild all stale groups in the file.

    Groups that are linked from another file are rebuilt in memory; that file is not changed.

    Returns
    -------
    list of str
        Names of the rebuilt groups.
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
    """Return the version that this radarsim makes; 0 for an unknown kind."""
    definition = DEFINITIONS.get(kind) if isinstance(kind, str) else None
    return 0 if definition is None else definition.version
