// Without landmarks the answer says how sure the match is, and lists other matches as requests that can be sent.
import assert from 'node:assert/strict';
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { folder, run } from './support/cli.mjs';
import { daemon, samples } from './support/daemon.mjs';
import { morphOf } from './support/glb.mjs';
import { ball, egg, figure, obj } from './support/shapes.mjs';

// A ball with three unlike knobs.
const knobs = [
  [[1, 0, 0], 1.6],
  [[-0.6, 0.8, 0], 1.2],
  [[0, -0.8, 0.6], 0.9],
];
const knobbed = (levels, by) =>
  ball(levels, (p) => {
    const r = knobs.reduce(
      (sum, [q, far]) => sum + by * far * Math.exp(-15 * (1 - p.reduce((s, x, k) => s + x * q[k], 0))),
      1,
    );
    return p.map((x) => r * x);
  });

async function upload(d, ...bodies) {
  const replies = [];
  for (const body of bodies) replies.push(await d.upload(obj(body)));
  return replies.map((reply, i) => ({ mesh: reply.json.id, name: `body ${i}` }));
}

const along = (triangle, weights, positions) =>
  [0, 1, 2].map((k) => triangle.reduce((sum, v, i) => sum + weights[i] * positions[v][k], 0));
const place = ({ triangle, barycentric }, { triangles, positions }) =>
  along(triangles[triangle], barycentric, positions);

/**
 * The distance between a place on the first shape and a place on the second in the morph, from the vertex next to the
 * first.
 */
async function gap(d, supermesh, from, to) {
  const { shapes, count } = morphOf((await d.get(supermesh.asset)).bytes);
  const at = (s, v) => shapes[s].slice(3 * v, 3 * v + 3);
  const apart = (p, q) => Math.hypot(...p.map((x, k) => x - q[k]));
  let best = 0;
  for (let v = 1; v < count; v++) if (apart(at(0, v), from) < apart(at(0, best), from)) best = v;
  return apart(at(1, best), to);
}

test('the request of an alternative is answered, with another map', async (t) => {
  const d = await daemon(t);
  const bodies = [knobbed(3, 1), knobbed(3, 0.8)];
  const shapes = await upload(d, ...bodies);
  const remesh = { method: 'adaptive', tolerance: 0.02 };
  const asset = { fit: 'none', animation: 'none' };
  const first = await d.made('/v1/supermeshes', { shapes, remesh, asset });
  const { match, alternatives } = first;
  assert.ok(match.confidence >= 0 && match.confidence <= 1);
  assert.equal(match.verdict, match.confidence >= 0.8 ? 'sure' : match.confidence >= 0.5 ? 'likely' : 'unsure');
  assert.ok(alternatives.length >= 1 && alternatives.length <= 4, `${alternatives.length}`);
  let before = 1;
  for (const { cost, shape, request } of alternatives) {
    assert.ok(cost >= before && shape === 1);
    before = cost;
    // the same request, but for the landmarks and the method that meets them
    const { landmarks, align, ...others } = request;
    const { landmarks: none, align: auto, ...asked } = first.request;
    assert.deepEqual(others, asked);
    assert.deepEqual([none, auto.method, align.method], ['auto', 'auto', 'pin']);
    assert.ok(landmarks.length >= 3);
    for (const l of landmarks)
      assert.ok(Math.abs(l.confidence - Math.min(0.99, 1 / cost)) < 1e-9, `${l.confidence} ${cost}`);
  }
  const reply = await d.post('/v1/supermeshes', alternatives[0].request, { headers: { prefer: 'wait=60' } });
  assert.equal(reply.status, 200, reply.bytes.toString());
  const other = reply.json;
  assert.notEqual(other.id, first.id);
  assert.equal(other.match, undefined);
  assert.deepEqual(other.alternatives, []);
  // The landmarks are met; the first map maps one of them elsewhere.
  assert.equal(other.landmarks.length, alternatives[0].request.landmarks.length);
  for (const l of other.landmarks) for (const r of l.residual_relative) assert.ok(r < 1e-6, `${l.name}: ${r}`);
  // A kept alignment has the same verdict and alternatives.
  const kept = await d.made('/v1/supermeshes', { shapes, remesh: { ...remesh, tolerance: 0.03 }, asset });
  assert.equal(kept.timings_ms.align, 0);
  assert.deepEqual([kept.match, kept.alternatives.map((a) => a.cost)], [match, alternatives.map((a) => a.cost)]);
  const places = alternatives[0].request.landmarks.map(({ at }) => at.map((p, s) => place(p, bodies[s])));
  let most = 0;
  for (const [from, to] of places) {
    assert.ok((await gap(d, other, from, to)) < 0.05);
    most = Math.max(most, await gap(d, first, from, to));
  }
  assert.ok(most > 0.5, `${most}`);
});

test('of three shapes, an alternative matches one otherwise and leaves the others', async (t) => {
  const d = await daemon(t);
  const bodies = [knobbed(3, 1), knobbed(3, 0.8), knobbed(3, 0.9)];
  const shapes = await upload(d, ...bodies);
  const remesh = { method: 'adaptive', tolerance: 0.001 };
  const asset = { fit: 'none', animation: 'none' };
  const first = await d.made('/v1/supermeshes', { shapes, remesh, asset });
  assert.ok(first.match.confidence >= 0);
  const { alternatives } = first;
  assert.ok(alternatives.length >= 1 && alternatives.length <= 4, `${alternatives.length}`);
  alternatives.forEach(({ cost }, i) => assert.ok(cost >= (i ? alternatives[i - 1].cost : 1)));
  const [{ shape, request }] = alternatives;
  assert.ok(shape === 1 || shape === 2);
  for (const { at } of request.landmarks) assert.equal(at.length, 3);
  const reply = await d.post('/v1/supermeshes', request, { headers: { prefer: 'wait=60' } });
  assert.equal(reply.status, 200, reply.bytes.toString());
  for (const l of reply.json.landmarks) for (const r of l.residual_relative) assert.ok(r < 1e-6, `${l.name}: ${r}`);
  // The first map maps the places of the other shapes nearly to each other, and some places of the one shape elsewhere.
  const { shapes: found, count } = morphOf((await d.get(first.asset)).bytes);
  const at = (s, v) => found[s].slice(3 * v, 3 * v + 3);
  const apart = (p, q) => Math.hypot(...p.map((x, k) => x - q[k]));
  const most = [0, 0, 0];
  for (const { at: places } of request.landmarks) {
    const points = places.map((p, s) => place(p, bodies[s]));
    let best = 0;
    for (let v = 1; v < count; v++) if (apart(at(0, v), points[0]) < apart(at(0, best), points[0])) best = v;
    points.forEach((p, s) => (most[s] = Math.max(most[s], apart(at(s, best), p))));
  }
  assert.ok(most[shape] > 0.5 && most[3 - shape] < 0.3, `${shape}: ${most}`);
  // A kept alignment has the same alternatives.
  const kept = await d.made('/v1/supermeshes', { shapes, remesh: { ...remesh, tolerance: 0.02 }, asset });
  assert.equal(kept.timings_ms.align, 0);
  assert.deepEqual(
    kept.alternatives.map((a) => [a.shape, a.cost, a.request.landmarks]),
    alternatives.map((a) => [a.shape, a.cost, a.request.landmarks]),
  );
});

test('rotations alone have neither verdict nor alternatives', async (t) => {
  const d = await daemon(t);
  const shapes = await upload(d, knobbed(2, 1), egg(2));
  const align = { method: 'auto', options: { preset: 'fast' } };
  const fast = await d.made('/v1/supermeshes', { shapes, remesh: { method: 'adaptive', tolerance: 0.05 }, align });
  assert.equal(fast.match, undefined);
  assert.deepEqual(fast.alternatives, []);
});

test('the client says where a match is not sure, and calls only given landmarks exact', async (t) => {
  const d = await daemon(t);
  const env = { ORBMORPH_SERVER: d.url };
  const at = await folder(t);
  const [out, md, marks] = ['morph.glb', 'report.md', 'landmarks.json'].map((name) => path.join(at, name));
  const doll = path.join(at, 'doll.obj');
  await writeFile(doll, obj(figure([1, 1, 1, 0], 0.9))); // it looks alike from the front and from behind
  const morph = async (...args) => {
    const files = [path.join(samples, 'elephant.ply'), doll];
    const done = await run(['morph', ...files, '-o', out, '--report', md, '-t', '0.01', ...args], { env });
    assert.equal(done.code, 0, done.err);
    return done.out + (await readFile(md, 'utf8'));
  };
  const said = await morph();
  assert.match(said, /match: unsure \(confidence 0\.[0-4]\d\)/);
  const doubt =
    /Not sure: the shapes may be matched wrongly, such as a left (\w+ )?limb with a right one \(confidence/g;
  assert.equal(said.match(doubt)?.length, 2, `printed and in the report, by the found parts: ${said}`);
  assert.doesNotMatch(said, /exact/);
  const [{ id }] = (await d.get('/v1/supermeshes')).json.supermeshes;
  const { alternatives } = (await d.get(`/v1/supermeshes/${id}`)).json;
  const requests = alternatives.length === 1 ? 'the request' : `one of the ${alternatives.length} requests`;
  assert.ok(said.includes(`or send ${requests} in \`alternatives\` (Next match in the studio).`), said);
  await writeFile(marks, JSON.stringify(alternatives[0].request.landmarks));
  const guessed = await morph('--landmarks', marks);
  assert.match(guessed, /landmarks, from a found match/);
  assert.match(guessed, /The landmarks coincide\. They come from a match that orbmorph found\./);
  assert.doesNotMatch(guessed, /exact|Not sure/);
});

test('the doubt about a match names no limbs where none were found', async (t) => {
  const d = await daemon(t);
  const at = await folder(t);
  // a cube looks alike from all sides; turned, the frames of the files tell nothing either
  const cube = (levels) => ball(levels, (p) => p.map((x) => x / Math.max(...p.map(Math.abs))));
  const turned = ([x, y, z]) => [0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y, z];
  const other = cube(4);
  const files = ['one.obj', 'other.obj'].map((name) => path.join(at, name));
  await writeFile(files[0], obj(cube(3)));
  await writeFile(files[1], obj({ ...other, positions: other.positions.map(turned) }));
  const args = ['morph', ...files, '-o', path.join(at, 'x.glb'), '-t', '0.02'];
  const { code, out, err } = await run(args, { env: { ORBMORPH_SERVER: d.url } });
  assert.equal(code, 0, err);
  assert.match(out, /Not sure: the shapes may be matched wrongly \(confidence .*; another match is nearly as good/);
  assert.doesNotMatch(out, /left|right/);
  assert.doesNotMatch(out, /map is bad/, 'the map is good, though the confidence of every landmark is low');
});
