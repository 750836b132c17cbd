# SPDX-License-Identifier: GPL-3.0-or-later
"""A frame is opened once, and processed without a file: the same input gives the same bits."""

from __future__ import annotations

import dataclasses
import hashlib
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.errors import ConfigError
from radarsim_addon.signal import (
    Burst,
    Cfar,
    FrameInput,
    FrameResult,
    ProcessOptions,
    Radar,
    Receiver,
    Spectrogram,
    SpectrogramOptions,
    Waveform,
    open_frame,
    open_run,
    process_frame,
    process_run,
)
from radarsim_addon.signal.paths import PathRows, has_digests, table_files
from radarsim_addon.signal.pipeline import main
from radarsim_addon.signal.spectrum import accumulator
from tests.signal import path_runs as pr
from tests.signal.synthetic import Setup, points
from tests.signal.synthetic import write_run as write_rings

OPTIONS = ProcessOptions(
    products=False,
    plots=False,
    receiver=Receiver(noise_figure_db=3.0, adc_bits=12),
    cfar=Cfar("os", 1e-6),
)


def rings_run(folder: Path) -> Path:
    """Two rings of 32 x 24 pixels; half of them move."""
    setup = Setup(
        rings=2,
        width_px=32,
        height_px=24,
        radar=Radar(Waveform(5.3e9, 50e6, 2.5e-6, 60e6), Burst(1000.0, 16)),
    )
    echoes = [(r, c, 200.0 + 7 * r, 0.3 * (c % 2), 1e-6) for r in range(24) for c in range(32)]
    return write_rings(folder, setup, points(setup, echoes))


def paths_run(folder: Path) -> Path:
    """A plate of 32 x 32 pixels, four replicates, with a link budget."""
    here = pr.pose((0, 0, 0))
    receiver, transmitter = pr.camera(here), contract.TransmitterRecord(here, 5.0)
    rows = pr.trace([pr.plate("Plate", (0, 600, 0), 90.0, 30.0)], receiver, transmitter, 32, 4)
    return pr.write_run(
        folder, rows, ["Plate"], receiver, transmitter, range_limits_m=900.0,
        system=contract.LinkBudget(10.0), replicates=4,
    )  # fmt: skip


RUNS = pytest.mark.parametrize("make", [rings_run, paths_run], ids=["rings", "paths"])


def in_memory(opened: FrameInput) -> FrameInput:
    """The input with the images of its rings read."""
    if opened.tables:
        return opened
    keys = np.ndindex(opened.frame.rings, opened.frame.snapshots)
    read = {(ring, n): opened.images(ring, n) for ring, n in keys}
    return dataclasses.replace(opened, images=lambda ring, n: read[ring, n])


def arrays_of(value: object) -> Iterator[np.ndarray]:
    """All arrays and numbers of a result, but for the time that it took."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, float | int | complex):
        yield np.array(value)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from arrays_of(item)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            if field.name not in ("source", "wall_s", "cpu_s"):
                yield from arrays_of(getattr(value, field.name))


def digest(result: FrameResult) -> str:
    found = hashlib.sha256()
    for array in arrays_of(result):
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


@RUNS
def test_processing_needs_no_folder_and_says_nothing(
    tmp_path: Path, make, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = open_run(make(tmp_path / "run"))
    options = OPTIONS.for_run(run)
    opened = in_memory(options.open(run.frame(1)))
    (written,) = (e for e in process_run(run.path, OPTIONS) if isinstance(e, FrameResult))
    shutil.rmtree(run.path)
    monkeypatch.chdir(tmp_path)
    result = process_frame(opened, options)
    assert list(tmp_path.iterdir()) == []
    assert capsys.readouterr() == ("", "")
    assert result.files == () and len(written.files) >= 3
    assert result.statistics.power_w > 0 and result.rd_map.power.max() > 0
    assert digest(result) == digest(dataclasses.replace(written, files=()))
    other = process_frame(opened, dataclasses.replace(options, range_taper="hann"))
    assert digest(other) != digest(result)


@RUNS
def test_bits_do_not_depend_on_the_number_of_synthesis_threads(
    tmp_path: Path, make, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = open_run(make(tmp_path / "run"))
    options = OPTIONS.for_run(run)
    opened, digests = options.open(run.frame(1)), set()
    for threads in (1, 2, 5):
        monkeypatch.setattr(accumulator, "available_threads", lambda count=threads: count)
        digests.add(digest(process_frame(opened, options)))
    assert len(digests) == 1


def test_a_spectrogram_of_an_object_is_that_of_its_ranges(tmp_path: Path) -> None:
    """Two plates 150 m apart: that of one, from its paths, is that of the ranges around it."""
    here = pr.pose((0, 0, 0))
    receiver, transmitter = pr.camera(here), contract.TransmitterRecord(here, 5.0)
    plates = [pr.plate("Near", (-60, 300, 0), 25.0), pr.plate("Far", (120, 430, 0), 60.0)]
    rows = pr.trace(plates, receiver, transmitter, 48, 1)
    folder = pr.write_run(
        tmp_path / "run", rows, ["Near", "Far"], receiver, transmitter, range_limits_m=600.0
    )

    def shown(**given: object) -> Spectrogram:
        wanted = SpectrogramOptions(16, 0.5, **given)
        options = ProcessOptions(spectrogram=wanted).for_run(open_run(folder))
        found = process_frame(options.open(open_run(folder).frame(1)), options).spectrogram
        assert found is not None
        return found

    whole, near, far = shown(), shown(object_name="Near"), shown(object_name="F*")
    assert near.power.shape == (7, 16)
    assert near.power.max() > 0 and far.power.max() > 0
    for alone, limits_m in ((near, (250.0, 370.0)), (far, (380.0, 520.0))):
        cut = shown(limits_m=limits_m)
        assert cut.power.max() < 0.99 * whole.power.max()
        # paired echoes of the other plate, 38 dB down, add up to 2 x 1.3 % of the amplitude
        np.testing.assert_allclose(alone.power, cut.power, atol=0.026 * cut.power.max())
    with pytest.raises(ConfigError, match="No object or collection"):
        shown(object_name="Nowhere")


def test_a_table_is_hashed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, hashed = paths_run(tmp_path / "run"), []

    def counting(table: PathRows, column_sha256: dict[str, str]) -> bool:
        hashed.append(table.size)
        return has_digests(table, column_sha256)

    monkeypatch.setattr(table_files, "has_digests", counting)
    list(process_run(folder, dataclasses.replace(OPTIONS, plots=True)))
    assert len(hashed) == 1 and hashed[0] > 0


def test_what_is_given_replaces_what_the_run_says(tmp_path: Path) -> None:
    frame = open_run(paths_run(tmp_path / "run")).frame(1)
    own = open_frame(frame)
    assert own.radar == frame.run.radar and own.range_limits_m == (0.0, 900.0)
    assert own.link_budget == contract.LinkBudget(10.0)
    radar = Radar(pr.WAVEFORM, Burst(500.0, 8))
    budget = contract.LinkBudget(20.0)
    other = open_frame(frame, radar=radar, link_budget=budget, range_limits_m=(500.0, 700.0))
    assert (other.radar, other.link_budget) == (radar, budget)
    result = process_frame(other, OPTIONS.for_run(frame.run))
    assert result.rd_map.range_m[0] == 500.0 and result.rd_map.doppler_hz.size == 8
    watts = process_frame(own, OPTIONS.for_run(frame.run)).statistics.power_w
    assert result.statistics.power_w == pytest.approx(2 * watts, rel=1e-12)


def test_rings_have_no_table(tmp_path: Path) -> None:
    opened = open_frame(open_run(rings_run(tmp_path / "run")).frame(1))
    with pytest.raises(ConfigError, match="measured by rings"):
        _ = opened.table


def test_tapers_with_numbers_are_accepted(tmp_path: Path) -> None:
    folder = rings_run(tmp_path / "run")
    tapers = ["--range-taper", "kaiser:8", "--doppler-taper", "taylor:4:-35"]
    assert main(["process", str(folder), "--no-plots", "--no-products", *tapers]) == 0
    options = dataclasses.replace(OPTIONS, range_taper="kaiser:8", doppler_taper="taylor:4:-35")
    result = next(e for e in process_run(folder, options) if isinstance(e, FrameResult))
    assert (result.rd_map.range_taper, result.rd_map.doppler_taper) == ("kaiser:8", "taylor:4:-35")
