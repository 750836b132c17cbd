# SPDX-License-Identifier: GPL-3.0-or-later
"""Rain, gases and the echo of rain, against tables of another code."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from pathlib import Path
from typing import cast

from radarsim_addon.physics.rain_echo import rain_reflectivity_per_m
from radarsim_addon.physics.weather import Polarisation
from radarsim_addon.signal.radar import Weather

from .case import Bench, Case, Check, Group, absolute_check, worst_of

TABLE = Path(__file__).parents[2] / "tests" / "data" / "weather.csv"
_TITLES = {
    "rain_attenuation_p838_3": "attenuation by rain, P.838-3",
    "gas_p676": "attenuation by gases, P.676-12",
    "rain_volume": "reflectivity of rain, Mie series",
}
_SIDES = {"H": "horizontal", "V": "vertical", "": "average"}


def against_table(_bench: Bench) -> list[Check]:
    """Every row of the table, one result a model."""
    with open(TABLE, encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    models: dict[str, Callable[[dict[str, str]], Check]] = {
        "rain_attenuation_p838_3": _rain,
        "gas_p676": _gases,
        "rain_volume": _rain_echo,
    }
    return [
        worst_of(_TITLES[model], [check(row) for row in rows if row["model"] == model])
        for model, check in models.items()
    ]


def _rain(row: dict[str, str]) -> Check:
    weather = Weather(
        rain_mm_per_h=_rate(row), rain_polarisation=cast(Polarisation, _SIDES[row["polarisation"]])
    )
    found = weather.attenuation_db_per_km(_carrier_hz(row))
    expected = float(row["value3"])
    return _relative(_label(row), expected, found, "dB/km", 5e-6, "itur 0.4.0")


def _gases(row: dict[str, str]) -> Check:
    found = Weather(gases=True).attenuation_db_per_km(_carrier_hz(row))
    expected = float(row["value1"]) + float(row["value2"])
    return _relative(_label(row), expected, found, "dB/km", 1e-9, "itur 0.4.0")


def _rain_echo(row: dict[str, str]) -> Check:
    found = 10 * math.log10(rain_reflectivity_per_m(_carrier_hz(row), _rate(row)))
    return absolute_check(
        _label(row), float(row["value2"]), found, 0.015, "Mie series of another code", unit="dB"
    )


def _label(row: dict[str, str]) -> str:
    rain = f", {_rate(row):g} mm/h" if "mm_per_h" in row["parameters"] else ""
    return f"{row['frequency_ghz']} GHz{rain} {row['polarisation']}".rstrip()


def _rate(row: dict[str, str]) -> float:
    return float(row["parameters"].removeprefix("mm_per_h="))


def _carrier_hz(row: dict[str, str]) -> float:
    return float(row["frequency_ghz"]) * 1e9


def _relative(
    name: str, expected: float, measured: float, unit: str, bound: float, source: str
) -> Check:
    error = measured / expected - 1
    return Check(name, expected, measured, unit, error, bound, "relative", source)


GROUP = Group(
    "weather",
    "Weather",
    "What rain and gases take of a kilometre of path, and what rain returns.",
    (Case("tables", against_table, 10.0, quick=True),),
)
