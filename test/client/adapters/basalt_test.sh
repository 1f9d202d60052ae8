#!/usr/bin/env bash
# Builds the adapter for Basalt against the installed client library, renders a
# recording of two cameras, and runs Basalt on it, from a wrong calibration,
# until a version has become active and was applied. Skipped (77) without
# Basalt.
#
#   basalt_test.sh BUILD_DIR SOURCE_DIR SELFCALD SELFCAL SELFCAL_RENDER \
#     BASALT_DIR [BASALT_PREFIX [ADAPTER_BUILD [SECONDS [PACE [PAUSE]]]]]
#
# BASALT_PREFIX has the libraries that Basalt needs and the system lacks.
# ADAPTER_BUILD keeps the adapter's build, and with it Basalt's library, which
# takes minutes to compile. Rendering takes about two minutes of CPU time. After
# PAUSE seconds of the recording, its rest waits for the daemon's version.
set -euo pipefail
build=$1 source=$2 selfcald=$3 selfcal=$4 render=$5 basalt=$6
prefix=${7:-} adapter=${8:-} seconds=${9:-60} pace=${10:-1} pause=${11:-40}

if [[ ! -f $basalt/include/basalt/vi_estimator/vio_estimator.h ]]; then
  echo 'skipped: SELFCAL_BASALT_DIR does not name the source of Basalt'
  exit 77
fi
if [[ ! -x $render ]]; then
  echo 'skipped: selfcal_render is not built (it needs OpenCV)'
  exit 77
fi

# shellcheck source=test/client/package/private_library.sh
source "$source/test/client/package/private_library.sh"
install_library "$build"
adapter=${adapter:-$work/build}
if ! {
  cmake -S "$source/client/adapters/basalt" -B "$adapter" \
    -Dselfcal_DIR="$work/prefix/lib/cmake/selfcal" \
    -DCMAKE_PREFIX_PATH="$work/prefix;$prefix" -DBASALT_DIR="$basalt" \
    -DCONVERSION_TEST="$source/test/client/adapters/basalt_conversion.cc" &&
    cmake --build "$adapter" -j2
} >"$work/log" 2>&1; then
  cat "$work/log" >&2
  exit 1
fi
"$render" "$work/recording" --device equidistant --twin --seconds "$seconds" \
  --exposure-ms 3 2>/dev/null

# The factory calibration: cameras that are off by up to 0.6 % (f), 2 px, 5 mm,
# 0.15 degrees and 2 ms, and an IMU whose scales are off by 2 and 3 per mille.
# Both cameras have nearly the same errors: Basalt ends tracks that violate the
# epipolar constraint between them.
python3 - "$work" <<'END'
import copy
import json
import math
import sys

work = sys.argv[1]
with open(f"{work}/recording/calibration.json") as file:
    truth = json.load(file)
noise = {
    "gyro_noise_density": 1.7e-4,
    "accel_noise_density": 2e-3,
    "gyro_bias_random_walk": 2e-5,
    "accel_bias_random_walk": 3e-4,
}


def write(name, factory):
    rig = {"name": f"rigs/{name}", "factory": factory, "imu_noise": noise}
    with open(f"{work}/{name}.json", "w") as file:
        json.dump(rig | {"pixel_sigma_px": 0.3}, file)


start = copy.deepcopy(truth)
for axis, error in {"x": 1, "y": -1, "z": 1}.items():
    start["imu"]["s_g"][axis] += 0.002 * error
    start["imu"]["s_a"][axis] += 0.003 * error
for camera in start["cameras"]:
    camera["f"]["x"] *= 1.005
    camera["f"]["y"] *= 1.006
    camera["c"]["x"] += 2
    camera["c"]["y"] -= 1.5
    camera["p_ci"]["x"] += 0.005
    camera["p_ci"]["y"] -= 0.003
    turned = camera["q_ci"]
    turned["x"] += 0.0015
    turned["y"] -= 0.001
    norm = math.hypot(*turned.values())
    camera["q_ci"] = {axis: value / norm for axis, value in turned.items()}
    camera["time_offset_s"] = 0.002
right = start["cameras"][1]
right["f"]["y"] *= 0.999
right["c"]["y"] += 0.4
right["p_ci"]["z"] += 0.002
write("truth", truth)
write("stereo", start)
END

start_daemon "$selfcald"
"$selfcal" rig create "$work/truth.json" >/dev/null
"$selfcal" rig create "$work/stereo.json" --block '*.time_offset=on' \
  --prior-sigma '*.time_offset=0.02' >/dev/null
"$selfcal" calibration export stereo --format basalt --imu-rate 200 \
  --output "$work/calibration.json" >/dev/null 2>&1
export LD_LIBRARY_PATH
LD_LIBRARY_PATH=$(dirname "$(find "$work/prefix" -name libselfcal.so)")
"$adapter/basalt_conversion" "$SELFCAL_TARGET" stereo "$work/calibration.json"
# Fewer tracks than by default, so that the daemon's run takes less time.
sed -E 's/(optical_flow_detection_grid_size": )50/\1100/' \
  "$basalt/data/euroc_config.json" >"$work/config.json"
"$adapter/run_basalt" "$SELFCAL_TARGET" stereo truth "$work/recording" \
  "$work/config.json" "$work/calibration.json" "$seconds" "$pace" \
  "$pause" >"$work/shown"
# Without what Basalt prints itself.
grep -E '^(at the|version|segments| +version| .*\.[0-9]{4} .*\.[0-9]{3} )' \
  "$work/shown"
"$selfcal" calibration list stereo

grep -q 'version 2 is applied' "$work/shown"
grep -q ' 0 rejected, 0 dropped; ' "$work/shown"
# Each error of the factory calibration is at most a third of it at the end: f,
# c, time offset, and the scales of the IMU.
python3 - "$work/shown" <<'END'
import re
import sys

NUMBER = re.compile(r"-?\d+\.\d+")
errors = {"start": [], "end": []}
with open(sys.argv[1]) as file:
    for line in file:
        if found := re.match(r"at the (start|end): (\w+).* is off by (.*)", line):
            values = [abs(float(value)) for value in NUMBER.findall(found[3])]
            errors[found[1]] += values[:5] if found[2] == "camera" else values
assert len(errors["start"]) == len(errors["end"]) == 16
for start, end in zip(errors["start"], errors["end"]):
    assert end < start / 3, f"off by {start}, at the end by {end}"
END
echo 'passed'
