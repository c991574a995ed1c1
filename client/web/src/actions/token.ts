/**
 * Tokens: a daemon that wants one is asked for what needs it first, so that the page can ask for a token before anything
 * else. It is kept for as long as the tab is open, and sent in the header only, never in an address.
 */
import { ProblemError } from 'orbmorph';
import { client, set, state } from '../state';

const KEY = 'orbmorph.token';

function kept(): string | undefined {
  try {
    return sessionStorage.getItem(KEY) ?? undefined;
  } catch {
    return undefined; // storage may be switched off
  }
}

function keep(token: string | undefined) {
  client.token = token;
  try {
    if (token) sessionStorage.setItem(KEY, token);
    else sessionStorage.removeItem(KEY);
  } catch {
    // it then lasts as long as the page
  }
}

let entered: (() => void) | null = null;

/** Until the daemon answers: at once where it wants no token, or when one that it knows has been entered. */
export async function enter() {
  keep(kept());
  try {
    await client.page('jobs', { limit: 1 });
    if (client.token) set({ token: 'kept' });
  } catch (error) {
    if (!isAsking(error)) return client.token ? set({ token: 'kept' }) : undefined;
    ask(client.token ? 'The token of this tab is not known here any more.' : null);
    await new Promise<void>((resolve) => (entered = resolve));
  }
}

/** Tries a token; a message where it is of no use. */
export async function tryToken(token: string): Promise<string | null> {
  const before = client.token;
  client.token = token;
  try {
    await client.page('jobs', { limit: 1 });
  } catch (error) {
    if (error instanceof ProblemError && error.status === 401) {
      client.token = before;
      return 'This token is not known here.';
    }
    if (!(error instanceof ProblemError) || error.status !== 403) {
      client.token = before;
      return (error as Error).message;
    }
    // it is known, but may not read: what it may do will show
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
  read: 'see what is on the server',
  write: 'upload, morph, cancel or delete',
  admin: 'do this',
};

/** What to say of an error; asks for a token where that is what is missing. */
export function explain(error: unknown): string {
  if (isAsking(error)) {
    if (!state.asking) ask(client.token ? 'The token is not known here any more.' : null);
    return 'The daemon wants a token.';
  }
  if (error instanceof ProblemError && error.status === 403) {
    const scope = String(error.problem.scope ?? 'write');
    return `The token lacks the scope “${scope}”, which is needed to ${NEEDS[scope] ?? 'do this'}. Use a token that has it.`;
  }
  return error instanceof ProblemError ? error.detail || error.title : (error as Error).message;
}
