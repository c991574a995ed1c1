// Compiled but never run: code that must compile, and code that the compiler must reject.
import orbmorph, {
  Orbmorph,
  ProblemError,
  type KnownProblem,
  type Landmark,
  type Mesh,
  type Supermesh,
} from '../src/index.js';

export async function usage(a: File, b: Uint8Array) {
  const landmarks: Landmark[] = [{ name: 'nose', at: [{ vertex: 12 }, { point: [1, 2, 3] }] }];
  const morph = await orbmorph.morph([a, b, 'horse.obj'], {
    landmarks,
    remesh: { tolerance: 0.001 },
    onProgress: ({ step, progress }) => `${step} ${progress}`,
  });
  const glb: ArrayBuffer = await morph.glb();
  const packed: ArrayBuffer = await morph.glb({ profile: 'meshopt' });
  const client = new Orbmorph({ server: 'http://127.0.0.1:8080', token: 'secret' });
  client.token = undefined;
  const mesh: Mesh = await client.uploadMesh(a, { repair: ['safe', 'fill_holes'] });
  const embedding = await client.embed(mesh.id, { method: 'newton', options: { preset: 'quality' } });
  const mean: number | null = embedding.distortion.symmetric_dirichlet.mean;
  const supermesh: Supermesh = await client.merge({
    shapes: [{ mesh: mesh.id }, { mesh: mesh.id }],
    landmarks: 'auto',
    align: { method: 'auto' },
  });
  const off: number | null | undefined = supermesh.profiles?.meshopt.quantization_relative;
  const { id: landmarks_id } = await client.createLandmarks({ landmarks });
  const url: string = client.morphUrl({ shapes: [mesh.id, mesh.id], landmarks: landmarks_id, tolerance: 0.01 });
  const signed: string = await orbmorph.signUrl(url, { key: 'web', secret: 'secret', expires: '30d' });
  const message = await orbmorph.verifyWebhook('{}', new Headers(), 'whsec_');
  if (message.type === 'job.failed') console.log(message.data.problem?.detail);
  const sphere: ArrayBuffer = await client.alignedSphere(supermesh.id, 0);
  for await (const job of client.list('jobs', { state: 'running' })) job.progress?.toFixed(2);
  const names: string[] = [];
  for await (const made of client.list('supermeshes', { view: 'summary', mesh: mesh.id, name: 'dog' })) {
    names.push(...made.shapes.map(({ name }) => name));
    // @ts-expect-error a summary has no report
    void made.pairs;
  }
  for await (const made of client.list('supermeshes', { limit: 10 })) made.pairs.length.toFixed();
  return [glb, packed, off, mean, sphere, signed, names];
}

export function describe(error: unknown) {
  if (!(error instanceof ProblemError)) throw error;
  const problem = error.problem as KnownProblem;
  return problem.type === '/problems/not-closed' ? problem.boundary_edges.length : error.kind;
}

// @ts-expect-error a method that does not exist
void new Orbmorph().merge({ shapes: [{ mesh: 'x' }, { mesh: 'y' }], remesh: { method: 'magic' } });
// @ts-expect-error a place is a vertex, a point, or a triangle with barycentric coordinates
export const wrong: Landmark = { at: [{ corner: 1 }, { vertex: 2 }] };
