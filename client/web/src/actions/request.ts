/** Takes the options and landmarks of a morph's request, so that “Morph again” makes the same morph. */
import type { Supermesh } from 'orbmorph';
import { landmarkName, patch, readyShapes, set, state, type Options } from '../state';
import { clearLandmarks, takeLandmarks } from './landmarks';

type Request = NonNullable<Supermesh['request']>;

/** What the daemon assumes of the members for which the page has no fields. */
const ASSUMED = {
  align: { preset: 'default', steps: 10, one_way: false, radius: 0 },
  asset: { normals: true, animation: 'pingpong', path_steps: 3, colors: false },
};

/** The named members of `given` whose values differ from the assumed ones. */
const besides = <T extends object>(given: T, assumed: { [K in keyof T]?: unknown }): Partial<T> =>
  Object.fromEntries(
    Object.entries(given).filter(([key, value]) => key in assumed && value !== assumed[key as keyof T]),
  ) as Partial<T>;

const isEmpty = (object: object) => !Object.keys(object).length;

/** What the page has no fields for. Not the preset “fast”: the page says that “Morph again” makes the default morph. */
function moreOf({ embedding, align, asset }: Request): Options['more'] {
  const { preset, ...rest } = besides(align.options, ASSUMED.align);
  const options = { ...rest, ...(preset && preset !== 'fast' && { preset }) };
  const written = besides(asset, ASSUMED.asset);
  return {
    ...((embedding.method !== 'newton' || !isEmpty(embedding.options)) && { embedding }),
    ...(!isEmpty(options) && { align: { options } }),
    ...(!isEmpty(written) && { asset: written }),
  };
}

function optionsOf(request: Request): Options {
  const { align, remesh, asset, landmarks, transfer = [] } = request;
  const usual = landmarks === 'auto' ? 'auto' : 'pin';
  const isStandIn = align.options.preset === 'fast' && remesh.method === 'convex-hull'; // of a fast morph of this page
  return {
    ...state.options,
    align: align.method === usual ? 'default' : align.method,
    remesh: isStandIn ? 'adaptive' : remesh.method,
    tolerance: remesh.tolerance,
    maxTriangles: remesh.max_triangles || null,
    path: asset.path,
    fit: asset.fit,
    holes: asset.holes,
    texels: transfer.find(({ resolution }) => resolution)?.resolution ?? null,
    more: moreOf(request),
  };
}

/** A morph may call its shapes otherwise than the server. */
export const takeNames = ({ shapes }: Supermesh) =>
  readyShapes().forEach((shape, i) => patch(shape, { name: shapes[i].name }));

/**
 * Sets the page to the request of a morph of its shapes. `undoable`: the landmarks that the page has now can be brought
 * back. An older engine stored no requests; then only the names change.
 */
export async function takeRequest(supermesh: Supermesh, { undoable }: { undoable: boolean }) {
  const { request } = supermesh;
  takeNames(supermesh);
  if (!request) return;
  set({ options: optionsOf(request) });
  readyShapes().forEach((shape, i) => {
    const { meshes = [], nodes = [] } = (i === 0 && request.template) || {};
    const taken = (request.transfer ?? []).filter(({ from }) => from === i).map(({ what }) => what);
    patch(shape, { taken, surface: { meshes, nodes } });
  });
  if (Array.isArray(request.landmarks) && request.landmarks.length) {
    const marks = request.landmarks.map((mark, i) => ({
      ...mark,
      name: landmarkName(mark.name, i) === mark.name ? mark.name : '',
    }));
    await takeLandmarks(marks, { undoable });
  } else if (state.landmarks.length && state.landmarks !== state.listed) clearLandmarks();
}
