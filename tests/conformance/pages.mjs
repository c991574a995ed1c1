// Pages in headless Chromium, and the server that they and the npm packages of tests/package.json come from.
import fs from 'node:fs';
import http from 'node:http';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { executablePath, softwareGl } from '../tools/chromium.mjs';

const modules = fileURLToPath(new URL('../node_modules/', import.meta.url));
const types = {
  '.html': 'text/html',
  '.js': 'text/javascript',
  '.json': 'application/json',
  '.glb': 'model/gltf-binary',
};

export const npmFile = (name) => path.join(modules, name);

/** Ends the process, which CTest counts as skipped, if Chromium or one of the packages is missing. */
export function need(...packages) {
  const files = [executablePath, ...['playwright-core', ...packages].map(npmFile)];
  if (!files.every((file) => fs.existsSync(file))) {
    console.log('Chromium or the npm packages are missing: npm ci in tests/');
    process.exit(0);
  }
}

/** Serves what `find(path)` returns: { html }, { script }, the path of a file, or nothing. Returns the port and `close`. */
export async function serve(find) {
  const server = http.createServer((request, response) => {
    const found = find(decodeURIComponent(new URL(request.url, 'http://x').pathname));
    if (found?.html) return response.writeHead(200, { 'Content-Type': types['.html'] }).end(found.html);
    if (found?.script) return response.writeHead(200, { 'Content-Type': types['.js'] }).end(found.script);
    if (!found || !fs.existsSync(found)) return response.writeHead(404).end();
    response.writeHead(200, { 'Content-Type': types[path.extname(found)] ?? 'application/octet-stream' });
    fs.createReadStream(found).pipe(response);
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  return { port: server.address().port, close: () => server.close() };
}

/** Chromium with software GL. */
export async function startBrowser() {
  const { chromium } = await import('playwright-core');
  return chromium.launch({
    timeout: 180_000,
    executablePath,
    args: [
      '--no-sandbox',
      ...softwareGl,
      '--disable-background-networking',
      '--disable-component-update',
      '--no-first-run',
    ],
  });
}
