# SPDX-License-Identifier: GPL-3.0-or-later
"""Files and scripts that a scene depends on: its bytes, and what its drivers and handlers read.

`file_identity` is a hash of the .blend file, of the files that it reads and of add-ons with
handlers. The questions about drivers (`looks_at_view`, `reads_context`...) decide which shortcuts
renders may take.
"""

from __future__ import annotations

import hashlib
import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

from ...errors import SceneError
from ...findings import Finding, finding
from ...typed_json import file_sha256
from ..materials import table_files

_TILE_NUMBER = re.compile("<UDIM>|<UVTILE>")


def file_identity() -> str:
    """Return the SHA-256 of the open .blend file and of all files that it reads, in any folder.

    Add-ons whose code Blender calls when it loads or renders are part of it. `SceneError` if a file
    is there and cannot be read.
    """
    digest = hashlib.sha256()
    paths = [Path(bpy.data.filepath), *_linked_files()]
    for path in [*paths, *sorted({code_file(one) for one in handlers_of_others()})]:
        for part in _parts(path):
            digest.update(f"{part.name}\0{_sha256(part)}\0".encode())
    return digest.hexdigest()


def foreign_handlers() -> list[str]:
    """Return the names of functions of scripts that Blender calls when it loads or renders.

    Functions of add-ons are not included, because each process of a run has the same add-ons.
    """
    places = [
        bpy.utils.user_resource("EXTENSIONS"),
        bpy.utils.user_resource("SCRIPTS", path="addons"),
    ]
    folders = [Path(place) for place in places if place]
    return [
        getattr(one, "__qualname__", repr(one))
        for one in handlers_of_others()
        if not any(code_file(one).is_relative_to(folder) for folder in folders)
    ]


def frame_handlers() -> list[str]:
    """Return the names of functions of add-ons and scripts that Blender calls at each frame."""
    called = *bpy.app.handlers.frame_change_pre, *bpy.app.handlers.frame_change_post
    return [
        f"{getattr(one, '__module__', '?')}.{getattr(one, '__qualname__', repr(one))}"
        for one in handlers_of_others()
        if one in called
    ]


def unreadable_files() -> list[Finding]:
    """Return a finding on files that the scene reads and that are missing, if any."""
    lost = [path for path in _linked_files() if not any(_parts(path))]
    return [finding("linked-file-missing", *map(str, lost))] if lost else []


def handlers_of_others() -> list[Any]:
    """Return the functions of add-ons and scripts that Blender calls at any event.

    The functions of Blender and of radarsim are not included.
    """
    program = bpy.utils.system_resource("SCRIPTS")
    hooks = (getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers))
    called = itertools.chain.from_iterable(hook for hook in hooks if isinstance(hook, list))
    return [one for one in called if _of_others(one) and not code_file(one).is_relative_to(program)]


def code_file(function: Any) -> Path:
    """Return the file that the code of a function is in; "?" in this folder if none is known."""
    code = getattr(getattr(function, "__func__", function), "__code__", None)
    return Path(getattr(code, "co_filename", "?")).absolute()


def _linked_files() -> list[Path]:
    """Return the files and folders that the open file reads, sorted, with those that
    are missing.
    """
    written, baked = _caches()
    paths = bpy.utils.blend_paths(absolute=True, packed=False)
    found = {_absolute(path) for path in paths if path}  # a baked cache has an empty one
    found -= {_absolute(sound.filepath) for sound in bpy.data.sounds} | written
    found |= baked
    found |= {path for material in bpy.data.materials for path in table_files(material)}
    for owner in (*bpy.data.images, *bpy.data.movieclips, *bpy.data.cache_files, *bpy.data.volumes):
        if getattr(owner, "source", "") == "SEQUENCE" or getattr(owner, "is_sequence", False):
            found |= set(_sequence(_absolute(owner.filepath)))
    usd = [path for path in found if path.suffix.startswith(".usd")]
    found |= {layer for path in usd for layer in path.parent.rglob("*.usd*")}  # of its layers
    program = Path(bpy.utils.system_resource("SCRIPTS")).parent  # its version is in the run's plan
    above = Path(bpy.data.filepath).parents  # an ocean that is not baked names them
    return sorted(p for p in found if not (p.is_relative_to(program) or p in above))


def _caches() -> tuple[set[Path], set[Path]]:
    """Return the folders that simulations write during playback, and those of baked simulations."""
    written: set[Path] = set()
    baked: set[Path] = set()
    file = Path(bpy.data.filepath or "unsaved.blend")
    own = file.with_name(f"blendcache_{file.stem}")
    worlds = [scene.rigidbody_world for scene in bpy.data.scenes]
    caches: list[Any] = [getattr(world, "point_cache", None) for world in worlds]
    for item in bpy.data.objects:
        caches += [system.point_cache for system in item.particle_systems]
        for modifier in item.modifiers:
            caches.append(getattr(modifier, "point_cache", None))
            domain = getattr(modifier, "domain_settings", None)
            replayed = domain is not None and domain.cache_type == "REPLAY"
            if domain is not None and (replayed or not domain.has_cache_baked_any):
                written.add(_absolute(domain.cache_directory))
            if modifier.type == "OCEAN" and not modifier.is_cached:
                written.add(_absolute(modifier.filepath))
            canvas = getattr(modifier, "canvas_settings", None)
            caches += [one.point_cache for one in (canvas.canvas_surfaces if canvas else ())]
            if modifier.type == "NODES":
                baked |= {_absolute(one.directory) for one in modifier.bakes if one.directory}
                baked |= {_absolute(modifier.bake_directory)} if modifier.bake_directory else set()
                baked |= {_absolute(text) for text in _texts(modifier) if Path(text).is_file()}
    caches = [one for one in caches if one is not None]
    baked |= {_absolute(one.filepath) for one in caches if one.use_external}
    on_disk = [one for one in caches if one.use_disk_cache and not one.use_external]
    written |= {own} if on_disk else set()
    baked |= {own} if any(one.is_baked for one in on_disk) else set()
    return written, {path for path in baked if path.exists()}


def _texts(modifier: Any) -> Iterator[str]:
    """Return the texts in the inputs of a Geometry Nodes modifier. They may name files."""
    values: list[Any] = []
    if hasattr(modifier, "properties"):  # Blender 5.2
        inputs = modifier.properties.inputs
        own = [getattr(inputs, one.identifier) for one in inputs.bl_rna.properties]
        values = [getattr(one, "value", None) for one in own]
    elif hasattr(modifier, "items"):
        values = [value for _, value in modifier.items()]
    yield from (bpy.path.abspath(value) for value in values if isinstance(value, str) and value)


def _absolute(path: str) -> Path:
    return Path(bpy.path.abspath(path)).absolute()


def _sequence(path: Path) -> Iterator[Path]:
    """Return the files of a sequence, given one of them. The last digits of the name are the
    number.
    """
    match = re.fullmatch(r"(.*?)\d+(\D*)", path.name)
    if match is None:
        return
    pattern = re.compile(re.escape(match[1]) + r"\d+" + re.escape(match[2]))
    yield from (one for one in path.parent.glob("*") if pattern.fullmatch(one.name))


def _parts(path: Path) -> list[Path]:
    """Return the files of a path: the file itself, the files of a folder, or the tiles of an image;
    empty if it is missing.
    """
    if path.is_dir():
        return sorted(one for one in path.rglob("*") if one.is_file())
    if _TILE_NUMBER.search(path.name):
        return sorted(path.parent.glob(_TILE_NUMBER.sub("[0-9]*", path.name)))
    return [path] if path.exists() else []


def _sha256(path: Path) -> str:
    try:
        return file_sha256(path)
    except OSError as error:
        raise SceneError(
            f"{path}, which the scene is made of, cannot be read ({error.strerror or error}). Make "
            "it readable, or unlink it in Blender (File > External Data)."
        ) from error


def disabled_drivers() -> list[Finding]:
    """Return a finding on data-blocks of the open file with drivers that Blender has refused to
    evaluate.

    Call this after the scene is evaluated.
    """
    names: dict[str, None] = {}
    count = 0
    for item, curve in _drivers():
        if not (curve.is_valid and curve.driver.is_valid):
            names[item.name] = None
            count += 1
    return [finding("driver-disabled", *names, count=count)] if count else []


def driven_by_whole_frames() -> list[str]:
    """Return the names of data-blocks whose drivers read the number of the whole frame."""
    return list(dict.fromkeys(_names_of_readers(r"\bframe_current\b")))


def may_move_at_whole_frames() -> bool:
    """Return whether drivers, or handlers of other add-ons, may move objects at whole
    frames only.
    """
    return moved_by_scripts() or bool(driven_by_whole_frames())


def looks_at_view() -> bool:
    """Return whether the scene may depend on which camera renders, or on numbers of objects.

    True for Geometry Nodes that read the active camera, movie clips (constraints may follow them in
    it), drivers that name a camera or a `pass_index`, and handlers of other add-ons and scripts.
    """
    nodes = (node for group in bpy.data.node_groups for node in group.nodes)
    return (
        moved_by_scripts()
        or len(bpy.data.movieclips) > 0
        or any(node.bl_idname == "GeometryNodeInputActiveCamera" for node in nodes)
        or any(True for _ in _names_of_readers(r"\b(camera|pass_index)\b"))
    )


def reads_context() -> bool:
    """Return whether scripts may read, during the evaluation of a render, which scene is active.

    This is possible for drivers with Python expressions, and for handlers of other add-ons and
    scripts that Blender calls when it evaluates a scene.
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
    """Return whether other add-ons or scripts have handlers that Blender calls at each frame."""
    called = *bpy.app.handlers.frame_change_pre, *bpy.app.handlers.frame_change_post
    return any(map(_of_others, called))


def _of_others(handler: Any) -> bool:
    own = __name__.rpartition(".blender.")[0]
    return not (getattr(handler, "__module__", None) or "").startswith(own)


def _drivers() -> Iterator[tuple[Any, Any]]:
    """Yield all data-blocks with each of their drivers that is not muted."""
    for item in _data_blocks():
        animation = getattr(item, "animation_data", None)
        for curve in animation.drivers if animation is not None else ():
            if not curve.mute:
                yield item, curve


def _names_of_readers(pattern: str) -> Iterator[str]:
    """Return the names of data-blocks with drivers that read something."""
    for item, curve in _drivers():
        if any(re.search(pattern, text) for text in _read_by(curve.driver)):
            yield item.name


def _read_by(driver: Any) -> Iterator[str]:
    """Return the expression of a driver, and the paths of the properties that its
    variables read.
    """
    if driver.type == "SCRIPTED":
        yield driver.expression
    for variable in driver.variables:
        if variable.type in ("SINGLE_PROP", "CONTEXT_PROP"):
            yield from (target.data_path for target in variable.targets)


def _data_blocks() -> Iterator[Any]:
    """Yield all data-blocks in use, and the node trees that are part of them."""
    for kind in bpy.data.bl_rna.properties:
        if kind.type == "COLLECTION" and kind.identifier != "all_ids":  # of 5.x: all once more
            with_tree = "node_tree" in kind.fixed_type.bl_rna.properties
            for item in getattr(bpy.data, kind.identifier):
                if item.users:
                    yield item
                    if with_tree and item.node_tree is not None:
                        yield item.node_tree
