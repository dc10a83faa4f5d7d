// What is shown and what a visitor does: one state, one function that draws it, events that change it.

const state = { index: Math.floor((numMoments - 1) * 0.4), query: 0, isPlaying: false, speed: 0.25 };
const [seek, play, clock, count, attentionNote, voxelsNote, voxelStart, voxelEnd] =
  ['seek', 'play', 'clock', 'count', 'attention-note', 'voxels-note', 'voxel-start', 'voxel-end'].map((id) => document.getElementById(id));
const screens = [...lanes, ...(camera ? [camera] : []), ...maps];
let lastFrame = null, wanted = 0;
const calm = matchMedia('(prefers-reduced-motion: reduce)').matches;

/** The moment that an address names: "#t=1.234" are seconds since the recording's first event. */
function addressed() {
  const named = /^#t=(\d+(?:\.\d+)?)$/.exec(location.hash);
  if (!named) return null;
  const stop = Number(named[1]) * 1e6;
  return facts.stops.reduce((best, each, i) => (Math.abs(each - stop) < Math.abs(facts.stops[best] - stop) ? i : best), 0);
}

/** The address names the moment while the page rests, so that a copied one leads here. */
function address(index) {
  try {
    history.replaceState(null, '', `#t=${(facts.stops[index] / 1e6).toFixed(3)}`);
  } catch {
    // a browser that keeps pages from their address shows the moment all the same
  }
}

seek.max = numMoments - 1;
if (attention) state.query = nearestQuery(sensorWidth * 0.58, sensorHeight * 0.45);
document.getElementById('facts').textContent = [
  `${sensorWidth} × ${sensorHeight} pixels`, `${counted(facts.counts.reduce((sum, n) => sum + n, 0))} events`,
  `${numMoments} images`, facts.policy, facts.format, `network ${facts.lanes.join(', ')}`,
].join(' · ');

/** Windows are numbered from 0, as everywhere. */
function windowOf(index) {
  return `window ${facts.windows[index]} of ${facts.windows[0]} – ${facts.windows[numMoments - 1]}`;
}

/** Draw the state. Images that are still being decoded are waited for; a newer wish overtakes an older one. */
async function show() {
  const ticket = ++wanted, { index, query } = state;
  seek.value = index;
  seek.setAttribute('aria-valuetext', `${seconds(facts.stops[index])}, ${windowOf(index)}`);
  say(clock, seconds(facts.stops[index]));
  say(count, windowOf(index));
  strip.draw(index);
  const sheetIndex = attention ? sheetOf(index) : 0;
  const asked = [...lanes.map((lane) => image(lane.stream, index)), image('voxels', index)];
  if (camera) asked.push(image('camera', index));
  if (attention) asked.push(image('attention', sheetIndex), image('lane0', Math.min(sheetIndex * attention.stride, numMoments - 1)));
  const got = await Promise.all(asked);
  if (ticket !== wanted) return;
  const cross = attention ? attention.queries[query] : null;
  lastFrame = got[0];
  lanes.forEach((lane) => drawPicture(lane, got.shift()));
  drawBins(got.shift());
  if (camera) drawPicture(camera, got.shift());
  if (attention) {
    const [sheet, under] = got;
    drawMaps(under, sheet, sheetIndex, query);
    const at = Math.min(sheetIndex * attention.stride, numMoments - 1);
    const when = at === index ? '' : `, as of image ${at + 1}`;
    say(attentionNote, `pixel ${cross.join(', ')}${when} · the cross snaps to the nearest of ${attention.queries.length} places`);
    screens.forEach((each) => moveCross(each, cross));
  }
  say(voxelsNote, `${counted(facts.counts[index])} events in ${((facts.stops[index] - facts.starts[index]) / 1000).toFixed(1)} ms`);
  say(voxelEnd, `${facts.voxels.limits[index].toFixed(1)} brighter`);
  say(voxelStart, `${facts.voxels.limits[index].toFixed(1)} darker`);
  cloud.draw(index, lastFrame);
  document.documentElement.dataset.shown = index;
  document.documentElement.dataset.query = query;
  if (!state.isPlaying) address(index);
  prefetch(index);
}

function prefetch(index) {
  for (const ahead of [1, 2, 3, -1]) {
    const i = index + ahead;
    if (i < 0 || i >= numMoments) continue;
    lanes.forEach((lane) => image(lane.stream, i));
    image('voxels', i);
    if (camera) image('camera', i);
    if (attention) image('attention', sheetOf(i));
  }
}

let isQueued = false;

/** Draw once with the next screen refresh, however often it is asked. */
function redraw() {
  if (isQueued) return;
  isQueued = true;
  requestAnimationFrame(() => {
    isQueued = false;
    show().catch((error) => fail(error));
  });
}

function fail(error) {
  const problem = document.getElementById('problem');
  problem.hidden = false;
  problem.textContent = `This page cannot show an image: ${error.message}`;
}

function goTo(index) {
  state.index = Math.min(Math.max(index, 0), numMoments - 1);
  redraw();
}

function setPlaying(isPlaying) {
  state.isPlaying = isPlaying;
  play.setAttribute('aria-label', isPlaying ? 'Pause' : 'Play');
  document.getElementById('play-icon').setAttribute('d', isPlaying ? 'M6 4.5h4.5v15H6zM13.5 4.5H18v15h-4.5z' : 'M7 4.5v15l13-7.5z');
  if (!isPlaying) return;
  let before = performance.now(), at = facts.stops[state.index >= numMoments - 1 ? 0 : state.index];
  const tick = (now) => {
    if (!state.isPlaying) return;
    at += (now - before) * 1000 * state.speed;
    before = now;
    let index = state.index;
    if (at < facts.stops[index]) index = 0;
    while (index < numMoments - 1 && facts.stops[index + 1] <= at) index++;
    if (index >= numMoments - 1) at = facts.stops[0];
    if (index !== state.index) goTo(index);
    requestAnimationFrame(tick);
  };
  requestAnimationFrame(tick);
}

function pause() {
  if (state.isPlaying) setPlaying(false);
}

seek.addEventListener('input', () => { pause(); goTo(Number(seek.value)); });
play.addEventListener('click', () => setPlaying(!state.isPlaying));
document.getElementById('speed').addEventListener('change', (event) => { state.speed = Number(event.target.value); });

function follow(event) {
  pause();
  goTo(strip.momentAt(event));
}
strip.canvas.addEventListener('pointerdown', (event) => { strip.canvas.setPointerCapture(event.pointerId); follow(event); });
strip.canvas.addEventListener('pointermove', (event) => { if (event.buttons) follow(event); });

for (const { canvas } of screens) {
  canvas.addEventListener('click', (event) => {
    if (!attention) return;
    const box = canvas.getBoundingClientRect();
    state.query = nearestQuery((event.clientX - box.left) / box.width * sensorWidth, (event.clientY - box.top) / box.height * sensorHeight);
    redraw();
  });
}

function turned(yaw, pitch) {
  cloud.turn(yaw, pitch);
  document.querySelectorAll('[data-view]').forEach((button) => button.setAttribute('aria-pressed', 'false'));
  cloud.draw(state.index, lastFrame);
}
cloud.canvas.addEventListener('pointerdown', (event) => cloud.canvas.setPointerCapture(event.pointerId));
cloud.canvas.addEventListener('pointermove', (event) => {
  if (event.buttons) turned(event.movementX / -180, event.movementY / 180);
});
document.querySelectorAll('[data-view]').forEach((button) => button.addEventListener('click', () => {
  cloud.face(button.dataset.view);
  cloud.draw(state.index, lastFrame);
  document.querySelectorAll('[data-view]').forEach((other) => other.setAttribute('aria-pressed', String(other === button)));
}));

/** Move the cross by whole steps of the grid of query pixels. */
function moveQuery(across, down) {
  if (!attention) return;
  const columns = new Set(attention.queries.map(([x]) => x)).size, rows = attention.queries.length / columns;
  const column = Math.min(Math.max(state.query % columns + across, 0), columns - 1);
  const row = Math.min(Math.max(Math.floor(state.query / columns) + down, 0), rows - 1);
  state.query = row * columns + column;
  redraw();
}

const step = (by) => () => { pause(); goTo(state.index + by); };
const KEYS = {
  ' ': () => setPlaying(!state.isPlaying), ArrowLeft: step(-1), ArrowRight: step(1),
  Home: () => { pause(); goTo(0); }, End: () => { pause(); goTo(numMoments - 1); },
  a: () => moveQuery(-1, 0), d: () => moveQuery(1, 0), w: () => moveQuery(0, -1), s: () => moveQuery(0, 1),
};
const TURNS = { ArrowLeft: [0.08, 0], ArrowRight: [-0.08, 0], ArrowUp: [0, -0.08], ArrowDown: [0, 0.08] };

document.addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches('select')) return;
  if (event.key === ' ' && event.target.matches('button, a')) return;
  const turns = event.target === cloud.canvas && TURNS[event.key];
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const action = turns ? () => turned(...turns) : event.shiftKey && key.startsWith('Arrow') ? step(key === 'ArrowLeft' ? -10 : key === 'ArrowRight' ? 10 : 0) : KEYS[key];
  if (!action) return;
  event.preventDefault();
  action();
});

window.addEventListener('hashchange', () => {
  const there = addressed();
  if (there !== null && there !== state.index) { pause(); goTo(there); }
});
sizeOf.onChange = redraw;
const named = addressed();
if (named !== null) state.index = named;
redraw();
// It plays by itself, but not for those who asked for less motion, nor over a moment that was asked for.
if (!calm && named === null) setPlaying(true);
