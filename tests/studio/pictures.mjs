// Takes pictures, compares them and counts their pixels. Chromium decodes them, in one blank page a browser: to open a page takes it
// five times as long as to compare two pictures.
const pages = new WeakMap();

/** The blank page, with `pixelsOf(PNG in base64)`, which returns a canvas's ImageData. */
function blank(browser) {
  if (!pages.has(browser)) pages.set(browser, open(browser));
  return pages.get(browser);
}

async function open(browser) {
  const page = await browser.newPage();
  await page.evaluate(() => {
    globalThis.bitmapOf = (data) =>
      createImageBitmap(new Blob([Uint8Array.from(atob(data), (c) => c.charCodeAt(0))], { type: 'image/png' }));
    globalThis.pixelsOf = async (data) => {
      const bitmap = await globalThis.bitmapOf(data);
      const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d');
      context.drawImage(bitmap, 0, 0);
      return context.getImageData(0, 0, bitmap.width, bitmap.height);
    };
  });
  return page;
}

const sessions = new WeakMap();

/**
 * A picture (PNG) of a page, or of the one element that a locator finds, or of a part of the page (`clip`). Playwright's
 * own takes four times the CPU time: it makes the file as small as it can. Take pictures of a page one after the other:
 * Chromium mixes up the parts of two that it takes at once.
 */
export async function shot(what, clip) {
  const page = what.page?.() ?? what;
  if (what !== page)
    clip = await what.evaluate((element) => {
      element.scrollIntoViewIfNeeded();
      const { left, top, right, bottom } = element.getBoundingClientRect();
      const [x, y] = [Math.floor(left), Math.floor(top)];
      return { x, y, width: Math.ceil(right) - x, height: Math.ceil(bottom) - y };
    });
  if (!sessions.has(page)) sessions.set(page, page.context().newCDPSession(page));
  const session = await sessions.get(page);
  const { data } = await session.send('Page.captureScreenshot', {
    format: 'png',
    optimizeForSpeed: true,
    ...(clip && { clip: { ...clip, scale: 1 } }),
  });
  return Buffer.from(data, 'base64');
}

/** Counts the pixels in a screenshot of `selector` that `test(r, g, b)` accepts. */
export async function countPixels(page, selector, test) {
  const png = await shot(page.locator(selector).first());
  return (await blank(page.context().browser())).evaluate(
    async ({ picture, source }) => {
      const accept = new Function('r', 'g', 'b', `return (${source})(r, g, b)`);
      const { data } = await globalThis.pixelsOf(picture);
      let count = 0;
      for (let i = 0; i < data.length; i += 4) if (accept(data[i], data[i + 1], data[i + 2])) count++;
      return count;
    },
    { picture: png.toString('base64'), source: test.toString() },
  );
}

/** The share of pixels that differ by more than 24 of 255 between two screenshots; 1 if their sizes differ. */
export async function difference(browser, a, b) {
  return (await blank(browser)).evaluate(
    async (both) => {
      const [x, y] = [await globalThis.pixelsOf(both[0]), await globalThis.pixelsOf(both[1])].map(({ data }) => data);
      if (x.length !== y.length) return 1;
      let count = 0;
      for (let i = 0; i < x.length; i += 4)
        if (Math.max(Math.abs(x[i] - y[i]), Math.abs(x[i + 1] - y[i + 1]), Math.abs(x[i + 2] - y[i + 2])) > 24) count++;
      return count / (x.length / 4);
    },
    [a.toString('base64'), b.toString('base64')],
  );
}

/** A picture at half its size, in 32 levels a channel: a third of the bytes; averages over blocks hide what is lost. */
export async function halved(browser, png) {
  const text = await (await blank(browser)).evaluate(async (data) => {
    const bitmap = await globalThis.bitmapOf(data);
    const canvas = new OffscreenCanvas(bitmap.width >> 1, bitmap.height >> 1);
    const context = canvas.getContext('2d');
    context.imageSmoothingQuality = 'high';
    context.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
    const pixels = context.getImageData(0, 0, canvas.width, canvas.height);
    for (let i = 0; i < pixels.data.length; i++)
      if (i % 4 < 3) pixels.data[i] = Math.round(Math.round(pixels.data[i] / 8.226) * 8.226);
    context.putImageData(pixels, 0, 0);
    const bytes = new Uint8Array(await (await canvas.convertToBlob({ type: 'image/png' })).arrayBuffer());
    let out = '';
    for (let i = 0; i < bytes.length; i += 8192) out += String.fromCharCode(...bytes.subarray(i, i + 8192));
    return btoa(out);
  }, png.toString('base64'));
  return Buffer.from(text, 'base64');
}

/**
 * Compares the mean colours (0 to 255) of blocks of 8 × 8 pixels. Returns the mean difference and the share of blocks
 * that differ by more than 20. Another GPU or font renderer draws edges differently, which averages out in a block; a
 * missing shape, colour or panel does not.
 */
export async function apart(browser, a, b) {
  return (await blank(browser)).evaluate(
    async (both) => {
      const [x, y] = [await globalThis.pixelsOf(both[0]), await globalThis.pixelsOf(both[1])];
      if (x.width !== y.width || x.height !== y.height)
        return { size: [x.width, x.height, y.width, y.height], share: 1, mean: 255 };
      const SIDE = 8;
      let blocks = 0;
      let many = 0;
      let sum = 0;
      for (let top = 0; top + SIDE <= x.height; top += SIDE)
        for (let left = 0; left + SIDE <= x.width; left += SIDE) {
          const d = [0, 0, 0];
          for (let j = 0; j < SIDE; j++)
            for (let i = 0; i < SIDE; i++)
              for (let c = 0; c < 3; c++) {
                const at = 4 * ((top + j) * x.width + left + i) + c;
                d[c] += x.data[at] - y.data[at];
              }
          const far = Math.max(...d.map(Math.abs)) / (SIDE * SIDE);
          blocks++;
          sum += far;
          if (far > 20) many++;
        }
      return { share: many / blocks, mean: sum / blocks };
    },
    [a.toString('base64'), b.toString('base64')],
  );
}
