# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/render_radar.py: exit codes, kill -9, a full disk; in processes of its own where the
process is what is tested, else in this one, because starting Blender takes longer than the rest."""

from __future__ import annotations

import os
import signal as signals
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import contract, signal
from radarsim_addon.blender import rig_settings as properties
from radarsim_addon.blender.run.shared_folder import Leases
from radarsim_addon.signal.pipeline import main
from radarsim_addon.typed_json import file_sha256, read_record
from tests.blender import radar_scenes as rs
from tests.blender.headless.conftest import Command, Done

pytestmark = [pytest.mark.blender, pytest.mark.slow]

SCRIPT = Path(__file__).resolve().parents[3] / "scripts" / "render_radar.py"
posix = pytest.mark.skipif(os.name != "posix", reason="signals and limits of POSIX")


@pytest.fixture(scope="module")
def blend(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A saved scene with settings of its own, under a name that is not ASCII."""
    path = tmp_path_factory.mktemp("scene é") / "rädar scene.blend"
    properties.register()
    try:
        rs.new_scene()
        plate = rs.add_plate(10.0, preset="ground")
        rs.move_steadily(plate, (0, 5, 0))
        settings = rs.radar()
        settings.sampling_mode = "rings"
        settings.ring_step_m, settings.samples, settings.prf_hz = 4.0, 1, 2000.0
        settings.width_px = settings.height_px = 32
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    finally:
        properties.unregister()
    return path


def start(*words: Any, **options: Any) -> Done:
    return subprocess.run(
        [sys.executable, str(SCRIPT), *map(str, words)],
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=300,
        check=False,
        **options,
    )


def test_renders_with_the_files_own_settings(blend: Path, tmp_path: Path) -> None:
    folder = tmp_path / "my rün"
    done = start(blend, "--out", folder)
    assert done.returncode == 0, done.stderr
    assert "6/6 renders, 100 %" in done.stdout
    run = read_record(folder / "run.json", contract.RunRecord)
    assert (run.rings, run.snapshots, run.burst["prf_hz"], run.width_px) == (3, 2, 2000.0, 32)
    assert run.blend_file == blend.name
    assert run.extra["resumable"] is True
    assert "Fra:" not in done.stdout


def test_paths_are_measured_where_asked_for(here: Command, blend: Path, tmp_path: Path) -> None:
    """Named, or implied by an option of theirs; the same command again renders nothing."""
    for number, words in enumerate((("--sampling-mode", "paths"), ("--replicates", "2"))):
        folder = tmp_path / str(number)
        done = here(blend, "--out", folder, "--resolution", "16x16", *words, "--process")
        assert done.returncode == 0, done.stderr
        run = read_record(folder / "run.json", contract.RunRecord)
        assert run.sampling_mode == "paths"
        record = read_record(folder / "frames/frame_0001/paths.json", contract.PathsRecord)
        assert record.replicates == (4 if number == 0 else 2)
        assert record.path_count > 0
        table = folder / "frames/frame_0001/paths.npz"
        written = table.stat().st_mtime_ns
        assert (folder / "products" / "frame_0001_expected.npz").is_file()
        again = here(blend, "--out", folder, "--resolution", "16x16", *words)
        assert again.returncode == 0, again.stderr
        assert table.stat().st_mtime_ns == written
        # it says what is there, as the first one did, and with --process what was made of it
        count = len({item.code for item in record.findings})
        known = f"{record.path_count:,} paths, standard error {100 * record.relative_error:.2g} %"
        assert f"frame 1: done before; {known}, {count} finding" in again.stdout
        assert "done before" not in done.stdout
        assert all(f"[{item.code}]" in again.stdout for item in record.findings)
        processed = here(blend, "--out", folder, "--resolution", "16x16", *words, "--process")
        assert processed.returncode == 0, processed.stderr
        assert f"files in {folder / 'products'}" in processed.stdout


def test_rings_that_are_done_are_counted(here: Command, blend: Path, tmp_path: Path) -> None:
    here(blend, "--out", tmp_path / "run")
    again = here(blend, "--out", tmp_path / "run")
    assert "frame 1: done before; 6 images" in again.stdout


def test_who_finishes_last_processes_a_shared_run(
    here: Command, blend: Path, tmp_path: Path
) -> None:
    """Another process holds frame 2: this one leaves the processing to it, and does not fail."""
    folder = tmp_path / "run"
    words = [
        "--frames",
        "1:2",
        "--sampling-mode",
        "paths",
        "--replicates",
        "1",
        "--resolution",
        "8x8",
    ]
    assert here(blend, "--out", folder, *words).returncode == 0
    for frame in (1, 2):
        (folder / contract.frame_dir(frame) / contract.PATHS_FILE).unlink()
    lease = Leases(folder).claim("frame_0002")
    assert lease is not None
    with lease:
        done = here(blend, "--out", folder, *words, "--process")
    assert done.returncode == 0, done.stderr
    assert "not processed: other processes still measure frames" in done.stdout
    assert not (folder / "products").exists()
    last = here(blend, "--out", folder, *words, "--process")
    assert last.returncode == 0, last.stderr
    assert len(list((folder / "products").glob("*_map.npz"))) == 2


def test_options_override_the_file(here: Command, blend: Path, tmp_path: Path) -> None:
    words = (
        "--frames 2:4:2 --rings 2 --ring-step 6 --snapshot-interval-ms 20 --samples 2 "
        "--resolution 24x16 --max-reflections 2 --carrier-ghz 77 --bandwidth-mhz 150 "
        "--chirp-duration-us 12.5 --sampling-rate-mhz 160 --prf-hz 4000 --pulses 64 "
        "--seed 5 --process"
    )
    done = here(blend, "--out", tmp_path / "run", *words.split())
    assert done.returncode == 0, done.stderr
    run = read_record(tmp_path / "run" / "run.json", contract.RunRecord)
    assert (run.frames, run.rings, run.ring_step_m, run.snapshot_interval_s) == (
        [2, 4],
        2,
        6.0,
        0.02,
    )
    assert (run.samples, run.width_px, run.height_px, run.seed) == (2, 24, 16, 5)
    assert run.max_reflections == 2
    assert run.waveform == {
        "carrier_hz": 77e9,
        "bandwidth_hz": 150e6,
        "chirp_duration_s": 12.5e-6,
        "sampling_rate_hz": 160e6,
    }
    assert run.burst == {"prf_hz": 4000.0, "pulses": 64}
    assert (tmp_path / "run" / "products" / "frame_0004_map.npz").is_file()
    assert "changed" not in done.stdout
    again = here(blend, "--out", tmp_path / "run", *words.replace("--prf-hz 4000", "").split())
    assert again.returncode == 0, again.stderr
    assert (
        "radarsim: changed since the run in this folder:\nradarsim:   burst.prf_hz: 4000 -> 2000\n"
    ) in again.stdout
    assert "frames 2, 4: done before" in again.stdout


def test_the_installed_command_renders_too(here: Command, blend: Path, tmp_path: Path) -> None:
    """``radarsim render``, with the names of today and a radar chosen by its name."""
    folder = tmp_path / "run"
    words = "--sampling-mode paths --carrier-ghz 24 --max-reflections 2 --replicates 1"
    words += " --snapshot-interval-ms 20 --resolution 16x16 --rig Radar"
    command = [sys.executable, "-m", "radarsim_addon", "render", str(blend), "--out", str(folder)]
    done = subprocess.run(
        [*command, *words.split()], capture_output=True, text=True, cwd=SCRIPT.parents[1]
    )
    assert done.returncode == 0, done.stderr
    run = read_record(folder / "run.json", contract.RunRecord)
    assert (run.sampling_mode, run.waveform["carrier_hz"]) == ("paths", 24e9)
    record = read_record(folder / "frames/frame_0001/paths.json", contract.PathsRecord)
    assert (record.max_reflections, record.replicates) == (2, 1)
    done = here(blend, "--out", tmp_path / "b", "--rig", "Mast")
    assert done.returncode == 1
    assert "SceneError: The scene has no radar 'Mast'; it has 'Radar'." in done.stderr


def test_help(here: Command) -> None:
    done = here("--help")
    assert done.returncode == 0
    for option in ("--out", "--frames", "--ring-step", "--overwrite", "--process", "--seed"):
        assert option in done.stdout


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["--no-such-option"], 2, "unrecognized arguments"),
        (["--ring-step", "0"], 2, "argument --ring-step: 0 m is out of bounds"),
        (["--rings", "-1"], 2, "argument --rings: -1 is out of bounds"),
        (["--rings", "x"], 2, "argument --rings: invalid whole number value: 'x'"),
        (["--frames", "1:2:3:4"], 2, "ConfigError: Frames '1:2:3:4'"),
        (["--resolution", "10"], 2, "ConfigError: Resolution '10'"),
        (["--resolution", "0x36"], 2, "Resolution '0x36' has a width of 0"),
        (["--resolution", "64x0"], 2, "Resolution '64x0' has a height of 0"),
        (["--prf-hz", "1e6"], 2, "ConfigError: Chirp of 2.5e-06 s is longer"),
        (["--scene", "None"], 1, "SceneError: The file has no scene 'None'"),
    ],
)
def test_bad_arguments(
    here: Command, blend: Path, tmp_path: Path, words: list[str], code: int, message: str
) -> None:
    done = here(blend, "--out", tmp_path / "run", *words)
    assert done.returncode == code
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_missing_and_broken_files(here: Command, tmp_path: Path) -> None:
    done = here(tmp_path / "none.blend", "--out", tmp_path / "run")
    assert (done.returncode, "Traceback" in done.stderr) == (2, False)
    assert "ConfigError" in done.stderr and "does not exist" in done.stderr
    broken = tmp_path / "broken.blend"
    broken.write_bytes(b"no blend file at all" * 100)
    done = start(broken, "--out", tmp_path / "run")
    assert (done.returncode, "Traceback" in done.stderr) == (1, False)
    assert "SceneError" in done.stderr and "cannot be opened" in done.stderr


def test_missing_folder(here: Command, blend: Path, tmp_path: Path) -> None:
    done = here(blend, "--out", tmp_path / "no" / "run")
    assert done.returncode == 1
    assert "OutputError" in done.stderr and "does not exist. Create it" in done.stderr


def test_paths_that_are_no_blend_file(here: Command, tmp_path: Path) -> None:
    """Each line is one sentence after the other, on one line, without a traceback."""
    run = tmp_path / "run"
    run.mkdir()
    (run / "run.json").touch()
    broken = tmp_path / "bro\nken.blend"
    broken.touch()
    for path, code, message in (
        (tmp_path, 2, f"ConfigError: {tmp_path} is a folder, not a .blend file. Give the .blend"),
        (run, 2, f"This folder holds a run: radarsim process {run} processes it."),
        (broken, 1, r"bro\nken.blend cannot be opened: "),
        (broken, 1, ". Give a .blend file that this version of Blender reads."),
        (tmp_path / ("a" * 300), 2, ": File name too long. Give the .blend file to render."),
    ):
        done = here(path, "--out", tmp_path / "out")
        assert (done.returncode, done.stderr.count("\n")) == (code, 1), done.stderr
        assert message in done.stderr and 'blend" Give' not in done.stderr


def test_folders_that_cannot_be_made(here: Command, blend: Path, tmp_path: Path) -> None:
    for folder, message in (
        (tmp_path / ("a" * 300), "File name too long. Choose a shorter name."),
        (blend, "there is a file of this name."),
        (blend / "run", "Not a directory."),
    ):
        done = here(blend, "--out", folder)
        assert (done.returncode, done.stderr.count("\n")) == (1, 1), done.stderr
        assert "OutputError: Cannot make the folder" in done.stderr and message in done.stderr


def test_scripts_in_the_file_are_not_run(tmp_path: Path) -> None:
    rs.new_scene()
    flag = tmp_path / "ran"
    text = bpy.data.texts.new("hook.py")
    text.from_string(f"open({str(flag)!r}, 'w').close()")
    text.use_module = True  # "Register": run on load
    cube = bpy.data.objects.new("Driven", None)
    bpy.context.scene.collection.objects.link(cube)
    curve = cube.driver_add("location", 0)
    curve.driver.expression = f"open({str(flag)!r}, 'w').close() or 1.0"
    path = tmp_path / "hooked.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    flag.unlink(missing_ok=True)
    done = start(path, "--out", tmp_path / "run", "--resolution", "8x8")
    assert done.returncode == 3, done.stderr  # measured; nothing in it echoes
    assert not flag.exists()


@posix
def test_a_run_without_any_echo_ends_with_3(here: Command, tmp_path: Path) -> None:
    """Also where the command finds it done already, and for its processing."""
    rs.new_scene()
    path = tmp_path / "empty.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    words = (path, "--out", tmp_path / "run", "--resolution", "8x8")
    for more in ((), (), ("--process",)):
        done = here(*words, *more)
        assert done.returncode == 3, done.stdout + done.stderr
        assert (tmp_path / "run" / "run.json").is_file()
    assert "no-echo" in done.stdout
    assert main(["process", str(tmp_path / "run")]) == 3


@posix
def test_kill_in_the_middle_and_start_again(here: Command, blend: Path, tmp_path: Path) -> None:
    """kill -9 at an arbitrary moment, twice; then the run is what an undisturbed one is."""
    folder = tmp_path / "run"
    command = [sys.executable, str(SCRIPT), str(blend), "--out", str(folder)]
    command += ["--frames", "1:6", "--resolution", "64x64", "--samples", "4"]
    for wanted in (3, 20):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            limit = time.monotonic() + 120
            while len(list(folder.rglob("ring_*.json"))) < wanted and process.poll() is None:
                assert time.monotonic() < limit
                time.sleep(0.001)
        finally:
            process.send_signal(signals.SIGKILL)
            process.wait()
    kept = {p: p.stat().st_mtime_ns for p in folder.rglob("ring_*.json")}
    assert len(kept) >= 20
    # What has a sidecar is whole at any moment.
    for sidecar in kept:
        record = read_record(sidecar, contract.RenderRecord)
        assert file_sha256(sidecar.with_suffix(".exr")) == record.exr_sha256
    assert here(*command[2:]).returncode == 0
    assert not list(folder.rglob("*.part*"))
    assert {p: p.stat().st_mtime_ns for p in kept} == kept

    def images() -> list[bytes]:
        run = signal.open_run(folder)
        assert run.missing() == []
        places = [(frame, number) for frame in (1, 6) for number in (0, 1)]
        return [run.frame(frame).image(2, number)[1]["R"].tobytes() for frame, number in places]

    resumed = images()
    assert here(*command[2:], "--overwrite").returncode == 0
    assert images() == resumed


@posix
def test_full_disk(here: Command, blend: Path, tmp_path: Path) -> None:
    """No file may pass 6 kB: the EXR of 64 x 64 pixels does not fit, the smaller ones do."""
    import resource

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (6000, 6000))

    folder = tmp_path / "run"
    words = [blend, "--out", folder, "--resolution", "64x64", "--rings", "3"]
    done = start(*words, preexec_fn=limit)
    assert done.returncode == 1, done.stdout
    assert "OutputError" in done.stderr and "disk" in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(folder.rglob("*.part*"))
    assert here(*words).returncode == 0
    assert signal.open_run(folder).missing() == []


@posix
@pytest.mark.parametrize("sampling_mode", ["rings", "paths"])
def test_ctrl_c_stops_after_the_render_and_the_run_goes_on(
    here: Command, blend: Path, tmp_path: Path, sampling_mode: str
) -> None:
    """Exit code 130, nothing half-written, and the same command finishes the run."""
    # Automatic rings follow from the frames: stated, the run is the same with fewer of them.
    stated = ["--rings", "3"] if sampling_mode == "rings" else []
    words = [blend, "--out", tmp_path / "run", "--sampling-mode", sampling_mode, *stated]
    words += ["--frames", "1:40"]
    process = subprocess.Popen(
        [sys.executable, str(SCRIPT), *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    wanted = "*.exr" if sampling_mode == "rings" else "paths.npz"
    deadline = time.monotonic() + 120
    while not list((tmp_path / "run").rglob(wanted)) and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(signals.SIGINT)
    _, said = process.communicate(timeout=120)
    assert process.returncode == 130, said
    assert "Interrupted" in said
    assert "Traceback" not in said
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "run").rglob(wanted)}
    assert before
    assert not list((tmp_path / "run").rglob("*.part*"))
    done = here(*words[:-1], "1:2")
    assert done.returncode == 0, done.stderr
    kept = [path for path in before if "frame_0001" in str(path)]
    assert kept
    assert all(path.stat().st_mtime_ns == before[path] for path in kept)
