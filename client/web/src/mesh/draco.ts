/**
 * Decodes primitives of KHR_draco_mesh_compression. The decoder comes with three.js and is loaded for the first file that
 * needs it. It is the one in plain JavaScript: the daemon's Content-Security-Policy does not allow WebAssembly.
 */
import type { Draco } from 'three/examples/jsm/libs/draco/gltf/draco_decoder.js';
import type { Gltf, Primitive } from './gltf';

/** What the studio shows. */
const SHOWN = /^(POSITION|TEXCOORD_\d+|COLOR_0)$/;

let loaded: Promise<{ draco: Draco }> | null = null;

function decoder(): Promise<{ draco: Draco }> {
  loaded ??= import('three/examples/jsm/libs/draco/gltf/draco_decoder.js').then(
    ({ default: start }) =>
      // wrapped, as it is a thenable
      new Promise((resolve) => void start({ onModuleLoaded: (draco) => resolve({ draco }) })),
  );
  loaded.catch(() => (loaded = null)); // the next file tries again
  return loaded;
}

/** Gives compressed primitives plain accessors. Vertices get the numbers that the daemon gives them. */
export async function unpackPrimitives(gltf: Gltf) {
  const primitives = (gltf.json.meshes ?? [])
    .flatMap((mesh) => mesh.primitives)
    .filter((primitive) => primitive.extensions?.KHR_draco_mesh_compression);
  if (!primitives.length) return;
  const { draco } = await decoder();
  for (const primitive of primitives) unpack(draco, gltf, primitive);
}

function unpack(draco: Draco, gltf: Gltf, primitive: Primitive) {
  const { bufferView, attributes } = primitive.extensions!.KHR_draco_mesh_compression!;
  const bytes = gltf.view(bufferView);
  const reader = new draco.Decoder();
  const mesh = new draco.Mesh();
  /** The values that `fill` writes to the decoder's memory. */
  const copied = (length: number, fill: (bytes: number, at: number) => boolean): Uint8Array => {
    const at = draco._malloc(length);
    const out = fill(length, at) ? new Uint8Array(draco.HEAPF32.buffer, at, length).slice() : null;
    draco._free(at);
    if (!out) throw new Error('Draco cannot give the values in the type of the accessor.');
    return out;
  };
  try {
    const status = reader.DecodeArrayToMesh(new Int8Array(bytes), bytes.length, mesh);
    if (!status.ok()) throw new Error(status.error_msg());
    const types: Record<number, [number, number]> = {
      5120: [draco.DT_INT8, 1],
      5121: [draco.DT_UINT8, 1],
      5122: [draco.DT_INT16, 2],
      5123: [draco.DT_UINT16, 2],
      5125: [draco.DT_UINT32, 4],
      5126: [draco.DT_FLOAT32, 4],
    };
    const points = mesh.num_points();
    for (const [name, id] of Object.entries(attributes)) {
      if (!SHOWN.test(name)) continue;
      const { componentType, normalized } = gltf.json.accessors![primitive.attributes[name]];
      const attribute = reader.GetAttributeByUniqueId(mesh, id);
      if (!attribute.ptr) throw new Error(`The compressed primitive lacks ${name}.`);
      const width = attribute.num_components();
      const [type, size] = types[componentType];
      const values = copied(points * width * size, (length, at) =>
        reader.GetAttributeDataArrayForAllPoints(mesh, attribute, type, length, at),
      );
      const kind = width === 1 ? 'SCALAR' : `VEC${width}`;
      primitive.attributes[name] = gltf.add(values, { componentType, normalized, count: points, type: kind });
    }
    const count = 3 * mesh.num_faces();
    const corners = copied(4 * count, (length, at) => reader.GetTrianglesUInt32Array(mesh, length, at));
    primitive.indices = gltf.add(corners, { componentType: 5125, count, type: 'SCALAR' });
    primitive.mode = 4;
  } finally {
    draco.destroy(mesh);
    draco.destroy(reader);
  }
}
