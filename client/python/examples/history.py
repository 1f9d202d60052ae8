#!/usr/bin/env python3
"""Lists the segments of a rig as a data frame and plots its calibration over
the versions.

    PYTHONPATH=DIR history.py TARGET RIG PLOT.png

client/python/generate creates DIR. Needs pandas and matplotlib.
"""

import sys

import matplotlib
import pandas

import selfcal
from selfcal.v1 import calibration_service_pb2, segment_pb2

matplotlib.use("Agg")
from matplotlib import pyplot


def segment_frame(daemon: selfcal.Daemon, rig: str) -> pandas.DataFrame:
    """Returns one row per segment, oldest first; gains by group [nats]."""
    rows = []
    for segment in daemon.segments(rig):
        row = {
            "segment": segment.name.rsplit("/", 1)[1],
            "state": segment_pb2.Segment.State.Name(segment.state),
            "seconds": 1e-9 * (segment.end_ns - segment.start_ns),
            "keyframes": segment.keyframes,
            "landmarks": segment.landmarks,
            "temperature_c": (
                segment.temperature_c
                if segment.HasField("temperature_c")
                else float("nan")
            ),
            "angular_rate": (
                segment.motion.angular_rate
                if segment.HasField("motion")
                else float("nan")
            ),
            "acceleration": (
                segment.motion.acceleration
                if segment.HasField("motion")
                else float("nan")
            ),
            "kept": any(score.in_table for score in segment.scores),
        }
        for score in segment.scores:
            row[f"gain_{score.group}"] = score.gain_nats
        rows.append(row)
    return pandas.DataFrame(rows[::-1])


def calibration_frame(daemon: selfcal.Daemon, rig: str) -> pandas.DataFrame:
    """Returns one row for each component of each version."""
    states = calibration_service_pb2.Calibration.State
    return pandas.DataFrame(
        [
            {
                "version": version.version,
                "state": states.Name(version.state),
                "verdict": version.verdict.text,
                "component": estimate.component,
                "unit": estimate.unit,
                "value": estimate.value,
                # For rotations, whose rotation vector may change its sign.
                "from_factory": estimate.from_factory,
                "sigma": estimate.sigma,
            }
            for version in daemon.calibrations(rig)
            for estimate in version.estimates
        ]
    ).sort_values("version", kind="stable")


def plot_history(frame: pandas.DataFrame, path: str) -> None:
    """Plots the differences from the first version, with sigmas, in one plot
    each for focal length and principal point; rejected versions are hollow."""
    figure, axes = pyplot.subplots(2, 1, sharex=True, figsize=(8, 6))
    for axis, kind in zip(axes, ["focal", "principal"]):
        chosen = frame[frame.component.str.contains(kind)]
        for name, rows in chosen.groupby("component"):
            change = rows.value - rows.value.iloc[0]
            axis.errorbar(
                rows.version, change, rows.sigma, capsize=3, label=name
            )
            rejected = rows.state == "REJECTED"
            axis.plot(
                rows.version[rejected], change[rejected], "o", mfc="white"
            )
        axis.set_ylabel(f"{kind}: change [px]")
        if not chosen.empty:
            axis.legend()
    axes[-1].set_xlabel("version")
    figure.tight_layout()
    figure.savefig(path)


def main() -> int:
    if len(sys.argv) != 4:
        print(__doc__, file=sys.stderr)
        return 2
    target, rig, plot = sys.argv[1:]
    with selfcal.connect(target) as daemon:
        print(segment_frame(daemon, rig).to_string())
        plot_history(calibration_frame(daemon, rig), plot)
    return 0


if __name__ == "__main__":
    sys.exit(main())
