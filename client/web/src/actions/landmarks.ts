/** Edits landmarks with undo, and imports and exports them in the daemon's format. */
import type { Place, Supermesh } from 'orbmorph';
import { listIn, marksOf, type Listed } from '../mesh/marks';
import { work } from '../mesh/work';
import { counted } from '../words';
import type { Spot } from '../mesh/worker';
import {
  landmarksOnAll,
  patch,
  readyShapes,
  set,
  state,
  toast,
  wireLandmarks,
  type Landmark,
  type Result,
  type Shape,
} from '../state';

let count = 0;

/** Every edit goes through here, which makes it undoable. A morph made from the old landmarks stays in view. */
function change(landmarks: Landmark[], active = state.active) {
  set({ past: [...state.past.slice(-199), state.landmarks], future: [], landmarks, active });
}

export function undo() {
  const last = state.past.at(-1);
  if (last) set({ past: state.past.slice(0, -1), future: [state.landmarks, ...state.future], landmarks: last });
}

export function redo() {
  const [next, ...future] = state.future;
  if (next) set({ future, past: [...state.past, state.landmarks], landmarks: next });
}

const byId = (id: number | null | undefined) => state.landmarks.find((landmark) => landmark.id === id);

/** The landmark that the next click sets: the active one, or else its twin, as long as a shape lacks it. */
export function pending(): Landmark | null {
  const active = byId(state.active);
  const shapes = readyShapes();
  return [active, byId(active?.twin)].find((l) => l && shapes.some((shape) => !l.at[shape.key])) ?? null;
}

/** Finds out which shapes have a clear plane of symmetry. */
export function findSymmetry() {
  for (const shape of readyShapes())
    if (shape.model && shape.symmetric === undefined) {
      shape.symmetric = false;
      void work('symmetric', shape.key).then((symmetric) => symmetric && patch(shape, { symmetric }));
    }
}

export async function pickOn(shape: Shape, origin: number[], direction: number[]) {
  const spot = await work('pick', shape.key, origin, direction);
  if (!spot) return;
  const other = state.mirror && shape.symmetric ? await work('mirror', shape.key, spot.position) : null;
  placeOn(shape, spot, other);
}

/** Sets the pending landmark, or a new one, at `spot`; with `other` also its twin, unless that is set already. */
export function placeOn(shape: Shape, spot: Spot, other: Spot | null = null) {
  const open = pending();
  const at = (landmark: Landmark, where: Spot) => ({ ...landmark, at: { ...landmark.at, [shape.key]: where } });
  const placed = at(open ?? { id: ++count, name: '', at: {} }, spot);
  let landmarks = open ? state.landmarks.map((l) => (l === open ? placed : l)) : [...state.landmarks, placed];
  if (other) {
    const known = byId(placed.twin);
    const twin: Landmark = known ?? { id: ++count, name: '', at: {}, twin: placed.id };
    if (!known) landmarks.push(twin);
    placed.twin = twin.id;
    if (!twin.at[shape.key]) landmarks = landmarks.map((l) => (l.id === twin.id ? at(l, other) : l));
  }
  change(landmarks, state.active !== null && open ? state.active : placed.id);
}

/** Moves a landmark on a shape, as one step for undo. */
export function moveTo(id: number, shape: Shape, spot: Spot) {
  const moved = ({ also, ...mark }: Landmark): Landmark => ({
    ...mark,
    at: { ...mark.at, [shape.key]: spot },
    also: also && { ...also, confidence: undefined }, // it is set now, no longer found
  });
  change(
    state.landmarks.map((l) => (l.id === id ? moved(l) : l)),
    id,
  );
}

type Suspect = NonNullable<Supermesh['suspects']>[number];

/**
 * Moves a landmark of a morph to where it would lie by the surface around it, and shows it there; undo takes it back.
 * Moves nothing if the landmark is no longer as the morph had it.
 */
export async function followSuggestion({ supermesh, request }: Result, { landmark, shape: number, at }: Suspect) {
  const given = (supermesh.request ?? request)?.landmarks;
  const shapes = readyShapes();
  const shape = shapes[number];
  const before = Array.isArray(given) ? given[landmark]?.at[number] : undefined;
  const own = shape && landmarksOnAll(shapes)[landmark];
  if (!own || JSON.stringify(own.at[shape.key].place) !== JSON.stringify(before))
    return toast('The landmarks are others now. Morph again to see whether one may be misplaced.');
  const [spot] = await work('locate', shape.key, [at], true);
  if (!spot || byId(own.id) !== own) return;
  moveTo(own.id, shape, spot);
  set({ tab: 'landmarks' });
}

export function renameLandmark(id: number, name: string) {
  change(state.landmarks.map((l) => (l.id === id ? { ...l, name } : l)));
}

export function removeLandmark(id: number) {
  change(
    state.landmarks.filter((l) => l.id !== id),
    state.active === id ? null : state.active,
  );
}

export function clearLandmarks() {
  change([], null);
}

export function forgetShape(key: string) {
  if (state.landmarks === state.listed) return set({ landmarks: [], listed: null, past: [], future: [] });
  const landmarks = state.landmarks
    .map((l) => ({ ...l, at: Object.fromEntries(Object.entries(l.at).filter(([other]) => other !== key)) }))
    .filter((l) => Object.keys(l.at).length);
  set({ landmarks, past: [], future: [] });
}

/** What else than its places the daemon takes of a landmark, where that differs from what it assumes. */
const alsoOf = ({ pass, radius, confidence = 1 }: Listed[0]): Landmark['also'] => ({
  ...(pass && { pass }),
  ...(radius && { radius }),
  ...(confidence < 1 && { confidence }),
});

/** The landmarks of a file or a response on the shapes; those that fit no shape are omitted. */
async function located(list: Listed, snap: boolean): Promise<Landmark[]> {
  const shapes = readyShapes();
  const made: Landmark[] = list.map((mark) => ({
    id: ++count,
    name: mark.name ?? '',
    at: {},
    ...((mark.weight ?? 1) < 1 && { weight: mark.weight }),
    also: alsoOf(mark),
  }));
  await Promise.all(
    shapes.map(async (shape, index) => {
      const wanted = list.map((l, row) => ({ row, place: l.at?.[index] })).filter((w) => w.place);
      const spots = await work(
        'locate',
        shape.key,
        wanted.map((w) => w.place as Place),
        snap,
      );
      wanted.forEach((w, i) => {
        if (spots[i]) made[w.row].at[shape.key] = spots[i]!;
      });
    }),
  );
  return made.filter((l) => Object.keys(l.at).length);
}

/** Lists what the shown morph has found, unless the list holds landmarks that were set. */
export async function listFound(list: Listed, isShown: () => boolean) {
  const free = () => isShown() && (!state.landmarks.length || state.landmarks === state.listed);
  if (!free()) return;
  const landmarks = await located(list, true);
  if (free()) set({ landmarks, listed: landmarks, active: null });
}

/**
 * Replaces the landmarks by those of a file or a response; if none of these fits the shapes, nothing changes. Returns how
 * many fit.
 */
export async function takeLandmarks(list: Listed, { undoable = true, snap = false } = {}): Promise<number> {
  const landmarks = await located(list, snap);
  if (!landmarks.length) return 0;
  if (undoable) change(landmarks, null);
  else set({ landmarks, active: null });
  return landmarks.length;
}

/** Imports a landmark file; says what is wrong with one that it cannot use, and then changes nothing. */
export async function importLandmarks(file: File) {
  const { name } = file;
  try {
    const list = listIn(await file.text());
    if (!list) throw new Error(`${name} is not a landmark file: it has no list of landmarks.`);
    const shapes = readyShapes().length;
    if (!shapes) throw new Error(`${name} has landmarks. Add their shapes first, then import it under Landmarks.`);
    const marks = marksOf(list, shapes, name);
    const taken = await takeLandmarks(marks);
    if (!taken)
      throw new Error(`No landmark of ${name} fits these shapes: it may be of others, or of another order of them.`);
    toast(
      taken === marks.length
        ? `${counted(taken, 'landmark')} imported.`
        : `${taken} of ${counted(marks.length, 'landmark')} fit these shapes.`,
    );
  } catch (error) {
    toast((error as Error).message, 'error');
  }
}

export function exportLandmarks() {
  save(
    new Blob([JSON.stringify({ landmarks: wireLandmarks() }, null, 2)], { type: 'application/json' }),
    'landmarks.json',
  );
}

export function save(blob: Blob, name: string) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
