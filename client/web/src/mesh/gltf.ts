/**
 * The part of glTF 2.0 that meshes and morphs need: accessors (also sparse, normalised and compressed), nodes, targets,
 * images.
 */
import { unpackView, type Packed } from './meshopt';

interface Accessor {
  bufferView?: number;
  byteOffset?: number;
  componentType: number;
  count: number;
  type: string;
  normalized?: boolean;
  sparse?: {
    count: number;
    indices: { bufferView: number; byteOffset?: number; componentType: number };
    values: { bufferView: number; byteOffset?: number };
  };
}
export interface Primitive {
  mode?: number;
  attributes: Record<string, number>;
  indices?: number;
  material?: number;
  targets?: Record<string, number>[];
  extensions?: {
    KHR_materials_variants?: { mappings?: { material: number; variants: number[] }[] };
    KHR_draco_mesh_compression?: { bufferView: number; attributes: Record<string, number> };
  };
}
interface Node {
  name?: string;
  mesh?: number;
  weights?: number[];
  skin?: number;
  children?: number[];
  matrix?: number[];
  translation?: number[];
  rotation?: number[];
  scale?: number[];
}
interface TextureSlot {
  index: number;
  texCoord?: number;
  extensions?: {
    KHR_texture_transform?: { offset?: number[]; scale?: number[]; rotation?: number; texCoord?: number };
  };
}
interface Material {
  pbrMetallicRoughness?: { baseColorFactor?: number[]; baseColorTexture?: TextureSlot };
  alphaMode?: string;
  alphaCutoff?: number;
  extensions?: {
    KHR_materials_pbrSpecularGlossiness?: { diffuseFactor?: number[]; diffuseTexture?: TextureSlot };
  };
}
interface BufferView {
  buffer: number;
  byteOffset?: number;
  byteLength: number;
  byteStride?: number;
  extensions?: { EXT_meshopt_compression?: Packed };
}
interface Document {
  accessors?: Accessor[];
  bufferViews?: BufferView[];
  buffers?: { uri?: string; byteLength: number }[];
  meshes?: {
    name?: string;
    primitives: Primitive[];
    weights?: number[];
    extras?: { targetNames?: string[]; firstShape?: number };
  }[];
  materials?: Material[];
  textures?: { source?: number; sampler?: number }[];
  images?: { uri?: string; bufferView?: number; mimeType?: string }[];
  samplers?: { wrapS?: number; wrapT?: number }[];
  nodes?: Node[];
  scenes?: { nodes?: number[] }[];
  scene?: number;
  extensions?: { KHR_materials_variants?: { variants?: { name: string }[] } };
  animations?: {
    channels: { sampler: number; target: { node?: number; path: string } }[];
    samplers: { input: number; output: number; interpolation?: string }[];
  }[];
}

export interface Part {
  position: Float32Array;
  index: Uint32Array;
  matrix: number[];
  primitive: Primitive;
  mesh: number;
}

const WIDTH: Record<string, number> = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4, MAT2: 4, MAT3: 9, MAT4: 16 };
const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

function multiply(a: number[], b: number[]): number[] {
  const out = new Array<number>(16).fill(0);
  for (let c = 0; c < 4; c++)
    for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
  return out;
}

function localMatrix(node: Node): number[] {
  if (node.matrix) return node.matrix;
  const [x, y, z, w] = node.rotation ?? [0, 0, 0, 1];
  const [sx, sy, sz] = node.scale ?? [1, 1, 1];
  const [tx, ty, tz] = node.translation ?? [0, 0, 0];
  // biome-ignore format: columns of the matrix
  return [
    (1 - 2 * (y * y + z * z)) * sx, 2 * (x * y + z * w) * sx, 2 * (x * z - y * w) * sx, 0,
    2 * (x * y - z * w) * sy, (1 - 2 * (x * x + z * z)) * sy, 2 * (y * z + x * w) * sy, 0,
    2 * (x * z + y * w) * sz, 2 * (y * z - x * w) * sz, (1 - 2 * (x * x + y * y)) * sz, 0,
    tx, ty, tz, 1,
  ];
}

export class Gltf {
  private readonly unpacked = new Map<number, Uint8Array>();

  constructor(
    readonly json: Document,
    readonly buffers: Uint8Array[],
  ) {}

  /** The bytes of a buffer view, without compression. */
  view(number: number): Uint8Array {
    const view = this.json.bufferViews![number];
    const packed = view.extensions?.EXT_meshopt_compression;
    const { buffer, byteOffset = 0, byteLength } = packed ?? view;
    const bytes = this.buffers[buffer].subarray(byteOffset, byteOffset + byteLength);
    if (!packed) return bytes;
    const known = this.unpacked.get(number) ?? unpackView(packed, bytes);
    this.unpacked.set(number, known);
    return known;
  }

  /** Adds an accessor with these bytes. Returns its number. */
  add(bytes: Uint8Array, accessor: Omit<Accessor, 'bufferView'>): number {
    const buffer = this.buffers.push(bytes) - 1;
    const bufferView = (this.json.bufferViews ??= []).push({ buffer, byteLength: bytes.length }) - 1;
    return (this.json.accessors ??= []).push({ ...accessor, bufferView }) - 1;
  }

  private component(view: DataView, at: number, type: number, normalized: boolean): number {
    switch (type) {
      case 5120:
        return normalized ? Math.max(view.getInt8(at) / 127, -1) : view.getInt8(at);
      case 5121:
        return normalized ? view.getUint8(at) / 255 : view.getUint8(at);
      case 5122:
        return normalized ? Math.max(view.getInt16(at, true) / 32767, -1) : view.getInt16(at, true);
      case 5123:
        return normalized ? view.getUint16(at, true) / 65535 : view.getUint16(at, true);
      case 5125:
        return view.getUint32(at, true);
      default:
        return view.getFloat32(at, true);
    }
  }

  private fill(
    out: Float32Array | Uint32Array,
    bufferView: number,
    offset: number,
    type: number,
    count: number,
    width: number,
    normalized: boolean,
  ) {
    const bytes = this.view(bufferView);
    const size = type === 5120 || type === 5121 ? 1 : type === 5122 || type === 5123 ? 2 : 4;
    const start = bytes.byteOffset + offset;
    const stride = this.json.bufferViews![bufferView].byteStride ?? size * width;
    if (stride === size * width && start % size === 0 && !normalized) {
      const View =
        { 5120: Int8Array, 5121: Uint8Array, 5122: Int16Array, 5123: Uint16Array, 5125: Uint32Array }[type] ??
        Float32Array;
      out.set(new View(bytes.buffer as ArrayBuffer, start, count * width));
      return;
    }
    const data = new DataView(bytes.buffer as ArrayBuffer, start);
    for (let i = 0; i < count; i++)
      for (let k = 0; k < width; k++)
        out[i * width + k] = this.component(data, i * stride + k * size, type, normalized);
  }

  private read<T extends Float32Array | Uint32Array>(number: number, make: (length: number) => T): T {
    const accessor = this.json.accessors![number];
    const width = WIDTH[accessor.type];
    const out = make(accessor.count * width);
    if (accessor.bufferView !== undefined)
      this.fill(
        out,
        accessor.bufferView,
        accessor.byteOffset ?? 0,
        accessor.componentType,
        accessor.count,
        width,
        !!accessor.normalized,
      );
    const { sparse } = accessor;
    if (sparse) {
      const where = new Uint32Array(sparse.count);
      const values = make(sparse.count * width);
      this.fill(
        where,
        sparse.indices.bufferView,
        sparse.indices.byteOffset ?? 0,
        sparse.indices.componentType,
        sparse.count,
        1,
        false,
      );
      this.fill(
        values,
        sparse.values.bufferView,
        sparse.values.byteOffset ?? 0,
        accessor.componentType,
        sparse.count,
        width,
        !!accessor.normalized,
      );
      for (let i = 0; i < sparse.count; i++)
        for (let k = 0; k < width; k++) out[where[i] * width + k] = values[i * width + k];
    }
    return out;
  }

  floats = (accessor: number) => this.read(accessor, (n) => new Float32Array(n));
  integers = (accessor: number) => this.read(accessor, (n) => new Uint32Array(n));

  /** An image of the file; empty if it is in another file. */
  image(number: number): Blob {
    const { uri, bufferView, mimeType: type } = this.json.images![number];
    if (uri !== undefined) return new Blob(uri.startsWith('data:') ? [dataUri(uri) as BlobPart] : [], { type });
    return new Blob([this.view(bufferView!) as BlobPart], { type });
  }

  /** For each mesh, the matrices of the nodes that show it. */
  private matrices(): Map<number, number[][]> {
    const { json } = this;
    const found = new Map<number, number[][]>();
    const nodes = json.nodes ?? [];
    const child = new Set(nodes.flatMap((node) => node.children ?? []));
    const roots = json.scenes?.[json.scene ?? 0]?.nodes ?? nodes.map((_, i) => i).filter((i) => !child.has(i));
    const stack = roots.map((node) => ({ node, matrix: IDENTITY, depth: 0 })).reverse(); // the first one is on top
    while (stack.length) {
      const { node, matrix, depth } = stack.pop()!;
      if (!nodes[node] || depth > 64) continue;
      const world = multiply(matrix, localMatrix(nodes[node]));
      const { mesh } = nodes[node];
      if (mesh !== undefined) found.set(mesh, [...(found.get(mesh) ?? []), world]);
      const below = [...(nodes[node].children ?? [])].reverse();
      for (const next of below) stack.push({ node: next, matrix: world, depth: depth + 1 });
    }
    return found;
  }

  /** Triangle primitives wherever the scene shows them. */
  shown(parts: Part[]): Part[] {
    const matrices = this.matrices();
    return parts.flatMap((part) => (matrices.get(part.mesh) ?? []).map((matrix) => ({ ...part, matrix })));
  }

  /** All triangle primitives, meshes in file order, where the first node has them. */
  triangles(): Part[] {
    const matrices = this.matrices();
    const parts: Part[] = [];
    (this.json.meshes ?? []).forEach((mesh, number) => {
      for (const primitive of mesh.primitives) {
        const mode = primitive.mode ?? 4;
        if (mode < 4 || mode > 6 || primitive.attributes.POSITION === undefined) continue;
        const position = this.floats(primitive.attributes.POSITION);
        let index: Uint32Array;
        if (primitive.indices !== undefined) index = this.integers(primitive.indices);
        else index = Uint32Array.from({ length: position.length / 3 }, (_, i) => i);
        if (mode > 4) index = apart(index, mode === 6);
        parts.push({ position, index, matrix: matrices.get(number)?.[0] ?? IDENTITY, primitive, mesh: number });
      }
    });
    return parts;
  }
}

/** The triangles of a strip or a fan. Those that repeat a vertex only change the direction of a strip. */
function apart(list: Uint32Array, fan: boolean): Uint32Array {
  const out: number[] = [];
  for (let i = 0; i + 2 < list.length; i++) {
    const [a, b, c] = fan
      ? [list[i + 1], list[i + 2], list[0]]
      : [list[i], list[i + 1 + (i % 2)], list[i + 2 - (i % 2)]];
    if (a !== b && b !== c && c !== a) out.push(a, b, c);
  }
  return Uint32Array.from(out);
}

function dataUri(uri: string): Uint8Array {
  const text = uri.match(/^data:[^,]*;base64,(.*)$/s);
  if (!text) throw new Error('The file refers to another file, which is not included. Save it as GLB.');
  return Uint8Array.from(atob(text[1]), (c) => c.charCodeAt(0));
}

export function readGlb(buffer: ArrayBuffer): Gltf {
  const view = new DataView(buffer);
  let json: Document;
  let binary: Uint8Array | null = null;
  if (view.byteLength > 20 && view.getUint32(0, true) === 0x46546c67) {
    const length = view.getUint32(12, true);
    json = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 20, length)));
    const at = 20 + length;
    if (at + 8 <= view.byteLength)
      binary = new Uint8Array(buffer, at + 8, Math.min(view.getUint32(at, true), view.byteLength - at - 8));
  } else json = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer)));
  const buffers = (json.buffers ?? []).map((b) =>
    b.uri === undefined ? (binary ?? new Uint8Array()) : dataUri(b.uri),
  );
  return new Gltf(json, buffers);
}
