/**
 * Tokens. The page first sends a request that needs one, so that it asks for a token before anything else. It keeps the
 * token as long as the tab is open and sends it only in the header, never in a URL.
 */
import { ProblemError } from 'orbmorph';
import { client, set, state } from '../state';

const KEY = 'orbmorph.token';

function kept(): string | undefined {
  try {
    return sessionStorage.getItem(KEY) ?? undefined;
  } catch {
    return undefined; // the browser may forbid storage
  }
}

function keep(token: string | undefined) {
  client.token = token;
  try {
    if (token) sessionStorage.setItem(KEY, token);
    else sessionStorage.removeItem(KEY);
  } catch {
    // the token then lasts as long as the page
  }
}

let entered: (() => void) | null = null;

/** Waits for access: until the user enters a valid token if the daemon requires one. */
export async function waitForAccess() {
  keep(kept());
  try {
    await client.page('jobs', { limit: 1 });
    if (client.token) set({ token: 'kept' });
  } catch (error) {
    if (!isAsking(error)) return client.token ? set({ token: 'kept' }) : undefined;
    ask(client.token ? 'The daemon no longer knows the token of this tab.' : null);
    await new Promise<void>((resolve) => (entered = resolve));
  }
}

/** Tries a token. Returns a message if the daemon does not accept it. */
export async function tryToken(token: string): Promise<string | null> {
  const before = client.token;
  client.token = token;
  try {
    await client.page('jobs', { limit: 1 });
  } catch (error) {
    if (error instanceof ProblemError && error.status === 401) {
      client.token = before;
      return 'The daemon does not know this token.';
    }
    if (!(error instanceof ProblemError) || error.status !== 403) {
      client.token = before;
      return (error as Error).message;
    }
    // valid, but without the scope to read; each later refusal names its scope
  }
  keep(token);
  set({ token: 'kept', asking: null, problem: null });
  entered?.();
  entered = null;
  return null;
}

export function forgetToken() {
  keep(undefined);
  location.reload();
}

export const ask = (reason: string | null = null) => set({ asking: { reason } });

const isAsking = (error: unknown) => error instanceof ProblemError && error.status === 401;

const NEEDS: Record<string, string> = {
  read: 'list what is on the server',
  write: 'upload, morph, cancel or delete',
  admin: 'do this',
};

/** The message for an error. Asks for a token if the error is a missing one. */
export function explain(error: unknown): string {
  if (isAsking(error)) {
    if (!state.asking) ask(client.token ? 'The daemon no longer knows the token.' : null);
    return 'The daemon requires a token.';
  }
  if (error instanceof ProblemError && error.status === 403) {
    const scope = String(error.problem.scope ?? 'write');
    return `The token lacks the scope “${scope}”, which is needed to ${NEEDS[scope] ?? 'do this'}. Use a token that has it.`;
  }
  return error instanceof ProblemError ? error.detail || error.title : (error as Error).message;
}
