#!/usr/bin/env bash
# Builds the libFuzzer targets and runs each for some seconds, as many at once as there are cores.
#
#   tests/fuzz/run.sh SECONDS [TARGET…]
#
# New inputs stay in build-fuzz/corpus/TARGET and are used again; what crashes, hangs or leaks is kept in
# build-fuzz/found, and the script fails. A line a target: executions, edges covered, time.
set -euo pipefail
cd "$(dirname "$(realpath -- "${BASH_SOURCE[0]}")")/../.."
seconds=${1:?seconds for each target}
shift
cmake --preset fuzz -DORB_TESTS=ON >/dev/null
targets=("$@")
if [ ${#targets[@]} -eq 0 ]; then
  targets=(obj off ply stl gltf glb json query range config sphere)
fi
cmake --build build-fuzz --target "${targets[@]/#/fuzz_}"
mkdir -p build-fuzz/found build-fuzz/corpus

one() {
  local name=$1 log=build-fuzz/corpus/$1.log status=0
  mkdir -p "build-fuzz/corpus/$name"
  TIMEFORMAT='%R s wall, %U s user, %S s system'
  { time build-fuzz/bin/fuzz_"$name" -close_fd_mask=2 -max_total_time="$2" -rss_limit_mb=2048 -timeout=60 \
      -print_final_stats=1 -artifact_prefix="build-fuzz/found/$name-" "build-fuzz/corpus/$name" \
      "tests/fuzz/corpus/$name"; } >"$log" 2>&1 || status=$?
  echo "fuzz $name: $(sed -n 's/^stat::number_of_executed_units: *//p' "$log") executions," \
    "$(grep -oE 'cov: [0-9]+' "$log" | tail -1), $(tail -1 "$log")"
  if [ $status -ne 0 ]; then
    tail -50 "$log"
  fi
  return $status
}
export -f one
printf '%s\n' "${targets[@]}" | xargs -P "$(nproc)" -I{} bash -c "one {} $seconds"
