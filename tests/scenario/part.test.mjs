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

/** The radius and the height of the surface without its features, at a share of the way down the ball. */
function profile(down, isBust) {
  const of = isBust ? OF_BUST : OF_HEAD;
  const angle = Math.min(1, down / of) * NECK;
  const [radius, height] = [Math.sin(angle), Math.cos(angle)]; // of the neck, if it is below the head
  if (down < of) return [radius, height];
  const below = (down - of) / (1 - of);
  if (!isBust) return [radius * (1 - below), height];
  const i = Math.min(3, Math.floor(4 * below));
  const from = i ? shoulders[i - 1] : [radius, height];
  return from.map((x, k) => x + (4 * below - i) * (shoulders[i][k] - x));
}

/** How many times as far from the middle of the head a direction lies because of its features. */
const feature = (p) =>
  features.reduce((sum, [to, by]) => sum + by * Math.exp((p.reduce((dot, x, k) => dot + x * to[k], 0) - 1) / 0.08), 1);

/** Moves a point of the unit ball onto a head, or onto a bust that has the same points above the neck. */
function shaped([x, y, z], isBust) {
  const down = Math.acos(Math.max(-1, Math.min(1, z))) / Math.PI;
  const [radius, height] = profile(down, isBust);
  const long = Math.hypot(x, y) || 1;
  const place = [(radius * x) / long, (radius * y) / long, height];
  if (down < (isBust ? OF_BUST : OF_HEAD) - 0.02) return place.map((c) => feature(place) * c);
  return height < Math.cos(NECK) ? [place[0], 1.4 * place[1], height] : place;
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
  assert.ok(sum / count < 0.15, `the upper half of the head is ${sum / count} of its radius away in the mean`);

  // Spread over the whole bust is another match, which can be sent for.
  const [whole] = made.alternatives;
  const reply = await d.post('/v1/supermeshes', whole.request, { headers: { prefer: 'wait=60' } });
  assert.equal(reply.status, 200, reply.bytes.toString());
  assert.equal(reply.json.match, undefined);
  const spread = morphOf((await d.get(reply.json.asset)).bytes);
  let lowest = Infinity;
  for (let v = 0; v < spread.count; v++) {
    const [onHead, onBust] = spread.shapes.map((shape) => shape[3 * v + 2]);
    if (onHead > 0) lowest = Math.min(lowest, onBust);
  }
  assert.ok(lowest < -1.2, 'the upper half of the head reaches below the neck of the bust');
});
