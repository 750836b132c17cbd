# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of a radar frame, opened and checked: lengths, vertices, images and motion of its rows.

The rows are compared with the digests in the sidecar, and so are the files of motion. Their numbers
must be within bounds, so that sums are finite. Only `open_frame_table` computes the digest of all
rows: open a table once and pass it on.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...arrays import Int32, Mask, Real
from ...contract import MOTION_FILE, PATHS_FILE, PATHS_TABLE, ImageRecord, PathsRecord
from ...errors import ConfigError, PathDataError, SchemaError
from ...options import MAX_LENGTH_M
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ...physics.radar_equation import effective_area_m2
from ...typed_json import check_run, read_record
from ..motion import FrameMotion, KinematicMotion, PathImages, read_motion
from .paths import PathFlag, PathGeometry
from .table import PathRows, has_curved_images, has_digests, has_images, iter_rows, open_table

#: Bounds of quantities of a row, by column: least, most, and whether NaN (unknown) is allowed.
_BOUNDS = {
    "power_w": (-1e30, 1e30, False),  # estimates of differences are below 0 by chance
    "solid_angle_sr": (1e-30, 1e30, False),
    "length_m": (0.0, MAX_LENGTH_M, False),
    "length_sigma_m": (0.0, MAX_LENGTH_M, False),
    "range_rate_mps": (-SPEED_OF_LIGHT_MPS, SPEED_OF_LIGHT_MPS, False),
    "first_scatterer_m": (-MAX_LENGTH_M, MAX_LENGTH_M, True),
    "last_scatterer_m": (-MAX_LENGTH_M, MAX_LENGTH_M, True),
    "direction": (-1.001, 1.001, False),
    "mirror_phase_rad": (-1e30, 1e30, False),
}


def read_paths_record(folder: Path, frame: int, run_fingerprint: str = "") -> PathsRecord:
    """Read the sidecar of a frame's table, which must be of this frame and run (empty: any run).

    Records of older versions name no run.
    """
    record = read_record(folder / PATHS_FILE, PathsRecord)
    if record.frame != frame or record.table_file != PATHS_TABLE:
        raise SchemaError(
            f"{folder / PATHS_FILE} is of frame {record.frame} and table {record.table_file!r}; "
            f"expected frame {frame} and {PATHS_TABLE!r}. Remove it and render the run again."
        )
    check_run(folder / PATHS_FILE, record, run_fingerprint)
    return record


def open_frame_table(
    folder: Path, frame: int, run_fingerprint: str = ""
) -> tuple[PathsRecord, PathRows]:
    """Open the sidecar and the mapped table of a frame, and compare them."""
    record = read_paths_record(folder, frame, run_fingerprint)
    path = folder / PATHS_TABLE
    table = open_table(path, record.column_groups)
    if table.size != record.path_count:
        raise SchemaError(
            f"{path} has {table.size} rows, its sidecar says {record.path_count}. "
            "Remove both and render the run again."
        )
    if not has_digests(table, record.column_sha256):
        raise SchemaError(
            f"{path} does not match the SHA-256 of its columns in the sidecar {PATHS_FILE}. The "
            "file was changed: remove both and render the run again."
        )
    _check_numbers(path, table, record)
    return record, table


def _check_numbers(path: Path, table: PathRows, record: PathsRecord) -> None:
    """Check that each row refers to entries of the sidecar, and that its quantities can be summed.

    Raises SchemaError for the former, PathDataError for the latter.
    """
    most = {"replicate": record.replicates - 1}
    most |= dict.fromkeys(("first_object", "last_object"), len(record.objects))
    for name, last in most.items():
        if name in table.names and table.size:
            low, high = int(table[name].min()), int(table[name].max())
            if low < 0 or high > last:
                raise SchemaError(
                    f"{path} has {name} from {low} to {high}; its sidecar knows 0 to {last}. "
                    "Remove both and render the run again."
                )
    first = 0
    for rows in iter_rows(table, 1 << 13):  # they stay in the processor's cache
        for name, (*bounds, blank) in _BOUNDS.items():
            if name in rows.names:
                _check_column(path, rows, name, first, bounds, blank)
        first += rows.size


def _check_column(
    path: Path, rows: PathRows, name: str, first_row: int, bounds: Sequence[float], blank: bool
) -> None:
    values = rows[name]
    if values.min() >= bounds[0] and values.max() <= bounds[1]:  # False with NaN
        return
    good = (values >= bounds[0]) & (values <= bounds[1])
    if blank:
        good |= np.isnan(values)
    if name == "length_m":
        good |= ~usable(rows)
    if not good.all():
        place = int(np.argwhere(~good)[0, 0])
        raise PathDataError(
            f"{path}: row {first_row + place} has {name} {values[place]}; expected numbers from "
            f"{bounds[0]:g} to {bounds[1]:g}. Remove the file and its sidecar, and render the run "
            "again."
        )


def usable(rows: PathRows) -> Mask:
    """Return which rows have a length, (n,)."""
    return np.asarray((rows["flags"] & PathFlag.NO_RANGE) == 0)


def frame_motion(folder: Path, record: PathsRecord) -> FrameMotion | None:
    """Read the motion of the bodies that the paths of a table touch; None if the run has none."""
    if not record.motion_file:
        return None
    if record.motion_file != MOTION_FILE:
        raise SchemaError(
            f"{folder / PATHS_FILE} names the motion file {record.motion_file!r}; expected "
            f"{MOTION_FILE!r}. Remove it and render the run again."
        )
    motion = read_motion(folder, record.frame, record.motion_sha256)
    return dataclasses.replace(motion, images=record.images)


def radiance_of(rows: PathRows, record: PathsRecord) -> Real:
    """Return the radiance of rows, (n,) [W m^-2 sr^-1]: the power over the solid angle and the
    effective area of an isotropic receiver.
    """
    wavelength_m = SPEED_OF_LIGHT_MPS / record.carrier_hz
    area_m2 = float(effective_area_m2(wavelength_m))
    return np.asarray(rows["power_w"] / (area_m2 * rows["solid_angle_sr"]), dtype=np.float64)


def images_of(rows: PathRows, images: Sequence[ImageRecord]) -> PathImages | None:
    """Return the images over which rows go, from the table's sidecar; None without images."""
    curved = has_curved_images(rows)
    if not (curved or (images and has_images(rows))):
        return None
    ends = (rows["receiver_image"], rows["transmitter_image"])
    numbers = np.stack(ends, axis=-1)
    negative = bool(numbers.size) and numbers.min() < 0 and not curved
    if negative or numbers.max(initial=0) > len(images):
        raise ConfigError(
            f"The table names image {numbers.max()}, its sidecar has {len(images)}. They do not "
            "belong together: render the frame again."
        )
    return PathImages.of(images, numbers, planes_of(rows))


def planes_of(rows: PathRows) -> Real | None:
    """Return normals and offsets of the planes of images in curved mirrors, (n, 2, 4) [m].

    They are for receiver and transmitter; None without these columns.
    """
    if not has_curved_images(rows):
        return None
    return np.stack([rows["receiver_plane"], rows["transmitter_plane"]], axis=1)


def geometry_of(rows: PathRows, images: Sequence[ImageRecord] = ()) -> PathGeometry:
    """Return the vertices and directions of rows; `images` are those to which the rows refer."""
    return PathGeometry(
        order=rows["order"].astype(np.int32),
        transparent_depth=rows["transparent_depth"].astype(np.int32),
        first_scatterer_m=np.array(rows["first_scatterer_m"]),
        last_scatterer_m=np.array(rows["last_scatterer_m"]),
        direction=np.array(rows["direction"]),
        first_object=np.array(rows["first_object"]),
        last_object=np.array(rows["last_object"]),
        images=images_of(rows, images),
    )


def motion_of_rows(rows: PathRows, scene: FrameMotion) -> KinematicMotion:
    """Return how the lengths of rows change over the burst."""
    one = np.asarray(rows["order"] == 1)

    def ends(what: str) -> Int32:
        """Numbers at the first and at the last scatterer, (n, 2)."""
        last = rows[f"last_{what}"]
        return np.stack([np.where(one, last, rows[f"first_{what}"]), last], axis=-1)

    first = last = np.array(rows["last_scatterer_m"])
    if not one.all():
        first = np.where(one[:, None], last, rows["first_scatterer_m"])
    bodies, tracks = ends("body"), ends("surface_point")
    most_tracks = 0 if scene.tracks is None else scene.tracks.body.size
    for what, numbers, most in (
        ("last_body", bodies, len(scene.bodies)),
        ("last_surface_point", tracks, most_tracks),
    ):
        if numbers.size and not 0 <= numbers.min() <= numbers.max() <= most:
            raise ConfigError(
                f"The table names {what} {numbers.max()}, the motion file has {most}. They do not "
                "belong together: render the frame again."
            )
    return KinematicMotion(
        scene=scene,
        length_m=np.array(rows["length_m"]),
        order=rows["order"].astype(np.int32),
        first_scatterer_m=first,
        last_scatterer_m=last,
        direction=np.array(rows["direction"]),
        bodies=bodies,
        tracks=tracks,
        images=images_of(rows, scene.images),
    )
