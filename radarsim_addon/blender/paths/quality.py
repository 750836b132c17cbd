# SPDX-License-Identifier: GPL-3.0-or-later
"""How good a table of paths is: what was left out, what is mixed, how exact lengths are.

Does not import bpy.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...contract import ReceiverRecord
from ...findings import Finding, finding
from ...signal.paths import PathFlag, PathRows, has_images
from ...vectors import are_finite
from ..views import PowerBeyond, TracedReplicate
from .same_point import in_view

#: Fraction of the power that may be in flawed rows before the run says so, and the relative error
#: that nobody minds if none was asked for: 0.2 dB.
_WARN_SHARE, _USUAL_ERROR = 1e-3, 0.05
#: Fraction of the power in further reflections up to which nothing is said: it changes a level by
#: 0.04 dB. The orders just above the limit are rendered for this, so that their own power decides;
#: that of the last order followed bounds nothing, as in a corner the next one may be the brightest.
_NEGLIGIBLE = 0.01
#: Standard deviations of a normal distribution, and expectation of a Poisson distribution without a
#: single event, at a one-sided confidence of 95 %.
_SIGMAS_95, _UNSEEN_95 = 1.645, 2.996
#: A length error above this fraction of a wavelength spoils coherent sums: 2 pi / 20 of phase.
_WARN_WAVELENGTHS = 0.05
#: Below this fraction of the strongest return in a view, a surface seen directly has no echo.
_FAINTEST = 1e-12


class QualitySums:
    """Sums over views and rows; sums of tiles add up to those of the frame.

    `add_rows` runs in a thread besides the other methods, and so changes sums of its own alone.
    """

    def __init__(self) -> None:
        self.total_w = self.truncated_reflections_w = self.truncated_transparency_w = 0.0
        self.truncated_reflections_variance_w2 = self.strongest_ray_w = 0.0
        self.mixed_w = self.unranged_w = self._row_w = 0.0
        #: Power of the strongest path [W per square Blender unit].
        self.strongest_path = 0.0
        #: Power of paths over mirrors that go through something open on the way: left out.
        self.through_mirrored_w = 0.0
        #: Power of paths whose reverse begins outside of the field of view.
        self.one_way_w = 0.0
        self._bias_wm = self._sigma2_wm2 = 0.0
        self.coloured = False
        self.seen: set[int] = set()
        self.echoing: set[int] = set()
        self.bodies: set[int] = set()

    def add_view(self, traced: TracedReplicate, watts_per_unit: float) -> None:
        """Add what a view found; `watts_per_unit` turns its powers into watts."""
        self.total_w += traced.total * watts_per_unit
        self.truncated_reflections_w += traced.truncated_reflections * watts_per_unit
        self.truncated_transparency_w += traced.truncated_transparency * watts_per_unit
        self.strongest_path = max(self.strongest_path, traced.strongest)
        self.coloured |= traced.coloured
        if traced.open_view is not None and traced.open_view.object_index is not None:
            self.seen.update(_numbers(traced.open_view.object_index))

    def add_beyond(
        self, beyond: PowerBeyond, watts_per_unit: float, strongest_path: float = 0.0
    ) -> None:
        """Add the power beyond the last order; `strongest_path` is that of a followed one."""
        beyond_w = beyond.power * watts_per_unit
        self.total_w += beyond_w
        self.truncated_reflections_w += beyond_w
        self.truncated_reflections_variance_w2 += beyond.variance * watts_per_unit**2
        # paths that no ray met may be as strong as those that were followed
        strongest = max(beyond.strongest_ray, beyond.pixels_per_ray * strongest_path)
        self.strongest_ray_w = max(self.strongest_ray_w, strongest * watts_per_unit)

    def add_rows(self, rows: PathRows, receiver: ReceiverRecord) -> None:
        """Add the rows of a view, which is a part of the receiver's field of view."""
        power = rows["power_w"]
        echoes = ~_next_to_nothing(rows)
        for name in ("last_object", "first_object"):
            self.echoing.update(_numbers(rows[name][echoes]))
        for name in ("last_body", "first_body"):
            self.bodies.update(_numbers(rows[name]))
        flags = rows["flags"]
        mixed = np.flatnonzero(flags & PathFlag.MIXED)
        self._row_w += float(power.sum())
        self.mixed_w += float(power[mixed].sum())
        self.unranged_w += float(power[flags & PathFlag.NO_RANGE != 0].sum())
        reversible = flags & PathFlag.HAS_REVERSE != 0
        if has_images(rows):
            reversible &= rows["transmitter_image"] == 0
        both = np.flatnonzero(reversible & (receiver.kind != "orthographic"))
        last_m = rows["last_scatterer_m"][both]
        outside = are_finite(last_m) & ~in_view(last_m, receiver)
        self.one_way_w += float(power[both[outside]].sum())
        # A mixture's range lies between those mixed: it is off by less than the path's own length.
        self._bias_wm += float(np.sum(power[mixed] * rows["length_m"][mixed] / 2))
        sigma = rows["length_sigma_m"].astype(np.float64)
        self._sigma2_wm2 += float(np.sum(power * sigma**2))

    def numbers(self) -> dict[str, float]:
        """The sums by name; sets left out."""
        return {k: float(v) for k, v in vars(self).items() if not isinstance(v, set)}

    @classmethod
    def from_numbers(cls, numbers: Mapping[str, float], **sets: Iterable[int]) -> QualitySums:
        """What `numbers` gave, and the sets by name."""
        found = cls()
        for name, value in numbers.items():
            setattr(found, name, value)
        found.coloured = bool(found.coloured)
        for name, members in sets.items():
            getattr(found, name).update(members)
        return found

    @classmethod
    def joined(cls, parts: Iterable[QualitySums]) -> QualitySums:
        """Sums of several tiles."""
        total = cls()
        for part in parts:
            for name, value in vars(part).items():
                if isinstance(value, set):
                    getattr(total, name).update(value)
                elif name.startswith("strongest"):
                    setattr(total, name, max(getattr(total, name), value))
                else:
                    setattr(total, name, getattr(total, name) + value)
        total.coloured = bool(total.coloured)
        return total

    def share(self, watts: float) -> float:
        """Part of the total power, 0 where there is none."""
        return watts / self.total_w if self.total_w > 0 else 0.0

    @property
    def truncated_reflections_stderr(self) -> float:
        """Standard error of the fraction of the power in reflections that were not followed."""
        return self.share(float(np.sqrt(self.truncated_reflections_variance_w2)))

    @property
    def truncated_reflections_upper(self) -> float:
        """Upper bound of the same fraction at 95 % confidence.

        What the rays found has a normal error. Paths so rare that no ray met them have the bound of
        the rule of three: their expected number is below 3, each at most as strong as the
        strongest that was found (Hanley and Lippman-Hand 1983).
        """
        stderr_w = float(np.sqrt(self.truncated_reflections_variance_w2))
        more_w = _SIGMAS_95 * stderr_w + _UNSEEN_95 * self.strongest_ray_w
        upper_w = self.truncated_reflections_w + more_w
        return upper_w / (self.total_w + more_w) if upper_w > 0 else 0.0

    @property
    def length_sigma_m(self) -> float:
        """Power-weighted rms of the standard deviation of a path's length [m]."""
        return float(np.sqrt(self._sigma2_wm2 / self._row_w)) if self._row_w > 0 else 0.0

    @property
    def mixed_bias_bound_m(self) -> float:
        """Upper bound of the power-weighted mean range error from mixed pixels [m]."""
        return self._bias_wm / self._row_w if self._row_w > 0 else 0.0

    def record_fields(self, wavelength_m: float) -> dict[str, Any]:
        """Return the fields of `contract.PathsRecord` that say how good a frame is."""
        return {
            "coloured": self.coloured,
            "total_power_w": self.total_w,
            "truncated_reflections_fraction": self.share(self.truncated_reflections_w),
            "truncated_reflections_stderr": self.truncated_reflections_stderr,
            "truncated_reflections_upper": self.truncated_reflections_upper,
            "truncated_transparency_fraction": self.share(self.truncated_transparency_w),
            "mixed_power_fraction": self.share(self.mixed_w),
            "unranged_power_fraction": self.share(self.unranged_w),
            "mixed_bias_bound_m": self.mixed_bias_bound_m,
            "length_sigma_m": self.length_sigma_m,
            "length_sigma_wavelengths": self.length_sigma_m / wavelength_m,
        }

    def findings(
        self, wavelength_m: float, objects: Sequence[str] = (), tolerated: float = 0.0
    ) -> list[Finding]:
        """Find what to know of this frame; `objects` names the numbers from 1.

        What is missing or mixed is no danger up to the error that was asked for, `tolerated`; where
        none was, up to `_USUAL_ERROR`.
        """
        found = []

        def told(item: Finding, fraction: float) -> Finding:
            return item if fraction > (tolerated or _USUAL_ERROR) else item.as_information()

        left, stderr = self.share(self.truncated_reflections_w), self.truncated_reflections_stderr
        upper = self.truncated_reflections_upper
        negligible = min(tolerated or _NEGLIGIBLE, _NEGLIGIBLE)
        # Rays that miss rare paths are a danger to all orders: only an error asked for counts them.
        if left + _SIGMAS_95 * stderr > negligible or upper > (tolerated or 1.0):
            lost = finding(
                "reflections-truncated",
                fraction=left,
                fraction_stderr=stderr,
                fraction_upper=upper,
            )
            # a fraction within its own standard error is no news
            found.append(told(lost, left - stderr))
        behind = self.share(self.truncated_transparency_w)
        if behind > _WARN_SHARE:
            found.append(told(finding("transparency-truncated", fraction=behind), behind))
        through = self.share(self.through_mirrored_w)
        if through > _WARN_SHARE:
            found.append(told(finding("mirror-way-through", fraction=through), through))
        one_way = self.share(self.one_way_w)
        if one_way > _WARN_SHARE:
            found.append(told(finding("reverse-outside-view", fraction=one_way), one_way))
        mixed, unranged = self.share(self.mixed_w), self.share(self.unranged_w)
        if mixed > _WARN_SHARE:
            found.append(told(finding("mixed-paths", fraction=mixed), mixed))
        if unranged > _WARN_SHARE:
            found.append(finding("unranged-power", fraction=unranged))
        if self.length_sigma_m > _WARN_WAVELENGTHS * wavelength_m:
            found.append(
                finding(
                    "phase-unreliable",
                    length_sigma_m=self.length_sigma_m,
                    length_sigma_wavelengths=self.length_sigma_m / wavelength_m,
                )
            )
        silent = [objects[n - 1] for n in sorted(self.seen - self.echoing) if 0 < n <= len(objects)]
        if silent and self.total_w > 0:
            found.append(finding("object-without-echo", *silent))
        return found


def _next_to_nothing(rows: PathRows) -> NDArray[np.bool_]:
    """Which rows seen directly are far below the strongest of their view, range taken out, (n,).

    Lobes of rough surfaces fall faster than any power: at grazing incidence they leave 1e-22.
    """
    direct = (rows["order"] == 1) & (rows["transparent_depth"] == 0)
    with np.errstate(over="ignore", invalid="ignore"):
        returned = rows["power_w"] * rows["length_m"] ** 2 / rows["solid_angle_sr"]
        strongest = np.max(returned, initial=0.0, where=direct & np.isfinite(returned))
        return np.asarray(direct & (returned < _FAINTEST * strongest))


def _numbers(column: NDArray[np.integer[Any]]) -> list[int]:
    """Different numbers from 0 in a column."""
    there = np.zeros(int(column.max(initial=-1)) + 1, dtype=bool)
    there[column] = True
    found: list[int] = np.flatnonzero(there).tolist()
    return found
