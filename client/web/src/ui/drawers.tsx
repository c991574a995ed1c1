/** Drawers on the right: the server's content, ways to use a morph, help. */
import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';
import type { Job, Problem } from 'orbmorph';
import { client, set, state } from '../state';
import { addMesh, cancelJob, loadServer, openSupermesh, remove, watchJob } from '../actions/server';
import { buildRequest } from '../actions/merge';
import { escaped } from '../take/page';
import { count } from '../words';
import { Bar, Button } from './parts';
import { fileName, TakeAway } from './take';

const TITLES = { server: 'On the server', share: 'Use this morph', help: 'Help' };

export function Drawer() {
  const dialog = useRef<HTMLDialogElement>(null);
  const kind = state.drawer!;
  // not after the next frame: a Tab in between would move the focus to which the dialog returns it
  useLayoutEffect(() => {
    dialog.current!.showModal();
  }, []);
  return (
    // biome-ignore lint/a11y/useKeyWithClickEvents: the click is on the backdrop; Escape closes a dialog by itself
    <dialog
      ref={dialog}
      class="drawer"
      aria-label={TITLES[kind]}
      onClose={() => set({ drawer: null })}
      onClick={(event) => event.target === dialog.current && dialog.current!.close()}
    >
      <div class="drawer-in">
        <div class="row spread">
          <h2>{TITLES[kind]}</h2>
          <Button kind="quiet" icon="close" label="Close" onClick={() => dialog.current!.close()} />
        </div>
        {kind === 'server' && <Server />}
        {kind === 'share' && <Share />}
        {kind === 'help' && <Help />}
      </div>
    </dialog>
  );
}

function when(text: string | undefined): string {
  if (!text) return '';
  const seconds = (Date.now() - Date.parse(text)) / 1000;
  if (!Number.isFinite(seconds)) return '';
  if (seconds < 60) return 'just now';
  if (seconds < 3600) return `${Math.round(seconds / 60)} min ago`;
  if (seconds < 86400) return `${Math.round(seconds / 3600)} h ago`;
  return new Date(text).toLocaleDateString();
}

function Server() {
  useEffect(() => {
    void loadServer();
    const timer = setInterval(
      () => state.server?.jobs.some((job) => job.state === 'running' || job.state === 'queued') && void loadServer(),
      2000,
    );
    return () => clearInterval(timer);
  }, []);
  const list = state.server;
  if (!list) return <p class="hint">Loading…</p>;
  if (list.message)
    return (
      <p class="red" role="alert">
        {list.message}
      </p>
    );
  const jobs = list.jobs.filter((job) => job.state !== 'succeeded');
  return (
    <>
      <h3>Morphs</h3>
      {!list.supermeshes.length && <p class="hint">None yet.</p>}
      <ul class="list">
        {list.supermeshes.map((item) => {
          const name = item.shapes?.map((s) => s.name).join(' → ') || item.id.slice(0, 8);
          return (
            <li key={item.id}>
              <button type="button" class="item" onClick={() => void openSupermesh(item.id)}>
                <strong>{name}</strong>
                <span class="muted">
                  {item.triangles !== undefined && `${count(item.triangles)} triangles · `}
                  {when(item.created)}
                </span>
              </button>
              <Delete what={`the morph ${name}`} onDelete={() => remove('supermesh', item)} />
            </li>
          );
        })}
      </ul>
      <h3>Shapes</h3>
      {!list.meshes.length && <p class="hint">None yet.</p>}
      <ul class="list">
        {list.meshes.map((mesh) => (
          <li key={mesh.id}>
            <button type="button" class="item" onClick={() => void addMesh(mesh)} aria-label={`Add ${mesh.name}`}>
              <strong>{mesh.name}</strong>
              <span class="muted">
                {count(mesh.triangles)} triangles · {when(mesh.created)}
              </span>
            </button>
            <Delete what={`the shape ${mesh.name}`} onDelete={() => remove('mesh', mesh)} />
          </li>
        ))}
      </ul>
      {jobs.length > 0 && <h3>Jobs</h3>}
      <ul class="list">
        {jobs.map((job) => (
          <JobRow key={job.id} job={job} />
        ))}
      </ul>
    </>
  );
}

/** Deletes something of the server, once the user confirms it: nothing brings it back. */
function Delete({ what, onDelete }: { what: string; onDelete: () => Promise<void> }) {
  const [asks, setAsks] = useState(false);
  if (!asks) return <Button kind="quiet" icon="trash" label={`Delete ${what}`} onClick={() => setAsks(true)} />;
  return (
    <div class="row sure" role="group" aria-label={`Delete ${what}?`}>
      <Button kind="danger" aria-label={`Delete ${what} for good`} onClick={() => void onDelete()}>
        Delete
      </Button>
      <Button kind="quiet" aria-label={`Keep ${what}`} data-takes-focus onClick={() => setAsks(false)}>
        Keep
      </Button>
    </div>
  );
}

/** Why a job failed. The detail counts landmarks and shapes from 0, and nothing here shows which these are. */
const said = ({ title, detail, ...facts }: Problem) => ('landmarks' in facts ? title : detail);

function JobRow({ job }: { job: Job }) {
  const live = job.state === 'running' || job.state === 'queued';
  return (
    <li>
      <div class="item">
        <strong>{job.kind === 'supermesh' ? 'Morph' : 'Map to the sphere'}</strong>
        <span class="muted">
          {job.state}
          {job.problem ? `: ${said(job.problem)}` : ''} · {when(job.created)}
        </span>
        {live && <Bar label="Progress" value={job.progress ?? null} />}
      </div>
      {live && job.kind === 'supermesh' && (
        <Button kind="quiet" onClick={() => void watchJob(job.id)}>
          Follow
        </Button>
      )}
      {live && <Button kind="quiet" icon="close" label="Cancel this job" onClick={() => void cancelJob(job.id)} />}
    </li>
  );
}

function Snippet({ title, text }: { title: string; text: string }) {
  const [copied, setCopied] = useState(false);
  const copy = async () => {
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      const range = document.createRange();
      range.selectNodeContents(document.getElementById(`snippet-${title}`)!);
      getSelection()!.removeAllRanges();
      getSelection()!.addRange(range);
      document.execCommand('copy');
    }
    setCopied(true);
    setTimeout(() => setCopied(false), 1600);
  };
  return (
    <section class="snippet" aria-label={title}>
      <div class="row spread">
        <h3>{title}</h3>
        <Button kind="quiet" icon={copied ? 'check' : 'copy'} onClick={() => void copy()}>
          {copied ? 'Copied' : 'Copy'}
        </Button>
      </div>
      <pre id={`snippet-${title}`} tabIndex={0} role="region" aria-label={`${title}: code`}>
        {text}
      </pre>
    </section>
  );
}

/** Quotes text for a POSIX shell. */
const quoted = (text: string) => `'${text.replace(/'/g, "'\\''")}'`;

const viewerPage = (asset: string, names: string[]) => `<!doctype html>
<meta charset="utf-8">
<title>${escaped(names.join(' to '))}</title>
<style>html, body { margin: 0; height: 100% } model-viewer { width: 100%; height: 100% }</style>
<script type="module" src="https://cdn.jsdelivr.net/npm/@google/model-viewer@4.4.0/dist/model-viewer.min.js"></script>
<model-viewer src="${asset}" alt="${escaped(names.join(' to '))}" autoplay camera-controls></model-viewer>
`;

/** The page plays the asset's animation, which passes through all shapes. */
const threePage = (asset: string, names: string[]) => `<!doctype html>
<meta charset="utf-8">
<title>${escaped(names.join(' to '))}</title>
<style>html, body { margin: 0; height: 100%; overflow: hidden }</style>
<script type="importmap">
{ "imports": { "three": "https://cdn.jsdelivr.net/npm/three@0.180.0/build/three.module.js",
               "three/addons/": "https://cdn.jsdelivr.net/npm/three@0.180.0/examples/jsm/" } }
</script>
<script type="module">
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

const renderer = new THREE.WebGLRenderer({ antialias: true });
renderer.setSize(innerWidth, innerHeight);
document.body.append(renderer.domElement);
const scene = new THREE.Scene();
scene.background = new THREE.Color(0xf3f1ec);
scene.add(new THREE.HemisphereLight(0xffffff, 0x556070, 3));

const gltf = await new GLTFLoader().loadAsync('${asset}');
scene.add(gltf.scene);
const ball = new THREE.Box3().setFromObject(gltf.scene).getBoundingSphere(new THREE.Sphere());
const camera = new THREE.PerspectiveCamera(32, innerWidth / innerHeight, ball.radius / 10, ball.radius * 20);
camera.position.copy(ball.center).add(new THREE.Vector3(1, 0.4, 1.6).multiplyScalar(ball.radius * 2));
camera.lookAt(ball.center);

const mixer = new THREE.AnimationMixer(gltf.scene);
for (const clip of gltf.animations) mixer.clipAction(clip).play();
const clock = new THREE.Clock();
renderer.setAnimationLoop(() => {
  mixer.update(clock.getDelta());
  renderer.render(scene, camera);
});
</script>
`;

function Share() {
  const { result } = state;
  if (!result) return null;
  const origin = location.origin;
  const asset = new URL(client.url(result.supermesh.asset), origin).href;
  const request = result.request ?? buildRequest();
  const names = result.supermesh.shapes.map((s) => s.name);
  const file = fileName(result, 'glb');
  const secret = client.token ? ` -H "Authorization: Bearer $ORBMORPH_TOKEN"` : '';
  const curl = `curl -sS${secret} ${origin}/v1/supermeshes -H 'Content-Type: application/json' -H 'Prefer: wait=60' \\\n  -d ${quoted(JSON.stringify(request))}\ncurl -sS${secret} -o ${quoted(file)} ${asset}`;
  // a page of another site may not read from the daemon, and must not contain the token
  const shown = encodeURIComponent(file);
  return (
    <>
      <TakeAway result={result} />
      <h3>For developers</h3>
      <p class="hint">The URL of an asset never changes, so it can be cached forever.</p>
      <Snippet title="Asset" text={asset} />
      <Snippet title="curl" text={curl} />
      <p class="hint">
        The pages below load <code>{file}</code>. Put it beside them, and serve their folder, for example with{' '}
        <code>python3 -m http.server</code>: browsers load no models from pages opened as files.
      </p>
      <Snippet title="three.js" text={threePage(shown, names)} />
      <Snippet title="model-viewer" text={viewerPage(shown, names)} />
    </>
  );
}

const KEYS: [string, string][] = [
  ['1 2 3 4', 'Shapes, Landmarks, Morph, Spheres'],
  ['Space', 'Play or pause'],
  ['W', 'Wireframe'],
  ['Arrow keys', 'Rotate the focused view'],
  ['+ and −', 'Zoom in and out'],
  ['0', 'Reset the view'],
  ['Enter', 'Set a landmark at the centre of the view'],
  ['Arrow keys on a landmark', 'Slide it on the surface; with Shift by less'],
  ['Delete', 'Delete the selected landmark'],
  ['Ctrl Z, Ctrl Shift Z', 'Undo, redo'],
  ['Esc', 'Close'],
];

function Help() {
  return (
    <>
      <p>
        Add two or more closed meshes and press <strong>Morph</strong>. Where features do not match, set landmarks on
        them: the same feature on each shape.
      </p>
      <p>
        Drag to rotate, use the wheel or two fingers to zoom, drag with the right button or Shift to move. The URL of
        the page holds its state: bookmark it or send it.
      </p>
      <h3>Keys</h3>
      <table class="report keys">
        <tbody>
          {KEYS.map(([key, what]) => (
            <tr key={key}>
              <th scope="row">
                <kbd>{key}</kbd>
              </th>
              <td>{what}</td>
            </tr>
          ))}
        </tbody>
      </table>
      <p>
        <a href="/docs">The HTTP interface</a> · <a href="/licenses.txt">Licences</a>
      </p>
    </>
  );
}
