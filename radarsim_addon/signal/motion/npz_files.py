# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays of an .npz file that may come from anywhere: no objects, and no more than is claimed."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy_format

#: What to do about a file that is not as it was written, in whatever way. A render that is done
#: again takes the frames that are whole as they are.
RENDER_AGAIN = "Render the run again: it renders this frame and keeps the others."
#: Largest size that the headers of a file may claim [bytes].
_MAX_BYTES = 1 << 34


def plain_arrays(path: Path) -> dict[str, Any]:
    """Return the arrays of an .npz with headers that claim an allowed size.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    dict
        By name.

    Raises
    ------
    ValueError
        Objects, or too large a size. Damaged files raise errors of many kinds.
    """
    claimed = 0
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            with archive.open(name) as stream:
                npy_format.read_magic(stream)
                shape, _, dtype = npy_format.read_array_header_1_0(stream)
            if dtype.hasobject:
                raise ValueError(f"{name} holds objects")
            claimed += int(np.prod(shape, dtype=object)) * dtype.itemsize
    if claimed > _MAX_BYTES:
        raise ValueError(f"{claimed} bytes; expected at most {_MAX_BYTES}")
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}
