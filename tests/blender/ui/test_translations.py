# SPDX-License-Identifier: GPL-3.0-or-later
"""Every text of the tab can be translated, and dictionaries are read and checked."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.materials.physical_materials import READY
from radarsim_addon.blender.rig_settings import TEXT_CONTEXT
from radarsim_addon.blender.rig_settings.material import MaterialSettings
from radarsim_addon.blender.ui import fields
from radarsim_addon.blender.ui.overlays import overlay_lines
from radarsim_addon.errors import ConfigError
from scripts import make_translation
from tests.blender import radar_scenes as rs
from tests.blender import recording

pytestmark = pytest.mark.blender

#: Units and symbols, which no language translates.
_SAME = {
    "ms", "us", "dB", "dBm", "dBW", "dBsm", "dBi", "GHz", "MHz", "kHz", "Hz", "deg", "km", "mm",
    "EIRP", "HH", "VV",
}  # fmt: skip


def words(text: str) -> list[str]:
    return [word for word in re.findall(r"[^\W\d_]{2,}", text) if word not in _SAME]


@pytest.mark.parametrize("path", sorted(make_translation.UI.glob("*.py")), ids=lambda one: one.name)
def test_no_drawn_text_is_put_together_before_it_is_translated(path: Path) -> None:
    """`tr` takes constants; of what is drawn, no f-string holds words, nor does a sum of texts."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for name, item in make_translation.drawn_arguments(tree):
        said = f"{path.name}:{item.lineno}"
        if name == "tr":
            assert isinstance(item, ast.Constant), f"{said}: tr() of a text that is not constant"
            continue
        for part in ast.walk(item):
            if isinstance(part, ast.JoinedStr):
                parts = (one.value for one in part.values if isinstance(one, ast.Constant))
                assert not words(" ".join(map(str, parts))), f"{said}: use tr()"


def test_all_texts_of_the_tab_come_from_the_dictionary(
    addon: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a dictionary that marks what it translates, nothing with words is drawn unmarked."""
    rs.new_scene()
    rs.add_plate(30.0, 2.0)
    known = make_translation.source_texts() | make_translation.declared_texts()
    names = "|".join(sorted(bpy.data.objects.keys(), key=len, reverse=True))
    looked_up, texts = [], []

    def pgettext_iface(text: str, context: str) -> str:
        assert context == TEXT_CONTEXT  # else Blender's own words come first
        looked_up.append(text)
        return f"\u00ab{text}\u00bb"

    app = SimpleNamespace(translations=SimpleNamespace(pgettext_iface=pgettext_iface))
    with monkeypatch.context() as patch:
        patch.setattr(fields, "bpy", SimpleNamespace(app=app, context=bpy.context))
        for kind in ("paths", "rings"):
            rs.radar().sampling_mode = kind
            rs.radar().use_link_budget = kind == "rings"
            texts += recording.drawn(*recording.TAB).texts
            texts += [label.text for label, _ in overlay_lines(recording.context())[1]]
    for text in texts:
        assert "\u00ab" in text or text in known or not words(re.sub(names, "", text)), text
    assert len(looked_up) > 8 and {text for text in looked_up if "\u00ab" not in text} <= known


def test_dictionaries_are_read_and_checked(tmp_path: Path) -> None:
    def write(texts: object) -> None:
        (tmp_path / "de_DE.json").write_text(json.dumps(texts), encoding="utf-8")

    write({"about {time}": "etwa {time}", "Radar": ""})
    expected = {(context, "about {time}"): "etwa {time}" for context in ("*", "Operator", "Radar")}
    assert fields.read_dictionaries(tmp_path) == {"de_DE": expected}
    write({"about {time}": "etwa {zeit}"})
    with pytest.raises(ConfigError, match=r"\['zeit'\]; expected those of 'about \{time\}'"):
        fields.read_dictionaries(tmp_path)
    write(["about {time}"])
    with pytest.raises(ConfigError, match="not a JSON object of texts"):
        fields.read_dictionaries(tmp_path)
    (tmp_path / "de_DE.json").write_text("{")
    with pytest.raises(ConfigError, match="is no JSON"):
        fields.read_dictionaries(tmp_path)


def test_the_german_dictionary_has_the_texts_of_the_code(addon: None) -> None:
    """No text that the window no longer has; without a translation are the names of papers only.

    `python scripts/make_translation.py de_DE` removes the former and lists the latter.
    """
    path = fields.LOCALES / "de_DE.json"
    german = json.loads(path.read_text(encoding="utf-8"))
    known = make_translation.source_texts() | make_translation.declared_texts()
    assert set(german) <= known, set(german) - known
    media = MaterialSettings.bl_rna.properties["medium"].enum_items_static
    sources = {one.description for one in media} | {one.description for one in READY.values()}
    assert {text for text, translated in german.items() if not translated} <= sources
    registered = fields.read_dictionaries()["de_DE"]
    assert registered["*", "Range Profile"] == "Entfernungsprofil"
    assert registered["Operator", "Set Up Radar"] == "Radar einrichten"
    assert len(registered) > 1600


def test_the_script_adds_texts_and_keeps_translations(addon: None, tmp_path: Path) -> None:
    path = tmp_path / "de_DE.json"
    path.write_text(json.dumps({"Not measured yet": "Nicht gemessen", "long gone": "lange weg"}))
    assert make_translation.main(["de_DE", "--out", str(tmp_path)]) == 0
    texts = json.loads(path.read_text(encoding="utf-8"))
    assert texts["Not measured yet"] == "Nicht gemessen" and "long gone" not in texts
    wanted = {"about {time}", "Set Up Radar", "Range Profile", "Beyond unambiguous velocity"}
    assert wanted <= set(texts) and len(texts) > 300
