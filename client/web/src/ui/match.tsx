/** What the answer says about the map: how sure the match is, and where the map may be wrong. */
import { landmarkName, set, state, type Result } from '../state';
import { followSuggestion } from '../actions/landmarks';
import { flipMatch, flippedOf, nextMatch } from '../actions/merge';
import { isWord, sideOf } from '../mesh/others';
import { player } from '../player';
import { count, relative } from '../words';
import { Button } from './parts';

/** Another match lowers the confidence if it costs less than twice as much. Others are not worth a word. */
const CREDIBLE = 2;

/** What may be otherwise, in words, by the best other match that has any: "the tail of dog may be the … of giraffe". */
function doubtOf({ matches, supermesh: { shapes, match } }: Result): string | null {
  if (!matches?.told || matches.at > 0 || match?.part) return null; // the first other match of a part is of the wholes
  const { landmarks, others } = matches.told;
  for (const { cost, shape, swaps, flips } of others) {
    if (cost > CREDIBLE) continue;
    const clear = swaps.find(({ from, to }) => {
      const [a, b] = [landmarks[from], landmarks[to]];
      return isWord(a) && isWord(b) && (!flips || sideOf(a) * sideOf(b) < 0);
    });
    const words =
      clear &&
      `the ${landmarks[clear.from]} of ${shapes[0].name} may be the ${landmarks[clear.to]} of ${shapes[shape].name}`;
    if (flips) return `left and right may be swapped${words ? `: ${words}` : ''}`;
    if (words) return words;
  }
  return null;
}

function sentenceOf(result: Result): string {
  const { matches, supermesh } = result;
  const verdict = supermesh.match?.verdict;
  const doubt = doubtOf(result);
  if (verdict === 'unsure')
    return `Not sure: ${doubt ?? 'the shapes may be matched wrongly'}. Look at it, try the next match, or set landmarks.`;
  if (verdict === 'likely')
    return `The match looks plausible, but ${doubt ? `${doubt}. Check` : 'check'} it before you rely on it.`;
  if (verdict === 'sure') return 'The match is sure.';
  return matches && matches.at > 0
    ? `Match ${matches.at + 1} of ${matches.requests.length}; the first one was the best.`
    : '';
}

/** How sure the match of the shapes is, and ways to look at it and to the next ones. */
export function Match({ result }: { result: Result }) {
  const { matches, supermesh } = result;
  const said = sentenceOf(result);
  if (!said && !matches) return null;
  return (
    <div class="match">
      {said && (
        <p class="hint" role="status" aria-label="How sure the match is">
          {said}
        </p>
      )}
      <div class="row wrap">
        {matches && (
          <Button disabled={!!state.running} onClick={() => void nextMatch()}>
            Next match
          </Button>
        )}
        {matches && flippedOf(matches) > 0 && (
          <Button
            disabled={!!state.running}
            title="The match that has left and right swapped, and back"
            onClick={() => void flipMatch()}
          >
            Flip
          </Button>
        )}
        {supermesh.match && supermesh.match.verdict !== 'sure' && state.show !== 'stretch' && (
          <Button
            title="Where the morph stretches the surface and the map is least reliable"
            onClick={() => {
              player.pause();
              set({ show: 'stretch' });
            }}
          >
            Heat map
          </Button>
        )}
      </div>
    </div>
  );
}

/** Landmarks that may be misplaced, and where they would lie. */
export function Suspects({ result }: { result: Result }) {
  const { shapes, suspects = [] } = result.supermesh;
  if (!suspects.length) return null;
  return (
    <ul class="hint" aria-label="Landmarks that may be misplaced">
      {suspects.map((suspect) => {
        const { landmark, name, shape, share, distance_relative: far } = suspect;
        const called = landmarkName(name, landmark);
        return (
          <li key={`${shape} ${landmark}`}>
            {`${called} may be misplaced: ${Math.round(100 * share)} % of the distortion is around it. On ${
              shapes[shape].name
            } it would lie ${Math.round(100 * far)} % of the diagonal away. `}
            <Button
              kind="quiet"
              title={`Moves ${called} to where the surface around it suggests. Undo takes it back.`}
              onClick={() => void followSuggestion(result, suspect)}
            >
              Move it there
            </Button>
          </li>
        );
      })}
    </ul>
  );
}

/** Degrees of the up axis beyond which a fit laid a shape down or stood it on its head. */
const OVER = 60;

/** What the fit did to shapes whose up axis it rotated far. */
export function Rotated({ result: { supermesh } }: { result: Result }) {
  const over = supermesh.shapes.filter(({ fit }) => (fit?.up_degrees ?? 0) > OVER);
  if (!over.length) return null;
  return (
    <ul class="hint" aria-label="Shapes that the fit rotated">
      {over.map(({ name, fit }) => (
        <li key={name}>
          {`The fit rotated the up axis of ${name} by ${Math.round(fit!.up_degrees)}°. If that is wrong, set landmarks, or choose another fit under Options.`}
        </li>
      ))}
    </ul>
  );
}

/** The share of the surface that may get thin halfway: a patch or two are hardly seen. */
const THIN_MOST = 0.01;

/** Where the map between two shapes is bad. */
export function Warnings({ result: { supermesh } }: { result: Result }) {
  const { shapes } = supermesh;
  const isRigid = supermesh.request?.asset?.path === 'rigid'; // what gets thin does so on the straight path only
  const warnings = (supermesh.warnings ?? []).filter(
    ({ kind, share }) => kind !== 'thin' || (!isRigid && share > THIN_MOST),
  );
  if (!warnings.length) return null;
  const place = ({ shape, centre, radius }: (typeof warnings)[0]['parts'][0]['at'][0]) =>
    `around (${centre.map((x) => Number(x.toPrecision(3))).join(', ')}) of ${shapes[shape].name}, within ${Number(radius.toPrecision(2))}`;
  return (
    <ul class="hint" aria-label="Warnings of the map">
      {warnings.map(({ kind, a, b, share, parts }) => (
        <li key={`${kind}${a}${b}`}>
          {`From ${shapes[a].name} to ${shapes[b].name}, ${Number((100 * share).toPrecision(2))} % of the surface ${
            kind === 'thin' ? 'gets thin halfway, where a limb is twisted or rotated far' : 'is stretched badly'
          }: look ${place(parts[0].at[0])}. ${
            kind === 'thin'
              ? 'A landmark there helps against a twist, the path “As rigid as possible” against a rotation.'
              : 'A landmark there may help.'
          }`}
        </li>
      ))}
    </ul>
  );
}

/** Where a template has too few triangles for the other shapes. */
export function Coarse({ result: { supermesh } }: { result: Result }) {
  const [first, ...others] = supermesh.shapes;
  const missed = others.filter(({ coarse }) => coarse);
  if (!missed.length) return null;
  return (
    <>
      <ul class="hint" aria-label="Where the mesh is too coarse">
        {missed.map(({ name, coarse }) => (
          <li key={name}>
            {`The mesh of ${first.name} is too coarse for ${name}: ${count(coarse!.count)} of its triangles, ${Number(
              (100 * coarse!.share).toPrecision(2),
            )} % of the surface, miss it by more than the tolerance${
              coarse!.errors_relative.length ? `, by up to ${relative(coarse!.errors_relative[0])}` : ''
            }. Subdivide it there.`}
          </li>
        ))}
      </ul>
      {state.show !== 'error' && (
        <div class="row">
          <Button
            title="A heat map of the distance, on the mesh"
            onClick={() => {
              player.pause();
              set({ show: 'error' });
            }}
          >
            Show where
          </Button>
        </div>
      )}
    </>
  );
}
