/** Turns a source (File, Blob, bytes, path) into a request body and sends it with progress. */
import { ProblemError, abortError, unreachable } from './errors.js';

const isNode = typeof process !== 'undefined' && !!process.versions?.node;

/** Opens a source. A string is a path, in Node only. -> {name, size, body}; `body` is a Blob or bytes */
export async function openSource(source, name) {
  if (typeof source === 'string' || source instanceof URL) {
    if (!isNode) throw new TypeError('Only Node can read a path; pass a File, a Blob or bytes.');
    const module = 'node:fs/promises'; // a variable, so that bundlers do not resolve it
    const { readFile } = await import(/* @vite-ignore */ module);
    const bytes = await readFile(source);
    const file = String(source).split(/[\\/]/).pop();
    return { name: name ?? stem(file), size: bytes.byteLength, body: bytes };
  }
  if (source && typeof source === 'object' && 'source' in source) return openSource(source.source, source.name ?? name);
  if (typeof Blob !== 'undefined' && source instanceof Blob)
    return { name: name ?? (source.name ? stem(source.name) : 'mesh'), size: source.size, body: source };
  if (source instanceof ArrayBuffer)
    return { name: name ?? 'mesh', size: source.byteLength, body: new Uint8Array(source) };
  if (ArrayBuffer.isView(source)) {
    const bytes = new Uint8Array(source.buffer, source.byteOffset, source.byteLength);
    return { name: name ?? 'mesh', size: bytes.byteLength, body: bytes };
  }
  throw new TypeError('A mesh must be a File, a Blob, bytes or (in Node) a path.');
}

export const stem = (file) => file.replace(/\.[A-Za-z0-9]{1,5}$/, '') || 'mesh';

/** Posts `body`; calls `onProgress(sent, total)`. Only XMLHttpRequest reports progress in browsers. -> {status, json} */
export function sendBody(url, body, size, { headers, onProgress, signal, fetch }) {
  if (typeof XMLHttpRequest !== 'undefined' && onProgress)
    return sendXhr(url, body, size, { headers, onProgress, signal, fetch });
  return sendFetch(url, body, size, { headers, onProgress, signal, fetch });
}

function sendXhr(url, body, size, { headers, onProgress, signal, fetch }) {
  return new Promise((resolve, reject) => {
    if (signal?.aborted) return reject(abortError(signal));
    const xhr = new XMLHttpRequest();
    const abort = () => xhr.abort();
    const end = () => signal?.removeEventListener('abort', abort);
    xhr.open('POST', url);
    for (const [key, value] of Object.entries(headers)) xhr.setRequestHeader(key, value);
    xhr.upload.onprogress = (event) => onProgress(event.loaded, event.lengthComputable ? event.total : size);
    xhr.onload = () => {
      end();
      const answer = { status: xhr.status, json: parse(xhr.responseText) };
      if (xhr.status >= 200 && xhr.status < 300) resolve(answer);
      else
        reject(
          new ProblemError(answer.json ?? { title: xhr.statusText }, xhr.status, {
            get: (n) => xhr.getResponseHeader(n),
          }),
        );
    };
    xhr.onerror = () => {
      end();
      unreachable(url, undefined, fetch).then(reject);
    };
    xhr.onabort = () => {
      end();
      reject(abortError(signal));
    };
    signal?.addEventListener('abort', abort);
    xhr.send(body);
  });
}

async function sendFetch(url, body, size, { headers, onProgress, signal, fetch }) {
  let response;
  try {
    const init = { method: 'POST', headers, signal, body };
    if (onProgress && isNode) {
      init.body = counted(body, (sent) => onProgress(sent, size));
      init.duplex = 'half';
      init.headers = { ...headers };
    }
    response = await fetch(url, init);
  } catch (error) {
    if (signal?.aborted) throw abortError(signal);
    throw await unreachable(url, error, fetch);
  }
  const json = parse(await response.text());
  if (!response.ok) throw new ProblemError(json ?? { title: response.statusText }, response.status, response.headers);
  return { status: response.status, json };
}

/** A stream of the body in pieces; calls `onSent(bytes)` after each. */
function counted(body, onSent) {
  const whole = body instanceof Uint8Array ? body : null;
  const piece = 256 * 1024;
  const size = whole ? whole.byteLength : body.size;
  let at = 0;
  return new ReadableStream({
    async pull(controller) {
      if (at >= size) return controller.close();
      const end = Math.min(at + piece, size);
      const part = whole ? whole.subarray(at, end) : new Uint8Array(await body.slice(at, end).arrayBuffer());
      at = end;
      controller.enqueue(part);
      onSent(at);
    },
  });
}

export function parse(text) {
  try {
    return text ? JSON.parse(text) : null;
  } catch {
    return null;
  }
}
