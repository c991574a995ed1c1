// The examples of `orbmorph --help`, of each command's --help and of the manual page run as they stand.
import assert from 'node:assert/strict';
import { copyFile, mkdir, readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { folder, run, runProgram } from './support/cli.mjs';
import { binaries, daemon, root, samples } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

async function examples() {
  const top = (await run(['--help'])).out;
  const lists = [top];
  for (const [, command] of top.matchAll(/^ {2}([a-z]+) {2,}/gm)) lists.push((await run([command, '--help'])).out);
  const help = lists.flatMap((text) => [...text.matchAll(/^ {2}\$ (orbmorph .*)$/gm)].map(([, line]) => line));
  assert.equal(
    lists.filter((text) => text.includes('\n  $ orbmorph ')).length,
    lists.length,
    'each help has an example',
  );
  const page = await readFile(path.join(root, 'deploy/man/orbmorph.1'), 'utf8');
  const manual = page
    .split('.SH EXAMPLES')[1]
    .split('\n')
    .filter((line) => line.startsWith('orbmorph '))
    .map((line) => line.replaceAll('\\-', '-'));
  assert.ok(manual.length > 5);
  return [...help, ...manual];
}

test('the examples run', async (t) => {
  const d = await daemon(t);
  const at = await folder(t);
  for (const file of ['dog.obj', 'giraffe.off', 'dog-giraffe.json'])
    await copyFile(path.join(samples, file), path.join(at, file));
  const scan = shapes.withoutFace(shapes.egg());
  await writeFile(path.join(at, 'scan.stl'), shapes.binaryStl(scan));
  await mkdir(path.join(at, 'frames'));
  await writeFile(path.join(at, 'frames/1.ply'), shapes.binaryPly(shapes.egg()));
  await writeFile(path.join(at, 'frames/2.ply'), shapes.binaryPly(shapes.bean()));
  const env = {
    ORBMORPH_SERVER: d.url,
    ORBMORPH_KEY: 'key:secret',
    BROWSER: 'true',
    XDG_DATA_HOME: path.join(at, 'home'),
    PATH: `${path.dirname(binaries.client)}:${process.env.PATH}`,
  };
  const made = await run(['morph', 'dog.obj', 'giraffe.off', '-q', '--json', '-o', 'out.glb'], { env, cwd: at });
  const { id } = JSON.parse(made.out);
  const job = (await d.get('/v1/jobs')).json.jobs[0].id;
  const order = (line) => (line.includes(' rm ') ? 2 : line.includes('completions') ? 1 : 0);
  for (const line of (await examples()).sort((a, b) => order(a) - order(b))) {
    let command = line.replace('/etc/bash_completion.d/', `${at}/`);
    command = command.replace('/v1/jobs/ID', `/v1/jobs/${job}`).replace('/v1/supermeshes/ID', `/v1/supermeshes/${id}`);
    const studio = command.startsWith('orbmorph studio');
    // it runs until it is told to stop, here once it has printed its address
    if (studio) command = `mkfifo said; ${command} >said & read -r line <said; echo "$line"; kill $!; wait $!`;
    const { code, out, err } = await runProgram('sh', ['-c', command], { env, cwd: at });
    // the scan has a hole: the doctor reports it, and which repair helps
    if (command.includes('doctor'))
      assert.ok(code === 1 && /--repair fill_holes scan\.stl/.test(out), `${line}: ${out}`);
    else assert.equal(code, 0, `${line}: ${err}`);
    if (studio) assert.match(out, /^http:/);
  }
});
