// The facts and the one block of bytes that this page carries, and images decoded from it on demand.

const facts = JSON.parse(document.getElementById('page-facts').textContent);
const numMoments = facts.windows.length;
const [sensorWidth, sensorHeight] = facts.sensor;

function decodedBytes() {
  const element = document.getElementById('page-data');
  const text = element.textContent.trim();
  element.remove();
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

const bytes = decodedBytes();
const streams = new Map();
let filled = 0;
for (const [name, lengths] of facts.streams) {
  const offsets = [filled];
  for (const length of lengths) offsets.push(filled += length);
  streams.set(name, offsets);
}

/** Bytes of part `i` of a stream. */
function part(name, i) {
  const offsets = streams.get(name);
  return bytes.subarray(offsets[i], offsets[i + 1]);
}

/** Events of moment `i`, one 32-bit word each: x (11 bits, high), y (11), time in the window (9), polarity (1). */
function eventsOf(i) {
  if (!eventsOf.held.has(i)) eventsOf.held.set(i, new Uint32Array(part('events', i).slice().buffer));
  return eventsOf.held.get(i);
}
eventsOf.held = new Map();

const MOST_PIXELS = 32e6;
const images = new Map();
let heldPixels = 0;

/** The decoded image `i` of a stream, as a promise; those asked for longest ago are given back. */
function image(name, i) {
  const key = `${name} ${i}`;
  const held = images.get(key);
  if (held) {
    images.delete(key);
    images.set(key, held);
    return held.decoded;
  }
  const made = { pixels: 0, decoded: createImageBitmap(new Blob([part(name, i)], { type: 'image/webp' })) };
  images.set(key, made);
  made.decoded.then((bitmap) => {
    made.pixels = bitmap.width * bitmap.height;
    heldPixels += made.pixels;
    for (const [oldest, old] of images) {
      if (heldPixels <= MOST_PIXELS || old === made) break;
      images.delete(oldest); // not closed: a picture that is being drawn may still hold it
      heldPixels -= old.pixels;
    }
  }, () => images.delete(key));
  return made.decoded;
}

const seconds = (microseconds, digits = 3) => `${(microseconds / 1e6).toFixed(digits)} s`;
const numbers = new Intl.NumberFormat('en');
const counted = (number) => numbers.format(number);

/** A canvas' size on the page in CSS pixels, measured once and again whenever it changes: measuring costs a layout. */
function sizeOf(canvas) {
  if (!sizeOf.held.has(canvas)) {
    const measure = () => {
      const { width, height } = canvas.getBoundingClientRect();
      sizeOf.held.set(canvas, { width, height });
    };
    measure();
    new ResizeObserver(() => { measure(); sizeOf.onChange(); }).observe(canvas);
  }
  return sizeOf.held.get(canvas);
}
sizeOf.held = new Map();
sizeOf.onChange = () => {};
