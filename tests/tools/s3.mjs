// A client of S3 for tests that makes its own signatures: s3.mjs METHOD BUCKET[/KEY][?QUERY] on the server of
// with_s3.sh.
import { createHash, createHmac } from 'node:crypto';

const sha256 = (bytes) => createHash('sha256').update(bytes).digest('hex');
const hmac = (key, text) => createHmac('sha256', key).update(text).digest();

/** The keys of with_s3.sh. */
export const KEYS = { access: 'orbmorph:daemon', secret: 'secret-of-the-daemon' };

/** Sends a signed request; path: BUCKET[/KEY][?QUERY], with nothing in it that needs encoding. */
export async function s3(endpoint, method, path, body, meta = {}, keys = KEYS) {
  const url = new URL(`/${path}`, endpoint);
  const date = new Date().toISOString().replace(/[-:]|\.\d+/g, '');
  const scope = `${date.slice(0, 8)}/us-east-1/s3/aws4_request`;
  const payload = sha256(body ?? '');
  const headers = { host: url.host, 'x-amz-content-sha256': payload, 'x-amz-date': date };
  for (const [name, value] of Object.entries(meta)) {
    headers[`x-amz-meta-${name}`] = value;
  }
  const names = Object.keys(headers).sort();
  const query = [...url.searchParams]
    .map(([name, value]) => `${encodeURIComponent(name)}=${encodeURIComponent(value)}`)
    .sort();
  const canonical = [
    method,
    url.pathname,
    query.join('&'),
    ...names.map((name) => `${name}:${headers[name]}`),
    '',
    names.join(';'),
    payload,
  ].join('\n');
  const text = ['AWS4-HMAC-SHA256', date, scope, sha256(canonical)].join('\n');
  const key = [date.slice(0, 8), 'us-east-1', 's3', 'aws4_request'].reduce(hmac, `AWS4${keys.secret}`);
  const signature = createHmac('sha256', key).update(text).digest('hex');
  delete headers.host;
  headers.authorization = `AWS4-HMAC-SHA256 Credential=${keys.access}/${scope},SignedHeaders=${names.join(';')},Signature=${signature}`;
  return fetch(url, { method, body, headers });
}

/** The keys of all objects that begin with a prefix. */
export async function list(endpoint, bucket, prefix = '') {
  const answer = await s3(endpoint, 'GET', `${bucket}?list-type=2&prefix=${encodeURIComponent(prefix)}`);
  return [...(await answer.text()).matchAll(/<Key>([^<]*)<\/Key>/g)].map((found) => found[1]);
}

if (process.argv[1] === import.meta.filename) {
  const [method, path] = process.argv.slice(2);
  const answer = await s3(process.env.ORB_S3, method, path);
  process.stdout.write(await answer.text());
  process.exitCode = answer.ok ? 0 : 1;
}
