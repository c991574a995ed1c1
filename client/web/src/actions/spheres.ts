/** The embeddings of the shapes: asked for when the tab is opened, painted on the surface and on the sphere. */
import { client, readyShapes, set, state, type Shape, type SpherePaint } from '../state';
import { work } from '../mesh/work';
import { MEASURES, type MeasureName } from '../mesh/distortion';
import { sphereModels } from '../view/models';
import { stage } from '../view/shared';
import type { Paint } from '../view/colors';

export async function loadSpheres() {
  await Promise.all(readyShapes().map((shape) => (shape.sphere && shape.sphere.state !== 'failed' ? null : load(shape))));
}

async function load(shape: Shape) {
  const sphere = (shape.sphere = { state: 'working' } as NonNullable<Shape['sphere']>);
  set();
  try {
    sphere.embedding = await client.embed(shape.mesh!.id, {
      onProgress: (job) => {
        sphere.job = job;
        set();
      },
    });
    const data = await work('sphere', await client.sphere(sphere.embedding.id));
    const models = sphereModels(data);
    Object.assign(sphere, { ...models, values: data.values, normals: data.surface.normal, places: data.sphere, state: 'ready' });
    paintSphere(shape);
  } catch (error) {
    Object.assign(sphere, { state: 'failed', message: (error as Error).message });
  }
  set();
}

export const isMeasure = (paint: SpherePaint): paint is MeasureName => (MEASURES as readonly string[]).includes(paint);

/** The range over which a measure is painted: the same for every shape, so that they compare. */
export function measureRange(name: MeasureName): { low: number; high: number } {
  const p99 = state.shapes.map((shape) => shape.sphere?.embedding?.distortion?.[name]?.p99 ?? 0);
  const most = Math.max(...p99, 1e-6);
  if (name !== 'area') return { low: 1, high: Math.max(most, 1.05) };
  const std = Math.max(...state.shapes.map((s) => s.sphere?.embedding?.distortion?.area?.std ?? 0), 0.05);
  return { low: -2.5 * std, high: 2.5 * std };
}

function paintSphere(shape: Shape) {
  const { sphere } = shape;
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
  for (const shape of state.shapes) paintSphere(shape);
}
