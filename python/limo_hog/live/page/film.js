// The page of `limo-hog detect --view`: shows what the run sends, and sends back control messages.
"use strict";

const $ = (id) => document.getElementById(id);
let socket = null;
let paused = false;
let ended = false;

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({ data }) => (typeof data === "string" ? read(JSON.parse(data)) : picture(data));
  socket.onclose = () => {
    if (ended) return;
    notice("The run is over, or was stopped. What you see is the last it showed.");
    setTimeout(connect, 2000);
  };
}

function read(message) {
  if (message.threshold) {
    Object.assign($("threshold"), { min: message.threshold.low, max: message.threshold.high, value: message.threshold.value });
    notice("");
  }
  if (message.state) state(message.state);
  if (message.complaint) $("complaint").textContent = message.complaint;
  if (message.ended) {
    ended = true;
    notice(`The run is over: ${message.ended.summary}`);
  }
}

function state(now) {
  paused = now.paused;
  $("source").textContent = now.source;
  $("frame").textContent = now.frame;
  $("ids").textContent = now.ids.length ? `in view: ${now.ids.join(", ")}` : "";
  $("pause").textContent = paused ? "Go on" : "Pause";
  $("margin").textContent = now.threshold.toFixed(2);
  $("people").textContent = now.people;
  $("rate").textContent = now.rate === null ? "–" : `${now.rate.toFixed(1)}/s`;
  $("detect").textContent = `${now.detect_ms.toFixed(1)} ms`;
  $("dropped").textContent = now.dropped;
}

function picture(data) {
  const last = $("camera").src;
  $("camera").src = URL.createObjectURL(new Blob([data], { type: "image/jpeg" }));
  if (last) URL.revokeObjectURL(last);
}

function notice(text) {
  $("notice").textContent = text;
  $("notice").hidden = !text;
}

function send(message) {
  $("complaint").textContent = "";
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

$("pause").onclick = () => send({ do: paused ? "resume" : "pause" });
$("threshold").oninput = () => send({ set: "threshold", value: Number($("threshold").value) });
document.onkeydown = (event) => {
  if (event.key !== " " || event.target !== document.body) return;
  event.preventDefault();
  $("pause").onclick();
};
connect();
