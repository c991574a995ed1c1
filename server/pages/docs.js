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
  element("h4", title, parent);
  element("pre", JSON.stringify(value, null, 1), parent);
}
function show(api) {
  const root = document.getElementById("routes");
  root.textContent = "";
  element("p", api.info.description, root);
  for (const [path, item] of Object.entries(api.paths)) {
    for (const [method, op] of Object.entries(item)) {
      if (!op.responses) {
        continue;
      }
      const box = element("details", undefined, root);
      const head = element("summary", undefined, box);
      element("span", method.toUpperCase(), head).className = "method";
      element("code", path, head);
      element("span", " " + op.summary, head);
      if (op.description) {
        element("p", op.description, box);
      }
      for (const p of [...(item.parameters || []), ...(op.parameters || [])]) {
        const q = p.$ref ? api.components.parameters[p.$ref.split("/").pop()] : p;
        element("p", q.name + " (" + q.in + "): " + (q.description || ""), box);
      }
      if (op.requestBody) {
        schema(box, "Body", op.requestBody.content);
      }
      for (const [status, answer] of Object.entries(op.responses)) {
        schema(box, status + " " + (answer.description || ""), answer.content || answer);
      }
    }
  }
  element("h2", "Schemas", root);
  for (const [name, value] of Object.entries(api.components.schemas)) {
    const box = element("details", undefined, root);
    element("summary", name, box);
    element("pre", JSON.stringify(value, null, 1), box);
  }
}
fetch("/openapi.json").then((r) => r.json()).then(show);
