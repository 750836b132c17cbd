# SPDX-License-Identifier: GPL-3.0-or-later
"""Kirchhoff sigma0 against the definition by slopes, albedo against energy and measured values."""

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.physics import fresnel, rough
from radarsim_addon.physics.rough import RAMP_BELOW, transmission_factors


@pytest.mark.parametrize("index", [1.4 + 1.0j, 2.3 + 0.05j, 9 + 3j, 1e4 + 1e4j])
@pytest.mark.parametrize("slope", [0.1, 0.2, 0.3])
def test_sigma0_is_the_slope_density_at_the_mirror_facets(index: complex, slope: float) -> None:
    """sigma0 = pi |Gamma|^2 p(tan, 0)/cos^4 with p the density of slopes (Barrick 1968)."""
    angle = np.radians(np.arange(0, 61, 5))
    density = np.exp(-(np.tan(angle) ** 2) / (2 * slope**2)) / (2 * np.pi * slope**2)
    reflectance = abs((index - 1) / (index + 1)) ** 2
    expected = np.pi * reflectance * density / np.cos(angle) ** 4
    np.testing.assert_allclose(rough.sigma0(index, slope, np.cos(angle)), expected, rtol=1e-11)


def test_sigma0_of_a_patch_integrates_to_its_reflectance() -> None:
    """Integral of sigma0 cos^4 over all slopes is pi |Gamma|^2: every facet is counted once."""
    slope, index = 0.25, 3.0
    tangent = np.linspace(0, 12 * slope, 20001)
    cosine = 1 / np.sqrt(1 + tangent**2)
    value = rough.sigma0(index, slope, cosine) * cosine**4 * 2 * np.pi * tangent
    total = (value.sum() - value[[0, -1]].sum() / 2) * (tangent[1] - tangent[0])
    reflectance = float(fresnel.unpolarised_reflectance(index, 1.0))
    assert total == pytest.approx(np.pi * reflectance, rel=1e-6)


def test_grazing_incidence_is_zero_and_quiet() -> None:
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        value = rough.sigma0(3.0, 0.2, np.array([0.0, 1e-300, 1e-9, 1e-3]))
        masked = rough.sigma0(3.0, 0.2, np.array([0.0, 1e-300, 1e-9, 1e-3]), "smith")
    np.testing.assert_array_equal(value, 0)
    np.testing.assert_array_equal(masked, 0)


def test_masking_where_it_is_said_not_to_matter() -> None:
    """Below 0.05 dB up to slope 0.3 at 60 degrees; 0.37 dB at 70."""

    def loss_db(slope: float, degrees: float) -> float:
        cosine = np.cos(np.radians(degrees))
        return float(
            10
            * np.log10(rough.sigma0(3.0, slope, cosine) / rough.sigma0(3.0, slope, cosine, "smith"))
        )

    assert 0 < loss_db(0.3, 60) < 0.05
    assert loss_db(0.3, 70) == pytest.approx(0.38, abs=0.02)
    assert loss_db(0.4, 60) == pytest.approx(0.19, abs=0.02)


def test_smith_lambda_from_its_definition() -> None:
    """Lambda = (1/mu) int_mu^inf (p - mu) P(p) dp with P the Gaussian of slopes (Smith 1967)."""
    slope = 0.4
    for degrees in (30.0, 60.0, 80.0):
        mu = 1 / np.tan(np.radians(degrees))
        p = np.linspace(mu, mu + 12 * slope, 200001)
        density = np.exp(-(p**2) / (2 * slope**2)) / (np.sqrt(2 * np.pi) * slope)
        integrand = (p - mu) * density
        step = p[1] - p[0]
        expected = (integrand.sum() - integrand[[0, -1]].sum() / 2) * step / mu
        got = rough.masking_lambda(np.sqrt(2) * slope, np.cos(np.radians(degrees)))
        assert float(got) == pytest.approx(expected, rel=1e-6)


def test_cycles_rational_masking_is_close() -> None:
    cosine = np.cos(np.arctan(1 / np.linspace(0.01, 3, 2000)))
    exact = 1 / (1 + rough.masking_lambda(1.0, cosine))
    rational = 1 / (1 + rough.masking_lambda(1.0, cosine, "cycles"))
    assert np.abs(exact - rational).max() < 3.5e-3


@pytest.mark.parametrize(
    ("alpha", "normal", "oblique"),
    [(0.1, 1.000, 1.000), (0.3, 1.000, 0.924), (0.6, 0.856, 0.854), (1.0, 0.462, 0.766)],
)
@pytest.mark.parametrize("masking", ["smith", "cycles"])
def test_conductor_albedo_as_cycles_gives_it(alpha, normal, oblique, masking) -> None:
    slope = alpha / np.sqrt(2)
    assert rough.albedo(slope, 1.0, None, masking) == pytest.approx(normal, abs=3e-3)
    assert rough.albedo(slope, 0.5, None, masking) == pytest.approx(oblique, abs=3e-3)


def test_albedo_converges_and_never_gains() -> None:
    for slope in (0.05, 0.3, 0.7):
        for cosine in (1.0, 0.5, 0.05):
            value = rough.albedo(slope, cosine)
            assert 0 < value <= 1 + 1e-4
            assert value == pytest.approx(rough.albedo(slope, cosine, steps=1024), abs=1e-4)


def test_albedo_of_a_nearly_smooth_surface_is_fresnel() -> None:
    index = 2.3 + 0.05j
    for cosine in (1.0, 0.7, 0.5):
        expected = float(fresnel.unpolarised_reflectance(index, cosine))
        assert rough.albedo(1e-4, cosine, index) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("index", "slope", "facet_fresnel"),
    [(1.5, 0.15, True), (9 + 3j, 0.3, True), (9 + 3j, 0.1, False)],
)
def test_a_rough_face_passes_no_more_than_its_facets_leave(
    index: complex, slope: float, facet_fresnel: bool
) -> None:
    """R + T <= 1 at every angle, T by the factors, R by an integral of another resolution."""
    flat, grazing = transmission_factors(index, slope, facet_fresnel)
    totals = []
    for cosine in (1.0, 0.85, 0.62, 0.52, 0.45, 0.33, 0.25, 0.2, 0.16, 0.11, 0.07, 0.05, 0.03):
        ramp = max(1 - cosine / RAMP_BELOW, 0.0)
        entering = 1 - float(fresnel.unpolarised_reflectance(index, cosine))
        if facet_fresnel:
            reflected = rough.albedo(slope, cosine, index, "cycles", 300)
        else:
            normal = abs((index - 1) / (index + 1)) ** 2
            reflected = normal * rough.albedo(slope, cosine, None, "cycles", 300)
        totals.append(reflected + (flat * (1 - ramp) + grazing * ramp) * entering)
    assert max(totals) < 1 + 1e-3
    # No less than that: at some angle nothing is lost.
    assert max(totals) > 1 - 2e-3
    assert transmission_factors(index, 0.0, facet_fresnel) == (1.0, 1.0)


def test_relations_of_roughness() -> None:
    slope = rough.rms_slope(0.01, 0.1)
    assert float(slope) == pytest.approx(0.1 * np.sqrt(2), rel=1e-15)
    assert float(rough.cycles_roughness(slope)) ** 2 == pytest.approx(0.2, rel=1e-14)
    back = rough.slope_from_roughness(rough.cycles_roughness([0.1, 0.3, np.sqrt(0.5)]))
    np.testing.assert_allclose(back, [0.1, 0.3, np.sqrt(0.5)], rtol=1e-14)
    with pytest.raises(ConfigError, match="Cycles allows at most 1"):
        rough.cycles_roughness(0.8)


def test_coherent_fraction() -> None:
    """k h = 1/2 at normal incidence leaves exp(-1)."""
    assert float(rough.coherent_fraction(0.05 / (4 * np.pi), 0.05)) == pytest.approx(np.exp(-1))
    assert float(rough.coherent_fraction(1.0, 0.05, 0.0)) == 1


def test_slope_of_a_gaussian_surface_by_its_spectrum() -> None:
    """The rms slope of the correlation h^2 exp(-x^2/l^2) is sqrt(-C''(0))."""
    height, length, step = 0.01, 0.1, 1e-4
    correlation = height**2 * np.exp(-((np.array([-step, 0, step]) / length) ** 2))
    second = (correlation[0] - 2 * correlation[1] + correlation[2]) / step**2
    assert float(rough.rms_slope(height, length)) == pytest.approx(np.sqrt(-second), rel=1e-5)


def test_limits_of_kirchhoff() -> None:
    assert rough.kirchhoff_limits(0.03, 0.3, 0.0566) == ()
    smooth = rough.kirchhoff_limits(0.001, 0.3, 0.0566)
    assert [item.code for item in smooth] == ["kirchhoff-coherent-part"]
    fine = rough.kirchhoff_limits(0.003, 0.01, 0.0566)
    (short,) = [item for item in fine if item.code == "kirchhoff-short-correlation"]
    assert short.numbers["k_l"] == pytest.approx(1.11, abs=0.005)
    steep = rough.kirchhoff_limits(0.2, 0.3, 0.0566)
    assert [item.code for item in steep] == ["kirchhoff-steep-slopes"]
    assert steep[0].numbers["slope"] == pytest.approx(0.943, abs=5e-4)
    curved = rough.kirchhoff_limits(0.2, 0.1, 0.0566)
    assert "kirchhoff-curved-facets" in [item.code for item in curved]
    # Oblique incidence needs more height.
    assert rough.kirchhoff_limits(0.03, 0.3, 0.0566, 0.3) != ()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: rough.sigma0(np.nan, 0.2, 1.0), "Index of refraction holds"),
        (lambda: rough.sigma0(3.0, 0.0, 1.0), "Rms slope is 0; expected more than 0"),
        (lambda: rough.sigma0(3.0, 0.2, np.nan), "holds nan"),
        (lambda: rough.sigma0(3.0, 0.2, 1.0, "some"), "none, smith, cycles"),  # type: ignore[arg-type]
        (lambda: rough.sigma0(3.0, [0.1, 0.2], [1.0, 0.9, 0.8]), "shapes do not fit together"),
        (lambda: rough.albedo(0.2, 0.0), "more than 0"),
        (lambda: rough.albedo(0.2, 1.0, masking="none"), "Masking is 'none'"),
        (lambda: rough.rms_slope(0.1, 0.0), "Correlation length is 0 m"),
        (lambda: rough.kirchhoff_limits(np.nan, 0.1, 0.05), "Rms height holds nan"),
    ],
)
def test_bad_input(call, message) -> None:
    with pytest.raises(ConfigError, match=message):
        call()


def test_least_height_of_a_slope_has_a_correlation_length_of_one_wavelength() -> None:
    for slope, wavelength in ((0.02, 0.0039), (0.1, 0.03), (0.3, 0.117)):
        height = rough.least_rms_height_m(slope, wavelength)
        assert rough.rms_slope(height, wavelength) == pytest.approx(slope)
    # a Roughness of 0.5 is the first with an eighth of the wavelength
    slope = rough.slope_from_roughness(0.5)
    assert rough.least_rms_height_m(slope, 0.03) == pytest.approx(0.03 / 8)
