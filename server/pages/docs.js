// Renders /openapi.json as a page, without third-party code.
function element(name, text, parent) {
  const e = document.createElement(name);
  if (text !== undefined) {
    e.textContent = text;
  }
  if (parent) {
    parent.append(e);
  }
  return e;
}

const SCHEMA = '#/components/schemas/';

/* JSON in which short values take one line, and a reference to a schema is its name. */
function json(value, pad = '') {
  if (value?.$ref) {
    return value.$ref.replace(SCHEMA, '');
  }
  const isArray = Array.isArray(value);
  if (!value || typeof value !== 'object') {
    return JSON.stringify(value);
  }
  const inner = pad + '  ';
  const entries = Object.entries(value).map(([key, item]) => (isArray ? '' : key + ': ') + json(item, inner));
  const [open, close] = isArray ? '[]' : '{}';
  const line = open + entries.join(', ') + close;
  return line.length + pad.length < 100 && !line.includes('\n')
    ? line
    : open + '\n' + entries.map((entry) => inner + entry).join(',\n') + '\n' + pad + close;
}

/* The document with references to its responses, examples and parameters resolved; those to schemas stay names. */
function resolved(api, value) {
  if (Array.isArray(value)) return value.map((item) => resolved(api, item));
  if (!value || typeof value !== 'object') return value;
  const [, kind, name] = /^#\/components\/(responses|examples|parameters|headers)\/(.+)$/.exec(value.$ref) || [];
  if (kind) return resolved(api, api.components[kind][name]);
  return Object.fromEntries(Object.entries(value).map(([key, item]) => [key, resolved(api, item)]));
}

/* Shows a schema: links to named ones, else its JSON. */
function showSchema(parent, schema) {
  if (Object.keys(schema).every((key) => key === 'description' || key === 'contentMediaType')) {
    element('p', schema.description, parent);
    return;
  }
  const alternatives = schema.oneOf || schema.anyOf || [schema];
  if (!alternatives.every((s) => s.$ref)) {
    element('pre', json(schema), parent);
    return;
  }
  const line = element('p', undefined, parent);
  alternatives.forEach((s, i) => {
    const name = s.$ref.replace(SCHEMA, '');
    line.append(i ? ' or ' : '');
    element('a', name, line).href = '#' + name;
  });
}

function showContent(parent, content) {
  for (const [type, media] of Object.entries(content)) {
    element('p', undefined, parent).append(element('code', type));
    if (media.schema) {
      showSchema(parent, media.schema);
    }
    const examples = media.examples || (media.example === undefined ? {} : { example: { value: media.example } });
    for (const [name, { value }] of Object.entries(examples)) {
      const box = element('details', undefined, parent);
      element('summary', name + (value.detail ? ': ' + value.detail : ''), box);
      element('pre', typeof value === 'string' ? value : json(value), box);
    }
  }
}

/* The values that a parameter takes, as far as a few words say it. */
function valuesOf(schema) {
  const values = schema.enum ? schema.enum.join(', ') : schema.type || (schema.$ref || '').replace(SCHEMA, '');
  return values + (schema.default === undefined ? '' : '; default: ' + schema.default);
}

function showParameters(parent, parameters) {
  if (parameters.length === 0) {
    return;
  }
  const table = element('table', undefined, parent);
  const head = element('tr', undefined, element('thead', undefined, table));
  for (const title of ['parameter', 'in', 'values', 'meaning']) {
    element('th', title, head).scope = 'col';
  }
  const body = element('tbody', undefined, table);
  for (const p of parameters) {
    const row = element('tr', undefined, body);
    element('code', p.name, element('td', undefined, row));
    element('td', p.in + (p.required ? ', required' : ''), row);
    element('td', valuesOf(p.schema), row);
    element('td', p.description, row);
  }
}

function showOperation(parent, path, method, op, parameters) {
  const box = element('details', undefined, parent);
  box.id = op.operationId;
  const head = element('summary', undefined, box);
  element('span', method.toUpperCase(), head).className = 'method';
  element('code', path, head);
  element('span', ' ' + op.summary, head);
  if (op.description) {
    element('p', op.description, box);
  }
  showParameters(box, parameters);
  if (op.requestBody) {
    element('h3', 'Body', box);
    if (op.requestBody.description) {
      element('p', op.requestBody.description, box);
    }
    showContent(box, op.requestBody.content);
  }
  for (const [status, answer] of Object.entries(op.responses)) {
    element('h3', status + ' ' + (answer.description || ''), box);
    showContent(box, answer.content || {});
  }
}

/* Opens what the fragment of the address names. */
function openNamed() {
  const named = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (named) {
    named.open = true;
    named.scrollIntoView();
  }
}

function show(api) {
  const root = document.getElementById('routes');
  root.textContent = '';
  element('p', api.info.description, root);
  const paths = Object.entries(resolved(api, api.paths));
  for (const tag of api.tags) {
    element('h2', tag.name, root);
    element('p', tag.description, root);
    for (const [path, item] of paths) {
      for (const [method, op] of Object.entries(item)) {
        if (op.tags?.includes(tag.name)) {
          showOperation(root, path, method, op, [...(item.parameters || []), ...(op.parameters || [])]);
        }
      }
    }
  }
  element('h2', 'Schemas', root);
  for (const [name, value] of Object.entries(api.components.schemas)) {
    const box = element('details', undefined, root);
    box.id = name;
    element('summary', name, box);
    element('pre', json(value), box);
  }
  addEventListener('hashchange', openNamed);
  openNamed();
}
fetch('/openapi.json')
  .then((r) => r.json())
  .then(show);
