/** HMAC-SHA256 by WebCrypto, which browsers, Deno and Node have. */
async function webCrypto() {
  if (globalThis.crypto?.subtle) return globalThis.crypto;
  const module = 'node:crypto'; // a variable, so that bundlers do not resolve it; Node 18 has no global crypto
  return (await import(/* @vite-ignore */ module)).webcrypto;
}

export const utf8 = (text) => new TextEncoder().encode(text);

/** -> the 32 bytes; key and bytes are Uint8Arrays */
export async function hmac(key, bytes) {
  const { subtle } = await webCrypto();
  const imported = await subtle.importKey('raw', key, { name: 'HMAC', hash: 'SHA-256' }, false, ['sign']);
  return new Uint8Array(await subtle.sign('HMAC', imported, bytes));
}
