// Runs the command line.
import { spawn } from 'node:child_process';
import { mkdtemp, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { binaries } from './daemon.mjs';

/** Runs a program; resolves to {code, bytes, out, err}. */
export function runProgram(program, args, { env = {}, cwd, input } = {}) {
  return new Promise((resolve, reject) => {
    const child = spawn(program, args, {
      cwd,
      env: { ...process.env, ...env },
      stdio: [input === undefined ? 'ignore' : 'pipe', 'pipe', 'pipe'],
    });
    const out = [];
    const err = [];
    child.stdout.on('data', (chunk) => out.push(chunk));
    child.stderr.on('data', (chunk) => err.push(chunk));
    child.on('error', reject);
    child.on('close', (code, signal) =>
      resolve({
        code: code ?? signal,
        bytes: Buffer.concat(out),
        out: Buffer.concat(out).toString(),
        err: Buffer.concat(err).toString(),
      }),
    );
    child.stdin?.end(input);
  });
}

export const run = (args, { env = {}, ...rest } = {}) =>
  runProgram(binaries.client, args, { env: { ORBMORPH_SERVER: '', ...env }, ...rest });

/** Quotes a word for a shell. */
export const quoted = (word) => `'${word.replaceAll("'", "'\\''")}'`;

/** A folder that is deleted when the test ends. */
export async function folder(t) {
  const made = await mkdtemp(path.join(tmpdir(), 'orbmorph-cli-'));
  t.after(() => rm(made, { recursive: true, force: true }));
  return made;
}
