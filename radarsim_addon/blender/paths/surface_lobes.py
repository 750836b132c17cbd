# SPDX-License-Identifier: GPL-3.0-or-later
"""Lobes of surfaces that Cycles does not have: weights of the lobes that it renders instead.

A clutter model: the lobe of :mod:`..nodes.clutter_lobe` is exact in backscatter. Into another
direction it is a Lambert lobe of the albedo that is seen. A vertex with the grazing angles psi_s
towards the previous vertex (on the receiver's side) and psi_i towards the next one has the weight

    w = (f + sigma_b / (4 pi sin psi_i sin psi_s)) / (f + rho(psi_s) / pi)

with f what the rough interface scatters, and sigma_b = sqrt(sigma0(psi_i) sigma0(psi_s)), which is
reciprocal.

A directive lobe: the scattered fraction of the power at psi_i, in the directive lobe of
:mod:`...physics.directive_lobes`, takes the place of the Lambert lobe of a simple material, or of
the table of a slightly rough mirror.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...array_types import Mask, Real
from ...errors import ConfigError
from ...physics.clutter import ClutterModel
from ...physics.directive_lobes import directive_lobe
from ...physics.facets import facet_scattering
from ...physics.fresnel import unpolarised_reflectance
from ...vectors import dots
from ..materials import EXACT_FACETS, ScatteredLobe
from ..nodes.clutter_lobe import TABLE_WIDTH
from ..nodes.group_search import group_input
from ..nodes.physical_material import EXTINCTION, INDEX, ROUGHNESS, SMOOTH_BELOW

#: Cosine between the direction of a mirrored ray and a segment above which a smooth surface has
#: reflected it like a mirror: 1 minus the square of what Cycles rounds, over 2.
_MIRRORED = 1 - 1e-9
#: An index at which all is reflected.
_CONDUCTOR = complex(1e12)

#: Sines of grazing angles towards the vertex before and the one after, (n,) each.
Sines = tuple[Real, Real]


def is_mirrored(sines: Sines, back: Real, onward: Real) -> Mask:
    """Whether a smooth surface mirrors unit vectors from a vertex into each other, (n,).

    `sines` are their products with the normal.
    """
    found = 2 * sines[0]
    found *= sines[1]
    found -= dots(back, onward)
    return np.asarray(found >= _MIRRORED)


@dataclass(frozen=True)
class _Table:
    """sigma0 by grazing angle, as the lobe of a table gives it."""

    table_db: Real

    @cached_property
    def _steps(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """ln sigma0 half a column before each and after the last, and steps to the next."""
        levels = np.pad(self.table_db * (np.log(10) / 10), 1, mode="edge").astype(np.float32)
        return levels[:-1], np.diff(levels)

    def log_sigma0(self, sine: Real) -> NDArray[np.float32]:
        """Natural logarithm at sines of grazing angles, (n,), as the image gives it: linear.

        float32 is within 1e-4 dB of the same line in float64.
        """
        angle = np.minimum(sine, 1.0)
        np.arcsin(angle, out=angle)
        angle *= 2 / np.pi * TABLE_WIDTH**3
        column = angle.astype(np.float32)
        np.cbrt(column, out=column)
        column += np.float32(0.5)
        left = column.astype(np.intp)
        levels, steps = self._steps
        column -= np.trunc(column)
        column *= steps.take(left)
        column += levels.take(left)
        return column

    def sigma0(self, sine: Real) -> Real:
        """At sines of grazing angles."""
        return np.exp(self.log_sigma0(sine), dtype=np.float64)

    def albedo(self, sigma0: Real, sine: Real, seen_first: bool) -> Real:
        """Of the rendered lobe, which is limited beyond the first vertex."""
        found = sigma0 / (4 * sine**2)
        return found if seen_first else np.minimum(found, 1.0)


@dataclass(frozen=True)
class ClutterLobe(_Table):
    """Of a material with a clutter model: what Cycles renders of it, and its limits."""

    material: str
    model: ClutterModel
    index: complex
    alpha: float

    def weights(
        self, sines: Sines, normal: Real, back: Real, onward: Real, seen_first: bool
    ) -> Real:
        """Weights of vertices with unit vectors to both neighbours, (n,).

        `sines` are their products with the normal. `seen_first`: the receiver sees the vertex
        itself, and the albedo is not limited.
        """
        sine_s, sine_i = sines
        level_s, level_i = self.log_sigma0(sine_s), self.log_sigma0(sine_i)
        # what the lobe is to be over a Lambert lobe of the albedo that is seen
        ratio = np.exp((level_i - level_s) / 2) * sine_s / sine_i
        if self.alpha == 0 and seen_first:
            return ratio
        seen = np.exp(level_s, dtype=np.float64)
        lambert, rendered = (self.albedo(seen, sine_s, both) / np.pi for both in (True, seen_first))
        facets: Real | float = 0.0
        if self.alpha > 0:
            facets = facet_scattering(self.index, self.alpha, normal, back, onward, EXACT_FACETS)
        return np.asarray((facets + lambert * ratio) / (facets + rendered))


@dataclass(frozen=True)
class DirectiveLobe(_Table):
    """Of a material with a directive lobe; the table is empty for a simple material."""

    lobe: ScatteredLobe
    polarisation: str
    wavelength_m: float

    @classmethod
    def of(cls, lobe: ScatteredLobe, polarisation: str, wavelength_m: float) -> DirectiveLobe:
        """Of the lobe of a material in a run."""
        table_db = np.zeros(0)
        if lobe.from_table:
            table_db = _as_rendered(lobe.table_db(wavelength_m))
        return cls(table_db, lobe, polarisation, wavelength_m)

    @property
    def alpha(self) -> float:
        """Width of the glossy lobe; 0: a mirror."""
        return self.lobe.alpha

    def weights(
        self, sines: Sines, normal: Real, back: Real, onward: Real, seen_first: bool
    ) -> Real:
        """As those of `ClutterLobe`; waves come from `onward`."""
        lobe, sine_s = self.lobe, sines[0]
        facets = np.zeros(sine_s.size)
        if self.table_db.size:
            albedo = self.albedo(self.sigma0(sine_s), sine_s, seen_first)
        else:
            seen = unpolarised_reflectance(lobe.mirror.index, np.minimum(sine_s, 1.0))
            albedo = (1 - lobe.mirror.share) * seen
            if lobe.alpha > 0:
                facets = facet_scattering(_CONDUCTOR, lobe.alpha, normal, back, onward)
                facets = lobe.mirror.share * seen * facets
        scattered = lobe.scattered(onward, normal, self.polarisation, self.wavelength_m)
        directive = directive_lobe(lobe.exponent, normal, onward, back)
        return (facets + scattered * directive) / (facets + albedo / np.pi)


def clutter_lobe(material: Any, model: ClutterModel, table_db: Real) -> ClutterLobe:
    """The lobe of a material with a clutter model and the table of the run."""

    def value(name: str) -> float:
        socket = group_input(material, name)
        if socket is None:
            raise ConfigError(
                f"Material {material.name!r} has a clutter model and a link at {name}, so the "
                "scattering into other directions is unknown. Remove the link."
            )
        return float(socket.default_value)

    roughness = value(ROUGHNESS)
    index = complex(value(INDEX), value(EXTINCTION))
    alpha = roughness**2 if roughness > SMOOTH_BELOW else 0.0
    return ClutterLobe(_as_rendered(table_db), material.name, model, index, alpha)


def _as_rendered(table_db: Real) -> Real:
    """A table as its image rounds it."""
    return table_db.astype(np.float32).astype(np.float64)
