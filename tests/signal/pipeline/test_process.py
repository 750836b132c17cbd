# SPDX-License-Identifier: GPL-3.0-or-later
"""From a run's folder to its products, through the Python API and the command line."""

import json
import shutil
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract, errors
from radarsim_addon.errors import FrameFileError, OutputError
from radarsim_addon.findings import finding
from radarsim_addon.signal import (
    Burst,
    FrameResult,
    ProcessOptions,
    Progress,
    Radar,
    Waveform,
    open_run,
    process_run,
    read_exr,
)
from radarsim_addon.signal.pictures import frame_pictures
from radarsim_addon.signal.pipeline import cli, main
from radarsim_addon.signal.pipeline.cli import frame_lines
from tests.signal import path_runs
from tests.signal.synthetic import Setup, empty, points, write_run

SETUP = Setup(rings=4, radar=Radar(Waveform(5.3e9, 50e6, 2.5e-6, 60e6), Burst(1000.0, 64)))
#: A target, and a wall that is stationary.
ECHOES = [(5, 6, 600.0, 5.0, 1e-6), *((2, c, 300.0, 0.0, 1e-5) for c in range(10))]
QUICK = ProcessOptions(products=False, plots=False)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_run(tmp_path / "Läufe é" / "Run 1", SETUP, points(SETUP, ECHOES))


def results(
    path: Path, options: ProcessOptions | None = QUICK, **more: object
) -> list[FrameResult]:
    events = process_run(path, options, **more)  # type: ignore[arg-type]
    return [event for event in events if isinstance(event, FrameResult)]


def test_run_to_map(folder: Path) -> None:
    (result,) = results(folder)
    assert result.statistics.counts.paths == 11
    assert result.statistics.nearest_m == pytest.approx(300, abs=1e-3)
    assert result.statistics.farthest_m == pytest.approx(600, abs=1e-3)
    target = result.moving_targets[0]
    assert target.velocity_mps == pytest.approx(5.0, abs=0.02)
    assert target.doppler_hz < 0  # receding
    assert target.range_m == pytest.approx(600 + 5 * 63 / 2000, abs=0.02)
    assert len(result.moving_targets) == 1
    wall = max(result.edges, key=lambda e: e.level_db)
    # one range only: half power is half the response's width before it
    half_m = 1.303 * SETUP.radar.waveform.range_resolution_m / 2
    assert wall.range_m == pytest.approx(300 - half_m, abs=0.1)
    assert result.findings == []


def test_files_of_a_frame(folder: Path) -> None:
    (result,) = results(folder, None)
    names = sorted(p.name for p in (folder / "products").iterdir())
    assert names == sorted(path.name for path in result.files)
    assert names == [
        "frame_0001_amplitude_t0.exr", "frame_0001_amplitude_t1.exr", "frame_0001_echo.png",
        "frame_0001_map.npz", "frame_0001_profile.npz",
        "frame_0001_range_doppler.png", "frame_0001_range_profile.png",
        "frame_0001_range_t0.exr", "frame_0001_range_t1.exr",
        "frame_0001_rings.png", "frame_0001_summary.json",
    ]  # fmt: skip
    with np.load(folder / "products/frame_0001_map.npz", allow_pickle=False) as arrays:
        assert arrays["power"].shape == (1, arrays["doppler_hz"].size, arrays["range_m"].size)
        np.testing.assert_array_equal(arrays["power"], result.rd_map.power)
        assert arrays["velocity_mps"][0] > 0  # lowest Doppler: receding
    with np.load(folder / "products/frame_0001_profile.npz", allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["expected_power"], result.profile.power)
    summary = json.loads((folder / "products/frame_0001_summary.json").read_text("utf-8"))
    assert summary["moving_targets"][0]["velocity_mps"] == result.moving_targets[0].velocity_mps
    for path in result.files:
        if path.suffix == ".png":
            assert path.read_bytes().startswith(b"\x89PNG")


def test_the_four_products(folder: Path) -> None:
    results(folder, ProcessOptions(plots=False))
    channels = [f"ring.{ring:03d}" for ring in range(4)]
    place = folder / "products"
    for snapshot_index, target_m in ((0, 600.0), (1, 600.05)):
        amplitude = read_exr(place / f"frame_0001_amplitude_t{snapshot_index}.exr", channels)
        range_m = read_exr(place / f"frame_0001_range_t{snapshot_index}.exr", channels)
        assert range_m["ring.002"][5, 6] == pytest.approx(target_m, abs=1e-3)
        assert amplitude["ring.002"][5, 6] == pytest.approx(1e-6, rel=1e-6)
        assert range_m["ring.001"][2, 3] == pytest.approx(300, abs=1e-3)
        assert sum(int(np.count_nonzero(image)) for image in range_m.values()) == 11
        assert not range_m["ring.003"].any()


def test_progress_counts_up_to_the_total(folder: Path) -> None:
    steps = [e for e in process_run(folder, QUICK) if isinstance(e, Progress)]
    assert [s.done for s in steps] == list(range(1, steps[-1].total + 1))


@pytest.mark.filterwarnings("error")
def test_empty_scene_gives_an_empty_map(tmp_path: Path) -> None:
    setup = Setup(rings=2)
    folder = write_run(tmp_path / "run", setup, lambda *_: empty(setup))
    (result,) = results(folder, ProcessOptions(plots=False))
    assert not result.rd_map.plane_power.any()
    assert result.statistics.nearest_m is None
    assert result.findings == [finding("no-echo").in_frame(1)]
    assert (
        json.loads((folder / "products/frame_0001_summary.json").read_text())["moving_targets"]
        == []
    )


def test_empty_scene_can_be_drawn(tmp_path: Path) -> None:
    setup = Setup(rings=2)
    folder = write_run(tmp_path / "run", setup, lambda *_: empty(setup))
    (result,) = results(folder, ProcessOptions(plots=True))
    assert len([p for p in result.files if p.suffix == ".png"]) == 4


def test_ambiguities_are_warned_about(tmp_path: Path) -> None:
    radar = Radar(Waveform(5.3e9, 50e6, 0.5e-6, 60e6), Burst(200e3, 32))  # 749 m
    setup = Setup(radar=radar)
    folder = write_run(tmp_path / "far", setup, points(setup, [(1, 1, 800.0, 0.0, 1.0)]))
    (result,) = results(folder)
    found = result.findings[0]
    assert found.code == "range-ambiguous-paths"
    assert found.numbers["unambiguous_range_m"] == pytest.approx(749.481, abs=1e-3)
    assert "749.481 m, which the PRF sets" in found.text
    assert result.rd_map.range_m[result.rd_map.plane_power.max(axis=0).argmax()] == pytest.approx(
        800, abs=1.5
    )
    folder = write_run(tmp_path / "fast", SETUP, points(SETUP, [(1, 1, 300.0, 15.0, 1.0)]))
    (result,) = results(folder)
    found = result.findings[0]
    assert found.code == "doppler-ambiguous-paths"
    assert found.numbers["max_unambiguous_velocity_mps"] == pytest.approx(14.14, abs=5e-3)
    assert result.moving_targets[0].velocity_mps == pytest.approx(15 - 2 * 14.141, abs=0.02)


def test_echoes_beyond_the_code_and_without_it_are_warned_about(tmp_path: Path) -> None:
    setup = Setup(range_encoding_length_m=10.0)
    folder = write_run(tmp_path / "a", setup, points(setup, [(1, 1, 900.0, 0, 1e-3)]))
    (result,) = results(folder)
    assert finding("range-encoding-underflow", count=1).in_frame(1) in result.findings
    assert result.statistics.counts.range_encoding_underflow == 1


def test_incomplete_run(folder: Path) -> None:
    (folder / "frames/frame_0001/ring_002_t1.exr").unlink()
    with pytest.raises(FrameFileError, match=r"lacks 1 of 8 renders.*resumes where it stopped"):
        results(folder)
    with pytest.raises(FrameFileError, match="no complete frame"):
        results(folder, allow_incomplete=True)


def test_incomplete_frames_can_be_skipped(tmp_path: Path) -> None:
    setup = Setup(rings=2, frames=(1, 2, 3))
    folder = write_run(tmp_path / "run", setup, points(setup, [(1, 1, 300.0, 0, 1.0)]))
    (folder / "frames/frame_0002/ring_000_t0.json").unlink()
    assert [r.frame for r in results(folder, allow_incomplete=True)] == [1, 3]
    assert [r.frame for r in results(folder, frames=[3])] == [3]
    with pytest.raises(FrameFileError, match="no frame 9"):
        results(folder, frames=[9])


def test_leading_edges_that_are_not_listed_are_counted(tmp_path: Path) -> None:
    setup = Setup(rings=8)
    echoes = [(1 + n, 1, 300.0 + 150.0 * n, 0, 1.0 + n) for n in range(7)]
    folder = write_run(tmp_path / "run", setup, points(setup, echoes))
    (result,) = results(folder)
    assert (len(result.edges), result.edges_left_out) == (5, 2)
    path = next(path for path in result.files if path.name.endswith("_summary.json"))
    assert json.loads(path.read_text())["leading_edges_left_out"] == 2
    lines = [line for line in frame_lines(result) if "leading edge" in line]
    assert len(lines) == 6 and lines[-1] == "  2 leading edges of lower prominence are not listed"


def test_output_folder_that_cannot_be(folder: Path) -> None:
    (folder / "file").touch()
    with pytest.raises(OutputError, match="Cannot make the folder"):
        results(folder, out=folder / "file" / "sub")


def test_memory_does_not_grow_with_the_number_of_frames(tmp_path: Path) -> None:
    radar = Radar(SETUP.radar.waveform, Burst(1000.0, 8))
    setup = Setup(radar=radar, rings=2, frames=tuple(range(1, 13)), width_px=64, height_px=64)
    picture = points(setup, [(r, c, 300.0, 0, 1.0) for r in range(64) for c in range(64)])
    folder = write_run(tmp_path / "run", setup, picture)
    run = open_run(folder)
    options = ProcessOptions(plots=False)

    def peak_bytes(frames: list[int]) -> int:
        tracemalloc.start()
        for _ in process_run(run.path, options, frames=frames):
            pass
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    one = peak_bytes([1])
    assert peak_bytes(list(setup.frames)) < 1.25 * one


def test_command_line_processes_and_informs(folder: Path, capsys: pytest.CaptureFixture) -> None:
    assert main(["process", str(folder), "--no-plots", "--out", str(folder / "out ü")]) == 0
    shown = capsys.readouterr().out
    assert "11 paths" in shown
    assert "moving target" in shown
    assert (folder / "out ü" / "frame_0001_map.npz").is_file()
    assert main(["info", str(folder)]) == 0
    shown = capsys.readouterr().out
    for words in ("8 of 8 are there", "encoding length    1000 m", "mixed pixels     0.00 %",
                  "1 Blender unit = 100 m", "range rounding", "  11 paths\n"):  # fmt: skip
        assert words in shown


def test_info_of_an_incomplete_run(folder: Path, capsys: pytest.CaptureFixture) -> None:
    (folder / "frames/frame_0001/ring_002_t1.exr").unlink()
    assert main(["info", str(folder)]) == 0
    shown = capsys.readouterr().out
    assert "7 of 8 are there" in shown
    assert "incomplete: frame 1: EXR ring_002_t1.exr" in shown


def test_named_errors_without_traceback(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "radarsim_addon", "process", str(tmp_path / "none")]
    root = Path(__file__).parents[3]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("radarsim: FrameFileError: ")
    assert "Traceback" not in done.stderr


def test_exit_code_of_bad_numbers_and_arguments(
    folder: Path, capsys: pytest.CaptureFixture
) -> None:
    assert main(["process", str(folder), "--range-taper", "gauss"]) == 2
    assert "ConfigError: Window 'gauss'" in capsys.readouterr().err
    assert main(["process", str(folder), "--range-limits", "9:5"]) == 2
    for bad in (
        ["--frames", "x"],
        ["--frames", "5:1"],
        ["--amplitude-model", "best"],
        ["--range-limits", "5"],
    ):
        with pytest.raises(SystemExit) as stop:
            main(["process", str(folder), *bad])
        assert stop.value.code == 2
    with pytest.raises(SystemExit) as stop:
        main([])
    assert stop.value.code == 2


#: As docs/headless.md has them.
CODES = {
    errors.ConfigError: 2, errors.SettingNameError: 2, errors.SceneError: 1,
    errors.OutputError: 1, errors.FrameFileError: 1, errors.SchemaError: 1,
    errors.MissingDependencyError: 1, errors.PathDataError: 1, errors.WorkerError: 1,
    MemoryError: 1, KeyboardInterrupt: 130,
}  # fmt: skip


@pytest.mark.parametrize(
    ("words", "function"),
    [
        (["process", "run"], "_process"),
        (["info", "run"], "print_run"),
        (["objects", "run"], "print_objects"),
        (["merge", "out", "part"], "merge_parts"),
        (["antennas", "radar.json"], "print_antennas"),
    ],
)
def test_exit_codes_of_all_commands_and_errors(
    words: list[str], function: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    for error, code in CODES.items():

        def fail(*_: object, error: type[BaseException] = error) -> None:
            raise error("x")

        monkeypatch.setattr(cli, function, fail)
        assert main(words) == code, error
        said = capsys.readouterr().err
        assert said.startswith("radarsim: ") and said.count("\n") == 1
        if code != 130:
            assert error.__name__ in said


def test_a_detectors_options_without_a_detector_are_refused(
    folder: Path, capsys: pytest.CaptureFixture
) -> None:
    for words in (["--pfa", "1e-3"], ["--cfar-guard", "2,4"]):
        assert main(["process", str(folder), *words]) == 2
        error = capsys.readouterr().err
        assert f"radarsim: ConfigError: {words[0]} without --cfar" in error
        assert "Add --cfar ca or --cfar os" in error
    assert main(["process", str(folder), "--no-plots", "--cfar", "ca", "--pfa", "1e-3"]) == 0


def test_a_spectrogram_is_written_where_one_is_asked_for(
    folder: Path, capsys: pytest.CaptureFixture
) -> None:
    assert main(["process", str(folder), "--spectrogram-overlap", "0.5"]) == 2
    assert "Add --spectrogram N" in capsys.readouterr().err
    words = ["--spectrogram", "8", "--spectrogram-overlap", "0.5", "--frames", "1"]
    assert main(["process", str(folder), *words]) == 0
    files = folder / "products"
    with np.load(files / "frame_0001_spectrogram.npz") as found:
        prf_hz = SETUP.radar.burst.prf_hz
        assert found["power"].shape == (found["time_s"].size, 8) and found["power"].max() > 0
        np.testing.assert_allclose(np.diff(found["time_s"]), 4 / prf_hz)
        np.testing.assert_allclose(np.diff(found["doppler_hz"]), prf_hz / 8)
    assert (files / "frame_0001_spectrogram.png").stat().st_size > 1000
    assert main(["process", str(folder), "--no-plots"]) == 0  # without one: none is left
    assert not list(files.glob("*spectrogram*"))


def test_help_tells_defaults_in_words(capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit):
        main(["process", "--help"])
    shown = " ".join(capsys.readouterr().out.split())
    assert "[none]" not in shown and "None:" not in shown
    assert "Set the one-way ranges of the profile [those of the run]" in shown
    assert "Set the false alarms per cell [1e-06]" in shown


def test_truncated_exr_ends_with_its_name(folder: Path, capsys: pytest.CaptureFixture) -> None:
    path = folder / "frames/frame_0001/ring_001_t0.exr"
    path.write_bytes(path.read_bytes()[:-40])
    assert main(["process", str(folder)]) == 1
    error = capsys.readouterr().err
    assert error.startswith("radarsim: FrameFileError: ")
    assert "ring_001_t0.exr is damaged or truncated" in error


@pytest.mark.parametrize(
    ("gone", "error"), [("", FrameFileError), ("products", OutputError)], ids=["run", "products"]
)
def test_a_folder_that_vanishes_is_named(tmp_path: Path, gone: str, error: type[Exception]) -> None:
    setup = Setup(frames=(1, 2), radar=SETUP.radar)
    path = write_run(tmp_path / "run", setup, points(setup, ECHOES))
    out = path / "products" if not gone else tmp_path / "products"
    events = process_run(path, QUICK, out=out)
    while not isinstance(next(events), FrameResult):
        pass
    lost = out if gone else path
    shutil.rmtree(lost)
    with pytest.raises(error, match=f"{lost.name} has vanished during the processing"):
        list(events)


# -- what is missing, and what fails ---------------------------------------------------------------


def plate_run(folder: Path, scene: contract.GroundTruthRecord | None) -> Path:
    """A plate before a radar with antennas, of which a picture is drawn."""
    receiver = path_runs.camera(path_runs.pose((0, 0, 0)))
    emitter = contract.TransmitterRecord(path_runs.pose((0, 0, 0)), 1.0)
    plates = [path_runs.plate("Plate", (0, 50, 0), 4.0)]
    rows = path_runs.trace(plates, receiver, emitter, 32)
    return path_runs.write_run(
        folder, rows, ["Plate"], receiver, emitter, range_limits_m=80.0, scene=scene,
        system=contract.LinkBudget(1.0),
    )  # fmt: skip


def test_info_takes_the_rounding_of_powers_for_no_power(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    folder = plate_run(tmp_path / "run", None)
    path = folder / contract.frame_dir(1) / contract.PATHS_FILE
    for fraction, shown in ((8.6e-38, "0 %"), (1.5e-3, "0.15 %")):
        content = json.loads(path.read_text())
        path.write_text(json.dumps(content | {"unranged_power_fraction": fraction}))
        assert main(["info", str(folder)]) == 0
        assert f"without a range  {shown} of the power" in capsys.readouterr().out


def test_a_missing_ground_truth_is_found_because_it_changes_echoes(tmp_path: Path) -> None:
    item = contract.ObjectRecord("Plate", 50.0, 50.0, None, rms_height_m=0.0)
    folder = plate_run(tmp_path / "run", contract.GroundTruthRecord(1, 0.0, [item]))
    code = "ground-truth-missing"
    (whole,) = results(folder, ProcessOptions(plots=False, speckle_seed=1))
    assert code not in {item.code for item in whole.findings}
    (folder / contract.frame_dir(1) / contract.GROUND_TRUTH_FILE).unlink()
    (left,) = results(folder, ProcessOptions(plots=False, speckle_seed=1))
    (found,) = (item for item in left.findings if item.code == code)
    assert (found.severity, found.frames) == ("caution", (1,))
    assert not np.allclose(left.echoes.samples, whole.echoes.samples)  # a smooth plate before
    rings = write_run(tmp_path / "rings", Setup(), points(Setup(), [(1, 1, 300.0, 0, 1.0)]))
    assert not any(item.code == code for result in results(rings) for item in result.findings)


def test_what_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A damaged table, or a disk that is full when the pictures are written."""
    folder, out = plate_run(tmp_path / "run", None), tmp_path / "out"
    drawn = ProcessOptions(plots=True)
    out.mkdir()
    with monkeypatch.context() as full:

        def fail(*_: object) -> None:
            raise OutputError("Cannot write the picture: No space left on device.")

        full.setattr(frame_pictures, "save_picture", fail)
        with pytest.raises(OutputError, match="No space left"):
            results(folder, drawn, out=out)
    assert list(out.iterdir()) == []
    results(folder, drawn, out=out)
    assert {"antennas.png", "frame_0001_map.npz"} < {path.name for path in out.iterdir()}
    shutil.rmtree(out)
    out.mkdir()
    table = folder / contract.frame_dir(1) / contract.PATHS_TABLE
    table.write_bytes(table.read_bytes()[:-8])
    with pytest.raises(FrameFileError):
        results(folder, drawn, out=out)
    assert list(out.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("noise_seed", r"give receiver=signal\.Receiver\(noise_seed=\.\.\.\)"),
        ("spectrogram_object", r"give spectrogram=signal\.SpectrogramOptions\(object_name="),
        ("cfar_pfa", r"give cfar=signal\.Cfar\(pfa="),
        ("prf_hz", r"give radar=signal\.Radar\("),
        ("out", "give the argument out of the function"),
        ("rain_mm_per_hour", r"did you mean weather=signal\.Weather\(rain_mm_per_h="),
        ("plot", r"did you mean plots\?"),
        ("nothing_like_it", r"docs/signal\.md lists them"),
    ],
)
def test_names_that_are_no_options_are_told_where_they_belong(name: str, hint: str) -> None:
    with pytest.raises(errors.SettingNameError, match=f"no option '{name}'; {hint}"):
        ProcessOptions(**{name: 1})  # type: ignore[arg-type]
