// Images, voxel bins and attention maps of one moment. Every function draws at once from decoded images.

const RESOLUTION = { 0: '1/1', 1: '1/2', 2: '1/4', 3: '1/8' };

function element(tag, className, text) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

/** Change a text only where it differs: each change costs a layout. */
function say(where, text) {
  if (where.textContent !== text) where.textContent = text;
}

function fitted(canvas, width, height) {
  canvas.width = width;
  canvas.height = height;
  canvas.style.aspectRatio = `${width} / ${height}`;
  return canvas.getContext('2d');
}

/** A canvas of the sensor's size under a movable cross; the browser enlarges it, which costs nothing here. */
function screen(label, canvas = element('canvas')) {
  const frame = element('div', 'screen');
  canvas.setAttribute('role', 'img');
  canvas.setAttribute('aria-label', label);
  const cross = element('i', 'cross');
  cross.hidden = true;
  canvas.replaceWith(frame);
  frame.append(canvas, cross);
  return { frame, canvas, cross, context: fitted(canvas, sensorWidth, sensorHeight) };
}

const lanes = facts.lanes.map((name, i) => {
  const figure = element('figure', 'lane');
  const caption = element('figcaption');
  const made = screen(`Reconstruction by ${name}`);
  caption.append(element('b', '', 'Image the network makes of them'));
  if (facts.lanes.length > 1) caption.append(element('span', '', name));
  figure.append(caption, made.frame);
  document.getElementById('lanes').append(figure);
  return { stream: `lane${i}`, ...made };
});

const camera = facts.hasCamera
  ? { stream: 'camera', ...screen('Frame of an ordinary camera', document.getElementById('camera')) } : null;
if (!camera) document.getElementById('camera-panel').hidden = true;

function drawPicture({ context }, bitmap) {
  context.drawImage(bitmap, 0, 0, sensorWidth, sensorHeight);
}

function moveCross({ cross }, [x, y]) {
  cross.hidden = false;
  cross.style.left = `${(x + 0.5) / sensorWidth * 100}%`;
  cross.style.top = `${(y + 0.5) / sensorHeight * 100}%`;
}

const bins = Array.from({ length: facts.voxels.bins }, (_, i) => {
  const tile = element('div', 'tile');
  const canvas = element('canvas');
  canvas.setAttribute('role', 'img');
  canvas.setAttribute('aria-label', `Voxel bin ${i + 1} of ${facts.voxels.bins}`);
  const last = facts.voxels.bins - 1;
  tile.append(canvas, element('span', '', last ? `${Math.round(100 * i / last)} %` : ''));
  document.getElementById('bins').append(tile);
  return canvas;
});
document.getElementById('bins').style.setProperty('--num-bins', bins.length);
document.getElementById('voxel-scale').style.background = `linear-gradient(90deg, ${facts.colours.voxels.join(',')})`;

function drawBins(bitmap) {
  const width = bitmap.width / bins.length;
  bins.forEach((canvas, i) => {
    if (canvas.width !== width || canvas.height !== bitmap.height) fitted(canvas, width, bitmap.height);
    canvas.getContext('2d').drawImage(bitmap, -i * width, 0);
  });
}

const attention = facts.attention;
const maps = attention ? attention.sites.map((site) => {
  const tile = element('div', 'tile');
  const own = RESOLUTION[site.scale], read = RESOLUTION[Math.min(site.scale + 1, 3)];
  const words = site.isCross ? `${own} reads ${read}` : `within ${own}`;
  const reads = element('span');
  const made = screen(`Attention, ${words}`);
  tile.append(element('b', '', words), made.frame, reads);
  document.getElementById('maps').append(tile);
  return { ...made, reads };
}) : [];
if (attention) {
  document.getElementById('maps').style.setProperty('--num-maps', maps.length);
  document.getElementById('attention-scale').style.background = `linear-gradient(90deg, ${facts.colours.attention.join(',')})`;
  document.getElementById('scale-low').textContent = `${attention.range[0].toFixed(2)} ×`;
  document.getElementById('scale-high').textContent = `${attention.range[1].toFixed(2).replace('.00', '')} × uniform`;
} else {
  document.getElementById('attention-panel').hidden = true;
}

/** Which kept attention sheet stands nearest to moment `i`. */
function sheetOf(i) {
  const last = streams.get('attention').length - 2;
  return Math.min(Math.round(i / attention.stride), last);
}

function drawMaps(frame, sheet, sheetIndex, query) {
  const { rows, columns, top, left, patch, queries } = attention;
  maps.forEach(({ context, reads }, site) => {
    context.globalAlpha = 1;
    context.fillStyle = '#000';
    context.fillRect(0, 0, sensorWidth, sensorHeight);
    context.imageSmoothingEnabled = true;
    context.globalAlpha = 0.45;
    context.drawImage(frame, 0, 0, sensorWidth, sensorHeight);
    context.globalAlpha = 1;
    context.imageSmoothingEnabled = false;
    context.drawImage(sheet, query * columns, site * rows, columns, rows, -left, -top, columns * patch, rows * patch);
    say(reads, `≈ ${attention.read[sheetIndex][site * queries.length + query]} of ${rows * columns}`);
  });
}

/** The index of the query pixel nearest to (x, y) on the sensor. */
function nearestQuery(x, y) {
  let best = 0;
  attention.queries.forEach(([qx, qy], i) => {
    const [bx, by] = attention.queries[best];
    if (Math.hypot(qx - x, qy - y) < Math.hypot(bx - x, by - y)) best = i;
  });
  return best;
}
