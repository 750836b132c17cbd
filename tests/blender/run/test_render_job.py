# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs that stop, go on, meet other runs, bad folders and full disks."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import contract, signal
from radarsim_addon.blender.materials import make_physical_material
from radarsim_addon.blender.nodes import attributes, groups
from radarsim_addon.blender.paths import PathJob
from radarsim_addon.blender.rings import RingJob, ring_job
from radarsim_addon.blender.run import shared_folder
from radarsim_addon.blender.state import SettingsRestorer
from radarsim_addon.errors import OutputError, RenderError, SceneError, SchemaError
from radarsim_addon.signal.radar import Burst
from radarsim_addon.typed_json import file_sha256, read_record
from tests.blender import radar_scenes as rs
from tests.blender.path_helpers import job_for, run_paths

pytestmark = pytest.mark.blender


@pytest.fixture
def plate() -> Any:
    """A radar and a plate 10 units before it: rings of 4 units make three."""
    rs.new_scene()
    return rs.add_plate(10.0)


def rendered(folder: Path, *arguments: Any, **changes: Any) -> Any:
    """Measure a file that nobody has touched since it was opened."""
    return rs.run(folder, *arguments, **{"identity": "file", **changes})


def exr_times(folder: Path) -> dict[str, int]:
    return {str(p.relative_to(folder)): p.stat().st_mtime_ns for p in folder.rglob("*.exr")}


def test_files_of_a_run(plate: Any, tmp_path: Path) -> None:
    """Exactly the files of the contract, each sidecar matching its EXR."""
    rendered(tmp_path, snapshots=2, frames=(3,))
    names = sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file())
    stems = [f"frames/frame_0003/ring_{n:03d}_t{p}" for n in range(3) for p in range(2)]
    expected = [stem + suffix for stem in stems for suffix in (".exr", ".json")]
    assert names == sorted([*expected, "frames/frame_0003/ground_truth.json", "run.json"])
    for stem in stems:
        record = read_record(tmp_path / f"{stem}.json", contract.RenderRecord)
        assert file_sha256(tmp_path / f"{stem}.exr") == record.exr_sha256
        assert record.versions["blender"] == bpy.app.version_string
    run = read_record(tmp_path / "run.json", contract.RunRecord)
    assert (run.rings, run.snapshots, run.frames) == (3, 2, [3])
    assert run.waveform["carrier_hz"] == 5.3e9
    assert run.frame_times_s == [3 / 24]


def test_a_stopped_run_goes_on(plate: Any, tmp_path: Path) -> None:
    rendered(tmp_path, limit=2, snapshots=2)
    before = exr_times(tmp_path)
    assert len(before) == 2
    job = rendered(tmp_path, snapshots=2)
    after = exr_times(tmp_path)
    assert (len(after), job.done, job.total) == (6, 6, 6)
    assert {name: after[name] for name in before} == before
    rendered(tmp_path, snapshots=2)
    assert exr_times(tmp_path) == after


def test_more_frames_and_another_waveform_continue_a_run(plate: Any, tmp_path: Path) -> None:
    rendered(tmp_path)
    before = exr_times(tmp_path)
    rendered(tmp_path, frames=(1, 2), burst=rs.Burst(2000.0, 64))
    after = exr_times(tmp_path)
    assert {name: after[name] for name in before} == before
    assert len(after) == 2 * len(before)
    run = read_record(tmp_path / "run.json", contract.RunRecord)
    assert (run.burst["prf_hz"], run.frames) == (2000.0, [1, 2])


def test_bursts_that_reach_the_next_frame_are_named(plate: Any, tmp_path: Path) -> None:
    """64 pulses at 1 kHz take 64 ms, frames 42 ms: it is the nearest two frames that count."""
    scene = bpy.context.scene
    measured = rs.measurement(frames=(1, 2, 20), burst=Burst(1000.0, 64))
    with RingJob(scene, scene.view_layers[0], measured, tmp_path / "run") as job:
        (found,) = (one for one in job.run_findings if one.code == "bursts-overlap")
    assert found.numbers["frame_interval_s"] == pytest.approx(1 / 24)


@pytest.mark.parametrize("damage", ["truncate", "flip", "no sidecar", "bad sidecar", "no exr"])
def test_damaged_files_are_rendered_again(plate: Any, tmp_path: Path, damage: str) -> None:
    rendered(tmp_path)
    exr = tmp_path / contract.frame_dir(1) / "ring_002_t0.exr"
    sidecar = exr.with_suffix(".json")
    pixels = rs.images(tmp_path)[2]["B"]
    data = exr.read_bytes()
    if damage == "truncate":
        exr.write_bytes(data[: len(data) // 2])
    elif damage == "flip":
        exr.write_bytes(data[:-9] + bytes([data[-9] ^ 1]) + data[-8:])
    elif damage == "no sidecar":
        sidecar.unlink()
    elif damage == "bad sidecar":
        sidecar.write_text(sidecar.read_text(encoding="utf-8")[:100], encoding="utf-8")
    else:
        exr.unlink()
    untouched = exr_times(tmp_path)
    untouched.pop(str(exr.relative_to(tmp_path)), None)
    rendered(tmp_path)
    assert (rs.images(tmp_path)[2]["B"] == pixels).all()
    after = exr_times(tmp_path)
    assert {name: after[name] for name in untouched} == untouched


def test_leftovers_of_a_killed_run_are_removed(plate: Any, tmp_path: Path) -> None:
    rendered(tmp_path, limit=1)
    left = [
        tmp_path / contract.frame_dir(1) / "ring_001_t0.exr.part",
        tmp_path / "run.json.part",
    ]
    for path in left:
        path.write_bytes(b"half")
    rendered(tmp_path)
    assert not any(path.exists() for path in left)


@pytest.mark.parametrize(
    "change",
    [{"seed": 1}, {"samples": 2}, {"ring_step_m": 5.0}, {"width_px": 40}, {"max_reflections": 2}],
)
def test_another_run_is_refused_and_kept(
    plate: Any, tmp_path: Path, change: dict[str, Any]
) -> None:
    rendered(tmp_path)
    before = exr_times(tmp_path)
    with pytest.raises(OutputError, match=r"another run.*overwrite"):
        rendered(tmp_path, **change)
    assert exr_times(tmp_path) == before


def test_another_carrier_is_another_run_where_materials_are_physical(
    plate: Any, tmp_path: Path
) -> None:
    other = signal.Waveform(24e9, 50e6, 2.5e-6, 60e6)
    rendered(tmp_path / "simple")
    before = exr_times(tmp_path / "simple")
    rendered(tmp_path / "simple", waveform=other)
    assert exr_times(tmp_path / "simple") == before
    make_physical_material("Wall", "concrete", carrier_hz=5.3e9)
    rendered(tmp_path / "physical")
    with pytest.raises(OutputError, match=r"another run.*carrier of physical materials"):
        rendered(tmp_path / "physical", waveform=other)


def test_overwrite_removes_the_other_run_and_nothing_else(plate: Any, tmp_path: Path) -> None:
    rendered(tmp_path, frames=(1, 2))
    foreign = [tmp_path / "notes.txt", tmp_path / contract.frame_dir(1) / "mine.exr"]
    for path in foreign:
        path.write_text("keep", encoding="utf-8")
    rendered(tmp_path, overwrite=True, seed=4)
    assert all(path.read_text(encoding="utf-8") == "keep" for path in foreign)
    assert not list((tmp_path / contract.frame_dir(2)).glob("ring_*"))
    record = read_record(
        tmp_path / contract.frame_dir(1) / "ring_000_t0.json", contract.RenderRecord
    )
    assert record.seed == 4


def test_a_scene_in_memory_is_always_measured_again(plate: Any, tmp_path: Path) -> None:
    """Nothing of the run before is left from the first render on, also where the run is stopped."""
    rs.run(tmp_path, frames=(1, 2), snapshots=2)
    before, earlier = exr_times(tmp_path), signal.open_run(tmp_path).record
    products = tmp_path / "products"
    products.mkdir()
    made = [products / name for name in ("frame_0002_map.npz", "frame_0002_summary.json")]
    for path in (*made, products / "notes.txt"):
        path.write_text("{}", encoding="utf-8")
    job = rs.run(tmp_path, frames=(1, 2), snapshots=2, limit=1)
    after, later = exr_times(tmp_path), signal.open_run(tmp_path).record
    assert (len(before), len(after), job.total) == (12, 1, 12)
    assert not set(after.items()) & set(before.items())
    assert earlier.fingerprint != later.fingerprint and later.extra["resumable"] is False
    assert [path.exists() for path in made] == [False, False]
    assert (products / "notes.txt").exists()
    rs.run(tmp_path, frames=(1, 2), snapshots=2)
    assert not set(exr_times(tmp_path).items()) & set(after.items())


def test_a_file_replaces_no_run_of_a_scene_in_memory(plate: Any, tmp_path: Path) -> None:
    rs.run(tmp_path)
    before = exr_times(tmp_path)
    with pytest.raises(OutputError, match=r"another run.*overwrite"):
        rendered(tmp_path)
    assert exr_times(tmp_path) == before


def test_overwriting_measures_the_same_run_again(plate: Any, tmp_path: Path) -> None:
    rendered(tmp_path)
    before = exr_times(tmp_path)
    rendered(tmp_path, overwrite=True)
    after = exr_times(tmp_path)
    assert before.keys() == after.keys() and not before.items() & after.items()


def test_the_run_of_another_scene_or_file_is_named_and_kept(plate: Any, tmp_path: Path) -> None:
    rs.run(tmp_path / "run")
    before = exr_times(tmp_path)
    bpy.context.scene.name = "Yard"
    text = r"another scene: a file that was never saved, scene 'Scene'; this is .* scene 'Yard'"
    with pytest.raises(OutputError, match=text):
        rs.run(tmp_path / "run")
    bpy.context.scene.name = "Scene"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "cube.blend"))
    with pytest.raises(OutputError, match=r"this is 'cube\.blend', scene 'Scene'\. Choose"):
        rs.run(tmp_path / "run")
    assert exr_times(tmp_path) == before
    rs.run(tmp_path / "run", overwrite=True)
    record = signal.open_run(tmp_path / "run").record
    assert (record.blend_file, record.scene) == ("cube.blend", "Scene")


@pytest.mark.parametrize("survive", [0, 3, 8, 13])
def test_a_clearing_that_is_killed_leaves_no_mixture(
    plate: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, survive: int
) -> None:
    """The plan goes last: what is left is of the run before, which is incomplete."""
    rs.run(tmp_path, frames=(1, 2))
    earlier, left = signal.open_run(tmp_path).record, [survive]
    remove = shared_folder.remove_file

    def killed(path: Path) -> None:
        if not left[0]:
            raise KeyboardInterrupt
        left[0] -= 1
        remove(path)

    monkeypatch.setattr(shared_folder, "remove_file", killed)
    with pytest.raises(KeyboardInterrupt):
        rs.run(tmp_path, frames=(1, 2), samples=2)
    monkeypatch.undo()
    found = signal.open_run(tmp_path)
    assert found.record.fingerprint == earlier.fingerprint
    assert (len(found.missing()) == 0) == (survive == 0)
    rs.run(tmp_path, frames=(1, 2), samples=2)
    assert not signal.open_run(tmp_path).missing()
    assert {signal.open_run(tmp_path).record.samples} == {2}


def test_frames_without_a_plan_are_refused(plate: Any, tmp_path: Path) -> None:
    rendered(tmp_path)
    (tmp_path / "run.json").unlink()
    with pytest.raises(OutputError, match="unknown run"):
        rendered(tmp_path)
    rendered(tmp_path, overwrite=True)
    assert (tmp_path / "run.json").exists()


def test_a_plan_of_a_newer_radarsim_is_refused(plate: Any, tmp_path: Path) -> None:
    rendered(tmp_path)
    path = tmp_path / "run.json"
    data = json.loads(path.read_text(encoding="utf-8"))
    data["schema_version"] = contract.SCHEMA_VERSION + 1
    path.write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(OutputError, match="schema version"):
        rendered(tmp_path)


# -- folders ---------------------------------------------------------------------------------------


def test_folder_is_made_in_an_existing_parent_only(plate: Any, tmp_path: Path) -> None:
    rendered(tmp_path / "new", limit=0)
    assert (tmp_path / "new" / "run.json").exists()
    with pytest.raises(OutputError, match=r"missing does not exist\. Create it"):
        rendered(tmp_path / "missing" / "run", limit=0)


def test_a_file_in_the_way(plate: Any, tmp_path: Path) -> None:
    (tmp_path / "run").write_text("", encoding="utf-8")
    with pytest.raises(OutputError, match="there is a file of this name"):
        rendered(tmp_path / "run", limit=0)
    (tmp_path / "run2").mkdir()
    (tmp_path / "run2" / "frames").write_text("", encoding="utf-8")
    with pytest.raises(OutputError, match="Cannot make the folder"):
        rendered(tmp_path / "run2")


def test_read_only_folder(plate: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Root may write anywhere, so the system's refusal is played."""

    def refuse(**_: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
    with pytest.raises(OutputError, match="Permission denied"):
        rendered(tmp_path)


@contextmanager
def ordinary_user() -> Iterator[None]:
    """As user 65534 where the tests run as root, whom no permission holds back."""
    root = os.geteuid() == 0
    if root:
        os.seteuid(65534)
    try:
        yield
    finally:
        if root:
            os.seteuid(0)


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="permissions of POSIX")
def test_read_only_folder_for_users(plate: Any) -> None:
    # not in tmp_path, which lies in a folder that is open to who runs the tests alone
    with ordinary_user(), tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o500)
        with pytest.raises(OutputError, match=r"Cannot make the folder .*run: Permission denied"):
            rendered(folder / "run")
        with pytest.raises(OutputError, match=r"Cannot write .*: Permission denied"):
            rendered(folder)
        assert list(folder.iterdir()) == []
        folder.chmod(0o700)


def test_folder_removed_in_the_middle(plate: Any, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with pytest.raises(OutputError), rs.job_for(folder, identity="file") as job:
        task = next(job.pending())
        job.start(task)
        job.render(task)
        shutil.rmtree(folder)
        job.finish(task)
    assert attributes.ATTR_RING_MAX not in bpy.context.scene


@pytest.mark.parametrize("name", ["Ünïcödé 雷達 run", "with space #1 %04d", "{braces} $HOME"])
def test_paths_with_odd_names(plate: Any, tmp_path: Path, name: str) -> None:
    folder = tmp_path / name / "rün"
    folder.parent.mkdir()
    rendered(folder)
    assert sorted(p.name for p in tmp_path.iterdir()) == [name]
    assert len(list(folder.rglob("ring_*.exr"))) == 3
    assert any(found.mask.any() for found in rs.decoded(folder))


def test_failed_write_leaves_nothing_half(
    plate: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Blender writes half a file and says nothing: told, removed, and rendered the next time."""
    with rs.job_for(tmp_path, identity="file") as job:
        save = ring_job.save_render

        def half(scene: Any, path: Path) -> None:
            save(scene, path)
            data = path.read_bytes()
            path.write_bytes(data[: len(data) // 2])

        monkeypatch.setattr(ring_job, "save_render", half)
        task = next(job.pending())
        job.start(task)
        job.render(task)
        with pytest.raises(OutputError, match="disk is probably full"):
            job.finish(task)
    monkeypatch.undo()
    assert not list(tmp_path.rglob("*.part*"))
    assert not list(tmp_path.rglob("*.exr"))
    assert rendered(tmp_path).done == 3


def test_failed_render_is_named(
    plate: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A camera that vanishes in the middle makes Cycles fail."""
    with rs.job_for(tmp_path, identity="file") as job:
        task = next(job.pending())
        job.start(task)
        bpy.context.scene.camera = None
        with pytest.raises(RenderError, match="Cycles failed"):
            job.render(task)


def test_scaled_later_in_the_animation(plate: Any, tmp_path: Path) -> None:
    """An antenna that is scaled at another frame is found before anything is rendered."""
    radar = bpy.data.objects["Radar"]
    radar.keyframe_insert("scale", frame=1)
    radar.scale = (3, 3, 3)
    radar.keyframe_insert("scale", frame=5)
    with pytest.raises(SceneError, match="scaled"):
        rendered(tmp_path, frames=(1, 5))
    assert not list(tmp_path.rglob("*.exr"))


def test_done_only_where_bytes_match(plate: Any, tmp_path: Path) -> None:
    job = rendered(tmp_path, limit=1)
    first, second = list(job.plan.tasks())[:2]
    assert shared_folder.is_done(tmp_path, first, job.fingerprint)
    assert not shared_folder.is_done(tmp_path, second, job.fingerprint)


def test_a_frame_of_another_run_is_refused_and_rendered_again(plate: Any, tmp_path: Path) -> None:
    """Both runs are alike but for the power of the transmitter."""
    own, other = tmp_path / "own", tmp_path / "other"
    run_both(own, "file")
    before = exr_blue(own)
    bpy.data.lights[0].energy *= 4
    run_both(other, "another file")
    assert (exr_blue(other) != before).any()
    frame = contract.frame_dir(1)
    for name in ("rings", "paths"):
        shutil.rmtree(own / name / frame)
        shutil.copytree(other / name / frame, own / name / frame)
        with pytest.raises(SchemaError, match="frame 1 belongs to another run"):
            list(signal.process_run(own / name, signal.ProcessOptions(plots=False)))
    bpy.data.lights[0].energy /= 4
    run_both(own, "file")
    assert (exr_blue(own) == before).all()
    for name in ("rings", "paths"):
        list(signal.process_run(own / name, signal.ProcessOptions(plots=False)))


def run_both(folder: Path, identity: str) -> None:
    folder.mkdir(exist_ok=True)
    rendered(folder / "rings", identity=identity)
    run_paths(folder / "paths", identity=identity)


def exr_blue(folder: Path) -> Any:
    return signal.read_exr(folder / "rings" / contract.frame_dir(1) / "ring_002_t0.exr")["B"]


def test_groups_of_an_older_version_are_rebuilt_before_the_first_ring(
    plate: Any, tmp_path: Path
) -> None:
    """An old file's groups, drawn anew, give the same run as fresh ones."""
    rendered(tmp_path / "fresh")
    for tree in bpy.data.node_groups:
        if groups.group_version(tree) is not None:
            tree[groups.VERSION_PROPERTY] = 0
            tree.nodes.clear()  # what an old version drew: here, nothing that echoes
    rendered(tmp_path / "stale")
    name = "frames/frame_0001/ring_002_t0.exr"
    fresh, stale = (signal.read_exr(tmp_path / run / name)["B"] for run in ("fresh", "stale"))
    assert fresh.max() > 0
    assert (fresh == stale).all()


@pytest.mark.skipif(os.name != "posix", reason="links need rights elsewhere")
def test_links_at_folders(plate: Any, tmp_path: Path) -> None:
    """The folder that the user names may be a link that leads somewhere; none inside it may."""
    elsewhere, link = tmp_path / "elsewhere", tmp_path / "link"
    link.symlink_to(elsewhere)
    with pytest.raises(OutputError, match=r"link is a symbolic link to .*elsewhere, which does"):
        rendered(link)
    elsewhere.mkdir()
    (elsewhere / "frames").symlink_to(tmp_path)
    with pytest.raises(OutputError, match=r"frames is a symbolic link; expected a folder"):
        rendered(link)
    (elsewhere / "frames").unlink()
    rendered(link)
    assert len(list(elsewhere.rglob("ring_*.exr"))) == 3
    assert sorted(path.name for path in tmp_path.iterdir()) == ["elsewhere", "link"]


def test_the_remaining_time_counts_this_session_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 20 renders 8 were there, 4 took 10 s: 8 remain, 20 s."""
    monkeypatch.setattr(time, "monotonic", lambda: 110.0)
    state = {"_started_s": 100.0, "total": 20, "done": 12, "_rendered": 4, "_done_before": 8}
    for kind in (RingJob, PathJob):
        left_s = kind.seconds_left.fget  # type: ignore[attr-defined]
        assert left_s is not None and left_s(SimpleNamespace(**state)) == pytest.approx(20.0)
        begun = {**state, "done": 8, "_rendered": 0}
        assert left_s(SimpleNamespace(**begun)) is None


@pytest.mark.parametrize("engine", ["CYCLES", "BLENDER_WORKBENCH"])
def test_the_engine_is_set_only_where_it_is_another(
    plate: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, engine: str
) -> None:
    """To set it while Cycles draws an icon blocks a window for good."""
    scene = bpy.context.scene
    scene.render.engine = engine
    names = []
    put = SettingsRestorer.set

    def noted(self: Any, owner: Any, name: str, value: Any) -> bool:
        names.append(name)
        return put(self, owner, name, value)

    monkeypatch.setattr(SettingsRestorer, "set", noted)
    job = rs.job_for(tmp_path)
    job.prepare()
    assert scene.render.engine == "CYCLES"
    job.restore()
    assert scene.render.engine == engine
    assert ("engine" in names) == (engine != "CYCLES") and "resolution_x" in names


def test_progress_of_a_single_frame_moves(plate: Any, tmp_path: Path) -> None:
    """One tile of four replicates: five steps, and each in words."""
    shown, stages = [], []
    with job_for(tmp_path, options={"replicates": 4}) as job:
        for task in job.pending():
            job.start(task)
            shown.append(job.fraction)
            stages.append(job.stage)
            job.render(task)
            job.finish(task)
    assert job.total == job.done == 5
    assert 0.8 in shown  # before the table is written
    assert stages[-1] == "frame 1, motion and path table"
    assert {stage.partition(",")[0] for stage in stages} == {"frame 1"}
