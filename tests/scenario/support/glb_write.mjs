// A writer of binary glTF, against the specification: one mesh, one primitive, at most one morph target and one texture.

/**
 * positions, normals, colors, moves: [x,y,z] per vertex; uv, uv1: [u,v]; triangles; image: a PNG; factor: base colour.
 * edit(gltf, push): changes the document before it is written; push(bytes) adds a buffer view and returns its number.
 */
export function writeGlb({ positions, normals, colors, uv, uv1, triangles, moves, image, factor, wrap = 10497, edit }) {
  const parts = [];
  const bufferViews = [];
  const accessors = [];
  const push = (bytes) => {
    const byteOffset = parts.reduce((n, p) => n + p.length, 0);
    parts.push(bytes, Buffer.alloc((4 - (bytes.length % 4)) % 4));
    return bufferViews.push({ buffer: 0, byteOffset, byteLength: bytes.length }) - 1;
  };
  const floats = (values, width) => {
    const range = (pick) => Array.from({ length: width }, (_, k) => Math.fround(pick(...values.map((v) => v[k]))));
    const bufferView = push(Buffer.from(new Float32Array(values.flat()).buffer));
    return (
      accessors.push({
        bufferView,
        componentType: 5126,
        count: values.length,
        type: `VEC${width}`,
        min: range(Math.min),
        max: range(Math.max),
      }) - 1
    );
  };
  const attributes = { POSITION: floats(positions, 3) };
  if (normals) attributes.NORMAL = floats(normals, 3);
  if (colors) attributes.COLOR_0 = floats(colors, 3);
  if (uv) attributes.TEXCOORD_0 = floats(uv, 2);
  if (uv1) attributes.TEXCOORD_1 = floats(uv1, 2);
  const corners = triangles.flat();
  const indices =
    accessors.push({
      bufferView: push(Buffer.from(new Uint16Array(corners).buffer)),
      componentType: 5123,
      count: corners.length,
      type: 'SCALAR',
    }) - 1;
  const primitive = { attributes, indices, material: 0 };
  if (moves)
    primitive.targets = [
      {
        POSITION: floats(moves, 3),
        ...(normals
          ? {
              NORMAL: floats(
                moves.map(() => [0, 0, 0]),
                3,
              ),
            }
          : {}),
      },
    ];
  const surface = { baseColorFactor: factor ?? [1, 1, 1, 1], metallicFactor: 0 };
  const gltf = {
    asset: { version: '2.0' },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [primitive] }],
    materials: [{ pbrMetallicRoughness: surface }],
  };
  if (image) {
    surface.baseColorTexture = { index: 0 };
    Object.assign(gltf, {
      textures: [{ source: 0, sampler: 0 }],
      samplers: [{ wrapS: wrap, wrapT: wrap }],
      images: [{ bufferView: push(image), mimeType: 'image/png' }],
    });
  }
  Object.assign(gltf, { accessors, bufferViews });
  edit?.(gltf, push);
  const bin = Buffer.concat(parts);
  gltf.buffers = [{ byteLength: bin.length }];
  const text = Buffer.from(JSON.stringify(gltf));
  const json = Buffer.concat([text, Buffer.alloc((4 - (text.length % 4)) % 4, ' ')]);
  const head = Buffer.alloc(20);
  const second = Buffer.alloc(8);
  head.write('glTF');
  [2, 28 + json.length + bin.length, json.length].forEach((n, i) => head.writeUInt32LE(n, 4 + 4 * i));
  head.write('JSON', 16);
  second.writeUInt32LE(bin.length, 0);
  second.write('BIN\0', 4, 'latin1');
  return Buffer.concat([head, json, second, bin]);
}

/** The same as text, with the buffer in a data URI. */
export function writeGltf(mesh) {
  const glb = writeGlb(mesh);
  const end = 20 + glb.readUInt32LE(12);
  const json = JSON.parse(glb.subarray(20, end).toString());
  json.buffers[0].uri = `data:application/octet-stream;base64,${glb.subarray(end + 8).toString('base64')}`;
  return Buffer.from(JSON.stringify(json));
}
