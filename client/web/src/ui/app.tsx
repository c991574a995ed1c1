/** The frame of the page: header, stage, inspector. */
import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';
import { readyShapes, set, state, type Tab } from '../state';
import { startMerge } from '../actions/merge';
import { addFiles } from '../actions/shapes';
import { redo, removeLandmark, undo } from '../actions/landmarks';
import { player } from '../player';
import { stage, stageHost } from '../view/shared';
import { applyTheme, theme, type Theme } from '../theme';
import { Button, Icon, useStateOfPage } from './parts';
import { ShapesInspector, ShapesStage } from './shapes';
import { LandmarksInspector, LandmarksStage } from './landmarks';
import { MorphInspector, MorphStage, switchWire } from './morph';
import { SpheresInspector, SpheresStage } from './spheres';
import { Drawer } from './drawers';
import { Action } from './action';
import { TokenDialog } from './token';
import { ask } from '../actions/token';

const TITLES: Record<Tab, string> = { shapes: 'Shapes', landmarks: 'Landmarks', morph: 'Morph', spheres: 'Spheres' };

export function App() {
  useStateOfPage();
  useShortcuts();
  useDrop();
  const empty = state.shapes.length === 0;
  return (
    <div class={`app${state.dragging ? ' dragging' : ''}${empty ? ' empty' : ''}`}>
      <Header />
      <main class="body">
        <StageArea />
        {!empty && (
          <aside class="inspector" aria-label={TITLES[state.tab]}>
            <div class="scroll" tabIndex={0} role="region" aria-label={`${TITLES[state.tab]}: settings`}>
              <Inspector />
            </div>
            <Action />
          </aside>
        )}
      </main>
      {state.drawer && <Drawer />}
      {state.asking && <TokenDialog />}
      <div class="toasts" role="status" aria-live="polite">
        {state.toasts.map((t) => (
          <div class={`toast ${t.kind}`} key={t.id}>
            <Icon name={t.kind === 'error' ? 'alert' : 'check'} />
            <span>{t.text}</span>
          </div>
        ))}
      </div>
    </div>
  );
}

function Header() {
  const [now, setNow] = useState<Theme>(theme());
  const next: Record<Theme, Theme> = { auto: 'dark', dark: 'light', light: 'auto' };
  const usable = (tab: Tab) =>
    tab === 'shapes' || (tab === 'morph' ? !!state.result : state.shapes.some((s) => s.state === 'ready'));
  return (
    <header class="header">
      <a class="brand" href="./" aria-label="orbmorph: start over">
        <svg viewBox="0 0 32 32" aria-hidden="true" class="logo">
          <circle cx="16" cy="16" r="13" />
          <path d="M3.600 19c6-5.500 18.500-5.500 24.800 0M16 3c-5.500 7.500-5.500 18.500 0 26M7.500 6.500c6 5 11 5 17 0" />
        </svg>
        <span>orbmorph</span>
      </a>
      {state.shapes.length > 0 && (
        <nav class="tabs" aria-label="Views">
          {(Object.keys(TITLES) as Tab[]).map((tab) => (
            <button
              type="button"
              key={tab}
              aria-current={state.tab === tab ? 'page' : undefined}
              disabled={!usable(tab)}
              onClick={() => set({ tab })}
            >
              {TITLES[tab]}
            </button>
          ))}
        </nav>
      )}
      <div class="tools">
        {state.token === 'kept' && <Button kind="quiet" icon="key" label="Token" onClick={() => ask()} />}
        <Button kind="quiet" icon="server" label="On the server" onClick={() => set({ drawer: 'server' })} />
        <Button
          kind="quiet"
          icon="theme"
          label={`Colours: ${now === 'auto' ? 'system' : now}`}
          onClick={() => {
            applyTheme(next[now]);
            setNow(next[now]);
            set();
          }}
        />
        <Button kind="quiet" icon="help" label="Help and keys" onClick={() => set({ drawer: 'help' })} />
      </div>
    </header>
  );
}

function StageArea() {
  const element = useRef<HTMLDivElement>(null);
  useLayoutEffect(() => {
    element.current!.prepend(stageHost);
    stage.draw();
  }, []);
  const views = { shapes: ShapesStage, landmarks: LandmarksStage, morph: MorphStage, spheres: SpheresStage };
  const View = views[state.tab];
  return (
    <div class="stage-area" ref={element}>
      <div class="views">
        <View />
      </div>
      {state.loading && (
        <div class="loading" role="status">
          <span class="spinner" aria-hidden="true" />
          {state.loading}
        </div>
      )}
      {state.dragging && (
        <div class="drop-here" aria-hidden="true">
          Drop to add
        </div>
      )}
    </div>
  );
}

function Inspector() {
  const parts = {
    shapes: ShapesInspector,
    landmarks: LandmarksInspector,
    morph: MorphInspector,
    spheres: SpheresInspector,
  };
  const Part = parts[state.tab];
  return <Part />;
}

/** Opens dropped files. Two or more on the first page are morphed at once, if all are accepted and nothing was done since. */
async function takeDropped(files: File[]) {
  const isFirst = !state.shapes.length;
  const { meshes: added, marks } = await addFiles(files);
  const { shapes, landmarks, tab, running, result } = state;
  const isAsDropped = shapes.length === added && (marks > 0 || !landmarks.length);
  const untouched = isAsDropped && tab === 'shapes' && !running && !result;
  if (isFirst && added > 1 && untouched && readyShapes().length === added) await startMerge();
}

function useDrop() {
  useEffect(() => {
    let depth = 0;
    const hasFiles = (event: DragEvent) => event.dataTransfer?.types.includes('Files');
    const enter = (event: DragEvent) => {
      if (!hasFiles(event)) return;
      if (depth++ === 0) set({ dragging: true });
    };
    const leave = () => {
      if (depth > 0 && --depth === 0) set({ dragging: false });
    };
    const over = (event: DragEvent) => hasFiles(event) && event.preventDefault();
    const drop = (event: DragEvent) => {
      if (!hasFiles(event)) return;
      event.preventDefault();
      depth = 0;
      set({ dragging: false });
      void takeDropped([...event.dataTransfer!.files]);
    };
    const all: [string, (event: never) => void][] = [
      ['dragenter', enter],
      ['dragleave', leave],
      ['dragover', over],
      ['drop', drop],
    ];
    for (const [name, listener] of all) addEventListener(name, listener as EventListener);
    return () => all.forEach(([name, listener]) => removeEventListener(name, listener as EventListener));
  }, []);
}

function useShortcuts() {
  useEffect(() => {
    const press = (event: KeyboardEvent) => {
      const target = event.target as HTMLElement;
      if (target.closest('input:not([type=range]):not([type=checkbox]), select, textarea')) return;
      const key = event.key.toLowerCase();
      if ((event.ctrlKey || event.metaKey) && key === 'z') {
        event.preventDefault();
        if (event.shiftKey) redo();
        else undo();
      } else if ((event.ctrlKey || event.metaKey) && key === 'y') {
        event.preventDefault();
        redo();
      } else if (event.ctrlKey || event.metaKey || event.altKey) return;
      else if (key === 'escape' && state.drawer) set({ drawer: null });
      else if (key === ' ' && state.result && !target.closest('button, summary, a')) {
        event.preventDefault();
        player.toggle();
      } else if (key === 'w' && state.result) switchWire();
      else if (
        (key === 'delete' || key === 'backspace') &&
        state.tab === 'landmarks' &&
        state.active !== null &&
        !target.closest('button')
      )
        removeLandmark(state.active);
      else if (/^[1-4]$/.test(key) && state.shapes.length) {
        const tab = (Object.keys(TITLES) as Tab[])[Number(key) - 1];
        if (tab !== 'morph' || state.result) set({ tab });
      }
    };
    addEventListener('keydown', press);
    return () => removeEventListener('keydown', press);
  }, []);
}
