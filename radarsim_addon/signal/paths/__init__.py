# SPDX-License-Identifier: GPL-3.0-or-later
"""The path table: columns, flags, selection, geometry, pixel footprints.

In: the table of a frame, or lengths and powers of your own. Out: `Paths` (path lengths [m],
radiances [W/m^2/sr], solid angles [sr]) and the table's rows.
"""

from .channel_motion import channel_lengths
from .flags import PATH_FLAGS, Flags, PathFlag
from .footprints import (
    Points,
    Steps,
    spread,
    steps_of,
    tiles_by_replicate,
    views_by_replicate,
)
from .geometry import PathGeometry
from .paths import NEGLIGIBLE_FRACTION, PathCounts, Paths, make_paths, path_power_w
from .pixel_spacing import GridPlaces, Places, joined_places
from .range_bins import power_of_range_bins
from .replicates import MOST_UNCERTAIN, edge_variances, lone_variances, replicate_offset_px
from .rows import (
    AnyRows,
    Columns,
    PathColumns,
    chosen_rows,
    has_curved_images,
    has_images,
    read_columns,
    scatterer_rows,
    widened,
    write_columns,
)
from .table import (
    COLUMN_GROUPS,
    CURVED_IMAGE_DTYPE,
    IMAGE_DTYPE,
    PATH_DTYPE,
    PathRows,
    TableFile,
    column_groups,
    iter_rows,
    open_table,
    write_table,
)
from .table_files import (
    frame_motion,
    geometry_of,
    images_of,
    motion_of_rows,
    open_frame_table,
    planes_of,
    radiance_of,
    read_paths_record,
    usable,
)
from .table_footprints import TableFootprints
from .triangles import Spaces, TriangleMesh
from .unrendered import unrendered_record

__all__ = [
    "COLUMN_GROUPS",
    "CURVED_IMAGE_DTYPE",
    "IMAGE_DTYPE",
    "MOST_UNCERTAIN",
    "NEGLIGIBLE_FRACTION",
    "PATH_DTYPE",
    "PATH_FLAGS",
    "AnyRows",
    "Columns",
    "Flags",
    "GridPlaces",
    "PathColumns",
    "PathCounts",
    "PathFlag",
    "PathGeometry",
    "PathRows",
    "Paths",
    "Places",
    "Points",
    "Spaces",
    "Steps",
    "TableFile",
    "TableFootprints",
    "TriangleMesh",
    "channel_lengths",
    "chosen_rows",
    "column_groups",
    "edge_variances",
    "frame_motion",
    "geometry_of",
    "has_curved_images",
    "has_images",
    "images_of",
    "iter_rows",
    "joined_places",
    "lone_variances",
    "make_paths",
    "motion_of_rows",
    "open_frame_table",
    "open_table",
    "path_power_w",
    "planes_of",
    "power_of_range_bins",
    "radiance_of",
    "read_columns",
    "read_paths_record",
    "replicate_offset_px",
    "scatterer_rows",
    "spread",
    "steps_of",
    "tiles_by_replicate",
    "unrendered_record",
    "usable",
    "views_by_replicate",
    "widened",
    "write_columns",
    "write_table",
]
