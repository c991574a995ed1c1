// Makes docs/morph.webp, the film of the README: the morph of the studio's first page in its colours, drawn by the studio's
// player. Needs a built studio: node tests/tools/film.mjs
import { readFile, writeFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { root, startBrowser } from '../studio/support.mjs';

const web = join(root, 'client/web');
const esbuild = createRequire(join(web, 'package.json'))('esbuild');
const { outputFiles } = await esbuild.build({
  stdin: {
    contents: "export { open } from './take/player.js'; export { joinWebp } from './take/webp';",
    resolveDir: join(web, 'src'),
    loader: 'ts',
  },
  bundle: true,
  write: false,
  format: 'iife',
  globalName: 'studio',
  logLevel: 'error',
});

const SIZE = [640, 480];
const FRAMES = 90; // of a round, which takes 5.4 s

const browser = await startBrowser();
const page = await browser.newPage();
await page.evaluate(outputFiles[0].text.replace(/^(?:"use strict";\s*)?var studio/, 'globalThis.studio'));
const film = await page.evaluate(
  async ([text, [width, height], frames]) => {
    const glb = Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
    const canvas = new OffscreenCanvas(width, height);
    const camera = { yaw: 0.55, distance: 2.75 };
    const tints = ['#f2a97f', '#f0c64f', '#8fb2ef'];
    const player = await globalThis.studio.open(canvas, glb, { shapes: 3, tints, seconds: 1.8, loop: 'loop', camera });
    const stills = [];
    for (let i = 0; i < frames; i++) {
      player.draw(player.placeAt((i * player.seconds) / frames), '#171a21');
      const still = await canvas.convertToBlob({ type: 'image/webp', quality: 0.86 });
      stills.push(new Uint8Array(await still.arrayBuffer()));
    }
    const whole = globalThis.studio.joinWebp(stills, width, height, Math.round((1000 * player.seconds) / frames));
    const bytes = new Uint8Array(await whole.arrayBuffer());
    return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(''));
  },
  [(await readFile(join(web, 'welcome/animals.glb'))).toString('base64'), SIZE, FRAMES],
);
await writeFile(join(root, 'docs/morph.webp'), Buffer.from(film, 'base64'));
await browser.close();
