// The work of a modeller, from the empty page to the file on disk.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { mkdtemp, readFile, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { promisify } from 'node:util';
import { endless } from '../scenario/support/daemon.mjs';
import { ball, obj, torus } from '../scenario/support/shapes.mjs';
import { browser, daemon } from './started.mjs';
import {
  addFiles,
  button,
  clickView,
  countPixels,
  difference,
  hideToasts,
  json,
  defaultShown,
  openPage,
  root,
  sample,
  settled,
  shownToasts,
  startDaemon,
  until,
} from './support.mjs';

const scrubber = (page) => page.getByRole('slider', { name: 'Along the morph' });
const time = (page) => scrubber(page).evaluate((input) => Number(input.value));
const landmarks = (page) => page.locator('.marks li');
const seek = (page, value) =>
  scrubber(page).evaluate((input, v) => {
    input.value = String(v);
    input.dispatchEvent(new Event('input', { bubbles: true }));
  }, value);

/** Three landmarks, each on both shapes, at positions where both have a surface. */
async function pickThree(page) {
  await button(page, 'Landmarks').click();
  for (const [n, [x, y]] of [
    [0.5, 0.5],
    [0.4, 0.5],
    [0.45, 0.56],
  ].entries()) {
    await clickView(page, 0, x, y);
    await until(
      () =>
        landmarks(page)
          .count()
          .then((count) => count === n + 1),
      `landmark ${n + 1} on the first shape`,
    );
    await clickView(page, 1, x, y);
    await until(
      () =>
        page
          .locator('.badge.warn')
          .count()
          .then((count) => count === 0),
      `landmark ${n + 1} on the second shape`,
    );
  }
}

async function morph(page) {
  await button(page, /^Morph \d shapes$/).click();
  await until(() => button(page, 'Pause').count(), 'the morph plays');
  await defaultShown(page);
}

/** The id of the morph that is shown. The address follows a moment later: it may still name the fast one. */
async function shownId(page) {
  const link = await page.getByRole('link', { name: 'Download GLB' }).getAttribute('href');
  const id = link.match(/[0-9a-f]{64}/)[0];
  await until(() => page.url().includes(`r=${id}`), 'the URL names the morph');
  return id;
}

test('from the empty page to a playing morph in at most five clicks', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  let clicks = 0;
  const click = async (name) => {
    await button(page, name).click();
    clicks++;
  };
  await click('Try with samples');
  await until(
    () =>
      page
        .locator('.card.ready')
        .count()
        .then((n) => n === 2),
    'two samples are taken',
  );
  await click(/^Morph 2 shapes$/);
  await until(() => button(page, 'Pause').count(), 'the morph plays');
  const seen = new Set();
  await until(async () => seen.add(await time(page)).size > 5, 'time passes');
  assert.ok(clicks <= 5, `${clicks} clicks`);
  await done();
});

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
  await until(
    () =>
      landmarks(page)
        .count()
        .then((n) => n === 3),
    'the landmarks are back',
  );
  const [again] = await Promise.all([page.waitForEvent('download'), button(page, 'Export').click()]);
  assert.deepEqual(JSON.parse(await readFile(await again.path(), 'utf8')), exported);
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
  // a landmark that goes while it is dragged takes the magnifier along
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

test('morph with landmarks, scrub, mix, wireframe, download', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  await button(page, 'Landmarks').click();
  await page.getByLabel('Landmark file').setInputFiles(sample('dog-giraffe.json'));
  await until(() => landmarks(page).count(), 'the landmarks of the samples are read');
  const count = await landmarks(page).count();
  await morph(page);
  await button(page, 'Pause').click();
  const id = await shownId(page);
  const supermesh = await json(daemon.url, `/v1/supermeshes/${id}`);
  assert.equal(supermesh.landmarks.length, count);
  assert.equal(supermesh.certificate.landmarks_exact, true);

  const shots = [];
  for (const t of [0, 0.5, 1]) {
    await seek(page, t);
    await settled(page);
    shots.push(await page.locator('.stage-area').screenshot());
  }
  assert.ok((await difference(browser, shots[0], shots[1])) > 0.005, 'halfway differs from the first shape');
  assert.ok((await difference(browser, shots[1], shots[2])) > 0.005, 'halfway differs from the second shape');

  await page.getByRole('slider', { name: 'Share of dog' }).evaluate((input) => {
    input.value = '0.5';
    input.dispatchEvent(new Event('input', { bubbles: true }));
  });
  await settled(page);
  assert.ok(
    (await difference(browser, await page.locator('.pane').screenshot(), await page.locator('.pane').screenshot())) ===
      0,
  );
  assert.equal(await page.getByRole('slider', { name: 'Share of giraffe' }).inputValue(), '0.5');

  const plain = await page.locator('.stage-area').screenshot();
  await page.getByRole('switch', { name: 'Wireframe' }).click();
  await settled(page);
  assert.ok(
    (await difference(browser, plain, await page.locator('.stage-area').screenshot())) > 0.005,
    'the wireframe is drawn',
  );
  // The wireframe is on in “Each shape” by default, and in “Error” since the step above. The switch hides it in both.
  for (const view of ['Each shape', 'Error']) {
    await page.getByRole('group', { name: 'What is shown' }).getByRole('button', { name: view }).click();
    if (view === 'Error')
      await until(
        () =>
          page
            .getByText(/largest/)
            .count()
            .then((n) => n > 0),
        'the errors are measured',
      );
    assert.ok(await page.getByRole('switch', { name: 'Wireframe' }).isChecked(), view);
    await settled(page);
    const drawn = await page.locator('.stage-area').screenshot();
    await page.getByRole('switch', { name: 'Wireframe' }).click();
    await settled(page);
    assert.ok(
      (await difference(browser, drawn, await page.locator('.stage-area').screenshot())) > 0.005,
      `${view}: the wireframe is gone`,
    );
  }
  await page.getByRole('group', { name: 'What is shown' }).getByRole('button', { name: 'Morph' }).click();

  const [download] = await Promise.all([
    page.waitForEvent('download'),
    page.getByRole('link', { name: 'Download GLB' }).click(),
  ]);
  assert.match(download.suggestedFilename(), /\.glb$/);
  const glb = await readFile(await download.path());
  assert.equal(glb.toString('latin1', 0, 4), 'glTF');
  assert.deepEqual(glb, Buffer.from(await (await fetch(`${daemon.url}${supermesh.asset}`)).arrayBuffer()));
  await done();
});

test('side by side, the morph moves between its shapes under one camera', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  await button(page, 'Landmarks').click();
  await page.getByLabel('Landmark file').setInputFiles(sample('dog-giraffe.json'));
  await until(() => landmarks(page).count(), 'the landmarks of the samples are read');
  await morph(page);
  await button(page, 'Pause').click();
  await button(page, 'Side by side').click();
  await until(async () => (await page.locator('.pane').count()) === 3, 'three views');
  assert.deepEqual(await page.locator('.pane .caption strong').allInnerTexts(), ['dog', 'Morph', 'giraffe']);
  /** The three views without their captions. */
  const views = async () => {
    await settled(page);
    const boxes = await page
      .locator('.pane-view')
      .evaluateAll((all) => all.map((e) => e.getBoundingClientRect().toJSON()));
    const width = Math.floor(Math.min(...boxes.map((box) => box.width))) - 4;
    const shot = ({ x, y, height }) =>
      page.screenshot({
        clip: { x: Math.round(x) + 2, y: Math.round(y) + 44, width, height: Math.floor(height) - 48 },
      });
    return [await shot(boxes[0]), await shot(boxes[1]), await shot(boxes[2])];
  };
  const apart = (a, b) => difference(browser, a, b);
  await seek(page, 0);
  const start = await views();
  assert.ok((await apart(start[0], start[1])) < 0.01, 'at its start the morph is the first shape');
  assert.ok((await apart(start[1], start[2])) > 0.03, 'and not the second');
  await seek(page, 1);
  const end = await views();
  assert.ok((await apart(end[1], end[2])) < 0.01, 'at its end it is the second shape');
  assert.ok((await apart(end[0], start[0])) < 0.002 && (await apart(end[2], start[2])) < 0.002, 'the shapes stay');
  await seek(page, 0.5);
  const middle = await views();
  assert.ok((await apart(middle[1], start[0])) > 0.01 && (await apart(middle[1], end[2])) > 0.01, 'between both');
  // a place of one shape is marked on the others
  const marks = async () => {
    await settled(page);
    return page.locator('.marker.probe').evaluateAll((all) =>
      all.map((e) => {
        const [box, of] = [e.getBoundingClientRect(), e.closest('.pane-view').getBoundingClientRect()];
        return [box.x + box.width / 2 - of.x, box.y + box.height / 2 - of.y];
      }),
    );
  };
  const near = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]) < 2.5; // pixels; views differ by one in width
  const view = await page.locator('.pane-view').first().boundingBox();
  const inside = [view.width * 0.5, view.height * 0.58]; // on the dog's flank
  await seek(page, 0);
  await page.mouse.move(view.x + inside[0], view.y + inside[1]);
  await until(async () => (await page.locator('.marker.probe').count()) === 3, 'the place is marked');
  const [dog, same, other] = await marks();
  assert.ok(near(dog, inside) && near(dog, same) && !near(dog, other), `${[dog, same, other]}`);
  await seek(page, 1);
  await until(async () => near((await marks())[1], other), 'the mark of the morph goes along');
  await page.mouse.move(view.x + 4, view.y + 4);
  await until(async () => (await page.locator('.marker.probe').count()) === 0, 'none beside the shape');
  await page.locator('.pane-view').nth(2).focus();
  await page.keyboard.press('Enter');
  const centre = [view.width / 2, view.height / 2]; // on the giraffe's
  await until(async () => near((await marks())[2] ?? [0, 0], centre), 'the keyboard marks the centre');
  await page.mouse.move(view.x + 5, view.y + 5); // nothing is marked in the pictures below
  await until(async () => (await page.locator('.marker.probe').count()) === 0, 'the mouse takes it away');
  await seek(page, 0.5);
  await page.locator('.pane-view').nth(1).focus();
  for (let i = 0; i < 5; i++) await page.keyboard.press('ArrowLeft');
  await page.getByRole('slider', { name: 'Along the morph' }).focus(); // so that no view has a ring
  const turned = await views();
  for (const k of [0, 1, 2]) assert.ok((await apart(turned[k], middle[k])) > 0.01, `view ${k} has rotated`);
  await until(() => page.url().includes('show=beside'), 'the address says so');
  await page.reload();
  await until(async () => (await page.locator('.pane').count()) === 3, 'three views after a reload');
  await done();
});

test('a fit that turns a shape over is said', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const [dog, giraffe] = [await readFile(sample('dog.obj')), await readFile(sample('giraffe.off'), 'latin1')];
  // by half a turn about x: what was up is down, and the fit turns it back by as much
  const over = giraffe.replace(/^(-?[\d.]+) (-?[\d.]+) (-?[\d.]+)$/gm, (line, x, y, z) =>
    /\./.test(line) ? `${x} ${-y} ${-z}` : line,
  );
  assert.notEqual(over, giraffe);
  await addFiles(
    page,
    { name: 'dog.obj', mimeType: 'text/plain', buffer: dog },
    { name: 'giraffe.off', mimeType: 'text/plain', buffer: Buffer.from(over, 'latin1') },
  );
  await button(page, 'Landmarks').click();
  await page.getByLabel('Landmark file').setInputFiles(sample('dog-giraffe.json'));
  await until(() => landmarks(page).count(), 'the landmarks of the samples are read');
  await morph(page);
  const said = await page.getByRole('list', { name: 'Shapes that the fit turned over' }).innerText();
  assert.match(said, /The fit turned giraffe over: its up axis by 180°/);
  await done();
});

test('a reload and the URL alone restore the same state', async () => {
  const first = await openPage(browser, daemon.url);
  await addFiles(first.page, sample('dog.obj'), sample('giraffe.off'));
  await button(first.page, 'Landmarks').click();
  await first.page.getByLabel('Landmark file').setInputFiles(sample('dog-giraffe.json'));
  await until(() => landmarks(first.page).count(), 'landmarks');
  const count = await landmarks(first.page).count();
  await morph(first.page);
  await button(first.page, 'Pause').click();
  await seek(first.page, 0.25);
  await until(() => /t=0\.250/.test(first.page.url()), 'the URL holds the time');
  await hideToasts(first.page);
  await settled(first.page);
  const before = await first.page.locator('.pane').screenshot();
  await first.page.reload();
  await until(() => button(first.page, 'Play').count(), 'the morph is back');
  await settled(first.page);
  await until(
    async () => (await difference(browser, before, await first.page.locator('.pane').screenshot())) < 0.002,
    'it looks the same',
  );
  const address = first.page.url();
  await first.done();

  const second = await openPage(browser, daemon.url, { hash: new URL(address).hash });
  await until(() => button(second.page, 'Play').count(), 'the morph is there');
  assert.equal(await time(second.page), 0.25);
  await button(second.page, 'Landmarks').click();
  assert.equal(await landmarks(second.page).count(), count);
  await second.done();
});

test('a refused mesh says why, shows the rim in red, and can be repaired', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  // the dog without its first 40 faces
  let left = 40;
  const text = (await readFile(sample('dog.obj'), 'utf8'))
    .split('\n')
    .filter((line) => !(line.startsWith('f ') && left-- > 0))
    .join('\n');
  await page
    .locator('input[type=file]')
    .first()
    .setInputFiles({ name: 'open.obj', mimeType: 'text/plain', buffer: Buffer.from(text) });
  await page.locator('.card.refused').waitFor();
  assert.match(await page.getByRole('alert').innerText(), /hole/);
  await until(() => page.getByText('Shown in red on the model.').count(), 'the rim is found');
  // the lines are drawn over the surface, so the rim is visible from any side
  await settled(page);
  assert.ok((await countPixels(page, '.stage-area', (r, g, b) => r > 180 && g < 110 && b < 110)) > 20, 'red is drawn');
  await button(page, 'Fill the holes').click();
  await until(() => page.locator('.card.ready').count(), 'it is repaired');
  assert.equal(await page.locator('.card.refused').count(), 0);
  await settled(page);
  assert.equal(await countPixels(page, '.stage-area', (r, g, b) => r > 180 && g < 110 && b < 110), 0, 'no red is left');
  await done();
});

test('loose pieces are shown in red, and the largest can be kept', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const text = await readFile(sample('dog.obj'), 'utf8');
  const known = text.split('\n').filter((line) => line.startsWith('v '));
  const [x, y, z] = [0, 1, 2].map((k) => Math.max(...known.map((line) => Number(line.split(/\s+/)[k + 1]))));
  const size = 0.2 * y;
  const corners = [
    [0, 0, 0],
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
  ].map((c) => `v ${[x, y, z].map((at, k) => at + size * (c[k] - 0.5)).join(' ')}`);
  const faces = [
    [1, 3, 2],
    [1, 2, 4],
    [2, 3, 4],
    [1, 4, 3],
  ].map((f) => `f ${f.map((v) => v + known.length).join(' ')}`);
  const both = [...known, ...corners, ...text.split('\n').filter((line) => line.startsWith('f ')), ...faces].join('\n');
  await page
    .locator('input[type=file]')
    .first()
    .setInputFiles({ name: 'two.obj', mimeType: 'text/plain', buffer: Buffer.from(`${both}\n`) });
  await page.locator('.card.refused').waitFor();
  await until(() => page.getByText('Shown in red on the model.').count(), 'the loose piece is found');
  await settled(page);
  assert.ok((await countPixels(page, '.stage-area', (r, g, b) => r > 150 && g < 110 && b < 110)) > 50, 'red is drawn');
  await button(page, 'Keep the largest piece').click();
  await until(() => page.locator('.card.ready').count(), 'it is repaired');
  await done();
});

test('the loop around a handle is shown in red, and the handle can be closed', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const file = { name: 'ring.obj', mimeType: 'text/plain', buffer: Buffer.from(obj(torus())) };
  await page.locator('input[type=file]').first().setInputFiles(file);
  await page.locator('.card.refused').waitFor();
  await until(() => page.getByText('Shown in red on the model.').count(), 'the loop is found');
  await settled(page);
  assert.ok((await countPixels(page, '.stage-area', (r, g, b) => r > 180 && g < 110 && b < 110)) > 20, 'red is drawn');
  assert.match(
    await page.getByRole('list', { name: 'Handles' }).innerText(),
    /^Handle 1: its loop is \d+ % of the diagonal/,
  );
  await button(page, 'Close the handle along the red loop').click();
  await until(() => page.locator('.card.ready').count(), 'it is repaired');
  await done();
});

test('linked cameras rotate together, others alone', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  const views = async () => {
    await settled(page);
    return [await page.locator('.pane').nth(0).screenshot(), await page.locator('.pane').nth(1).screenshot()];
  };
  const turn = async () => {
    await page.locator('.pane-view').first().focus();
    for (let i = 0; i < 5; i++) await page.keyboard.press('ArrowLeft');
  };
  await page.locator('.pane-view').first().focus();
  const first = await views();
  await turn();
  const second = await views();
  for (const k of [0, 1]) assert.ok((await difference(browser, first[k], second[k])) > 0.01, `view ${k} has rotated`);
  await page.getByRole('switch', { name: 'Link the cameras' }).click();
  await page.locator('.pane-view').first().focus();
  const third = await views();
  await turn();
  const fourth = await views();
  assert.ok((await difference(browser, third[0], fourth[0])) > 0.01, 'the focused view has rotated');
  assert.ok((await difference(browser, third[1], fourth[1])) < 0.002, 'the other has not');
  await done();
});

test('an upload shows its progress', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const session = await page.context().newCDPSession(page);
  await session.send('Network.enable');
  await session.send('Network.emulateNetworkConditions', {
    offline: false,
    latency: 0,
    downloadThroughput: -1,
    uploadThroughput: 400_000,
  });
  await page.evaluate(() => {
    globalThis.seen = [];
    new MutationObserver(() => {
      const bar = document.querySelector('[role=progressbar][aria-label^=Uploading]');
      const now = Number(bar?.getAttribute('aria-valuenow') ?? NaN);
      if (now > 0 && now !== globalThis.seen.at(-1)) globalThis.seen.push(now);
    }).observe(document.body, { subtree: true, childList: true, attributes: true });
  });
  const dog = await readFile(sample('dog.obj'), 'utf8');
  const long = Buffer.from(`${dog}\n${`# ${'x'.repeat(98)}\n`.repeat(12_000)}`);
  await page
    .locator('input[type=file]')
    .first()
    .setInputFiles({ name: 'dog.obj', mimeType: 'text/plain', buffer: long });
  await page.locator('.card.ready').waitFor();
  const seen = await page.evaluate(() => globalThis.seen);
  assert.ok(seen.length >= 3, `shares seen: ${seen}`);
  assert.deepEqual(
    seen,
    [...seen].sort((a, b) => a - b),
  );
  await done();
});

test('a file without a mesh is refused with an explanation', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await page
    .locator('input[type=file]')
    .first()
    .setInputFiles({ name: 'letter.obj', mimeType: 'text/plain', buffer: Buffer.from('Dear Sir or Madam\n') });
  await page.locator('.card.refused, .card.failed').waitFor();
  assert.ok((await page.getByRole('alert').first().innerText()).length > 20);
  await done();
});

test('a morph is cancelled before it is done', async () => {
  // Another job occupies the only worker, so the morph cannot finish before it is cancelled.
  const busy = await startDaemon({ args: ['--workers', '1'] });
  const post = async (path, body, headers) => (await fetch(busy.url + path, { method: 'POST', headers, body })).json();
  const { id: mesh } = await post('/v1/meshes', obj(ball(5)));
  const other = await post('/v1/embeddings', JSON.stringify({ mesh, ...endless }), {
    'Content-Type': 'application/json',
  });
  const { page, done } = await openPage(browser, busy.url);
  await addFiles(page, sample('dog.obj'), sample('elephant.ply'));
  await page.getByText('Options', { exact: true }).click();
  await page.getByRole('slider', { name: /^Tolerance/ }).evaluate((input) => {
    input.value = '-4';
    input.dispatchEvent(new Event('input', { bubbles: true }));
  });
  await button(page, /^Morph 2 shapes$/).click();
  await button(page, 'Cancel').click();
  await until(() => shownToasts(page).then((list) => list.includes('Cancelled.')), 'the page says so');
  const { jobs } = await json(busy.url, '/v1/jobs');
  const morph = jobs.find(({ kind }) => kind === 'supermesh');
  await until(async () => (await json(busy.url, morph.url)).state === 'cancelled', 'the job has stopped');
  await button(page, /^Morph 2 shapes$/).waitFor();
  await done();
  await fetch(busy.url + other.url, { method: 'DELETE' });
  await busy.stop();
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
  await done();
});

test('a search for landmarks survives a reload as itself, and can be stopped', async () => {
  const busy = await startDaemon({ args: ['--workers', '1'] }); // whose only worker another job occupies
  const post = async (path, body, headers) => (await fetch(busy.url + path, { method: 'POST', headers, body })).json();
  const { id: mesh } = await post('/v1/meshes', obj(ball(5)));
  const type = { 'Content-Type': 'application/json' };
  const other = await post('/v1/embeddings', JSON.stringify({ mesh, ...endless }), type);
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
  await fetch(busy.url + other.url, { method: 'DELETE' });
  await busy.stop();
});

test('an unsure match is labelled, and the next match gives another morph', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('elephant.ply'));
  await morph(page);
  const shown = () => page.url().match(/r=([0-9a-f]{64})/)?.[1];
  const first = await json(daemon.url, `/v1/supermeshes/${await shownId(page)}`);
  const said = page.getByRole('status', { name: 'How sure the match is' });
  assert.equal(first.match.verdict, 'unsure');
  await until(
    async () =>
      /^Not sure: the \w+ front limb of dog may be the \w+ front limb of elephant\. Look/.test(
        await said.textContent(),
      ),
    'the doubt in words',
  );
  assert.doesNotMatch(await page.locator('.report').first().textContent(), /exact/, 'no landmarks were given');
  const { id } = await fetch(`${daemon.url}/v1/supermeshes`, {
    method: 'POST',
    headers: { 'content-type': 'application/json', prefer: 'wait=60' },
    body: JSON.stringify(first.alternatives[0].request),
  }).then((reply) => reply.json());
  await button(page, 'Next match').click();
  await until(() => shown() === id, 'the first alternative is shown');
  await until(async () => /^Match 2 of /.test(await said.textContent()), 'it is called the second');
  assert.doesNotMatch(await page.locator('.report').first().textContent(), /exact/, 'its landmarks were found');
  for (let i = 0; i < first.alternatives.length; i++) {
    await button(page, 'Next match').click();
    await until(async () => !(await button(page, 'Next match').isDisabled()), 'the next one is shown');
  }
  await until(() => shown() === first.id, 'after the last comes the first');
  assert.equal(await button(page, 'Flip').count(), 0, 'the other match takes head to foot');
  // there and back again; what led to it is listed
  await button(page, 'Next match').click();
  await until(() => shown() === id, 'the other match');
  await button(page, 'Landmarks').click();
  const pairs = first.alternatives[0].request.landmarks.length;
  await until(async () => (await landmarks(page).count()) === pairs, 'its landmarks');
  await button(page, 'Morph', { exact: true }).click();
  await button(page, 'Next match').click();
  await until(() => shown() === first.id, 'the first one again');
  // the heat map: blue where the surface is as it was, red where it is stretched badly
  await button(page, 'Heat map').click();
  await until(() => page.getByText(/^99 % of it below/).count(), 'it is measured');
  await settled(page);
  assert.equal(await page.locator('.pane').count(), 2);
  assert.ok((await countPixels(page, '.stage-area', (r, g, b) => b > r + 15 && b > g && r < 70)) > 5000, 'blue');
  assert.ok((await countPixels(page, '.pane-view', (r, g, b) => r > 120 && r > 2 * g && r > 1.5 * b)) > 100, 'red');
  // what was found is in the list, and given once it is corrected
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
  await done();
});

test('a job continues when the page is closed, and is found again', async () => {
  const first = await openPage(browser, daemon.url);
  await addFiles(first.page, sample('giraffe.off'), sample('elephant.ply'));
  await button(first.page, /^Morph 2 shapes$/).click();
  const address = await until(
    () => (/j=[^&]+/.test(first.page.url()) || /r=/.test(first.page.url())) && first.page.url(),
    'the address names the job',
  );
  await first.done();
  const second = await openPage(browser, daemon.url, { hash: new URL(address).hash });
  await until(() => button(second.page, /^(Play|Pause)$/).count(), 'the morph is there');
  await second.done();
});

test('what is on the server is listed and opened', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await button(page, 'On the server', { exact: true }).click();
  await button(page, 'Add dog').first().waitFor();
  const listed = await page.locator('dialog .item strong').allInnerTexts();
  assert.ok(listed.includes('dog → giraffe') && listed.includes('giraffe'), listed.join(', '));
  assert.ok(!listed.some((text) => /^[0-9a-f]{6,}/.test(text)), `names, no ids: ${listed.join(', ')}`);
  await page.locator('.list .item', { hasText: '→' }).first().click();
  await until(() => button(page, /^(Play|Pause)$/).count(), 'the morph opens');
  await done();
});

test('spheres before and after the alignment: certified, painted, measured', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  await button(page, 'Landmarks').click();
  await page.getByLabel('Landmark file').setInputFiles(sample('dog-giraffe.json'));
  await until(() => landmarks(page).count(), 'landmarks');
  const count = await landmarks(page).count();
  await button(page, 'Spheres').click();
  await until(
    () =>
      page
        .getByText('Certified one to one')
        .count()
        .then((n) => n === 2),
    'both are embedded',
  );
  assert.ok(await button(page, 'After', { exact: true }).isDisabled(), 'there is no morph yet');
  const shots = [];
  for (const name of ['Normals', 'Checkerboard', 'Stretch', 'Areas']) {
    await button(page, name).click();
    await settled(page);
    shots.push(await page.locator('.stage-area').screenshot());
  }
  for (let i = 1; i < shots.length; i++)
    assert.ok((await difference(browser, shots[i - 1], shots[i])) > 0.03, `paint ${i} differs from the one before`);
  assert.equal(await page.getByRole('img', { name: /^Histogram/ }).count(), 2);

  // The position of each landmark on the two spheres, in pixels of its own view.
  const spots = () =>
    page.evaluate(() =>
      [...document.querySelectorAll('.pane-view:has(.marker.small)')].map((view) => {
        const box = view.getBoundingClientRect();
        return [...view.querySelectorAll('.marker.small')].map((mark) => {
          const m = mark.getBoundingClientRect();
          return [m.x + m.width / 2 - box.x, m.y + m.height / 2 - box.y];
        });
      }),
    );
  const gap = ([a, b]) => Math.max(...a.map((p, i) => Math.hypot(p[0] - b[i][0], p[1] - b[i][1])));
  const before = await spots();
  assert.deepEqual(
    before.map((list) => list.length),
    [count, count],
  );
  assert.ok(gap(before) > 20, 'before the alignment the spheres do not correspond');
  await morph(page);
  await button(page, 'Pause').click();
  await button(page, 'Spheres').click();
  await button(page, 'After', { exact: true }).click();
  await until(
    () =>
      page
        .getByText('on the common sphere')
        .count()
        .then((n) => n === 2),
    'the aligned spheres',
  );
  await until(
    () =>
      page
        .locator('.marker.small')
        .count()
        .then((n) => n === 2 * count),
    'with their landmarks',
  );
  await settled(page);
  assert.ok(gap(await spots()) < 1, 'after the alignment landmarks coincide');
  await until(() => /side=after/.test(page.url()), 'the URL says so');
  const shown = await page.locator('.pane').nth(1).screenshot();
  await page.reload();
  await until(
    () =>
      page
        .getByText('on the common sphere')
        .count()
        .then((n) => n === 2),
    'also after a reload',
  );
  await until(
    () =>
      page
        .locator('.marker.small')
        .count()
        .then((n) => n === 2 * count),
    'with their landmarks',
  );
  await settled(page);
  await until(
    async () => (await difference(browser, shown, await page.locator('.pane').nth(1).screenshot())) < 0.01,
    'it looks the same',
  );
  await done();
});

test('the offered commands and pages show this morph', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  await button(page, 'Landmarks').click();
  await page.getByLabel('Landmark file').setInputFiles(sample('dog-giraffe.json'));
  await until(() => landmarks(page).count(), 'landmarks');
  await morph(page);
  await button(page, 'Pause').click();
  await button(page, 'Use it').click();
  const text = (title) => page.getByRole('region', { name: `${title}: code` }).textContent();
  const asset = Buffer.from(await (await fetch(await text('Asset'))).arrayBuffer());

  const folder = await mkdtemp(join(tmpdir(), 'orbmorph-curl-'));
  const { stdout } = await promisify(execFile)('bash', ['-e', '-c', await text('curl')], { cwd: folder });
  assert.deepEqual(await readFile(join(folder, 'dog-giraffe.glb')), asset, 'curl downloads the same bytes');
  assert.equal(`${daemon.url}${JSON.parse(stdout).asset}`, await text('Asset'), 'the request names the same morph');
  await rm(folder, { recursive: true });

  // Serves the page from another site, with the asset beside it; the npm packages here answer for the CDN.
  const html = await text('three.js');
  const context = await browser.newContext({ viewport: { width: 400, height: 300 } });
  const other = await context.newPage();
  const faults = [];
  other.on('pageerror', (error) => faults.push(error.stack));
  const site = 'http://somebody.example/page.html';
  await context.route('https://cdn.jsdelivr.net/npm/three@*/**', (route) =>
    route.fulfill({
      headers: { 'Access-Control-Allow-Origin': '*' },
      path: join(
        root,
        'client/web/node_modules/three',
        new URL(route.request().url()).pathname.replace(/^\/npm\/three@[^/]+\//, ''),
      ),
    }),
  );
  await context.route(site, (route) => route.fulfill({ contentType: 'text/html', body: html }));
  await context.route('http://somebody.example/dog-giraffe.glb', (route) => route.fulfill({ body: asset }));
  await other.goto(site);
  await other.locator('canvas').waitFor();
  const ground = (r, g, b) => Math.abs(r - 0xf3) + Math.abs(g - 0xf1) + Math.abs(b - 0xec) > 60 && r + g + b > 60;
  await until(async () => (await countPixels(other, 'canvas', ground)) > 2000, 'the morph appears');
  const first = await other.screenshot();
  await until(async () => (await difference(browser, first, await other.screenshot())) > 0.01, 'and moves');
  assert.deepEqual(faults, []);
  await context.close();
  assert.match(await text('model-viewer'), /<model-viewer src="dog-giraffe\.glb"/);
  await done();
});

test('my own mesh is kept, its holes are open again, and each of several targets has a slider', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const body = (name, map, cut = 0) => {
    const { positions, triangles } = ball(3, map);
    const buffer = Buffer.from(obj({ positions, triangles: triangles.slice(cut) }));
    return { name: `${name}.obj`, mimeType: 'text/plain', buffer };
  };
  const files = [
    body('bowl', ([x, y, z]) => [x, 0.8 * y, 1.1 * z], 4),
    body('pear', ([x, y, z]) => [x * (1 - 0.3 * y), 1.4 * y, z]),
    body('loaf', ([x, y, z]) => [1.6 * x, y, 0.8 * z]),
  ];
  await page.locator('input[type=file]').first().setInputFiles(files);
  await button(page, 'Fill the holes').click();
  await until(async () => (await page.locator('.card.ready').count()) === 3, 'all are taken');
  const keep = page.getByRole('switch', { name: 'Keep the mesh of bowl' });
  assert.equal(await keep.isChecked(), false);
  await keep.click();
  await morph(page);
  const made = await json(daemon.url, `/v1/supermeshes/${await shownId(page)}`);
  assert.deepEqual([made.request.remesh.method, made.request.asset.holes], ['template', 'reopen']);
  const triangles = async ({ asset }) => {
    const glb = Buffer.from(await (await fetch(`${daemon.url}${asset}`)).arrayBuffer());
    const { accessors, meshes } = JSON.parse(glb.toString('utf8', 20, 20 + glb.readUInt32LE(12)));
    return meshes[0].primitives.reduce((sum, { indices }) => sum + accessors[indices].count / 3, 0);
  };
  assert.equal(await triangles(made), 512 - 4, 'the triangles of the file');
  await button(page, 'Pause').click();
  const shares = page.getByRole('slider', { name: /^Share of / });
  assert.equal(await shares.count(), 3);
  const pictures = [];
  for (const chosen of [0, 1, 2]) {
    for (const i of [0, 1, 2])
      await shares.nth(i).evaluate(
        (input, v) => {
          input.value = v;
          input.dispatchEvent(new Event('input', { bubbles: true }));
        },
        Number(i === chosen),
      );
    await settled(page);
    pictures.push(await page.locator('.pane').screenshot());
  }
  for (const [a, b] of [
    [0, 1],
    [1, 2],
    [2, 0],
  ])
    assert.ok((await difference(browser, pictures[a], pictures[b])) > 0.01, `targets ${a} and ${b}`);
  await button(page, 'Shapes', { exact: true }).click();
  assert.ok(await keep.isChecked());
  const holes = page.getByRole('switch', { name: 'Open the holes of bowl again in the morph' });
  assert.equal(await holes.count(), 0, 'a mesh that stays has its holes in any case');
  await keep.click();
  await holes.click();
  await morph(page);
  const filled = await json(daemon.url, `/v1/supermeshes/${await shownId(page)}`);
  assert.deepEqual([filled.request.remesh.method, filled.request.asset.holes], ['adaptive', 'filled']);
  assert.equal(await triangles(filled), filled.triangles, 'the patch is part of it');
  await done();
});

test('the error of the common mesh is measured and below the tolerance', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  await page.getByText('Options', { exact: true }).click();
  await button(page, 'As in the files').click();
  await morph(page);
  await button(page, 'Error').click();
  await until(
    () =>
      page
        .locator('.pane .legend')
        .count()
        .then((n) => n === 2),
    'both shapes are measured',
  );
  const captions = await page.locator('.pane .caption').allInnerTexts();
  for (const text of captions) {
    const percent = Number(text.match(/largest ([\d.e+-]+) %/)[1]);
    assert.ok(percent <= 0.1 * 1.05 + 1e-6, `${percent} % is within the tolerance of 0.1 %`);
  }
  await done();
});

test('the report names what the files have and the asset lacks', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const shape = (name, map) => ({
    name: `${name}.obj`,
    mimeType: 'text/plain',
    buffer: Buffer.from(`mtllib ${name}.mtl\nusemtl paint\n${obj(ball(2, map))}`),
  });
  const input = page.locator('input[type=file]').first();
  await input.setInputFiles([
    shape('plum', ([x, y, z]) => [x, 1.1 * y, z]),
    shape('pear', ([x, y, z]) => [x, 1.5 * y, z]),
  ]);
  await until(async () => (await page.locator('.card.ready').count()) === 2, 'both are taken');
  await morph(page);
  const left = page.locator('details.dropped');
  const [above, below] = [
    await left.boundingBox(),
    await page.getByRole('link', { name: 'Download GLB' }).boundingBox(),
  ];
  assert.ok(above.y + above.height <= below.y, 'what is missing is said before the button');
  assert.match(await left.locator('summary').innerText(), /^Not in the asset: \d part/);
  await left.locator('summary').click();
  const text = await left.innerText();
  assert.match(text, /mtllib plum\.mtl/);
  assert.match(text, /Materials of an OBJ are in another file/);
  await done();
});
