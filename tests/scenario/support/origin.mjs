// An HTTP server of the test that receives webhooks, or serves meshes.
import { createServer } from 'node:http';
import { createServer as createSecure } from 'node:https';

/**
 * Listens on `address`, with `tls` ({key, cert}) by https; `answer(request, response, body)` answers. Resolves to {url,
 * requests, close()}; `requests` are {method, url, headers, body, at} in the order of their arrival.
 */
export async function origin(t, answer = (_, response) => response.end(), address = '127.0.0.1', tls) {
  const requests = [];
  const listener = (request, response) => {
    const parts = [];
    request.on('data', (part) => parts.push(part));
    request.on('error', () => {});
    request.on('end', () => {
      const body = Buffer.concat(parts).toString();
      requests.push({ method: request.method, url: request.url, headers: request.headers, body, at: Date.now() });
      answer(request, response, body, requests.length);
    });
  };
  const server = tls ? createSecure(tls, listener) : createServer(listener);
  const close = () => new Promise((resolve) => server.close(resolve) && server.closeAllConnections());
  await new Promise((resolve) => server.listen(0, address, resolve));
  t.after(close);
  return { url: `http${tls ? 's' : ''}://${address}:${server.address().port}`, requests, close };
}
