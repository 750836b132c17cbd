# SPDX-License-Identifier: GPL-3.0-or-later
"""The identity of a file: its bytes and those of all that it reads, where nobody touched it."""

from __future__ import annotations

import contextlib
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.headless import session
from radarsim_addon.blender.plan import parse_render_arguments
from radarsim_addon.blender.scene import scene_files as fi
from radarsim_addon.errors import ConfigError, SceneError
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


def image_file(path: Path, value: float = 0.5) -> None:
    image = bpy.data.images.new("Written", 2, 2)
    image.pixels = [value] * 16
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)


def library(path: Path, *links: Path) -> None:
    """A file with one object, which links that of another file."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    for source in links:
        link(source)
    item = bpy.data.objects.new("Part", None)
    item.parent = next(iter(bpy.context.scene.objects), None)
    bpy.context.scene.collection.objects.link(item)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


def link(source: Path) -> None:
    with bpy.data.libraries.load(str(source), link=True) as (_, wanted):
        wanted.objects = ["Part"]
    bpy.context.scene.collection.objects.link(wanted.objects[0])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a scene that reads files of many kinds; the add-on is not registered."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "parts").mkdir()
    library(folder / "parts" / "inner.blend")
    library(folder / "parts" / "outer.blend", folder / "parts" / "inner.blend")
    rs.new_scene()
    plate = rs.add_plate(10.0)
    link(folder / "parts" / "outer.blend")
    for name in ("plain", "seq_001", "seq_002", "seq_010", "other_001", "tile.1001", "tile.1002"):
        image_file(folder / f"{name}.png")
    tree = plate.data.materials[0].node_tree
    for name, source in (("plain", "FILE"), ("seq_001", "SEQUENCE"), ("tile.1001", "TILED")):
        image = bpy.data.images.load(str(folder / f"{name}.png"))
        image.source = source
        if source == "TILED":
            image.filepath = str(folder / "tile.<UDIM>.png")
        tree.nodes.new("ShaderNodeTexImage").image = image
    lobe = tree.nodes.new("ShaderNodeTexIES")
    lobe.mode, lobe.filepath = "EXTERNAL", str(folder / "lamp.ies")
    cache = plate.modifiers.new("Cache", "MESH_CACHE")
    cache.filepath = str(folder / "motion.mdd")
    cloth = rs.add_plate(12.0)
    cloth.modifiers.new("Cloth", "CLOTH").point_cache.use_external = True
    cloth.modifiers["Cloth"].point_cache.filepath = "//points"
    group = bpy.data.node_groups.new("Group", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    group.nodes.new("NodeGroupOutput")
    cloth.modifiers.new("Nodes", "NODES").node_group = group
    cloth.modifiers["Nodes"].bake_directory = "//bakes"
    for name in ("points", "bakes"):
        (folder / name).mkdir()
    for name in ("lamp.ies", "motion.mdd", "points/1.bphys", "bakes/meta.json", "talk.wav"):
        (folder / name).write_bytes(b"first")
    with contextlib.suppress(RuntimeError):
        bpy.data.sounds.load(str(folder / "talk.wav"))
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    bpy.ops.file.make_paths_relative()
    bpy.ops.wm.save_mainfile()
    return folder


def identity(folder: Path) -> str:
    bpy.ops.wm.open_mainfile(filepath=str(folder / "scene.blend"))
    return fi.file_identity()


@pytest.fixture
def copied(made: Path, tmp_path: Path) -> Path:
    return shutil.copytree(made, tmp_path / "copy")


def test_another_folder_changes_nothing(made: Path, copied: Path) -> None:
    assert identity(made) == identity(made) == identity(copied)


READ = (
    "parts/outer.blend", "parts/inner.blend", "plain.png", "seq_001.png", "seq_002.png",
    "seq_010.png", "tile.1001.png", "tile.1002.png", "lamp.ies", "motion.mdd", "points/1.bphys",
    "bakes/meta.json",
)  # fmt: skip


def test_each_file_that_is_read_counts(copied: Path) -> None:
    before = identity(copied)
    for name in READ:
        path = copied / name
        kept = path.read_bytes()
        path.unlink()
        assert identity(copied) != before, f"{name} removed"
        if path.suffix == ".blend":
            library(path, *([copied / "parts" / "inner.blend"] if "outer" in name else []))
        elif path.suffix == ".png":
            image_file(path, 0.25)
        else:
            path.write_bytes(b"second")
        assert identity(copied) != before, f"{name} changed"
        path.write_bytes(kept)
    for name in ("other_001.png", "talk.wav"):
        (copied / name).write_bytes(b"other")
    assert identity(copied) == before, "read again, and files that are not read"


def test_missing_and_unreadable_files_are_named(
    copied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    identity(copied)
    assert fi.unreadable_files() == []
    (copied / "plain.png").unlink()
    (copied / "parts" / "inner.blend").unlink()
    identity(copied)
    (found,) = fi.unreadable_files()
    assert found.code == "linked-file-missing" and found.severity == "caution"
    assert "plain.png" in found.message and "inner.blend" in found.message
    assert "seq_" not in found.message and "talk.wav" not in found.message

    def refuse(path: Path) -> str:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(fi, "file_sha256", refuse)
    with pytest.raises(SceneError, match=r"scene\.blend.*cannot be read \(Permission denied\)"):
        fi.file_identity()


# -- untouched -------------------------------------------------------------------------------------


@contextlib.contextmanager
def handler(hooks: list[Any], function: Callable[..., None]) -> Iterator[None]:
    hooks.append(function)
    try:
        yield
    finally:
        hooks.remove(function)


def job(folder: Path) -> Any:
    words = [str(folder / "scene.blend"), "--out", str(folder / "run")]
    return session.open_job(parse_render_arguments(words))


def test_a_file_that_radarsim_opens_has_an_identity(made: Path) -> None:
    opened = job(made)
    assert opened.identity.startswith(identity(made)) and not opened.early_findings


@pytest.mark.parametrize("name", ["load_post", "frame_change_pre", "depsgraph_update_post"])
def test_handlers_of_scripts_leave_none(made: Path, name: str) -> None:
    """They may have changed the scene when it was opened, or may change it in the run."""

    def meddle(*_: Any) -> None:
        pass

    with handler(getattr(bpy.app.handlers, name), bpy.app.handlers.persistent(meddle)):
        opened = job(made)
        assert opened.identity == ""
        (found,) = opened.early_findings
        assert found.code == "changed-by-scripts" and "meddle" in found.message
        with pytest.raises(ConfigError, match="meddle"):
            session.check_workers(opened_here=True)
    assert job(made).identity


def test_code_of_add_ons_counts(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every process of a run has the same add-ons; another version of one is another run."""
    own = identity(made)
    addon = tmp_path / "addons" / "other.py"
    addon.parent.mkdir()
    monkeypatch.setattr(bpy.utils, "user_resource", lambda kind, path="": str(tmp_path / path))
    found = []
    for version in ("1", "2"):
        addon.write_text(f"def meddle(*_):\n    return {version}\n")
        scope: dict[str, Any] = {"__name__": "other"}
        exec(compile(addon.read_text(), str(addon), "exec"), scope)
        with handler(bpy.app.handlers.frame_change_post, scope["meddle"]):
            assert fi.foreign_handlers() == []
            found.append(fi.file_identity())
    assert len({own, *found}) == 3


@pytest.mark.parametrize(
    ("words", "plain"),
    [
        ("-b {file} -P render_radar.py -- --out x -P no.py", True),
        ("--background {file} --python render_radar.py -- --out x", True),
        ("-b -Y --factory-startup -noaudio -t 2 {file} -P render_radar.py", True),
        ("-b {file} --python-exit-code 1 -P render_radar.py --", True),
        ("-b {file} other.blend -P render_radar.py --", False),
        ("-b {file} -P other.py -P render_radar.py -- --out x", False),
        ("-b {file} --python-expr 1 -P render_radar.py --", False),
        ("-b -y {file} -P render_radar.py --", True),
        ("-b -P render_radar.py -- {file}", False),
    ],
)
def test_words_of_the_blender_program(
    made: Path, monkeypatch: pytest.MonkeyPatch, words: str, plain: bool
) -> None:
    """Blender has opened the file: only where it ran nothing but the script is it untouched."""
    bpy.ops.wm.open_mainfile(filepath=str(made / "scene.blend"))
    own = [word.format(file=bpy.data.filepath) for word in words.split()]
    if own[-1] == bpy.data.filepath:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    monkeypatch.setattr(sys, "argv", ["/usr/bin/blender", *own])
    assert (session.changed_by_scripts(opened_here=False) == []) is plain
    assert session.changed_by_scripts(opened_here=True) == []


def test_texts_that_run_when_the_file_is_opened(
    made: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(made / "scene.blend"))
    bpy.data.texts.new("startup.py").use_module = True
    words = [bpy.data.filepath, "-P", "render_radar.py"]
    monkeypatch.setattr(sys, "argv", ["blender", "-b", "-Y", *words])
    assert session.changed_by_scripts(opened_here=False) == []
    monkeypatch.setattr(sys, "argv", ["blender", "-b", "--enable-autoexec", *words])
    assert session.changed_by_scripts(opened_here=False) == ["startup.py"]
    assert session.changed_by_scripts(opened_here=True) == []


def test_a_file_that_changes_while_it_is_opened_is_refused(
    copied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def written(*_: Any) -> None:
        with open(copied / "scene.blend", "ab") as stream:
            stream.write(b" ")

    with (
        handler(bpy.app.handlers.load_post, bpy.app.handlers.persistent(written)),
        pytest.raises(SceneError, match="was changed while it was opened"),
    ):
        job(copied)
