# SPDX-License-Identifier: GPL-3.0-or-later
"""Patterns against directivity integrals, closed-form beamwidths, and each other."""

import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.physics.antennas import (
    TAPERS,
    Antenna,
    Aperture,
    CosinePower,
    Gaussian,
    Isotropic,
    PlanarArray,
    TableAntenna,
    angles_from_direction,
    direction_from_angles,
    read_pattern,
    sphere_mean,
    taper_weights,
    to_antenna_frame,
)

AHEAD = np.array([0.0, 0.0, -1.0])


def gain_at(antenna, azimuth_deg, elevation_deg=0.0):
    return antenna.gain(direction_from_angles(np.radians(azimuth_deg), np.radians(elevation_deg)))


def half_power_width_rad(antenna, axis: int) -> float:
    """Full width at half power by bisection of the pattern itself."""
    peak = float(antenna.gain(AHEAD))
    low, high = 0.0, np.pi / 2
    for _ in range(60):
        middle = (low + high) / 2
        angles = (middle, 0.0) if axis == 0 else (0.0, middle)
        if float(antenna.gain(direction_from_angles(*angles))) > peak / 2:
            low = middle
        else:
            high = middle
    return 2 * low


# -- directions ------------------------------------------------------------------------------------


def test_directions_follow_blender_cameras() -> None:
    """Boresight -Z, azimuth positive to the right (+X), elevation positive up (+Y)."""
    np.testing.assert_allclose(direction_from_angles(0.0, 0.0), AHEAD, atol=1e-16)
    right, up = direction_from_angles(np.pi / 2, 0.0), direction_from_angles(0.0, np.pi / 2)
    np.testing.assert_allclose(right, [1, 0, 0], atol=1e-16)
    np.testing.assert_allclose(up, [0, 1, 0], atol=1e-16)


def test_angles_and_directions_are_inverse_near_the_poles_too() -> None:
    azimuth = np.radians([-179.0, -90.0, 0.0, 1e-6, 120.0])[:, None]
    elevation = np.radians([-89.999999, -30.0, 0.0, 89.999999])
    back = angles_from_direction(5 * direction_from_angles(azimuth, elevation))
    np.testing.assert_allclose(back[0], np.broadcast_to(azimuth, (5, 4)), atol=1e-7)
    np.testing.assert_allclose(back[1], np.broadcast_to(elevation, (5, 4)), rtol=1e-14, atol=1e-15)


def test_pose_turns_the_pattern() -> None:
    """An antenna turned a quarter to the left about +Y looks along world -X; scale is ignored."""
    turn = np.array([[0, 0, 1, 7], [0, 1, 0, 8], [-1, 0, 0, 9], [0, 0, 0, 1]], dtype=float)
    turn[:3, :3] *= 3
    np.testing.assert_allclose(to_antenna_frame(turn, [-1, 0, 0]), AHEAD, atol=1e-15)
    # World -Z is then on its right.
    np.testing.assert_allclose(to_antenna_frame(turn, [0, 0, -1]), [1, 0, 0], atol=1e-15)
    # A roll of 30 degrees about the boresight; the antenna's own axes are stretched unevenly.
    roll = np.array([[np.sqrt(3), -1, 0], [1, np.sqrt(3), 0], [0, 0, 2]]) / 2
    local = to_antenna_frame(roll * [0.5, 2.0, 7.0], [1, 0, 0])
    np.testing.assert_allclose(local, [np.sqrt(3) / 2, -0.5, 0], atol=1e-15)


# -- directivity: the mean gain over the sphere is the efficiency ----------------------------------

DEG = np.pi / 180
LOSSLESS: dict[str, Antenna] = {
    "isotropic": Isotropic(),
    "cos^0": CosinePower(0.0),
    "cos^3.7": CosinePower(3.7),
    "cos^200": CosinePower(200.0),
    "gaussian 30x14": Gaussian(30 * DEG, 14 * DEG),
    "gaussian 90x60": Gaussian(90 * DEG, 60 * DEG),
    "small aperture": Aperture(0.02, 0.01, 0.0566),
    "aperture": Aperture(0.3, 0.2, 0.0566),
    "line of isotropic": PlanarArray(12, 1, 2e-3, 2e-3, 4e-3, element_exponent=None),
    "steered, tapered": PlanarArray(
        8, 6, 0.03, 0.025, 0.06, 0.3, -0.2, "taylor", "hamming", element_exponent=1.0
    ),
    "odd weights": PlanarArray(3, 1, 0.07, 0.01, 0.06, 0.4, 0.0, (1.0, -0.2, 0.9)),
    "cos^0 elements": PlanarArray(5, 4, 0.03, 0.03, 0.06, element_exponent=0.0),
    "cos^1000 elements": PlanarArray(3, 2, 0.5, 0.7, 1, 0.1, -0.05, element_exponent=1000.0),
}


@pytest.mark.parametrize("name", LOSSLESS)
def test_lossless_antennas_radiate_what_they_accept(name: str) -> None:
    # A wide Gaussian has a crease behind the antenna, where azimuth jumps: the rule feels it.
    tolerance = 1e-6 if name == "gaussian 90x60" else 1e-9
    assert sphere_mean(LOSSLESS[name]) == pytest.approx(1, abs=tolerance)


def test_efficiency_scales_the_gain() -> None:
    for antenna in (
        Isotropic(0.6),
        CosinePower(2.0, 0.6),
        Gaussian(0.5, 0.5, 0.6),
        Aperture(0.1, 0.1, 0.05, 0.6),
        PlanarArray(4, 4, 0.025, 0.025, 0.05, efficiency=0.6),
    ):
        assert sphere_mean(antenna, 80, 120) == pytest.approx(0.6, rel=1e-7)


def test_directivity_closed_forms() -> None:
    assert float(CosinePower(3.0).gain(AHEAD)) == pytest.approx(8, rel=1e-15)
    # Half-wave spacing of isotropic elements: exactly their number (Balanis 6.3.2).
    for count in (2, 12, 100):
        line = PlanarArray(count, 1, 0.5, 0.5, 1.0, element_exponent=None)
        assert line.peak_gain == pytest.approx(count, rel=1e-12)
    # Wide aperture: 4 pi A / lambda^2.
    assert Aperture(10, 5, 0.0566).peak_gain == pytest.approx(4 * np.pi * 50 / 0.0566**2, rel=1e-5)
    # One element cos^q: 2 (q + 1), also where the gamma functions of its integral overflow.
    for q in (0.0, 2.5, 341.0, 342.0, 1000.0):
        element = PlanarArray(1, 1, 0.5, 0.5, 1.0, element_exponent=q)
        assert element.peak_gain == pytest.approx(2 * (q + 1), rel=1e-11)
    # Narrow Gaussian beam: 16 ln2 / (widths).
    narrow = Gaussian(1 * DEG, 2 * DEG)
    assert narrow.peak_gain == pytest.approx(16 * np.log(2) / (2 * DEG**2), rel=2e-4)


def test_tapered_line_loses_its_taper_efficiency() -> None:
    """At half-wave spacing D = (sum w)^2 / sum w^2, with the windows' closed forms for w."""
    element = np.arange(16)
    closed = {
        "uniform": np.ones(16),
        "hamming": 0.54 - 0.46 * np.cos(2 * np.pi * element / 15),
        # None of the 16 is idle: the zeros lie one spacing beyond both ends.
        "hann": np.sin(np.pi * (element + 1) / 17) ** 2,
    }
    for taper in TAPERS:
        # Dolph's and Taylor's weights from the transform of their patterns.
        weights = closed[taper] if taper in closed else _from_pattern(taper, 16)
        line = PlanarArray(16, 1, 0.5, 0.5, 1.0, column_taper=taper, element_exponent=None)
        assert line.peak_gain == pytest.approx(weights.sum() ** 2 / np.sum(weights**2), rel=1e-10)
        made = taper_weights(taper, 16)
        np.testing.assert_allclose(made / made.sum(), weights / weights.sum(), rtol=1e-9)


def _from_pattern(taper: str, count: int) -> np.ndarray:
    """Weights of a line by the definitions of their patterns, at -50 dB and at nbar 4, -35 dB."""
    position = (np.arange(count) - (count - 1) / 2) / count
    if taper == "taylor":
        a2 = (np.arccosh(10 ** (35 / 20)) / np.pi) ** 2
        stretch2 = 16 / (a2 + 3.5**2)
        m = np.arange(1, 4)
        # The space factor at its sample points m (Balanis, Antenna Theory, 7.7).
        top = np.prod([1 - m**2 / stretch2 / (a2 + (n - 0.5) ** 2) for n in m], axis=0)
        factor = top * math.factorial(3) ** 2
        factor = factor / [math.factorial(3 + i) * math.factorial(3 - i) for i in m]
        return 1 + 2 * np.sum(factor * np.cos(2 * np.pi * m * position[:, None]), axis=1)
    # The zeros of Chebyshev's polynomial of degree N - 1 in x0 cos(psi/2) are those of the array.
    zero = np.cos((2 * np.arange(1, count) - 1) * np.pi / (2 * (count - 1)))
    edge = np.cosh(np.arccosh(10 ** (50 / 20)) / (count - 1))
    return np.poly(np.exp(2j * np.arccos(zero / edge))).real


# -- beamwidths, nulls, sidelobes ------------------------------------------------------------------


def test_half_power_beamwidths() -> None:
    for exponent in (0.5, 2.0, 30.0):
        antenna = CosinePower(exponent)
        assert half_power_width_rad(antenna, 0) == pytest.approx(
            2 * np.arccos(0.5 ** (1 / exponent)), rel=1e-12
        )
    assert half_power_width_rad(CosinePower.from_beamwidth(60 * DEG), 0) == pytest.approx(60 * DEG)
    gaussian = Gaussian(30 * DEG, 14 * DEG)
    assert half_power_width_rad(gaussian, 0) == pytest.approx(30 * DEG, rel=1e-12)
    assert half_power_width_rad(gaussian, 1) == pytest.approx(14 * DEG, rel=1e-12)
    aperture = Aperture(0.3, 0.2, 0.0566)
    for axis, size in ((0, 0.3), (1, 0.2)):
        # sinc^2(0.442946) = 1/2
        expected = 2 * np.arcsin(0.44294647 * 0.0566 / size)
        assert half_power_width_rad(aperture, axis) == pytest.approx(expected, rel=1e-7)
    # Uniform line of N: 0.886 lambda/(N d) for large N.
    line = PlanarArray(200, 1, 0.5, 0.5, 1.0, element_exponent=None)
    assert half_power_width_rad(line, 0) == pytest.approx(0.88589 / 100, rel=1e-4)


def test_nulls_and_first_sidelobe_of_a_uniform_line() -> None:
    line = PlanarArray(16, 1, 0.5, 0.5, 1.0, element_exponent=None)
    nulls = np.degrees(np.arcsin(np.arange(1, 8) / 8))
    assert gain_at(line, nulls).max() < 1e-28 * line.peak_gain
    fine = gain_at(line, np.linspace(nulls[0], nulls[1], 4001))
    # Dirichlet kernel of 16: -13.15 dB (a continuous aperture has -13.26).
    x = np.linspace(1, 2, 400001) / 8
    dirichlet = (np.sin(8 * np.pi * x) / (16 * np.sin(np.pi * x / 2))) ** 2
    assert fine.max() / line.peak_gain == pytest.approx(dirichlet.max(), rel=1e-6)


@pytest.mark.parametrize(("taper", "level_db"), [("taylor", -35.0), ("chebyshev", -50.0)])
def test_tapers_hold_their_sidelobe_level(taper: str, level_db: float) -> None:
    line = PlanarArray(64, 1, 0.5, 0.5, 1.0, column_taper=taper, element_exponent=None)
    relative_db = 10 * np.log10(gain_at(line, np.linspace(4, 90, 20001)) / line.peak_gain + 1e-30)
    assert relative_db.max() == pytest.approx(level_db, abs=0.4)


def test_steering_points_the_beam_and_tells_grating_lobes() -> None:
    array = PlanarArray(16, 8, 0.5, 0.5, 1.0, 25 * DEG, -10 * DEG, element_exponent=None)
    azimuth, elevation = np.meshgrid(np.arange(-80, 80.5), np.arange(-80, 80.5), indexing="ij")
    gain = gain_at(array, azimuth, elevation)
    best = np.unravel_index(np.argmax(gain), gain.shape)
    assert (azimuth[best], elevation[best]) == (25, -10)
    assert gain.max() == pytest.approx(array.peak_gain, rel=1e-12)
    assert not array.grating_lobes
    wide = PlanarArray(8, 1, 0.9, 0.5, 1.0, 30 * DEG, element_exponent=None)
    assert wide.grating_lobes
    lobe = np.degrees(np.arcsin(0.5 - 1 / 0.9))
    assert float(gain_at(wide, lobe)) == pytest.approx(wide.peak_gain, rel=1e-9)


def test_nothing_behind() -> None:
    for antenna in (CosinePower(2.0), Aperture(0.1, 0.1, 0.05), PlanarArray(4, 4, 0.5, 0.5, 1.0)):
        assert float(antenna.gain([0.1, 0.2, 1.0])) == 0


# -- tables ----------------------------------------------------------------------------------------


def write_pattern(path: Path, antenna, step_deg: float, rng: np.random.Generator) -> Path:
    azimuths, elevations = np.arange(-60, 60.01, step_deg), np.arange(-40, 40.01, step_deg)
    rows = [
        (a, e, 10 * np.log10(float(gain_at(antenna, a, e)))) for a in azimuths for e in elevations
    ]
    rng.shuffle(rows)
    text = "azimuth_deg,elevation_deg,gain_db\n" + "".join(f"{a},{e},{g:.9f}\n" for a, e, g in rows)
    path.write_text(text, encoding="utf-8")
    return path


def test_two_way_pattern_from_a_table_stays_within_its_bound(tmp_path: Path) -> None:
    """Gaussian 30 x 14 degrees at 0.5 degree steps: 0.015 dB two-way, far below 0.05 dB."""
    exact = Gaussian(30 * DEG, 14 * DEG)
    rng = np.random.default_rng(1)
    table = read_pattern(write_pattern(tmp_path / "pattern.csv", exact, 0.5, rng))
    azimuth, elevation = rng.uniform(-59, 59, 5000), rng.uniform(-39, 39, 5000)
    directions = direction_from_angles(azimuth * DEG, elevation * DEG)
    expected_db = 20 * np.log10(exact.gain(directions))
    error_db = 20 * np.log10(table.gain(directions)) - expected_db
    peak_db = 20 * np.log10(exact.peak_gain)
    assert (expected_db > peak_db - 40).sum() > 500
    # 3 (h/b)^2 per axis and way, and it only ever reads low.
    bound = 2 * 3.02 * (0.5**2 / 30**2 + 0.5**2 / 14**2)
    assert -bound < error_db.min() and error_db.max() < 1e-6
    assert bound < 0.05


def test_table_is_exact_at_its_rows_and_smallest_outside(tmp_path: Path) -> None:
    exact = Gaussian(30 * DEG, 14 * DEG)
    table = read_pattern(write_pattern(tmp_path / "p.csv", exact, 5.0, np.random.default_rng(2)))
    assert float(gain_at(table, 15.0, -5.0)) == pytest.approx(
        float(gain_at(exact, 15, -5)), rel=1e-8
    )
    assert float(gain_at(table, 170.0, 0.0)) == pytest.approx(10 ** (table.outside_db / 10))
    assert table.peak_gain == pytest.approx(exact.peak_gain, rel=1e-8)
    # The smallest one lies in no corner and in no first row.
    lobed = TableAntenna([-20.0, 0.0, 30.0], [-10.0, 10.0], [[3.0, 2.0], [10.0, 9.0], [-7.0, 1.0]])
    assert float(gain_at(lobed, 31.0, 0.0)) == pytest.approx(10**-0.7)
    assert float(gain_at(lobed, 0.0, -11.0)) == pytest.approx(10**-0.7)


@pytest.mark.parametrize("azimuths", [np.arange(-180, 181, 10.0), np.arange(0, 360, 10.0)])
def test_full_circle_is_closed_whichever_way_it_is_counted(azimuths) -> None:
    elevations = np.array([-90.0, 0.0, 90.0])
    gain = np.repeat(3 * np.cos(azimuths * DEG)[:, None], 3, axis=1)
    table = TableAntenna(azimuths, elevations, gain)
    for at in (-179.9, -175.0, 175.0, 180.0, -5.0, 5.0, 95.0):
        low = np.floor(at / 10) * 10
        ends = 3 * np.cos(np.array([low, low + 10]) * DEG)
        expected = ends[0] + (at - low) / 10 * (ends[1] - ends[0])
        assert float(table.gain_dbi(direction_from_angles(at * DEG, 0.1))) == pytest.approx(
            expected
        )


def test_principal_cuts_are_multiplied(tmp_path: Path) -> None:
    """Exact for a pattern that is a product, as a Gaussian is."""
    exact = Gaussian(30 * DEG, 14 * DEG)
    lines = ["cut,angle_deg,gain_db"]
    for angle in np.arange(-40, 40.5, 1.0):
        lines.append(f"azimuth,{angle},{10 * np.log10(float(gain_at(exact, angle, 0))):.9f}")
        lines.append(f"Elevation,{angle},{10 * np.log10(float(gain_at(exact, 0, angle))):.9f}")
    path = tmp_path / "cuts.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    table = read_pattern(path)
    for azimuth, elevation in ((0, 0), (7, -3), (-20, 11)):
        got, expected = gain_at(table, azimuth, elevation), gain_at(exact, azimuth, elevation)
        assert float(got) == pytest.approx(float(expected), rel=1e-7)
    # By hand: 8 dB on boresight, 2 dB more at 10 degrees to the right, 3 dB more 5 degrees up.
    path.write_text(
        "cut,angle_deg,gain_db\nazimuth,0,8\nazimuth,10,10\nelevation,0,8\nelevation,5,11\n",
        encoding="utf-8",
    )
    assert float(read_pattern(path).gain_dbi(direction_from_angles(10 * DEG, 5 * DEG))) == (
        pytest.approx(13)
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n", "expected azimuth_deg, elevation_deg, gain_db or cut, angle_deg, gain_db"),
        ("azimuth_deg,elevation_deg,gain_db\n0,0,1\n0,0,1\n", "line 3: .* is given twice"),
        (
            "azimuth_deg,elevation_deg,gain_db\n0,0,1\n0,5,1\n5,0,1\n",
            "azimuth 5, elevation 5 .* miss",
        ),
        ("azimuth_deg,elevation_deg,gain_db\n0,0,1\n5,0,1\n", "at least 2 azimuths and 2 elev"),
        ("azimuth_deg,elevation_deg,gain_db\n0,0,x\n", "line 2: gain_db is 'x'"),
        ("azimuth_deg,elevation_deg,gain_db\n0,0,1\n0,95,1\n5,0,1\n5,95,1\n", "-90 to 90 degrees"),
        ("cut,angle_deg,gain_db\nside,0,1\n", "line 2: cut is 'side'"),
        (f"cut,angle_deg,gain_db\nazimuth,0,{'1' * 140_000}\n", "line 2, cannot be read as CSV"),
        ("cut,angle_deg,gain_db\nazimuth,-5,1\nazimuth,5,1\n", "elevation cut has 0 rows"),
        (
            "cut,angle_deg,gain_db\nazimuth,-5,1\nazimuth,5,1\nelevation,-5,9\nelevation,5,9\n",
            "expected the same gain",
        ),
    ],
)
def test_bad_tables(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "pattern.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=message):
        read_pattern(path)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Isotropic(1.2), "Efficiency is 1.2"),
        (lambda: CosinePower(-1.0), "Exponent is -1"),
        (lambda: CosinePower.from_beamwidth(60.0), "give degrees"),
        (lambda: Gaussian(0.0, 1.0), "Azimuth beamwidth is 0 rad"),
        (lambda: Gaussian(30.0, 14.0), "at most 3.14159 rad"),
        (lambda: Aperture(np.nan, 1.0, 0.1), "Aperture width holds nan"),
        (lambda: PlanarArray(0, 1, 0.5, 0.5, 1.0), "0 columns"),
        (
            lambda: PlanarArray(4, 1, 0.5, 0.5, 1.0, column_taper=(1.0, 2.0)),
            "2 weights; expected 4",
        ),
        (lambda: PlanarArray(4, 1, 0.5, 0.5, 1.0, column_taper="kaiser"), "uniform, hamming"),
        (lambda: PlanarArray(2, 1, 0.5, 0.5, 1.0, column_taper=(1.0, -1.0)), "add up to zero"),
        (lambda: PlanarArray(2, 1, 0.5, 0.5, 1.0, element_exponent=1001.0), "up to 1000|to 1000"),
        (lambda: Isotropic().gain([0.0, 0.0, 0.0]), "length zero"),
        (lambda: Isotropic().gain([np.nan, 0.0, 1.0]), "Direction holds nan"),
        (lambda: Isotropic().gain([1.0, 0.0]), r"expected \[\.\.\., 3\]"),
        (lambda: to_antenna_frame(np.eye(2), AHEAD), "expected 4x4"),
    ],
)
def test_bad_input(call, message) -> None:
    with pytest.raises(ConfigError, match=message):
        call()


@pytest.mark.parametrize("sides", [(40_000_000, 2), (300, 300), (5000, 1), (10**400, 1)])
def test_arrays_that_take_too_long_are_refused(sides: tuple[int, int]) -> None:
    with pytest.raises(ConfigError, match="too large for its gain"):
        PlanarArray(*sides, 0.5, 0.5, 1.0)
