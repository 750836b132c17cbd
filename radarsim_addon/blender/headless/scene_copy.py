# SPDX-License-Identifier: GPL-3.0-or-later
"""A temporary copy of the open file, which a separate process measures.

`save_copy` writes the file, and pixels that are not part of it, into a temporary folder. It does
not change the user's file or scene. `open_copy` opens the copy in the other process as if it were
the original. For this, `save_copy` writes the path of the original into the copy, as Blender does
in the files that it saves for a crash, and ``recover_auto_save`` then uses it as the path of the
file. So libraries, caches and all other paths that begin with ``//`` are found.

The other process has no add-ons, handlers or driver scripts of the user. Therefore both processes
evaluate the scene at the frame of the copy, and a run with an object that differs is refused. The
error names the object.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...arrays import Single
from ...errors import OutputError, SceneError
from ...messages import Message
from ...processes import temporary_folder
from ..run.scene_state import Device, choose_device, chosen_device
from ..scene import frame_handlers, simulation_frames, writes_disk_caches
from ..state import SettingsRestorer, Snapshot, evaluated_snapshot, mesh_counts, vertex_positions

#: Space that stays free on the disk [bytes].
_SPARE_BYTES = 1 << 26
#: Bytes of a .blend file without data, and of each vertex, edge, corner and face of a mesh.
_FILE_BYTES, _MESH_BYTES = 1 << 20, (12, 8, 8, 4)


@dataclass(frozen=True)
class SceneCopy:
    """A copy in a temporary folder, which `close` removes, and the order for its process."""

    folder: Path
    order: Message
    size_bytes: int
    took_s: float

    def close(self) -> None:
        """Remove the copy; a second call changes nothing."""
        shutil.rmtree(self.folder, ignore_errors=True)


def save_copy(
    scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, radar: Any, overwrite: bool
) -> SceneCopy:
    """Save a copy of the open file, for the view layer, scene and radar that are measured.

    OutputError: the disk is full. SceneError: painted pixels cannot be copied.
    """
    began_s = time.monotonic()
    folder = temporary_folder().resolve()
    try:
        check_room(folder)
        names, numbers = evaluated_numbers(evaluated_snapshot(view_layer))
        file = folder / "scene.blend"
        _save(file)
        if bpy.data.filepath:
            _note_original(file, bpy.data.filepath)
        device = chosen_device(scene)
        fields = {
            "file": str(file),
            "original": bpy.data.filepath,
            "scene": scene.name,
            "view_layer": view_layer.name,
            "radar": radar.name,
            "overwrite": overwrite,
            "device": [device.kind, device.ids],
            "frame": scene.frame_current,
            "handlers": frame_handlers(),
            "names": names,
            "images": list(_save_painted(folder)),
        }
        size_bytes = sum(part.stat().st_size for part in folder.iterdir())
    except BaseException as error:
        shutil.rmtree(folder, ignore_errors=True)
        if isinstance(error, OSError):
            raise OutputError(f"A copy of the scene could not be saved: {error}.") from error
        raise
    took_s = time.monotonic() - began_s
    return SceneCopy(folder, Message(fields, {"numbers": numbers}), size_bytes, took_s)


def expected_size() -> int:
    """Return the approximate size of a copy [bytes], from the file on disk or its meshes."""
    found = _FILE_BYTES
    for mesh in (one for one in bpy.data.meshes if one.users and not one.library):
        keys = len(mesh.shape_keys.key_blocks) if mesh.shape_keys else 0
        counts = mesh_counts(mesh)
        found += sum(a * b for a, b in zip(counts, _MESH_BYTES, strict=True))
        found += 8 * counts[2] * len(mesh.uv_layers) + 12 * counts[0] * keys
    for image in bpy.data.images:
        if image.packed_file is not None:
            found += image.packed_file.size
        if image.is_dirty:
            found += 4 * len(image.pixels)
    with contextlib.suppress(OSError):
        found = max(found, os.path.getsize(bpy.data.filepath))
    return found


def check_room(folder: Path) -> None:
    """Check that a disk has enough free space for a copy; OutputError if not."""
    needed, free = 1.1 * expected_size() + _SPARE_BYTES, shutil.disk_usage(folder).free
    if free < needed:
        raise OutputError(
            f"The copy of the scene that is measured needs about {needed / 1e6:.0f} MB in the "
            f"temporary folder {folder.parent}, which has {free / 1e6:.0f} MB. Make room there, or "
            "start Blender with the variable TMPDIR (TEMP on Windows) set to another folder."
        )


def _save(file: Path) -> None:
    kept = SettingsRestorer()
    preferences = bpy.context.preferences
    kept.keep(preferences, "is_dirty")
    kept.set(preferences.filepaths, "file_preview_type", "NONE")  # drawing one takes time
    kept.set(bpy.data, "use_autopack", False)  # it would pack files into the user's data
    for hooks in (bpy.app.handlers.save_pre, bpy.app.handlers.save_post):
        kept.on_restore("handlers", partial(hooks.extend, list(hooks)))
        hooks.clear()  # for add-ons, nothing is saved
    try:
        bpy.ops.wm.save_as_mainfile(
            filepath=str(file), copy=True, compress=False, relative_remap=False
        )
    except RuntimeError as error:
        raise OutputError(
            f"A copy of the scene could not be saved as {file}: {str(error).strip()} Check that "
            "the disk has room, and save the file once yourself."
        ) from error
    finally:
        kept.restore()


def _note_original(file: Path, original: str) -> None:
    """Write the path of the original file into the block of a .blend file that holds a path.

    Blocks follow the header of 12 bytes. From Blender 5.0 on, the header states its own size.
    """
    path = original.encode("utf-8", "surrogateescape")
    with open(file, "r+b") as stream:
        start = stream.read(17)
        new = start[7:9].isdigit()
        header = struct.Struct("<4siqqq" if new else "<4siqii")
        stream.seek(int(start[7:9]) if new else 12)
        while len(found := stream.read(header.size)) == header.size:
            code, *numbers = header.unpack(found)
            length = numbers[2 if new else 0]
            if code == b"GLOB" and len(path) < _PATH_BYTES <= length - _PATH_AT:
                stream.seek(_PATH_AT, os.SEEK_CUR)
                stream.write(path.ljust(_PATH_BYTES, b"\0"))
                return
            stream.seek(length, os.SEEK_CUR)
    raise OutputError(
        f"The path {original} cannot be written into a copy of this file. Save the file under a "
        "shorter path."
    )


#: Where Blender's `FileGlobal` has the path of the file, and its length [bytes].
_PATH_AT, _PATH_BYTES = 80, 1024


# -- painted and generated images ------------------------------------------------------------------


def _save_painted(folder: Path) -> Iterator[dict[str, Any]]:
    """Write the pixels of changed, unsaved images next to the copy."""
    for number, image in enumerate(bpy.data.images):
        if not image.is_dirty or image.source not in ("FILE", "GENERATED", "TILED"):
            continue
        if image.source == "TILED":
            raise SceneError(
                f"The image {image.name!r} has tiles with painted pixels that are not saved. Save "
                "them: Image > Save in the Image Editor."
            )
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        np.save(folder / f"image_{number}.npy", pixels)
        yield {
            "file": f"image_{number}.npy",
            "name": image.name,
            "library": image.library.name if image.library else None,
            "size": list(image.size),
            "float": image.is_float,
        }


def _restore_painted(folder: Path, images: list[dict[str, Any]]) -> None:
    for record in images:
        library = record["library"]
        image = bpy.data.images[(record["name"], library) if library else record["name"]]
        space = image.colorspace_settings.name
        image.source = "GENERATED"  # Cycles reads the file of another image
        image.generated_width, image.generated_height = record["size"]
        image.use_generated_float = record["float"]
        image.colorspace_settings.name = space
        pixels = np.load(folder / record["file"])
        if len(image.pixels) != pixels.size:
            raise SceneError(
                f"The image {image.name!r} has pixels that are not saved and cannot be copied. "
                "Save it: Image > Save in the Image Editor."
            )
        image.pixels.foreach_set(pixels)
        image.update()


# -- the other process -----------------------------------------------------------------------------


def open_copy(order: Message) -> None:
    """Open a copy as the original file, with scripts disabled, and check that the scene is the
    same.

    SceneError: an object differs in this process.
    """
    fields = order.fields
    file = Path(fields["file"])
    try:
        bpy.ops.wm.recover_auto_save(filepath=str(file), use_scripts=False)
    except RuntimeError as error:
        raise SceneError(f"The copy of the scene cannot be opened: {str(error).strip()}") from error
    if fields["original"] and Path(bpy.data.filepath) != Path(fields["original"]):
        raise SceneError(
            f"The copy of {fields['original']} opens as {bpy.data.filepath}, so its relative paths "
            "would not be found. Measure the saved file with `radarsim render`."
        )
    written = writes_disk_caches()
    if written:
        raise SceneError(
            f"Simulations of {', '.join(map(repr, written[:10]))} would write their caches next to "
            "the file while the window uses them. Bake them, or switch Disk Cache off."
        )
    _restore_painted(file.parent, fields["images"])
    scene = bpy.data.scenes[fields["scene"]]
    kind, ids = fields["device"]
    choose_device(scene, Device(kind, tuple(ids)))
    view_layer = scene.view_layers[fields["view_layer"]]
    here = evaluated_numbers(evaluated_snapshot(view_layer))
    different = differences((fields["names"], order.arrays["numbers"]), here)
    if different and not _simulates():
        shown = ", ".join(map(repr, different[:10]))
        raise SceneError(
            f"{len(different)} objects are different in the process that measures: {shown}. They "
            "depend on add-ons, handlers or driver scripts, which do not run there, or were moved "
            "without a keyframe. Bake or keyframe their motion and apply what scripts have made; "
            "or measure in a script that has them (radarsim.measure)."
        )


def _simulates() -> bool:
    """Return whether a simulation is not baked, so that its state depends on earlier frames."""
    return any(len(simulation_frames(scene, 1 << 30)) > 0 for scene in bpy.data.scenes)


#: Columns: rows of an object, sum and sum of magnitudes of their matrices; number of vertices of
#: its mesh (-1: not compared), weighted sum of their coordinates, and bound of that sum.
_COLUMNS = 1 + 2 * 16 + 1 + 3 + 1
#: Largest difference of sums, over the sum of magnitudes.
_SAME = 1e-6
#: Weights of vertices, which repeat.
_WEIGHTS = np.random.default_rng(1).uniform(0.5, 1.5, 4093).astype(np.float32)


def evaluated_numbers(snapshot: Snapshot) -> tuple[list[str], NDArray[np.float64]]:
    """Return the names of all objects, with instancers, and numbers for a comparison.

    The numbers are sums of the poses of each object and of the vertices of its mesh.
    """
    count = len(snapshot.shapes)
    numbers = np.zeros((count, _COLUMNS))
    shape = snapshot.layout.shape
    matrices = snapshot.matrices.reshape(-1, 16)
    numbers[:, 0] = np.bincount(shape, minlength=count)
    for column in range(16):
        values = matrices[:, column]
        numbers[:, 1 + column] = np.bincount(shape, values, count)
        numbers[:, 17 + column] = np.bincount(shape, np.abs(values), count)
    for row, one in enumerate(snapshot.shapes):
        if not one.own or one.original.type != "MESH" or _shown_otherwise(one.original):
            numbers[row, 33] = -1
        else:
            places = vertex_positions(snapshot.evaluated(one.original))
            numbers[row, 33:] = _mesh_numbers(places)
    return [one.original.name_full for one in snapshot.shapes], numbers


def _shown_otherwise(item: bpy.types.Object) -> bool:
    """Return whether this window shows another mesh than it renders, because of edit mode or
    subdivision by the graphics card.
    """
    by_card = bpy.context.preferences.system.use_gpu_subdivision and not bpy.app.background
    subdivided = by_card and any(one.type in ("SUBSURF", "MULTIRES") for one in item.modifiers)
    return subdivided or item.mode == "EDIT"


def _mesh_numbers(places: Single) -> NDArray[np.float64]:
    found, count = np.zeros(5), len(places)
    if count:
        whole = count - count % len(_WEIGHTS)
        sums = _WEIGHTS @ places[:whole].reshape(-1, len(_WEIGHTS), 3)
        found[0] = count
        found[1:4] = sums.sum(axis=0, dtype=float) + _WEIGHTS[: count - whole] @ places[whole:]
        found[4] = count * max(-float(places.min()), float(places.max()), 0.0)
    return found


def differences(
    window: tuple[list[str], NDArray[np.float64]], here: tuple[list[str], NDArray[np.float64]]
) -> list[str]:
    """Return the names of the window's objects that differ or are missing in this process."""
    rows: dict[str, list[int]] = {}
    for row, name in enumerate(here[0]):
        rows.setdefault(name, []).append(row)
    found: list[str] = []
    for name, numbers in zip(*window, strict=True):
        left = rows.get(name)
        if not left or not _same(numbers, here[1][left.pop(0)]):
            found.append(name)
    return list(dict.fromkeys(found))


def _same(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    if one[0] != other[0] or one[33] not in (-1, other[33]):
        return False
    parts = [(slice(1, 17), slice(17, 33)), (slice(34, 37), slice(37, 38))]
    for sums, sizes in parts[: 1 if one[33] < 0 else 2]:
        with np.errstate(invalid="ignore"):
            apart = np.abs(one[sums] - other[sums]) > _SAME * one[sizes].sum()
        if apart.any():
            return False
    return True
