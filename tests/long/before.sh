#!/bin/bash
# Runs tests of this version against the daemon of an older one, to see which of them fail there, and why.
#   tests/long/before.sh PROGRAM TEST…      PROGRAM: the older orbmorphd
# A test is a scenario, such as jobs, a test of the studio, such as studio.first, or long.before: attacks by interfaces
# that older daemons have too. For the studio the older daemon must have been built with its studio. ORBMORPH: the command
# line, this version's by default.
# Options that the older daemon does not know are omitted, with their values. Its address space is limited, since some
# scenarios make it take all memory. ORB_BEFORE_TESTS: only tests whose names match. ORB_BEFORE_WAIT: seconds that a test
# of the studio waits for what should come.
set -euo pipefail
cd "$(dirname "$0")/../.."
old=$(realpath "$1")
shift
seconds=${ORB_BEFORE_SECONDS:-300}
at=$(mktemp -d)
trap 'rm -rf "$at"' EXIT
"$old" --help >"$at/help"
cat >"$at/orbmorphd" <<END
#!/bin/bash
ulimit -v ${ORB_BEFORE_KB:-6000000}
args=()
while [ \$# -gt 0 ]; do
  if [[ \$1 == --* ]] && ! grep -q -e "\${1%%=*}\b" "$at/help"; then
    [[ \$1 == *=* || \${2:---} == --* ]] || shift
  else
    args+=("\$1")
  fi
  shift
done
exec "$old" "\${args[@]}"
END
chmod +x "$at/orbmorphd"
wait=${ORB_BEFORE_WAIT:-20}
export ORBMORPHD=$at/orbmorphd ORB_DAEMON=$at/orbmorphd ORBMORPH=${ORBMORPH:-$PWD/build/bin/orbmorph}
export ORB_PATIENCE=${wait}000 ORB_LIMIT=${wait}000 ORB_BEFORE=1
for name in "$@"; do
  [[ $name == *.* ]] || name=scenario.$name
  echo "== $name"
  timeout "$seconds" node --test --test-timeout="${seconds}000" ${ORB_BEFORE_TESTS:+"--test-name-pattern=$ORB_BEFORE_TESTS"} \
    "tests/${name/.//}.test.mjs" >"$at/out" 2>&1 || [ $? -ne 124 ] || echo "not ok: stopped after $seconds s"
  # prints the first four lines of each failure's error: what was expected, and what the test waited for
  awk '/^(not )?ok / { print }
    /^  error:/ { left = 4; sub(/^ *error: */, ""); sub(/^\|-$/, "") }
    /^  code:/ { left = 0 }
    { gsub(/\033\[[0-9;]*m/, ""); sub(/^ +/, "") }
    left && NF && !/^(=+|Call log:$)/ { print "    " substr($0, 1, 200); left-- }' "$at/out"
done
