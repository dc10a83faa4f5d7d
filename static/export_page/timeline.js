// The strip above the slider: events a second as an area, likeness to the camera as a line, the playhead.

const strip = (() => {
  const canvas = document.getElementById('strip');
  const context = canvas.getContext('2d');
  const INSET = 10; // half the slider's thumb: strip and slider agree on where a moment lies
  const highest = Math.max(...facts.rates, 1);
  const scored = facts.ssim.some((value) => value !== null);

  function place(i, width) {
    return INSET + (width - 2 * INSET) * (numMoments > 1 ? i / (numMoments - 1) : 0.5);
  }

  function draw(index) {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const { width, height } = sizeOf(canvas), base = height - 2, top = 15;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const area = () => {
      context.beginPath();
      context.moveTo(place(0, width), base);
      facts.rates.forEach((rate, i) => context.lineTo(place(i, width), base - (base - top) * rate / highest));
      context.lineTo(place(numMoments - 1, width), base);
      context.closePath();
      context.fill();
    };
    context.fillStyle = '#5a6270';
    area();
    context.save();
    context.beginPath();
    context.rect(0, 0, place(index, width), height);
    context.clip();
    context.fillStyle = '#aeb6c2';
    area();
    context.restore();
    if (scored) {
      context.strokeStyle = '#86e3b0';
      context.lineWidth = 1.75;
      context.beginPath();
      let started = false;
      facts.ssim.forEach((value, i) => {
        if (value === null) { started = false; return; }
        const y = base - (base - top) * Math.max(value, 0);
        if (started) context.lineTo(place(i, width), y); else context.moveTo(place(i, width), y);
        started = true;
      });
      context.stroke();
    }
    context.fillStyle = '#f2f4f6';
    context.fillRect(place(index, width) - 1, top - 4, 2, base - top + 4);
    context.font = '13px system-ui, sans-serif';
    context.textBaseline = 'top';
    const ssim = facts.ssim[index];
    const said = [[`${Math.round(facts.rates[index] / 1000)} k events/s`, '#c4cad2']];
    if (ssim !== null && ssim !== undefined) said.push([`likeness to the camera (SSIM) ${ssim.toFixed(2)}`, '#86e3b0']);
    let x = INSET;
    for (const [text, colour] of said) {
      context.fillStyle = colour;
      context.fillText(text, x, -1);
      x += context.measureText(text).width + 18;
    }
  }

  /** The moment under a pointer. */
  function momentAt(event) {
    const box = canvas.getBoundingClientRect();
    const share = (event.clientX - box.left - INSET) / Math.max(box.width - 2 * INSET, 1);
    return Math.round(Math.min(Math.max(share, 0), 1) * (numMoments - 1));
  }

  return { canvas, draw, momentAt };
})();
