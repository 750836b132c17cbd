# SPDX-License-Identifier: GPL-3.0-or-later
"""Write a dictionary of the window's texts for a language, or add what it lacks.

    python scripts/make_translation.py de_DE

The file is radarsim_addon/blender/ui/locales/LOCALE.json: translations by their English text, empty
where there is none yet. Translations of texts that the window no longer has are removed.
"""

from __future__ import annotations

import argparse
import ast
import json
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
UI = ROOT / "radarsim_addon/blender/ui"
#: Functions that draw a text, and which of their arguments it is: a place or a name.
DRAWING: dict[str, tuple[int | str, ...]] = {
    "tr": (0,), "label": ("text",), "operator": ("text",), "prop": ("text",), "progress": ("text",),
    "column": ("heading",), "draw_number": (1,), "draw_state": (1,), "draw_quantity": (3,),
}  # fmt: skip


def drawn_arguments(tree: ast.AST) -> list[tuple[str, ast.expr]]:
    """Return the texts that a module draws: function, and the expression."""
    found = []
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        for which in DRAWING.get(name, ()):
            if isinstance(which, str):
                found += [(name, one.value) for one in node.keywords if one.arg == which]
            elif len(node.args) > which:
                found.append((name, node.args[which]))
    return found


def source_texts() -> set[str]:
    """Return the constant texts that the modules of the window draw, and labels in their sources:
    Blender replaces the label of a preset menu by the name of the chosen preset.
    """
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in UI.glob("*.py")]
    items = [item for tree in trees for _, item in drawn_arguments(tree)]
    for tree in trees:
        for node in ast.walk(tree):
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "bl_label":
                items.append(node.value)
    return {
        item.value
        for item in items
        if isinstance(item, ast.Constant) and isinstance(item.value, str) and item.value
    }


def declared_texts() -> set[str]:
    """Return labels and tooltips of panels, operators and settings, and titles of findings."""
    import bpy

    from radarsim_addon.blender import addon
    from radarsim_addon.blender.ui.live_preview import LIVE_PROPERTY
    from radarsim_addon.blender.ui.scene_panel import title_of
    from radarsim_addon.findings.catalogue import CATALOGUE

    found: set[str] = {title_of(code) for code in CATALOGUE}
    live = bpy.types.WindowManager.bl_rna.properties[LIVE_PROPERTY]
    found.update((live.name, live.description))
    bases = (bpy.types.Operator, bpy.types.PropertyGroup)
    of_blender = {item.identifier for base in bases for item in base.bl_rna.properties}

    def add(kind: Any) -> None:
        if kind in addon.CLASSES and issubclass(kind, bpy.types.Operator):
            found.update((kind.bl_label, kind.bl_rna.description))
        for item in kind.bl_rna.properties:
            if item.identifier in of_blender:
                continue
            # the tab draws units behind the fields
            found.update((item.name, item.name.partition(" [")[0], item.description))
            for one in getattr(item, "enum_items_static", ()):
                found.update((one.name, one.description))

    for kind in addon.CLASSES:
        if issubclass(kind, bpy.types.Operator):
            add(kind)
    for kind in bpy.types.PropertyGroup.__subclasses__():
        if "radarsim" in kind.__module__ and kind.is_registered:
            add(kind)
    return {text for text in found if text}


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("locale", help="name of Blender's for the language, for example de_DE")
    parser.add_argument("--out", type=Path, default=UI / "locales", help="folder of the file")
    arguments = parser.parse_args(argv)
    from radarsim_addon.blender import addon

    addon.register()
    path = arguments.out / f"{arguments.locale}.json"
    known = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    texts = {text: known.get(text, "") for text in sorted(source_texts() | declared_texts())}
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(texts, indent=1, ensure_ascii=False) + "\n"
    path.write_text(text, encoding="utf-8")
    missing = sum(not text for text in texts.values())
    print(f"{path}: {len(texts)} texts, {missing} without a translation")
    return 0


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    sys.exit(main())
