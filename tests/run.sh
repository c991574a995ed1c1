#!/usr/bin/env bash
# Sets up what the tests need, builds with warnings as errors, runs every test, and ends with ctest's summary.
#
# The units and scenarios run twice: in a build with AddressSanitizer and UndefinedBehaviorSanitizer, and in the
# release build, where the conformance tests follow. What takes longer is in tests/long.sh.
set -euo pipefail
cd "$(dirname "$(realpath -- "${BASH_SOURCE[0]}")")/.."

source deploy/packages.sh
orb_install_packages "${orb_build_packages[@]}" "${orb_test_packages[@]}" "${orb_fuzz_packages[@]}"
orb_install_node
if command -v ccache >/dev/null; then
  export CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache
fi

# The npm packages of tests/package-lock.json; skipped while they are there.
if ! cmp -s tests/package-lock.json tests/node_modules/.installed-lock; then
  (cd tests && npm ci --no-audit --no-fund --loglevel=error)
  cp tests/package-lock.json tests/node_modules/.installed-lock
fi

bash client/web/build.sh

cmake --preset release -DORB_WERROR=ON -DORB_TESTS=ON >/dev/null
cmake --build build
cmake --preset asan -DORB_TESTS=ON >/dev/null
cmake --build build-asan

# Two more than there are cores: most tests wait more than they compute.
side_by_side=$(($(nproc) + 2))
echo "== with sanitizers =="
ctest --test-dir build-asan --output-on-failure -R '^(unit|scenario)\.' -j $side_by_side
echo "== fuzzing, 10 s a target =="
# From one seed, so that a change is judged by much the same inputs as the one before; long runs look for new ones.
ORB_FUZZ_SEED=1 tests/fuzz/run.sh 10
echo "== release =="
ctest --test-dir build --output-on-failure -j $side_by_side
