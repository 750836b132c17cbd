# SPDX-License-Identifier: GPL-3.0-or-later
"""Speckle as a stage of processing: roughness from the ground truth, findings, the map."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from radarsim_addon import contract
from radarsim_addon.errors import ConfigError
from radarsim_addon.findings import merge
from radarsim_addon.signal.decoding import frame_paths, open_frame
from radarsim_addon.signal.pipeline import FrameResult, ProcessOptions, process_run
from radarsim_addon.signal.radar import Radar
from radarsim_addon.signal.runs import open_run
from radarsim_addon.signal.scattering import FrameSpeckle
from radarsim_addon.signal.scattering.frame_speckle import kirchhoff_findings
from radarsim_addon.typed_json import write_record
from tests.signal import path_runs as pr
from tests.signal.scattering.speckle_scenes import WAVELENGTH_M, scene, speckle


def test_frames_know_the_roughness_of_their_objects(tmp_path: Path) -> None:
    _, _, folder = scene(tmp_path / "run", side_m=1.0, size_px=32)
    frame = open_run(folder).frame(1)
    radar = Radar(pr.WAVEFORM, pr.BURST)
    rough = FrameSpeckle(open_frame(frame, radar=radar), 3).apply(frame_paths(frame))
    assert rough.phasors is not None
    assert not np.isnan(rough.phasors).any()
    item = contract.ObjectRecord("Plate", 1000.0, 1000.0, None, rms_height_m=0.0)
    record = contract.GroundTruthRecord(1, 0.0, [item])
    write_record(folder / contract.frame_dir(1) / contract.GROUND_TRUTH_FILE, record)
    smooth = FrameSpeckle(open_frame(frame, radar=radar), 3)
    report = smooth.report()
    assert report is not None
    assert report.coherent_objects == ("Plate",)
    assert not np.isnan(smooth.apply(frame_paths(frame)).phasors).any()
    assert (
        FrameSpeckle(open_frame(frame, radar=radar), None).apply(frame_paths(frame)).phasors is None
    )


@pytest.mark.parametrize("cell_m", [0.0, -3.0, math.nan, 1e9])
def test_cells_without_sense_are_refused(tmp_path: Path, cell_m: float) -> None:
    record, table, _ = scene(tmp_path / "run", side_m=1.0, size_px=16)
    with pytest.raises(ConfigError, match="Edge of a speckle cell is"):
        speckle(record, table, 0, cell_m=cell_m)


def test_surfaces_beyond_the_model_are_named() -> None:
    def record(*surfaces: tuple[str, float, float]) -> contract.GroundTruthRecord:
        items = [
            contract.ObjectRecord(n, 1.0, 1.0, None, rms_height_m=h, correlation_length_m=length)
            for n, h, length in surfaces
        ]
        return contract.GroundTruthRecord(1, 0.0, items)

    good = ("Sand", 0.02, 0.4)  # k h = 2.2, slope 0.07
    assert kirchhoff_findings(record(good), WAVELENGTH_M) == []
    found = kirchhoff_findings(record(good, ("Gravel", 0.02, 0.03)), WAVELENGTH_M)
    assert {item.subjects for item in found} == {("Gravel",)}
    (short,) = [item for item in found if item.code == "kirchhoff-short-correlation"]
    assert short.numbers["k_l"] == pytest.approx(3.33, abs=0.005)
    many = [(f"Stone {n}", 0.02, 0.03) for n in range(20)]
    merged = merge(kirchhoff_findings(record(*many), WAVELENGTH_M))
    assert all(len(item.subjects) == 20 and "and 17 more" in item.text for item in merged)
    assert kirchhoff_findings(None, WAVELENGTH_M) == []


def test_map_shows_the_speckle(tmp_path: Path) -> None:
    """Mean of the map's peak over realisations is the received power."""
    _, table, folder = scene(tmp_path / "run", side_m=3.0, size_px=48, range_m=400.0)
    peaks, reports = [], []
    for seed in range(24):
        options = ProcessOptions(speckle_seed=seed, plots=False, products=False)
        for event in process_run(folder, options):
            if isinstance(event, FrameResult):
                peaks.append(event.rd_map.plane_power.max())
                reports.append(event.speckle)
    expected = float(table["power_w"].sum())
    error = np.std(peaks, ddof=1) / math.sqrt(len(peaks))
    assert abs(np.mean(peaks) - expected) < 3 * error
    assert stats.kstest(np.array(peaks) / expected, "expon").pvalue > 0.05
    assert reports[0] is not None
