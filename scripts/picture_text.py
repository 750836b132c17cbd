# SPDX-License-Identifier: GPL-3.0-or-later
"""Letters of the documentation's pictures: readable at half the size of a picture."""

from __future__ import annotations

from typing import Any


def use_readable_text(pyplot: Any) -> None:
    """Set the sizes of matplotlib's letters [pt]."""
    pyplot.rcParams.update(
        {"font.size": 13, "axes.titlesize": 14, "legend.fontsize": 12, "legend.framealpha": 0.6}
    )
