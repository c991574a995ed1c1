// Compares the places of a supermesh's vertices in the uploaded files with the files and the asset.
import assert from 'node:assert/strict';
import test from 'node:test';
import { daemon, assertProblem } from './support/daemon.mjs';
import { morphOf } from './support/glb.mjs';
import * as shapes from './support/shapes.mjs';

function read(bytes) {
  assert.equal(bytes.toString('latin1', 0, 8), 'ORBPLACE');
  const [version, count, vertices] = [8, 12, 16].map((at) => bytes.readUInt32LE(at));
  assert.equal(version, 1);
  const map = 20 + 28 * count * vertices;
  assert.equal(bytes.toString('latin1', map, map + 8), 'GLBVERTS');
  const asset = Array.from({ length: bytes.readUInt32LE(map + 8) }, (_, g) => bytes.readUInt32LE(map + 12 + 4 * g));
  assert.equal(bytes.length, map + 12 + 4 * asset.length);
  assert.ok(asset.every((v) => v < vertices));
  const at = (s, v) => {
    const from = 20 + 28 * (s * vertices + v);
    return { triangle: bytes.readInt32LE(from), weights: [4, 12, 20].map((o) => bytes.readDoubleLE(from + o)) };
  };
  return { count, vertices, at, asset };
}

const position = (m, { triangle, weights }) => {
  const p = [0, 0, 0];
  for (let k = 0; k < 3; k++) {
    const corner = m.positions[m.triangles[triangle][k]];
    for (let i = 0; i < 3; i++) p[i] += weights[k] * corner[i];
  }
  return p;
};

test('places of a supermesh name triangles of the files', async (t) => {
  const d = await daemon(t);
  const sources = [shapes.egg(3), shapes.bean(3)];
  // The second file lists every triangle reversed and from another corner: the repair reverses them again.
  sources[1] = {
    ...sources[1],
    triangles: sources[1].triangles.map(
      ([a, b, c], i) =>
        [
          [b, a, c],
          [a, c, b],
          [c, b, a],
        ][i % 3],
    ),
  };
  const pair = [];
  for (const m of sources) pair.push({ mesh: (await d.upload(shapes.obj(m))).json.id });
  const landmarks = [0, 1, 2].map((axis) => ({
    name: 'xyz'[axis],
    at: sources.map((m) => ({ vertex: m.points.findIndex((p) => Math.abs(p[axis] - 1) < 1e-12) })),
  }));
  // One inside a triangle, which the alignment splits.
  landmarks.push({ name: 'inside', at: [0, 1].map(() => ({ triangle: 47, barycentric: [0.25, 0.15, 0.6] })) });
  for (const method of ['adaptive', 'overlay']) {
    const supermesh = await d.made('/v1/supermeshes', { shapes: pair, landmarks, remesh: { method } });
    const reply = await d.get(`${supermesh.url}/places`);
    assert.equal(reply.status, 200);
    assert.match(reply.headers.get('cache-control'), /immutable/);
    const places = read(reply.bytes);
    assert.equal(places.count, 2);
    assert.equal(places.vertices, supermesh.vertices);

    // Every vertex of the asset is at the place of one supermesh vertex, on both shapes, and vice versa.
    const morph = morphOf((await d.get(supermesh.asset)).bytes);
    const near = (p, q) => Math.hypot(...p.map((x, i) => x - q[i])) < 3e-6;
    const glb = [];
    for (let v = 0; v < morph.shapes[0].length / 3; v++) {
      glb.push(morph.shapes.flatMap((s) => [...s.slice(3 * v, 3 * v + 3)]));
    }
    const cells = new Map();
    for (const p of glb) {
      const k = Math.round(p[0] * 1e5);
      cells.set(k, [...(cells.get(k) ?? []), p]);
    }
    const met = new Set();
    for (let v = 0; v < places.vertices; v++) {
      const both = [0, 1].flatMap((s) => {
        const place = places.at(s, v);
        assert.ok(place.triangle >= 0 && place.triangle < sources[s].triangles.length);
        assert.ok(place.weights.every((w) => w >= 0));
        assert.ok(Math.abs(place.weights.reduce((a, b) => a + b) - 1) < 1e-12);
        return position(sources[s], place);
      });
      const cell = Math.round(both[0] * 1e5);
      const found = [-1, 0, 1].flatMap((o) => cells.get(cell + o) ?? []).filter((p) => near(p, both));
      assert.ok(found.length > 0, `vertex ${v} is not in the asset`);
      for (const p of found) met.add(p);
    }
    assert.equal(met.size, glb.length);

    // The landmarks' vertices are where the caller placed them.
    supermesh.landmarks.forEach((l, i) => {
      for (const s of [0, 1]) {
        const asked = landmarks[i].at[s];
        const wanted =
          asked.vertex !== undefined
            ? sources[s].positions[asked.vertex]
            : position(sources[s], { triangle: asked.triangle, weights: asked.barycentric });
        const got = position(sources[s], places.at(s, l.vertex));
        assert.ok(Math.hypot(...got.map((x, k) => x - wanted[k])) < 1e-12, `${method} ${l.name} ${s}`);
      }
    });
    const part = await d.get(`${supermesh.url}/places`, { headers: { range: 'bytes=0-7' } });
    assert.equal(part.status, 206);
    assert.equal(part.bytes.toString(), 'ORBPLACE');
    assert.equal((await d.delete(supermesh.url)).status, 204);
    assertProblem(await d.get(`${supermesh.url}/places`), 404, 'not-found');
  }
});

// A label of the second file, one a vertex, that no position tells: carried to the GLB, also where the GLB splits vertices.
test('an attribute is carried to the asset by the places', async (t) => {
  const d = await daemon(t);
  // Every triangle of the first file has three texture coordinates of its own: the asset splits every vertex.
  const first = shapes.egg(3);
  const second = shapes.bean(3);
  const seams = [
    ...first.positions.map((p) => `v ${p.join(' ')}`),
    ...first.triangles.flatMap((_, i) =>
      [0, 1, 2].map((k) => `vt ${((i % 37) + 0.3 * k) / 40} ${((i % 29) + 0.2 * k * k) / 40}`),
    ),
    ...first.triangles.map((c, i) => `f ${c.map((v, k) => `${v + 1}/${3 * i + k + 1}`).join(' ')}`),
  ].join('\n');
  const pair = [];
  for (const text of [seams, shapes.obj(second)]) pair.push({ mesh: (await d.upload(text)).json.id });
  const supermesh = await d.made('/v1/supermeshes', {
    shapes: pair,
    align: { method: 'rotate' },
    remesh: { method: 'adaptive' },
  });
  const places = read((await d.get(`${supermesh.url}/places`)).bytes);
  const morph = morphOf((await d.get(supermesh.asset)).bytes);
  assert.equal(places.asset.length, morph.shapes[0].length / 3);
  assert.ok(places.asset.length > places.vertices, 'seams split vertices');
  assert.equal(new Set(places.asset).size, places.vertices);
  // The attribute is a linear function of the position, so that its value on the asset is known.
  const label = second.positions.map((p) => 3 * p[0] - 2 * p[1] + p[2] + 5);
  places.asset.forEach((v, g) => {
    const { triangle, weights } = places.at(1, v);
    const value = second.triangles[triangle].reduce((sum, corner, k) => sum + weights[k] * label[corner], 0);
    const [x, y, z] = morph.shapes[1].slice(3 * g, 3 * g + 3);
    assert.ok(Math.abs(value - (3 * x - 2 * y + z + 5)) < 2e-5, `vertex ${g}: ${value}`);
  });
});
