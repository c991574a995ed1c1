// Generates src/api.d.ts from the daemon's OpenAPI document: one type for each schema.
//   node client/js/types.mjs            writes the file
//   node client/js/types.mjs --check    fails if the file is not up to date
import { readFileSync, writeFileSync } from 'node:fs';

const here = (path) => new URL(path, import.meta.url);
const { info, components } = JSON.parse(readFileSync(here('../../api/openapi.json'), 'utf8'));
const target = here('src/api.d.ts');

const literal = (value) => (typeof value === 'string' ? `'${value.replace(/'/g, "\\'")}'` : String(value));
const comment = (text, pad) => (text ? `${pad}/** ${text.replace(/\*\//g, '* /').replace(/\s+/g, ' ')} */\n` : '');
const PLAIN = { string: 'string', number: 'number', integer: 'number', boolean: 'boolean', null: 'null' };
const either = (types) => [...new Set(types)].join(' | ') || 'never';
const member = (name) => (/^[A-Za-z_$][\w$]*$/.test(name) ? name : literal(name));

function typeOf(schema, pad) {
  if (schema === true || Object.keys(schema).length === 0) return 'unknown';
  if (schema.$ref) return schema.$ref.split('/').at(-1);
  if ('const' in schema) return literal(schema.const);
  if (schema.enum) return either(schema.enum.map(literal));
  // next to properties, alternatives only say which properties are required
  if ((schema.oneOf || schema.anyOf) && !schema.properties)
    return either((schema.oneOf ?? schema.anyOf).map((s) => typeOf(s, pad)));
  if (Array.isArray(schema.type)) return either(schema.type.map((type) => typeOf({ ...schema, type }, pad)));
  if (schema.type === 'array') return arrayOf(schema, pad);
  if (schema.type === 'object' || schema.properties) return objectOf(schema, pad);
  return PLAIN[schema.type] ?? 'unknown';
}

function arrayOf({ items = true, minItems, maxItems }, pad) {
  const item = typeOf(items, pad);
  if (minItems !== undefined && minItems === maxItems && minItems <= 4)
    return `[${Array(minItems).fill(item).join(', ')}]`;
  return /[|{]/.test(item) ? `Array<${item}>` : `${item}[]`;
}

function objectOf({ properties = {}, required = [], additionalProperties }, pad) {
  const inner = `${pad}  `;
  const lines = Object.entries(properties).map(
    ([name, schema]) =>
      `${comment(schema.description, inner)}${inner}${member(name)}${required.includes(name) ? '' : '?'}: ${typeOf(schema, inner)};\n`,
  );
  const more =
    additionalProperties && additionalProperties !== true
      ? typeOf(additionalProperties, inner)
      : additionalProperties
        ? 'unknown'
        : null;
  if (!lines.length) return `Record<string, ${more ?? 'unknown'}>`;
  if (more) lines.push(`${inner}[name: string]: unknown;\n`);
  return `{\n${lines.join('')}${pad}}`;
}

const text = `// Generated from api/openapi.json by client/js/types.mjs. Do not edit.\n\n/** Requests and responses of the daemon, interface version ${info.version}. */\n\n${Object.entries(
  components.schemas,
)
  .map(([name, schema]) => `${comment(schema.description, '')}export type ${name} = ${typeOf(schema, '')};\n`)
  .join('\n')}`;

if (process.argv.includes('--check')) {
  let now = '';
  try {
    now = readFileSync(target, 'utf8');
  } catch {
    // the file does not exist yet
  }
  if (now !== text) {
    console.error('client/js/src/api.d.ts is not up to date with api/openapi.json: run node client/js/types.mjs');
    process.exit(1);
  }
} else writeFileSync(target, text);
