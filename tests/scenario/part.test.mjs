// Without landmarks a head goes to the head of a bust, and the answer says that it is a part of it.
import assert from 'node:assert/strict';
import test from 'node:test';
import { daemon } from './support/daemon.mjs';
import { morphOf } from './support/glb.mjs';
import { ball, obj } from './support/shapes.mjs';

const NECK = 0.85 * Math.PI; // the angle from the top of the head at which the neck begins
const [OF_HEAD, OF_BUST] = [0.9, 0.45]; // where that is on the way from the top of each ball to its bottom
const shoulders = [
  [0.9, -1.5],
  [1.7, -1.9],
  [2, -3.2],
  [0, -3.3],
]; // radius and height, down to the sole

// A nose, two ears and a bun: direction and length.
const features = [
  [[1, 0, 0], 0.9],
  [[0, 0.98, 0.2], 0.5],
  [[0, -0.98, 0.2], 0.5],
  [[-0.8, 0, 0.6], 0.6],
];

const unit = (radius, height, [x, y]) => {
  const long = Math.hypot(x, y) || 1;
  return [(radius * x) / long, (radius * y) / long, height];
};

/** Moves a point of the unit ball onto a head, or onto a bust that has the same points above the neck. */
function shaped(point, isBust) {
  const down = Math.acos(Math.max(-1, Math.min(1, point[2]))) / Math.PI;
  const of = isBust ? OF_BUST : OF_HEAD;
  const neck = [Math.sin(NECK), Math.cos(NECK)];
  if (down < of - 0.02) {
    const angle = (down / of) * NECK;
    const q = unit(Math.sin(angle), Math.cos(angle), point);
    const out = features.reduce(
      (sum, [to, by]) => sum + by * Math.exp((q.reduce((dot, x, k) => dot + x * to[k], 0) - 1) / 0.08),
      1,
    );
    return q.map((x) => out * x);
  }
  if (down < of) return unit(Math.sin((down / of) * NECK), Math.cos((down / of) * NECK), point);
  const below = (down - of) / (1 - of);
  if (!isBust) return unit(neck[0] * (1 - below), neck[1], point);
  const i = Math.min(3, Math.floor(4 * below));
  const [from, to] = [i ? shoulders[i - 1] : neck, shoulders[i]];
  const [radius, height] = from.map((x, k) => x + (4 * below - i) * (to[k] - x));
  const [x, y, z] = unit(radius, height, point);
  return [x, height < neck[1] ? 1.4 * y : y, z];
}

test('a head goes to the head of a bust, and the answer says that it is a part', async (t) => {
  const d = await daemon(t);
  const [head, bust] = [ball(4, (p) => shaped(p, false)), ball(5, (p) => shaped(p, true))];
  const shapes = [];
  for (const body of [head, bust]) shapes.push({ mesh: (await d.upload(obj(body))).json.id });
  const asset = { fit: 'none', animation: 'none' };
  const made = await d.made('/v1/supermeshes', { shapes, asset, remesh: { method: 'adaptive', tolerance: 0.01 } });
  assert.equal(made.match.part, true);
  assert.ok(made.match.confidence < 0.8, 'parts are not said to be sure');

  const morph = morphOf((await d.get(made.asset)).bytes);
  let [sum, count] = [0, 0];
  for (let v = 0; v < morph.count; v++) {
    const [p, q] = morph.shapes.map((shape) => shape.slice(3 * v, 3 * v + 3));
    if (p[2] < 0) continue; // below, the map stretches towards neck, shoulders and chest
    sum += Math.hypot(...p.map((x, k) => x - q[k]));
    count++;
  }
  assert.ok(count > 30);
  assert.ok(sum / count < 0.15, `the places of the head are ${sum / count} of its radius away in the mean`);

  // Spread over the whole bust is another match, which can be sent for.
  const [whole] = made.alternatives;
  const reply = await d.post('/v1/supermeshes', whole.request, { headers: { prefer: 'wait=60' } });
  assert.equal(reply.status, 200, reply.bytes.toString());
  assert.equal(reply.json.match, undefined);
  const spread = morphOf((await d.get(reply.json.asset)).bytes);
  const lowest = (min, at) => {
    let least = Infinity;
    for (let v = 0; v < spread.count; v++)
      if (spread.shapes[0][3 * v + 2] > min) least = Math.min(least, spread.shapes[1][3 * v + at]);
    return least;
  };
  assert.ok(lowest(0, 2) < -1.2, 'the upper half of the head reaches below the neck of the bust');
});
