// "transfer": skins with their skeletons, and morph targets of the files.
import assert from 'node:assert/strict';
import test from 'node:test';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
import { rigged } from '../samples/rigged.mjs';
import { assertProblem, daemon } from './support/daemon.mjs';
import { writeGlb } from './support/glb_write.mjs';
import * as shapes from './support/shapes.mjs';
import { assetOf, near, shown, uploaded } from './support/transferred.mjs';

const JOINTS = 20;
const HEIGHT = 2;
const asset = { fit: 'none', animation: 'none' };

/** The joint to which a height of the sample belongs, by its weights. */
const jointAt = (y) => Math.min(JOINTS - 1.001, Math.max(0, (y / HEIGHT) * (JOINTS - 1)));

/** The offset of the sample's target "smile". */
const smile = ([, y]) => [0, y > 1.4 ? 0.05 * (y - 1.4) : 0, 0];

const times = (a, b) =>
  Array.from({ length: 16 }, (_, i) =>
    [0, 1, 2, 3].reduce((sum, k) => sum + a[4 * k + (i % 4)] * b[4 * (i >> 2) + k], 0),
  );
const one = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
const local = ({ matrix, translation: [x, y, z] = [0, 0, 0] }) => matrix ?? [...one.slice(0, 12), x, y, z, 1];
const apply = (m, [x, y, z]) => [0, 1, 2].map((r) => m[r] * x + m[4 + r] * y + m[8 + r] * z + m[12 + r]);

/** The place of each vertex of a primitive as deformed by its skin, with some joints translated in their own frame. */
function posed({ gltf, read }, { POSITION, JOINTS_0, WEIGHTS_0 }, moved = {}) {
  const [skin] = gltf.skins;
  const parent = new Map(gltf.nodes.flatMap(({ children = [] }, n) => children.map((c) => [c, n])));
  const world = (n) => {
    const here = local(gltf.nodes[n]);
    const { name } = gltf.nodes[n];
    const at = moved[name] ? times(here, [...one.slice(0, 12), ...moved[name], 1]) : here;
    return parent.has(n) ? times(world(parent.get(n)), at) : at;
  };
  const bind = read(skin.inverseBindMatrices);
  const joint = skin.joints.map((n, j) => times(world(n), [...bind.slice(16 * j, 16 * j + 16)]));
  return Array.from({ length: POSITION.length / 3 }, (_, v) => {
    const sum = [0, 0, 0];
    for (let k = 4 * v; k < 4 * v + 4; k++) {
      const p = apply(joint[JOINTS_0[k]], POSITION.slice(3 * v, 3 * v + 3));
      p.forEach((x, c) => (sum[c] += WEIGHTS_0[k] * x));
    }
    return sum;
  });
}

/** Where the joints are at rest. */
function rests({ gltf }) {
  const parent = new Map(gltf.nodes.flatMap(({ children = [] }, n) => children.map((c) => [c, n])));
  const world = (n) => (parent.has(n) ? times(world(parent.get(n)), local(gltf.nodes[n])) : local(gltf.nodes[n]));
  return gltf.skins[0].joints.map((n) => world(n).slice(12, 15));
}

/** The weights at the places that `at` gives: the sample's weights, blended on its triangles. */
function assertWeights({ JOINTS_0, WEIGHTS_0 }, at) {
  for (const [v, [, y]] of at.entries()) {
    const joints = JOINTS_0.slice(4 * v, 4 * v + 4);
    const weights = WEIGHTS_0.slice(4 * v, 4 * v + 4);
    assert.equal(
      weights.reduce((a, b) => a + b),
      1,
      'the sum is exact',
    );
    weights.forEach((w, k) => assert.ok(w > 0 ? w <= (weights[k - 1] ?? 1) : joints[k] === 0));
    const mean = weights.reduce((sum, w, k) => sum + w * joints[k], 0);
    assert.ok(Math.abs(mean - jointAt(y)) < 1e-3, `${joints}: ${weights} at ${y}`);
  }
}

for (const method of ['adaptive', 'overlay', 'subdivision', 'convex-hull', 'template'])
  test(`${method}: the skin and the targets of a later shape`, async (t) => {
    const d = await daemon(t);
    const egg = shapes.egg(3);
    const normals = egg.positions.map((p) => p.map((x) => x / Math.hypot(...p)));
    const body = await uploaded(d, rigged().bytes, { name: 'body', repair: 'largest_component' });
    const bases = [['obj', shapes.obj(egg)]];
    if (method === 'template') bases.push(['glb', writeGlb({ ...egg, normals })]);
    for (const [kind, file] of bases) {
      const base = await uploaded(d, file, { name: `egg ${kind}` });
      const transfer = ['skin', 'targets'].map((what) => ({ from: 1, what }));
      const remesh = { method, tolerance: 0.005 };
      const made = await d.made('/v1/supermeshes', { shapes: [base, body], remesh, asset, transfer });
      assert.deepEqual(made.transferred, [
        { from: 1, what: 'skin', as: 'JOINTS_0' },
        { from: 1, what: 'targets', as: 'smile' },
      ]);
      const result = await assetOf(d, made);
      const { gltf, read, all, bytes } = result;
      assert.equal(all.length, 1);
      const places = shown(all[0]);
      assertWeights(all[0], places);
      assert.equal(gltf.skins.length, 1);
      assert.deepEqual(
        gltf.skins[0].joints.map((n) => gltf.nodes[n].name),
        Array.from({ length: JOINTS }, (_, j) => `joint ${j}`),
      );
      assert.equal(gltf.nodes.length, 1 + JOINTS, 'the mesh and the joints, nothing else of the sample');
      const low = [0, 1, 2].map((k) => Math.min(...places.map((_, v) => all[0].POSITION[3 * v + k])));
      const high = [0, 1, 2].map((k) => Math.max(...places.map((_, v) => all[0].POSITION[3 * v + k])));
      for (const p of rests(result))
        p.forEach((x, k) => assert.ok(x > low[k] - 0.1 && x < high[k] + 0.1, `${p} is in the egg: ${low}, ${high}`));
      posed(result, all[0]).forEach((p, v) =>
        near(p, all[0].POSITION.slice(3 * v, 3 * v + 3), 1e-5, 'the skeleton at rest moves nothing'),
      );

      const { targetNames } = gltf.meshes[0].extras;
      assert.deepEqual(targetNames, ['body', 'smile']);
      const move = all[0].moves[1];
      let off = 0;
      places.forEach((p, v) => {
        const is = smile(p);
        const crosses = Math.abs(p[1] - 1.4) < 0.2; /* the target has a kink there */
        off = Math.max(off, ...(crosses ? [0] : is.map((x, k) => Math.abs(x - move[3 * v + k]))));
      });
      assert.ok(off < 1e-5, `smile: ${off}`);
      assert.ok(Math.max(...move) > 0.02);
      if (all[0].NORMAL) {
        const turn = read(all[0].primitive.targets[1].NORMAL);
        assert.ok(turn.some((x) => x !== 0));
        for (let v = 0; v < places.length; v++) {
          const n = [0, 1, 2].map((k) => all[0].NORMAL[3 * v + k] + turn[3 * v + k]);
          assert.ok(Math.abs(Math.hypot(...n) - 1) < 1e-4);
        }
      }
      const scene = await new GLTFLoader().parseAsync(
        bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length),
        '',
      );
      let mesh;
      scene.scene.traverse((node) => (mesh ??= node.isMesh ? node : undefined));
      assert.ok(mesh.isSkinnedMesh);
      assert.equal(mesh.skeleton.bones.length, JOINTS);
      assert.deepEqual(mesh.morphTargetDictionary, { body: 0, smile: 1 });
    }
  });

test('the skin of a larger shape moves with it', async (t) => {
  const d = await daemon(t);
  const body = await uploaded(d, rigged().bytes, { name: 'body', repair: 'largest_component' });
  const { surface } = rigged();
  const large = { ...surface, positions: surface.positions.map(([x, y, z]) => [3 * x + 5, 3 * y - 1, 3 * z]) };
  const file = await uploaded(d, shapes.obj(large), { name: 'large' });
  const transfer = [{ from: 1, what: 'skin' }];
  const options = { asset: { ...asset, fit: 'similarity' }, transfer };
  const made = await d.made('/v1/supermeshes', { shapes: [file, body], ...options });
  assert.ok(Math.abs(made.shapes[1].fit.scale - 3) < 0.05, JSON.stringify(made.shapes[1].fit));
  const result = await assetOf(d, made);
  const [part] = result.all;
  const rest = posed(result, part);
  rest.forEach((p, v) => near(p, part.POSITION.slice(3 * v, 3 * v + 3), 1e-4, 'at rest'));
  const raised = posed(result, part, { 'joint 10': [0, 0.1, 0] });
  raised.forEach((p, v) => {
    let share = 0;
    for (let k = 4 * v; k < 4 * v + 4; k++) share += part.JOINTS_0[k] >= 10 ? part.WEIGHTS_0[k] : 0;
    const way = Math.hypot(...p.map((x, k) => x - rest[v][k]));
    assert.ok(Math.abs(way - 0.1 * made.shapes[1].fit.scale * share) < 1e-4, `${way} for ${share}`);
  });
});

test('the joints and their animations follow the base', async (t) => {
  const d = await daemon(t);
  const body = await uploaded(d, rigged().bytes, { name: 'body', repair: 'largest_component' });
  const { surface } = rigged();
  const large = { ...surface, positions: surface.positions.map(([x, y, z]) => [3 * x + 5, 3 * y - 1, 3 * z]) };
  const file = await uploaded(d, shapes.obj(large), { name: 'large' });
  const request = { shapes: [file, body], asset: { fit: 'none' }, transfer: [{ from: 1, what: 'skin' }] };
  const made = await d.made('/v1/supermeshes', request);
  const result = await assetOf(d, made);
  const [part] = result.all;
  posed(result, part).forEach((p, v) => near(p, part.POSITION.slice(3 * v, 3 * v + 3), 1e-4, 'at rest'));
  // The joints are as near to their places as the points of the map are to theirs.
  const slip = shown(part).map(([x, y, z], v) =>
    Math.hypot(...[3 * x + 5, 3 * y - 1, 3 * z].map((c, k) => c - part.POSITION[3 * v + k])),
  );
  assert.ok(Math.max(...slip) < 0.3, `the map is nearly that of the shapes: ${Math.max(...slip)}`);
  rests(result).forEach((p, j) => near(p, [5, (3 * HEIGHT * j) / (JOINTS - 1) - 1, 0], 0.3, `joint ${j}`));

  const { animations, nodes } = result.gltf;
  assert.deepEqual(
    animations.map(({ name }) => name),
    ['wave', 'morph'],
  );
  const [{ channels, samplers }] = animations;
  assert.deepEqual(
    channels.map(({ target }) => [nodes[target.node].name, target.path]),
    [['joint 9', 'rotation']],
    'the targets of the body are not taken, nor what moves them',
  );
  const sine = Math.fround(Math.sin(0.3));
  assert.deepEqual([...result.read(samplers[0].input)], [0, 0.5, 1]);
  assert.deepEqual([...result.read(samplers[0].output)].slice(0, 7), [0, 0, 0, 1, 0, 0, sine]);
});

test('the own skin and targets of the first shape, on a new mesh', async (t) => {
  const d = await daemon(t);
  const body = await uploaded(d, rigged().bytes, { name: 'body', repair: 'largest_component' });
  const egg = await uploaded(d, shapes.obj(shapes.egg(3)), { name: 'egg' });
  const request = { shapes: [body, egg], asset };
  const lacks = (made) => made.dropped.map((entry) => entry.what).filter((what) => /skins|targets/.test(what));
  assert.deepEqual(lacks(await d.made('/v1/supermeshes', request)), ['skins', 'targets']);
  const transfer = ['skin', 'targets'].map((what) => ({ from: 0, what }));
  const made = await d.made('/v1/supermeshes', { ...request, transfer });
  assert.deepEqual(lacks(made), []);
  const { why } = made.dropped.find(({ what }) => what === 'animations');
  assert.equal(why, 'Of the animations, the asset has those of its skeleton.', 'not those of its targets');
  const result = await assetOf(d, made);
  assert.deepEqual(result.gltf.meshes[0].extras.targetNames, ['egg', 'smile']);
  const joints = result.gltf.nodes.filter(({ name }) => /^joint/.test(name));
  joints.forEach((node, j) =>
    assert.deepEqual(node.translation, [0, j ? HEIGHT / (JOINTS - 1) : 0, 0], 'its own fits'),
  );
  assert.equal(result.all.length, 2, 'a part for each material');
  for (const part of result.all) {
    const places = Array.from({ length: part.POSITION.length / 3 }, (_, v) => part.POSITION.slice(3 * v, 3 * v + 3));
    assertWeights(part, places);
    posed(result, part).forEach((p, v) => near(p, places[v], 1e-5, 'at rest'));
    const { targets } = part.primitive;
    assert.deepEqual(Object.keys(targets[1]).sort(), Object.keys(targets[0]).sort(), 'the same attributes');
  }
  const targets = await d.made('/v1/supermeshes', { ...request, transfer: [{ from: 0, what: 'targets' }] });
  assert.ok(targets.profiles.quantized, 'targets alone leave the profiles');
  assert.equal((await d.get(`${targets.asset}?profile=meshopt`)).status, 200);
});

test('a kept document must have what an entry of the first shape names', async (t) => {
  const d = await daemon(t);
  const body = await uploaded(d, rigged().bytes, { name: 'body', repair: 'largest_component' });
  const egg = await uploaded(d, shapes.obj(shapes.egg(3)), { name: 'egg' });
  const plain = await uploaded(d, writeGlb(shapes.egg(3)), { name: 'plain' });
  const remesh = { method: 'template' };
  const transfer = ['skin', 'targets'].map((what) => ({ from: 0, what }));
  const made = await d.made('/v1/supermeshes', { shapes: [body, egg], remesh, asset, transfer });
  assert.deepEqual(made.transferred, [], 'the document has them');
  for (const one of transfer) {
    const { problem } = await d.make('/v1/supermeshes', { shapes: [plain, egg], remesh, asset, transfer: [one] });
    assert.match(problem.detail, /from shape 0, which has no/);
    assert.equal(problem.transfer, 0);
  }
});

test('targets of equal names get a number', async (t) => {
  const d = await daemon(t);
  const body = await uploaded(d, rigged().bytes, { name: 'body', repair: 'largest_component' });
  const egg = await uploaded(d, shapes.obj(shapes.egg(2)), { name: 'egg' });
  const named = async (list, remesh, from) => {
    const transfer = from.map((shape) => ({ from: shape, what: 'targets' }));
    const made = await d.made('/v1/supermeshes', { shapes: list, remesh, transfer, asset });
    const { gltf } = await assetOf(d, made);
    const { targetNames } = gltf.meshes.at(-1).extras;
    assert.deepEqual(
      made.transferred.map((one) => one.as),
      targetNames.slice(-from.length),
    );
    return targetNames;
  };
  const shape = (mesh, name) => ({ ...mesh, name });
  const twice = [shape(egg, 'egg'), shape(body, 'smile'), shape(body, 'other')];
  assert.deepEqual(await named(twice, { method: 'adaptive' }, [1, 2]), ['smile', 'other', 'smile (2)', 'smile (3)']);
  const kept = [shape(body, 'body'), shape(body, 'other')];
  assert.deepEqual(await named(kept, { method: 'template' }, [1]), ['smile', 'other', 'smile (2)']);

  // Names are cut between characters, and the report names a target as the asset does.
  for (const [name, cut] of [
    ['x'.repeat(127), 'x'.repeat(127)],
    ['é'.repeat(80), 'é'.repeat(63)],
  ]) {
    const bean = shapes.bean(2);
    const edit = (gltf) => {
      gltf.meshes[0].extras = { targetNames: [name] };
    };
    const bytes = writeGlb({ ...bean, moves: bean.positions.map(() => [0, 0.1, 0]), edit });
    const other = await uploaded(d, bytes, { name: 'bean' });
    const list = [shape(egg, 'egg'), shape(other, 'one'), shape(other, 'two')];
    const names = await named(list, { method: 'adaptive' }, [1, 2]);
    assert.deepEqual(names, ['one', 'two', cut, `${cut} (2)`]);
  }
});

test('a skin that cannot be taken is refused', async (t) => {
  const d = await daemon(t);
  const body = await uploaded(d, rigged().bytes, { name: 'body', repair: 'largest_component' });
  const egg = await uploaded(d, shapes.obj(shapes.egg(2)), { name: 'egg' });
  const refused = async (request, why, members) => {
    const { problem } = await d.make('/v1/supermeshes', { asset, ...request });
    const { type, shape, transfer, elements } = problem ?? {};
    assert.match(problem.detail, why);
    assert.deepEqual(
      { type, shape, transfer, elements },
      { type: '/problems/bad-option', elements: undefined, ...members },
    );
  };
  const skin = (from) => [{ from, what: 'skin' }];
  await refused({ shapes: [body, egg], transfer: skin(1) }, /shape 1, which has no skin/, { shape: 1, transfer: 0 });
  const missing = ['skin', 'targets'].map((what, from) => ({ from, what }));
  const none = { shape: 1, transfer: 1 };
  await refused({ shapes: [body, egg], transfer: missing }, /shape 1, which has no morph targets/, none);
  const remesh = { method: 'template' };
  const elements = [{ where: 'meshes[1]', name: 'Body' }];
  const own0 = { shape: 0, transfer: 0, elements };
  await refused({ shapes: [body, body], remesh, transfer: skin(1) }, /has a skin already/, own0);
  const own = await d.made('/v1/supermeshes', { shapes: [body, egg], remesh, transfer: skin(0), asset });
  assert.deepEqual(own.transferred, [], 'its document has it');
  assertProblem(await d.get(`${own.asset}?profile=meshopt`), 422, 'bad-option');
});

test('what a file has in a form that cannot be carried is refused by its part', async (t) => {
  const d = await daemon(t);
  const egg = await uploaded(d, shapes.obj(shapes.egg(2)), { name: 'egg' });
  const body = [{ where: 'meshes[1]', name: 'Body' }];
  const primitive = (gltf) => gltf.meshes[1].primitives[0];
  for (const [what, edit, why, elements] of [
    [
      'skin',
      (gltf) => {
        gltf.skins[0].name = 'bones';
        gltf.accessors[gltf.skins[0].inverseBindMatrices].count -= 1;
      },
      /inverse bind matrices/,
      [{ where: 'skins[0]', name: 'bones' }],
    ],
    [
      'skin',
      (gltf) => {
        primitive(gltf).attributes.WEIGHTS_0 = primitive(gltf).attributes.TEXCOORD_0;
      },
      /WEIGHTS_0 does not fit/,
      body,
    ],
    [
      'targets',
      (gltf) => {
        primitive(gltf).targets[0].POSITION = primitive(gltf).attributes.TEXCOORD_0;
      },
      /target of mesh 1 \("Body"\) does not fit/,
      body,
    ],
    [
      'color',
      (gltf) => {
        primitive(gltf).attributes.COLOR_0 = primitive(gltf).attributes.POSITION;
        primitive(gltf).attributes.COLOR_1 = primitive(gltf).attributes.TEXCOORD_0;
      },
      /COLOR_1 does not fit/,
      body,
    ],
  ]) {
    const other = await uploaded(d, rigged({ edit }).bytes, { name: 'body', repair: 'largest_component' });
    const request = { shapes: [egg, other], asset, transfer: [{ from: 1, what }] };
    const { problem } = await d.make('/v1/supermeshes', request);
    assert.match(problem?.detail, why);
    assert.equal(problem.type, '/problems/malformed-mesh');
    assert.deepEqual([problem.shape, problem.transfer, problem.elements], [1, 0, elements]);
  }
});

test('a skin for a document that has no room is refused before the work', async (t) => {
  const d = await daemon(t);
  const { bytes } = rigged();
  const body = await uploaded(d, bytes, { name: 'body', repair: 'largest_component' });
  const request = { shapes: [body, { ...body, name: 'other' }], remesh: { method: 'template' }, asset };
  const { problem } = await d.make('/v1/supermeshes', { ...request, transfer: [{ from: 1, what: 'skin' }] });
  assert.match(problem?.detail, /has a skin already/);
  assert.deepEqual([problem.shape, problem.transfer], [0, 0]);
  assert.deepEqual(problem.elements, [{ where: 'meshes[1]', name: 'Body' }]);
  assert.ok((await d.made('/v1/supermeshes', request)).timings_ms.align > 0, 'the alignment was not computed for it');
});

test('a skeleton that cannot be copied is refused before the work', async (t) => {
  const d = await daemon(t);
  const { bytes: wave } = rigged({
    edit: (gltf) => {
      const [{ samplers }] = gltf.animations;
      gltf.accessors[samplers[0].input].count -= 1;
    },
  });
  const egg = await uploaded(d, shapes.obj(shapes.egg(2)), { name: 'egg' });
  const body = await uploaded(d, wave, { name: 'body', repair: 'largest_component' });
  const request = { shapes: [egg, body], asset };
  const { problem } = await d.make('/v1/supermeshes', { ...request, transfer: [{ from: 1, what: 'skin' }] });
  assert.equal(problem?.type, '/problems/malformed-mesh');
  assert.deepEqual([problem.shape, problem.transfer], [1, 0]);
  assert.deepEqual(problem.elements, [{ where: 'animations[0]', name: 'wave' }]);
  assert.ok((await d.made('/v1/supermeshes', request)).timings_ms.align > 0, 'the alignment was not computed for it');
});
