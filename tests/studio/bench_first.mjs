// Measures how long a visitor waits for a morph: from the press of “Morph” to the picture of the fast one, and to the
// default one, with files that are already uploaded. Starts a fresh daemon for each round, so that nothing is stored.
// Prints medians.
//
//   node tests/studio/bench_first.mjs [ROUNDS] [given|found | FILE FILE]
//
// By default five rounds of dog.obj and giraffe.off with given landmarks, and five without.
import { wholeBrowser } from '../tools/chromium.mjs';
import { addFiles, button, defaultShown, openPage, sample, startBrowser, startDaemon, until } from './support.mjs';

const [rounds = 5, ...rest] = process.argv.slice(2);
const files = rest.length > 1 ? rest : [];
const median = (list) => list.toSorted((a, b) => a - b)[list.length >> 1];

/** Seconds until the fast morph and the default one are shown. marks: a file of landmarks. */
async function round(browser, pair, marks) {
  const daemon = await startDaemon();
  const { page, done } = await openPage(browser, daemon.url, { allFrames: true });
  await addFiles(page, ...pair);
  if (marks) {
    await button(page, 'Landmarks').click();
    await page.getByLabel('Landmark file').setInputFiles(marks);
    await page.locator('.marks li').first().waitFor();
  }
  await page.evaluate(() => {
    const shown = (text) => document.querySelector('[aria-label="Which morph is shown"]')?.innerText.includes(text);
    const drawn = () => document.querySelector('.morph .pane-view') && document.querySelector('.stage');
    globalThis.times = {};
    const look = () => {
      const now = performance.now();
      if (globalThis.pressed && drawn())
        for (const kind of ['fast', 'default'])
          if (shown(`the ${kind} morph`)) globalThis.times[kind] ??= now - globalThis.pressed;
      requestAnimationFrame(look);
    };
    look();
    document.addEventListener(
      'click',
      (e) => {
        if (/^Morph 2/.test(e.target.closest('button')?.innerText ?? '')) globalThis.pressed = performance.now();
      },
      true,
    );
  });
  await button(page, /^Morph 2 shapes$/).click();
  await until(() => page.evaluate(() => globalThis.times.fast), 'the fast morph');
  await defaultShown(page);
  await until(() => page.evaluate(() => globalThis.times.default), 'the default morph');
  const times = await page.evaluate(() => globalThis.times);
  await done();
  await daemon.stop();
  return times;
}

const browser = await startBrowser({ compositing: 'gpu', program: wholeBrowser });
const samples = [sample('dog.obj'), sample('giraffe.off')];
const rows = {
  given: ['dog – giraffe, 21 landmarks', samples, sample('dog-giraffe.json')],
  found: ['dog – giraffe, no landmarks', samples, null],
};
const wanted = files.length
  ? [[files.join(' – '), files, null]]
  : (rest.length ? rest : ['given', 'found']).map((row) => rows[row]);
for (const [name, pair, marks] of wanted) {
  const all = [];
  for (let i = 0; i < Number(rounds); i++) all.push(await round(browser, pair, marks));
  const [fast, full] = ['fast', 'default'].map((kind) => (median(all.map((t) => t[kind])) / 1000).toFixed(2));
  console.log(`${name}: the fast morph is shown after ${fast} s, the default one after ${full} s`);
}
await browser.close();
