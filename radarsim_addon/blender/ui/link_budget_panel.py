# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel and operators of the power budget and its antennas."""

from __future__ import annotations

import math
from typing import Any

import bpy

from ...errors import RadarSimError
from ...physics.radar_equation import monostatic_power_w
from ...signal.detection import predicted_snr
from ...signal.radar import RadarSystem, make_system
from ..scene import draw_patterns, find_rig, remove_patterns
from ..settings import ANTENNA_SETTINGS, SCENE_PROPERTY, read_system_settings
from ..settings import radar as properties


class RADARSIM_OT_draw_patterns(bpy.types.Operator):
    """Draw the antennas' patterns as wire surfaces, 40 dB from peak to centre. They do not echo"""

    bl_idname = "radarsim.draw_patterns"
    bl_label = "Draw Patterns"
    bl_options = {"REGISTER", "UNDO"}

    size: bpy.props.FloatProperty(
        name="Size", default=5.0, min=1e-6, subtype="DISTANCE", description="Length of the peak"
    )
    which: bpy.props.EnumProperty(
        name="Antennas",
        items=(
            ("BOTH", "Both", "Transmitter and receiver"),
            ("transmit", "Transmitter", "On the emitter"),
            ("receive", "Receiver", "On the camera"),
        ),
        description="Which patterns are drawn",
    )

    def execute(self, context: Any) -> set[str]:
        settings = getattr(context.scene, SCENE_PROPERTY)
        try:
            rig = find_rig(context.scene, settings.camera, settings.emitter, True)
            system = scene_system(context.scene)
            if system is None:
                self.report({"ERROR"}, "There are no antennas. Tick Radar > Power Budget first.")
                return {"CANCELLED"}
        except RadarSimError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        both = ("transmit", "receive")
        which = both if self.which == "BOTH" else (self.which,)
        draw_patterns(context.scene, rig, system, self.size, which)
        return {"FINISHED"}


class RADARSIM_OT_remove_patterns(bpy.types.Operator):
    """Remove the wire surfaces of the antennas' patterns"""

    bl_idname = "radarsim.remove_patterns"
    bl_label = "Remove Patterns"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        remove_patterns()
        return {"FINISHED"}


class RADARSIM_PT_system(bpy.types.Panel):
    bl_label = "Power Budget"
    bl_idname = "RADARSIM_PT_system"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Radar"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: Any) -> None:
        self.layout.prop(getattr(context.scene, SCENE_PROPERTY), "use_system", text="")

    def draw(self, context: Any) -> None:
        from .panels import wrapped

        layout = self.layout
        settings = getattr(context.scene, SCENE_PROPERTY)
        if not settings.use_system:
            wrapped(
                context, layout, "The lamp's power is the EIRP in all directions.", "INFO"
            )  # fmt: skip
            return
        column = layout.column(align=True)
        column.prop(settings, "transmit_power_w")
        column.prop(settings, "transmit_loss_db")
        column.prop(settings, "receive_loss_db")
        column.prop(settings, "other_loss_db")
        column.prop(settings, "noise_figure_db")
        column.prop(settings, "antenna_temperature_k")
        layout.prop(settings, "amplitude_model")
        for title, antenna in (
            ("Transmitter", settings.transmitter_antenna),
            ("Receiver", settings.receiver_antenna),
        ):
            _draw_antenna(layout, title, antenna)
        row = layout.row(align=True)
        row.operator("radarsim.draw_patterns", icon="MESH_UVSPHERE")
        row.operator("radarsim.remove_patterns", text="", icon="X")
        kinds = {settings.transmitter_antenna.kind, settings.receiver_antenna.kind}
        if "table" in kinds:  # not at every redraw
            layout.label(text="Tables are read when a run starts")
            return
        try:
            system = scene_system(context.scene)
            lines = budget_lines(system, properties.read_measurement(context.scene).radar)
        except RadarSimError as error:
            wrapped(context, layout, str(error), "ERROR")
            return
        box = layout.box().column(align=True)
        for line in lines:
            box.label(text=line)


def _draw_antenna(layout: Any, title: str, antenna: Any) -> None:
    box = layout.box().column(align=True)
    box.prop(antenna, "kind", text=title)
    for name in ANTENNA_SETTINGS[antenna.kind]:
        box.prop(antenna, name)
    if antenna.kind not in ("isotropic", "table"):
        box.prop(antenna, "set_peak")
        if antenna.set_peak:
            box.prop(antenna, "peak_gain_dbi")


def scene_system(scene: Any) -> RadarSystem | None:
    """The scene's power budget with its antennas; None where none is used.

    Raises
    ------
    ConfigError
        Numbers out of range, or a table that cannot be read.
    """
    wavelength_m = properties.read_measurement(scene).waveform.wavelength_m
    record = read_system_settings(getattr(scene, SCENE_PROPERTY), wavelength_m)
    return None if record is None else make_system(record, wavelength_m)


def budget_lines(system: RadarSystem | None, radar: Any) -> list[str]:
    """Gains, EIRP, noise, and what 1 m^2 at 1 km brings, at the peaks of both patterns."""
    if system is None:
        return []
    gains = (system.transmitter.peak_gain, system.receiver.peak_gain)
    record = system.record
    eirp_w = record.transmit_power_w * gains[0] / 10 ** (record.transmit_loss_db / 10)
    noise_w = system.noise_power_w(radar.waveform.sampling_rate_hz)
    power_w = float(
        monostatic_power_w(
            record.transmit_power_w * gains[0], 1.0, 1000.0, system.wavelength_m, gains[1]
        )
    ) / system.loss  # fmt: skip
    found = [
        f"Peak gains: {_db(gains[0]):.2f} and {_db(gains[1]):.2f} dBi",
        f"EIRP: {eirp_w:.4g} W ({_db(eirp_w):.2f} dBW)",
        f"1 m² at 1 km: {_db(power_w) + 30:.2f} dBm",
    ]
    if noise_w > 0:
        snr = predicted_snr(power_w, radar, system, "hamming", "hamming")
        found.insert(2, f"Noise: {_db(noise_w) + 30:.2f} dBm a sample")
        found.append(f"    in the map: {snr.burst_db:.1f} dB above noise")
    return found


def _db(value: float) -> float:
    return 10 * math.log10(value)


CLASSES: tuple[type, ...] = (
    RADARSIM_OT_draw_patterns,
    RADARSIM_OT_remove_patterns,
    RADARSIM_PT_system,
)
