# SPDX-License-Identifier: GPL-3.0-or-later
"""Coverage diagram as npz, and its curve over height as CSV."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from ...atomic_files import replaced, write_arrays
from ..radar import Coverage, CoverageCurve

_COLUMNS = (
    "height_m",
    "pattern_propagation_factor_f4",
    "relative_to_free_space",
    "flat_two_ray",
    "zone",
)


def write_coverage_files(found: Coverage, curve: CoverageCurve, folder: Path) -> list[Path]:
    """Write ``coverage.npz`` and ``coverage.csv``.

    Parameters
    ----------
    found
        Diagram.
    curve
        Its curve at one range.
    folder
        Existing folder.

    Returns
    -------
    list of Path
        Both files; see docs/coverage.md for their contents.
    """
    setup = found.setup
    arrays = {
        "range_m": found.range_m,
        "height_m": found.height_m,
        "pattern_propagation_factor_f4": found.factor,
        "relative_to_free_space": found.ground_gain,
        "zone": found.zone,
        "transmitter_height_m": setup.transmitter.height_m,
        "receiver_height_m": setup.receiver.height_m,
        "wavelength_m": setup.wavelength_m,
        "polarisation": setup.polarisation,
        "ground_index": setup.ground.index,
        "ground_rms_height_m": setup.ground.rms_height_m,
        "earth_radius_m": setup.radius_m,
        "curve_range_m": curve.range_m,
    }
    whole, table = folder / "coverage.npz", folder / "coverage.csv"
    write_arrays(whole, arrays)
    columns = (found.height_m, curve.factor, curve.ground_gain, curve.two_ray, curve.zone)
    with replaced(table) as temporary, open(temporary, "w", encoding="utf-8", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(_COLUMNS)
        writer.writerows(np.stack(columns, axis=1).tolist())
    return [whole, table]
