# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the user's scene that a measurement needs: set for a run and restored after it.

`MeasurementSettings` sets render, Cycles, image format, view layers, antennas, materials and scene
attributes. If one of these settings is wrong, results are wrong without an error: the comments say
why. Threads and geometry stay as the user has them; so does the device, if its check passes.

A measurement relies on behaviour of Cycles that was measured on the CPU. A GPU is checked once for
each version of Blender and radarsim. The check runs in a process of its own (`headless.selfcheck`),
so that a kernel that crashes or hangs does not affect the window. The verdict is kept in the user's
cache folder.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ... import __version__, errors
from ...atomic_files import make_folder, write_json
from ...errors import RadarSimError, SceneError
from ...findings import Finding, finding
from ..materials import (
    EXACT_FACETS,
    Interiors,
    assigned_materials,
    average_in_a_row,
    averaging_objects,
    beyond_float32,
    doubled_panes,
    interior_losses_db,
    media_beyond_their_band,
    overlapping_shells,
    set_clutter_tables,
    set_layer_normals,
    settle_interiors,
    settle_interiors_far_away,
    straight_interiors,
    total_reflections,
    update_materials,
)
from ..nodes import attributes
from ..nodes.materials import VOLUME_STEP_RATE, is_radar_material
from ..plan import POLARISATIONS, Plan
from ..scene import (
    NEAR_CLIP_UNITS,
    Rig,
    check_meshes,
    check_normals,
    check_sizes,
    displaced_surfaces,
    isolate,
    limited_visibility,
    rendered_surfaces,
    sharpen_walls,
    show_what_ever_renders,
)
from ..state import SettingsRestorer, evaluated_snapshot


class MeasurementSettings:
    """Sets a scene for a measurement (`apply`), and restores the user's settings (`restore`).

    `any_material`: materials other than the Radar Material echo, too; a world volume has the range
    encoding. `view_camera` is the `ViewCamera` that renders; None: the receiver renders.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        view_layer: bpy.types.ViewLayer,
        rig: Rig,
        plan: Plan,
        any_material: bool = False,
        view_camera: Any = None,
    ) -> None:
        self._scene = scene
        self._renders = rig.camera if view_camera is None else view_camera.item
        self._view_layer = view_layer
        self._rig = rig
        self._plan = plan
        self._any_material = any_material
        self._recorder = SettingsRestorer()
        self.findings: list[Finding] = []
        #: Objects that waves pass with the mean of both polarisations, and their index.
        self.averaging: dict[str, complex] = {}
        #: Whether they may be passed one after the other.
        self.averages_in_a_row = False
        #: How the interiors of objects are computed.
        self.interiors = Interiors()
        self.device_kind = "CPU"

    def apply(self) -> None:
        """Set everything; on failure restore all settings, then raise the error.

        SceneError: Cycles is not available, and nothing is changed.
        """
        if not hasattr(self._scene, "cycles"):
            raise SceneError(
                "Cycles is not enabled in this Blender; the radar is rendered with it. "
                "Enable Edit > Preferences > Add-ons > Cycles Render Engine."
            )
        try:
            self._recorder.keep_frame(self._scene)
            # The camera and what is visible decide which objects Blender evaluates. Other settings
            # have it evaluate all again: once, with the materials.
            self._recorder.set(self._scene, "camera", self._renders)
            # Materials are settled once: also of what is hidden in the viewport or until later.
            show_what_ever_renders(self._recorder, self._view_layer)
            used = assigned_materials(evaluated_snapshot(self._view_layer))
            assigned = {m for one in used for m in one.materials if m is not None}
            unfit = self._set_device()
            self._set_render()
            self._set_cycles()
            self._set_image_format()
            self._set_view_layers()
            self._set_antennas()
            self._set_code()
            self.findings = [*unfit, *self._camera_markers(), *self._set_materials(assigned)]
            snapshot = evaluated_snapshot(self._view_layer)
            self.findings += check_sizes(rendered_surfaces(snapshot), self._plan.metres_per_unit)
            self.findings += isolate(
                self._recorder, self._scene, self._rig.emitter, snapshot, self._any_material
            )
            snapshot = evaluated_snapshot(self._view_layer)
            self.findings += [*displaced_surfaces(snapshot), *limited_visibility(snapshot)]
        except BaseException:
            self.restore()
            raise

    def restore(self) -> list[str]:
        """Restore the user's scene. Return what could not be restored. May be called again."""
        return self._recorder.restore()

    def set_ring(self, ring_min_m: float, ring_max_m: float) -> None:
        """Limit the transmitter's light to ``ring_min_m <= r < ring_max_m`` (Eq. 5)."""
        # Neighbouring rings divide the same number of metres, so their shared edge is the same
        # float32 in both and no path is lost or counted twice.
        self._scene[attributes.ATTR_RING_MIN] = ring_min_m / self._plan.metres_per_unit
        self._scene[attributes.ATTR_RING_MAX] = ring_max_m / self._plan.metres_per_unit
        # Writing a custom property from Python does not tell Cycles; an update tag does. One of
        # everything would empty the cache of rigid bodies.
        self._scene.update_tag(refresh={"TIME"})

    # -- the groups of settings --------------------------------------------------------------------

    def _set_render(self) -> None:
        render, put = self._scene.render, self._recorder.set
        measurement = self._plan.measurement
        if render.engine != "CYCLES":
            # To set it, even to the same, blocks Blender for good while Cycles draws an icon: both
            # wait for Python.
            put(render, "engine", "CYCLES")
        put(render, "resolution_x", measurement.width_px)
        put(render, "resolution_y", measurement.height_px)
        put(render, "resolution_percentage", 100)
        # Other aspects would stretch the angles between pixels (and 5.0 cannot write them).
        put(render, "pixel_aspect_x", 1.0)
        put(render, "pixel_aspect_y", 1.0)
        border = ("border_min_x", "border_max_x", "border_min_y", "border_max_y")
        self._recorder.keep(render, "use_border", "use_crop_to_border", *border)
        render.use_border = render.use_crop_to_border = False
        put(render, "use_motion_blur", False)
        put(render, "use_multiview", False)
        put(render, "use_freestyle", False)
        put(render, "film_transparent", False)
        put(render, "dither_intensity", 0.0)
        # These would post-process the frame.
        put(render, "use_compositing", False)
        put(render, "use_sequencer", False)
        put(render, "use_single_layer", False)
        put(render, "use_stamp", False)
        # The scene stays in Cycles between rings: milliseconds instead of a new build each time.
        put(render, "use_persistent_data", True)
        for name in render.bl_rna.properties.keys():
            # Date, host and paths do not belong into every EXR file.
            if name.startswith("use_stamp_") and name != "use_stamp_labels":
                put(render, name, False)

    def _set_device(self) -> list[Finding]:
        """Use the CPU if the check of the chosen device failed."""
        device, failed = failed_facts(self._scene)
        self.device_kind = "CPU" if failed else device.kind
        if not failed:
            return []
        self._recorder.set(self._scene.cycles, "device", "CPU")
        return [finding("device-unfit", *failed, device=device.kind)]

    def _set_cycles(self) -> None:
        put, put_some = self._recorder.set, self._recorder.set_if_present
        cycles, measurement = self._scene.cycles, self._plan.measurement
        put(cycles, "samples", measurement.samples)
        put(cycles, "seed", measurement.seed)
        put(cycles, "use_animated_seed", False)  # both snapshots must sample the same paths
        put_some(cycles, "sample_offset", 0)
        put_some(cycles, "use_sample_subset", False)
        put(cycles, "use_layer_samples", "IGNORE")
        put(cycles, "time_limit", 0.0)
        put(cycles, "sampling_pattern", "TABULATED_SOBOL")  # AUTOMATIC changes paths with samples
        put(cycles, "scrambling_distance", 1.0)
        put(cycles, "auto_scrambling_distance", False)
        put(cycles, "use_denoising", False)  # some builds raise with it on
        put(cycles, "use_adaptive_sampling", False)
        put_some(cycles, "use_guiding", False)
        # Russian roulette makes amplitudes of single pixels random by tens of percent.
        put(cycles, "min_light_bounces", 1024)
        put(cycles, "min_transparent_bounces", 1024)
        put(cycles, "light_sampling_threshold", 0.0)  # weak echoes would be dropped at random
        put(cycles, "sample_clamp_direct", 0.0)  # strong echoes would be cut
        put(cycles, "sample_clamp_indirect", 0.0)
        put(cycles, "blur_glossy", 0.0)
        put(cycles, "caustics_reflective", True)
        put(cycles, "caustics_refractive", True)
        put(cycles, "use_fast_gi", False)
        for name in ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces"):
            put(cycles, name, measurement.max_reflections - 1)
        put(cycles, "volume_bounces", 0)
        put(cycles, "transparent_max_bounces", 1024)  # surfaces in line; transparent ones count
        put(cycles, "use_light_tree", False)
        put(cycles, "film_exposure", 1.0)
        put(cycles, "film_transparent_glass", False)
        put(cycles, "rolling_shutter_type", "NONE")
        put(cycles, "use_auto_tile", False)
        # 5.x tracks densities that depend on position or direction at random unless told not to.
        put_some(cycles, "volume_biased", True)
        # It moves the grid of pixels by another amount in each render.
        put_some(cycles, "use_pixel_jitter", False)
        if measurement.samples == 1:
            # One path through the pixel's centre.
            put(cycles, "pixel_filter_type", "BLACKMAN_HARRIS")
            put(cycles, "filter_width", 0.01)
        else:
            put(cycles, "pixel_filter_type", "BOX")
            put(cycles, "filter_width", 1.0)
        # Culling takes objects out of the scene by what the camera sees of them.
        put(cycles, "use_camera_cull", False)
        put(cycles, "use_distance_cull", False)

    def _set_image_format(self) -> None:
        image, put = self._scene.render.image_settings, self._recorder.set
        # The media type (from 5.0 on) limits the formats, the format depth and codec; and each
        # resets others, such as colour space and stereo views.
        self._recorder.keep_all(image)
        if hasattr(image, "media_type"):
            image.media_type = "IMAGE"
        image.file_format = "OPEN_EXR"
        image.color_mode = "RGB"
        image.color_depth = "32"
        image.exr_codec = "ZIP"
        put(image, "use_preview", False)
        put(image, "color_management", "FOLLOW_SCENE")

    def _set_view_layers(self) -> None:
        put, put_some = self._recorder.set, self._recorder.set_if_present
        for layer in self._scene.view_layers:
            put(layer, "use", layer == self._view_layer)
        layer = self._view_layer
        put(layer, "samples", 0)
        put(layer, "material_override", None)
        put_some(layer, "world_override", None)
        put(layer, "use_pass_combined", True)
        for name in ("use_solid", "use_strand", "use_volumes"):
            put_some(layer, name, True)
        put_some(layer, "use_motion_blur", False)
        if hasattr(layer, "cycles"):
            put_some(layer.cycles, "use_denoising", False)
        put(self._scene, "world", None)  # black

    def _set_antennas(self) -> None:
        put, put_some = self._recorder.set, self._recorder.set_if_present
        camera, emitter = self._rig.camera, self._rig.emitter
        put(camera.data, "clip_start", NEAR_CLIP_UNITS)
        put(camera.data, "clip_end", 1e12)
        put(camera.data.dof, "use_dof", False)
        put(emitter, "hide_render", False)
        for kind in ("diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
            put(emitter, f"visible_{kind}", True)
        light = emitter.data
        put(light, "shadow_soft_size", 0.0)
        put(light, "use_shadow", True)
        put(light, "color", (1.0, 1.0, 1.0))  # colour would enter R/B as range
        put_some(light, "use_temperature", False)
        put_some(light, "normalize", True)
        put_some(light, "use_soft_falloff", False)
        put(light.cycles, "max_bounces", 1024)
        put(light.cycles, "is_portal", False)
        put(light.cycles, "is_caustics_light", False)
        linking = getattr(emitter, "light_linking", None)
        if linking is not None:
            put(linking, "receiver_collection", None)
            put(linking, "blocker_collection", None)

    def _camera_markers(self) -> list[Finding]:
        """Remove cameras from markers: Blender would render with them and not the receiver."""
        markers = [one for one in self._scene.timeline_markers if one.camera is not None]
        others = dict.fromkeys(one.camera.name for one in markers)
        others.pop(self._rig.camera.name, None)
        for marker in markers:
            self._recorder.set(marker, "camera", None)
        return (
            [finding("camera-markers", *others, receiver=self._rig.camera.name)] if others else []
        )

    def _set_materials(self, assigned: set[Any]) -> list[Finding]:
        """Evaluate physical materials at the run's carrier, and set the layers that waves pass.

        `assigned` are those of the rendered objects.
        """
        for material in bpy.data.materials:
            if is_radar_material(material):
                self._recorder.set(material.cycles, "volume_step_rate", VOLUME_STEP_RATE)
        measurement = self._plan.measurement
        carrier_hz, beyond = measurement.waveform.carrier_hz, measurement.beyond_band
        failures = update_materials(carrier_hz, self._recorder, assigned, beyond)
        in_order = sorted(assigned, key=lambda material: str(material.name_full))
        failures += media_beyond_their_band(carrier_hz, beyond, in_order)
        failures += set_clutter_tables(
            self._recorder, assigned, carrier_hz, measurement.polarisation
        )
        failures += settle_interiors(self._recorder, assigned)
        snapshot = evaluated_snapshot(self._view_layer)
        if measurement.polarisation == "average":
            self.averaging = averaging_objects(snapshot)
        no_layers = set_layer_normals(self._recorder, snapshot)
        sharpen_walls(self._recorder, snapshot)
        snapshot = evaluated_snapshot(self._view_layer)
        self.averages_in_a_row = average_in_a_row(snapshot, self.averaging)
        units, extent = self._plan.metres_per_unit, self._plan.extent
        wavelength = measurement.waveform.wavelength_m / units
        antennas = [
            snapshot.evaluated(item).matrix_world.translation
            for item in (self._rig.camera, self._rig.emitter)
        ]
        reach = max(extent.from_emitter_m, extent.from_receiver_m) / units
        extinction_length = self._plan.extinction_length_m / units
        losses_db = interior_losses_db(wavelength, snapshot)
        self.interiors = settle_interiors_far_away(
            self._recorder,
            snapshot,
            antennas,
            reach,
            wavelength,
            extinction_length,
            self._plan.range_encoding_length_m / units,
            losses_db,
        )
        return [
            *failures,
            *check_meshes(snapshot),
            *check_normals(snapshot),
            *overlapping_shells(snapshot),
            *doubled_panes(snapshot, units),
            *straight_interiors(snapshot, units),
            *no_layers,
            *self.interiors.findings,
            *beyond_float32(losses_db),
            *total_reflections(snapshot, antennas, wavelength, extinction_length),
        ]

    def _set_code(self) -> None:
        put = self._recorder.set_item
        units, measurement = self._plan.metres_per_unit, self._plan.measurement
        put(
            self._scene,
            attributes.ATTR_INVERSE_CODE_LENGTH,
            units / self._plan.range_encoding_length_m,
        )
        put(self._scene, attributes.ATTR_EXTINCTION_LENGTH, self._plan.extinction_length_m / units)
        waveform, name = measurement.waveform, measurement.polarisation
        put(self._scene, attributes.ATTR_WAVELENGTH, waveform.wavelength_m / units)
        put(self._scene, attributes.ATTR_POLARISATION, float(POLARISATIONS.index(name)))
        put(self._scene, attributes.ATTR_FACET_FRESNEL, 1.0 if EXACT_FACETS else 0.0)
        put(self._scene, attributes.ATTR_RING_MIN, 0.0)
        put(self._scene, attributes.ATTR_RING_MAX, 0.0)


# -------------------------------------------------------------------------------------------------
# The device that Cycles renders on, and whether a check of it has passed.
# -------------------------------------------------------------------------------------------------


#: Longest check [s]. Kernels that Blender has to compile first take most of it.
_TIME_LIMIT_S = 300.0
NO_ANSWER = "the check ends"


@dataclass(frozen=True)
class Device:
    """A kind of device and its devices, by Cycles' own identifiers."""

    kind: str = "CPU"
    ids: tuple[str, ...] = ()


@dataclass(frozen=True)
class Verdict:
    """Result of a check: the largest deviation and bound of each fact, and the failed facts."""

    facts: dict[str, tuple[float, float]]
    failed: tuple[str, ...]


def chosen_device(scene: bpy.types.Scene) -> Device:
    """Return the device that a scene and the user's preferences choose; the CPU without one."""
    addon = bpy.context.preferences.addons.get("cycles")
    if scene.cycles.device != "GPU" or addon is None:
        return Device()
    kind = addon.preferences.compute_device_type
    used = [item for item in addon.preferences.devices if item.use]
    if not any(item.type == kind for item in used):
        return Device()  # Cycles takes the CPU, too
    return Device(kind, tuple(sorted(item.id for item in used)))


def choose_device(scene: bpy.types.Scene, device: Device) -> None:
    """Set scene and preferences (in memory) to a device; without ids, to all of its kind.

    RadarSimError if Blender does not find it.
    """
    scene.cycles.device = "CPU" if device.kind == "CPU" else "GPU"
    if device.kind == "CPU":
        return
    preferences = bpy.context.preferences.addons["cycles"].preferences
    try:
        preferences.compute_device_type = device.kind
    except TypeError:
        raise RadarSimError(
            f"This Blender has no devices of kind {device.kind}. Choose another one, or CPU."
        ) from None
    preferences.refresh_devices()
    for item in preferences.devices:
        item.use = item.id in device.ids if device.ids else item.type == device.kind
    if chosen_device(scene).kind != device.kind:
        raise RadarSimError(
            f"Blender finds no device of kind {device.kind} on this machine. Install its driver, "
            "or choose CPU."
        )


def failed_facts(scene: bpy.types.Scene) -> tuple[Device, tuple[str, ...]]:
    """Return the chosen device and the facts that do not hold on it. It is checked once."""
    device = chosen_device(scene)
    if device.kind == "CPU":
        return device, ()
    path = cache_file(device)
    verdict = _read(path)
    if verdict is None:
        verdict = check(device)
        keep(path, verdict)
    return device, verdict.failed


def check(device: Device) -> Verdict:
    """Check a device in a process of its own."""
    root = Path(errors.__file__).parent
    code = (
        f"import sys; sys.path.insert(0, {str(root.parent)!r}); "
        f"from {root.name}.blender.headless.selfcheck import check_here; check_here(sys.argv[-1])"
    )
    program = bpy.app.binary_path
    words = [sys.executable, "-c", code]
    if program:
        words = [program, "--background", "--factory-startup", "--python-expr", code, "--"]
    with tempfile.TemporaryDirectory(prefix="radarsim_") as name:
        order = Path(name, "check.json")
        write_json(order, dataclasses.asdict(device))
        said = ""
        with contextlib.suppress(OSError, subprocess.TimeoutExpired):
            done = subprocess.run(
                [*words, str(order)],
                timeout=_TIME_LIMIT_S,
                check=False,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                encoding="utf-8",
                errors="replace",
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
            said = f" (exit code {done.returncode}) {done.stderr.strip()[-200:]}"
        return _read(order) or Verdict({}, (NO_ANSWER + said.rstrip(),))


def keep(path: Path, verdict: Verdict) -> None:
    """Write a verdict. If the cache cannot be written, the next run checks again."""
    try:
        make_folder(path.parent.parent)
        make_folder(path.parent)
        write_json(path, dataclasses.asdict(verdict))
    except (OSError, RadarSimError):
        pass


def cache_file(device: Device) -> Path:
    """Return the file of the verdict on a device: one for each build of Blender and radarsim."""
    key = [__version__, bpy.app.version_string, str(bpy.app.build_hash), device.kind, *device.ids]
    name = hashlib.sha256(json.dumps(key).encode()).hexdigest()[:16]
    home = Path.home()
    folder = {"win32": home / "AppData/Local", "darwin": home / "Library/Caches"}.get(
        sys.platform, home / ".cache"
    )
    given = os.environ.get("LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME")
    return (Path(given) if given else folder) / "radarsim" / f"device-{name}.json"


def _read(path: Path) -> Verdict | None:
    """Read a verdict; None if there is none that can be read."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        facts = {str(k): (float(v[0]), float(v[1])) for k, v in data["facts"].items()}
        return Verdict(facts, tuple(map(str, data["failed"])))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError):
        return None
