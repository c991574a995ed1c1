/**
 * The spheres of the shapes before the alignment (their embeddings) and after it (from the supermesh), painted on the
 * surface and on the sphere. They are loaded when they come into view.
 */
import type { Embedding } from 'orbmorph';
import { client, readyShapes, set, state, type Shape, type SpherePaint, type SphereState } from '../state';
import { work } from '../mesh/work';
import { MEASURES, type MeasureName } from '../mesh/distortion';
import { explain } from './token';
import { sphereModels } from '../view/models';
import { stage } from '../view/shared';
import type { Paint } from '../view/colors';

/** The sphere of a shape that the page shows. */
export const sphereOf = (shape: Shape): SphereState | undefined =>
  state.side === 'after' ? shape.aligned : shape.sphere;

/** Whether the morph is of these shapes and has their aligned spheres. */
export const canAlign = () =>
  !!state.result &&
  readyShapes().every((shape, i) => {
    const of = state.result!.supermesh.shapes[i];
    return of?.mesh === shape.mesh!.id && !!of.sphere;
  });

export function showSide(side: 'before' | 'after') {
  set({ side });
  void loadSpheres();
}

export async function loadSpheres() {
  const { result, side } = state;
  if (side === 'after' && !canAlign()) return set({ side: 'before' });
  // Both sides need the embeddings first: their measures give the colour ranges and the histograms.
  await Promise.all(readyShapes().map((shape) => loadOnce(shape, 'before', () => loadEmbedded(shape))));
  if (side === 'after')
    await Promise.all(
      readyShapes().map((shape, i) => {
        if (shape.aligned?.result !== result!.supermesh.id) {
          dropSphere(shape, side);
          shape.aligned = undefined;
        }
        return loadOnce(shape, side, () => loadAligned(shape, i));
      }),
    );
  for (const shape of state.shapes) for (const sphere of [shape.sphere, shape.aligned]) paintSphere(sphere);
}

async function loadOnce(shape: Shape, side: 'before' | 'after', make: () => Promise<void>) {
  const known = side === 'after' ? shape.aligned : shape.sphere;
  if (known && known.state !== 'failed') return placeLandmarks(shape, side);
  dropSphere(shape, side);
  await make();
}

function dropSphere(shape: Shape, side: 'before' | 'after') {
  const old = side === 'after' ? shape.aligned : shape.sphere;
  old?.surface?.dispose();
  old?.ball?.dispose();
}

export function forgetSpheres(shape: Shape) {
  for (const side of ['before', 'after'] as const) {
    dropSphere(shape, side);
    void work('close', `${shape.key} ${side}`);
  }
}

async function loadEmbedded(shape: Shape) {
  const sphere: SphereState = (shape.sphere = { state: 'working' });
  await load(shape, 'before', sphere, async () => {
    sphere.embedding = await client.embed(shape.mesh!.id, {
      onProgress: (job) => {
        sphere.job = job;
        set();
      },
    });
    return client.sphere(sphere.embedding.id);
  });
}

async function loadAligned(shape: Shape, index: number) {
  const { supermesh } = state.result!;
  const sphere = (shape.aligned = { state: 'working', result: supermesh.id } as NonNullable<Shape['aligned']>);
  await load(shape, 'after', sphere, () => client.alignedSphere(supermesh.id, index));
}

async function load(shape: Shape, side: 'before' | 'after', sphere: SphereState, fetch: () => Promise<ArrayBuffer>) {
  set();
  try {
    const data = await work('sphere', `${shape.key} ${side}`, await fetch());
    const models = sphereModels(data);
    Object.assign(sphere, {
      ...models,
      values: data.values,
      normals: data.surface.normal,
      places: data.sphere,
      state: 'ready',
    });
    paintSphere(sphere);
    await placeLandmarks(shape, side);
  } catch (error) {
    Object.assign(sphere, { state: 'failed', message: explain(error) });
  }
  set();
}

/** Places the landmarks on the sphere. */
async function placeLandmarks(shape: Shape, side: 'before' | 'after') {
  const sphere = side === 'after' ? shape.aligned : shape.sphere;
  const here = state.landmarks.filter((landmark) => landmark.at[shape.key]);
  if (sphere?.state !== 'ready') return;
  const spots = await work(
    'sphereSpots',
    `${shape.key} ${side}`,
    here.map((landmark) => landmark.at[shape.key].position),
  );
  sphere.spots = new Map(here.map((landmark, i) => [landmark.id, spots[i]]));
  set();
}

export const isMeasure = (paint: SpherePaint): paint is MeasureName => (MEASURES as readonly string[]).includes(paint);

const embeddings = (): Embedding[] => state.shapes.flatMap((shape) => shape.sphere?.embedding ?? []);

/** The range over which a measure is painted. All shapes share it, which makes them comparable. */
export function measureRange(name: MeasureName): { low: number; high: number } {
  const most = Math.max(...embeddings().map((e) => e.distortion?.[name]?.p99 ?? 0), 1e-6);
  if (name !== 'area') return { low: 1, high: Math.max(most, 1.05) };
  const std = Math.max(...embeddings().map((e) => e.distortion?.area?.std ?? 0), 0.05);
  return { low: -2.5 * std, high: 2.5 * std };
}

function paintSphere(sphere: SphereState | undefined) {
  if (!sphere?.surface || !sphere.ball) return;
  const { paint } = state;
  let with_: Paint;
  if (isMeasure(paint)) {
    const { low, high } = measureRange(paint);
    with_ = { kind: 'value', ramp: paint === 'area' ? 'diverging' : 'heat', low, high, log: paint !== 'area' };
  } else with_ = { kind: paint };
  for (const model of [sphere.surface, sphere.ball]) {
    if (isMeasure(paint)) model.attribute('value', sphere.values![paint]);
    else model.attribute('tone', paint === 'direction' ? sphere.normals! : sphere.places!);
    model.paint(with_);
  }
  stage.draw();
}

export function setPaint(paint: SpherePaint) {
  set({ paint });
  for (const shape of state.shapes) {
    paintSphere(shape.sphere);
    paintSphere(shape.aligned);
  }
}
