// Starts a daemon on a free port with a fresh folder, Chromium, and pages that record every console error,
// every exception and every request to another origin; `done` fails the test if there was any.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { readFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { basename, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';
import { executablePath, softwareGl } from '../tools/chromium.mjs';

export const root = fileURLToPath(new URL('../../', import.meta.url));
export const sample = (name) => join(root, 'tests/samples', name);

const PATIENCE = Number(process.env.ORB_PATIENCE ?? 180_000); // ms; only a failing test waits that long

/** `keep`: do not delete the folder, so that a later daemon can use it through `data`. */
export async function startDaemon({
  args = [],
  data = mkdtempSync(join(tmpdir(), 'orbmorph-studio-')),
  keep = false,
} = {}) {
  if (process.env.ORB_STUDIO_URL && !args.length)
    return { url: process.env.ORB_STUDIO_URL.replace(/\/$/, ''), stop: async () => {} };
  const program = process.env.ORB_DAEMON ?? join(root, 'build/bin/orbmorphd');
  const child = spawn(program, ['--listen', '127.0.0.1:0', '--data', data, ...args], {
    stdio: ['ignore', 'pipe', 'pipe'],
  });
  let log = '';
  child.stderr.on('data', (text) => (log += text));
  const url = await new Promise((resolve, reject) => {
    let out = '';
    child.stdout.on('data', (text) => {
      out += text;
      const found = out.match(/listening on (http:\S+)/);
      if (found) resolve(found[1]);
    });
    child.on('exit', (code) => reject(new Error(`orbmorphd ended with ${code}: ${log}`)));
    setTimeout(() => reject(new Error(`orbmorphd does not listen: ${log}`)), 120_000).unref();
  });
  return {
    url,
    data,
    program,
    stop: () =>
      new Promise((resolve) => {
        child.removeAllListeners('exit');
        child.on('exit', () => {
          if (!keep) rmSync(data, { recursive: true, force: true });
          resolve();
        });
        child.kill('SIGTERM');
        setTimeout(() => child.kill('SIGKILL'), 120_000).unref();
      }),
  };
}

/**
 * Starts Chromium with software GL. `compositing`: "software", the most robust, reads every drawn canvas back
 * on the page's main thread; "gpu" composites pages with the same GL, as browsers with a GPU do.
 */
export const startBrowser = ({ compositing = 'software', program = executablePath } = {}) =>
  chromium.launch({
    timeout: PATIENCE,
    executablePath: program,
    args: [
      '--no-sandbox',
      ...(compositing === 'software' ? ['--disable-gpu'] : ['--ignore-gpu-blocklist']),
      ...softwareGl,
      '--disable-background-networking',
      '--disable-component-update',
      '--disable-sync',
      '--no-first-run',
    ],
  });

/**
 * At most eight frames per second on the page's main thread. Moving parts draw in every frame, and software GL takes a
 * core for each of them as long as the test lasts.
 */
function slowFrames() {
  const [request, cancel] = [globalThis.requestAnimationFrame, globalThis.cancelAnimationFrame];
  const waiting = new Map();
  let count = 0;
  globalThis.requestAnimationFrame = (call) => {
    const id = ++count;
    const draw = () => waiting.set(id, { frame: request((time) => waiting.delete(id) && call(time)) });
    waiting.set(id, { timer: setTimeout(draw, 120) });
    return id;
  };
  globalThis.cancelAnimationFrame = (id) => {
    const { timer, frame } = waiting.get(id) ?? {};
    waiting.delete(id);
    clearTimeout(timer);
    if (frame) cancel(frame);
  };
}

/** Opens a page in its own context. `allFrames`: frames come as fast as they can. Responses of 4xx, which Chromium logs as errors, are allowed. */
export async function openPage(browser, url, { hash = '', allFrames = false, ...options } = {}) {
  const context = await browser.newContext({
    viewport: { width: 1280, height: 800 },
    acceptDownloads: true,
    ...options,
  });
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE);
  if (!allFrames) await page.addInitScript(slowFrames);
  await page.addInitScript(() => {
    globalThis.shownToasts = []; // toasts disappear after some seconds
    new MutationObserver((changes) => {
      for (const { addedNodes } of changes)
        for (const node of addedNodes)
          if (node.classList?.contains('toast')) globalThis.shownToasts.push(node.innerText);
    }).observe(document, { subtree: true, childList: true });
  });
  const errors = [];
  page.on('console', (message) => {
    if (message.type() === 'error' && !/status of 4\d\d/.test(message.text()))
      errors.push(`console: ${message.text()}`);
  });
  page.on('pageerror', (error) => errors.push(`exception: ${error.stack}`));
  page.on('request', (request) => {
    const target = new URL(request.url());
    if (/^(https?|wss?):$/.test(target.protocol) && target.origin !== new URL(url).origin)
      errors.push(`outside: ${request.url()}`);
  });
  await page.goto(`${url}/${hash}`);
  return {
    page,
    done: async () => {
      await context.close();
      assert.deepEqual(errors, []);
    },
  };
}

/** Waits until `check` returns a true value, and returns it. */
export async function until(check, what, limit = Number(process.env.ORB_LIMIT ?? 900_000)) {
  const end = Date.now() + limit;
  for (;;) {
    const value = await check();
    if (value) return value;
    if (Date.now() > end) throw new Error(`not within ${limit / 1000} s: ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
}

/** Waits until a locator finds this many elements. */
export const counted = (locator, count, what) => until(async () => (await locator.count()) === count, what);

export const button = (page, name, options) => page.getByRole('button', { name, ...options });

/** Adds files and waits until they are uploaded and drawn. */
export async function addFiles(page, ...files) {
  await page.locator('input[type=file]').first().setInputFiles(files);
  await until(
    () =>
      page
        .locator('.card.ready')
        .count()
        .then((n) => n >= files.length),
    'the shapes are uploaded',
  );
  await counted(page.getByText('reading…'), 0, 'the shapes are read');
  await settled(page);
}

/** Drops files on the page, as from a folder. */
export async function dropFiles(page, ...paths) {
  const files = await Promise.all(
    paths.map(async (path) => [basename(path), (await readFile(path)).toString('base64')]),
  );
  const data = await page.evaluateHandle((list) => {
    const transfer = new DataTransfer();
    for (const [name, bytes] of list)
      transfer.items.add(new File([Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0))], name));
    return transfer;
  }, files);
  for (const event of ['dragenter', 'dragover', 'drop'])
    await page.dispatchEvent('body', event, { dataTransfer: data });
}

/** Waits until the default morph has replaced the fast one. The studio of 8bbd71c has one morph, without a name (ORB_BEFORE). */
export const defaultShown = (page) =>
  until(
    async () =>
      (await page.getByText('Shown: the default morph.').count()) ||
      (process.env.ORB_BEFORE &&
        (await button(page, /^(Pause|Play)$/).count()) &&
        !(await page.locator('.progress').count())),
    'the default morph',
  );

/** Clicks into a view; `x` and `y` are fractions of its width and height. */
export async function clickView(page, index, x, y) {
  const box = await page.locator('.pane-view').nth(index).boundingBox();
  await page.mouse.click(box.x + box.width * x, box.y + box.height * y);
}

/** The toasts that the page has shown so far. */
export const shownToasts = (page) => page.evaluate(() => globalThis.shownToasts);

/** Adds styles to the page. Its policy forbids style elements, but not adopted style sheets. */
export const adopt = (page, css) =>
  page.evaluate((text) => {
    const sheet = new CSSStyleSheet();
    sheet.replaceSync(text);
    document.adoptedStyleSheets = [...document.adoptedStyleSheets, sheet];
  }, css);

/** Hides the toasts, so that they cover no view. They stay in the document. */
export const hideToasts = (page) => adopt(page, '.toasts { visibility: hidden !important; }');

export const json = async (url, path, init) => (await fetch(url + path, init)).json();
export const bytes = (path) => readFileSync(path);

/** Waits until the stage has drawn everything and the browser has shown it. */
export async function settled(page) {
  await page.evaluate(() => new Promise((resolve) => setTimeout(resolve, 50)));
  await until(
    () => page.evaluate(() => document.querySelector('.stage')?.dataset.busy === undefined),
    'the stage has drawn',
  );
  await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
}
