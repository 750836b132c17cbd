# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of a radar, which its rig holds as ``object.radarsim``.

They are made from the dataclasses that declare them. They belong to the object, so they are copied
with it and follow it into other scenes and files. The window shows numbers in its own units (GHz,
us); the file has them as float64 in SI, and `Settings` reads them there. Blender's own float
properties are float32, so they only show numbers and take input. `read_measurement` and the other
functions at the end make checked records of the settings. ``**given`` are values that replace the
radar's settings, by their names, in SI. ConfigError: values that do not fit together.
"""

from __future__ import annotations

import contextlib
import difflib
import functools
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import bpy

from ...contract import AntennaRecord, LinkBudget
from ...errors import ConfigError, OutputError, RadarSimError, SceneError, SettingNameError
from ...options import Declared, declared
from ...signal.radar import (
    PATTERNS,
    SINGLE_CHANNEL,
    WAVEFORM_KINDS,
    AnyWaveform,
    Burst,
    Channel,
    Weather,
    load_radar,
    make_system,
    read_system,
    self_contained,
)
from ..materials import refresh_materials
from ..plan import Measurement, PathOptions, RunSettings, merged, shortest_decimal
from ..scene import active_radar, is_transmitter

Record = TypeVar("Record")
Change = Callable[[Any], None]

#: From 4.5 on Blender warns of // paths in properties that do not declare them.
_RELATIVE = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5, 0) else {"ANIMATABLE"}
#: Where other names belong that are no settings; the interface for scripts adds them.
PLACES: dict[str, str] = {}
#: Least number that a field of the window takes, where a value must be above 0.
_LEAST_SHOWN = 1e-6


@dataclass(frozen=True)
class WindowField:
    """A field of the window in a unit that files, scripts and options do not use.

    The setting also has a property in SI, for scripts and animations.
    """

    name: str
    unit: str
    minimum: float
    #: From SI to the unit, and back.
    shown: Callable[[float], float]
    to_si: Callable[[float], float]


def watts_to_dbm(watts: float) -> float:
    """Return a power in dBm; 0 W gives -270 dBm."""
    return 10 * math.log10(max(watts, 1e-30)) + 30


def dbm_to_watts(dbm: float) -> float:
    """Return a power [W] from dBm, which Blender's fields have in float32."""
    return float(10 ** (shortest_decimal(dbm) / 10 - 3))


#: By the names of settings.
WINDOW_FIELDS = {
    "prf_hz": WindowField(
        "prf_khz", "kHz", 1e-6, lambda hertz: hertz / 1e3, lambda khz: shortest_decimal(khz, 3)
    ),
    "transmit_power_w": WindowField(
        "transmit_power_dbm", "dBm", -200.0, watts_to_dbm, dbm_to_watts
    ),
}


def field_of(item: Declared) -> tuple[str, str]:
    """Return the property by which the window shows a setting, and its unit; "" without one."""
    field = WINDOW_FIELDS.get(item.name)
    return (item.shown_name, item.shown_unit) if field is None else (field.name, field.unit)


def property_group(
    name: str,
    settings: Mapping[str, Declared],
    others: Mapping[str, Any] | None = None,
    changes: Mapping[str, Change] | None = None,
) -> type[Any]:
    """Return a class of bpy.types.PropertyGroup, which is not registered yet.

    `others` are more properties (pointers). `changes` are functions by the name of a setting, which
    are called with the group after the setting has changed.
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
        if item.name in WINDOW_FIELDS:
            field = WINDOW_FIELDS[item.name]
            annotations[field.name] = _window_property(item, field)
    annotations.update(others or {})
    members = {
        "__annotations__": annotations,
        "__doc__": "Settings, see the declarations of their dataclasses.",
        "changes": dict(changes or {}),
    }
    return type(name, (bpy.types.PropertyGroup,), members)


def _property(item: Declared, change: Change | None) -> Any:
    """Return a field of the window."""
    of = item.of
    common: dict[str, Any] = {
        "name": item.shown_label, "description": of.help, "translation_context": TEXT_CONTEXT,
    }  # fmt: skip
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


def _window_property(item: Declared, field: WindowField) -> Any:
    """Return the field of the window in another unit."""

    def put(group: Any, value: float) -> None:
        group[item.name] = field.to_si(value)

    return bpy.props.FloatProperty(
        name=item.shown_label.replace(f"[{item.shown_unit}]", f"[{field.unit}]"),
        description=item.of.help,
        get=lambda group: field.shown(float(group.get(item.name, item.initial))),
        set=put,
        min=field.minimum,
        precision=2,
    )


def read(group: Any, item: Declared) -> Any:
    """Return the value of a setting; numbers in SI and float64."""
    if item.optional and not getattr(group, f"use_{item.name}"):
        return None
    if item.kind is float:
        return float(group.get(item.name, item.initial))
    value = getattr(group, item.name)
    return item.kind(value) if item.of.choices else value


def write(group: Any, item: Declared, value: Any) -> None:
    """Set the value of a setting, which was checked. Callbacks run as after input in the window."""
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

    ``view.carrier_hz = 77e9`` reads back as 77e9. A group inside it takes a mapping,
    ``view.transmitter = {"kind": "gaussian"}``, and keeps its other settings. A value of the wrong
    type or out of bounds raises `ConfigError`, an unknown name `SettingNameError`. Declarations of
    groups inside it (antennas) are mappings under the name of the group.
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
        """Return an instance of a dataclass from which the group was made.

        `given` are values that replace those of the group, and values of fields that are no
        settings.
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
        """Return where a name belongs, or which name is similar."""
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


RADAR_PROPERTY = "radarsim"
#: Blender translates many words otherwise: power as an exponent, a waveform as a curve.
TEXT_CONTEXT = "Radar"
#: Kinds of waveforms with settings; samples of an arbitrary one come from a file.
WAVEFORMS = {name: kind for name, kind in WAVEFORM_KINDS.items() if name != "arbitrary"}
RADAR_SETTINGS = merged(
    RunSettings, Burst, *WAVEFORMS.values(), LinkBudget, Measurement, PathOptions, Weather
)
ANTENNA_SETTINGS = merged(AntennaRecord, *PATTERNS.values())
_ALL: dict[str, Declared | Mapping[str, Declared]] = {
    **RADAR_SETTINGS,
    "transmitter": ANTENNA_SETTINGS,
    "receiver": ANTENNA_SETTINGS,
}


def settings(radar: bpy.types.Object) -> Settings:
    """Return the settings of a radar by their names, in SI and float64.

    Parameters
    ----------
    radar : bpy.types.Object
        The rig.

    Returns
    -------
    Settings

    Raises
    ------
    ConfigError
        The properties are not registered.
    """
    if not hasattr(radar, RADAR_PROPERTY):
        raise ConfigError("Radars have no settings yet. Call radarsim_addon.register() first.")
    return Settings(getattr(radar, RADAR_PROPERTY), _ALL)


def carrier_hz(scene: bpy.types.Scene) -> float:
    """Return the carrier of a scene's active radar; the initial carrier without a radar."""
    try:
        view = settings(active_radar(scene))
    except SceneError:
        return float(RADAR_SETTINGS["carrier_hz"].initial)
    if view.waveform_kind == "file":
        with contextlib.suppress(OSError, ConfigError):
            path = Path(bpy.path.abspath(view.waveform_file))
            return _carrier_of_file(path, path.stat().st_mtime_ns)
    return float(view.carrier_hz)


@functools.lru_cache(maxsize=8)
def _carrier_of_file(path: Path, _: int) -> float:
    """Return the carrier of a waveform file, read again after a change."""
    return float(load_radar(path, Burst(1.0, 1)).waveform.carrier_hz)


def beyond_band(scene: bpy.types.Scene) -> str:
    """Return how media behave outside their band, by the active radar of a scene."""
    with contextlib.suppress(SceneError):
        return str(settings(active_radar(scene)).beyond_band)
    return "hold"


def _refresh_for_carrier(_: Any, __: Any = None) -> None:
    """Evaluate physical materials at the carrier of the active radar, and show them again."""
    # What cannot be evaluated there, lies beyond its band, or has no carrier yet (a waveform file
    # that was not chosen), is told by the panels and by the run.
    with contextlib.suppress(RadarSimError):
        refresh_materials(carrier_hz(bpy.context.scene), beyond_band(bpy.context.scene))
    manager = bpy.context.window_manager
    for window in () if manager is None else manager.windows:
        for area in window.screen.areas:
            area.tag_redraw()  # Blender does not draw the Material tab for a change in the sidebar


def _fm_rate(group: Any) -> float:
    numbers = Settings(group, RADAR_SETTINGS)
    return float(numbers.bandwidth_hz / numbers.chirp_duration_s * 1e-12)


def _set_fm_rate(group: Any, value: float) -> None:
    duration_us = RADAR_SETTINGS["chirp_duration_s"].to_shown(
        Settings(group, RADAR_SETTINGS).chirp_duration_s
    )
    # MHz/us times us round less than Hz/s times s.
    bandwidth_hz = round(shortest_decimal(value) * duration_us * 1e6, 3)
    write(group, RADAR_SETTINGS["bandwidth_hz"], bandwidth_hz)


#: Values of the three choices of quality.
_QUALITIES: tuple[dict[str, Any], ...] = (
    {"replicates": 2, "max_standard_error": 0.0, "time_limit_s": 0.0},
    {"replicates": 4, "max_standard_error": 0.0, "time_limit_s": 0.0},
    {"replicates": 4, "max_standard_error": 0.01},
)


def _quality(group: Any) -> int:
    numbers = Settings(group, RADAR_SETTINGS)
    return 2 if numbers.max_standard_error > 0 else int(numbers.replicates > 2)


def _set_quality(group: Any, number: int) -> None:
    if number != _quality(group):
        for name, value in _QUALITIES[number].items():
            write(group, RADAR_SETTINGS[name], value)


AntennaGroup = property_group("RadarAntennaSettings", ANTENNA_SETTINGS)
RadarGroup = property_group(
    "RadarSettings",
    RADAR_SETTINGS,
    {
        "camera": bpy.props.PointerProperty(
            name="Receiver",
            type=bpy.types.Object,
            poll=lambda _, item: item.type == "CAMERA",
            description="Choose the camera that receives. Empty: the one on the rig, else the "
            "scene's",
        ),
        "light": bpy.props.PointerProperty(
            name="Transmitter",
            type=bpy.types.Object,
            poll=lambda _, item: is_transmitter(item),
            description="Choose the Point light with the Ring Emitter. Empty: the one on the rig",
        ),
        "fm_rate_mhz_per_us": bpy.props.FloatProperty(
            name="FM Rate [MHz/us]",
            get=_fm_rate,
            set=_set_fm_rate,
            min=1e-6,
            precision=4,
            description="Set the bandwidth by the chirp rate K = B / T; 20 MHz/us are 20e12 Hz/s",
        ),
        "quality": bpy.props.EnumProperty(
            name="Quality",
            items=(
                ("draft", "Draft", "2 replicates of each tile, without refinement"),
                ("good", "Good", "4 replicates of each tile, without refinement"),
                ("error", "Error", "Refine tiles until the standard error is below a maximum"),
            ),
            get=_quality,
            set=_set_quality,
            translation_context=TEXT_CONTEXT,
            description="Set replicates and refinement; Advanced has the single settings",
        ),
        "transmitter": bpy.props.PointerProperty(
            type=AntennaGroup, name="Transmitter", description="Antenna of the transmitter"
        ),
        "receiver": bpy.props.PointerProperty(
            type=AntennaGroup, name="Receiver", description="Antenna of the receiver"
        ),
    },
    dict.fromkeys(
        ("carrier_hz", "waveform_kind", "waveform_file", "beyond_band"), _refresh_for_carrier
    ),
)


#: Property of lights: their power in dBm.
EIRP_PROPERTY = "radarsim_eirp_dbm"


def eirp_property() -> Any:
    """Return the property of a light that shows its power in dBm."""

    def put(light: Any, dbm: float) -> None:
        light.energy = dbm_to_watts(dbm)

    return bpy.props.FloatProperty(
        name="EIRP [dBm]",
        get=lambda light: watts_to_dbm(light.energy),
        set=put,
        min=-200.0,
        max=300.0,
        precision=2,
        description="Set what the transmitter radiates in all directions: the power of the light",
    )


def active_radar_property() -> Any:
    """Return the scene's property that names the active radar."""
    return bpy.props.PointerProperty(
        name="Radar",
        type=bpy.types.Object,
        poll=lambda scene, item: (
            item.name in scene.objects
            and any(is_transmitter(child) for child in (item, *item.children))
        ),
        update=_refresh_for_carrier,
        description="Choose the radar that measures. Empty: the only one",
    )


# What a radar's settings ask for, as checked records.


def read_measurement(scene: bpy.types.Scene, radar: Any = None, **given: Any) -> Measurement:
    """Return the measurement of a radar's settings, without its link budget.

    `radar` None is the active radar of the scene; SceneError without one, or if there are several
    and none is active. ``frames`` among the given values is a tuple of frames.
    """
    view = settings(active_radar(scene) if radar is None else radar)
    burst = view.record(Burst, **_of(Burst, given))
    waveform, burst, channels = _radar(view, given, burst)
    numbers: dict[str, Any] = (
        {"extinction_length_m": waveform.wavelength_m}
        if given.get("extinction", view.extinction) == "wavelength"
        else {}
    )
    numbers |= _of(Measurement, given)
    numbers["frames"] = given.get("frames") or _frames(scene, view)
    numbers["weather"] = view.record(Weather, **_of(Weather, given))
    return view.record(Measurement, waveform=waveform, burst=burst, channels=channels, **numbers)


def _of(kind: type[Any], given: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in given.items() if name in declared(kind)}


def _radar(
    view: Settings, given: dict[str, Any], burst: Burst
) -> tuple[AnyWaveform, Burst, tuple[Channel, ...]]:
    kind = "file" if "waveform_file" in given else given.get("waveform_kind", view.waveform_kind)
    numbers = {
        name: value
        for name, value in given.items()
        if any(name in declared(other) for other in WAVEFORMS.values())
    }
    strange = [name for name in numbers if kind == "file" or name not in declared(WAVEFORMS[kind])]
    if strange:
        flags = ", ".join(RADAR_SETTINGS[name].flag for name in strange)
        raise ConfigError(
            f"{flags} given, which a waveform of kind {kind!r} does not have. Leave it out, or "
            "choose another waveform."
        )
    if kind != "file":
        return view.record(WAVEFORMS[kind], **numbers), burst, (SINGLE_CHANNEL,)
    file = str(given.get("waveform_file") or view.waveform_file)
    if not file.strip():
        raise ConfigError("No waveform file is chosen. Choose one in Radar > Waveform.")
    found = load_radar(Path(bpy.path.abspath(file)), burst)
    return found.waveform, found.burst, found.channels


def _frames(scene: bpy.types.Scene, view: Settings) -> tuple[int, ...]:
    if view.frame_mode == "current":
        return (scene.frame_current,)
    if view.frame_mode == "scene":
        return tuple(range(scene.frame_start, scene.frame_end + 1, scene.frame_step))
    frames = range(view.frame_start, view.frame_end + 1, view.frame_step)
    if not frames:
        raise ConfigError(
            f"Frames {view.frame_start} to {view.frame_end} are none; expected the last one not "
            "before the first one."
        )
    return tuple(frames)


def read_path_options(radar: bpy.types.Object, **given: Any) -> PathOptions:
    """Return how paths are followed."""
    return settings(radar).record(PathOptions, **_of(PathOptions, given))


def _antenna_record(view: Settings) -> AntennaRecord:
    """Return the settings of one antenna as a record, with its tables."""
    parameters = {
        name: bpy.path.abspath(value) if name == "file" else value
        for name in declared(PATTERNS[view.kind])
        if (value := getattr(view, name)) is not None or name == "element_exponent"
    }
    return self_contained(AntennaRecord(view.kind, parameters))


def read_link_budget(
    radar: Any, wavelength_m: float, file: str | Path | None = None
) -> LinkBudget | None:
    """Return a radar's link budget, or that of a file (JSON), checked; None without one.

    Raises ConfigError for values out of bounds, or a table or file that cannot be read.
    """
    record = own_link_budget(radar) if file is None else read_system(file)
    if record is not None:
        make_system(record, wavelength_m)  # checks it
    return record


def own_link_budget(radar: bpy.types.Object) -> LinkBudget | None:
    """Return the link budget of a radar's settings, antennas unchecked; None without one."""
    view = settings(radar)
    if not view.use_link_budget:
        return None
    names = ("transmitter", "receiver")
    antennas = {name: _antenna_record(getattr(view, name)) for name in names}
    return view.record(LinkBudget, **antennas)


def output_folder(radar: bpy.types.Object) -> Path:
    """Return the output folder as an absolute path; it may not exist.

    Raises OutputError if none is set, or it is relative to a file that was never saved.
    """
    text = settings(radar).output_folder
    if not text.strip():
        raise OutputError("No output folder is set. Choose one in Radar > Measure > Output.")
    if text.startswith("//") and not bpy.data.filepath:
        raise OutputError(
            f"The output folder {text!r} is relative to the .blend file, which was never saved. "
            "Save the file, or choose an absolute folder in Radar > Measure > Output."
        )
    return Path(bpy.path.abspath(text))
