// Checks the types of the studio and the JavaScript client with client/web's compiler. Exits with 77 if it is missing.
import { spawnSync } from 'node:child_process';
import { existsSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';

const root = fileURLToPath(new URL('../../', import.meta.url));
const compiler = join(root, 'client/web/node_modules/typescript/bin/tsc');
if (!existsSync(compiler)) {
  console.log('skipped: client/web/node_modules is missing (client/web/build.sh)');
  process.exit(77);
}
let failed = false;
for (const folder of ['client/js', 'client/web'])
  failed =
    spawnSync(process.execPath, [compiler, '--noEmit', '-p', join(root, folder)], { stdio: 'inherit' }).status !== 0 ||
    failed;
process.exit(failed ? 1 : 0);
