import { defineConfig, type Plugin } from 'vite';
import { readdirSync, readFileSync, existsSync, statSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { join } from 'node:path';

const here = (path: string) => fileURLToPath(new URL(path, import.meta.url));
const isMesh = (name: string) => /\.(obj|off|ply|stl|3mf|gltf|glb)$/i.test(name);

/**
 * Bundles the repository's sample meshes as assets. `virtual:samples` lists them as {name, file, bytes, url}.
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

/**
 * Writes licenses.txt with the licences of the bundled packages (`dependencies` in package.json), as they require, and of
 * Draco's decoder, which three has without its licence: that is Apache 2.0, word for word the licence of TypeScript.
 */
function licenses(): Plugin {
  const read = (path: string) => readFileSync(here(path), 'utf8').trim();
  return {
    name: 'orbmorph-licenses',
    apply: 'build',
    generateBundle() {
      const { dependencies } = JSON.parse(read('package.json')) as { dependencies: Record<string, string> };
      const parts = Object.entries(dependencies).map(
        ([name, version]) => `${name} ${version}\n\n${read(`node_modules/${name}/LICENSE`)}\n`,
      );
      const draco = read('node_modules/typescript/LICENSE.txt');
      if (!/^Apache License\s+Version 2\.0/.test(draco)) throw new Error('The licence of TypeScript is another one.');
      parts.push(`Draco\n\nCopyright The Draco Authors\n\n${draco}\n`);
      const source = [`orbmorph\n\n${read('../../LICENSE')}\n`, ...parts].join(`\n${'-'.repeat(80)}\n\n`);
      this.emitFile({ type: 'asset', fileName: 'licenses.txt', source });
    },
  };
}

/** Makes Draco's decoder a module: it lies in a package of modules, and is a script that names one function. */
function draco(): Plugin {
  return {
    name: 'orbmorph-draco',
    transform: (code, id) =>
      /draco_decoder\.js/.test(id) ? { code: `${code}\nexport default DracoDecoderModule;\n`, map: null } : undefined,
  };
}

export default defineConfig({
  base: './',
  plugins: [samples(), licenses(), draco()],
  resolve: { alias: { orbmorph: here('../js/src/index.js') } },
  esbuild: { jsx: 'automatic', jsxImportSource: 'preact' },
  worker: { format: 'es', plugins: () => [draco()] },
  optimizeDeps: { exclude: ['three/examples/jsm/libs/draco/gltf/draco_decoder.js'] },
  build: {
    target: 'es2022',
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 900,
  },
  server: {
    host: '127.0.0.1',
    fs: { allow: [here('../..')] },
    proxy: {
      '/v1': {
        target: process.env.ORBMORPH_SERVER ?? 'http://127.0.0.1:8080',
        // The daemon refuses the origin of this server; to the daemon, the proxy is not a page.
        configure: (proxy) => proxy.on('proxyReq', (request) => request.removeHeader('origin')),
      },
    },
  },
});
