# SPDX-License-Identifier: GPL-3.0-or-later
"""Received watts, antennas on paths and cross sections, against the radar equation."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.errors import ConfigError
from radarsim_addon.physics.radar_equation import bistatic_power_w
from radarsim_addon.sidecar import file_sha256, read_record, write_record
from radarsim_addon.signal.decoding import frame_paths, open_frame, single_vertex_m
from radarsim_addon.signal.detection import (
    BudgetReport,
    FrameBudget,
    matching_objects,
    object_echoes,
)
from radarsim_addon.signal.detection.power_budget import compression_loss_db
from radarsim_addon.signal.paths import PATH_DTYPE, Paths, make_paths, path_power_w, write_table
from radarsim_addon.signal.paths.table import open_table
from radarsim_addon.signal.pipeline import FrameResult, ProcessOptions, main, process_run
from radarsim_addon.signal.radar import Burst, FmcwWaveform, Radar, make_system
from radarsim_addon.signal.runs import open_run
from radarsim_addon.signal.scattering import Link
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
    link, rows = FrameBudget(frame).link, np.asarray(frame.table.rows)
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
    import dataclasses

    left = dataclasses.replace(make_paths(np.ones(3), np.arange(1, 4)), gain=np.array([1.0, 2, 3]))
    both = Paths.join([left, make_paths(1.0, 9.0)])
    np.testing.assert_array_equal(both.gain, [1, 2, 3, 1])
    np.testing.assert_array_equal(both.select(np.array([False, True, False, True])).gain, [2, 1])


# -- products --------------------------------------------------------------------------------------


def two_plates(folder: Path) -> Path:
    plates = [
        pr.plate("Near", (0, 600, 0), 4.0, 0, 0.3),
        pr.plate("Far", (25, 900, 0), 8.0, 0, 0.3),
    ]
    receiver = pr.camera(pr.pose((0, 0, 0)), 3.0)
    emitter = contract.TransmitterRecord(pr.pose((0, 0, 0)), 1e6)
    rows = pr.trace(plates, receiver, emitter, 256, 2)
    beam = {"azimuth_beamwidth_deg": 8.0, "elevation_beamwidth_deg": 8.0}
    antenna = contract.AntennaRecord("gaussian", beam)
    scene = contract.GroundTruthRecord(
        1, 0.0,
        [contract.ObjectRecord(n, 1.0, 1.0, None, [], ["Plates"]) for n in ("Near", "Far")],
    )  # fmt: skip
    system = contract.LinkBudget(1e3, antenna, antenna, noise_figure_db=3.0)
    return pr.write_run(
        folder, rows, ["Near", "Far"], receiver, emitter, range_limits_m=1200.0, system=system,
        replicates=2, scene=scene,
    )  # fmt: skip


def test_summary_holds_watts_and_square_metres(tmp_path: Path) -> None:
    folder = two_plates(tmp_path / "run")
    results = [e for e in process_run(folder, ProcessOptions(plots=False))
               if isinstance(e, FrameResult)]  # fmt: skip
    summary = json.loads((folder / "products" / "frame_0001_summary.json").read_text())
    budget = summary["link_budget"]
    assert [echo["name"] for echo in budget["objects"]] == ["Near", "Far"]
    near, far = budget["objects"]
    assert near["rcs_m2"] == pytest.approx(4 * 0.3 * 16, rel=0.03)
    assert far["rcs_m2"] == pytest.approx(4 * 0.3 * 64, rel=0.03)
    # two-way gain at atan(25/900) off boresight, 12 dB (angle / width)^2 each way
    off_deg = math.degrees(math.atan2(25, 900))
    gain = 10 * math.log10(16 * math.log(2) / math.radians(8) ** 2)  # narrow beam
    level_db = 10 * math.log10(
        float(bistatic_power_w(1e3, far["rcs_m2"], 900, 900, WAVELENGTH_M))
    ) + 2 * (gain - 12.04 * (off_deg / 8) ** 2)
    assert far["power_dbm"] - 30 == pytest.approx(level_db, abs=0.1)
    assert budget["received_w"] == pytest.approx(near["power_w"] + far["power_w"], rel=1e-9)
    assert budget["noise_dbm"] == pytest.approx(-174 + 10 * math.log10(60e6) + 3, abs=0.05)
    pulse_gain_db = 10 * math.log10(150 * pr.BURST.pulses)
    snr = near["predicted_snr"]
    assert snr["burst_db"] - snr["single_sample_db"] == pytest.approx(pulse_gain_db - 2.7, abs=0.1)
    # the expected profile peaks at the objects' powers
    profile = results[0].profile
    here = np.abs(profile.range_m - 600) < 20
    assert 10 * math.log10(profile.power[here].max() / near["power_w"]) == pytest.approx(0, abs=0.1)
    assert results[0].expected is not None
    peak = results[0].expected.profile[np.abs(results[0].expected.range_m - 600) < 20].max()
    assert 10 * math.log10(peak / near["power_w"]) == pytest.approx(0, abs=0.3)


def budget_of(folder: Path, options: ProcessOptions) -> BudgetReport:
    result = next(e for e in process_run(folder, options) if isinstance(e, FrameResult))
    return result.budget


def test_no_snr_of_what_is_not_in_the_map(tmp_path: Path) -> None:
    folder = two_plates(tmp_path / "run")
    quick = ProcessOptions(products=False, plots=False, range_limits_m=(0.0, 800.0))
    report = budget_of(folder, quick)
    assert set(report.snr) == {"Near"}
    assert report.excluded_reason == {"Far": "outside the window"}
    assert "outside the window" in report.lines()[2] and "SNR" not in report.lines()[2]
    # 50 MHz over 250 samples: 749 m; the anti-alias filter takes out what is beyond
    fmcw = Radar(FmcwWaveform(5.3e9, 50e6, 250, 1e6), Burst(1000.0, 64))
    report = budget_of(folder, dataclasses.replace(quick, range_limits_m=None, radar=fmcw))
    assert report.excluded_reason == {"Far": "beyond the ADC's band"}
    # echoes of pulses fold: 900 m is received at 400 m
    folding = Radar(pr.WAVEFORM, Burst(pr.C0_MPS / 2 / 500, 64))
    report = budget_of(
        folder, dataclasses.replace(quick, range_limits_m=(300.0, 480.0), radar=folding)
    )
    assert report.excluded_reason == {"Near": "outside the window"}
    assert set(report.snr) == {"Far"}


def test_a_canceller_lowers_the_predicted_snr(tmp_path: Path) -> None:
    folder = two_plates(tmp_path / "run")
    quick = ProcessOptions(products=False, plots=False, mti=2)
    assert set(budget_of(folder, quick).excluded_reason.values()) == {"cancelled by the MTI"}
    table = folder / contract.frame_dir(1) / contract.PATHS_TABLE
    rows = np.array(open_table(table))
    rows["range_rate_mps"][rows["last_object"] == 2] = 2.0
    write_table(table, [rows])
    sidecar = folder / contract.frame_dir(1) / contract.PATHS_FILE
    record = read_record(sidecar, contract.PathsRecord)
    write_record(sidecar, dataclasses.replace(record, table_sha256=file_sha256(table)))
    plain = budget_of(folder, dataclasses.replace(quick, mti=0)).snr["Far"]
    for pulses in (2, 3):
        report = budget_of(folder, dataclasses.replace(quick, mti=pulses))
        assert report.excluded_reason == {"Near": "cancelled by the MTI"}
        # the textbook's response over that of white noise; the burst is a little shorter, too
        sine = math.sin(math.pi * (-2 * 2.0 / WAVELENGTH_M) / 1000.0) ** 2
        gain = {2: 4 * sine / 2, 3: 16 * sine**2 / 6}[pulses] * (65 - pulses) / 64
        change_db = report.snr["Far"].burst_db - plain.burst_db
        assert change_db == pytest.approx(10 * math.log10(gain), abs=1e-9)


def test_two_reflections_reach_the_transmitter_from_the_last_vertex(tmp_path: Path) -> None:
    """R_r and G_r are those of the first vertex, R_t and G_t those of the last: a bent path."""
    first, last = np.array([100.0, 400.0, 0.0]), np.array([-60.0, 800.0, 0.0])
    receiver_m, transmitter_m = np.zeros(3), np.array([-200.0, 0.0, 0.0])
    back_m, there_m = math.hypot(100, 400), math.hypot(140, 800)
    rcs_m2, eirp_w = 7.0, 1e6
    row = np.zeros(1, dtype=PATH_DTYPE)
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


def test_windows_cost_what_harris_says() -> None:
    radar = Radar(pr.WAVEFORM, pr.BURST)
    assert compression_loss_db(radar, "none", "none") == pytest.approx(0, abs=0.15)
    # Hamming: processing loss 1.34 dB (Harris 1978, table 1), over band and over pulses
    assert compression_loss_db(radar, "hamming", "hamming") == pytest.approx(2 * 1.34, abs=0.12)


def test_groups_and_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = two_plates(tmp_path / "run")
    frame = open_run(folder).frame(1)
    assert matching_objects(frame, "Plates") == ["Near", "Far"]
    assert matching_objects(frame, "*ar") == ["Near", "Far"]
    assert matching_objects(frame, "Far") == ["Far"]
    with pytest.raises(ConfigError, match=r"'Nothing'; there are 'Near', 'Far', 'Plates'"):
        matching_objects(frame, "Nothing")
    single = object_echoes(frame, pr.WAVEFORM.carrier_hz)
    (both,) = object_echoes(frame, pr.WAVEFORM.carrier_hz, None, {"all": ["Near", "Far"]})
    assert both.rcs_m2 == pytest.approx(sum(e.rcs_m2 for e in single))
    assert main(["rcs", str(folder), "--object", "Plates"]) == 0
    printed = capsys.readouterr().out
    assert f"{both.rcs_dbsm:7.2f} dBsm" in printed
    assert main(["rcs", str(folder), "--object", "Nothing"]) == 2


def test_paths_over_two_objects_are_shared(tmp_path: Path) -> None:
    folder = two_plates(tmp_path / "run")
    record_folder = folder / contract.frame_dir(1)
    from radarsim_addon.sidecar import file_sha256, read_record, write_record
    from radarsim_addon.signal.paths import write_table
    from radarsim_addon.signal.paths.table import open_table

    rows = np.array(open_table(record_folder / contract.PATHS_TABLE))
    rows["order"][0], rows["first_object"][0] = 2, 2
    assert rows["last_object"][0] == 1 or rows["last_object"][0] == 2
    rows["last_object"][0] = 1
    write_table(record_folder / contract.PATHS_TABLE, [rows])
    record = read_record(record_folder / contract.PATHS_FILE, contract.PathsRecord)
    changed = {**record.__dict__, "table_sha256": file_sha256(record_folder / contract.PATHS_TABLE)}
    write_record(record_folder / contract.PATHS_FILE, contract.PathsRecord(**changed))
    frame = open_run(folder).frame(1)
    for echo in object_echoes(frame, pr.WAVEFORM.carrier_hz):
        assert echo.multi_object_power_w == pytest.approx(rows["power_w"][0])
    (both,) = object_echoes(frame, pr.WAVEFORM.carrier_hz, None, {"all": ["Near", "Far"]})
    assert both.multi_object_power_w == 0


def test_a_receiver_gain_beside_a_system_is_refused(tmp_path: Path) -> None:
    folder = two_plates(tmp_path / "run")
    with pytest.raises(ConfigError, match="receiver gain of 10"):
        list(process_run(folder, ProcessOptions(receive_antenna_gain_dbi=10.0)))


def test_system_file_overrides_the_runs_own(tmp_path: Path) -> None:
    folder = two_plates(tmp_path / "run")
    file = tmp_path / "other.json"
    file.write_text('{"transmit_power_w": 1e6, "weighting": "paper"}')
    assert main(["process", str(folder), "--no-plots", "--system", str(file)]) == 0
    summary = json.loads((folder / "products" / "frame_0001_summary.json").read_text())
    assert summary["options"]["amplitude_model"] == "paper"
    assert summary["options"]["link_budget"]["transmit_power_w"] == 1e6


def test_cross_sections_of_rings_are_refused_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    setup = synthetic.Setup(rings=2)
    picture = synthetic.points(setup, [(2, 2, 300.0, 1.0, 0.0)])
    folder = synthetic.write_run(tmp_path / "run", setup, picture)
    assert main(["rcs", str(folder)]) != 0
    assert "measured by rings" in capsys.readouterr().err
