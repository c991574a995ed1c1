// Drops meshes into the studio in pairs, as a visitor does: both show, morph, play and export. Nothing is set.
//
//   node tests/long/visit.mjs FOLDER MESH MESH [MESH MESH…]
//
// Writes pictures of each pair (the shapes; half the fast morph; half the default one, and its end) and the contact
// sheet pairs.png into FOLDER. Exits with 1 if a pair fails.
import assert from 'node:assert/strict';
import { mkdir, readFile, writeFile } from 'node:fs/promises';
import { basename, join } from 'node:path';
import { countPixels } from '../studio/pictures.mjs';
import {
  addFiles,
  button,
  defaultShown,
  openPage,
  settled,
  startBrowser,
  startDaemon,
  until,
} from '../studio/support.mjs';
import { parseGlb } from '../scenario/support/glb.mjs';
import { sheet } from './sheet.mjs';

const [folder, ...files] = process.argv.slice(2);
assert.ok(folder && files.length >= 2 && files.length % 2 === 0, 'usage: visit.mjs FOLDER MESH MESH [MESH MESH…]');
await mkdir(folder, { recursive: true });
const LIMIT = 180_000; // ms a step
const daemon = await startDaemon();
const browser = await startBrowser();

/** Pixels that differ from the stage, which is light. */
const drawn = (r, g, b) => Math.min(r, g, b) < 200 || Math.max(r, g, b) - Math.min(r, g, b) > 25;

async function visit(pair, pictures) {
  const { page, done } = await openPage(browser, daemon.url, {
    colorScheme: 'light',
    viewport: { width: 900, height: 560 },
  });
  page.setDefaultTimeout(LIMIT);
  const shoot = async () => {
    await settled(page);
    assert.ok((await countPixels(page, '.pane-view', drawn)) > 1500, 'the shape is drawn');
    pictures.push(await page.locator('.stage-area').screenshot());
  };
  await addFiles(page, ...pair);
  assert.equal(await page.locator('.card.ready').count(), 2, 'both are accepted');
  await shoot();
  const scrub = (value) =>
    page.getByRole('slider', { name: 'Along the morph' }).evaluate((input, time) => {
      input.value = time;
      input.dispatchEvent(new Event('input', { bubbles: true }));
    }, value);
  await button(page, /^Morph 2 shapes$/).click();
  await until(() => button(page, 'Pause').count(), 'the fast morph plays', LIMIT);
  await button(page, 'Pause').click();
  await scrub('0.5');
  await shoot();
  await defaultShown(page);
  await shoot();
  await scrub('1');
  await shoot();
  const verdict = page.getByRole('status', { name: 'How sure the match is' });
  const said = (await verdict.count()) ? await verdict.innerText() : '';
  const [download] = await Promise.all([
    page.waitForEvent('download'),
    page.getByRole('link', { name: 'Download GLB' }).click(),
  ]);
  const { gltf } = parseGlb(await readFile(await download.path()));
  assert.equal(gltf.meshes[0].primitives[0].targets.length, 1, 'a morph target');
  await done();
  return said;
}

const rows = [];
let failed = 0;
for (let i = 0; i < files.length; i += 2) {
  const pair = files.slice(i, i + 2);
  const title = pair.map((file) => basename(file)).join(' – ');
  const pictures = [];
  const begin = performance.now();
  const { said, problem } = await visit(pair, pictures).then(
    (text) => ({ said: text }),
    (error) => ({ problem: error.message.split('\n')[0] }),
  );
  failed += problem ? 1 : 0;
  console.log(
    `${problem ? 'FAILED' : 'ok'} ${title} ${((performance.now() - begin) / 1000).toFixed(1)} s ${problem ?? said}`,
  );
  for (const [k, picture] of pictures.entries()) await writeFile(join(folder, `${i / 2}-${k}.png`), picture);
  rows.push({ title: problem ? `${title}: ${problem}` : title, pictures: pictures.map((p) => p.toString('base64')) });
}
await writeFile(join(folder, 'pairs.png'), await sheet(browser, rows, { across: 1 }));
await browser.close();
await daemon.stop();
process.exit(failed ? 1 : 0);
