/**
 * What covers a surface: colours of vertices, and the base colour and texture of each material, by the rules of the
 * downloaded page (take/player.js).
 */
import type { Gltf, Part } from './gltf';

export interface Cover {
  /** linear light */
  base: [number, number, number];
  /** the number of its image; -1 without texture */
  image: number;
  /** how the texture repeats, as in glTF's samplers */
  wrap: [number, number];
  /** alpha below which nothing is drawn */
  cutoff: number;
}

/** The cover of the vertices of a file, with images as they are in the file. */
export interface Dress {
  /** two numbers for each vertex */
  uv: Float32Array;
  /** linear red, green and blue of each vertex */
  dye: Float32Array | null;
  /** the cover of each vertex */
  cover: Uint16Array;
  covers: Cover[];
  images: Blob[];
}

/** The cover of drawn vertices. `runs`: the corners from `start` have a cover. */
export interface Skin {
  uv: Float32Array;
  dye: Float32Array | null;
  covers: Cover[];
  runs: { start: number; count: number; cover: number }[];
  /** images that are still to be decoded */
  files: Blob[];
  /** null where the browser cannot decode an image */
  images: (ImageBitmap | null)[];
}

const LARGEST = 2048; // pixels of a texture's side
export const PLAIN: Cover = { base: [1, 1, 1], image: -1, wrap: [10497, 10497], cutoff: 0 };

/** The cover of glTF primitives; null where all is grey, as in assets without material: the shape's tint. */
export function dressOf(gltf: Gltf, parts: Part[]): Dress | null {
  const total = parts.reduce((n, part) => n + part.position.length / 3, 0);
  const dress: Dress = {
    uv: new Float32Array(2 * total),
    dye: null,
    cover: new Uint16Array(total),
    covers: [],
    images: [],
  };
  const imageNumbers = new Map<number, number>();
  const coverNumbers = new Map<string, number>();
  let first = 0;
  for (const part of parts) {
    const count = part.position.length / 3;
    const { attributes, material = -1 } = part.primitive;
    const { cover, uv } = coverOf(gltf, material, attributes, dress.images, imageNumbers);
    if (uv) dress.uv.set(uv.subarray(0, 2 * count), 2 * first);
    if (attributes.COLOR_0 !== undefined) {
      dress.dye ??= new Float32Array(3 * total).fill(1);
      const colors = gltf.floats(attributes.COLOR_0);
      const width = gltf.json.accessors![attributes.COLOR_0].type === 'VEC4' ? 4 : 3;
      for (let i = 0; i < count; i++)
        for (let k = 0; k < 3; k++) dress.dye[3 * (first + i) + k] = colors[width * i + k];
    }
    const key = JSON.stringify(cover);
    const number = coverNumbers.get(key) ?? dress.covers.push(cover) - 1;
    coverNumbers.set(key, number);
    dress.cover.fill(number, first, first + count);
    first += count;
  }
  const plain = dress.covers.every(({ base, image }) => image < 0 && Math.max(...base) - Math.min(...base) < 0.01);
  return plain && !dress.dye ? null : dress;
}

function coverOf(
  gltf: Gltf,
  number: number,
  attributes: Record<string, number>,
  images: Blob[],
  imageNumbers: Map<number, number>,
): { cover: Cover; uv: Float32Array | null } {
  const material = gltf.json.materials?.[number];
  if (!material) return { cover: PLAIN, uv: null };
  const surface = material.pbrMetallicRoughness ?? {};
  const older = material.extensions?.KHR_materials_pbrSpecularGlossiness;
  const [r, g, b] = older?.diffuseFactor ?? surface.baseColorFactor ?? [1, 1, 1];
  const cutoff = material.alphaMode === 'MASK' ? (material.alphaCutoff ?? 0.5) : 0;
  const cover: Cover = { ...PLAIN, base: [r, g, b], cutoff };
  const slot = older ? older.diffuseTexture : surface.baseColorTexture;
  const transform = slot?.extensions?.KHR_texture_transform ?? {};
  const coordinates = attributes[`TEXCOORD_${transform.texCoord ?? slot?.texCoord ?? 0}`];
  const texture = slot && gltf.json.textures?.[slot.index];
  if (texture?.source === undefined || coordinates === undefined) return { cover, uv: null };
  const known = imageNumbers.get(texture.source);
  cover.image = known ?? images.push(gltf.image(texture.source)) - 1;
  imageNumbers.set(texture.source, cover.image);
  const sampler = gltf.json.samplers?.[texture.sampler ?? -1];
  cover.wrap = [sampler?.wrapS ?? 10497, sampler?.wrapT ?? 10497];
  const uv = gltf.floats(coordinates);
  const [sx, sy] = transform.scale ?? [1, 1];
  const [ox, oy] = transform.offset ?? [0, 0];
  const [s, c] = [Math.sin(transform.rotation ?? 0), Math.cos(transform.rotation ?? 0)];
  for (let i = 0; i < uv.length; i += 2) {
    const [u, v] = [uv[i] * sx, uv[i + 1] * sy];
    uv[i] = c * u + s * v + ox;
    uv[i + 1] = c * v - s * u + oy;
  }
  return { cover, uv };
}

const CHANNELS = ['red', 'green', 'blue'];
/** The largest value of a colour, by its type. */
const WHOLE: Record<string, number> = { uchar: 255, uint8: 255, ushort: 65535, uint16: 65535 };

/**
 * The colours of PLY vertices, which are sRGB, as the daemon reads them: of other types than those above, values beyond 1
 * are taken for bytes.
 */
export function plyDress(properties: Map<string, Float64Array>, types: Map<string, string>): Dress | null {
  const names = properties.has('red') ? CHANNELS : CHANNELS.map((name) => `diffuse_${name}`);
  const channels = names.map((name) => properties.get(name));
  if (channels.some((channel) => !channel)) return null;
  const large = channels.some((channel) => channel!.some((x) => x > 1));
  const scale = names.map((name) => WHOLE[types.get(name) ?? ''] ?? (large ? 255 : 1));
  const count = channels[0]!.length;
  const dye = new Float32Array(3 * count);
  for (let i = 0; i < count; i++)
    for (let k = 0; k < 3; k++) {
      const x = channels[k]![i] / scale[k];
      dye[3 * i + k] = x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4;
    }
  return { uv: new Float32Array(2 * count), dye, cover: new Uint16Array(count), covers: [PLAIN], images: [] };
}

/** Whether two vertices at one position look the same, so that one drawn vertex serves both. */
export function alike({ uv, dye, cover }: Dress, a: number, b: number): boolean {
  if (a === b) return true;
  if (cover[a] !== cover[b] || uv[2 * a] !== uv[2 * b] || uv[2 * a + 1] !== uv[2 * b + 1]) return false;
  return !dye || [0, 1, 2].every((k) => dye[3 * a + k] === dye[3 * b + k]);
}

/** What alike() compares, as text. */
const lookOf = ({ uv, dye, cover }: Dress, v: number): string =>
  [cover[v], uv[2 * v], uv[2 * v + 1], ...(dye?.subarray(3 * v, 3 * v + 3) ?? [])].join(' ');

/**
 * Splits drawn vertices where corners that share one look different. `index` is changed; `from` returns the drawn vertex
 * that each one copies, and `skin` what covers them.
 */
export function splitByLook(dress: Dress, corners: Uint32Array, index: Uint32Array, count: number) {
  const from: number[] = Array.from({ length: count }, (_, i) => i);
  const vertex: number[] = new Array<number>(count).fill(-1);
  /** the copies of drawn vertices, by vertex and look: a vertex may have as many looks as it has triangles */
  const copies = new Map<string, number>();
  /** the copy that a vertex of the file was last drawn by */
  const latest = new Int32Array(dress.cover.length).fill(-1);
  for (let c = 0; c < corners.length; c++) {
    const [at, v] = [index[c], corners[c]];
    if (vertex[at] < 0) vertex[at] = v;
    if (alike(dress, vertex[at], v)) continue;
    if (latest[v] < 0 || from[latest[v]] !== at) {
      const look = `${at} ${lookOf(dress, v)}`;
      let copy = copies.get(look);
      if (copy === undefined) {
        copy = from.push(at) - 1;
        vertex.push(v);
        copies.set(look, copy);
      }
      latest[v] = copy;
    }
    index[c] = latest[v];
  }
  const uv = new Float32Array(2 * from.length);
  const dye = dress.dye && new Float32Array(3 * from.length);
  vertex.forEach((v, i) => {
    if (v < 0) return;
    uv.set(dress.uv.subarray(2 * v, 2 * v + 2), 2 * i);
    dye?.set(dress.dye!.subarray(3 * v, 3 * v + 3), 3 * i);
  });
  const skin: Skin = { uv, dye, covers: dress.covers, runs: runsOf(dress, corners), files: dress.images, images: [] };
  return { from, skin };
}

/** Runs of triangles of one cover. */
function runsOf({ cover }: Dress, corners: Uint32Array): Skin['runs'] {
  const runs: Skin['runs'] = [];
  for (let c = 0; c < corners.length; c += 3) {
    const last = runs.at(-1);
    if (last?.cover === cover[corners[c]]) last.count += 3;
    else runs.push({ start: c, count: 3, cover: cover[corners[c]] });
  }
  return runs;
}

/** The skin of drawn vertices that are those of the file. */
export const skinOf = (dress: Dress, corners: Uint32Array): Skin => ({
  uv: dress.uv,
  dye: dress.dye,
  covers: dress.covers,
  runs: runsOf(dress, corners),
  files: dress.images,
  images: [],
});

/** Decodes the images of a skin. Large ones are scaled down. */
export async function decodeImages(skin: Skin | undefined) {
  if (!skin) return;
  skin.images = await Promise.all(
    skin.files.map(async (blob) => {
      try {
        const image = await createImageBitmap(blob, { colorSpaceConversion: 'none', premultiplyAlpha: 'none' });
        const scale = LARGEST / Math.max(image.width, image.height);
        if (scale >= 1) return image;
        try {
          return await createImageBitmap(image, {
            resizeWidth: Math.max(1, Math.round(image.width * scale)),
            resizeHeight: Math.max(1, Math.round(image.height * scale)),
          });
        } finally {
          image.close();
        }
      } catch {
        return null;
      }
    }),
  );
  skin.files = [];
}

/** Frees the decoded images of a skin that is no longer drawn. */
export function closeImages(skin: Skin | null | undefined) {
  for (const image of skin?.images ?? []) image?.close();
}

/** A file whose materials are damaged is shown without them. */
export function tried(get: () => Dress | null): Dress | null {
  try {
    return get();
  } catch {
    return null;
  }
}
