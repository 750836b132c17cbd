# SPDX-License-Identifier: GPL-3.0-or-later
"""Received watts, antennas on paths and cross sections, against the radar equation."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.errors import ConfigError
from radarsim_addon.physics.radar_equation import bistatic_power_w
from radarsim_addon.signal.decoding import frame_paths, open_frame, single_vertex_m
from radarsim_addon.signal.detection import (
    FrameBudget,
    object_echoes,
)
from radarsim_addon.signal.motion import BodyMotion, FrameMotion, LinearMotion
from radarsim_addon.signal.motion.body_motion import Segment
from radarsim_addon.signal.paths import PathRows, Paths, make_paths, path_power_w
from radarsim_addon.signal.radar import Channel, Element, make_system
from radarsim_addon.signal.runs import open_run
from radarsim_addon.signal.scattering import Link
from radarsim_addon.signal.scattering.amplitudes import PathEnds
from tests.signal import path_runs as pr
from tests.signal import synthetic

WAVELENGTH_M = pr.WAVEFORM.wavelength_m


def one_plate(
    folder: Path, emitter_at: tuple[float, float, float] = (0, 0, 0), tilt_deg: float = 0.0,
    range_m: float = 1000.0, system: contract.LinkBudget | None = None, replicates: int = 1,
) -> Path:  # fmt: skip
    """A run of a 10 m Lambert plate, finely sampled."""
    target = pr.plate("Plate", (0, range_m, 0), 10.0, tilt_deg, 0.5)
    receiver = pr.camera(pr.pose((0, 0, 0)), math.degrees(8 / range_m))
    emitter = contract.TransmitterRecord(pr.pose(emitter_at), 1e6)
    rows = pr.trace([target], receiver, emitter, 200, replicates)
    return pr.write_run(
        folder, rows, ["Plate"], receiver, emitter, range_limits_m=2 * range_m, system=system,
        replicates=replicates,
    )  # fmt: skip


@pytest.mark.parametrize("tilt_deg", [0.0, 40.0])
@pytest.mark.parametrize("bistatic", [False, True])
def test_plate_has_its_cross_section(tmp_path: Path, tilt_deg: float, bistatic: bool) -> None:
    at = (-300.0, 200.0, 100.0) if bistatic else (0.0, 0.0, 0.0)
    run = open_run(one_plate(tmp_path / "run", at, tilt_deg, replicates=4))
    (echo,) = object_echoes(run.frame(1), pr.WAVEFORM.carrier_hz)
    normal = np.array([0, -math.cos(math.radians(tilt_deg)), math.sin(math.radians(tilt_deg))])
    to_emitter = np.array(at) - [0, 1000, 0]
    cos_t = normal @ to_emitter / np.linalg.norm(to_emitter)
    cos_r = normal @ [0, -1, 0]
    expected = 4 * 0.5 * 100 * cos_t * cos_r
    assert 10 * math.log10(echo.rcs_m2 / expected) == pytest.approx(0, abs=0.05)
    assert echo.rcs_error_m2 < 0.02 * echo.rcs_m2
    power = bistatic_power_w(1e6, expected, float(np.linalg.norm(to_emitter)), 1000.0, WAVELENGTH_M)
    assert 10 * math.log10(echo.power_w / power) == pytest.approx(0, abs=0.05)
    assert echo.range_m == pytest.approx((1000 + np.linalg.norm(to_emitter)) / 2, abs=0.1)


def test_system_scales_to_watts_and_cancels_the_lamp(tmp_path: Path) -> None:
    system = contract.LinkBudget(
        transmit_power_w=50.0,
        transmitter=contract.AntennaRecord("isotropic", {"gain_dbi": 20.0}),
        receiver=contract.AntennaRecord("isotropic", {"gain_dbi": 10.0}),
        transmit_loss_db=1.0, receive_loss_db=2.0, other_loss_db=3.0,
    )  # fmt: skip
    run = open_run(one_plate(tmp_path / "run", system=system))
    frame = run.frame(1)
    budget = FrameBudget(open_frame(frame))
    power = path_power_w(budget.apply(frame_paths(frame)), WAVELENGTH_M).sum()
    plain = path_power_w(frame_paths(frame), WAVELENGTH_M).sum()
    assert power / plain == pytest.approx(50 * 10**2 * 10 / 1e6 / 10**0.6, rel=1e-12)
    (echo,) = object_echoes(frame, pr.WAVEFORM.carrier_hz, budget.link)
    assert echo.power_w == pytest.approx(power, rel=1e-12)
    expected = bistatic_power_w(50 * 100, echo.rcs_m2, 1000, 1000, WAVELENGTH_M, 10, 6.0)
    assert 10 * math.log10(power / expected) == pytest.approx(0, abs=0.01)


def test_gains_of_rows_are_found_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By their numbers in the table: with the bits of those that are not kept, in any part."""
    beam = {"azimuth_beamwidth_deg": 5.0, "elevation_beamwidth_deg": 4.0}
    system = contract.LinkBudget(50.0, contract.AntennaRecord("gaussian", beam))
    frame = open_frame(open_run(one_plate(tmp_path / "run", system=system)).frame(1))
    link, rows = FrameBudget(frame).link, frame.table.rows
    assert link is not None
    gains, paths = link.mean_factor_of_rows(rows), frame_paths(frame)
    applied = link.apply(paths).gain
    number = np.arange(rows.size)
    for part in (number[3:7], number[5:]):
        assert (link.mean_factor_of_rows(rows[part], part) == gains[part]).all()
    assert (link.apply(paths, of_table=True).gain == applied).all()  # some are not known
    assert (link.mean_factor_of_rows(rows, number) == gains).all()
    monkeypatch.setattr(Link, "mean_factor", None)
    assert (link.mean_factor_of_rows(rows, number) == gains).all()
    assert (link.apply(paths, of_table=True).gain == applied).all()


def test_another_carrier_brings_power_by_its_wavelength_squared(tmp_path: Path) -> None:
    """The effective area is lambda^2 / 4 pi, the cross section stays that of the render."""
    frame = open_run(one_plate(tmp_path / "run")).frame(1)
    (echo,) = object_echoes(frame, pr.WAVEFORM.carrier_hz)
    (twice,) = object_echoes(frame, 2 * pr.WAVEFORM.carrier_hz)
    assert twice.power_w == pytest.approx(echo.power_w / 4, rel=1e-12)
    assert twice.rcs_m2 == echo.rcs_m2


def test_each_antenna_has_its_own_direction(tmp_path: Path) -> None:
    """Bistatic: the transmitter is turned 7 degrees off the plate, the receiver looks at it."""
    wide = {"azimuth_beamwidth_deg": 12.0, "elevation_beamwidth_deg": 30.0}
    target = pr.plate("Plate", (0, 1000, 0), 1.0)
    receiver = pr.camera(pr.pose((0, 0, 0)), 0.05)
    # from (-1000, 0, 0) the plate is at 45 degrees to the right of +Y
    emitter = contract.TransmitterRecord(pr.pose((-1000, 0, 0), 45 - 7.0), 1e6)
    rows = pr.trace([target], receiver, emitter, 64)
    folder = pr.write_run(
        tmp_path / "run", rows, ["Plate"], receiver, emitter, range_limits_m=3000.0,
        system=contract.LinkBudget(1e6, contract.AntennaRecord("gaussian", wide)),
    )  # fmt: skip
    run = open_run(folder)
    budget = FrameBudget(open_frame(run.frame(1)))
    paths = budget.apply(frame_paths(run.frame(1)))
    assert paths.gain is not None
    peak = float(make_system(run.record.link_budget, WAVELENGTH_M).transmitter.gain((0, 0, -1.0)))
    loss_db = 40 * math.log10(2) * (7 / 12) ** 2  # 3.01 dB at half the beamwidth
    assert 10 * np.log10(paths.gain.mean() / peak) == pytest.approx(-loss_db, abs=0.02)


def test_swept_beam_draws_its_two_way_pattern() -> None:
    """Both antennas are swept over a point; product of sinc^2 patterns to -40 dB and below."""
    aperture = contract.AntennaRecord("aperture", {"width_m": 1.0, "height_m": 0.5})
    system = make_system(contract.LinkBudget(1.0, aperture, aperture), WAVELENGTH_M)
    point = np.array([0.0, 500.0, 0.0])
    paths = make_paths(1.0, 1000.0)
    for azimuth_deg in np.linspace(-6, 6, 61):
        matrix = pr.pose((0, 0, 0), azimuth_deg)
        link = Link(system, pr.camera(matrix), contract.TransmitterRecord(matrix, 1.0))
        factor = link.factor(paths.length_m, point[None] / 500, point[None])
        one_way = np.sinc(1.0 / WAVELENGTH_M * math.sin(math.radians(azimuth_deg))) ** 2
        boresight = float(system.transmitter.gain((0, 0, -1.0))) ** 2
        assert float(factor[0]) == pytest.approx(boresight * one_way**2, rel=1e-9)


def test_gains_follow_each_antenna_on_its_own_way() -> None:
    """The receiver drives to the right, the transmitter climbs: cos^8 to where each of them is."""
    span_s, point_m = 0.1, np.array([10.0, 200.0, 5.0])
    places_m = np.array([[0.0, 0, 0], [-40.0, 0, 0]])
    velocities_mps = np.array([[400.0, 0, 0], [0, 0, 900.0]])

    def moving(place_m: np.ndarray, velocity_mps: np.ndarray) -> BodyMotion:
        half = velocity_mps * span_s / 2
        segment = Segment(0.0, span_s, np.array([place_m + half, half]))
        return BodyMotion(np.array(pr.pose(place_m)), (segment,))

    receiver, transmitter = (moving(*o) for o in zip(places_m, velocities_mps, strict=True))
    lobe = contract.AntennaRecord("cosine", {"exponent": 8.0})
    poses = [pr.pose(place_m) for place_m in places_m]
    link = Link(
        make_system(contract.LinkBudget(1.0, lobe, lobe), WAVELENGTH_M),
        pr.camera(poses[0]), contract.TransmitterRecord(poses[1], 1.0),
        FrameMotion(span_s, receiver, transmitter, False, []),
    )  # fmt: skip
    ways_m = point_m - places_m
    length_m = np.linalg.norm(ways_m, axis=1).sum(keepdims=True)
    ends = PathEnds(
        length_m, ways_m[:1] / np.linalg.norm(ways_m[0]), point_m[None], point_m[None],
        LinearMotion(length_m, np.zeros(1)),
    )  # fmt: skip
    times_s = np.array([0.0, 0.04, 0.1])
    towards_m = point_m - (places_m + velocities_mps * times_s[:, None, None])
    cosines = towards_m[..., 1] / np.linalg.norm(towards_m, axis=2)
    expected = np.prod(2 * 9 * cosines**8, axis=1)
    np.testing.assert_allclose(link.factors(ends, times_s)[0], expected, rtol=1e-9)


def test_single_vertex_is_on_the_ray_and_the_ellipsoid() -> None:
    rng = np.random.default_rng(3)
    receiver, emitter = np.array([1.0, 2.0, 3.0]), np.array([-40.0, 5.0, 20.0])
    point = rng.uniform(-500, 500, (200, 3))
    there = np.linalg.norm(point - receiver, axis=1)
    length = there + np.linalg.norm(point - emitter, axis=1)
    direction = (point - receiver) / there[:, None]
    found = single_vertex_m(length, direction, receiver, emitter)
    np.testing.assert_allclose(found, point, atol=1e-9)
    assert np.isnan(single_vertex_m(np.ones(1), direction[:1], receiver, emitter)).all()


def test_rings_know_their_vertices(tmp_path: Path) -> None:
    """A Gaussian beam on the pixels of a ring, receiver and emitter in one place."""
    setup = synthetic.Setup()
    echoes = [(0, 0, 400.0, 1.0, 0.0), (setup.height_px - 1, setup.width_px // 2, 700.0, 2.0, 0.0)]
    folder = synthetic.write_run(tmp_path / "run", setup, synthetic.points(setup, echoes))
    run = open_run(folder)
    frame = run.frame(1)
    beam = contract.AntennaRecord(
        "gaussian", {"azimuth_beamwidth_deg": 25.0, "elevation_beamwidth_deg": 25.0}
    )
    budget = FrameBudget(open_frame(frame, link_budget=contract.LinkBudget(3.0, receiver=beam)))
    paths = budget.apply(frame_paths(frame))
    assert paths.geometry is not None
    receiver_m = budget.link.receiver_m
    distance = np.linalg.norm(paths.geometry.last_scatterer_m - receiver_m, axis=1)
    np.testing.assert_allclose(
        distance + np.linalg.norm(paths.geometry.last_scatterer_m - budget.link.emitter_m, axis=1),
        paths.length_m, rtol=1e-12,
    )  # fmt: skip
    eirp_w = synthetic.render_record(setup, 1, 0, 0).transmitter.eirp_w
    gain = budget.link.receive_gain(paths.geometry.direction)
    np.testing.assert_allclose(paths.gain, 3.0 / eirp_w * gain, rtol=1e-12)
    assert budget.link.guessed == 0


def test_an_unknown_vertex_lies_half_way(tmp_path: Path) -> None:
    """An element 0.5 m off the receiver sees a target at 3 m 9.5 degrees off its axis, a narrow
    beam 3.0 dB times (2 x 9.46 / 12)^2 down; so where the first vertex of the path is not known.
    """
    beam = contract.AntennaRecord(
        "gaussian", {"azimuth_beamwidth_deg": 12.0, "elevation_beamwidth_deg": 12.0}
    )
    system = make_system(contract.LinkBudget(1.0, receiver=beam), WAVELENGTH_M)
    here = pr.pose((0, 0, 0))
    link = Link(system, pr.camera(here), contract.TransmitterRecord(here, 1.0))
    known = np.array([[0.0, 3.0, 0.0]])
    channel = Channel(rx=Element(position_m=(0.5, 0.0, 0.0)))
    angle_deg = math.degrees(math.atan2(0.5, 3.0))
    loss_db = 40 * math.log10(2) * (angle_deg / 12) ** 2
    peak = float(system.receiver.gain((0, 0, -1.0)))
    for first, last in ((known, known), (np.full((1, 3), np.nan), known)):
        length_m, direction = np.array([6.0]), np.array([[0, 1.0, 0]])
        motion = LinearMotion(length_m, np.zeros(1))
        ends = PathEnds(length_m, direction, first, last, motion)
        gain = link.factors(ends, np.zeros(1), channel)[0, 0]
        assert 10 * math.log10(gain / peak) == pytest.approx(-loss_db, abs=1e-6)


def test_paths_without_directions_are_refused() -> None:
    link = Link(
        make_system(contract.LinkBudget(), WAVELENGTH_M),
        pr.camera(pr.pose((0, 0, 0))),
        contract.TransmitterRecord(pr.pose((0, 0, 0)), 1.0),
    )
    with pytest.raises(ConfigError, match="no directions"):
        link.apply(make_paths(1.0, 10.0))


def test_a_dark_lamp_is_refused() -> None:
    system, here = make_system(contract.LinkBudget(), WAVELENGTH_M), pr.pose((0, 0, 0))
    with pytest.raises(ConfigError, match="power is 0 W"):
        Link(system, pr.camera(here), contract.TransmitterRecord(here, 0.0))


def test_gain_follows_rows() -> None:

    left = dataclasses.replace(make_paths(np.ones(3), np.arange(1, 4)), gain=np.array([1.0, 2, 3]))
    both = Paths.join([left, make_paths(1.0, 9.0)])
    np.testing.assert_array_equal(both.gain, [1, 2, 3, 1])
    np.testing.assert_array_equal(both.select(np.array([False, True, False, True])).gain, [2, 1])


# -- products --------------------------------------------------------------------------------------


def test_two_reflections_reach_the_transmitter_from_the_last_vertex(tmp_path: Path) -> None:
    """R_r and G_r are those of the first vertex, R_t and G_t those of the last: a bent path."""
    first, last = np.array([100.0, 400.0, 0.0]), np.array([-60.0, 800.0, 0.0])
    receiver_m, transmitter_m = np.zeros(3), np.array([-200.0, 0.0, 0.0])
    back_m, there_m = math.hypot(100, 400), math.hypot(140, 800)
    rcs_m2, eirp_w = 7.0, 1e6
    row = PathRows.zeros(1)
    row["power_w"] = bistatic_power_w(eirp_w, rcs_m2, there_m, back_m, WAVELENGTH_M)
    row["length_m"] = back_m + math.dist(first, last) + there_m
    row["order"], row["solid_angle_sr"] = 2, 1e-6
    row["first_scatterer_m"], row["last_scatterer_m"] = first, last
    row["direction"] = (first - receiver_m) / back_m
    row["first_object"] = row["last_object"] = 1
    beam = contract.AntennaRecord(
        "gaussian", {"azimuth_beamwidth_deg": 30.0, "elevation_beamwidth_deg": 30.0}
    )
    folder = pr.write_run(
        tmp_path / "run", row, ["Corner"], pr.camera(pr.pose(receiver_m)),
        contract.TransmitterRecord(pr.pose(transmitter_m), eirp_w), range_limits_m=1000.0,
        system=contract.LinkBudget(5.0, beam, beam),
    )  # fmt: skip
    frame = open_run(folder).frame(1)
    (echo,) = object_echoes(frame, pr.WAVEFORM.carrier_hz)
    assert echo.rcs_m2 == pytest.approx(rcs_m2, rel=1e-9)
    budget = FrameBudget(open_frame(frame))
    paths = budget.apply(frame_paths(frame))
    assert paths.gain is not None
    peak = float(budget.link.system.transmitter.gain((0, 0, -1.0)))
    angles_deg = math.degrees(math.atan2(100, 400)), math.degrees(math.atan2(140, 800))
    loss_db = sum(40 * math.log10(2) * (angle / 30) ** 2 for angle in angles_deg)
    gain_db = 10 * math.log10(float(paths.gain[0]) * eirp_w / 5.0 / peak**2)
    assert gain_db == pytest.approx(-loss_db, abs=1e-6)
