#!/usr/bin/env bash
# Builds the adapter for OpenVINS against the installed client library, and runs
# OpenVINS on its simulator, from a wrong calibration, until versions have
# become active and were applied. Skipped (77) without OpenVINS.
#
#   openvins_test.sh BUILD_DIR SOURCE_DIR SELFCALD SELFCAL OPENVINS_DIR \
#     OPENVINS_BUILD [SECONDS]
set -euo pipefail
build=$1 source=$2 selfcald=$3 selfcal=$4 openvins=$5 openvins_build=$6
seconds=${7:-90}

if [[ ! -d $openvins/ov_msckf || ! -d $openvins_build ]]; then
  echo 'skipped: SELFCAL_OPENVINS_DIR and SELFCAL_OPENVINS_BUILD do not name' \
    'the source of OpenVINS and its build'
  exit 77
fi

# shellcheck source=test/client/package/private_library.sh
source "$source/test/client/package/private_library.sh"
install_library "$build"
if ! {
  cmake -S "$source/client/adapters/openvins" -B "$work/build" \
    -DCMAKE_PREFIX_PATH="$work/prefix" -DOPENVINS_DIR="$openvins" \
    -DOPENVINS_BUILD="$openvins_build" &&
    cmake --build "$work/build"
} >"$work/log" 2>&1; then
  cat "$work/log" >&2
  exit 1
fi

# The truth of the simulation: one camera of OpenVINS's own configuration, its
# IMU with errors, and a time offset. The filter does not calibrate itself.
mkdir "$work/truth" "$work/start"
trajectory=$openvins/ov_data/sim/tum_corridor1_512_16_okvis.txt
sed -E -e "s|^sim_traj_path:.*|sim_traj_path: \"$trajectory\"|" \
  -e 's/^max_cameras:.*/max_cameras: 1/' \
  -e 's/^sim_freq_cam:.*/sim_freq_cam: 20/' \
  -e 's/^sim_freq_imu:.*/sim_freq_imu: 200/' \
  -e 's/^sim_min_feature_gen_dist:.*/sim_min_feature_gen_dist: 1.5/' \
  -e 's/^sim_max_feature_gen_dist:.*/sim_max_feature_gen_dist: 5/' \
  -e 's/^(calib_[a-z_]+): true/\1: false/' \
  "$openvins/config/rpng_sim/estimator_config.yaml" \
  >"$work/truth/estimator_config.yaml"
cat >"$work/truth/kalibr_imucam_chain.yaml" <<'END'
%YAML:1.0

cam0:
  T_imu_cam:
    - [0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975]
    - [0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768]
    - [-0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949]
    - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: []
  camera_model: pinhole
  distortion_coeffs: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
  distortion_model: radtan
  intrinsics: [458.654, 457.296, 367.215, 248.375]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: 0.002
END
cat >"$work/truth/kalibr_imu_chain.yaml" <<'END'
%YAML:1.0

imu0:
  T_i_b:
    - [1.0, 0.0, 0.0, 0.0]
    - [0.0, 1.0, 0.0, 0.0]
    - [0.0, 0.0, 1.0, 0.0]
    - [0.0, 0.0, 0.0, 1.0]
  accelerometer_noise_density: 2.0e-3
  accelerometer_random_walk: 3.0e-3
  gyroscope_noise_density: 1.7e-04
  gyroscope_random_walk: 2.0e-05
  rostopic: /imu0
  time_offset: 0.0
  update_rate: 200.0
  model: "rpng"
  Tw:
    - [1.002, 0.001, -0.001]
    - [0.0, 0.998, 0.001]
    - [0.0, 0.0, 1.001]
  R_IMUtoGYRO:
    - [1.0, 0.0, 0.0]
    - [0.0, 1.0, 0.0]
    - [0.0, 0.0, 1.0]
  Ta:
    - [1.003, -0.002, 0.001]
    - [0.0, 0.997, 0.001]
    - [0.0, 0.0, 1.002]
  R_IMUtoACC:
    - [1.0, 0.0, 0.0]
    - [0.0, 1.0, 0.0]
    - [0.0, 0.0, 1.0]
  Tg:
    - [0.0, 0.0, 0.0]
    - [0.0, 0.0, 0.0]
    - [0.0, 0.0, 0.0]
END
# The factory calibration: an ideal IMU, no time offset, and a camera that is
# off by 0.5 %, 2 px and 5 mm.
sed -e 's/458.654, 457.296, 367.215, 248.375/460.9, 459.6, 369.2, 246.4/' \
  -e 's/-0.0216401454975/-0.0266401454975/' \
  -e 's/timeshift_cam_imu: 0.002/timeshift_cam_imu: 0.0/' \
  "$work/truth/kalibr_imucam_chain.yaml" \
  >"$work/start/kalibr_imucam_chain.yaml"
sed -E -e 's/\[1\.002, 0\.001.*/[1.0, 0.0, 0.0]/;s/\[0\.0, 0\.998.*/[0.0, 1.0, 0.0]/' \
  -e 's/\[0\.0, 0\.0, 1\.00[12]\]/[0.0, 0.0, 1.0]/' \
  -e 's/\[1\.003, -0\.002.*/[1.0, 0.0, 0.0]/;s/\[0\.0, 0\.997.*/[0.0, 1.0, 0.0]/' \
  "$work/truth/kalibr_imu_chain.yaml" >"$work/start/kalibr_imu_chain.yaml"

start_daemon "$selfcald"
"$selfcal" rig create --from openvins --id vins \
  "$work/start/kalibr_imucam_chain.yaml" "$work/start/kalibr_imu_chain.yaml" \
  --block 'cam0.time_offset=on' --prior-sigma 'cam0.time_offset=0.02' >/dev/null
export LD_LIBRARY_PATH
LD_LIBRARY_PATH=$(dirname "$(find "$work/prefix" -name libselfcal.so)")
"$work/build/run_openvins" "$SELFCAL_TARGET" vins \
  "$work/truth/estimator_config.yaml" "$seconds" | tee "$work/shown"
"$selfcal" calibration list vins

grep -q 'version 2 is applied' "$work/shown"
grep -q ' 0 rejected, 0 dropped; ' "$work/shown"
# From 2.2 px to less than a fifth.
awk '/at the end/ { good = $9 < 0.44 && $9 > -0.44 } END { exit !good }' \
  <(tr -d , <"$work/shown")
echo 'passed'
