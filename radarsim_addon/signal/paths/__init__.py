# SPDX-License-Identifier: GPL-3.0-or-later
"""The path table: columns, flags, selection, geometry, pixel footprints.

In: the table of a frame, or lengths and powers of your own. Out: `Paths` (path lengths [m],
radiances [W/m^2/sr], solid angles [sr]) and the table's rows.
"""

from .flags import Flags, PathFlag
from .footprints import Points, Steps, spread, steps_of, views_by_shift
from .geometry import PathGeometry
from .paths import PathCounts, Paths, join_paths, make_paths, path_amplitude, path_power_w
from .replicates import edge_variances, lone_variances, shift_px
from .table import PATH_DTYPE, PathRows, iter_rows, write_table
from .table_files import (
    as_path_motion,
    frame_motion,
    geometry_of,
    is_mixed,
    motion_of_rows,
    open_frame_table,
    radiance_of,
    read_paths_record,
    table_parts,
    usable,
)

__all__ = [
    "PATH_DTYPE",
    "Flags",
    "PathCounts",
    "PathFlag",
    "PathGeometry",
    "PathRows",
    "Paths",
    "Points",
    "Steps",
    "as_path_motion",
    "edge_variances",
    "frame_motion",
    "geometry_of",
    "is_mixed",
    "iter_rows",
    "join_paths",
    "lone_variances",
    "make_paths",
    "motion_of_rows",
    "open_frame_table",
    "path_amplitude",
    "path_power_w",
    "radiance_of",
    "read_paths_record",
    "shift_px",
    "spread",
    "steps_of",
    "table_parts",
    "usable",
    "views_by_shift",
    "write_table",
]
