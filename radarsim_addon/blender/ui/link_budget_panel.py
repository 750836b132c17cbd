# SPDX-License-Identifier: GPL-3.0-or-later
"""Panel and operators of the power budget and its antennas."""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass
from typing import Any

import bpy

from ...contract import LinkBudget
from ...errors import ConfigError, RadarSimError
from ...findings import length_text
from ...options import declared
from ...physics.radar_equation import monostatic_power_w, to_db
from ...signal.detection import predicted_snr
from ...signal.radar import PATTERNS, RadarSystem, make_system
from ..plan import Measurement
from ..rig_settings import own_link_budget, read_measurement, watts_to_dbm
from ..scene import active_radar, antennas_of, draw_patterns, find_rig, remove_patterns
from .fields import (
    ActiveRadarPanel,
    active_group,
    draw_fields,
    draw_number,
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
                    draw_state(self, tr("EIRP {dbm:.1f} dBm", dbm=watts_to_dbm(eirp_w(system))))

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
            rows = [] if system is None else _kept_rows(system, read_measurement(context.scene))
        except RadarSimError as error:
            if not shown_at_field(group, str(error)):
                wrapped(context, layout, str(error), "ERROR")
            return
        box = layout.box().column(align=True)
        for name, text in rows:
            if name:
                draw_number(box, name, text)
            else:
                wrapped(context, box, text, "NONE")


def scene_system(scene: bpy.types.Scene) -> RadarSystem | None:
    """Return the link budget of the scene with its antennas; None if the scene uses none.

    The last results are cached: the gain of an antenna is an integral, and Blender draws panels
    very often.
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


#: Link budgets whose antennas are kept.
_MOST_KEPT = 8
_systems: dict[tuple[str, float], RadarSystem] = {}
_rows: dict[str, Any] = {}


def _kept_rows(system: RadarSystem, measurement: Measurement) -> list[tuple[str, str]]:
    """Return `budget_rows`. The rows of the last call are reused if nothing has changed."""
    if _rows.get("of") != (system, measurement):
        _rows.update({"of": (system, measurement), "rows": budget_rows(system, measurement)})
    found: list[tuple[str, str]] = _rows["rows"]
    return found


def eirp_w(system: RadarSystem) -> float:
    """Return the EIRP in the peak of the transmitter's pattern, after the transmit loss [W]."""
    record = system.record
    gain = system.transmitter.peak_gain
    return float(record.transmit_power_w * gain / 10 ** (record.transmit_loss_db / 10))


#: A target whose range of detection is given: RCS [m^2], probabilities of detection and of a false
#: alarm in a cell.
_RCS_M2, _DETECTED, _FALSE = 10.0, 0.9, 1e-6
#: Windows over range and Doppler of a run that is processed with defaults.
_TAPERS = "hamming", "hamming"


def needed_snr_db(detected: float, false_alarms: float) -> float:
    """Return the SNR in a cell at which a steady target is detected with these probabilities.

    Albersheim's equation for one sample of a linear detector, within 0.2 dB (Proc. IEEE 69, 839,
    1981).
    """
    a, b = math.log(0.62 / false_alarms), math.log(detected / (1 - detected))
    return 10 * math.log10(a + 0.12 * a * b + 1.7 * b)


@dataclass(frozen=True)
class TargetSnr:
    """SNR in the map of a target of 10 m^2 at the peaks of both patterns, against range."""

    #: At 1 m, without weather.
    at_1_m_db: float
    weather_db_per_m: float

    @classmethod
    def of(cls, system: RadarSystem, measurement: Measurement) -> TargetSnr:
        """Return the SNR curve of a link budget and a measurement, whose noise must not be zero."""
        record, radar = system.record, measurement.radar
        power_w = monostatic_power_w(
            record.transmit_power_w * system.transmitter.peak_gain, _RCS_M2, 1.0,
            system.wavelength_m, system.receiver.peak_gain,
        ) / system.loss  # fmt: skip
        taken_db_per_km = measurement.weather.attenuation_db_per_km(radar.waveform.carrier_hz)
        found = predicted_snr(float(power_w), radar, system, *_TAPERS)
        return cls(found.burst_db, 2e-3 * taken_db_per_km)

    def at(self, range_m: float) -> float:
        """Return the SNR at a range [dB]."""
        return self.at_1_m_db - 40 * math.log10(range_m) - self.weather_db_per_m * range_m

    def longest_m(self, needed_db: float) -> float:
        """Return the range at which the SNR falls to this value [m]."""
        low_m, high_m = 1e-6, 1e12
        for _ in range(80):
            middle_m = math.sqrt(low_m * high_m)
            low_m, high_m = (
                (middle_m, high_m) if self.at(middle_m) > needed_db else (low_m, middle_m)
            )
        return low_m


def budget_rows(system: RadarSystem, measurement: Measurement) -> list[tuple[str, str]]:
    """Return names and values: gains, EIRP, noise, and the SNR of a target of 10 m^2.

    The last row has no name. It is a sentence on the detection of this target.
    """
    gains_dbi = [float(to_db(one.peak_gain)) for one in (system.transmitter, system.receiver)]
    noise_w = system.noise_power_w(measurement.radar.waveform.sampling_rate_hz)
    rows = [
        (tr("Peak Gains"), f"{gains_dbi[0]:.1f}, {gains_dbi[1]:.1f} dBi"),
        (tr("EIRP"), f"{watts_to_dbm(eirp_w(system)):.1f} dBm"),
    ]
    if noise_w <= 0:
        return rows
    rows.append((tr("Noise"), f"{watts_to_dbm(noise_w):.1f} dBm"))
    snr = TargetSnr.of(system, measurement)
    stop_m, longest_m = measurement.range_stop_m, measurement.radar.unambiguous_range_m
    if stop_m > 0:
        name = tr("SNR at {range}", range=_length(stop_m))
        rows.append((name, f"{snr.at(stop_m):.1f} dB (10 dBsm)"))
    range_m = snr.longest_m(needed_snr_db(_DETECTED, _FALSE))
    text = tr("10 dBsm is detected to {range} (Pd 0.9, Pfa 1e-6)", range=_length(range_m))
    if range_m > longest_m:
        text += tr(", beyond the longest range of {range}", range=_length(longest_m))
    return [*rows, ("", text)]


def _length(metres: float) -> str:
    return length_text(float(f"{metres:.3g}"))


CLASSES: tuple[type, ...] = (
    RADARSIM_OT_draw_patterns,
    RADARSIM_OT_remove_patterns,
    RADARSIM_PT_system,
)
