// The first minute: a page that moves, progress that moves, and the files that a visitor downloads.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { readFile, writeFile } from 'node:fs/promises';
import { pathToFileURL } from 'node:url';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { browser, daemon } from './started.mjs';
import { countPixels, difference, shot } from './pictures.mjs';
import {
  addFiles,
  counted,
  button,
  defaultShown,
  dropFiles,
  json,
  openPage,
  sample,
  settled,
  shownToasts,
  until,
} from './support.mjs';
import { morphOf } from '../scenario/support/glb.mjs';
import { writeGlb } from '../scenario/support/glb_write.mjs';
import { readPng, writePng } from '../scenario/support/png.mjs';
import { ball, obj, reversed, threeMf } from '../scenario/support/shapes.mjs';

/** Pixels of a shape on the first page: they are more saturated than its background. */
const vivid = (r, g, b) => Math.max(r, g, b) - Math.min(r, g, b) > 70;
const hero = (page) => shot(page.locator('.hero'));

test('the first page plays a morph without a click, and offers three more', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await until(async () => (await countPixels(page, '.hero', vivid)) > 4000, 'a shape is drawn');
  const first = await hero(page);
  await until(async () => (await difference(browser, first, await hero(page))) > 0.02, 'it moves');
  const others = page.getByRole('group', { name: 'Sample morphs' }).getByRole('button');
  assert.equal(await others.count(), 4);
  await button(page, 'Pause the sample').click();
  await settled(page);
  const still = await hero(page);
  await page.waitForTimeout(700);
  assert.ok((await difference(browser, still, await hero(page))) < 0.001, 'paused');
  for (const name of ['Star', 'Fruit', 'Vase']) {
    const before = await hero(page);
    await button(page, name).click();
    await until(async () => (await difference(browser, before, await hero(page))) > 0.02, `${name} appears`);
  }
  assert.equal((await (await fetch(`${daemon.url}/v1/jobs`)).json()).jobs.length, 0, 'the daemon computed nothing');
  // the shapes of the film can be opened, and are accepted
  await button(page, 'Try with samples').click();
  await counted(page.locator('.card.ready'), 3, 'its shapes are open');
  await done();
});

test('two files that are dropped on the first page morph without a click, with landmarks beside them; a third does not', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await page.locator('input[type=file]').first().waitFor({ state: 'attached' });
  await dropFiles(page, sample('dog.obj'), sample('giraffe.off'), sample('dog-giraffe.json'));
  await defaultShown(page);
  await page.getByText('21 landmarks will meet exactly.').waitFor();
  const stage = page.locator('.morph .pane-view');
  const first = await shot(stage);
  await until(async () => (await difference(browser, first, await shot(stage))) > 0.01, 'it plays');
  const { jobs } = await (await fetch(`${daemon.url}/v1/jobs`)).json();
  await dropFiles(page, sample('elephant.ply'));
  await counted(page.locator('.card.ready'), 3, 'it is open');
  await page.waitForTimeout(700);
  const later = await (await fetch(`${daemon.url}/v1/jobs`)).json();
  assert.equal(later.jobs.length, jobs.length, 'who adds a shape says when to morph');
  await done();
});

test('a visitor who prefers less motion gets a still picture that can be played', async () => {
  const { page, done } = await openPage(browser, daemon.url, { reducedMotion: 'reduce' });
  await until(async () => (await countPixels(page, '.hero', vivid)) > 4000, 'a shape is drawn');
  const first = await hero(page);
  await page.waitForTimeout(900);
  assert.ok((await difference(browser, first, await hero(page))) < 0.001);
  await button(page, 'Play the sample').click();
  await until(async () => (await difference(browser, first, await hero(page))) > 0.02, 'it moves');
  await done();
});

test('progress names the stage, says what is left, moves each second, and can be cancelled', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  // A job that reports once and then is silent for a long time, as in a long stage.
  const job = { id: '1'.repeat(32), url: `/v1/jobs/${'1'.repeat(32)}`, kind: 'supermesh', state: 'running' };
  Object.assign(job, { stage: 'align', progress: 0.4, seconds_left: 12, result: null, problem: null, attempt: 1 });
  let cancelled = false;
  await page.route('**/v1/supermeshes', (route) =>
    route.request().postDataJSON().align?.options?.preset === 'fast'
      ? route.fulfill({ status: 422, contentType: 'application/problem+json', body: '{"status":422}' })
      : route.fulfill({ status: 202, headers: { Location: job.url }, json: job }),
  );
  await page.route(`**${job.url}**`, (route) => {
    if (route.request().method() === 'DELETE') cancelled = true;
    if (route.request().url().endsWith('/events'))
      return route.fulfill({
        contentType: 'text/event-stream',
        body: `event: progress\ndata: ${JSON.stringify(job)}\n\n`,
      });
    return route.fulfill({ json: { ...job, state: cancelled ? 'cancelled' : 'running' } });
  });
  await button(page, /^Morph 2 shapes$/).click();
  const status = page.locator('.progress').getByRole('status');
  await until(async () => /Matching the shapes \(2 of 5\)/.test(await status.innerText()), 'the stage');
  const text = () => page.locator('.progress').innerText();
  await until(async () => /about 12 s left/.test(await text()), 'what is left');
  const bar = () => page.locator('.progress [role=progressbar]').getAttribute('aria-valuenow').then(Number);
  const [begin, seen] = [await bar(), new Set()];
  for (let i = 0; i < 4; i++) {
    seen.add((await text()).match(/\d+:\d\d/)[0]);
    await page.waitForTimeout(1100);
  }
  assert.equal(seen.size, 4, `the clock moves each second: ${[...seen]}`);
  assert.ok((await bar()) > begin && (await bar()) < 100, 'and the bar between reports');
  await button(page, 'Cancel').click();
  await counted(page.locator('.progress'), 0, 'the progress is gone');
  assert.ok(cancelled);
  await done();
});

/** A page with a morph of animals that is ready to be downloaded. */
async function taking({ files = ['dog.obj', 'giraffe.off'], landmarks = 'dog-giraffe.json' } = {}) {
  const opened = await openPage(browser, daemon.url);
  const { page } = opened;
  await addFiles(page, ...files.map(sample));
  await button(page, 'Landmarks').click();
  await page.getByLabel('Landmark file').setInputFiles(sample(landmarks));
  await page.locator('.marks li').first().waitFor();
  await button(page, /^Morph \d shapes$/).click();
  await until(() => button(page, 'Pause').count(), 'the morph plays');
  await defaultShown(page);
  await button(page, 'Use it').click();
  const take = page.getByRole('region', { name: 'Take it away' });
  const download = async (name) => {
    const waiting = page.waitForEvent('download');
    await take.getByRole('button', { name, exact: true }).click();
    const file = await waiting;
    return { name: file.suggestedFilename(), bytes: await readFile(await file.path()) };
  };
  return { ...opened, take, download };
}

test('the downloaded page plays the morph from a file, without a network', async (t) => {
  const { page, take, download, done } = await taking();
  await take.getByRole('slider', { name: /seconds a shape/ }).fill('1');
  await take.getByLabel('Easing').selectOption('linear');
  const { name, bytes } = await download('Web page');
  assert.equal(name, 'dog-giraffe.html');
  const html = bytes.toString();
  assert.doesNotMatch(html, /https?:\/\/|<link|\bimport\b/, 'nothing is loaded');
  const folder = mkdtempSync(join(tmpdir(), 'orbmorph-page-'));
  t.after(() => rmSync(folder, { recursive: true }));
  const context = await browser.newContext({
    viewport: { width: 500, height: 400 },
    colorScheme: 'light',
    offline: true,
  });
  const other = await context.newPage();
  const faults = [];
  other.on('pageerror', (error) => faults.push(error.stack));
  other.on('console', (message) => message.type() === 'error' && faults.push(message.text()));
  other.on('request', (request) => /^https?:/.test(request.url()) && faults.push(request.url()));
  const file = join(folder, name);
  await writeFile(file, bytes);
  await other.goto(pathToFileURL(file).href);
  await other.locator('body[data-ready]').waitFor();
  const shape = (r, _g, b) => r - b > 45; // the dog's tint: more than the background, and no button
  await until(async () => (await countPixels(other, 'canvas', shape)) > 3000, 'the morph appears in its tints');
  const first = await shot(other);
  await until(async () => (await difference(browser, first, await shot(other))) > 0.02, 'it plays');
  await other.getByRole('button', { name: 'Pause' }).click();
  const slider = other.getByRole('slider', { name: 'Along the morph' });
  await slider.fill('0');
  await other.waitForTimeout(200);
  const dog = await shot(other);
  await slider.fill('1');
  await other.waitForTimeout(200);
  assert.ok((await difference(browser, dog, await shot(other))) > 0.02, 'the other end is another shape');
  assert.match(await slider.getAttribute('aria-valuetext'), /giraffe/);
  const box = await other.locator('canvas').boundingBox();
  const before = await shot(other);
  await other.mouse.move(box.width / 2, box.height / 2);
  await other.mouse.down();
  await other.mouse.move(box.width / 2 + 90, box.height / 2, { steps: 4 });
  await other.mouse.up();
  await other.waitForTimeout(200);
  assert.ok((await difference(browser, before, await shot(other))) > 0.02, 'dragging rotates it');
  assert.deepEqual(faults, []);
  await context.close();
  await page.keyboard.press('Escape');
  await done();
});

/** Decodes an animated picture in the browser: its frames' sizes, durations in ms, and how much they differ. */
const decode = (page, bytes, type) =>
  page.evaluate(
    async ({ data, type }) => {
      const raw = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
      const decoder = new ImageDecoder({ data: raw, type });
      await decoder.tracks.ready;
      await decoder.completed;
      const { frameCount, repetitionCount } = decoder.tracks.selectedTrack;
      const frames = [];
      let first = null;
      for (let frameIndex = 0; frameIndex < frameCount; frameIndex++) {
        const { image } = await decoder.decode({ frameIndex });
        const canvas = new OffscreenCanvas(image.displayWidth, image.displayHeight);
        const context = canvas.getContext('2d');
        context.drawImage(image, 0, 0);
        const pixels = context.getImageData(0, 0, canvas.width, canvas.height).data;
        first ??= pixels;
        let other = 0;
        for (let i = 0; i < pixels.length; i += 4) if (Math.abs(pixels[i + 2] - first[i + 2]) > 40) other++;
        frames.push({ width: canvas.width, ms: image.duration / 1000, other: (4 * other) / pixels.length });
        image.close();
      }
      return { frames, repetitionCount };
    },
    { data: bytes.toString('base64'), type },
  );

test('pictures and films: PNG, GIF, WebP and video, named after the shapes', async () => {
  const { page, take, download, done } = await taking();
  await take.getByRole('slider', { name: /seconds a shape/ }).fill('0.5');
  await take.getByRole('button', { name: '360 × 360' }).click();
  const png = await download('Picture');
  assert.equal(png.name, 'dog-giraffe.png');
  assert.deepEqual([png.bytes.readUInt32BE(16), png.bytes.readUInt32BE(20)], [1600, 1200]);
  const glb = await download('GLB');
  assert.equal(glb.name, 'dog-giraffe.glb');
  assert.deepEqual(morphOf(glb.bytes).names, ['giraffe']);
  for (const [label, type, rate] of [
    ['GIF', 'image/gif', 20],
    ['WebP', 'image/webp', 25],
  ]) {
    const { name, bytes } = await download(label);
    assert.equal(name, `dog-giraffe.${label.toLowerCase()}`);
    const { frames, repetitionCount } = await decode(page, bytes, type);
    assert.equal(frames.length, rate, `${label}: a second there and back`);
    assert.equal(repetitionCount, Infinity);
    assert.ok(frames.every((f) => f.width === 360 && Math.abs(f.ms - 1000 / rate) < 1));
    assert.ok(frames[Math.floor(rate / 2)].other > 0.02, `${label}: halfway is the other shape`);
    assert.ok(frames[rate - 1].other < 0.01, `${label}: the end meets the beginning`);
  }
  const video = take.getByRole('button', { name: /^(MP4|WebM)$/ });
  const { name, bytes } = await download(await video.innerText());
  assert.match(name, /^dog-giraffe\.(mp4|webm)$/);
  const other = await browser.newPage(); // the studio's policy allows no video
  const size = await other.evaluate(
    async ([data, type]) => {
      const element = document.createElement('video');
      const raw = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
      element.src = URL.createObjectURL(new Blob([raw], { type }));
      await new Promise((resolve, reject) => {
        element.onloadedmetadata = resolve;
        element.onerror = () => reject(new Error(element.error.message));
      });
      return [element.videoWidth, element.videoHeight];
    },
    [bytes.toString('base64'), name.endsWith('mp4') ? 'video/mp4' : 'video/webm'],
  );
  assert.deepEqual(size, [360, 360]);
  await other.close();
  await done();
});

test('a film goes on to the first shape or back again, is eased, and turns the shape', async () => {
  const { page, take, download, done } = await taking({
    files: ['dog.obj', 'giraffe.off', 'elephant.ply'],
    landmarks: 'dog-giraffe-elephant.json',
  });
  await take.getByRole('slider', { name: /seconds a shape/ }).fill('0.5');
  await take.getByRole('button', { name: '360 × 360' }).click();
  /** How much each of the 20 frames a second differs from the first one. */
  const film = async () => (await decode(page, (await download('GIF')).bytes, 'image/gif')).frames.map((f) => f.other);
  const back = await film();
  assert.equal(back.length, 40, 'back again: four ways of half a second');
  await take.getByRole('button', { name: 'On to the first' }).click();
  await take.getByLabel('Easing').selectOption('linear');
  const loop = await film();
  assert.equal(loop.length, 30, 'on to the first: three ways');
  assert.ok(loop[29] < 0.5 * loop[20] && loop[20] > 0.02, `the last way leads to the first shape: ${loop}`);
  await take.getByLabel('Easing').selectOption('slow');
  const slow = await film();
  assert.ok(slow[2] < 0.8 * loop[2], `a slow start: ${slow[2]}, ${loop[2]}`);
  await take.getByRole('button', { name: 'Both' }).click();
  const both = await film();
  assert.ok(both.length === 30 && Math.abs(both[15] - slow[15]) > 0.01, `it turns as well: ${both[15]}, ${slow[15]}`);
  await take.getByRole('button', { name: 'A turntable' }).click();
  const turn = await film();
  assert.equal(turn.length, 120, 'one turn in six seconds');
  assert.ok(turn[119] < 0.3 * turn[30], `the end meets the beginning: ${turn[119]}, ${turn[30]}`);
  await done();
});

/** A closed surface with one triangle strip per ring, which only the daemon reads. */
function strips() {
  const [rings, around] = [9, 16];
  const points = [[0, 1.4, 0]];
  for (let i = 1; i < rings; i++)
    for (let j = 0; j < around; j++) {
      const [v, h] = [(Math.PI * i) / rings, (2 * Math.PI * j) / around];
      points.push([Math.sin(v) * Math.cos(h), 1.4 * Math.cos(v), Math.sin(v) * Math.sin(h)]);
    }
  const last = points.push([0, -1.4, 0]) - 1;
  const at = (i, j) => (i === 0 ? 0 : i === rings ? last : 1 + (i - 1) * around + (j % around));
  const strip = [];
  for (let i = 1; i < rings - 1; i++) {
    for (let j = 0; j <= around; j++) strip.push(at(i, j), at(i + 1, j));
    strip.push(-1);
  }
  for (let j = 0; j < around; j++)
    strip.push(0, at(1, j + 1), at(1, j), -1, last, at(rings - 1, j), at(rings - 1, j + 1), -1);
  const head = `ply\nformat ascii 1.0\nelement vertex ${points.length}\nproperty float x\nproperty float y\nproperty float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n`;
  const text = `${head}${points.map((p) => `${p.join(' ')}\n`).join('')}${strip.length} ${strip.join(' ')}\n`;
  return { name: 'strips.ply', mimeType: 'text/plain', buffer: Buffer.from(text), triangles: 2 * around * (rings - 1) };
}

/** An egg in 3MF, in inches. */
function threeMfFile() {
  const { positions, triangles } = ball(3);
  const egg = { positions: positions.map(([x, y, z]) => [1.4 * x, y, 0.8 * z]), triangles };
  return { name: 'egg.3mf', mimeType: 'model/3mf', buffer: threeMf(egg, 'inch'), triangles: triangles.length };
}

for (const [kind, make] of [
  ['PLY of strips', strips],
  ['3MF', threeMfFile],
])
  test(`what only the daemon can read is shown as the daemon has it: ${kind}`, () => shownByDaemon(make()));

async function shownByDaemon({ triangles, ...file }) {
  const { page, done } = await openPage(browser, daemon.url);
  await page.locator('input[type=file]').first().setInputFiles([file]);
  await until(() => page.locator('.card.ready').count(), 'the daemon accepts it');
  await until(
    async () => (await page.locator('.caption').innerText()).includes(`${triangles} triangles`),
    'its triangles',
  );
  assert.equal(await page.getByRole('alert').count(), 0);
  await settled(page);
  const tinted = (r, g, b) => r - b > 40 && r > g;
  await until(async () => (await countPixels(page, '.pane-view', tinted)) > 5000, 'it is drawn');
  await done();
}

/** A ball whose texture is red on its upper half and green on its lower one, and one of blue vertices. */
function dressed() {
  const { positions, triangles } = ball(3);
  const uv = positions.map(([x, y]) => [(x + 1) / 2, (1 - y) / 2]);
  const image = writePng(32, 32, (_x, y) => (y < 16 ? [230, 20, 20] : [20, 200, 20]));
  const lines = ['ply', 'format ascii 1.0', `element vertex ${positions.length}`];
  for (const axis of 'xyz') lines.push(`property float ${axis}`);
  for (const color of ['red', 'green', 'blue']) lines.push(`property uchar ${color}`);
  lines.push(`element face ${triangles.length}`, 'property list uchar int vertex_indices', 'end_header');
  for (const [x, y, z] of positions) lines.push(`${1.2 * x} ${y} ${z} 20 30 230`);
  for (const triangle of triangles) lines.push(`3 ${triangle.join(' ')}`);
  return [
    { name: 'textured.glb', mimeType: 'model/gltf-binary', buffer: writeGlb({ positions, uv, triangles, image }) },
    { name: 'blue.ply', mimeType: 'text/plain', buffer: Buffer.from(`${lines.join('\n')}\n`) },
  ];
}

test('files of a glTF that are dropped with it are put into it; other files without a shape are left out', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const folder = mkdtempSync(join(tmpdir(), 'orbmorph-drop-'));
  const { buffer } = dressed()[0];
  const size = buffer.readUInt32LE(12);
  const document = JSON.parse(buffer.toString('utf8', 20, 20 + size));
  const bin = buffer.subarray(28 + size);
  document.buffers[0].uri = 'my%20ball.bin';
  const view = document.bufferViews[document.images[0].bufferView];
  document.images[0] = { uri: 'textures/skin.png' };
  const files = {
    'ball.gltf': JSON.stringify(document),
    'my ball.bin': bin,
    'skin.png': bin.subarray(view.byteOffset, view.byteOffset + view.byteLength),
    'egg.obj': `mtllib egg.mtl\n${obj(ball(3, ([x, y, z]) => [x, 1.3 * y, z]))}`,
    'egg.mtl': 'newmtl red\nKd 1 0 0\n',
  };
  for (const [name, bytes] of Object.entries(files)) await writeFile(join(folder, name), bytes);
  await page.locator('input[type=file]').first().waitFor({ state: 'attached' });
  await dropFiles(page, ...Object.keys(files).map((name) => join(folder, name)));
  await until(async () => (await shownToasts(page)).some((text) => /Left out.*: egg\.mtl$/.test(text)), 'what is left');
  await defaultShown(page);
  await button(page, 'Pause').click();
  const [top, bottom] = await halves(page, 0);
  assert.ok(top[0] > 4000 && top[0] > 8 * top[1], `red above: ${top}`);
  assert.ok(bottom[1] > 4000 && bottom[1] > 2 * bottom[0], `green below: ${bottom}`);
  await button(page, 'Shapes', { exact: true }).click();
  assert.deepEqual(await page.locator('.card strong').allInnerTexts(), ['ball', 'egg']);
  rmSync(folder, { recursive: true });
  await done();
});

/**
 * The numbers of pixels of the upper and the lower half of a view that are red, green, blue: one channel far stronger
 * than the others.
 */
async function halves(page, index) {
  await settled(page);
  const { x, y, width, height } = await page.locator('.pane-view').nth(index).boundingBox();
  const counts = [];
  for (const top of [y, y + height / 2]) {
    const [pixels] = readPng(await shot(page, { x, y: top, width, height: height / 2 })).frames;
    const found = [0, 0, 0];
    for (let i = 0; i < pixels.length; i += 3) {
      const rgb = [...pixels.subarray(i, i + 3)];
      const strongest = rgb.indexOf(Math.max(...rgb));
      if (rgb.every((c, k) => k === strongest || c < 0.5 * rgb[strongest])) found[strongest]++;
    }
    counts.push(found);
  }
  return counts;
}

test('textures and colours of the files are on the stage, before and after the morph', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, ...dressed());
  const upright = ([top, bottom], what) => {
    assert.ok(top[0] > 4000 && top[0] > 8 * top[1], `${what}: red above, ${top}`);
    assert.ok(bottom[1] > 4000 && bottom[1] > 2 * bottom[0], `${what}: green below, ${bottom}`);
  };
  upright(await halves(page, 0), 'the file');
  const [top, bottom] = await halves(page, 1);
  assert.ok(top[2] > 4000 && bottom[2] > 4000, `blue vertices: ${top}, ${bottom}`);
  await button(page, /^Morph 2 shapes$/).click();
  await defaultShown(page);
  await button(page, 'Pause').click();
  upright(await halves(page, 0), 'the morph');
  // decoded images are large: they are freed together with their view, not when the browser finds the time
  const drawing = page.workers().find((worker) => /draw/.test(worker.url()));
  await drawing.evaluate(() => {
    const close = ImageBitmap.prototype.close;
    globalThis.closed = 0;
    ImageBitmap.prototype.close = function () {
      globalThis.closed++;
      close.call(this);
    };
  });
  await button(page, 'Shapes', { exact: true }).click();
  await button(page, /^Remove /)
    .first()
    .click();
  await until(
    () => drawing.evaluate(() => globalThis.closed === 2),
    'the images of the shape and the morph are closed',
  );
  await done();
});

test('after a repair, picture and counts are those of the repaired mesh', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  let left = 60;
  const lines = (await readFile(sample('dog.obj'), 'utf8')).split('\n');
  const open = lines.filter((line) => !(line.startsWith('f ') && left-- > 0)).join('\n');
  const file = { name: 'open.obj', mimeType: 'text/plain', buffer: Buffer.from(open) };
  await page.locator('input[type=file]').first().setInputFiles([file]);
  await button(page, 'Fill the holes').click();
  await until(() => page.locator('.card.ready').count(), 'the daemon accepts it');
  const [mesh] = (await (await fetch(`${daemon.url}/v1/meshes?limit=100`)).json()).meshes.filter(
    (m) => m.name === 'open',
  );
  const said = async () =>
    Number((await page.locator('.caption').innerText()).match(/([\d\s]+) triangles/)[1].replace(/\D/g, ''));
  assert.ok(mesh.triangles > 5600 - 60, String(mesh.triangles));
  await until(async () => (await said()) === mesh.triangles, `${mesh.triangles} triangles`);
  await done();
});

test('a shape whose triangles faced inwards is shown as the daemon faced them', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const add = (name, shape) =>
    page
      .locator('input[type=file]')
      .first()
      .setInputFiles([{ name, mimeType: 'text/plain', buffer: Buffer.from(obj(shape)) }]);
  const tinted = (r, _g, b) => Math.abs(r - b) > 40;
  const drawn = async () => {
    await settled(page);
    return countPixels(page, '.pane-view', tinted);
  };
  await add('outwards.obj', ball());
  await counted(page.locator('.card.ready'), 1, 'it is accepted');
  const whole = await drawn();
  assert.ok(whole > 4000, String(whole));
  await button(page, 'Remove outwards').click();
  await add(
    'partly.obj',
    reversed(ball(), (t) => t % 5 === 0),
  );
  await page.getByText(/^Repaired: reorient/).waitFor();
  await until(async () => Math.abs((await drawn()) - whole) < 0.01 * whole, 'the ball has no gaps');
  await done();
});

test('a link whose morph or shapes are gone says so', async () => {
  const none = (digit) => digit.repeat(64);
  for (const [hash, expected] of [
    [`#m=${none('a')},${none('b')}&tab=morph&r=${none('c')}`, /This link is dead\s+Its 2 shapes are not on the server/],
    [`#r=${none('c')}`, /This link is dead\s+Its morph is not on the server/],
  ]) {
    const { page, done } = await openPage(browser, daemon.url, { hash });
    const alert = page.getByRole('alert');
    await alert.waitFor();
    assert.match(await alert.innerText(), expected);
    await button(page, 'Dismiss').click();
    await alert.waitFor({ state: 'detached' });
    await done();
  }
});

test('a link that is cut off, or whose job is gone, says so', async () => {
  const [dog, giraffe] = await Promise.all(
    ['dog.obj', 'giraffe.off'].map(async (name) => {
      const init = { method: 'POST', body: await readFile(sample(name)) };
      return (await json(daemon.url, `/v1/meshes?name=${name.split('.')[0]}`, init)).id;
    }),
  );
  const job = '1'.repeat(32);
  for (const [hash, cards, expected] of [
    [`#m=${dog.slice(0, 40)}`, 0, /This link is damaged/],
    [`#m=${dog},${giraffe.slice(0, 10)}`, 1, /This link is damaged/],
    [`#m=${dog},${giraffe}&r=${dog.slice(1)}`, 2, /This link is damaged/],
    [`#m=${dog},${'a'.repeat(64)}`, 1, /1 of the 2 shapes of this link is no longer on the server/],
    [`#m=${dog},${giraffe}&j=${job}`, 2, /The job of this link is gone\s+The server .* Press Morph to start it again/],
    [
      `#m=${dog},${giraffe}&tab=landmarks&j=${job}&find=1`,
      0,
      /The job of this link is gone\s+The server .* Press Find them for me/,
    ],
  ]) {
    const { page, done } = await openPage(browser, daemon.url, { hash });
    const alert = page.getByRole('alert');
    await alert.waitFor();
    assert.match(await alert.innerText(), expected);
    await counted(page.locator('.card'), cards, `${hash}: its shapes`);
    await done();
  }
});

test('a link whose shapes are gone says so once, also if its morph is looked for after that', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  let answer;
  const dismissed = new Promise((resolve) => (answer = resolve));
  await page.route('**/v1/supermeshes/*', async (route) => {
    await dismissed;
    await route.continue();
  });
  const answered = page.waitForResponse('**/v1/supermeshes/*');
  await page.goto(`${daemon.url}/#m=${'a'.repeat(64)}&r=${'c'.repeat(64)}`); // the page reloads by itself
  await page.getByRole('alert').getByText('Its shape is not on the server').waitFor();
  await button(page, 'Dismiss').click();
  await page.getByRole('alert').waitFor({ state: 'detached' });
  answer();
  assert.equal((await answered).status(), 404);
  await settled(page);
  assert.equal(await page.getByRole('alert').count(), 0);
  await done();
});
