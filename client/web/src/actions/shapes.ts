/** Adds shapes from files, samples and the server; offers repairs for refused meshes. */
import { ProblemError, type Mesh } from 'orbmorph';
import samples from 'virtual:samples';
import { client, patch, set, shapeOf, state, tint, toast, type Shape } from '../state';
import { meshesOf, missingOf } from '../mesh/companions';
import { CLOSE, LARGEST, numbers, sizeFor, SMALL } from '../mesh/refusal';
import { listIn } from '../mesh/marks';
import { withRepairs } from '../mesh/repairs';
import { work } from '../mesh/work';
import { shapeModel } from '../view/models';
import { forgetShape, importLandmarks } from './landmarks';
import { clearResult } from './merge';
import { forgetSpheres } from './spheres';
import { explain } from './token';

export interface Sample {
  name: string;
  file: string;
  bytes: number;
  url: string;
}
export const sampleList: Sample[] = samples;

let count = 0;

function create(name: string): Shape {
  const shape: Shape = { key: `s${++count}`, name, state: 'reading', progress: 0 };
  if (state.result) clearResult();
  set({ shapes: [...state.shapes, shape] });
  return shape;
}

/** Parses the file in the worker and creates the model. The view stays empty if the file cannot be drawn. */
async function draw(shape: Shape, buffer: ArrayBuffer) {
  try {
    const display = await work('open', shape.key, buffer);
    if (!shapeOf(shape.key)) return void work('close', shape.key);
    const model = shapeModel(display, tint(state.shapes.indexOf(shape)));
    patch(shape, {
      model,
      extras: display.extras,
      beyond: display.beyond,
      content: display.content,
      facts: { vertices: display.vertices, triangles: display.triangles, format: display.format },
    });
  } catch {
    // the daemon may read it: showRepaired() then shows its mesh
  }
}

/** Repairs after which the surface looks otherwise than in the file: triangles that faced inwards are not drawn. */
const RESHAPING = ['fill_holes', 'largest_component', 'close_handles', 'split_nonmanifold', 'part', 'reorient'];

/**
 * Shows what the daemon made of a file where that differs from the file, or where only the daemon can read it. The mesh
 * comes with its embedding, which the morph needs anyway.
 */
async function showRepaired(shape: Shape) {
  const mesh = shape.mesh!;
  await drawn.get(shape.key);
  if (shape.model && !mesh.repairs?.some(({ kind, count }) => count > 0 && RESHAPING.includes(kind))) return;
  try {
    const embedding = await client.embed(mesh.id);
    const display = await work('openRepaired', shape.key, await client.sphere(embedding.id));
    if (shapeOf(shape.key) !== shape || shape.mesh !== mesh) return;
    shape.model?.dispose();
    patch(shape, {
      model: shapeModel(display, tint(state.shapes.indexOf(shape))),
      facts: { vertices: mesh.vertices, triangles: mesh.triangles, format: mesh.format },
      message: undefined,
    });
  } catch (error) {
    // the file stays on show if it could be read; a morph would report the same problem
    if (!shape.model) patch(shape, { message: explain(error) });
  }
}

async function send(shape: Shape, repair = state.options.repair) {
  patch(shape, { state: 'uploading', progress: 0, repair, problem: undefined, message: undefined, defects: undefined });
  shape.model?.defects(null);
  try {
    const mesh = await client.uploadMesh(shape.file!, {
      name: shape.name,
      repair,
      onProgress: (sent, total) => patch(shape, { progress: total ? sent / total : 1 }),
    });
    patch(shape, { state: 'ready', mesh, progress: 1 });
    void showRepaired(shape);
  } catch (error) {
    if (!(error instanceof ProblemError) || error.status === 401 || error.status === 403)
      return patch(shape, { state: 'failed', message: explain(error) });
    const missing = error.kind === 'malformed-mesh' ? await missingOf(shape.file!) : [];
    patch(shape, { state: 'refused', problem: error.problem, missing });
    await drawn.get(shape.key);
    await showDefects(shape, error);
  }
}

const pairs = (value: unknown): number[][] =>
  Array.isArray(value) ? value.filter((x) => Array.isArray(x) && x.length === 2) : [];

/** The edges of closed loops of vertices. */
const rims = (value: unknown): number[][] =>
  Array.isArray(value)
    ? value.flatMap((loop) => numbers(loop).map((v, i, all) => [v, all[(i + 1) % all.length]!]))
    : [];

async function showDefects(shape: Shape, error: ProblemError) {
  const { problem } = error;
  const edges = [
    ...pairs(problem.boundary_edges),
    ...pairs(problem.nonmanifold_edges),
    ...pairs(problem.edges),
    ...rims(problem.loops),
  ];
  const vertices = [...numbers(problem.nonmanifold_vertices), ...numbers(problem.vertices)];
  const defects = await work('defects', shape.key, error.kind, edges, vertices);
  shape.model?.defects(defects);
  patch(shape, { defects: defects.found });
}

const drawn = new Map<string, Promise<void>>();

/** The landmark files among these files: glTF documents are JSON, too, whatever their names end with. */
async function landmarkFiles(files: File[]): Promise<File[]> {
  const lists = await Promise.all(
    files.map(async (file) => /\.json$/i.test(file.name) && listIn(await file.text()) !== null),
  );
  return files.filter((_, i) => lists[i]);
}

/** Adds the meshes among these files, then imports the landmark files. Returns how many of each there are. */
export async function addFiles(files: Iterable<File>): Promise<{ meshes: number; marks: number }> {
  const all = [...files];
  const marks = await landmarkFiles(all);
  const { meshes, left } = await meshesOf(all.filter((file) => !marks.includes(file)));
  if (left.length && meshes.length) toast(`Left out, because no shape is in them: ${left.join(', ')}`);
  if (meshes.length) set({ tab: 'shapes' });
  await Promise.all(
    meshes.map(async (file) => {
      const shape = create(file.name.replace(/\.[A-Za-z0-9]{1,5}$/, ''));
      shape.file = file;
      drawn.set(
        shape.key,
        file.arrayBuffer().then((buffer) => draw(shape, buffer)),
      );
      await send(shape);
    }),
  );
  for (const file of marks) {
    await Promise.all(state.shapes.map(({ key }) => drawn.get(key))); // places are those of the drawn meshes
    await importLandmarks(file);
  }
  return { meshes: meshes.length, marks: marks.length };
}

/** Adds samples in this order, however fast each is loaded. */
export async function addSamples(list: Sample[]) {
  const files = await Promise.all(
    list.map(async (sample) => {
      try {
        const response = await fetch(sample.url);
        if (!response.ok) throw new Error(String(response.status));
        return [new File([await response.blob()], sample.file)];
      } catch {
        toast(`The sample ${sample.name} could not be loaded.`, 'error');
        return [];
      }
    }),
  );
  await addFiles(files.flat());
}

/** The pair that "Try with samples" opens: the one of the samples that is matched best. */
export const samplePair = () => sampleList.filter(({ name }) => name === 'dog' || name === 'giraffe');

export async function addFromServer(mesh: Mesh): Promise<Shape> {
  const shape = create(mesh.name || mesh.id.slice(0, 8));
  patch(shape, { mesh });
  try {
    await draw(shape, await client.meshFile(mesh.id));
    patch(shape, { state: 'ready', progress: 1 });
    void showRepaired(shape);
  } catch (error) {
    patch(shape, { state: 'failed', message: explain(error) });
  }
  return shape;
}

export function removeShape(key: string) {
  const shape = shapeOf(key);
  if (!shape) return;
  forgetShape(key);
  shape.model?.dispose();
  forgetSpheres(shape);
  shape.error?.model.dispose();
  void work('close', key);
  drawn.delete(key);
  if (state.result) clearResult();
  set({ shapes: state.shapes.filter((other) => other !== shape) });
  state.shapes.forEach((other, index) => other.model?.color(tint(index)));
}

export function moveShape(key: string, by: number) {
  const shapes = [...state.shapes];
  const from = shapes.findIndex((shape) => shape.key === key);
  const to = from + by;
  if (from < 0 || to < 0 || to >= shapes.length) return;
  shapes.splice(to, 0, ...shapes.splice(from, 1));
  if (state.result) clearResult();
  set({ shapes });
  shapes.forEach((other, index) => other.model?.color(tint(index)));
}

/** Uploads the file with further repairs beside those that it was uploaded with. */
export async function uploadAgain(key: string, repair: string) {
  const shape = shapeOf(key);
  if (!shape?.file) return;
  await send(shape, withRepairs(shape.repair ?? 'safe', repair));
  if (repair.includes(CLOSE)) await closeTheRest(shape, Number(repair.split(`${CLOSE}:`)[1] ?? SMALL));
}

/**
 * The rounds that closeTheRest() makes. A refusal with tens of thousands of handles may leave loops out, and a cut can
 * lengthen others: each round allows the longest of those left.
 */
const ROUNDS = 8;

/** Closes the handles that are left after a repair with this `size`. */
async function closeTheRest(shape: Shape, size: number) {
  for (let round = 0; round < ROUNDS && shape.state === 'refused' && shapeOf(shape.key) === shape; round++) {
    const next = sizeFor(numbers(shape.problem?.loop_lengths_relative));
    if (next <= size || next > LARGEST) return;
    size = next;
    await send(shape, withRepairs(shape.repair ?? 'safe', `safe,${CLOSE}:${size}`));
  }
}
