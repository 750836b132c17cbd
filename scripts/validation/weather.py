# SPDX-License-Identifier: GPL-3.0-or-later
"""Rain, gases and the echo of rain, against tables of another code."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from pathlib import Path
from typing import cast

import numpy as np

from radarsim_addon.physics.weather import Polarisation, rain_reflectivity_per_m
from radarsim_addon.signal import open_run
from radarsim_addon.signal.decoding import open_frame
from radarsim_addon.signal.pipeline import main
from radarsim_addon.signal.radar import Weather
from radarsim_addon.signal.scattering import rain_rows

from .case import Bench, Case, Check, Group, absolute_check, power_check, worst_of
from .scenes import EIRP_W, Plate, acquire, add_plate, lambert, new_scene, wavelength

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


def rain_volume(bench: Bench) -> list[Check]:
    """Power of rain in the view, before and beside a plate, and its mean Doppler velocity."""
    new_scene(4.0)
    add_plate("Wall", Plate(np.array([-200.0, 800, 0]), _across(400.0), _up(400.0)), lambert(1.0))
    weather = Weather(rain_mm_per_h=10.0, rain_echo=True, wind_y_mps=8.0)
    run = acquire(bench, 64, 1, carrier_hz=9.65e9, prf_hz=2000.0)
    frame = open_frame(open_run(run.folder).frame(1), range_limits_m=(100.0, 1500.0))
    rows = rain_rows(frame, weather, 0)
    range_m, right = rows["length_m"] / 2, run.record.receiver.right
    solid_sr = 4 * math.asin(right**2 / (1 + right**2))
    link = EIRP_W * wavelength(9.65e9) ** 2 / (4 * math.pi) ** 3
    eta = rain_reflectivity_per_m(9.65e9, 10.0)
    checks = []
    for start_m, stop_m, part in ((200.0, 700.0, 1.0), (900.0, 1400.0, 0.5)):
        inside = (range_m > start_m) & (range_m < stop_m)
        expected = link * eta * solid_sr * part * (1 / start_m - 1 / stop_m)
        name = f"echo of rain, {start_m:g} to {stop_m:g} m, {part:.0%} of the view open"
        found = float(rows["power_w"][inside].sum())
        checks.append(power_check(name, expected, found, 0.15, "integral over the volume"))
    mean_mps = float(np.average(rows["range_rate_mps"], weights=rows["power_w"]))
    source = "wind along a level view"
    checks.append(
        absolute_check("mean range rate of rain", 8.0, mean_mps, 0.08, source, unit="m/s")
    )
    return checks


def rain_chain(bench: Bench) -> list[Check]:
    """Rain by the options of the command, from a Blender scene to the products of a frame."""
    new_scene(4.0)
    add_plate("Far", Plate(np.array([-1.0, 3000, -1]), _across(2.0), _up(2.0)), lambert(1.0))
    run = acquire(
        bench, 64, 2, carrier_hz=9.65e9, prf_hz=4000.0, pulses=64, bandwidth_hz=50e6,
        sampling_rate_hz=60e6, chirp_duration_s=4e-6, range_stop_m=1500.0,
    )  # fmt: skip
    powers = []
    for seed in range(4):  # one realisation has some 200 independent cells
        code = main([
            "process", str(run.folder), "--no-plots", "--no-products", "--range-limits", "100:1500",
            "--speckle-seed", str(seed), "--rain-mm-per-h", "25", "--rain-echo", "--wind-y", "12",
        ])  # fmt: skip
        if code not in (0, 3):
            raise AssertionError(f"the command ended with {code}")
        with np.load(run.folder / "products" / "frame_0001_map.npz") as file:
            range_m, doppler_hz = file["range_m"], file["doppler_hz"]
            powers.append(file["power"][0])
    power = np.mean(powers, axis=0)
    with np.load(run.folder / "products" / "frame_0001_expected.npz") as file:
        expected = {name: file[name] for name in ("range_m", "doppler_hz", "clutter_map")}
    right = run.record.receiver.right
    solid_sr = 4 * math.asin(right**2 / (1 + right**2))
    link = EIRP_W * wavelength(9.65e9) ** 2 / (4 * math.pi) ** 3
    eta = rain_reflectivity_per_m(9.65e9, 25.0)
    lost = Weather(rain_mm_per_h=25.0).attenuation_db_per_km(9.65e9)
    near_m = np.arange(300.0, 1300.0, 0.5) + 0.25
    density = link * eta * solid_sr * 10 ** (-lost * 2 * near_m / 1e4) / near_m**2
    total_w = float(density.sum() * 0.5)
    checks = []
    # what a map adds up of a point of 1 W: cells of half the response's width, Hamming both ways
    for name, ranges_m, hertz, values, bound_db in (
        ("expected power", expected["range_m"], expected["doppler_hz"], expected["clutter_map"],
         0.15),
        ("echoes", range_m, doppler_hz, power, 0.5),
    ):  # fmt: skip
        inside = (ranges_m > 300) & (ranges_m < 1300)
        cells = values[:, inside]
        step_m = float(ranges_m[1] - ranges_m[0])
        in_map_w = float(cells.sum()) * step_m / _response_m2()
        label = f"rain through the chain, power of {name} from 300 to 1300 m"
        checks.append(power_check(label, total_w, in_map_w, bound_db, "integral with extinction"))
        mean_mps = -float(np.average(hertz, weights=cells.sum(axis=1))) * wavelength(9.65e9) / 2
        label = f"rain through the chain, mean range rate of {name}"
        checks.append(
            absolute_check(label, 12.0, mean_mps, 0.1, "wind along a level view", unit="m/s")
        )
    return checks


def _response_m2() -> float:
    """Integral over range of a point's response in the map, summed over its Doppler cells [m]."""
    part = (np.arange(20_000) + 0.5) / 20_000 - 0.5  # of the band of 50 MHz
    band = 0.54 + 0.46 * np.cos(2 * np.pi * part)
    # Parseval: of |mean of band exp(j 4 pi f r / c)|^2 over all ranges
    along_m = 299_792_458.0 / 2 / 50e6 * float(np.mean(band**2) / np.mean(band) ** 2)
    pulses = 0.54 - 0.46 * np.cos(2 * np.pi * (np.arange(64) + 0.5) / 64)
    over_doppler = 64 * float(np.sum(pulses**2) / pulses.sum() ** 2)
    return along_m * over_doppler


def _across(length_m: float) -> np.ndarray:
    return np.array([length_m, 0.0, 0.0])


def _up(length_m: float) -> np.ndarray:
    return np.array([0.0, 0.0, length_m])


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
    "Attenuation by rain and gases, and the echo of rain.",
    (
        Case("tables", against_table, 10.0, quick=True),
        Case("echo of rain", rain_volume, 15.0),
        Case("rain through the chain", rain_chain, 30.0),
    ),
)
