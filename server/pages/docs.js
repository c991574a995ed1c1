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
function schema(parent, title, value) {
  element('h4', title, parent);
  element('pre', JSON.stringify(value, null, 1), parent);
}
/* The document with references to its responses, examples and parameters resolved; those to schemas stay names. */
function resolved(api, value) {
  if (Array.isArray(value)) return value.map((item) => resolved(api, item));
  if (!value || typeof value !== 'object') return value;
  const [, kind, name] = /^#\/components\/(responses|examples|parameters|headers)\/(.+)$/.exec(value.$ref) || [];
  if (kind) return resolved(api, api.components[kind][name]);
  return Object.fromEntries(Object.entries(value).map(([key, item]) => [key, resolved(api, item)]));
}
function show(api) {
  const root = document.getElementById('routes');
  root.textContent = '';
  element('p', api.info.description, root);
  for (const [path, item] of Object.entries(resolved(api, api.paths))) {
    for (const [method, op] of Object.entries(item)) {
      if (!op.responses) {
        continue;
      }
      const box = element('details', undefined, root);
      const head = element('summary', undefined, box);
      element('span', method.toUpperCase(), head).className = 'method';
      element('code', path, head);
      element('span', ' ' + op.summary, head);
      if (op.description) {
        element('p', op.description, box);
      }
      for (const p of [...(item.parameters || []), ...(op.parameters || [])]) {
        element('p', p.name + ' (' + p.in + '): ' + (p.description || ''), box);
      }
      if (op.requestBody) {
        schema(box, 'Body', op.requestBody.content);
      }
      for (const [status, answer] of Object.entries(op.responses)) {
        schema(box, status + ' ' + (answer.description || ''), answer.content || answer);
      }
    }
  }
  element('h2', 'Schemas', root);
  for (const [name, value] of Object.entries(api.components.schemas)) {
    const box = element('details', undefined, root);
    element('summary', name, box);
    element('pre', JSON.stringify(value, null, 1), box);
  }
}
fetch('/openapi.json')
  .then((r) => r.json())
  .then(show);
