// A proxy in front of an S3 server that answers some requests like a failing server.
import { readFileSync } from 'node:fs';
import http from 'node:http';

/** Forwards the next request. */
export const pass = 'pass';
/** 503 SlowDown, without asking the server. */
export const busy = 'busy';
/** 403 AccessDenied, without asking the server. */
export const denied = 'denied';
/** The server carries out the request, and its answer is lost. */
export const lost = 'lost';
/** The same, and its answer is 500. */
export const late = 'late';
/** The connection ends within the body of the answer. */
export const half = 'half';
/** Half of the body, as a whole answer. */
export const short = 'short';
/** Headers and body in packets of their own. The body waits until the headers are acknowledged, as Nagle's algorithm
 * makes it wait. */
export const apart = 'apart';
/** One bit of the body is another. */
export const flipped = 'flipped';

/** How many bytes Linux has sent or will send on this IPv4 connection that the other end has not acknowledged. */
function unacknowledged({ localPort, remotePort }) {
  const port = (number) => number.toString(16).toUpperCase().padStart(4, '0');
  const ends = new RegExp(`:${port(localPort)} [0-9A-F]{8}:${port(remotePort)} [0-9A-F]{2} ([0-9A-F]{8}):`);
  return Number.parseInt(ends.exec(readFileSync('/proc/net/tcp', 'latin1'))[1], 16);
}

/** Sends the headers, then the body. Adds to `waits` for how many milliseconds the headers were not acknowledged. */
function answerApart(from, headers, body, response, waits) {
  delete headers.connection; // the server closes each connection of the proxy
  response.writeHead(from.statusCode, headers).flushHeaders();
  const began = performance.now();
  const send = () => {
    if (response.destroyed) return;
    if (unacknowledged(response.socket)) return setImmediate(send);
    waits.push(performance.now() - began);
    response.end(body);
  };
  setImmediate(send); // the headers are on their way then
}

function answer(how, from, body, response, waits) {
  const headers = { ...from.headers };
  const part = body.subarray(0, body.length >> 1);
  if (how === lost) return response.destroy();
  if (how === late) return response.writeHead(500).end();
  if (how === short && part.length) {
    headers['content-length'] = part.length;
    response.writeHead(from.statusCode, headers).end(part);
  } else if (how === apart) {
    answerApart(from, headers, body, response, waits);
  } else if (how === half && part.length) {
    response.writeHead(from.statusCode, headers).write(part, () => response.destroy());
  } else {
    if (how === flipped && part.length) body[part.length] ^= 4;
    response.writeHead(from.statusCode, headers).end(body);
  }
}

/**
 * Starts it in front of the server at `url`, until the test ends. `decide` chooses by {method, path, query, tries},
 * where tries counts the requests of this method to this path and query, from 1. It may return a promise, which holds
 * the request. `waits` of the proxy are the milliseconds of each answer that was `apart`.
 */
export async function s3Proxy(t, url, decide) {
  const proxy = { decide, seen: [], tries: new Map(), waits: [] };
  const server = http.createServer(async (request, response) => {
    const [path, query = ''] = request.url.split('?');
    const key = `${request.method} ${request.url}`;
    proxy.tries.set(key, (proxy.tries.get(key) ?? 0) + 1);
    const asked = { method: request.method, path, query, tries: proxy.tries.get(key) };
    const how = (await proxy.decide(asked)) ?? pass;
    proxy.seen.push({ ...asked, how });
    if (response.destroyed) return; // the client has gone while the request was held
    if (how === busy || how === denied) {
      const [status, code] = how === busy ? [503, 'SlowDown'] : [403, 'AccessDenied'];
      request.resume();
      request.on('end', () =>
        response.writeHead(status, { 'content-type': 'application/xml' }).end(`<Error><Code>${code}</Code></Error>`),
      );
      return;
    }
    const { hostname, port } = new URL(url);
    // The headers unchanged: the signature covers them.
    const { method, url: target, headers } = request;
    const to = http.request({ hostname, port, method, path: target, headers, agent: false });
    request.pipe(to);
    // Swift sends a body with the answer to HEAD of a key that it lacks. Node reports that as an error of the
    // connection.
    let headed = false;
    to.on('error', () => headed || response.destroy());
    to.on('response', async (from) => {
      headed = method === 'HEAD';
      if (headed)
        return answer(
          how,
          from.on('error', () => {}),
          Buffer.alloc(0),
          response,
          proxy.waits,
        );
      const chunks = [];
      try {
        for await (const chunk of from) chunks.push(chunk);
      } catch {
        return response.destroy(); // the server went away
      }
      answer(how, from, Buffer.concat(chunks), response, proxy.waits);
    });
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  t.after(() => {
    server.closeAllConnections();
    return new Promise((done) => server.close(done));
  });
  proxy.url = `http://127.0.0.1:${server.address().port}`;
  return proxy;
}
