// The page of `limo-hog detect --view`.
"use strict";

function read(message) {
  if (message.threshold) {
    Object.assign($("threshold"), message.threshold);
    notice("");
  }
  for (const [id, text] of Object.entries(message.state ?? {})) $(id).textContent = text;
  if (message.ended) {
    ended = true;
    notice(`The run is over: ${message.ended.summary}`);
  }
}

const show = (jpeg) => putPicture($("camera"), jpeg);

$("pause").onclick = () => send({ do: $("pause").textContent === "Pause" ? "pause" : "resume" });
$("threshold").oninput = () => send({ set: "threshold", value: Number($("threshold").value) });
document.onkeydown = (event) => {
  if (event.key !== " " || event.target !== document.body) return;
  event.preventDefault();
  $("pause").onclick();
};
connect();
