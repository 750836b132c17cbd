# SPDX-License-Identifier: GPL-3.0-or-later
"""Permittivities of the library against values computed independently."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path

from radarsim_addon.physics import materials
from radarsim_addon.physics.materials import (
    ice_permittivity,
    kaatze_permittivity,
    klein_swift_permittivity,
    liebe_permittivity,
    soil_permittivity,
)

from .case import Bench, Case, Check, Group, worst_of

TABLE = Path(__file__).parents[2] / "tests" / "data" / "material_spot_values.csv"
#: Not offered by the library.
ABSENT = re.compile("sea Stogryn|soil P.527")
_BY_TEMPERATURE = {
    "water Liebe91=P.527-4": liebe_permittivity,
    "water Kaatze89": kaatze_permittivity,
    "ice Maetzler06": ice_permittivity,
}


def _number(text: str, name: str) -> float:
    found = re.search(rf"{name}=(-?[\d.]+)", text)
    if not found:
        raise ValueError(f"{TABLE.name}: no {name} in {text!r}")
    return float(found[1])


def _evaluate(model: str, params: str, frequency_hz: float) -> complex:
    """The equation itself: the table also holds values outside some bands."""
    if model.startswith("P.2040"):
        return complex(materials.permittivity(model.split()[1], frequency_hz))
    if model.startswith("sea Klein-Swift"):
        at = _number(params, "T"), _number(params, "S")
        return complex(klein_swift_permittivity(frequency_hz, *at))
    if model.startswith("soil"):
        return complex(soil_permittivity(frequency_hz, _number(params, "mv"), 0.4, 0.2, 1.3, 20.0))
    return complex(_BY_TEMPERATURE[model](frequency_hz, _number(params, "T")))


def spot_values(_bench: Bench) -> list[Check]:
    """One result a model; the bound is half a unit of the last digit printed."""
    with open(TABLE, encoding="utf-8") as stream:
        rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
    found: dict[str, list[Check]] = {}
    for row in rows:
        model, params = row["model"], row["params"]
        if ABSENT.match(model):
            continue
        got = _evaluate(model, params, float(row["freq_GHz"]) * 1e9)
        for part, value in (("re", got.real), ("im", got.imag)):
            text = row[f"eps_{part}"]
            want = float(text)
            # Half a unit of the last digit, and 1e-7 for the electric constant's editions.
            digit = 0.6 * 10.0 ** -len(text.partition(".")[2])
            fine = model.startswith("ice") and part == "im"
            bound = max(digit, 0.6e-8 if fine else 0.6e-6) + 2e-7 * abs(want)
            check = Check(
                f"{part} at {row['freq_GHz']} GHz {params}",
                want,
                value,
                "",
                value - want,
                bound,
                "1",
                "independent computation, six decimals (ice eight)",
            )
            found.setdefault(model, []).append(check)
    return [worst_of(model, checks) for model, checks in found.items()]


def beyond_bands(_bench: Bench) -> list[Check]:
    """Held at the band's edge and extrapolated, of ITU-R's rows with their own formula."""
    checks = []
    for name, real, c, d in (
        ("brick", 3.91, 0.0238, 0.16),
        ("asphalt_concrete", 4.83, 0.0108, 1.3969),
    ):
        for policy, at_ghz in (("hold", 40.0), ("extrapolate", 77.0)):
            want = complex(real, c * at_ghz**d / (2 * math.pi * at_ghz * 1e9 * 8.8541878128e-12))
            got = complex(materials.permittivity(name, 77e9, beyond_band=policy))
            checks.append(
                Check(
                    f"{name} at 77 GHz, {policy}",
                    want.imag,
                    got.imag,
                    "",
                    abs(got - want),
                    1e-9,
                    "1",
                    f"eps'' of Table 3 at {at_ghz:g} GHz",
                )
            )
    return checks


GROUP = Group(
    "materials",
    "Materials",
    "Relative permittivities, exp(-jwt).",
    (
        Case("permittivities", spot_values, 5.0, quick=True),
        Case("beyond the band", beyond_bands, 1.0, quick=True),
    ),
)
