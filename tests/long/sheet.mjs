/**
 * A contact sheet: rows of PNGs in base64 under their titles, `across` of them beside each other. The first `wide` pictures of a row
 * get twice the width.
 */
export async function sheet(browser, rows, { across = 2, width = 360, height = 300, wide = 0 } = {}) {
  const page = await browser.newPage();
  const data = await page.evaluate(
    async ({ list, across, width, height, wide }) => {
      const head = 22;
      const most = Math.max(...list.map(({ pictures }) => pictures.length));
      const whole = (most + Math.min(wide, most)) * width;
      const canvas = new OffscreenCanvas(across * whole, Math.ceil(list.length / across) * (height + head));
      const context = canvas.getContext('2d');
      context.fillStyle = '#fff';
      context.fillRect(0, 0, canvas.width, canvas.height);
      context.fillStyle = '#000';
      context.font = '14px sans-serif';
      for (const [i, { title, pictures }] of list.entries()) {
        let left = whole * (i % across);
        const top = Math.floor(i / across) * (height + head);
        context.fillText(title, left + 6, top + 16);
        for (const [k, text] of pictures.entries()) {
          const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
          const image = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
          const room = k < wide ? 2 * width : width;
          const scale = Math.min(room / image.width, height / image.height);
          context.drawImage(image, left, top + head, scale * image.width, scale * image.height);
          left += room;
        }
      }
      const bytes = new Uint8Array(await (await canvas.convertToBlob()).arrayBuffer());
      return bytes.toBase64?.() ?? btoa(Array.from(bytes, (b) => String.fromCharCode(b)).join(''));
    },
    { list: rows, across, width, height, wide },
  );
  await page.close();
  return Buffer.from(data, 'base64');
}
