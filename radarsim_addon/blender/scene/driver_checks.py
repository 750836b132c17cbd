# SPDX-License-Identifier: GPL-3.0-or-later
"""What drivers and scripts read: whole frames, the active camera; and refused drivers."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

from ...findings import Finding, finding

#: The whole number of the frame, as expressions and variables of drivers name it.
_WHOLE_FRAME = re.compile(r"\bframe_current\b")
#: The camera of a scene and the numbers of its objects, likewise.
_VIEW = re.compile(r"\b(camera|pass_index)\b")


def disabled_drivers() -> list[Finding]:
    """Find data-blocks with drivers that Blender has refused to evaluate, in the open file.

    Returns
    -------
    list of Finding
        At most one. Call it when the scene has been evaluated.
    """
    names: dict[str, None] = {}
    count = 0
    for item, curve in _drivers():
        if not (curve.is_valid and curve.driver.is_valid):
            names[item.name] = None
            count += 1
    return [finding("driver-disabled", *names, count=count)] if count else []


def driven_by_whole_frames() -> list[str]:
    """Return the data-blocks whose drivers read the whole number of the frame.

    Returns
    -------
    list of str
        Their names, each once.
    """
    return list(dict.fromkeys(_names_of_readers(_WHOLE_FRAME)))


def may_move_at_whole_frames() -> bool:
    """Return whether scripts or drivers may move objects at whole frames only.

    Returns
    -------
    bool
        True for drivers that name `frame_current`, and for handlers of other add-ons and scripts
        that Blender calls at each frame.
    """
    return moved_by_scripts() or bool(driven_by_whole_frames())


def looks_at_view() -> bool:
    """Return whether the scene may depend on which camera renders, or on numbers of objects.

    Returns
    -------
    bool
        True for Geometry Nodes that read the active camera, movie clips (constraints may follow
        them in it), drivers that name a camera or a `pass_index`, and handlers of other add-ons
        and scripts.
    """
    nodes = (node for group in bpy.data.node_groups for node in group.nodes)
    return (
        moved_by_scripts()
        or len(bpy.data.movieclips) > 0
        or any(node.bl_idname == "GeometryNodeInputActiveCamera" for node in nodes)
        or any(True for _ in _names_of_readers(_VIEW))
    )


def reads_context() -> bool:
    """Return whether scripts may ask, while Blender evaluates a render, which scene is active.

    Returns
    -------
    bool
        True for drivers that are Python expressions, and for handlers of other add-ons and scripts
        that Blender calls when it evaluates a scene.
    """
    hooks = bpy.app.handlers
    before_render = hooks.render_pre, hooks.depsgraph_update_pre, hooks.depsgraph_update_post
    return (
        moved_by_scripts()
        or any(map(_of_others, itertools.chain(*before_render)))
        or any(
            curve.driver.type == "SCRIPTED" and not curve.driver.is_simple_expression
            for _, curve in _drivers()
        )
    )


def moved_by_scripts() -> bool:
    """Return whether other add-ons or scripts have handlers that Blender calls at each frame.

    Returns
    -------
    bool
    """
    called = *bpy.app.handlers.frame_change_pre, *bpy.app.handlers.frame_change_post
    return any(map(_of_others, called))


def handlers_of_others() -> list[Any]:
    """Return the functions of add-ons and scripts that Blender calls, at whatever event.

    Returns
    -------
    list of callable
        Blender's own and radarsim's are not among them.
    """
    program = bpy.utils.system_resource("SCRIPTS")
    hooks = (getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers))
    called = itertools.chain.from_iterable(hook for hook in hooks if isinstance(hook, list))
    return [one for one in called if _of_others(one) and not code_file(one).is_relative_to(program)]


def code_file(function: Any) -> Path:
    """Return the file that the code of a function is in; "?" in this folder if none is known."""
    code = getattr(getattr(function, "__func__", function), "__code__", None)
    return Path(getattr(code, "co_filename", "?")).absolute()


def _of_others(handler: Any) -> bool:
    own = __name__.rpartition(".blender.")[0]
    return not getattr(handler, "__module__", "").startswith(own)


def _drivers() -> Iterator[tuple[Any, Any]]:
    """All data-blocks with each of their drivers that is not muted."""
    for item in _data_blocks():
        animation = getattr(item, "animation_data", None)
        for curve in animation.drivers if animation is not None else ():
            if not curve.mute:
                yield item, curve


def _names_of_readers(what: re.Pattern[str]) -> Iterator[str]:
    """Names of the data-blocks with drivers that read something."""
    for item, curve in _drivers():
        if any(map(what.search, _read_by(curve.driver))):
            yield item.name


def _read_by(driver: Any) -> Iterator[str]:
    """Expression of a driver, and the paths of properties that its variables read."""
    if driver.type == "SCRIPTED":
        yield driver.expression
    for variable in driver.variables:
        if variable.type in ("SINGLE_PROP", "CONTEXT_PROP"):
            yield from (target.data_path for target in variable.targets)


def _data_blocks() -> Iterator[Any]:
    """All data-blocks in use, and the node trees that are part of them."""
    for kind in bpy.data.bl_rna.properties:
        if kind.type == "COLLECTION" and kind.identifier != "all_ids":  # of 5.x: all once more
            with_tree = "node_tree" in kind.fixed_type.bl_rna.properties
            for item in getattr(bpy.data, kind.identifier):
                if item.users:
                    yield item
                    if with_tree and item.node_tree is not None:
                        yield item.node_tree
