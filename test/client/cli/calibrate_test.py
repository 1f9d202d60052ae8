"""selfcal calibrate and track on rendered recordings, against real daemons.

calibrate_test.py SELFCAL SELFCALD RENDER [TEST...]
"""

import json
import math
import os
import pathlib
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import zlib

SELFCAL, SELFCALD, RENDER = sys.argv[1:4]
sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))

from running_daemon import RunningDaemon

SECONDS = 18


def render(folder: pathlib.Path, *options: str) -> pathlib.Path:
    subprocess.run(
        [RENDER, folder, "--exposure-ms", "2", *options],
        check=True,
        stderr=subprocess.DEVNULL,
    )
    return folder


def command(
    recording: pathlib.Path, output: pathlib.Path, *options: str
) -> list:
    return [SELFCAL, "calibrate", recording, "--output", output,
            "--selfcald", SELFCALD, *options]  # fmt: skip


def stamp_later(readings: pathlib.Path, by_ns: int) -> None:
    first, *lines = readings.read_text().splitlines(keepends=True)
    for n, line in enumerate(lines):
        stamp, rest = line.split(",", 1)
        lines[n] = f"{int(stamp) + by_ns},{rest}"
    readings.write_text(first + "".join(lines))


def copy_with_readings_later(
    recording: pathlib.Path, copy: pathlib.Path, by_ns: int
) -> pathlib.Path:
    shutil.copytree(recording, copy)
    stamp_later(copy / "mav0/imu0/data.csv", by_ns)
    return copy


def calibrate(recording: pathlib.Path, output: pathlib.Path, *options: str):
    return subprocess.run(
        command(recording, output, *options),
        capture_output=True,
        text=True,
        check=False,
    )


def parameters(output: pathlib.Path) -> dict:
    return json.loads((output / "calibration.json").read_text())["parameters"]


class Calibrate(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.walk = render(cls.folder / "walk", "--seconds", str(SECONDS))
        # A start that is off by 5 % and 10 px.
        sensor = cls.walk / "mav0/cam0/sensor.yaml"
        sensor.write_text(
            re.sub(
                r"intrinsics: \[(.*)\]",
                lambda found: (
                    "intrinsics: "
                    + str(
                        [
                            scale * float(value) + shift
                            for value, scale, shift in zip(
                                found[1].split(","),
                                (1.05, 1.05, 1, 1),
                                (0, 0, 10, -10),
                            )
                        ]
                    )
                ),
                sensor.read_text(),
            )
        )

    @classmethod
    def tearDownClass(cls) -> None:
        shutil.rmtree(cls.folder)

    def check_against_truth(self, output: pathlib.Path) -> None:
        truth = json.loads((self.walk / "calibration.json").read_text())
        found = parameters(output)["cameras"][0]
        true = truth["cameras"][0]
        for axis in "xy":
            self.assertLess(abs(found["f"][axis] - true["f"][axis]), 0.5)
            self.assertLess(abs(found["c"][axis] - true["c"][axis]), 0.5)
        for axis in "xyz":
            self.assertLess(abs(found["p_ci"][axis] - true["p_ci"][axis]), 5e-3)
        dot = sum(found["q_ci"][a] * true["q_ci"][a] for a in "wxyz")
        self.assertLess(2 * math.acos(min(1, abs(dot))), 2e-3)

    def test_from_a_recording_to_files(self) -> None:
        output = self.folder / "output"
        done = calibrate(self.walk, output)
        self.assertIn(done.returncode, (0, 5), done.stderr)
        self.assertIn("segments stored", done.stderr)
        self.check_against_truth(output)
        self.assertTrue((output / "report.html").stat().st_size > 10000)
        self.assertTrue((output / "kalibr/camchain-imucam.yaml").exists())
        # A tool that has no such camera model is named.
        self.assertIn("no files for openvins", done.stderr)

        # Nothing is left to do, and the result is the same.
        before = parameters(output)
        again = calibrate(self.walk, output)
        self.assertEqual(again.returncode, done.returncode, again.stderr)
        self.assertIn("0 segments stored", again.stderr)
        self.assertEqual(parameters(output), before)

        # The same recording gives the same bits.
        other = self.folder / "other"
        code = calibrate(self.walk, other).returncode
        self.assertEqual(code, done.returncode)
        self.assertEqual(parameters(other), before)

        # The state can be served.
        daemon = RunningDaemon(SELFCALD, f"{output}/state")
        self.addCleanup(daemon.stop)
        listed = subprocess.run(
            [SELFCAL, "--target", daemon.target, "rig", "list"],
            capture_output=True,
            text=True,
            check=True,
        )
        self.assertIn("device", listed.stdout)

    def test_aligns_two_clocks(self) -> None:
        late = copy_with_readings_later(
            self.walk, self.folder / "late", 86_400_250_000_000
        )
        output = self.folder / "aligned"
        done = calibrate(late, output, "--temperature", "31.5")
        self.assertIn(done.returncode, (0, 5), done.stderr)
        self.assertRegex(
            done.stderr,
            r"the clock of the readings is 86400\.2\d\d s ahead of that of the",
        )
        self.check_against_truth(output)
        daemon = RunningDaemon(SELFCALD, f"{output}/state")
        self.addCleanup(daemon.stop)
        shown = subprocess.run(
            [SELFCAL, "--target", daemon.target, "--json",
             "segment", "list", "device"],
            capture_output=True,
            text=True,
            check=True,
        )  # fmt: skip
        segments = json.loads(shown.stdout)["segments"]
        self.assertGreater(len(segments), 2)
        for segment in segments:
            self.assertEqual(segment["temperature_c"], 31.5)

    def test_says_what_to_record(self) -> None:
        output = self.folder / "asked"
        calm = render(
            self.folder / "calm", "--seconds", "12", "--excitation", "0.1"
        )
        done = calibrate(calm, output)
        self.assertIn(done.returncode, (1, 5), done.stderr)
        text = (output / "what_to_record.txt").read_text()
        self.assertIn(text, done.stderr)
        self.assertIn("missing", text)

        # It is what the coach of a daemon says.
        daemon = RunningDaemon(SELFCALD, f"{output}/state")
        self.addCleanup(daemon.stop)
        coached = subprocess.run(
            [SELFCAL, "--target", daemon.target, "rig", "coach", "device",
             "--json"],
            capture_output=True,
            text=True,
            check=True,
        )  # fmt: skip
        advice = json.loads(coached.stdout)
        self.assertGreater(len(advice["lessons"]), 0)
        for lesson in advice["lessons"]:
            self.assertIn(
                f"record {lesson['seconds']:g} s more of this: "
                f"{lesson['instruction']}",
                text,
            )
        self.assertLess(sum(a["seconds"] for a in advice["lessons"]), SECONDS)
        daemon.stop()

        # Vigorous motion of a greater length leaves nothing missing.
        done = calibrate(self.walk, output)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("no direction is missing", done.stderr)
        self.check_against_truth(output)

    def test_continues_after_sigkill(self) -> None:
        output = self.folder / "killed"
        process = subprocess.Popen(
            command(self.walk, output),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        log = pathlib.Path(f"{output}/state.log")
        limit = time.monotonic() + 120
        while not (log.exists() and "is scored" in log.read_text()):
            self.assertLess(time.monotonic(), limit, "no segment in time")
            time.sleep(0.05)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        scored = log.read_text().count("is scored")
        self.assertLess(scored, 4)
        done = calibrate(self.walk, output)
        self.assertIn(done.returncode, (0, 5), done.stderr)
        self.assertGreater(log.read_text().count("is scored"), scored)
        self.check_against_truth(output)

    def test_track_streams_to_a_daemon(self) -> None:
        daemon = RunningDaemon(SELFCALD, f"{self.folder}/served")
        self.addCleanup(daemon.stop)
        target = ["--target", daemon.target]
        created = self.folder / "rig.json"
        truth = json.loads((self.walk / "calibration.json").read_text())
        created.write_text(
            json.dumps(
                {
                    "name": "rigs/hand",
                    "factory": truth,
                    "imuNoise": {
                        "gyroNoiseDensity": 1.7e-4,
                        "accelNoiseDensity": 2e-3,
                        "gyroBiasRandomWalk": 2e-5,
                        "accelBiasRandomWalk": 3e-3,
                    },
                    "pixelSigmaPx": 0.5,
                }
            )
        )
        subprocess.run(
            [SELFCAL, *target, "rig", "create", created],
            check=True,
            capture_output=True,
        )
        sent = subprocess.run(
            [SELFCAL, *target, "track", "hand", self.walk],
            capture_output=True,
            text=True,
            check=False,
        )
        self.assertEqual(sent.returncode, 0, sent.stderr)
        listed = subprocess.run(
            [SELFCAL, *target, "segment", "list", "hand"],
            check=True,
            capture_output=True,
            text=True,
        )
        self.assertEqual(len(listed.stdout.splitlines()), 5)


class TwoImus(unittest.TestCase):
    def setUp(self) -> None:
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)

    def test_calibrates_a_second_imu(self) -> None:
        walk = render(
            self.folder / "walk", "--seconds", str(SECONDS), "--second-imu"
        )
        # The second IMU is half a degree and 4 mm from where it is stated.
        sensor = walk / "mav0/imu1/sensor.yaml"
        text = sensor.read_text()
        found = re.search(r"data: \[(.*?)\]", text, re.DOTALL)
        pose = [float(value) for value in found[1].split(",")]
        c, s = math.cos(0.009), math.sin(0.009)
        for row in range(3):
            a, b = pose[4 * row : 4 * row + 2]
            pose[4 * row : 4 * row + 2] = c * a + s * b, c * b - s * a
        pose[3] += 0.004
        sensor.write_text(text.replace(found[0], f"data: {pose}"))
        # Its readings are stamped 3 ms late.
        stamp_later(walk / "mav0/imu1/data.csv", 3_000_000)
        output = self.folder / "output"
        done = calibrate(walk, output)
        self.assertIn(done.returncode, (0, 5), done.stderr)
        truth = json.loads((walk / "calibration.json").read_text())["imu1"]
        result = parameters(output)["imu1"]
        for axis in "xyz":
            self.assertLess(
                abs(result["p_ji"][axis] - truth["p_ji"][axis]), 2e-3
            )
            self.assertLess(abs(result["s_g"][axis] - truth["s_g"][axis]), 3e-3)
        dot = sum(result["q_ji"][a] * truth["q_ji"][a] for a in "wxyz")
        self.assertLess(2 * math.acos(min(1, abs(dot))), 2e-3)
        self.assertLess(abs(result["time_offset_s"] + 3e-3), 1e-4)
        self.assertTrue((output / "kalibr/imu1.yaml").exists())

        # A further recording has to have its readings, too.
        shutil.rmtree(walk / "mav0/imu1")
        missing = calibrate(walk, output)
        self.assertNotEqual(missing.returncode, 0)
        self.assertIn("no readings of the second IMU", missing.stderr)


def real_recording(test: unittest.TestCase, name: str) -> pathlib.Path:
    data = os.environ.get(
        "SELFCAL_TEST_DATA",
        pathlib.Path(__file__).parents[4] / "shared/data",
    )
    recording = pathlib.Path(data) / name
    if not recording.exists():
        test.skipTest(f"no recordings beside the checkout: {recording}")
    return recording


class Map(unittest.TestCase):
    """A map of maplab: states and tracks of a SLAM system, which are used as
    they are."""

    def test_from_a_map_to_files(self) -> None:
        recording = real_recording(self, "euroc_v1_01")
        folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, folder)
        output = folder / "output"
        done = calibrate(recording, output, "--temperature", "21")
        # One keyframe a second: three segments, too few to confirm anything.
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("3 segments stored, 0 left out", done.stderr)
        self.assertIn("too few segments to confirm", done.stderr)
        self.assertFalse((output / "calibration.json").exists())

        again = calibrate(recording, output)
        self.assertEqual(again.returncode, 1, again.stderr)
        self.assertIn("0 segments stored, 0 left out", again.stderr)

        # The segments are those of an import.
        daemon = RunningDaemon(SELFCALD, f"{output}/state")
        self.addCleanup(daemon.stop)
        target = [SELFCAL, "--target", daemon.target, "--json"]
        for line in (
            ["rig", "create", "--vi-map", recording, "--id", "imported"],
            ["segment", "import", "imported", recording],
        ):
            subprocess.run([*target, *line], check=True, capture_output=True)
        listed = {}
        for rig in "device", "imported":
            shown = subprocess.run(
                [*target, "segment", "list", rig],
                capture_output=True,
                text=True,
                check=True,
            )
            listed[rig] = json.loads(shown.stdout)["segments"]
        for name in "start_ns", "end_ns", "keyframes":
            self.assertEqual(
                *([one[name] for one in some] for some in listed.values())
            )
        self.assertEqual(
            [one["temperature_c"] for one in listed["device"]], [21] * 3
        )

    def test_a_map_that_is_too_short(self) -> None:
        recording = real_recording(self, "equidistant_room")
        folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, folder)
        done = calibrate(recording, folder, "--keyframes", "2000")
        self.assertEqual(done.returncode, 2)
        self.assertIn(f"{recording} is too short for one segment", done.stderr)
        inner = calibrate(recording / "vi_map", folder)
        self.assertEqual(inner.returncode, 2)
        self.assertIn("name a VI-map folder", inner.stderr)


class RealImages(unittest.TestCase):
    """Five seconds of a drone that hardly moves: no calibration follows, and
    no component is far less certain than it was before."""

    def test_says_that_there_is_too_little_motion(self) -> None:
        images = real_recording(self, "euroc_images")
        folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, folder)
        done = calibrate(images, folder / "output")
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("Send more motion", done.stderr)
        rows = [line.split("\t") for line in done.stdout.splitlines()]
        sigmas = {row[0]: float(row[3]) for row in rows if len(row) == 4}
        for camera in "cam0", "cam1":
            self.assertLess(sigmas[f"{camera}.focal.x"], 3 * 23)
            self.assertLess(sigmas[f"{camera}.p_CI.x"], 3 * 0.05)


class Broken(unittest.TestCase):
    """One sentence and a code for each."""

    def setUp(self) -> None:
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)

    def expect(self, recording: pathlib.Path, text: str, *options: str) -> None:
        done = calibrate(recording, self.folder / "output", *options)
        self.assertIn(done.returncode, (1, 2), done.stderr)
        self.assertIn(text, done.stderr)

    def test_no_recording(self) -> None:
        self.expect(self.folder / "nothing", "nothing")

    def test_no_motion(self) -> None:
        still = render(
            self.folder / "still", "--seconds", "8", "--excitation", "0"
        )
        self.expect(still, "no motion was found")

    def test_two_clocks_and_no_motion(self) -> None:
        still = render(
            self.folder / "resting", "--seconds", "8", "--excitation", "0"
        )
        late = copy_with_readings_later(
            still, self.folder / "late", 86_400_000_000_000
        )
        self.expect(late, "have no time in common")

    def test_all_dark(self) -> None:
        dark = render(self.folder / "dark", "--seconds", "5")
        first = min((dark / "mav0/cam0/data").iterdir())
        black = self.folder / "black.png"

        # A PNG of zeros with the size of the others.
        def chunk(kind: bytes, data: bytes) -> bytes:
            body = kind + data
            return (
                struct.pack(">I", len(data))
                + body
                + struct.pack(">I", zlib.crc32(body))
            )

        header = struct.pack(">IIBBBBB", 640, 480, 8, 0, 0, 0, 0)
        black.write_bytes(
            b"\x89PNG\r\n\x1a\n"
            + chunk(b"IHDR", header)
            + chunk(b"IDAT", zlib.compress(bytes(641 * 480)))
            + chunk(b"IEND", b"")
        )
        for image in first.parent.iterdir():
            shutil.copy(black, image)
        self.expect(dark, "no motion was found")

    def test_images_of_another_size(self) -> None:
        small = render(self.folder / "small", "--seconds", "2")
        sensor = small / "mav0/cam0/sensor.yaml"
        sensor.write_text(sensor.read_text().replace("480", "400"))
        self.expect(small, "640 x 480")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:])
