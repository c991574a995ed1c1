/**
 * A fake daemon for the client's tests. It serves the paths that the client uses, and it can break an event stream, refuse
 * events or stop a job from ending, which a real daemon does not do on request.
 */
import { createServer } from 'node:http';
import { createHash } from 'node:crypto';

export async function startDaemon({ jobSteps = 3, breakStream = false, noEvents = false, token } = {}) {
  const seen = { uploads: [], requests: [], lastEventIds: [] };
  const meshes = new Map();
  const jobs = new Map();
  let broken = false;

  const send = (res, status, body, headers = {}) => {
    res.writeHead(status, {
      'Content-Type': status >= 400 ? 'application/problem+json' : 'application/json',
      ...headers,
    });
    res.end(body === undefined ? '' : JSON.stringify(body));
  };
  const problem = (res, status, name, more = {}) =>
    send(res, status, { type: `/problems/${name}`, title: name, status, detail: `It is ${name}.`, ...more });
  const view = (job) => ({
    id: job.id,
    url: `/v1/jobs/${job.id}`,
    kind: 'supermesh',
    state: job.state,
    stage: job.stage,
    progress: job.step / jobSteps,
    seconds_left: null,
    result: job.state === 'succeeded' ? `/v1/supermeshes/${job.id}` : null,
    problem: job.problem ?? null,
    attempt: 1,
    created: '2026-01-01T00:00:00Z',
  });
  const advance = (job) => {
    if (job.state === 'cancelled' || job.state === 'failed') return;
    job.step++;
    job.state = 'running';
    job.stage = 'align';
    if (job.step >= jobSteps) {
      job.state = job.body.fail ? 'failed' : 'succeeded';
      if (job.body.fail)
        job.problem = { type: '/problems/bad-landmarks', title: 'Bad', status: 422, detail: 'Two are the same.' };
    }
  };

  const server = createServer(async (req, res) => {
    const url = new URL(req.url, 'http://x');
    const parts = url.pathname.split('/').filter(Boolean);
    const chunks = [];
    for await (const chunk of req) chunks.push(chunk);
    const body = Buffer.concat(chunks);
    seen.requests.push({ method: req.method, path: url.pathname, query: url.search, body: body.toString('latin1') });
    if (token && req.headers.authorization !== `Bearer ${token}`) return problem(res, 401, 'unauthorized');

    if (url.pathname === '/v1/meshes' && req.method === 'POST') {
      seen.uploads.push({
        name: url.searchParams.get('name'),
        repair: url.searchParams.get('repair'),
        bytes: body.length,
      });
      if (body.toString().includes('open'))
        return problem(res, 422, 'not-closed', { boundary_loops: 1, boundary_edges: [[0, 1]] });
      const id = createHash('sha256').update(body).digest('hex');
      const known = meshes.has(id);
      meshes.set(id, { id, url: `/v1/meshes/${id}`, name: url.searchParams.get('name') });
      return send(res, known ? 200 : 201, meshes.get(id));
    }
    if (url.pathname === '/v1/meshes') {
      const all = [...meshes.values()];
      const at = Number(url.searchParams.get('page_token') ?? 0);
      return send(res, 200, {
        meshes: all.slice(at, at + 1),
        next_page_token: at + 1 < all.length ? String(at + 1) : null,
      });
    }
    if (url.pathname === '/v1/supermeshes' && req.method === 'POST') {
      const request = JSON.parse(body);
      const id = String(jobs.size + 1);
      const job = { id, step: 0, state: 'queued', body: request };
      jobs.set(id, job);
      return send(res, 202, view(job), { Location: `/v1/jobs/${id}`, 'Retry-After': '1' });
    }
    if (parts[1] === 'supermeshes' && parts[3] === 'asset.glb') {
      res.writeHead(200, { 'Content-Type': 'model/gltf-binary' });
      return res.end(`glTF${url.search}`);
    }
    if (parts[1] === 'supermeshes')
      return send(res, 200, {
        id: parts[2],
        url: url.pathname,
        asset: `${url.pathname}/asset.glb`,
        request: jobs.get(parts[2]).body,
      });
    if (parts[1] === 'jobs' && jobs.has(parts[2])) {
      const job = jobs.get(parts[2]);
      if (req.method === 'DELETE') {
        job.state = 'cancelled';
        return send(res, 200, view(job));
      }
      if (parts[3] !== 'events') {
        if (url.searchParams.has('wait')) advance(job);
        return send(res, 200, view(job));
      }
      if (noEvents) return problem(res, 406, 'no-events');
      seen.lastEventIds.push(req.headers['last-event-id']);
      res.writeHead(200, { 'Content-Type': 'text/event-stream' });
      for (;;) {
        if (job.state !== 'cancelled') advance(job);
        const name = job.state === 'running' ? 'progress' : job.state;
        res.write(`: a comment\nid: ${job.step}\nevent: ${name}\r\ndata: ${JSON.stringify(view(job))}\n\n`);
        if (name !== 'progress') return res.end();
        if (breakStream && !broken) {
          broken = true;
          return setTimeout(() => res.destroy(), 20);
        }
        await new Promise((resolve) => setTimeout(resolve, 30));
        if (res.destroyed) return;
      }
    }
    problem(res, 404, 'not-found');
  });
  await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
  return {
    url: `http://127.0.0.1:${server.address().port}`,
    seen,
    jobs,
    stop: () => {
      server.closeAllConnections();
      return new Promise((resolve) => server.close(resolve));
    },
  };
}
