#!/usr/bin/env bash
# Builds the container image from a base image that is named by its digest, so that both stages, and every later build
# from the same commit, start from the same bytes.
#   deploy/image.sh [NAME]      builds NAME (orbmorph) from the base in deploy/base-image
#   deploy/image.sh --update    looks up the digest that the tag has now, and writes it to deploy/base-image
# deploy/base-image holds IMAGE:TAG@sha256:DIGEST. While it has no digest, a build looks it up first. ORB_BUILDER names
# the program: podman, or docker.
set -euo pipefail
cd "$(dirname "$(realpath -- "${BASH_SOURCE[0]}")")/.."
builder=${ORB_BUILDER:-$(command -v podman || command -v docker || true)}
[ -n "$builder" ] || { echo "deploy/image.sh needs podman or docker" >&2; exit 1; }
base=$(<deploy/base-image)

# Prints IMAGE:TAG@sha256:DIGEST for IMAGE:TAG.
look_up() {
  local digest
  "$builder" pull --quiet "$1" >/dev/null
  digest=$("$builder" image inspect --format '{{index .RepoDigests 0}}' "$1")
  digest=${digest##*@}
  [[ $digest =~ ^sha256:[0-9a-f]{64}$ ]] || { echo "$1 has no digest: $digest" >&2; return 1; }
  echo "$1@$digest"
}

if [ "${1:-}" = --update ]; then
  base=$(look_up "${base%%@*}")
  echo "$base" >deploy/base-image
  echo "deploy/base-image: $base"
  exit 0
fi
[[ $base == *@sha256:* ]] || base=$(look_up "$base")
echo "base: $base"
exec "$builder" build --build-arg "BASE=$base" --label "org.opencontainers.image.base.name=${base%%@*}" \
  --label "org.opencontainers.image.base.digest=${base##*@}" -f deploy/Dockerfile -t "${1:-orbmorph}" .
