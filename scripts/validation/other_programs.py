# SPDX-License-Identifier: GPL-3.0-or-later
"""The same quantity by radarsim, and by another program or a measurement.

``scripts/other_programs.py`` prints a comparison as the table that its page of docs shows. The
values of the others are in tests/data/other_programs.csv, with their sources. A program that is
installed computes its values again.
"""

from __future__ import annotations

import csv
import functools
import importlib
import importlib.util
import math
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from radarsim_addon.physics.clutter import clutter_model, nathanson_sea
from radarsim_addon.physics.constants import SPEED_OF_LIGHT_MPS
from radarsim_addon.physics.materials import material
from radarsim_addon.physics.radar_equation import bistatic_power_w, predict_snr
from radarsim_addon.physics.weather import (
    gas_attenuation_db_per_km,
    rain_attenuation_db_per_km,
    sphere_backscatter_m2,
)

from .case import Bench, Case, Check, Group, absolute_check, relative_check

TABLE = Path(__file__).parents[2] / "tests" / "data" / "other_programs.csv"
Values = dict[str, float]


@dataclass(frozen=True)
class Comparison:
    """One table: what is compared, by whom, and how far both may differ.

    Attributes
    ----------
    heading, unit, digits
        Head of the first column; unit and decimals of the values.
    other, package
        Head of the other's column; the module that its values need, empty for none.
    ours, theirs
        Values by case; `theirs` is None where only recorded values exist.
    bounds
        Largest difference by the first words of a case, in `unit` or as a ratio.
    """

    heading: str
    unit: str
    digits: int
    other: str
    ours: Callable[[], Values]
    bounds: Mapping[str, float] = field(default_factory=dict)
    package: str = ""
    theirs: Callable[[], Values] | None = None
    kind: Literal["absolute", "relative"] = "absolute"

    def reference(self, key: str) -> Values:
        """Return the other's values: computed where its package is there, else recorded ones."""
        missing = self.package and importlib.util.find_spec(self.package) is None
        return recorded(key) if self.theirs is None or missing else self.theirs()

    def checks(self, key: str) -> list[Check]:
        """Compare every case with the recorded value."""
        ours, compare = self.ours(), {"absolute": absolute_check, "relative": relative_check}
        found = []
        for case, value in recorded(key).items():
            bound = next(self.bounds[start] for start in self.bounds if case.startswith(start))
            found.append(
                compare[self.kind](case, value, ours[case], bound, self.other, unit=self.unit)
            )
        return found


def recorded(key: str) -> Values:
    """Return the values of a comparison in the table, by case."""
    with open(TABLE, encoding="utf-8") as stream:
        rows = csv.DictReader(line for line in stream if not line.startswith("#"))
        return {row["case"]: float(row["value"]) for row in rows if row["comparison"] == key}


# -- attenuation -----------------------------------------------------------------------------------

_RAIN_MM_PER_H = 10.0
_CARRIERS_GHZ = (10.0, 77.0)


def attenuation() -> Values:
    """One-way attenuation by rain of horizontal waves, and by gases [dB/km]."""
    found = {}
    for ghz in _CARRIERS_GHZ:
        rain = rain_attenuation_db_per_km(ghz * 1e9, _RAIN_MM_PER_H, "horizontal")
        found[f"rain, {ghz:g} GHz"] = float(rain)
        found[f"gases, {ghz:g} GHz"] = float(gas_attenuation_db_per_km(ghz * 1e9))
    return found


def _attenuation_by_itur() -> Values:
    rain = importlib.import_module("itur.models.itu838").rain_specific_attenuation
    gases = importlib.import_module("itur.models.itu676").gamma_exact
    found = {}
    for ghz in _CARRIERS_GHZ:
        found[f"rain, {ghz:g} GHz"] = float(rain(_RAIN_MM_PER_H, ghz, 0, 0).value)
        found[f"gases, {ghz:g} GHz"] = float(gases(ghz, 1013.25, 7.5, 288.15).value)
    return found


# -- sea -------------------------------------------------------------------------------------------

_SIDES = {"HH": "horizontal", "VV": "vertical"}


def sea() -> Values:
    """sigma0 of the model nrl_sea at 9.3 GHz, sea state 3 [dB]."""
    return _sea_levels(functools.partial(clutter_model("nrl_sea").sigma0_db, sea_state=3))


def measured_sea() -> Values:
    """sigma0 of Nathanson's table, which has a row for each of these angles [dB]."""
    return _sea_levels(clutter_model("table", nathanson_sea(3)).sigma0_db)


def _sea_levels(sigma0_db: Callable[..., object]) -> Values:
    return {
        f"{deg} deg, {name}": float(np.asarray(sigma0_db(9.3e9, math.radians(deg), side)))
        for deg in (1, 10, 60)
        for name, side in _SIDES.items()
    }


def sea_deviations(_bench: Bench) -> list[Check]:
    """Mean difference between model and all measured values, which the report prints, too."""
    model, found = clutter_model("nrl_sea"), []
    # The report prints two decimals.
    for name, printed_db in (("HH", 2.64), ("VV", 2.54)):
        errors_db = []
        for state in range(7):
            for line in Path(nathanson_sea(state)).read_text(encoding="utf-8").splitlines():
                cells = line.removeprefix("# ").split(",")
                if len(cells) == 4 and cells[3] == name:
                    deg, level_db, ghz = map(float, cells[:3])
                    psi = math.radians(deg)
                    model_db = model.sigma0_db(ghz * 1e9, psi, _SIDES[name], sea_state=state)
                    errors_db.append(level_db - float(model_db))
        mean_db = float(np.mean(np.abs(errors_db)))
        label = f"mean deviation of {len(errors_db)} measured values, {name}"
        source = "NRL/MR/5310-12-9346, against Nathanson's tables"
        found.append(absolute_check(label, printed_db, mean_db, 0.005, source, unit="dB"))
    return found


# -- spheres ---------------------------------------------------------------------------------------


def _spheres() -> dict[str, tuple[complex, float]]:
    """Index and circumference over wavelength of each sphere."""
    wavelength_m = SPEED_OF_LIGHT_MPS / 77e9
    water = complex(material("water", 77e9))
    found = {f"water, {mm:g} mm": (water, math.pi * mm * 1e-3 / wavelength_m) for mm in (1.0, 4.0)}
    return found | {f"n = 1.6, ka = {ka:g}": (1.6 + 0j, float(ka)) for ka in (1, 10)}


def spheres() -> Values:
    """Backscatter cross section over pi a^2."""
    return {
        case: float(sphere_backscatter_m2(1.0, 2 * math.pi / ka, index)) / math.pi
        for case, (index, ka) in _spheres().items()
    }


def _spheres_by_miepython() -> Values:
    efficiencies = importlib.import_module("miepython").efficiencies_mx
    # its time dependence is exp(+jwt)
    return {
        case: float(efficiencies(index.conjugate(), ka)[2])
        for case, (index, ka) in _spheres().items()
    }


# -- radar equation --------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Link:
    """An example of the documentation of `radareqsnr`."""

    carrier_hz: float
    pulse_s: float
    gains_db: tuple[float, float]
    ranges_m: tuple[float, float]
    rcs_m2: float = 1.0
    temperature_k: float = 290.0
    loss_db: float = 0.0


_LINKS = {
    "1 GHz, 50 km": _Link(1e9, 0.2e-6, (20, 20), (50e3, 50e3)),
    "10 GHz, 100 km, 3 dB loss": _Link(10e9, 1e-6, (40, 40), (1e5, 1e5), 0.5, 300.0, 3.0),
    "10 GHz, bistatic, 50 km and 75 km": _Link(10e9, 1e-6, (40, 20), (50e3, 75e3)),
}


def link_snr() -> Values:
    """SNR of one pulse of 1 MW [dB]."""
    found = {}
    for case, link in _LINKS.items():
        transmit, receive = (10 ** (gain / 10) for gain in link.gains_db)
        wavelength_m = SPEED_OF_LIGHT_MPS / link.carrier_hz
        power_w = bistatic_power_w(
            1e6 * transmit, link.rcs_m2, *link.ranges_m, wavelength_m, receive, link.loss_db
        )
        snr = predict_snr(
            float(power_w),
            link.pulse_s,
            1 / link.pulse_s,
            antenna_temperature_k=link.temperature_k,
        )
        found[case] = snr.single_pulse_db
    return found


# -- street canyon ---------------------------------------------------------------------------------

#: Reflections, and range bins [m] that are added up.
CANYON_PARTS = ((1, 2, 10), (1, 10, 20), (1, 20, 40), (2, 12, 20), (2, 20, 40))


def canyon_values(first: np.ndarray, second: np.ndarray) -> Values:
    """Powers of range parts from two profiles in bins of 1 m, for an EIRP of 1 W [dBW]."""
    profiles = {1: first, 2: second}
    words = {1: "one reflection", 2: "two reflections"}
    return {
        f"{words[order]}, {start} to {stop} m": 10
        * math.log10(float(profiles[order][start:stop].sum()))
        for order, start, stop in CANYON_PARTS
    }


def canyon(resolution: str = "1414x707") -> Values:
    """The canyon as `radarsim render` measures it, in a process of its own."""
    from radarsim_addon.contract import PATHS_FILE, PathsRecord, frame_dir
    from radarsim_addon.signal.paths.table import open_table
    from radarsim_addon.typed_json import read_record
    from scripts.benchmarks.canyon import BLEND
    from scripts.benchmarks.canyon_accuracy import binned, second_reflections
    from scripts.benchmarks.stages import render_cost

    with tempfile.TemporaryDirectory(prefix="radarsim_canyon_") as name:
        frame = Path(name) / "run" / frame_dir(1)
        words = ("--resolution", resolution, "--max-reflections", 2)
        render_cost(BLEND, Path(name) / "run", *words)
        record = read_record(frame / PATHS_FILE, PathsRecord)
        rows = open_table(frame / record.table_file)
        eirp_w = record.transmitter.eirp_w
        first = binned(rows[rows["order"] == 1], record) / eirp_w
        second = second_reflections(rows, record).mean(axis=0) / eirp_w
    return canyon_values(first, second)


def _canyon_by_sionna() -> Values:
    from scripts.benchmarks.sionna_canyon import power_profiles

    return canyon_values(*power_profiles())


COMPARISONS = {
    "canyon": Comparison(
        "reflections and range",
        "dBW",
        2,
        "Sionna RT 2.2.0",
        canyon,
        # Sampled: both scatter. Second reflections have a tenth as many paths a bin.
        {"one": 0.05, "two": 0.2},
        "sionna",
        _canyon_by_sionna,
    ),
    "weather": Comparison(
        "attenuation by",
        "dB/km",
        5,
        "itur 0.4.0",
        attenuation,
        # Both evaluate the same equations in float64; P.676 adds up 79 lines.
        {"rain": 1e-9, "gases": 1e-9},
        "itur",
        _attenuation_by_itur,
        "relative",
    ),
    "sea": Comparison(
        "grazing angle, polarisation",
        "dB",
        1,
        "measured (Nathanson 1991)",
        sea,
        theirs=measured_sea,
    ),
    "spheres": Comparison(
        "sphere",
        "",
        6,
        "miepython 3.3.0",
        spheres,
        {"": 1e-12},
        "miepython",
        _spheres_by_miepython,
        "relative",
    ),
    "radar-equation": Comparison(
        "example",
        "dB",
        4,
        "MATLAB",
        link_snr,
        # The documentation prints four decimals.
        {"": 0.5e-4},
    ),
}


def _case(key: str, _bench: Bench) -> list[Check]:
    return COMPARISONS[key].checks(key)


GROUP = Group(
    "other_programs",
    "Other programs and measurements",
    "The tables that pages of the documentation show: `scripts/other_programs.py` prints them.",
    (
        Case("street canyon", functools.partial(_case, "canyon"), 40.0),
        *(
            Case(label, functools.partial(_case, key), 5.0, quick=True)
            for key, label in (
                ("weather", "rain and gases"),
                ("spheres", "dielectric spheres"),
                ("radar-equation", "radar equation"),
            )
        ),
        Case("sea", sea_deviations, 5.0, quick=True),
    ),
)
