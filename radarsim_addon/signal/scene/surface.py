# SPDX-License-Identifier: GPL-3.0-or-later
"""What a material is at the carrier: numbers that are read once, and what follows from them.

A `Surface` is simple, physical or a thin sheet (the three Radar Materials), or made for light. Each
input is a number, or None where a node sets it: it may then vary over the surface, and what needs
the number is unknown there.

Widths of lobes are alpha of a Beckmann lobe, sqrt(2) times the RMS slope: infinite for a Lambert
surface, 0 for a mirror and where the width is not known.
"""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ...arrays import Real, dots
from ...errors import ConfigError
from ...physics.clutter import ClutterModel, clutter_model
from ...physics.fresnel import unpolarised_reflectance
from ...physics.mirrors import MirrorMaterial, coherent_reflection
from ...physics.rough import (
    facet_brightness,
    lobe_exponent,
    rms_slope,
    slope_from_roughness,
)

Kind = Literal["simple", "physical", "sheet", "light"]

#: Roughness up to which Cycles takes a lobe for a mirror, and finds no Point light in it.
SHARP = 0.0037
#: Roughness up to which a physical material is smooth: it mirrors, and has no lobe.
SMOOTH_BELOW = 0.01
#: A medium that passes less of the power at normal incidence is opaque.
OPAQUE_BELOW_TRANSMITTANCE = 1e-3
#: Extinction from which power falls by 54 dB within a hundredth of a wavelength.
_OPAQUE_KAPPA = 100.0
#: Index from which on a surface reflects all power at all angles but the most grazing.
_METAL = 1000.0
#: If a Principled BSDF has a lower albedo or metallic part, most of the echo of a sphere comes from
#: its specular lobe.
_DARK = 0.2
#: Albedo of the rendered lobe where less is scattered: Cycles drops lobes of 1e-5.
_LEAST_ALBEDO = 1e-4
#: Albedo of Blender's default surface, and of a material made for light whose colour is not known.
_DEFAULT_ALBEDO, _GUESSED_ALBEDO = 0.8, 0.5

#: BSDFs of Blender with a reflecting lobe of their Roughness, and those of them with no other,
#: which depends on both directions alike.
_GLOSSY = {"Anisotropic", "Glass", "Glossy", "Metallic"}
_RECIPROCAL = {"Anisotropic", "Glossy", "Metallic"}


def is_conductor(index: complex) -> bool:
    """Return whether a medium is opaque: it reflects all, or absorbs all within its skin."""
    # Half the threshold of the node group, which rounds.
    passed = 4 * index.real / ((index.real + 1) ** 2 + index.imag**2)
    return passed < OPAQUE_BELOW_TRANSMITTANCE / 2 or index.imag >= _OPAQUE_KAPPA


@dataclass(frozen=True)
class RoughSurface:
    """Heights of a surface: RMS height and correlation length [m], RMS slope; 0 if unknown."""

    rms_height_m: float = 0.0
    correlation_length_m: float = 0.0
    rms_slope: float = 0.0

    @property
    def slope(self) -> float:
        """RMS slope: sqrt(2) h/l if both are known, else the slope of the record."""
        if self.rms_height_m > 0 and self.correlation_length_m > 0:
            return float(rms_slope(self.rms_height_m, self.correlation_length_m))
        return self.rms_slope

    @property
    def correlation_length(self) -> float:
        """Correlation length [m]; if not given, from RMS height and slope; 0 if unknown."""
        if self.correlation_length_m > 0:
            return self.correlation_length_m
        if self.rms_height_m > 0 and self.rms_slope > 0:
            return math.sqrt(2) * self.rms_height_m / self.rms_slope
        return 0.0


@dataclass(frozen=True)
class Clutter:
    """A clutter model with its parameters; `path` is the CSV file of the model 'table'."""

    name: str
    parameters: dict[str, float] = field(default_factory=dict)
    path: str | None = None

    @property
    def model(self) -> ClutterModel:
        """The model. Raises ConfigError for an unknown name or a table that cannot be used."""
        if not self.path:
            return clutter_model(self.name, self.path)
        return _table_model(self.name, self.path, file_stamp(self.path))

    @property
    def key(self) -> str:
        """A text that changes whenever sigma0 may."""
        return f"{self!r} {file_stamp(self.path) if self.path else None}"

    def sigma0_db(self, carrier_hz: float, grazing_rad: ArrayLike, polarisation: str) -> Real:
        """Return sigma0 at grazing angles [rad] in dB. Raises ConfigError as its model does."""
        return self.model.sigma0_db(carrier_hz, grazing_rad, polarisation, **self.parameters)


@functools.lru_cache(maxsize=16)
def _table_model(name: str, path: str, _stamp: tuple[int, int] | None) -> ClutterModel:
    """Model of a file, read again only after the file has changed: panels ask at each redraw."""
    return clutter_model(name, path)


def file_stamp(path: str) -> tuple[int, int] | None:
    """Return the time of the last change [ns] and the size of a file; None without it."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size


@dataclass(frozen=True)
class ScatteredLobe:
    """The directive lobe in which a material scatters what it reflects and does not mirror."""

    #: See `lobe_exponent`.
    exponent: int
    #: What the surface mirrors.
    mirror: MirrorMaterial
    #: Width of the glossy lobe in place of the mirror, as of a Beckmann lobe; 0: a mirror.
    alpha: float
    #: Whether Cycles' lobe has the albedo of a table; else that of a simple material.
    from_table: bool

    def scattered(
        self, to_source: Real, normal: Real, polarisation: str, wavelength_m: float
    ) -> Real:
        """Return the fraction of the power that is scattered, (n,).

        `to_source` and `normal` are unit vectors from the surface to where waves come from, and
        across it, (n, 3).
        """
        mirror, cosine = self.mirror, np.abs(dots(to_source, normal))
        kept = mirror.share * coherent_reflection(mirror.rms_height_m, cosine, wavelength_m) ** 2
        every = replace(mirror, share=1.0).rendered_power(-to_source, normal, polarisation)
        return np.asarray(every * (1 - kept))

    def rendered_db(self, grazing_rad: Real, wavelength_m: float) -> Real:
        """Return sigma0 [dB] of the Lambert lobe that Cycles renders in its place."""
        sine = np.sin(grazing_rad)
        kept = coherent_reflection(self.mirror.rms_height_m, sine, wavelength_m) ** 2
        albedo = (1 - kept) * unpolarised_reflectance(self.mirror.index, sine)
        return np.asarray(10 * np.log10(4 * sine**2 * np.maximum(albedo, _LEAST_ALBEDO)))


@dataclass(frozen=True)
class Shader:
    """A shader node of a material made for light."""

    #: Name of the BSDF ("Principled", "Glossy"...), or of another kind of node.
    kind: str
    #: Its inputs by name, None where a node sets one; of a colour, the brightest channel.
    inputs: Mapping[str, float | None]
    #: Mean of the channels of its colour; None without one, or where a node sets it.
    albedo: float | None = None

    @property
    def roughness(self) -> float | None:
        return self.inputs.get("Roughness")

    @property
    def is_sharp(self) -> bool:
        """Whether it mirrors, by those of its inputs that are numbers."""

        def below(name: str) -> bool:
            value = self.inputs[name]
            return value is not None and value <= SHARP

        def above_0(name: str) -> bool:
            value = self.inputs[name]
            return value is None or value > 0

        if self.kind != "Principled":
            return self.kind in _GLOSSY and below("Roughness")
        if above_0("Coat Weight") and below("Coat Roughness"):
            return True
        return below("Roughness") and (above_0("Metallic") or above_0("Specular IOR Level"))

    @property
    def outshining_width(self) -> float:
        """Width of the glossy lobe if this lobe can be brighter than the rest of the material; else
        infinite.
        """
        if self.kind == "Principled":
            metallic, colour = self.inputs["Metallic"], self.inputs["Base Color"]
            bright = colour is not None and colour > _DARK
            if bright and metallic is not None and metallic < _DARK:
                return math.inf  # the diffuse part returns 16 times what the lobe does, and more
        elif self.kind not in _GLOSSY:
            return math.inf
        roughness = self.roughness
        return roughness**2 if roughness is not None and roughness > SHARP else math.inf


@dataclass(frozen=True)
class Angles:
    """Cosines of n rays at a surface, each (n,)."""

    #: Of the angles from the shading normal; to the transmitter, negative behind the surface.
    to_transmitter: Real
    to_receiver: Real
    #: From the shading normal to the facet half way between both antennas.
    to_facet: Real
    #: From that facet's normal to an antenna.
    at_facet: Real
    #: From the normal of the triangle to the receiver.
    to_receiver_flat: Real


@dataclass(frozen=True, eq=False)
class Surface:
    """A material at the carrier."""

    name: str = ""
    kind: Kind = "light"
    #: Real and imaginary part of the index n + j kappa.
    n: float | None = None
    kappa: float | None = None
    #: Of a simple material: fraction of the reflected power in the specular lobe.
    specularity: float | None = None
    #: Cycles' roughness of that lobe, alpha = roughness^2.
    roughness: float | None = None
    #: Of a sheet, in wavelengths.
    thickness: float | None = None
    #: What scales the power that passes a face.
    transmissions: tuple[float | None, ...] = ()
    #: Whether a clutter model or a lobe of a table is rendered where there is one.
    has_clutter_row: bool = False
    #: Of inputs that a node sets: the number that would be there without the node.
    unlinked: Mapping[str, float] = field(default_factory=dict)
    #: Whether the Volume of the output is connected.
    volume: bool = False
    rough: RoughSurface = RoughSurface()
    clutter: Clutter | None = None
    #: Exponent of a directive lobe as the user set it; None without one.
    exponent: object = None
    #: Shaders made for light that reach the output, through mixes and groups, and the one that is
    #: linked to it; None for a Radar Material and Blender's default surface.
    shaders: tuple[Shader, ...] = ()
    output: Shader | None = None
    #: Whether it is Blender's default surface, of an empty slot.
    is_default: bool = False

    # What passes it.

    @property
    def is_radar(self) -> bool:
        """Whether it is a Radar Material, and so encodes the range."""
        return self.kind != "light"

    @cached_property
    def is_opaque(self) -> bool:
        """Whether it is a Radar Material that lets nothing through.

        It is a conductor with constant inputs, or its transmission is 0.
        """
        if self.transmissions and all(one == 0 for one in self.transmissions):
            return True
        return self.n is not None and self.kappa is not None and is_conductor(self.index)

    @property
    def has_interior(self) -> bool:
        """Whether waves enter objects of it: a Radar Material with a Volume that is not opaque."""
        return self.volume and not self.is_opaque

    @property
    def is_entered(self) -> bool:
        """Whether waves enter objects of this physical material."""
        return self.kind == "physical" and self.has_interior

    @property
    def passes_by_polarisation(self) -> bool:
        """Whether waves pass it by Fresnel's equations for each polarisation."""
        return self.kind == "sheet" or self.is_entered

    @property
    def delays(self) -> bool:
        """Whether waves that pass it are delayed: by its interior, or as thin panes."""
        return self.kind == "sheet" or self.has_interior

    # What it mirrors.

    @property
    def index(self) -> complex:
        """Index n + j kappa; 1 for parts that a node sets."""
        return complex(1.0 if self.n is None else self.n, self.kappa or 0.0)

    @cached_property
    def mirror(self) -> MirrorMaterial | None:
        """What a Radar Material mirrors.

        None if it is too rough, has no specular part, or an input is set by a node: the mirror may
        then vary over the surface.
        """
        if self.n is None or self.kappa is None:
            return None
        if self.kind == "sheet":
            if self.thickness is None or not self.thickness > 0:
                return None
            return MirrorMaterial(self.index, 1.0, True, sheet_wavelengths=self.thickness)
        if self.roughness is None:
            return None
        if self.kind == "physical":
            smooth = self.roughness <= SMOOTH_BELOW
            return (
                MirrorMaterial(self.index, 1.0, True, self.rough.rms_height_m) if smooth else None
            )
        share = self.specularity
        if self.kind != "simple" or share is None or share <= 0 or self.roughness > SHARP:
            return None
        return MirrorMaterial(self.index, share, False, self.rough.rms_height_m)

    @cached_property
    def is_mirror_like(self) -> bool:
        """Whether it has a lobe that Cycles takes for a mirror.

        False where a node sets the roughness.
        """
        if self.kind == "light":
            return any(one.is_sharp for one in self.shaders)
        if self.kind == "sheet":
            return True
        limit = SMOOTH_BELOW if self.kind == "physical" else SHARP
        shiny = self.specularity is None or self.specularity > 0
        return shiny and self.roughness is not None and self.roughness <= limit

    @property
    def mirrors(self) -> bool:
        """Whether it mirrors, even where its reflection is not known."""
        return self.mirror is not None or self.is_mirror_like

    # Its lobes.

    @cached_property
    def lobe_width(self) -> float:
        """Width of the narrowest lobe in which it scatters."""
        width = self._lobe_width
        if self.exponent is None:
            return width
        # a facet turns the mirrored wave by twice its own angle
        return min(1 / math.sqrt(lobe_exponent(self.exponent)), width)

    @property
    def _lobe_width(self) -> float:
        """The same without a directive lobe."""
        if self.kind == "light":
            return self._width_for_light
        if self.clutter is not None:  # scatters by the geometric mean of both angles
            return math.inf
        if self.kind == "simple":
            if self.specularity is None:
                return 0.0
            if self.specularity == 0:
                return math.inf
        return 0.0 if self.roughness is None else self.roughness**2

    @property
    def _width_for_light(self) -> float:
        """Width of the lobe if the shader at the output is a Diffuse or Principled BSDF."""
        if self.is_default:
            return math.inf
        shader = self.output
        if shader is None or "Roughness" not in shader.inputs:
            return 0.0
        if shader.kind == "Diffuse":
            return math.inf
        known = shader.kind == "Principled" and shader.roughness is not None
        return (shader.roughness or 0.0) ** 2 if known else 0.0

    @cached_property
    def glint_slope(self) -> float:
        """RMS slope of the narrowest lobe that can outshine the rest of the surface.

        0 for diffuse surfaces, clutter models, mirrors, and where a node sets the roughness.
        """
        if self.is_radar:
            width = self.lobe_width
            return width / math.sqrt(2) if SHARP**2 < width <= 1 else 0.0
        width = min((one.outshining_width for one in self.shaders), default=math.inf)
        return 0.0 if math.isinf(width) else width / math.sqrt(2)

    @cached_property
    def reflectance(self) -> float:
        """Fraction of the power that the lobe of a Radar Material reflects at normal incidence.

        0 for materials made for light, and where nodes set the index.
        """
        if self.n is None or self.kappa is None:
            return 0.0
        found = float(unpolarised_reflectance(self.index, 1.0))
        return found if self.specularity is None else found * self.specularity

    @cached_property
    def reciprocal_lobe(self) -> float:
        """Width of the lobe if it scatters alike in both directions.

        0 also where Fresnel's equations are those of one of the two directions.
        """
        if self.exponent is not None:
            return 0.0
        if self.kind == "light":
            return self._reciprocal_for_light
        if self.n is None or self.kappa is None or self.roughness is None:
            return 0.0
        if self.kind == "physical":
            smooth = self.roughness <= SMOOTH_BELOW
            if self.clutter is not None:
                return math.inf if smooth else 0.0
            return 0.0 if smooth else self.roughness**2
        if self.kind != "simple" or abs(self.index) < _METAL:
            return 0.0
        width = self._lobe_width
        return width if self.roughness > SHARP or math.isinf(width) else 0.0

    @property
    def _reciprocal_for_light(self) -> float:
        if not self.shaders:
            return self._width_for_light
        shader = self.shaders[0]
        turned = shader.inputs.get("Normal", 0.0) is None
        if len(self.shaders) > 1 or "Roughness" not in shader.inputs or turned:
            return 0.0
        if shader.kind == "Diffuse":
            return math.inf
        roughness = shader.roughness
        if shader.kind not in _RECIPROCAL or roughness is None or roughness <= SHARP:
            return 0.0
        return roughness**2

    @property
    def has_rough_facets(self) -> bool:
        """Whether it has facets with Fresnel's equations of their own: physical, and not smooth."""
        if self.kind != "physical":
            return False
        return self.roughness is None or self.roughness > SMOOTH_BELOW or self.rough.slope > 0

    def scattered_lobe(self) -> ScatteredLobe | None:
        """Return the directive lobe; None without one.

        Raises ConfigError if the exponent cannot be used, or it scatters nothing by such a lobe.
        """
        if self.exponent is None:
            return None
        try:
            return self._directive(lobe_exponent(self.exponent))
        except ConfigError as error:
            raise ConfigError(f"Material {self.name!r}: {error}") from error

    def _directive(self, exponent: int) -> ScatteredLobe:
        if self.clutter is not None:
            raise ConfigError(
                "It has a clutter model and a scattered lobe. Take one of the two away: "
                'set_clutter(material, "none") or set_scattered_lobe(material, None).'
            )
        needed = [self.n, self.kappa, self.roughness]
        if self.kind == "simple":
            needed.append(self.specularity)
        if self.kind not in ("simple", "physical") or None in needed:
            raise ConfigError(
                "A scattered lobe needs a Radar Material, simple or physical, without the "
                "thickness of a thin sheet, whose inputs are numbers. Choose such a material, or "
                "remove the links."
            )
        mirror, roughness = self.mirror, self.roughness or 0.0
        if self.kind == "simple":
            share = self.specularity or 0.0
            if share >= 1:
                raise ConfigError(
                    "A scattered lobe needs a Specularity below 1: it holds the other part of the "
                    "power. Effective roughness with the parameter S is a Specularity of 1 - S^2."
                )
            mirror = mirror or MirrorMaterial(self.index, share, False)
            alpha = 0.0 if roughness <= SHARP else roughness**2
            return ScatteredLobe(exponent, mirror, alpha, False)
        if mirror is None or mirror.rms_height_m == 0:
            raise ConfigError(
                "A scattered lobe of a physical material holds what the RMS height of a mirror "
                "takes from its image: expected an RMS height above 0, and no correlation length "
                "and slope."
            )
        if not self.has_clutter_row:
            raise ConfigError(
                "A scattered lobe needs the Clutter Row of the physical Radar Material as a "
                "number: it is linked, or the node group is of an earlier version. Assign the "
                "material again."
            )
        return ScatteredLobe(exponent, mirror, 0.0, True)

    # How bright it is in a single reflection, without its mirror and its directive lobe.

    @property
    def is_guessed(self) -> bool:
        """Whether `brightness` uses numbers that are not known.

        They are those that a node sets, and what a material made for light scatters besides the
        colour of a Diffuse BSDF.
        """
        if self.kind == "light":
            exact = self.output is not None and self.output.kind == "Diffuse"
            return self._albedo is None or not (exact or self.is_default)
        return any(getattr(self, name) is None for name in self._used)

    @property
    def _used(self) -> tuple[str, ...]:
        """Inputs that its brightness depends on."""
        if self.kind not in ("simple", "physical"):
            return ()
        both = ("n", "kappa", "roughness")
        return (*both, "specularity") if self.kind == "simple" else both

    @property
    def _albedo(self) -> float | None:
        """Albedo of a material that is no Radar Material, which is taken as a Lambert surface; None
        if it is not known.
        """
        if self.is_default:
            return _DEFAULT_ALBEDO
        if self.output is None or self.output.kind not in ("Principled", "Diffuse"):
            return None
        return self.output.albedo

    def brightness(self, angles: Angles, carrier_hz: float, polarisation: str) -> Real:
        """Return 4 pi f cos_in of n rays, with the BRDF f, as in `facet_brightness`, (n,)
        [m^2/m^2].

        If a node sets an input, the number that the input would have without the node counts.
        """
        lambert = 4 * np.maximum(angles.to_transmitter, 0.0)
        if self.kind == "sheet":
            return np.zeros(lambert.shape)
        if self.kind == "light":
            albedo = self._albedo
            return np.asarray((_GUESSED_ALBEDO if albedo is None else albedo) * lambert)
        used = {name: getattr(self, name) for name in self._used}
        number = {name: self.unlinked[name] if x is None else x for name, x in used.items()}
        index, roughness = complex(number["n"], number["kappa"]), number["roughness"]
        facets = np.zeros(lambert.shape)
        if roughness > (SHARP if self.kind == "simple" else SMOOTH_BELOW):
            slope = slope_from_roughness(roughness)
            facets = facet_brightness(
                slope, angles.to_transmitter, angles.to_receiver, angles.to_facet
            )
        if self.kind == "simple":
            share = number["specularity"]
            reflected = unpolarised_reflectance(index, angles.to_receiver)
            return np.asarray(reflected * (share * facets + (1 - share) * lambert))
        total = unpolarised_reflectance(index, angles.at_facet) * facets
        if self.clutter is not None:
            grazing_rad = np.arcsin(np.clip(angles.to_receiver, 0.0, 1.0))
            sigma0 = 10 ** (self.clutter.sigma0_db(carrier_hz, grazing_rad, polarisation) / 10)
            # a pixel's area has the cosine of the triangle
            total = total + sigma0 / np.maximum(angles.to_receiver_flat, 1e-12)
        return np.asarray(total)
