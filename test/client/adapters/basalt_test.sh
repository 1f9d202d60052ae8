#!/usr/bin/env bash
# Builds the adapter for Basalt against the installed client library, renders a
# recording of two cameras, and runs Basalt on it, from a wrong calibration,
# until a version has become active and was applied. Skipped (77) without
# Basalt.
#
#   basalt_test.sh BUILD_DIR SOURCE_DIR SELFCALD SELFCAL SELFCAL_RENDER \
#     BASALT_DIR [BASALT_PREFIX [ADAPTER_BUILD [SECONDS [PACE]]]]
#
# BASALT_PREFIX has the libraries that Basalt needs and the system lacks.
# ADAPTER_BUILD keeps the adapter's build, and with it Basalt's library, which
# takes minutes to compile.
set -euo pipefail
build=$1 source=$2 selfcald=$3 selfcal=$4 render=$5 basalt=$6
prefix=${7:-} adapter=${8:-} seconds=${9:-60} pace=${10:-2}

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
# 0.2 degrees and 2 ms, and an IMU that is off by 2 to 3 per mille. The cameras
# are nearly off by the same, as Basalt ends tracks between them otherwise.
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
  --output "$work/calibration.json" 2>/dev/null
export LD_LIBRARY_PATH
LD_LIBRARY_PATH=$(dirname "$(find "$work/prefix" -name libselfcal.so)")
"$adapter/run_basalt" "$SELFCAL_TARGET" stereo truth "$work/recording" \
  "$basalt/data/euroc_config.json" "$work/calibration.json" "$seconds" \
  "$pace" >"$work/shown"
grep -E '^(at the|version|segments| )' "$work/shown"
"$selfcal" calibration list stereo

grep -q 'version 2 is applied' "$work/shown"
grep -q ' 0 rejected, 0 dropped; ' "$work/shown"
echo 'passed'
