// A signed URL on a page of another origin, in headless Chromium, with a daemon that requires tokens: three.js and
// <model-viewer> show a morph that nobody has computed before, with one request, and later take it from the HTTP cache.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { signUrl } from '../../client/js/src/index.js';
import { runProgram } from '../scenario/support/cli.mjs';
import { binaries, daemon } from '../scenario/support/daemon.mjs';
import { writePng } from '../scenario/support/png.mjs';
import * as shapes from '../scenario/support/shapes.mjs';
import { need, npmFile, serve, startBrowser } from './pages.mjs';

need('three', '@google/model-viewer');

const three = `<!doctype html><title>three</title>
<script type="importmap">{"imports":{"three":"/npm/three/build/three.module.js","three/addons/":"/npm/three/examples/jsm/"}}</script>
<script type="module">
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { MeshoptDecoder } from "three/addons/libs/meshopt_decoder.module.js";
const src = new URLSearchParams(location.search).get("src");
window.show = (src) => new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).load(src, ({ scene, animations }) => {
  const names = [];
  scene.traverse((o) => o.morphTargetDictionary && names.push(...Object.keys(o.morphTargetDictionary)));
  window.result = { names, animations: animations.length };
}, undefined, (error) => (window.result = { error: String(error) }));
window.show(src);
</script>`;
// <model-viewer> computes its own sky in each page, which takes software GL five seconds.
const sky = `data:image/png;base64,${writePng(64, 32, () => [200, 200, 200]).toString('base64')}`;
const viewer = `<!doctype html><title>model-viewer</title>
<script>self.ModelViewerElement = { meshoptDecoderLocation: "data:text/javascript," };</script>
<script type="module" src="/npm/@google/model-viewer/dist/model-viewer.min.js"></script>
<script type="module">
const element = document.createElement("model-viewer");
element.addEventListener("load", () => (window.result = { loaded: element.loaded, animations: element.availableAnimations.length }));
element.addEventListener("error", (event) => (window.result = { error: String(event.detail?.sourceError ?? event.type) }));
element.environmentImage = "${sky}";
window.show = (src) => (element.src = src);
window.show(new URLSearchParams(location.search).get("src"));
element.style.width = element.style.height = "200px";
document.body.append(element);
</script>`;

let browser;
let server;
let origin;
before(async () => {
  const pages = { '/three': { html: three }, '/viewer': { html: viewer } };
  server = await serve((at) => pages[at] ?? (at.startsWith('/npm/') && npmFile(at.slice(5))));
  origin = `http://localhost:${server.port}`;
  browser = await startBrowser();
});
after(async () => {
  await browser?.close();
  server?.close();
});

async function admin(d, ...words) {
  const ran = await runProgram(binaries.daemon, [...words, '--data', d.data]);
  assert.equal(ran.code, 0, ran.err);
  return ran.out.trim();
}

test('a page of another origin shows signed morphs', async (t) => {
  const d = await daemon(t, { args: ['--auth', 'on'] });
  const token = await admin(d, 'token', 'add', 'shop', '--scope', 'read,write');
  const [name, secret] = (await admin(d, 'key', 'add', 'web', '--tenant', 'shop', '--origin', origin)).split(':');
  const ids = [];
  for (const [called, shape] of Object.entries({ egg: shapes.egg(2), bean: shapes.bean(2) })) {
    const body = Buffer.from(shapes.obj(shape));
    const headers = { authorization: `Bearer ${token}` };
    ids.push((await d.request('POST', `/v1/meshes?name=${called}`, { body, headers })).json.id);
  }
  // The daemon counts the requests that reach it.
  const requests = async () => Number(/requests=(\d+)/.exec(await admin(d, 'key', 'list'))[1]);
  const jobs = async () =>
    (await d.get('/v1/jobs', { headers: { authorization: `Bearer ${token}` } })).json.jobs.length;
  const signed = (tolerance) =>
    signUrl(`${d.url}/v1/morph.glb?shapes=${ids}&align=rotate&tolerance=${tolerance}`, {
      key: name,
      secret,
      expires: '1d',
    });
  const context = await browser.newContext();
  t.after(() => context.close());
  /** The picture of a new page for each of the sources, one after the other: opening a page takes seconds. */
  const show = async (page, src, ...others) => {
    const tab = await context.newPage();
    const result = async () => (await tab.waitForFunction(() => window.result, null, { timeout: 120_000 })).jsonValue();
    await tab.goto(`${origin}/${page}?src=${encodeURIComponent(src)}`);
    const results = [await result()];
    for (const other of others) {
      await tab.evaluate((next) => {
        window.result = undefined;
        window.show(next);
      }, other);
      results.push(await result());
    }
    await tab.close();
    return results;
  };

  for (const [page, tolerance, expected] of [
    ['three', 0.05, { names: ['bean'], animations: 1 }],
    ['viewer', 0.04, { loaded: true, animations: 1 }],
    ['viewer', '0.03&profile=meshopt', { loaded: true, animations: 1 }],
  ]) {
    const [before, made] = [await requests(), await jobs()];
    const src = await signed(tolerance);
    assert.deepEqual(await show(page, src), [expected]);
    assert.equal(await requests(), before + 1, `${page}: one request`);
    assert.equal(await jobs(), made + 1, `${page}: nobody had computed it`);
    const changed = src.replace('tolerance=0.0', 'tolerance=0.1');
    const unsigned = src.split('&key=')[0];
    const [again, ...bad] = await show(page, src, changed, unsigned);
    assert.deepEqual(again, expected);
    assert.equal(await requests(), before + 1, `${page}: the second time it comes from the HTTP cache`);
    for (const { error } of bad) assert.match(error, /\S/); // and shows nothing
  }
});
