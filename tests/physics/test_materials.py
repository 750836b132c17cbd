# SPDX-License-Identifier: GPL-3.0-or-later
"""Permittivities against independent values, and what happens outside the models' bands."""

import cmath
import csv
import itertools
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.physics import materials
from radarsim_addon.physics.materials import (
    ITU_NEW_ROWS,
    ITU_ROWS,
    MaterialModel,
    ice_permittivity,
    kaatze_permittivity,
    klein_swift_permittivity,
    liebe_permittivity,
    soil_permittivity,
)

DATA = Path(__file__).parents[1] / "data" / "material_spot_values.csv"
ALL_NAMES = sorted(materials.models())
EXAMPLES: dict[str, dict[str, Any]] = {
    "permittivity": {"eps_real": 4.0, "eps_imag": 0.1},
    "index": {"n": 2.0, "k": 0.1},
    "debye": {
        "static_permittivity": 80.0,
        "infinite_permittivity": 5.0,
        "relaxation_frequency_hz": 17e9,
    },
    "conductor": {"conductivity_s_per_m": 5.8e7},
    "soil": {"moisture": 0.2},
}


def spot_rows() -> list[dict[str, str]]:
    with open(DATA, encoding="utf-8") as stream:
        rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
    # Not offered: Stogryn's sea water and the P.527 soil.
    return [row for row in rows if not re.match("sea Stogryn|soil P.527", row["model"])]


def number(text: str, name: str) -> float:
    found = re.search(rf"{name}=(-?[\d.]+)", text)
    assert found
    return float(found[1])


def evaluate(model: str, params: str, frequency_hz: float) -> complex:
    """The equation itself: the table also holds values outside some bands."""
    if model.startswith("P.2040"):
        return complex(materials.permittivity(model.split()[1], frequency_hz))
    if model.startswith("sea Klein-Swift"):
        temperature_c, salinity_psu = number(params, "T"), number(params, "S")
        return complex(klein_swift_permittivity(frequency_hz, temperature_c, salinity_psu))
    if model.startswith("soil"):
        return complex(soil_permittivity(frequency_hz, number(params, "mv"), 0.4, 0.2, 1.3, 20.0))
    equation = {
        "water Liebe91=P.527-4": liebe_permittivity,
        "water Kaatze89": kaatze_permittivity,
        "ice Maetzler06": ice_permittivity,
    }[model]
    return complex(equation(frequency_hz, number(params, "T")))


def test_spot_values(subtests: pytest.Subtests) -> None:
    for row in spot_rows():
        with subtests.test(f"{row['model']}, {row['freq_GHz']} GHz, {row['params']}"):
            got = evaluate(row["model"], row["params"], float(row["freq_GHz"]) * 1e9)
            # Half a unit of the last printed digit (6, for ice 8), and 1e-7: electric constant.
            digit = 0.6e-8 if row["model"].startswith("ice") else 0.6e-6
            assert got.real == pytest.approx(float(row["eps_re"]), rel=2e-7, abs=0.6e-6)
            assert got.imag == pytest.approx(float(row["eps_im"]), rel=2e-7, abs=digit)


@pytest.mark.parametrize("name", ALL_NAMES)
def test_every_model_is_passive_over_its_band_and_names_its_source(name: str) -> None:
    model = materials.models()[name]
    assert model.source and model.edition and model.band_text
    for low, high in model.bands_hz:
        frequency = np.geomspace(max(low, 1e6), min(high, 1e13), 200).reshape(20, 10)
        index = model.index(frequency, **EXAMPLES.get(name, {}))
        assert index.shape == frequency.shape
        assert np.all(index.imag >= 0) and np.all(index.real > 0)
        eps = model.permittivity(frequency, **EXAMPLES.get(name, {}))
        np.testing.assert_allclose(index**2, eps, rtol=1e-13)


@pytest.mark.parametrize("name", ALL_NAMES)
def test_outside_the_band_is_a_named_error(name: str) -> None:
    model = materials.models()[name]
    for low, high in model.bands_hz:
        for frequency in (low * 0.99, high * 1.01):
            if frequency <= 0 or not np.isfinite(frequency):
                continue
            with pytest.raises(ConfigError) as caught:
                materials.material(name, frequency, **EXAMPLES.get(name, {}))
            message = str(caught.value)
            assert repr(name) in message
            assert f"{frequency / 1e9:g} GHz" in message
            assert model.band_text in message
            assert model.remedy in message


def test_band_edges_are_inside_even_after_float32() -> None:
    for edge in (np.float32(1.0), np.float32(100.0) * np.float32(1 + 6e-8)):
        assert np.isfinite(materials.material("concrete", float(edge) * 1e9))
    inside_one = materials.permittivity("concrete", 1e9)
    assert complex(inside_one) == pytest.approx(5.24 + 1j * 17.9751036 * 0.0462, rel=1e-7)


def test_itu_bands_of_one_material_do_not_overlap() -> None:
    for rows in (*ITU_ROWS.values(), *ITU_NEW_ROWS.values()):
        for below, above in itertools.pairwise(rows):
            assert below.high_ghz < above.low_ghz


def test_editions_are_told_apart() -> None:
    assert "P.2040-3" in materials.material_model("concrete").edition
    assert "P.2040-4" in materials.material_model("asphalt_concrete").edition


def test_beyond_the_band_an_edge_is_held_or_the_equation_continued() -> None:
    at = np.array([0.5e9, 10e9, 120e9, 200e9, 500e9])
    held = materials.permittivity("glass", at, beyond_band="hold")
    edges = materials.permittivity("glass", [0.5e9, 10e9, 100e9, 220e9, 450e9])
    np.testing.assert_array_equal(held, edges)
    free = materials.permittivity("glass", at, beyond_band="extrapolate")
    f_ghz = at[[2, 4]] / 1e9  # 120 GHz by the lower row, 500 GHz by the upper one
    sigma = np.array([0.0036, 0.0004]) * f_ghz ** np.array([1.3394, 1.658])
    expected = np.array([6.31, 5.79]) + 1j * sigma / (2 * np.pi * at[[2, 4]] * 8.8541878128e-12)
    np.testing.assert_allclose(free[[2, 4]], expected, rtol=1e-9)
    np.testing.assert_array_equal(free[:2], edges[:2])
    with pytest.raises(ConfigError, match="Beyond band is 'guess'"):
        materials.material("glass", 5e9, beyond_band="guess")


def test_error_class_of_a_carrier_beyond_the_band() -> None:
    asphalt = materials.material_model("asphalt_concrete")
    assert asphalt.out_of_band(40e9) is asphalt.out_of_band(40e9 * (1 + 1e-7)) is None
    near, far = asphalt.out_of_band(41e9), asphalt.out_of_band(77e9)
    assert near is not None and far is not None
    assert (near.error_class, far.error_class) == ("small", "moderate")
    assert near.edge_hz == far.edge_hz == 40e9
    # eps'' ~ f^(d - 1) and hardly any change of eps': so does k
    assert far.absorption_ratio == pytest.approx((77 / 40) ** 0.3969, rel=0.02)
    wet = materials.material_model("wet_ground").out_of_band(77e9)
    assert wet is not None and wet.error_class == "large"


@pytest.mark.parametrize(("f_ghz", "edge_ghz"), [(0.2, 1.0), (77.0, 10.0)])
def test_difference_beyond_the_band_has_no_sign(f_ghz: float, edge_ghz: float) -> None:
    """Wet ground by ITU-R P.2040 reflects more below its band than at the edge, less above it."""
    index = []
    for at_ghz in (edge_ghz, f_ghz):
        sigma = 0.15 * at_ghz**1.3
        loss = sigma / (2 * math.pi * at_ghz * 1e9 * 8.8541878128e-12)
        index.append(cmath.sqrt(30 * at_ghz**-0.4 + 1j * loss))
    power = [abs((n - 1) / (n + 1)) ** 2 for n in index]
    found = materials.material_model("wet_ground").out_of_band(f_ghz * 1e9)
    assert found is not None and found.edge_hz == 1e9 * edge_ghz
    assert found.reflection_db == pytest.approx(abs(10 * math.log10(power[0] / power[1])))
    ratio = index[1].imag / index[0].imag
    assert found.absorption_ratio == pytest.approx(max(ratio, 1 / ratio))


@pytest.mark.parametrize(
    ("name", "bands_ghz"),
    [
        ("water", [(1e-3, 1000)]),  # ITU-R P.527: to 1 THz
        ("water_kaatze", [(1.1, 57)]),  # abstract of the paper
        ("sea_water", [(0.3, 10)]),
        ("ice", [(0.01, 3000)]),
        ("soil", [(0.3, 1.3), (1.4, 18)]),  # Peplinski; Dobson
        ("concrete", [(1, 100)]),  # ITU-R P.2040, table 3
        ("brick", [(1, 40)]),
        ("glass", [(0.1, 100), (220, 450)]),
        ("wood", [(0.001, 100)]),
        ("very_dry_ground", [(1, 10)]),
        ("metal", [(1, 100)]),
    ],
)
def test_bands_are_those_of_the_sources(name: str, bands_ghz: list[tuple[float, float]]) -> None:
    edges_hz = [edge for band in materials.material_model(name).bands_hz for edge in band]
    assert edges_hz == pytest.approx([1e9 * edge for band in bands_ghz for edge in band])


def test_a_table_goes_on_along_its_last_line(tmp_path: Path) -> None:
    text = "frequency_ghz,eps_real,eps_imag\n1,4,0.1\n10,5,0.2\n"
    path = table(tmp_path, text)
    got = materials.permittivity("table", [0.1e9, 100e9], path=path, beyond_band="extrapolate")
    np.testing.assert_allclose(got, [3, 6 + 0.3j], rtol=1e-12, atol=1e-12)
    held = materials.permittivity("table", [0.1e9, 100e9], path=path, beyond_band="hold")
    np.testing.assert_array_equal(held, [4 + 0.1j, 5 + 0.2j])


def test_gap_between_two_bands_is_outside() -> None:
    with pytest.raises(ConfigError, match=r"0\.3 to 1\.3 GHz and 1\.4 to 18 GHz"):
        materials.material("soil", 1.35e9, moisture=0.2)
    with pytest.raises(ConfigError, match=r"0\.1 to 100 GHz and 220 to 450 GHz"):
        materials.material("glass", np.array([5e9, 150e9]))


@pytest.mark.parametrize(("frequency_hz", "eps_real"), [(145e9, 6.31), (150e9, 5.79)])
def test_between_two_bands_the_edge_at_the_smaller_ratio_is_held(
    frequency_hz: float, eps_real: float
) -> None:
    """Glass of ITU-R P.2040, table 3: the bands end at 100 GHz and begin again at 220 GHz."""
    held = materials.permittivity("glass", frequency_hz, beyond_band="hold")
    assert held.real == pytest.approx(eps_real, rel=1e-12)


def test_peplinski_low_band_correction() -> None:
    """eps' -> 1.15 eps' - 0.68 below 1.3 GHz (Peplinski 1995, eq. (2) with (8)).

    The uncorrected eps' is smooth in frequency, so the step at the divide is the correction.
    """
    below = complex(soil_permittivity(1.3499e9, 0.2, 0.4, 0.2, 1.3, 20.0))
    above = complex(soil_permittivity(1.3501e9, 0.2, 0.4, 0.2, 1.3, 20.0))
    assert below.real == pytest.approx(1.15 * above.real - 0.68, rel=1e-4)


def test_soil_whose_fit_amplifies_is_refused() -> None:
    with pytest.raises(ConfigError, match="no passive permittivity"):
        materials.material("soil", 1.4e9, moisture=0.02, sand=1.0, clay=0.0)
    with pytest.raises(ConfigError, match=r"add up to 1\.2"):
        materials.material("soil", 5e9, moisture=0.2, sand=0.7, clay=0.5)
    with pytest.raises(ConfigError, match="moisture"):
        materials.material("soil", 5e9)


def test_a_model_that_amplifies_is_refused_whatever_it_is() -> None:
    """The last check of all models, in whose place single models may have one of their own."""
    gains = MaterialModel("laser", "", "a test", "", ((0.0, np.inf),), lambda f: 4.0 - 0.1j + 0 * f)
    with pytest.raises(ConfigError, match=r"'laser' \(a test\) gives no passive permittivity"):
        gains.permittivity([5e9, 6e9])


def test_debye_maximum_loss_and_limits() -> None:
    numbers: dict[str, Any] = {
        "static_permittivity": 80.0,
        "infinite_permittivity": 5.0,
        "relaxation_frequency_hz": 17e9,
    }
    at_peak = complex(materials.permittivity("debye", 17e9, **numbers))
    assert at_peak == pytest.approx((80 + 5) / 2 + 1j * (80 - 5) / 2, rel=1e-14)
    assert complex(materials.permittivity("debye", 1e3, **numbers)).real == pytest.approx(80)
    assert complex(materials.permittivity("debye", 1e16, **numbers)).real == pytest.approx(5)
    lossy = complex(materials.permittivity("debye", 1e9, conductivity_s_per_m=2.0, **numbers))
    dry = complex(materials.permittivity("debye", 1e9, **numbers))
    assert (lossy - dry).imag == pytest.approx(17.97510 * 2.0, rel=1e-6)


@pytest.mark.parametrize("conductivity", [5.8e7, 1e20])
def test_conductor_skin_depth(conductivity: float) -> None:
    """k0 Im(n) is one over the skin depth sqrt(2/(w mu0 sigma)) of a good conductor."""
    frequency = 10e9
    index = complex(materials.material("conductor", frequency, conductivity_s_per_m=conductivity))
    omega = 2 * np.pi * frequency
    skin_depth = np.sqrt(2 / (omega * 4e-7 * np.pi * conductivity))
    assert omega / 299_792_458 * index.imag * skin_depth == pytest.approx(1, rel=1e-8)


def test_zero_loss_stays_zero() -> None:
    assert materials.material("vacuum", 5e9) == 1
    assert materials.material("permittivity", 5e9, eps_real=4.0) == 2
    assert materials.material("index", 5e9, n=1.5).imag == 0
    plasma = complex(materials.material("permittivity", 5e9, eps_real=-4.0))
    assert plasma == 2j


def test_parameters_broadcast_with_frequency() -> None:
    frequency = np.array([1.4e9, 5.3e9, 10e9])
    temperature = np.array([0.0, 10.0, 25.0, 30.0])[:, None]
    index = materials.material("water", frequency, temperature_c=temperature)
    assert index.shape == (4, 3)
    alone = materials.material("water", 5.3e9, temperature_c=25.0)
    assert complex(index[2, 1]) == complex(alone)


AMPLIFYING = {
    "static_permittivity": 5.0,
    "infinite_permittivity": 80.0,
    "relaxation_frequency_hz": 17e9,
}


@pytest.mark.parametrize(
    ("name", "frequency", "parameters", "message"),
    [
        ("concrete", np.nan, {}, "Frequency holds nan"),
        ("concrete", [5e9, np.inf], {}, "Frequency holds inf"),
        ("concrete", -5e9, {}, "more than 0 Hz"),
        ("concrete", "fast", {}, "expected a number of Hz"),
        ("concret", 5e9, {}, "did you mean concrete"),
        ("concrete", 5e9, {"moisture": 0.1}, "has no parameter 'moisture'"),
        ("water", 5e9, {"temperature_c": np.nan}, "temperature_c of material 'water' holds nan"),
        ("water", 5e9, {"temperature_c": 290.0}, "expected -4 to 40 degC"),
        ("conductor", 5e9, {}, "needs conductivity_s_per_m"),
        ("conductor", 5e9, {"conductivity_s_per_m": np.inf}, "holds inf"),
        ("permittivity", 5e9, {"eps_real": 4.0, "eps_imag": -0.1}, "eps_imag"),
        ("permittivity", 5e9, {"eps_real": 0.0}, "has the index 0"),
        ("index", 5e9, {"n": 0.0}, "has the index 0"),
        ("index", 5e9, {"n": "2"}, "n of material 'index' is '2'; expected a number"),
        ("index", 5e9, {"n": True}, "is True; expected a number"),
        ("debye", 5e9, {**AMPLIFYING}, "static permittivity 5 below the infinite one, 80"),
        # The conductivity hides the gain at this frequency, not at others.
        ("debye", 1e9, {**AMPLIFYING, "conductivity_s_per_m": 50.0}, "amplifies"),
        ("table", 5e9, {}, "has no path"),
        ("water", [1e9, 2e9], {"temperature_c": [1.0, 2.0, 3.0]}, "shapes do not fit together"),
    ],
)
def test_bad_input(name: str, frequency: object, parameters: dict[str, Any], message: str):
    with pytest.raises(ConfigError, match=message):
        materials.material(name, frequency, **parameters)  # type: ignore[arg-type]


# -- tables ----------------------------------------------------------------------------------------


def table(folder: Path, text: str) -> Path:
    path = folder / "mätt wood.csv"
    path.write_text(text, encoding="utf-8-sig")
    return path


def test_table_is_exact_at_its_rows_and_log_linear_between(tmp_path: Path) -> None:
    path = table(
        tmp_path,
        "# measured\nEps_Imag, frequency_GHz, eps_real\n0.4,10,4\n\n0.2,1,2.0\n0.3,100,5\n",
    )
    got = materials.permittivity("table", np.array([1e9, 10e9, 100e9]), path=path)
    np.testing.assert_allclose(got, [2 + 0.2j, 4 + 0.4j, 5 + 0.3j], rtol=1e-14)
    middle = complex(materials.permittivity("table", np.sqrt(10) * 1e9, path=path))
    assert middle == pytest.approx(3 + 0.3j, rel=1e-14)
    with pytest.raises(ConfigError, match=r"1 to 100 GHz\. Change the carrier, or add rows"):
        materials.material("table", 101e9, path=path)


def test_table_by_index_and_in_hertz(tmp_path: Path) -> None:
    path = table(tmp_path, "frequency_hz,n,k\n5.3e9,1.4,1.0\n")
    assert complex(materials.material("table", 5.3e9, path=path)) == pytest.approx(1.4 + 1j)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("frequency_ghz,eps_real,eps_imag\n", "no rows"),
        ("f,eps\n1,2\n", "expected frequency_ghz, eps_real, eps_imag or"),
        ("frequency_ghz,eps_real,eps_imag\n1,2\n", "line 2: 2 cells; expected 3"),
        ("frequency_ghz,eps_real,eps_imag\n1,x,0\n", "line 2: eps_real is 'x'"),
        ("frequency_ghz,eps_real,eps_imag\n1,nan,0\n", "line 2: eps_real is 'nan'"),
        ("frequency_ghz,eps_real,eps_imag\n1,inf,0\n", "line 2: eps_real is 'inf'"),
        ("frequency_ghz,eps_real,eps_imag\n1,2,0\n2,-1e999,0\n", "line 3: eps_real is '-1e999'"),
        ("frequency_ghz,eps_real,eps_imag\n0,2,0\n", "line 2: frequency 0 Hz"),
        ("# c\nfrequency_ghz,n,k\n1,2,-0.1\n", "line 3: imaginary part -0.1 means gain"),
        ("frequency_ghz,n,k\n1,2,0\n1,2,0\n", "1 GHz twice"),
        ("frequency_ghz,n,n,k\n1,2,0,0\n", "occurs twice"),
    ],
)
def test_bad_tables(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(message)):
        materials.material("table", 1e9, path=table(tmp_path, text))


def test_missing_or_binary_table(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="does not exist"):
        materials.material("table", 1e9, path=tmp_path / "none.csv")
    binary = tmp_path / "photo.csv"
    binary.write_bytes(b"\xff\xfe\x00\x9f")
    with pytest.raises(ConfigError, match="not UTF-8"):
        materials.material("table", 1e9, path=binary)
    with pytest.raises(ConfigError, match="cannot be read"):
        materials.material("table", 1e9, path=tmp_path)


def test_models_are_frozen() -> None:
    model = materials.material_model("concrete")
    assert isinstance(model, MaterialModel)
    with pytest.raises(AttributeError):
        model.name = "other"  # type: ignore[misc]
    with pytest.raises(TypeError):
        materials.models()["concrete"] = model  # type: ignore[index]
