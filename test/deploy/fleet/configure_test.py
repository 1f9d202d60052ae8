#!/usr/bin/env python3
"""Tests configure and restore of deploy/fleet: what they write, and what they
refuse."""

import importlib.util
import pathlib
import subprocess
import sys
import tempfile
import unittest

FLEET = pathlib.Path(__file__).resolve().parents[3] / "deploy/fleet"
for module in ("jinja2", "yaml"):
    if importlib.util.find_spec(module) is None:
        print(f"fleet: skipped, there is no {module}")
        sys.exit()

import yaml

MACHINES = {
    "db-1": {"address": "10.0.0.11", "runs": ["etcd", "database"]},
    "db-2": {"address": "10.0.0.12", "runs": ["etcd", "database"]},
    "hub-1": {"address": "10.0.0.21", "runs": ["etcd", "replica"]},
}


def run(program: str, *arguments: object) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, FLEET / program, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )


class ConfigureTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.out = self.folder / "out"

    def configure(
        self, inventory: dict, *arguments: str
    ) -> subprocess.CompletedProcess:
        file = self.folder / "fleet.yaml"
        file.write_text(yaml.safe_dump(inventory), encoding="utf-8")
        return run("configure", file, self.out, *arguments)

    def patroni(self, machine: str) -> dict:
        file = self.out / machine / "etc/patroni/config.yml"
        return yaml.safe_load(file.read_text(encoding="utf-8"))

    def refuses(self, inventory: dict, *texts: str) -> None:
        done = self.configure(inventory)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertNotIn("Traceback", done.stderr)
        for text in texts:
            self.assertIn(text, done.stderr)
        self.assertFalse(self.out.exists())

    def test_the_example_is_valid(self) -> None:
        done = run("configure", FLEET / "fleet.example.yaml", self.out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.patroni("db-1")["scope"], "selfcal")

    def test_settings_replace_the_defaults(self) -> None:
        changes = {
            "failover": {"strict": True},
            "postgresql": {"parameters": {"work_mem": "8MB"}},
            "backup": {"repository": {"repo1-type": "s3"}},
        }
        done = self.configure({"machines": MACHINES, **changes})
        self.assertEqual(done.returncode, 0, done.stderr)
        dcs = self.patroni("db-1")["bootstrap"]["dcs"]
        self.assertTrue(dcs["synchronous_mode_strict"])
        self.assertEqual(dcs["ttl"], 20)

    def test_unknown_settings_are_refused(self) -> None:
        self.refuses(
            {"machines": MACHINES, "failover": {"strct": True}},
            "failover.strct",
            "ttl, loop_wait, retry_timeout, strict",
        )
        self.refuses({"machines": MACHINES, "watchdg": "off"}, "watchdg")

    def test_values_of_another_type_are_refused(self) -> None:
        self.refuses({"machines": MACHINES, "failover": 20}, "failover")
        self.refuses(
            {"machines": MACHINES, "failover": {"ttl": "20s"}}, "failover.ttl"
        )
        # The word off without quotes.
        self.refuses({"machines": MACHINES, "watchdog": False}, "watchdog")

    def test_machines_are_complete(self) -> None:
        for machine, text in (
            ({"address": "10.0.0.12", "runs": ["storage"]}, "storage"),
            ({"host": "10.0.0.12", "runs": ["database"]}, "host"),
            ({"address": "10.0.0.12"}, "runs"),
        ):
            self.refuses({"machines": {**MACHINES, "db-2": machine}}, text)
        self.refuses({}, "machines")

    def test_a_primary_can_be_asked_twice_before_it_is_replaced(self) -> None:
        failover = {"ttl": 20, "loop_wait": 5, "retry_timeout": 8}
        self.refuses(
            {"machines": MACHINES, "failover": failover},
            "failover.ttl",
            "loop_wait + 2 * retry_timeout",
        )

    def test_etcd_has_an_odd_number_of_members(self) -> None:
        machines = {**MACHINES}
        del machines["hub-1"]
        self.refuses({"machines": machines}, "etcd", "odd")
        machines = {
            name: {**machine, "runs": machine["runs"][1:]}
            for name, machine in MACHINES.items()
        }
        self.refuses({"machines": machines}, "etcd", "odd")

    def test_a_point_in_time_has_a_zone(self) -> None:
        inventory = {"machines": MACHINES}
        for time in ("2026-01-31 12:00:00", "2026-01-31", "noon"):
            done = self.configure(inventory, "--restore-to", time)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("--restore-to", done.stderr)
            done = run("restore", self.folder, time)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("TIME", done.stderr)
        done = self.configure(inventory, "--restore-to", "2026-01-31 12:00+01")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(
            '"--target=2026-01-31 12:00:00+01:00"',
            (self.out / "db-1/etc/patroni/config.yml").read_text(),
        )


if __name__ == "__main__":
    unittest.main()
