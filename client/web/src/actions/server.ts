/** Lists, opens and deletes what the server stores. */
import { ProblemError, type Mesh, type Supermesh } from 'orbmorph';
import { client, set, state, toast } from '../state';
import { addFromServer, removeShape } from './shapes';
import { isOfPage, openResult, resumeJob } from './merge';
import { takeRequest } from './request';
import { player } from '../player';
import { explain } from './token';

export async function loadServer() {
  set({ server: { meshes: [], supermeshes: [], jobs: [], message: null, ...state.server, loading: true } });
  try {
    const [meshes, supermeshes, jobs] = await Promise.all([
      client.page('meshes', { limit: 100 }),
      client.page('supermeshes', { limit: 100 }),
      client.page('jobs', { limit: 50 }),
    ]);
    set({
      server: { meshes: meshes.items, supermeshes: supermeshes.items, jobs: jobs.items, message: null, loading: false },
    });
  } catch (error) {
    set({ server: { meshes: [], supermeshes: [], jobs: [], message: explain(error), loading: false } });
  }
}

export async function addMesh(mesh: Mesh) {
  set({ drawer: null, tab: 'shapes' });
  await addFromServer(mesh);
}

/** Opens a morph together with its shapes. */
export async function openSupermesh(id: string, play = true) {
  set({ drawer: null });
  try {
    const supermesh = await client.getSupermesh(id);
    const areShown = isOfPage(supermesh);
    if (!areShown && !(await openShapes(supermesh))) return;
    await takeRequest(supermesh, { undoable: areShown });
    await openResult(supermesh, supermesh.request ?? null);
    set({ tab: 'morph', show: 'morph' });
    if (play) player.play();
  } catch (error) {
    toast(explain(error), 'error');
  }
}

/** Opens the shapes of a morph in place of those of the page; says so and returns false if the server lacks one. */
async function openShapes(supermesh: Supermesh): Promise<boolean> {
  const meshes = await Promise.all(
    supermesh.shapes.map(({ mesh }) =>
      client.getMesh(mesh).catch((error) => {
        if (error instanceof ProblemError && error.status === 404) return null;
        throw error;
      }),
    ),
  );
  const gone = new Set(supermesh.shapes.flatMap(({ name }, i) => (meshes[i] ? [] : [name])));
  if (gone.size) {
    const detail = `${[...gone].join(', ')} ${gone.size > 1 ? 'are' : 'is'} no longer on the server. Add the files, and morph them again.`;
    set({ problem: { title: 'Shapes of this morph are missing', detail, facts: null } });
    return false;
  }
  for (const shape of [...state.shapes]) removeShape(shape.key);
  for (const mesh of meshes) await addFromServer(mesh!);
  return true;
}

export async function watchJob(id: string) {
  set({ drawer: null });
  await resumeJob(id);
}

export async function cancelJob(id: string) {
  await client.cancelJob(id).catch((error) => toast(explain(error), 'error'));
  await loadServer();
}

export async function remove(kind: 'mesh' | 'supermesh', item: Mesh | Supermesh) {
  try {
    await (kind === 'mesh' ? client.deleteMesh(item.id) : client.deleteSupermesh(item.id));
  } catch (error) {
    toast(explain(error), 'error');
  }
  await loadServer();
}
