#!/usr/bin/env bash
# Builds the container image from a base image that is named by its digest, so that both stages, and every later build
# from the same commit, start from the same bytes.
#   deploy/image.sh [NAME]      builds NAME (orbmorph) from the base in deploy/base-image
#   deploy/image.sh --update    looks up the digest that the tag has now, and writes it to deploy/base-image
# deploy/base-image holds IMAGE:TAG@sha256:DIGEST; ORB_BASE names another one. Without a digest nothing is built.
# ORB_BUILDER names the program: podman, or docker.
set -euo pipefail
cd "$(dirname "$(realpath -- "${BASH_SOURCE[0]}")")/.."
builder=${ORB_BUILDER:-$(command -v podman || command -v docker || true)}
[ -n "$builder" ] || { echo "deploy/image.sh needs podman or docker" >&2; exit 1; }
base=${ORB_BASE:-$(<deploy/base-image)}

if [ "${1:-}" = --update ]; then
  "$builder" pull --quiet "${base%%@*}" >/dev/null
  digest=$("$builder" image inspect --format '{{index .RepoDigests 0}}' "${base%%@*}")
  digest=${digest##*@}
  [[ $digest =~ ^sha256:[0-9a-f]{64}$ ]] || { echo "${base%%@*} has no digest: $digest" >&2; exit 1; }
  echo "${base%%@*}@$digest" >deploy/base-image
  echo "deploy/base-image: ${base%%@*}@$digest"
  exit 0
fi
[[ $base =~ ^[^@]+@sha256:[0-9a-f]{64}$ ]] || {
  echo "the base image $base has no digest: name one as IMAGE:TAG@sha256:DIGEST, or run deploy/image.sh --update" >&2
  exit 1
}
echo "base: $base"
exec "$builder" build --build-arg "BASE=$base" --label "org.opencontainers.image.base.name=${base%%@*}" \
  --label "org.opencontainers.image.base.digest=${base##*@}" -f deploy/Dockerfile -t "${1:-orbmorph}" .
