#!/usr/bin/env bash
# Makes the pictures of the documents anew, from the samples, with the programs of build/bin:
#   docs/morph.webp                    the film of the README, made in the studio
#   docs/studio.png, handles           the studio, in Chromium
#   docs/tutorial.png, tutorial-sheet  the tutorial's page in Chromium and its sheet (they need tests/node_modules)
#   docs/holes-open.png, holes-filled  half an elephant, open and filled
# docs/rigged.png is the sheet of tests/long.sh rigged.
set -euo pipefail
cd "$(dirname "$(realpath -- "${BASH_SOURCE[0]}")")/../.."
bin=$PWD/build/bin
work=$(mktemp -d)
daemon=
trap '[ -z "$daemon" ] || kill "$daemon"; rm -rf "$work"' EXIT

"$bin/orbmorphd" --listen 127.0.0.1:0 --data "$work/data" >"$work/out" 2>"$work/log" &
daemon=$!
until grep -q listening "$work/out"; do
  kill -0 "$daemon" || { cat "$work/log" >&2; exit 1; }
  sleep 0.1
done
ORBMORPH_SERVER=$(sed -n 's/^orbmorphd listening on //p' "$work/out")
export ORBMORPH_SERVER

samples=tests/samples
node tests/tools/film.mjs
ORB_PICTURE=docs/studio.png node tests/studio/looks.mjs landmarks
ORB_PICTURE=docs/handles.png node tests/studio/looks.mjs handles
ORB_PICTURES=1 node --test tests/conformance/tutorial.test.mjs

node tests/tools/holes.mjs "$work/half.obj"
node tests/tools/holes.mjs "$work/tall.obj" 1.25
for kind in open:template:reopen filled:adaptive:filled; do
  IFS=: read -r name method holes <<<"$kind"
  "$bin/orbmorph" morph "$work/half.obj" "$work/tall.obj" --repair fill_holes --align rotate --remesh "$method" \
    --set "asset.holes=$holes" -o "$work/$name.glb"
  "$bin/orbmorph" view "$work/$name.glb" -o "docs/holes-$name.png" --poses 2 --size 360 --wire --inside --yaw 250
done
