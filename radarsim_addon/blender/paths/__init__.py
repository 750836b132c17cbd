# SPDX-License-Identifier: GPL-3.0-or-later
"""Path sampling, one path per pixel: tiles, error estimate, table.

In: a plan and the scene. Out: the path table of each frame with its sidecar. `path_job` makes the
frames of a run; `frame` measures and refines the tiles of one (`tiles`: the field of view as a
partition; `glints`: bright spots that need finer ones; `measured_tiles`: rows and sums of measured
tiles; `error_budget`: which tiles to refine). `view_tracer` renders a tile replicate and decodes
its rows. `hit_points` moves their vertices onto the meshes in float64, `clutter_weights` corrects
powers of lobes that Cycles does not have. Paths over mirrors are those of `signal.tracing`;
`obstacles` finds what delays waves on ways that Cycles does not trace.
"""

from .path_job import PathJob

__all__ = [
    "PathJob",
]
