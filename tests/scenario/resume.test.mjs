// A client that follows a job receives its end, whichever event number it resumes with.
import assert from 'node:assert/strict';
import test from 'node:test';
import { daemon, endless, until } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const events = (d, job, seen) =>
  d.get(`${job.url}/events`, { headers: seen === undefined ? {} : { 'last-event-id': String(seen) } });
const names = (reply) => [...reply.bytes.toString().matchAll(/^event: (\w+)$/gm)].map((m) => m[1]);
const ids = (reply) => [...reply.bytes.toString().matchAll(/^id: (\d+)$/gm)].map((m) => Number(m[1]));

test('resuming after an unknown event sends all events, after the last one none; also after a restart', async (t) => {
  const d = await daemon(t);
  const { id } = (await d.upload(shapes.obj(shapes.egg(3)))).json;
  const job = await d.ended((await d.post('/v1/embeddings', { mesh: id })).json);
  for (const when of ['while it is remembered', 'after a restart']) {
    const all = await events(d, job);
    assert.equal(all.status, 200);
    const last = ids(all).at(-1);
    assert.equal((await events(d, job, last)).status, 204, `${when}: all was seen, nothing is to come`);
    for (const seen of [last + 1, 99_999_999_999, '9'.repeat(40), 'abc', -1, '']) {
      const reply = await events(d, job, seen);
      assert.equal(reply.status, 200, `${when}: ${seen}`);
      assert.deepEqual(ids(reply), ids(all), `${when}: ${seen}`);
      assert.equal(names(reply).at(-1), 'succeeded', `${when}: ${seen}`);
    }
    assert.deepEqual(names(await events(d, job, last - 1)), ['succeeded'], when);
    if (when === 'after a restart') break;
    await d.stop();
    await d.start();
  }
});

test('a client that saw events that a stop lost still receives the end', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1', '--drain-seconds', '0'] });
  const { id } = (await d.upload(shapes.binaryPly(shapes.ball(4)))).json;
  const job = (await d.post('/v1/embeddings', { mesh: id, ...endless })).json;
  await until(async () => (await d.get(job.url)).json.state === 'running', 'it runs');
  await d.stop();
  await d.start();
  await until(async () => (await d.get(job.url)).json.state === 'running', 'it runs again');
  const followed = events(d, job, 1_900_000); // as if the interrupted attempt had sent many events
  await until(async () => (await d.get('/readyz?verbose')).json.waiting_connections === 1, 'it is followed');
  assert.equal((await d.delete(job.url)).status, 200);
  assert.equal(names(await followed).at(-1), 'cancelled');
});
