#!/usr/bin/env bash
# From a bare Debian 12 to a GLB that morphs: installs packages, builds, starts the daemon, merges two meshes over HTTP.
#
#   deploy/demo.sh [--serve] [--landmarks FILE] [MESH MESH…]
#
# Without meshes it takes the samples of this repository. --serve leaves the daemon running and prints its address.
set -euo pipefail

usage() {
  sed -n '2,6s/^# \{0,1\}//p' "$0"
}

serve=no
landmarks=
meshes=()
while [ $# -gt 0 ]; do
  case "$1" in
    --serve) serve=yes ;;
    --landmarks) landmarks=$(realpath -- "${2:?a file is missing after --landmarks}"); shift ;;
    --help | -h) usage; exit 0 ;;
    --) shift; break ;;
    -*) echo "demo.sh: unknown option $1" >&2; usage >&2; exit 2 ;;
    *) meshes+=("$1") ;;
  esac
  shift
done
meshes+=("$@")
for i in "${!meshes[@]}"; do
  if [ ! -f "${meshes[$i]}" ] || [ ! -r "${meshes[$i]}" ]; then
    echo "demo.sh: cannot read ${meshes[$i]}" >&2
    exit 2
  fi
  meshes[i]=$(realpath -- "${meshes[$i]}")
done
if [ ${#meshes[@]} -eq 1 ]; then
  echo "demo.sh: two meshes or more are needed" >&2
  exit 2
fi

root=$(cd "$(dirname "$(realpath -- "${BASH_SOURCE[0]}")")/.." && pwd)
if [ ${#meshes[@]} -eq 0 ]; then
  meshes=("$root/tests/samples/dog.obj" "$root/tests/samples/giraffe.off")
  landmarks=${landmarks:-$root/tests/samples/dog-giraffe.json}
fi

# shellcheck source=deploy/packages.sh
source "$root/deploy/packages.sh"
orb_install_packages "${orb_build_packages[@]}"
if [ "$serve" = yes ]; then
  orb_install_node
fi

# The folder of the results, without blanks in its name.
pick_output() {
  local folder
  for folder in "$root/build/demo" "${HOME:-/}/orbmorph-demo" /var/tmp/orbmorph-demo; do
    case "$folder" in *[[:space:]]*) continue ;; esac
    if mkdir -p "$folder" 2>/dev/null && [ -w "$folder" ]; then
      echo "$folder"
      return
    fi
  done
  echo "demo.sh: no folder to write to" >&2
  return 1
}
output=$(pick_output)

mkdir -p "$root/build"
log=$root/build/demo-build.log
echo "building in $root/build (log: demo-build.log)"
build() {
  # the studio is compiled into the daemon
  if [ "$serve" = yes ]; then
    bash "$root/client/web/build.sh"
  fi
  [ -f "$root/build/build.ninja" ] || cmake -S "$root" --preset release -DORB_TESTS=OFF
  cmake --build "$root/build" --target orbmorphd orbmorph
}
# Prints the step of the build every five seconds: Ninja writes [done/all] before each step, build.sh "stage: …".
say_progress() {
  local step
  while sleep 5; do
    step=$(grep -aoE '^(\[[0-9]+/[0-9]+\]|stage: .*)' "$log" | tail -n 1 | sed 's/^stage: //' | tr -d '[]') || true
    [ -n "$step" ] || step='what the compiler can do'
    echo "  building: ${step/\// of } (${SECONDS} s)"
  done
}
say_progress &
reporter=$!
built=yes
(cd "$root" && build) >"$log" 2>&1 || built=no
kill "$reporter" 2>/dev/null || true
wait "$reporter" 2>/dev/null || true
if [ "$built" = no ]; then
  tail -n 40 "$log" >&2
  echo "demo.sh: the build failed; all of its output is in $log" >&2
  exit 1
fi

data=$(mktemp -d "${TMPDIR:-/tmp}/orbmorph-demo.XXXXXX")
daemon=
finish() {
  if [ -n "$daemon" ]; then
    kill "$daemon" 2>/dev/null || true
    wait "$daemon" 2>/dev/null || true
  fi
  rm -rf "$data"
}
trap finish EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

address=
start_daemon() {
  : >"$data/out"
  setsid "$root/build/bin/orbmorphd" --listen "127.0.0.1:$1" --data "$data/store" >"$data/out" 2>"$data/log" </dev/null &
  daemon=$!
  for _ in $(seq 150); do
    address=$(sed -n 's/^orbmorphd listening on //p' "$data/out")
    [ -z "$address" ] || return 0
    if ! kill -0 "$daemon" 2>/dev/null; then
      break
    fi
    sleep 0.1
  done
  return 1
}
# the port of all examples, or any port if another program has it
start_daemon 8080 || start_daemon 0 || true
if [ -z "$address" ]; then
  cat "$data/log" >&2
  echo "demo.sh: the daemon did not start" >&2
  exit 1
fi

# a.obj b.off → a-b; the characters that a file's name may have without quoting
stem=
for mesh in "${meshes[@]}"; do
  name=$(basename -- "$mesh")
  stem+=${stem:+-}${name%.*}
done
stem=$(printf %s "$stem" | tr -c 'A-Za-z0-9._-' _ | cut -c1-100)

echo "morphing $(basename -- "${meshes[0]}") and $((${#meshes[@]} - 1)) more at $address"
export ORBMORPH_SERVER=$address
options=(-o "$output/$stem.glb" --report "$output/$stem.md")
if [ -n "$landmarks" ]; then
  options+=(--landmarks "$landmarks")
fi
"$root/build/bin/orbmorph" morph --json "${options[@]}" -- "${meshes[@]}" >"$output/$stem.json"

echo
echo "GLB:    $output/$stem.glb"
echo "Report: $output/$stem.md"
echo "JSON:   $output/$stem.json"
if [ "$serve" = yes ]; then
  echo "Server: $address (its data in $data; stop it with: kill $daemon)"
  echo "Open $address/ in a browser, and drop your own files there."
  daemon=
  trap - EXIT
fi
