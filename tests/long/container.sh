#!/usr/bin/env bash
# The container from nothing, without an image registry: the base is a bare Debian under the name that the Dockerfile
# asks for. Built by buildah, run by podman for one merge with a token, and stopped. It has no capability, may gain no
# privilege, reads only its volume's files and its own, and has the usual seccomp profile; within that, isolate = strict
# confines the processes of jobs. Needs root and the Debian mirror.
#   tests/long/container.sh [FOLDER]     FOLDER (/tmp/orbmorph-package) keeps the bare Debian
set -euo pipefail
cd "$(dirname "$(realpath -- "${BASH_SOURCE[0]}")")/../.."
at=$(realpath -m "${1:-/tmp/orbmorph-package}")
mirror=${ORB_DEBIAN_MIRROR:-http://deb.debian.org/debian}
mkdir -p "$at"
own=(--root "$at/images" --runroot "$at/images-run" --storage-driver vfs)

if [ ! -f "$at/base/.whole" ]; then
  rm -rf "$at/base"
  debootstrap --variant=minbase bookworm "$at/base" "$mirror"
  touch "$at/base/.whole"
fi
# The build also trusts certificates that were added to this machine: a proxy may need them.
mkdir -p "$at/base/usr/local/share/ca-certificates"
cp /usr/local/share/ca-certificates/*.crt "$at/base/usr/local/share/ca-certificates/" 2>/dev/null || true
echo 'cafile=/etc/ssl/certs/ca-certificates.crt' >"$at/base/root/.npmrc"
if ! podman "${own[@]}" image exists docker.io/library/debian:12-slim; then
  tar -C "$at/base" -c . | podman "${own[@]}" import --quiet - docker.io/library/debian:12-slim
fi
# Chroots instead of containers for the steps: this also works inside other containers.
buildah "${own[@]}" bud --layers --isolation=chroot --pull-never --format docker \
  --build-arg BASE=docker.io/library/debian:12-slim -f deploy/Dockerfile -t orbmorph .

# Without systemd, which podman would ask for cgroups and timers; limits that need no privilege.
run=(podman "${own[@]}" --cgroup-manager cgroupfs --events-backend file --runtime runc)
place=(--network host --no-healthcheck --ulimit nofile=4096:4096 --ulimit nproc=4096:4096 -v "$at/volume:/var/lib/orbmorph"
  --cap-drop all --security-opt no-new-privileges --read-only)
rm -rf "$at/volume"
mkdir -p "$at/volume"
user=$("${run[@]}" image inspect --format '{{.Config.User}}' orbmorph)
[ "$user" = orbmorph ] || { echo "it runs as '$user'"; exit 1; }
"${run[@]}" image inspect --format '{{json .HealthCheck}}' orbmorph | grep -q /livez
"${run[@]}" run --rm "${place[@]}" --entrypoint id orbmorph
owner=$("${run[@]}" run --rm "${place[@]}" --entrypoint id orbmorph -u)
chown "$owner" "$at/volume"
token=$("${run[@]}" run --rm "${place[@]}" orbmorph token add web --scope read,write --data /var/lib/orbmorph)
port=$((20000 + RANDOM % 20000))
name=orbmorph-check-$$
"${run[@]}" run -d --name "$name" "${place[@]}" orbmorph --listen "0.0.0.0:$port" --data /var/lib/orbmorph \
  --isolate strict --workers 1 >/dev/null
trap '"${run[@]}" rm -f "$name" >/dev/null 2>&1 || true' EXIT
for _ in $(seq 100); do
  curl -fs "http://127.0.0.1:$port/readyz" >/dev/null && break
  sleep 0.1
done
ask() { curl -fsS -H "Authorization: Bearer $token" "$@"; }
[ "$(curl -s -o /dev/null -w '%{http_code}' "http://127.0.0.1:$port/v1/meshes")" = 401 ]
upload() { ask --data-binary "@tests/samples/$1" "http://127.0.0.1:$port/v1/meshes?name=${1%.*}" | sed 's/.*"id":"\([0-9a-f]*\)".*/\1/'; }
a=$(upload dog.obj) b=$(upload giraffe.off)
asset=$(ask -H 'Content-Type: application/json' -H 'Prefer: wait=60' -d "{\"shapes\":[{\"mesh\":\"$a\"},{\"mesh\":\"$b\"}]}" \
  "http://127.0.0.1:$port/v1/supermeshes" | sed 's/.*"asset":"\([^"]*\)".*/\1/')
ask "http://127.0.0.1:$port$asset" >"$at/asset.glb"
[ "$(head -c 4 "$at/asset.glb")" = glTF ]

# A job that takes long: what its process may do, according to the kernel of this machine.
says() { sed -n "s/^$2:[[:space:]]*//p" "/proc/$1/status"; }
daemon=$("${run[@]}" inspect --format '{{.State.Pid}}' "$name")
zygote=$(pgrep -P "$daemon" -f isolated-processes)
c=$(upload elephant.ply)
job=$(ask -H 'Content-Type: application/json' -d "{\"mesh\":\"$c\",\"method\":\"kernel-sampling\",\"options\":{\"step\":0.01,\"growth\":1.01,\"first_optimization\":1,\"displacement_threshold\":1e-15,\"max_iterations\":1000000}}" \
  "http://127.0.0.1:$port/v1/embeddings" | sed 's/.*"url":"\([^"]*\)".*/\1/')
for _ in $(seq 200); do
  [ "$(ask "http://127.0.0.1:$port$job" | sed 's/.*"stage":"\([^"]*\)".*/\1/')" = embed ] && break
  sleep 0.1
done
workers=$(pgrep -P "$zygote") # of jobs and of checks
[ -n "$workers" ]
for pid in "$daemon" $workers; do
  [ "$(says "$pid" CapEff)" = 0000000000000000 ]
  [ "$(says "$pid" CapBnd)" = 0000000000000000 ]
  [ "$(says "$pid" NoNewPrivs)" = 1 ]
  [ "$(says "$pid" Seccomp)" = 2 ]
  [ "$(says "$pid" Uid | cut -f1)" = "$owner" ]
done
# These processes have their own filter in addition to the container's.
for pid in $workers; do
  [ "$(says "$pid" Seccomp_filters)" -gt "$(says "$daemon" Seccomp_filters)" ]
done
ask -X DELETE "http://127.0.0.1:$port$job" >/dev/null
"${run[@]}" exec "$name" curl -fsS "http://127.0.0.1:$port/livez" >/dev/null
"${run[@]}" stop -t 20 "$name" >/dev/null
[ "$("${run[@]}" inspect --format '{{.State.ExitCode}}' "$name")" = 0 ]
echo "the container is built, runs as its user without privileges, confines its jobs, and ends when it is told to"
