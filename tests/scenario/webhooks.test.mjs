// Webhooks by Standard Webhooks: what a receiver gets, its signatures checked by the package standardwebhooks, retries,
// and no message lost by kill -9. ORB_HOOK_KILLS is the number of kills.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { Webhook } from 'standardwebhooks';
import { verifyWebhook } from '../../client/js/src/index.js';
import { folder, runProgram } from './support/cli.mjs';
import { assertProblem, binaries, daemon, endless, root, slow, until } from './support/daemon.mjs';
import { origin } from './support/origin.mjs';
import * as shapes from './support/shapes.mjs';

const kills = Number(process.env.ORB_HOOK_KILLS ?? (slow ? 3 : 6));
const allow = ['--webhook-allow', '127.0.0.0/8', '--webhook-retry-seconds', '1'];

async function admin(d, ...words) {
  const ran = await runProgram(binaries.daemon, ['webhook', ...words, '--data', d.data]);
  assert.equal(ran.code, 0, ran.err);
  return ran.out.trim();
}
async function add(d, ...words) {
  const secret = await admin(d, 'add', ...words);
  assert.match(secret, /^whsec_[A-Za-z0-9+/]{43}=$/);
  return secret;
}

let made = 0;
async function mesh(d, options) {
  made++;
  const text = shapes.obj(shapes.ball(1, ([x, y, z]) => [x * (1 + 0.1 * Math.sin(made)), y, z + 0.001 * made]));
  const reply = await d.post('/v1/meshes', Buffer.from(text), options);
  assert.ok([200, 201].includes(reply.status), reply.bytes.toString());
  return reply.json.id;
}
const embed = (d, body, options) => d.post('/v1/embeddings', body, options);
const deliveries = async (d, job, options) => {
  const reply = await d.get(`${job.url}/deliveries`, options);
  assert.equal(reply.status, 200, reply.bytes.toString());
  return reply.json.deliveries;
};
/** The message of a request, with its signature verified. */
const verified = (secret, { body, headers }) => new Webhook(secret).verify(body, headers);
const endings = (d, job) =>
  until(async () => (await deliveries(d, job)).every((x) => x.state !== 'pending'), 'the ends');

test('the end of a job is announced to the webhook that the request names', async (t) => {
  const d = await daemon(t, { args: allow });
  const { url, requests } = await origin(t);
  const id = await mesh(d);
  const accepted = await embed(d, { mesh: id, webhook: { url: `${url}/hook?a=b#c` } });
  assert.equal(accepted.status, 202, accepted.bytes.toString());
  const job = await d.ended(accepted.json);
  await until(() => requests.length === 1, 'the message');
  const [message] = requests;
  assert.equal(message.method, 'POST');
  assert.equal(message.url, '/hook?a=b');
  assert.equal(message.headers['content-type'], 'application/json');
  const secret = await admin(d, 'secret');
  const body = verified(secret, message);
  assert.deepEqual(Object.keys(body), ['type', 'timestamp', 'data']);
  assert.equal(body.type, 'job.succeeded');
  assert.equal(body.timestamp, job.finished);
  assert.deepEqual(body.data, job);
  assert.throws(() => verified(secret, { ...message, body: `${message.body} ` }), /signature/i);
  await endings(d, job);
  const [delivery] = await deliveries(d, job);
  assert.deepEqual(
    { ...delivery, created: 0, finished: 0 },
    {
      number: 1,
      id: message.headers['webhook-id'],
      webhook: null,
      url: `${url}/hook?a=b`,
      type: 'job.succeeded',
      state: 'delivered',
      attempts: 1,
      status: 200,
      error: null,
      created: 0,
      next_attempt: null,
      finished: 0,
    },
  );
  // The webhook is not part of the id: the same request finds the embedding, and no job exists that would end.
  const known = await embed(d, { mesh: id, webhook: { url: `${url}/hook` } });
  assert.equal(known.status, 200);
  assert.equal(known.json.url, job.result);
  // A retry by hand.
  const again = await d.post(`${job.url}/deliveries/1/retry`);
  assert.equal(again.status, 202, again.bytes.toString());
  assert.equal(again.json.state, 'pending');
  await until(() => requests.length === 2, 'the message again');
  assert.equal(requests[1].headers['webhook-id'], message.headers['webhook-id']);
  assert.equal(requests[1].body, message.body);
  verified(secret, requests[1]);
  await endings(d, job);
  assert.equal((await deliveries(d, job))[0].attempts, 2);
  assertProblem(await d.post(`${job.url}/deliveries/2/retry`), 404, 'not-found');
  assertProblem(await d.get(`/v1/jobs/${'0'.repeat(32)}/deliveries`), 404, 'not-found');
  assertProblem(await d.post(`/v1/jobs/${'0'.repeat(32)}/deliveries/1/retry`), 404, 'not-found');
});

test('events choose what is announced; requests that share a job keep their webhooks', async (t) => {
  const d = await daemon(t, { args: [...allow, '--workers', '1'] });
  const { url, requests } = await origin(t);
  const large = (await d.upload(shapes.obj(shapes.egg(5)))).json.id;
  const busy = { mesh: large, ...endless };
  const jobs = [];
  for (const [name, events] of [
    ['all', undefined],
    ['succeeded', ['succeeded']],
    ['cancelled', ['cancelled', 'failed']],
    ['all', ['failed']],
  ])
    jobs.push((await embed(d, { ...busy, webhook: { url: `${url}/${name}`, events } })).json);
  assert.equal(new Set(jobs.map((job) => job.id)).size, 1);
  await d.delete(jobs[0].url);
  await d.ended(jobs[0]);
  await until(() => requests.length === 2, 'both messages');
  assert.deepEqual(requests.map((r) => r.url).sort(), ['/all', '/cancelled']);
  assert.equal(JSON.parse(requests[0].body).type, 'job.cancelled');
  await endings(d, jobs[0]);
  assert.equal((await deliveries(d, jobs[0])).length, 2);
  // A job that fails: its landmark is a vertex that no triangle uses.
  const text = shapes.obj(shapes.egg(1));
  const spare = (await d.upload(`${text}v 0 0 0\n`)).json.id;
  const last = text.match(/^v /gm).length;
  const failed = await d.post('/v1/supermeshes', {
    shapes: [{ mesh: await mesh(d) }, { mesh: spare }],
    landmarks: [{ at: [{ vertex: 0 }, { vertex: last }] }],
    webhook: { url: `${url}/failed`, events: ['failed'] },
  });
  const end = await d.ended(failed.json);
  assert.equal(end.state, 'failed');
  await until(() => requests.length === 3, 'the message of the failure');
  assert.equal(JSON.parse(requests[2].body).type, 'job.failed');
  assert.deepEqual(JSON.parse(requests[2].body).data.problem, end.problem);
});

test('a webhook is read strictly, and goes to public and listed addresses only', async (t) => {
  const d = await daemon(t, { args: ['--webhook-allow', '127.0.0.2'] });
  const { url, requests } = await origin(t);
  const id = await mesh(d);
  const port = url.split(':').pop();
  for (const [webhook, type, status] of [
    [null, 'invalid-request', 422],
    [url, 'invalid-request', 422],
    [{}, 'invalid-request', 422],
    [{ url: 'hook' }, 'invalid-request', 422],
    [{ url: 'https://example.org/', events: [] }, 'invalid-request', 422],
    [{ url: 'https://example.org/', events: ['ended'] }, 'invalid-request', 422],
    [{ url: 'https://example.org/', event: ['failed'] }, 'unknown-member', 422],
    [{ url }, 'forbidden-address', 403],
    [{ url: 'https://127.0.0.1/' }, 'forbidden-address', 403],
    [{ url: 'https://[::1]/' }, 'forbidden-address', 403],
    [{ url: 'https://169.254.169.254/' }, 'forbidden-address', 403],
    [{ url: 'https://a:b@example.org/' }, 'forbidden-address', 403],
    [{ url: 'http://8.8.8.8/' }, 'forbidden-address', 403],
  ])
    assertProblem(await embed(d, { mesh: id, webhook }), status, type, JSON.stringify(webhook));
  // The daemon resolves a name when it sends the message. It does not follow a redirect.
  const listed = await origin(t, (_, response) => response.writeHead(307, { location: url }).end(), '127.0.0.2');
  await add(d, 'local', '--url', `http://localhost:${port}/`);
  const job = await d.ended((await embed(d, { mesh: id, webhook: { url: listed.url } })).json);
  await until(async () => (await deliveries(d, job)).every((x) => x.attempts > 0), 'attempts');
  const [own, local] = await deliveries(d, job);
  assert.equal(own.state, 'pending');
  assert.equal(own.status, 307);
  assert.equal(local.webhook, 'local');
  assert.equal(local.status, null);
  assert.match(local.error, /address/);
  assert.equal(requests.length, 0);
});

test('webhooks of a tenant: added, rotated with overlap, removed, in a running daemon', async (t) => {
  const d = await daemon(t, { args: [...allow, '--auth', 'on'] });
  const { url, requests } = await origin(t);
  const token = async (name) => {
    const ran = await runProgram(binaries.daemon, ['token', 'add', name, '--scope', 'read,write', '--data', d.data]);
    return { headers: { authorization: `Bearer ${ran.out.trim()}` } };
  };
  const [ann, bob] = [await token('ann'), await token('bob')];
  const first = await add(d, 'site', '--url', `${url}/site`, '--tenant', 'ann', '--events', 'succeeded');
  const twice = ['webhook', 'add', 'site', '--url', url, '--data', d.data];
  assert.equal((await runProgram(binaries.daemon, twice)).code, 1);
  const list = await admin(d, 'list');
  assert.equal(list, `site tenant=ann url=${url}/site events=succeeded`);
  const run = async (who, body = {}) => {
    const count = requests.length;
    const { json } = await embed(d, { mesh: await mesh(d, who), ...body }, who);
    return { job: json, message: async () => until(() => requests[count], 'a message') };
  };
  const one = await run(ann);
  assert.equal(verified(first, await one.message()).data.id, one.job.id);
  await endings({ get: (target) => d.get(target, ann) }, one.job);
  assertProblem(await d.get(`${one.job.url}/deliveries`, bob), 404, 'not-found');
  assertProblem(await d.post(`${one.job.url}/deliveries/1/retry`, undefined, bob), 404, 'not-found');
  // Two signatures while the secrets overlap.
  const second = await admin(d, 'rotate', 'site', '--overlap', '1h');
  const both = await (await run(ann)).message();
  assert.equal(both.headers['webhook-signature'].split(' ').length, 2);
  for (const secret of [first, second]) verified(secret, both);
  const third = await admin(d, 'rotate', 'site', '--overlap', '0s');
  const last = await (await run(ann)).message();
  assert.throws(() => verified(second, last));
  verified(third, last);
  // A webhook of a request is signed with the secret of its tenant.
  const own = await admin(d, 'secret', '--tenant', 'bob');
  assert.equal(await admin(d, 'secret', '--tenant', 'bob'), own);
  assert.notEqual(await admin(d, 'secret', '--tenant', 'ann'), own);
  const its = await (await run(bob, { webhook: { url: `${url}/own` } })).message();
  assert.equal(its.url, '/own');
  verified(own, its);
  await admin(d, 'remove', 'site');
  assert.equal(await admin(d, 'list'), '');
  const { job } = await run(ann);
  await until(async () => (await d.get(job.url, ann)).json.state === 'succeeded', 'the job');
  assert.deepEqual(await deliveries(d, job, ann), []);
});

test('https trusts the authorities of tls-authorities, and no others', async (t) => {
  const at = await folder(t);
  const [key, cert] = ['key.pem', 'cert.pem'].map((name) => path.join(at, name));
  const subject = ['-subj', '/CN=localhost', '-addext', 'subjectAltName=IP:127.0.0.1'];
  const kind = ['-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:prime256v1', '-nodes', '-days', '2'];
  const made = ['req', '-x509', ...kind, ...subject, '-keyout', key, '-out', cert];
  assert.equal((await runProgram('openssl', made)).code, 0);
  const tls = { key: await readFile(key), cert: await readFile(cert) };
  const { url, requests } = await origin(t, undefined, '127.0.0.1', tls);
  for (const trusted of [false, true]) {
    const d = await daemon(t, { args: [...allow, ...(trusted ? ['--tls-authorities', cert] : [])] });
    const body = { mesh: await mesh(d), webhook: { url } };
    const job = await d.ended((await embed(d, body)).json);
    const [end] = await until(async () => {
      const list = await deliveries(d, job);
      return list[0].attempts > 0 && list;
    }, 'an attempt');
    assert.equal(end.state, trusted ? 'delivered' : 'pending');
    if (!trusted) assert.match(end.error, /certificate/i);
    assert.equal(requests.length, trusted ? 1 : 0);
    await d.stop();
  }
});

test('a receiver that fails is asked again and delays no other', async (t) => {
  const d = await daemon(t, { args: allow });
  let well = false;
  const ill = await origin(t, (_, response) => response.writeHead(well ? 204 : 500).end());
  const silent = await origin(t, () => {});
  const gone = await origin(t, (_, response) => response.writeHead(410).end());
  const fine = await origin(t);
  for (const [name, { url }] of Object.entries({ ill, silent, gone, fine })) await add(d, name, '--url', url);
  const job = await d.ended((await embed(d, { mesh: await mesh(d) })).json);
  await until(() => fine.requests.length === 1, 'the message');
  await until(() => silent.requests.length > 0, 'the message to the silent one');
  assert.ok(fine.requests[0].at - silent.requests[0].at < 14_000, 'before the silent one is given up');
  await until(() => ill.requests.length >= 3, 'three attempts');
  const waits = [1, 2].map((i) => ill.requests[i].at - ill.requests[i - 1].at);
  assert.ok(waits[0] >= 900 && waits[1] >= 1800, `${waits} ms`);
  for (const { headers } of ill.requests) assert.equal(headers['webhook-id'], ill.requests[0].headers['webhook-id']);
  const state = await until(async () => {
    const now = Object.fromEntries((await deliveries(d, job)).map((x) => [x.webhook, x]));
    return now.fine.state === 'delivered' && now.gone.state === 'failed' && now; // 410 is final
  }, 'the ends of two');
  assert.equal(gone.requests.length, 1);
  assert.equal(state.gone.status, 410);
  assert.equal(state.ill.state, 'pending');
  assert.equal(state.ill.error, 'the receiver answered 500');
  assert.ok(Date.parse(state.ill.next_attempt) > ill.requests[1].at);
  // One message at a time goes to a receiver.
  for (let i = 0; i < 3; i++) await d.made('/v1/embeddings', { mesh: await mesh(d) });
  await until(() => fine.requests.length === 4, 'the other messages');
  silent.requests.slice(1).forEach((r, i) => assert.ok(r.at - silent.requests[i].at > 14_000, 'one after another'));
  // A retry by hand before it is due.
  well = true;
  await d.post(`${job.url}/deliveries/${state.ill.number}/retry`);
  await until(async () => (await deliveries(d, job)).find((x) => x.webhook === 'ill').state === 'delivered', 'its end');
  await admin(d, 'remove', 'silent');
  const removed = (await deliveries(d, job)).find((x) => x.webhook === 'silent');
  assert.equal(removed.state, 'failed');
  assert.match(removed.error, /removed/);
});

test('the documented code verifies messages, in JavaScript and Python', async () => {
  const secret = 'whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw';
  const old = 'whsec_C2FVsBQIhrscChlQIMV+b5sSYspob7oD';
  const now = new Date();
  const body = '{"type":"job.succeeded","data":{"name":"Bär"}}';
  const sign = (key, at = now) => new Webhook(key).sign('msg_a_1', at, body);
  const headers = (signature, at = now) => ({
    'webhook-id': 'msg_a_1',
    'webhook-timestamp': `${Math.floor(at / 1000)}`,
    'webhook-signature': signature,
  });
  const both = headers(`${sign(secret)} ${sign(old)}`);
  for (const key of [secret, old]) {
    assert.equal((await verifyWebhook(body, both, key)).data.name, 'Bär');
    assert.equal((await verifyWebhook(Buffer.from(body), new Headers(both), key)).type, 'job.succeeded');
  }
  const before = new Date(now - 400_000);
  for (const wrong of [
    [`${body} `, both, secret],
    [body, headers(sign(secret)), old],
    [body, headers(sign(secret).replace('v1,', 'v2,')), secret],
    [body, { ...both, 'webhook-id': 'msg_a_2' }, secret],
    [body, { ...both, 'webhook-timestamp': `${Math.floor(now / 1000) - 1}` }, secret],
    [body, headers(sign(secret, before), before), secret],
    [body, {}, secret],
    [body, both, 'secret'],
  ])
    await assert.rejects(verifyWebhook(...wrong), JSON.stringify(wrong));
  const page = await readFile(path.join(root, 'docs/webhooks.md'), 'utf8');
  const [, lines] = /```python\n([\s\S]*?)```/.exec(page);
  for (const [key, genuine] of [
    [secret, 'True'],
    [old, 'True'],
    ['whsec_AAAA', 'False'],
  ]) {
    const given = `headers = ${JSON.stringify(both)}\nbody = ${JSON.stringify(body)}.encode()\nsecret = "${key}"\n`;
    const ran = await runProgram('python3', ['-c', `${given}${lines}print(genuine)`]);
    assert.equal(ran.out.trim(), genuine, ran.err);
  }
});

test(`${kills} kills -9 lose no message`, async (t) => {
  let count = 0;
  const got = new Map(); // job → messages
  let secret;
  const receiver = await origin(t, (request, response, body) => {
    const behaviour = count++ % 8;
    if (behaviour === 0) response.writeHead(503).end();
    else if (behaviour === 1) request.socket.destroy();
    else {
      const message = verified(secret, { body, headers: request.headers }); // now: the signature is too old later
      got.set(message.data.id, [...(got.get(message.data.id) ?? []), { body, headers: request.headers }]);
      setTimeout(() => response.writeHead(204).end(), behaviour === 2 ? 30 : 0);
    }
  });
  const d = await daemon(t, { args: [...allow, '--workers', '2'] });
  secret = await add(d, 'hook', '--url', `${receiver.url}/tenant`);
  const accepted = new Set();
  d.killed = true;
  for (let kill = 0; kill < kills; kill++) {
    const work = (async () => {
      try {
        for (;;) {
          const { status, json } = await embed(d, { mesh: await mesh(d) });
          if (status === 202) accepted.add(json.id);
        }
      } catch (error) {
        if (error instanceof assert.AssertionError) throw error;
      }
    })();
    await until(() => accepted.size > kill, 'another job is accepted');
    await new Promise((done) => setTimeout(done, Math.random() * (slow ? 900 : 300)));
    await d.stop('SIGKILL');
    await work;
    await d.start();
  }
  assert.ok(accepted.size >= kills, `${accepted.size} jobs`);
  await until(() => [...accepted].every((id) => got.has(id)), 'each accepted job is announced');
  let repeated = 0;
  for (const [id, messages] of got) {
    assert.equal(new Set(messages.map((m) => m.headers['webhook-id'])).size, 1, `${id}: one id`);
    assert.equal(new Set(messages.map((m) => m.body)).size, 1, `${id}: one body`);
    repeated += messages.length - 1;
  }
  t.diagnostic(`${kills} kills, ${accepted.size} accepted jobs, all announced; ${repeated} messages repeated`);
  await until(async () => {
    const { json } = await d.get('/v1/jobs', { query: { limit: 1000 } });
    for (const job of json.jobs) if ((await deliveries(d, job)).some((x) => x.state === 'pending')) return false;
    return true;
  }, 'nothing is pending');
});

test('where the system denies connections, deliveries and downloads say so', {
  skip: !process.env.ORB_WITHOUT && 'ORB_WITHOUT names no program',
}, async (t) => {
  const d = await daemon(t, {
    args: [...allow, '--fetch-allow', '127.0.0.0/8'],
    program: [process.env.ORB_WITHOUT, 'addresses', binaries.daemon],
  });
  const { url, requests } = await origin(t);
  const accepted = await embed(d, { mesh: await mesh(d), webhook: { url } });
  const job = await d.ended(accepted.json);
  await until(async () => (await deliveries(d, job))[0].attempts > 0, 'an attempt');
  const [delivery] = await deliveries(d, job);
  assert.match(
    JSON.stringify(delivery),
    /the system denies the connection \(IPAddressDeny of the unit, or a firewall\)/,
  );
  assert.match(d.log, /webhooks cannot be delivered: the system denies .*outgoing\.conf/);
  const fetched = await d.ended((await d.post('/v1/meshes', { url: `${url}/a.obj` })).json);
  assert.equal(fetched.problem.type, '/problems/fetch-failed');
  assert.match(fetched.problem.detail, /^The file was not fetched: the system denies the connection/);
  assert.equal(requests.length, 0);
});
