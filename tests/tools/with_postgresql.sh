#!/usr/bin/env bash
# Runs a command with a PostgreSQL server of its own, which ends with it: with_postgresql.sh COMMAND…
#
# ORB_POSTGRESQL_OPTIONS are more options of the server. The command finds in its environment
#   ORB_POSTGRESQL     the URL of the server's database
#   ORB_NEW_CATALOGUE  a program: prints the URL of the catalogue for a data folder, and creates its empty schema
#   ORB_POSTGRESQL_DO  a program: stops or starts the server (stop, start)
#   ORBMORPHD          if it is set: a program that starts that daemon with the catalogue of its --data
#   ORB_DAEMON         then: that daemon itself
set -eu
bin=$(ls -d /usr/lib/postgresql/*/bin 2>/dev/null | sort -V | tail -1)
[ -n "$bin" ] || bin=$(dirname "$(command -v initdb || echo /nowhere/initdb)")
[ -x "$bin/initdb" ] || {
  echo "PostgreSQL is not there: install the package postgresql" >&2
  exit 77
}
folder=$(mktemp -d /tmp/orbmorph-postgresql-XXXXXX)
as=()
if [ "$(id -u)" -eq 0 ]; then # the server refuses to run as root
  as=(setpriv --reuid=nobody --regid="$(id -g nobody)" --clear-groups)
  chown nobody "$folder"
fi
finish() {
  "${as[@]}" "$bin/pg_ctl" -D "$folder/data" -m immediate -s stop >/dev/null 2>&1 || true
  rm -rf "$folder"
}
trap finish EXIT
trap 'exit 143' TERM INT
cd "$folder"
"${as[@]}" env HOME="$folder" "$bin/initdb" -D "$folder/data" -U orbmorph -A trust -E UTF8 --locale=C.UTF-8 -N >"$folder/log" ||
  { cat "$folder/log" >&2; exit 1; }
# Connections of the role "guarded" need a password.
sed -i '1i local all guarded scram-sha-256' "$folder/data/pg_hba.conf"
export ORB_POSTGRESQL_DO="$folder/do"
cat >"$ORB_POSTGRESQL_DO" <<END
#!/bin/sh
cd "$folder"
exec ${as[*]} env HOME="$folder" "$bin/pg_ctl" -D "$folder/data" -s -w -m fast -l "$folder/server.log" \
  -o "-c listen_addresses='' -c unix_socket_directories='$folder' -c fsync=off -c max_connections=300 -c shared_buffers=32MB ${ORB_POSTGRESQL_OPTIONS:-}" "\$1"
END
chmod 755 "$ORB_POSTGRESQL_DO"
"$ORB_POSTGRESQL_DO" start || { cat "$folder/server.log" >&2; exit 1; }
export ORB_POSTGRESQL="postgresql:///postgres?host=$folder&user=orbmorph"
export ORB_NEW_CATALOGUE="$folder/new_catalogue"
chmod 755 "$folder"
cat >"$ORB_NEW_CATALOGUE" <<END
#!/bin/sh
schema=c\$(printf %s "\$1" | sha1sum | cut -c1-24)
"$bin/psql" -X -q -d "$ORB_POSTGRESQL" -c "SET client_min_messages=warning; CREATE SCHEMA IF NOT EXISTS \$schema" || exit 1
printf %s "$ORB_POSTGRESQL&options=-csearch_path%3D\$schema"
END
chmod 755 "$ORB_NEW_CATALOGUE"
if [ -n "${ORBMORPHD:-}" ]; then
  cat >"$folder/orbmorphd" <<END
#!/usr/bin/env bash
data=
for ((i = 1; i < \$#; i++)); do
  if [ "\${!i}" = --data ]; then j=\$((i + 1)); data=\${!j}; fi
done
if [ -n "\$data" ]; then
  ORBMORPH_CATALOGUE=\$("$ORB_NEW_CATALOGUE" "\$data") || exit 1
  export ORBMORPH_CATALOGUE
fi
exec "$ORBMORPHD" "\$@"
END
  chmod 755 "$folder/orbmorphd"
  export ORB_DAEMON=$ORBMORPHD PATH="$bin:$PATH"
  export ORBMORPHD="$folder/orbmorphd"
fi
cd "$OLDPWD"
"$@" &
wait $!
