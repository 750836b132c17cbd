# SPDX-License-Identifier: GPL-3.0-or-later
"""Building materials and grounds of Recommendation ITU-R P.2040, Table 3.

eps' = a f^b, sigma = c f^d [S/m], f in GHz; eps'' = sigma / (2 pi f eps_0).

The edition matters: P.2040-1 (2015) has other numbers for several materials (concrete 5.31 there,
5.24 here). The rows named ``ITU_EDITION`` are those of P.2040-2 (2021) and P.2040-3 (2023), which
agree. Asphalt concrete, vinyl tile and carpet tile were added with P.2040-4 (2025), whose text was
not at hand: they come from two implementations of it that agree, and carry ``ITU_NEW_EDITION``.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from ..array_types import Complex, Real
from .constants import VACUUM_PERMITTIVITY_F_PER_M
from .material_model import MaterialModel

ITU_EDITION = "P.2040-3, 2023, Table 3"
ITU_NEW_EDITION = "P.2040-4, 2025, Table 3, from secondary sources"


class ItuRow(NamedTuple):
    """Coefficients of a material in a band.

    Attributes
    ----------
    low_ghz, high_ghz
        Band [GHz].
    a, b, c, d
        eps' = a f^b, sigma = c f^d, f in GHz, sigma in S/m.
    """

    low_ghz: float
    high_ghz: float
    a: float
    b: float
    c: float
    d: float


#: Bands of one material never overlap.
ITU_ROWS: dict[str, tuple[ItuRow, ...]] = {
    "concrete": (ItuRow(1, 100, 5.24, 0, 0.0462, 0.7822),),
    "brick": (ItuRow(1, 40, 3.91, 0, 0.0238, 0.16),),
    "plasterboard": (ItuRow(1, 100, 2.73, 0, 0.0085, 0.9395),),
    "wood": (ItuRow(0.001, 100, 1.99, 0, 0.0047, 1.0718),),
    "glass": (
        ItuRow(0.1, 100, 6.31, 0, 0.0036, 1.3394),
        ItuRow(220, 450, 5.79, 0, 0.0004, 1.658),
    ),
    "ceiling_board": (
        ItuRow(1, 100, 1.48, 0, 0.0011, 1.0750),
        ItuRow(220, 450, 1.52, 0, 0.0029, 1.029),
    ),
    "chipboard": (ItuRow(1, 100, 2.58, 0, 0.0217, 0.78),),
    "plywood": (ItuRow(1, 40, 2.71, 0, 0.33, 0),),
    "marble": (ItuRow(1, 60, 7.074, 0, 0.0055, 0.9262),),
    "floorboard": (ItuRow(50, 100, 3.66, 0, 0.0044, 1.3515),),
    "metal": (ItuRow(1, 100, 1, 0, 1e7, 0),),
    "very_dry_ground": (ItuRow(1, 10, 3, 0, 0.00015, 2.52),),
    "medium_dry_ground": (ItuRow(1, 10, 15, -0.1, 0.035, 1.63),),
    "wet_ground": (ItuRow(1, 10, 30, -0.4, 0.15, 1.30),),
}

ITU_NEW_ROWS: dict[str, tuple[ItuRow, ...]] = {
    "vinyl_tile": (ItuRow(1, 40, 3.62, 0, 0.0051, 0.8422),),
    "carpet_tile": (ItuRow(1, 40, 2.08, 0, 0.0009, 0.82),),
    "asphalt_concrete": (ItuRow(1, 40, 4.83, 0, 0.0108, 1.3969),),
}


def _permittivity(frequency_hz: Real, rows: tuple[ItuRow, ...]) -> Complex:
    """Return P.2040 eq. (57) to (59) by the row of the nearest band, as the frequencies."""
    f_ghz = frequency_hz / 1e9
    eps = np.empty(f_ghz.shape, dtype=np.complex128)
    outside = [np.abs(np.log(np.clip(f_ghz, r.low_ghz, r.high_ghz) / f_ghz)) for r in rows]
    nearest = np.argmin(outside, axis=0)
    for number, row in enumerate(rows):
        conductivity = row.c * f_ghz**row.d
        loss = conductivity / (2 * np.pi * frequency_hz * VACUUM_PERMITTIVITY_F_PER_M)
        eps = np.where(nearest == number, row.a * f_ghz**row.b + 1j * loss, eps)
    return eps


def _model(name: str, rows: tuple[ItuRow, ...], edition: str) -> MaterialModel:
    remedy = (
        "Change the carrier, or use the model 'soil' (0.3 to 1.3 and 1.4 to 18 GHz), 'table' or "
        "'permittivity'."
        if name.endswith("_ground")
        else "Change the carrier, or use the model 'conductor'."
        if name == "metal"
        else MaterialModel.remedy
    )
    return MaterialModel(
        name=name,
        title=name.replace("_", " ").capitalize(),
        source="Recommendation ITU-R P.2040",
        edition=edition,
        bands_hz=tuple((row.low_ghz * 1e9, row.high_ghz * 1e9) for row in rows),
        permittivity_of=partial(_permittivity, rows=rows),
        remedy=remedy,
    )


def itu_models() -> tuple[MaterialModel, ...]:
    """Return all rows of the table as models.

    Returns
    -------
    tuple of MaterialModel
        One per material.
    """
    return tuple(
        _model(name, rows, edition)
        for table, edition in ((ITU_ROWS, ITU_EDITION), (ITU_NEW_ROWS, ITU_NEW_EDITION))
        for name, rows in table.items()
    )
