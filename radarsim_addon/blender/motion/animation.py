# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender's animation can do between samples: keyframes, steps, and simulations.

Within 1e-4 frames of a keyframe, Blender's F-curves give the value of the key itself. A sample
there has the pose of another moment, so none is taken: see `SamplingPlan`.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence
from typing import Any

import bpy
import numpy as np

from ..nodes.shader_trees import displacing_nodes, reads_place
from ..scene import action_curves, animation_curves, has_simulation_zone, is_simulated_body

#: Animated properties that move a surface.
_MOVES = re.compile(r"(location|rotation\w*|scale|influence|value|eval_time|offset\w*|strength)$")
#: Modifiers that deform a mesh on straight lines between the whole frames of a cache.
_CACHED = {"CLOTH", "MESH_CACHE", "MESH_SEQUENCE_CACHE", "SOFT_BODY"}


def key_frames(first: float, last: float, stretch: float = 1.0) -> list[float]:
    """Return the frames from `first` to `last` at which an F-curve of the file may have a corner,
    in rising order.

    These are keys, also those that Cycles modifiers and strips repeat, and the steps of Stepped
    modifiers. `stretch` is the number of scene frames per frame of the animation (*Time
    Stretching*, new over old).
    """
    found: set[float] = set()
    first, last = first / stretch, last / stretch
    for action in bpy.data.actions:
        for curve in action_curves(action):
            found.update(_key_frames(curve, first, last))
    for strip in _strips():
        for curve in action_curves(strip.action):
            frames = (float(key.co[0]) for key in curve.keyframe_points)
            found.update(_in_scene(strip, np.unique([*frames]), first, last))
    return sorted(frame * stretch for frame in found)


def _key_frames(curve: bpy.types.FCurve, first: float, last: float) -> Iterator[float]:
    keys = np.empty(2 * len(curve.keyframe_points))
    if not keys.size:
        return
    curve.keyframe_points.foreach_get("co", keys)
    frames = keys[::2]
    yield from frames[(frames >= first) & (frames <= last)].tolist()
    for modifier in curve.modifiers:
        if modifier.mute:
            continue
        if modifier.type == "CYCLES" and frames[-1] > frames[0]:
            period = frames[-1] - frames[0]
            for number in range(
                *_counts((first - frames[0]) / period, (last - frames[0]) / period)
            ):
                repeated = frames + number * period
                yield from repeated[(repeated >= first) & (repeated <= last)].tolist()
        if modifier.type == "STEPPED":
            step, offset = modifier.frame_step, modifier.frame_offset
            for number in range(*_counts((first - offset) / step, (last - offset) / step)):
                yield offset + number * step


def _counts(low: float, high: float) -> tuple[int, int]:
    """Return the start and the end of a range of at most 10 000 whole numbers, from `low` to
    `high`.
    """
    start = int(np.floor(low))
    return start, min(int(np.ceil(high)) + 1, start + 10_000)


def _strips() -> Iterator[Any]:
    for collection in bpy.data.bl_rna.properties:
        if collection.type != "COLLECTION":
            continue
        for item in getattr(bpy.data, collection.identifier):
            for track in getattr(getattr(item, "animation_data", None), "nla_tracks", ()):
                yield from (strip for strip in track.strips if strip.action is not None)


def _in_scene(strip: Any, frames: Any, first: float, last: float) -> Iterator[float]:
    """Yield the scene frames at which a strip shows these frames of its action."""
    length = strip.action_frame_end - strip.action_frame_start
    along = (frames - strip.action_frame_start) * strip.scale
    if strip.use_reverse:
        along = length * strip.scale - along
    for repeat in range(int(np.ceil(min(strip.repeat, 1000)))):
        shown = strip.frame_start + along + repeat * length * strip.scale
        yield from shown[(shown >= first) & (shown <= last)].tolist()
    yield from (at for at in (strip.frame_start, strip.frame_end) if first <= at <= last)


def driving_objects(item: bpy.types.Object) -> list[Any]:
    """Return all objects that may move an object: itself, parents, targets of constraints, objects
    of modifiers.
    """
    found: dict[Any, None] = {}
    waiting = [item]
    while waiting:
        one = waiting.pop()
        if one is None or one in found:
            continue
        found[one] = None
        waiting.append(one.parent)
        bones = one.pose.bones if one.pose is not None else ()
        for owner in (one, *bones):
            waiting += [getattr(constraint, "target", None) for constraint in owner.constraints]
        waiting += [getattr(modifier, "object", None) for modifier in one.modifiers]
    return list(found)


def is_linear_between_frames(scene: bpy.types.Scene, item: bpy.types.Object) -> bool:
    """Return whether Blender moves an object along straight lines between whole frames.

    This is so for rigid bodies, and for transforms from a cache file.
    """
    return any(
        is_simulated_body(scene, one)
        or any(constraint.type == "TRANSFORM_CACHE" for constraint in one.constraints)
        for one in driving_objects(item)
    )


def deforms_linearly_between_frames(item: bpy.types.Object) -> bool:
    """Return whether a cache or a simulation, which has whole frames only, deforms a mesh."""
    return has_simulation_zone(item) or any(
        modifier.type in _CACHED and getattr(modifier, "interpolation", "LINEAR") == "LINEAR"
        for modifier in item.modifiers
    )


def cache_frames(item: bpy.types.Object) -> tuple[float, float] | None:
    """Return the scene frame that shows frame 0 of a cache, and the number of scene frames from one
    cache frame to the next.

    This is (0, 1) for simulations, and None for a file whose frames Blender does not give.
    """
    for modifier in item.modifiers:
        if modifier.type == "MESH_CACHE":
            how = modifier.play_mode, modifier.time_mode
            if how != ("SCENE", "FRAME") or modifier.frame_scale <= 0:
                return None
            return modifier.frame_start / modifier.frame_scale, 1 / modifier.frame_scale
        if modifier.type == "MESH_SEQUENCE_CACHE":
            return None if modifier.use_vertex_interpolation else (0.0, 1.0)
    return 0.0, 1.0


def displacement_changes(item: bpy.types.Object, first: float, last: float) -> bool:
    """Return whether the shader displacement of an object may change between two frames.

    Cycles displaces the surface while it renders, so the vertices in Blender do not show this
    motion. The displacement changes by F-curves, drivers and movies in its nodes. It also changes
    if the nodes use the coordinates of another object, or positions in the world while the object
    moves.
    """
    for material in (slot.material for slot in item.material_slots):
        if material is None or material.displacement_method not in ("DISPLACEMENT", "BOTH"):
            continue
        tree = material.node_tree
        if tree is None:
            continue
        moves = any(getattr(one.animation_data, "action", None) for one in driving_objects(item))
        if _changes(tree, displacing_nodes(tree), item, moves, first, last):
            return True
    return False


def _changes(
    tree: bpy.types.NodeTree,
    nodes: Sequence[Any],
    item: bpy.types.Object,
    moves: bool,
    first: float,
    last: float,
) -> bool:
    """Return whether nodes of a tree may give different values at different times between two
    frames.
    """
    names = {f'nodes["{node.name}"]' for node in nodes}
    animation = tree.animation_data
    paths = [curve.data_path for curve in getattr(animation, "drivers", ())]
    paths += [
        curve.data_path
        for curve in animation_curves(animation)
        if len({curve.evaluate(frame) for frame in np.linspace(first, last, 9).tolist()}) > 1
    ]
    if any(path.startswith(name) for path in paths for name in names):
        return True
    for node in nodes:
        if node.type == "GROUP" and node.node_tree is not None:
            if _changes(node.node_tree, list(node.node_tree.nodes), item, moves, first, last):
                return True
        elif (
            getattr(getattr(node, "image", None), "source", "") in ("MOVIE", "SEQUENCE")
            or (node.type == "TEX_COORD" and node.object not in (None, item))
            or (moves and reads_place(node))
        ):
            return True
    return False


def moves_in_steps(item: bpy.types.Object, first: float, last: float) -> bool:
    """Return whether an F-curve holds a value between `first` and `last`, then jumps."""
    return any(
        _MOVES.search(curve.data_path) and _has_step(curve, first, last)
        for one in driving_objects(item)
        for owner in (one, getattr(one.data, "shape_keys", None))
        if owner is not None
        for curve in animation_curves(owner.animation_data)
    )


def _has_step(curve: bpy.types.FCurve, first: float, last: float) -> bool:
    keys = curve.keyframe_points
    if any(modifier.type == "STEPPED" and not modifier.mute for modifier in curve.modifiers):
        return len(keys) > 1
    return any(
        key.interpolation == "CONSTANT"
        and key.co[1] != after.co[1]
        and key.co[0] <= last
        and after.co[0] >= first
        for key, after in itertools.pairwise(keys)
    )
