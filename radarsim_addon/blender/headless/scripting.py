# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface for scripts: a radar, materials, a measurement, its results.

::

    from radarsim_addon import blender as radarsim

    rig = radarsim.add_radar(location=(0, 0, 1.5), look_at=(0, 50, 1), preset="automotive_77ghz")
    radarsim.settings(rig).pulses = 64
    radarsim.assign_material(objects, radarsim.material("itu_concrete"))
    run = radarsim.measure(rig, "run", frames=[1])
    (result,) = radarsim.process(run)

In the extension the first line is ``from bl_ext.user_default.radarsim import blender as radarsim``.
"""

from __future__ import annotations

import atexit
import contextlib
import dataclasses
import difflib
import math
import operator
import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import bpy
from mathutils import Vector

from ...errors import ConfigError, SceneError
from ...options import declared
from ...signal.pipeline import FrameResult, ProcessOptions, process_run
from ...signal.runs import Run, open_run
from ..materials import (  # noqa: F401
    make_physical_material,
    set_clutter,
    set_clutter_fluctuation,
    set_mirror,
    set_scattered_lobe,
)
from ..materials.physical_materials import READY
from ..nodes import assign_to, make_material, preset_material
from ..plan import DEFAULT_PRESET, PathOptions, radar_preset
from ..rig_settings import (
    PLACES,
    RADAR_PROPERTY,
    Settings,
    apply_preset,
    carrier_hz,
    register,
    set_values,
    unregister,
)
from ..rig_settings import settings as settings_of
from ..scene import (
    antennas_of,
    bare_objects,
    find_rig,
    radars,
    replace_material,
    setup_rig,
    suggest_materials,
)
from ..state import evaluated_snapshot
from .console import quiet_blender
from .scene_picture import show  # noqa: F401
from .session import make_job


def ensure_registered() -> None:
    """Register the settings of radars and materials, unless the extension has done so."""
    if not hasattr(bpy.types.Object, RADAR_PROPERTY):
        register()
        # Blender 4.5 as a module hangs at exit with properties that have functions of Python.
        atexit.register(unregister)


def material(
    medium: str | None = None,
    *,
    name: str | None = None,
    n: float | None = None,
    kappa: float = 0.0,
    rms_height_m: float = 0.0,
    correlation_length_m: float = 0.0,
    rms_slope: float = 0.0,
    sheet_thickness_m: float = 0.0,
    penetrable: bool | None = None,
    **parameters: Any,
) -> Any:
    """Make a physical radar material from a medium of the library or from a complex index.

    The medium is evaluated at the carrier of the active radar of the current scene, without one at
    that of the paper's radar. A measurement evaluates it again, at its own carrier, so a carrier
    that is changed later, or given to :func:`measure`, needs no new material. An index given by `n`
    and `kappa` is the same at every carrier.

    Parameters
    ----------
    medium
        Name of a medium, such as "concrete" or "itu_concrete"; its index follows the carrier.
    name
        Name of the material in Blender; None: that of the medium.
    n, kappa
        Complex index of refraction n + j kappa, in place of a medium; kappa is 0 or positive.
    rms_height_m, correlation_length_m, rms_slope
        Roughness of the surface [m, m, 1]; all 0: smooth.
    sheet_thickness_m
        More than 0: a thin pane, one face with interference [m].
    penetrable
        Whether waves enter objects of the material, which must then be closed meshes. False: the
        surface alone reflects. None: they enter, unless the medium is a conductor at the carrier
        with which the material is made.
    **parameters
        Parameters of the medium, such as ``temperature_c``.

    Returns
    -------
    bpy.types.Material

    Raises
    ------
    ConfigError
        Neither or both of medium and n, an unknown medium or parameter, a number out of bounds.
    """
    for key in parameters:
        if near := difflib.get_close_matches(key, material.__kwdefaults__ or (), 1, 0.8):
            raise ConfigError(f"material has no argument {key!r}; did you mean {near[0]}?")
    if (medium is None) == (n is None):
        raise ConfigError("A material needs a medium or n (with kappa), and not both.")
    if medium is None:
        medium, parameters = "index", {"n": n, "k": kappa, **parameters}
    elif not isinstance(medium, str):
        raise ConfigError(
            f"Medium is {medium!r}; expected a name, such as 'concrete'. Give an index as n=2.5."
        )
    elif kappa:
        raise ConfigError(
            f"kappa is {kappa!r}, but the medium {medium!r} has its own. Leave out kappa, or give "
            "n in place of the medium."
        )
    known = medium.removeprefix("itu_")  # of Recommendation ITU-R P.2040
    ensure_registered()
    return make_physical_material(
        name or f"Radar {known.replace('_', ' ')}",
        known,
        carrier_hz=carrier_hz(bpy.context.scene),
        rms_height_m=rms_height_m,
        correlation_length_m=correlation_length_m,
        rms_slope=rms_slope,
        sheet_thickness_m=sheet_thickness_m,
        penetrable=penetrable,
        **parameters,
    )


def simple_material(
    preset: str | None = None,
    *,
    name: str | None = None,
    n: float | None = None,
    kappa: float = 0.0,
    specularity: float = 0.5,
    roughness: float = 0.5,
    penetrable: bool | None = None,
) -> Any:
    """Make a simple radar material: the node group Radar Material with four inputs.

    Its index does not follow the carrier, and its roughness is no length.

    Parameters
    ----------
    preset
        Name of a ready material: "metal", "paper_object", "concrete", "ground", "wood" or "glass".
        The file's own is returned where it is unchanged.
    name
        Name of the material in Blender; None: "Radar Material".
    n, kappa
        Index n (from 1) and normalised extinction (from 0), in place of a preset.
    specularity
        Fraction of the reflected power in the specular lobe, 0 to 1.
    roughness
        Width of the specular lobe, 0 to 1, as in Blender.
    penetrable
        Whether waves enter objects of the material. None: they do, unless it is a conductor.

    Returns
    -------
    bpy.types.Material

    Raises
    ------
    ConfigError
        Neither or both of preset and n, an unknown preset, or a number out of bounds.
    """
    if (preset is None) == (n is None):
        raise ConfigError("A simple material needs a preset or n (with kappa), and not both.")
    ensure_registered()
    if n is not None:
        label = name or "Radar Material"
        return make_material(label, n, kappa, specularity, roughness, penetrable=penetrable)
    if (name, kappa, specularity, roughness, penetrable) != (None, 0.0, 0.5, 0.5, None):
        raise ConfigError("A preset has all numbers. Give n and the others in place of the preset.")
    return preset_material(str(preset))


def assign_material(objects: Any, material: bpy.types.Material) -> list[Any]:
    """Give objects a material, in all their material slots.

    Parameters
    ----------
    objects : bpy.types.Object or iterable of them
        Objects that cannot carry a material are passed over.
    material : bpy.types.Material

    Returns
    -------
    list of bpy.types.Object : those that have the material now

    Raises
    ------
    SceneError
        None of the objects can carry a material.
    """
    if not isinstance(material, bpy.types.Material):
        raise SceneError(f"{material!r} is no material; expected what radarsim.material returns.")
    chosen = [objects] if isinstance(objects, bpy.types.Object) else objects
    if isinstance(chosen, str) or not isinstance(chosen, Iterable):
        raise SceneError(f"{objects!r} is no object; expected objects of the scene.")
    return assign_to(chosen, material)


def assign_by_name(
    scene: bpy.types.Scene | None = None, *, default: str | None = None
) -> dict[str, str]:
    """Put radar materials in the place of the optical ones whose names are known.

    Parameters
    ----------
    scene : bpy.types.Scene, optional
        None: the current one.
    default
        Radar material for the optical ones whose names are not known, and for objects without any,
        such as "Plastic"; None: these are as they were.

    Returns
    -------
    dict of str
        Radar material by optical material; "" stands for objects without a material.

    Raises
    ------
    ConfigError
        There is no radar material of the name `default`.
    """
    if default is not None and default not in READY:
        raise ConfigError(f"Default is {default!r}; expected one of {', '.join(sorted(READY))}.")
    ensure_registered()
    scene = bpy.context.scene if scene is None else scene
    layer = scene.view_layers[0]
    taken = {}
    for material, known in suggest_materials(evaluated_snapshot(layer)).items():
        ready = known or default
        if ready:
            replace_material(material, ready, carrier_hz(scene), evaluated_snapshot(layer))
            taken[material.name] = ready
    bare = bare_objects(evaluated_snapshot(layer)) if default else []
    if default and bare:
        made = READY[default].material(default, carrier_hz(scene), penetrable=False)
        assign_to(bare, made)
        taken[""] = default
    return taken


def add_radar(
    location: Sequence[float] = (0.0, 0.0, 0.0),
    look_at: Sequence[float] | None = None,
    *,
    field_of_view_deg: float | None = None,
    preset: str = DEFAULT_PRESET,
    scene: bpy.types.Scene | None = None,
    **values: Any,
) -> Any:
    """Add a radar to a scene: an empty that carries a transmitter and a receiver.

    Parameters
    ----------
    location : (3,)
        Position of the radar [Blender units].
    look_at : (3,), optional
        Point that the boresight goes through [Blender units]; None: level, along the world's +Y.
    field_of_view_deg
        Full angle of the receiver's longer side [degrees]; None: that of the preset.
    preset
        Radar to begin with, such as "automotive_77ghz" or "paper"; docs/headless.md lists them.
    scene : bpy.types.Scene, optional
        None: the current one.
    **values
        Settings by their names, in SI, after those of the preset; see :func:`settings`.

    Returns
    -------
    bpy.types.Object
        The empty. It can be moved, animated, parented and linked into other files.

    Raises
    ------
    ConfigError
        An unknown preset or setting, a value out of bounds, or a point to look at that is the
        location itself.
    """
    ensure_registered()
    scene = bpy.context.scene if scene is None else scene
    target = None if look_at is None else _point("Point to look at", look_at)
    rig = setup_rig(scene, _point("Location", location))
    try:
        apply_preset(scene, rig, radar_preset(preset))
        set_values(settings(rig), values)
        if field_of_view_deg is not None:
            if not 0 < field_of_view_deg < 180:
                raise ConfigError(
                    f"Field of view is {field_of_view_deg!r} degrees; expected more than 0 and "
                    "less than 180."
                )
            found = find_rig(scene, **antennas_of(scene, rig), any_projection=True)
            found.camera.data.angle = math.radians(field_of_view_deg)
        if target is not None:
            _look(rig, target)
    except BaseException:
        made = [part for item in (*rig.children, rig) for part in (item, item.data)]
        bpy.data.batch_remove([part for part in made if part is not None])  # its camera, its light
        raise
    return rig


def _look(rig: bpy.types.Object, target: Sequence[float]) -> None:
    direction = Vector(target) - rig.location
    if direction.length == 0:
        raise ConfigError(
            f"The radar is at {tuple(rig.location)} and looks at the same point; expected another."
        )
    # A camera looks along its -Z with +Y up: the empty does, too.
    rig.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()


class Antennas(NamedTuple):
    """Objects of a radar's antennas.

    Attributes
    ----------
    receiver : bpy.types.Object
        Camera. It looks along its -Z, its +Y is up.
    transmitter : bpy.types.Object
        Point light. Its pattern has the same axes.
    """

    receiver: Any
    transmitter: Any


def antennas(rig: bpy.types.Object) -> Antennas:
    """Return the antennas of a radar, for example to place them apart from one another.

    Parameters
    ----------
    rig : bpy.types.Object
        The radar.

    Returns
    -------
    Antennas
        Receiver and transmitter. Both are children of the radar: their locations and rotations are
        in its axes, where -Z is boresight, +X right and +Y up.

    Raises
    ------
    SceneError
        The object is no radar, or an antenna is missing.
    """
    settings(rig)  # refuses other objects
    scene = next(scene for scene in bpy.data.scenes if rig.name in scene.objects)
    found = find_rig(scene, **antennas_of(scene, rig), any_projection=True)
    return Antennas(found.camera, found.emitter)


def settings(rig: bpy.types.Object) -> Settings:
    """Return the settings of a radar by their names, in SI and float64.

    Parameters
    ----------
    rig : bpy.types.Object
        What :func:`add_radar` returned.

    Returns
    -------
    Settings
        ``settings(rig).carrier_hz = 77e9`` sets a value and checks it; 77e9 reads back as 77e9.
        docs/settings.md lists all names.

    Raises
    ------
    SceneError
        The object is no radar.
    """
    ensure_registered()
    known = isinstance(rig, bpy.types.Object) and (
        # a radar whose light stands elsewhere names it
        rig.radarsim.light is not None or any(rig in radars(scene) for scene in bpy.data.scenes)
    )
    if not known:
        name = getattr(rig, "name", rig)
        raise SceneError(f"{name!r} is no radar; expected the object that add_radar returned.")
    return settings_of(rig)


#: Functions and classes whose arguments are not settings of a radar, with those arguments.
_ARGUMENTS = {
    "add_radar": ("location", "look_at", "field_of_view_deg", "preset"),
    "measure": ("folder", "frames", "overwrite"),
    "material": (
        "medium", "n", "kappa", "rms_height_m", "correlation_length_m", "rms_slope",
        "sheet_thickness_m", "penetrable",
    ),
    "simple_material": ("specularity", "roughness"),
    "signal.ProcessOptions": tuple(item.name for item in dataclasses.fields(ProcessOptions)),
}  # fmt: skip
PLACES.update(
    {name: f"{function}({name}=...)" for function, names in _ARGUMENTS.items() for name in names}
)


def measure(
    rig: Any,
    folder: str | Path,
    *,
    frames: Iterable[int] | None = None,
    overwrite: bool = False,
    progress: Callable[[float], None] | None = None,
    scene: bpy.types.Scene | None = None,
    **values: Any,
) -> Run:
    """Render the radar frames into a run folder; no window is needed.

    Parameters
    ----------
    rig : bpy.types.Object
        The radar.
    folder
        Folder of the run; made if its parent exists. The earlier run of this file and scene in it
        is replaced.
    frames
        Blender frames; None: those of the radar's settings.
    overwrite
        Replace also the run of another file or scene.
    progress
        Called with the fraction that is done, 0 to 1, after each render.
    scene : bpy.types.Scene, optional
        None: the current one.
    **values
        Settings in place of the radar's own for this run, in SI (docs/settings.md lists them).

    Returns
    -------
    radarsim_addon.signal.Run
        What :func:`radarsim_addon.signal.open_run` returns.

    Raises
    ------
    RadarSimError
        A named kind of it. The scene and its settings are as they were.

    Warns
    -----
    UserWarning
        For each error or caution among the findings.
    """
    view, scene = settings(rig), bpy.context.scene if scene is None else scene
    if frames is not None:
        values["frames"] = _frame_numbers(frames)
    for name in values.keys() - declared(PathOptions).keys() - {"frames"}:
        getattr(view, name)  # an unknown name is refused before anything is written
    layer = bpy.context.view_layer if scene == bpy.context.scene else scene.view_layers[0]
    path = Path(folder).absolute()
    with quiet_blender() as stream:
        job = make_job(scene, layer, path, radar=rig, overwrite=overwrite, given=values)
        with job:
            for task in job.pending():
                job.start(task)
                job.render(task)
                job.finish(task)
                if progress is not None:
                    with contextlib.redirect_stdout(stream):  # `print` is seen
                        progress(job.fraction)
                    stream.flush()
    if progress is not None:  # the last tile counts as done when no further one is asked for
        progress(1.0)
    for item in job.findings:
        if item.severity != "info":
            warnings.warn(f"{item.code}: {item.message}", stacklevel=2)
    return open_run(path)


def process(
    run: Run | str | Path,
    options: ProcessOptions | None = None,
    *,
    out: str | Path | None = None,
    frames: Sequence[int] | None = None,
) -> list[FrameResult]:
    """Process a run: echoes, profiles, maps, findings, and files where asked for.

    Parameters
    ----------
    run
        The run, or its folder.
    options
        How; None: the defaults.
    out
        Folder of the files; None: ``products`` in the run's folder.
    frames
        Radar frames; None: all.

    Returns
    -------
    list of radarsim_addon.signal.FrameResult
        One for each frame. For many frames use :func:`radarsim_addon.signal.process_run`, which
        yields them one after the other.

    Raises
    ------
    RadarSimError
        One of its named kinds.
    """
    path = run.path if isinstance(run, Run) else run
    events = process_run(path, options, out=out, frames=frames)
    return [event for event in events if isinstance(event, FrameResult)]


def _frame_numbers(frames: Iterable[int]) -> tuple[int, ...]:
    try:
        numbers = tuple(operator.index(frame) for frame in frames)
    except TypeError:
        numbers = ()
    if not numbers:
        raise ConfigError(f"Frames are {frames!r}; expected whole numbers, such as [1, 2].")
    return numbers


def _point(name: str, values: Sequence[float]) -> tuple[float, float, float]:
    try:
        x, y, z = (float(value) for value in values)
    except (TypeError, ValueError):
        x = y = z = math.nan
    if not all(map(math.isfinite, (x, y, z))):
        raise ConfigError(f"{name} is {values!r}; expected three finite numbers.")
    return x, y, z
