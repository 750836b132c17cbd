# SPDX-License-Identifier: GPL-3.0-or-later
"""Expected power by cells: where echoes stand that fold in range."""

from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.signal import (
    Burst,
    FmcwWaveform,
    PmcwWaveform,
    Radar,
    SteppedWaveform,
    Waveform,
    expected_power_profile,
    open_run,
)
from radarsim_addon.signal.decoding import frame_paths, open_frame
from radarsim_addon.signal.detection import object_echoes
from radarsim_addon.signal.maps import expected_power, expected_power_map
from radarsim_addon.signal.paths import PathRows
from radarsim_addon.signal.radar import AnyWaveform
from tests.signal import path_runs as pr

LFM = Waveform(5.3e9, 50e6, 2.5e-6, 60e6)
STEPPED = SteppedWaveform(5.3e9, 250e3, 200, 1e-6)
FMCW = FmcwWaveform(5.3e9, 50e6, 200, 1e6)
PMCW = PmcwWaveform(5.3e9, 20e-9, 8)


def test_standard_error_of_two_shifts_is_half_their_difference(tmp_path: Path) -> None:
    """1 nW and 3 nW: (4 +- 1) / 2 nW, as n - 1 = 1; the map's, the profile's, the object's."""
    rows = PathRows.zeros(2)
    rows["replicate"], rows["power_w"] = [0, 1], [0.5e-9, 1.5e-9]
    rows["length_m"], rows["solid_angle_sr"] = 2 * 40 * LFM.sample_spacing_m, 1e-6
    rows["order"], rows["last_object"], rows["direction"] = 1, 1, (0.0, 1.0, 0.0)
    rows["first_object"] = 1
    rows["first_scatterer_m"] = rows["last_scatterer_m"] = (0.0, rows["length_m"][0] / 2, 0.0)
    here = pr.pose((0, 0, 0))
    folder = pr.write_run(
        tmp_path / "run", rows, ["Plate"], pr.camera(here), contract.TransmitterRecord(here, 5.0),
        range_limits_m=300.0, replicates=2,
    )  # fmt: skip
    frame = open_run(folder).frame(1)
    found = expected_power(open_frame(frame, radar=Radar(LFM, Burst(1e3, 4))))
    cell = int(np.argmax(found.profile))
    assert found.profile[cell] == pytest.approx(2e-9, rel=1e-2)
    assert found.profile_error[cell] == pytest.approx(found.profile[cell] / 2, rel=1e-9)
    assert found.map_error.max() == pytest.approx(found.map.max() / 2, rel=1e-9)
    (echo,) = object_echoes(frame, LFM.carrier_hz)
    assert echo.power_w == pytest.approx(2e-9)
    assert echo.power_error_w == pytest.approx(1e-9)


@pytest.mark.parametrize(
    ("waveform", "prf_hz", "range_limits_m", "echoes"),
    [
        (LFM, 50e3, (0.0, 2500.0), 3),  # period 2998 m
        (LFM, 50e3, (500.0, 3300.0), 2),
        (LFM, 100e3, (0.0, 2500.0), 6),  # 1499 m: a window that shows all echoes twice
        (STEPPED, 4e3, (0.0, 590.0), 3),  # 599.6 m
        (PMCW, 1e4, (0.0, 750.0), 3),  # 764.5 m
        (FMCW, 4e3, (0.0, 590.0), 1),  # beyond 599.6 m filtered out
    ],
    ids=["lfm", "lfm later", "lfm twice", "stepped", "pmcw", "fmcw"],
)
def test_expected_power_folds_as_the_profile(
    tmp_path: Path, waveform: AnyWaveform, prf_hz: float, range_limits_m: tuple, echoes: int
) -> None:
    radar = Radar(waveform, Burst(prf_hz, 4))
    # in the middle of a cell, so that both stand at the same place
    step_m = waveform.sample_spacing_m / 2
    ranges_m = range_limits_m[0] + step_m * np.rint(
        (np.array([400.0, 3200.0, 6100.0]) - range_limits_m[0]) / step_m
    )
    rows = PathRows.zeros(3)
    rows["length_m"], rows["power_w"] = 2 * ranges_m, [1e-9, 2e-9, 3e-9]
    rows["solid_angle_sr"], rows["order"], rows["last_object"] = 1e-6, 1, 1
    here = pr.pose((0, 0, 0))
    receiver, emitter = pr.camera(here), contract.TransmitterRecord(here, 5.0)
    folder = pr.write_run(
        tmp_path / "run", rows, ["Plate"], receiver, emitter, range_limits_m=1000.0
    )
    frame = open_run(folder).frame(1)
    found = expected_power(
        open_frame(frame, radar=radar, range_limits_m=range_limits_m), range_taper="none"
    )
    truth = expected_power_profile(
        frame_paths(frame), radar, range_limits_m=range_limits_m, range_taper="none", oversample=2
    )
    size = min(found.range_m.size, truth.range_m.size)
    np.testing.assert_allclose(found.range_m[:size], truth.range_m[:size])
    peaks = [
        i for i in range(1, size - 1)
        if truth.power[i] > 4e-10 and truth.power[i] == truth.power[i - 1 : i + 2].max()
    ]  # fmt: skip
    assert len(peaks) == echoes
    for i in peaks:
        # folded ones fall between cells: a quarter of a sample off at most
        assert found.profile[i - 1 : i + 2].max() == pytest.approx(truth.power[i], rel=0.15)
    # of a map, every Doppler together: nothing moves here
    assert found.map.max() > 0
    total = found.profile[:size].sum(), truth.power[:size].sum()
    assert total[0] == pytest.approx(total[1], rel=0.05)


@pytest.mark.parametrize("step", [1, 4])
def test_few_rows_of_doppler_are_smeared_as_by_a_transform(
    step: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And keep what is far below the strongest."""
    random = np.random.default_rng(1)
    rows, held = random.uniform(size=(5, 9)), np.array([0, 3, 31, 40, 63])
    response = 10.0 ** random.uniform(-20, 0, 64)
    found = expected_power_map._smear_doppler(rows, held, response, step)
    direct = [sum(rows[n] * response[(i - h) % 64] for n, h in enumerate(held)) for i in range(64)]
    assert found == pytest.approx(np.array(direct)[::step], rel=1e-14)
    monkeypatch.setattr(expected_power_map, "_FEW_ROWS", 0)
    transformed = expected_power_map._smear_doppler(rows, held, response, step)
    assert transformed == pytest.approx(found, abs=1e-14)
    assert not expected_power_map._smear_doppler(rows[:0], held[:0], response, step).any()
