/**
 * A problem that the daemon returned (RFC 9457). `type` is the URI of the problem type, `kind` its last part
 * ("not-closed"), `problem` the whole problem object with its details.
 */
export class ProblemError extends Error {
  constructor(problem, status) {
    super(problem.detail || problem.title || `The daemon returned status ${status}.`);
    this.name = 'ProblemError';
    this.problem = problem;
    this.type = problem.type || 'about:blank';
    this.kind = this.type.slice(this.type.lastIndexOf('/') + 1);
    this.title = problem.title || '';
    this.detail = problem.detail || '';
    this.status = problem.status || status || 0;
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
