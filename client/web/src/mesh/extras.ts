/** What a file may have besides its surface, by the names of the daemon. */
import type { Gltf, Part } from './gltf';

export const EXTRAS = ['skin', 'color', 'texcoord', 'targets', 'texture'] as const;
export type Extra = (typeof EXTRAS)[number];

/** What the meshes of a document are called, and the nodes that show any: by these a request names a surface. */
export interface Content {
  meshes: { number: number; name: string }[];
  nodes: string[];
}

export function contentOf({ json }: Gltf): Content {
  const nodes = json.nodes ?? [];
  const showing = new Set<number>();
  const parent = new Map(nodes.flatMap(({ children = [] }, i) => children.map((child) => [child, i] as const)));
  for (const [i, { mesh }] of nodes.entries())
    for (let at: number | undefined = mesh === undefined ? undefined : i; at !== undefined && !showing.has(at); ) {
      showing.add(at);
      at = parent.get(at);
    }
  const names = [...showing].sort((a, b) => a - b).flatMap((i) => nodes[i]?.name || []);
  return {
    meshes: (json.meshes ?? []).map(({ name = '' }, number) => ({ number, name })),
    nodes: [...new Set(names)],
  };
}

/** What a new mesh lacks of its first shape unless it is taken: the first sets of colours and coordinates it has. */
export function beyondIn(gltf: Gltf, parts: Part[]): Extra[] {
  const has = (name: string) => parts.some(({ primitive }) => primitive.attributes[name] !== undefined);
  const more: Partial<Record<Extra, string>> = { color: 'COLOR_1', texcoord: 'TEXCOORD_1' };
  return extrasIn(gltf, parts).filter((what) => what !== 'texture' && (!more[what] || has(more[what])));
}

/** What the primitives of a document have besides positions. */
export function extrasIn({ json }: Gltf, parts: Part[]): Extra[] {
  const skinned = new Set((json.nodes ?? []).flatMap(({ mesh, skin }) => (skin === undefined ? [] : [mesh])));
  const has: Record<Extra, (part: Part) => boolean> = {
    skin: ({ primitive, mesh }) => primitive.attributes.JOINTS_0 !== undefined && skinned.has(mesh),
    color: ({ primitive }) => primitive.attributes.COLOR_0 !== undefined,
    texcoord: ({ primitive }) => primitive.attributes.TEXCOORD_0 !== undefined,
    targets: ({ primitive }) => !!primitive.targets?.length,
    texture: ({ primitive: { material = -1 } }) =>
      json.materials?.[material]?.pbrMetallicRoughness?.baseColorTexture !== undefined,
  };
  return EXTRAS.filter((what) => parts.some(has[what]));
}
