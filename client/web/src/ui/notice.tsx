/** What went wrong with the last morph or link. */
import { set, state } from '../state';
import { Button, Icon } from './parts';

export function Notice() {
  const { problem } = state;
  if (!problem) return null;
  return (
    <div class="notice error" role="alert">
      <Icon name="alert" />
      <div>
        <strong>{problem.title}</strong>
        <p>{problem.detail}</p>
      </div>
      <Button kind="quiet" icon="close" label="Dismiss" onClick={() => set({ problem: null })} />
    </div>
  );
}
