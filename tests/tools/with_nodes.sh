#!/usr/bin/env bash
# Runs a command with ORBMORPHD naming three nodes behind haproxy instead of one daemon (three_nodes.mjs); within
# with_postgresql.sh and with_s3.sh: with_nodes.sh COMMAND…
set -eu
: "${ORB_POSTGRESQL:?to be run by with_postgresql.sh}" "${ORB_S3:?and by with_s3.sh}"
[ -x "$(command -v haproxy || echo /usr/sbin/haproxy)" ] || {
  echo "haproxy is not there: install the package haproxy" >&2
  exit 77
}
ORBMORPHD="$(cd "$(dirname "$0")" && pwd)/three_nodes.mjs" ORB_NODES=3 exec "$@"
