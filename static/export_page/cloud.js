// Events in space and time, drawn dot by dot into an image: parallel projection, no graphics card needed.

const AGES = 64;
const TRAIL = 220e3; // µs of events behind the picture
const ATTITUDES = { angle: [-0.6, 0.3], side: [-1.18, 0.12], front: [0, 0] };

const cloud = (() => {
  const canvas = document.getElementById('cloud');
  const context = canvas.getContext('2d', { willReadFrequently: true });
  const view = { yaw: ATTITUDES.angle[0], pitch: ATTITUDES.angle[1], zoom: 1 };
  let pixels = null, words = null, ratio = 1;

  const pack = (colour) => (255 << 24 | colour[2] << 16 | colour[1] << 8 | colour[0]) >>> 0;
  const ground = pack(facts.colours.ground);
  const fading = (hue) => Uint32Array.from({ length: AGES }, (_, age) => {
    const strength = 1 - 0.82 * (age / (AGES - 1)) ** 0.7;
    return pack(facts.colours.ground.map((dark, i) => Math.round(dark + (hue[i] - dark) * strength)));
  });
  const on = fading(facts.colours.on), off = fading(facts.colours.off);

  function resize() {
    const box = sizeOf(canvas);
    ratio = Math.min(window.devicePixelRatio || 1, 1.5);
    const width = Math.max(Math.round(box.width * ratio), 1), height = Math.max(Math.round(box.height * ratio), 1);
    if (pixels && pixels.width === width && pixels.height === height) return;
    canvas.width = width;
    canvas.height = height;
    pixels = context.createImageData(width, height);
    words = new Uint32Array(pixels.data.buffer);
  }

  /** Screen = centre + x·a + y·b + age·c, with the age 0 … 1 running away from the viewer; fitted to the canvas. */
  function projection() {
    const depth = sensorWidth * 2.6;
    const [cy, sy, cp, sp] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
    const turned = (x, y, z) => [x * cy - z * sy, y * cp - (x * sy + z * cy) * sp];
    const a = turned(1, 0, 0), b = turned(0, 1, 0), c = turned(0, 0, depth);
    const w = sensorWidth / 2, h = sensorHeight / 2;
    let [left, right, top, bottom] = [1e9, -1e9, 1e9, -1e9];
    for (const x of [-w, w]) for (const y of [-h, h]) for (const age of [0, 1]) {
      const px = x * a[0] + y * b[0] + age * c[0], py = x * a[1] + y * b[1] + age * c[1];
      left = Math.min(left, px); right = Math.max(right, px); top = Math.min(top, py); bottom = Math.max(bottom, py);
    }
    const margin = 26 * ratio;
    const scale = view.zoom * Math.min((canvas.width - 2 * margin) / (right - left), (canvas.height - 2 * margin - 16 * ratio) / (bottom - top));
    const origin = [canvas.width / 2 - scale * (left + right) / 2, canvas.height / 2 - scale * (top + bottom) / 2 - 4 * ratio];
    return { a: a.map((v) => v * scale), b: b.map((v) => v * scale), c: c.map((v) => v * scale), origin };
  }

  function drawDots(index, { a, b, c, origin }) {
    words.fill(ground);
    const { width, height } = pixels, shift = facts.eventShift, now = facts.stops[index];
    const size = ratio > 1 ? 3 : 2;
    let first = index;
    while (first > 0 && now - facts.starts[first - 1] <= TRAIL) first--;
    const newest = index;
    const span = Math.max(TRAIL, now - facts.starts[newest]);
    const x0 = origin[0] - a[0] * sensorWidth / 2 - b[0] * sensorHeight / 2;
    const y0 = origin[1] - a[1] * sensorWidth / 2 - b[1] * sensorHeight / 2;
    for (let i = first; i <= newest; i++) {
      const events = eventsOf(i), start = now - facts.starts[i], tick = (facts.stops[i] - facts.starts[i]) / 512;
      for (let k = 0; k < events.length; k++) {
        const word = events[k];
        const x = (word >>> 21) << shift, y = (word >>> 10 & 2047) << shift;
        const age = (start - (word >>> 1 & 511) * tick) / span;
        const px = (x0 + x * a[0] + y * b[0] + age * c[0]) | 0, py = (y0 + x * a[1] + y * b[1] + age * c[1]) | 0;
        if (px < 0 || py < 0 || px >= width - size || py >= height - size) continue;
        const colour = (word & 1 ? on : off)[age >= 1 ? AGES - 1 : age * AGES | 0];
        let at = py * width + px;
        for (let row = 0; row < size; row++, at += width) {
          words[at] = colour; words[at + 1] = colour;
          if (size > 2) words[at + 2] = colour;
        }
      }
    }
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.putImageData(pixels, 0, 0);
    return span;
  }

  function drawFrame({ a, b, c, origin }, picture, span) {
    const w = sensorWidth / 2, h = sensorHeight / 2;
    const at = (x, y, age) => [origin[0] + x * a[0] + y * b[0] + age * c[0], origin[1] + x * a[1] + y * b[1] + age * c[1]];
    const tilt = Math.hypot(view.yaw, view.pitch);
    context.lineWidth = ratio;
    context.strokeStyle = '#ffffff38';
    context.beginPath();
    for (const [x, y] of [[-w, -h], [w, -h], [w, h], [-w, h]]) {
      context.moveTo(...at(x, y, 0));
      context.lineTo(...at(x, y, 1));
    }
    context.stroke();
    if (picture && tilt > 0.1) {
      context.globalAlpha = Math.min((tilt - 0.1) / 0.25, 0.94);
      context.setTransform(a[0], a[1], b[0], b[1], ...at(-w, -h, 0));
      context.drawImage(picture, 0, 0, sensorWidth, sensorHeight);
      context.setTransform(1, 0, 0, 1, 0, 0);
      context.globalAlpha = 1;
    }
    context.strokeStyle = '#f2f4f6';
    context.beginPath();
    for (const [x, y] of [[-w, -h], [w, -h], [w, h], [-w, h]]) context.lineTo(...at(x, y, 0));
    context.closePath();
    context.stroke();
    if (tilt < 0.3) return;
    context.fillStyle = '#c4cad2';
    context.font = `${13 * ratio}px system-ui, sans-serif`;
    const [nowX, nowY] = at(w, h, 0), [thenX, thenY] = at(w, h, 1);
    context.textAlign = 'center';
    context.textBaseline = 'top';
    const inside = (x, text) => Math.min(Math.max(x, context.measureText(text).width / 2 + 4), canvas.width - context.measureText(text).width / 2 - 4);
    context.fillText('now', inside(nowX, 'now'), nowY + 5 * ratio);
    const before = `${Math.round(span / 1000)} ms ago`;
    context.fillText(before, inside(thenX, before), thenY + 5 * ratio);
  }

  /** Draw the events up to moment `index`, with the reconstruction at their newest end. */
  function draw(index, picture) {
    resize();
    const projected = projection();
    const span = drawDots(index, projected);
    drawFrame(projected, picture, span);
  }

  function turn(yaw, pitch) {
    view.yaw = Math.min(Math.max(view.yaw + yaw, -1.4), 1.4);
    view.pitch = Math.min(Math.max(view.pitch + pitch, -1.2), 1.2);
  }

  function face(name) {
    [view.yaw, view.pitch] = ATTITUDES[name];
  }

  return { canvas, draw, turn, face, view };
})();
