# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender property groups made from the settings that dataclasses declare.

Numbers come in as the window shows them (GHz, us), go into the file as float64 in SI, and are read
by :class:`Settings`. Blender's own float properties are float32: here they only show the number
and take what was typed.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

import bpy

from ...errors import ConfigError, SettingNameError
from ...options import Declared, declared
from ..plan import shortest_decimal

Record = TypeVar("Record")
Change = Callable[[Any], None]

#: From 4.5 on Blender warns of // paths in properties that do not declare them.
_RELATIVE = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5, 0) else {"ANIMATABLE"}
#: Where names belong that are no settings of a radar; the interface for scripts fills it.
PLACES: dict[str, str] = {}
#: Least number that a field of the window takes, where a value must be above 0.
_LEAST_SHOWN = 1e-6


def property_group(
    name: str,
    settings: Mapping[str, Declared],
    others: Mapping[str, Any] | None = None,
    changes: Mapping[str, Change] | None = None,
) -> type[Any]:
    """Return a class of bpy.types.PropertyGroup, not yet registered.

    `others` are further properties (pointers); `changes` are called, by the name of a setting,
    with the group after the setting was changed.
    """
    annotations: dict[str, Any] = {}
    for item in settings.values():
        if item.optional:
            annotations[f"use_{item.name}"] = bpy.props.BoolProperty(
                name=f"Set {item.of.label.lower()}",
                description=item.of.help,
                default=item.of.on or item.default is not None,
            )
        annotations[item.shown_name] = _property(item, (changes or {}).get(item.name))
    annotations.update(others or {})
    members = {
        "__annotations__": annotations,
        "__doc__": "Settings, see the declarations of their dataclasses.",
        "changes": dict(changes or {}),
    }
    return type(name, (bpy.types.PropertyGroup,), members)


def _property(item: Declared, change: Change | None) -> Any:
    """A field of the window."""
    of = item.of
    common: dict[str, Any] = {"name": item.shown_label, "description": of.help}
    if change is not None:  # not called by keyframes, which may change nothing else
        common["update"] = lambda group, _: change(group)
    if item.kind is bool:
        return bpy.props.BoolProperty(default=bool(item.initial), **common)
    if of.choices:
        return bpy.props.EnumProperty(items=of.choices, default=str(item.initial), **common)
    if item.kind is str:
        if of.path:
            common |= {"subtype": f"{of.path}_PATH", "options": _RELATIVE}
        return bpy.props.StringProperty(default=item.initial or "", **common)
    bounds = {"min": of.minimum, "max": of.maximum, "soft_max": of.soft_maximum}
    if item.kind is int:
        common |= {key: int(value) for key, value in bounds.items() if value is not None}
        return bpy.props.IntProperty(default=item.initial, **common)
    common |= {key: item.to_shown(value) for key, value in bounds.items() if value is not None}
    if of.above == 0:
        common["min"] = _LEAST_SHOWN

    def get(group: Any) -> float:
        return item.to_shown(group.get(item.name, item.initial))

    def put(group: Any, value: float) -> None:
        group[item.name] = shortest_decimal(value, item.exponent)

    return bpy.props.FloatProperty(get=get, set=put, precision=of.digits, **common)


def read(group: Any, item: Declared) -> Any:
    """Return the value of a setting, numbers in SI and float64."""
    if item.optional and not getattr(group, f"use_{item.name}"):
        return None
    if item.kind is float:
        return float(group.get(item.name, item.initial))
    value = getattr(group, item.name)
    return item.kind(value) if item.of.choices else value


def write(group: Any, item: Declared, value: Any) -> None:
    """Set the value of a setting, which was checked; others are told as if the window had."""
    if item.optional:
        setattr(group, f"use_{item.name}", value is not None)
    if item.kind is float and value is not None:
        group[item.name] = float(value)
        if item.name in group.changes:
            group.changes[item.name](group)
    elif value is not None:
        setattr(group, item.name, str(value) if item.of.choices else value)


class Settings:
    """The settings of a property group by their names, in SI and float64, checked when set.

    ``view.carrier_hz = 77e9`` reads back as 77e9. A group within it takes a mapping,
    ``view.transmitter = {"kind": "gaussian"}``, and keeps its other settings. Setting raises a
    `ConfigError` where the value has the wrong type or is out of bounds; an unknown name raises a
    `SettingNameError`.

    Parameters
    ----------
    group : bpy.types.PropertyGroup
    declarations
        Its settings by name; of groups within it (antennas), theirs by the group's name.
    """

    __slots__ = ("_declarations", "_group")

    def __init__(
        self, group: Any, declarations: Mapping[str, Declared | Mapping[str, Declared]]
    ) -> None:
        object.__setattr__(self, "_group", group)
        object.__setattr__(self, "_declarations", declarations)

    def __getattr__(self, name: str) -> Any:
        item = self._declaration(name)
        if isinstance(item, Declared):
            return read(self._group, item)
        return Settings(getattr(self._group, name), item)

    def __setattr__(self, name: str, value: Any) -> None:
        item = self._declaration(name)
        if not isinstance(item, Declared):
            if not isinstance(value, Mapping):
                raise ConfigError(
                    f"{name} is {value!r:.60}; expected a mapping of its settings, which are "
                    f"{', '.join(item)}."
                )
            view = getattr(self, name)
            for key, part in value.items():
                setattr(view, key, part)
            return
        item.check(value)
        if self._group.id_data.library is not None:
            raise ConfigError(
                f"{self._group.id_data.name!r} is linked from another file; its settings cannot be "
                "changed here. Change them there, or make the object local."
            )
        write(self._group, item, value)

    def __dir__(self) -> Iterable[str]:
        return list(self._declarations)

    def record(self, kind: type[Record], **given: Any) -> Record:
        """Return an instance of one of the dataclasses that the group was made from.

        Parameters
        ----------
        kind
            Dataclass.
        **given
            Values in place of the group's own, and those of fields that are no settings.

        Raises
        ------
        ConfigError
            Values that do not fit together.
        """
        own = {name: getattr(self, name) for name in declared(kind) if name in self._declarations}
        return kind(**{**own, **given})

    def values(self) -> dict[str, Any]:
        """Return all settings by name; those of a group within it as a mapping."""
        found = {name: getattr(self, name) for name in self._declarations}
        return {k: v.values() if isinstance(v, Settings) else v for k, v in found.items()}

    def _declaration(self, name: str) -> Declared | Mapping[str, Declared]:
        found: Declared | Mapping[str, Declared] | None = self._declarations.get(name)
        if found is None:
            raise SettingNameError(f"There is no setting {name!r}; {self._hint(name)}")
        return found

    def _hint(self, name: str) -> str:
        """Where a name belongs, or which it resembles."""
        groups = [key for key, item in self._declarations.items() if not isinstance(item, Declared)]
        for group in groups:
            inner = self._declarations[group]
            assert not isinstance(inner, Declared)
            if name in inner:
                owners = " and ".join(f"settings(rig).{key}" for key in groups)
                return f"it is one of {owners}, such as settings(rig).{group}.{name}."
        if name in PLACES:
            return f"it is an argument: {PLACES[name]}."
        near = difflib.get_close_matches(name, self._declarations, 3, 0.6)
        return f"did you mean {' or '.join(near)}?" if near else "docs/settings.md lists them."
