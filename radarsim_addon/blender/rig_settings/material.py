# SPDX-License-Identifier: GPL-3.0-or-later
"""``material.radarsim``: what the panel shows of the settings that the room `materials` keeps.

These properties store nothing: each one reads and writes a custom property of the material. So a
script, another version of radarsim and the panel see the same numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy

from ...errors import RadarSimError
from ...physics.clutter import CLUTTER_TABLE, MOTIONS, TEXTURES, clutter_models
from ...physics.materials import TABLE, models
from ...physics.rough import MOST_EXPONENT
from ..materials import LOBE_EXPONENT
from ..materials import clutter as cm
from ..materials import physical_materials as pm
from ..materials.clutter import PREFIX as FLUCTUATION
from ..plan import shortest_decimal
from .radar import TEXT_CONTEXT, beyond_band, carrier_hz

_CLUTTER = (
    (cm.NO_CLUTTER, "None", "What medium and roughness return is all"),
    *((name, model.title, model.source) for name, model in clutter_models().items()),
    (CLUTTER_TABLE, "Table", "A CSV file over grazing angle: grazing_deg and sigma0_db"),
)
_TEXTURE_NAMES = {"none": "None", "k": "K", "lognormal": "Log-Normal", "weibull": "Weibull"}
_MOTION_NAMES = {"none": "None", "exponential": "Exponential", "gaussian": "Gaussian", "sea": "Sea"}
#: What other numbers begin with, once a kind is chosen.
_CLUTTER_START = {
    FLUCTUATION + "texture": {
        FLUCTUATION + "texture_shape": 1.0,
        FLUCTUATION + "texture_length_m": 10.0,
    },
    FLUCTUATION + "motion": {FLUCTUATION + "motion_speed_mps": 0.1},
}


def _choice(key: str, name: str, description: str, items: tuple[tuple[str, str, str], ...]) -> Any:
    """Return a field for a custom property with one of some names; without it, the first name."""
    names = [item[0] for item in items]

    def read(settings: Any) -> int:
        value = settings.id_data.get(key, names[0])
        return names.index(value) if value in names else 0

    def write(settings: Any, number: int) -> None:
        material = settings.id_data
        material[key] = names[number]
        for other, value in _CLUTTER_START.get(key, {}).items():
            if number and other not in material:
                material[other] = value

    return bpy.props.EnumProperty(
        name=name,
        description=description,
        items=items,
        get=read,
        set=write,
        translation_context=TEXT_CONTEXT,
    )


def clutter_fields(number: Callable[..., Any]) -> dict[str, Any]:
    """Return the fields of model, texture and motion. `number` makes a field for a number."""

    def set_path(settings: Any, value: str) -> None:
        settings.id_data[cm.PATH] = value

    parameters = {one.name: one for model in clutter_models().values() for one in model.parameters}
    return {
        "clutter": _choice(
            cm.CLUTTER, "Clutter", "Return sigma0 of a model by grazing angle, too", _CLUTTER
        ),
        "clutter_path": bpy.props.StringProperty(
            name="Table",
            subtype="FILE_PATH",
            get=lambda settings: str(settings.id_data.get(cm.PATH, "")),
            set=set_path,
            description="CSV file: grazing_deg, sigma0_db; also frequency_ghz, polarisation",
        ),
        **{
            f"clutter_{name}": number(
                cm.PARAMETER_PREFIX + name,
                {"gamma_db": "Gamma [dB]", "sea_state": "Sea State"}[name],
                one.meaning[:1].upper() + one.meaning[1:],
                default=one.default,
                min=one.minimum,
                max=one.maximum,
                precision=2,
            )
            for name, one in parameters.items()
        },
        "texture": _choice(
            FLUCTUATION + "texture",
            "Texture",
            "Vary the power of the echoes over the surface; the mean stays",
            tuple((name, _TEXTURE_NAMES[name], "") for name in TEXTURES),
        ),
        "texture_shape": number(
            FLUCTUATION + "texture_shape",
            "Shape",
            "K: order nu. Log-normal: standard deviation of ln(power). Weibull: shape, at most 1",
            default=0.0, min=0.0, max=1e3, precision=3,
        ),
        "texture_length_m": number(
            FLUCTUATION + "texture_length_m",
            "Length [m]",
            "Length over which the texture varies",
            default=0.0, min=0.0, precision=3,
        ),
        "clutter_motion": _choice(
            FLUCTUATION + "motion",
            "Motion",
            "Let the scatterers of the surface move, with a spectrum of this kind",
            tuple((name, _MOTION_NAMES[name], "") for name in MOTIONS),
        ),
        "motion_speed_mps": number(
            FLUCTUATION + "motion_speed_mps",
            "Speed [m/s]",
            "Exponential: speed by which the spectrum falls to 1/e. Else: standard deviation",
            default=0.0, min=0.0, max=100.0, precision=3,
        ),
        "motion_fraction": number(
            FLUCTUATION + "motion_fraction",
            "Fraction",
            "Exponential: part of the power that is still. Sea: part that approaches",
            default=0.0, min=0.0, max=1.0, precision=3,
        ),
    }  # fmt: skip


MATERIAL_PROPERTY = "radarsim"

#: Where a parameter without default starts.
_START = {
    "eps_real": 4.0,
    "n": 2.0,
    "static_permittivity": 80.0,
    "infinite_permittivity": 5.0,
    "relaxation_frequency_hz": 17e9,
    "conductivity_s_per_m": 1e7,
    "moisture": 0.2,
}
_MEDIA: tuple[tuple[str, str, str], ...] = (
    *(
        (name, model.title[:1].upper() + model.title[1:], f"{model.source}; {model.band_text}")
        for name, model in models().items()
    ),
    (TABLE, "Table", "A CSV file over frequency: frequency_ghz, eps_real, eps_imag (or n, k)"),
)
_NAMES = [item[0] for item in _MEDIA]


def _refresh(material: bpy.types.Material) -> None:
    try:
        scene = bpy.context.scene
        pm.update_material(material, carrier_hz(scene), beyond_band(scene))
    except RadarSimError:
        return  # the panel tells it


def choose_medium(material: bpy.types.Material, name: str) -> None:
    """Set the medium of a physical material. Parameters without a default get an initial value."""
    for key in [key for key in material.keys() if key.startswith(pm.PARAMETER_PREFIX)]:
        if key != pm.PATH:
            del material[key]
    material[pm.MEDIUM] = name
    for parameter in () if name == TABLE else models()[name].parameters:
        if parameter.default is None:
            material[pm.PARAMETER_PREFIX + parameter.name] = _START.get(parameter.name, 1.0)


def _get_medium(settings: Any) -> int:
    name = settings.id_data.get(pm.MEDIUM, _NAMES[0])
    return _NAMES.index(name) if name in _NAMES else 0


def _set_medium(settings: Any, number: int) -> None:
    choose_medium(settings.id_data, _NAMES[number])
    _refresh(settings.id_data)


def _set_path(settings: Any, value: str) -> None:
    settings.id_data[pm.PATH] = value
    _refresh(settings.id_data)


def _number(
    key: str, name: str, description: str, exponent: int = 0, default: float = 0.0, **bounds: Any
) -> Any:
    """Return a field that shows a custom property of the material times ``10**-exponent``."""

    def write(settings: Any, value: float) -> None:
        material = settings.id_data
        material[key] = shortest_decimal(value, exponent)
        of_sheet = key == pm.SHEET_THICKNESS and pm.is_physical(material)
        if of_sheet and pm.is_sheet(material) != (value > 0):
            pm.make_physical(material)
        _refresh(material)

    return bpy.props.FloatProperty(
        name=name,
        description=description,
        get=lambda settings: float(settings.id_data.get(key, default)) * 10.0**-exponent,
        set=write,
        **bounds,
    )


def _set_lobe_exponent(settings: Any, value: int) -> None:
    if value > 0:
        settings.id_data[LOBE_EXPONENT] = value
    else:
        settings.id_data.pop(LOBE_EXPONENT, None)


def _get_lobe_exponent(settings: Any) -> int:
    value = settings.id_data.get(LOBE_EXPONENT, 0)
    return int(value) if isinstance(value, int | float) and 0 <= value <= MOST_EXPONENT else 0


class MaterialSettings(bpy.types.PropertyGroup):
    """Medium, surface and clutter of a material."""

    medium: bpy.props.EnumProperty(
        name="Medium",
        translation_context=TEXT_CONTEXT,
        items=_MEDIA,
        get=_get_medium,
        set=_set_medium,
        description="What the object is made of; its index at the carrier comes from the library",
    )
    path: bpy.props.StringProperty(
        name="Table",
        subtype="FILE_PATH",
        get=lambda settings: str(settings.id_data.get(pm.PATH, "")),
        set=_set_path,
        description="CSV file: frequency_ghz and eps_real, eps_imag (or n, k)",
    )
    rms_height_mm: _number(
        pm.RMS_HEIGHT,
        "Rms Height [mm]",
        "Root mean square of the surface's height; 0: not given",
        -3, min=0.0, precision=3,
    )  # fmt: skip
    correlation_length_mm: _number(
        pm.CORRELATION_LENGTH,
        "Correlation Length [mm]",
        "Of a Gaussian surface; with the height it gives the slope sqrt(2) h / l",
        -3, min=0.0, precision=3,
    )  # fmt: skip
    rms_slope: _number(
        pm.RMS_SLOPE,
        "Rms Slope",
        "Rms slope of the surface, where height and correlation length do not give it",
        min=0.0, max=0.7071, precision=4,
    )  # fmt: skip
    lobe_exponent: bpy.props.IntProperty(
        name="Scattered Lobe",
        description="Set the exponent of the lobe around the mirrored wave. The lobe contains the "
        "power that the material does not mirror. For walls with effective roughness and mirrors "
        "with an RMS height. 1 is wide, 1000 is narrow. 0 means no lobe",
        get=_get_lobe_exponent,
        set=_set_lobe_exponent,
        min=0,
        max=MOST_EXPONENT,
        soft_max=200,
    )
    sheet_thickness_mm: _number(
        pm.SHEET_THICKNESS,
        "Thin Sheet [mm]",
        "Thickness of a pane that is modelled as one face: the echoes of its two sides interfere. "
        "0: a surface, with an interior where Volume is connected",
        -3, min=0.0, precision=3,
    )  # fmt: skip


for _model in models().values():
    for _parameter in _model.parameters:
        MaterialSettings.__annotations__.setdefault(
            _parameter.name,
            _number(
                pm.PARAMETER_PREFIX + _parameter.name,
                _parameter.name.replace("_", " ").capitalize()
                + (f" [{_parameter.unit}]" if _parameter.unit else ""),
                _parameter.meaning,
                default=0.0 if _parameter.default is None else _parameter.default,
                precision=4,
            ),
        )
MaterialSettings.__annotations__.update(clutter_fields(_number))
