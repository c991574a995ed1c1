#!/usr/bin/env bash
# Builds the studio into client/web/dist. Does nothing if dist is newer than all sources.
set -euo pipefail
cd "$(dirname "$0")"

stamp=dist/.built
if [ -f "$stamp" ] && [ -z "$(find src public welcome index.html package-lock.json vite.config.ts tsconfig.json ../js/src \
    ../../tests/samples -newer "$stamp" -print -quit 2>/dev/null)" ]; then
  exit 0
fi
command -v npm >/dev/null || { echo "The studio needs Node 18 and npm: apt-get install nodejs npm" >&2; exit 1; }
if [ ! -f node_modules/.installed ] || [ package-lock.json -nt node_modules/.installed ]; then
  npm ci --no-audit --no-fund --loglevel=error
  touch node_modules/.installed
fi
npx --no-install vite build --logLevel warn
touch "$stamp"
