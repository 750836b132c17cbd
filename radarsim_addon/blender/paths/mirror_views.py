# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders with the transmitter in the places of its images, and the rows that come out of them."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from ...signal.paths import PathRows
from ..views import TracedReplicate
from .mirror_paths import MirrorPaths
from .quality import QualitySums
from .row_finisher import RowFinisher
from .tiles import Tile
from .view_tracer import PathTask, ViewTracer


@dataclass(frozen=True)
class MirrorViews:
    """Measures tile replicates over the mirrors of a frame."""

    tracer: ViewTracer
    finisher: RowFinisher
    mirrors: MirrorPaths

    def measure(
        self,
        number: int,
        tile: Tile,
        replicate: int,
        own: PathRows,
        traced: TracedReplicate,
        quality: QualitySums,
    ) -> Generator[PathTask, None, tuple[PathRows, int]]:
        """Make the renders of all images; return the rows of the tile replicate, and renders made.

        `own` are the rows without images, and `traced` is what they came from. What the mirrors
        change is added to `quality`.
        """
        rows, renders = [self.mirrors.number(own, traced, 0)], 0
        for image, place_m in enumerate(self.mirrors.lamps_m, start=1):
            found, origin_m, traced = yield from self.tracer.replicate_tasks(
                number, tile, replicate, image, self.mirrors.reflections(image)
            )
            renders += traced.renders
            (found,) = self.finisher.finish([(found, origin_m)], place_m)
            found = self.mirrors.number(found, traced, image)
            found, through_w = self.mirrors.choose(image, found)
            quality.through_mirrored_w += through_w
            quality.total_w += through_w
            rows.append(found)
        every, through_w = self.mirrors.with_both_ways(np.concatenate(rows))
        quality.through_mirrored_w += through_w
        quality.total_w += through_w
        quality.total_w += float(every["power_w"].sum() - own["power_w"].sum())
        return every, renders
