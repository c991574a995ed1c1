// The default morph of files in other units and with other axes, by the command line, the API and the studio: upright
// and of constant size.
//
//   node tests/long/units.mjs FILE.png
//
// The dog of the samples is in its file's units and stands along y; the giraffe is in units of 1 and 100 and stands along
// y and z. Draws a row for each of these four giraffes: the sheet of the command line, the asset of the API at five
// times, and the studio at its start, its middle and its end. Exits with 1 if a request differs between the three, or if
// the size of the morph leaves that of its ends.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { promisify } from 'node:util';
import {
  addFiles,
  button,
  defaultShown,
  openPage,
  root,
  sample,
  settled,
  startBrowser,
  startDaemon,
} from '../studio/support.mjs';
import { morphOf } from '../scenario/support/glb.mjs';
import { sheet } from './sheet.mjs';

const [out] = process.argv.slice(2);
assert.ok(out, 'usage: units.mjs FILE.png');
const run = promisify(execFile);
const program = join(root, 'build/bin/orbmorph');
const folder = await mkdtemp(join(tmpdir(), 'orbmorph-units-'));
const daemon = await startDaemon();
const browser = await startBrowser();
const env = { ...process.env, ORBMORPH_SERVER: daemon.url };

/** The giraffe in another unit, and perhaps with z up. */
const giraffe = (await readFile(sample('giraffe.off'), 'latin1')).split('\n');
const variant = (unit, zUp) =>
  giraffe
    .map((line, i) => {
      const p = line.split(' ').map(Number);
      if (i < 2 || p.length !== 3) return line;
      return (zUp ? [p[0], -p[2], p[1]] : p).map((x) => unit * x).join(' ');
    })
    .join('\n');

/** The largest side of the morph's box at its ends and between them. */
function sizes(bytes) {
  const { shapes } = morphOf(bytes);
  return [0, 0.25, 0.5, 0.75, 1].map((t) => {
    const [low, high] = [Array(3).fill(Infinity), Array(3).fill(-Infinity)];
    shapes[0].forEach((from, i) => {
      const x = (1 - t) * from + t * shapes[1][i];
      low[i % 3] = Math.min(low[i % 3], x);
      high[i % 3] = Math.max(high[i % 3], x);
    });
    const range = high.map((x, k) => x - low[k]);
    return { tall: range[1], largest: Math.max(...range) };
  });
}

async function inStudio(file) {
  const { page, done } = await openPage(browser, daemon.url, {
    colorScheme: 'light',
    viewport: { width: 900, height: 560 },
  });
  await addFiles(page, sample('dog.obj'), file);
  await button(page, /^Morph 2 shapes$/).click();
  await defaultShown(page);
  await button(page, 'Pause').click();
  const pictures = [];
  for (const time of ['0', '0.5', '1']) {
    await page.getByRole('slider', { name: 'Along the morph' }).evaluate((input, value) => {
      input.value = value;
      input.dispatchEvent(new Event('input', { bubbles: true }));
    }, time);
    await settled(page);
    pictures.push(await page.locator('.pane-view').screenshot());
  }
  const link = await page.getByRole('link', { name: 'Download GLB' }).getAttribute('href');
  await done();
  return { pictures, id: /[0-9a-f]{64}/.exec(link)[0] };
}

const post = async (path, body, type) => {
  const reply = await fetch(daemon.url + path, { method: 'POST', body, headers: { 'Content-Type': type } });
  assert.ok(reply.ok, `${path}: ${reply.status}`);
  return reply.json();
};

/** The same morph with only the names of the shapes. */
async function byApi(file) {
  const meshes = [];
  for (const [name, path] of [
    ['dog', sample('dog.obj')],
    ['giraffe', file],
  ])
    meshes.push({
      mesh: (await post(`/v1/meshes?name=${name}`, await readFile(path), 'application/octet-stream')).id,
      name,
    });
  const job = await post('/v1/supermeshes', JSON.stringify({ shapes: meshes }), 'application/json');
  for (let at = job; ; at = await (await fetch(daemon.url + job.url)).json()) {
    if (at.state === 'succeeded' || at.certificate) {
      const supermesh = at.certificate ? at : await (await fetch(daemon.url + at.result)).json();
      return { supermesh, glb: Buffer.from(await (await fetch(daemon.url + supermesh.asset)).arrayBuffer()) };
    }
    assert.notEqual(at.state, 'failed', JSON.stringify(at.problem));
    await new Promise((resolve) => setTimeout(resolve, 300));
  }
}

const rows = [];
for (const zUp of [false, true])
  for (const unit of [1, 100]) {
    const title = `units of ${unit}, ${zUp ? 'z' : 'y'} up`;
    const file = join(folder, 'giraffe.off');
    const [glb, png, again, other] = ['morph.glb', 'sheet.png', 'api.glb', 'api.png'].map((name) => join(folder, name));
    await writeFile(file, variant(unit, zUp));
    await run(program, ['morph', sample('dog.obj'), file, '-o', glb], { env });
    await run(program, ['view', glb, '-o', png]);
    const api = await byApi(file);
    await writeFile(again, api.glb);
    await run(program, ['view', again, '-o', other]);
    const studio = await inStudio(file);
    assert.deepEqual(await readFile(glb), api.glb, `${title}: command line and API differ`);
    assert.equal(studio.id, api.supermesh.id, `${title}: the studio differs`);
    const size = sizes(api.glb);
    const [first, last] = [size[0], size[4]];
    for (const { tall, largest } of size) {
      assert.ok(largest > 0.8 * Math.min(first.largest, last.largest), `${title}: it shrinks`);
      assert.ok(largest < 1.2 * Math.max(first.largest, last.largest), `${title}: it grows`);
      assert.ok(tall > 0.8 * Math.min(first.tall, last.tall), `${title}: it lies down`);
    }
    const { fit } = api.supermesh.shapes[1];
    console.log(
      `${title}: ${fit.kind}, scaled by ${fit.scale.toPrecision(3)}, rotated by ${fit.rotation_degrees.toFixed(0)}°`,
    );
    rows.push({
      title: `${title}: command line | API | studio`,
      pictures: [await readFile(png), await readFile(other), ...studio.pictures].map((p) => p.toString('base64')),
    });
  }
await writeFile(out, await sheet(browser, rows, { across: 1, width: 200, height: 100, wide: 2 }));
await browser.close();
await daemon.stop();
await rm(folder, { recursive: true, force: true });
