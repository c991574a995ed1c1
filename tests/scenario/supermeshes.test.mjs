// Supermeshes: one closed surface for all shapes, landmarks at their places, every variant of the request.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { daemon, samples, slow } from './support/daemon.mjs';
import { morphOf, topologyOf, vertexAt } from './support/glb.mjs';
import { apart, diagonalOf, placed } from './support/misplaced.mjs';
import * as shapes from './support/shapes.mjs';

const landmarksOf = async (file) => JSON.parse(await readFile(path.join(samples, file), 'utf8')).landmarks;
const sample = async (file) => shapes.parse(await readFile(path.join(samples, file), 'utf8'));

async function animals(d, ...files) {
  const meshes = [];
  for (const file of files) meshes.push(await d.mesh(path.join(samples, file)));
  return meshes.map((m) => ({ mesh: m.id, name: m.name }));
}

/** Asserts what holds for every supermesh with every method. */
async function check(d, supermesh, sources, landmarks) {
  assert.equal(supermesh.triangles, 2 * supermesh.vertices - 4);
  assert.equal(supermesh.certificate.closed, true);
  assert.equal(supermesh.certificate.genus, 0);
  assert.deepEqual(
    supermesh.certificate.flipped,
    sources.map(() => 0),
  );
  assert.deepEqual(
    supermesh.certificate.degree,
    sources.map(() => 1),
  );
  const asset = await d.get(supermesh.asset);
  assert.equal(asset.status, 200);
  const morph = morphOf(asset.bytes);
  assert.equal(morph.shapes.length, sources.length);
  const topology = topologyOf(morph);
  assert.equal(topology.closed, true, 'every edge has two triangles');
  assert.equal(topology.euler, 2);
  assert.equal(topology.vertices, supermesh.vertices);
  assert.equal(topology.triangles, supermesh.triangles);
  const used = new Set();
  for (const { name, at } of landmarks ?? []) {
    const vertex = vertexAt(
      morph,
      at.map((place, s) => sources[s].positions[place.vertex]),
    );
    assert.ok(vertex >= 0, `landmark ${name} is not a vertex of the supermesh`);
    used.add(topology.weld[vertex]);
  }
  assert.equal(used.size, landmarks?.length ?? 0);
  return morph;
}

test('two animals with landmarks, from requests to the asset', async (t) => {
  const d = await daemon(t);
  const pair = await animals(d, 'dog.obj', 'giraffe.off');
  const landmarks = await landmarksOf('dog-giraffe.json');
  const request = { shapes: pair, landmarks };
  const first = await d.make('/v1/supermeshes', request);
  assert.ok(first.resource, JSON.stringify(first.problem));
  assert.equal(first.status, 202);
  assert.equal(first.job.kind, 'supermesh');
  const supermesh = first.resource;
  const sources = [await sample('dog.obj'), await sample('giraffe.off')];
  const morph = await check(d, supermesh, sources, landmarks);
  assert.equal(supermesh.certificate.landmarks_exact, true);
  assert.deepEqual(
    supermesh.landmarks.map((l) => l.name),
    landmarks.map((l) => l.name),
  );
  for (const l of supermesh.landmarks) for (const r of l.residual_relative) assert.ok(r < 1e-6, `${l.name}: ${r}`);
  assert.deepEqual(
    supermesh.shapes.map((s) => [s.mesh, s.name]),
    pair.map((s) => [s.mesh, s.name]),
  );
  for (const s of supermesh.shapes) {
    assert.ok(s.hausdorff_relative < 0.005, `${s.name}: ${s.hausdorff_relative}`);
    assert.ok(s.rms_relative <= s.hausdorff_relative);
  }

  // The asset, compared with the contract.
  const { gltf, names } = morph;
  assert.deepEqual(names, ['giraffe']);
  assert.equal(gltf.asset.version, '2.0');
  assert.equal(gltf.nodes.filter((n) => n.mesh !== undefined).length, 1);
  assert.equal(gltf.animations.length, 1);
  assert.equal(gltf.animations[0].channels[0].target.path, 'weights');
  const weights = morph.read(gltf.animations[0].samplers[0].output);
  assert.ok(weights.includes(0) && weights.includes(1), 'each shape alone has a keyframe');

  // The same request again gets its answer at once. With other options the embeddings are known.
  const second = await d.make('/v1/supermeshes', request);
  assert.equal(second.status, 200);
  assert.deepEqual(second.resource, supermesh);
  assert.deepEqual((await d.get(supermesh.url)).json, supermesh);
  assert.equal(Object.values((await d.get('/v1/embeddings')).json).find(Array.isArray).length, 2);
  // Several nodes answer in turn, each with its own results.
  const embedded = async () => {
    let count = 0;
    for (let i = 0; i < Number(process.env.ORB_NODES ?? 1); i++)
      count += Number(
        /^orbmorph_job_seconds_count\{kind="embedding"\} (\d+)$/m.exec((await d.get('/metrics')).bytes.toString())[1],
      );
    return count;
  };
  assert.equal(await embedded(), 2);
  const other = await d.made('/v1/supermeshes', { ...request, asset: { animation: 'none', normals: false } });
  assert.notEqual(other.id, supermesh.id);
  assert.equal(await embedded(), 2, 'none was made again');
  const plain = morphOf((await d.get(other.asset)).bytes);
  assert.equal(plain.gltf.animations, undefined);
  assert.equal(plain.gltf.meshes[0].primitives[0].attributes.NORMAL, undefined);
  const swapped = await d.made('/v1/supermeshes', {
    shapes: [...pair].reverse(),
    landmarks: landmarks.map((l) => ({ ...l, at: [...l.at].reverse() })),
  });
  assert.notEqual(swapped.id, supermesh.id, 'the order of shapes belongs to the identity');
});

/** The limbs of the standing dog. */
const LIMBS = {
  head: (x, y) => x > 0.8 && y > 1,
  tail: (x, y) => x < -0.8 && y > 0.6,
  'left front limb': (x, y, z) => x > 0 && y < 0.4 && z < 0,
  'right front limb': (x, y, z) => x > 0 && y < 0.4 && z > 0,
  'left hind limb': (x, y, z) => x < 0 && y < 0.4 && z < 0,
  'right hind limb': (x, y, z) => x < 0 && y < 0.4 && z > 0,
};

// How far a place may slide along shape s, relative to its diagonal: as far as a part reaches that a warning names as stretched, or 1 %.
function slides({ warnings = [] }, s, at, diagonal) {
  const spots = warnings
    .filter(({ kind }) => kind === 'stretched')
    .flatMap(({ parts }) => parts.map((part) => part.at.find(({ shape }) => shape === s)));
  const around = spots.filter(({ centre, radius }) => apart(centre, at) <= radius);
  return Math.max(0.01, ...around.map(({ radius }) => radius / diagonal));
}

test('correspondence without landmarks', async (t) => {
  const d = await daemon(t);
  const pair = await animals(d, 'dog.obj', 'elephant.ply');
  const sources = [await sample('dog.obj'), await sample('elephant.ply')];
  const absent = await d.make('/v1/supermeshes', { shapes: pair });
  assert.ok(absent.resource, JSON.stringify(absent.problem));
  await check(d, absent.resource, sources);
  const found = absent.resource.landmarks;
  assert.equal(found.length, 12);
  const words = new Set();
  found.forEach((l, i) => {
    if (!LIMBS[l.name]) assert.equal(l.name, `auto ${i + 1}`);
    else {
      // the dog looks along x and stands along y, so its left is −z
      const [x, y, z] = placed(sources[0], l.at[0]);
      assert.ok(LIMBS[l.name](x, y, z), `${l.name} at ${x}, ${y}, ${z}`);
      words.add(l.name);
    }
    assert.equal(l.at.length, 2);
    assert.ok(l.confidence >= 0 && l.confidence <= 1, `${l.name}: ${l.confidence}`);
    for (const [s, place] of l.at.entries()) {
      assert.ok(place.triangle < sources[s].triangles.reduce((sum, face) => sum + face.length - 2, 0));
      assert.ok(Math.abs(place.barycentric.reduce((a, b) => a + b) - 1) < 1e-9);
      // Within the tolerance of the surface, but the omitted parts let the place slide along it.
      const most = slides(absent.resource, s, placed(sources[s], place), diagonalOf(sources[s]));
      assert.ok(l.residual_relative[s] < most, `${l.name}: ${l.residual_relative}`);
    }
  });
  assert.ok(words.size >= 4, `limbs have words: ${[...words]}`);
  if (!slow) {
    const exact = await d.made('/v1/supermeshes', { shapes: pair, remesh: { method: 'overlay' } });
    assert.deepEqual(
      exact.landmarks.map(({ at }) => at),
      found.map(({ at }) => at),
      'the alignment does not hang on the remeshing',
    );
    for (const l of exact.landmarks)
      for (const residual of l.residual_relative) assert.ok(residual < 1e-6, `${l.name}: ${l.residual_relative}`);
  }
  const again = await d.make('/v1/supermeshes', {
    shapes: pair,
    landmarks: found.map(({ name, at }) => ({ name, at })),
  });
  assert.ok(again.resource, JSON.stringify(again.problem));
  assert.equal(again.resource.certificate.landmarks_exact, true);
  const named = await d.make('/v1/supermeshes', { shapes: pair, landmarks: 'auto' });
  assert.ok(named.resource, JSON.stringify(named.problem));
});

test('places of landmarks can be points and triangles', async (t) => {
  const d = await daemon(t);
  const sources = [shapes.egg(3), shapes.bean(3)];
  const pair = [];
  for (const m of sources) pair.push({ mesh: (await d.upload(shapes.obj(m))).json.id });
  const at = (axis) => sources.map((m) => m.points.findIndex((p) => Math.abs(p[axis] - 1) < 1e-12));
  const landmarks = [0, 1, 2].map((axis) => ({ name: 'xyz'[axis], at: at(axis).map((vertex) => ({ vertex })) }));
  const vertices = await d.made('/v1/supermeshes', { shapes: pair, landmarks });
  await check(d, vertices, sources, landmarks);
  const asPoints = landmarks.map((l) => ({
    name: l.name,
    at: l.at.map(({ vertex }, s) => ({ point: sources[s].positions[vertex] })),
  }));
  await check(d, await d.made('/v1/supermeshes', { shapes: pair, landmarks: asPoints }), sources, landmarks);
  const inside = landmarks.map((l, i) => ({
    name: l.name,
    at: l.at.map(() => ({ triangle: 40 * i + 7, barycentric: [0.25, 0.25, 0.5] })),
  }));
  const supermesh = await d.made('/v1/supermeshes', { shapes: pair, landmarks: inside });
  const morph = await check(d, supermesh, sources);
  for (const l of inside) {
    const places = l.at.map(({ triangle, barycentric }, s) => {
      const corners = sources[s].triangles[triangle].map((v) => sources[s].positions[v]);
      return [0, 1, 2].map((k) => corners.reduce((sum, c, i) => sum + barycentric[i] * c[k], 0));
    });
    assert.ok(vertexAt(morph, places) >= 0, `landmark ${l.name}`);
  }
});

test('more than two shapes', { skip: slow }, async (t) => {
  const d = await daemon(t);
  const three = await animals(d, 'dog.obj', 'giraffe.off', 'elephant.ply');
  const landmarks = await landmarksOf('dog-giraffe-elephant.json');
  const sources = [await sample('dog.obj'), await sample('giraffe.off'), await sample('elephant.ply')];
  const result = await d.make('/v1/supermeshes', { shapes: three, landmarks });
  assert.ok(result.resource, JSON.stringify(result.problem));
  const morph = await check(d, result.resource, sources, landmarks);
  assert.deepEqual(morph.names, ['giraffe', 'elephant']);
});

test('methods of alignment and of remeshing', async (t) => {
  const d = await daemon(t);
  const sources = [shapes.egg(3), shapes.bean(3)];
  const pair = [];
  for (const m of sources) pair.push({ mesh: (await d.upload(shapes.obj(m))).json.id });
  const corner = (x, y, z) =>
    sources.map((m) => {
      const size = Math.hypot(x, y, z);
      const far = m.points.map((p) => Math.hypot(p[0] - x / size, p[1] - y / size, p[2] - z / size));
      return { vertex: far.indexOf(Math.min(...far)) };
    });
  const landmarks = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [-1, -1, 0.2],
  ].map((c, i) => ({ name: `l${i}`, at: corner(...c) }));
  const built = [];
  for (const method of ['pin', 'rotate', 'rbf']) {
    const result = await d.make('/v1/supermeshes', { shapes: pair, landmarks, align: { method } });
    if (result.resource) {
      built.push(method);
      await check(d, result.resource, sources, method === 'pin' ? landmarks : undefined);
    } else {
      assert.equal(result.problem.status, 422, `${method}: ${JSON.stringify(result.problem)}`);
    }
  }
  for (const method of ['adaptive', 'overlay', 'subdivision', 'convex-hull', 'template']) {
    const result = await d.make('/v1/supermeshes', { shapes: pair, landmarks, remesh: { method } });
    if (result.resource) {
      built.push(method);
      await check(d, result.resource, sources, landmarks);
    } else {
      // A request for something that is not built is refused at once, and no job is created.
      assert.equal(result.status, 422, `${method}: ${JSON.stringify(result)}`);
      assert.equal(result.problem.type, '/problems/unsupported-method');
      assert.equal(result.problem.method, method);
    }
  }
  assert.deepEqual(built, ['pin', 'rotate', 'rbf', 'adaptive', 'overlay', 'subdivision', 'convex-hull', 'template']);
});

test('tolerance and a triangle budget', async (t) => {
  const d = await daemon(t);
  const pair = [];
  for (const m of [shapes.egg(4), shapes.bean(4)]) pair.push({ mesh: (await d.upload(shapes.obj(m))).json.id });
  const build = async (remesh) =>
    d.make('/v1/supermeshes', { shapes: pair, remesh: { method: 'adaptive', ...remesh } });
  const fine = await build({ tolerance: 0.0005 });
  if (!fine.resource) {
    assert.equal(fine.problem.status, 422);
    return t.skip('adaptive is not built');
  }
  const coarse = (await build({ tolerance: 0.01 })).resource;
  assert.ok(coarse.triangles < fine.resource.triangles);
  for (const s of fine.resource.shapes) assert.ok(s.hausdorff_relative <= 0.0005 * 1.0001, `${s.hausdorff_relative}`);
  const budget = (await build({ tolerance: 0.0001, max_triangles: 600 })).resource;
  assert.ok(budget.triangles <= 600, `${budget.triangles}`);
  assert.ok(budget.shapes[0].hausdorff_relative > 0.0001, 'the error is stated');
});

test('bad landmarks and bad requests are refused with what is wrong', async (t) => {
  const d = await daemon(t);
  const pair = [];
  for (const m of [shapes.egg(2), shapes.bean(2)]) pair.push({ mesh: (await d.upload(shapes.obj(m))).json.id });
  const good = [
    { name: 'a', at: [{ vertex: 0 }, { vertex: 0 }] },
    { name: 'b', at: [{ vertex: 1 }, { vertex: 1 }] },
  ];
  const refused = async (request, statuses, type) => {
    const result = await d.make('/v1/supermeshes', { shapes: pair, ...request });
    assert.ok(result.problem, `accepted: ${JSON.stringify(request)}`);
    assert.ok(
      statuses.includes(result.problem.status),
      `${JSON.stringify(request)}: ${JSON.stringify(result.problem)}`,
    );
    if (type) assert.equal(result.problem.type, `/problems/${type}`, JSON.stringify(result.problem));
    return result.problem;
  };
  await refused(
    { landmarks: [...good, { name: 'far', at: [{ vertex: 2 }, { vertex: 1e6 }] }] },
    [422],
    'bad-landmarks',
  );
  await refused(
    { landmarks: [...good, { name: 'twice', at: [{ vertex: 0 }, { vertex: 5 }] }] },
    [422],
    'bad-landmarks',
  );
  await refused({ landmarks: [{ name: 'short', at: [{ vertex: 0 }] }] }, [400, 422]);
  await refused({ landmarks: [{ at: [{ vertex: -1 }, { vertex: 0 }] }] }, [400, 422]);
  await refused({ landmarks: [{ at: [{ triangle: 0, barycentric: [2, -1, 0] }, { vertex: 0 }] }] }, [400, 422]);
  await refused({ align: { method: 'pin' } }, [422], 'bad-landmarks');
  await refused({ align: { method: 'rbf' } }, [422], 'bad-landmarks');
  await refused({ shapes: [pair[0]] }, [400, 422]);
  await refused({ shapes: [] }, [400, 422]);
  await refused({ shapes: [...Array(17)].map(() => pair[0]) }, [400, 413, 422]);
  await refused({ remesh: { method: 'origami' } }, [400, 422]);
  await refused({ remesh: { tolerance: -1 } }, [400, 422]);
  await refused({ remesh: { max_triangles: 1.5 } }, [400, 422]);
  await refused({ asset: { fit: 'tight' } }, [400, 422]);
  assert.match((await refused({ colour: 'red' }, [400, 422])).detail, /colour/);
  assert.match((await refused({ remesh: { sharpness: 2 } }, [400, 422])).detail, /sharpness/);
  await refused({ shapes: [pair[0], { mesh: 'f'.repeat(64) }] }, [404, 422]);
});

test('files in other units, axes and places are moved onto the first shape by default, and the answer says how', async (t) => {
  const d = await daemon(t);
  const bean = shapes.bean(2);
  const landmarks = [0, 1, 2, 4].map((vertex) => ({ at: [{ vertex }, { vertex }] }));
  const merged = async (change, asset) => {
    const meshes = [bean, { ...bean, positions: bean.positions.map(change) }].map((shape) =>
      Buffer.from(shapes.obj(shape)),
    );
    const list = [];
    for (const bytes of meshes) list.push({ mesh: (await d.upload(bytes)).json.id });
    const made = await d.made('/v1/supermeshes', { shapes: list, landmarks, remesh: { method: 'overlay' }, asset });
    return { made, morph: morphOf((await d.get(made.asset)).bytes) };
  };
  // An overlay has every vertex of both shapes, so their boxes are exact.
  const box = (flat) =>
    [0, 1, 2].flatMap((k) => {
      const line = flat.filter((_, i) => i % 3 === k);
      return [Math.min(...line), Math.max(...line)];
    });
  const apart = ({ shapes: [a, b] }) => {
    const other = box(b);
    return Math.max(...box(a).map((x, i) => Math.abs(x - other[i])));
  };
  const same = await merged(([x, y, z]) => [1.2 * x, 1.2 * y, 1.2 * z]);
  assert.deepEqual(
    same.made.shapes.map((shape) => shape.fit.kind),
    ['none', 'none'],
  );
  assert.ok(apart(same.morph) > 0.15);
  assert.equal(same.made.request.asset.fit, 'auto');
  // Centimetres with z up, instead of metres with y up.
  const other = ([x, y, z]) => [100 * x, -100 * z, 100 * y];
  const moved = await merged(other);
  const { kind, scale, rotation_degrees, up_degrees } = moved.made.shapes[1].fit;
  assert.equal(kind, 'similarity');
  for (const [value, wanted] of [
    [scale, 0.01],
    [rotation_degrees, 90],
    [up_degrees, 90],
  ])
    assert.ok(Math.abs(value - wanted) < 1e-6 * wanted, `${value} ${wanted}`);
  assert.ok(apart(moved.morph) < 1e-5);
  assert.ok(apart((await merged(other, { fit: 'none' })).morph) > 50);
  const away = await merged(([x, y, z]) => [x + 20, y, z]);
  assert.ok(away.made.shapes[1].fit.translation_relative > 5 && apart(away.morph) < 1e-5);
});
