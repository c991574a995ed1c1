// Runs one test file. Exits with 77 (skipped) and names what is missing if it cannot run.
import { existsSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { executablePath } from '../tools/chromium.mjs';

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
const needed = {
  'client/web/node_modules (client/web/build.sh)': here('../../client/web/node_modules/esbuild'),
  'client/web/dist (client/web/build.sh)': here('../../client/web/dist/index.html'),
  'tests/node_modules (npm ci in tests/)': here('../node_modules/playwright-core'),
  chromium: executablePath,
};
for (const [what, path] of Object.entries(needed))
  if (!existsSync(path)) {
    console.log(`skipped: ${what} is missing`);
    process.exit(77);
  }
await import(new URL(process.argv[2], import.meta.url));
