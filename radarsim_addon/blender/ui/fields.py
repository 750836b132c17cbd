# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels are made of: their place, settings by their names, sentences."""

from __future__ import annotations

import contextlib
import functools
import json
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import bpy

from ...errors import ConfigError, RadarSimError, SceneError
from ...findings import Finding, finding_lines, from_json, merge, to_json
from ...options import Declared
from ..rig_settings import RADAR_PROPERTY, RADAR_SETTINGS, TEXT_CONTEXT, Settings, field_of
from ..scene import active_radar

# -------------------------------------------------------------------------------------------------
# Texts of the tab in the user's language.
#
# Blender translates labels, tooltips and names of settings that its dictionaries know. Texts with
# numbers in them are translated by `tr` before the numbers are put in. A dictionary of ours is a
# file `locales/LOCALE.json` in this folder, for example `locales/de_DE.json`: translations by their
# English text, as `scripts/make_translation.py` writes it with empty translations.
# -------------------------------------------------------------------------------------------------


LOCALES = Path(__file__).with_name("locales")
#: Contexts in which Blender looks texts up: of labels, of operators' buttons, and of our words.
_CONTEXTS = ("*", "Operator", TEXT_CONTEXT)
_OWNER = __name__


def tr(text: str, /, **values: Any) -> str:
    """Return a text in the user's language, with values in place of its {names}."""
    return translated(text).format(**values)


def translated(text: str) -> str:
    """Return a text that is not a constant in the user's language, if the dictionaries
    contain it.
    """
    return str(bpy.app.translations.pgettext_iface(text, TEXT_CONTEXT))


def read_dictionaries(folder: Path = LOCALES) -> dict[str, dict[tuple[str, str], str]]:
    """Return the translations of all locales by context and text, in the form that Blender takes.

    ConfigError: a file is not a JSON object of texts, or a translation lacks {names} of its text.
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
    """Register radarsim's dictionaries with Blender. A second call changes nothing."""
    unregister_translations()
    dictionaries = read_dictionaries()
    if dictionaries:
        bpy.app.translations.register(_OWNER, dictionaries)


def unregister_translations() -> None:
    """Unregister the dictionaries. A second call changes nothing."""
    bpy.app.translations.unregister(_OWNER)


# -------------------------------------------------------------------------------------------------
# Findings and errors in Blender's window: in panels, and as reports of operators.
# -------------------------------------------------------------------------------------------------


#: Icon of a severity.
ICONS = {"info": "INFO", "caution": "ERROR", "error": "CANCEL"}  # Blender's ERROR is a triangle


@contextlib.contextmanager
def reported(operator: bpy.types.Operator) -> Iterator[None]:
    """Show a named error as the report of an operator, which then returns CANCELLED."""
    try:
        yield
    except RadarSimError as error:
        operator.report({"ERROR"}, str(error))


def report_findings(
    operator: bpy.types.Operator, findings: list[Finding], frames: Sequence[int] = ()
) -> None:
    """Report findings of `frames` in Blender's status bar and Info editor."""
    for item in merge(findings):
        kind = "INFO" if item.severity == "info" else "WARNING"  # ERROR would raise in scripts
        operator.report({kind}, finding_lines([item], frames, whole=True)[0])


def draw_findings(
    context: bpy.types.Context, layout: bpy.types.UILayout, findings: Iterable[Finding]
) -> None:
    """Draw findings in a panel, each with the icon of its severity."""
    for item in findings:
        wrapped(context, layout, item.message, ICONS[item.severity])


def findings_text(findings: list[Finding]) -> str:
    """Return findings as text for a Blender property."""
    return json.dumps([to_json(item) for item in findings])


def read_findings(text: str) -> list[Finding]:
    """Return the findings that `findings_text` wrote."""
    return [from_json(item, "Findings") for item in json.loads(text or "[]")]


#: Letters of a line that a narrow sidebar holds, and letters that the rest of a header takes.
_NARROW, _HEADER = 40, 4
#: Parts of the width that names take: Blender's own, and for names of more letters than `_SHORT`.
_NAMES, _LONG_NAMES, _SHORT = 0.4, 0.55, 14


def active_group(scene: bpy.types.Scene) -> Any:
    """Return the properties of the scene's active radar; None without one."""
    try:
        return getattr(active_radar(scene), RADAR_PROPERTY)
    except SceneError:
        return None


class RadarPanel:
    """A panel of the sidebar tab."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Radar"
    bl_translation_context = TEXT_CONTEXT


class ActiveRadarPanel(RadarPanel):
    """A panel of the sidebar tab about the active radar."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return active_group(context.scene) is not None


def split(layout: bpy.types.UILayout) -> Any:
    """Return a layout with names on the left and values on the right, without keyframe buttons."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    return layout


def draw_number(layout: bpy.types.UILayout, name: str, text: str) -> None:
    """Draw a derived number like a field: its name on the left, its value on the right.

    The name takes more of the width if it is longer than the names of fields.
    """
    _named(layout, name).label(text=text, translate=False)


def _named(layout: bpy.types.UILayout, name: str) -> bpy.types.UILayout:
    """Draw a name like that of a field; return the layout of what is on its right."""
    shown = translated(name) if name else ""
    parts = layout.split(factor=_NAMES if len(shown) <= _SHORT else _LONG_NAMES)
    names = parts.row()
    names.alignment = "RIGHT"
    names.label(text=shown, translate=False)
    return parts


def misfit(group: Any, item: Declared) -> str:
    """Return why the value of a setting is not valid, in the words of a measurement; "" if it is
    valid.
    """
    try:
        item.check(getattr(Settings(group, {item.name: item}), item.name))
    except ConfigError as error:
        return str(error)
    return ""


def shown_at_field(group: Any, wrong: str) -> bool:
    """Return whether a field of the panels already shows an error of the settings."""
    shown = group is not None and wrong != ""
    return shown and any(misfit(group, item) == wrong for item in RADAR_SETTINGS.values())


def label_of(item: Declared) -> str:
    """Return the label of a setting without its unit."""
    return item.shown_label.removesuffix(f" [{item.shown_unit}]")


def draw_quantity(layout: bpy.types.UILayout, owner: Any, prop: str, name: str, unit: str) -> None:
    """Draw a number with its unit after it. In brackets after the name, a narrow sidebar would cut
    the unit off.
    """
    fields = _named(layout, name).split(factor=0.68, align=True)
    fields.prop(owner, prop, text="")
    fields.label(text=unit, translate=False)


def draw_state(panel: Any, text: str) -> None:
    """Draw the state of a panel at the right end of its header, cut to the width that the name
    leaves.
    """
    room = letters_across(bpy.context) - len(translated(panel.bl_label)) - _HEADER
    if room < len(text):
        text = f"{text[: room - 1].rstrip()}\u2026" if room > _SHORT // 2 else ""
    row = panel.layout.row()
    row.active = False  # less bright than the panel's name
    row.label(text=text)


def draw_fields(
    layout: bpy.types.UILayout,
    group: Any,
    settings: Mapping[str, Declared],
    *names: str,
    after: Mapping[str, Sequence[tuple[str, str]]] = MappingProxyType({}),
    labels: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Draw settings one below the other. A setting that may be None has a switch.

    after: derived numbers (name, value) to draw below a setting, by the name of the setting.
    labels: labels that replace those of the settings.
    """
    column = layout.column()
    for name in names or settings:
        item = settings[name]
        if not item.of.window:
            continue
        if item.optional:
            column.prop(group, f"use_{name}")
            if not getattr(group, f"use_{name}"):
                continue
        wrong = misfit(group, item)
        field = column.column() if wrong else column
        if wrong:  # a file, a script or an animation may set what the field would not take
            field.alert = True
        prop, unit = field_of(item)
        label = labels.get(name, label_of(item))
        if unit:
            draw_quantity(field, group, prop, label, unit)
        elif len(translated(label)) > _SHORT and item.kind is not bool:
            _named(field, label).prop(group, prop, text="")
        else:
            field.prop(group, prop, text=label)
        if wrong:
            for line in textwrap.wrap(wrong, _NARROW):
                field.label(text=line, translate=False)
        for label, text in after.get(name, ()):
            draw_number(column, label, text)


def letters_across(context: bpy.types.Context) -> int:
    """Return the number of letters that fit into a line next to an icon."""
    if context.region is None:  # without a window
        return 2 * _NARROW
    return max(16, int(context.region.width / (7 * context.preferences.system.ui_scale)) - 4)


def wrapped(context: bpy.types.Context, layout: bpy.types.UILayout, text: str, icon: str) -> None:
    """Draw a sentence over as many lines as the sidebar's width needs."""
    column = layout.column(align=True)
    for index, line in enumerate(textwrap.wrap(text, letters_across(context))):
        column.label(text=line, icon="BLANK1" if index and icon != "NONE" else icon)


# -------------------------------------------------------------------------------------------------
# Timers that change data, whatever Blender notes of drawing.
#
# Blender notes, once for all threads, that a panel is being drawn and must not change data. A
# render that begins meanwhile may leave the note there for good: then timers could change nothing
# any more. Properties of the window manager can be set even so, and their updates may change data.
# -------------------------------------------------------------------------------------------------


_PROPERTY = "radarsim_timer"
_calls: list[Callable[[], None]] = []
#: In what Blender says where it refuses to change data, of properties and of operators.
_REFUSALS = ("Writing to ID classes in this context", "can't modify blend data in this state")


def _run_calls(_: Any, __: Any) -> None:
    """Run the waiting functions. This is the update function of the property."""
    while _calls:
        _calls.pop()()


def may_write(timer: Callable[[], float | None]) -> Callable[[], float | None]:
    """Return a function for Blender's timers that calls the given one with the right to change
    data.
    """

    @functools.wraps(timer)
    def allowed() -> float | None:
        pauses_s: list[float | None] = []
        errors: list[Exception] = []

        def call() -> None:
            try:
                pauses_s.append(timer())
            except Exception as error:  # Blender would print it and go on
                errors.append(error)

        _calls.append(call)
        manager = bpy.context.window_manager
        setattr(manager, _PROPERTY, not getattr(manager, _PROPERTY))
        if errors:
            raise errors[0]
        return pauses_s[0]

    return allowed


def is_refused(error: BaseException) -> bool:
    """Return whether Blender refused to change data."""
    return any(text in str(error) for text in _REFUSALS)


def may_write_at_need(timer: Callable[[], float | None]) -> Callable[[], float | None]:
    """Return what `may_write` returns, for timers that run many times per second.

    The update of the property draws the whole window. So this function first runs the timer
    directly, and uses the update only if Blender refuses to change data.
    """
    allowed = may_write(timer)

    @functools.wraps(timer)
    def tried() -> float | None:
        try:
            return timer()
        except (AttributeError, RuntimeError) as error:
            if not is_refused(error):
                raise
        return allowed()

    return tried


def register_timer_writes() -> None:
    """Register the property; a second call changes nothing."""
    if not hasattr(bpy.types.WindowManager, _PROPERTY):
        switch = bpy.props.BoolProperty(
            name="Timer",
            update=_run_calls,
            options={"SKIP_SAVE", "HIDDEN"},
            description="Set by timers that change data",
        )
        setattr(bpy.types.WindowManager, _PROPERTY, switch)


def unregister_timer_writes() -> None:
    """Unregister the property. A second call changes nothing."""
    if hasattr(bpy.types.WindowManager, _PROPERTY):
        delattr(bpy.types.WindowManager, _PROPERTY)
