/** A view of the stage with its caption and its landmarks as numbered buttons. */
import type { ComponentChildren } from 'preact';
import { useEffect, useLayoutEffect, useRef } from 'preact/hooks';
import { work } from '../mesh/work';
import type { Touched } from '../mesh/linked';
import type { Spot } from '../mesh/worker';
import { Loupe } from '../view/loupe';
import { stage } from '../view/shared';
import type { Marker, Ray, View } from '../view/stage';
import { BALL_SCALE, type Model } from '../view/models';
import { hue, set, state, type Shape, type SphereState } from '../state';
import { moveTo, pickOn, removeLandmark } from '../actions/landmarks';
import { isDark } from '../theme';

interface PaneProps {
  label: string;
  model: Model | null | undefined;
  wire?: boolean;
  pickable?: Shape;
  markers?: Shape;
  /** a point that the views have in common: where it is here, and what becomes of a place under the pointer */
  probe?: { spot: Touched | null; at: (ray: Ray | null) => void };
  /** a sphere whose landmarks the view shows */
  spots?: SphereState;
  children?: ComponentChildren;
}

export function Pane({ label, model, wire = false, pickable, markers, spots, probe, children }: PaneProps) {
  const element = useRef<HTMLDivElement>(null);
  const view = useRef<View | null>(null);

  useLayoutEffect(() => {
    view.current = stage.add(element.current!);
    return () => stage.remove(view.current!);
  }, []);

  useLayoutEffect(() => {
    model?.wireframe(wire, isDark() ? '#05070a' : '#20242c');
    view.current!.show(model ?? null);
    view.current!.onPick = pickable ? (ray) => void pickOn(pickable, ray.origin, ray.direction) : (probe?.at ?? null);
    view.current!.onHover = probe?.at ?? null;
    stage.draw();
  });

  return (
    <section class={`pane${pickable ? ' pickable' : ''}`} aria-label={label}>
      <div
        class="pane-view"
        ref={element}
        tabIndex={0}
        role="application"
        aria-roledescription="3D view"
        aria-label={`${label}. Arrow keys rotate, plus and minus zoom, 0 resets${pickable ? ', Enter sets a landmark at the centre' : probe ? ', Enter marks the place at the centre in all views' : ''}.`}
      >
        {markers && <Markers shape={markers} view={view} />}
        {probe?.spot && <Probe spot={probe.spot} view={view} />}
        {spots?.spots && spots.spots.size > 0 && <Spots spots={spots.spots} view={view} />}
      </div>
      {children}
    </section>
  );
}

const ARROWS: Record<string, [number, number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

function Markers({ shape, view }: { shape: Shape; view: { current: View | null } }) {
  const box = useRef<HTMLDivElement>(null);
  /** the landmark that is dragged, and where it is on the surface */
  const dragged = useRef<{ id: number; spot: Spot | null } | null>(null);
  /** ends the drag without moving anything */
  const release = useRef<(() => void) | null>(null);
  const here = state.landmarks
    .map((landmark, index) => ({ landmark, index }))
    .filter(({ landmark }) => landmark.at[shape.key]);

  useEffect(() => {
    const buttons = [...box.current!.children] as HTMLElement[];
    view.current!.markers = here.map(({ landmark }, i): Marker => {
      const { spot } = dragged.current?.id === landmark.id ? dragged.current : { spot: null };
      return { ...(spot ?? landmark.at[shape.key]), element: buttons[i] };
    });
    stage.draw();
  });

  useEffect(() => () => release.current?.(), []);
  // a landmark may go while it is dragged: by its key, by Undo, with the list
  useEffect(() => {
    if (dragged.current && !here.some(({ landmark }) => landmark.id === dragged.current!.id)) release.current?.();
  });

  const drag = (id: number) => (event: PointerEvent) => {
    event.preventDefault();
    event.stopPropagation();
    if (dragged.current) return; // a second finger
    set({ active: id });
    const button = event.currentTarget as HTMLElement;
    button.focus();
    button.setPointerCapture(event.pointerId);
    const from = { x: event.clientX, y: event.clientY };
    const now: { id: number; spot: Spot | null } = { id, spot: null };
    dragged.current = now;
    let loupe: Loupe | null = null;
    let next: Ray | null = null;
    let sliding = Promise.resolve();
    /** Keeps the marker on the surface under the pointer; off the surface it stays where it was. */
    const slide = async (x: number, y: number) => {
      while (next) {
        const { origin, direction } = next;
        next = null;
        const spot = await work('pick', shape.key, origin, direction).catch(() => null);
        if (!spot || !view.current || dragged.current !== now) continue;
        now.spot = spot;
        const marker = view.current.markers.find(({ element }) => element === button);
        if (marker) Object.assign(marker, spot);
        loupe?.at(spot, x, y);
        view.current.stage.draw();
      }
    };
    const listening = new AbortController();
    const stop = () => {
      listening.abort();
      loupe?.close();
      loupe = null;
      if (dragged.current === now) dragged.current = null;
      release.current = null;
    };
    release.current = stop;
    const move = (to: PointerEvent) => {
      if (to.pointerId !== event.pointerId || !view.current) return;
      if (!now.spot && Math.hypot(to.clientX - from.x, to.clientY - from.y) < 4) return;
      const around = view.current.element.getBoundingClientRect();
      if (event.pointerType === 'touch') loupe ??= new Loupe(view.current);
      const waits = next !== null;
      next = view.current.rayAt(to.clientX, to.clientY);
      if (!waits) sliding = sliding.then(() => slide(to.clientX - around.left, to.clientY - around.top));
    };
    const drop = async (to: PointerEvent) => {
      if (to.pointerId !== event.pointerId) return;
      listening.abort();
      await sliding;
      if (dragged.current !== now) return;
      stop();
      if (now.spot && to.type === 'pointerup') moveTo(id, shape, now.spot);
      else set();
    };
    // on the window: events also come from there once the button is gone
    const { signal } = listening;
    window.addEventListener('pointermove', move, { signal });
    window.addEventListener('pointerup', drop, { signal });
    window.addEventListener('pointercancel', drop, { signal });
  };

  /** Slides a marker on the surface by some pixels of the view; where there is no surface, it stays. */
  const nudge = async (id: number, button: HTMLElement, dx: number, dy: number) => {
    const at = button.getBoundingClientRect();
    const ray = view.current!.rayAt(at.left + at.width / 2 + dx, at.top + at.height / 2 + dy);
    const spot = await work('pick', shape.key, ray.origin, ray.direction);
    if (spot) moveTo(id, shape, spot);
  };

  return (
    <div class="markers" ref={box}>
      {here.map(({ landmark, index }) => (
        <button
          type="button"
          key={landmark.id}
          class="marker"
          aria-pressed={landmark.id === state.active}
          style={{ '--hue': hue(index) }}
          aria-label={`Landmark ${index + 1}${landmark.name ? `, ${landmark.name},` : ''} on ${shape.name}. Arrow keys move it, Delete removes it.`}
          onPointerDown={drag(landmark.id)}
          onClick={() => set({ active: landmark.id })}
          onKeyDown={(event) => {
            const [dx, dy] = ARROWS[event.key] ?? [0, 0];
            const step = event.shiftKey ? 1 : 6; // pixels
            if (event.key === 'Delete' || event.key === 'Backspace') removeLandmark(landmark.id);
            else if (dx || dy) void nudge(landmark.id, event.currentTarget, step * dx, step * dy);
            else return;
            event.preventDefault();
          }}
        >
          {index + 1}
        </button>
      ))}
    </div>
  );
}

/** Landmarks on a sphere: numbers that cannot be moved. */
function Spots({ spots, view }: { spots: Map<number, [number, number, number]>; view: { current: View | null } }) {
  const box = useRef<HTMLDivElement>(null);
  const here = state.landmarks
    .map((landmark, index) => ({ landmark, index }))
    .filter(({ landmark }) => spots.has(landmark.id));
  useEffect(() => {
    const marks = [...box.current!.children] as HTMLElement[];
    view.current!.markers = here.map(({ landmark }, i): Marker => {
      const normal = spots.get(landmark.id)!;
      return { position: normal.map((x) => x * BALL_SCALE) as [number, number, number], normal, element: marks[i] };
    });
    stage.draw();
    return () => void (view.current && (view.current.markers = []));
  });
  return (
    <div class="markers" ref={box} aria-hidden="true">
      {here.map(({ landmark, index }) => (
        <span key={landmark.id} class="marker small" style={{ '--hue': hue(index) }}>
          {index + 1}
        </span>
      ))}
    </div>
  );
}

/** A point that the views have in common. */
function Probe({ spot, view }: { spot: Touched; view: { current: View | null } }) {
  const dot = useRef<HTMLSpanElement>(null);
  useEffect(() => {
    view.current!.markers = [{ ...spot, element: dot.current! }];
    stage.draw();
    return () => {
      if (view.current) view.current.markers = [];
    };
  }, [spot]);
  return (
    <div class="markers" aria-hidden="true">
      <span ref={dot} class="marker probe" />
    </div>
  );
}
