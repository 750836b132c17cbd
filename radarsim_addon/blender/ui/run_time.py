# SPDX-License-Identifier: GPL-3.0-or-later
"""How long a run takes, before it is begun."""

from __future__ import annotations

from typing import Any

from ...errors import RadarSimError
from ...findings import Finding, finding
from ..plan import Measurement, automatic_rings
from ..rig_settings import PROGRESS_PROPERTY, read_path_options
from ..scene import active_radar
from .fields import active_group
from .scene_reading import scene_record
from .translations import tr

#: Time beyond which a run is called long [s].
LONG_S = 900.0
#: Time of a frame besides its rays: preparation, table, motion [s].
_FRAME_S = 0.5


def effort(context: Any, measurement: Measurement) -> tuple[str, float]:
    """What a run takes, in words and in seconds: of rings the renders (0 s), of paths the time."""
    group = active_group(context.scene)
    try:
        if group.sampling_mode == "rings":
            record, rings = scene_record(context), measurement.rings
            if not rings and record is not None:
                rings = automatic_rings(measurement.ring_step_m, record.extent)
            if not rings:
                return tr("{count} renders per ring", count=measurement.renders(1)), 0.0
            count = measurement.renders(rings)
            return tr("{count} renders, {rings} rings", count=count, rings=rings), 0.0
        options = read_path_options(active_radar(context.scene))
    except RadarSimError:
        return tr("cannot measure"), 0.0
    rays = measurement.width_px * measurement.height_px * options.replicates
    per_ray_s = getattr(context.window_manager, PROGRESS_PROPERTY).seconds_per_ray
    looks = len(measurement.frames) * options.visibility_updates
    seconds = looks * (_FRAME_S + rays * options.max_reflections * per_ray_s)
    text = time_text(seconds)
    text = tr("at least {time}", time=text) if options.refines else tr("about {time}", time=text)
    return text, seconds


def time_text(seconds: float) -> str:
    """Return a time with a unit that suits it: "12 s", "3.4 min", "2.1 h"."""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{max(seconds, 1.0):.0f} s"


def long_run(context: Any, measurement: Measurement) -> list[Finding]:
    """Return the finding of a run that takes long; empty if it does not."""
    seconds = effort(context, measurement)[1]
    if seconds <= LONG_S:
        return []
    draft = active_group(context.scene).quality == "draft"
    return [finding("run-takes-long", hours=seconds / 3600, draft=int(draft))]
