/** Messages of webhooks (https://www.standardwebhooks.com), in browsers, Deno and Node. */
import { hmac, utf8 } from './hmac.js';

const decode = (base64) => Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
const encode = (bytes) => btoa(String.fromCharCode(...bytes));

/** Whether two texts are equal, in a time that does not depend on where they differ. */
function same(a, b) {
  let differences = a.length ^ b.length;
  for (let i = 0; i < a.length; i++) differences |= a.charCodeAt(i) ^ b.charCodeAt(i % (b.length || 1));
  return differences === 0;
}

/**
 * Verifies a message of a webhook. `body` is the body as it came, a string or bytes; `headers` are a Headers object or an
 * object with lower-case names; `secret` is what `orbmorphd webhook add`, `rotate` or `secret` prints. A message that is
 * older or newer than `tolerance` seconds is refused.
 * -> the parsed message {type, timestamp, data}. Throws an Error if the message is not genuine.
 */
export async function verifyWebhook(body, headers, secret, { tolerance = 300 } = {}) {
  const header = (name) => (typeof headers.get === 'function' ? headers.get(name) : headers[name]) ?? '';
  const [id, timestamp, signatures] = ['webhook-id', 'webhook-timestamp', 'webhook-signature'].map(header);
  if (!/^whsec_[A-Za-z0-9+/]+=*$/.test(secret)) throw new TypeError('The secret must begin with whsec_.');
  if (!id || !/^\d{1,15}$/.test(timestamp) || !signatures)
    throw new Error('The message lacks the headers of a webhook.');
  if (Math.abs(Date.now() / 1000 - Number(timestamp)) > tolerance)
    throw new Error('The message is too old, or the clocks differ.');
  const content =
    typeof body === 'string' ? utf8(body) : new Uint8Array(body.buffer ?? body, body.byteOffset ?? 0, body.byteLength);
  const head = utf8(`${id}.${timestamp}.`);
  const signed = new Uint8Array(head.length + content.length);
  signed.set(head);
  signed.set(content, head.length);
  const wanted = `v1,${encode(await hmac(decode(secret.slice('whsec_'.length)), signed))}`;
  if (!signatures.split(' ').some((one) => same(one, wanted)))
    throw new Error('The signature of the message is wrong.');
  return JSON.parse(new TextDecoder().decode(content));
}
