#!/usr/bin/python3
"""Runs the quick form of the evaluation and checks what it leaves.

    check_quick.py PROGRAM PLOT_SCRIPT OUT_DIR PART PARTS

Every experiment must run, every file must parse, no value may be missing or
not finite, and the figures that are marked as robust must hold. Parts are
numbered from 0; experiments are dealt to them in turn, and each runs on one
core.
"""

import csv
import json
import math
import pathlib
import shutil
import subprocess
import sys
import xml.etree.ElementTree


def fail(message):
    sys.exit(f"FAILED: {message}")


def finite(value):
    if isinstance(value, list):
        return all(finite(one) for one in value)
    if isinstance(value, dict):
        return all(finite(one) for one in value.values())
    if isinstance(value, float):
        return math.isfinite(value)
    return value is not None


def load(path):
    value = json.loads(path.read_text())
    if not finite(value):
        fail(f"{path}: a value is not finite")
    return value


def check_table(path):
    rows = list(csv.reader(path.open()))
    if len(rows) < 2 or any(len(row) != len(rows[0]) for row in rows):
        fail(f"{path}: no rows, or rows of different length")
    if any(
        cell.lower() in ("nan", "-nan", "inf", "-inf")
        for row in rows
        for cell in row
    ):
        fail(f"{path}: a value is not finite")
    lines = path.with_suffix(".md").read_text().splitlines()
    if len(lines) != len(rows) + 1:
        fail(f"{path}: the Markdown has other rows")


def check_summary(out):
    names = set()
    for entry in load(out / "summary.json"):
        for key in ("name", "experiment", "value", "bound", "holds"):
            if key not in entry:
                fail(f"summary.json: {entry} has no {key}")
        if entry["name"] in names:
            fail(f"summary.json: {entry['name']} is there twice")
        names.add(entry["name"])
        # So that it is in no other part, either.
        if not entry["name"].startswith(entry["experiment"] + "."):
            fail(f"summary.json: {entry['name']} is not named after its folder")
        if not entry["holds"]:
            text = f"{entry['name']}: {entry['value']} misses {entry['bound']}"
            if entry["robust"]:
                fail(text)
            print(f"in the quick form {text}")


def main():
    program, plot_script, out, part, parts = sys.argv[1:]
    out = pathlib.Path(out)
    shutil.rmtree(out, ignore_errors=True)
    listed = subprocess.run(
        [program, "--list"], check=True, text=True, stdout=subprocess.PIPE
    ).stdout
    names = [line.split()[0] for line in listed.splitlines()]
    names = names[int(part) :: int(parts)]
    subprocess.run(
        [program, "--out", out, "--only", ",".join(names)]
        + ["--quick", "--threads", "1"],
        check=True,
    )
    subprocess.run([plot_script, out], check=True)
    for name in names:
        folder = out / name
        tables = sorted(folder.glob("*.csv"))
        if not tables:
            fail(f"{folder}: no table")
        for table in tables:
            check_table(table)
        for plot in sorted(folder.glob("*.plot.json")):
            load(plot)
            svg = plot.with_name(plot.name[: -len(".plot.json")] + ".svg")
            xml.etree.ElementTree.parse(svg)
    check_summary(out)


if __name__ == "__main__":
    main()
