// Tenants: what one token may see and change of another's, although equal bytes and equal requests are stored once.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import test from 'node:test';
import { isDeepStrictEqual, promisify } from 'node:util';
import { assertProblem, binaries, daemon, endless, until } from './support/daemon.mjs';
import { objectsNamed } from './support/objects.mjs';
import * as shapes from './support/shapes.mjs';

const wave = (levels, k = 1) =>
  shapes.binaryPly(shapes.ball(levels, ([x, y, z]) => [x * (1 + 0.3 * Math.sin(7 * y + k)), 1.5 * y, z]));
const large = wave(5);
const small = wave(3, 2);
const other = wave(3, 3);

async function tenants(t, ...args) {
  const d = await daemon(t, { args: ['--auth', 'on', '--workers', '1', ...args] });
  const token = (...words) =>
    promisify(execFile)(binaries.daemon, ['token', ...words, '--data', d.data]).then(({ stdout }) => stdout.trim());
  const add = async (name, scope, ...more) => {
    const who = { headers: { authorization: `Bearer ${await token('add', name, '--scope', scope, ...more)}` } };
    return process.env.ORB_NODES ? d.known(who) : who;
  };
  const upload = (who, bytes, query = {}) => d.post('/v1/meshes', bytes, { ...who, query });
  const list = async (who, what) => (await d.get(`/v1/${what}`, who)).json[what].map(({ id }) => id);
  const end = async (who, job) => {
    let reply;
    do reply = await d.get(job.url, { ...who, query: { wait: 60 } });
    while (reply.json.finished === null);
    assert.equal(reply.json.state, 'succeeded', reply.bytes.toString());
    return reply.json;
  };
  return { d, token, add, upload, list, end };
}

/** Asserts that two responses are equal except for what differs between any two requests. */
function assertSame(a, b, hide, what) {
  const plain = (reply) => hide.reduce((text, word) => text.replaceAll(word, '*'), reply.bytes.toString());
  assert.equal(a.status, b.status, what);
  assert.equal(plain(a), plain(b), what);
  for (const [name, value] of a.headers)
    if (!['date', 'x-request-id'].includes(name)) assert.equal(b.headers.get(name), value, `${what}: ${name}`);
  assert.deepEqual([...a.headers.keys()], [...b.headers.keys()], what);
}

test('a tenant does not see what another one owns', async (t) => {
  const { d, add, upload, list, end } = await tenants(t);
  const [ann, bob, reader, admin] = [
    await add('ann', 'read,write'),
    await add('bob', 'read,write'),
    await add('reader', 'read'),
    await add('root', 'admin'),
  ];
  const viewer = await add('viewer', 'read', '--tenant', 'ann');
  const [a, b] = [(await upload(ann, small, { name: 'secret' })).json, (await upload(ann, other)).json];
  const super_ = (await d.post('/v1/supermeshes', { shapes: [{ mesh: a.id }, { mesh: b.id }] }, ann)).json;
  const ended = await end(ann, super_);
  const [embedding] = await list(ann, 'embeddings');
  const running = (await d.post('/v1/embeddings', { mesh: (await upload(ann, large)).json.id, ...endless }, ann)).json;
  const queued = (await d.post('/v1/embeddings', { mesh: a.id, ...endless }, ann)).json;

  const things = [
    a.url,
    `${a.url}/file`,
    `/v1/embeddings/${embedding}`,
    `/v1/embeddings/${embedding}/sphere.ply`,
    ended.result,
    `${ended.result}/asset.glb`,
    `${ended.result}/places`,
    `${ended.result}/spheres/0.ply`,
  ];
  const jobs = [super_.url, running.url, queued.url];
  for (const url of [...things, ...jobs]) {
    for (const who of [ann, viewer, admin]) {
      const reply = await d.get(url, who);
      assert.equal(reply.status, 200, url);
      if (/\.(glb|ply)$|places$|file$/.test(url))
        assert.match(reply.headers.get('cache-control'), /^private/, 'no shared cache keeps it');
    }
    const id = /[0-9a-f]{32,64}/.exec(url)[0];
    const nothing = url.replace(id, '0'.repeat(id.length));
    for (const who of [bob, reader]) {
      assertSame(await d.get(url, who), await d.get(nothing, who), [id, '0'.repeat(id.length)], url);
      assert.equal((await d.get(url, who)).status, 404, url);
      assert.equal((await d.request('HEAD', url, who)).status, 404, url);
    }
  }
  for (const job of jobs) {
    assertProblem(await d.get(`${job}/events`, bob), 404, 'not-found');
    assertProblem(await d.get(job, { ...bob, query: { wait: 5 } }), 404, 'not-found', 'at once');
    assertProblem(await d.delete(job, bob), 404, 'not-found');
    assertProblem(await d.delete(job, viewer), 403, 'forbidden');
  }
  for (const thing of [a.url, `/v1/embeddings/${embedding}`, ended.result]) {
    assertProblem(await d.delete(thing, bob), 404, 'not-found');
    assertProblem(await d.delete(thing, viewer), 403, 'forbidden');
    assert.equal((await d.get(thing, ann)).status, 200);
  }
  // Knowing the id of a mesh is not enough to use it.
  const nobodys = { mesh: '0'.repeat(64) };
  assertSame(
    await d.post('/v1/embeddings', { mesh: a.id }, bob),
    await d.post('/v1/embeddings', nobodys, bob),
    [a.id, nobodys.mesh],
    'embedding',
  );
  const merge = (mesh) => d.post('/v1/supermeshes', { shapes: [{ mesh }, { mesh }] }, bob);
  assertSame(await merge(a.id), await merge(nobodys.mesh), [a.id, nobodys.mesh], 'supermesh');

  for (const what of ['meshes', 'embeddings', 'supermeshes', 'jobs']) {
    assert.deepEqual(await list(bob, what), [], what);
    const own = await list(ann, what);
    assert.equal(own.length, { meshes: 3, embeddings: 2, supermeshes: 1, jobs: 3 }[what], what);
    assert.deepEqual(await list(viewer, what), own);
    assert.deepEqual(await list(admin, what), own);
  }
  assert.deepEqual((await d.get('/v1/jobs', { ...bob, query: { state: 'running' } })).json.jobs, []);
  // Only the operator sees how much work there is.
  await until(async () => (await d.get(running.url, ann)).json.state === 'running', 'it runs');
  // One of several nodes runs it, and the proxy chooses which one answers.
  const running_here = async () => (await d.get('/readyz?verbose', admin)).json.running;
  if (process.env.ORB_NODES) await until(async () => (await running_here()) === 1, 'a node says that it runs a job');
  else assert.equal(await running_here(), 1);
  for (const who of [ann, reader, {}])
    assert.deepEqual((await d.get('/readyz?verbose', who)).json, { status: 'ready' });
  const before = await list(admin, 'jobs');
  const [queued_end, running_end] = [await d.delete(queued.url, ann), await d.delete(running.url, admin)];
  assert.deepEqual([queued_end.status, running_end.status], [200, 200], 'its own, and all with admin');
  assert.equal(before.length, 3);
});

test('the id of a request reveals nothing about other tenants', async (t) => {
  const { d, add } = await tenants(t);
  const [ann, bob] = [await add('ann', 'read'), await add('bob', 'read')];
  const seen = [];
  for (let i = 0; i < 40; i++)
    seen.push(BigInt(`0x${(await d.get('/v1/meshes', i % 2 ? ann : bob)).headers.get('x-request-id')}`));
  assert.equal(new Set(seen).size, seen.length);
  const steps = seen.slice(1).map((n, i) => n - seen[i]);
  assert.equal(new Set(steps).size, steps.length, 'no step comes twice');
  assert.ok(steps.some((step) => step < 0n) && steps.some((step) => step > 0n), 'they do not count');
});

test('page tokens reveal nothing about other tenants', async (t) => {
  const { d, add, upload } = await tenants(t);
  const [ann, bob] = [await add('ann', 'read,write'), await add('bob', 'read,write')];
  const tokens = [];
  const seen = [];
  for (let i = 0; i < 12; i++)
    for (const who of [ann, bob]) await upload(who, `${shapes.tetrahedron}# ${i} ${who === ann}\n`);
  const page = (token) => d.get('/v1/meshes', { ...bob, query: { limit: 1, ...(token && { page_token: token }) } });
  for (let token, first = true; token || first; first = false) {
    const { json } = await page(token);
    seen.push(...json.meshes.map(({ id }) => id));
    if ((token = json.next_page_token)) tokens.push(token);
  }
  assert.equal(new Set(seen).size, 12);
  assert.equal(tokens.length, 11);
  for (const token of tokens) assert.match(token, /^[0-9a-f]{16}$/);
  const numbers = tokens.map((token) => BigInt(`0x${token}`));
  const steps = numbers.slice(1).map((n, i) => n - numbers[i]);
  assert.equal(new Set(steps).size, steps.length, 'no step comes twice');
  assert.ok(steps.some((step) => step < 0n) && steps.some((step) => step > 0n), 'they do not count');
  // Cursors belong to this data folder: they stay valid after a restart, and no others are.
  await d.stop();
  await d.start();
  assert.deepEqual(
    (await page(tokens[4])).json.meshes.map(({ id }) => id),
    [seen[5]],
  );
  for (const token of [
    '1',
    'ffff',
    '0'.repeat(16),
    'f'.repeat(16),
    '000000000000000c',
    tokens[4].slice(1),
    `${tokens[4]}0`,
    tokens[4].replace(/.$/, (c) => (c === '0' ? '1' : '0')),
  ])
    assertProblem(await page(token), 400, 'bad-query', token);
});

test('an upload does not reveal that another tenant has the same mesh', async (t) => {
  const { d, add, upload } = await tenants(t);
  const [ann, bob] = [await add('ann', 'read,write'), await add('bob', 'read,write')];
  const first = await upload(ann, small, { name: 'secret' });
  await new Promise((done) => setTimeout(done, 1100)); // times of uploads are whole seconds
  const second = await upload(bob, small, { name: 'mine' });
  assert.deepEqual([first.status, second.status], [201, 201]);
  assert.equal(second.json.id, first.json.id);
  assert.equal(second.json.name, 'mine');
  assert.ok(Date.parse(second.json.created) > Date.parse(first.json.created), 'with its own time');
  assert.deepEqual(
    { ...second.json, name: 'secret', created: first.json.created },
    first.json,
    'all else follows from the bytes',
  );
  assert.deepEqual((await d.get(second.json.url, bob)).json, second.json);
  assert.deepEqual((await d.get(first.json.url, ann)).json, first.json);
  assert.deepEqual((await d.get('/v1/meshes', bob)).json.meshes, [second.json]);
  const again = await upload(bob, small, { name: 'other' });
  assert.equal(again.status, 200, 'known to this tenant');
  assert.deepEqual(again.json, second.json);
  // A request that cannot be accepted is refused in the same way to both.
  const twice = await Promise.all([ann, bob].map((who) => upload(who, Buffer.from('o nothing\n'))));
  assertSame(twice[0], twice[1], [], 'a bad file');
});

test('equal requests of two tenants: one result, two jobs', async (t) => {
  const { d, add, upload, list, end } = await tenants(t);
  const [ann, bob] = [await add('ann', 'read,write'), await add('bob', 'read,write')];
  const { id } = (await upload(ann, large)).json;
  assert.equal((await upload(bob, large)).status, 201);
  const ask = (who, more) => d.post('/v1/embeddings', { mesh: id, ...more }, who);

  // Bob has his own job: Ann's ends when she cancels it, his goes on.
  const accepted = [await ask(ann, endless), await ask(bob, endless)];
  for (const { status, bytes } of accepted) assert.equal(status, 202, bytes.toString());
  const [his, hers] = accepted.map(({ json }) => json);
  assert.notEqual(his.id, hers.id);
  assert.equal((await ask(bob, endless)).json.id, hers.id, 'of one tenant it is the same job');
  assert.equal((await d.get(hers.url, bob)).json.state, 'queued', 'the work is not done twice at once');
  assertProblem(await d.delete(hers.url, ann), 404, 'not-found');
  assert.equal((await d.delete(his.url, ann)).status, 200);
  await until(async () => (await d.get(hers.url, bob)).json.state === 'running', 'his job runs');
  assert.equal((await d.delete(hers.url, bob)).status, 200);

  // Bob cannot see that Ann already has the result, except by the time that it takes.
  const one = await end(ann, (await ask(ann)).json);
  // The only worker is busy with Ann's job, and Bob's other job runs beside it, while Bob looks: an existing result
  // arrives at once.
  const blocker = (await ask(ann, endless)).json;
  await until(async () => (await d.get(blocker.url, ann)).json.state === 'running', 'the worker is busy');
  const beside = (await ask(bob, { ...endless, options: { ...endless.options, step: 0.011 } })).json;
  await until(async () => (await d.get(beside.url, bob)).json.state === 'running', 'Bob has a job that runs');
  const began = Date.now();
  const reply = await ask(bob);
  assert.equal(reply.status, 202);
  assert.deepEqual(await list(bob, 'embeddings'), []);
  assert.equal((await d.delete(beside.url, bob)).status, 200);
  assert.equal((await d.delete(blocker.url, ann)).status, 200);
  const two = await end(bob, reply.json);
  assert.equal(two.result, one.result);
  const [a, b] = [(await d.get(one.result, ann)).json, (await d.get(two.result, bob)).json];
  assert.ok(Date.parse(b.created) >= began && Date.parse(a.created) < began);
  assert.deepEqual({ ...b, created: a.created }, a, 'the very same result');
  assert.equal((await ask(bob)).status, 200);
  assert.equal((await objectsNamed(d.data, a.id)).length, 1, 'stored once');

  // Bob's merge shows him the embeddings that it needed, although Ann's existed.
  const third = (await upload(ann, other)).json;
  await end(ann, (await d.post('/v1/embeddings', { mesh: third.id }, ann)).json);
  await upload(bob, other);
  await end(bob, (await d.post('/v1/supermeshes', { shapes: [{ mesh: id }, { mesh: third.id }] }, bob)).json);
  assert.equal((await list(bob, 'embeddings')).length, 2);
  assert.deepEqual(await list(ann, 'supermeshes'), []);
});

test('deleting removes only the tenant that deletes from the owners', async (t) => {
  const { d, token, add, upload, list, end } = await tenants(t);
  const quota = ['--quota', String(small.length + other.length)];
  const [ann, bob, admin] = [
    await add('ann', 'read,write', ...quota),
    await add('bob', 'read,write', ...quota),
    await add('root', 'admin'),
  ];
  const left = async (who) =>
    Number(/"upload";r=(\d+)/.exec((await d.get('/v1/meshes', who)).headers.get('ratelimit'))[1]);
  const { id, url } = (await upload(ann, small)).json;
  await upload(bob, small);
  // Several nodes learn of it after a moment, and answer in turn.
  const leaves = async (...most) => {
    const all = async () => {
      const found = [];
      for (let i = 0; i < Number(process.env.ORB_NODES ?? 1); i++) found.push([await left(ann), await left(bob)]);
      return found;
    };
    if (process.env.ORB_NODES)
      await until(async () => (await all()).every((found) => isDeepStrictEqual(found, most)), `${most} are left`, 60);
    else assert.deepEqual(await all(), [most]);
  };
  await leaves(other.length, other.length); // each owns it, so it counts for each
  const made = await Promise.all(
    [ann, bob].map(async (who) => (await end(who, (await d.post('/v1/embeddings', { mesh: id }, who)).json)).result),
  );
  assert.equal(made[0], made[1]);

  for (const thing of [url, made[0]]) {
    assert.equal((await d.delete(thing, ann)).status, 204);
    assertProblem(await d.get(thing, ann), 404, 'not-found');
    assertProblem(await d.delete(thing, ann), 404, 'not-found');
    assert.equal((await d.get(thing, bob)).status, 200, 'the other has it still');
  }
  assert.equal((await d.get(`${url}/file`, bob)).bytes.length, small.length);
  await leaves(small.length + other.length, other.length); // the bytes that a tenant gives up no longer count
  assert.equal((await upload(ann, small)).status, 201, 'and may come back');
  assert.equal((await upload(ann, other)).status, 201);
  assertProblem(await upload(ann, wave(3, 4)), 429, 'quota-exceeded');
  assert.equal((await d.delete(url, ann)).status, 204);

  // When the last owner deletes it, it is gone for everyone.
  const files = async () => (await objectsNamed(d.data, id)).length;
  assert.equal(await files(), 1);
  assert.equal((await d.delete(url, bob)).status, 204);
  assert.equal(await files(), 0);
  assertProblem(await d.get(url, admin), 404, 'not-found');
  assert.equal((await d.get(made[1], bob)).status, 200, 'what was derived stays');

  // Each of several nodes learns of a new quota by a notice.
  const accepted = async (who) => {
    let reply = await upload(who, large);
    if (process.env.ORB_NODES)
      await until(async () => reply.status !== 429 || !(reply = await upload(who, large)), 'a node knows the quota');
    return reply.json;
  };

  // A job that needs it prevents the deletion, but only for the job's own tenant.
  await upload(ann, large);
  await token('set', 'bob', '--quota', '0');
  const { url: big, id: mesh } = await accepted(bob);
  await token('set', 'ann', '--quota', '0');
  const hers = await accepted(ann);
  assert.equal(hers.id, mesh);
  const job = (await d.post('/v1/embeddings', { mesh, ...endless }, bob)).json;
  assertProblem(await d.delete(big, bob), 409, 'in-use');
  assert.equal((await d.delete(big, ann)).status, 204);
  assert.equal((await d.delete(job.url, bob)).status, 200);

  // The operator deletes for everyone, and sees entries without an owner. A token that returns under its name finds its
  // own entries.
  await upload(ann, small);
  await upload(bob, small);
  assert.equal((await d.delete(url, admin)).status, 204);
  for (const who of [ann, bob]) assertProblem(await d.get(url, who), 404, 'not-found');
  await token('remove', 'bob');
  const [kept] = await list(admin, 'meshes');
  assert.ok((await list(admin, 'meshes')).includes(mesh) && kept);
  const back = await add('bob', 'read,write');
  assert.ok((await list(back, 'meshes')).includes(mesh));

  await d.stop();
  const { stdout } = await promisify(execFile)(binaries.daemon, ['--check-data', '--data', d.data]);
  assert.match(stdout, /: 0 wrong, 0 objects without a row/);
});

test('only the operator sees what was made without tokens', async (t) => {
  const d = await daemon(t, {});
  const { id, url } = (await d.upload(small)).json;
  const { resource } = await d.make('/v1/embeddings', { mesh: id });
  await d.stop();
  d.args = ['--auth', 'on'];
  await d.start();
  const add = async (name, scope) => ({
    headers: {
      authorization: `Bearer ${(await promisify(execFile)(binaries.daemon, ['token', 'add', name, '--scope', scope, '--data', d.data])).stdout.trim()}`,
    },
  });
  const [ann, admin] = [await add('ann', 'read,write'), await add('root', 'admin')];
  if (process.env.ORB_NODES) for (const who of [ann, admin]) await d.known(who);
  for (const thing of [url, resource.url]) {
    assertProblem(await d.get(thing, ann), 404, 'not-found');
    assert.equal((await d.get(thing, admin)).status, 200);
  }
  assert.equal((await d.post('/v1/meshes', small, ann)).status, 201);
  assert.equal((await d.delete(url, ann)).status, 204);
  assert.equal((await d.get(url, admin)).status, 200, 'a tenant gives up its own only');
  await d.stop();
  d.args = [];
  await d.start();
  assert.equal((await d.get(url)).status, 200);
  assert.equal((await d.upload(small)).status, 200);
  assert.equal((await d.delete(url)).status, 204, 'without tokens everybody is the operator');
  assert.equal((await d.get(url)).status, 404);
});

test("an operator's job on another's mesh outlives its delete", async (t) => {
  const { d, add, upload } = await tenants(t);
  const [ann, bob, root] = [
    await add('ann', 'read,write'),
    await add('bob', 'read,write'),
    await add('root', 'read,write,admin'),
  ];
  const mesh = (await upload(ann, small, { name: 'secret' })).json;
  await upload(ann, large);
  const blocker = (await d.post('/v1/embeddings', { mesh: (await upload(bob, large)).json.id, ...endless }, bob)).json;
  const job = (await d.post('/v1/embeddings', { mesh: mesh.id, ...endless }, root)).json; // it may run beside the other
  assert.equal((await d.delete(mesh.url, ann)).status, 204);
  const gone = async () => {
    for (let i = 0; i < Number(process.env.ORB_NODES ?? 0); i++) {
      if ((await d.get(mesh.url, ann)).status !== 404) return false;
    }
    return true;
  };
  await until(gone, 'the other nodes know', 5);
  assertProblem(await d.get(mesh.url, ann), 404, 'not-found');
  assertProblem(await d.delete(mesh.url, root), 409, 'in-use');
  assert.equal((await d.delete(blocker.url, bob)).status, 200);
  assert.equal((await d.delete(job.url, root)).status, 200);
  await until(async () => (await d.get(job.url, root)).json.state === 'cancelled', 'the job ends');
  assert.equal((await d.delete(mesh.url, root)).status, 204);
});

test("what waits shows nothing of another's job", async (t) => {
  const { d, add, upload } = await tenants(t);
  const [ann, bob] = [await add('ann', 'read,write'), await add('bob', 'read,write')];
  const slow = (await upload(ann, large)).json;
  await upload(bob, large);
  const hers = (await d.post('/v1/embeddings', { mesh: slow.id, ...endless }, ann)).json;
  await until(async () => (await d.get(hers.url, ann)).json.stage === 'embed', 'hers is being worked on');
  const his = await d.post(
    '/v1/supermeshes',
    { shapes: [{ mesh: slow.id }, { mesh: slow.id }], embedding: endless },
    bob,
  );
  assert.equal(his.status, 202, his.bytes.toString());
  for (const end = Date.now() + 1000; Date.now() < end; await new Promise((done) => setTimeout(done, 20))) {
    const shown = (await d.get(his.json.url, bob)).json;
    assert.equal((await d.get(hers.url, ann)).json.state, 'running');
    assert.equal(shown.state, 'queued', 'while hers is being worked on');
  }
  await d.delete(hers.url, ann);
  await d.delete(his.json.url, bob);
});
