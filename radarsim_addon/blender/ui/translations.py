# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts of the tab in the user's language.

Blender translates labels, tooltips and names of settings that its dictionaries know. Texts with
numbers in them are translated by `tr` before the numbers are put in. A dictionary of ours is a
file `locales/LOCALE.json` in this folder, for example `locales/de_DE.json`: translations by their
English text, as `scripts/make_translation.py` writes it with empty translations.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy

from ...errors import ConfigError

LOCALES = Path(__file__).with_name("locales")
#: Contexts in which Blender looks texts up: of labels and settings, of operators' buttons.
_CONTEXTS = ("*", "Operator")
_OWNER = __name__


def tr(text: str, /, **values: Any) -> str:
    """Return a text in the user's language, with values in place of its {names}."""
    return str(bpy.app.translations.pgettext_iface(text)).format(**values)


def read_dictionaries(folder: Path = LOCALES) -> dict[str, dict[tuple[str, str], str]]:
    """Return the translations of all locales by context and text, as Blender takes them.

    Raises
    ------
    ConfigError
        A file is not a JSON object of texts, or a translation has other {names} than its text.
    """
    found = {}
    for path in sorted(folder.glob("*.json")):
        try:
            texts = json.loads(path.read_text(encoding="utf-8"))
        except ValueError as error:
            raise ConfigError(f"{path} is no JSON: {error}") from error
        if not isinstance(texts, dict) or not all(isinstance(one, str) for one in texts.values()):
            raise ConfigError(
                f"{path} is not a JSON object of texts; expected English: translated."
            )
        for text, translated in texts.items():
            if translated and _names(text) != _names(translated):
                raise ConfigError(
                    f"{path}: {translated!r} has the names {_names(translated)}; expected those of "
                    f"{text!r}: {_names(text)}."
                )
        found[path.stem] = {
            (context, text): translated
            for text, translated in texts.items()
            if translated
            for context in _CONTEXTS
        }
    return found


def _names(text: str) -> list[str]:
    """Names in braces, without their formats."""
    return sorted(part.partition("}")[0].partition(":")[0] for part in text.split("{")[1:])


def register_translations() -> None:
    """Give Blender our dictionaries; a second call changes nothing."""
    unregister_translations()
    dictionaries = read_dictionaries()
    if dictionaries:
        bpy.app.translations.register(_OWNER, dictionaries)


def unregister_translations() -> None:
    """Take them back; a second call changes nothing."""
    bpy.app.translations.unregister(_OWNER)
