/** Signed URLs. Only WebCrypto and URL are needed, so this runs in browsers, Deno and Node. */
import { hmac, utf8 } from './hmac.js';

const SPANS = { d: 86400, h: 3600, m: 60, s: 1 };

/** Unix time in seconds of a Date, of a Unix time, or of a span from now such as "30d", "12h" or "90m". */
function moment(expires) {
  if (expires instanceof Date) return Math.floor(expires.getTime() / 1000);
  const [, count, unit] = /^(\d+)([dhms])$/.exec(expires) ?? [];
  const time = count ? Math.floor(Date.now() / 1000) + count * SPANS[unit] : expires;
  if (!Number.isSafeInteger(time) || time <= 0)
    throw new TypeError('expires must be a Date, a Unix time in seconds or a span such as "30d".');
  return time;
}

/**
 * Signs a URL of the daemon (or a path), so that it can be loaded without a token until it expires. `key` and `secret`
 * are the two halves of what `orbmorphd key add` prints. The secret must not get into a page: sign on a server.
 * -> the signed URL
 */
export async function signUrl(url, { key, secret, expires }) {
  const text = String(url);
  const parsed = new URL(text, 'http://orbmorph.invalid');
  if (!/^[\w.-]+$/.test(key ?? '') || !secret) throw new TypeError('signUrl needs the key and the secret.');
  if (['key', 'expires', 'signature'].some((name) => parsed.searchParams.has(name)))
    throw new TypeError('The URL is signed already.');
  const query = `${parsed.search ? `${parsed.search}&` : '?'}key=${key}&expires=${moment(expires)}`;
  const mac = await hmac(utf8(secret), utf8(parsed.pathname + query));
  const hex = Array.from(mac, (byte) => byte.toString(16).padStart(2, '0')).join('');
  const origin = parsed.host === 'orbmorph.invalid' ? '' : parsed.origin;
  return `${origin}${parsed.pathname}${query}&signature=${hex}${parsed.hash}`;
}
