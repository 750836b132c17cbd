# SPDX-License-Identifier: GPL-3.0-or-later
"""Physics simulations, which Blender computes at whole frames, one after another."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

from ...errors import SceneError
from ..nodes.shader_trees import trees_within
from ..state import Snapshot

#: Types of modifiers with a cache that playing the animation fills.
_CACHED_MODIFIERS = {"CLOTH", "PARTICLE_SYSTEM", "SOFT_BODY"}


def simulation_frames(scene: bpy.types.Scene, last: int) -> range:
    """Return the frames to show, in order, so that simulations are known up to the frame `last`.

    Blender computes a simulation that is not baked from one frame to the next; after a jump it
    shows an earlier state. The list is empty if nothing is simulated, or if everything is baked.
    """
    starts = [cache.frame_start for cache in _caches(scene) if not cache.is_baked]
    if any(map(has_simulation_zone, scene.objects)):  # a step through baked ones does no harm
        starts.append(scene.frame_start)
    return range(min(starts), last + 1) if starts else range(0)


def _caches(scene: bpy.types.Scene) -> Iterator[Any]:
    world = scene.rigidbody_world
    if world is not None and world.enabled and world.point_cache is not None:
        yield world.point_cache
    for item in scene.objects:
        for modifier in item.modifiers:
            if modifier.type == "PARTICLE_SYSTEM":
                if modifier.particle_system.settings.type == "EMITTER":
                    yield modifier.particle_system.point_cache
            elif modifier.type in _CACHED_MODIFIERS:
                yield modifier.point_cache


def writes_disk_caches() -> list[str]:
    """Return the names of objects, and of scenes with rigid bodies, whose simulation writes files
    during playback.

    These are disk caches that are not baked, and fluids.
    """
    found = [
        scene.name
        for scene in bpy.data.scenes
        if scene.rigidbody_world is not None and _is_written(scene.rigidbody_world.point_cache)
    ]
    for item in bpy.data.objects:
        caches = [system.point_cache for system in item.particle_systems]
        for modifier in item.modifiers:
            caches.append(getattr(modifier, "point_cache", None))
            canvas = getattr(modifier, "canvas_settings", None)
            caches += [one.point_cache for one in (canvas.canvas_surfaces if canvas else ())]
            domain = getattr(modifier, "domain_settings", None)
            if domain is not None and (
                domain.cache_type == "REPLAY" or not domain.has_cache_baked_any
            ):
                found.append(item.name)
        if any(map(_is_written, caches)):
            found.append(item.name)
    return found


def _is_written(cache: Any) -> bool:
    return cache is not None and cache.use_disk_cache and not (cache.use_external or cache.is_baked)


def renders_whole_frames_only(item: bpy.types.Object) -> bool:
    """Return whether Blender renders an object's shape of the whole frame before at times between
    two frames.

    This is so for cloth and soft bodies that are not baked, and for cache files whose vertices are
    not interpolated.
    """
    for modifier in item.modifiers:
        if modifier.type in ("CLOTH", "SOFT_BODY"):
            if not modifier.point_cache.is_baked:
                return True
        elif modifier.type == "MESH_SEQUENCE_CACHE" and not modifier.use_vertex_interpolation:
            return True
    return False


def check_particles_are_baked(snapshot: Snapshot, otherwise: str) -> None:
    """Check that particles that carry objects or pieces of a mesh have a baked cache.

    Between two frames, Blender writes the states of particles that are not baked into the cache of
    whole frames. Then their places depend on the order in which times are shown. `otherwise` is the
    remedy in the message for users who do not bake.
    """
    if not bpy.data.particles:
        return
    rendered = [s.original for s in snapshot.shapes if not s.original.hide_render]
    for item in (*rendered, *snapshot.layout.instancers):
        for owner, system in _carrying_particles(item):
            cache, settings = system.point_cache, system.settings
            moves = settings.type == "EMITTER" and settings.physics_type != "NO"
            if moves and not (cache.is_baked or cache.use_external):
                raise SceneError(
                    f"The particle system {system.name!r} of {owner.name!r} is not baked. Between "
                    "whole frames Blender then gives places of particles that depend on the "
                    "frames shown before, so their range rates would be wrong. Bake it: select "
                    f"{owner.name!r}, then Particle Properties > Cache > Bake. {otherwise}"
                )


def _carrying_particles(item: bpy.types.Object) -> Iterator[tuple[Any, Any]]:
    """Yield the owner and the particle system of all particles that carry instances or pieces of an
    object.
    """
    explodes = any(modifier.type == "EXPLODE" for modifier in item.modifiers)
    for system in item.particle_systems:
        if explodes or system.settings.render_type in ("OBJECT", "COLLECTION"):
            yield item, system
    for modifier in item.modifiers:
        if modifier.type == "PARTICLE_INSTANCE" and modifier.object is not None:
            systems = modifier.object.particle_systems
            if modifier.particle_system_index <= len(systems):
                yield modifier.object, systems[modifier.particle_system_index - 1]


def has_simulation_zone(item: bpy.types.Object) -> bool:
    """Return whether an object has Geometry Nodes with a simulation zone, also within groups."""
    return any(
        node.bl_idname == "GeometryNodeSimulationOutput"
        for modifier in item.modifiers
        if modifier.type == "NODES"
        for tree in trees_within(modifier.node_group)
        for node in tree.nodes
    )


def is_simulated_body(scene: bpy.types.Scene, item: bpy.types.Object) -> bool:
    """Return whether the rigid-body simulation of a scene moves an object. It moves no passive or
    animated body.
    """
    world, body = scene.rigidbody_world, item.rigid_body
    return bool(
        world is not None
        and world.enabled
        and body is not None
        and body.type == "ACTIVE"
        and body.enabled
        and not body.kinematic
    )
