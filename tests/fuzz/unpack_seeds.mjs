// Writes the seeds of fuzz_unpack: documents that Draco's encoder and the profile "meshopt" have compressed.
//
//   cmake --build build --target asset_fixture
//   node tests/fuzz/unpack_seeds.mjs build-fuzz/seeds/unpack && tests/fuzz/run.sh --pack unpack
// draco_share and meshopt_twice are inputs that were found: shares that are no integers, members of one name.
import { execFileSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { draco } from '../scenario/support/draco.mjs';
import { root } from '../scenario/support/daemon.mjs';
import * as shapes from '../scenario/support/shapes.mjs';

const folder = process.argv[2];
mkdirSync(folder, { recursive: true });

/** choice: the first byte, which says which vertices get a target; 0: all. */
function seed(name, glb, choice = 0) {
  writeFileSync(path.join(folder, name), Buffer.concat([Buffer.from([choice]), glb]));
}

const egg = shapes.egg(1);
const row = (make) => egg.positions.map((_, v) => make(v));
const colors = row((v) => [v % 256, 255 - v, 7 * (v % 30), 255]);
seed('draco', (await draco(egg)).glb);
seed('draco_sequential', (await draco({ ...egg, colors, method: 'SEQUENTIAL' })).glb, 1);
seed('draco_coloured', (await draco({ ...egg, colors })).glb, 4);
const sets = {
  NORMAL: { rows: egg.positions.map((p) => p.map((x) => x / Math.hypot(...p))), componentType: 5126 },
  TEXCOORD_0: { rows: row((v) => [v / 50, 1 - v / 50]), componentType: 5126 },
  TEXCOORD_1: { rows: row((v) => [1000 * v, 9 * v]), componentType: 5123, normalized: true },
  JOINTS_0: { rows: row((v) => [v % 2, 1 - (v % 2), 0, 0]), componentType: 5121 },
  WEIGHTS_0: { rows: row((v) => [v, 255 - v, 0, 0]), componentType: 5121, normalized: true },
};
/**
 * Two joints. A separate buffer view for their matrices would be larger than the mesh, so they use glTF's default, the
 * identity.
 */
const rig = (json) => {
  json.nodes.push({ children: [2] }, { translation: [0, 1, 0] });
  json.scenes[0].nodes.push(1);
  json.nodes[0].skin = 0;
  json.skins = [{ joints: [1, 2] }];
};
seed('draco_rigged', (await draco({ ...egg, sets, edit: rig })).glb);
/** An accessor whose type differs from that of the Draco data, which takes precedence. */
const untrue = (json) => {
  json.accessors[json.meshes[0].primitives[0].attributes.TEXCOORD_0].type = 'VEC4';
};
seed('draco_type', (await draco({ ...egg, sets, edit: untrue })).glb);

const made = mkdtempSync(path.join(tmpdir(), 'orbmorph-seeds-'));
execFileSync(path.join(root, 'build/bin/asset_fixture'), [made]);
for (const name of ['bare', 'colours', 'dressed'])
  seed(`meshopt_${name}`, readFileSync(path.join(made, `${name}.meshopt.glb`)), name === 'bare' ? 0 : 2);
rmSync(made, { recursive: true });
