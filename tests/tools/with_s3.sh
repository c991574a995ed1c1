#!/usr/bin/env bash
# Runs a command with an S3 server of its own, which ends with it: with_s3.sh COMMAND…
#
# ORB_S3_SERVER chooses it: swift, OpenStack Swift (the default), or radosgw, Ceph's. The command finds in its environment
#   ORB_S3         the server's URL; its keys are in AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY
#   ORB_S3_START   a program: starts the server again on the same port with the same data, and prints its process
#   ORB_S3_PID     the server's process
#   ORBMORPHD      if it is set: a program that starts that daemon with objects in the bucket "objects", below a prefix
#                  for its --data
#   ORB_DAEMON     then: that daemon itself
set -eu
tools=$(cd "$(dirname "$0")" && pwd)
case ${ORB_S3_SERVER:-swift} in
  swift)
    server_program=(/usr/bin/python3 "$tools/swift_s3.py") # Debian's Python, which has Debian's modules
    /usr/bin/python3 -c 'import swift.common, eventlet' 2>/dev/null || {
      echo "Swift is not there: install the packages swift-proxy, swift-account, swift-container and swift-object" >&2
      exit 77
    }
    ;;
  radosgw)
    server_program=("$tools/radosgw.sh")
    for program in radosgw radosgw-admin ceph ceph-mon ceph-osd monmaptool; do
      command -v "$program" >/dev/null || {
        echo "Ceph's radosgw is not there: install the packages radosgw, ceph-osd and ceph-mon" >&2
        exit 77
      }
    done
    ;;
  *)
    echo "ORB_S3_SERVER is swift or radosgw, not $ORB_S3_SERVER" >&2
    exit 2
    ;;
esac
folder=$(mktemp -d /tmp/orbmorph-s3-XXXXXX)
server=
finish() {
  exec 2>/dev/null # bash would report the ends of these processes
  for pid in $server $(cat "$folder/restarted" "$folder/data/cluster" 2>/dev/null || true); do
    kill -9 "$pid" 2>/dev/null || true
  done
  wait "$server" || true
  rm -rf "$folder"
}
trap finish EXIT
trap 'exit 143' TERM INT
mkdir "$folder/data"
"${server_program[@]}" "$folder/data" >"$folder/port" 2>"$folder/log" &
server=$!
for ((i = 0; i < 1200; i++)); do
  [ -s "$folder/port" ] && break
  kill -0 "$server" 2>/dev/null || { cat "$folder/log" >&2; exit 1; }
  sleep 0.1
done
port=$(head -1 "$folder/port")
[ -n "$port" ] || { echo "The S3 server did not start within two minutes" >&2; cat "$folder/log" >&2; exit 1; }
export ORB_S3="http://127.0.0.1:$port" ORB_S3_PID=$server ORB_S3_START="$folder/start"
export AWS_ACCESS_KEY_ID=orbmorph:daemon AWS_SECRET_ACCESS_KEY=secret-of-the-daemon
cat >"$ORB_S3_START" <<END
#!/usr/bin/env bash
${server_program[@]@Q} "$folder/data" "$port" >/dev/null 2>>"$folder/log" &
echo \$! >>"$folder/restarted"
echo \$!
END
chmod 755 "$ORB_S3_START"
node "$tools/s3.mjs" PUT objects >/dev/null
if [ -n "${ORBMORPHD:-}" ]; then
  cat >"$folder/orbmorphd" <<END
#!/usr/bin/env bash
data=
for ((i = 1; i < \$#; i++)); do
  if [ "\${!i}" = --data ]; then j=\$((i + 1)); data=\${!j}; fi
done
if [ -n "\$data" ]; then
  prefix=\$(printf %s "\$data" | sha1sum | cut -c1-24)
  export ORBMORPH_OBJECTS="s3://objects/\$prefix?endpoint=$ORB_S3"
fi
exec "$ORBMORPHD" "\$@"
END
  chmod 755 "$folder/orbmorphd"
  export ORB_DAEMON=${ORB_DAEMON:-$ORBMORPHD} ORBMORPHD="$folder/orbmorphd"
fi
"$@" &
wait $!
