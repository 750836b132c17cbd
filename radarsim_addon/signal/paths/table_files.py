# SPDX-License-Identifier: GPL-3.0-or-later
"""Radar frames of the acquisition "paths": the table on disk as `Paths` in memory."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...contract import MOTION_FILE, PATHS_FILE, PATHS_TABLE, PathsRecord
from ...errors import ConfigError, SchemaError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ...physics.radar_equation import effective_area_m2
from ...sidecar import file_sha256, read_record
from ..motion import FrameMotion, KinematicMotion, PathMotion, read_motion
from .flags import PathFlag
from .geometry import PathGeometry
from .table import PathRows, iter_rows, open_table


def read_paths_record(folder: Path, frame: int) -> PathsRecord:
    """Sidecar of a frame's table.

    Raises
    ------
    FrameFileError, SchemaError
        It is missing, damaged, newer than this version, or of another frame.
    """
    record = read_record(folder / PATHS_FILE, PathsRecord)
    if record.frame != frame or record.table_file != PATHS_TABLE:
        raise SchemaError(
            f"{folder / PATHS_FILE} is of frame {record.frame} and table {record.table_file!r}; "
            f"expected frame {frame} and {PATHS_TABLE!r}. Remove it and render the run again."
        )
    return record


def open_frame_table(folder: Path, frame: int) -> tuple[PathsRecord, PathRows]:
    """Sidecar and memory-mapped table of a frame, checked against each other.

    Raises
    ------
    FrameFileError, SchemaError
        A file is missing or damaged, or they do not belong together.
    """
    record = read_paths_record(folder, frame)
    table = open_table(folder / PATHS_TABLE)
    if table.size != record.path_count:
        raise SchemaError(
            f"{folder / PATHS_TABLE} has {table.size} rows, its sidecar says {record.path_count}. "
            "Remove both and render the run again."
        )
    digest = file_sha256(folder / PATHS_TABLE)
    if digest != record.table_sha256:
        raise SchemaError(
            f"{folder / PATHS_TABLE} does not match its sidecar {PATHS_FILE}: SHA-256 "
            f"{digest[:12]}..., expected {record.table_sha256[:12]}... The file was changed: "
            "remove both and render the run again."
        )
    return record, table


def frame_motion(folder: Path, frame: int) -> FrameMotion | None:
    """Motion of what a frame's paths touch; None where the run has none.

    Raises
    ------
    FrameFileError, SchemaError
        A file is missing or damaged, or they do not belong together.
    """
    record = read_paths_record(folder, frame)
    if not record.motion_file:
        return None
    if record.motion_file != MOTION_FILE:
        raise SchemaError(
            f"{folder / PATHS_FILE} names the motion file {record.motion_file!r}; expected "
            f"{MOTION_FILE!r}. Remove it and render the run again."
        )
    return read_motion(folder, frame, record.motion_sha256)


def radiance_of(rows: PathRows, record: PathsRecord) -> NDArray[np.float64]:
    """Radiance [W m^-2 sr^-1] of rows: their power over receiver area and solid angle."""
    wavelength_m = SPEED_OF_LIGHT_MPS / record.carrier_hz
    area_m2 = float(effective_area_m2(wavelength_m))
    return np.asarray(rows["power_w"] / (area_m2 * rows["solid_angle_sr"]), dtype=np.float64)


def geometry_of(rows: PathRows) -> PathGeometry:
    """Vertices and directions of rows."""
    return PathGeometry(
        order=rows["order"].astype(np.int32),
        transparent_depth=rows["transparent_depth"].astype(np.int32),
        first_scatterer_m=np.array(rows["first_scatterer_m"]),
        last_scatterer_m=np.array(rows["last_scatterer_m"]),
        direction=np.array(rows["direction"]),
        first_object=np.array(rows["first_object"]),
        last_object=np.array(rows["last_object"]),
    )


def table_parts(
    folder: Path, frame: int, rows: int = 1 << 18
) -> Iterator[tuple[PathsRecord, PathRows]]:
    """The table in parts that fit into memory."""
    record, table = open_frame_table(folder, frame)
    for part in iter_rows(table, rows):
        yield record, part


def usable(rows: PathRows) -> NDArray[np.bool_]:
    """Rows that have a length, (n,)."""
    return np.asarray((rows["flags"] & PathFlag.NO_RANGE) == 0)


def is_mixed(rows: PathRows) -> NDArray[np.bool_]:
    """Rows whose pixel held several paths even so, (n,)."""
    return np.asarray((rows["flags"] & PathFlag.MIXED) != 0)


def motion_of_rows(rows: PathRows, scene: FrameMotion) -> KinematicMotion:
    """Motion of rows of a table.

    Raises
    ------
    ConfigError
        The rows name a body or a track that the motion does not have.
    """
    one = np.asarray(rows["order"] == 1)
    last = np.array(rows["last_scatterer_m"])
    first = np.where(one[:, None], last, rows["first_scatterer_m"])
    bodies = np.stack(
        [np.where(one, rows["last_body"], rows["first_body"]), rows["last_body"]], axis=-1
    )
    tracks = np.stack(
        [
            np.where(one, rows["last_surface_point"], rows["first_surface_point"]),
            rows["last_surface_point"],
        ],
        axis=-1,
    )
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
        bodies=bodies.astype(np.int32),
        tracks=tracks.astype(np.int32),
    )


def as_path_motion(rows: PathRows, scene: FrameMotion | None) -> PathMotion | None:
    """Motion of rows, or None where a run has none."""
    return None if scene is None else motion_of_rows(rows, scene)
