import { render } from 'preact';
import './style.css';
import { keepFocus } from './focus';
import { App } from './ui/app';
import { keepUrl, restore } from './url';
import { applyTheme } from './theme';
import { waitForAccess } from './actions/token';
import { stage } from './view/shared';
import { toast } from './state';

applyTheme();
keepFocus();
render(<App />, document.getElementById('app')!);
stage.onFailed = () =>
  toast('This browser has no WebGL, so the studio cannot draw shapes. Uploading and morphing still work.', 'error');
void waitForAccess().then(restore).finally(keepUrl);
