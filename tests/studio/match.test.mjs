// A match that was found without landmarks: what the studio says about it, and the other matches.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { figure, obj } from '../scenario/support/shapes.mjs';
import { browser, daemon } from './started.mjs';
import { landmarks, morph, shownId } from './steps.mjs';
import { countPixels } from './pictures.mjs';
import { addFiles, button, json, openPage, sample, settled, until } from './support.mjs';

const said = (page) => page.getByRole('status', { name: 'How sure the match is' });
const says = (page, pattern, what) => until(async () => pattern.test(await said(page).innerText()), what);
const shown = (page) => page.url().match(/r=([0-9a-f]{64})/)?.[1];

/** A sample with its bytes, so that it can be added beside a file that is made here. */
const bytesOf = (name) => ({ name, mimeType: 'application/octet-stream', buffer: readFileSync(sample(name)) });

/** A figure with arms and legs of one length, which looks alike from the front and from behind. */
const doll = { name: 'doll.obj', mimeType: 'text/plain', buffer: Buffer.from(obj(figure([1, 1, 1, 0], 0.9))) };

/** The doubt of an animal and the doll: the words name a limb on each. */
const limb = '(head|tail|(?:left|right) (?:front|hind) limb)';
const named = new RegExp(
  `^Not sure: (left and right may be swapped: )?the ${limb} of elephant may be the ${limb} of doll\\. Look at it`,
);

/**
 * Waits for that doubt. The two limbs that it names are landmarks that were found. Where it says that left and right may
 * be swapped, they lie on opposite sides, and only there Flip is offered.
 */
async function doubtsLimbs(page, { landmarks: found }) {
  await says(page, named, 'the doubt in words');
  const [, swapped, a, b] = (await said(page).innerText()).match(named);
  for (const doubted of [a, b])
    assert.ok(
      found.some(({ name }) => name === doubted),
      `${doubted} is a landmark that was found`,
    );
  assert.notEqual(a, b);
  assert.equal(await button(page, 'Flip').count(), swapped ? 1 : 0);
  if (swapped) assert.deepEqual([a, b].map((name) => name.match(/left|right/)?.[0]).sort(), ['left', 'right']);
}

/** Morphs the shapes, and returns the result's resource. */
async function morphed(page) {
  await morph(page);
  return json(daemon.url, `/v1/supermeshes/${await shownId(page)}`);
}

/**
 * The id of the morph of a request. A job that takes longer than one wait answers with its own id, which is half as
 * long.
 */
async function idOf(request) {
  const headers = { 'content-type': 'application/json', prefer: 'wait=60' };
  for (;;) {
    const { id, state, problem } = await json(daemon.url, '/v1/supermeshes', {
      method: 'POST',
      headers,
      body: JSON.stringify(request),
    });
    assert.ok(id && state !== 'failed', JSON.stringify(problem));
    if (/^[0-9a-f]{64}$/.test(id)) return id;
  }
}

/** Checks the alternatives of every result: up to four, the best first, each for one later shape, with its request. */
function checkAlternatives({ alternatives, request }) {
  assert.ok(alternatives.length > 0 && alternatives.length <= 4, `${alternatives.length} alternatives`);
  const costs = alternatives.map(({ cost }) => cost);
  assert.ok(costs[0] >= 1, `the first one costs ${costs[0]}`);
  assert.deepEqual(
    costs,
    [...costs].sort((a, b) => a - b),
    'the best first',
  );
  for (const { shape, request: other } of alternatives) {
    assert.ok(Number.isInteger(shape) && shape > 0 && shape < request.shapes.length, `shape ${shape}`);
    assert.deepEqual(other.shapes, request.shapes, 'it is of the same shapes');
    assert.ok(other.landmarks.length <= 12, `${other.landmarks.length} landmarks`);
    for (const { at } of other.landmarks) assert.equal(at.length, request.shapes.length, 'a place on each shape');
  }
}

test('three shapes: verdict, doubt, heat map, and the matches one after another, also after a reload', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, bytesOf('elephant.ply'), bytesOf('dog.obj'), doll);
  const first = await morphed(page);
  assert.equal(first.match.verdict, 'unsure');
  checkAlternatives(first);
  assert.equal(first.alternatives[0].shape, 2, 'the doll is the one in doubt');
  await doubtsLimbs(page, first);
  await button(page, 'Heat map').click();
  await until(async () => (await page.getByText(/^99 % of it below/).count()) === 3, 'three are measured');
  await settled(page);
  for (const i of [0, 1, 2]) {
    const pane = `.pane:nth-child(${i + 1}) .pane-view`;
    const blue = await countPixels(page, pane, (r, g, b) => b > r + 15 && b > g && r < 70);
    const red = await countPixels(page, pane, (r, g, b) => r > 120 && r > 2 * g && r > 1.5 * b);
    assert.ok(blue > 500 && red > 20, `shape ${i}: ${blue} blue, ${red} red`);
  }
  const ids = [first.id];
  for (const { request } of first.alternatives) ids.push(await idOf(request));
  assert.equal(new Set(ids).size, ids.length, 'each match is another morph');
  for (let i = 1; i < ids.length; i++) {
    await button(page, 'Next match').click();
    await says(page, new RegExp(`^Match ${i + 1} of ${ids.length}; the first one was the best\\.$`), `match ${i + 1}`);
    await until(() => shown(page) === ids[i], 'its morph');
    if (i > 1) continue;
    await page.reload();
    await says(page, new RegExp(`^Match 2 of ${ids.length}; the first one was the best\\.$`), 'also after a reload');
    assert.equal(shown(page), ids[1]);
  }
  await button(page, 'Next match').click();
  await says(page, /^Not sure: /, 'the first match, and its doubt');
  await until(() => shown(page) === ids[0] && !/[#&]q=/.test(page.url()), 'its morph');
  await done();
});

test('Flip swaps left and right and back, also after a reload', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const bodies = [figure([0.8, 1, 0.5, 0.5]), figure([1, 0.9, 0.6, 0.45], 0.7), figure([0.6, 1.2, 0.4, 0.5])];
  const files = bodies.map((body, i) => ({
    name: `figure${i}.obj`,
    mimeType: 'text/plain',
    buffer: Buffer.from(obj(body)),
  }));
  await addFiles(page, ...files);
  const first = await morphed(page);
  const [other] = first.alternatives;
  // what it maps from the left (x < 0) of the first figure is on the right of the other one, and vice versa
  const across = ({ point, vertex, triangle, barycentric }, { positions, triangles }) => {
    if (point) return point[0];
    if (vertex !== undefined) return positions[vertex][0];
    return triangles[triangle].reduce((sum, v, k) => sum + barycentric[k] * positions[v][0], 0);
  };
  const sides = other.request.landmarks
    .map(({ at }) => [across(at[0], bodies[0]), across(at[other.shape], bodies[other.shape])])
    .filter((pair) => pair.every((x) => Math.abs(x) > 0.3));
  assert.ok(sides.length >= 4 && sides.every(([a, b]) => a * b < 0), JSON.stringify(sides));
  const flipped = await idOf(other.request);
  await button(page, 'Flip').click();
  await until(() => shown(page) === flipped, 'the flipped match');
  await says(page, new RegExp(`^Match 2 of ${1 + first.alternatives.length};`), 'it is the second');
  await page.reload();
  await button(page, 'Flip').click();
  await until(() => shown(page) === first.id, 'the first match again');
  await says(page, /^The match is sure\.$/, 'it is sure');
  // a link that names the job of another match: the page shows that match when the job is done
  const headers = { 'content-type': 'application/json', prefer: 'respond-async' };
  const body = JSON.stringify({ ...other.request, remesh: { ...other.request.remesh, tolerance: 0.0023 } });
  const { id: job } = await json(daemon.url, '/v1/supermeshes', { method: 'POST', headers, body });
  await until(() => !/[#&]q=/.test(page.url()), 'the URL follows');
  const hash = `${new URL(page.url()).hash}&j=${job}&q=${first.id},0,1`;
  const second = await openPage(browser, daemon.url, { hash });
  await says(second.page, new RegExp(`^Match 2 of ${1 + first.alternatives.length};`), 'the second, when it is done');
  await second.done();
  await done();
});

test('an unsure match is labelled, and the next match gives another morph', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, bytesOf('elephant.ply'), doll);
  const first = await morphed(page);
  assert.equal(first.match.verdict, 'unsure');
  await doubtsLimbs(page, first);
  assert.doesNotMatch(await page.locator('.report').first().textContent(), /exact/, 'no landmarks were given');
  const id = await idOf(first.alternatives[0].request);
  await button(page, 'Next match').click();
  await until(() => shown(page) === id, 'the first alternative is shown');
  await says(page, /^Match 2 of /, 'it is called the second');
  assert.doesNotMatch(await page.locator('.report').first().textContent(), /exact/, 'its landmarks were found');
  for (let i = 0; i < first.alternatives.length; i++) {
    await button(page, 'Next match').click();
    await until(async () => !(await button(page, 'Next match').isDisabled()), 'the next one is shown');
  }
  await until(() => shown(page) === first.id, 'after the last comes the first');
  // there and back again; the requests that led to it are listed
  await button(page, 'Next match').click();
  await until(() => shown(page) === id, 'the other match');
  await button(page, 'Landmarks').click();
  const pairs = first.alternatives[0].request.landmarks.length;
  await until(async () => (await landmarks(page).count()) === pairs, 'its landmarks');
  await button(page, 'Morph', { exact: true }).click();
  for (let i = 0; i < first.alternatives.length; i++) {
    await until(async () => !(await button(page, 'Next match').isDisabled()), 'the next one is there');
    await button(page, 'Next match').click();
  }
  await until(() => shown(page) === first.id, 'the first one again');
  // the heat map: blue where the surface keeps its size, red where it is stretched badly
  await button(page, 'Heat map').click();
  await until(() => page.getByText(/^99 % of it below/).count(), 'it is measured');
  await settled(page);
  assert.equal(await page.locator('.pane').count(), 2);
  assert.ok((await countPixels(page, '.stage-area', (r, g, b) => b > r + 15 && b > g && r < 70)) > 5000, 'blue');
  assert.ok((await countPixels(page, '.pane-view', (r, g, b) => r > 120 && r > 2 * g && r > 1.5 * b)) > 100, 'red');
  // the found landmark is in the list, and counts as given once it is corrected
  await button(page, 'Landmarks').click();
  await until(async () => (await landmarks(page).count()) === first.landmarks.length, 'the found landmarks');
  const hint = page.locator('.action .hint');
  assert.match(await hint.innerText(), /matched without landmarks/);
  await until(() => /tab=landmarks/.test(page.url()), 'the URL names the view');
  await page.reload();
  await until(async () => (await landmarks(page).count()) === first.landmarks.length, 'they are back');
  assert.match(await hint.innerText(), /matched without landmarks/);
  const name = page.getByRole('textbox', { name: 'Name of landmark 1', exact: true });
  await name.fill('tail');
  await name.press('Tab');
  await until(
    async () => (await hint.innerText()) === `${first.landmarks.length} landmarks will meet exactly.`,
    'given',
  );
  // what only corrects a match begins where that match ended
  const second = await morphed(page);
  assert.equal(second.request.align.start, first.alignment);
  assert.equal(second.start_followed, true);
  await done();
});
