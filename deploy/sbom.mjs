// Writes the software bill of materials of a build, as SPDX 2.3 in JSON: what the programs link (Debian packages of this
// machine), the header-only libraries that are compiled in, and the npm packages that the studio bundles.
//   node deploy/sbom.mjs BUILD_FOLDER > orbmorph.spdx.json
// The same build gives the same bytes: SOURCE_DATE_EPOCH, or the newest program, is the instant of creation.
import { execFileSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { readFileSync, realpathSync, statSync } from 'node:fs';
import path from 'node:path';
import { fileURLToPath } from 'node:url';

const root = path.resolve(path.dirname(fileURLToPath(import.meta.url)), '..');
const build = path.resolve(process.argv[2] ?? path.join(root, 'build'));
const programs = ['orbmorphd', 'orbmorph', 'orbmorph-bench'].map((name) => path.join(build, 'bin', name));
/** Debian packages of which only headers are used, which the compiler puts into the programs. */
const headers = ['libeigen3-dev', 'libspectra-dev'];

const run = (program, ...args) =>
  execFileSync(program, args, { encoding: 'utf8', stdio: ['ignore', 'pipe', 'ignore'] });
/** Its output, even if it fails: dpkg-query does if one of its arguments is unknown. */
const tryRun = (...args) => {
  try {
    return run(...args);
  } catch (error) {
    return error.stdout ?? '';
  }
};
const version = /project\(orbmorph VERSION (\S+)/.exec(readFileSync(path.join(root, 'CMakeLists.txt'), 'utf8'))[1];

/** The Debian packages that own files, by file. A package may know a file by its path before /usr was merged. */
function ownersOf(files) {
  const places = new Map();
  for (const file of files)
    for (const one of [realpathSync(file), file]) places.set(one, file).set(one.replace(/^\/usr/, ''), file);
  const owners = new Map();
  for (const [, name, place] of tryRun('dpkg-query', '-S', ...places.keys()).matchAll(/^([^:\s]+)[^\n]*: (\/.*)$/gm))
    owners.set(places.get(place), name);
  return owners;
}

const id = (kind, name) => `SPDXRef-${kind}-${name.replace(/[^A-Za-z0-9.-]/g, '-')}`;
const common = { filesAnalyzed: false, licenseConcluded: 'NOASSERTION', copyrightText: 'NOASSERTION' };

function debian(name) {
  const format = `\${Version}\\t\${Architecture}\\t\${source:Package}\\t\${source:Version}\\t\${Homepage}`;
  const [found, arch, source, sourceVersion, homepage] = tryRun('dpkg-query', '-W', '-f', format, name).split('\t');
  if (!found) throw new Error(`the Debian package ${name} is not installed`);
  const distribution = /^ID=(\S+)$/m.exec(readFileSync('/etc/os-release', 'utf8'))?.[1] ?? 'debian';
  return {
    SPDXID: id('deb', name),
    name,
    versionInfo: found,
    supplier: 'Organization: Debian',
    downloadLocation: 'NOASSERTION',
    ...(homepage ? { homepage } : {}),
    ...common,
    licenseDeclared: 'NOASSERTION',
    sourceInfo: `built from the source package ${source} ${sourceVersion}`,
    externalRefs: [
      {
        referenceCategory: 'PACKAGE-MANAGER',
        referenceType: 'purl',
        referenceLocator: `pkg:deb/${distribution}/${encodeURIComponent(name)}@${encodeURIComponent(found)}?arch=${arch}`,
      },
    ],
  };
}

/** A library that no package owns: built by hand on this machine. */
const unowned = (file) => ({
  SPDXID: id('file', path.basename(file)),
  name: path.basename(file),
  supplier: 'NOASSERTION',
  downloadLocation: 'NOASSERTION',
  ...common,
  licenseDeclared: 'NOASSERTION',
  checksums: [{ algorithm: 'SHA256', checksumValue: createHash('sha256').update(readFileSync(file)).digest('hex') }],
});

function npm(name, { version, resolved, integrity, license }) {
  const [algorithm, digest] = (integrity ?? '').split('-');
  return {
    SPDXID: id('npm', name),
    name,
    versionInfo: version,
    supplier: 'NOASSERTION',
    downloadLocation: resolved ?? 'NOASSERTION',
    ...common,
    licenseDeclared: license ?? 'NOASSERTION',
    ...(algorithm === 'sha512'
      ? { checksums: [{ algorithm: 'SHA512', checksumValue: Buffer.from(digest, 'base64').toString('hex') }] }
      : {}),
    externalRefs: [
      {
        referenceCategory: 'PACKAGE-MANAGER',
        referenceType: 'purl',
        referenceLocator: `pkg:npm/${name.replace('@', '%40')}@${version}`,
      },
    ],
  };
}

const direct = new Set(); // names of libraries that the programs themselves name
const libraries = new Map(); // all libraries that the loader loads: name → file
for (const program of programs) {
  for (const [, name] of run('readelf', '--dynamic', '--wide', program).matchAll(/\(NEEDED\).*\[(.+)\]/g))
    direct.add(name);
  for (const [, name, file] of run('ldd', program).matchAll(/^\s*(\S+)(?: => (\/\S+))? \(0x/gm)) {
    if (file ?? name.startsWith('/')) libraries.set(path.basename(name), file ?? name);
  }
}
const main = {
  SPDXID: 'SPDXRef-orbmorph',
  name: 'orbmorph',
  versionInfo: version,
  supplier: 'Organization: The orbmorph authors',
  downloadLocation: 'NOASSERTION',
  ...common,
  licenseDeclared: 'MIT',
  primaryPackagePurpose: 'APPLICATION',
};
const packages = new Map([[main.SPDXID, main]]);
const relations = new Map();
const add = (made, relationshipType) => {
  packages.set(made.SPDXID, made);
  const known = relations.get(made.SPDXID);
  if (!known || known === 'DEPENDS_ON') relations.set(made.SPDXID, relationshipType);
};
const owners = ownersOf([...libraries.values()]);
for (const [name, file] of libraries) {
  const owned = owners.get(file);
  add(owned ? debian(owned) : unowned(file), direct.has(name) ? 'DYNAMIC_LINK' : 'DEPENDS_ON');
}
for (const name of headers) add(debian(name), 'STATIC_LINK');
const lock = JSON.parse(readFileSync(path.join(root, 'client/web/package-lock.json'), 'utf8'));
for (const [place, entry] of Object.entries(lock.packages)) {
  if (place && !entry.dev && !entry.optional) add(npm(place.replace(/^.*node_modules\//, ''), entry), 'CONTAINS');
}

const sorted = [...packages.values()].sort((a, b) => (a.SPDXID < b.SPDXID ? -1 : 1));
const seconds = Number(
  process.env.SOURCE_DATE_EPOCH ?? Math.max(...programs.map((file) => statSync(file).mtimeMs / 1000)),
);
const relationships = [
  { spdxElementId: 'SPDXRef-DOCUMENT', relationshipType: 'DESCRIBES', relatedSpdxElement: main.SPDXID },
  ...[...relations].sort().map(([relatedSpdxElement, relationshipType]) => ({
    spdxElementId: main.SPDXID,
    relationshipType,
    relatedSpdxElement,
  })),
];
const digest = createHash('sha256')
  .update(JSON.stringify([sorted, relationships]))
  .digest('hex');
const document = {
  spdxVersion: 'SPDX-2.3',
  dataLicense: 'CC0-1.0',
  SPDXID: 'SPDXRef-DOCUMENT',
  name: `orbmorph-${version}`,
  documentNamespace: `https://spdx.org/spdxdocs/orbmorph-${version}-${digest}`,
  creationInfo: {
    created: new Date(1000 * Math.floor(seconds)).toISOString().replace('.000Z', 'Z'),
    creators: [`Tool: orbmorph-sbom-${version}`],
  },
  packages: sorted,
  relationships,
};
process.stdout.write(`${JSON.stringify(document, null, 2)}\n`);
