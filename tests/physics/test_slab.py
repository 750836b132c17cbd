# SPDX-License-Identifier: GPL-3.0-or-later
"""The slab against energy conservation, limits, and the characteristic matrix."""

import itertools

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.physics import fresnel

WAVELENGTH_M = 0.0566
LOSSLESS = np.array([1 / 1.5, 1.0 + 1e-9, 1.2, 2.3, 9.0])[:, None, None]
LOSSY = np.array([1.4 + 1.0j, 2.3 + 0.002j, 2.29 + 0.2j, 9 + 3j, 1e4 + 1e4j])[:, None, None]
THICKNESS_M = np.array([1e-6, 0.003, 0.01, 0.2])[:, None]
COSINE = np.cos(np.radians([0, 10, 30, 60, 85, 89.99]))


def characteristic_matrix(index: complex, thickness_m: float, cosine: float, polarisation: str):
    """T and R of one layer by Abeles' 2x2 matrix, an independent way (Born and Wolf 1.6)."""
    q = np.sqrt(complex(index) ** 2 - 1 + cosine**2)
    delta = 2 * np.pi / WAVELENGTH_M * thickness_m * q
    inside = q if polarisation == "s" else q / index**2
    matrix = np.array(
        [
            [np.cos(delta), -1j / inside * np.sin(delta)],
            [-1j * inside * np.sin(delta), np.cos(delta)],
        ]
    )
    b, c = matrix @ np.array([1, cosine])
    transmission, reflection = 2 * cosine / (cosine * b + c), (cosine * b - c) / (cosine * b + c)
    return abs(transmission) ** 2, abs(reflection) ** 2


def test_coherent_matches_the_characteristic_matrix(subtests: pytest.Subtests) -> None:
    indices = (1.4 + 1.0j, 2.3 + 0.002j, 2.29, 9 + 3j, 1 / 1.5)
    slabs = itertools.product(indices, (0.0, 30.0, 60.0, 85.0), (1e-4, 0.003, 0.02))
    for index, degrees, thickness_m in slabs:
        with subtests.test(f"{index}, {degrees}, {thickness_m}"):
            cosine = np.cos(np.radians(degrees))
            power = fresnel.slab_power(index, thickness_m, WAVELENGTH_M, cosine)
            for polarisation, transmitted, reflected in (
                ("s", power.transmitted_s, power.reflected_s),
                ("p", power.transmitted_p, power.reflected_p),
            ):
                t, r = characteristic_matrix(index, thickness_m, cosine, polarisation)
                assert float(transmitted) == pytest.approx(t, rel=1e-10, abs=1e-15)
                assert float(reflected) == pytest.approx(r, rel=1e-10, abs=1e-12)


@pytest.mark.parametrize("model", ["coherent", "incoherent"])
def test_lossless_slab_conserves_energy(model) -> None:
    power = fresnel.slab_power(LOSSLESS, THICKNESS_M, WAVELENGTH_M, COSINE, model)
    assert np.abs(power.absorbed_s).max() < 1e-12
    assert np.abs(power.absorbed_p).max() < 1e-12


@pytest.mark.parametrize("model", fresnel.MODELS)
def test_nothing_is_gained(model) -> None:
    power = fresnel.slab_power(LOSSY, THICKNESS_M, WAVELENGTH_M, COSINE, model)
    for share in power:
        assert np.all(np.isfinite(share)) and np.all(share >= 0) and np.all(share <= 1 + 1e-12)
    assert np.all(power.absorbed_s > -1e-12) and np.all(power.absorbed_p > -1e-12)


def test_incoherent_is_the_mean_over_frequency() -> None:
    """Lossless, thick: averaging the interference over whole periods of the phase."""
    index, thickness_m, cosine = 2.3, 0.5, np.cos(np.radians(40))
    q = np.sqrt(index**2 - 1 + cosine**2)
    # 2 delta runs through 10 whole turns: exponentially convergent, exact to rounding.
    phase = np.arange(2000) / 2000 * 10 * np.pi + 100
    wavelength = 2 * np.pi * thickness_m * q / phase
    coherent = fresnel.slab_power(index, thickness_m, wavelength, cosine)
    incoherent = fresnel.slab_power(index, thickness_m, WAVELENGTH_M, cosine, "incoherent")
    assert coherent.transmitted_s.mean() == pytest.approx(
        float(incoherent.transmitted_s), rel=1e-12
    )
    assert coherent.reflected_p.mean() == pytest.approx(float(incoherent.reflected_p), rel=1e-12)


def test_single_pass_is_the_first_term_of_the_series() -> None:
    """Half a wave and a quarter wave sheets differ; their geometric series share the first term."""
    index = 2.3 + 0.05j
    r_s, _ = fresnel.reflection_coefficients(index, 0.8)
    q = np.sqrt(index**2 - 1 + 0.64)
    delta = 2 * np.pi / WAVELENGTH_M * 0.02 * q
    t_s, _, _, _ = fresnel.amplitude_coefficients(index, 0.02, WAVELENGTH_M, 0.8)
    first_term = t_s * (1 - r_s**2 * np.exp(2j * delta))
    single = fresnel.slab_power(index, 0.02, WAVELENGTH_M, 0.8, "single-pass")
    assert float(single.transmitted_s) == pytest.approx(abs(complex(first_term)) ** 2, rel=1e-12)


def test_thick_absorber_is_single_pass() -> None:
    arguments = (2.3 + 0.1j, 0.3, WAVELENGTH_M, COSINE)
    coherent = fresnel.slab_power(*arguments)
    single = fresnel.slab_power(*arguments, "single-pass")
    np.testing.assert_allclose(coherent.transmitted, single.transmitted, rtol=1e-2)
    np.testing.assert_allclose(coherent.reflected, single.reflected, rtol=1e-2)


def test_half_wave_window_and_quarter_wave_mirror() -> None:
    index = 2.0
    half = fresnel.slab_power(index, WAVELENGTH_M / 4, WAVELENGTH_M)
    assert float(half.transmitted) == pytest.approx(1, abs=1e-14)
    quarter = fresnel.slab_power(index, WAVELENGTH_M / 8, WAVELENGTH_M)
    # ((1 - n^2)/(1 + n^2))^2 (Born and Wolf 1.6.4)
    assert float(quarter.reflected) == pytest.approx((3 / 5) ** 2, rel=1e-13)


def test_brewster_angle_passes_all_of_p() -> None:
    power = fresnel.slab_power(2.3, THICKNESS_M, WAVELENGTH_M, np.cos(np.arctan(2.3)))
    np.testing.assert_allclose(power.transmitted_p, 1, atol=1e-14)


def test_frustrated_total_reflection_falls_exponentially() -> None:
    """n < 1 beyond the critical angle: -8.686 Im(delta) dB per metre once thick."""
    index, cosine = 1 / 1.5, np.cos(np.radians(60))
    thick, thicker = 0.10, 0.12
    power = fresnel.slab_power(index, np.array([thick, thicker]), WAVELENGTH_M, cosine)
    decay = np.log(power.transmitted_s[0] / power.transmitted_s[1])
    evanescent = 2 * np.pi / WAVELENGTH_M * np.sqrt(0.75 - index**2)
    assert decay == pytest.approx(2 * evanescent * (thicker - thick), rel=1e-3)


def test_shader_graph_numbers() -> None:
    """Two-way losses that Cycles gave for the same graph: n = 2.3 at 0, 30 and 60 degrees."""
    cosine = np.cos(np.radians([0.0, 30.0, 60.0]))
    loss_db = 20 * np.log10(fresnel.straight_through_power(2.3, 0.5, WAVELENGTH_M, cosine))
    np.testing.assert_allclose(loss_db, [-2.92960, -2.96285, -3.83133], atol=1e-5)


def test_absorption_and_delay_at_sixty_degrees() -> None:
    """exp(-4 pi kappa d/lambda) along the refracted path, and the delay of its phase."""
    index, thickness_m, cosine = 2.3 + 0.002j, 1.0, 0.5
    angle = float(fresnel.refraction_angle_rad(2.3, cosine))
    assert np.sin(angle) == pytest.approx(np.sin(np.radians(60)) / 2.3, rel=1e-14)
    lossy = fresnel.straight_through_power(index, thickness_m, WAVELENGTH_M, cosine)
    lossless = fresnel.straight_through_power(2.3, thickness_m, WAVELENGTH_M, cosine)
    path_m = thickness_m / np.cos(angle)
    expected = np.exp(-4 * np.pi * 0.002 * path_m / WAVELENGTH_M)
    assert float(lossy / lossless) == pytest.approx(expected, rel=1e-4)
    # n path inside minus what vacuum would have taken to the same wave front.
    excess = (
        2.3 * path_m
        - thickness_m / cosine
        + thickness_m * np.sin(np.radians(60)) * (np.tan(np.radians(60)) - np.tan(angle))
    )
    assert float(fresnel.excess_path_m(2.3, thickness_m, cosine)) == pytest.approx(
        excess, rel=1e-12
    )


def test_excess_path_is_the_phase_of_one_passage() -> None:
    index, thickness_m, cosine = 1.3 + 0.02j, 0.004, 0.7
    t_s, _, r_s, _ = fresnel.amplitude_coefficients(index, thickness_m, WAVELENGTH_M, cosine)
    face, _ = fresnel.reflection_coefficients(index, cosine)
    q = np.sqrt(index**2 - 1 + cosine**2)
    delta = 2 * np.pi / WAVELENGTH_M * thickness_m * q
    one_passage = t_s * (1 - face**2 * np.exp(2j * delta)) / (1 - face**2)
    excess = float(fresnel.excess_path_m(index, thickness_m, cosine))
    phase = 2 * np.pi / WAVELENGTH_M * (excess + cosine * thickness_m)
    assert np.angle(one_passage) == pytest.approx(phase, rel=1e-12)
    assert abs(complex(r_s)) < 1


def test_excess_path_keeps_digits_for_thin_air() -> None:
    assert float(fresnel.excess_path_m(1 + 1e-12, 1.0)) == pytest.approx(1e-12, rel=1e-3)
    assert float(fresnel.excess_path_m(1.0, 1.0, 0.0)) == 0


@pytest.mark.parametrize("index", [2.3, 1.4 + 1.0j, 9 + 3j])
def test_phase_inside_a_lossy_medium_follows_born_and_wolf(index: complex) -> None:
    """N sin(psi) = sin(theta), 2 N^2 = a + 2 s^2 + sqrt(a^2 + 4 n^2 k^2), a = n^2 - k^2 - s^2.

    Born and Wolf 14.2 (12) to (14), which has no complex square root.
    """
    n, k = complex(index).real, complex(index).imag
    for degrees in (10.0, 45.0, 80.0):
        sine = np.sin(np.radians(degrees))
        a = n**2 - k**2 - sine**2
        real_index = np.sqrt((a + 2 * sine**2 + np.hypot(a, 2 * n * k)) / 2)
        angle = float(fresnel.refraction_angle_rad(index, np.cos(np.radians(degrees))))
        assert np.sin(angle) == pytest.approx(sine / real_index, rel=1e-12)


@pytest.mark.parametrize("model", fresnel.MODELS)
@pytest.mark.parametrize("index", [1.5, 2 + 1j, 1e4 + 1e4j])
def test_grazing_incidence_reflects_everything(model, index) -> None:
    power = fresnel.slab_power(index, 0.1, WAVELENGTH_M, np.array([0.0, 1e-9]), model)
    np.testing.assert_allclose(power.transmitted_s, 0, atol=1e-6)
    np.testing.assert_allclose(power.reflected_s, 1, atol=1e-6)
    np.testing.assert_allclose(power.reflected_p[0], 1, atol=1e-6)


@pytest.mark.parametrize("model", fresnel.MODELS)
def test_vacuum_slab_is_not_there(model) -> None:
    power = fresnel.slab_power(1.0, THICKNESS_M, WAVELENGTH_M, np.array([1.0, 0.5, 1e-6]), model)
    np.testing.assert_allclose(power.transmitted, 1, rtol=1e-12)
    np.testing.assert_allclose(power.reflected, 0, atol=1e-12)


def test_huge_loss_underflows_to_zero_without_warning() -> None:
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        power = fresnel.slab_power(1e7 * (1 + 1j), 1.0, WAVELENGTH_M, COSINE)
    assert np.all(power.transmitted == 0)
    # Opaque: reflects as one face does.
    face, _ = fresnel.power_transmission(1e7 * (1 + 1j), COSINE)
    np.testing.assert_allclose(power.reflected_s, 1 - face, rtol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.nan, 0.1, 0.05, 1.0), "Index of refraction holds"),
        ((0.0, 0.1, 0.05, 1.0), "Index of refraction is 0"),
        ((2 - 0.1j, 0.1, 0.05, 1.0), "amplifies"),
        ((2.0, 0.0, 0.05, 1.0), "Thickness is 0 m; expected more than 0 m"),
        ((2.0, np.nan, 0.05, 1.0), "Thickness holds nan"),
        ((2.0, 0.1, -1.0, 1.0), "Wavelength is -1 m"),
        ((2.0, 0.1, 0.05, 1.5), "expected 0 to 1"),
        ((2.0, 0.1, 0.05, np.array([1j])), "expected a number"),
        (([2.0, 3.0], [0.1, 0.2, 0.3], 0.05), r"index \(2,\), thickness_m \(3,\)"),
        ((2.0, 0.1, 0.05, 1.0, "magic"), "expected one of coherent, incoherent, single-pass"),
    ],
)
def test_bad_input(arguments, message) -> None:
    with pytest.raises(ConfigError, match=message):
        fresnel.slab_power(*arguments)
