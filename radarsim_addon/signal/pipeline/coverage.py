# SPDX-License-Identifier: GPL-3.0-or-later
"""A coverage diagram to its files."""

from __future__ import annotations

from pathlib import Path

from ...atomic_files import make_folder
from ..pictures import COVERAGE_PICTURE, has_matplotlib, plot_coverage, save_figure
from ..products import write_coverage_files
from ..radar import Coverage, coverage_curve


def write_coverage(found: Coverage, folder: Path, curve_m: float | None = None) -> list[Path]:
    """Write a diagram as npz, its curve over height as CSV, and, with matplotlib, the picture.

    Parameters
    ----------
    found
        Diagram.
    folder
        Made if it is missing.
    curve_m
        Range of the curve [m]; None: the last one of the diagram.

    Returns
    -------
    list of Path
        Files written.

    Raises
    ------
    ConfigError
        The range of the curve is not above 0.
    OutputError
        A file cannot be written.
    """
    curve = coverage_curve(found, curve_m)
    files = write_coverage_files(found, curve, make_folder(folder))
    if has_matplotlib():
        files.append(save_figure(plot_coverage(found, curve), folder / COVERAGE_PICTURE))
    return files
