/** What a file may have besides its surface, by the names of the daemon. */
import type { Gltf, Part } from './gltf';

export const EXTRAS = ['skin', 'color', 'texcoord', 'targets', 'texture'] as const;
export type Extra = (typeof EXTRAS)[number];

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
