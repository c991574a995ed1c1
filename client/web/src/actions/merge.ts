/**
 * Sends the merge request, follows its job, loads the asset and plays it. A morph is requested twice: with the fast
 * preset, whose result is shown at once, and as the options say, which replaces it.
 */
import {
  CancelledError,
  ProblemError,
  type Job,
  type Landmark,
  type Place,
  type Supermesh,
  type SupermeshRequest,
} from 'orbmorph';
import {
  client,
  givenLandmarks,
  isFast,
  isTemplate,
  landmarksOnAll,
  readyShapes,
  set,
  SHAPES_MOST,
  state,
  surfaceOf,
  takenFrom,
  tint,
  toast,
  type Matches,
  type Result,
  type Running,
} from '../state';
import { landmarkTrouble, type Marks } from '../mesh/trouble';
import { work } from '../mesh/work';
import { counted } from '../words';
import { morphModels } from '../view/models';
import { player } from '../player';
import { listFound, takeLandmarks } from './landmarks';
import { explain } from './token';

/** The last alignment, with the meshes and landmarks that it is of. */
let lastAlignment: { alignment: string; meshes: string; landmarks: string; start?: string } | null = null;

const meshesOf = ({ shapes }: { shapes: { mesh: string }[] }) => shapes.map(({ mesh }) => mesh).join();

const marksOf = (request: SupermeshRequest | null) =>
  Array.isArray(request?.landmarks) ? JSON.stringify(request.landmarks.map(({ at, weight }) => [at, weight])) : '';

function noteAlignment(supermesh: Supermesh, request: SupermeshRequest | null) {
  const { alignment } = supermesh;
  lastAlignment = alignment
    ? { alignment, meshes: meshesOf(supermesh), landmarks: marksOf(request), start: request?.align?.start }
    : null;
}

/**
 * Where the alignment of a request begins: with other landmarks than the last one, where that ended; with the same
 * landmarks, where that began.
 */
function startOf(request: SupermeshRequest) {
  const last = lastAlignment;
  if (!last || last.meshes !== meshesOf(request)) return undefined;
  return last.landmarks === marksOf(request) ? last.start : last.alignment;
}

export function buildRequest(find = false): SupermeshRequest {
  const { options } = state;
  const shapes = readyShapes();
  const landmarks = givenLandmarks(shapes);
  const request: SupermeshRequest = { shapes: shapes.map(({ mesh, name }) => ({ mesh: mesh!.id, name })) };
  if (find) request.landmarks = 'auto';
  else if (landmarks.length) request.landmarks = landmarks;
  const { more } = options;
  if (more.embedding) request.embedding = more.embedding;
  if (!find && more.align) request.align = more.align;
  if (!find && options.align !== 'default') request.align = { ...request.align, method: options.align };
  const start = Array.isArray(request.landmarks) && !['rbf', 'rotate'].includes(options.align) && startOf(request);
  if (start) request.align = { ...request.align, start };
  request.remesh = { method: options.remesh, tolerance: options.tolerance };
  if (options.maxTriangles && options.remesh !== 'template') request.remesh.max_triangles = options.maxTriangles;
  request.asset = { ...more.asset, fit: find ? 'none' : options.fit };
  if (options.path !== 'linear') request.asset.path = options.path;
  if (options.holes !== 'reopen') request.asset.holes = options.holes;
  const surface = surfaceOf(shapes[0]);
  if (surface) request.template = surface;
  const transfer = shapes.flatMap((shape, from) =>
    takenFrom(shape).map((what) => ({
      from,
      what,
      ...(what === 'texture' && options.texels && { resolution: options.texels }),
    })),
  );
  if (!find && transfer.length) request.transfer = transfer;
  return request;
}

/**
 * Up to this many triangles of all shapes, the hull of their vertices is made in a fraction of the time of the adaptive
 * mesh (0.08 instead of 0.35 s at 28,000 triangles). It has as many triangles as the shapes, so beyond 100,000 it takes longer.
 */
const HULL_MOST = 60_000;

/** The same request with the fast preset; null where the method has none, and where a start makes the default fast. */
function fastRequest(request: SupermeshRequest): SupermeshRequest | null {
  const method = request.align?.method;
  if (method === 'rbf' || method === 'rotate' || request.align?.start) return null;
  const { transfer: _, ...bare } = request; // pictures would be baked twice
  const triangles = readyShapes().reduce((sum, { mesh }) => sum + mesh!.triangles, 0);
  const hull = request.remesh?.method === 'adaptive' && !request.remesh.max_triangles && triangles <= HULL_MOST;
  return {
    ...bare,
    align: { ...request.align, options: { ...request.align?.options, preset: 'fast' } },
    ...(hull && { remesh: { method: 'convex-hull' } }),
  };
}

/** Whether there are as many shapes as the daemon morphs at once. */
export const canMerge = () => readyShapes().length >= 2 && readyShapes().length <= SHAPES_MOST;

export async function startMerge(purpose: Running['purpose'] = 'morph') {
  if (state.running || !canMerge()) return;
  const running: Running = { purpose, job: null, abort: new AbortController(), fast: null };
  set({ running, problem: null });
  const request = buildRequest(purpose === 'find');
  const fast = purpose === 'morph' ? fastRequest(request) : null;
  if (fast) await showFast(running, fast);
  const { start, ...align } = request.align ?? {};
  const send = (sent: SupermeshRequest) =>
    client.merge(sent, { signal: running.abort.signal, onJob: progress(running), onProgress: progress(running) });
  // the daemon keeps alignments for a time only
  const sendAnew = (error: unknown) => {
    if (!start || !(error instanceof ProblemError) || error.problem.member !== 'start') throw error;
    request.align = align;
    return send(request);
  };
  await follow(running, () => send(request).catch(sendAnew), request);
}

/** Sends the next match of the shown morph, after the last one the first again. */
export async function nextMatch() {
  const matches = state.result?.matches;
  if (matches) await sendMatch(matches, ((matches.tried ?? matches.at) + 1) % matches.requests.length);
}

/** The match that has left and right swapped, seen from the best one; −1 if there is none. */
export const flippedOf = ({ told }: Matches) => (told?.others.findIndex(({ flips }) => flips) ?? -1) + 1 || -1;

/** Sends the match that has left and right swapped, and from there the best one again. */
export async function flipMatch() {
  const matches = state.result?.matches;
  const flipped = matches ? flippedOf(matches) : -1;
  if (matches && flipped > 0) await sendMatch(matches, matches.at === flipped ? 0 : flipped);
}

async function sendMatch(matches: Matches, at: number) {
  if (state.running) return;
  matches.tried = at; // one that fails is passed over next time
  const next: Matches = { best: matches.best, requests: matches.requests, at, told: matches.told };
  const running: Running = { purpose: 'morph', job: null, abort: new AbortController(), fast: null, matches: next };
  set({ running, problem: null });
  const request = next.requests[next.at];
  await follow(
    running,
    () =>
      client.merge(request, { signal: running.abort.signal, onJob: progress(running), onProgress: progress(running) }),
    request,
    next,
  );
}

/** Whether the shapes of the page are those of a morph, in their order. */
export const isOfPage = ({ shapes }: Supermesh) =>
  readyShapes().length === shapes.length && readyShapes().every((shape, i) => shape.mesh!.id === shapes[i].mesh);

/** The landmarks that a morph found; of another match that was sent, those that led to it. */
function foundIn({ landmarks = [], request }: Supermesh): { name?: string; at: Place[] }[] {
  const found = landmarks.flatMap((l) => ('at' in l ? [{ name: l.name, at: l.at as Place[] }] : []));
  if (found.length || !Array.isArray(request?.landmarks)) return found;
  return request.landmarks.every(({ confidence }) => confidence < 1)
    ? request.landmarks.map(({ at }) => ({ at: at as Place[] }))
    : [];
}

/** Finds out how the other matches differ from the best one. */
async function tellOthers({ matches }: Result) {
  if (!matches || matches.told || !isOfPage(matches.best)) return;
  const { alternatives = [] } = matches.best;
  const found = foundIn(matches.best).map(({ name = '', at }) => ({ name, at }));
  const others = await work(
    'others',
    readyShapes().map(({ key }) => key),
    found,
    alternatives.map(({ shape = 1, request }) => ({
      shape,
      places: (request.landmarks as Landmark[]).map((l) => l.at),
    })),
  );
  matches.told = {
    landmarks: found.map(({ name }) => name),
    others: others.map((other, i) => ({ ...other, cost: alternatives[i].cost, shape: alternatives[i].shape ?? 1 })),
  };
  set();
}

/** The requests of a morph that was matched without landmarks, and of its alternatives. at: which of them is shown. */
export function matchesOf(best: Supermesh, at = 0): Matches | null {
  const others = best.alternatives ?? [];
  return others.length && best.request && at >= 0 && at <= others.length
    ? { best, requests: [best.request, ...others.map(({ request }) => request)], at }
    : null;
}

/**
 * Shows the fast morph when it is done. Resolves once the daemon has computed it: the job of the default one would run
 * beside it, and take half of the processors from it.
 */
function showFast(running: Running, request: SupermeshRequest): Promise<void> {
  const abort = new AbortController();
  const { signal } = abort;
  return new Promise((computed) => {
    const show = async () => {
      try {
        const onProgress = (job: Job) => {
          running.fast!.job = job;
          set();
        };
        const supermesh = await client.merge(request, { signal, onProgress }).finally(() => computed());
        await openResult(supermesh, request, { signal });
        if (signal.aborted) return;
        set({ tab: 'morph', show: 'morph' });
        player.play();
      } catch {
        // the default morph does not need it, and reports what is wrong with the request
      } finally {
        running.fast!.job = null;
        set();
      }
    };
    running.fast = { job: null, abort, ended: Promise.resolve() };
    running.fast.ended = show();
  });
}

/** The server has forgotten a job, or never had it. */
class GoneError extends Error {
  constructor(purpose: Running['purpose']) {
    const button = purpose === 'find' ? 'Find them for me' : 'Morph';
    super(`The server ${location.host} no longer has the job of this link. Press ${button} to start it again.`);
  }
}

/** Follows a job that an earlier visit started. `matches`: those of which it computes one. */
export async function resumeJob(id: string, purpose: Running['purpose'] = 'morph', matches?: Matches) {
  const running: Running = { purpose, job: null, abort: new AbortController(), fast: null, matches };
  set({ running });
  const { signal } = running.abort;
  await follow(
    running,
    async () => {
      try {
        return await client.result<Supermesh>(id, { signal, onProgress: progress(running) });
      } catch (error) {
        if (signal.aborted) await client.cancelJob(id).catch(() => {});
        throw error instanceof ProblemError && error.status === 404 ? new GoneError(purpose) : error;
      }
    },
    null,
    matches,
  );
}

const progress = (running: Running) => (job: Job) => {
  running.job = job;
  set();
};

async function follow(
  running: Running,
  get: () => Promise<Supermesh>,
  request: SupermeshRequest | null,
  matches?: Matches,
) {
  const marks = sentMarks();
  try {
    const supermesh = await get();
    running.fast?.abort.abort();
    if (running.purpose === 'find') await takeFound(supermesh);
    else if (state.result && isFast(state.result)) {
      await openResult(supermesh, request ?? supermesh.request ?? null, { keep: true });
    } else {
      await openResult(supermesh, request ?? supermesh.request ?? null, { matches });
      set({ tab: 'morph', show: 'morph' });
      player.play();
    }
  } catch (error) {
    if (running.abort.signal.aborted || error instanceof CancelledError) toast('Cancelled.');
    else set({ problem: describe(error, marks) });
  } finally {
    await running.fast?.ended;
    if (state.running === running) set({ running: null });
  }
}

/** The landmarks of a request that is sent now, as the page calls them. */
function sentMarks(): Marks {
  const shapes = readyShapes();
  const marks = landmarksOnAll(shapes);
  return {
    names: marks.map((mark) => `${state.landmarks.indexOf(mark) + 1}${mark.name ? ` (${mark.name})` : ''}`),
    shapes: shapes.map(({ name }) => name),
    places: marks.map(({ at }) => shapes.map(({ key }) => at[key].position)),
  };
}

function describe(error: unknown, marks: Marks) {
  if (error instanceof ProblemError && (error.status === 401 || error.status === 403))
    return { title: 'The token does not allow this', detail: explain(error), facts: null };
  if (error instanceof ProblemError) {
    const detail = (error.kind === 'bad-landmarks' && landmarkTrouble(error.problem, marks)) || error.detail;
    return { title: error.title || 'The daemon refused the request', detail, facts: error.problem };
  }
  const title = error instanceof GoneError ? 'The job of this link is gone' : 'The request failed';
  return { title, detail: (error as Error).message, facts: null };
}

const PROPOSALS = 12;

/** Takes the landmarks of the response; if it has none, well-spread places of the correspondence it found. */
async function takeFound(supermesh: Supermesh) {
  const named = (supermesh.landmarks ?? []).filter((l) => 'at' in l);
  const points = named.length
    ? []
    : await work('propose', await client.asset(supermesh.id), supermesh.shapes.length, PROPOSALS);
  const found = named.length
    ? named.map(({ name, at }) => ({ name, at }))
    : points.map((at) => ({ name: '', at: at.map((point) => ({ point })) }));
  noteAlignment(supermesh, null);
  const taken = await takeLandmarks(found, { snap: true });
  set({ tab: 'landmarks' });
  toast(taken ? `${counted(taken, 'landmark')} found. Drag any that are off.` : 'No landmarks found.');
}

export function cancelMerge() {
  state.running?.fast?.abort.abort();
  state.running?.abort.abort();
}

/**
 * Shows a morph. `keep`: in place of the shown one, with its time, mixture and view. `signal`: if aborted meanwhile,
 * nothing changes. `matches`: those among which it is one; by default those that its answer lists. `look`: of its
 * materials, see MorphData. `extras`: the weights of its targets that are not shapes; by default those of the asset.
 */
export async function openResult(
  supermesh: Supermesh,
  request: SupermeshRequest | null,
  {
    keep = false,
    signal,
    matches,
    look = 0,
    extras,
  }: { keep?: boolean; signal?: AbortSignal; matches?: Matches; look?: number; extras?: number[] } = {},
) {
  if (!keep) set({ loading: 'Loading the morph' });
  try {
    const buffer = await client.asset(supermesh.id, { signal });
    const carried = (supermesh.transferred ?? []).filter(({ what }) => what === 'targets').length;
    const data = await work('morph', supermesh.id, buffer, supermesh.shapes.length, look, carried);
    if (signal?.aborted) return;
    const { playing, mix, show, side, result: before } = state;
    const { time } = player;
    keep &&= !!before;
    clearResult();
    if (before && before.supermesh.id !== supermesh.id) void work('close', before.supermesh.id);
    const models = morphModels(data, supermesh.shapes.length + 1, tint(0));
    const result: Result = {
      supermesh,
      request,
      matches: matches ?? matchesOf(supermesh),
      main: models[0],
      each: models.slice(1),
      data: {
        times: data.times,
        weights: data.weights,
        shapes: data.shapes,
        names: data.names,
        vertices: data.vertices,
        triangles: data.triangles,
        looks: data.looks,
        extras: data.extras,
      },
      look: Math.min(look, Math.max(data.looks.length - 1, 0)),
      extras: data.extras.map(({ weight }, i) => extras?.[i] ?? weight),
    };
    result.each.forEach((model, i) => {
      model.weights(result.data.shapes[i] ?? []);
      model.color(tint(i));
    });
    set({ result, mix: null });
    if (!isFast(result)) noteAlignment(supermesh, request);
    player.load(result);
    void tellOthers(result);
    if (!isFast(result) && isOfPage(supermesh) && before?.supermesh.id !== supermesh.id)
      void listFound(foundIn(supermesh), () => state.result === result);
    if (!keep) return;
    set({ show, side });
    player.seek(time);
    if (mix) player.mix(mix);
    else if (playing) player.play();
  } finally {
    if (!keep) set({ loading: null });
  }
}

let looking = new AbortController();

/** Shows the morph with other materials. The last call wins, and none outlives its morph. */
export async function showLook(look: number) {
  const { result } = state;
  looking.abort();
  looking = new AbortController();
  const { signal } = looking;
  if (!result || look === result.look) return;
  try {
    await openResult(result.supermesh, result.request, {
      keep: true,
      signal,
      matches: result.matches ?? undefined,
      look,
      extras: result.extras,
    });
  } catch (error) {
    if (!signal.aborted) toast(explain(error), 'error');
  }
}

export function clearResult() {
  const { result } = state;
  looking.abort();
  if (!result) return;
  player.unload();
  for (const model of [result.main, ...result.each, ...(result.stretch ?? [])]) model.dispose();
  for (const shape of state.shapes) {
    shape.error?.model.dispose();
    shape.error = undefined;
  }
  set({ result: null, mix: null, playing: false, show: 'morph', side: 'before' });
}

const isFitted = (shape: Supermesh['shapes'][number]) => (shape.fit?.kind ?? 'none') !== 'none';

/** Relative errors of this size come from coordinates of 32 bits: they are painted as none. */
const ROUNDING = 1e-5;

/** Measures the supermesh's error on every shape and paints it on the original surface, or on a template. */
export async function measureErrors() {
  const { result } = state;
  if (!result) return;
  const shapes = readyShapes();
  for (const [index, shape] of shapes.entries()) {
    if (shape.error?.result === result.supermesh.id || shape.mesh?.id !== result.supermesh.shapes[index]?.mesh)
      continue;
    set({ loading: `Measuring the error on ${shape.name}` });
    try {
      const found = await work(
        'error',
        shape.key,
        result.supermesh.id,
        index,
        isFitted(result.supermesh.shapes[index]),
      );
      const { max, rms } = found;
      const onTemplate = isTemplate(result) && index > 0;
      const model = (onTemplate ? result.each[index] : shape.model!).copy();
      if (onTemplate) model.weights(result.data.shapes[index] ?? []);
      model.attribute('value', onTemplate ? found.made : found.values);
      const top = Math.max(max, ROUNDING);
      model.paint({ kind: 'value', ramp: 'heat', low: 0, high: top });
      shape.error = { result: result.supermesh.id, model, max, rms, top };
    } catch (error) {
      toast((error as Error).message, 'error');
    }
    set({ loading: null });
  }
}

/** From this energy on a map is bad: reports warn of more than 1 % of the area at such an energy. */
export const STRETCHED = 20;

/** Measures how much the morph stretches its surface, and paints it on each shape. */
export async function measureStretch() {
  const { result } = state;
  if (!result || result.stretch) return;
  const values = await work('stretch', result.supermesh.id);
  if (state.result !== result || result.stretch) return;
  result.stretch = values.map((list, i) => {
    const model = result.each[i].copy();
    model.weights(result.data.shapes[i] ?? []);
    model.attribute('value', list);
    model.paint({ kind: 'value', ramp: 'heat', low: 1, high: STRETCHED, log: true });
    return model;
  });
  set();
}
