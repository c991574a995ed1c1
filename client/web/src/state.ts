/** The state of the page and its listeners. actions/*.ts change it. */
import type { Job, Landmark as WireLandmark, Mesh, Problem, Supermesh, SupermeshRequest, Embedding } from 'orbmorph';
import { Orbmorph } from 'orbmorph';
import type { MorphData } from './mesh/morph';
import type { MeasureName, SphereData } from './mesh/distortion';
import type { Other } from './mesh/others';
import type { Spot } from './mesh/worker';
import { EXTRAS, type Content, type Extra } from './mesh/extras';
import type { Model } from './view/models';

export type Tab = 'shapes' | 'landmarks' | 'morph' | 'spheres';
export const TABS: Tab[] = ['shapes', 'landmarks', 'morph', 'spheres'];

export interface Shape {
  key: string;
  name: string;
  state: 'reading' | 'uploading' | 'ready' | 'refused' | 'failed';
  progress: number;
  file?: File;
  mesh?: Mesh;
  model?: Model;
  /** whether it has one clear plane of symmetry; undefined until that is known */
  symmetric?: boolean;
  facts?: { vertices: number; triangles: number; format: string };
  /** what its file has besides the surface, as far as the page can read it */
  extras?: Extra[];
  /** which of these a new mesh lacks, if this is the first shape */
  beyond?: Extra[];
  /** which of these the morph takes */
  taken?: Extra[];
  /** the parts of a glTF document */
  content?: Content;
  /** which of these the closed surface consists of, if the mesh is kept; none: those that were uploaded */
  surface?: { meshes: number[]; nodes: string[] };
  /** of a refused glTF: the files with its data that were not added with it */
  missing?: string[];
  /** The repairs that it was uploaded with. */
  repair?: string;
  problem?: Problem;
  message?: string;
  defects?: number;
  /** the embedding */
  sphere?: SphereState;
  /** the sphere after the alignment; `result` is the supermesh it belongs to */
  aligned?: SphereState & { result: string };
  /** of the morph `result`; its model is the shape, or a template at the shape, painted from 0 to `top` */
  error?: { result: string; max: number; rms: number; top: number; model: Model };
}

export interface SphereState {
  state: 'working' | 'ready' | 'failed';
  job?: Job;
  message?: string;
  embedding?: Embedding;
  values?: SphereData['values'];
  surface?: Model;
  ball?: Model;
  normals?: Float32Array;
  places?: Float32Array;
  /** points on the sphere by landmark id */
  spots?: Map<number, [number, number, number]>;
}

export interface Landmark {
  id: number;
  name: string;
  at: Record<string, Spot>;
  /** below 1: of a soft landmark, from a file; otherwise absent */
  weight?: number;
  /** what else a file or a morph says of it, which the page only passes on */
  also?: Partial<Pick<WireLandmark, 'pass' | 'radius' | 'confidence'>>;
  /** the landmark on the other side of the plane of symmetry */
  twin?: number;
}

export interface Options {
  align: 'default' | 'pin' | 'rbf' | 'rotate' | 'auto';
  remesh: 'adaptive' | 'overlay' | 'subdivision' | 'convex-hull' | 'template';
  tolerance: number;
  maxTriangles: number | null;
  path: 'linear' | 'rigid';
  fit: 'auto' | 'none' | 'rigid' | 'similarity';
  /** what becomes of holes of the first shape that a repair has filled */
  holes: 'reopen' | 'filled';
  /** of baked textures: texels a side; null: as fine as those of the shape */
  texels: number | null;
  repair: string;
  /** what else the request of an opened morph says: the page has no fields for it */
  more: Pick<SupermeshRequest, 'embedding' | 'align' | 'asset'>;
}

/** The sizes of textures that the page offers. */
export const TEXELS = [256, 512, 1024, 2048, 4096, 8192];

export const DEFAULTS: Options = {
  align: 'default',
  remesh: 'adaptive',
  tolerance: 0.001,
  maxTriangles: null,
  path: 'linear',
  fit: 'auto',
  holes: 'reopen',
  texels: null,
  repair: 'safe',
  more: {},
};

/** How a morph plays, here and in what is taken away. */
export const MOTION = { easing: ['smooth', 'linear', 'slow', 'bounce'], loop: ['pingpong', 'loop'] } as const;
export interface Motion {
  seconds: number;
  easing: (typeof MOTION.easing)[number];
  loop: (typeof MOTION.loop)[number];
}

export interface Running {
  purpose: 'morph' | 'find';
  job: Job | null;
  abort: AbortController;
  /** the fast morph that is shown until this one is done; `ended` never rejects */
  fast: { job: Job | null; abort: AbortController; ended: Promise<void> } | null;
  /** the match that is computed, of a morph that has several */
  matches?: Matches;
}

/** The requests of a morph that was matched without landmarks and of its alternatives, and which of them is shown. */
export interface Matches {
  best: Supermesh; // the first of them, whose answer lists the others
  requests: SupermeshRequest[];
  at: number; // the shown one
  tried?: number; // the last one that was sent
  told?: Told; // once it is known
}

/** How the alternatives of a match differ from it. */
export interface Told {
  landmarks: string[]; // the names of the found landmarks, to which the swaps refer
  others: (Other & { cost: number; shape: number })[]; // in the order of the alternatives
}

export interface Result {
  supermesh: Supermesh;
  request: SupermeshRequest | null;
  matches: Matches | null;
  data: Pick<MorphData, 'times' | 'weights' | 'shapes' | 'names' | 'vertices' | 'triangles' | 'looks' | 'extras'>;
  /** which of the looks is shown */
  look: number;
  /** the weights of the targets that are not shapes, as they are shown */
  extras: number[];
  main: Model;
  each: Model[];
  /** the shapes, painted by how much the morph stretches them, once that is measured */
  stretch?: Model[];
}

export const presetOf = (result: Result) =>
  (result.supermesh.request ?? result.request)?.align?.options?.preset ?? 'default';
/** Whether the first shape's own mesh carries the morph, so that the error is where that mesh is too coarse. */
export const isTemplate = (result: Result) =>
  (result.supermesh.request ?? result.request)?.remesh?.method === 'template';
export const isFast = (result: Result) => presetOf(result) === 'fast';

/** Whether the default morph is still to come: what is shown is not what a download gives. */
export const isWaiting = () => !!state.result && isFast(state.result) && state.running?.purpose === 'morph';

export const PAINTS = ['direction', 'checker', 'symmetric_dirichlet', 'angle', 'area', 'aspect'] as const;
export type SpherePaint = 'direction' | 'checker' | MeasureName;

export interface State {
  tab: Tab;
  shapes: Shape[];
  landmarks: Landmark[];
  active: number | null;
  /** the landmarks that the shown morph found; a morph does not use them as long as they are `landmarks`, unchanged */
  listed: Landmark[] | null;
  /** whether a landmark sets its twin, too */
  mirror: boolean;
  past: Landmark[][];
  future: Landmark[][];
  options: Options;
  running: Running | null;
  problem: { title: string; detail: string; facts: Problem | null } | null;
  loading: string | null;
  result: Result | null;
  playing: boolean;
  motion: Motion;
  mix: number[] | null;
  show: 'morph' | 'beside' | 'each' | 'stretch' | 'error';
  wire: boolean;
  /** wireframe of the common mesh on each shape, separate because that view is about its triangles */
  meshWire: boolean;
  linked: boolean;
  paint: SpherePaint;
  side: 'before' | 'after';
  /** whether a token is in use */
  token: 'none' | 'kept';
  /** the token dialog, and why it is open */
  asking: { reason: string | null } | null;
  drawer: 'server' | 'share' | 'help' | null;
  server: { meshes: Mesh[]; supermeshes: Supermesh[]; jobs: Job[]; message: string | null; loading: boolean } | null;
  toasts: { id: number; text: string; kind: 'info' | 'error' }[];
  dragging: boolean;
}

export const state: State = {
  tab: 'shapes',
  shapes: [],
  landmarks: [],
  active: null,
  listed: null,
  mirror: false,
  past: [],
  future: [],
  options: { ...DEFAULTS },
  running: null,
  problem: null,
  loading: null,
  result: null,
  playing: false,
  motion: { seconds: 2.2, easing: 'smooth', loop: 'pingpong' },
  mix: null,
  show: 'morph',
  wire: false,
  meshWire: true,
  linked: true,
  paint: 'direction',
  side: 'before',
  token: 'none',
  asking: null,
  drawer: null,
  server: null,
  toasts: [],
  dragging: false,
};

export const client = new Orbmorph({ server: '' });

const listeners = new Set<() => void>();
let scheduled = false;

/** Changes the state. Several changes in one task notify the listeners once. */
export function set(change: Partial<State> = {}) {
  Object.assign(state, change);
  if (scheduled) return;
  scheduled = true;
  queueMicrotask(() => {
    scheduled = false;
    for (const listener of [...listeners]) listener();
  });
}

export function watch(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

export function shapeOf(key: string): Shape | undefined {
  return state.shapes.find((shape) => shape.key === key);
}

export function patch(shape: Shape, change: Partial<Shape>) {
  Object.assign(shape, change);
  set();
}

let toastCount = 0;
export function toast(text: string, kind: 'info' | 'error' = 'info') {
  const id = ++toastCount;
  set({ toasts: [...state.toasts.slice(-3), { id, text, kind }] });
  setTimeout(() => set({ toasts: state.toasts.filter((t) => t.id !== id) }), kind === 'error' ? 9000 : 4000);
}

/** Tints of the shapes in order. */
const TINTS = ['#f0b79a', '#a8c3ee', '#b4d3a6', '#ecd08a', '#d9b3dc', '#93d0cb', '#e6a9b4', '#c2c6cc'];
export const tint = (index: number) => TINTS[index % TINTS.length];

/** Colours of the landmarks, easy to distinguish; each marker also shows its number. */
const HUES = [
  '#d6336c',
  '#1971c2',
  '#2b7a3a',
  '#c2410c',
  '#7048e8',
  '#0b7285',
  '#a61e4d',
  '#4d7c0f',
  '#364fc7',
  '#c92a2a',
  '#087057',
  '#862e9c',
];
export const hue = (index: number) => HUES[index % HUES.length];

/** The landmarks that have a place on each of the shapes: those of a request, in its order. */
export const landmarksOnAll = (shapes = readyShapes()): Landmark[] =>
  state.landmarks.filter((landmark) => shapes.length > 0 && shapes.every((shape) => landmark.at[shape.key]));

/** The landmarks that are set on every shape, in the daemon's format. */
export function wireLandmarks(shapes = readyShapes()): WireLandmark[] {
  return landmarksOnAll(shapes).map(({ name, at, weight, also }) => ({
    ...(name && { name }),
    at: shapes.map(({ key }) => at[key].place),
    ...(weight && { weight }),
    ...also,
  }));
}

/** What the page calls the landmark at an index of a request: the daemon names those without a name from 0. */
export const landmarkName = (name: string | undefined, index: number) =>
  name && name !== `landmark ${index}` ? name : `Landmark ${index + 1}`;

/** The landmarks that a morph would use. */
export const givenLandmarks = (shapes = readyShapes()): WireLandmark[] =>
  state.landmarks === state.listed ? [] : wireLandmarks(shapes);

/** Whether a file has something besides its surface. */
const hasExtra = (shape: Shape | undefined, what: Extra) =>
  !!shape?.extras?.includes(what) || !!shape?.mesh?.attributes?.some((name) => name === what);

/** What the morph can take from a shape: from the first one what a new mesh lacks, and no second skin. */
export function extrasOf(shape: Shape): Extra[] {
  const [first] = readyShapes();
  if (!shape.mesh) return [];
  if (shape === first) return state.options.remesh === 'template' ? [] : (shape.beyond ?? []);
  return EXTRAS.filter((what) => {
    if (what === 'texture' && !hasExtra(first, 'texcoord')) return false; // there is nothing to paint it on
    if (what === 'skin' && state.options.remesh === 'template' && hasExtra(first, 'skin')) return false;
    return hasExtra(shape, what);
  });
}

/** What the morph takes from a shape. */
export const takenFrom = (shape: Shape): Extra[] => extrasOf(shape).filter((what) => shape.taken?.includes(what));

/** Of which parts the kept surface consists, where that is said. */
export function surfaceOf(shape: Shape | undefined): { meshes?: number[]; nodes?: string[] } | null {
  const { meshes = [], nodes = [] } = (state.options.remesh === 'template' && shape?.content && shape.surface) || {};
  if (!meshes.length && !nodes.length) return null;
  return { ...(meshes.length && { meshes }), ...(nodes.length && { nodes }) };
}

/** The daemon morphs at most so many shapes at once: API_SHAPES_MAX. */
export const SHAPES_MOST = 16;

export const readyShapes = () => state.shapes.filter((shape) => shape.state === 'ready' && shape.mesh);
