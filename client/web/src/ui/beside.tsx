/** The morph between the two shapes that it blends now, in one frame and under one camera, with a linked point. */
import { useEffect, useRef, useState } from 'preact/hooks';
import { state, type Result } from '../state';
import { player } from '../player';
import { work } from '../mesh/work';
import type { Touched } from '../mesh/linked';
import type { Ray } from '../view/stage';
import { Name } from './labels';
import { Pane } from './pane';

/** The place that the pointer marks in one of the views, on all of them. */
function useLinked(result: Result, from: number) {
  const [spots, setSpots] = useState<Touched[] | null>(null);
  const aim = useRef<{ view: number; ray: Ray } | null>(null);
  const mark = useRef<(view: number, ray: Ray | null) => void>(() => {});
  const leg = useRef(from);
  leg.current = from;
  useEffect(() => {
    let alive = true;
    let asking = false;
    let again = false;
    const ask = async () => {
      again = asking;
      if (asking) return;
      asking = true;
      do {
        again = false;
        const { shapes } = result.data;
        const weights = [shapes[leg.current], player.weights, shapes[leg.current + 1]];
        const now = aim.current;
        const found = now && (await work('touch', result.supermesh.id, weights[now.view], now.ray, weights));
        if (!alive) return;
        setSpots(aim.current ? found : null);
      } while (again);
      asking = false;
    };
    mark.current = (view, ray) => {
      aim.current = ray && { view, ray };
      void ask();
    };
    const forget = player.listen(() => aim.current && void ask());
    return () => {
      alive = false;
      forget();
    };
  }, [result]);
  return (view: number) => ({ spot: spots?.[view] ?? null, at: (ray: Ray | null) => mark.current(view, ray) });
}

export function Beside({ result }: { result: Result }) {
  const { shapes } = result.supermesh;
  const [leg, setLeg] = useState(0);
  useEffect(
    () => player.listen((time) => setLeg(Math.min(Math.floor(time * (shapes.length - 1)), shapes.length - 2))),
    [result],
  );
  const from = Math.min(leg, shapes.length - 2); // another morph may have fewer shapes
  const linked = useLinked(result, from);
  const side = (i: number) => (
    <Pane
      key={`side${i}`}
      label={shapes[i].name}
      model={result.each[i]}
      wire={state.wire}
      probe={linked(i === from ? 0 : 2)}
    >
      <Name index={i} name={shapes[i].name} note="" />
    </Pane>
  );
  return (
    <div class="grid" data-count={3}>
      {side(from)}
      <Pane key="main" label="Morph" model={result.main} wire={state.wire} probe={linked(1)}>
        <div class="caption">
          <strong>Morph</strong>
        </div>
      </Pane>
      {side(from + 1)}
    </div>
  );
}
