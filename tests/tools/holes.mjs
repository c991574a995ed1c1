// Writes half an elephant, open where it is cut, as OBJ: node tests/tools/holes.mjs FILE [STRETCH]. For pictures of filled
// holes.
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { root } from '../scenario/support/daemon.mjs';
import { obj, parse } from '../scenario/support/shapes.mjs';

const { positions, triangles } = parse(await readFile(path.join(root, 'tests/samples/elephant.ply'), 'utf8'));
const span = [0, 1, 2].map((k) => {
  const values = positions.map((p) => p[k]);
  return [Math.min(...values), Math.max(...values)];
});
const long = span.map(([low, high]) => high - low).reduce((most, size, k, all) => (size > all[most] ? k : most), 0);
const at = 0.5 * span[long][0] + 0.5 * span[long][1];
const kept = triangles.filter((t) => t.every((v) => positions[v][long] > at));
const stretch = Number(process.argv[3] ?? 1);
await writeFile(
  process.argv[2],
  obj({ positions: positions.map(([x, y, z]) => [x, y * stretch, z]), triangles: kept }),
);
