/** What a refusal of a mesh says on the page, and the repairs that its buttons make. */
import type { Problem } from 'orbmorph';
import { count, counted } from '../words';

export interface Offer {
  repair: string;
  label: string;
}

export const CLOSE = 'close_handles';
const SPLIT = 'split_nonmanifold';
/** The daemon's own limit of a handle that it closes, and the largest limit that it takes: relative to the diagonal. */
export const SMALL = 0.05;
export const LARGEST = 10;

const kindOf = ({ type }: Problem) => type.split('/').pop();

export const numbers = (value: unknown): number[] =>
  Array.isArray(value) ? value.flat(2).filter((x) => typeof x === 'number') : [];

/** The size that allows loops of these lengths; 0 if there are none. */
export const sizeFor = (lengths: number[]) => {
  const longest = Math.max(0, ...lengths);
  return longest > SMALL ? Number((1.01 * longest).toPrecision(3)) : longest && SMALL;
};

/** How many pieces the mesh has, and how many of them the refusal lists: the largest. */
export function piecesOf({ component_count, parts }: Problem): { total: number; listed: number } {
  const listed = Array.isArray(parts) ? parts.length : 0;
  return { total: Math.max(Number(component_count) || 0, listed), listed };
}

/** The pieces after the largest; those of one name by that of their node, or by their numbers. */
function otherParts(parts: unknown): Offer[] {
  if (!Array.isArray(parts)) return [];
  const owned = (key: 'name' | 'node', value?: string) =>
    value && parts.filter((part) => part[key] === value).length === 1 ? value : undefined;
  return parts.slice(1).map(({ part, triangles, name, node }) => {
    const own = owned('name', name) ?? owned('node', node);
    const title = own ? `“${own}”` : [name && `“${name}”`, `piece ${part}`].filter(Boolean).join(', ');
    return { repair: `safe,part:${part}`, label: `Keep ${title} (${count(triangles)} triangles)` };
  });
}

/** One button closes all handles, including those whose loops are not on show. */
function handleRepairs(lengths: number[], genus: number): Offer[] {
  const size = sizeFor(lengths);
  if (size === 0 || size > LARGEST) return [];
  const label = genus === 1 ? 'Close the handle' : `Close all ${count(genus)} handles`;
  if (size === SMALL) return [{ repair: `safe,${CLOSE}`, label }];
  return [{ repair: `safe,${CLOSE}:${size}`, label: `${label} along the red loop${genus === 1 ? '' : 's'}` }];
}

/** The repairs that the page offers for a refusal. `tried`: those that the mesh was uploaded with. */
export function repairsFor(problem: Problem, tried = ''): Offer[] {
  const kind = kindOf(problem);
  const others = otherParts(problem.parts);
  const pieces = [{ repair: 'safe,largest_component', label: 'Keep the largest piece' }, ...others];
  if (kind === 'not-closed')
    return [{ repair: 'safe,fill_holes', label: 'Fill the holes' }, ...(others.length ? pieces : [])];
  if (kind === 'not-connected' || (kind === 'not-manifold' && problem.components)) return pieces;
  if (kind === 'not-manifold' && !tried.includes(SPLIT)) return [{ repair: `safe,${SPLIT}`, label: 'Split it there' }];
  if (kind === 'not-genus-zero') return handleRepairs(numbers(problem.loop_lengths_relative), Number(problem.genus));
  return [];
}

/**
 * Why the mesh was refused and what the buttons do about it. The daemon's own sentence names members of requests, which
 * the page does not show; it is used where the page has no button, and so nothing to explain.
 */
export function sentenceFor(problem: Problem, offers: Offer[]): string {
  const kind = kindOf(problem);
  const { total } = piecesOf(problem);
  const edges = Number(problem.edge_count ?? 0);
  const joints = Number(problem.vertex_count ?? 0);
  if (!offers.length) return problem.detail;
  if (kind === 'not-closed') {
    const holes = Number(problem.boundary_loops ?? 0);
    const said = `The surface is not closed: it has ${counted(holes, 'hole')}. “Fill the holes” covers ${holes === 1 ? 'it with a patch' : 'each with a patch'}.`;
    return total > 1
      ? `${said} A morph takes one of the ${count(total)} pieces, and one without holes needs no filling: the server says below whether there is one.`
      : said;
  }
  if (kind === 'not-connected')
    return `The mesh has ${counted(total, 'piece')} that do not touch. A morph takes one of them: keep the one that you want.`;
  if (kind === 'not-manifold' && problem.components)
    return `${count(total)} pieces touch only at ${counted(joints, 'vertex', 'vertices')}. A morph takes one of them: keep the one that you want.`;
  if (kind === 'not-manifold')
    return edges
      ? `${counted(edges, 'edge belongs', 'edges belong')} to more than two faces. “Split it there” parts the surface at ${edges === 1 ? 'it' : 'them'}.`
      : `Faces touch only at ${counted(joints, 'vertex', 'vertices')}. “Split it there” parts them.`;
  const genus = Number(problem.genus ?? 0);
  return `The surface has ${counted(genus, 'handle')}, like a ring or the ear of a cup. A morph needs a surface without: close ${genus === 1 ? 'it' : 'them'} here, or fill or cut ${genus === 1 ? 'it' : 'them'} in the program that made the mesh.`;
}
