#!/usr/bin/env bash
# Runs a command with pgbouncer, in session mode, before the server of with_postgresql.sh, within which it runs:
# with_pgbouncer.sh COMMAND…
#
# The command finds in its environment
#   ORB_NEW_CATALOGUE  a program: prints the URL of the catalogue for a name, through pgbouncer, and creates its empty
#                      database. A schema does not do: pgbouncer passes on no search_path.
set -eu
: "${ORB_POSTGRESQL:?to be run by with_postgresql.sh}"
program=$(command -v pgbouncer || echo /usr/sbin/pgbouncer)
[ -x "$program" ] || {
  echo "pgbouncer is not there: install the package pgbouncer" >&2
  exit 77
}
folder=$(mktemp -d /tmp/orbmorph-pgbouncer-XXXXXX)
server=
finish() {
  [ -n "$server" ] && kill "$server" 2>/dev/null && wait "$server" 2>/dev/null || true
  rm -rf "$folder"
}
trap finish EXIT
trap 'exit 143' TERM INT
as=()
if [ "$(id -u)" -eq 0 ]; then # it refuses to run as root
  as=(setpriv --reuid=nobody --regid="$(id -g nobody)" --clear-groups)
  chown nobody "$folder"
fi
chmod 755 "$folder"
behind=${ORB_POSTGRESQL#*host=}
# The settings that docs/cluster.md names. A pool of its own for each database.
cat >"$folder/pgbouncer.ini" <<END
[databases]
* = host=${behind%%&*} user=orbmorph
[pgbouncer]
pool_mode = session
listen_addr =
listen_port = 6432
unix_socket_dir = $folder
auth_type = any
max_client_conn = 300
default_pool_size = 100
server_login_retry = 1
query_wait_timeout = 5
END
"${as[@]}" "$program" -q "$folder/pgbouncer.ini" 2>"$folder/log" &
server=$!
url="postgresql:///%s?host=$folder&port=6432&user=orbmorph"
for ((i = 0; i < 300; i++)); do
  # shellcheck disable=SC2059
  psql -X -qAt -d "$(printf "$url" postgres)" -c 'SELECT 1' >/dev/null 2>&1 && break
  kill -0 "$server" 2>/dev/null || { cat "$folder/log" >&2; exit 1; }
  sleep 0.1
done
cat >"$folder/new_catalogue" <<END
#!/bin/sh
name=c\$(printf %s "\$1" | sha1sum | cut -c1-24)
if [ "\$(psql -X -qAt -d "$ORB_POSTGRESQL" -c "SELECT 1 FROM pg_database WHERE datname='\$name'")" != 1 ]; then
  psql -X -q -d "$ORB_POSTGRESQL" -c "CREATE DATABASE \$name" || exit 1
fi
printf "$url" "\$name"
END
chmod 755 "$folder/new_catalogue"
export ORB_NEW_CATALOGUE="$folder/new_catalogue"
"$@" &
wait $!
