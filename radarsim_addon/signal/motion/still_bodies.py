# SPDX-License-Identifier: GPL-3.0-or-later
"""``still_bodies.npz``: bodies of a radar frame that are stationary, written if there are many.

Plain arrays, one row a body: ``number`` (n,), its number in the frame from 1, ascending; ``pose``
(n, 4, 4), translation in metres; ``object`` and ``instance`` (n,), names in UTF-8.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from ...array_files import read_npz
from ...array_types import Integers, Real
from ...atomic_files import write_arrays
from ...contract import MOTION_FILE, STILL_BODIES_FILE
from ...errors import FrameFileError, SchemaError
from ...motion_record import MotionRecord
from ...sidecar import file_sha256

Item = TypeVar("Item")

#: What to do about a file that is not as it was written, in whatever way.
RENDER_AGAIN = "Render the run again: it renders this frame and keeps the others."
_KINDS = {"number": "iu", "pose": "f", "object": "S", "instance": "S"}


@dataclass(frozen=True)
class StillBodies:
    """Bodies of a frame that are stationary.

    Attributes
    ----------
    number
        Their numbers in the frame, from 1, ascending, (n,).
    pose
        Poses, translation in metres, (n, 4, 4).
    object, instance
        Names as `BodyRecord` has them, n each.
    """

    number: Integers
    pose: Real
    object: Sequence[str]
    instance: Sequence[str]

    def __len__(self) -> int:
        return int(self.number.size)

    def among(self, others: Sequence[Item], mine: Sequence[Item]) -> list[Item]:
        """Return one list of what belongs to the other bodies of the frame, and to these."""
        found: list[Item] = list(others)
        for number, one in zip(self.number.tolist(), mine, strict=True):
            found.insert(number - 1, one)
        return found


def write_still_bodies(folder: Path, bodies: StillBodies) -> Path:
    """Write ``still_bodies.npz``.

    Parameters
    ----------
    folder
        Folder of the frame.
    bodies
        Stationary bodies.

    Returns
    -------
    Path
        The file.
    """
    path = folder / STILL_BODIES_FILE
    arrays = {
        "number": bodies.number,
        "pose": bodies.pose,
        "object": np.array([name.encode() for name in bodies.object]),
        "instance": np.array([name.encode() for name in bodies.instance]),
    }
    write_arrays(path, arrays)
    return path


def read_still_bodies(folder: Path, record: MotionRecord) -> StillBodies | None:
    """Read and check the file of stationary bodies of a frame.

    Parameters
    ----------
    folder
        Folder of the frame.
    record
        Motion of the frame, without its stationary bodies.

    Returns
    -------
    StillBodies
        None where the record names no file.

    Raises
    ------
    FrameFileError, SchemaError
        The file is missing, damaged or of another frame.
    """
    if not record.still_bodies_file:
        return None
    path = folder / STILL_BODIES_FILE
    if record.still_bodies_file != STILL_BODIES_FILE:
        raise SchemaError(
            f"{folder / MOTION_FILE} names the file {record.still_bodies_file!r} of stationary "
            f"bodies; expected {STILL_BODIES_FILE!r}. {RENDER_AGAIN}"
        )
    found = _read(path, len(record.bodies))
    if file_sha256(path) != record.still_bodies_sha256:
        raise SchemaError(f"{path} was changed, or belongs to another frame. {RENDER_AGAIN}")
    return found


def _read(path: Path, others: int) -> StillBodies:
    try:
        arrays = read_npz(path, _KINDS)
        for name, kind in _KINDS.items():
            if arrays[name].dtype.kind not in kind:
                raise ValueError(f"{name} holds values of type {arrays[name].dtype}")
        names = ([name.decode() for name in arrays[key].tolist()] for key in ("object", "instance"))
        found = StillBodies(
            arrays["number"].astype(np.int64), arrays["pose"].astype(np.float64), *names
        )
        _check(found, others)
    except FileNotFoundError as error:
        raise FrameFileError(f"{path} is missing. {RENDER_AGAIN}") from error
    # zipfile and zlib raise errors of many kinds on damaged files
    except Exception as error:
        raise FrameFileError(
            f"{path} cannot be read as stationary bodies ({error}). {RENDER_AGAIN}"
        ) from error
    return found


def _check(found: StillBodies, others: int) -> None:
    number, count = found.number, found.number.size
    if number.ndim != 1 or found.pose.shape != (count, 4, 4):
        raise ValueError(f"numbers of shape {number.shape}, poses of shape {found.pose.shape}")
    if len(found.object) != count or len(found.instance) != count:
        raise ValueError(f"{len(found.object)} objects and {len(found.instance)} instances")
    if count and (number[0] < 1 or number[-1] > count + others or (np.diff(number) <= 0).any()):
        raise ValueError(f"numbers must ascend and lie between 1 and {count + others}")
    if not np.isfinite(found.pose).all():
        raise ValueError("poses that are not finite")
