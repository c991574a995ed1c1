// Landmarks: set by hand, dragged, mirrored, and found.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { readOff, vertexBeside } from '../scenario/support/misplaced.mjs';
import { ball, obj } from '../scenario/support/shapes.mjs';
import { browser, daemon } from './started.mjs';
import { landmarks, morph, startOccupied } from './steps.mjs';
import { countPixels } from './pictures.mjs';
import {
  addFiles,
  button,
  clickView,
  counted,
  json,
  openPage,
  sample,
  settled,
  shownToasts,
  until,
} from './support.mjs';

/** Three landmarks, each on both shapes, at positions where both have a surface. */
async function pickThree(page) {
  await button(page, 'Landmarks').click();
  for (const [n, [x, y]] of [
    [0.5, 0.5],
    [0.4, 0.5],
    [0.45, 0.56],
  ].entries()) {
    await clickView(page, 0, x, y);
    await counted(landmarks(page), n + 1, `landmark ${n + 1} on the first shape`);
    await clickView(page, 1, x, y);
    await counted(page.locator('.badge.warn'), 0, `landmark ${n + 1} on the second shape`);
  }
}

test('upload, pick, name, undo, redo, export, import', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  assert.ok((await countPixels(page, '.stage-area', (r, _g, b) => r > b + 40)) > 2000, 'the first shape is drawn');
  await pickThree(page);
  assert.equal(await page.locator('.marker:not(.still)').count(), 6);

  await page.getByRole('textbox', { name: 'Name of landmark 2' }).fill('hip');
  await page.getByRole('textbox', { name: 'Name of landmark 2' }).press('Tab');
  await button(page, 'Undo').click();
  assert.equal(await page.getByRole('textbox', { name: 'Name of landmark 2' }).inputValue(), '');
  await button(page, 'Redo').click();
  assert.equal(await page.getByRole('textbox', { name: 'Name of landmark 2' }).inputValue(), 'hip');
  await button(page, 'Delete landmark 3').click();
  assert.equal(await landmarks(page).count(), 2);
  await page.keyboard.press('Control+z');
  assert.equal(await landmarks(page).count(), 3);

  const [download] = await Promise.all([page.waitForEvent('download'), button(page, 'Export').click()]);
  const exported = JSON.parse(await readFile(await download.path(), 'utf8'));
  assert.equal(exported.landmarks.length, 3);
  assert.equal(exported.landmarks[1].name, 'hip');
  for (const landmark of exported.landmarks) {
    assert.equal(landmark.at.length, 2);
    for (const place of landmark.at) assert.ok(Number.isInteger(place.vertex) || place.point.length === 3);
  }

  await button(page, 'Clear').click();
  assert.equal(await landmarks(page).count(), 0);
  await page
    .getByLabel('Landmark file')
    .setInputFiles({ name: 'l.json', mimeType: 'application/json', buffer: Buffer.from(JSON.stringify(exported)) });
  await counted(landmarks(page), 3, 'the landmarks are back');
  const [again] = await Promise.all([page.waitForEvent('download'), button(page, 'Export').click()]);
  assert.deepEqual(JSON.parse(await readFile(await again.path(), 'utf8')), exported);

  // a soft landmark of a file stays soft, also after a reload
  exported.landmarks[1].weight = 0.3;
  await page
    .getByLabel('Landmark file')
    .setInputFiles({ name: 's.json', mimeType: 'application/json', buffer: Buffer.from(JSON.stringify(exported)) });
  const hint = page.locator('.action .hint');
  const says = '2 landmarks will meet exactly, 1 soft one will be drawn together.';
  await until(async () => (await hint.innerText()) === says, 'it is called soft');
  await until(() => /[#&]l=[^&]*(\*|%2A)0\.3/.test(page.url()), 'the URL has its weight');
  await page.reload();
  await until(async () => (await hint.innerText()) === says, 'it is soft again');
  const [soft] = await Promise.all([page.waitForEvent('download'), button(page, 'Export').click()]);
  const weights = JSON.parse(await readFile(await soft.path(), 'utf8')).landmarks.map(({ weight }) => weight);
  assert.deepEqual(weights, [undefined, 0.3, undefined]);

  // a file that cannot be used says why, and changes nothing
  const imports = async (name, content) => {
    const before = (await shownToasts(page)).length;
    const file = { name, mimeType: 'application/json', buffer: Buffer.from(JSON.stringify(content)) };
    await page.getByLabel('Landmark file').setInputFiles(file);
    return until(async () => (await shownToasts(page))[before], 'an answer');
  };
  assert.equal(await imports('none.json', []), 'none.json has no landmarks.');
  assert.match(
    await imports('three.json', [[1, 2, 3]]),
    /^three\.json has landmarks for 3 shapes, and only 2 are here/,
  );
  assert.match(await imports('far.json', [[1e6, 1e6]]), /^No landmark of far\.json fits these shapes/);
  assert.equal(await landmarks(page).count(), 3);
  // pairs of vertices, as the command line takes them
  assert.equal(await imports('pair.json', [[1, 2]]), '1 landmark imported.');
  await imports('pairs.json', [
    [1, 2],
    [300, 400],
    [1, 700],
  ]);
  assert.equal(await landmarks(page).count(), 3);
  await button(page, /^Morph 2 shapes$/).click();
  const alert = page.getByRole('alert');
  await alert.waitFor();
  assert.match(await alert.innerText(), /Landmarks 1 and 3 are at one place on dog/);
  await done();
});

test('a landmark is dragged to another place', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  await button(page, 'Landmarks').click();
  await clickView(page, 0, 0.5, 0.5);
  const marker = page.locator('.marker:not(.still)').first();
  await marker.waitFor();
  await settled(page);
  const from = await marker.boundingBox();
  const center = { x: from.x + from.width / 2, y: from.y + from.height / 2 };
  await page.mouse.move(center.x, center.y);
  await page.mouse.down();
  await page.mouse.move(center.x - 60, center.y + 4, { steps: 4 });
  await page.mouse.up();
  await until(async () => {
    const to = await marker.boundingBox();
    return Math.abs(to.x + to.width / 2 - (center.x - 60)) < 14;
  }, 'the marker is at its new place');
  // off the shape, it stays on the surface
  const middle = async () => {
    await settled(page);
    const { x, y, width, height } = await marker.boundingBox();
    return { x: x + width / 2, y: y + height / 2 };
  };
  const pane = await page.locator('.pane-view').first().boundingBox();
  let at = await middle();
  await page.mouse.move(at.x, at.y);
  await page.mouse.down();
  await page.mouse.move(at.x, pane.y + 20, { steps: 40 });
  await until(async () => (await middle()).y < at.y - 3, 'it slides up before it is dropped');
  await page.mouse.up();
  at = await middle();
  assert.ok(at.y - pane.y > 80, `it left the shape: ${at.y - pane.y}`);
  // a finger has a magnifier
  const touch = (type, x, y) =>
    marker.dispatchEvent(type, { pointerId: 7, pointerType: 'touch', clientX: x, clientY: y, bubbles: true });
  await page.evaluate(() => (Element.prototype.setPointerCapture = () => {})); // there is no such finger
  await touch('pointerdown', at.x, at.y);
  for (let i = 1; i <= 4; i++) await touch('pointermove', at.x + 3 * i, at.y + 3 * i);
  const loupe = page.locator('.loupe');
  await until(async () => /translate/.test(await loupe.getAttribute('style')), 'the magnifier is placed');
  await settled(page);
  const tinted = (r, g, b) => r - b > 40 && r > g;
  assert.ok((await countPixels(page, '.loupe', tinted)) > 4000, 'it shows the surface');
  await touch('pointerup', at.x + 12, at.y + 12);
  await until(async () => (await loupe.count()) === 0, 'it is gone');
  await button(page, 'Undo').click();
  await until(async () => Math.abs((await middle()).x - at.x) < 1, 'a drag is one step');
  // a landmark that is deleted while it is dragged removes the magnifier, too
  at = await middle();
  await touch('pointerdown', at.x, at.y);
  for (let i = 1; i <= 4; i++) await touch('pointermove', at.x + 3 * i, at.y + 3 * i);
  await until(async () => /translate/.test(await loupe.getAttribute('style')), 'the magnifier is back');
  await page.keyboard.press('Delete');
  await until(async () => (await marker.count()) === 0, 'the landmark is deleted');
  await until(async () => (await loupe.count()) === 0, 'the magnifier is gone, too');
  await done();
});

test('on symmetric shapes, a landmark on the left sets one on the right', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const bodies = [0.7, 0.9].map((width, i) => {
    const shape = ([x, y, z]) => [1.6 * x + 0.4 * z * z, y + 0.5 * x * x, (width + 0.25 * x - 0.2 * y) * z];
    return { name: `body${i}.obj`, mimeType: 'text/plain', buffer: Buffer.from(obj(ball(3, shape))) };
  });
  await addFiles(page, ...bodies);
  await button(page, 'Landmarks').click();
  await page.getByRole('switch', { name: 'Click left, get right' }).click();
  await clickView(page, 0, 0.5, 0.5);
  await until(async () => (await landmarks(page).count()) === 2, 'a pair');
  await clickView(page, 1, 0.5, 0.5);
  await until(async () => (await page.locator('.badge.warn').count()) === 0, 'both are on both shapes');
  assert.equal(await landmarks(page).count(), 2);
  const [download] = await Promise.all([page.waitForEvent('download'), button(page, 'Export').click()]);
  const [left, right] = JSON.parse(await readFile(await download.path(), 'utf8')).landmarks;
  for (const [i, { buffer }] of bodies.entries()) {
    const known = buffer.toString().split('\n');
    const [a, b] = [left, right].map(({ at }) =>
      at[i].point ? at[i].point : known[at[i].vertex].split(' ').slice(1).map(Number),
    );
    assert.ok(Math.abs(a[2]) > 0.2, `shape ${i}: off the plane, ${a}`);
    assert.ok(Math.hypot(a[0] - b[0], a[1] - b[1], a[2] + b[2]) < 0.05, `shape ${i}: ${a}, ${b}`);
  }
  await button(page, 'Undo').click();
  assert.equal(await page.locator('.badge.warn').count(), 2, 'a pair is one step');
  await done();
});

test('landmarks are found', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('elephant.ply'));
  await button(page, 'Landmarks').click();
  await button(page, 'Find them for me').click();
  const [text] = await until(() => shownToasts(page).then((list) => list.length > 0 && list), 'an answer');
  const found = Number(text.match(/^(\d+) landmarks found/)?.[1] ?? 0);
  assert.equal(await landmarks(page).count(), found);
  assert.ok(found > 0 || /matched/.test(text), text);
  // a job without a name so far
  await button(page, 'Clear').click();
  let asked = 0;
  await page.route('**/v1/supermeshes', (route) => asked++ && route.continue()); // the first one gets no answer
  await button(page, 'Find them for me').click();
  await until(() => asked, 'the search is sent');
  await page.reload();
  await counted(landmarks(page), found, 'the search goes on after a reload');
  await done();
});

test('a search for landmarks survives a reload as itself, and can be stopped', async (t) => {
  const busy = await startOccupied(t);
  const { page, done } = await openPage(browser, busy.url);
  await addFiles(page, sample('dog.obj'), sample('elephant.ply'));
  await button(page, 'Landmarks').click();
  await button(page, 'Find them for me').click();
  await until(() => /j=[0-9a-f]+&find=1/.test(page.url()), 'the URL names the search');
  await page.reload();
  await button(page, 'Stop finding').click();
  await until(() => shownToasts(page).then((list) => list.includes('Cancelled.')), 'it is stopped');
  const { jobs } = await json(busy.url, '/v1/jobs');
  const search = jobs.find(({ kind }) => kind === 'supermesh');
  await until(async () => (await json(busy.url, search.url)).state === 'cancelled', 'its job, too');
  assert.equal(await page.evaluate(() => document.activeElement.textContent), 'Find them for me', 'the focus stays');
  await done();
});

test('a landmark that may be misplaced moves to where it would lie, and back', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  const { landmarks: given } = JSON.parse(await readFile(sample('dog-giraffe.json'), 'utf8'));
  given[0].at[1] = { vertex: vertexBeside(readOff(await readFile(sample('giraffe.off'), 'utf8')), given, 0) };
  await button(page, 'Landmarks').click();
  await page.getByLabel('Landmark file').setInputFiles({
    name: 'moved.json',
    mimeType: 'application/json',
    buffer: Buffer.from(JSON.stringify({ landmarks: given })),
  });
  await counted(landmarks(page), given.length, 'the landmarks are read');
  await morph(page);
  const suspects = page.getByRole('list', { name: 'Landmarks that may be misplaced' });
  await until(() => suspects.count(), 'the landmark is named');
  assert.match(
    await suspects.textContent(),
    new RegExp(`^${given[0].name} may be misplaced: .* diagonal away. Move it there$`),
  );
  const places = async () => {
    const [download] = await Promise.all([page.waitForEvent('download'), button(page, 'Export').click()]);
    return JSON.parse(await readFile(await download.path(), 'utf8')).landmarks.map(({ at }) => at);
  };

  await button(page, 'Move it there').click();
  await until(() => button(page, 'Export').count(), 'the landmarks are shown');
  const [moved, ...others] = await places();
  assert.deepEqual(moved[0], given[0].at[0]);
  assert.ok(Number.isInteger(moved[1].triangle), 'the nose lies where the answer says');
  assert.deepEqual(
    others,
    given.slice(1).map(({ at }) => at),
  );
  await button(page, 'Undo').click();
  assert.deepEqual((await places())[0], given[0].at);

  await button(page, 'Delete landmark 1', { exact: true }).click();
  await button(page, 'Morph', { exact: true }).click();
  await button(page, 'Move it there').click();
  await until(
    async () => (await shownToasts(page)).some((text) => text.includes('The landmarks are others now')),
    'the studio says that the landmarks are others',
  );
  await done();
});

test('only landmarks of weight 1 are called exact', async () => {
  const { landmarks: given } = JSON.parse(await readFile(sample('dog-giraffe.json'), 'utf8'));
  const meshes = [];
  for (const name of ['dog.obj', 'giraffe.off']) {
    const body = await readFile(sample(name));
    meshes.push(await (await fetch(`${daemon.url}/v1/meshes?name=${name}`, { method: 'POST', body })).json());
  }
  const soft = given.map((l, i) => (i === 0 ? { ...l, weight: 0.3 } : l));
  for (const [marks, words] of [
    [given, /^21, exact$/],
    [soft, /^20 exact, 1 soft, up to [\d.e-]+ % from its place$/],
  ]) {
    const answer = await fetch(`${daemon.url}/v1/supermeshes`, {
      method: 'POST',
      headers: { 'content-type': 'application/json', prefer: 'wait=60' },
      body: JSON.stringify({
        shapes: meshes.map(({ id }) => ({ mesh: id })),
        landmarks: marks,
        remesh: { tolerance: 0.02 },
      }),
    });
    const { id } = await answer.json();
    const { page, done } = await openPage(browser, daemon.url, {
      hash: `#m=${meshes.map((m) => m.id)}&tab=morph&r=${id}`,
    });
    const row = page.getByRole('row', { name: /^Landmarks/ }).getByRole('cell');
    await until(() => row.count(), 'the report is shown');
    assert.match(await row.textContent(), words);
    await done();
  }
});
