/**
 * A problem that the daemon returned (RFC 9457). `type` is the URI of the problem type, `kind` its last part
 * ("not-closed"), `problem` the whole problem object with its details. `retryAfter`: seconds after which to try again, or
 * null. `requestId`: the number of the request in the daemon's log, or null.
 */
export class ProblemError extends Error {
  constructor(problem, status, headers) {
    super(problem.detail || problem.title || `The daemon returned status ${status}.`);
    this.name = 'ProblemError';
    this.problem = problem;
    this.type = problem.type || 'about:blank';
    this.kind = this.type.slice(this.type.lastIndexOf('/') + 1);
    this.title = problem.title || '';
    this.detail = problem.detail || '';
    this.status = problem.status || status || 0;
    const seconds = headers?.get('Retry-After');
    this.retryAfter = /^\d+$/.test(seconds ?? '') ? Number(seconds) : null;
    this.requestId = headers?.get('X-Request-Id') ?? null;
  }
}

/** The daemon is unreachable, or the connection broke. */
export class UnreachableError extends Error {
  constructor(url, cause) {
    super(`No response from ${url || 'the daemon'}. Is orbmorphd running there?`, { cause });
    this.name = 'UnreachableError';
    this.url = url;
  }
}

/** The daemon is running, but does not let pages of this origin in. */
export class CorsError extends UnreachableError {
  constructor(url, cause) {
    super(url, cause);
    const { origin } = location;
    this.message = `The daemon at ${new URL(url).origin} does not allow pages of ${origin}. Start it with --cors ${origin}.`;
    this.name = 'CorsError';
  }
}

/**
 * Why a request failed without a response. A browser hides that from a page of another origin; if a request without CORS
 * arrives, the daemon is running. -> CorsError or UnreachableError
 */
export async function unreachable(url, cause, fetch) {
  if (typeof location !== 'undefined' && location.origin && /^https?:/.test(url)) {
    const { origin } = new URL(url);
    const arrives = () =>
      fetch(`${origin}/livez`, { mode: 'no-cors' }).then(
        () => true,
        () => false,
      );
    if (origin !== location.origin && (await arrives())) return new CorsError(url, cause);
  }
  return new UnreachableError(url, cause);
}

/** The job was cancelled, but not by this call. */
export class CancelledError extends Error {
  constructor(job) {
    super('The job was cancelled.');
    this.name = 'CancelledError';
    this.job = job;
  }
}

export function abortError(signal) {
  if (signal?.reason instanceof Error) return signal.reason;
  return new DOMException('The operation was aborted.', 'AbortError');
}

export const isAbort = (error) => error?.name === 'AbortError' || error?.name === 'TimeoutError';
