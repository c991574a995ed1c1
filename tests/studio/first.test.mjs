// The fast morph is shown first, and the default one replaces it.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { browser, daemon } from './started.mjs';
import { addFiles, button, defaultShown, json, openPage, sample, settled, shownToasts, until } from './support.mjs';

const isFast = (request) => request.postDataJSON().align?.options?.preset === 'fast';
const refuse = (route, title) =>
  route.fulfill({
    status: 422,
    contentType: 'application/problem+json',
    body: JSON.stringify({ type: 'about:blank', title, status: 422, detail: 'As the test wants.' }),
  });

/**
 * A page with two shapes whose POST of a morph goes to `answer(kind, route)`; kind: fast or default. Also returns the
 * kinds in the order of their requests.
 */
async function pageWith(answer) {
  const opened = await openPage(browser, daemon.url);
  const posted = [];
  await opened.page.route('**/v1/supermeshes', async (route) => {
    if (route.request().method() !== 'POST') return route.continue();
    const kind = isFast(route.request()) ? 'fast' : 'default';
    posted.push(kind);
    return answer(kind, route);
  });
  await addFiles(opened.page, sample('dog.obj'), sample('giraffe.off'));
  await button(opened.page, 'Landmarks').click();
  await opened.page.getByLabel('Landmark file').setInputFiles(sample('dog-giraffe.json'));
  await opened.page.locator('.marks li').first().waitFor();
  return { ...opened, posted };
}

/** Requests the morph; the fast one is requested first. */
async function morph(page, posted) {
  await button(page, /^Morph 2 shapes$/).click();
  await until(() => posted.length, 'a morph is requested');
  assert.equal(posted[0], 'fast');
}

/** A promise and the function that resolves it. */
function gate() {
  let open;
  const opened = new Promise((resolve) => (open = resolve));
  return { opened, open };
}

const shown = (page) => page.getByRole('status', { name: 'Which morph is shown' });
const slider = (page) => page.getByRole('slider', { name: 'Along the morph' });
const camera = (page) => new URL(page.url()).hash.match(/cam=([^&]*)/)?.[1];
test('the default morph replaces the fast one and keeps time, camera and view', async () => {
  const { opened, open } = gate();
  const { page, posted, done } = await pageWith(async (kind, route) => {
    if (kind === 'default') await opened;
    await route.continue();
  });
  await morph(page, posted);
  await until(() => button(page, 'Pause').count(), 'the fast morph plays');
  assert.deepEqual(posted, ['fast', 'default']);
  assert.match(await shown(page).innerText(), /^Shown: the fast morph\. The default one replaces it/);
  assert.ok(await button(page, 'Download GLB').isDisabled(), 'only the default morph is downloaded');
  assert.ok(await button(page, 'Use it').isDisabled());
  assert.ok(await button(page, 'Cancel').isVisible());

  await slider(page).fill('0.3');
  await page.locator('.pane-view').first().focus();
  for (let i = 0; i < 4; i++) await page.keyboard.press('ArrowLeft');
  await page.getByRole('switch', { name: 'Wireframe' }).check();
  // The address follows with a delay. A press rotates by 0.12, from 0.55.
  const rotated = await until(() => camera(page)?.startsWith('1.03,') && camera(page), 'the address names the camera');
  const fast = page.url().match(/[#&]r=([0-9a-f]+)/)[1];
  open();
  await defaultShown(page);
  assert.equal(await slider(page).inputValue(), '0.3');
  assert.ok(await button(page, 'Play').isVisible(), 'still paused');
  assert.ok(await page.getByRole('switch', { name: 'Wireframe' }).isChecked());
  assert.equal(await page.locator('.progress').count(), 0);
  const now = await until(() => {
    const id = page.url().match(/[#&]r=([0-9a-f]+)/)?.[1];
    return id !== fast && id;
  }, 'the address names the default morph');
  assert.equal(camera(page), rotated);
  const waiting = page.waitForEvent('download');
  await page.getByRole('link', { name: 'Download GLB' }).click();
  assert.ok((await waiting).url().includes(now), 'the default morph is downloaded');
  await done();
});

test('the fast morph takes the cheap way to a common mesh, unless the options name another', async () => {
  const asked = [];
  const { page, posted, done } = await pageWith((kind, route) => {
    asked.push(route.request().postDataJSON().remesh);
    return kind === 'fast' ? route.continue() : refuse(route, 'No default morph');
  });
  const failed = page.getByRole('alert').getByText('No default morph');
  await morph(page, posted);
  await failed.waitFor();
  assert.deepEqual(
    asked.map(({ method }) => method),
    ['convex-hull', 'adaptive'],
  );
  // the hull has every vertex of both shapes, and landmarks are one vertex of both
  const { supermeshes } = await json(daemon.url, '/v1/supermeshes');
  const { vertices, shapes, landmarks } = supermeshes.find(({ request }) => request.remesh.method === 'convex-hull');
  const meshes = await Promise.all(shapes.map(({ mesh }) => json(daemon.url, `/v1/meshes/${mesh}`)));
  assert.equal(vertices, meshes[0].vertices + meshes[1].vertices - landmarks.length);

  await page.getByText('Options', { exact: true }).click();
  await page.getByLabel('Most triangles').fill('4000');
  await button(page, 'Morph again').click();
  await until(() => asked.length === 4, 'both are requested again');
  await failed.waitFor();
  assert.deepEqual(
    asked.slice(2).map(({ method, max_triangles }) => [method, max_triangles]),
    [
      ['adaptive', 4000],
      ['adaptive', 4000],
    ],
  );
  await page.getByLabel('Common mesh').selectOption('overlay');
  await button(page, 'Morph again').click();
  await until(() => asked.length === 6, 'both are requested once more');
  await failed.waitFor();
  assert.deepEqual(
    asked.slice(4).map(({ method }) => method),
    ['overlay', 'overlay'],
  );
  await done();
});

test('the default job is sent when the fast one has ended, not to compute beside it, also after a reload', async () => {
  const job = { id: '2'.repeat(32), url: `/v1/jobs/${'2'.repeat(32)}`, kind: 'supermesh', state: 'running' };
  Object.assign(job, { stage: 'align', progress: 0.4, seconds_left: 12, result: null, problem: null, attempt: 1 });
  let ended = false;
  const { page, posted, done } = await pageWith((kind, route) =>
    kind === 'fast'
      ? route.fulfill({ status: 202, headers: { Location: job.url }, json: job })
      : refuse(route, 'No default morph'),
  );
  await page.route(`**${job.url}**`, (route) =>
    route.request().url().endsWith('/events')
      ? route.fulfill({ contentType: 'text/event-stream', body: `event: progress\ndata: ${JSON.stringify(job)}\n\n` })
      : route.fulfill({ json: { ...job, state: ended ? 'cancelled' : 'running' } }),
  );
  await morph(page, posted);
  const polled = () => page.waitForRequest((request) => request.url().endsWith('/events'));
  await polled();
  await polled();
  assert.deepEqual(posted, ['fast']);
  await until(() => /[#&]go=1(&|$)/.test(page.url()), 'the address says that a morph is to come');
  await page.reload();
  await polled();
  await polled();
  assert.deepEqual(posted, ['fast', 'fast'], 'equal requests are one job');
  ended = true;
  await page.getByRole('alert').getByText('No default morph').waitFor();
  assert.deepEqual(posted, ['fast', 'fast', 'default']);
  await done();
});

test('a fast morph that fails does not hide the default one', async () => {
  const { page, posted, done } = await pageWith((kind, route) =>
    kind === 'fast' ? refuse(route, 'No fast morph') : route.continue(),
  );
  await morph(page, posted);
  await defaultShown(page);
  await until(() => button(page, 'Pause').count(), 'the default morph plays');
  assert.deepEqual(posted, ['fast', 'default']);
  assert.equal(await page.getByRole('alert').count(), 0);
  await done();
});

test('the fast morph stays if the default one fails', async () => {
  const { opened, open } = gate();
  const { page, posted, done } = await pageWith(async (kind, route) => {
    if (kind === 'fast') return route.continue();
    await opened;
    return refuse(route, 'No default morph');
  });
  await morph(page, posted);
  await until(() => button(page, 'Pause').count(), 'the fast morph plays');
  open();
  await page.getByRole('alert').getByText('No default morph').waitFor();
  assert.match(await shown(page).innerText(), /^Shown: the fast morph\. “Morph again”/);
  assert.ok(await page.getByRole('link', { name: 'Download GLB' }).isVisible(), 'there is no other to download');
  await done();
});

test('cancelling keeps the fast morph and stops the default one', async () => {
  const { page, posted, done } = await pageWith((kind, route) => (kind === 'fast' ? route.continue() : undefined));
  await morph(page, posted);
  await until(() => button(page, 'Pause').count(), 'the fast morph plays');
  await button(page, 'Cancel').click();
  await until(() => shownToasts(page).then((list) => list.includes('Cancelled.')), 'the page says so');
  assert.match(await shown(page).innerText(), /^Shown: the fast morph\. “Morph again”/);
  assert.equal(await page.locator('.progress').count(), 0);
  await button(page, 'Morph again').waitFor();
  await done();
});

test('progress names the morph and its stage', async () => {
  const { opened, open } = gate();
  const { page, posted, done } = await pageWith(async (kind, route) => {
    if (kind === 'default') await opened; // or it may end before the fast one, and the page then does not wait for that
    await route.continue();
  });
  await page.evaluate(() => {
    globalThis.stages = new Set();
    new MutationObserver(() => {
      const text = document.querySelector('.progress-text span')?.textContent;
      if (text) globalThis.stages.add(text);
    }).observe(document.body, { subtree: true, childList: true, characterData: true });
  });
  // a request of its own, or its answer may be stored
  await button(page, 'Shapes', { exact: true }).click();
  await page.getByText('Options', { exact: true }).click();
  await page.getByLabel('Most triangles').fill('9000');
  await morph(page, posted);
  await until(() => button(page, 'Pause').count(), 'the fast morph plays');
  open();
  await defaultShown(page);
  const seen = await page.evaluate(() => [...globalThis.stages]);
  assert.ok(
    seen.some((text) => /^Fast morph: \S/.test(text)),
    seen.join(', '),
  );
  assert.ok(
    seen.some((text) => /^Default morph: \S/.test(text)),
    seen.join(', '),
  );
  await done();
});

test('progress draws no shape again: without a GPU that takes a core from the daemon', async () => {
  const { opened, open } = gate();
  const { page, posted, done } = await pageWith(async (_kind, route) => {
    await opened;
    await route.continue();
  });
  await settled(page);
  await page.evaluate(() => {
    globalThis.drawings = 0;
    document.querySelector('.stage').addEventListener('drawn', () => globalThis.drawings++);
  });
  await morph(page, posted);
  await until(
    async () => /^\d+:(0[2-9]|[1-5]\d)/.test(await page.locator('.progress .hint').first().innerText()),
    'two seconds',
  );
  assert.equal(await page.evaluate(() => globalThis.drawings), 0);
  open();
  await until(() => page.evaluate(() => globalThis.drawings), 'the fast morph is drawn');
  await defaultShown(page);
  await done();
});
