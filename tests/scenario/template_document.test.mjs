// The remesh method "template" if the first shape was glTF: the asset is that document with targets.
import assert from 'node:assert/strict';
import test from 'node:test';
import { rigged } from '../samples/rigged.mjs';
import { assertProblem, daemon } from './support/daemon.mjs';
import { farthest } from './support/distance.mjs';
import { parseGlb } from './support/glb.mjs';
import { writeGlb, writeGltf } from './support/glb_write.mjs';
import * as shapes from './support/shapes.mjs';

const options = { remesh: { method: 'template' }, asset: { fit: 'none' }, landmarks: 'auto' };

const binaryOf = (glb) => glb.subarray(28 + glb.readUInt32LE(12));
const jsonOf = (glb) => JSON.parse(glb.toString('utf8', 20, 20 + glb.readUInt32LE(12)));

async function merge(d, file, query, others, more = {}) {
  const reply = await d.upload(file, query);
  assert.equal(reply.status, 201, JSON.stringify(reply.json));
  const meshes = [{ mesh: reply.json.id }];
  for (const [i, other] of others.entries())
    meshes.push({ mesh: (await d.upload(shapes.obj(other), { name: `other ${i}` })).json.id });
  return { shapes: meshes, ...options, ...more };
}

/** Asserts that `after` has everything in `before`, except for what targets change. */
function assertMembers(before, after, where = '') {
  if (before === null || typeof before !== 'object') assert.equal(after, before, where);
  else
    for (const [key, value] of Object.entries(before)) {
      if (!/\/(weights|targetNames|byteLength|output)$/.test(`${where}/${key}`) || /bufferViews/.test(where))
        assertMembers(value, after?.[key], `${where}/${key}`);
    }
}

test('a rigged character stays, and gets two shape keys', async (t) => {
  const d = await daemon(t);
  const { bytes, surface } = rigged();
  const made = await d.made(
    '/v1/supermeshes',
    await merge(d, bytes, { name: 'body', repair: 'largest_component' }, [shapes.bean(3), shapes.egg(3)]),
  );
  assert.deepEqual(made.dropped, []);
  assert.equal(made.profiles, undefined);
  const asset = (await d.get(made.asset)).bytes;
  const before = jsonOf(bytes);
  const { gltf, read } = parseGlb(asset);
  assertMembers(before, gltf);
  assert.deepEqual(gltf.extensions, before.extensions);
  assert.equal(gltf.nodes.length, before.nodes.length);
  const old = binaryOf(bytes);
  assert.ok(binaryOf(asset).subarray(0, old.length).equals(old), 'the bytes of the upload stay');

  const body = gltf.meshes[1];
  assert.deepEqual(body.extras, { author: 'someone', targetNames: ['smile', 'other 0', 'other 1'], firstShape: 1 });
  assert.deepEqual(body.weights, [0.25, 0, 0]);
  assert.equal(gltf.meshes[0].primitives[0].targets, undefined, 'the eye is not on the surface');
  const moved = [[], []];
  for (const [p, primitive] of body.primitives.entries()) {
    assert.deepEqual(primitive.attributes, before.meshes[1].primitives[p].attributes);
    assert.equal(primitive.targets.length, 3);
    assert.deepEqual(primitive.targets[0], before.meshes[1].primitives[p].targets[0]);
    const [base, normal, tangent] = ['POSITION', 'NORMAL', 'TANGENT'].map((name) => read(primitive.attributes[name]));
    for (const k of [1, 2]) {
      const [move, turn, bend] = ['POSITION', 'NORMAL', 'TANGENT'].map((name) => read(primitive.targets[k][name]));
      base.forEach(
        (x, i) => i % 3 === 0 && moved[k - 1].push([x + move[i], base[i + 1] + move[i + 1], base[i + 2] + move[i + 2]]),
      );
      for (let v = 0; v < base.length / 3; v++) {
        const n = [0, 1, 2].map((c) => normal[3 * v + c] + turn[3 * v + c]);
        const tan = [0, 1, 2].map((c) => tangent[4 * v + c] + bend[3 * v + c]);
        assert.ok(Math.abs(Math.hypot(...n) - 1) < 1e-5 && Math.abs(Math.hypot(...tan) - 1) < 1e-5);
        const across = Math.abs(n[0] * tan[0] + n[1] * tan[1] + n[2] * tan[2]);
        const was = Math.abs([0, 1, 2].reduce((sum, c) => sum + normal[3 * v + c] * tangent[4 * v + c], 0));
        assert.ok(Math.abs(across - was) < 1e-5, 'both turn alike');
      }
    }
  }
  assert.equal(moved[0].length, surface.positions.length);
  for (const [k, other] of [shapes.bean(3), shapes.egg(3)].entries()) {
    const used = [...new Set(surface.triangles.flat())];
    assert.equal(used.length, surface.positions.length - 2, 'one vertex of each pole has no triangle');
    const shown = used.map((v) => moved[k][v]);
    const off = farthest(shown, other.positions.flat(), other.triangles.flat());
    assert.ok(off < 3e-6, `target ${k}: ${off}`);
    const at = new Map();
    used.forEach((v) => {
      const p = surface.positions[v];
      const key = p.map((x) => x + 0).join();
      assert.deepEqual(moved[k][at.get(key) ?? v], moved[k][v], 'what lies at one place moves alike');
      at.set(key, v);
    });
    assert.ok(at.size < used.length);
  }

  const [wave, morph] = gltf.animations;
  assert.deepEqual([...read(wave.samplers[1].output)], [0, 0, 0, 0.75, 0, 0, 0.25, 0, 0]);
  assert.equal(wave.samplers[0].output, before.animations[0].samplers[0].output);
  assert.equal(morph.name, 'morph');
  const keys = [...read(morph.samplers[0].output)];
  assert.equal(keys.length, 3 * read(morph.samplers[0].input).length);
  assert.deepEqual(keys.slice(0, 3), [0.25, 0, 0]);
  assert.ok([1, 2].every((k) => keys.some((x, i) => i % 3 === k && x === 1)));

  for (const profile of ['quantized', 'meshopt'])
    assertProblem(await d.get(`${made.asset}?profile=${profile}`), 422, 'bad-option');
  const places = (await d.get(`${made.url}/places`)).bytes;
  const tail = places.indexOf('GLBVERTS');
  assert.equal(places.readUInt32LE(tail + 8), surface.positions.length + 4, 'the eye counts');
  assert.equal(places.readInt32LE(tail + 12), -1);
});

/** A node that scales, rotates and mirrors, under a parent that moves and scales. */
const placed = (gltf) => {
  gltf.nodes = [
    { children: [1], scale: [0.01, 0.01, 0.01], translation: [0, 3, 0] },
    { mesh: 0, scale: [-200, 100, 50], rotation: [Math.SQRT1_2, 0, 0, Math.SQRT1_2] },
  ];
};
const inScene = ([x, y, z]) => [-2 * x, -0.5 * z + 3, y];

for (const [kind, write] of [
  ['GLB', writeGlb],
  ['glTF', writeGltf],
])
  test(`${kind}: targets are in the coordinates of the mesh`, async (t) => {
    const d = await daemon(t);
    const egg = shapes.egg(3);
    const normals = egg.positions.map((p) => p.map((x) => x / Math.hypot(...p)));
    const file = write({ ...egg, normals, edit: placed });
    const bean = shapes.bean(3);
    bean.positions = bean.positions.map(([x, y, z]) => [2 * x, y + 3, z]);
    const request = await merge(d, file, { name: 'egg' }, [bean], { asset: { fit: 'none', animation: 'none' } });
    const made = await d.made('/v1/supermeshes', request);
    const { gltf, read } = parseGlb((await d.get(made.asset)).bytes);
    assert.equal(gltf.animations, undefined);
    assert.equal(gltf.buffers.length, 1);
    assert.equal(gltf.buffers[0].uri, undefined);
    const [primitive] = gltf.meshes[0].primitives;
    const base = read(primitive.attributes.POSITION);
    assert.deepEqual([...base], egg.positions.flat().map(Math.fround));
    const move = read(primitive.targets[0].POSITION);
    const points = egg.positions.map((_, v) => inScene([0, 1, 2].map((k) => base[3 * v + k] + move[3 * v + k])));
    const off = farthest(points, bean.positions.flat(), bean.triangles.flat());
    assert.ok(off < 5e-6, `${off}`);
    const normal = read(primitive.attributes.NORMAL);
    const turn = read(primitive.targets[0].NORMAL);
    let inward = 0;
    for (let v = 0; v < points.length; v++) {
      const n = [0, 1, 2].map((k) => normal[3 * v + k] + turn[3 * v + k]);
      assert.ok(Math.abs(Math.hypot(...n) - 1) < 1e-5);
      const out = [-n[0] / 2, -n[2] / 0.5, n[1]]; // normals transform by the inverse transpose
      const p = points[v];
      inward += out[0] * p[0] + out[1] * (p[1] - 3) + out[2] * p[2] <= 0;
    }
    assert.ok(inward < points.length / 20, `${inward} normals face inwards`);
  });

test('whole numbers of extras and foreign extensions keep all digits', async (t) => {
  const d = await daemon(t);
  const ids = ['12345678901234567', '-9223372036854775807', '18446744073709551615', '9007199254740993'];
  const bytes = writeGlb({
    ...shapes.egg(2),
    edit: (gltf) => {
      gltf.extras = { tags: '[-1,"id0"]', list: ['ID0', 0.1, 7], one: 'ID1' };
      gltf.nodes[0].extras = 'ID2';
      gltf.extensions = { ACME_ids: { deep: [{ of: 'ID3' }] } };
      gltf.extensionsUsed = ['ACME_ids'];
    },
  });
  const json = bytes.toString('latin1', 20, 20 + bytes.readUInt32LE(12));
  const numbers = json.replace(/"ID(\d)"/g, (_, k) => ids[k]).trimEnd();
  assert.ok(ids.every((id) => numbers.includes(id)));
  const binary = binaryOf(bytes).toString('base64'); // a glTF, which has no lengths to correct
  const text = numbers.replace(/"buffers":\[\{/, `"buffers":[{"uri":"data:application/octet-stream;base64,${binary}",`);
  const made = await d.made('/v1/supermeshes', await merge(d, Buffer.from(text), { name: 'egg' }, [shapes.bean(2)]));
  const asset = (await d.get(made.asset)).bytes;
  const after = asset.toString('utf8', 20, 20 + asset.readUInt32LE(12));
  assert.deepEqual(JSON.parse(after).extras, JSON.parse(numbers).extras);
  for (const part of [
    `"list":[${ids[0]},0.1,7],"one":${ids[1]}`,
    `"extras":${ids[2]}`,
    `"ACME_ids":{"deep":[{"of":${ids[3]}}]}`,
  ])
    assert.ok(after.includes(part), part);
});

test('a mesh that the scene shows twice is refused', async (t) => {
  const d = await daemon(t);
  const twice = (gltf) => {
    gltf.scenes[0].nodes = [2];
    gltf.meshes[0].name = 'egg';
    gltf.nodes = [{ name: 'one', mesh: 0 }, { mesh: 0, translation: [5, 0, 0] }, { children: [0, 1] }];
  };
  const file = writeGlb({ ...shapes.egg(2), edit: twice });
  const request = await merge(d, file, { name: 'eggs', repair: 'largest_component' }, [shapes.bean(2)]);
  const { problem } = await d.make('/v1/supermeshes', request);
  assert.match(problem.detail, /shows mesh 0 \("egg"\) 2 times/);
  assert.match(problem.detail, /mesh of its own/);
  assert.equal(problem.shape, 0);
  assert.equal(problem.element_count, 3);
  assert.deepEqual(problem.elements, [
    { where: 'meshes[0]', name: 'egg' },
    { where: 'nodes[0]', name: 'one' },
    { where: 'nodes[1]' },
  ]);
  const { timings_ms } = await d.made('/v1/supermeshes', { ...request, remesh: { method: 'adaptive' } });
  assert.ok(timings_ms.align > 0, 'the refusal came before the alignment, which would be kept');
});

const grown = (by, { positions, ...rest }) => ({ ...rest, positions: positions.map((p) => p.map((x) => by * x)) });

test('an upload whose vertices do not fit is refused by its mesh', async (t) => {
  const d = await daemon(t);
  const edit = (gltf) => {
    gltf.meshes[0].name = 'egg';
    gltf.accessors[gltf.meshes[0].primitives[0].attributes.TEXCOORD_0].count -= 1;
  };
  const egg = shapes.egg(2);
  const { status, json } = await d.upload(writeGlb({ ...egg, uv: egg.positions.map(([x, y]) => [x, y]), edit }));
  assert.equal(status, 400);
  assert.match(json.detail, /TEXCOORD_0 does not fit its POSITION/);
  assert.deepEqual(json.elements, [{ where: 'meshes[0]', name: 'egg' }]);
});

test('a document that cannot get targets is refused by the parts at fault', async (t) => {
  const d = await daemon(t);
  const refused = async (egg, edit, detail, elements, type = '/problems/bad-option') => {
    const request = await merge(d, writeGlb({ ...egg, edit }), { name: 'egg' }, [grown(10, shapes.bean(2))]);
    const { problem } = await d.make('/v1/supermeshes', request);
    assert.equal(problem?.type, type);
    assert.match(problem.detail, detail);
    assert.deepEqual([problem.shape, problem.elements], [0, elements]);
  };
  const tiny = (gltf) => {
    gltf.meshes[0].name = 'dust';
    gltf.nodes = [{ name: 'shrink', mesh: 0, scale: [1e-38, 1e-38, 1e-38] }];
  };
  await refused(
    grown(1e38, shapes.egg(2)),
    tiny,
    /A target is too large for float32 in the coordinates of mesh 0 \("dust"\); give its node another scale/,
    [
      { where: 'meshes[0]', name: 'dust' },
      { where: 'nodes[0]', name: 'shrink' },
    ],
  );
  const misfit = (gltf, push) => {
    const numbers = (list) =>
      gltf.accessors.push({
        bufferView: push(Buffer.from(Float32Array.from(list).buffer)),
        componentType: 5126,
        count: list.length,
        type: 'SCALAR',
      }) - 1;
    const moves = push(Buffer.alloc(12 * gltf.accessors[0].count));
    const { count } = gltf.accessors[0];
    const target = {
      POSITION: gltf.accessors.push({ bufferView: moves, componentType: 5126, count, type: 'VEC3' }) - 1,
    };
    gltf.meshes[0].primitives[0].targets = [target, target];
    const sampler = { input: numbers([0, 1]), output: numbers([0, 1, 0]) };
    gltf.nodes = [{ mesh: 0 }];
    gltf.animations = [
      { name: 'idle', channels: [], samplers: [] },
      { name: 'talk', channels: [{ sampler: 0, target: { node: 0, path: 'weights' } }], samplers: [sampler] },
    ];
  };
  await refused(
    shapes.egg(2),
    misfit,
    /animation of weights does not fit/,
    [{ where: 'animations[1]', name: 'talk' }],
    '/problems/malformed-mesh',
  );
  const late = (gltf, push) => {
    misfit(gltf, push);
    gltf.accessors.at(-1).count = 2; // a value for each target, but of one of two keyframes
  };
  await refused(
    shapes.egg(2),
    late,
    /animation of weights does not fit/,
    [{ where: 'animations[1]', name: 'talk' }],
    '/problems/malformed-mesh',
  );
  const other = (change) => (gltf, push) => {
    misfit(gltf, push);
    gltf.animations = undefined;
    change(gltf, gltf.meshes[0].primitives[0].targets[0].POSITION);
  };
  for (const [change, detail] of [
    [(gltf, at) => gltf.accessors[at].count--, /A morph target of mesh 0 has another number of vertices/],
    [(gltf) => gltf.meshes[0].primitives[0].targets.splice(1, 1, { POSITION: 99 }), /missing accessor \(99\)/],
  ])
    await refused(
      shapes.egg(2),
      other(change),
      detail,
      [{ where: 'meshes[0]' }, { where: 'nodes[0]' }],
      '/problems/malformed-mesh',
    );
  const short = (gltf, push) => {
    misfit(gltf, push);
    gltf.meshes[0].name = 'face';
    gltf.animations = undefined;
    const [primitive] = gltf.meshes[0].primitives;
    primitive.targets = [primitive.targets[0]];
    gltf.meshes[0].primitives.push({ ...primitive, targets: [], mode: 0 });
  };
  await refused(
    shapes.egg(2),
    short,
    /different numbers of morph targets/,
    [{ where: 'meshes[0]', name: 'face' }, { where: 'nodes[0]' }],
    '/problems/malformed-mesh',
  );
});

test('a request names the meshes or nodes that are the surface', async (t) => {
  const d = await daemon(t);
  const { bytes } = rigged();
  const request = await merge(d, bytes, { name: 'body', repair: 'largest_component' }, [shapes.bean(2)]);
  const plain = await d.made('/v1/supermeshes', request);
  const assetOf = async (made) => (await d.get(made.asset)).bytes;
  for (const template of [{ nodes: ['body'] }, { meshes: [1] }, { meshes: [1], nodes: ['body'] }]) {
    const named = await d.made('/v1/supermeshes', { ...request, template });
    assert.notEqual(named.id, plain.id);
    assert.deepEqual(named.request.template, { meshes: [], nodes: [], ...template });
    assert.ok((await assetOf(named)).equals(await assetOf(plain)), JSON.stringify(template));
  }
  const eye = [{ where: 'meshes[0]', name: 'eye' }];
  for (const [template, why, elements] of [
    [{ meshes: [0, 1] }, /names mesh 0 \("eye"\), but the closed surface has no vertex of it/, eye],
    [{ nodes: ['left eye'] }, /names mesh 0 \("eye"\)/, [...eye, { where: 'meshes[1]', name: 'Body' }]],
    [
      { nodes: ['nobody'] },
      /the node "nobody", which the document of the first shape does not have/,
      [{ where: 'nodes', name: 'nobody' }],
    ],
    [{ meshes: [2] }, /names mesh 2, but the document of the first shape has 2 meshes/, [{ where: 'meshes[2]' }]],
  ]) {
    const { problem } = await d.make('/v1/supermeshes', { ...request, template });
    assert.equal(problem?.type, '/problems/bad-option');
    assert.match(problem.detail, why);
    assert.deepEqual(problem.elements, elements);
  }
  for (const template of ['body', { meshes: 1 }, { meshes: [-1] }, { meshes: [0.5] }, { nodes: [''] }])
    assertProblem(await d.post('/v1/supermeshes', { ...request, template }), 422, 'invalid-request');
  const obj = { ...request, shapes: [...request.shapes].reverse(), template: { meshes: [0], nodes: ['body'] } };
  const { problem } = await d.make('/v1/supermeshes', obj);
  assert.match(problem.detail, /the first shape is not glTF/);
  const listed = [{ where: 'meshes[0]' }, { where: 'nodes', name: 'body' }];
  assert.deepEqual([problem.shape, problem.elements], [0, listed]);
  const other = (await d.make('/v1/supermeshes', { ...obj, remesh: { method: 'overlay' } })).problem;
  assert.match(other.detail, /that the method 'overlay' does not keep; omit that member, or use the method 'template'/);
  assert.deepEqual([other.type, other.elements], ['/problems/bad-option', listed]);
});

test('a limit below the triangles of the template is refused', async (t) => {
  const d = await daemon(t);
  const egg = shapes.egg(2);
  const request = await merge(d, writeGlb(egg), { name: 'egg' }, [shapes.bean(2)]);
  const count = egg.triangles.length;
  for (const [method, most, why] of [
    ['template', count - 1, new RegExp(`keeps the ${count} triangles of the first shape, more than max_triangles`)],
    ['overlay', count, /'overlay' makes \d+ triangles here, more than max_triangles/],
    ['subdivision', 8, /'subdivision' makes \d+ triangles here, more than max_triangles/],
  ]) {
    const { problem } = await d.make('/v1/supermeshes', { ...request, remesh: { method, max_triangles: most } });
    assert.equal(problem?.type, '/problems/bad-option', method);
    assert.match(problem.detail, why);
  }
  const made = await d.made('/v1/supermeshes', { ...request, remesh: { method: 'template', max_triangles: count } });
  assert.equal(made.triangles, count);
});

test('the surface has a mesh that the request does not name', async (t) => {
  const d = await daemon(t);
  const egg = shapes.egg(2);
  const halves = (gltf) => {
    const [primitive] = gltf.meshes[0].primitives;
    const { count, bufferView, ...rest } = gltf.accessors[primitive.indices];
    const third = Math.floor(count / 6) * 3;
    gltf.accessors.push({ ...rest, bufferView, count: count - third, byteOffset: 2 * third });
    gltf.accessors[primitive.indices] = { ...rest, bufferView, count: third };
    gltf.meshes.push({ name: 'upper', primitives: [{ ...primitive, indices: gltf.accessors.length - 1 }] });
    gltf.nodes = [{ mesh: 0 }, { name: 'hat', mesh: 1 }];
    gltf.scenes = [{ nodes: [0, 1] }];
  };
  const request = await merge(d, writeGlb({ ...egg, edit: halves }), { name: 'egg' }, [shapes.bean(2)]);
  const { problem } = await d.make('/v1/supermeshes', { ...request, template: { meshes: [0] } });
  assert.match(problem.detail, /has vertices of mesh 1 \("upper"\), which "template" does not name/);
  const made = await d.made('/v1/supermeshes', { ...request, template: { meshes: [0], nodes: ['hat'] } });
  const { gltf } = parseGlb((await d.get(made.asset)).bytes);
  assert.deepEqual(
    gltf.meshes.map((m) => m.primitives[0].targets.length),
    [1, 1],
  );
});
