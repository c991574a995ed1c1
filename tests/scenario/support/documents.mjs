// The documents and the shell lines in them.
import { mkdir, mkdtemp, readFile, readdir, rm, symlink } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { binaries, root, samples } from './daemon.mjs';

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

/** A folder that acts as the root of a checkout, and the environment in which the lines run. */
export async function place(t, d) {
  const at = await mkdtemp(path.join(tmpdir(), 'orbmorph-lines-'));
  t.after(() => rm(at, { recursive: true, force: true }));
  await mkdir(path.join(at, 'tests'));
  await symlink(samples, path.join(at, 'tests/samples'));
  const env = {
    ...process.env,
    ORBMORPH_SERVER: d.url,
    PATH: `${path.dirname(binaries.client)}:${path.dirname(binaries.daemon)}:${process.env.PATH}`,
  };
  return { at, env };
}
