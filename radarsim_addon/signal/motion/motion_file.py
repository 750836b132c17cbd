# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of a radar frame on disk: ``motion.json`` and two files of plain arrays next to it.

``deforming_surfaces.npz``: points on deforming surfaces are numbered from 1. ``track_body`` (n,)
numbers the body, ``track_vertices`` (n, 3) and ``track_weights`` (n, 3) give three vertices of its
mesh and their barycentric weights. For each such body b, ``edges_s_b`` (segments + 1,) and
``series_b`` (segments, degrees, vertices, 3) are Chebyshev series of the vertices' positions in the
body's own axes [m].

``still_bodies.npz``: bodies that are stationary, written if there are many, one row each:
``number`` (n,), its number in the frame from 1, ascending; ``pose`` (n, 4, 4), translation in
metres; ``object`` and ``instance`` (n,), names in UTF-8.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from ...arrays import Int32, Integers, Real, read_npz
from ...atomic_files import write_arrays
from ...contract import (
    DEFORMING_SURFACES_FILE,
    MOTION_FILE,
    STILL_BODIES_FILE,
    BodyRecord,
    ImageRecord,
    MotionRecord,
    SegmentRecord,
)
from ...errors import FrameFileError, SchemaError
from ...typed_json import file_sha256, read_record
from .body_motion import BodyMotion, Segment, which_move

Item = TypeVar("Item")

#: What to do about a file that is not as it was written, in whatever way.
RENDER_AGAIN = "Render the run again: it renders this frame and keeps the others."
_KINDS = {"number": "iu", "pose": "f", "object": "S", "instance": "S"}


@dataclass(frozen=True)
class StillBodies:
    """Bodies of a frame that are stationary, n rows."""

    number: Integers
    pose: Real
    object: Sequence[str]
    instance: Sequence[str]

    def __len__(self) -> int:
        return int(self.number.size)

    def among(self, others: Sequence[Item], mine: Sequence[Item]) -> list[Item]:
        """Merge a list for the other bodies of the frame and a list for the stationary ones, in the
        order of the numbers.
        """
        found: list[Item] = list(others)
        for number, one in zip(self.number.tolist(), mine, strict=True):
            found.insert(number - 1, one)
        return found


@dataclass(frozen=True)
class VertexSeries:
    """Positions of vertices in a body's own axes [m], as Chebyshev series in segments of time."""

    #: Limits of the segments, (segments + 1,) [s].
    edges_s: Real
    #: Coefficients, (segments, degrees, vertices, 3) [m].
    series: Real

    def positions(self, vertices: Int32, times_s: Real) -> Real:
        """Return positions, (times, *vertices.shape, 3) [m]."""
        which = np.clip(
            np.searchsorted(self.edges_s, times_s, side="right") - 1, 0, len(self.series) - 1
        )
        found = np.empty((times_s.size, *vertices.shape, 3))
        for number in np.unique(which):
            rows = np.flatnonzero(which == number)
            start_s, stop_s = self.edges_s[number : number + 2]
            x = 2 * (times_s[rows] - start_s) / (stop_s - start_s) - 1
            basis = chebyshev.chebvander(x, self.series.shape[1] - 1)
            found[rows] = np.tensordot(basis, self.series[number][:, vertices], axes=1)
        return found

    def velocities(self, vertices: Int32, time_s: float) -> Real:
        """Return velocities at a time, (*vertices.shape, 3) [m/s]."""
        number = int(np.searchsorted(self.edges_s[1:-1], time_s, side="right"))
        series = self.series[number][:, vertices]
        start_s, stop_s = self.edges_s[number : number + 2]
        per_s = 2 / (stop_s - start_s)
        x = (time_s - start_s) * per_s - 1
        rates = chebyshev.chebval(x, chebyshev.chebder(series, axis=0))
        return np.asarray(rates * per_s)


@dataclass(frozen=True)
class Tracks:
    """Points on surfaces that deform; number n of a table's column is row n - 1."""

    #: Number of the body, from 1, (n,).
    body: Int32
    #: Three vertices of its mesh and their barycentric weights, (n, 3).
    vertices: Int32
    weights: Real
    #: Positions of the vertices by the number of the body.
    series: Mapping[int, VertexSeries]


@dataclass(frozen=True)
class FrameMotion:
    """Motion of a radar frame's bodies: number n of a table's column is ``bodies[n - 1]``."""

    #: Of the burst [s].
    span_s: float
    receiver: BodyMotion
    emitter: BodyMotion
    orthographic: bool
    bodies: Sequence[BodyMotion]
    #: Points on deforming surfaces; None without any.
    tracks: Tracks | None = None
    #: Time of the table within the burst [s].
    epoch_offset_s: float = 0.0
    #: Names of object and instance of each body, the same in all frames.
    body_keys: Sequence[str] = ()
    #: Images of the antennas that the table numbers, from 1; they move with antennas and mirrors.
    images: Sequence[ImageRecord] = ()
    #: Box of the mesh of each body that turns, (2, 3) in its own axes [m at scale 1], or None.
    boxes: Sequence[Real | None] = ()

    @property
    def moving(self) -> bool:
        antennas = self.receiver.moving or self.emitter.moving
        return self.tracks is not None or antennas or bool(which_move(self.bodies).any())


def body_record(
    name: str, instance: str, motion: BodyMotion, deforms: bool, box: Real | None = None
) -> BodyRecord:
    """Return the record of a body. It keeps the box (2, 3) of the mesh, in the body's own axes [m
    at scale 1], of a body that turns.
    """
    return BodyRecord(
        object=name,
        instance=instance,
        pose=motion.pose.tolist(),
        deforms=deforms,
        segments=[
            SegmentRecord(
                start_s=segment.start_s,
                stop_s=segment.stop_s,
                translation=segment.translation.tolist(),
                rotation_centre=segment.rotation_centre.tolist(),
                rotation=segment.rotation.tolist(),
                initial_orientation=segment.initial_orientation.tolist(),
                linear=[] if segment.linear is None else segment.linear.tolist(),
            )
            for segment in motion.segments
        ],
        noise_m=motion.noise_m,
        displacement_error_bound_m=motion.displacement_error_bound_m,
        box=[] if box is None or not motion.turning else box.tolist(),
    )


def write_still_bodies(folder: Path, bodies: StillBodies) -> Path:
    path = folder / STILL_BODIES_FILE
    arrays = {
        "number": bodies.number,
        "pose": bodies.pose,
        "object": np.array([name.encode() for name in bodies.object]),
        "instance": np.array([name.encode() for name in bodies.instance]),
    }
    write_arrays(path, arrays)
    return path


def write_tracks(folder: Path, tracks: Tracks) -> Path:
    arrays: dict[str, Any] = {
        "track_body": tracks.body,
        "track_vertices": tracks.vertices,
        "track_weights": tracks.weights,
    }
    for body, series in tracks.series.items():
        arrays[f"edges_s_{body}"] = series.edges_s
        arrays[f"series_{body}"] = series.series
    path = folder / DEFORMING_SURFACES_FILE
    write_arrays(path, arrays)
    return path


def read_motion(folder: Path, frame: int, sha256: str) -> FrameMotion:
    """Read the motion of a radar frame, checked against the digest of its file in ``paths.json``.
    Stationary bodies of a file of their own are put back in their places.
    """
    path = folder / MOTION_FILE
    record = read_record(path, MotionRecord)
    if record.frame != frame or file_sha256(path) != sha256:
        raise SchemaError(
            f"{path} does not belong to the path table in its folder. Remove the paths.json there "
            "and render the run again."
        )
    if len(record.antennas) != 2 or not record.duration_s >= 0:
        raise SchemaError(
            f"{path} has {len(record.antennas)} antennas over {record.duration_s!r} s; expected "
            "receiver and transmitter, over a time from 0. Render the frame again."
        )
    still = read_still_bodies(folder, record)
    count = len(record.bodies) + (0 if still is None else len(still))
    tracks = None
    if record.deforming_surfaces_file:
        named = record.deforming_surfaces_file, DEFORMING_SURFACES_FILE
        with _own_file(path, *named, "deforming surfaces", record.deforming_surfaces_sha256) as own:
            tracks = _read_tracks(own, count)
    at_s = record.epoch_offset_s
    receiver, emitter = (_body(body, f"{path}: {body.object}", at_s) for body in record.antennas)
    places = [f"{path}: {body.object}" for body in record.bodies]
    pairs = list(zip(record.bodies, places, strict=True))
    bodies = [_body(body, where, at_s) for body, where in pairs]
    boxes = [_box(body, where) for body, where in pairs]
    keys = [_key(body.object, body.instance) for body in record.bodies]
    if still is not None:
        stationary = [BodyMotion(pose, epoch_offset_s=at_s) for pose in still.pose]
        names = map(_key, still.object, still.instance)
        bodies, boxes = still.among(bodies, stationary), still.among(boxes, [None] * len(still))
        keys = still.among(keys, list(names))
    return FrameMotion(
        span_s=record.duration_s,
        receiver=receiver,
        emitter=emitter,
        orthographic=record.receiver_kind == "orthographic",
        bodies=bodies,
        tracks=tracks,
        epoch_offset_s=at_s,
        boxes=boxes,
        body_keys=keys,
    )


def _key(name: str, instance: str) -> str:
    return f"{name}\0{instance}"


def _body(record: BodyRecord, where: str, epoch_offset_s: float) -> BodyMotion:
    segments = []
    for number, segment in enumerate(record.segments):
        here = f"{where}, segment {number}"
        starts_late = number > 0 and segment.start_s < record.segments[number - 1].stop_s
        if not segment.stop_s > segment.start_s or starts_late:
            raise FrameFileError(
                f"{here} runs from {segment.start_s!r} to {segment.stop_s!r} s; expected "
                "segments in order of time. Render the frame again."
            )
        move = _array(segment.translation, (None, 3), here)
        linear = _array(segment.linear, (None, 9), here) if segment.linear else None
        if not len(move):
            raise FrameFileError(f"{here} has no translation. Render the frame again.")
        segments.append(
            Segment(
                segment.start_s,
                segment.stop_s,
                move,
                _array(segment.rotation_centre, (3,), here),
                _array(segment.rotation, (None, 3), here),
                _array(segment.initial_orientation, (3, 3), here),
                linear,
            )
        )
    pose = _array(record.pose, (4, 4), where)
    return BodyMotion(
        pose, tuple(segments), record.noise_m, record.displacement_error_bound_m, epoch_offset_s
    )


def _box(record: BodyRecord, where: str) -> Real | None:
    if not record.box:
        return None
    box = _array(record.box, (2, 3), f"{where}, box")
    if not (np.isfinite(box).all() and (box[0] <= box[1]).all()):
        raise FrameFileError(
            f"{where} has the box {record.box!r:.80}; expected a low and a high corner. Render the "
            "frame again."
        )
    return box


def _array(values: ArrayLike, shape: tuple[int | None, ...], where: str) -> Real:
    array = np.array(values, dtype=np.float64)
    if array.size == 0 and shape[0] is None:
        array = array.reshape(tuple(n or 0 for n in shape))
    fits = array.ndim == len(shape) and all(
        n is None or n == have for n, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        wanted = " x ".join("any" if n is None else str(n) for n in shape)
        raise FrameFileError(
            f"{where} has the shape {array.shape}; expected {wanted}. The file was not written by "
            "radarsim, or was edited: render the frame again."
        )
    return array


@contextmanager
def _own_file(motion: Path, given: str, name: str, what: str, sha256: str) -> Iterator[Path]:
    """Give the path of a file next to that of the motion, and check its digest afterwards.

    Errors of reading it, and of the checks of its arrays, name the file.
    """
    if given != name:
        raise SchemaError(
            f"{motion} names the file {given!r} of {what}; expected {name!r}. {RENDER_AGAIN}"
        )
    path = motion.with_name(name)
    try:
        yield path
    except FileNotFoundError as error:
        raise FrameFileError(f"{path} is missing. {RENDER_AGAIN}") from error
    # zipfile and zlib raise errors of many kinds on damaged files
    except Exception as error:
        raise FrameFileError(
            f"{path} cannot be read as {what} ({error}). {RENDER_AGAIN}"
        ) from error
    if file_sha256(path) != sha256:
        raise SchemaError(f"{path} was changed, or belongs to another frame. {RENDER_AGAIN}")


def read_still_bodies(folder: Path, record: MotionRecord) -> StillBodies | None:
    """Read and check the file of stationary bodies of a frame; None where its record names none."""
    if not record.still_bodies_file:
        return None
    named = record.still_bodies_file, STILL_BODIES_FILE
    motion, digest = folder / MOTION_FILE, record.still_bodies_sha256
    with _own_file(motion, *named, "stationary bodies", digest) as path:
        arrays = read_npz(path, _KINDS)
        for name, kind in _KINDS.items():
            if arrays[name].dtype.kind not in kind:
                raise ValueError(f"{name} holds values of type {arrays[name].dtype}")
        names = ([name.decode() for name in arrays[key].tolist()] for key in ("object", "instance"))
        found = StillBodies(
            arrays["number"].astype(np.int64), arrays["pose"].astype(np.float64), *names
        )
        _check_still_bodies(found, len(record.bodies))
    return found


def _check_still_bodies(found: StillBodies, others: int) -> None:
    number, count = found.number, found.number.size
    if number.ndim != 1 or found.pose.shape != (count, 4, 4):
        raise ValueError(f"numbers of shape {number.shape}, poses of shape {found.pose.shape}")
    if len(found.object) != count or len(found.instance) != count:
        raise ValueError(f"{len(found.object)} objects and {len(found.instance)} instances")
    if count and (number[0] < 1 or number[-1] > count + others or (np.diff(number) <= 0).any()):
        raise ValueError(f"numbers must ascend and lie between 1 and {count + others}")
    if not np.isfinite(found.pose).all():
        raise ValueError("poses that are not finite")


def _read_tracks(path: Path, bodies: int) -> Tracks:
    """Read and check points of deforming surfaces; ValueError where they cannot be."""
    arrays = read_npz(path)
    for name, array in arrays.items():
        expected = "iu" if name in ("track_body", "track_vertices") else "f"
        if array.dtype.kind not in expected:
            raise ValueError(f"{name} holds values of type {array.dtype}")
    tracks = Tracks(
        arrays["track_body"].astype(np.int32),
        arrays["track_vertices"].astype(np.int32),
        arrays["track_weights"].astype(np.float64),
        {
            int(body): VertexSeries(arrays[f"edges_s_{body}"], arrays[f"series_{body}"])
            for body in np.unique(arrays["track_body"]).tolist()
        },
    )
    count = tracks.body.size
    if tracks.vertices.shape != (count, 3) or tracks.weights.shape != (count, 3):
        raise ValueError(f"{count} tracks with {tracks.vertices.shape} vertices")
    if count and not (tracks.body.min() >= 1 and tracks.body.max() <= bodies):
        raise ValueError(f"bodies up to {tracks.body.max()}, there are {bodies}")
    # of a point on a triangle they are from 0 to 1, and a little beyond by rounding
    if not (np.abs(tracks.weights) <= 1000).all():
        raise ValueError("weights of corners that are no numbers up to 1000")
    for body, series in tracks.series.items():
        used = tracks.vertices[tracks.body == body]
        shape = series.series.shape
        if len(shape) != 4 or shape[3] != 3 or series.edges_s.shape != (shape[0] + 1,):
            raise ValueError(f"series of shape {shape} and {series.edges_s.shape} edges")
        if not (np.diff(series.edges_s) > 0).all() or not np.isfinite(series.series).all():
            raise ValueError("series that are not finite and in order")
        if used.size and not (used.min() >= 0 and used.max() < shape[2]):
            raise ValueError(f"vertices up to {used.max()}, there are {shape[2]}")
    return tracks
