import { render } from 'preact';
import './style.css';
import { App } from './ui/app';
import { keepUrl, restore } from './url';
import { applyTheme } from './theme';
import { enter } from './actions/token';
import { stage } from './view/shared';
import { toast } from './state';

applyTheme();
render(<App />, document.getElementById('app')!);
stage.onFailed = () =>
  toast('This browser shows no WebGL, so shapes cannot be drawn. Uploading and morphing work all the same.', 'error');
void enter().then(restore).finally(keepUrl);
