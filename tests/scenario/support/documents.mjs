// The documents and the shell lines in them.
import { mkdir, mkdtemp, readFile, readdir, rm, symlink, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { binaries, root, samples } from './daemon.mjs';
import { writeGlb } from './glb_write.mjs';
import { writePng } from './png.mjs';

export const documents = async () => [
  'README.md',
  'CONTRIBUTING.md',
  'SECURITY.md',
  ...(await readdir(path.join(root, 'docs'))).filter((f) => f.endsWith('.md')).map((f) => `docs/${f}`),
];

export const blocks = (text, language) =>
  [...text.matchAll(new RegExp(`^\`\`\`${language}\\n([^]*?)^\`\`\`$`, 'gm'))].map((m) => m[1]);

/** The lines of all ```sh blocks of a document as one script in which curl fails if the daemon refuses; "" if there is none. */
export async function shellLines(file) {
  const text = await readFile(path.join(root, file), 'utf8').catch(() => '');
  return blocks(text, 'sh').join('\n').replaceAll('curl -sS', 'curl -sS --fail-with-body');
}

/** A box with a texture, for "any GLB with a texture" of the cookbook. */
function texturedBox() {
  const positions = [];
  const uv = [];
  const triangles = [];
  for (const axis of [0, 1, 2])
    for (const side of [-1, 1]) {
      const first = positions.length;
      for (const [s, t] of [
        [-1, -1],
        [1, -1],
        [1, 1],
        [-1, 1],
      ]) {
        const p = [0, 0, 0];
        p[axis] = side;
        p[(axis + 1) % 3] = side * s;
        p[(axis + 2) % 3] = t;
        positions.push(p);
        uv.push([(s + 1) / 2, (1 - t) / 2]);
      }
      triangles.push([first, first + 1, first + 2], [first, first + 2, first + 3]);
    }
  const image = writePng(32, 32, (x, y) => (((x >> 2) + (y >> 2)) % 2 ? [220, 120, 40] : [250, 240, 220]));
  return writeGlb({ positions, uv, triangles, image });
}

/** A folder that acts as the root of a checkout, and the environment in which the lines run. */
export async function place(t, d) {
  const at = await mkdtemp(path.join(tmpdir(), 'orbmorph-lines-'));
  t.after(() => rm(at, { recursive: true, force: true }));
  await mkdir(path.join(at, 'tests'));
  await symlink(samples, path.join(at, 'tests/samples'));
  await writeFile(path.join(at, 'textured.glb'), texturedBox());
  const env = {
    ...process.env,
    ORBMORPH_SERVER: d.url,
    PATH: `${path.dirname(binaries.client)}:${path.dirname(binaries.daemon)}:${process.env.PATH}`,
  };
  return { at, env };
}
