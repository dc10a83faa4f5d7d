// The visitor's own camera, asked for by a button of ours: small grey mirrored pictures go to the server one at a time,
// the next one when the last was seen (app/web/camera_endpoint.py). Nothing is kept here either.
(() => {
  const FEWEST = 1000 / 15; // milliseconds from picture to picture
  let going = null; // {socket, stream}

  const say = (text) => {
    for (const place of document.querySelectorAll("[data-etv-camera-said]")) {
      place.textContent = text;
      place.hidden = !text;
    }
  };
  const stop = () => {
    if (!going) return;
    for (const track of going.stream.getTracks()) track.stop();
    going.socket?.close();
    going = null;
  };
  const REASONS = {
    NotAllowedError: "The camera was not allowed. It can be allowed beside the page's address.",
    NotFoundError: "There is no camera here.",
    NotReadableError: "Another program uses the camera.",
  };

  const settings = () => {
    const value = (name) => Number(document.querySelector(`[data-etv-mirror=${name}]`)?.value ?? NaN);
    return JSON.stringify({ contrast: value("contrast"), noise: value("noise") });
  };

  const start = async (ticket) => {
    if (going) return;
    say("");
    if (!navigator.mediaDevices) return say("A browser gives its camera only to pages on this machine, or over https.");
    const hold = (going = { socket: null, stream: new MediaStream() });
    try {
      hold.stream = await navigator.mediaDevices.getUserMedia({
        video: { width: { ideal: 320 }, height: { ideal: 240 }, frameRate: { ideal: 30 }, facingMode: "user" },
      });
    } catch (error) {
      going = null;
      return say(REASONS[error.name] ?? `The camera cannot be used (${error.name}).`);
    }
    const video = document.createElement("video");
    video.muted = video.playsInline = true;
    video.srcObject = hold.stream;
    await video.play();
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = (hold.socket = new WebSocket(`${scheme}//${location.host}/camera`));
    let isFree = false;
    let size = null;
    let sentAt = 0;
    const canvas = document.createElement("canvas");
    const context = canvas.getContext("2d", { willReadFrequently: true });
    const show = () => {
      if (socket.readyState !== WebSocket.OPEN) return;
      const now = performance.now();
      if (isFree && now - sentAt >= FEWEST && video.readyState >= 2) {
        const [width, height] = size;
        // The middle of the picture, in the sensor's shape, turned as in a mirror.
        const scale = Math.min(video.videoWidth / width, video.videoHeight / height);
        const [w, h] = [width * scale, height * scale];
        context.setTransform(-1, 0, 0, 1, width, 0);
        context.drawImage(video, (video.videoWidth - w) / 2, (video.videoHeight - h) / 2, w, h, 0, 0, width, height);
        const rgba = context.getImageData(0, 0, width, height).data;
        const grey = new Uint8Array(width * height);
        for (let i = 0; i < grey.length; i++) grey[i] = 0.299 * rgba[4 * i] + 0.587 * rgba[4 * i + 1] + 0.114 * rgba[4 * i + 2];
        isFree = false;
        sentAt = now;
        socket.send(grey);
      }
      setTimeout(show, 8);
    };
    socket.onopen = () => socket.send(JSON.stringify({ ticket }));
    socket.onmessage = (event) => {
      const said = JSON.parse(event.data);
      if (said.go) {
        [canvas.width, canvas.height] = size = said.go;
        isFree = true;
        show();
      }
      if (said.got) isFree = true;
      if (said.refused) say(said.refused);
      if (said.over || said.refused) stop();
    };
    socket.onclose = () => going === hold && stop();
  };

  document.addEventListener("click", (event) => {
    const button = event.target.closest?.("[data-etv-camera]");
    if (button) start(button.dataset.etvCamera);
    if (event.target.closest?.("[data-etv-camera-stop]")) stop();
  });
  document.addEventListener("input", (event) => {
    if (event.target.closest?.("[data-etv-mirror]") && going?.socket?.readyState === WebSocket.OPEN) going.socket.send(settings());
  });
  window.addEventListener("pagehide", stop);
})();
