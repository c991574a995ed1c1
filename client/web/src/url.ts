/**
 * Keeps the state of the page in the fragment of its URL, so that a link or a reload restores it:
 *   #m=ID,ID&tab=morph&r=ID&j=ID&t=0.40&l=12:99~nose;33:45&cam=…&o=adaptive,0.001,,linear,similarity,default&more=…
 * m: meshes on the server, r: a supermesh, j: a job, find=1: one that finds landmarks, go=1: one that makes the morph, where
 * it has no id yet, q: the best match, which of its matches r is, and which of them j computes, t: time along the morph, l:
 * landmarks (a vertex or x_y_z for each shape; after * the weight of a soft one, and pass, radius and confidence), cam: camera, o: options, more: what else the request of an opened morph says, x: what the morph takes from the shapes (1:skin), s: the parts of
 * the first document that the surface consists of, look: of its materials, e: the weights of its
 * targets that are not shapes.
 */
import type { Place } from 'orbmorph';
import {
  client,
  DEFAULTS,
  patch,
  readyShapes,
  set,
  state,
  TABS,
  surfaceOf,
  takenFrom,
  watch,
  type Landmark,
  type Matches,
  type Options,
  type Tab,
} from './state';
import { EXTRAS } from './mesh/extras';
import { addFromServer } from './actions/shapes';
import { takeLandmarks } from './actions/landmarks';
import { isOfPage, matchesOf, openResult, resumeJob, startMerge } from './actions/merge';
import { setPaint } from './actions/spheres';
import { takeNames } from './actions/request';
import { openSupermesh } from './actions/server';
import { player } from './player';
import { stage } from './view/shared';
import { PAINTS } from './state';

let restoring = false;
let written = '';

const round = (x: number) => String(Number(x.toPrecision(7)));

/** The numbers of a landmark besides its places; nothing where all are as the daemon assumes them. */
function encodeNumbers({ weight = 1, also: { pass = 0, radius = 0, confidence = 1 } = {} }: Landmark): string {
  if (pass || radius || confidence < 1) return `*${[weight, pass, radius, confidence].join('_')}`;
  return weight < 1 ? `*${weight}` : '';
}

function decodeNumbers(text: string) {
  const [weight = 1, pass = 0, radius = 0, confidence = 1] = text.split('_').filter(Boolean).map(Number);
  return { weight, pass, radius, confidence };
}

function encodePlace(place: Place | undefined): string {
  if (!place) return '';
  if ('vertex' in place) return String(place.vertex);
  if ('point' in place) return place.point.map(round).join('_');
  return `t${place.triangle}_${place.barycentric.map(round).join('_')}`;
}

function decodePlace(text: string): Place | undefined {
  if (!text) return undefined;
  const values = text.replace(/^t/, '').split('_').map(Number);
  if (!values.every(Number.isFinite)) return undefined;
  if (text.startsWith('t') && values.length === 4)
    return { triangle: values[0], barycentric: [values[1], values[2], values[3]] };
  if (values.length === 3) return { point: [values[0], values[1], values[2]] };
  return values.length === 1 ? { vertex: values[0] } : undefined;
}

function encodeOptions(o: Options): string {
  return [o.remesh, o.tolerance, o.maxTriangles ?? '', o.path, o.fit, o.align, o.holes, o.texels ?? ''].join(',');
}

function decodeOptions(text: string): Options {
  const [remesh, tolerance, most, path, fit, align, holes, texels] = text.split(',');
  const from = <T extends string>(value: string, allowed: readonly T[], otherwise: T): T =>
    (allowed as readonly string[]).includes(value) ? (value as T) : otherwise;
  return {
    ...DEFAULTS,
    remesh: from(remesh, ['adaptive', 'overlay', 'subdivision', 'convex-hull', 'template'], DEFAULTS.remesh),
    tolerance: Number(tolerance) > 0 ? Number(tolerance) : DEFAULTS.tolerance,
    maxTriangles: Number(most) >= 4 ? Number(most) : null,
    path: from(path, ['linear', 'rigid'], DEFAULTS.path),
    fit: from(fit, ['auto', 'none', 'rigid', 'similarity'], DEFAULTS.fit),
    holes: from(holes, ['reopen', 'filled'], DEFAULTS.holes),
    texels: Number(texels) >= 16 ? Number(texels) : null,
    align: from(align, ['default', 'pin', 'rbf', 'rotate', 'auto'], DEFAULTS.align),
  };
}

function decodeMore(text: string | null): Options['more'] | null {
  try {
    const { embedding, align, asset } = JSON.parse(text ?? '');
    return { ...(embedding && { embedding }), ...(align && { align }), ...(asset && { asset }) };
  } catch {
    return null; // there is none, or the link is damaged
  }
}

const encodeTaken = () =>
  readyShapes()
    .flatMap((shape, i) => takenFrom(shape).map((what) => `${i}:${what}`))
    .join(',');

function restoreTaken(text: string) {
  for (const [number, name] of text.split(',').map((entry) => entry.split(':'))) {
    const shape = readyShapes()[Number(number)];
    const what = EXTRAS.find((known) => known === name);
    if (shape && what) patch(shape, { taken: [...(shape.taken ?? []), what] });
  }
}

const encodeSurface = () => {
  const surface = surfaceOf(readyShapes()[0]);
  return surface ? encodeURIComponent(JSON.stringify(surface)) : '';
};

function restoreSurface(text: string) {
  const [first] = readyShapes();
  const { content } = first ?? {};
  if (!text || !content) return;
  try {
    const { meshes = [], nodes = [] } = JSON.parse(text) as { meshes?: unknown[]; nodes?: unknown[] };
    patch(first, {
      surface: {
        meshes: content.meshes.map(({ number }) => number).filter((number) => meshes.includes(number)),
        nodes: content.nodes.filter((name) => nodes.includes(name)),
      },
    });
  } catch {
    // the link is damaged: nothing is named
  }
}

/** Of several matches: ID of the best one, number of the shown one, number of the one that is computed. */
function encodeMatch(): string {
  const { result, running } = state;
  const shown = result?.matches;
  const next = running?.job ? running.matches : undefined;
  const best = next?.best ?? shown?.best;
  if (!best || (!next && !shown?.at)) return '';
  return [best.id, shown?.at ?? 0, ...(next ? [next.at] : [])].join(',');
}

/** The weights of the targets that are not shapes, unless they are those of the asset. */
function encodeExtras(): string {
  const { data, extras = [] } = state.result ?? {};
  return data?.extras.some(({ weight }, i) => weight !== extras[i]) ? extras.map(round).join(',') : '';
}

/** The best match that a URL names, and the numbers of those that are shown and computed. */
async function decodeMatch(text: string): Promise<{ shown?: Matches; next?: Matches }> {
  const [id, ...numbers] = text.split(',');
  if (!isId(id)) return {};
  const best = await client.getSupermesh(id).catch(() => null);
  const [shown, next] = numbers.map((at) => (best && matchesOf(best, Number(at))) || undefined);
  return { shown, next };
}

function encode(): string {
  const parts: string[] = [];
  const put = (key: string, value: string) => value && parts.push(`${key}=${value}`);
  const shapes = readyShapes();
  put('m', shapes.map((shape) => shape.mesh!.id).join(','));
  if (state.tab !== 'shapes') put('tab', state.tab);
  put('r', state.result?.supermesh.id ?? '');
  put('j', state.running?.job?.id ?? '');
  if (state.running?.purpose === 'find') put('find', '1');
  else if (state.running && !state.running.job && !state.running.matches) put('go', '1');
  put('q', encodeMatch());
  if (state.result && !state.playing) put('t', player.time.toFixed(3));
  put(
    'l',
    (state.landmarks === state.listed ? [] : state.landmarks)
      .map(
        (l) =>
          `${shapes.map((s) => encodePlace(l.at[s.key]?.place)).join(':')}${encodeNumbers(l)}${l.name ? `~${encodeURIComponent(l.name)}` : ''}`,
      )
      .join(';'),
  );
  if (encodeOptions(state.options) !== encodeOptions(DEFAULTS)) put('o', encodeOptions(state.options));
  if (Object.keys(state.options.more).length) put('more', encodeURIComponent(JSON.stringify(state.options.more)));
  put('x', encodeTaken());
  put('s', encodeSurface());
  if (state.result?.look) put('look', String(state.result.look));
  put('e', encodeExtras());
  if (state.paint !== 'direction') put('paint', state.paint);
  if (state.side !== 'before') put('side', state.side);
  if (state.show !== 'morph') put('show', state.show);
  if (state.wire) put('wire', '1');
  put('cam', stage.orbit.toString());
  return parts.join('&');
}

const report = (title: string, detail: string) => set({ problem: { title, detail, facts: null } });

/** Says that nothing of a link is left. what: "its morph is" */
const dead = (what: string) =>
  report(
    'This link is dead',
    `${what[0].toUpperCase()}${what.slice(1)} not on the server ${location.host}: deleted, or the link is from another server. Drop the files here to make the morph again.`,
  );

const isId = (text: string) => /^[0-9a-f]{64}$/.test(text);

/** A new URL costs the browser some 30 ms: it draws its address and loads the icon. So the URL is written at rest. */
const REST = 600; // ms: longer than a frame of a large shape
const LONGEST = 2400; // ms, after which it is written anyway
let timer = 0;
let since = 0;
function save() {
  const now = performance.now();
  if (restoring || (timer && now - since > LONGEST - REST)) return;
  if (!timer) since = now;
  clearTimeout(timer);
  timer = window.setTimeout(() => {
    timer = 0;
    if (!restoring) write(hash());
  }, REST);
}

/** The part of the URL that says what the page shows. */
function hash(): string {
  const text = encode();
  const bare = text.replace(/&?cam=[^&]*/, '');
  return bare || state.shapes.length ? `#${text}` : '';
}

function write(next: string) {
  if (next === written) return;
  written = next;
  history.replaceState(null, '', next || location.pathname + location.search);
}

/** Holds what the page shows if it goes away before that is in its URL: a page that reloads has the old URL. */
const LATE = 'orbmorph.late';

function keepLate() {
  const late = timer && !restoring && location.hash === written; // else another URL has been pasted
  try {
    if (late) sessionStorage.setItem(LATE, JSON.stringify({ from: written, to: hash() }));
    else sessionStorage.removeItem(LATE);
  } catch {
    // without storage, the last second is lost
  }
}

/** After a reload, and on the way back: brings the URL up to date. */
function takeLate() {
  try {
    const late = sessionStorage.getItem(LATE);
    sessionStorage.removeItem(LATE);
    const [navigation] = performance.getEntriesByType('navigation') as PerformanceNavigationTiming[];
    if (!late || navigation?.type === 'navigate') return;
    const { from, to } = JSON.parse(late);
    if (from === written) write(to);
  } catch {
    // there is no storage
  }
}

export async function restore() {
  written = location.hash;
  takeLate();
  const query = new URLSearchParams(location.hash.slice(1).replace(/\+/g, '%2B'));
  restoring = true;
  let next: Matches | undefined;
  try {
    const camera = query.get('cam');
    if (camera) stage.orbit.restore(camera);
    const options = query.get('o');
    if (options) set({ options: decodeOptions(options) });
    const more = decodeMore(query.get('more'));
    if (more) set({ options: { ...state.options, more } });
    const named = (query.get('m') ?? '').split(',').filter(Boolean);
    const ids = named.filter(isId);
    const result = query.get('r');
    if (ids.length < named.length || (result !== null && !isId(result)))
      report(
        'This link is damaged',
        'A part of it is missing, as when a line breaks in it. Copy the whole link again.',
      );
    const tab = query.get('tab') as Tab;
    let lost = 0;
    if (ids.length) {
      set({ loading: 'Loading the shapes' });
      const meshes = await Promise.allSettled(ids.map((id) => client.getMesh(id)));
      await Promise.all(meshes.flatMap((m) => (m.status === 'fulfilled' ? [addFromServer(m.value)] : [])));
      set({ loading: null });
      lost = meshes.filter((m) => m.status === 'rejected').length;
      if (!lost) {
        restoreTaken(query.get('x') ?? '');
        restoreSurface(query.get('s') ?? '');
      }
      if (lost === ids.length) dead(`its ${lost > 1 ? `${lost} shapes are` : 'shape is'}`);
      else if (lost)
        report(
          'Some shapes are missing',
          `${lost} of the ${ids.length} shapes of this link ${lost > 1 ? 'are' : 'is'} no longer on the server. Add the files again.`,
        );
    }
    const landmarks = (query.get('l') ?? '')
      .split(';')
      .filter(Boolean)
      .map((text) => {
        const [where, name = ''] = text.split('~');
        const [places, numbers = ''] = where.split('*');
        return { name, at: places.split(':').map(decodePlace) as Place[], ...decodeNumbers(numbers) };
      });
    if (landmarks.length) await takeLandmarks(landmarks, { undoable: false });
    const paint = PAINTS.find((name) => name === query.get('paint'));
    if (paint) setPaint(paint);
    if (query.get('wire')) set({ wire: true });
    if (result && isId(result) && ids.length) {
      const [supermesh, matches] = await Promise.all([
        client.getSupermesh(result).catch(() => null),
        decodeMatch(query.get('q') ?? ''),
      ]);
      next = matches.next;
      const look = Number(query.get('look')) || 0;
      const extras = (query.get('e') ?? '').split(',').flatMap((text) => (text ? [Number(text) || 0] : []));
      if (supermesh && isOfPage(supermesh)) takeNames(supermesh);
      if (supermesh && state.shapes.length)
        await openResult(supermesh, supermesh.request ?? null, { matches: matches.shown, look, extras });
      else if (!supermesh && !lost)
        report(
          'The morph of this link is gone',
          'It was deleted from the server. Its shapes are here: press Morph to make it again.',
        );
    } else if (result && isId(result) && !named.length) {
      if (await client.getSupermesh(result).catch(() => null)) await openSupermesh(result, false);
      else dead('its morph is');
    }
    const time = Number(query.get('t'));
    if (state.result && query.has('t') && Number.isFinite(time)) player.seek(time);
    if (state.result && query.get('side') === 'after') set({ side: 'after' });
    if (TABS.includes(tab) && state.shapes.length) set({ tab });
    const show = query.get('show');
    if (state.result && (show === 'beside' || show === 'each' || show === 'stretch' || show === 'error')) set({ show });
  } finally {
    restoring = false;
  }
  const job = query.get('j');
  if (job) void resumeJob(job, query.get('find') ? 'find' : 'morph', next);
  else if (query.get('find')) void startMerge('find');
  else if (query.get('go')) void startMerge();
}

/** Keeps the URL up to date. Pasting a URL of another state reloads the page with that state. */
export function keepUrl() {
  watch(save);
  player.listen(() => state.playing || save()); // a playing morph has no time in its URL
  stage.onMoved = save;
  window.addEventListener('pagehide', keepLate);
  window.addEventListener('hashchange', () => {
    if (location.hash !== written) location.reload();
  });
}
