#!/usr/bin/env bash
# Installing a component that was not built says what to build: the build of
# deploy/demo has only the daemon and the demo.
#
#   partial_install_test.sh BUILD_DIR
set -euo pipefail
build=$1

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# The scripts of the build, which look for its files in a folder with only what
# configuring makes.
cp -r "$build/changelogs" "$work"
for component in daemon cli library python; do
  while IFS= read -r script; do
    copy=$work/${script#"$build"/}
    mkdir -p "$(dirname "$copy")"
    sed "s|$build/|$work/|g" "$script" >"$copy"
  done < <(find "$build" -name cmake_install.cmake)
  if cmake -DCMAKE_INSTALL_COMPONENT="$component" \
    -DCMAKE_INSTALL_PREFIX="$work/prefix" -P "$work/cmake_install.cmake" \
    >"$work/log" 2>&1; then
    echo "FAILED: $component was installed from nothing" >&2
    exit 1
  fi
  # CMake wraps its messages.
  tr -s ' \n' ' ' <"$work/log" | grep -F \
    "the component $component is not built; build it with: cmake --build" || {
    cat "$work/log" >&2
    echo "FAILED: installing $component does not say what to build" >&2
    exit 1
  }
done
echo passed
