# SPDX-License-Identifier: GPL-3.0-or-later
"""The evaluated scene of a view layer."""

from __future__ import annotations

from typing import Any


def evaluated_depsgraph(view_layer: Any) -> Any:
    """The view layer's depsgraph, brought up to date."""
    view_layer.update()
    return view_layer.depsgraph
