#!/usr/bin/env bash
# The Debian packages from nothing: built by cpack, checked by lintian, installed by apt into a fresh Debian 12, removed,
# and purged. There the daemon runs as its own user for one merge, and a program is built with liborbmorph-dev and run
# with liborbmorph1 alone. Needs root, debootstrap and the Debian mirror.
#   tests/long/package.sh [FOLDER]     FOLDER (/tmp/orbmorph-package) keeps the build and the bare Debian
set -euo pipefail
cd "$(dirname "$(realpath -- "${BASH_SOURCE[0]}")")/../.."
at=$(realpath -m "${1:-/tmp/orbmorph-package}")
mirror=${ORB_DEBIAN_MIRROR:-http://deb.debian.org/debian}
debian=$at/debian
mkdir -p "$at"

bash client/web/build.sh
cmake -S . -B "$at/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DORB_TESTS=OFF -DCMAKE_INSTALL_PREFIX=/usr >/dev/null
cmake --build "$at/build"
rm -f "$at"/build/*.deb
(cd "$at/build" && cpack -G DEB)
packages=("$at"/build/{orbmorph,liborbmorph1,liborbmorph-dev}_*.deb)
if command -v lintian >/dev/null; then
  lintian --allow-root --fail-on error "${packages[@]}"
fi

if [ ! -f "$at/base/.whole" ]; then
  rm -rf "$at/base"
  debootstrap --variant=minbase bookworm "$at/base" "$mirror"
  touch "$at/base/.whole"
fi
unmount() {
  [ -z "${daemon:-}" ] || kill "$daemon" 2>/dev/null || true
  umount -q "$debian/proc" "$debian/dev/null" "$debian/dev/urandom" 2>/dev/null || true
}
trap unmount EXIT
unmount
rm -rf "$debian"
cp -a "$at/base" "$debian"
cp /etc/resolv.conf "$debian/etc/"
mount -t proc proc "$debian/proc"
for node in null urandom; do
  [ -e "$debian/dev/$node" ] || touch "$debian/dev/$node"
  mount --bind "/dev/$node" "$debian/dev/$node"
done
for package in "${packages[@]}"; do
  name=$(basename "$package")
  cp "$package" "$debian/root/${name%%_*}.deb"
done
cp tests/samples/dog.obj tests/samples/giraffe.off "$debian/root/"
inside() { DEBIAN_FRONTEND=noninteractive LC_ALL=C chroot "$debian" "$@"; }
inside apt-get update -qq
# Packages that orbmorph does not depend on are not installed: only it and curl are.
inside apt-get install -qq -y --no-install-recommends /root/orbmorph.deb curl >"$at/install.log" 2>&1 || { cat "$at/install.log"; exit 1; }

inside orbmorphd --version
inside sh -c 'ldd /usr/bin/orbmorphd /usr/bin/orbmorph /usr/bin/orbmorph-bench | grep "not found"' && exit 1
[ "$(inside stat -c %U:%G:%a /var/lib/orbmorph)" = orbmorph:orbmorph:750 ]
inside orbmorphd --check-config --config /etc/orbmorph/orbmorphd.conf
for file in /lib/systemd/system/orbmorphd.service /lib/systemd/system/orbmorphd.socket /usr/share/man/man1/orbmorph.1.gz \
  /usr/share/man/man1/orbmorph-bench.1.gz /usr/share/man/man8/orbmorphd.8.gz; do
  [ -s "$debian$file" ]
done
grep -o '](\(docs\|client\|CONTRIBUTING\|SECURITY\)[^)#]*' "$debian/usr/share/doc/orbmorph/README.md" | cut -c3- | while read -r link; do
  [ -e "$debian/usr/share/doc/orbmorph/$link" ] || { echo "the installed README's link $link leads nowhere"; exit 1; }
done

# Starts the daemon as the unit does: with the installed configuration, as the package's user. --listen: a port that is
# free here.
inside su -s /bin/sh orbmorph -c 'exec orbmorphd --config /etc/orbmorph/orbmorphd.conf --listen 127.0.0.1:0' >"$at/daemon.out" 2>"$at/daemon.log" &
daemon=$!
for _ in $(seq 100); do
  url=$(sed -n 's/^orbmorphd listening on //p' "$at/daemon.out")
  [ -z "$url" ] || break
  sleep 0.1
done
upload() { inside curl -fsS --data-binary "@/root/$1" "$url/v1/meshes?name=${1%.*}" | sed 's/.*"id":"\([0-9a-f]*\)".*/\1/'; }
a=$(upload dog.obj) b=$(upload giraffe.off)
inside curl -fsS -H 'Content-Type: application/json' -H 'Prefer: wait=60' \
  -d "{\"shapes\":[{\"mesh\":\"$a\"},{\"mesh\":\"$b\"}]}" "$url/v1/supermeshes" >"$at/supermesh.json"
asset=$(sed 's/.*"asset":"\([^"]*\)".*/\1/' "$at/supermesh.json")
inside curl -fsS "$url$asset" >"$at/asset.glb"
[ "$(head -c 4 "$at/asset.glb")" = glTF ]
inside orbmorph --server "$url" ls
kill "$daemon" $(pgrep -P "$daemon") 2>/dev/null || true
wait "$daemon" || true
daemon=
inside su -s /bin/sh orbmorph -c 'orbmorphd --check-data --data /var/lib/orbmorph'

# The library: a program built with the development package runs with liborbmorph1 alone.
[ ! -e "$debian/usr/include/orbmorph" ]
inside apt-get install -qq -y --no-install-recommends /root/liborbmorph1.deb /root/liborbmorph-dev.deb gcc libc6-dev pkg-config \
  >"$at/install.log" 2>&1 || { cat "$at/install.log"; exit 1; }
inside sh -c 'cc -std=c17 /usr/share/doc/liborbmorph-dev/morph.c $(pkg-config --cflags --libs orbmorph) -o /root/morph'
# shellcheck disable=SC2046 # words
inside apt-get purge -qq -y liborbmorph-dev $(dpkg-deb -f "$debian/root/liborbmorph-dev.deb" Depends | grep -o '[^ ,]*-dev') >"$at/remove.log" 2>&1
inside apt-get autoremove -qq -y >>"$at/remove.log" 2>&1
inside /root/morph /root/dog.obj /root/giraffe.off >"$at/library.glb"
[ "$(head -c 4 "$at/library.glb")" = glTF ]
inside apt-get purge -qq -y liborbmorph1 >>"$at/remove.log" 2>&1

inside apt-get remove -qq -y orbmorph >>"$at/remove.log" 2>&1
[ ! -e "$debian/usr/bin/orbmorphd" ] && [ -e "$debian/etc/orbmorph/orbmorphd.conf" ] && [ -e "$debian/var/lib/orbmorph/catalogue.sqlite" ]
inside apt-get purge -qq -y orbmorph >>"$at/remove.log" 2>&1
left=$(find "$debian" -xdev -name '*orbmorph*' -not -path '*/root/*' -not -path '*/var/log/*')
[ -z "$left" ] || { echo "a purge leaves: $left"; exit 1; }
if grep orbmorph "$debian/etc/passwd" "$debian/etc/group"; then
  echo "a purge leaves its user or group"
  exit 1
fi
echo "the packages install, run, and leave nothing"
