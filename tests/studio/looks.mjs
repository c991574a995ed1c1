// The scenes of the studio that have reference pictures: how to reach them, and how to compare pictures.
//   node tests/studio/looks.mjs [SCENE…]                     retakes reference pictures (tests/studio/looks/SCENE.png)
//   ORB_PICTURE=FILE.png node tests/studio/looks.mjs SCENE   takes one picture at full size, for the documents
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { obj, parse } from '../scenario/support/shapes.mjs';
import { tunnels } from '../tools/tunnels.mjs';
import { countPixels, halved } from './pictures.mjs';
import {
  addFiles,
  counted,
  adopt,
  button,
  clickView,
  hideToasts,
  defaultShown,
  openPage,
  root,
  sample,
  settled,
  startBrowser,
  startDaemon,
  until,
} from './support.mjs';

export const folder = join(root, 'tests/studio/looks');
const pair = [sample('dog.obj'), sample('giraffe.off')];
const SMALL = { viewport: { width: 390, height: 780 }, hasTouch: true, isMobile: true };

const without = (file, keep) => ({
  name: `${file.split('.')[0]}.obj`,
  mimeType: 'text/plain',
  buffer: Buffer.from(readFileSync(sample(file), 'utf8').split('\n').filter(keep()).join('\n')),
});
/** The dog with tunnels through neck, body and legs. */
const pierced = () => {
  const dog = parse(readFileSync(sample('dog.obj'), 'utf8'));
  const at = [
    [-0.5, 0.95, 0.35],
    [0.1, 0.9, 0.35],
    [0.6, 1.1, 0.3],
    [0.45, 0.4, 0.35],
  ];
  return { name: 'dog.obj', mimeType: 'text/plain', buffer: Buffer.from(obj(tunnels(dog, at))) };
};
const holed = () =>
  without('dog.obj', () => {
    let left = 60;
    return (line) => !(line.startsWith('f ') && left-- > 0);
  });

/** The sample of the first page stands still. */
const STILL = { reducedMotion: 'reduce' };
const welcome = (page) =>
  until(async () => (await countPixels(page, '.hero', (r, _g, b) => r - b > 70)) > 4000, 'the sample is drawn');

async function landmarked(page) {
  await addFiles(page, ...pair);
  await button(page, 'Landmarks').click();
  await page.getByLabel('Landmark file').setInputFiles(sample('dog-giraffe.json'));
  await page.locator('.marks li').first().waitFor();
}
async function morphed(page) {
  await landmarked(page);
  await button(page, /^Morph 2 shapes$/).click();
  await until(() => button(page, 'Pause').count(), 'the morph plays');
  await defaultShown(page);
  await button(page, 'Pause').click();
}
const slide = (page, name, value) =>
  page.getByRole('slider', { name }).evaluate((input, v) => {
    input.value = String(v);
    input.dispatchEvent(new Event('input', { bubbles: true }));
  }, value);
async function spheres(page) {
  await button(page, 'Spheres').click();
  await counted(page.getByText('Certified one to one'), 2, 'both are embedded');
  const working = page.locator('.centered').getByRole('progressbar');
  await counted(working, 0, 'both spheres are loaded');
}

/**
 * name: [steps that lead to the scene, options of the page, the scene that the steps begin at]. Without the third they begin
 * at an empty page.
 */
export const SCENES = {
  empty: [welcome, STILL],
  'empty-dark': [welcome, { colorScheme: 'dark', ...STILL }],
  shapes: [(page) => addFiles(page, ...pair)],
  'shapes-dark': [
    async (page) => {
      await addFiles(page, ...pair, sample('elephant.ply'));
      await page.getByRole('switch', { name: 'Wireframe' }).click();
    },
    { colorScheme: 'dark' },
  ],
  'shapes-small': [(page) => addFiles(page, ...pair), SMALL],
  refused: [
    async (page) => {
      await page.locator('input[type=file]').first().setInputFiles([holed()]);
      await until(() => page.getByText('Shown in red on the model.').count(), 'the rim is found');
    },
  ],
  handles: [
    async (page) => {
      await page.locator('input[type=file]').first().setInputFiles([pierced()]);
      await until(() => page.getByText('Shown in red on the model.').count(), 'the loops are found');
    },
  ],
  landmarks: [
    async (page) => {
      await landmarked(page);
      await clickView(page, 0, 0.5, 0.5);
      await page.locator('.wanted').waitFor();
    },
  ],
  morph: [
    async (page) => {
      await morphed(page);
      await slide(page, 'Along the morph', 0.5);
    },
  ],
  each: [(page) => button(page, 'Each shape').click(), {}, 'morph'],
  error: [
    async (page) => {
      await button(page, 'Error').click();
      await counted(page.locator('.pane .legend'), 2, 'both are measured');
    },
    {},
    'each',
  ],
  'spheres-before': [spheres, {}, 'error'],
  'spheres-after': [
    async (page) => {
      await button(page, 'Checkerboard').click();
      await button(page, 'After').click();
      await counted(page.getByText('on the common sphere'), 2, 'they are aligned');
      await until(
        () =>
          page
            .locator('.marker.small')
            .count()
            .then((n) => n > 2),
        'landmarks are on them',
      );
    },
    {},
    'spheres-before',
  ],
  'morph-dark': [
    async (page) => {
      await morphed(page);
      await slide(page, 'Share of dog', 0.25);
      await page.getByRole('switch', { name: 'Wireframe' }).click();
    },
    { colorScheme: 'dark' },
  ],
  'morph-small': [
    async (page) => {
      await morphed(page);
      await slide(page, 'Along the morph', 0.5);
    },
    SMALL,
  ],
  'use-it': [
    async (page) => {
      await morphed(page);
      await slide(page, 'Along the morph', 0); // it may be playing
      await button(page, 'Use it').click();
    },
  ],
  'heat-map': [
    async (page) => {
      await addFiles(page, ...pair);
      await spheres(page);
      await button(page, 'Stretch').click();
    },
  ],
};

/** Hides what differs between runs: timings and the text cursor. */
const STEADY = '[data-varies] { visibility: hidden !important; } * { caret-color: transparent !important; }';

/** Opens a page and goes to a scene. */
async function open(browser, url, name) {
  const [reach, options, from] = SCENES[name];
  if (!from) {
    const opened = await openPage(browser, url, { colorScheme: 'light', ...options });
    await opened.page.evaluate(() => document.fonts.ready);
    await reach(opened.page);
    return opened;
  }
  const opened = await open(browser, url, from);
  await reach(opened.page);
  return opened;
}

/**
 * Takes a picture of a scene as PNG, at half size or at full size (`whole`). A scene that begins at the previous one
 * continues with its page; `close` closes the page of the last one.
 */
export function photographer(browser, url) {
  let last = null; // { name, page, done }
  const close = async () => {
    const closing = last;
    last = null;
    await closing?.done();
  };
  const look = async (name, whole = false) => {
    const [reach, , from] = SCENES[name];
    const opened = last;
    if (opened && from === opened.name) {
      last = null; // a failing scene closes the page
      await reach(opened.page);
      last = { ...opened, name };
    } else {
      await close();
      last = { name, ...(await open(browser, url, name)) };
    }
    const { page } = last;
    await adopt(page, STEADY);
    await hideToasts(page);
    await page.mouse.move(2, 2);
    await page.evaluate(() => document.activeElement?.blur());
    await settled(page);
    const full = await page.screenshot({ animations: 'disabled' });
    return whole ? full : halved(browser, full);
  };
  return { look, close };
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  mkdirSync(folder, { recursive: true });
  const daemon = await startDaemon();
  const browser = await startBrowser();
  const { look, close } = photographer(browser, daemon.url);
  try {
    const picture = process.env.ORB_PICTURE;
    if (picture) writeFileSync(picture, await look(process.argv[2], true));
    else
      for (const name of process.argv.length > 2 ? process.argv.slice(2) : Object.keys(SCENES)) {
        const png = await look(name);
        writeFileSync(join(folder, `${name}.png`), png);
        console.log(`${name}.png ${png.length} bytes`);
      }
    await close();
  } finally {
    await browser.close();
    await daemon.stop();
  }
}
