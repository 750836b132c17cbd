# SPDX-License-Identifier: GPL-3.0-or-later
"""Which last vertices each render of a tile replicate marks. Does not import bpy.

The place of a last vertex is the ratio of two renders of its path class's marks: with the place in
their colours, and white. Every render with the same random paths can bring one of the two, whatever
path class the transmitter shines on in it. A class with both needs no render of its own for them.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...array_types import Real
from .requests import RenderRequest, VertexMark, View

#: Least light that float32 holds with all its digits.
_TINY = float(np.finfo(np.float32).tiny)


class MarkedVertices:
    """Marks of path classes in the renders of one tile replicate.

    Parameters
    ----------
    max_reflections, max_depth, all_opaque
        As in `TraceLimits`.
    enabled
        Whether renders can bring marks.
    """

    def __init__(
        self, max_reflections: int, max_depth: int, all_opaque: bool, enabled: bool
    ) -> None:
        self._max_reflections, self._max_depth = max_reflections, max_depth
        self._all_opaque, self._enabled = all_opaque, enabled
        #: Renders of marks; the second key is whether their blue has range encoding.
        self._views: dict[tuple[VertexMark, bool], View] = {}

    def choose(
        self, request: RenderRequest, path_class: tuple[int, int], echoes: bool = False
    ) -> VertexMark | None:
        """Return what a render should mark: half of the marks of a path class or of the next ones.

        Parameters
        ----------
        request
            The render.
        path_class
            Order and depth of the first one of which something may be left.
        echoes
            The render is that of the echoes of this class. If it has none of its marks yet, half of
            them is of no use: the transmitter's colours will have to tell the vertex.

        Returns
        -------
        VertexMark or None
            None where nothing is left to mark, or the paths would not be those of the renders that
            bring the other half.
        """
        asked = request.path_class
        # Rays that pass surfaces with certainty take other paths than rays that leave it to chance.
        certain = asked.surface_depth is not None and not self._all_opaque
        if not self._enabled or not request.encoded or certain or asked.order_max is None:
            return None
        if path_class[0] == 1:  # its vertex is known
            path_class, echoes = (2, 0), False
        if echoes and (VertexMark(*path_class, False), request.all_channels) not in self._views:
            path_class = self.after(*path_class)
        # A ray meets one more surface than it is reflected by; but if it may only end there, it
        # passes what is transparent before with certainty.
        highest = asked.order_max + self._all_opaque
        for order, depth in self._classes(*path_class):
            if order > highest:
                return None
            for place in (False, True):
                mark = VertexMark(order, depth, place)
                if (mark, request.all_channels) not in self._views:
                    return mark
        return None

    def keep(self, request: RenderRequest, view: View) -> None:
        """Keep the marks that a render has brought."""
        if request.mark is not None and view.marks is not None:
            self._views[request.mark, request.all_channels] = view.marks

    def found(
        self, order: int, depth: int, all_channels: bool, amplitude: Real
    ) -> tuple[View, View] | None:
        """Return the marks of a path class with and without the place in their colours.

        None where one of the two is missing in a pixel with an `amplitude`, (h, w).
        """
        keys = [(VertexMark(order, depth, place), all_channels) for place in (True, False)]
        if not all(key in self._views for key in keys):
            return None
        coloured, white = (self._views[key] for key in keys)
        lit = np.flatnonzero(amplitude > 0)
        whole = all(np.all(view.colours(lit) >= _TINY) for view in (coloured, white))
        return (coloured, white) if whole else None

    def after(self, order: int, depth: int) -> tuple[int, int]:
        """Return the next path class of which something may be left."""
        return (order + 1, 0) if self._all_opaque else (order, depth + 1)

    def _classes(self, order: int, depth: int) -> Iterator[tuple[int, int]]:
        """This path class and those after it."""
        while order <= self._max_reflections and depth <= self._max_depth:
            yield order, depth
            order, depth = self.after(order, depth)
