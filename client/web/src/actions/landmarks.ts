/** Edits landmarks with undo, and imports and exports them in the daemon's format. */
import type { Landmark as WireLandmark, Place } from 'orbmorph';
import { work } from '../mesh/work';
import type { Spot } from '../mesh/worker';
import { readyShapes, set, state, toast, wireLandmarks, type Landmark, type Shape } from '../state';

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

/** The landmark that the next click sets: the active one, as long as a shape lacks it. */
export function pending(): Landmark | null {
  const active = state.landmarks.find((landmark) => landmark.id === state.active);
  const shapes = readyShapes();
  return active && shapes.some((shape) => !active.at[shape.key]) ? active : null;
}

export async function pickOn(shape: Shape, origin: number[], direction: number[]) {
  const spot = await work('pick', shape.key, origin, direction);
  if (spot) placeOn(shape, spot);
}

export function placeOn(shape: Shape, spot: Spot) {
  const open = pending();
  if (open) return change(state.landmarks.map((l) => (l === open ? { ...l, at: { ...l.at, [shape.key]: spot } } : l)));
  const made: Landmark = { id: ++count, name: '', at: { [shape.key]: spot } };
  change([...state.landmarks, made], made.id);
}

export async function moveOn(id: number, shape: Shape, origin: number[], direction: number[]) {
  const spot = await work('pick', shape.key, origin, direction);
  if (spot)
    change(
      state.landmarks.map((l) => (l.id === id ? { ...l, at: { ...l.at, [shape.key]: spot } } : l)),
      id,
    );
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
  const landmarks = state.landmarks
    .map((l) => ({ ...l, at: Object.fromEntries(Object.entries(l.at).filter(([other]) => other !== key)) }))
    .filter((l) => Object.keys(l.at).length);
  set({ landmarks, past: [], future: [] });
}

/** Replaces the landmarks by those of a file or a response. Returns how many fit the shapes. */
export async function takeLandmarks(
  list: Pick<WireLandmark, 'name' | 'at'>[],
  { undoable = true, snap = false } = {},
): Promise<number> {
  const shapes = readyShapes();
  const made: Landmark[] = list.map((l) => ({ id: ++count, name: l.name ?? '', at: {} }));
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
  const landmarks = made.filter((l) => Object.keys(l.at).length);
  if (undoable) change(landmarks, null);
  else set({ landmarks, active: null });
  return landmarks.length;
}

export async function importLandmarks(file: File) {
  try {
    const content = JSON.parse(await file.text());
    const list = Array.isArray(content) ? content : content.landmarks;
    if (!Array.isArray(list)) throw new Error('It contains no array of landmarks.');
    const taken = await takeLandmarks(list);
    toast(
      taken === list.length ? `${taken} landmarks imported.` : `${taken} of ${list.length} landmarks fit these shapes.`,
    );
  } catch (error) {
    toast(`${file.name} is not a landmark file. ${(error as Error).message}`, 'error');
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
