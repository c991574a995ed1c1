// The work of a modeller, from the empty page to the file on disk.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { mkdtemp, readFile, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { promisify } from 'node:util';
import { ball, obj } from '../scenario/support/shapes.mjs';
import { browser, daemon } from './started.mjs';
import { landmarked, landmarks, morph, scrubber, seek, shownId, slide, startOccupied } from './steps.mjs';
import { countPixels, difference, shot } from './pictures.mjs';
import {
  addFiles,
  button,
  counted,
  hideToasts,
  json,
  openPage,
  root,
  sample,
  settled,
  shownToasts,
  until,
} from './support.mjs';

const time = (page) => scrubber(page).evaluate((input) => Number(input.value));

test('from the empty page to a playing morph in at most five clicks', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  let clicks = 0;
  const click = async (name) => {
    await button(page, name).click();
    clicks++;
  };
  // the first sample arrives last
  await page.route('**/dog*.obj', async (route) => {
    await new Promise((resolve) => setTimeout(resolve, 700));
    await route.continue();
  });
  await click('Try with samples');
  await counted(page.locator('.card.ready'), 2, 'two samples are taken');
  assert.deepEqual(await page.locator('.card strong').allInnerTexts(), ['dog', 'giraffe']);
  await click(/^Morph 2 shapes$/);
  await until(() => button(page, 'Pause').count(), 'the morph plays');
  const seen = new Set();
  await until(async () => seen.add(await time(page)).size > 5, 'time passes');
  assert.ok(clicks <= 5, `${clicks} clicks`);
  await page.getByText('Shown: the default morph.').waitFor();
  assert.equal(await page.getByText(/^Not sure/).count(), 0, 'the samples show a match that is worth showing');
  await done();
});

test('morph with landmarks, scrub, mix, wireframe, download', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  await landmarked(page);
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
    shots.push(await shot(page.locator('.stage-area')));
  }
  assert.ok((await difference(browser, shots[0], shots[1])) > 0.005, 'halfway differs from the first shape');
  assert.ok((await difference(browser, shots[1], shots[2])) > 0.005, 'halfway differs from the second shape');

  await slide(page.getByRole('slider', { name: 'Share of dog' }), 0.5);
  await settled(page);
  assert.ok((await difference(browser, await shot(page.locator('.pane')), await shot(page.locator('.pane')))) === 0);
  assert.equal(await page.getByRole('slider', { name: 'Share of giraffe' }).inputValue(), '0.5');

  const plain = await shot(page.locator('.stage-area'));
  await page.getByRole('switch', { name: 'Wireframe' }).click();
  await settled(page);
  assert.ok(
    (await difference(browser, plain, await shot(page.locator('.stage-area')))) > 0.005,
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
    const drawn = await shot(page.locator('.stage-area'));
    await page.getByRole('switch', { name: 'Wireframe' }).click();
    await settled(page);
    assert.ok(
      (await difference(browser, drawn, await shot(page.locator('.stage-area')))) > 0.005,
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

test('a fit that turns a shape over is said', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const [dog, giraffe] = [await readFile(sample('dog.obj')), await readFile(sample('giraffe.off'), 'latin1')];
  // by half a turn about x: up becomes down, and the fit rotates it back by as much
  const over = giraffe.replace(/^(-?[\d.]+) (-?[\d.]+) (-?[\d.]+)$/gm, (line, x, y, z) =>
    /\./.test(line) ? `${x} ${-y} ${-z}` : line,
  );
  assert.notEqual(over, giraffe);
  await addFiles(
    page,
    { name: 'dog.obj', mimeType: 'text/plain', buffer: dog },
    { name: 'giraffe.off', mimeType: 'text/plain', buffer: Buffer.from(over, 'latin1') },
  );
  await landmarked(page);
  await morph(page);
  const said = await page.getByRole('list', { name: 'Shapes that the fit rotated' }).innerText();
  assert.match(said, /The fit rotated the up axis of giraffe by 180°/);
  const moved = page.getByRole('list', { name: 'Shapes that the fit moved' });
  assert.match(
    await moved.innerText(),
    /^Onto dog, giraffe was scaled by 0\.\d+, rotated by 180°, and moved by 0\.\d+ d/,
  );
  assert.ok(await page.locator('.inspector .scroll').evaluate((e) => e.scrollWidth <= e.clientWidth), 'it fits');
  await done();
});

test('a reload and the URL alone restore the same state', async () => {
  const first = await openPage(browser, daemon.url);
  await addFiles(first.page, sample('dog.obj'), sample('giraffe.off'));
  await landmarked(first.page);
  const count = await landmarks(first.page).count();
  await morph(first.page);
  await button(first.page, 'Pause').click();
  await seek(first.page, 0.25);
  await until(() => /t=0\.250/.test(first.page.url()), 'the URL holds the time');
  await hideToasts(first.page);
  await settled(first.page);
  const before = await shot(first.page.locator('.pane'));
  await first.page.reload();
  await until(() => button(first.page, 'Play').count(), 'the morph is back');
  await settled(first.page);
  await until(
    async () => (await difference(browser, before, await shot(first.page.locator('.pane')))) < 0.002,
    'it looks the same',
  );
  const address = first.page.url();
  await seek(first.page, 0.5);
  await first.page.reload();
  await until(() => button(first.page, 'Play').count(), 'the morph is back');
  assert.equal(await time(first.page), 0.5, 'a reload at once, before the URL is written');
  await first.done();

  const second = await openPage(browser, daemon.url, { hash: new URL(address).hash });
  await until(() => button(second.page, 'Play').count(), 'the morph is there');
  assert.equal(await time(second.page), 0.25);
  await button(second.page, 'Landmarks').click();
  assert.equal(await landmarks(second.page).count(), count);
  await second.done();
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
  await button(page, 'Remove letter').click();
  const buffer = Buffer.from(JSON.stringify({ asset: { version: '2.0' }, buffers: [{ uri: 'a.bin', byteLength: 9 }] }));
  const file = { name: 'half.gltf', mimeType: 'model/gltf+json', buffer };
  await page.locator('input[type=file]').first().setInputFiles([file]);
  await page.getByRole('alert').getByText('half needs a.bin, which was not added with it.').waitFor();
  await done();
});

test('a morph is cancelled before it is done', async (t) => {
  // The morph cannot finish before it is cancelled.
  const busy = await startOccupied(t);
  const { page, done } = await openPage(browser, busy.url);
  await addFiles(page, sample('dog.obj'), sample('elephant.ply'));
  await page.getByText('Options', { exact: true }).click();
  await slide(page.getByRole('slider', { name: /^Tolerance/ }), -4);
  await button(page, /^Morph 2 shapes$/).click();
  await button(page, 'Cancel').click();
  await until(() => shownToasts(page).then((list) => list.includes('Cancelled.')), 'the page says so');
  const { jobs } = await json(busy.url, '/v1/jobs');
  const morph = jobs.find(({ kind }) => kind === 'supermesh');
  await until(async () => (await json(busy.url, morph.url)).state === 'cancelled', 'the job has stopped');
  await button(page, /^Morph 2 shapes$/).waitFor();
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
  // morphs of the same shapes are told apart by their size and age
  for (const text of await page.locator('.list .item', { hasText: '→' }).allInnerTexts())
    assert.match(text, /\d triangles · (just now|\d+ (min|h) ago)/);
  await page.locator('.list .item', { hasText: '→' }).first().click();
  await until(() => button(page, /^(Play|Pause)$/).count(), 'the morph opens');
  await done();
});

test('a morph opens with its options; one whose shapes were deleted says so, and leaves the page as it is', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  const pear = async (name, map) => {
    const { positions, triangles } = ball(2, map);
    const init = { method: 'POST', body: obj({ positions, triangles }) };
    return (await json(daemon.url, `/v1/meshes?name=${name}`, init)).id;
  };
  const [thin, wide] = [
    await pear('thin', (p) => [0.6 * p[0], p[1], p[2]]),
    await pear('wide', (p) => [2 * p[0], ...p.slice(1)]),
  ];
  const { id } = await json(daemon.url, '/v1/supermeshes', {
    method: 'POST',
    headers: { 'Content-Type': 'application/json', Prefer: 'wait=60' },
    body: JSON.stringify({
      shapes: [{ mesh: thin }, { mesh: wide, name: 'broad' }],
      align: { method: 'rotate' },
      remesh: { method: 'subdivision', tolerance: 0.03, max_triangles: 2000 },
      asset: { fit: 'none', path: 'rigid', path_steps: 2, animation: 'none' },
    }),
  });
  // a morph is opened with its options: made again, it is the same one
  const open = async () => {
    await button(page, 'On the server', { exact: true }).click();
    await page.locator('.list .item', { hasText: 'thin → broad' }).click();
  };
  await open();
  await shownId(page);
  await page.getByText('Options', { exact: true }).click();
  await page.getByText('As the opened morph: animation none, path steps 2.').waitFor();
  const ofThese = async () =>
    (await json(daemon.url, '/v1/supermeshes?limit=100')).supermeshes.filter(
      ({ shapes }) => shapes[1].name === 'broad',
    );
  await button(page, 'Morph again').click();
  await until(
    async () => (await button(page, 'Morph again').count()) && (await button(page, 'Pause').count()),
    'again',
  );
  assert.equal(await shownId(page), id);
  assert.equal((await ofThese()).length, 1, 'there is no other');
  await button(page, 'Shapes', { exact: true }).click();
  await button(page, 'Remove thin').click();
  await button(page, 'Remove broad').click();
  await addFiles(page, sample('dog.obj'));
  // who deletes something is asked first
  await button(page, 'On the server', { exact: true }).click();
  await button(page, 'Delete the shape wide').click();
  await button(page, 'Keep the shape wide').click();
  await button(page, 'Delete the shape wide').click();
  assert.equal((await fetch(`${daemon.url}/v1/meshes/${wide}`)).status, 200);
  await button(page, 'Delete the shape wide for good').click();
  await until(async () => (await fetch(`${daemon.url}/v1/meshes/${wide}`)).status === 404, 'it is deleted');
  await button(page, 'Close').click();
  await open();
  const alert = page.getByRole('alert');
  await alert.waitFor();
  assert.match(await alert.innerText(), /Shapes of this morph are missing\s+broad is no longer on the server/);
  assert.deepEqual(await page.locator('.card strong').allInnerTexts(), ['dog']);
  await done();
});

test('the offered commands and pages show this morph', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  await landmarked(page);
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

  // Serves the pages from another site, with the asset beside them; the npm packages here answer for the CDN.
  const context = await browser.newContext({ viewport: { width: 400, height: 300 } });
  const faults = [];
  await context.route('http://somebody.example/dog-giraffe.glb', (route) => route.fulfill({ body: asset }));
  for (const [title, folder, element] of [
    ['three.js', 'client/web/node_modules/three', 'canvas'],
    ['model-viewer', 'tests/node_modules/@google/model-viewer', 'model-viewer'],
  ]) {
    const html = await text(title);
    const { name, version } = JSON.parse(await readFile(join(root, folder, 'package.json'), 'utf8'));
    const cdn = `https://cdn.jsdelivr.net/npm/${name}@${version}/`;
    await context.route(`${cdn}**`, (route) =>
      route.fulfill({
        headers: { 'Access-Control-Allow-Origin': '*' },
        path: join(root, folder, route.request().url().slice(cdn.length)),
      }),
    );
    const site = `http://somebody.example/${title}.html`;
    await context.route(site, (route) => route.fulfill({ contentType: 'text/html', body: html }));
    const other = await context.newPage();
    other.on('pageerror', (error) => faults.push(error.stack));
    other.on('requestfailed', (request) => faults.push(request.url()));
    await other.goto(site);
    await other.locator(element).first().waitFor();
    const ground = (r, g, b) => Math.abs(r - 0xf3) + Math.abs(g - 0xf1) + Math.abs(b - 0xec) > 60 && r + g + b > 60;
    await until(async () => (await countPixels(other, element, ground)) > 2000, `${title}: the morph appears`);
    const first = await shot(other);
    await until(async () => (await difference(browser, first, await shot(other))) > 0.01, `${title}: and moves`);
    await other.close();
  }
  assert.deepEqual(faults, []);
  await context.close();
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
    for (const i of [0, 1, 2]) await slide(shares.nth(i), Number(i === chosen));
    await settled(page);
    pictures.push(await shot(page.locator('.pane')));
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
