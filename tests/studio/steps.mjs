// Steps that tests of the studio share: landmarks, the morph and its player.
import { endless } from '../scenario/support/daemon.mjs';
import { ball, obj } from '../scenario/support/shapes.mjs';
import { button, defaultShown, sample, startDaemon, until } from './support.mjs';

export const landmarks = (page) => page.locator('.marks li');

/** Reads the landmarks of the dog and the giraffe from their file. */
export async function landmarked(page) {
  await button(page, 'Landmarks').click();
  await page.getByLabel('Landmark file').setInputFiles(sample('dog-giraffe.json'));
  await until(() => landmarks(page).count(), 'the landmarks of the samples are read');
}

export async function morph(page) {
  await button(page, /^Morph \d shapes$/).click();
  await until(() => button(page, 'Pause').count(), 'the morph plays');
  await defaultShown(page);
}

/** The id of the shown morph. The address follows a moment later: it may still name the fast one. */
export async function shownId(page) {
  const link = await page.getByRole('link', { name: 'Download GLB' }).getAttribute('href');
  const id = link.match(/[0-9a-f]{64}/)[0];
  await until(() => page.url().includes(`r=${id}`), 'the URL names the morph');
  return id;
}

/** Moves a slider. */
export const slide = (slider, value) =>
  slider.evaluate((input, v) => {
    input.value = String(v);
    input.dispatchEvent(new Event('input', { bubbles: true }));
  }, value);

export const scrubber = (page) => page.getByRole('slider', { name: 'Along the morph' });
export const seek = (page, value) => slide(scrubber(page), value);

/** Starts a daemon whose only worker is busy with another job until the test ends. */
export async function startOccupied(t) {
  const busy = await startDaemon({ args: ['--workers', '1'] });
  const post = async (path, body, headers) => (await fetch(busy.url + path, { method: 'POST', headers, body })).json();
  const { id: mesh } = await post('/v1/meshes', obj(ball(5)));
  const type = { 'Content-Type': 'application/json' };
  const other = await post('/v1/embeddings', JSON.stringify({ mesh, ...endless }), type);
  t.after(async () => {
    await fetch(busy.url + other.url, { method: 'DELETE' });
    await busy.stop();
  });
  return busy;
}
