# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel and operators of the power budget and its antennas."""

from __future__ import annotations

import contextlib
from typing import Any

import bpy

from ...contract import LinkBudget
from ...errors import ConfigError, RadarSimError
from ...options import declared
from ...physics.radar_equation import monostatic_power_w, to_db
from ...signal.detection import predicted_snr
from ...signal.radar import PATTERNS, Radar, RadarSystem, make_system
from ..rig_settings import own_link_budget, read_measurement
from ..scene import active_radar, antennas_of, draw_patterns, find_rig, remove_patterns
from .fields import (
    ActiveRadarPanel,
    active_group,
    draw_fields,
    draw_state,
    reported,
    shown_at_field,
    split,
    tr,
    wrapped,
)


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
            ("transmit", "Transmitter", "On the transmitter"),
            ("receive", "Receiver", "On the camera"),
        ),
        description="Which patterns are drawn",
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        with reported(self):
            antennas = antennas_of(context.scene, active_radar(context.scene))
            rig = find_rig(context.scene, **antennas, any_projection=True)
            system = scene_system(context.scene)
            if system is None:
                raise ConfigError("There are no antennas. Tick Radar > Link Budget first.")
            which = ("transmit", "receive") if self.which == "BOTH" else (self.which,)
            draw_patterns(context.scene, rig, system, self.size, which)
            return {"FINISHED"}
        return {"CANCELLED"}


class RADARSIM_OT_remove_patterns(bpy.types.Operator):
    """Remove the wire surfaces of the antennas' patterns"""

    bl_idname = "radarsim.remove_patterns"
    bl_label = "Remove Patterns"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        remove_patterns()
        return {"FINISHED"}


class RADARSIM_PT_system(ActiveRadarPanel, bpy.types.Panel):
    bl_label = "Link Budget"
    bl_idname = "RADARSIM_PT_system"
    bl_parent_id = "RADARSIM_PT_rig"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(active_group(context.scene), "use_link_budget", text="")

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        group = active_group(context.scene)
        if not group.use_link_budget:
            draw_state(self, tr("light as EIRP"))
        elif group.transmitter.kind != "table":  # not read at every redraw
            with contextlib.suppress(RadarSimError):
                system = scene_system(context.scene)
                if system is not None:
                    draw_state(self, tr("EIRP {dbm:.1f} dBm", dbm=_dbm(eirp_w(system))))

    def draw(self, context: bpy.types.Context) -> None:
        layout = split(self.layout)
        group = active_group(context.scene)
        if not group.use_link_budget:
            text = tr("The light's power is the EIRP in all directions.")
            wrapped(context, layout, text, "INFO")
            return
        draw_fields(layout, group, declared(LinkBudget))
        antennas = (("Transmitter", group.transmitter), ("Receiver", group.receiver))
        for title, antenna in antennas:
            box = layout.box()
            box.prop(antenna, "kind", text=title)
            draw_fields(box, antenna, declared(PATTERNS[antenna.kind]))
        row = layout.row(align=True)
        row.operator("radarsim.draw_patterns", icon="MESH_UVSPHERE")
        row.operator("radarsim.remove_patterns", text="", icon="X")
        if "table" in (antenna.kind for _, antenna in antennas):  # not at every redraw
            layout.label(text="Tables are read when a run starts")
            return
        try:
            system = scene_system(context.scene)
            lines = _shown_lines(system, read_measurement(context.scene).radar)
        except RadarSimError as error:
            if not shown_at_field(group, str(error)):
                wrapped(context, layout, str(error), "ERROR")
            return
        box = layout.box().column(align=True)
        for line in lines:
            box.label(text=line)


def scene_system(scene: bpy.types.Scene) -> RadarSystem | None:
    """The scene's link budget with its antennas; None where none is used.

    The last ones are kept: the gain of an antenna is an integral, and panels draw all the time.
    """
    wavelength_m = read_measurement(scene).waveform.wavelength_m
    record = own_link_budget(active_radar(scene))
    if record is None:
        return None
    key = (repr(record), wavelength_m)
    if key not in _systems:
        if len(_systems) >= _MOST_KEPT:
            _systems.clear()
        _systems[key] = make_system(record, wavelength_m)
    return _systems[key]


def _shown_lines(system: RadarSystem | None, radar: Radar) -> list[str]:
    """Return `budget_lines`, kept for the system and the radar that were drawn last."""
    if _lines.get("of") != (system, radar):
        _lines.update({"of": (system, radar), "text": budget_lines(system, radar)})
    found: list[str] = _lines["text"]
    return found


#: Link budgets whose antennas are kept.
_MOST_KEPT = 8
_systems: dict[tuple[str, float], RadarSystem] = {}
_lines: dict[str, Any] = {}


def eirp_w(system: RadarSystem) -> float:
    """What goes into the peak of the transmitter's pattern [W]."""
    record = system.record
    gain = system.transmitter.peak_gain
    return float(record.transmit_power_w * gain / 10 ** (record.transmit_loss_db / 10))


def _dbm(watts: float) -> float:
    return float(to_db(watts)) + 30


def budget_lines(system: RadarSystem | None, radar: Any) -> list[str]:
    """Gains, EIRP, noise, and what 1 m^2 at 1 km brings, at the peaks of both patterns."""
    if system is None:
        return []
    gains = (system.transmitter.peak_gain, system.receiver.peak_gain)
    record = system.record
    noise_w = system.noise_power_w(radar.waveform.sampling_rate_hz)
    power_w = float(
        monostatic_power_w(
            record.transmit_power_w * gains[0], 1.0, 1000.0, system.wavelength_m, gains[1]
        )
    ) / system.loss  # fmt: skip
    found = [
        tr("Peak gains: {one:.2f} and {two:.2f} dBi", one=to_db(gains[0]), two=to_db(gains[1])),
        tr("EIRP: {watts:.4g} W ({dbm:.2f} dBm)", watts=eirp_w(system), dbm=_dbm(eirp_w(system))),
        tr("1 m² at 1 km: {dbm:.2f} dBm", dbm=_dbm(power_w)),
    ]
    if noise_w > 0:
        snr = predicted_snr(power_w, radar, system, "hamming", "hamming")
        found.insert(2, tr("Noise: {dbm:.2f} dBm per sample", dbm=_dbm(noise_w)))
        found.append("    " + tr("in the map: {snr:.1f} dB above noise", snr=snr.burst_db))
    return found


CLASSES: tuple[type, ...] = (
    RADARSIM_OT_draw_patterns,
    RADARSIM_OT_remove_patterns,
    RADARSIM_PT_system,
)
