// Completions in three shells, and the manual pages.
import assert from 'node:assert/strict';
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { folder, quoted, run, runProgram } from './support/cli.mjs';
import { binaries, patience, root } from './support/daemon.mjs';

const completions = path.join(root, 'deploy/completions');
const files = { bash: 'orbmorph.bash', zsh: '_orbmorph', fish: 'orbmorph.fish' };

test('the completion files match what the program prints', async () => {
  for (const [shell, file] of Object.entries(files)) {
    const { out } = await run(['completions', shell]);
    assert.equal(
      out,
      await readFile(path.join(completions, file), 'utf8'),
      `stale: orbmorph completions ${shell} > deploy/completions/${file}`,
    );
  }
});

test('bash completes commands, options, choices and operands', async () => {
  const complete = async (...words) => {
    const script = `source "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _orbmorph; printf '%s\\n' "\${COMPREPLY[@]}"`;
    const { code, out, err } = await runProgram('bash', [
      '--norc',
      '-euc',
      script,
      'bash',
      path.join(completions, files.bash),
      ...words,
    ]);
    assert.equal(code, 0, err);
    assert.equal(err, '');
    return out.trim().split('\n');
  };
  assert.deepEqual(await complete('orbmorph', 'mo'), ['morph']);
  assert.deepEqual(await complete('orbmorph', 'morph', '--remes'), ['--remesh']);
  assert.deepEqual(await complete('orbmorph', 'morph', '--align', 'r'), ['rbf', 'rotate']);
  assert.deepEqual(await complete('orbmorph', 'ls', 'me'), ['meshes']);
});

test('fish completes commands, options, choices and operands', async (t) => {
  const home = await folder(t);
  const complete = async (line) => {
    const { code, out, err } = await runProgram(
      'fish',
      ['--no-config', '-c', `source ${quoted(path.join(completions, files.fish))}; complete -C "${line}"`],
      { env: { HOME: home } },
    );
    assert.equal(code, 0, err);
    assert.equal(err, '');
    return out
      .trim()
      .split('\n')
      .map((row) => row.split('\t')[0]);
  };
  assert.deepEqual(await complete('orbmorph mo'), ['morph']);
  assert.deepEqual(await complete('orbmorph morph --remes'), ['--remesh']);
  assert.deepEqual((await complete('orbmorph morph --align r')).slice(0, 2).sort(), ['rbf', 'rotate']);
  assert.deepEqual(await complete('orbmorph ls me'), ['meshes']);
});

test('zsh completes commands, options and choices as they are typed', async (t) => {
  const at = await folder(t);
  const script = `zmodload zsh/zpty
zpty z zsh -f -i
zpty -w z 'PS1=; fpath=("$COMPLETIONS" $fpath); autoload -Uz compinit; compinit -D -u; print R""EADY'
zpty -r z line '*READY*'
zpty -w -n z $'orbmorph comp\\t\\C-A: \\C-E\\C-J'
zpty -w -n z $'orbmorph morph --remes\\tover\\tx\\C-A: \\C-E\\C-J'
zpty -w z 'print D""ONE'
while zpty -r z line; do print -r -- "$line"; [[ $line == *DONE* ]] && break; done
`;
  await writeFile(path.join(at, 'type.zsh'), script);
  const { out, err } = await runProgram('timeout', [String(60 * patience), 'zsh', '-f', path.join(at, 'type.zsh')], {
    env: { TERM: 'xterm', HOME: at, COMPLETIONS: completions },
  });
  assert.match(out, /:? ?orbmorph completions/, err);
  assert.match(out, /orbmorph morph --remesh overlay x/, `${out}${err}`);
});

const pages = ['orbmorph.1', 'orbmorph-bench.1', 'orbmorphd.8'];

test('the manual pages render without a warning', async () => {
  for (const page of pages) {
    const file = path.join(root, 'deploy/man', page);
    const lint = await runProgram('mandoc', ['-T', 'lint', '-W', 'warning', file]);
    assert.equal(lint.out + lint.err, '', page);
    const shown = await runProgram('man', ['--warnings', '-l', file], {
      env: { LC_ALL: 'C.UTF-8', MANWIDTH: '80', MANPAGER: 'cat' },
    });
    assert.equal(shown.code, 0, shown.err);
    assert.equal(shown.err, '', page);
    for (const section of ['NAME', 'SYNOPSIS', 'DESCRIPTION', 'SEE ALSO'])
      assert.match(shown.out, new RegExp(`^${section}$`, 'm'), page);
  }
});

test('the manual pages document every command and option', async () => {
  const text = async (page) =>
    // biome-ignore lint/suspicious/noControlCharactersInRegex: mandoc overstrikes with backspaces
    (await runProgram('mandoc', ['-T', 'utf8', path.join(root, 'deploy/man', page)])).out.replace(/.\x08/g, '');
  const options = (help) => [...new Set(help.match(/(?<=^|[ ,(])--[a-z][a-z-]+/gm))];
  const client = await text('orbmorph.1');
  const top = (await run(['--help'])).out;
  for (const [, command] of top.matchAll(/^ {2}([a-z]+) /gm)) {
    assert.match(client, new RegExp(`^ +${command} `, 'm'), command);
    for (const option of options((await run([command, '--help'])).out))
      assert.match(client, new RegExp(`${option}\\b`), `orbmorph.1: ${command} ${option}`);
  }
  for (const [program, page] of [
    [binaries.daemon, 'orbmorphd.8'],
    [path.join(path.dirname(binaries.daemon), 'orbmorph-bench'), 'orbmorph-bench.1'],
  ]) {
    const page_text = await text(page);
    for (const option of options((await runProgram(program, ['--help'])).out))
      assert.match(page_text, new RegExp(`${option}\\b`), `${page}: ${option}`);
  }
});
