/** The one stage of the page. */
import { Stage } from './stage';

const host = document.createElement('div');
host.className = 'stage';
export const stageHost = host;
export const stage = new Stage(host);
