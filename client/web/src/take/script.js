/* The script of a downloaded page. `open` is that of player.js; settings and the morph are in the page. */
const canvas = document.querySelector('canvas');
const slider = document.querySelector('input');
const button = document.querySelector('button');
const settings = JSON.parse(document.getElementById('settings').textContent);
const text = atob(document.getElementById('morph').textContent.trim());
const glb = Uint8Array.from(text, (c) => c.charCodeAt(0)).buffer;

open(canvas, glb, settings).then(
  (player) => {
    let playing = !matchMedia('(prefers-reduced-motion: reduce)').matches;
    let time = 0;
    let last = 0;
    let dirty = true;
    const most = settings.loop === 'loop' ? player.shapes : player.shapes - 1;
    slider.max = most;
    const say = () => {
      const from = Math.min(Math.floor(slider.value), player.shapes - 1);
      const to = (from + 1) % player.shapes;
      const share = Math.round(100 * (slider.value - from));
      const name =
        share === 0 ? settings.names[from] : `${share} % from ${settings.names[from]} to ${settings.names[to]}`;
      slider.setAttribute('aria-valuetext', name);
      button.textContent = playing ? '❚❚' : '▶';
      button.setAttribute('aria-label', playing ? 'Pause' : 'Play');
    };
    const frame = (now) => {
      const passed = last ? Math.min(0.1, (now - last) / 1000) : 0;
      last = now;
      if (playing) {
        time += passed;
        slider.value = player.placeAt(time);
        dirty = true;
      }
      const ratio = Math.min(devicePixelRatio, 2);
      const [width, height] = [Math.round(innerWidth * ratio), Math.round(innerHeight * ratio)];
      if (canvas.width !== width || canvas.height !== height) {
        canvas.width = width;
        canvas.height = height;
        dirty = true;
      }
      if (dirty) player.draw(Number(slider.value));
      if (dirty) say();
      dirty = false;
      requestAnimationFrame(frame);
    };
    const toggle = () => {
      playing = !playing;
      dirty = true;
    };
    button.onclick = toggle;
    slider.oninput = () => {
      playing = false;
      dirty = true;
    };
    const { camera } = player;
    const fingers = new Map();
    canvas.onpointerdown = (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
    };
    canvas.onpointermove = (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const others = [...fingers].filter(([id]) => id !== event.pointerId).map(([, p]) => p);
      const size = Math.max(1, innerHeight);
      if (others.length) {
        const reach = ([x, y]) => Math.hypot(x - others[0][0], y - others[0][1]);
        camera.distance = Math.min(
          12,
          Math.max(0.5, (camera.distance * reach(before)) / Math.max(1, reach([event.clientX, event.clientY]))),
        );
      } else {
        camera.yaw -= (4 * (event.clientX - before[0])) / size;
        camera.pitch = Math.min(1.55, Math.max(-1.55, camera.pitch + (4 * (event.clientY - before[1])) / size));
      }
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      dirty = true;
    };
    canvas.onpointerup = canvas.onpointercancel = (event) => fingers.delete(event.pointerId);
    canvas.addEventListener(
      'wheel',
      (event) => {
        event.preventDefault();
        camera.distance = Math.min(
          12,
          Math.max(0.5, camera.distance * Math.exp(Math.max(-60, Math.min(60, event.deltaY)) * 0.0025)),
        );
        dirty = true;
      },
      { passive: false },
    );
    addEventListener('keydown', (event) => {
      if (event.target === slider || event.ctrlKey || event.metaKey || event.altKey) return;
      const turn = { ArrowLeft: [0.12, 0], ArrowRight: [-0.12, 0], ArrowUp: [0, 0.12], ArrowDown: [0, -0.12] }[
        event.key
      ];
      if (event.key === ' ' && event.target !== button) toggle();
      else if (turn) {
        camera.yaw += turn[0];
        camera.pitch = Math.min(1.55, Math.max(-1.55, camera.pitch + turn[1]));
        dirty = true;
      } else return;
      event.preventDefault();
    });
    document.body.dataset.ready = '';
    requestAnimationFrame(frame);
  },
  (error) => {
    document.querySelector('p').textContent = error.message;
  },
);
