// A daemon and a browser for the tests of the file that imports them. They are started before any of its hooks runs, and
// stopped after its last test.
import { after } from 'node:test';
import { startBrowser, startDaemon } from './support.mjs';

export const daemon = await startDaemon();
export const browser = await startBrowser().catch(async (error) => {
  await daemon.stop();
  throw error;
});
after(async () => {
  await browser.close();
  await daemon.stop();
});
