// The remesh method "template": the first shape's own vertices and triangles carry the morph.
import assert from 'node:assert/strict';
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { folder, run } from './support/cli.mjs';
import { daemon, samples } from './support/daemon.mjs';
import { farthest, toTriangle } from './support/distance.mjs';
import { morphOf, parseGlb } from './support/glb.mjs';
import { writeGlb } from './support/glb_write.mjs';
import * as shapes from './support/shapes.mjs';

const remesh = { method: 'template' };

const diagonalOf = (points) =>
  Math.hypot(...[0, 1, 2].map((k) => Math.max(...points.map((p) => p[k])) - Math.min(...points.map((p) => p[k]))));

/** The points of frame s of a morph. */
const pointsOf = (morph, s) =>
  Array.from({ length: morph.count }, (_, v) => [0, 1, 2].map((k) => morph.shapes[s][3 * v + k]));

/**
 * Asserts that the base is `source` bit for bit, as float32, and that each vertex of target s lies on `targets[s - 1]`.
 */
function assertKept(morph, source, targets) {
  assert.deepEqual(morph.shapes[0].slice(0, 3 * source.positions.length), source.positions.flat().map(Math.fround));
  assert.deepEqual(morph.triangles, source.triangles.flat());
  for (const [s, target] of targets.entries()) {
    const off = farthest(pointsOf(morph, s + 1), target.positions.flat(), target.triangles.flat());
    assert.ok(off <= 1e-6 * diagonalOf(target.positions), `target ${s}: ${off}`);
  }
}

/** The largest distance of the vertices and edge midpoints of `target` from frame s of the morph. */
function distanceBack(morph, s, target) {
  const { positions, triangles } = target;
  const middles = triangles.flatMap((t) =>
    [0, 1, 2].map((k) => [0, 1, 2].map((i) => (positions[t[k]][i] + positions[t[(k + 1) % 3]][i]) / 2)),
  );
  return farthest([...positions, ...middles], morph.shapes[s], morph.triangles);
}

const minus = (a, b) => a.map((x, k) => x - b[k]);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const normalOf = ([a, b, c]) => cross(minus(b, a), minus(c, a));
const facesOf = ({ positions, triangles }) => triangles.map((t) => t.map((v) => positions[v]));

/** The face of a surface that is nearest to a point. */
function nearestFace(point, faces) {
  let [least, nearest] = [Infinity, null];
  for (const face of faces) {
    const distance = toTriangle(point, ...face);
    if (distance < least) [least, nearest] = [distance, face];
  }
  return nearest;
}

const unit = (x) => x.map((c) => c / Math.hypot(...x));
const sumOf = (vectors) => [0, 1, 2].map((k) => vectors.reduce((sum, x) => sum + x[k], 0));

/** The normals of a surface at its corners, by position: sums over the faces there, by area. */
function smoothNormalsOf(faces) {
  const normals = new Map();
  for (const face of faces) {
    for (const corner of face) normals.set(`${corner}`, sumOf([normals.get(`${corner}`) ?? [0, 0, 0], normalOf(face)]));
  }
  return normals;
}

/** The smooth normal of a surface at a point on it. */
function smoothNormalAt(point, faces, normals) {
  const face = nearestFace(point, faces);
  const whole = Math.hypot(...normalOf(face));
  const shares = [0, 1, 2].map((k) => Math.hypot(...normalOf([point, face[(k + 1) % 3], face[(k + 2) % 3]])) / whole);
  return unit(sumOf(face.map((corner, k) => unit(normals.get(`${corner}`)).map((x) => x * shares[k]))));
}

/**
 * The cosine between a triangle and the surface at its corners, which lie on it. The centre may be far from the surface
 * and nearest to another part of it; and at an edge, a flat face represents only one side.
 */
function facingOf(triangle, faces, normals) {
  const smooth = sumOf(triangle.map((corner) => smoothNormalAt(corner, faces, normals)));
  const normal = normalOf(triangle);
  return normal.reduce((total, x, k) => total + x * smooth[k], 0) / (Math.hypot(...normal) * Math.hypot(...smooth));
}

/**
 * Asserts that the inverted triangles of a pair are counted, and the largest named by their numbers in the file.
 * Returns how many there are.
 */
function assertNamed({ a, b, inverted_fraction, inverted_count, inverted_triangles }, triangles, morph, sources) {
  assert.ok(inverted_fraction < 0.05);
  assert.equal(inverted_fraction, inverted_count / triangles);
  assert.equal(inverted_triangles.length, Math.min(inverted_count, 32));
  const places = [a, b].map((s) => pointsOf(morph, s));
  const faces = [a, b].map((s) => facesOf(sources[s]));
  const shown = inverted_triangles.map((t) => places.map((points) => sources[0].triangles[t].map((v) => points[v])));
  const normals = faces.map(smoothNormalsOf);
  const facing = shown.map((pair) => Math.min(...pair.map((triangle, i) => facingOf(triangle, faces[i], normals[i]))));
  // The others face their surface with a cosine near 1. The daemon weights normals by its own rule, hence the margin.
  assert.ok(Math.max(-1, ...facing) < 0.05, `${facing}`);
  const sizes = shown.map((pair) => Math.max(...pair.map((triangle) => Math.hypot(...normalOf(triangle)))));
  assert.ok(
    sizes.every((x, i) => i === 0 || x <= 1.001 * sizes[i - 1]),
    'the largest first',
  );
  return inverted_triangles.length;
}

test('the mesh of the first shape stays, and the others lie on their surfaces', async (t) => {
  const d = await daemon(t);
  const files = ['dog.obj', 'giraffe.off', 'elephant.ply'];
  const sources = await Promise.all(
    files.map(async (f) => shapes.parse(await readFile(path.join(samples, f), 'utf8'))),
  );
  const meshes = [];
  for (const file of files) meshes.push({ mesh: (await d.mesh(path.join(samples, file))).id });
  const { landmarks } = JSON.parse(await readFile(path.join(samples, 'dog-giraffe-elephant.json'), 'utf8'));
  const made = await d.made('/v1/supermeshes', { shapes: meshes, landmarks, remesh, asset: { fit: 'none' } });
  assert.equal(made.vertices, sources[0].positions.length);
  assert.equal(made.triangles, sources[0].triangles.length);
  assert.equal(made.certificate.landmarks_exact, true);
  const morph = morphOf((await d.get(made.asset)).bytes);
  assert.equal(morph.count, made.vertices);
  assertKept(morph, sources[0], sources.slice(1));
  assert.equal(made.shapes[0].hausdorff_relative, 0);
  for (const s of [1, 2]) {
    const { hausdorff_relative, hausdorff_proved, diagonal } = made.shapes[s];
    assert.equal(hausdorff_proved, true);
    const measured = distanceBack(morph, s, sources[s]) / diagonal;
    assert.ok(measured > 0.001, 'the shapes differ by more than the tolerance');
    assert.ok(measured <= hausdorff_relative + 1e-6, `shape ${s}: ${measured}, stated ${hausdorff_relative}`);
  }
  const named = made.pairs.map((pair) => assertNamed(pair, made.triangles, morph, sources));
  assert.ok(Math.max(...named) > 0, 'a dog folds somewhere on the others');
});

test('vertices in their order, a vertex that a seam repeats, and one that no triangle uses', async (t) => {
  const d = await daemon(t);
  const base = shapes.egg(2);
  const target = shapes.bean(2);
  // A seam as exporters write it: the vertices of every third triangle are repeated with other texture coordinates.
  const positions = base.positions.map((p) => p.map(Math.fround));
  const uv = positions.map((p) => [Math.fround(p[0] / 4 + 0.5), Math.fround(p[1] / 4 + 0.5)]);
  const normals = positions.map((p) => p.map((x) => Math.fround(x / Math.hypot(...p))));
  positions.push([9, 9, 9]);
  uv.push([0, 0]);
  normals.push([0, 0, 1]);
  const triangles = base.triangles.map((corners, i) =>
    i % 3 > 0
      ? corners
      : corners.map((v) => {
          uv.push([uv[v][0] / 2, uv[v][1]]);
          normals.push(normals[v]);
          return positions.push(positions[v]) - 1;
        }),
  );
  const glb = writeGlb({ positions, normals, uv, triangles });
  const first = (await d.upload(glb, { name: 'egg' })).json;
  const second = (await d.upload(shapes.obj(target), { name: 'bean' })).json;
  const made = await d.made('/v1/supermeshes', {
    shapes: [{ mesh: first.id }, { mesh: second.id }],
    landmarks: 'auto',
    remesh,
    asset: { fit: 'none' },
  });
  assert.equal(made.vertices, base.positions.length, 'the surface itself is welded');
  const { bytes } = await d.get(made.asset);
  const morph = morphOf(bytes);
  const asset = parseGlb(bytes);
  const [primitive] = asset.gltf.meshes[0].primitives;
  assert.equal(morph.count, positions.length);
  assert.deepEqual(morph.triangles, triangles.flat());
  for (const [name, values] of Object.entries({ POSITION: positions, NORMAL: normals, TEXCOORD_0: uv }))
    assert.deepEqual([...asset.read(primitive.attributes[name])], values.flat(), name);
  const lone = base.positions.length;
  assert.deepEqual([...asset.read(primitive.targets[0].POSITION)].slice(3 * lone, 3 * lone + 3), [0, 0, 0]);
  const on = pointsOf(morph, 1).filter((_, v) => v !== lone);
  const off = farthest(on, target.positions.flat(), target.triangles.flat());
  assert.ok(off <= 1e-6 * diagonalOf(target.positions), `${off}`);
});

test('an OBJ vertex with several texture coordinates gets copies after all vertices, which move alike', async (t) => {
  const d = await daemon(t);
  const base = shapes.egg(2);
  // The first chart has the texture coordinates 1 … n, one per vertex; the second, every third triangle, the next n.
  const uv = [0, 1].flatMap((chart) =>
    base.points.map(([x, y]) => [chart / 2 + (x + 1) / 4, (y + 1) / 2].map(Math.fround)),
  );
  const n = base.positions.length;
  const chartOf = (i) => (i % 3 === 0 ? n : 0);
  const text =
    base.positions.map((p) => `v ${p.join(' ')}\n`).join('') +
    uv.map((p) => `vt ${p.join(' ')}\n`).join('') +
    base.triangles.map((f, i) => `f ${f.map((v) => `${v + 1}/${v + 1 + chartOf(i)}`).join(' ')}\n`).join('');
  const first = (await d.upload(text, { name: 'egg' })).json;
  const second = (await d.upload(shapes.obj(shapes.bean(2)), { name: 'bean' })).json;
  const made = await d.made('/v1/supermeshes', {
    shapes: [{ mesh: first.id }, { mesh: second.id }],
    align: { method: 'rotate' },
    remesh,
    asset: { fit: 'none' },
  });
  const morph = morphOf((await d.get(made.asset)).bytes);
  const read = morph.read(morph.gltf.meshes[0].primitives[0].attributes.TEXCOORD_0);
  const charts = base.positions.map(() => new Set());
  base.triangles.forEach((f, i) => f.forEach((v) => charts[v].add(chartOf(i))));
  assert.equal(morph.count, n + charts.filter((some) => some.size === 2).length);
  assert.deepEqual(morph.shapes[0].slice(0, 3 * n), base.positions.flat().map(Math.fround));
  base.triangles.flat().forEach((v, i) => {
    const at = morph.triangles[i];
    assert.ok(at === v || at >= n);
    for (const values of [morph.shapes[0], morph.deltas[0]])
      assert.deepEqual(values.slice(3 * at, 3 * at + 3), values.slice(3 * v, 3 * v + 3));
    const [a, b] = uv[v + chartOf(Math.floor(i / 3))];
    assert.deepEqual([read[2 * at], read[2 * at + 1]], [a, Math.fround(1 - b)]);
  });
});

test('an OBJ of several materials keeps its vertices once and in their order', async (t) => {
  const d = await daemon(t);
  const base = shapes.egg(2);
  const names = ['skin', 'cloth', 'hair'];
  const kindOf = (i) => (i * 7) % 3; // neighbours have different materials: nearly all vertices lie on a border
  const lone = [7, 8, 9]; // no triangle uses it
  const text =
    [...base.positions, lone].map((p) => `v ${p.join(' ')}\n`).join('') +
    base.triangles.map((f, i) => `usemtl ${names[kindOf(i)]}\nf ${f.map((v) => v + 1).join(' ')}\n`).join('');
  const colors = base.positions.map((p) => p.map((x) => (1 + Math.sin(5 * x)) / 2));
  const first = (await d.upload(text, { name: 'egg' })).json;
  const second = (await d.upload(writeGlb({ ...base, colors }), { name: 'painted' })).json;
  const order = { shapes: [{ mesh: first.id }, { mesh: second.id }], align: { method: 'rotate' }, remesh };
  const plain = await d.made('/v1/supermeshes', order);
  const dressed = await d.made('/v1/supermeshes', { ...order, transfer: [{ from: 1, what: 'color' }] });
  for (const made of [plain, dressed]) {
    const { gltf, read } = parseGlb((await d.get(made.asset)).bytes);
    const { primitives } = gltf.meshes[0];
    assert.deepEqual(
      primitives.map(({ material }) => gltf.materials[material].name),
      names,
    );
    for (const { attributes, targets } of primitives)
      assert.deepEqual(
        { attributes, targets },
        { attributes: primitives[0].attributes, targets: primitives[0].targets },
      );
    assert.deepEqual(
      [...read(primitives[0].attributes.POSITION)],
      [...base.positions, lone].flat().map(Math.fround),
      'each vertex once, as in the file',
    );
    for (const [k, { indices }] of primitives.entries())
      assert.deepEqual([...read(indices)], base.triangles.filter((_, i) => kindOf(i) === k).flat());
  }
  const { gltf, read } = parseGlb((await d.get(dressed.asset)).bytes);
  const painted = [...read(gltf.meshes[0].primitives[0].attributes.COLOR_0)];
  assert.equal(painted.length, 4 * (base.positions.length + 1));
  assert.ok(new Set(painted).size > 50, 'the colours came along');
});

test('where the template is too coarse for a shape, its triangles are named, the farthest first', async (t) => {
  const d = await daemon(t);
  const plain = shapes.ball(3);
  const horned = shapes.ball(4, (p) => {
    const r = 1 + 0.5 * Math.exp(-(((p[0] - 1) ** 2 + p[1] ** 2 + p[2] ** 2) / 0.02));
    return p.map((x) => r * x);
  });
  const ids = [];
  for (const body of [plain, horned]) ids.push({ mesh: (await d.upload(shapes.obj(body))).json.id });
  const request = (tolerance, method = 'template') => ({
    shapes: ids,
    align: { method: 'rotate' },
    remesh: { method, tolerance },
    asset: { fit: 'none' },
  });
  const tolerance = 0.006;
  const { shapes: told, asset } = await d.made('/v1/supermeshes', request(tolerance));
  assert.equal(told[0].coarse, undefined);
  const { diagonal, coarse } = told[1];
  // The same, computed from all pairs of samples and triangles.
  const made = pointsOf(morphOf((await d.get(asset)).bytes), 1);
  const faces = plain.triangles.map((corners) => corners.map((v) => made[v]));
  const mean = (points) => [0, 1, 2].map((k) => points.reduce((sum, p) => sum + p[k] / points.length, 0));
  const nearest = (p, among) => {
    let [least, at] = [Infinity, -1];
    among.forEach((face, i) => {
      const distance = toTriangle(p, ...face);
      if (distance < least) [least, at] = [distance, i];
    });
    return [least, at];
  };
  const wanted = facesOf(horned);
  const errors = faces.map(([a, b, c]) =>
    Math.max(
      ...[
        [a, b],
        [b, c],
        [c, a],
        [a, b, c],
      ].map((points) => nearest(mean(points), wanted)[0]),
    ),
  );
  for (const p of [...horned.positions, ...wanted.map(mean)]) {
    const [distance, i] = nearest(p, faces);
    errors[i] = Math.max(errors[i], distance);
  }
  const limit = tolerance * diagonal;
  const expected = errors.filter((x) => x > limit).sort((a, b) => b - a);
  assert.ok(expected.length > 0);
  // The horn is on the x axis; its bump falls below a thousandth of the radius at a distance of 0.36.
  const axis = ([x, y, z]) => Math.hypot(x / Math.hypot(x, y, z) - 1, y / Math.hypot(x, y, z), z / Math.hypot(x, y, z));
  for (const [i, face] of faces.entries())
    if (errors[i] > limit) assert.ok(Math.min(...face.map(axis)) < 0.36, `triangle ${i} is not at the horn`);
  assert.equal(coarse.count, expected.length);
  assert.equal(coarse.triangles.length, coarse.count);
  coarse.errors_relative.forEach((x, i) => assert.ok(Math.abs(x * diagonal - expected[i]) < 1e-5, `error ${i}`));
  // Samples at an edge may count for either triangle there, so the named ones are compared only as far as they are
  // unambiguous.
  assert.equal(coarse.triangles[0], errors.indexOf(Math.max(...errors)));
  for (const i of coarse.triangles) assert.ok(errors[i] > limit, `triangle ${i}`);
  const areaOf = (face) => Math.hypot(...normalOf(face));
  const sum = (list) => list.reduce((total, face) => total + areaOf(face), 0);
  const share = sum(coarse.triangles.map((i) => faces[i])) / sum(faces);
  assert.ok(Math.abs(coarse.share - share) < 1e-5, `${coarse.share}, measured ${share}`);
  const at = await folder(t);
  const files = ['plain', 'horned'].map((name) => path.join(at, `${name}.obj`));
  for (const [i, body] of [plain, horned].entries()) await writeFile(files[i], shapes.obj(body));
  const options = ['--remesh', 'template', '--align', 'rotate', '--fit', 'none', '-t', String(tolerance)];
  const args = ['morph', ...files, ...options, '-o', path.join(at, 'out.glb')];
  const { code, out, err } = await run(args, { env: { ORBMORPH_SERVER: d.url } });
  assert.equal(code, 0, err);
  const [, count, first] = out.match(
    /The mesh of plain is too coarse for horned at (\d+) of its triangles \(.* %\s+of the\s+surface\); subdivide it around triangle (\d+)/,
  );
  assert.deepEqual([Number(count), Number(first)], [coarse.count, coarse.triangles[0]]);
  for (const fine of [request(0.2), request(tolerance, 'adaptive')]) {
    const { shapes: list } = await d.made('/v1/supermeshes', fine);
    assert.ok(list.every((shape) => !('coarse' in shape)));
  }
});

test('where a repair has split a vertex, the bound is that of the file, which has it whole', async (t) => {
  const d = await daemon(t);
  // A ball whose poles are pulled to its centre, where they are one vertex.
  const ball = shapes.ball(3);
  const extreme = (sign) => ball.positions.reduce((s, p, i) => (sign * p[1] > sign * ball.positions[s][1] ? i : s), 0);
  const [top, bottom] = [extreme(1), extreme(-1)];
  const positions = ball.positions.map(([x, y, z], i) =>
    i === top || i === bottom ? [0, 0, 0] : [x, y * Math.min(1, 0.02 + 1.4 * Math.hypot(x, z)), z],
  );
  const touching = { positions, triangles: ball.triangles.map((f) => f.map((v) => (v === bottom ? top : v))) };
  const plain = shapes.ball(3);
  const first = (await d.upload(shapes.obj(touching))).json;
  assert.ok(
    first.repairs.some(({ kind }) => kind === 'split-vertices'),
    JSON.stringify(first.repairs),
  );
  const second = (await d.upload(shapes.obj(plain))).json;
  const made = await d.made('/v1/supermeshes', {
    shapes: [{ mesh: first.id }, { mesh: second.id }],
    align: { method: 'rotate' },
    remesh: { method: 'template', tolerance: 0.01 },
    asset: { fit: 'none' },
  });
  const { hausdorff_relative, hausdorff_proved, diagonal, coarse } = made.shapes[1];
  const morph = morphOf((await d.get(made.asset)).bytes);
  assert.equal(morph.count, positions.length);
  const points = pointsOf(morph, 1);
  const samples = touching.triangles.flatMap((f) =>
    [
      [1, 0, 0],
      [0.5, 0.5, 0],
      [0, 0.5, 0.5],
      [0.5, 0, 0.5],
      [1 / 3, 1 / 3, 1 / 3],
    ].map((w) => [0, 1, 2].map((k) => f.reduce((sum, v, i) => sum + w[i] * points[v][k], 0))),
  );
  const measured = farthest(samples, plain.positions.flat(), plain.triangles.flat()) / diagonal;
  assert.ok(measured > 0.1, `the asset reaches from pole to pole: ${measured}`);
  assert.equal(hausdorff_proved, true);
  assert.ok(measured <= hausdorff_relative, `${measured}, stated ${hausdorff_relative}`);
  // The triangles at the other pole are named.
  const stretched = touching.triangles.flatMap((f, i) => (f.includes(top) ? [i] : []));
  assert.ok(
    coarse.triangles.some((i) => stretched.includes(i)),
    `${coarse.triangles}, stretched ${stretched}`,
  );
});

test('landmarks that turn a triangle over are named', async (t) => {
  const d = await daemon(t);
  const [base, target] = [shapes.egg(3), shapes.bean(3)];
  const list = [];
  for (const body of [base, target]) list.push({ mesh: (await d.upload(shapes.obj(body))).json.id });
  const [a, b, c] = base.triangles[100];
  const mark = (name, ...at) => ({ name, at: at.map((vertex) => ({ vertex })) });
  const tips = [0, 1, 2, 3, 4, 5].map((v) => mark(`tip ${v}`, v, v));
  const mirrored = [mark('a', a, a), mark('b', b, c), mark('c', c, b)];
  const request = (landmarks, method = 'template') => ({
    shapes: list,
    landmarks,
    align: { method: 'rbf' },
    remesh: { method },
    asset: { fit: 'none' },
  });
  const { problem } = await d.make('/v1/supermeshes', request([...tips, ...mirrored]));
  assert.equal(problem.type, '/problems/bad-landmarks');
  assert.deepEqual(problem.landmarks, [6, 7, 8]);
  assert.equal(problem.shape, 0);
  assert.match(problem.detail, /flip 1 triangle of/);
  await d.made('/v1/supermeshes', request([...tips, ...mirrored.slice(0, 2)]));
  await d.made('/v1/supermeshes', request([...tips, ...mirrored], 'adaptive'));
});
