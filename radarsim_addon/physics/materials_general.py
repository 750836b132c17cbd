# SPDX-License-Identifier: GPL-3.0-or-later
"""Media given by user's numbers: vacuum, permittivity, index, Debye, conductor, CSV table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..array_types import Complex, Real
from ..errors import ConfigError
from .checks import read_csv
from .constants import VACUUM_PERMITTIVITY_F_PER_M
from .material_model import MaterialModel, Parameter
from .materials_water import debye_permittivity

_ALL_HZ = ((0.0, np.inf),)

TABLE_COLUMNS = (
    ("frequency_ghz", "eps_real", "eps_imag"),
    ("frequency_hz", "eps_real", "eps_imag"),
    ("frequency_ghz", "n", "k"),
    ("frequency_hz", "n", "k"),
)
"""Headers that a material's CSV file may have."""


def conductor_permittivity(
    frequency_hz: ArrayLike, conductivity_s_per_m: ArrayLike, relative_permittivity: ArrayLike = 1.0
) -> Complex:
    """Return eps' + j sigma/(2 pi f eps_0) (Balanis, Advanced Engineering Electromagnetics, 2-72).

    Parameters
    ----------
    frequency_hz
        f [Hz]. All arguments broadcast.
    conductivity_s_per_m
        sigma [S/m].
    relative_permittivity
        eps'.

    Returns
    -------
    ndarray
        Complex relative permittivity.
    """
    f = np.asarray(frequency_hz, dtype=np.float64)
    loss = np.asarray(conductivity_s_per_m, dtype=np.float64) / (
        2 * np.pi * f * VACUUM_PERMITTIVITY_F_PER_M
    )
    real = np.asarray(relative_permittivity, dtype=np.float64)
    return np.asarray(real + 1j * loss, dtype=np.complex128)


def _vacuum(frequency_hz: Real) -> Complex:
    return np.ones(frequency_hz.shape, dtype=np.complex128)


def _given_permittivity(frequency_hz: Real, eps_real: Real, eps_imag: Real) -> Complex:
    return np.asarray(eps_real + 1j * eps_imag + 0 * frequency_hz, dtype=np.complex128)


def _given_index(frequency_hz: Real, n: Real, k: Real) -> Complex:
    return np.asarray((n + 1j * k) ** 2 + 0 * frequency_hz, dtype=np.complex128)


def _debye(
    frequency_hz: Real,
    static_permittivity: Real,
    infinite_permittivity: Real,
    relaxation_frequency_hz: Real,
    conductivity_s_per_m: Real,
) -> Complex:
    if np.any(static_permittivity < infinite_permittivity):
        raise ConfigError(
            f"Material 'debye' has the static permittivity {np.min(static_permittivity):g} below "
            f"the infinite one, {np.max(infinite_permittivity):g}: its relaxation amplifies. "
            "Exchange the two, or use the model 'permittivity'."
        )
    relaxation = debye_permittivity(
        frequency_hz, static_permittivity, infinite_permittivity, relaxation_frequency_hz
    )
    return relaxation + conductor_permittivity(frequency_hz, conductivity_s_per_m, 0.0)


_CONDUCTIVITY = "conductivity_s_per_m"


def general_models() -> tuple[MaterialModel, ...]:
    """Return the models with user-given numbers, which hold at every frequency.

    Returns
    -------
    tuple of MaterialModel
        Vacuum, permittivity, index, debye, conductor.
    """
    own, edition = "values given by the user", "constant over frequency"
    return (
        MaterialModel("vacuum", "Vacuum, air", "definition", "exact", _ALL_HZ, _vacuum),
        MaterialModel(
            "permittivity",
            "Permittivity given",
            own,
            edition,
            _ALL_HZ,
            _given_permittivity,
            (
                Parameter("eps_real", "", "real part of the relative permittivity"),
                Parameter("eps_imag", "", "its imaginary part, loss >= 0", 0.0, 0.0),
            ),
        ),
        MaterialModel(
            "index",
            "Index of refraction given",
            own,
            edition,
            _ALL_HZ,
            _given_index,
            (
                Parameter("n", "", "real part of the index", None, 0.0),
                Parameter("k", "", "its imaginary part, loss >= 0", 0.0, 0.0),
            ),
        ),
        MaterialModel(
            "debye",
            "One Debye relaxation and a conductivity",
            "Debye, Polar Molecules",
            "1929",
            _ALL_HZ,
            _debye,
            (
                Parameter("static_permittivity", "", "permittivity at f = 0", None, 0.0),
                Parameter("infinite_permittivity", "", "permittivity far above f_r", None, 0.0),
                Parameter("relaxation_frequency_hz", "Hz", "f_r = 1/(2 pi tau)", None, above=0.0),
                Parameter(_CONDUCTIVITY, "S/m", "conductivity", 0.0, 0.0),
            ),
        ),
        MaterialModel(
            "conductor",
            "Conductor",
            "Ohm's law in Maxwell's equations",
            "conductivity constant over frequency",
            # Drude relaxation of metals lies in the terahertz; a constant sigma fails there.
            ((0.0, 1e12),),
            conductor_permittivity,
            (
                Parameter(_CONDUCTIVITY, "S/m", "conductivity, copper 5.8e7", None, 0.0),
                Parameter("relative_permittivity", "", "real part of the permittivity", 1.0, 0.0),
            ),
        ),
    )


def table_model(path: str | Path) -> MaterialModel:
    """Return a medium measured by the user: a CSV file over frequency.

    Parameters
    ----------
    path
        Columns frequency_ghz (or frequency_hz), and eps_real, eps_imag or n, k; rows in any order.

    Returns
    -------
    MaterialModel
        Permittivity interpolated linearly over log f: exact at the rows, passive between them. The
        band is that of the rows; one row holds at its own frequency only.

    Raises
    ------
    ConfigError
        The table is missing, misnamed, not numeric, not positive in frequency, double in frequency,
        or amplifying; the message has file, line and column.
    """
    table = read_csv(path, TABLE_COLUMNS)
    columns = table.columns
    in_ghz = "frequency_ghz" in columns
    frequency = table.numbers("frequency_ghz" if in_ghz else "frequency_hz")
    frequency = frequency * (1e9 if in_ghz else 1.0)
    by_index = not {"eps_real", "eps_imag"} <= set(columns)
    real = table.numbers("n" if by_index else "eps_real")
    imag = table.numbers("k" if by_index else "eps_imag")
    name = table.path.name
    for line, f, loss in zip(table.lines, frequency, imag, strict=True):
        if f <= 0:
            raise ConfigError(f"{name}, line {line}: frequency {f:g} Hz; expected more than 0.")
        if loss < 0:
            raise ConfigError(
                f"{name}, line {line}: imaginary part {loss:g} means gain. With exp(-jwt) loss is "
                "positive; change the sign of the column."
            )
    eps = (real + 1j * imag) ** 2 if by_index else real + 1j * imag
    order = np.argsort(frequency, kind="stable")
    frequency, eps = frequency[order], eps[order]
    double = np.flatnonzero(np.diff(frequency) == 0)
    if double.size:
        raise ConfigError(
            f"{name} holds {frequency[double[0]] / 1e9:g} GHz twice; remove one of the rows."
        )
    log_frequency = np.log(frequency)

    def permittivity_of(frequency_hz: Real) -> Complex:
        at = np.log(frequency_hz)
        value = np.interp(at, log_frequency, eps.real) + 1j * np.interp(at, log_frequency, eps.imag)
        if len(eps) > 1:  # beyond the rows, on the line through the last two
            slopes = np.diff(eps) / np.diff(log_frequency)
            value = value + slopes[0] * np.minimum(at - log_frequency[0], 0.0)
            value = value + slopes[-1] * np.maximum(at - log_frequency[-1], 0.0)
        return np.asarray(value, dtype=np.complex128)

    return MaterialModel(
        name=f"table {name}",
        title=f"Table {name}",
        source=f"{len(frequency)} rows of {name}",
        edition="given by the user",
        bands_hz=((float(frequency[0]), float(frequency[-1])),),
        permittivity_of=permittivity_of,
        remedy="Change the carrier, or add rows to the table.",
    )
