// A collector of OpenTelemetry: receives spans from the daemon, OTLP over HTTP in its JSON form.
import assert from 'node:assert/strict';
import { createServer } from 'node:http';

const text = ({ stringValue, intValue }) => stringValue ?? Number(intValue);
const flat = (attributes) => Object.fromEntries(attributes.map(({ key, value }) => [key, text(value)]));

function read(span, resource) {
  for (const [member, digits] of [
    ['traceId', 32],
    ['spanId', 16],
    ...(span.parentSpanId === undefined ? [] : [['parentSpanId', 16]]),
  ])
    assert.match(span[member], new RegExp(`^[0-9a-f]{${digits}}$`));
  for (const time of [span.startTimeUnixNano, span.endTimeUnixNano]) assert.match(time, /^\d{19}$/);
  return {
    trace: span.traceId,
    id: span.spanId,
    parent: span.parentSpanId,
    name: span.name,
    kind: span.kind,
    error: span.status?.code === 2 ? span.status.message : undefined,
    // A double resolves a quarter of a microsecond here.
    start: Number(span.startTimeUnixNano) / 1e6,
    end: Number(span.endTimeUnixNano) / 1e6,
    resource,
    ...flat(span.attributes),
  };
}

export class Collector {
  spans = [];
  batches = 0;

  /** answer(request, response): answers differently; returns false for the usual answer. */
  static async start(t, answer = () => false, port = 0) {
    const made = new Collector();
    made.server = createServer(async (request, response) => {
      const parts = [];
      for await (const part of request) parts.push(part);
      if (answer(request, response)) return;
      made.take(request, JSON.parse(Buffer.concat(parts)));
      response.setHeader('content-type', 'application/json').end('{"partialSuccess":{}}');
    });
    await new Promise((done) => made.server.listen(port, '127.0.0.1', done));
    made.url = `http://127.0.0.1:${made.server.address().port}`;
    t.after(() => made.stop());
    return made;
  }

  async stop() {
    this.server.closeAllConnections();
    await new Promise((done) => this.server.close(done));
  }

  take(request, { resourceSpans }) {
    assert.equal(`${request.method} ${request.url}`, 'POST /v1/traces');
    assert.equal(request.headers['content-type'], 'application/json');
    this.batches++;
    for (const { resource, scopeSpans } of resourceSpans)
      for (const { spans } of scopeSpans)
        this.spans.push(...spans.map((span) => read(span, flat(resource.attributes))));
  }

  named(name, of = () => true) {
    return this.spans.filter((span) => span.name === name && of(span));
  }
}
