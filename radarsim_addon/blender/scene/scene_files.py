# SPDX-License-Identifier: GPL-3.0-or-later
"""The bytes that a scene is made of: its .blend file, and the files that this reads."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

from ...errors import SceneError
from ...findings import Finding, finding
from ...sidecar import file_sha256
from ..materials import table_files
from .driver_checks import code_file, handlers_of_others

_TILE_NUMBER = re.compile("<UDIM>|<UVTILE>")


def file_identity() -> str:
    """Return a hash of the open .blend file and of all files that it reads.

    Add-ons whose code Blender calls when it loads or renders are part of it.

    Returns
    -------
    str
        SHA-256 in hexadecimal digits. It does not depend on the folder of the files.

    Raises
    ------
    SceneError
        A file is there and cannot be read.
    """
    digest = hashlib.sha256()
    paths = [Path(bpy.data.filepath), *_linked_files()]
    for path in [*paths, *sorted({code_file(one) for one in handlers_of_others()})]:
        for part in _parts(path):
            digest.update(f"{part.name}\0{_sha256(part)}\0".encode())
    return digest.hexdigest()


def foreign_handlers() -> list[str]:
    """Return the names of functions of scripts that Blender calls when it loads or renders.

    Returns
    -------
    list of str
        Functions of add-ons are not among them: each process of a run has the same add-ons.
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


def unreadable_files() -> list[Finding]:
    """Find files that the scene reads and that are missing.

    Returns
    -------
    list of Finding
        At most one.
    """
    lost = [path for path in _linked_files() if not any(_parts(path))]
    return [finding("linked-file-missing", *map(str, lost))] if lost else []


def _linked_files() -> list[Path]:
    """Files and folders that the open file reads, sorted; also those that are missing."""
    written, baked = _caches()
    found = {_absolute(path) for path in bpy.utils.blend_paths(absolute=True, packed=False)}
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
    """Folders that simulations write while they are played, and those of baked ones."""
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
    """Texts given to the inputs of a Geometry Nodes modifier, which may name files."""
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
    """Files of a sequence by one of them: the last digits of the name count."""
    match = re.fullmatch(r"(.*?)\d+(\D*)", path.name)
    if match is None:
        return
    pattern = re.compile(re.escape(match[1]) + r"\d+" + re.escape(match[2]))
    yield from (one for one in path.parent.glob("*") if pattern.fullmatch(one.name))


def _parts(path: Path) -> list[Path]:
    """Files of a path: itself, those in a folder, the tiles of an image; empty if it is missing."""
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
