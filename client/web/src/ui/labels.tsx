/** What a view says about its shape: the name, and what its colours mean. */
import { tint } from '../state';
import { type RAMPS, rampCss } from '../view/colors';

export function Name({ index, name, note }: { index: number; name: string; note: string }) {
  return (
    <div class="caption">
      <span class="dot" style={{ background: tint(index) }} aria-hidden="true" />
      <strong>{name}</strong>
      <span class="muted">{note}</span>
    </div>
  );
}

export function Legend({
  ramp,
  low,
  high,
  label,
}: {
  ramp: keyof typeof RAMPS;
  low: string;
  high: string;
  label: string;
}) {
  return (
    <div class="legend">
      <span class="ramp" style={{ background: rampCss(ramp) }} aria-hidden="true" />
      <span class="row spread">
        <span>{low}</span>
        <span>{high}</span>
      </span>
      <span class="muted">{label}</span>
    </div>
  );
}
