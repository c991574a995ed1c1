// A morph compared with its shapes, their spheres and their errors.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { browser, daemon } from './started.mjs';
import { landmarked, landmarks, morph, seek } from './steps.mjs';
import { difference, shot } from './pictures.mjs';
import { addFiles, button, counted, openPage, sample, settled, until } from './support.mjs';

test('side by side, the morph moves between its shapes under one camera', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  await landmarked(page);
  await morph(page);
  await button(page, 'Pause').click();
  await button(page, 'Side by side').click();
  await until(async () => (await page.locator('.pane').count()) === 3, 'three views');
  assert.deepEqual(await page.locator('.pane .caption strong').allInnerTexts(), ['dog', 'Morph', 'giraffe']);
  /** The three views without their captions. */
  const views = async () => {
    await settled(page);
    const boxes = await page
      .locator('.pane-view')
      .evaluateAll((all) => all.map((e) => e.getBoundingClientRect().toJSON()));
    const width = Math.floor(Math.min(...boxes.map((box) => box.width))) - 4;
    const view = ({ x, y, height }) =>
      shot(page, { x: Math.round(x) + 2, y: Math.round(y) + 44, width, height: Math.floor(height) - 48 });
    return [await view(boxes[0]), await view(boxes[1]), await view(boxes[2])];
  };
  const apart = (a, b) => difference(browser, a, b);
  await seek(page, 0);
  const start = await views();
  assert.ok((await apart(start[0], start[1])) < 0.01, 'at its start the morph is the first shape');
  assert.ok((await apart(start[1], start[2])) > 0.03, 'and not the second');
  await seek(page, 1);
  const end = await views();
  assert.ok((await apart(end[1], end[2])) < 0.01, 'at its end it is the second shape');
  assert.ok((await apart(end[0], start[0])) < 0.002 && (await apart(end[2], start[2])) < 0.002, 'the shapes stay');
  await seek(page, 0.5);
  const middle = await views();
  assert.ok((await apart(middle[1], start[0])) > 0.01 && (await apart(middle[1], end[2])) > 0.01, 'between both');
  // a place of one shape is marked on the others
  const marks = async () => {
    await settled(page);
    return page.locator('.marker.probe').evaluateAll((all) =>
      all.map((e) => {
        const [box, of] = [e.getBoundingClientRect(), e.closest('.pane-view').getBoundingClientRect()];
        return [box.x + box.width / 2 - of.x, box.y + box.height / 2 - of.y];
      }),
    );
  };
  const near = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]) < 2.5; // pixels; views differ by one in width
  const view = await page.locator('.pane-view').first().boundingBox();
  const inside = [view.width * 0.5, view.height * 0.58]; // on the dog's flank
  await seek(page, 0);
  await page.mouse.move(view.x + inside[0], view.y + inside[1]);
  await until(async () => (await page.locator('.marker.probe').count()) === 3, 'the place is marked');
  const [dog, same, other] = await marks();
  assert.ok(near(dog, inside) && near(dog, same) && !near(dog, other), `${[dog, same, other]}`);
  await seek(page, 1);
  await until(async () => near((await marks())[1], other), 'the mark of the morph goes along');
  await page.mouse.move(view.x + 4, view.y + 4);
  await until(async () => (await page.locator('.marker.probe').count()) === 0, 'none beside the shape');
  await page.locator('.pane-view').nth(2).focus();
  await page.keyboard.press('Enter');
  const centre = [view.width / 2, view.height / 2]; // on the giraffe's
  await until(async () => near((await marks())[2] ?? [0, 0], centre), 'the keyboard marks the centre');
  await page.mouse.move(view.x + 5, view.y + 5); // nothing is marked in the pictures below
  await until(async () => (await page.locator('.marker.probe').count()) === 0, 'the mouse takes it away');
  await seek(page, 0.5);
  await page.locator('.pane-view').nth(1).focus();
  for (let i = 0; i < 5; i++) await page.keyboard.press('ArrowLeft');
  await page.getByRole('slider', { name: 'Along the morph' }).focus(); // so that no view has a ring
  const turned = await views();
  for (const k of [0, 1, 2]) assert.ok((await apart(turned[k], middle[k])) > 0.01, `view ${k} has rotated`);
  await until(() => page.url().includes('show=beside'), 'the address says so');
  await page.reload();
  await until(async () => (await page.locator('.pane').count()) === 3, 'three views after a reload');
  await done();
});

test('linked cameras rotate together, others alone', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  const views = async () => {
    await settled(page);
    return [await shot(page.locator('.pane').nth(0)), await shot(page.locator('.pane').nth(1))];
  };
  const turn = async () => {
    await page.locator('.pane-view').first().focus();
    for (let i = 0; i < 5; i++) await page.keyboard.press('ArrowLeft');
  };
  await page.locator('.pane-view').first().focus();
  const first = await views();
  await turn();
  const second = await views();
  for (const k of [0, 1]) assert.ok((await difference(browser, first[k], second[k])) > 0.01, `view ${k} has rotated`);
  await page.getByRole('switch', { name: 'Link the cameras' }).click();
  await page.locator('.pane-view').first().focus();
  const third = await views();
  await turn();
  const fourth = await views();
  assert.ok((await difference(browser, third[0], fourth[0])) > 0.01, 'the focused view has rotated');
  assert.ok((await difference(browser, third[1], fourth[1])) < 0.002, 'the other has not');
  await done();
});

test('spheres before and after the alignment: certified, painted, measured', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  await landmarked(page);
  const count = await landmarks(page).count();
  await button(page, 'Spheres').click();
  await counted(page.getByText('Certified one to one'), 2, 'both are embedded');
  assert.ok(await button(page, 'After', { exact: true }).isDisabled(), 'there is no morph yet');
  const shots = [];
  for (const name of ['Normals', 'Checkerboard', 'Stretch', 'Areas']) {
    await button(page, name).click();
    await settled(page);
    shots.push(await shot(page.locator('.stage-area')));
  }
  for (let i = 1; i < shots.length; i++)
    assert.ok((await difference(browser, shots[i - 1], shots[i])) > 0.03, `paint ${i} differs from the one before`);
  assert.equal(await page.getByRole('img', { name: /^Histogram/ }).count(), 2);

  // The position of each landmark on the two spheres, in pixels of its own view.
  const spots = () =>
    page.evaluate(() =>
      [...document.querySelectorAll('.pane-view:has(.marker.small)')].map((view) => {
        const box = view.getBoundingClientRect();
        return [...view.querySelectorAll('.marker.small')].map((mark) => {
          const m = mark.getBoundingClientRect();
          return [m.x + m.width / 2 - box.x, m.y + m.height / 2 - box.y];
        });
      }),
    );
  const gap = ([a, b]) => Math.max(...a.map((p, i) => Math.hypot(p[0] - b[i][0], p[1] - b[i][1])));
  const before = await spots();
  assert.deepEqual(
    before.map((list) => list.length),
    [count, count],
  );
  assert.ok(gap(before) > 20, 'before the alignment the spheres do not correspond');
  await morph(page);
  await button(page, 'Pause').click();
  await button(page, 'Spheres').click();
  await button(page, 'After', { exact: true }).click();
  await counted(page.getByText('on the common sphere'), 2, 'the aligned spheres');
  await counted(page.locator('.marker.small'), 2 * count, 'with their landmarks');
  await settled(page);
  assert.ok(gap(await spots()) < 1, 'after the alignment landmarks coincide');
  await until(() => /side=after/.test(page.url()), 'the URL says so');
  const shown = await shot(page.locator('.pane').nth(1));
  await page.reload();
  await counted(page.getByText('on the common sphere'), 2, 'also after a reload');
  await counted(page.locator('.marker.small'), 2 * count, 'with their landmarks');
  await settled(page);
  await until(
    async () => (await difference(browser, shown, await shot(page.locator('.pane').nth(1)))) < 0.01,
    'it looks the same',
  );
  await done();
});

test('the error of the common mesh is measured and below the tolerance', async () => {
  const { page, done } = await openPage(browser, daemon.url);
  await addFiles(page, sample('dog.obj'), sample('giraffe.off'));
  await page.getByText('Options', { exact: true }).click();
  await button(page, 'As in the files').click();
  await morph(page);
  await button(page, 'Error').click();
  await counted(page.locator('.pane .legend'), 2, 'both shapes are measured');
  const captions = await page.locator('.pane .caption').allInnerTexts();
  for (const text of captions) {
    const percent = Number(text.match(/largest ([\d.e+-]+) %/)[1]);
    assert.ok(percent <= 0.1 * 1.05 + 1e-6, `${percent} % is within the tolerance of 0.1 %`);
  }
  await done();
});
