#!/usr/bin/env bash
# Builds the libFuzzer targets and runs each for some seconds, as many at once as there are cores.
#
#   tests/fuzz/run.sh [--cpu] SECONDS [TARGET…]    with --cpu the seconds are of CPU time, else of wall time
#                                                  with ORB_FUZZ_SEED all begin with the same inputs each time
#   tests/fuzz/run.sh --sums                       what all runs in build-fuzz came to, a line a target
#   tests/fuzz/run.sh --keep BYTES [TARGET…]       adds what covers more to tests/fuzz/corpus, inputs up to BYTES each
#
# New inputs stay in build-fuzz/corpus/TARGET and are used again; what crashes, hangs or leaks is kept in
# build-fuzz/found, and the script fails. A line a target: executions, edges covered, time; the same goes to
# build-fuzz/sums/TARGET.
set -euo pipefail
cd "$(dirname "$(realpath -- "${BASH_SOURCE[0]}")")/../.."
all=(obj off ply stl gltf glb json query range config sphere decode http token view client)

sums() {
  local name
  for name in "${all[@]}"; do
    if [ -f "build-fuzz/sums/$name" ]; then
      awk -v name="$name" '{ wall += $1; cpu += $2; runs += $3; cov = $4; bad += $5 != 0 }
        END { printf "%s: %.0f s wall, %.0f s CPU, %d executions, %s edges, %d runs that failed\n", name, wall, cpu, runs, cov, bad }' \
        "build-fuzz/sums/$name"
    fi
  done
}

# CPU time of a process so far, in seconds.
cpu_of() {
  local stat
  stat=$(cat "/proc/$1/stat" 2>/dev/null) || return 1
  set -- ${stat##*) }
  echo $(((${12} + ${13}) / $(getconf CLK_TCK)))
}

# Runs a target; a fuzzer that has its time is told by SIGUSR1 to end with its statistics.
one() {
  local name=$1 seconds=$2 unit=$3 log=build-fuzz/corpus/$1.log status=0 used limit=$2 fuzzer
  mkdir -p "build-fuzz/corpus/$name"
  [ "$unit" = wall ] || limit=0
  TIMEFORMAT='%R s wall, %U s user, %S s system'
  { time {
      build-fuzz/bin/fuzz_"$name" -close_fd_mask=2 -max_total_time="$limit" -rss_limit_mb=2048 -seed="${ORB_FUZZ_SEED:-0}" \
        -timeout=$([ "$unit" = wall ] && echo 60 || echo 1200) -report_slow_units=1200 -print_final_stats=1 \
        -artifact_prefix="build-fuzz/found/$name-" "build-fuzz/corpus/$name" "tests/fuzz/corpus/$name" &
      fuzzer=$!
      if [ "$unit" = cpu ]; then
        while used=$(cpu_of $fuzzer) && [ "$used" -lt "$seconds" ]; do
          sleep 1
        done
        kill -USR1 $fuzzer 2>/dev/null || true
      fi
      wait $fuzzer || status=$?
    }; } >"$log" 2>&1
  local runs cov
  runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
  cov=$(grep -oE 'cov: [0-9]+' "$log" | tail -1)
  echo "fuzz $name: $runs executions, $cov, $(tail -1 "$log")"
  tail -1 "$log" | awk -v runs="${runs:-0}" -v cov="${cov#cov: }" -v status=$status \
    '{ print $1, $4 + $7, runs, cov, status }' >>"build-fuzz/sums/$name"
  if [ $status -ne 0 ]; then
    tail -50 "$log"
  fi
  return $status
}

# Smallest inputs first, those that reach edges that the kept ones do not.
keep() {
  local name=$1 most=$2 small
  small=$(mktemp -d)
  find "build-fuzz/corpus/$name" -type f -size -"$((most + 1))"c -exec cp -t "$small" {} +
  build-fuzz/bin/fuzz_"$name" -close_fd_mask=2 -merge=1 -use_counters=0 -timeout=1200 "tests/fuzz/corpus/$name" "$small" 2>&1 |
    grep -E 'new files|new features' | tail -1
  rm -r "$small"
}

unit=wall
case ${1:?seconds for each target} in
  --sums)
    sums
    exit
    ;;
  --cpu)
    unit=cpu
    shift
    ;;
  --keep)
    unit=keep
    shift
    ;;
esac
amount=${1:?a number}
shift
cmake --preset fuzz -DORB_TESTS=ON >/dev/null
targets=("$@")
if [ ${#targets[@]} -eq 0 ]; then
  targets=("${all[@]}")
fi
cmake --build build-fuzz --target "${targets[@]/#/fuzz_}"
mkdir -p build-fuzz/found build-fuzz/corpus build-fuzz/sums
TMPDIR=$(mktemp -d)
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT
if [ $unit = keep ]; then
  for name in "${targets[@]}"; do
    keep "$name" "$amount"
  done
  exit
fi
export -f one cpu_of
printf '%s\n' "${targets[@]}" | xargs -P "$(nproc)" -I{} bash -c "one {} $amount $unit"
