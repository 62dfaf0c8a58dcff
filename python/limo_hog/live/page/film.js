// The page of `limo-hog detect --view`: shows what the run sends, and sends back control messages.
"use strict";

const $ = (id) => document.getElementById(id);
let socket = null;
let ended = false;

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  socket.onmessage = ({ data }) => (typeof data === "string" ? read(JSON.parse(data)) : picture(data));
  socket.onclose = () => {
    if (ended) return;
    notice("The run is over, or was stopped. What you see is the last it showed.");
    setTimeout(connect, 2000);
  };
}

function read(message) {
  if (message.threshold) {
    Object.assign($("threshold"), message.threshold);
    notice("");
  }
  for (const [id, text] of Object.entries(message.state ?? {})) $(id).textContent = text;
  if (message.complaint) $("complaint").textContent = message.complaint;
  if (message.ended) {
    ended = true;
    notice(`The run is over: ${message.ended.summary}`);
  }
}

function picture(jpeg) {
  URL.revokeObjectURL($("camera").src);
  $("camera").src = URL.createObjectURL(jpeg);
}

function notice(text) {
  $("notice").textContent = text;
  $("notice").hidden = !text;
}

function send(message) {
  $("complaint").textContent = "";
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

$("pause").onclick = () => send({ do: $("pause").textContent === "Pause" ? "pause" : "resume" });
$("threshold").oninput = () => send({ set: "threshold", value: Number($("threshold").value) });
document.onkeydown = (event) => {
  if (event.key !== " " || event.target !== document.body) return;
  event.preventDefault();
  $("pause").onclick();
};
connect();
