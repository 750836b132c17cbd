# SPDX-License-Identifier: GPL-3.0-or-later
"""Tiles of a frame that were measured: their sums, the powers of their cells, and their rows.

`MeasuredTiles` takes the rows of new tiles (`NewTile`) view by view: the powers of their cells go
to the error budget, the sums of `QualitySums` say how good the table is (truncated, mixed, without
a range), and the rows go to `TileCheckpoints`. These keep the last tiles in memory and the others
on disk, which bounds the memory of a frame, and lets a run that was stopped resume. Without
Blender's window, a separate thread does all this while Cycles renders (`Background`).
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import shutil
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ... import contract
from ...arrays import are_finite
from ...atomic_files import cannot_write, refuse_links, replaced
from ...contract import ReceiverRecord
from ...errors import RadarSimError
from ...findings import Finding, finding
from ...signal.decoding import in_view
from ...signal.paths import PATH_DTYPE, PathFlag, PathRows, has_images, iter_rows
from ...typed_json import file_sha256, read_record, write_record
from ..views import PowerBeyond, TracedReplicate
from .error_budget import CellGrid, ErrorBudget, ReplicatePowers
from .tiles import Tile


class Background:
    """Makes calls one after the other; they must not use Blender.

    A later `do` or `wait` raises the error of a call. Calls after it are not made. Without
    `threaded`, `do` makes each call itself.
    """

    def __init__(self, threaded: bool) -> None:
        self._threaded = threaded
        self._pool: ThreadPoolExecutor | None = None
        self._calls: deque[Future[None]] = deque()
        self._failed = False

    def do(self, call: Callable[..., None], *arguments: Any) -> None:
        if not self._threaded:
            call(*arguments)
            return
        while len(self._calls) > 1:  # what waiting calls hold is in memory
            self._calls.popleft().result()
        if self._pool is None:
            self._pool = ThreadPoolExecutor(1, "radarsim rows")
        self._calls.append(self._pool.submit(self._make, call, arguments))

    def _make(self, call: Callable[..., None], arguments: tuple[Any, ...]) -> None:
        if self._failed:
            return
        try:
            call(*arguments)
        except BaseException:
            self._failed = True
            raise

    def wait(self) -> None:
        """Return when all waiting calls are finished; raise the first error."""
        while self._calls:
            self._calls.popleft().result()

    def end(self) -> None:
        """Finish the waiting calls and end the thread. Errors are not raised."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None
        self._calls.clear()


# -------------------------------------------------------------------------------------------------
# Quality of a table of paths: what was left out, what is mixed, how exact lengths are.
# -------------------------------------------------------------------------------------------------


#: Fraction of the power in flawed rows above which there is a finding, and the relative error that
#: is tolerated if none was asked for: 0.2 dB.
_WARN_SHARE, _USUAL_ERROR = 1e-3, 0.05
#: Fraction of the power in further reflections that needs no finding: it changes a level by 0.04
#: dB. The orders just above the limit are rendered for this, so that their own power decides; that
#: of the last order followed bounds nothing, as in a corner the next one may be the brightest.
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

    `add_rows` may run in another thread than the other methods, and changes sums of its own alone.
    """

    def __init__(self) -> None:
        self.total_w = self.truncated_reflections_w = self.truncated_transparency_w = 0.0
        self.truncated_reflections_variance_w2 = self.strongest_ray_w = 0.0
        self.mixed_w = self.unranged_w = self._row_w = 0.0
        #: Power of the strongest path [W per square Blender unit].
        self.strongest_path = 0.0
        #: Power of paths over mirrors that are left out because something open is on the way.
        self.through_mirrored_w = 0.0
        #: Power of paths whose reverse begins outside of the field of view.
        self.one_way_w = 0.0
        self._bias_wm = self._sigma2_wm2 = 0.0
        self.coloured = False
        self.seen: set[int] = set()
        self.echoing: set[int] = set()
        self.bodies: set[int] = set()

    def add_view(self, traced: TracedReplicate, watts_per_unit: float) -> None:
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
        """Add the power of paths with more than the largest number of reflections.

        `strongest_path` is the power of the strongest path that was followed.
        """
        beyond_w = beyond.power * watts_per_unit
        self.total_w += beyond_w
        self.truncated_reflections_w += beyond_w
        self.truncated_reflections_variance_w2 += beyond.variance * watts_per_unit**2
        # paths that no ray met may be as strong as those that were followed
        strongest = max(beyond.strongest_ray, beyond.pixels_per_ray * strongest_path)
        self.strongest_ray_w = max(self.strongest_ray_w, strongest * watts_per_unit)

    def add_rows(self, rows: PathRows, receiver: ReceiverRecord) -> None:
        """Add the rows of a view, which is a part of the field of view."""
        power = rows["power_w"]
        # Lobes of rough surfaces fall faster than any power: at grazing incidence they leave 1e-22
        # of the strongest return of their view, range taken out, which is no echo.
        direct = (rows["order"] == 1) & (rows["transparent_depth"] == 0)
        with np.errstate(over="ignore", invalid="ignore"):
            returned = rows["power_w"] * rows["length_m"] ** 2 / rows["solid_angle_sr"]
            strongest = np.max(returned, initial=0.0, where=direct & np.isfinite(returned))
            echoes = ~(direct & (returned < _FAINTEST * strongest))
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
        """Return the sums by name. The sets are not included."""
        return {k: float(v) for k, v in vars(self).items() if not isinstance(v, set)}

    @classmethod
    def from_numbers(cls, numbers: Mapping[str, float], **sets: Iterable[int]) -> QualitySums:
        """Make the sums from what `numbers` returned; `sets` has the sets by name."""
        found = cls()
        for name, value in numbers.items():
            setattr(found, name, value)
        found.coloured = bool(found.coloured)
        for name, members in sets.items():
            getattr(found, name).update(members)
        return found

    @classmethod
    def joined(cls, parts: Iterable[QualitySums]) -> QualitySums:
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
        """Return a power as a fraction of the total power; 0 if the total is 0."""
        return watts / self.total_w if self.total_w > 0 else 0.0

    @property
    def truncated_reflections_stderr(self) -> float:
        """Standard error of the fraction of power in reflections that were not followed."""
        return self.share(float(np.sqrt(self.truncated_reflections_variance_w2)))

    @property
    def truncated_reflections_upper(self) -> float:
        """Upper bound of that fraction at 95 % confidence.

        The error of the power that rays found is normal. Paths so rare that no ray met them have
        the bound of the rule of three: fewer than 3 of them are expected, each at most as strong as
        the strongest path that was found (Hanley and Lippman-Hand 1983).
        """
        stderr_w = float(np.sqrt(self.truncated_reflections_variance_w2))
        more_w = _SIGMAS_95 * stderr_w + _UNSEEN_95 * self.strongest_ray_w
        upper_w = self.truncated_reflections_w + more_w
        return upper_w / (self.total_w + more_w) if upper_w > 0 else 0.0

    @property
    def length_sigma_m(self) -> float:
        """RMS of the standard deviation of path lengths [m], weighted with the power."""
        return float(np.sqrt(self._sigma2_wm2 / self._row_w)) if self._row_w > 0 else 0.0

    @property
    def mixed_bias_bound_m(self) -> float:
        """Upper bound of the mean range error that mixed pixels cause [m], weighted
        with the power.
        """
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
        """Return the findings about the quality of this frame; `objects` has the names of objects
        1, 2, ...

        Missing or mixed power up to the fraction `tolerated` is only information. This is the error
        that the user asked for; 0: `_USUAL_ERROR`.
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
        if (fraction := self.share(self.truncated_transparency_w)) > _WARN_SHARE:
            found.append(told(finding("transparency-truncated", fraction=fraction), fraction))
        if (fraction := self.share(self.through_mirrored_w)) > _WARN_SHARE:
            found.append(told(finding("mirror-way-through", fraction=fraction), fraction))
        if (fraction := self.share(self.one_way_w)) > _WARN_SHARE:
            found.append(told(finding("reverse-outside-view", fraction=fraction), fraction))
        if (fraction := self.share(self.mixed_w)) > _WARN_SHARE:
            found.append(told(finding("mixed-paths", fraction=fraction), fraction))
        unranged = self.share(self.unranged_w)
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


def _numbers(column: NDArray[np.integer[Any]]) -> list[int]:
    """Return the different numbers in a column, in rising order; all are 0 or more."""
    there = np.zeros(int(column.max(initial=-1)) + 1, dtype=bool)
    there[column] = True
    found: list[int] = np.flatnonzero(there).tolist()
    return found


# -------------------------------------------------------------------------------------------------
# Tiles of an unfinished frame: the last ones in memory, the others on disk. Does not import bpy.
#
# On disk, a tile is its rows, as they are in memory, and a record next to them, written last: a
# tile with a record is whole. Tiles are written when they take too much memory, after some
# seconds, or when the run is stopped: a frame that takes no longer leaves no files of them.
# -------------------------------------------------------------------------------------------------


#: Rows read at a time.
_CHUNK = 1 << 17
#: Most memory that tiles take [bytes], and the longest time that they are in memory alone [s]: what
#: a process that is killed loses. Writing and reading them again takes longer than their sums.
_MOST_HELD, _LONGEST_HELD_S = 192 << 20, 20.0


@dataclass(frozen=True)
class TileRecord:
    """The record of a measured tile: all but its rows.

    `rows` counts them replicate by replicate; `quality` are the sums of `QualitySums`; `renders`
    and `seconds` are its cost; `sha256` is that of the file of its rows.
    """

    rows: list[int]
    quality: dict[str, float]
    seen: list[int] = field(default_factory=list)
    echoing: list[int] = field(default_factory=list)
    bodies: list[int] = field(default_factory=list)
    renders: int = 0
    seconds: float = 0.0
    sha256: str = ""
    schema: str = "radarsim/tile"
    schema_version: int = contract.SCHEMA_VERSION

    def sums(self) -> QualitySums:
        return QualitySums.from_numbers(
            self.quality, seen=self.seen, echoing=self.echoing, bodies=self.bodies
        )


@dataclass
class _Held:
    """A tile in memory: its rows by replicate, when they were there, its record once it is
    whole.

    For a tile too large for that, whose rows are on disk: their digest.
    """

    rows: list[PathRows]
    since_s: float
    sha256: str = ""
    record: TileRecord | None = None


class TileCheckpoints:
    """Tiles of one frame, in a folder in the frame's.

    `stamp` is all that rows depend on besides the scene (see the run's fingerprint) and the tile,
    `dtype` their type.
    """

    def __init__(
        self, frame_folder: Path, stamp: str, dtype: np.dtype[np.void] = PATH_DTYPE
    ) -> None:
        self._folder = frame_folder / contract.TILES_DIR
        fields = [one.name for one in dataclasses.fields(TileRecord)]
        self._dtype = dtype
        self._held: dict[str, _Held] = {}
        self._stamp = f"{stamp} {dtype.descr} {fields}"

    def key(self, *numbers: Any) -> str:
        """Return the name of a tile. It is a digest of the numbers that determine the rows."""
        text = f"{self._stamp} {numbers!r}".encode()
        return hashlib.blake2b(text, digest_size=12).hexdigest()

    def find(self, key: str) -> TileRecord | None:
        """Return the record of a tile if its file is complete and its digest matches; else None."""
        try:
            record = read_record(self._folder / f"{key}.json", TileRecord)
            whole = file_sha256(self.rows_file(key)) == record.sha256
        except (RadarSimError, OSError):
            return None
        return record if whole else None

    def rows_file(self, key: str) -> Path:
        return self._folder / f"{key}.rows"

    @contextlib.contextmanager
    def writer(self, key: str) -> Iterator[TileWriter]:
        """Open a tile for writing. Rows are added replicate by replicate. After an error, no file
        is left.
        """
        with contextlib.ExitStack() as stack:

            def open_file() -> BinaryIO:
                refuse_links(self._folder, within=self._folder.parent)
                try:
                    self._folder.mkdir(exist_ok=True)
                except OSError as error:
                    raise cannot_write(self._folder, error) from error
                # no sync: who finds a tile compares its digest
                temporary = stack.enter_context(replaced(self.rows_file(key), sync=False))
                return stack.enter_context(open(temporary, "wb"))

            writer = TileWriter(open_file, lambda size: self._write_oldest(_MOST_HELD - size))
            yield writer
        self._held[key] = _Held(writer.rows, time.monotonic(), writer.sha256)

    def keep(self, key: str, record: TileRecord) -> None:
        """Keep the record of a complete tile, and write tiles that were in memory for too long."""
        self._held[key].record = record
        now_s = time.monotonic()
        for name, held in list(self._held.items()):
            since_s = min(held.since_s, now_s - record.seconds) if name == key else held.since_s
            if held.sha256 or now_s - since_s > _LONGEST_HELD_S:
                self._write(name)
        self._write_oldest(_MOST_HELD)

    def _write_oldest(self, most: int) -> None:
        """Write complete tiles, the oldest first, until the rest takes at most `most` bytes of
        memory.
        """
        sizes = {key: sum(rows.nbytes for rows in held.rows) for key, held in self._held.items()}
        size = sum(sizes.values())
        for key, own in sizes.items():
            if size <= most:
                return
            size -= own
            self._write(key)

    def write(self) -> None:
        """Write all complete tiles that are in memory.

        If a tile cannot be written, a later session measures it again.
        """
        with contextlib.suppress(OSError, RadarSimError):
            for key in [key for key, held in self._held.items() if held.record is not None]:
                self._write(key)

    def _write(self, key: str) -> None:
        held = self._held.pop(key)
        assert held.record is not None
        digest = held.sha256
        if not digest:
            with self.writer(key) as part:
                part.rows = held.rows
                part.spill()
            digest = self._held.pop(key).sha256
        record = dataclasses.replace(held.record, sha256=digest)
        write_record(self._folder / f"{key}.json", record, sync=False)

    def replicates(self, key: str, record: TileRecord) -> Iterator[PathRows]:
        """Yield the rows of a tile, one replicate after the other."""
        with open(self.rows_file(key), "rb") as stream:
            while (rows := PathRows.read(stream, self._dtype)) is not None:
                yield rows

    def chunks(self, key: str, tile: int) -> Iterator[PathRows]:
        """Yield the rows of a tile in chunks, with the number that the tile has in this run.

        The caller may change the rows, because they are not written again.
        """
        if key in self._held:
            held = self._held[key].rows
            if len(held) > 1 and sum(rows.size for rows in held) <= _CHUNK:
                held = [PathRows.joined(held)]
            for rows in held:
                rows["tile"] = tile
                yield from iter_rows(rows, _CHUNK)
            return
        with open(self.rows_file(key), "rb") as stream:
            while (part := PathRows.read(stream, self._dtype)) is not None:
                part["tile"] = tile
                yield from iter_rows(part, _CHUNK)

    def remove(self) -> None:
        """Remove all tiles: the frame is complete, or is not needed any more."""
        self._held.clear()
        shutil.rmtree(self._folder, ignore_errors=True)


class TileWriter:
    """Collects the rows of a tile, in a file if they are too many for memory.

    `open_file` opens it, `make_room` gets the bytes that the rows take; `rows` are those in memory,
    by replicate.
    """

    def __init__(self, open_file: Callable[[], BinaryIO], make_room: Callable[[int], None]) -> None:
        self._open_file, self._make_room = open_file, make_room
        self._stream: BinaryIO | None = None
        self._digest = hashlib.sha256()
        self.rows: list[PathRows] = []

    def add(self, rows: PathRows) -> None:
        self.rows.append(rows)
        size = sum(part.nbytes for part in self.rows)
        if self._stream is not None or size > _MOST_HELD:
            self.spill()
        else:
            self._make_room(size)

    def spill(self) -> None:
        """Write the rows in memory to the file."""
        if self._stream is None:
            self._stream = self._open_file()
        for rows in self.rows:
            rows.write(self._stream, self._digest)
        self.rows = []

    @property
    def sha256(self) -> str:
        """Digest of the file; empty if the rows are only in memory."""
        return "" if self._stream is None else self._digest.hexdigest()


@dataclass(frozen=True)
class MeasuredTile:
    """A measured tile, the key of its stored rows, the number of rows, and their sums."""

    tile: Tile
    key: str
    rows: int
    quality: QualitySums


@dataclass
class NewTile:
    """A tile whose replicates are being measured: sums over its views, and rows by replicate."""

    number: int
    tile: Tile
    key: str
    quality: QualitySums = field(default_factory=QualitySums)
    powers: list[ReplicatePowers] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)
    writer: TileWriter | None = None
    open: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)


class MeasuredTiles:
    """Measured tiles by number.

    `parts` stores the rows; each tile has `count` replicates. `budget` gets the powers of the cells
    of `grid`. If `threaded`, a separate thread does this. After `wait`, all that was added is in
    `tiles` and in `budget`.
    """

    def __init__(
        self,
        parts: TileCheckpoints,
        grid: CellGrid,
        budget: ErrorBudget,
        receiver: ReceiverRecord,
        count: int,
        threaded: bool,
    ) -> None:
        self._parts, self._grid, self._budget = parts, grid, budget
        self._receiver, self._count = receiver, count
        self._background = Background(threaded)
        self.tiles: dict[int, MeasuredTile] = {}

    def add_rows(self, new: NewTile, views: Sequence[PathRows]) -> None:
        """Add the rows of replicates. The caller must not change these rows afterwards."""
        self._background.do(self._add_rows, new, views)

    def _add_rows(self, new: NewTile, views: Sequence[PathRows]) -> None:
        new.powers += self._grid.powers_of_views(views, self._count, self._receiver)
        for rows in views:
            new.quality.add_rows(rows, self._receiver)
            new.sizes.append(rows.size)
            if new.writer is None:
                new.writer = new.open.enter_context(self._parts.writer(new.key))
            new.writer.add(rows)

    def keep(self, new: NewTile, renders: int, seconds: float) -> None:
        """Keep a tile after its last replicate, with the number and the time of its renders."""
        self._background.do(self._keep, new, renders, seconds)

    def _keep(self, new: NewTile, renders: int, seconds: float) -> None:
        new.open.close()
        sums = new.quality
        record = TileRecord(
            new.sizes,
            sums.numbers(),
            sorted(sums.seen),
            sorted(sums.echoing),
            sorted(sums.bodies),
            renders,
            seconds,
        )
        self._parts.keep(new.key, record)
        self._take(new.number, new.tile, new.key, record, new.powers)

    def drop(self, new: NewTile, error: BaseException) -> None:
        """Remove the file of a tile that could not be measured."""
        self._background.end()
        with contextlib.suppress(BaseException):
            new.open.__exit__(type(error), error, error.__traceback__)

    def take_again(self, number: int, tile: Tile, key: str, record: TileRecord) -> None:
        """Use a tile that an earlier session measured."""
        self._background.do(self._take_again, number, tile, key, record)

    def _take_again(self, number: int, tile: Tile, key: str, record: TileRecord) -> None:
        replicates = self._parts.replicates(key, record)
        count, receiver = self._count, self._receiver
        powers = [self._grid.replicate_powers(rows, count, receiver) for rows in replicates]
        self._take(number, tile, key, record, powers)

    def _take(
        self,
        number: int,
        tile: Tile,
        key: str,
        record: TileRecord,
        powers: Sequence[ReplicatePowers],
    ) -> None:
        self.tiles[number] = MeasuredTile(tile, key, sum(record.rows), record.sums())
        self._budget.powers[number] = self._grid.powers(powers)

    def remove(self, number: int) -> None:
        """Remove a tile from the frame; finer tiles replace it."""
        del self.tiles[number], self._budget.powers[number]

    def wait(self) -> None:
        """Return when all tiles are computed and written; raise the first error."""
        self._background.wait()

    def end(self) -> None:
        """End the thread; errors are not raised."""
        self._background.end()

    def quality(self) -> QualitySums:
        return QualitySums.joined(measured.quality for measured in self.tiles.values())

    def chunks(self) -> Iterator[PathRows]:
        for number, measured in self.tiles.items():
            yield from self._parts.chunks(measured.key, number)
