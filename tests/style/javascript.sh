#!/bin/sh
# Format and lint rules of biome.jsonc. 77 (skipped) without Node or Biome, which `npm ci` in tests/ installs.
# To correct what can be corrected: tests/node_modules/.bin/biome check --write .
set -eu
cd "$(dirname "$0")/../.."
biome=tests/node_modules/.bin/biome
if ! command -v node >/dev/null || ! "$biome" --version >/dev/null 2>&1; then
  echo "skipped: $biome does not run (npm ci in tests/)"
  exit 77
fi
exec "$biome" ci --colors=off --error-on-warnings --max-diagnostics=100 .
