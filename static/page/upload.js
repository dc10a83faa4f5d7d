// Files of the visitor's go to the server piece by piece, by a button or dropped anywhere on the page (see
// app/web/upload_endpoint.py). How far one is, and why one was refused, the server says; here is only what it cannot know.
(() => {
  const AHEAD = 4; // pieces that are on their way before the first is acknowledged
  const ticket = () => document.querySelector("[data-etv-ticket]")?.dataset.etvTicket;
  let going = null;

  const say = (text) => {
    for (const place of document.querySelectorAll("[data-etv-upload-said]")) {
      place.textContent = text;
      place.hidden = !text;
    }
  };

  const send = (file) =>
    new Promise((end) => {
      const scheme = location.protocol === "https:" ? "wss:" : "ws:";
      const socket = (going = new WebSocket(`${scheme}//${location.host}/upload`));
      let piece = 0;
      let sent = 0;
      let got = 0;
      let isPumping = false;
      let isKnown = false;
      const pump = async () => {
        if (isPumping) return;
        isPumping = true;
        try {
          while (sent < file.size && sent - got < AHEAD * piece && socket.readyState === WebSocket.OPEN) {
            const part = await file.slice(sent, sent + piece).arrayBuffer();
            socket.send(part);
            sent += part.byteLength;
            if (sent === file.size) socket.send("end");
          }
        } catch {
          say(`${file.name} can no longer be read; choose it again`);
          socket.close();
        }
        isPumping = false;
      };
      socket.onopen = () =>
        socket.send(JSON.stringify({ ticket: ticket(), name: file.name.slice(-200), size: file.size }));
      socket.onmessage = (event) => {
        const said = JSON.parse(event.data);
        isKnown = true;
        if (said.go) piece = said.go;
        if (said.got) got = said.got;
        if (said.done || said.refused) {
          socket.close();
          end(Boolean(said.done));
        } else {
          pump();
        }
      };
      socket.onclose = () => {
        going = null;
        if (!isKnown) say("The file could not be sent: the connection failed. Load the page again.");
        end(false);
      };
    });

  const sendAll = async (files) => {
    if (going || !ticket()) return;
    say("");
    for (const file of files) if (!(await send(file))) return;
  };

  // It stays in the page while the dialog is open; what the server draws may be replaced meanwhile.
  const field = document.createElement("input");
  field.type = "file";
  field.hidden = true;
  field.addEventListener("change", () => {
    const files = [...field.files];
    field.value = "";
    sendAll(files);
  });
  document.body.append(field);

  document.addEventListener("click", (event) => {
    if (event.target.closest?.("[data-etv-upload]")) field.click();
    if (event.target.closest?.("[data-etv-upload-stop]")) going?.close();
  });

  const cover = document.createElement("div");
  cover.className = "etv-drop";
  cover.hidden = true;
  cover.textContent = "Drop to open it here";
  document.body.append(cover);
  const isFile = (event) => Boolean(ticket()) && [...(event.dataTransfer?.types ?? [])].includes("Files");
  document.addEventListener("dragover", (event) => {
    if (!isFile(event)) return;
    event.preventDefault();
    cover.hidden = false;
  });
  document.addEventListener("dragleave", (event) => {
    if (event.relatedTarget === null) cover.hidden = true;
  });
  document.addEventListener("drop", (event) => {
    cover.hidden = true;
    if (!isFile(event)) return;
    event.preventDefault();
    sendAll([...event.dataTransfer.files]);
  });
})();
