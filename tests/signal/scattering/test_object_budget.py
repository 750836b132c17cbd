# SPDX-License-Identifier: GPL-3.0-or-later
"""Link budget of objects in the summary: power, cross section, SNR, and what has none."""

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
from radarsim_addon.signal.decoding import open_frame
from radarsim_addon.signal.detection import (
    BudgetReport,
    matching_objects,
    object_echoes,
)
from radarsim_addon.signal.detection.power_budget import compression_loss_db
from radarsim_addon.signal.paths import IMAGE_DTYPE, PathRows, write_table
from radarsim_addon.signal.paths.table import column_groups, open_table
from radarsim_addon.signal.pipeline import FrameResult, ProcessOptions, main, process_run
from radarsim_addon.signal.radar import Burst, FmcwWaveform, Radar
from radarsim_addon.signal.runs import open_run
from radarsim_addon.typed_json import read_record, write_record
from tests.signal import path_runs as pr
from tests.signal import synthetic

WAVELENGTH_M = pr.WAVEFORM.wavelength_m


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
    assert report.excluded_reason == {"Far": "outside the range limits"}
    assert "outside the range limits" in report.lines()[2] and "SNR" not in report.lines()[2]
    # 50 MHz over 250 samples: 749 m; the anti-alias filter takes out what is beyond
    fmcw = Radar(FmcwWaveform(5.3e9, 50e6, 250, 1e6), Burst(1000.0, 64))
    report = budget_of(folder, dataclasses.replace(quick, range_limits_m=None, radar=fmcw))
    assert report.excluded_reason == {"Far": "beyond the ADC's band"}
    # echoes of pulses fold: 900 m is received at 400 m
    folding = Radar(pr.WAVEFORM, Burst(pr.C0_MPS / 2 / 500, 64))
    report = budget_of(
        folder, dataclasses.replace(quick, range_limits_m=(300.0, 480.0), radar=folding)
    )
    assert report.excluded_reason == {"Near": "outside the range limits"}
    assert set(report.snr) == {"Far"}


def test_a_canceller_lowers_the_predicted_snr(tmp_path: Path) -> None:
    folder = two_plates(tmp_path / "run")
    quick = ProcessOptions(products=False, plots=False, mti=2)
    assert set(budget_of(folder, quick).excluded_reason.values()) == {"cancelled by the MTI"}
    table = folder / contract.frame_dir(1) / contract.PATHS_TABLE
    rows = open_table(table).copy()
    rows["range_rate_mps"][rows["last_object"] == 2] = 2.0
    written = write_table(table, [rows], rows.size)
    sidecar = folder / contract.frame_dir(1) / contract.PATHS_FILE
    record = read_record(sidecar, contract.PathsRecord)
    write_record(sidecar, dataclasses.replace(record, column_sha256=written.column_sha256))
    plain = budget_of(folder, dataclasses.replace(quick, mti=0)).snr["Far"]
    for pulses in (2, 3):
        report = budget_of(folder, dataclasses.replace(quick, mti=pulses))
        assert report.excluded_reason == {"Near": "cancelled by the MTI"}
        # the textbook's response over that of white noise; the burst is a little shorter, too
        sine = math.sin(math.pi * (-2 * 2.0 / WAVELENGTH_M) / 1000.0) ** 2
        gain = {2: 4 * sine / 2, 3: 16 * sine**2 / 6}[pulses] * (65 - pulses) / 64
        change_db = report.snr["Far"].burst_db - plain.burst_db
        assert change_db == pytest.approx(10 * math.log10(gain), abs=1e-9)


def test_received_power_knows_of_interference(tmp_path: Path) -> None:
    """Each point direct and over a mirror with 0.8 of the amplitude, in and out of phase."""
    folder = two_plates(tmp_path / "run")
    table = folder / contract.frame_dir(1) / contract.PATHS_TABLE
    sidecar = folder / contract.frame_dir(1) / contract.PATHS_FILE
    quick = ProcessOptions(products=False, plots=False, speckle_seed=None)
    alone_w = budget_of(folder, quick).received_w
    direct = open_table(table).copy()
    rows = PathRows.zeros(2 * direct.size, IMAGE_DTYPE)
    for name in direct.names:
        rows[name] = np.repeat(direct[name], 2, axis=0)
    rows["point"] = 1 + np.arange(rows.size) // 2
    rows["power_w"][1::2] *= 0.64
    groups = column_groups(IMAGE_DTYPE.names or ())
    for turn, gain in ((math.pi, 0.2**2), (0.0, 1.8**2), (math.pi / 2, 1.64)):
        rows["mirror_phase_rad"][1::2] = turn
        written = write_table(table, [rows], rows.size, IMAGE_DTYPE)
        record = read_record(sidecar, contract.PathsRecord)
        changed = dataclasses.replace(
            record,
            column_sha256=written.column_sha256,
            column_groups=groups,
            path_count=rows.size,
        )
        write_record(sidecar, changed)
        assert budget_of(folder, quick).received_w / alone_w == pytest.approx(gain, rel=1e-6)


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
    opened = open_frame(frame)
    truth = opened.ground_truth
    assert truth is not None
    instances = [dataclasses.replace(item, name=f"Instancer/{item.name}") for item in truth.objects]
    truth = dataclasses.replace(truth, objects=instances)
    of_instances = dataclasses.replace(opened, ground_truth=truth)
    assert matching_objects(of_instances, "Plates") == ["Near", "Far"]
    with pytest.raises(ConfigError, match=r"'Nothing'; there are 'Near', 'Far', 'Plates'"):
        matching_objects(frame, "Nothing")
    single = object_echoes(frame, pr.WAVEFORM.carrier_hz)
    (both,) = object_echoes(frame, pr.WAVEFORM.carrier_hz, None, {"all": ["Near", "Far"]})
    assert both.rcs_m2 == pytest.approx(sum(e.rcs_m2 for e in single))
    assert main(["objects", str(folder), "--object", "Plates"]) == 0
    printed = capsys.readouterr().out
    assert f"{both.rcs_dbsm:7.2f} dBsm" in printed
    assert main(["objects", str(folder), "--object", "Nothing"]) == 2


def test_paths_over_two_objects_are_shared(tmp_path: Path) -> None:
    folder = two_plates(tmp_path / "run")
    record_folder = folder / contract.frame_dir(1)
    from radarsim_addon.signal.paths import write_table
    from radarsim_addon.signal.paths.table import open_table
    from radarsim_addon.typed_json import read_record, write_record

    rows = open_table(record_folder / contract.PATHS_TABLE).copy()
    rows["order"][0], rows["first_object"][0] = 2, 2
    assert rows["last_object"][0] == 1 or rows["last_object"][0] == 2
    rows["last_object"][0] = 1
    written = write_table(record_folder / contract.PATHS_TABLE, [rows], rows.size)
    record = read_record(record_folder / contract.PATHS_FILE, contract.PathsRecord)
    changed = {**record.__dict__, "column_sha256": written.column_sha256}
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
    file.write_text('{"transmit_power_w": 1e6, "amplitude_model": "paper"}')
    assert main(["process", str(folder), "--no-plots", "--link-budget", str(file)]) == 0
    summary = json.loads((folder / "products" / "frame_0001_summary.json").read_text())
    assert summary["options"]["amplitude_model"] == "paper"
    assert summary["options"]["link_budget"]["transmit_power_w"] == 1e6


def test_cross_sections_of_rings_are_refused_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    setup = synthetic.Setup(rings=2)
    picture = synthetic.points(setup, [(2, 2, 300.0, 1.0, 0.0)])
    folder = synthetic.write_run(tmp_path / "run", setup, picture)
    assert main(["objects", str(folder)]) != 0
    assert "measured by rings" in capsys.readouterr().err
