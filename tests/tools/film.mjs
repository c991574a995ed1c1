// Makes docs/morph.webp, the film of the README, with the studio: node tests/tools/film.mjs
import { copyFile } from 'node:fs/promises';
import { join } from 'node:path';
import {
  addFiles,
  button,
  defaultShown,
  openPage,
  root,
  sample,
  startBrowser,
  startDaemon,
  until,
} from '../studio/support.mjs';

const daemon = await startDaemon();
const browser = await startBrowser();
try {
  const { page, done } = await openPage(browser, daemon.url, { colorScheme: 'light' });
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'), sample('elephant.ply'));
  await button(page, 'Landmarks').click();
  await page.getByLabel('Landmark file').setInputFiles(sample('dog-giraffe-elephant.json'));
  await page.locator('.marks li').first().waitFor();
  await button(page, /^Morph 3 shapes$/).click();
  await until(() => button(page, 'Pause').count(), 'the morph plays');
  await defaultShown(page);
  await button(page, 'Use it').click();
  const take = page.getByRole('region', { name: 'Take it away' });
  await take.getByRole('slider', { name: /seconds a shape/ }).fill('1.6');
  await take.getByRole('button', { name: 'On to the first' }).click();
  const waiting = page.waitForEvent('download');
  await take.getByRole('button', { name: 'WebP' }).click();
  await copyFile(await (await waiting).path(), join(root, 'docs/morph.webp'));
  await done();
} finally {
  await browser.close();
  await daemon.stop();
}
