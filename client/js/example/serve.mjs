// Serves this page, the client and three.js (from client/web/node_modules). Forwards /v1 to the daemon at
// ORBMORPH_SERVER (http://127.0.0.1:8080), so that the page and the daemon share an origin.
import { createServer, request } from 'node:http';
import { readFile } from 'node:fs/promises';
import { extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = fileURLToPath(new URL('.', import.meta.url));
const folders = { '/orbmorph/': join(here, '../src'), '/three/': join(here, '../../web/node_modules/three') };
const types = {
  '.html': 'text/html; charset=utf-8',
  '.js': 'text/javascript; charset=utf-8',
};
const daemon = new URL(process.env.ORBMORPH_SERVER ?? 'http://127.0.0.1:8080');

const server = createServer(async (req, res) => {
  const path = new URL(req.url, daemon).pathname;
  if (path.startsWith('/v1/')) {
    const { connection, ...headers } = req.headers;
    // The daemon refuses foreign origins. This page's own is not foreign: the page and the daemon share this server.
    if (
      [`http://127.0.0.1:${server.address().port}`, `http://localhost:${server.address().port}`].includes(
        headers.origin,
      )
    )
      delete headers.origin;
    const onward = request(
      new URL(req.url, daemon),
      { method: req.method, headers: { ...headers, host: daemon.host } },
      (answer) => {
        res.writeHead(answer.statusCode, answer.headers);
        answer.pipe(res);
      },
    );
    onward.on('error', () => (res.headersSent ? res.destroy() : res.writeHead(502).end()));
    res.on('close', () => onward.destroy());
    req.pipe(onward);
    return;
  }
  const prefix = Object.keys(folders).find((start) => path.startsWith(start));
  const folder = prefix ? folders[prefix] : here;
  const file = join(folder, normalize(prefix ? path.slice(prefix.length) : path === '/' ? 'index.html' : path));
  try {
    if (!file.startsWith(normalize(folder))) throw new Error('outside');
    const content = await readFile(file);
    res.writeHead(200, { 'Content-Type': types[extname(file)] ?? 'application/octet-stream' }).end(content);
  } catch {
    res.writeHead(404).end();
  }
});
server.listen(Number(process.env.PORT ?? 8090), '127.0.0.1', () =>
  console.log(`example on http://127.0.0.1:${server.address().port}`),
);
