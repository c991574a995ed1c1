#!/usr/bin/env bash
# Runs a command with an S3 server of its own, OpenStack Swift, which ends with it: with_s3.sh COMMAND…
#
# The command finds in its environment
#   ORB_S3         the server's URL; its keys are in AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY
#   ORB_S3_START   a program: starts the server again on the same port with the same data, and prints its process
#   ORB_S3_PID     the server's process
#   ORBMORPHD      if it is set: a program that starts that daemon with objects in the bucket "objects", below a prefix
#                  for its --data
#   ORB_DAEMON     then: that daemon itself
set -eu
python=/usr/bin/python3 # Debian's, which has Debian's modules
tools=$(cd "$(dirname "$0")" && pwd)
"$python" -c 'import swift.common, eventlet' 2>/dev/null || {
  echo "Swift is not there: install the packages swift-proxy, swift-account, swift-container and swift-object" >&2
  exit 77
}
folder=$(mktemp -d /tmp/orbmorph-s3-XXXXXX)
server=
finish() {
  for pid in $server $(cat "$folder/restarted" 2>/dev/null || true); do
    kill "$pid" 2>/dev/null || true
  done
  rm -rf "$folder"
}
trap finish EXIT
trap 'exit 143' TERM INT
"$python" "$tools/swift_s3.py" "$folder/swift" >"$folder/port" 2>"$folder/log" &
server=$!
for ((i = 0; i < 600; i++)); do
  [ -s "$folder/port" ] && break
  kill -0 "$server" 2>/dev/null || { cat "$folder/log" >&2; exit 1; }
  sleep 0.1
done
port=$(head -1 "$folder/port")
[ -n "$port" ] || { echo "Swift did not start within a minute" >&2; cat "$folder/log" >&2; exit 1; }
export ORB_S3="http://127.0.0.1:$port" ORB_S3_PID=$server ORB_S3_START="$folder/start"
export AWS_ACCESS_KEY_ID=orbmorph:daemon AWS_SECRET_ACCESS_KEY=secret-of-the-daemon
cat >"$ORB_S3_START" <<END
#!/usr/bin/env bash
"$python" "$tools/swift_s3.py" "$folder/swift" "$port" >/dev/null 2>>"$folder/log" &
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
