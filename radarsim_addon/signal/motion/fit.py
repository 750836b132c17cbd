# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits of sampled poses: low-degree series over a burst, which average float32 rounding.

Blender's matrices are float32. At 100 m from the world's origin that is 2 um rms, 7e-3 rad of
two-way phase at 77 GHz; a fit of p numbers to N samples reduces it by about 2 sqrt(p/N). The degree
minimises the Bayesian information criterion (Schwarz 1978): higher ones fit the rounding, lower
ones miss motion. If one series does not fit (a keyframe's corner), the burst is split where two fit
better by the same criterion. A fitted segment has a noise, and from that an error bound.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from ...arrays import Real, Single
from .body_motion import (
    BodyMotion,
    Segment,
    rotation,
    rotation_and_jacobian,
    rotation_vector,
)
from .motion_file import VertexSeries

#: Highest degree of a series.
_MAX_DEGREE = 14
#: Terms beyond a fit from which its noise is estimated.
_TERMS_BEYOND = 8
#: Standard errors by which the rate of a higher degree contradicts that of a lower one.
_CONTRADICTS = 2.0
#: Degree from which a series probably has further terms: every difference of a higher one counts.
_MANY_TERMS = 5


@dataclass(frozen=True)
class Series:
    """A least-squares series and how it fits."""

    coefficients: Real  # (degrees, columns)
    criterion: float
    residual: Real  # (samples, columns)
    spread: float  # largest standard deviation of a displacement, for unit noise; see `spread_of`
    slow: float  # noise that a fit takes for motion, see `slow_noise`
    floor: float = np.inf  # rounding below which nothing is fitted
    rate: float = 0.0  # standard deviation of the rate at the epoch, for unit noise [1/s]
    bias: float = 0.0  # what the rate at the epoch lacks, see `_rate_bias` [1/s]

    @property
    def scatter(self) -> float:
        return float(np.sqrt(np.mean(self.residual**2)))


def design_matrix(times_s: Real, start_s: float, stop_s: float, degree: int) -> Real:
    """Return Chebyshev polynomials, x = -1 at start and 1 at stop, (samples, degrees)."""
    x = 2 * (times_s - start_s) / (stop_s - start_s) - 1
    return np.asarray(chebyshev.chebvander(x, degree), dtype=np.float64)


def criterion_of(squares: float, count: int, parameters: int, floor: float) -> float:
    """Return Schwarz's criterion of a fit; `floor` is unavoidable rounding."""
    variance = squares / max(count, 1) + floor**2
    return float(count * np.log(variance) + parameters * np.log(max(count, 2)))


def degrees_for(samples: int) -> range:
    """Return the degrees to try for this number of samples."""
    return range(min(_MAX_DEGREE, max((samples - 1) // 2, 0)) + 1)


class BurstTimes(NamedTuple):
    """Times at which displacements are needed, and the epoch, at which they are 0 [s]."""

    stop_s: float
    epoch_s: float


def spread_of(
    times_s: Real, start_s: float, stop_s: float, degree: int, burst: BurstTimes
) -> tuple[float, float]:
    """Return the largest standard deviations of a displacement in a burst, and of the rate, for
    unit noise.

    The displacement is fit(t) - fit(epoch) where the fit contains the epoch, else both positions
    count; the rate is that at the epoch [1/s], 0 elsewhere.
    """
    if stop_s <= 0 or start_s >= burst.stop_s:
        return 0.0, 0.0
    design = design_matrix(times_s, start_s, stop_s, degree)
    inverse = np.linalg.pinv(design.T @ design)
    needed_s = np.linspace(max(start_s, 0.0), min(stop_s, burst.stop_s), 33)
    rows = design_matrix(needed_s, start_s, stop_s, degree)
    rate = 0.0
    if start_s <= burst.epoch_s <= stop_s:
        rows = rows - design_matrix(np.array([burst.epoch_s]), start_s, stop_s, degree)
        per_s = 2 / (stop_s - start_s)
        slopes = chebyshev.chebder(np.eye(degree + 1), axis=0)
        slope = chebyshev.chebval((burst.epoch_s - start_s) * per_s - 1, slopes) * per_s
        rate = float(np.sqrt(slope @ inverse @ slope))
    else:
        inverse = 2 * inverse
    return float(np.sqrt(np.einsum("ij,jk,ik->i", rows, inverse, rows).max())), rate


def slow_noise(times_s: Real, residual: Real, start_s: float, stop_s: float, degree: int) -> float:
    """Return the standard deviation of noise as slow as a fit: rms of the next terms.

    For white noise that is the scatter of the samples. Rounding of slow motion is a sawtooth with
    much less in the fit; motion that is not fitted adds to it.
    """
    highest = min(degree + _TERMS_BEYOND, len(times_s) - 1)
    if highest <= degree:
        return float(np.sqrt(np.mean(residual**2)))
    base = np.linalg.qr(design_matrix(times_s, start_s, stop_s, highest))[0][:, degree + 1 :]
    return float(np.sqrt(np.mean((base.T @ residual) ** 2)))


def _rate_bias(
    times_s: Real, values: Real, start_s: float, stop_s: float, degrees: range, burst: BurstTimes
) -> float:
    """Return the bias of the rate at the epoch for the lowest of some degrees; 0: no sign of one.

    A term of degree n that is lost in the noise of positions has a slope of n^2 times as much at
    the ends of a segment. Where a higher degree has another rate by more than its own error, there
    is such a term (Lepski 1991).
    """
    low = degrees[0]
    if low == 0 or not start_s <= burst.epoch_s <= stop_s:
        return 0.0
    terms = min(degrees[-1] + _TERMS_BEYOND, len(times_s) - 1)
    basis, upper = np.linalg.qr(design_matrix(times_s, start_s, stop_s, terms))
    parts = basis.T @ values
    per_s = 2 / (stop_s - start_s)
    slopes = chebyshev.chebder(np.eye(terms + 1), axis=0) * per_s
    at = chebyshev.chebval((burst.epoch_s - start_s) * per_s - 1, slopes)
    own = np.linalg.solve(upper.T, at)  # of polynomials that are orthogonal at the samples
    rates = np.cumsum(own[:, None] * parts, axis=0)
    bias = 0.0
    for n in degrees[1:3]:  # of further ones the rate is worse
        beyond = parts[n + 1 : n + 1 + _TERMS_BEYOND]
        apart = float(np.linalg.norm(rates[n] - rates[low]))
        if not len(beyond):
            break
        error = np.linalg.norm(own[: n + 1]) * np.sqrt(np.sum(beyond**2) / len(beyond))
        if low >= _MANY_TERMS or apart > _CONTRADICTS * float(error):
            bias = max(bias, apart)
    return bias


def fit_series(
    times_s: Real, values: Real, start_s: float, stop_s: float, floor: float, burst: BurstTimes
) -> Series:
    """Fit a Chebyshev series of the degree with the least criterion to (samples, columns).

    All columns get one degree; x is -1 at `start_s` and 1 at `stop_s`. Nothing below the rounding
    `floor` is fitted.
    """
    fits: list[tuple[float, Real, Real]] = []
    offset = values[0]
    shifted = values - offset
    best = 0
    for degree in degrees_for(len(times_s)):
        design = design_matrix(times_s, start_s, stop_s, degree)
        solved = np.linalg.lstsq(design, shifted, rcond=None)[0]
        residual = shifted - design @ solved
        # one column's parameters against one column's samples, summed over columns
        criterion = criterion_of(
            float(np.sum(residual**2)), values.size, (degree + 1) * values.shape[1], floor
        )
        fits.append((criterion, solved, residual))
        best = best if fits[best][0] <= criterion else degree
        if degree - best > 3:
            break

    criterion, solved, residual = fits[best]
    solved[0] += offset
    spread, rate = spread_of(times_s, start_s, stop_s, best, burst)
    slow = slow_noise(times_s, residual, start_s, stop_s, best)
    bias = _rate_bias(times_s, shifted, start_s, stop_s, range(best, len(fits)), burst)
    return Series(solved, criterion, residual, spread, slow, floor, rate, bias)


#: Minimum number of samples of a segment.
_LEAST_SAMPLES = 6
_MAX_DEPTH = 7
#: Minimum gain of two segments over one, in units of the criterion.
_SPLIT_GAIN = 20.0
#: Largest scatter of rounding, in units of the floor, which is a tenth of float32's step.
_MOST_NOISE = 20.0
#: Standard deviations in a bound.
_SIGMAS = 3.0


@dataclass(frozen=True)
class FittedSegment:
    """A segment of motion, with the series of its translation and rotation."""

    segment: Segment
    move: Series
    turn: Series

    @property
    def criterion(self) -> float:
        return self.turn.criterion + self.move.criterion


def _is_noise(fitted: FittedSegment) -> bool:
    """Return True if the residual looks like rounding: small, no slow part, no peaks."""
    for series in (fitted.move, fitted.turn):
        scatter = series.scatter
        if (
            scatter > _MOST_NOISE * series.floor
            or series.slow > 2 * scatter
            or np.abs(series.residual).max() > 8 * scatter
        ):
            return False
    return True


def split_segments(
    fit: Callable[[int, int, float], FittedSegment],
    times_s: Real,
    first: int,
    stop: int,
    stop_s: float,
    marks: list[int],
    depth: int,
) -> list[FittedSegment]:
    """Return one segment, or several if several fit better."""
    whole = fit(first, stop, stop_s)
    if depth >= _MAX_DEPTH or stop - first < 2 * _LEAST_SAMPLES or _is_noise(whole):
        return [whole]
    lowest, highest = first + _LEAST_SAMPLES, stop - _LEAST_SAMPLES
    candidates = [mark for mark in marks if lowest <= mark <= highest]
    if len(candidates) > 8:
        candidates = candidates[:: len(candidates) // 8]
    candidates.append((first + stop) // 2)

    def criterion_with(at: int) -> float:
        return fit(first, at, float(times_s[at])).criterion + fit(at, stop, stop_s).criterion

    at = min(dict.fromkeys(candidates), key=criterion_with)
    parts = [
        *split_segments(fit, times_s, first, at, float(times_s[at]), marks, depth + 1),
        *split_segments(fit, times_s, at, stop, stop_s, marks, depth + 1),
    ]
    if sum(part.criterion for part in parts) + _SPLIT_GAIN < whole.criterion:
        return parts
    return [whole]


def within_burst(fitted: Sequence[FittedSegment], span_s: float) -> list[FittedSegment]:
    """Return the segments that a burst from 0 to `span_s` touches."""
    last = len(fitted) - 1
    return [
        part
        for number, part in enumerate(fitted)
        if (part.segment.stop_s > 0 or number == last)
        and (part.segment.start_s < span_s or number == 0)
    ]


def quality_of(fitted: Sequence[FittedSegment], reach_m: float, still: bool) -> tuple[float, float]:
    """Return rms noise and bound of a displacement at the body's farthest point [m]."""
    noise = bound = 0.0
    for part in fitted:
        move, turn = part.move, part.turn
        noise = max(noise, float(np.hypot(move.scatter, turn.scatter * reach_m)))
        if still:
            # it may move by less than its rounding
            here = np.abs(move.residual).max() + reach_m * np.abs(turn.residual).max()
        else:
            here = _SIGMAS * np.hypot(move.slow * move.spread, turn.slow * reach_m * turn.spread)
        bound = max(bound, float(here))
    return noise, bound


#: Largest deviation of relative axes from orthonormal; float32 poses are within 1e-6.
_RIGID_WITHIN = 1e-5
#: Rotation from which the centre of rotation is fitted [rad].
_TURN_WITH_CENTRE = 0.3


class _Samples:
    """Poses of one body at the sample times."""

    def __init__(
        self, times_s: Real, poses: Real, floor_m: float, floor_turn: float, burst: BurstTimes
    ) -> None:
        self.times_s, self.origins, self.burst = times_s, poses[:, :3, 3], burst
        self.floor_m, self.floor_turn = floor_m, floor_turn
        axes = poses[:, :3, :3]
        try:
            relative = axes @ np.linalg.inv(axes[0])
        except np.linalg.LinAlgError:  # scaled to zero: it has no surface either
            relative = np.broadcast_to(np.eye(3), axes.shape).copy()
        gap = np.abs(relative @ relative.transpose(0, 2, 1) - np.eye(3)).max()
        self.rigid = bool(gap < _RIGID_WITHIN)
        if self.rigid:
            left, _, right = np.linalg.svd(relative)
            relative = left @ right
        self.relative = relative

    def fit(self, first: int, stop: int, stop_s: float) -> FittedSegment:
        rows = slice(first, stop)
        times_s = self.times_s[rows]
        start_s = float(times_s[0])
        move = fit_series(times_s, self.origins[rows], start_s, stop_s, self.floor_m, self.burst)
        if not self.rigid:
            flat = self.relative[rows].reshape(-1, 9)
            axes = fit_series(times_s, flat, start_s, stop_s, self.floor_turn, self.burst)
            segment = Segment(start_s, stop_s, move.coefficients, linear=axes.coefficients)
            return FittedSegment(segment, move, axes)
        turn, reference, criterion, residual = self._fit_turn(rows, start_s, stop_s)
        spread, rate = spread_of(times_s, start_s, stop_s, len(turn), self.burst)
        slow = slow_noise(times_s, residual, start_s, stop_s, len(turn))
        turning = Series(turn, criterion, residual, spread, slow, self.floor_turn, rate)
        bare = Segment(start_s, stop_s, np.zeros((1, 3)), np.zeros(3), turn, reference)
        turned = bare.orientation(times_s)
        pivot = np.zeros(3)
        if len(turn) and np.linalg.norm(bare.vector(times_s), axis=-1).max() > _TURN_WITH_CENTRE:
            move, pivot = self._fit_centre(rows, start_s, stop_s, turned, move)
        segment = Segment(start_s, stop_s, move.coefficients, pivot, turn, reference)
        return FittedSegment(segment, move, turning)

    def _fit_turn(
        self, rows: slice, start_s: float, stop_s: float
    ) -> tuple[Real, Real, float, Real]:
        """Fit phi(t) and the initial orientation by Gauss-Newton, degree by degree."""
        times_s, poses = self.times_s[rows], self.relative[rows]
        count = 3 * len(times_s)
        reference = poses[0]
        if (poses == reference).all():
            criterion = criterion_of(0.0, count, 3, self.floor_turn)
            return np.zeros((0, 3)), reference, criterion, np.zeros((len(times_s), 3))
        # Sums of small rotations are the rotation vector for a fixed axis, and near it otherwise.
        steps = rotation_vector(poses[1:] @ poses[:-1].transpose(0, 2, 1))
        summed = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        fits: list[tuple[Real, Real, float, Real]] = []
        best = 0
        for degree in degrees_for(len(times_s)):
            design = design_matrix(times_s, start_s, stop_s, degree)[:, 1:]
            basis = design - np.where(np.arange(1, degree + 1) % 2, -1.0, 1.0)
            turn = np.zeros((0, 3))
            if degree:
                turn = np.linalg.lstsq(basis, summed, rcond=None)[0]
            fitted = reference
            residual = np.zeros((len(times_s), 3))
            system = np.zeros((count, 3))
            for _ in range(4):
                vectors = basis @ turn
                exact, jacobian = rotation_and_jacobian(vectors)
                residual = rotation_vector(poses @ (exact @ fitted).transpose(0, 2, 1))
                blocks = np.einsum("nij,nk->nikj", jacobian, basis)
                system = np.concatenate(
                    [blocks.reshape(count, 3 * degree), exact.reshape(count, 3)], axis=1
                )
                # Chebyshev columns are near orthogonal: normal equations suffice
                normal, right = system.T @ system, system.T @ residual.ravel()
                step = np.linalg.lstsq(normal, right, rcond=1e-13)[0]
                turn = turn + step[:-3].reshape(degree, 3)
                fitted = rotation(step[-3:]) @ fitted
                if np.abs(step).max(initial=0.0) < 1e-11:
                    break
            residual = rotation_vector(poses @ (rotation(basis @ turn) @ fitted).transpose(0, 2, 1))
            criterion = criterion_of(
                float(np.sum(residual**2)), count, 3 * (degree + 1), self.floor_turn
            )
            fits.append((turn, fitted, criterion, residual))
            best = best if fits[best][2] <= criterion else degree
            if degree - best > 2:
                break
        return fits[best]

    def _fit_centre(
        self, rows: slice, start_s: float, stop_s: float, turned: Real, plain: Series
    ) -> tuple[Series, Real]:
        """Fit T(t) = c(t) + G(t) pivot if that takes fewer numbers than a series of T."""
        times_s, origins = self.times_s[rows], self.origins[rows]
        count = origins.size
        offset = origins[0]
        best, pivot = plain, np.zeros(3)
        columns = turned.reshape(count, 3)
        for degree in degrees_for(len(times_s)):
            if (degree + 2) * 3 > plain.coefficients.size + 3:
                break
            design = design_matrix(times_s, start_s, stop_s, degree)
            series = np.einsum("nk,ij->nikj", design, np.eye(3)).reshape(count, -1)
            system = np.concatenate([series, columns], axis=1)
            # least norm: along the axis the pivot is not distinguishable from the centre
            solved = np.linalg.lstsq(system, (origins - offset).ravel(), rcond=1e-9)[0]
            residual = ((origins - offset).ravel() - system @ solved).reshape(-1, 3)
            criterion = criterion_of(
                float(np.sum(residual**2)), count, 3 * (degree + 2), self.floor_m
            )
            if criterion < best.criterion:
                coefficients = solved[:-3].reshape(degree + 1, 3)
                coefficients[0] += offset
                spread, rate = spread_of(times_s, start_s, stop_s, degree, self.burst)
                spread += np.sqrt(6 / len(times_s))
                slow = slow_noise(times_s, residual, start_s, stop_s, degree)
                best = Series(coefficients, criterion, residual, spread, slow, self.floor_m, rate)
                pivot = solved[-3:]
        return best, pivot


def _rounding(values: NDArray[Any]) -> float:
    largest = np.float32(np.abs(values).max(initial=0.0))
    return 0.1 * float(np.spacing(max(largest, np.float32(1e-30))))


def fit_body(
    times_s: Real,
    poses: Real,
    span_s: float,
    reach_m: float,
    *,
    unit_m: float = 1.0,
    corners_s: Sequence[float] = (),
    pose: Real | None = None,
    epoch_s: float = 0.0,
) -> BodyMotion:
    """Fit the motion of one body to float32 poses (samples, 4, 4) at ascending times, which may
    begin before 0 and end after the burst of `span_s`.

    `reach_m` is the largest distance of the body's surface from its origin, `unit_m` the metres per
    Blender unit, in which translations were rounded. Motion may have corners at `corners_s`.
    Displacements are relative to `pose` at `epoch_s` (None: the first sample).
    """
    if pose is None:
        pose, epoch_s = poses[0], float(times_s[0])
    if len(times_s) < 2 or np.array_equal(poses, np.broadcast_to(pose, poses.shape)):
        return BodyMotion(pose, epoch_offset_s=epoch_s)
    floor_m = _rounding(poses[:, :3, 3] / unit_m) * unit_m
    # of turns: relative to the size of the axes
    size = float(np.linalg.norm(pose[:3, :3], axis=0).max()) or 1.0
    floor_turn = _rounding(poses[:, :3, :3]) / size
    samples = _Samples(times_s, poses, floor_m, floor_turn, BurstTimes(span_s, epoch_s))
    # indices at which a segment may begin
    marks = sorted({int(np.searchsorted(times_s, at)) for at in corners_s})
    stop_s = max(span_s, float(times_s[-1]))
    fit = functools.cache(samples.fit)  # of places that were tried, one is taken
    fitted = split_segments(fit, times_s, 0, len(times_s), stop_s, marks, 0)
    fitted = within_burst(fitted, span_s)
    segment = fitted[0].segment
    turns = len(segment.rotation) if segment.linear is None else len(segment.linear) - 1
    still = len(fitted) == 1 and turns == 0 and len(segment.translation) == 1
    noise, bound = quality_of(fitted, reach_m, still)
    if not still and noise < 0.8 * floor_m:
        # steps of the rounding that follow the samples: a bias without scatter
        bound += 10 * floor_m if any(len(part.segment.translation) > 1 for part in fitted) else 0.0
    if still:
        return BodyMotion(pose, (), noise, bound, epoch_s)
    segments = tuple(part.segment for part in fitted)
    error = max(
        float(np.hypot(p.move.slow * p.move.rate, p.turn.slow * reach_m * p.turn.rate))
        for p in fitted
    )
    bias = max(part.move.bias for part in fitted)
    return BodyMotion(pose, segments, noise, bound, epoch_s, error, bias)


def smooth_poses(known_s: Real, poses: Real, times_s: Real) -> Real:
    """Return poses (times, 4, 4) on cubics through a few known ones: constant with one, linear with
    two.
    """
    found = np.repeat(poses[:1], times_s.size, axis=0)
    if len(poses) < 2:
        return found
    found[:, :3, 3] = cubic_spline(known_s, poses[:, :3, 3])(times_s)
    axes = poses[:, :3, :3]
    turns = axes @ np.linalg.pinv(axes[0])
    if np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max() < _RIGID_WITHIN:
        from scipy.spatial.transform import Rotation, RotationSpline

        spline = RotationSpline(known_s, Rotation.from_matrix(turns))
        found[:, :3, :3] = spline(times_s).as_matrix() @ axes[0]
    else:
        found[:, :3, :3] = cubic_spline(known_s, axes)(times_s)
    return found


def cubic_spline(known_s: Real, values: Real) -> Callable[[Real], Real]:
    """Return the cubic spline through values (n, ...) at ascending times; it takes times and gives
    (times, ...).
    """
    from scipy.interpolate import CubicSpline  # not at import: slow

    spline: Callable[[Real], Real] = CubicSpline(known_s, values)
    return spline


def _vertex_series(times_s: Real, positions: Real | Single, segments: Sequence[Segment]) -> Real:
    """Return the coefficients of all vertices with the degrees of the segments."""
    vertices = positions.shape[1]
    degrees = max(len(segment.translation) for segment in segments)
    series = np.zeros((len(segments), degrees, vertices, 3))
    starts = [int(np.searchsorted(times_s, segment.start_s)) for segment in segments]
    for number, segment in enumerate(segments):
        own = len(segment.translation)
        first = starts[number]
        stop = int(np.searchsorted(times_s, segment.stop_s))
        stop += segment.stop_s >= times_s[-1]  # the last segment has the last sample, too
        design = design_matrix(times_s[first:stop], segment.start_s, segment.stop_s, own - 1)
        solver = np.linalg.pinv(design)
        for begin in range(0, vertices, 4096):
            part_m = positions[first:stop, begin : begin + 4096].astype(np.float64)
            series[number, :own, begin : begin + 4096] = np.tensordot(solver, part_m, axes=1)
    return series


def fit_vertices(
    times_s: Real,
    positions: Real | Single,
    span_s: float,
    *,
    corners_s: Sequence[float] = (),
    epoch_s: float = 0.0,
) -> tuple[VertexSeries, float, float]:
    """Fit series to the vertices of a mesh that deforms, (samples, vertices, 3) [m] in the body's
    own axes.

    All vertices have one degree and the same segments. Also returns noise and error bound [m] as
    `BodyMotion` has them; times and corners are as for `fit_body`.
    """
    count, vertices = positions.shape[:2]
    floor_m = _rounding(positions)
    spread = np.ptp(positions, axis=0).max(axis=-1)
    order = np.argsort(spread)[::-1]
    # about 400 vertices determine degree and segments of all
    chosen = np.concatenate([order[:200], order[200 :: 1 + vertices // 200]])
    some = positions[:, chosen].astype(np.float64).reshape(count, -1)
    burst = BurstTimes(span_s, epoch_s)

    def fit(first: int, stop: int, stop_s: float) -> FittedSegment:
        start_s = float(times_s[first])
        found = fit_series(times_s[first:stop], some[first:stop], start_s, stop_s, floor_m, burst)
        no_turn = Series(np.zeros((0, 3)), 0.0, np.zeros((1, 3)), 0.0, 0.0)
        return FittedSegment(Segment(start_s, stop_s, found.coefficients), found, no_turn)

    marks = sorted({int(np.searchsorted(times_s, at)) for at in corners_s})
    last_s = max(span_s, float(times_s[-1]))
    fitted = within_burst(split_segments(fit, times_s, 0, count, last_s, marks, 0), span_s)
    noise, bound = quality_of(fitted, 0.0, False)
    segments = [part.segment for part in fitted]
    edges_s = np.array([segment.start_s for segment in segments] + [segments[-1].stop_s])
    return VertexSeries(edges_s, _vertex_series(times_s, positions, segments)), noise, bound
