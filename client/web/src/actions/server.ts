/** Lists, opens and deletes what the server stores. */
import type { Mesh, Supermesh } from 'orbmorph';
import { client, set, state, toast } from '../state';
import { addFromServer, removeShape } from './shapes';
import { openResult, resumeJob } from './merge';
import { takeLandmarks } from './landmarks';
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
    await openShapes(supermesh);
    await openResult(supermesh, supermesh.request ?? null);
    set({ tab: 'morph', show: 'morph' });
    if (play) player.play();
  } catch (error) {
    toast(explain(error), 'error');
  }
}

async function openShapes(supermesh: Supermesh) {
  const wanted = supermesh.shapes.map((shape) => shape.mesh);
  const present = state.shapes.map((shape) => shape.mesh?.id);
  if (wanted.length === present.length && wanted.every((id, i) => id === present[i])) return;
  for (const shape of [...state.shapes]) removeShape(shape.key);
  for (const id of wanted) await addFromServer(await client.getMesh(id));
  const given = supermesh.request?.landmarks;
  const placed = Array.isArray(given) ? given : [];
  if (placed.length) await takeLandmarks(placed, { undoable: false });
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
