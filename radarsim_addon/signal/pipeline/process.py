# SPDX-License-Identifier: GPL-3.0-or-later
"""A run's folder to its products, frame by frame.

    for event in process_run("out/paper"):
        print(event)

yields a :class:`Progress` after each step and a :class:`FrameResult` after each frame. Memory is
bounded by one frame, however many there are, as long as the caller lets go of the results.

Products of an earlier processing are kept where nothing has changed. A frame's summary is written
last. It holds the fingerprint of all that the products are made of: settings, the frame's files,
and this software. Before a frame is processed again its summary is removed, so that products next
to a summary are always those that it was written for.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import importlib.metadata
import json
import os
import re
import time
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

import numpy as np

from ... import __version__
from ...atomic_files import make_folder, remove_abandoned, remove_file
from ...contract import PRODUCTS_DIR, frame_dir
from ...errors import FrameFileError, OutputError, RadarSimError
from ...findings import Finding, finding, from_json
from ...movie_file import movie_encoder
from ...typed_json import read_json
from ..maps import power_unit
from ..pictures import (
    ANTENNA_PICTURE,
    MapFile,
    animate_maps,
    common_scale,
    map_file,
    plot_antennas,
    save_figure,
)
from ..products import (
    MOST_SUMMARY_BYTES,
    SUMMARY_ENDING,
    FrameResult,
    check_cloud_packages,
    frame_file,
    remove_bag,
    remove_stale,
    write_bag,
    write_result,
)
from ..radar import make_system
from ..runs import FRAME_FIELDS, RadarFrame, Run, open_run, shared_plan
from .frame import frame_steps
from .options import AnimationFormat, ProcessOptions, ResolvedOptions

#: Options that change no file of a frame.
_OF_NO_FRAME = ("animate", "animation_format", "ros_bag")
#: In a frame's record: no product depends on it, and the record's digest does.
_RENDER_TIME = re.compile(rb'"(render_time_s|record_sha256)": *[^,}\s]*')
#: The animation of all frames' maps, in the folder of the products; it ends in its format.
_ANIMATION_NAME = "range_doppler"
#: Steps of a frame after its rings: echoes and map, products, pictures.
_STEPS_AFTER_RINGS = 3


@dataclass(frozen=True)
class Progress:
    """A step of processing.

    Attributes
    ----------
    done, total
        Steps that are done, and all steps of the whole run.
    text
        What the step did, and the time that it took.
    finding
        Why a frame was skipped.
    file
        What was written for all frames together.
    kept
        A frame whose products were there already.
    """

    done: int
    total: int
    text: str
    finding: Finding | None = None
    file: Path | None = None
    kept: KeptFrame | None = None


@dataclass(frozen=True)
class KeptFrame:
    """A frame whose products were there already; the map is for the animation."""

    frame: int
    files: tuple[Path, ...]
    findings: list[Finding]
    map: MapFile


def process_run(
    path: str | Path,
    options: ProcessOptions | None = None,
    *,
    out: str | Path | None = None,
    frames: Sequence[int] | None = None,
    allow_incomplete: bool = False,
    resume: bool = False,
) -> Generator[Progress | FrameResult, None, None]:
    """Process a run frame by frame.

    Parameters
    ----------
    path
        Folder that holds ``run.json``.
    options
        How; the defaults where None.
    out
        Folder for the products, made where missing; default ``products`` in the run's folder.
    frames
        Frames to process; all where None.
    allow_incomplete
        Skip frames whose renders are not all there, instead of raising.
    resume
        Keep products that are there, made of the same renders with the same settings by the same
        software. Such a frame yields a Progress, no result.

    Yields
    ------
    Progress or FrameResult
        Progress after each step, a result after each frame. Files of a frame, in `out`:
        ``frame_0001_amplitude_t0.exr`` and the other three products;
        ``_profile.npz`` (range_m, expected_power, coherent_power); ``_map.npz`` (doppler_hz,
        velocity_mps, range_m, power [channel, Doppler, range]); ``_summary.json``; where asked for
        ``_detections.csv`` and ``.json``, ``.h5``, ``.sigmf-data`` and ``.sigmf-meta``; pictures
        ``_rings.png``, ``_echo.png``, ``_range_profile.png``, ``_range_doppler.png``. With a
        system ``antennas.png``, and with several frames ``range_doppler.gif``, in the end.

    Raises
    ------
    RadarSimError
        One of its named kinds, see :mod:`radarsim_addon.errors`.
    """
    run = open_run(path)
    settled = (options or ProcessOptions()).for_run(run)
    chosen = [run.frame(n) for n in frames] if frames is not None else list(run.frames())
    with open_products(run, settled, out, allow_incomplete) as products:
        yield from _process_frames(replace(products, resume=resume), chosen)


def _process_frames(
    products: Products, chosen: Sequence[RadarFrame]
) -> Generator[Progress | FrameResult, None, None]:
    record, several = products.run.record, len(products.options.radar.channels) > 1
    rings = record.rings if record.sampling_mode == "rings" else 0
    steps = rings + _STEPS_AFTER_RINGS + several  # directions are a step of their own
    total, finished = steps * len(chosen), 0
    maps: list[MapFile] = []
    for frame in chosen:
        skipped = products.skipped(frame)
        if skipped is not None:
            finished += steps
            yield Progress(finished, total, f"frame {frame.number} skipped", skipped)
            continue
        kept = products.kept(frame)
        if kept is not None:
            finished += steps
            maps.append(kept.map)
            yield Progress(finished, total, f"frame {frame.number} kept", kept=kept)
            continue
        start_s = time.monotonic()
        for step, event in enumerate(products.process(frame), 1):
            if isinstance(event, FrameResult):
                maps.append(map_file(event, products.folder))
                yield event
            else:
                text = f"{event} ({time.monotonic() - start_s:.1f} s)"
                yield Progress(finished + step, total, text)
                start_s = time.monotonic()
        finished += steps
    path = products.draw_common(maps)
    if path is not None:
        yield Progress(total, total, f"animation: {path}", file=path)


@contextlib.contextmanager
def open_products(
    run: Run, options: ResolvedOptions, out: str | Path | None, allow_incomplete: bool
) -> Iterator[Products]:
    """Make the folder for a run's products. If the run is refused, no new folder remains."""
    if options.animation_format == "mp4" and options.animate is not False:
        movie_encoder()  # an error now, not after the frames
    check_cloud_packages(options.parquet, options.ros_bag)
    folder = products_folder(run, out)
    fresh = not os.path.exists(folder)  # Path.exists raises for names it cannot look at
    make_folder(folder, within=run.path if out is None else None)
    remove_abandoned(folder)
    try:
        try:
            yield Products(run, options, folder, allow_incomplete)
        finally:  # workers may have been killed
            remove_abandoned(folder)
    except RadarSimError:
        # If a folder was removed, report that, not the file error that follows from it.
        for place, kind in ((run.path, FrameFileError), (folder, OutputError)):
            if not place.is_dir():
                raise kind(
                    f"The folder {place} has vanished during the processing: it was removed or "
                    "renamed, or its drive is gone. Put it back, or process again."
                ) from None
        if fresh:
            with contextlib.suppress(OSError):  # it holds products: it stays
                folder.rmdir()
        raise


def products_folder(run: Run, out: str | Path | None) -> Path:
    """Return where products go: `out`, else a folder in that of the run."""
    return Path(out) if out is not None else run.path / PRODUCTS_DIR


@dataclass(frozen=True)
class Products:
    """The folder that a run's products go to, and how they are made; see `open_products`."""

    run: Run
    options: ResolvedOptions
    folder: Path
    allow_incomplete: bool = False
    resume: bool = False

    @functools.cached_property
    def _fingerprints(self) -> Fingerprints:
        return Fingerprints(self.run, self.options)

    def process(self, frame: RadarFrame) -> Iterator[str | FrameResult]:
        """Open, process and write a frame. Yield a text about each step, then the result."""
        options, folder, number = self.options, self.folder, frame.number
        fingerprint, summary = self._fingerprints.of(frame), self._summary(frame)
        result = yield from frame_steps(options.open(frame), options)
        # A summary tells that the others are whole and its own.
        remove_file(summary)
        try:
            files = write_result(result, folder, options.writers)
            yield f"frame {number}: products"
            if self.options.plots:
                files += write_result(result, folder, ["png"])
            yield f"frame {number}: pictures"
            remove_stale(folder, number, [*files, summary])
            result = replace(result, files=tuple(files), fingerprint=fingerprint)
            files += write_result(result, folder, ["json"])
        except RadarSimError:  # a full disk: what there is of the frame is of no use
            with contextlib.suppress(OutputError):
                remove_stale(folder, number, [])
            raise
        yield replace(result, files=tuple(files))

    def kept(self, frame: RadarFrame) -> KeptFrame | None:
        """Return a frame whose products are there; None where it has to be processed."""
        if not self.resume or not self._summary(frame).is_file():
            return None
        return kept_frame(self.folder, frame, self._fingerprints.of(frame))

    def _summary(self, frame: RadarFrame) -> Path:
        return frame_file(self.folder, frame.number, SUMMARY_ENDING)

    def skipped(self, frame: RadarFrame) -> Finding | None:
        """Return why a frame is left out; FrameFileError: it is incomplete and must not be."""
        gaps = frame.missing()
        if gaps and not self.allow_incomplete:
            raise FrameFileError(
                f"{frame.path} lacks {len(gaps)} of {frame.planned} renders; the first: "
                f"{gaps[0].reason}. Render the run again: radarsim render resumes where it "
                "stopped. Or process only what is complete with --allow-incomplete."
            )
        skipped = finding("frame-incomplete", missing=len(gaps)).in_frame(frame.number)
        return skipped if gaps else None

    def draw_common(self, maps: Sequence[MapFile]) -> Path | None:
        """Write what is of all frames together: the antennas' picture and, if asked for, the maps
        with common colours, and the bag of their points. Return the file of the maps.
        """
        if not maps:
            raise FrameFileError(
                f"{self.run.path} has no complete frame to process. Render the run again: "
                "radarsim render resumes where it stopped."
            )
        options, path = self.options, self.folder / _ANIMATION_NAME
        if options.plots and options.link_budget is not None:
            system = make_system(options.link_budget, options.radar.waveform.wavelength_m)
            save_figure(plot_antennas(system), self.folder / ANTENNA_PICTURE)
        if options.ros_bag:
            write_bag(self.folder, [(shown.frame, shown.time_s) for shown in maps])
        else:
            remove_bag(self.folder)
        wanted = options.animate or (options.animate is None and options.plots and len(maps) > 1)
        for kind in get_args(AnimationFormat):
            if not wanted or kind != options.animation_format:
                remove_file(path.with_suffix(f".{kind}"))
        if not wanted:
            return None
        scale = common_scale(maps, power_unit(options.amplitude_model))
        return animate_maps(maps, path.with_suffix(f".{options.animation_format}"), scale)


class Fingerprints:
    """Fingerprints of a run's frames for these options."""

    def __init__(self, run: Run, options: ResolvedOptions) -> None:
        plan = shared_plan(run.record)
        settings = {
            field.name: getattr(options, field.name) for field in dataclasses.fields(options)
        }
        budget = options.link_budget
        shared = {
            "plan": {key: value for key, value in plan.items() if key not in FRAME_FIELDS},
            "settings": {key: v for key, v in settings.items() if key not in _OF_NO_FRAME},
            # patterns that are read from files
            "antennas": budget and make_system(budget, options.radar.waveform.wavelength_m),
            "software": _software(),
        }
        self._shared = hashlib.sha256(json.dumps(_plain(shared), sort_keys=True).encode())

    def of(self, frame: RadarFrame) -> str:
        """Return the fingerprint of a frame: SHA-256 in hexadecimal digits."""
        digest, folder = self._shared.copy(), frame.run.path / frame_dir(frame.number)
        digest.update(f"{frame.number} {frame.time_s!r}".encode())
        for path in sorted(folder.rglob("*")):
            if path.suffix in (".json", ".npy", ".npz", ".exr") and path.name[0] != ".":
                digest.update(f"\0{path.relative_to(folder)}\0".encode())
                # what cannot be read is named by who needs its content
                with contextlib.suppress(OSError):
                    if path.suffix == ".json":  # the records hold hashes of all that is large
                        digest.update(_RENDER_TIME.sub(b"", path.read_bytes()))
                    else:
                        digest.update(str(path.stat().st_size).encode())
        return digest.hexdigest()


def kept_frame(folder: Path, frame: RadarFrame, fingerprint: str) -> KeptFrame | None:
    """Return the products of a frame that an earlier process left in `folder`. None: the frame must
    be processed.
    """
    path = frame_file(folder, frame.number, SUMMARY_ENDING)
    try:
        summary = read_json(path, MOST_SUMMARY_BYTES, "", FrameFileError)
        if summary.get("fingerprint") != fingerprint:
            return None
        sizes = {folder / name: size for name, size in summary["files"].items()}
        if any(not file.is_file() or file.stat().st_size != size for file, size in sizes.items()):
            return None
        findings = [from_json(item, str(path)) for item in summary["findings"]]
        shown = MapFile(
            frame_file(folder, frame.number, "_map.npz"),
            frame.number,
            frame.time_s,
            **{name: float(value) for name, value in summary["map"].items()},
        )
    # whatever is wrong with it: the frame is processed
    except (RadarSimError, OSError, KeyError, TypeError, ValueError, AttributeError):
        return None
    return KeptFrame(frame.number, (*sizes, path), findings, shown)


def _plain(value: object) -> object:
    """Return a value as JSON that is the same for equal values, arrays by their hash."""
    if isinstance(value, np.ndarray):
        return [str(value.dtype), value.shape, hashlib.sha256(value.tobytes()).hexdigest()]
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if value is None or isinstance(value, bool | int | float | str):
        return repr(value)
    if hasattr(value, "__dict__"):
        return [type(value).__qualname__, _plain(vars(value))]
    return repr(value)


@functools.cache
def _software() -> dict[str, str]:
    """Return versions, and the hash of the source: a checkout changes without its version."""
    root = Path(__file__).resolve().parents[2]
    found = {"radarsim": __version__, "numpy": np.__version__}
    for name in ("finufft", "matplotlib"):
        found[name] = importlib.metadata.version(name)
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.*")):
        of_source = path.suffix in (".py", ".md", ".csv")  # texts of findings and tables, too
        if of_source and path.relative_to(root).parts[0] != "blender":
            digest.update(path.read_bytes())
    return found | {"source": digest.hexdigest()}
