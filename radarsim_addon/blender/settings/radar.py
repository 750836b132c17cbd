# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user sets, kept in the scene as ``scene.radarsim``; GHz, MHz, us and ms at the edge.

Blender keeps these in float32; `read_measurement` turns them into the decimal numbers that were
typed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ...errors import ConfigError, OutputError
from ...signal.radar import AnyWaveform
from ..materials import refresh_materials
from ..nodes import PRESETS
from ..plan import MAX_RINGS, Measurement, shortest_decimal
from .link_budget import RadarAntennaSettings, SystemSettings
from .material import MATERIAL_PROPERTY, MaterialSettings
from .paths import PathSettings
from .waveform import WaveformSettings, read_radar

SCENE_PROPERTY = "radarsim"
PROGRESS_PROPERTY = "radarsim"


def _is_camera(_: Any, item: Any) -> bool:
    return bool(item.type == "CAMERA")


def _is_lamp(_: Any, item: Any) -> bool:
    return bool(item.type == "LIGHT")


def _carrier_changed(settings: Any, _: Any) -> None:
    # What cannot be evaluated there is told by the material's panel, and by the run.
    refresh_materials(shortest_decimal(settings.carrier_ghz, 9))


class RadarSettings(PathSettings, SystemSettings, WaveformSettings, bpy.types.PropertyGroup):
    """Settings of a measurement."""

    camera: bpy.props.PointerProperty(  # type: ignore[valid-type]
        name="Receiver",
        type=bpy.types.Object,
        poll=_is_camera,
        description="Camera that receives. Empty: that of the emitter's parent, else the scene's",
    )
    emitter: bpy.props.PointerProperty(  # type: ignore[valid-type]
        name="Emitter",
        type=bpy.types.Object,
        poll=_is_lamp,
        description="Point lamp with the Ring Emitter. Empty: the one there is",
    )
    preset: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Preset",
        items=tuple((name, preset.label, preset.description) for name, preset in PRESETS.items()),
        description="Material for the selected objects",
    )
    extinction: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Extinction Length",
        items=(
            ("LENGTH", "Length", "A length in metres, or one Blender unit"),
            ("WAVELENGTH", "Wavelength", "Makes the coefficient the physical one"),
        ),
        description=(
            "Normalising length of the Radar Material's extinction coefficient kappa: power falls "
            "as exp(-4 pi kappa d / length) with the depth d"
        ),
    )
    extinction_length_m: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Length [m]",
        default=0.0,
        min=0.0,
        precision=4,
        description="Normalising length in metres; 0: one Blender unit",
    )

    polarisation: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Polarisation",
        items=(
            ("AVERAGE", "Average", "Half the power in the plane of incidence, half across it"),
            ("VERTICAL", "Vertical", "Field in the vertical plane of the ray (world Z is up)"),
            ("HORIZONTAL", "Horizontal", "Field level"),
        ),
        description="Of waves that go through physical materials; it matters at an angle",
    )

    carrier_ghz: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Carrier [GHz]",
        default=5.3,
        min=1e-6,
        soft_max=300.0,
        precision=4,
        description="Carrier; sets wavelength, Doppler and the index of physical materials",
        update=_carrier_changed,
    )
    prf_hz: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="PRF [Hz]",
        default=1000.0,
        min=1e-3,
        precision=3,
        description="Pulses a second; unambiguous range is c / 2 PRF, largest velocity "
        "wavelength x PRF / 4",
    )
    pulses: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Pulses",
        default=128,
        min=1,
        soft_max=4096,
        description="Pulses of a burst; velocity resolution is wavelength x PRF / 2 pulses",
    )

    ring_mode: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Rings",
        items=(
            ("AUTO", "Automatic", "As many rings as the scene's farthest point needs"),
            ("COUNT", "Count", "A given number of rings"),
        ),
        description="How the number of rings is found",
    )
    ring_step_m: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Ring step [m]",
        default=250.0,
        soft_min=0.01,
        precision=3,
        description="Width of a ring in one-way range (Delta r of Eq. 5). One render each",
    )
    ring_count: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Rings",
        default=21,
        min=1,
        max=MAX_RINGS,
        description="Rings from range 0: ring n covers n x step to (n + 1) x step",
    )

    snapshots: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Passes",
        items=(
            ("1", "One", "At t alone: no Doppler"),
            ("2", "Two", "At t and at t + delta t, from which Doppler follows (Eq. 12)"),
        ),
        default="2",
        description="Renders of each ring",
    )
    snapshot_interval_ms: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Delta t [ms]",
        default=10.0,
        min=0.0,
        precision=3,
        description="Time between the passes. Below 2 ms float32 animation spoils the velocity",
    )
    max_bounces: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Bounces",
        default=0,
        min=0,
        max=1024,
        description="Reflections after the first one. 0: single reflections, as in the paper",
    )

    frame_mode: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Frames",
        items=(
            ("CURRENT", "Current", "The current frame alone"),
            ("SCENE", "Scene range", "The scene's frame range and step"),
            ("RANGE", "Range", "First, last and step as given here"),
        ),
        description="Blender frames that become radar frames",
    )
    frame_start: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="First", default=1, min=0, max=999_999, description="First frame"
    )
    frame_end: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Last", default=1, min=0, max=999_999, description="Last frame, included"
    )
    frame_step: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Step", default=1, min=1, description="Every n-th frame"
    )
    width_px: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Width", default=256, min=1, max=65536, subtype="PIXEL", description="Pixels across"
    )
    height_px: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Height", default=256, min=1, max=65536, subtype="PIXEL", description="Pixels up"
    )
    samples: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Samples",
        default=16,
        min=1,
        max=1 << 20,
        description="Paths a pixel. 1: exactly through the pixel's centre, one range a pixel. "
        "More: less noise, but pixels at edges mix ranges",
    )
    seed: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Seed", default=0, min=0, description="Of Cycles' random numbers, for all renders"
    )
    output_dir: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Output",
        default="//radar_run",
        subtype="DIR_PATH",
        # From 4.5 on Blender warns of // paths in properties that do not declare them.
        options={"PATH_SUPPORTS_BLEND_RELATIVE"}
        if bpy.app.version >= (4, 5, 0)
        else {"ANIMATABLE"},
        description="Folder of the run; // is the .blend file's folder. Made if its parent exists",
    )
    overwrite: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Overwrite",
        default=False,
        description="Remove the frames of another run from the output folder. Off: a run that was "
        "stopped goes on, another one is refused",
    )


class RadarProgress(bpy.types.PropertyGroup):
    """What the panel shows of a running job; lives in the window manager, in no file."""

    running: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Running", default=False, options={"SKIP_SAVE"}, description="A job is running"
    )
    fraction: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Progress",
        min=0.0,
        max=1.0,
        options={"SKIP_SAVE"},
        description="Share of the job that is done",
    )
    text: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Status", options={"SKIP_SAVE"}, description="State of the last job"
    )
    warnings: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Warnings",
        options={"SKIP_SAVE"},
        description="Warnings of the last job, one a line",
    )


def read_measurement(scene: Any, **overrides: Any) -> Measurement:
    """The scene's settings as a `Measurement`, without its power budget.

    Parameters
    ----------
    scene : bpy.types.Scene
    **overrides
        Numbers from a command line, by the names of `RadarSettings`, of float64 precision;
        ``frames`` is a tuple of frames, ``radar_file`` a radar file (JSON). None: the scene's own.

    Raises
    ------
    ConfigError
        Numbers that do not fit together.
    """
    settings = getattr(scene, SCENE_PROPERTY)
    given = {name: value for name, value in overrides.items() if value is not None}

    def number(name: str, exponent: int = 0) -> float:
        return exact_or_shortest_decimal(given.get(name), getattr(settings, name), exponent)

    def whole(name: str) -> int:
        return int(given.get(name, getattr(settings, name)))

    waveform, burst = read_radar(settings, given, number, whole)
    if given.get("ring_mode") == "AUTO":
        rings = 0
    elif "ring_count" in given:
        rings = whole("ring_count")
        if rings < 1:
            raise ConfigError(f"Number of rings is {rings}; expected a whole number from 1.")
    else:
        rings = settings.ring_count if settings.ring_mode == "COUNT" else 0
    return Measurement(
        waveform=waveform,
        burst=burst,
        frames=given["frames"] if "frames" in given else _frames(scene, settings),
        rings=rings,
        ring_step_m=number("ring_step_m"),
        snapshots=whole("snapshots"),
        snapshot_interval_s=number("snapshot_interval_ms", -3),
        width_px=whole("width_px"),
        height_px=whole("height_px"),
        samples=whole("samples"),
        seed=whole("seed"),
        max_bounces=whole("max_bounces"),
        extinction_length_m=_extinction_length_m(settings, waveform),
        polarisation=given.get("polarisation", settings.polarisation.lower()),
    )


def exact_or_shortest_decimal(given: float | None, stored: float, exponent: int) -> float:
    """A number in SI: from the command line as it is, from the panel as it was typed."""
    if given is None:
        return shortest_decimal(stored, exponent)
    # repr is the shortest decimal of a float64, so the shift of the decimal point is exact.
    return float(f"{given!r}e{exponent}") if "e" not in repr(given) else given * 10.0**exponent


def _frames(scene: Any, settings: Any) -> tuple[int, ...]:
    if settings.frame_mode == "CURRENT":
        return (scene.frame_current,)
    if settings.frame_mode == "SCENE":
        return tuple(range(scene.frame_start, scene.frame_end + 1, scene.frame_step))
    frames = range(settings.frame_start, settings.frame_end + 1, settings.frame_step)
    if not frames:
        raise ConfigError(
            f"Frames {settings.frame_start} to {settings.frame_end} are none; expected the last "
            "one not before the first one."
        )
    return tuple(frames)


def _extinction_length_m(settings: Any, waveform: AnyWaveform) -> float:
    if settings.extinction == "WAVELENGTH":
        return waveform.wavelength_m
    return shortest_decimal(settings.extinction_length_m)


def output_folder(scene: Any) -> Path:
    """The output folder as an absolute path.

    Raises
    ------
    OutputError
        None is set, or it is relative to a file that was never saved.
    """
    text = getattr(scene, SCENE_PROPERTY).output_dir
    if not text.strip():
        raise OutputError("No output folder is set. Choose one in Radar > Output.")
    if text.startswith("//") and not bpy.data.filepath:
        raise OutputError(
            f"The output folder {text!r} is relative to the .blend file, which was never saved. "
            "Save the file, or choose an absolute folder in Radar > Output."
        )
    return Path(bpy.path.abspath(text))


#: Settings by the Blender type they hang on.
_GROUPS = (
    (RadarSettings, bpy.types.Scene, SCENE_PROPERTY, "Radar"),
    (RadarProgress, bpy.types.WindowManager, PROGRESS_PROPERTY, "Radar progress"),
    (MaterialSettings, bpy.types.Material, MATERIAL_PROPERTY, "Radar material"),
)


def register() -> None:
    """Add ``radarsim`` to scenes, materials, window manager; a second call changes nothing."""
    if not RadarAntennaSettings.is_registered:
        bpy.utils.register_class(RadarAntennaSettings)
    for group, owner, name, label in _GROUPS:
        if not group.is_registered:
            bpy.utils.register_class(group)
            setattr(owner, name, bpy.props.PointerProperty(type=group, name=label))


def unregister() -> None:
    """Remove them."""
    for group, owner, name, _ in reversed(_GROUPS):
        if group.is_registered:
            delattr(owner, name)
            bpy.utils.unregister_class(group)
    if RadarAntennaSettings.is_registered:
        bpy.utils.unregister_class(RadarAntennaSettings)
