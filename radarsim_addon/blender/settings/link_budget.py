# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's power budget, part of ``scene.radarsim``: power, losses, noise, two antennas."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ...contract import AntennaRecord, LinkBudget
from ...signal.radar import make_system, read_system, self_contained
from ..plan import shortest_decimal

_TAPERS = (
    ("uniform", "Uniform", "All elements alike: -13.3 dB sidelobes"),
    ("hamming", "Hamming", "-42.7 dB sidelobes"),
    ("hann", "Hann", "-31.5 dB sidelobes, falling"),
)

#: Settings that a kind of antenna uses, in the order of the panel.
ANTENNA_SETTINGS: dict[str, tuple[str, ...]] = {
    "isotropic": ("gain_dbi",),
    "cosine": ("beamwidth_deg",),
    "gaussian": ("azimuth_beamwidth_deg", "elevation_beamwidth_deg"),
    "aperture": ("width_m", "height_m"),
    "array": (
        "columns",
        "rows",
        "column_spacing_wavelengths",
        "row_spacing_wavelengths",
        "column_taper",
        "row_taper",
        "steer_azimuth_deg",
        "steer_elevation_deg",
    ),
    "table": ("file",),
}


class RadarAntennaSettings(bpy.types.PropertyGroup):
    """Settings of one antenna; it looks along the -Z of the lamp or camera, its Y is up."""

    kind: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Pattern",
        items=(
            ("isotropic", "Isotropic", "The same gain in all directions"),
            ("cosine", "Cosine", "A power of the cosine of the angle from boresight"),
            ("gaussian", "Gaussian", "By half-power beamwidths in azimuth and elevation"),
            ("aperture", "Aperture", "Uniformly lit rectangle, sinc² in both planes"),
            ("array", "Array", "Grid of elements, steered by phase"),
            ("table", "Table", "CSV file: full pattern or principal cuts"),
        ),
        description="Gain against direction",
    )
    gain_dbi: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Gain [dBi]", default=0.0, soft_min=-20.0, soft_max=60.0, precision=2,
        description="Gain in every direction",
    )  # fmt: skip
    set_peak: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Set peak gain",
        default=False,
        description="Give the gain at the peak; off: that of a lossless antenna of this pattern",
    )
    peak_gain_dbi: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Peak gain [dBi]", default=20.0, soft_min=-20.0, soft_max=60.0, precision=2,
        description="Gain at the pattern's peak, losses of the antenna included",
    )  # fmt: skip
    beamwidth_deg: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Beamwidth [deg]", default=60.0, min=0.01, max=179.9, precision=2,
        description="Full width at half power",
    )  # fmt: skip
    azimuth_beamwidth_deg: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Azimuth beamwidth [deg]", default=10.0, min=0.01, max=180.0, precision=2,
        description="Full width at half power in the antenna's XZ plane",
    )  # fmt: skip
    elevation_beamwidth_deg: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Elevation beamwidth [deg]", default=20.0, min=0.01, max=180.0, precision=2,
        description="Full width at half power in the antenna's YZ plane",
    )  # fmt: skip
    width_m: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Width [m]", default=0.3, min=1e-4, precision=4, description="Along the antenna's X"
    )
    height_m: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Height [m]", default=0.2, min=1e-4, precision=4, description="Along the antenna's Y"
    )
    columns: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Columns", default=8, min=1, soft_max=128, description="Elements along X"
    )
    rows: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Rows", default=1, min=1, soft_max=128, description="Elements along Y"
    )
    column_spacing_wavelengths: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Column spacing [wavelengths]", default=0.5, min=0.01, precision=3,
        description="Distance of elements along X",
    )  # fmt: skip
    row_spacing_wavelengths: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Row spacing [wavelengths]", default=0.5, min=0.01, precision=3,
        description="Distance of elements along Y",
    )  # fmt: skip
    column_taper: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Column taper", items=_TAPERS, description="Amplitudes along X"
    )
    row_taper: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Row taper", items=_TAPERS, description="Amplitudes along Y"
    )
    steer_azimuth_deg: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Steer azimuth [deg]", default=0.0, min=-90.0, max=90.0, precision=2,
        description="Where the beam points, positive to the right",
    )  # fmt: skip
    steer_elevation_deg: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Steer elevation [deg]", default=0.0, min=-90.0, max=90.0, precision=2,
        description="Where the beam points, positive up",
    )  # fmt: skip
    file: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="File",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"}
        if bpy.app.version >= (4, 5, 0)
        else {"ANIMATABLE"},
        description="CSV: azimuth_deg, elevation_deg, gain_db; or cut, angle_deg, gain_db",
    )


class SystemSettings:
    """Mixed into `properties.RadarSettings`."""

    use_system: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Use Power Budget",
        default=False,
        description="Transmit power and antennas as given here. Off: the lamp's power is the EIRP "
        "in all directions, the receiver is isotropic",
    )
    transmit_power_w: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Transmit power [W]", default=1000.0, min=1e-12, precision=4,
        description="Peak power at the transmitter's output",
    )  # fmt: skip
    transmit_loss_db: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Transmit loss [dB]", default=0.0, min=0.0, precision=2,
        description="Between transmitter and antenna",
    )  # fmt: skip
    receive_loss_db: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Receive loss [dB]", default=0.0, min=0.0, precision=2,
        description="Between antenna and receiver",
    )  # fmt: skip
    other_loss_db: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Other losses [dB]", default=0.0, min=0.0, precision=2,
        description="What remains: atmosphere, processing",
    )  # fmt: skip
    noise_figure_db: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Noise figure [dB]", default=3.0, min=0.0, precision=2,
        description="Of the receiver, at 290 K",
    )  # fmt: skip
    antenna_temperature_k: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Antenna temperature [K]", default=290.0, min=0.0, precision=1,
        description="Noise that the antenna picks up",
    )  # fmt: skip
    amplitude_model: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="AmplitudeModel",
        items=(
            ("radar-equation", "Radar equation", "Amplitude is the root of the received power"),
            ("paper", "Paper", "Blue as amplitude times range squared (Eq. 10, 14)"),
        ),
        description="How radiance becomes amplitude",
    )
    transmitter_antenna: bpy.props.PointerProperty(  # type: ignore[valid-type]
        type=RadarAntennaSettings, name="Transmitter", description="Antenna on the emitter"
    )
    receiver_antenna: bpy.props.PointerProperty(  # type: ignore[valid-type]
        type=RadarAntennaSettings, name="Receiver", description="Antenna on the camera"
    )


def antenna_record(settings: Any) -> AntennaRecord:
    """One antenna's settings as a record, tables read in.

    Raises
    ------
    ConfigError
        The table cannot be read.
    """
    parameters: dict[str, Any] = {}
    for name in ANTENNA_SETTINGS[settings.kind]:
        value = getattr(settings, name)
        if name == "file":
            parameters[name] = bpy.path.abspath(value)
        else:
            parameters[name] = shortest_decimal(value) if isinstance(value, float) else value
    if settings.set_peak and settings.kind not in ("isotropic", "table"):
        parameters["gain_dbi"] = shortest_decimal(settings.peak_gain_dbi)
    return self_contained(AntennaRecord(settings.kind, parameters))


def read_system_settings(
    settings: Any, wavelength_m: float, file: str | Path | None = None
) -> LinkBudget | None:
    """The scene's power budget, checked; None where none is used.

    Parameters
    ----------
    settings : SystemSettings
    wavelength_m
        Of the carrier [m].
    file
        System file of a command line, in place of the scene's own.

    Raises
    ------
    ConfigError
        Numbers out of range, or a table or file that cannot be read.
    """
    if file is not None:
        record = read_system(file)
    elif not settings.use_system:
        return None
    else:
        record = LinkBudget(
            transmit_power_w=shortest_decimal(settings.transmit_power_w),
            transmitter=antenna_record(settings.transmitter_antenna),
            receiver=antenna_record(settings.receiver_antenna),
            transmit_loss_db=shortest_decimal(settings.transmit_loss_db),
            receive_loss_db=shortest_decimal(settings.receive_loss_db),
            other_loss_db=shortest_decimal(settings.other_loss_db),
            noise_figure_db=shortest_decimal(settings.noise_figure_db),
            antenna_temperature_k=shortest_decimal(settings.antenna_temperature_k),
            amplitude_model=settings.amplitude_model,
        )
    make_system(record, wavelength_m)  # checks it
    return record
