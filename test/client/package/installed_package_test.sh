#!/usr/bin/env bash
# Installs the client library into a folder of its own, builds the examples
# outside the tree with nothing but that, by CMake and by pkg-config, and
# streams a recording with them to a daemon.
#
#   installed_package_test.sh BUILD_DIR SOURCE_DIR SELFCALD SELFCAL WRITER
set -euo pipefail
build=$1 source=$2 selfcald=$3 selfcal=$4 writer=$5

# shellcheck source=test/client/package/private_library.sh
source "$source/test/client/package/private_library.sh"
install_library "$build"

echo 'headers: only what the package may know'
if grep -rnE '#include [<"](grpc|google|client/|core/|proto/|server/)' \
  "$work/prefix/include"; then
  echo 'FAILED: a public header includes what is not installed' >&2
  exit 1
fi
library=$(find "$work/prefix" -name 'libselfcal.so')
foreign=$(nm -DC --defined-only "$library" |
  grep -vE ' selfcal::(client::(SegmentBuilder::|SegmentStream::|CalibrationWatch::|Assemble|AtTemperature)|[A-Z])|@SELFCAL_C_[0-9]+$| SELFCAL_(CXX_0|C_1)(@|$)' ||
  true)
if [[ -n $foreign ]]; then
  echo "FAILED: libselfcal shows more than its interface: $foreign" >&2
  exit 1
fi

echo 'library: the C interface is what it was, and all that its header declares'
nm -D --defined-only --with-symbol-versions "$library" |
  awk '$3 ~ /@SELFCAL_C_/ { print $3 }' | sort >"$work/symbols"
diff "$source/test/client/package/c_symbols.txt" "$work/symbols" || {
  echo 'FAILED: a function of the C interface may be added, never changed' >&2
  exit 1
}
header=$work/prefix/include/selfcal/selfcal.h
sed 's://.*::' "$header" | grep -oE '\bselfcal_\w+\(' | tr -d '(' |
  sort -u >"$work/declared"
diff <(sed 's/@.*//' "$work/symbols") "$work/declared" || {
  echo 'FAILED: selfcal.h declares something else' >&2
  exit 1
}

echo 'library: what applies a calibration is in it'
for function in CarryBiases CorrectImu Project Unproject; do
  nm -DC --defined-only "$library" | grep " selfcal::$function(" >/dev/null || {
    echo "FAILED: libselfcal has no $function" >&2
    exit 1
  }
done

echo 'example: with CMake'
cp -r "$source/client/example" "$work/example"
if ! {
  cmake -S "$work/example" -B "$work/build" \
    -DCMAKE_PREFIX_PATH="$work/prefix" -DCMAKE_BUILD_TYPE=Debug &&
    cmake --build "$work/build"
} >"$work/log" 2>&1; then
  cat "$work/log" >&2
  exit 1
fi

echo 'example: with CMake, without C++20'
# No Eigen and no Abseil may be found.
if ! {
  cmake -S "$work/example" -B "$work/legacy" -DCXX20=OFF \
    -DCMAKE_PREFIX_PATH="$work/prefix" -DCMAKE_DISABLE_FIND_PACKAGE_Eigen3=ON \
    -DCMAKE_DISABLE_FIND_PACKAGE_absl=ON &&
    cmake --build "$work/legacy"
} >"$work/log" 2>&1; then
  cat "$work/log" >&2
  exit 1
fi

echo 'example: with pkg-config'
PKG_CONFIG_PATH=$(dirname "$(find "$work/prefix" -name selfcal.pc)")
export PKG_CONFIG_PATH
# shellcheck disable=SC2046
c++ -std=c++20 "$work/example/stream_recording.cc" -o "$work/by_pkg_config" \
  $(pkg-config --cflags --libs selfcal)
strict=(-Wall -Wextra -Wpedantic -Werror -O2 -MMD -MF "$work/includes")
[[ $(uname -m) != x86_64 ]] || strict+=(-march=native)
for example in stream_recording_c.c stream_recording_cxx11.cc; do
  compiler=(c++ -std=c++11)
  [[ $example != *.c ]] || compiler=(cc -std=c99)
  echo "example: $example, by ${compiler[*]} ${strict[*]:0:4}"
  # shellcheck disable=SC2046
  "${compiler[@]}" "${strict[@]}" "$work/example/$example" \
    -o "$work/${example%.*}" $(pkg-config --cflags --libs selfcal-c)
  if grep -iE '/(eigen3|absl)/' "$work/includes"; then
    echo "FAILED: $example needs Eigen or Abseil" >&2
    exit 1
  fi
done
export LD_LIBRARY_PATH
LD_LIBRARY_PATH=$(dirname "$library")

echo 'example: streams a recording'
"$writer" "$work"
start_daemon "$selfcald"
"$selfcal" rig create "$work/rig.json" >/dev/null
first=$("$work/build/stream_recording" "$SELFCAL_TARGET" packaged "$work" \
  "$work/spool" | tee /dev/stderr | tail -n 1)
again=$("$work/by_pkg_config" "$SELFCAL_TARGET" packaged "$work" |
  tee /dev/stderr | tail -n 1)
listed=$("$selfcal" segments list packaged | wc -l)
[[ $first == 'segments: 4 stored, 0 known already, 0 rejected' ]]
[[ $again == 'segments: 0 stored, 4 known already, 0 rejected' ]]
[[ $listed == 4 ]]

for program in stream_recording_c stream_recording_cxx11 \
  legacy/stream_recording_c legacy/stream_recording_cxx11; do
  echo "example: $program"
  rig=$(tr _/ -- <<<"$program")
  sed "s/packaged/$rig/g" "$work/rig.json" >"$work/$rig.json"
  "$selfcal" rig create "$work/$rig.json" >/dev/null
  shown=$("$work/$program" "$SELFCAL_TARGET" "$rig" "$work" "$work/spool" |
    tee /dev/stderr)
  [[ $shown == *'calibration 1 is active'* ]]
  [[ $shown == *'segments: 4 stored, 0 known already, 0 rejected' ]]
done
echo 'example: a filter, which exchanges its calibration'
sed 's/packaged/filter/g' "$work/rig.json" >"$work/filter.json"
"$selfcal" rig create "$work/filter.json" >/dev/null
shown=$("$work/build/stream_filter" "$SELFCAL_TARGET" filter "$work" 5 |
  tee /dev/stderr)
[[ $shown == *'version 1 is applied'*'segments: 4 stored, 0 rejected'* ]]
[[ $shown =~ tracks:\ ([0-9]+)\ triangulated,\ ([0-9]+)\ dropped ]]
((BASH_REMATCH[1] > 10 * BASH_REMATCH[2]))
"$selfcal" run start filter --force >/dev/null
"$work/build/stream_filter" "$SELFCAL_TARGET" filter "$work" 5 0.5 \
  >"$work/shown" &
example=$!
for _ in $(seq 100); do
  grep -q 'version 2 is applied' "$work/shown" && break
  sleep 0.05
done
"$selfcal" calibration activate filter 1 --reason 'seen by the example' \
  >/dev/null
wait "$example"
cat "$work/shown"
[[ $(<"$work/shown") == *'version 2 is applied'*'version 1 is applied'* ]]
echo 'passed'
