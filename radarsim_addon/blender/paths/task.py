# SPDX-License-Identifier: GPL-3.0-or-later
"""One render of a path job, as the drivers of a job see it."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from ... import contract
from ..plan import Instant
from ..views import RenderRequest

if TYPE_CHECKING:
    pass


@dataclasses.dataclass(frozen=True)
class PathTask:
    """One render of a view."""

    frame: int
    instant: Instant
    tile: int
    shift: int
    request: RenderRequest

    @property
    def exr_path(self) -> str:
        """What an error message calls this render."""
        return f"{contract.frame_dir(self.frame)}, tile {self.tile}, shift {self.shift}"
