// A client of the daemon with the types that openapi-typescript generates, without casts or other help. The test compiles
// it and runs it.
import createClient from 'openapi-fetch';
import type { components, paths } from './api.js';

type Supermesh = components['schemas']['Supermesh'];

/** Uploads files, merges them and lists, downloads and deletes the result. */
export async function journey(baseUrl: string, files: { name: string; bytes: Uint8Array }[]) {
  const client = createClient<paths>({ baseUrl });
  const headers = { 'Content-Type': 'application/octet-stream' };
  const ids: string[] = [];
  for (const { name, bytes } of files) {
    const { data, error } = await client.POST('/v1/meshes', {
      params: { query: { name } },
      headers,
      body: bytes,
      bodySerializer: (body) => body,
    });
    if (error) throw new Error(error.detail);
    ids.push(data.id);
  }
  const made = await client.POST('/v1/supermeshes', {
    params: { query: { wait: 60 } },
    body: {
      shapes: ids.map((mesh) => ({ mesh })),
      landmarks: [{ at: ids.map(() => ({ vertex: 0 })) }],
      align: { method: 'rotate' },
      remesh: { tolerance: 0.05 },
      asset: { animation: 'none' },
    },
  });
  if (made.error) throw new Error(made.error.detail);
  if (!('asset' in made.data)) throw new Error(`job ${made.data.id} is ${made.data.state}`);
  const supermesh: Supermesh = made.data;

  const list = await client.GET('/v1/supermeshes', {
    params: { query: { view: 'summary', mesh: ids[0] ?? '', limit: 10 } },
  });
  const names = list.data?.supermeshes.flatMap(({ shapes }) => shapes.map(({ name }) => name));
  const path = { id: supermesh.id };
  const asset = await client.GET('/v1/supermeshes/{id}/asset.glb', { params: { path }, parseAs: 'arrayBuffer' });
  const recipe = { shapes: ids.join(), align: 'rotate', tolerance: 0.05, animation: 'none' } as const;
  const morph = await client.GET('/v1/morph.glb', { params: { query: recipe }, parseAs: 'arrayBuffer' });
  const magic: string = new TextDecoder().decode(morph.data?.slice(0, 4));
  const deleted = await client.DELETE('/v1/supermeshes/{id}', { params: { path } });
  return { supermesh, names, bytes: asset.data?.byteLength, magic, deleted: deleted.response.status };
}

/** Why an upload is refused: each problem has the members of its type. */
export async function refusal(baseUrl: string, bytes: Uint8Array) {
  const client = createClient<paths>({ baseUrl, headers: { 'Content-Type': 'application/octet-stream' } });
  const { error } = await client.POST('/v1/meshes', { body: bytes, bodySerializer: (body) => body });
  switch (error?.type) {
    case '/problems/not-closed':
      return `${error.boundary_loops} loops`;
    case '/problems/malformed-mesh':
      return 'line' in error ? `line ${error.line}` : `offset ${error.offset}`;
    case '/problems/not-genus-zero':
      return `genus ${error.genus.toFixed()}`;
    default:
      return error?.detail;
  }
}

/** Requests that the types refuse. Never called. */
export function wrong(client: ReturnType<typeof createClient<paths>>) {
  const shapes = [{ mesh: 'a' }, { mesh: 'b' }];
  // @ts-expect-error there is no such method
  void client.POST('/v1/supermeshes', { body: { shapes, remesh: { method: 'magic' } } });
  // @ts-expect-error a recipe needs shapes
  void client.GET('/v1/morph.glb', { params: { query: { align: 'rotate' } } });
  // @ts-expect-error a mesh has no such part
  void client.GET('/v1/meshes/{id}/sphere.ply', { params: { path: { id: 'a' } } });
}
