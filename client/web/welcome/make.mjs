// Makes the morphs that the studio's first page plays, with the programs of build/bin:
//   node client/web/welcome/make.mjs
// The animals are the samples of the repository; the other shapes are radius functions on the sphere.
import { execFileSync, spawn } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = fileURLToPath(new URL('.', import.meta.url));
const root = join(here, '../../..');
const bin = join(root, 'build/bin');
const work = mkdtempSync(join(tmpdir(), 'orbmorph-welcome-'));

const { abs, cos, sin, exp, max, min, PI, hypot, atan2 } = Math;
const bump = (x, at, width) => exp(-(((x - at) / width) ** 2));
/** Superellipsoid: a cube with round edges for n = 8. */
const cube = (x, y, z, n = 8) => (abs(x) ** n + abs(y) ** n + abs(z) ** n) ** (-1 / n);

/** name: the radius in the direction (x, y, z), y up; or the point itself */
const SHAPES = {
  cube: (x, y, z) => 0.8 * cube(x, y, z),
  star: (x, y, z) => {
    const [h, v] = [atan2(x, y), Math.asin(max(-1, min(1, z)))];
    return 0.5 + 0.62 * (0.5 + 0.5 * cos(5 * h)) ** 1.5 * cos(v) ** 5 - 0.1 * abs(sin(v));
  },
  flower: (x, y, z) => {
    const h = atan2(x, y);
    return (0.5 + 0.45 * abs(cos(3 * h)) * (1 - z * z) ** 2) * (1 - 0.25 * bump(z, 1, 0.5) - 0.3 * bump(z, -1, 0.7));
  },
  apple: (_x, y) => 0.95 - 0.42 * bump(y, 1, 0.22) - 0.25 * bump(y, -1, 0.2) + 0.05 * y,
  pumpkin: (x, y, z) =>
    (0.98 - 0.08 * abs(cos(4 * atan2(z, x))) * (1 - y * y)) * (1 - 0.25 * y * y) -
    0.3 * bump(y, 1, 0.25) -
    0.2 * bump(y, -1, 0.25),
};
/** Surfaces of revolution: the profile [radius, height] at s from 0 (bottom) to 1 (top). */
const TURNED = {
  pear: (s) => [1.5 * Math.sqrt(s * (1 - s)) * (1 - 0.62 / (1 + exp((0.56 - s) * 9))), 2.2 * s - 1],
  vase: (s) => [0.16 + 0.5 * bump(s, 0.32, 0.2) + 0.22 * bump(s, 0.98, 0.1), 2 * s - 1],
  pawn: (s) => [0.1 + 0.52 * bump(s, 0.05, 0.16) + 0.16 * bump(s, 0.68, 0.05) + 0.36 * bump(s, 0.88, 0.11), 2 * s - 1],
  bottle: (s) => [0.17 + 0.33 / (1 + exp((s - 0.6) * 24)) + 0.05 * bump(s, 0.97, 0.03), 2 * s - 1],
};

/** A sphere of 6 · n² quadrilaterals, each cut in two, its points on an equal grid of angles on the cube's sides. */
function ball(n) {
  const points = [];
  const ids = new Map();
  const id = (p) => {
    const key = p.map((x) => x.toFixed(9)).join();
    if (!ids.has(key)) ids.set(key, points.push(p) - 1);
    return ids.get(key);
  };
  const triangles = [];
  const tan = (i) => Math.tan(((2 * i) / n - 1) * (PI / 4));
  for (const [a, b, c] of [
    [0, 1, 2],
    [1, 2, 0],
    [2, 0, 1],
  ])
    for (const side of [1, -1])
      for (let i = 0; i < n; i++)
        for (let j = 0; j < n; j++) {
          const at = (u, v) => {
            const p = [0, 0, 0];
            p[a] = tan(u);
            p[b] = side * tan(v);
            p[c] = side;
            const length = hypot(...p);
            return id(p.map((x) => Math.round((x / length) * 1e12) / 1e12 + 0));
          };
          const q = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
          triangles.push([q[0], q[1], q[2]], [q[0], q[2], q[3]]);
        }
  return { points, triangles };
}

function place(name, p) {
  if (SHAPES[name]) {
    const r = SHAPES[name](...p);
    return p.map((x) => x * r);
  }
  const s = min(1, max(0, Math.acos(max(-1, min(1, -p[1]))) / PI));
  if (name === 'pear') {
    const [r, h] = TURNED.pear(s);
    const flat = hypot(p[0], p[2]) || 1;
    return [(p[0] / flat) * r, h, (p[2] / flat) * r];
  }
  const [r, h] = TURNED[name](min(1, max(0, (s - 0.06) / 0.88)));
  const flat = hypot(p[0], p[2]) || 1;
  const lid = s < 0.06 ? s / 0.06 : s > 0.94 ? (1 - s) / 0.06 : 1;
  return [(p[0] / flat) * r * lid, 0.95 * h, (p[2] / flat) * r * lid];
}

const sphere = ball(24);
const nearest = (d) =>
  sphere.points.reduce(
    (best, p, i) =>
      p[0] * d[0] + p[1] * d[1] + p[2] * d[2] >
      sphere.points[best][0] * d[0] + sphere.points[best][1] * d[1] + sphere.points[best][2] * d[2]
        ? i
        : best,
    0,
  );
const marks = [
  [0, 1, 0],
  [0, -1, 0],
  [1, 0, 0],
  [-1, 0, 0],
  [0, 0, 1],
  [0, 0, -1],
  [1, 1, 1],
  [-1, 1, 1],
  [1, 1, -1],
  [-1, 1, -1],
].map(nearest);

const daemon = spawn(join(bin, 'orbmorphd'), ['--listen', '127.0.0.1:0', '--data', join(work, 'data')], {
  stdio: ['ignore', 'pipe', 'inherit'],
});
const server = await new Promise((resolve) => daemon.stdout.on('data', (text) => resolve(/http:\S+/.exec(text)[0])));
const morph = (out, files, landmarks, triangles) =>
  console.log(
    execFileSync(
      join(bin, 'orbmorph'),
      ['morph', ...files, '-l', landmarks, '-n', String(triangles), '-q', '-o', join(here, out)],
      { env: { ...process.env, ORBMORPH_SERVER: server } },
    ).toString(),
  );
try {
  const samples = join(root, 'tests/samples');
  // Without the elbows: with three shapes, they twist a foreleg by half a turn.
  const { landmarks } = JSON.parse(readFileSync(join(samples, 'dog-giraffe-elephant.json')));
  const animals = join(work, 'animals.json');
  writeFileSync(animals, JSON.stringify(landmarks.filter(({ name }) => !/elbow/.test(name))));
  morph(
    'animals.glb',
    ['dog.obj', 'giraffe.off', 'elephant.ply'].map((f) => join(samples, f)),
    animals,
    6000,
  );
  for (const names of [
    ['cube', 'star', 'flower'],
    ['apple', 'pear', 'pumpkin'],
    ['vase', 'pawn', 'bottle'],
  ]) {
    const files = names.map((name) => {
      const file = join(work, `${name}.obj`);
      writeFileSync(
        file,
        `${sphere.points.map((p) => `v ${place(name, p).join(' ')}\n`).join('')}${sphere.triangles.map((t) => `f ${t.map((v) => v + 1).join(' ')}\n`).join('')}`,
      );
      return file;
    });
    const landmarks = join(work, 'landmarks.json');
    writeFileSync(landmarks, JSON.stringify(marks.map((v) => names.map(() => v))));
    morph(`${names[0]}.glb`, files, landmarks, 4000);
  }
} finally {
  daemon.kill();
  await new Promise((resolve) => daemon.on('exit', resolve));
  rmSync(work, { recursive: true, force: true });
}
