#!/usr/bin/python3
"""Turns every plot description below a folder into an SVG beside it.

    plot.py DIR     DIR/**/NAME.plot.json -> DIR/**/NAME.svg

The description is that of plot.h. The same description gives the same bytes.
"""

import json
import pathlib
import sys

import matplotlib

matplotlib.use("svg")
matplotlib.rcParams.update(
    {
        "svg.hashsalt": "selfcal",
        "svg.fonttype": "path",
        "font.size": 10,
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.alpha": 0.3,
        "legend.fontsize": 8,
    }
)
from matplotlib import pyplot


def error_bars(series):
    if not series["low"]:
        return None
    return [
        [y - low for y, low in zip(series["y"], series["low"])],
        [high - y for y, high in zip(series["y"], series["high"])],
    ]


def draw_line(axes, series, _plot, _place, color):
    steps = "post" if series["style"] == "steps" else None
    axes.plot(
        series["x"],
        series["y"],
        label=series["label"] or None,
        color=color,
        linestyle="--" if series["dashed"] else "-",
        drawstyle="steps-post" if steps else "default",
    )
    if series["low"]:
        axes.fill_between(
            series["x"],
            series["low"],
            series["high"],
            step=steps,
            color=color,
            alpha=0.2,
            linewidth=0,
        )


def draw_scatter(axes, series, _plot, _place, color):
    axes.errorbar(
        series["x"],
        series["y"],
        yerr=error_bars(series),
        fmt="o",
        markersize=3,
        capsize=2,
        color=color,
        label=series["label"] or None,
    )


def draw_bars(axes, series, plot, place, color):
    index, count = place
    width = 0.8 / count
    x = [
        i + (index - (count - 1) / 2) * width
        for i in range(len(plot["categories"]))
    ]
    axes.bar(
        x,
        series["y"],
        width,
        yerr=error_bars(series),
        capsize=2,
        color=color,
        label=series["label"] or None,
    )


def draw_histogram(axes, series, plot, _place, color):
    values = [
        x for s in plot["series"] if s["style"] == "histogram" for x in s["x"]
    ]
    axes.hist(
        series["x"],
        bins=plot["bins"],
        range=(min(values), max(values)),
        histtype="stepfilled",
        alpha=0.4,
        edgecolor=color,
        color=color,
        label=series["label"] or None,
    )


DRAW = {
    "line": draw_line,
    "steps": draw_line,
    "scatter": draw_scatter,
    "bars": draw_bars,
    "histogram": draw_histogram,
}


def draw(path):
    plot = json.loads(path.read_text())
    wide = len(plot["categories"]) > 12
    figure, axes = pyplot.subplots(figsize=(11 if wide else 7, 4.5))
    bars = [s for s in plot["series"] if s["style"] == "bars"]
    for i, series in enumerate(plot["series"]):
        place = (bars.index(series), len(bars)) if series in bars else None
        DRAW[series["style"]](axes, series, plot, place, f"C{i % 10}")
    for value in plot["horizontal"]:
        axes.axhline(value, color="black", linewidth=0.8, linestyle=":")
    if plot["categories"]:
        long = any(len(name) > 8 for name in plot["categories"])
        axes.set_xticks(
            range(len(plot["categories"])),
            plot["categories"],
            rotation=45 if long else 0,
            ha="right" if long else "center",
        )
    axes.set_title(plot["title"])
    axes.set_xlabel(plot["x_label"])
    axes.set_ylabel(plot["y_label"])
    if plot["log_x"]:
        axes.set_xscale("log")
    if plot["log_y"]:
        axes.set_yscale("log")
    if any(series["label"] for series in plot["series"]):
        axes.legend()
    figure.tight_layout()
    name = path.name[: -len(".plot.json")]
    figure.savefig(path.with_name(name + ".svg"), metadata={"Date": None})
    pyplot.close(figure)


def main():
    folder = pathlib.Path(sys.argv[1])
    for path in sorted(folder.rglob("*.plot.json")):
        draw(path)


if __name__ == "__main__":
    main()
