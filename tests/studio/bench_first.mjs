// Measures how long a visitor waits for a morph: until the first picture of the fast one is drawn, and of the default
// one. Counted from the press of “Morph” with files that are uploaded, or from the drop of the files on the first page.
// Starts a fresh daemon for each round, so that nothing is stored. Prints medians and the longest wait.
//
//   node tests/studio/bench_first.mjs [ROUNDS] [--drop] [--fast] [--gl-page] [given|found | FILE FILE…]
//
// By default five rounds of dog.obj and giraffe.off with given landmarks, and five without. --fast: does not wait for
// the default morph. --gl-page: software GL draws the page as well, not only the shapes; no browser without a GPU does.
import { wholeBrowser } from '../tools/chromium.mjs';
import { basename } from 'node:path';
import { addFiles, button, dropFiles, openPage, sample, startBrowser, startDaemon, until } from './support.mjs';

const options = process.argv.slice(2).filter((argument) => argument.startsWith('--'));
const [rounds = 5, ...rest] = process.argv.slice(2).filter((argument) => !argument.startsWith('--'));
const drops = options.includes('--drop');
const kinds = options.includes('--fast') ? ['fast'] : ['fast', 'default'];
const sorted = (list) => list.toSorted((a, b) => a - b);

/** Notes when the page begins to wait, and when it has drawn its first picture of each morph. */
function watch() {
  globalThis.times = {};
  const { times } = globalThis;
  const begin = () => (times.begin ??= performance.now());
  addEventListener('drop', begin, true);
  addEventListener('click', (e) => /^Morph 2/.test(e.target.closest('button')?.innerText ?? '') && begin(), true);
  document.querySelector('.stage').addEventListener('drawn', () => {
    const shown = document.querySelector('[aria-label="Which morph is shown"]')?.innerText;
    for (const kind of ['fast', 'default'])
      if (shown?.includes(`the ${kind} morph`)) times[kind] ??= performance.now() - times.begin;
  });
}

/** Seconds until each morph is drawn. marks: a file of landmarks. */
async function round(browser, pair, marks) {
  const daemon = await startDaemon();
  const { page, done } = await openPage(browser, daemon.url, { allFrames: true });
  await page.locator('.hero .pane-view').waitFor();
  if (!drops) await addFiles(page, ...pair);
  if (marks) {
    await button(page, 'Landmarks').click();
    await page.getByLabel('Landmark file').setInputFiles(marks);
    await page.locator('.marks li').first().waitFor();
  }
  await page.waitForTimeout(1000); // a visitor looks at the page first
  await page.evaluate(watch);
  if (drops) await dropFiles(page, ...pair);
  else await button(page, /^Morph 2 shapes$/).click();
  for (const kind of kinds)
    await until(() => page.evaluate((name) => globalThis.times[name], kind), `the ${kind} morph`);
  const times = await page.evaluate(() => globalThis.times);
  await done();
  await daemon.stop();
  return times;
}

const browser = await startBrowser({
  compositing: options.includes('--gl-page') ? 'gpu' : 'software',
  program: wholeBrowser,
});
const samples = [sample('dog.obj'), sample('giraffe.off')];
const rows = {
  given: ['dog – giraffe, 21 landmarks', samples, sample('dog-giraffe.json')],
  found: ['dog – giraffe, no landmarks', samples, null],
};
const pairs = rest.filter((_, i) => i % 2 === 0).map((_, i) => rest.slice(2 * i, 2 * i + 2));
const wanted =
  rest.length > 1 && !rows[rest[0]]
    ? pairs.map((pair) => [pair.map((file) => basename(file)).join(' – '), pair, null])
    : (rest.length ? rest : drops ? ['found'] : ['given', 'found']).map((row) => rows[row]);
for (const [name, pair, marks] of wanted) {
  const all = [];
  for (let i = 0; i < Number(rounds); i++) all.push(await round(browser, pair, marks));
  const said = kinds.map((kind) => {
    const times = sorted(all.map((t) => t[kind] / 1000));
    return `the ${kind} morph after ${times[times.length >> 1].toFixed(2)} s, at most ${times.at(-1).toFixed(2)}`;
  });
  console.log(`${name}: ${said.join('; ')}`);
}
await browser.close();
