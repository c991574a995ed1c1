/** Light, dark or the system's choice; stored for the next visit. */
import { stage } from './view/shared';

export type Theme = 'auto' | 'light' | 'dark';
const KEY = 'orbmorph.theme';

export function theme(): Theme {
  try {
    const kept = localStorage.getItem(KEY);
    return kept === 'light' || kept === 'dark' ? kept : 'auto';
  } catch {
    return 'auto';
  }
}

export function applyTheme(next: Theme = theme()) {
  try {
    localStorage.setItem(KEY, next);
  } catch {
    // the browser may forbid storage; the choice then lasts as long as the page
  }
  if (next === 'auto') delete document.documentElement.dataset.theme;
  else document.documentElement.dataset.theme = next;
  stage.draw();
}

export const isDark = () => getComputedStyle(document.documentElement).colorScheme === 'dark';
