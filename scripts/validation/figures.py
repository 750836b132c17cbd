# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the validation: error against time, and what the curves look like."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ..picture_text import use_readable_text
from .case import Outcome

Curves = dict[str, list[dict[str, Any]]]


def draw(outcomes: Sequence[Outcome], curves: Curves, folder: Path) -> list[tuple[str, str]]:
    """All pictures whose numbers are there; returns file names and captions."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    use_readable_text(pyplot)
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name, caption, needs, paint in _PICTURES:
        if needs and needs not in curves:
            continue
        figure = paint(pyplot, outcomes, curves)
        path = folder / f"validation_{name}.png"
        figure.savefig(path, dpi=110, bbox_inches="tight")
        pyplot.close(figure)
        files.append((path.name, caption))
    return files


def _bounds(pyplot: Any, outcomes: Sequence[Outcome], _curves: Curves) -> Any:
    """Every result: how much of its bound its error takes, against the time of its case."""
    figure, axis = pyplot.subplots(figsize=(9, 5), layout="constrained")
    groups = list(dict.fromkeys(o.group for o in outcomes))
    colours = pyplot.get_cmap("tab20")
    floor = 1e-6
    for number, group in enumerate(groups):
        chosen = [(o, c) for o in outcomes if o.group == group for c in o.checks if c.bound > 0]
        axis.loglog(
            [max(o.cpu_s, 1e-3) for o, _ in chosen],
            [max(abs(c.error) / c.bound, floor) for _, c in chosen],
            "o",
            color=colours(number % 20),
            markersize=5,
            alpha=0.8,
            label=group.replace("_", " "),
        )
    axis.axhline(1, color="black", linewidth=1)
    axis.text(0.01, 1.12, "bound", transform=axis.get_yaxis_transform())
    axis.set_xlabel("processor time of the case [s] (below 1 ms: at 1 ms)")
    axis.set_ylabel("|error| / bound (below 1e-6: at 1e-6)")
    axis.set_title("Every result of the validation")
    axis.grid(True, which="major", alpha=0.3)
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _error_against_time(pyplot: Any, _outcomes: Sequence[Outcome], curves: Curves) -> Any:
    figure, axis = pyplot.subplots(figsize=(8.5, 5.2), layout="constrained")
    points = curves["error_against_time"]
    sides = sorted({round(p["side_px"]) for p in points})
    for number, scene in enumerate(dict.fromkeys(p["scene"] for p in points)):
        chosen = [p for p in points if p["scene"] == scene]
        # no lines: what costs next to nothing is measured with a spread that would bend them back
        sizes = [12 + 16 * sides.index(round(p["side_px"])) for p in chosen]
        time = [p["cpu_s"] for p in chosen]
        common = {"color": f"C{number}", "s": sizes, "linewidths": 1.2}
        axis.scatter(time, [abs(p["error_db"]) for p in chosen], marker="o", label=scene, **common)
        spread = [p["standard_error_db"] for p in chosen]
        axis.scatter(time, spread, marker="x", **common)
    axis.scatter([], [], color="0.4", marker="x", label="standard errors, from the replicates")
    axis.set_xscale("log")
    axis.set_yscale("log")
    # labels of all minor ticks of one decade would overlap
    axis.xaxis.set_major_locator(pyplot.matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter(pyplot.matplotlib.ticker.NullFormatter())
    axis.set_xlabel("processor time, scene to power [s]")
    axis.set_ylabel("|error| of the received power [dB]")
    axis.set_title(
        f"Error against time: {sides[0]} (smallest) to {sides[-1]} pixels per side, 4 replicates",
    )
    axis.grid(True, which="major", alpha=0.3)
    axis.legend()
    return figure


def _sigma0(pyplot: Any, _outcomes: Sequence[Outcome], curves: Curves) -> Any:
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(12, 4.8), layout="constrained")
    points = curves["sigma0_material"]
    media = list(dict.fromkeys(p["medium"] for p in points))
    slopes = sorted({p["slope"] for p in points})
    markers = "osD^v"
    for slope_number, slope in enumerate(slopes):
        for number, medium in enumerate(media):
            chosen = [p for p in points if p["medium"] == medium and p["slope"] == slope]
            angle = [p["angle_deg"] for p in chosen]
            colour = f"C{slope_number}"
            first = number == 0
            style = {"color": colour, "marker": markers[number], "markersize": 4}
            left.plot(angle, [p["measured_db"] for p in chosen], linestyle="none", **style)
            left.plot(
                angle,
                [p["expected_db"] for p in chosen],
                color=colour,
                linewidth=0.8,
                label=f"rms slope {slope:g}" if first else None,
            )
            right.plot(
                angle,
                [p["error_db"] for p in chosen],
                linewidth=0.6,
                **style,
            )
            if slope_number == 0:
                # in no colour: colours are slopes
                mark = {"color": "0.3", "marker": markers[number], "markersize": 4}
                right.plot([], [], linestyle="none", label=f"n = {medium}", **mark)
    left.set_ylabel("$\\sigma_0$ [dB]")
    left.legend()
    left.set_title("Backscatter: lines model, markers simulated")
    right.axhline(0.1, color="grey", linestyle="--", linewidth=1)
    right.axhline(-0.1, color="grey", linestyle="--", linewidth=1)
    right.set_ylim(-0.13, 0.19)  # room for the legend above the bound
    right.set_ylabel("simulated - model [dB]")
    right.set_title("Error: colour slope, marker medium; bound dashed")
    right.legend()
    for axis in (left, right):
        axis.set_xlabel("angle of incidence [deg]")
        axis.grid(True, alpha=0.3)
    return figure


def _show_error(axis: Any, model: str) -> None:
    """Labels of a panel of errors whose bound is 0.05 dB."""
    for bound_db in (-0.05, 0.05):
        axis.axhline(bound_db, color="grey", linestyle="--", linewidth=1)
    axis.set_ylim(-0.065, 0.095)  # room for the legend above the bound
    axis.set_ylabel(f"simulated - {model} [dB]")
    axis.set_title("Error, bound dashed")


def _range(pyplot: Any, _outcomes: Sequence[Outcome], curves: Curves) -> Any:
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(11, 4.3), layout="constrained")
    points = curves["power_against_range"]
    for number, tilt in enumerate(sorted({p["tilt_deg"] for p in points})):
        chosen = [p for p in points if p["tilt_deg"] == tilt]
        reach = [p["range_m"] for p in chosen]
        colour, label = f"C{number}", f"incidence {tilt:g} deg"
        left.loglog(reach, [p["expected_w"] for p in chosen], "-", color=colour)
        left.loglog(reach, [p["measured_w"] for p in chosen], "o", color=colour, label=label)
        right.semilogx(reach, [p["error_db"] for p in chosen], "o-", color=colour, label=label)
    left.set_ylabel("received power [W]")
    left.set_title("Lambert plate of 1 m$^2$, EIRP 1 MW (line: radar equation)")
    _show_error(right, "radar equation")
    for axis in (left, right):
        axis.set_xlabel("range [m]")
        axis.grid(True, which="major", alpha=0.3)
        axis.legend()
    return figure


def _beam(pyplot: Any, _outcomes: Sequence[Outcome], curves: Curves) -> Any:
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(12, 5.6), layout="constrained")
    points = curves["swept_beam"]
    for number, beam in enumerate(dict.fromkeys(p["beam"] for p in points)):
        chosen = [p for p in points if p["beam"] == beam]
        angle = [p["angle_deg"] for p in chosen]
        colour = f"C{number}"
        left.plot(angle, [p["expected_db"] for p in chosen], "-", color=colour, linewidth=0.9)
        left.plot(angle, [p["measured_db"] for p in chosen], "o", color=colour, markersize=4)
        right.plot(
            angle, [p["error_db"] for p in chosen], "o-", color=colour, markersize=4, label=beam
        )
    left.set_ylabel("received power over that on boresight [dB]")
    left.set_title("Two-way beam (line: model, dots: simulated)")
    _show_error(right, "model")
    figure.legend(loc="outside lower center", ncols=2)
    for axis in (left, right):
        axis.set_xlabel("target off boresight [deg]")
        axis.grid(True, alpha=0.3)
    return figure


def _speckle(pyplot: Any, _outcomes: Sequence[Outcome], curves: Curves) -> Any:
    figure, axis = pyplot.subplots(figsize=(6.5, 4.4), layout="constrained")
    points = curves["speckle"]
    level = [p["intensity"] for p in points]
    axis.semilogy(level, [p["expected"] for p in points], "-", label="exponential law")
    seen = [p for p in points if p["measured"] > 0]
    axis.semilogy(
        [p["intensity"] for p in seen],
        [p["measured"] for p in seen],
        ".",
        label="simulated, 200 seeds",
    )
    axis.set_xlabel("intensity over the sum of powers")
    axis.set_ylabel("fraction of cells above it")
    axis.set_title("Speckle of a rough patch")
    axis.grid(True, which="major", alpha=0.3)
    axis.legend()
    return figure


def _paper(pyplot: Any, _outcomes: Sequence[Outcome], curves: Curves) -> Any:
    figure, axis = pyplot.subplots(figsize=(8.5, 4.4), layout="constrained")
    points = curves["paper_profile"]
    reach = [p["range_m"] / 1e3 for p in points]

    def dbm(power_w: float) -> float:
        return 10 * math.log10(power_w) + 30

    axis.plot(
        reach,
        [dbm(p["power_w"]) for p in points],
        linewidth=0.8,
        label="strongest of 128 Doppler cells (in noise 7 dB above the mean)",
    )
    floor = dbm(points[0]["floor_w"])
    axis.axhline(floor, color="C3", linestyle="--", label=f"mean of the noise, {floor:.1f} dBm")
    axis.set_xlabel("range [km]")
    axis.set_ylabel("power in the map [dBm]")
    axis.set_title("The paper's scene in watts: range-Doppler map with thermal noise")
    axis.grid(True, alpha=0.3)
    axis.legend()
    return figure


_Paint = Callable[[Any, Sequence[Outcome], Curves], Any]
_PICTURES: tuple[tuple[str, str, str, _Paint], ...] = (
    ("bounds", "Error over bound against processor time, every result", "", _bounds),
    (
        "error_against_time",
        (
            "Error against processor time of one scene with more and more pixels; the spheres end "
            "at what their facets cost"
        ),
        "error_against_time",
        _error_against_time,
    ),
    ("range", "Power of a Lambert plate against range", "power_against_range", _range),
    ("beam", "Power of a plate while the beam sweeps over it", "swept_beam", _beam),
    ("speckle", "Distribution of the intensity of speckle", "speckle", _speckle),
    ("paper", "Range-Doppler map of the paper's scene over its noise", "paper_profile", _paper),
    ("sigma0", "sigma_0 of rough surfaces against incidence", "sigma0_material", _sigma0),
)
