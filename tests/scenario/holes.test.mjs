// Open meshes: repair=fill_holes fills the holes for the embedding, and the asset has the holes again. ORB_HOLES_ALL=1,
// as in tests/long.sh: every open mesh with every method.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { run } from './support/cli.mjs';
import { assertProblem, daemon, slow } from './support/daemon.mjs';
import { toTriangle } from './support/distance.mjs';
import { morphOf } from './support/glb.mjs';
import * as real from './support/real.mjs';
import * as shapes from './support/shapes.mjs';

const every = process.env.ORB_HOLES_ALL === '1';
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (a) => a.map((x) => x / Math.hypot(...a));

/** The triangles of a mesh for which `keep` is true, given the mean of their points on the sphere. */
function cut(mesh, keep) {
  const triangles = mesh.triangles.filter((t) =>
    keep(unit([0, 1, 2].map((k) => t.reduce((sum, v) => sum + mesh.points[v][k], 0)))),
  );
  return { positions: mesh.positions, triangles };
}
const away = (from, angle) => (p) => dot(p, unit(from)) < Math.cos((angle * Math.PI) / 180);
const all =
  (...tests) =>
  (p) =>
    tests.every((one) => one(p));

/** Masks with eyes and a mouth, busts, tubes without caps, balls with several holes. */
const open = [];
for (let i = 0; i < 5; i++) {
  const bend = 0.1 * i;
  const ball = shapes.ball(3, ([x, y, z]) => [x + bend * y * y, 1.3 * y, 0.8 * z]);
  const tube = shapes.ball(3, ([x, y, z]) => [(0.6 + 0.1 * i) * x, 2.5 * y + bend * x, 0.6 * z]);
  const eyes = [away([-0.4, 0.3, 1], 12), away([0.4, 0.3 + 0.05 * i, 1], 12), away([0, -0.5, 1], 10 + 2 * i)];
  open.push(
    [`mask ${i}`, cut(ball, all(away([0, 0, -1], 60 - 4 * i), ...eyes)), 4],
    [`bust ${i}`, cut(ball, away([0.1 * i, -1, 0], 35 + 5 * i)), 1],
    [`tube ${i}`, cut(tube, all(away([0, 1, 0], 25 + 3 * i), away([0, -1, 0], 30))), 2],
    [`ball ${i}`, cut(ball, all(...eyes)), 3],
  );
}

/** Discs: a flat one, a bowl and a saddle. Each is one sheet. */
for (const [name, height] of [
  ['flat disc', () => 0],
  ['shallow bowl', (x, y) => 0.3 * (x * x + y * y)],
  ['saddle', (x, y) => 0.4 * (x * x - y * y)],
])
  open.push([
    name,
    cut(
      shapes.ball(3, ([x, y]) => [x, y, height(x, y)]),
      away([0, 0, -1], 89),
    ),
    1,
  ]);

/** Discs of even triangles. */
function disc(rings, shape) {
  const at = (r, i) => (r === 0 ? 0 : 1 + 3 * r * (r - 1) + (i % (6 * r)));
  const positions = [shape(0, 0)];
  const triangles = [];
  for (let r = 1; r <= rings; r++) {
    for (let i = 0; i < 6 * r; i++) {
      const angle = (Math.PI * i) / (3 * r);
      positions.push(shape((r / rings) * Math.cos(angle), (r / rings) * Math.sin(angle)));
    }
    for (let i = 0; i < 6 * r; i++) {
      const [side, k] = [Math.floor(i / r), i % r];
      triangles.push([at(r, i), at(r, i + 1), at(r - 1, side * (r - 1) + k)]);
      if (k + 1 < r) triangles.push([at(r, i + 1), at(r - 1, side * (r - 1) + k + 1), at(r - 1, side * (r - 1) + k)]);
    }
  }
  return { positions, triangles };
}

/** A hole of more than 48 edges gets a surface with vertices of its own, which are omitted again as well. */
const wide = ['bust with a wide hole', cut(shapes.egg(4), away([0.2, -1, 0.1], 70)), 1];
open.push(wide);

/** The edges of exactly one triangle, as pairs of points; vertices at one place are one vertex. */
function rimOf(positions, triangles) {
  const key = (v) => positions[v].map((x) => x + 0).join();
  const edges = new Map();
  for (const t of triangles)
    for (let k = 0; k < 3; k++) {
      const [a, b] = [key(t[k]), key(t[(k + 1) % 3])];
      if (a !== b && !edges.delete(`${b} ${a}`)) edges.set(`${a} ${b}`, [positions[t[k]], positions[t[(k + 1) % 3]]]);
    }
  return [...edges.values()];
}

/** The number of loops that the edges form. */
function loops(edges) {
  const next = new Map(edges.map(([a, b]) => [a.join(), b.join()]));
  assert.equal(next.size, edges.length, 'each point of a rim is on it once');
  let count = 0;
  while (next.size) {
    let [at] = next.keys();
    for (count++; next.has(at); ) {
      const to = next.get(at);
      next.delete(at);
      at = to;
    }
  }
  return count;
}

const triple = (flat) => Array.from({ length: flat.length / 3 }, (_, i) => [...flat.slice(3 * i, 3 * i + 3)]);
const middle = ([a, b]) => a.map((x, k) => (x + b[k]) / 2);
const farFrom = (points, edges) =>
  Math.max(...points.map((p) => Math.min(...edges.map(([a, b]) => toTriangle(p, a, b, b)))));

/** Asserts that the asset is open along the rims of `mesh` and nowhere else. */
function assertRims(asset, mesh, count, what) {
  const morph = morphOf(asset);
  const made = rimOf(triple(morph.shapes[0]), triple(morph.triangles));
  const given = rimOf(mesh.positions, mesh.triangles);
  assert.equal(loops(made), count, what);
  const used = mesh.triangles.flat().map((v) => mesh.positions[v]);
  const pick = (one, k) => used.reduce((so, p) => one(so, p[k]), used[0][k]);
  const size = Math.hypot(...[0, 1, 2].map((k) => pick(Math.max, k) - pick(Math.min, k)));
  const points = (edges) => edges.flatMap((e) => [e[0], middle(e)]);
  const off = Math.max(farFrom(points(made), given), farFrom(points(given), made)) / size;
  assert.ok(off < 1e-6, `${what}: ${off}`);
  return morph;
}

async function upload(d, mesh, name, repair) {
  const reply = await d.upload(shapes.obj(mesh), { name, ...(repair && { repair }) });
  assert.ok(reply.status === 201 || reply.status === 200, JSON.stringify(reply.json));
  return { mesh: reply.json.id };
}

const asked = (list, remesh, holes) => ({
  shapes: list,
  align: { method: 'rotate' },
  remesh,
  asset: { normals: false, fit: 'none', ...(holes && { holes }) },
});

const REMESH = [
  { method: 'overlay' },
  { method: 'adaptive', tolerance: 0.01 },
  { method: 'subdivision', tolerance: 0.01 },
  { method: 'convex-hull' },
  { method: 'template' },
];

for (const remesh of REMESH)
  test(`${remesh.method}: open meshes are open again along their rims`, async (t) => {
    const d = await daemon(t);
    const other = await upload(d, shapes.bean(2), 'bean');
    const some = every || ['overlay', 'adaptive'].includes(remesh.method) ? open : open.slice(4, 10);
    for (const [name, mesh, count] of some) {
      const first = await upload(d, mesh, name, 'fill_holes');
      const made = await d.made('/v1/supermeshes', asked([first, other], remesh));
      assertRims((await d.get(made.asset)).bytes, mesh, count, name);
      assert.equal(made.open_holes, count, name);
      assert.deepEqual(
        made.dropped.map((entry) => [entry.what, entry.where]),
        [['surface', 'shapes[1]']],
        name,
      );
      if (remesh.method === 'adaptive')
        assert.ok(
          made.shapes.every((shape) => shape.hausdorff_relative <= remesh.tolerance),
          name,
        );
    }
  });

const scans = ['bunny_five_holes.obj', 'cowhead_open.obj'];

/** The pieces of a mesh, the largest first: edges between the same places connect triangles. */
function piecesOf({ positions, triangles }) {
  const root = triangles.map((_, i) => i);
  const find = (i) => {
    while (root[i] !== i) i = root[i] = root[root[i]];
    return i;
  };
  const owner = new Map();
  triangles.forEach((t, i) => {
    const places = t.map((v) => positions[v].map((x) => x + 0).join());
    for (let k = 0; k < 3; k++) {
      const edge = [places[k], places[(k + 1) % 3]].sort().join(' ');
      if (owner.has(edge)) root[find(i)] = find(owner.get(edge));
      else owner.set(edge, i);
    }
  });
  const pieces = new Map();
  triangles.forEach((t, i) => {
    const of = find(i);
    if (!pieces.has(of)) pieces.set(of, []);
    pieces.get(of).push(t);
  });
  return [...pieces.values()].sort((a, b) => b.length - a.length).map((list) => ({ positions, triangles: list }));
}

/**
 * The problem of an open mesh that is not a surface even with its holes filled, by index.csv, and the shape at fault.
 */
function refusalOf(row) {
  if (/^NaN/.test(row.reason)) return ['not-finite', 'vertices'];
  if (row.orientable === 'False') return ['not-orientable', 'edges'];
  return Number(row.nonmanifold_e) > 0 ? ['not-manifold', 'edges'] : undefined;
}

for (const row of real.rows('bad').filter((one) => Number(one.boundary_edges) > 0)) {
  if (!every && !scans.includes(row.name)) continue;
  test(`${row.name} is open again along its rims`, { skip: slow && Number(row.f) > 20_000 }, async (t) => {
    const d = await daemon(t);
    const file = await readFile(row.file, 'utf8');
    const refusal = refusalOf(row);
    if (refusal) {
      const refused = await d.upload(file, { name: 'scan', repair: 'fill_holes' });
      assertProblem(refused, 422, refusal[0]);
      assert.ok(refused.json[refusal[1]].length > 0);
      return;
    }
    const cutShort = row.reason.startsWith('truncated');
    if (cutShort) assertProblem(await d.upload(file, { name: 'scan', repair: 'fill_holes' }), 400, 'malformed-mesh');
    const text = cutShort ? file.slice(0, file.lastIndexOf('\n') + 1) : file;
    const whole = shapes.parse(text);
    const pieces = piecesOf(whole);
    assert.equal(pieces.length, Number(row.components));
    const bean = await upload(d, shapes.bean(2), 'bean');
    const methods = [{ method: 'overlay' }, { method: 'adaptive', tolerance: 0.003 }, { method: 'template' }];
    for (const [k, piece] of pieces.entries()) {
      const count = loops(rimOf(piece.positions, piece.triangles));
      if (pieces.length === 1) assert.equal(count, Number(row.boundary_loops));
      const query = { name: 'scan', repair: 'fill_holes', ...(pieces.length > 1 && { part: k }) };
      const first = await d.upload(text, query);
      assert.equal(first.status, 201, JSON.stringify(first.json));
      for (const remesh of Number(row.f) > 20_000 && !every ? methods.slice(0, 1) : methods) {
        const made = await d.made('/v1/supermeshes', asked([{ mesh: first.json.id }, bean], remesh));
        const shown = remesh.method === 'template' ? whole : piece; // a template keeps the other pieces as well
        const rims = shown === piece ? count : loops(rimOf(shown.positions, shown.triangles));
        assertRims((await d.get(made.asset)).bytes, shown, rims, remesh.method);
      }
    }
  });
}

test('holes of a later shape stay filled, and the report names them', async (t) => {
  const d = await daemon(t);
  const [, mask, count] = open[0];
  const closed = await upload(d, shapes.bean(2), 'bean');
  const opened = await upload(d, mask, 'mask', 'fill_holes');
  const later = await d.made('/v1/supermeshes', asked([closed, opened], { method: 'overlay' }));
  assert.deepEqual(
    later.dropped.map((entry) => [entry.what, entry.where]),
    [['holes', 'shapes[1]']],
  );
  const whole = morphOf((await d.get(later.asset)).bytes);
  assert.deepEqual(rimOf(triple(whole.shapes[0]), triple(whole.triangles)), []);

  const shown = await run(['get', later.id], { env: { ORBMORPH_SERVER: d.url } });
  assert.match(shown.out, /closed, genus 0/);
  const half = await d.made('/v1/supermeshes', asked([opened, closed], { method: 'overlay' }));
  assert.match((await run(['get', half.id], { env: { ORBMORPH_SERVER: d.url } })).out, /open at 4 holes, genus 0/);

  const filled = await d.made('/v1/supermeshes', asked([opened, closed], { method: 'overlay' }, 'filled'));
  const covered = morphOf((await d.get(filled.asset)).bytes);
  assert.deepEqual(rimOf(triple(covered.shapes[0]), triple(covered.triangles)), []);
  assert.deepEqual(filled.dropped, []);
  assert.equal(filled.open_holes, undefined);
  const kept = await d.made('/v1/supermeshes', asked([opened, closed], { method: 'template' }, 'filled'));
  assert.equal(kept.open_holes, 4);
  assert.equal(kept.asset_triangles, mask.triangles.length, 'those of the file');
  assert.ok(kept.asset_triangles < kept.triangles);
  assert.equal(whole.triangles.length / 3, later.triangles);
  assert.equal(later.asset_triangles, undefined);
  assert.match(kept.dropped.find(({ what }) => what === 'fills').why, /exactly the triangles of its file/);

  const both = await d.made('/v1/supermeshes', asked([opened, await upload(d, open[4][1], 'other', 'fill_holes')], {}));
  assertRims((await d.get(both.asset)).bytes, mask, count, 'both open');
  assert.deepEqual(both.dropped, []);
  const few = await d.made('/v1/supermeshes', asked([opened, closed], { max_triangles: 40 }));
  assert.deepEqual([few.dropped[0].what, few.dropped[0].where], ['holes', 'shapes[0]']);
  assert.ok(few.triangles <= 40);
});

/** The largest distance of points of a surface from triangles, which are near to each other. */
const fromSurface = (points, { positions, triangles }) =>
  Math.max(...points.map((p) => Math.min(...triangles.map((t) => toTriangle(p, ...t.map((v) => positions[v]))))));

/** A face without its back, which the map squeezes at the rim: edges that cross it need many splits there. */
const face = (levels, bend, from, angle) =>
  cut(
    shapes.ball(levels, ([x, y, z]) => [
      x + bend * y * y,
      1.3 * y,
      0.8 * z + (z > 0 ? 0.25 * Math.exp(-20 * (x * x + (y + 0.1) ** 2)) : 0),
    ]),
    away(from, angle),
  );

/** Landmarks at the vertices that are farthest left, right, back and in front. */
function poles(...meshes) {
  const farthest = (mesh, k, sign) =>
    [...new Set(mesh.triangles.flat())].reduce((best, v) =>
      sign * mesh.positions[v][k] > sign * mesh.positions[best][k] ? v : best,
    );
  return [
    [0, 1],
    [0, -1],
    [2, 1],
    [2, -1],
  ].map(([k, sign], i) => ({ name: `${i}`, at: meshes.map((mesh) => ({ vertex: farthest(mesh, k, sign) })) }));
}

test('where two shapes are open, the asset goes from rim to rim', async (t) => {
  const d = await daemon(t);
  const discs = [
    ['even disc', disc(10, (x, y) => [x, y, 0]), 1],
    ['leaf', disc(12, (x, y) => [1.6 * x * (1 - 0.2 * y), y + 0.3 * x * x, 0.2 * Math.sin(2 * x)]), 1],
  ];
  const faces = [
    ['face', face(4, 0.3, [0.15, 0, -1], 67), 1],
    ['fine face', face(5, 0, [0, 0, -1], 85), 1],
  ];
  const named = new Map([...open, ...discs, ...faces].map((one) => [one[0], one]));
  const fast = { method: 'auto', options: { preset: 'fast' } };
  for (const [a, b, matched, align] of [
    ['mask 0', 'mask 3', 4],
    ['bust 0', 'bust 4', 1],
    ['tube 1', 'tube 2', 2],
    ['even disc', 'leaf', 1],
    ['leaf', 'even disc', 1],
    ['face', 'fine face', 1],
    ['mask 0', 'mask 3', 4, fast],
    ['bust 0', 'bust 4', 1, { method: 'rotate' }],
    ['tube 1', 'tube 2', 2, { method: 'rbf' }],
  ]) {
    const [, first, count] = named.get(a);
    const [, second] = named.get(b);
    const ids = [await upload(d, first, a, 'fill_holes'), await upload(d, second, b, 'fill_holes')];
    const made = await d.made('/v1/supermeshes', {
      shapes: ids,
      ...(align && { align }),
      ...(align?.method === 'rbf' && { landmarks: poles(first, second) }),
      remesh: { method: 'adaptive', tolerance: a === 'face' ? 0.001 : 0.003 },
      asset: { normals: false, fit: 'none' },
    });
    const morph = assertRims((await d.get(made.asset)).bytes, first, count, `${a} – ${b}`);
    assert.deepEqual(made.dropped, []);
    assert.equal(made.rims.length, matched, `${a} – ${b} ${align?.method ?? ''}`);
    for (const rim of made.rims) {
      assert.equal(rim.shape, 1);
      assert.ok(rim.off_relative < 0.005 && rim.base.edges > 2 && rim.other.edges > 2);
    }
    assert.equal(new Set(made.rims.map((rim) => rim.other.hole)).size, matched);
    // On the second shape: its rim is that of the asset, nothing of its surface is lost, nothing that fills it shows.
    const target = triple(morph.shapes[1]);
    const asset = { positions: target, triangles: triple(morph.triangles) };
    const [rim, given] = [rimOf(target, asset.triangles), rimOf(second.positions, second.triangles)];
    const used = [...new Set(second.triangles.flat())].map((v) => second.positions[v]);
    const size = Math.hypot(
      ...[0, 1, 2].map((k) => Math.max(...used.map((p) => p[k])) - Math.min(...used.map((p) => p[k]))),
    );
    assert.ok(farFrom(rim.flat(), given) / size < 0.005, `${a} – ${b}: ${farFrom(rim.flat(), given) / size}`);
    assert.ok(farFrom(given.flat(), rim) / size < 0.005, `${b} – ${a}: ${farFrom(given.flat(), rim) / size}`);
    assert.ok(fromSurface(used, asset) / size < 0.005, `${b}: ${fromSurface(used, asset) / size}`);
    assert.ok(fromSurface(target, second) / size < 0.005, `${a}: ${fromSurface(target, second) / size}`);
  }
});

/** The part of a mesh that `keep` leaves, given a vertex's height as a share of the whole: its largest piece. */
function above(mesh, axis, share) {
  const along = mesh.positions.map((p) => p[axis]);
  const used = mesh.triangles.flat().map((v) => along[v]);
  const [low, high] = used.reduce(([l, h], x) => [Math.min(l, x), Math.max(h, x)], [Infinity, -Infinity]);
  const triangles = mesh.triangles.filter((t) => t.every((v) => along[v] > low + share * (high - low)));
  return piecesOf({ positions: mesh.positions, triangles })[0];
}

test('rims of real faces and busts meet', { skip: !real.there }, async (t) => {
  const d = await daemon(t);
  const person = async (name) =>
    shapes.parse(await readFile(path.join(real.folder, 'posed', `${name}-neutral.obj`), 'utf8'));
  const bust = async (name) => above(await person(name), 1, 0.8);
  const mask = async (name) => above(above(await person(name), 1, 0.86), 2, 0.55);
  // The map of least energy takes the rim of one face to the middle of the other; the search finds no map from dan to ada.
  for (const [what, first, second] of [
    ['faces', await mask('ada'), await mask('ben')],
    ['busts', await bust('dan'), await bust('ada')],
  ]) {
    const ids = [await upload(d, first, what, 'fill_holes'), await upload(d, second, what, 'fill_holes')];
    const made = await d.made('/v1/supermeshes', { shapes: ids, asset: { normals: false } });
    assert.equal(made.rims?.length, 1, what);
    assert.ok(made.rims[0].off_relative < 0.005, `${what}: ${made.rims[0].off_relative}`);
  }
});

test('a sheet faces as its file does', async (t) => {
  const d = await daemon(t);
  const bowl = disc(8, (x, y) => [x, y, 0.4 * (x * x + y * y)]);
  const turned = { ...bowl, triangles: bowl.triangles.map(([a, b, c]) => [a, c, b]) };
  for (const [name, mesh, turns] of [
    ['from inside', bowl, false],
    ['from outside', turned, false],
    ['bust inside out', shapes.reversed(open[1][1]), true],
  ]) {
    const reply = await d.upload(shapes.obj(mesh), { name, repair: 'fill_holes' });
    assert.equal(reply.status, 201, JSON.stringify(reply.json));
    const kinds = reply.json.repairs.map((one) => one.kind);
    assert.equal(kinds.includes('turn-inside-out'), turns, `${name}: ${kinds}`);
  }
});

test('a hole that only one of two open shapes has is named', async (t) => {
  const d = await daemon(t);
  const [, mask, count] = open[0];
  const [, bare] = [
    '',
    cut(
      shapes.ball(3, ([x, y, z]) => [x + 0.1 * y * y, 1.3 * y, 0.8 * z]),
      away([0, 0, -1], 55),
    ),
  ];
  const ids = [await upload(d, mask, 'mask', 'fill_holes'), await upload(d, bare, 'bare', 'fill_holes')];
  const made = await d.made('/v1/supermeshes', { shapes: ids, asset: { normals: false, fit: 'none' } });
  assertRims((await d.get(made.asset)).bytes, mask, count, 'mask');
  assert.equal(made.rims.length, 1);
  const left = [1, 2, 3, 4].filter((k) => k !== made.rims[0].base.hole);
  assert.deepEqual(
    made.dropped.map((entry) => [entry.what, entry.where]),
    left.map((k) => ['surface', `shapes[1], hole ${k} of shapes[0]`]),
  );
  const back = await d.made('/v1/supermeshes', { shapes: ids.toReversed(), asset: { normals: false, fit: 'none' } });
  assert.deepEqual(
    back.dropped.map((entry) => [entry.what, entry.where]),
    [1, 2, 3, 4].filter((k) => k !== back.rims[0].other.hole).map((k) => ['holes', `shapes[1], hole ${k}`]),
  );
});

test('what fills a wide hole continues the surface around it', async (t) => {
  const d = await daemon(t);
  const [name, mesh] = wide;
  assert.ok(rimOf(mesh.positions, mesh.triangles).length > 48);
  const ids = [await upload(d, mesh, name, 'fill_holes'), await upload(d, shapes.bean(2), 'bean')];
  const made = await d.made('/v1/supermeshes', asked(ids, { method: 'overlay' }, 'filled'));
  const { shapes: filled } = morphOf((await d.get(made.asset)).bytes);
  const depth = -Math.min(...triple(filled[0]).map((p) => p[1]));
  assert.ok(depth > 0.75 && depth < 1.1, `the egg ends at -1, the flat disc at -0.35, the surface at ${-depth}`);
  const open = await upload(d, cut(shapes.ball(4), away([0.2, -1, 0.1], 70)), 'ball', 'fill_holes');
  const { distortion } = await d.made('/v1/embeddings', open);
  assert.ok(distortion.symmetric_dirichlet.max < 1.1, 'a ball is its own sphere: 1; with a flat disc it is above 2');
});

test('a recipe asks for filled holes', async (t) => {
  const d = await daemon(t);
  const [, bust, count] = open[1];
  const ids = [await upload(d, bust, 'bust', 'fill_holes'), await upload(d, shapes.bean(2), 'bean')].map((s) => s.mesh);
  const recipe = `/v1/morph.glb?shapes=${ids}&align=rotate&remesh=overlay&fit=none&normals=false`;
  const opened = await d.get(recipe);
  assert.equal(opened.status, 200);
  assertRims(opened.bytes, bust, count, 'bust');
  const filled = morphOf((await d.get(`${recipe}&holes=filled`)).bytes);
  assert.deepEqual(rimOf(triple(filled.shapes[0]), triple(filled.triangles)), []);
});
