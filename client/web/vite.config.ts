import { defineConfig, type Plugin } from 'vite';
import { readdirSync, readFileSync, existsSync, statSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { join } from 'node:path';

const here = (path: string) => fileURLToPath(new URL(path, import.meta.url));
const isMesh = (name: string) => /\.(obj|off|ply|stl|glb)$/i.test(name);

/**
 * The repository's sample meshes become assets of the studio; `virtual:samples` lists them as {name, file, bytes, url}.
 * A file samples.json beside them may give `pair`: the two that "Try with samples" opens.
 */
function samples(): Plugin {
  const folder = here('../../tests/samples');
  let build = false;
  return {
    name: 'orbmorph-samples',
    configResolved: (config) => void (build = config.command === 'build'),
    resolveId: (id) => (id === 'virtual:samples' ? '\0samples' : undefined),
    load(id) {
      if (id !== '\0samples') return undefined;
      const files = existsSync(folder) ? readdirSync(folder).filter(isMesh).sort() : [];
      const items = files.map((file) => {
        const name = file.replace(/\.[^.]+$/, '');
        const bytes = statSync(join(folder, file)).size;
        const url = build
          ? `import.meta.ROLLUP_FILE_URL_${this.emitFile({ type: 'asset', name: file, source: readFileSync(join(folder, file)) })}`
          : JSON.stringify(`/@fs/${join(folder, file)}`);
        return `{name:${JSON.stringify(name)},file:${JSON.stringify(file)},bytes:${bytes},url:String(${url})}`;
      });
      return `export default [${items.join(',')}];`;
    },
  };
}

export default defineConfig({
  base: './',
  plugins: [samples()],
  resolve: { alias: { orbmorph: here('../js/src/index.js') } },
  esbuild: { jsx: 'automatic', jsxImportSource: 'preact' },
  worker: { format: 'es' },
  build: {
    target: 'es2022',
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 900,
  },
  server: {
    host: '127.0.0.1',
    fs: { allow: [here('../..')] },
    proxy: { '/v1': process.env.ORBMORPH_SERVER ?? 'http://127.0.0.1:8080' },
  },
});
