// "transfer": what the shapes have besides their surfaces, carried onto the supermesh of every method.
import assert from 'node:assert/strict';
import test from 'node:test';
import { rigged } from '../samples/rigged.mjs';
import { assertProblem, daemon } from './support/daemon.mjs';
import { writeGlb } from './support/glb_write.mjs';
import * as shapes from './support/shapes.mjs';
import { assetOf, inCharts, near, shown, uploaded } from './support/transferred.mjs';

const METHODS = ['adaptive', 'overlay', 'subdivision', 'convex-hull', 'template'];
const asset = { fit: 'none', animation: 'none' };

const tint = ([x, y, z]) => [0.5 + 0.2 * x, 0.4 + 0.1 * y, 0.5 + 0.3 * z];
const flat = ([x, y, z]) => [0.3 * x - 0.1 * z, 0.4 * y];
const wide = ([, y, z], east) => [(east ? 0.75 : 0.25) + 0.1 * y, 0.5 + 0.2 * z];

/** A bean with colours, a set of texture coordinates without seams, and one of two charts that meet at x = 0. */
function painted() {
  const bean = shapes.bean(3);
  const made = inCharts(bean, (v, east) => wide(bean.positions[v], east));
  return { ...made, uv1: made.positions.map(flat), colors: made.positions.map(tint) };
}

test('what cannot be transferred is refused by its entry', async (t) => {
  const d = await daemon(t);
  const [egg, bean] = [shapes.egg(2), shapes.bean(2)].map(shapes.obj);
  const request = { shapes: [await uploaded(d, egg, { name: 'egg' }), await uploaded(d, bean, { name: 'bean' })] };
  const skin = { from: 1, what: 'skin' };
  for (const [transfer, entry, why] of [
    ['skin', undefined, /must be an array/],
    [[7], 0, /must be an object/],
    [[{ what: 'skin' }], 0, /"from" of entry 0/],
    [[{ from: 2, what: 'skin' }], 0, /0 to 1 in their order/],
    [[{ from: 0.5, what: 'skin' }], 0, /0 to 1/],
    [[skin, { from: 1, what: 'bones' }], 1, /"what" of entry 1.*"targets"/],
    [[skin, skin], 1, /ask for the same/],
    [[{ from: 0, what: 'skin' }, { from: 1, what: 'color' }, skin], 2, /one skin, but entries 0 and 2/],
    [[{ from: 0, what: 'texture' }], 0, /first shape/],
    [[{ from: 1, what: 'texture', resolution: 3 }], 0, /16 to 8192/],
    [[{ from: 1, what: 'color', resolution: 64 }], 0, /"texture"/],
    [Array.from({ length: 65 }, () => skin), undefined, /at most 64/],
  ]) {
    const reply = await d.post('/v1/supermeshes', { ...request, transfer });
    assertProblem(reply, 422, 'invalid-request');
    assert.match(reply.json.detail, why);
    assert.equal(reply.json.transfer, entry);
  }
  const unknown = await d.post('/v1/supermeshes', { ...request, transfer: [skin, { ...skin, to: 2 }] });
  assertProblem(unknown, 422, 'unknown-member');
  assert.deepEqual([unknown.json.member, unknown.json.transfer], ['to', 1]);
  for (const [what, why] of [
    ['color', /no colours of vertices/],
    ['texcoord', /no texture coordinates/],
  ])
    for (const from of [0, 1]) {
      const { problem } = await d.make('/v1/supermeshes', { ...request, transfer: [{ from, what }] });
      assert.equal(problem?.type, '/problems/bad-option');
      assert.match(problem.detail, why);
      assert.match(problem.detail, new RegExp(`shape ${from}`));
    }
});

test('the canonical request has it, and it is part of the id', async (t) => {
  const d = await daemon(t);
  const file = writeGlb(painted());
  const request = {
    shapes: [await uploaded(d, shapes.obj(shapes.egg(2)), { name: 'egg' }), await uploaded(d, file, { name: 'bean' })],
    asset,
  };
  const plain = await d.made('/v1/supermeshes', request);
  const transfer = [{ from: 1, what: 'color' }];
  const made = await d.made('/v1/supermeshes', { ...request, transfer });
  assert.notEqual(made.id, plain.id);
  assert.deepEqual(made.request.transfer, transfer);
  assert.equal(plain.request.transfer, undefined);
  assert.equal(plain.transferred, undefined);
  assert.deepEqual(made.transferred, [{ from: 1, what: 'color', as: 'COLOR_0' }]);
  assert.equal((await d.made('/v1/supermeshes', made.request)).id, made.id);
  for (const profile of ['quantized', 'meshopt'])
    assertProblem(await d.get(`${made.asset}?profile=${profile}`), 422, 'bad-option');
  assert.equal(made.profiles, undefined);
});

/** Checks colours and texture coordinates of the bean, shown by target 0, on an asset. whole: no triangle of it crosses
 * the line between the charts; split: vertices on it have copies. */
function assertPainted(all, { color, chart, plane, whole, split }, what) {
  let beyond = 0;
  for (const one of all) {
    const places = shown(one);
    for (const [v, p] of places.entries()) {
      near(one[color].slice(4 * v, 4 * v + 3), tint(p), 2e-5, `${what}: ${color}`);
      assert.equal(one[color][4 * v + 3], 1);
      near(one[plane].slice(2 * v, 2 * v + 2), flat(p), 2e-5, `${what}: ${plane}`);
    }
    for (let i = 0; i < one.indices.length; i += 3) {
      const corners = one.indices.slice(i, i + 3);
      const uv = corners.map((v) => one[chart].slice(2 * v, 2 * v + 2));
      const east = uv[0][0] > 0.5;
      if (split)
        assert.ok(
          uv.every(([u]) => u > 0.5 === east),
          `${what}: a triangle lies on one chart`,
        );
      if (whole) for (const [k, v] of corners.entries()) near(uv[k], wide(places[v], east), 2e-5, `${what}: ${chart}`);
      else beyond += corners.some((v, k) => Math.abs(uv[k][0] - wide(places[v], east)[0]) > 2e-5);
    }
  }
  assert.ok(whole || beyond > 0, `${what}: some triangle crosses the line`);
}

for (const method of METHODS)
  test(`${method}: colours and texture coordinates of a later shape`, async (t) => {
    const d = await daemon(t);
    const egg = shapes.egg(3);
    const normals = egg.positions.map((p) => p.map((x) => x / Math.hypot(...p)));
    const bean = await uploaded(d, writeGlb(painted()), { name: 'bean' });
    const bases = [['obj', shapes.obj(egg)]];
    const uv = egg.positions.map(() => [0.5, 0.5]);
    const colors = egg.positions.map(() => [0, 0, 1]);
    bases.push(['glb', writeGlb({ ...egg, normals, uv, colors })]);
    for (const [kind, file] of bases) {
      const base = await uploaded(d, file, { name: `egg ${kind}` });
      const transfer = ['texcoord', 'color'].map((what) => ({ from: 1, what }));
      const remesh = { method, tolerance: 0.01 };
      const made = await d.made('/v1/supermeshes', { shapes: [base, bean], remesh, asset, transfer });
      const n = kind === 'obj' ? 0 : 1;
      assert.deepEqual(
        made.transferred.map((one) => one.as),
        [`TEXCOORD_${n}`, `TEXCOORD_${n + 1}`, `COLOR_${n}`],
      );
      const { all, gltf } = await assetOf(d, made);
      assertPainted(
        all,
        {
          color: `COLOR_${n}`,
          chart: `TEXCOORD_${n}`,
          plane: `TEXCOORD_${n + 1}`,
          whole: method === 'overlay',
          split: method !== 'template',
        },
        `${method} ${kind}`,
      );
      if (kind === 'glb') {
        const width = (3 * all[0].COLOR_0.length) / all[0].POSITION.length;
        assert.ok(all[0].COLOR_0.every((x, i) => x === (i % width > 1 ? 1 : 0)));
        assert.ok(all[0].TEXCOORD_0.every((x) => x === 0.5));
      } else assert.deepEqual(gltf.materials[0].pbrMetallicRoughness.baseColorFactor, [1, 1, 1, 1]);
      if (method === 'template') {
        const order = all[0].POSITION.map((x) => x);
        assert.deepEqual(order, egg.positions.flat().map(Math.fround), 'the vertices of the file stay');
      }
    }
  });

test('further sets of the first shape, and of one with several primitives', async (t) => {
  const d = await daemon(t);
  const { bytes } = rigged();
  const body = await uploaded(d, bytes, { name: 'body', repair: 'largest_component' });
  const egg = await uploaded(d, shapes.obj(shapes.egg(3)), { name: 'egg' });
  const texcoord = (from) => [{ from, what: 'texcoord' }];
  const first = await d.made('/v1/supermeshes', { shapes: [body, egg], asset, transfer: texcoord(0) });
  assert.deepEqual(
    first.transferred.map((one) => one.as),
    ['TEXCOORD_1'],
    'the asset has TEXCOORD_0 already',
  );
  for (const one of (await assetOf(d, first)).all)
    near(
      one.TEXCOORD_1,
      one.TEXCOORD_0.map((x) => x / 2),
      1e-5,
      'the second set is half the first',
    );
  const kept = { shapes: [body, egg], asset, remesh: { method: 'template' }, transfer: texcoord(0) };
  assert.deepEqual((await d.made('/v1/supermeshes', kept)).transferred, [], 'its document has them');
  const later = await d.made('/v1/supermeshes', { shapes: [egg, body], asset, transfer: texcoord(1) });
  assert.deepEqual(
    later.transferred.map((one) => one.as),
    ['TEXCOORD_0', 'TEXCOORD_1'],
  );
});
