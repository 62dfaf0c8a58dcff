// What live pages share: the connection to the run, and control messages. A page has read(message) and show(picture).
"use strict";

const $ = (id) => document.getElementById(id);
let socket = null;
let ended = false;

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({ data }) => {
    if (typeof data !== "string") return show(data);
    const message = JSON.parse(data);
    if (message.complaint) $("complaint").textContent = message.complaint;
    read(message);
  };
  socket.onclose = () => {
    if (ended) return;
    notice("The run is over, or was stopped. What you see is the last it showed.");
    setTimeout(connect, 2000);
  };
}

function send(message) {
  $("complaint").textContent = "";
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

function notice(text) {
  $("notice").textContent = text;
  $("notice").hidden = !text;
}

function putPicture(picture, jpeg) {
  URL.revokeObjectURL(picture.src);
  picture.src = URL.createObjectURL(new Blob([jpeg], { type: "image/jpeg" }));
}
