// The browser of the tests: Debian's chromium-headless-shell, or its chromium if that is missing. Both draw pages with
// the same code. The shell has no address bar, icons and menus to draw, so the tests take a third less CPU time.
import { existsSync } from 'node:fs';

const shell = '/usr/bin/chromium-headless-shell';

/** The visitors' browser, for benchmarks. */
export const wholeBrowser = process.env.ORB_CHROMIUM ?? '/usr/bin/chromium';

export const executablePath = process.env.ORB_CHROMIUM ?? (existsSync(shell) ? shell : wholeBrowser);

/** WebGL in software, for machines with and without a GPU. */
export const softwareGl = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];
