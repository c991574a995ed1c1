#!/usr/bin/env bash
# Sets up what the tests need, builds, runs every test, and ends with ctest's summary.
set -euo pipefail
cd "$(dirname "$0")/.."
cmake --preset release -DORB_WERROR=ON
cmake --build build
ctest --test-dir build --output-on-failure
