#!/usr/bin/env bash
# Packs what the build made into Debian packages, looks at what is in them and
# what they depend on, and runs the programs from an unpacked copy.
#
#   debian_packages_test.sh BUILD_DIR VERSION CERES     CERES: ON or OFF
#
# lintian checks the packages, too, where it is installed.
set -euo pipefail
build=$1 version=$2 ceres=$3

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() {
  echo "FAILED: $*" >&2
  exit 1
}

(cd "$work" && cpack --config "$build/CPackConfig.cmake" -B "$work/packs") \
  >"$work/log" 2>&1 || {
  cat "$work/log" >&2
  exit 1
}
arch=$(dpkg --print-architecture)
for package in selfcald selfcal libselfcal0 libselfcal-dev python3-selfcal; do
  [[ $package != python3-* ]] || arch=all
  deb=$work/packs/${package}_$version-1_$arch.deb
  [[ -f $deb ]] || fail "$package is missing"
  dpkg-deb -f "$deb" Package Version Depends Description
  [[ $(dpkg-deb -f "$deb" Homepage) == https://* ]] ||
    fail "$package has no address of the project"
  files=$(dpkg-deb -c "$deb" | awk '{print $6}')
  grep -qx "./usr/share/doc/$package/copyright" <<<"$files" ||
    fail "$package has no licence"
  elsewhere=$(grep -vE '^\./(usr(/|$)|$)' <<<"$files" || true)
  [[ $package == selfcald ]] || [[ -z $elsewhere ]] ||
    fail "$package puts files outside of /usr"
  dpkg-deb -x "$deb" "$work/root"
  doc=$work/root/usr/share/doc/$package
  zcat "$doc/changelog.Debian.gz" >"$work/changelog" ||
    fail "$package has no changelog"
  [[ $(dpkg-parsechangelog -l "$work/changelog" -S Version 2>&1) == \
    "$version-1" ]] || fail "the changelog of $package is not of $version"
done
arch=$(dpkg --print-architecture)
# The maintainer of a build that is not released is a placeholder.
if command -v lintian >/dev/null; then
  lintian --allow-root --fail-on error --suppress-tags \
    bogus-mail-host,bogus-mail-host-in-debian-changelog "$work"/packs/*.deb ||
    fail 'lintian finds mistakes'
fi
[[ -f $work/root/etc/selfcal/selfcald.toml ]] || fail 'no settings'
for file in alerts.yml client_alerts.yml dashboard.json \
  fleet_dashboard.json; do
  [[ -f $work/root/usr/share/selfcald/monitoring/$file ]] ||
    fail "selfcald has no $file"
done
for file in systemd/system/selfcald.service sysusers.d/selfcal.conf \
  tmpfiles.d/selfcal.conf; do
  [[ -f $work/root/usr/lib/$file ]] || fail "selfcald has no $file"
done
dpkg-deb -e "$work/packs/selfcald_$version-1_$arch.deb" "$work/control"
for script in postinst prerm postrm; do
  sh -n "$work/control/$script" || fail "$script is no script"
done
# Settings that somebody has changed stay as they are.
grep -qx /etc/selfcal/selfcald.toml "$work/control/conffiles" ||
  fail 'the settings are no conffile'
depends() { dpkg-deb -f "$work/packs/${1}_$version-1_$arch.deb" Depends; }
for package in selfcald selfcal libselfcal0; do
  [[ $(depends "$package") == *libgrpc++* ]] ||
    fail "$package does not depend on what it links"
done
[[ $(depends libselfcal-dev) == *"libselfcal0 (= $version-1)"* ]] ||
  fail 'libselfcal-dev does not depend on its library'
[[ $(depends selfcald) != *libselfcal* ]] ||
  fail 'the daemon depends on the client'

# SuiteSparseQR is GPL: no target of ours may link it (docs/licences.md).
programs=("$work/root/usr/bin/selfcald" "$work/root/usr/bin/selfcal"
  "$(find "$work/root" -name "libselfcal.so.$version")")
for program in "${programs[@]}"; do
  needed=$(readelf -d "$program" | grep NEEDED)
  [[ $needed == *libstdc++* ]] || fail "cannot read what $program links"
  [[ $needed != *libspqr* ]] || fail "$program links SuiteSparseQR"
  [[ $ceres == ON && $program == */selfcal@(d|) || $needed != *libcholmod* ]] ||
    fail "$program links CHOLMOD"
done

# Manual pages without mistakes, with every flag that the completion offers.
share=$work/root/usr/share
for page in man1/selfcal.1 man8/selfcald.8; do
  zcat "$share/man/$page.gz" >"$work/page" || fail "no manual page $page"
  ! command -v groff >/dev/null ||
    mistakes=$(groff -man -Tutf8 -ww -z "$work/page" 2>&1)
  [[ -z ${mistakes:-} ]] || fail "the manual page $page: $mistakes"
  sed 's/\\-/-/g' "$work/page" >"$work/$(basename "$page")"
done
completion=$share/bash-completion/completions/selfcal
flags=$(grep -oE -- '--[a-z][a-z-]+' "$completion" | sort -u)
(($(wc -l <<<"$flags") > 20)) || fail 'the completion has no flags'
while read -r flag; do
  grep -qF -- "$flag" "$work/selfcal.1" ||
    fail "the manual page of selfcal has no $flag"
done <<<"$flags"
grep -qF -- --max-run-memory "$work/selfcald.8" ||
  fail 'the manual page of selfcald has no settings'
bash -n "$completion" || fail 'the completion is no script'
[[ -f $share/zsh/vendor-completions/_selfcal ]] || fail 'nothing for zsh'
[[ -f $share/fish/vendor_completions.d/selfcal.fish ]] ||
  fail 'nothing for fish'

PYTHONPATH=$work/root/usr/lib/python3/dist-packages /usr/bin/python3 -B -c \
  'import selfcal; import selfcal.v1.rig_pb2; selfcal.connect' ||
  fail 'the Python package cannot be imported'

"$work/root/usr/bin/selfcald" --version | grep -qF "$version" ||
  fail 'selfcald --version'
"$work/root/usr/bin/selfcal" --version | grep -qF "$version" ||
  fail 'selfcal --version'
echo passed
