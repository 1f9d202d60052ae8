"""Lists of a daemon as Parquet against what the command line prints as CSV.

parquet_test.py PACKAGE_DIR EXTRA_DIR SELFCALD SELFCAL_DEMO SELFCAL
"""

import csv
import datetime
import io
import os
import subprocess
import sys
import unittest
from unittest import mock

PACKAGE, EXTRA, SELFCALD, DEMO, SELFCAL = sys.argv[1:6]
sys.path[:0] = [PACKAGE, EXTRA]

import pyarrow as pa
import pyarrow.parquet as pq
from demo_device import DemoDevice, run_module

import selfcal
from selfcal import parquet
from selfcal.v1 import (
    activity_service_pb2,
    recalibration_pb2,
    segment_pb2,
)


def run(arguments: list) -> subprocess.CompletedProcess:
    return run_module("selfcal.parquet", [PACKAGE, EXTRA], arguments)


def nanoseconds(time: str) -> int:
    """Since the epoch, of 2026-11-21T04:10:03.000000001Z."""
    second, _, fraction = time.rstrip("Z").partition(".")
    since = datetime.datetime.fromisoformat(second + "+00:00").timestamp()
    return int(since) * 10**9 + int(fraction.ljust(9, "0") or 0)


class ActivityInPages:
    """A service whose pages have one rig."""

    def __init__(self, rigs: list[str]) -> None:
        self._rigs = rigs

    def ListActivity(
        self,
        request: activity_service_pb2.ListActivityRequest,
        timeout: float,
    ) -> activity_service_pb2.ListActivityResponse:
        at = int(request.page_token or 0)
        page = activity_service_pb2.ListActivityResponse()
        page.rigs.add(name=self._rigs[at])
        if at + 1 < len(self._rigs):
            page.next_page_token = str(at + 1)
        return page


class ParquetTest(DemoDevice):
    selfcald = SELFCALD
    demo = DEMO

    def written(self, name: str, *rig: str) -> pa.Table:
        file = f"{self.folder}/{name}.parquet"
        done = run([self.target, name, *rig, file])
        self.assertEqual(done.returncode, 0, done.stderr)
        return pq.read_table(file)

    def listed(self, *command: str) -> list:
        printed = subprocess.run(
            [SELFCAL, "--target", self.target, *command, "--csv"],
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        return list(csv.reader(io.StringIO(printed, newline="")))

    def test_columns_and_values_are_those_of_csv(self) -> None:
        rig = "simulated"
        for name, parent, command in (
            ("rigs", (), ("rig", "list")),
            ("segments", (rig,), ("segment", "list", rig)),
            ("calibrations", (rig,), ("calibration", "list", rig)),
            ("calibrations", (), ("calibration", "list")),
            ("estimates", (), ("estimate", "list")),
            ("estimates", (rig,), ("estimate", "list", rig)),
            ("recalibrations", (rig,), ("run", "list", rig)),
            ("sessions", (rig,), ("session", "list", rig)),
            ("segments", (), ("segment", "list")),
            ("events", (), ("event", "list")),
            ("events", (rig,), ("event", "list", rig)),
        ):
            with self.subTest(name):
                table = self.written(name, *parent)
                header, *rows = self.listed(*command)
                self.assertGreater(len(rows), 0)
                self.assertEqual(table.column_names, header)
                self.assertEqual(table.num_rows, len(rows))
                for field in table.schema:
                    column = header.index(field.name)
                    values = table.column(field.name)
                    if pa.types.is_timestamp(field.type):
                        values = values.cast(pa.int64())
                    cells = [row[column] for row in rows]
                    pairs = zip(values.to_pylist(), cells, strict=True)
                    for value, cell in pairs:
                        self.compare(value, field, cell)

    def compare(self, value: object, field: pa.Field, cell: str) -> None:
        if value is None or cell == "":
            self.assertIn((value, cell), ((None, ""), ("", ""), ([], "")))
            return
        kind = field.type
        if pa.types.is_list(kind):
            kind = kind.value_type
            cells = cell.split("; ")
        else:
            cells, value = [cell], [value]
        if kind == pa.string() and cell[0] in "[{":
            self.assertIn(value[0][0], "[{")  # JSON, with defaults and without
            return
        of = {pa.string(): str, pa.bool_(): "true".__eq__}.get(kind, float)
        if pa.types.is_timestamp(kind):
            of = nanoseconds
        elif pa.types.is_integer(kind):
            of = int
        self.assertEqual(value, [of(c) for c in cells], field.name)

    def test_columns_have_types(self) -> None:
        schema = self.written("segments", "simulated").schema
        self.assertEqual(
            schema.field("scores.camera.gain_nats").type, pa.float64()
        )
        self.assertEqual(schema.field("sequence").type, pa.int64())
        self.assertEqual(schema.field("has_data").type, pa.bool_())
        self.assertEqual(
            schema.field("receive_time").type, pa.timestamp("ns", tz="UTC")
        )

    def test_what_is_not_set_is_null(self) -> None:
        run_ = recalibration_pb2.Recalibration(name="r", segments=["a", "b"])
        scored = segment_pb2.Segment()
        scored.scores.add(group="imu", entropy_nats=-2)
        table = parquet.table([segment_pb2.Segment(temperature_c=0), scored])
        self.assertEqual(table["temperature_c"].to_pylist(), [0, None])
        self.assertEqual(
            table["scores.imu.entropy_nats"].to_pylist(), [None, -2]
        )
        table = parquet.table([run_])
        self.assertEqual(table["end_time"].to_pylist(), [None])
        self.assertEqual(table["segments"].to_pylist(), [["a", "b"]])

    def test_activity_is_of_all_pages(self) -> None:
        names = self.written("activity")["name"].to_pylist()
        self.assertEqual(names, ["rigs/simulated"])
        daemon = selfcal.connect(self.target)
        self.addCleanup(daemon.close)
        daemon.activity_service = ActivityInPages(["rigs/a", "rigs/b"])
        file = f"{self.folder}/pages.parquet"
        with mock.patch.object(parquet, "connect", return_value=daemon):
            self.assertEqual(parquet.main(["any", "activity", file]), 0)
        names = pq.read_table(file)["name"].to_pylist()
        self.assertEqual(names, ["rigs/a", "rigs/b"])

    def test_file_of_any_length_is_the_table_of_its_messages(self) -> None:
        segments = [segment_pb2.Segment(sequence=k) for k in range(5)]
        segments[1].scores.add(group="imu", entropy_nats=-2)
        segments[4].scores.add(group="camera", gain_nats=1)
        segments[4].receive_time.FromNanoseconds(7)
        file = f"{self.folder}/batches.parquet"
        with mock.patch.object(parquet, "_BATCH", 2):
            parquet.write(file, iter(segments))
        self.assertEqual(pq.ParquetFile(file).num_row_groups, 3)
        self.assertTrue(pq.read_table(file).equals(parquet.table(segments)))

    def test_errors_say_what_is_wrong(self) -> None:
        file = f"{self.folder}/none.parquet"
        for arguments, code, text in (
            ([self.target, "segments", "nobody", file], 1, "nobody"),
            ([self.target, "sessions", file], 2, "name the rig"),
            ([self.target, "rigs", "simulated", file], 2, "not of one rig"),
            (["unix:/nowhere", "rigs", file], 1, "selfcal.parquet: "),
        ):
            done = run(arguments)
            self.assertEqual(done.returncode, code, done.stderr)
            self.assertIn(text, done.stderr)
        self.assertFalse(os.path.exists(file))
        with self.assertRaisesRegex(ValueError, "nothing"):
            parquet.table([])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
