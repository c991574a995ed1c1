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
  echo 'stage: the packages of the studio'
  # packages that npm has kept are not asked for again: without a network, each question would wait for minutes
  npm ci --prefer-offline --no-audit --no-fund --loglevel=error
  touch node_modules/.installed
fi
echo 'stage: the studio'
npx --no-install vite build --logLevel warn
touch "$stamp"
