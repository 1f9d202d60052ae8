#!/usr/bin/env python3
"""Tests that what the containers of deploy/fleet have agrees with what install
puts in place, without a container engine."""

import importlib.util
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

DEPLOY = pathlib.Path(__file__).resolve().parents[3] / "deploy"
FLEET = DEPLOY / "fleet"
for module in ("jinja2", "yaml"):
    if importlib.util.find_spec(module) is None:
        print(f"fleet: skipped, there is no {module}")
        sys.exit()

import yaml

PARTS = ["etcd", "database", "replica"]
FOLDER = "${FLEET:?}"


def services() -> dict:
    return yaml.safe_load((FLEET / "compose.yaml").read_text())["services"]


def mounts(service: dict) -> list[tuple[str, str]]:
    """Paths in FOLDER, and where the container has them."""
    found = []
    for volume in service["volumes"]:
        if volume.startswith(FOLDER):
            source, target, mode = volume.removeprefix(FOLDER).split(":")
            assert mode == "ro", volume
            found.append((source, target))
    return found


class ContainersTest(unittest.TestCase):
    def installed(self, part: str) -> list[pathlib.PurePath]:
        """What a machine with this part gets; another has the others."""
        with tempfile.TemporaryDirectory() as folder:
            inventory = pathlib.Path(folder) / "fleet.yaml"
            out = pathlib.Path(folder) / "out"
            others = [name for name in PARTS if name != part]
            machines = {
                "one": {"address": "10.0.0.11", "runs": [part]},
                "two": {"address": "10.0.0.12", "runs": others},
            }
            inventory.write_text(yaml.safe_dump({"machines": machines}))
            subprocess.run(
                [sys.executable, FLEET / "configure", inventory, out],
                check=True,
                capture_output=True,
            )
            lines = (out / "one/files").read_text().splitlines()
        return [pathlib.PurePath(line.split()[2]) for line in lines]

    def test_the_profiles_are_the_parts_of_a_machine(self) -> None:
        profiles = [service["profiles"] for service in services().values()]
        self.assertEqual({name for (name,) in profiles}, set(PARTS))

    def test_what_a_container_mounts_is_installed(self) -> None:
        for part in PARTS:
            files = self.installed(part)
            for name, service in services().items():
                if service["profiles"] != [part]:
                    continue
                found = mounts(service)
                # The certificates come from elsewhere.
                found.remove(("/etc/selfcal-fleet", "/etc/selfcal-fleet"))
                self.assertTrue(found, name)
                for source, target in found:
                    self.assertEqual(source, target, name)
                    self.assertTrue(
                        any(file.is_relative_to(source) for file in files),
                        f"{name}: {source}",
                    )

    def test_a_container_starts_only_if_the_folder_is_stated(self) -> None:
        # Without it, it would mount what the machine itself has.
        text = (FLEET / "compose.yaml").read_text()
        self.assertEqual(text.count("${FLEET"), text.count(FOLDER))

    def test_users_have_the_numbers_of_the_images(self) -> None:
        script = (FLEET / "install").read_text()
        stated = re.findall(r"^ +(\w+)\) echo (\d+) ;;$", script, re.M)
        images = [DEPLOY / "Containerfile", FLEET / "Containerfile"]
        made = [("root", "0")]
        for image in images:
            made += [
                (user, number)
                for number, user in re.findall(
                    r"useradd --system --uid (\d+) --gid (\w+)",
                    image.read_text(),
                )
            ]
        self.assertEqual(sorted(stated), sorted(made))


if __name__ == "__main__":
    unittest.main()
