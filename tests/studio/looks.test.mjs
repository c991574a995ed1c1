// Compares the studio with the reference pictures. node tests/studio/looks.mjs retakes them; look at them afterwards.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { existsSync } from 'node:fs';
import { mkdir, readFile, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { folder, photographer, SCENES } from './looks.mjs';
import { apart } from './pictures.mjs';
import { browser, daemon } from './started.mjs';

const { look, close } = photographer(browser, daemon.url);

const names = Object.keys(SCENES);
for (const [i, name] of names.entries())
  test(name, async () => {
    const stored = join(folder, `${name}.png`);
    assert.ok(existsSync(stored), `${stored} is missing: node tests/studio/looks.mjs ${name}`);
    const now = await look(name);
    if (SCENES[names[i + 1]]?.[2] !== name) await close();
    const { share, mean, size } = await apart(browser, now, await readFile(stored));
    const kept = join(tmpdir(), 'orbmorph-looks', `${name}.png`);
    const fine = share < 0.03 && mean < 4;
    if (!fine) {
      await mkdir(join(tmpdir(), 'orbmorph-looks'), { recursive: true });
      await writeFile(kept, now);
    }
    assert.ok(
      fine,
      `${(100 * share).toFixed(1)} % of the blocks differ (mean ${mean.toFixed(1)}${size ? `, sizes ${size}` : ''}), see ${kept}`,
    );
  });

test('the comparison detects another picture', async () => {
  const [a, b] = await Promise.all(['shapes', 'landmarks'].map((name) => readFile(join(folder, `${name}.png`))));
  assert.ok((await apart(browser, a, b)).share > 0.03);
  assert.deepEqual(await apart(browser, a, a), { share: 0, mean: 0 });
});
