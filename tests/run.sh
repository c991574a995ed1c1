#!/usr/bin/env bash
# Runs the tests: every step, or the named ones in the given order.
#
#   tests/run.sh [STEP…]
#
#   packages   installs what the tests need: Debian packages, Node, npm packages
#   build      builds the studio and the release build, with warnings as errors
#   asan       unit and scenario tests, in a build with AddressSanitizer and UndefinedBehaviorSanitizer
#   fuzz       each fuzz target for ORB_FUZZ_SECONDS (10)
#   release    every test, in the release build
#   core       only the library and its unit tests, where the daemon does not build; not part of a full run
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
    (cd tests && npm ci --no-audit --no-fund --loglevel=error)
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

# Tests of a build; adds their results to the totals. Two more at a time than there are cores: most wait more than they
# compute.
run_tests() {
  local build=$1 status=0
  shift
  rm -f "$build/tests.xml"
  ctest --test-dir "$build" --output-on-failure -j $(($(getconf _NPROCESSORS_ONLN) + 2)) --output-junit "$PWD/$build/tests.xml" "$@" || status=$?
  count_junit "$build/tests.xml" >>"$totals"
  return $status
}

# One word a test: passed, failed or skipped. A test that could not start counts as failed.
count_junit() {
  awk '/^[ \t]*<testcase / { end = /status="run"/ ? "passed" : /status="disabled"/ ? "skipped" : "failed" }
    /^[ \t]*<skipped message="SKIP_/ { end = "skipped" }
    /^[ \t]*<\/testcase>/ { print end }' "$1"
}

step_asan() {
  cmake --preset asan -DORB_TESTS=ON >/dev/null
  cmake --build build-asan
  run_tests build-asan -R '^(unit|scenario)\.'
}

# From one seed, so that two runs try much the same inputs; long runs look for new ones.
step_fuzz() {
  local status=0
  rm -f build-fuzz/results
  ORB_FUZZ_SEED=1 tests/fuzz/run.sh "${ORB_FUZZ_SECONDS:-10}" || status=$?
  cut -d' ' -f1 build-fuzz/results >>"$totals"
  return $status
}

step_release() {
  build_release
  run_tests build
}

# Without warnings as errors: it is for compilers that the rest of the tree has not met.
step_core() {
  cmake --preset core -DORB_TESTS=ON >/dev/null
  cmake --build build-core
  run_tests build-core
}

steps=(packages build asan fuzz release)
if [ $# -gt 0 ]; then
  steps=("$@")
fi
for step in "${steps[@]}"; do
  if ! declare -F "step_$step" >/dev/null; then
    echo "There is no step '$step': packages, build, asan, fuzz, release, core" >&2
    exit 2
  fi
done

totals=$(mktemp)
trap 'rm -f "$totals"' EXIT
sum() {
  grep -cx "$1" "$totals" || true
}
for step in "${steps[@]}"; do
  echo "== $step =="
  began=$SECONDS failures=$(sum failed)
  set +e # the subshell turns it on again; as part of a condition, bash would ignore it inside the function
  (
    set -e
    "step_$step"
  )
  status=$?
  set -e
  if [ $status -ne 0 ] && [ "$(sum failed)" -eq "$failures" ]; then
    echo failed >>"$totals"
  fi
  echo "== $step: exit status $status after $((SECONDS - began)) s =="
done
echo "$(sum passed) passed, $(sum failed) failed, $(sum skipped) skipped"
[ "$(sum failed)" -eq 0 ]
