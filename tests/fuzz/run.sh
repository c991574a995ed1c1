#!/usr/bin/env bash
# Builds the libFuzzer targets and runs each for some seconds, one more at once than there are cores: some wait for files.
#
#   tests/fuzz/run.sh [--cpu] SECONDS [TARGET…]    SECONDS of wall time each, with --cpu of CPU time;
#                                                  with ORB_FUZZ_SEED every run starts with the same inputs,
#                                                  with ORB_PLAIN=BUILD it links what it does not run from there
#   tests/fuzz/run.sh --sums                       totals of all runs in build-fuzz, one line per target
#   tests/fuzz/run.sh --unpack [TARGET…]           unpacks the seeds: tests/fuzz/corpus/TARGET.tar.gz, one file per
#                                                  input, into build-fuzz/seeds/TARGET; each run does so first
#   tests/fuzz/run.sh --pack [TARGET…]             packs them again, after inputs were added to or removed from
#                                                  build-fuzz/seeds/TARGET; the same inputs give the same bytes
#   tests/fuzz/run.sh --keep BYTES [TARGET…]       adds the inputs of up to BYTES that cover more, and packs
#
# Inputs that a run finds stay in build-fuzz/corpus/TARGET, and later runs use them. Inputs that crash, hang or leak are
# kept in build-fuzz/found, and the script fails. Each target prints one line: executions, edges covered, time; the
# same goes to build-fuzz/sums/TARGET. build-fuzz/results has a line "passed TARGET", "failed TARGET" or "stopped TARGET"
# for each: a run is stopped if a signal from outside ended it and it kept no input in build-fuzz/found. Its time and its
# executions until then count, and the script fails, since the run is not complete.
set -euo pipefail
cd "$(dirname "$(realpath -- "${BASH_SOURCE[0]}")")/../.."
all=(obj off ply stl 3mf gltf glb keep unpack carry json query range config sphere decode http token view client)

# Whether a run with this exit status was stopped from outside: by SIGINT or SIGTERM, which libFuzzer turns into 72, or by
# SIGHUP or SIGKILL; 130 and 143 are of a shell that was waiting. kept: its inputs in build-fuzz/found. In awk.
is_stopped='function is_stopped(status, kept) { return kept + 0 == 0 && status ~ /^(72|129|130|137|143)$/ }'

sums() {
  local name
  for name in "${all[@]}"; do
    if [ -f "build-fuzz/sums/$name" ]; then
      awk -v name="$name" "$is_stopped"'
        NF == 4 { $5 = $4; $4 = 0 } # of earlier versions, without edges
        NF >= 5 { wall += $1; cpu += $2; runs += $3; cov = $4 > 0 ? $4 : cov; if (is_stopped($5, $6)) stopped++; else bad += $5 != 0 }
        END { printf "%s: %.0f s wall, %.0f s CPU, %d executions, %s edges, %d runs that failed, %d that were stopped\n",
          name, wall, cpu, runs, cov, bad, stopped }' \
        "build-fuzz/sums/$name"
    fi
  done
}

# Unpacks seeds whose archive has changed, and keeps the others: they may have edits that are not packed yet.
unpack() {
  local name=$1 archive=tests/fuzz/corpus/$1.tar.gz seeds=build-fuzz/seeds/$1 sum
  sum=$(sha256sum <"$archive")
  if [ ! -d "$seeds" ] || [ "$sum" != "$(cat "$seeds.sum" 2>/dev/null)" ]; then
    rm -rf "$seeds"
    mkdir -p "$seeds"
    tar -C "$seeds" -xzf "$archive"
    echo "$sum" >"$seeds.sum"
  fi
}

# Packs seeds; an archive with the same inputs stays unchanged, whichever gzip wrote it.
pack() {
  local name=$1 archive=tests/fuzz/corpus/$1.tar.gz seeds=build-fuzz/seeds/$1 packed
  packed=$(mktemp)
  (cd "$seeds" && find . -type f -printf '%P\0') | LC_ALL=C sort -z |
    tar -C "$seeds" --null -T - --format=ustar --mtime=@0 --owner=0 --group=0 --numeric-owner --mode=644 -cf "$packed"
  if ! gzip -dc "$archive" 2>/dev/null | cmp -s - "$packed"; then
    gzip -9nc "$packed" >"$archive"
    echo "packed $(find "$seeds" -type f | wc -l) inputs into $archive"
  fi
  rm "$packed"
  sha256sum <"$archive" >"$seeds.sum"
}

# CPU time of a process so far, in seconds.
cpu_of() {
  local stat
  stat=$(cat "/proc/$1/stat" 2>/dev/null) || return 1
  set -- ${stat##*) }
  echo $(((${12} + ${13}) / $(getconf CLK_TCK)))
}

# Whether a process waits for something other than a core.
is_asleep() {
  [[ $(cat "/proc/$1/stat" 2>/dev/null) =~ \)\ [SD]\  ]]
}

# Runs a target. When the time is up, SIGUSR1 makes the fuzzer end with its statistics. With --cpu no limit of the fuzzer
# counts wall time, for it may wait for a core. Two kinds of inputs are findings then, and SIGABRT makes the fuzzer keep
# them: one that still runs after HANGS CPU seconds more, once the corpus has been read, and one that sleeps for SLEEPS
# seconds. The targets themselves abort at an input that costs too much CPU time (cost.h).
# Inputs may have LONGEST bytes then, instead of 4,096: so work that grows with the square of a file costs more than is
# allowed.
HANGS=60 SLEEPS=1200 LONGEST=65536
one() {
  local name=$1 seconds=$2 unit=$3 log=build-fuzz/corpus/$1.log began=build-fuzz/corpus/$1.began status=0 used=0 limit=$2
  local fuzzer now runs cov kept times slow=60 longest=0 until='' asleep=0
  mkdir -p "build-fuzz/corpus/$name"
  touch "$began"
  [ "$unit" = wall ] || limit=0 slow=0 longest=$LONGEST
  TIMEFORMAT='%R s wall, %U s user, %S s system'
  { time {
      build-fuzz/bin/fuzz_"$name" -close_fd_mask=2 -max_total_time="$limit" -rss_limit_mb=2048 -seed="${ORB_FUZZ_SEED:-0}" \
        -timeout=$slow -max_len=$longest -report_slow_units=1000000 -print_final_stats=1 \
        -artifact_prefix="build-fuzz/found/$name-" "build-fuzz/corpus/$name" "build-fuzz/seeds/$name" &
      fuzzer=$!
      trap 'kill $fuzzer 2>/dev/null' HUP INT TERM
      if [ "$unit" = cpu ]; then
        while now=$(cpu_of $fuzzer); do
          asleep=$([ "$now" = "$used" ] && is_asleep $fuzzer && echo $((asleep + 1)) || echo 0)
          used=$now
          if [ "$now" -ge "$seconds" ]; then
            kill -USR1 $fuzzer 2>/dev/null || true
            [ -n "$until" ] || ! grep -q INITED "$log" || until=$((now + HANGS))
          fi
          if [ "$now" -gt "${until:-$now}" ] || [ "$asleep" -gt "$SLEEPS" ]; then
            kill -ABRT $fuzzer 2>/dev/null || true
          fi
          sleep 1
        done
      fi
      wait $fuzzer || status=$?
      if kill -0 $fuzzer 2>/dev/null; then # a signal has interrupted the wait
        status=0
        wait $fuzzer || status=$?
      fi
    }; } >"$log" 2>&1
  runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log" | tail -1)
  runs=${runs:-$(sed -nE 's/^#([0-9]+).*/\1/p' "$log" | tail -1)} # of one that was killed: its last report
  cov=$(grep -oE 'cov: [0-9]+' "$log" | tail -1)
  kept=$(find build-fuzz/found -name "$name-*" -newer "$began" | wc -l)
  times=$(grep -E '^[0-9.]+ s wall, ' "$log" | tail -1)
  echo "fuzz $name: $runs executions, $cov, $times"
  awk -v runs="${runs:-0}" -v cov="${cov#cov: }" -v status=$status -v used="$used" -v kept="$kept" \
    '{ cpu = $4 + $7; print $1, cpu < used ? used : cpu, runs, cov ? cov : 0, status, kept }' <<<"$times" >>"build-fuzz/sums/$name"
  if awk "$is_stopped BEGIN { exit !is_stopped($status, $kept) }"; then
    echo "stopped $name" >>build-fuzz/results
    return 1
  fi
  if [ $status -ne 0 ]; then
    echo "failed $name" >>build-fuzz/results
    tail -50 "$log"
    return 1
  fi
  echo "passed $name" >>build-fuzz/results
}

# Adds the smallest inputs that reach edges that the seeds do not.
keep() {
  local name=$1 most=$2 small
  small=$(mktemp -d)
  find "build-fuzz/corpus/$name" -type f -size -"$((most + 1))"c -exec cp -t "$small" {} +
  build-fuzz/bin/fuzz_"$name" -close_fd_mask=2 -merge=1 -use_counters=0 -timeout=1200 "build-fuzz/seeds/$name" "$small" 2>&1 |
    grep -E 'new files|new features' | tail -1
  rm -r "$small"
  pack "$name"
}

unit=wall
case ${1:?seconds for each target} in
  --sums)
    sums
    exit
    ;;
  --pack | --unpack)
    work=${1#--}
    shift
    for name in "${@:-${all[@]}}"; do
      "$work" "$name"
    done
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
targets=("${@:-${all[@]}}")
cmake --preset fuzz -DORB_TESTS=ON -DORB_PLAIN="${ORB_PLAIN:-}" >/dev/null
cmake --build build-fuzz --target "${targets[@]/#/fuzz_}"
mkdir -p build-fuzz/found build-fuzz/corpus build-fuzz/sums
rm -f build-fuzz/results
for name in "${targets[@]}"; do
  unpack "$name"
done
TMPDIR=$(mktemp -d)
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT
if [ $unit = keep ]; then
  for name in "${targets[@]}"; do
    keep "$name" "$amount"
  done
  exit
fi
export -f one cpu_of is_asleep
export is_stopped HANGS SLEEPS LONGEST
printf '%s\n' "${targets[@]}" | xargs -P $(($(nproc) + 1)) -I{} bash -c "one {} $amount $unit"
