/**
 * Keeps the place of the keyboard. When the focused element is removed, hidden or disabled, browsers leave the focus on
 * the body, and the next Tab starts at the top of the page. Then a neighbour takes the focus instead.
 */
const FOCUSABLE = 'a[href], button, input, select, textarea, summary, [tabindex]';

const present = (e: HTMLElement) => e.isConnected && !e.matches(':disabled') && e.getClientRects().length > 0;
const usable = (e: HTMLElement) => e.tabIndex >= 0 && present(e);
const all = (region: ParentNode) => [...region.querySelectorAll<HTMLElement>(FOCUSABLE)];

/** The element that had the focus last, what holds it from the inside out, and the elements after and before it. */
let last: HTMLElement | null = null;
let holders: HTMLElement[] = [];
let after: HTMLElement[] = [];
let before: HTMLElement[] = [];
/** The element outside of dialogs that had the focus last. */
let outside: HTMLElement | null = null;

function remember(element: HTMLElement) {
  last = element;
  const list = all(document);
  const at = list.indexOf(element);
  after = list.slice(at + 1);
  before = list.slice(0, Math.max(at, 0)).reverse();
  holders = [];
  for (let up = element.parentElement; up && up !== document.body; up = up.parentElement) holders.push(up);
  if (!element.closest('dialog')) outside = element;
}

/** The element of a region that takes the focus: one marked for it, else the next one, the one before, or the first. */
function heirIn(region: HTMLElement): HTMLElement | undefined {
  const inside = (e: HTMLElement) => region.contains(e) && usable(e);
  const marked = region.querySelector<HTMLElement>('[data-takes-focus]');
  return (
    (marked && present(marked) ? marked : null) ?? after.find(inside) ?? before.find(inside) ?? all(region).find(usable)
  );
}

function check() {
  const { activeElement } = document;
  const nowhere = !activeElement || activeElement === document.body || activeElement === last;
  if (!last || !nowhere || present(last)) return;
  const wasInDialog = outside !== last && !holders.some((e) => e.isConnected && e.matches('dialog[open]'));
  if (wasInDialog && outside && present(outside)) return outside.focus({ preventScroll: true });
  for (const holder of holders) {
    const heir = holder.isConnected && heirIn(holder);
    if (heir) return heir.focus({ preventScroll: true });
  }
}

export function keepFocus() {
  document.addEventListener('focusin', ({ target }) => remember(target as HTMLElement));
  // a click beside everything removes the focus on purpose
  document.addEventListener('pointerdown', ({ target }) => {
    if (!(target as Element).closest?.(FOCUSABLE)) last = null;
  });
  let waits = false;
  new MutationObserver(() => {
    check();
    if (waits) return;
    waits = true;
    // styles that hide an element have an effect now
    requestAnimationFrame(() => {
      waits = false;
      check();
    });
  }).observe(document.body, { subtree: true, childList: true, attributeFilter: ['disabled', 'hidden', 'open'] });
}
