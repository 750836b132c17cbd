# SPDX-License-Identifier: GPL-3.0-or-later
"""The path table: one row for each pixel with an echo, and the surface that a row stands for.

In: the table of a frame, or your own lengths and powers. Out: `Paths` (path lengths [m], radiances
[W/m^2/sr], solid angles [sr]) and the rows of the table.

`table` has the rows as columns, and their file. `table_files` opens and checks the table of a
frame, and computes lengths, geometry and motion of its rows. `paths` has the paths in memory: their
selection, power, and lengths between displaced antenna elements. A path stands for the whole
surface in its pixel. `footprints` spreads it over points between the neighbouring rays;
`table_footprints` does this with places in space, and for range bins. `replicates` has the
sub-pixel offsets of a pixel grid, and the error at edges along the grid. `triangles` finds in
float64 where rays hit a mesh.
"""

from .footprints import (
    GridPlaces,
    Places,
    Points,
    Steps,
    joined_places,
    spread,
    steps_of,
    tiles_by_replicate,
    views_by_replicate,
)
from .paths import (
    MOST_SHARED,
    NEGLIGIBLE_FRACTION,
    PATH_FLAGS,
    Flags,
    PathCounts,
    PathFlag,
    PathGeometry,
    Paths,
    SharedValues,
    channel_lengths,
    make_paths,
    path_power_w,
)
from .replicates import MOST_UNCERTAIN, edge_variances, lone_variances, replicate_offset_px
from .table import (
    COLUMN_GROUPS,
    CURVED_IMAGE_DTYPE,
    IMAGE_DTYPE,
    PATH_DTYPE,
    PathRows,
    TableFile,
    column_groups,
    has_curved_images,
    has_digests,
    has_images,
    iter_rows,
    open_table,
    scatterer_rows,
    unrendered_record,
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
from .table_footprints import TableFootprints, power_of_range_bins
from .triangles import Spaces, TriangleMesh

__all__ = [
    "COLUMN_GROUPS",
    "CURVED_IMAGE_DTYPE",
    "IMAGE_DTYPE",
    "MOST_SHARED",
    "MOST_UNCERTAIN",
    "NEGLIGIBLE_FRACTION",
    "PATH_DTYPE",
    "PATH_FLAGS",
    "Flags",
    "GridPlaces",
    "PathCounts",
    "PathFlag",
    "PathGeometry",
    "PathRows",
    "Paths",
    "Places",
    "Points",
    "SharedValues",
    "Spaces",
    "Steps",
    "TableFile",
    "TableFootprints",
    "TriangleMesh",
    "channel_lengths",
    "column_groups",
    "edge_variances",
    "frame_motion",
    "geometry_of",
    "has_curved_images",
    "has_digests",
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
    "read_paths_record",
    "replicate_offset_px",
    "scatterer_rows",
    "spread",
    "steps_of",
    "tiles_by_replicate",
    "unrendered_record",
    "usable",
    "views_by_replicate",
    "write_table",
]
