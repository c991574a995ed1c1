/** The dialog that asks for the daemon's token. */
import { useLayoutEffect, useRef, useState } from 'preact/hooks';
import { client, set, state } from '../state';
import { forgetToken, tryToken } from '../actions/token';
import { Button, Icon } from './parts';

export function TokenDialog() {
  const dialog = useRef<HTMLDialogElement>(null);
  const [message, setMessage] = useState(state.asking!.reason);
  const [busy, setBusy] = useState(false);
  const must = !client.token;
  useLayoutEffect(() => dialog.current!.showModal(), []);
  const send = async (event: Event) => {
    event.preventDefault();
    const token = new FormData(event.currentTarget as HTMLFormElement).get('token') as string;
    if (!token.trim()) return;
    setBusy(true);
    setMessage(await tryToken(token.trim()));
    setBusy(false);
  };
  return (
    <dialog
      ref={dialog}
      class="ask"
      aria-labelledby="ask-title"
      onCancel={(event) => must && event.preventDefault()}
      onClose={() => set({ asking: null })}
    >
      <form class="ask-in" onSubmit={(event) => void send(event)}>
        <h2 id="ask-title">This daemon requires a token</h2>
        <p class="hint">
          Its operator creates one with <code>orbmorphd token add</code>. The token stays in this tab until you close
          it.
        </p>
        <label class="field">
          <span class="field-name">Token</span>
          <input type="password" name="token" autocomplete="off" spellcheck={false} required />
        </label>
        {message && (
          <p class="notice error" role="alert">
            <Icon name="alert" />
            <span>{message}</span>
          </p>
        )}
        <div class="row spread gap-top">
          {client.token ? (
            <Button kind="quiet" onClick={forgetToken}>
              Forget the current token
            </Button>
          ) : (
            <span />
          )}
          <button type="submit" class="button primary" disabled={busy}>
            Continue
          </button>
        </div>
      </form>
    </dialog>
  );
}
