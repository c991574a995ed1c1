#!/usr/bin/env bash
# Runs the tests: every step, or the named ones in the given order.
#
#   tests/run.sh [STEP…]
#
#   packages   installs what the tests need: Debian packages, Node, npm packages
#   build      builds the studio and the release build, with warnings as errors
#   asan       unit and scenario tests, in a build with AddressSanitizer and UndefinedBehaviorSanitizer
#   release    every test, in the release build; in a full run without the scenarios that asan has run
#   fuzz       each fuzz target for ORB_FUZZ_SECONDS (3) of CPU time
#   core       only the library and its unit tests, where the daemon does not build; not part of a full run
#
# In a full run two chains run beside asan and release, each one test at a time: the tests in a browser, and those that
# mostly wait. The fuzz targets run in the time that is left.
#
# A step that fails does not keep later steps from running. The last line is "N passed, N failed, N skipped", summed
# over tests and fuzz targets; a step that fails outside a test counts as one failure. The exit status is 0 only if
# nothing failed. Tests that take longer are in tests/long.sh.
set -euo pipefail
cd "$(dirname "$(realpath -- "${BASH_SOURCE[0]}")")/.."
source deploy/packages.sh
if command -v ccache >/dev/null; then
  export CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache
fi

step_packages() {
  orb_install_packages "${orb_build_packages[@]}" "${orb_test_packages[@]}" "${orb_fuzz_packages[@]}"
  orb_install_node
  if ! cmp -s tests/package-lock.json tests/node_modules/.installed-lock; then
    (cd tests && npm ci --prefer-offline --no-audit --no-fund --loglevel=error)
    cp tests/package-lock.json tests/node_modules/.installed-lock
  fi
}

build_release() {
  cmake --preset release -DORB_WERROR="${ORB_WERROR:-ON}" -DORB_TESTS=ON >/dev/null
  cmake --build build
}

step_build() {
  bash client/web/build.sh
  build_release
}

# Tests of a build; adds their results to the totals. Three at a time for each core: most wait more than they compute, and
# with fewer a tenth of the cores' time is lost.
run_tests() {
  local build=$1 status=0 jobs=$((3 * $(getconf _NPROCESSORS_ONLN)))
  shift
  rm -f "$build/tests.xml"
  "${behind[@]}" ctest --test-dir "$build" --output-on-failure --output-junit "$PWD/$build/tests.xml" -j $jobs "$@" || status=$?
  count_junit "$build/tests.xml" >>"$totals"
  return $status
}

# One word a test: passed, failed or skipped. A test that could not start counts as failed.
count_junit() {
  awk '/^[ \t]*<testcase / { end = /status="run"/ ? "passed" : /status="disabled"/ ? "skipped" : "failed" }
    /^[ \t]*<skipped message="SKIP_/ { end = "skipped" }
    /^[ \t]*<\/testcase>/ { print end }' "$1"
}

# Its daemon takes the numeric objects of the release build. So scenarios that mostly compute, and those that look at
# documents, programs, memory or time, run in the release build only, as do those that run with PostgreSQL and S3: their unit
# tests run here.
release_only='bench|holes|openapi_tools|shell|readme|real_pairs|examples|demo|attacks|s3|migrate|nodes|cluster'
# Most of their time passes in waiting for other servers and for clocks. In a full run they are a chain of their own, so
# that none of them is left alone at the end.
mostly_waiting='nodes|cluster|migrate|s3'
# These test more without sanitizers, and run in both builds. All others have run with sanitizers when a full run comes to
# the release build, and run there only if the build with sanitizers failed.
in_both='clock|isolate|webhooks|deploy|slow|real_meshes'
step_asan() {
  rm -f build-asan/tests.xml
  build_release
  cmake --preset asan -DORB_TESTS=ON -DORB_PLAIN="$PWD/build" >/dev/null
  "${behind[@]}" cmake --build build-asan
  ASAN_OPTIONS=${ASAN_OPTIONS:+$ASAN_OPTIONS:}handle_sigill=1 run_tests build-asan -R '^(unit|scenario)\.' -E "^scenario\.($release_only)\$"
}

# From one seed, so that two runs try much the same inputs; long runs look for new ones.
run_fuzz() {
  rm -f build-fuzz/results
  ORB_FUZZ_SEED=1 ORB_PLAIN="$PWD/build" "$@" tests/fuzz/run.sh --cpu "${ORB_FUZZ_SECONDS:-3}"
}

step_fuzz() {
  local status=0
  build_release
  run_fuzz || status=$?
  count_fuzz >>"$totals"
  return $status
}

# Also units in which every call fails once: sanitizers see what is left behind then.
asan_only() {
  {
    ctest --test-dir build -N | sed -n 's/.*: \(scenario\..*\)/\1/p' | grep -vxE "scenario\.($release_only|$in_both)"
    ctest --test-dir build -N | sed -n 's/.*: \(unit\.torture_.*\)/\1/p'
  } | paste -sd'|'
}

step_release() {
  build_release
  local without=()
  if [ -n "$browser" ]; then
    local names="scenario\.($mostly_waiting)"
    if [ -f build-asan/tests.xml ]; then
      names="$names|$(asan_only)"
    fi
    without+=(-LE browser -E "^($names)\$")
  fi
  run_tests build "${without[@]}"
}

# Starts tests of the release build beside the steps that follow, one at a time. Each chain has a folder of its own, as two
# runs of ctest in one folder overwrite each other's logs.
start_chain() {
  local chain=$1
  shift
  mkdir -p "build/$chain"
  rm -f "build/$chain/tests.xml"
  echo "subdirs(\"$PWD/build\")" >"build/$chain/CTestTestfile.cmake"
  ctest --test-dir "build/$chain" --output-on-failure --output-junit "$PWD/build/$chain/tests.xml" "$@" \
    >"build/$chain.log" 2>&1 &
  printf -v "$chain" '%s' $!
  printf -v "${chain}_began" '%s' $SECONDS
}

# At equal priority each chain gets an eighth of the processor beside six other tests, and at the end one core waits for it;
# so what runs beside them yields to them.
browser= browser_began= waiting= waiting_began= behind=()
start_chains() {
  start_chain browser -L browser
  start_chain waiting -R "^scenario\.($mostly_waiting)\$"
  behind=(nice -n 5)
}

# Starts the fuzz targets beside the steps that follow. Tests wait for a quarter of the cores' time; at this priority, the
# targets take little else. They count CPU time, so they try as much as alone.
fuzz= fuzz_began=
start_fuzz() {
  (run_fuzz env nice -n 15) >build/fuzz.log 2>&1 &
  fuzz=$! fuzz_began=$SECONDS
}

count_fuzz() {
  cut -d' ' -f1 build-fuzz/results
}

count_chain() {
  count_junit "build/$1/tests.xml"
}

# Waits for a chain or the fuzz targets, prints what they printed, and adds to the totals what `count` says of their results.
finish() {
  local what=$1 count=$2 status=0 failures pid began
  pid=$what began=${what}_began
  failures=$(sum failed)
  echo "== $what =="
  wait "${!pid}" || status=$?
  printf -v "$what" ''
  cat "build/$what.log"
  "$count" "$what" >>"$totals" || status=1
  ended "$what" $status "${!began}" "$failures"
}

# Without warnings as errors: it is for compilers that the rest of the tree has not met.
step_core() {
  cmake --preset core -DORB_TESTS=ON >/dev/null
  cmake --build build-core
  run_tests build-core
}

names="packages build asan release fuzz core"
for step in "$@"; do
  if [[ " $names " != *" $step "* ]]; then
    echo "There is no step '$step': $names" >&2
    exit 2
  fi
done

totals=$(mktemp)
trap 'rm -f "$totals"; [ -z "$browser$waiting$fuzz" ] || kill $browser $waiting $fuzz' EXIT
sum() {
  grep -cx "$1" "$totals" || true
}

# Ends a step: one that failed outside a test counts as one failure.
ended() {
  local step=$1 status=$2 began=$3 failures=$4
  if [ "$status" -ne 0 ] && [ "$(sum failed)" -eq "$failures" ]; then
    echo failed >>"$totals"
  fi
  echo "== $step: exit status $status after $((SECONDS - began)) s =="
}

# Runs a step and leaves its exit status in `status`. Never call it in a condition: bash then ignores set -e in the step.
run_step() {
  local step=$1 began=$SECONDS failures
  failures=$(sum failed)
  echo "== $step =="
  set +e
  (
    set -e
    "step_$step"
  )
  status=$?
  set -e
  ended "$step" $status "$began" "$failures"
}

if [ $# -gt 0 ]; then
  for step in "$@"; do
    run_step "$step"
  done
else
  run_step packages
  run_step build
  if [ $status -eq 0 ]; then
    start_chains
    start_fuzz
  fi
  run_step asan
  run_step release
  if [ -n "$browser" ]; then
    finish browser count_chain
    finish waiting count_chain
    finish fuzz count_fuzz
  else
    run_step fuzz
  fi
fi
echo "$(sum passed) passed, $(sum failed) failed, $(sum skipped) skipped"
[ "$(sum failed)" -eq 0 ]
