# The client library in a folder of its own, and a daemon, for the tests that
# build programs against it. Sourced; $work is the folder, which goes at the end.
work=$(mktemp -d)
daemon=
cleanup() {
  if [[ -n $daemon ]]; then
    kill "$daemon" 2>/dev/null || true
    wait "$daemon" 2>/dev/null || true
  fi
  rm -rf "$work"
}
trap cleanup EXIT

# Installs it from a folder of the build to $work/prefix.
install_library() {
  local component
  for component in library development; do
    cmake --install "$1" --prefix "$work/prefix" --component "$component" \
      >/dev/null
  done
}

# Starts this selfcald on $work/state, and exports SELFCAL_TARGET.
start_daemon() {
  "$1" --state-dir "$work/state" 2>"$work/daemon.log" &
  daemon=$!
  export SELFCAL_TARGET=unix:$work/state/selfcald.sock
  for _ in $(seq 300); do
    grep -q ready "$work/daemon.log" && return
    sleep 0.1
  done
  cat "$work/daemon.log" >&2
  return 1
}
