/** The daemon's resources as methods. Every method that can take long accepts `signal` and `onProgress`. */
import { CancelledError, ProblemError, UnreachableError, abortError, isAbort, unreachable } from './errors.js';
import { readEvents } from './events.js';
import { openSource, parse, sendBody } from './upload.js';

const ENDED = new Set(['succeeded', 'failed', 'cancelled']);
const LONGEST_WAIT_S = 60;
const ANSWER_MS = 2000; // an aborted request waits this long for the answer that names its job
const sleep = (ms, signal) =>
  new Promise((resolve, reject) => {
    if (signal?.aborted) return reject(abortError(signal));
    const stop = () => {
      clearTimeout(timer);
      reject(abortError(signal));
    };
    const timer = setTimeout(() => {
      signal?.removeEventListener('abort', stop);
      resolve();
    }, ms);
    signal?.addEventListener('abort', stop, { once: true });
  });

function defaultServer() {
  if (typeof location !== 'undefined' && /^https?:$/.test(location.protocol)) return '';
  const fromEnvironment = typeof process !== 'undefined' ? process.env?.ORBMORPH_SERVER : undefined;
  return fromEnvironment || 'http://127.0.0.1:8080';
}

export class Orbmorph {
  constructor({ server, token, fetch, retries = 4 } = {}) {
    this.server = String(server ?? defaultServer()).replace(/\/+$/, '');
    this.token = token ?? (typeof process !== 'undefined' ? process.env?.ORBMORPH_TOKEN : undefined);
    this.fetch = fetch ?? ((...args) => globalThis.fetch(...args));
    this.retries = retries;
  }

  /** The full URL of a path of the daemon, for example of `supermesh.asset`. */
  url(path) {
    return /^https?:/.test(path) ? path : this.server + path;
  }

  headers(more) {
    return { ...(this.token ? { Authorization: `Bearer ${this.token}` } : {}), ...more };
  }

  /**
   * Repeats what the daemon is too busy for (429 and 503), at most `retries` times, after as many seconds as it says. Equal
   * requests have one effect, so POST is repeated too. A used-up quota and a wait of more than a minute are not waited for.
   */
  async patient(send, signal) {
    for (let turn = 0; ; turn++) {
      try {
        return await send();
      } catch (error) {
        const busy =
          error instanceof ProblemError && [429, 503].includes(error.status) && error.kind !== 'quota-exceeded';
        const seconds = Math.max(error.retryAfter ?? 0, 0.25 * 2 ** turn);
        if (!busy || turn >= this.retries || seconds > LONGEST_WAIT_S) throw error;
        await sleep(1000 * seconds, signal);
      }
    }
  }

  /** Sends a request. Throws ProblemError if the daemon refuses it. -> Response */
  request(path, options = {}) {
    return this.patient(() => this.send(path, options), options.signal);
  }

  async send(path, { method = 'GET', json, headers, signal }) {
    const init = { method, signal, headers: this.headers(headers) };
    if (json !== undefined) {
      init.body = JSON.stringify(json);
      init.headers['Content-Type'] = 'application/json';
    }
    let response;
    try {
      response = await this.fetch(this.url(path), init);
    } catch (error) {
      if (signal?.aborted) throw abortError(signal);
      throw await unreachable(this.url(path), error, this.fetch);
    }
    if (!response.ok) {
      const problem = parse(await response.text().catch(() => ''));
      const { status, statusText: title, headers: sent } = response;
      throw new ProblemError(problem ?? { title, status }, status, sent);
    }
    return response;
  }

  async json(path, options) {
    const response = await this.request(path, options);
    return response.status === 204 ? null : parse(await response.text());
  }

  // ---- meshes

  /** Uploads a mesh. `source`: a File, Blob, ArrayBuffer, typed array or, in Node, a path. -> the mesh */
  async uploadMesh(source, { name, format, repair, handleSize, part, onProgress, signal } = {}) {
    const file = await openSource(source, name);
    const query = new URLSearchParams({ name: file.name });
    if (format) query.set('format', format);
    if (repair) query.set('repair', Array.isArray(repair) ? repair.join(',') : repair);
    if (handleSize !== undefined) query.set('handle_size', handleSize);
    if (part !== undefined) query.set('part', part);
    const send = () =>
      sendBody(this.url(`/v1/meshes?${query}`), file.body, file.size, {
        headers: this.headers({ 'Content-Type': 'application/octet-stream' }),
        onProgress,
        signal,
        fetch: this.fetch,
      });
    return (await this.patient(send, signal)).json;
  }

  getMesh(id, options) {
    return this.json(`/v1/meshes/${id}`, options);
  }

  /** The uploaded file. -> ArrayBuffer */
  async meshFile(id, options) {
    return (await this.request(`/v1/meshes/${id}/file`, options)).arrayBuffer();
  }

  deleteMesh(id, options) {
    return this.json(`/v1/meshes/${id}`, { ...options, method: 'DELETE' });
  }

  // ---- embeddings

  getEmbedding(id, options) {
    return this.json(`/v1/embeddings/${id}`, options);
  }

  /** Embeds a mesh and waits for the job. -> the embedding */
  embed(mesh, { method, options, ...watch } = {}) {
    return this.make('/v1/embeddings', clean({ mesh, method, options }), watch);
  }

  /** The binary PLY of the embedding. -> ArrayBuffer */
  async sphere(id, options) {
    return (await this.request(`/v1/embeddings/${id}/sphere.ply`, options)).arrayBuffer();
  }

  deleteEmbedding(id, options) {
    return this.json(`/v1/embeddings/${id}`, { ...options, method: 'DELETE' });
  }

  // ---- landmarks

  /** Stores landmarks. `landmarks`: an array, or an object with that member. -> {id, url, count, shapes, …} */
  createLandmarks(landmarks, options) {
    return this.json('/v1/landmarks', { ...options, method: 'POST', json: landmarks });
  }

  getLandmarks(id, options) {
    return this.json(`/v1/landmarks/${id}`, options);
  }

  deleteLandmarks(id, options) {
    return this.json(`/v1/landmarks/${id}`, { ...options, method: 'DELETE' });
  }

  // ---- supermeshes

  getSupermesh(id, options) {
    return this.json(`/v1/supermeshes/${id}`, options);
  }

  /** Merges uploaded meshes and waits for the job. `request`: the body of POST /v1/supermeshes. -> the supermesh */
  merge(request, watch = {}) {
    return this.make('/v1/supermeshes', request, watch);
  }

  /** The GLB, in the profile `profile`: 'float' (the default), 'quantized' or 'meshopt'. -> ArrayBuffer */
  async asset(id, { profile, ...options } = {}) {
    const query = profile ? `?profile=${encodeURIComponent(profile)}` : '';
    return (await this.request(`/v1/supermeshes/${id}/asset.glb${query}`, options)).arrayBuffer();
  }

  /** The binary PLY of the aligned embedding of shape `k`. -> ArrayBuffer */
  async alignedSphere(id, k, options) {
    return (await this.request(`/v1/supermeshes/${id}/spheres/${k}.ply`, options)).arrayBuffer();
  }

  /** The place of every vertex in the uploaded files, in the format of docs/places.md. -> ArrayBuffer */
  async places(id, options) {
    return (await this.request(`/v1/supermeshes/${id}/places`, options)).arrayBuffer();
  }

  deleteSupermesh(id, options) {
    return this.json(`/v1/supermeshes/${id}`, { ...options, method: 'DELETE' });
  }

  // ---- jobs

  /** `wait`: the daemon responds when the job ends, or after this many seconds. */
  getJob(id, { wait, ...options } = {}) {
    return this.json(`${jobPath(id)}${wait ? `?wait=${wait}` : ''}`, options);
  }

  cancelJob(id, options) {
    return this.json(jobPath(id), { ...options, method: 'DELETE' });
  }

  /**
   * Follows a job until it ends, by events, or by long polling if events do not arrive. Calls `onProgress(job)`. Aborting
   * `signal` stops following the job; the job keeps running. -> the ended job
   */
  async watchJob(job, { onProgress, signal } = {}) {
    const path = jobPath(job);
    let current = typeof job === 'object' ? { ...job } : { id: job };
    const update = (news) => {
      current = { ...current, ...news };
      onProgress?.(current);
    };
    let lastId;
    let pause = 250;
    for (let events = true; ; ) {
      try {
        if (events) {
          const headers = { Accept: 'text/event-stream', ...(lastId ? { 'Last-Event-ID': lastId } : {}) };
          const response = await this.request(`${path}/events`, { headers, signal });
          if (!response.body || !/event-stream/.test(response.headers.get('content-type') ?? '')) {
            events = false;
            continue;
          }
          for await (const event of readEvents(response.body)) {
            lastId = event.id ?? lastId;
            pause = 250;
            const news = parse(event.data);
            if (ENDED.has(event.event)) {
              update(await this.getJob(path, { signal }));
              return current;
            }
            if (news && typeof news === 'object') update(news);
          }
        }
        update(await this.getJob(path, { wait: events ? undefined : 20, signal }));
        if (ENDED.has(current.state)) return current;
      } catch (error) {
        if (signal?.aborted) throw abortError(signal);
        const passing =
          error instanceof UnreachableError ||
          error instanceof TypeError ||
          [429, 502, 503, 504].includes(error.status);
        if (!passing) {
          if (!events || !(error instanceof ProblemError) || error.status === 404) throw error;
          events = false;
        }
        if (passing && pause > 8000) throw error;
      }
      await sleep(pause, signal);
      pause *= 2;
    }
  }

  /** Follows a job and fetches its result. Throws ProblemError if the job failed. */
  async result(job, watch = {}) {
    const ended = ENDED.has(job?.state) ? job : await this.watchJob(job, watch);
    if (ended.state === 'cancelled') throw new CancelledError(ended);
    if (ended.state === 'failed') throw new ProblemError(ended.problem ?? { title: 'The job failed.' }, 422);
    return this.json(ended.result, { signal: watch.signal });
  }

  /**
   * Posts a request. An abort does not interrupt it at once: the daemon may have its job already, and only the answer
   * names the job to cancel. -> Response
   */
  async post(path, body, signal) {
    if (signal?.aborted) throw abortError(signal);
    const late = new AbortController();
    let timer;
    const abort = () => {
      timer = setTimeout(() => late.abort(abortError(signal)), ANSWER_MS);
    };
    signal?.addEventListener('abort', abort, { once: true });
    try {
      return await this.patient(() => this.send(path, { method: 'POST', json: body, signal: late.signal }), signal);
    } finally {
      clearTimeout(timer);
      signal?.removeEventListener('abort', abort);
    }
  }

  /**
   * Posts a request and waits for its job, if there is one. Calls `onJob(job)` once. Aborting `signal` also cancels the
   * job, unless `detach` is set.
   */
  async make(path, body, { onJob, onProgress, signal, detach } = {}) {
    const response = await this.post(path, body, signal);
    const answer = parse(await response.text());
    if (response.status !== 202) {
      if (signal?.aborted) throw abortError(signal);
      return answer;
    }
    onJob?.(answer);
    onProgress?.(answer);
    try {
      if (signal?.aborted) throw abortError(signal);
      return await this.result(answer, { onProgress, signal });
    } catch (error) {
      if (isAbort(error) && !detach) await this.cancelJob(answer).catch(() => {});
      throw error;
    }
  }

  // ---- lists

  /**
   * Fetches a page of a list. `kind`: meshes, embeddings, landmarks, supermeshes or jobs. `idPrefix` limits it to ids that
   * begin with it, `state` to jobs in a state, `mesh` and `name` to supermeshes with a shape of this mesh or name. The `view`
   * "summary" lists supermeshes without report and request. -> {items, next}
   */
  async page(kind, { limit, pageToken, idPrefix, state, mesh, name, view, signal } = {}) {
    const given = clean({ limit, page_token: pageToken, id_prefix: idPrefix, state, mesh, name, view });
    const text = new URLSearchParams(Object.entries(given).filter(([, value]) => value)).toString();
    const body = await this.json(`/v1/${kind}${text ? `?${text}` : ''}`, { signal });
    return {
      items: body[kind] ?? body.items ?? Object.values(body).find(Array.isArray) ?? [],
      next: body.next_page_token ?? null,
    };
  }

  /** Yields all items of a kind and fetches pages as needed: `for await (const mesh of client.list('meshes'))`. */
  async *list(kind, options = {}) {
    let pageToken;
    do {
      const page = await this.page(kind, { ...options, pageToken });
      yield* page.items;
      pageToken = page.next;
    } while (pageToken);
  }

  // ---- morphs

  /**
   * The URL of a morph: its GET computes the morph if nobody has. `recipe`: `shapes` (ids of meshes), and optionally
   * `names`, `landmarks` (an id, or "auto"), `align`, `preset`, `remesh`, `tolerance`, `max_triangles`, `fit`, `path`,
   * `animation`, `normals`, `holes`, `transfer` (a list of entries such as '1:skin'), `profile` and
   * `wait`.
   */
  morphUrl(recipe) {
    const query = Object.entries(clean(recipe)).map(
      ([name, value]) => `${name}=${[].concat(value).map(encodeURIComponent).join(',')}`,
    );
    return this.url(`/v1/morph.glb?${query.join('&')}`);
  }

  /**
   * Uploads files, merges them and waits for the job. Options: the members of POST /v1/supermeshes (`landmarks`,
   * `align`, `remesh`, `asset`), `repair`, `names`, `onProgress({step, file, job, progress})` and `signal`.
   * -> the supermesh with `meshes`, `assetUrl` and `glb()`, which takes `profile` like `asset()`
   */
  async morph(sources, { landmarks, align, remesh, asset, repair, names, onProgress, signal } = {}) {
    const meshes = [];
    for (const [index, source] of sources.entries()) {
      if (isMesh(source)) {
        meshes.push(source);
        continue;
      }
      const onUpload =
        onProgress &&
        ((sent, total) => onProgress({ step: 'upload', file: index, progress: total ? sent / total : 1 }));
      meshes.push(await this.uploadMesh(source, { name: names?.[index], repair, onProgress: onUpload, signal }));
    }
    const shapes = meshes.map((mesh) => clean({ mesh: mesh.id, name: mesh.name }));
    const given = Array.isArray(landmarks) || typeof landmarks === 'string' ? landmarks : landmarks?.landmarks;
    const supermesh = await this.merge(clean({ shapes, landmarks: given, align, remesh, asset }), {
      onProgress: onProgress && ((job) => onProgress({ step: 'merge', job, progress: job.progress ?? 0 })),
      signal,
    });
    return {
      ...supermesh,
      meshes,
      assetUrl: this.url(supermesh.asset),
      glb: (options) => this.asset(supermesh.id, options),
    };
  }
}

/** A mesh of the daemon rather than a file. */
const isMesh = (value) => typeof value?.id === 'string' && /^[0-9a-f]{64}$/.test(value.id);

/** "/v1/jobs/ID" for a job object, its path or its id. */
const jobPath = (job) => {
  const text = typeof job === 'object' ? (job.url ?? job.id) : job;
  return text.startsWith('/') ? text : `/v1/jobs/${text}`;
};

const clean = (object) => Object.fromEntries(Object.entries(object).filter(([, value]) => value !== undefined));
