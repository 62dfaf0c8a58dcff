// The page of a running episode: shows what the run sends, and sends back control messages.
"use strict";

const $ = (id) => document.getElementById(id);
const WINDOW_S = 60; // what the plots show
const KEPT = 6000; // control periods kept for the trails
// Columns of a row; from PEOPLE on x and y of each person, in the scenario's order.
const [TIME, ERROR, DISTANCE, LINEAR, ANGULAR, MEASURED, X, Y, PEOPLE] = [...Array(9).keys()];

let scene = null; // what stays the same: room, furniture, zones
let now = null; // the newest state
let history = []; // one row a control period
let socket = null;
let ended = false;
let colours = {};
let drawing = false;

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({ data }) => (typeof data === "string" ? read(JSON.parse(data)) : show(data));
  socket.onclose = () => {
    if (ended) return;
    notice("The run is over, or was stopped. What you see is the last it showed.");
    setTimeout(connect, 2000);
  };
}

function read(message) {
  if (message.scenario !== undefined) welcome(message);
  if (message.state) state(message.state, message.rows);
  if (message.complaint) $("complaint").textContent = message.complaint;
  if (message.ended) end(message.ended);
}

function welcome(message) {
  scene = message;
  history = [];
  ended = false;
  notice("");
  $("scenario").textContent = scene.scenario;
  parameters(scene.parameters);
}

function state(next, rows) {
  now = next;
  history = history.concat(rows).slice(-KEPT);
  $("clock").textContent = `${now.time.toFixed(1)} s`;
  $("mode").textContent = now.mode;
  $("mode").className = `chip ${now.mode}`;
  $("reason").textContent = now.reason;
  $("pause").textContent = now.paused ? "Go on" : "Pause";
  if (document.activeElement !== $("speed")) $("speed").value = String(now.speed);
  put("measured", now.measured_m, 2, "m");
  $("seen").textContent = seen();
  put("distance", now.distance_m, 2, "m");
  $("zone").textContent = now.distance_m === null ? "–" : zone(now.distance_m);
  put("error", now.error_px, 0, "px");
  put("linear", now.linear_m_s, 2, "m/s");
  put("angular", now.angular_rad_s, 2, "rad/s");
  $("boxes").textContent = now.boxes;
  if (now.detect_ms !== null) put("detect", now.detect_ms, 1, "ms");
  $("contacts").textContent = now.contacts.person + now.contacts.wall;
  redraw();
}

function seen() {
  if (now.measured_m !== null) return `${number(now.measured_m, 2)} m by the depth image · ${zone(now.measured_m)}`;
  return now.error_px === null ? "no box is followed in this image" : "the depth image does not tell how far";
}

function show(data) {
  const bytes = new Uint8Array(data);
  const kind = String.fromCharCode(bytes[0]);
  // A node's window says its name before its picture.
  const start = kind === "w" ? bytes.indexOf(10) + 1 : 1;
  const picture =
    kind === "w" ? nodeWindow(new TextDecoder().decode(bytes.subarray(1, start - 1))) : $({ c: "camera", d: "depth" }[kind]);
  const old = picture.src;
  picture.src = URL.createObjectURL(new Blob([bytes.subarray(start)], { type: "image/jpeg" }));
  if (old) URL.revokeObjectURL(old);
  picture.dataset.count = Number(picture.dataset.count || 0) + 1;
}

// The picture of one cv2.imshow window; its figure is made when it first shows something.
function nodeWindow(name) {
  const known = [...document.querySelectorAll("#windows img")].find((picture) => picture.alt === name);
  if (known) return known;
  const figure = document.createElement("figure");
  const caption = document.createElement("figcaption");
  const picture = document.createElement("img");
  caption.textContent = name;
  picture.alt = name;
  figure.append(caption, picture);
  $("windows").append(figure);
  return picture;
}

function end(card) {
  ended = true;
  const parts = ["The run has ended."];
  if (card.in_view !== undefined) {
    parts.push(`In view ${percent(card.in_view)}, found ${percent(card.detected)} of that,`);
    parts.push(`contacts ${card.contacts_person + card.contacts_wall}.`);
  }
  notice(parts.join(" "));
  for (const control of document.querySelectorAll("button, select, input")) control.disabled = true;
}

function notice(text) {
  $("notice").textContent = text;
  $("notice").hidden = !text;
}

const element = (kind, properties) => Object.assign(document.createElement(kind), properties);

function put(id, value, digits, unit) {
  const small = element("small", { textContent: unit });
  $(id).replaceChildren(...(value === null ? ["–"] : [`${number(value, digits)} `, small]));
}

// Without a minus before nothing, and with a real one before something.
const number = (value, digits) => value.toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1").replace("-", "−");
const percent = (share) => (share === undefined ? "–" : `${(100 * share).toFixed(0)} %`);
const ZONES = ["intimate", "personal", "social", "public"];
const zone = (distance) => ZONES[scene.zones.filter((end) => distance > end).length];

// Controls

const send = (message) => socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(message));
const pause = () => send({ do: now && now.paused ? "resume" : "pause" });
$("pause").onclick = pause;
$("step").onclick = () => send({ do: "step" });
$("speed").onchange = (event) => send({ do: "speed", value: Number(event.target.value) });
document.onkeydown = (event) => {
  if (["INPUT", "SELECT", "BUTTON"].includes(event.target.tagName)) return;
  if (event.key === " ") pause();
  else if (event.key === ".") send({ do: "step" });
  else return;
  event.preventDefault();
};
$("parameters").onsubmit = (event) => event.preventDefault();

function parameters(all) {
  $("parameters").hidden = !all.length;
  $("fields").replaceChildren();
  let group = "";
  for (const { name, value, low, high, unit, tooltip, whole } of all) {
    const [own, part = ""] = name.split(".").reverse();
    if (part !== group) $("fields").append(element("h3", { textContent: part }));
    group = part;
    const words = (unit && own.endsWith(`_${unit}`) ? own.slice(0, -unit.length - 1) : own).replaceAll("_", " ");
    const input = element("input", { type: "number", step: whole ? 1 : "any", min: low, max: high, name, value });
    const label = element("label", { title: `${tooltip} From ${low} to ${high}${unit && ` ${unit}`}.` });
    label.append(element("span", { textContent: words }), input, element("small", { textContent: unit }));
    input.onfocus = () => ($("about").textContent = label.title);
    input.onchange = () => {
      $("complaint").textContent = "";
      send({ set: name, value: input.valueAsNumber });
    };
    $("fields").append(label);
  }
}

// Drawing

function redraw() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    if (!now || !scene) return;
    drawMap();
    drawScale();
    const seen = Math.max(...history.slice(-600).map((row) => Math.abs(row[ERROR] || 0)), 50);
    plot("plot-error", [[ERROR, "error"]], -seen * 1.1, seen * 1.1);
    const far = Math.max(...history.slice(-600).map((row) => row[DISTANCE] || 0), 4);
    plot("plot-distance", [[DISTANCE, "distance"], [MEASURED, "measured"]], 0, far * 1.05, [0, ...scene.zones, far * 1.05]);
    const fast = Math.max(...history.slice(-600).map((row) => Math.max(Math.abs(row[LINEAR]), Math.abs(row[ANGULAR]))), 0.3);
    plot("plot-speed", [[LINEAR, "linear"], [ANGULAR, "angular"]], -fast * 1.1, fast * 1.1);
  });
}

function sheet(id) {
  const canvas = $(id);
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.lineJoin = pen.lineCap = "round";
  pen.font = "11px system-ui, sans-serif";
  return [pen, width, height];
}

function plot(id, series, low, high, bands = []) {
  const [pen, width, height] = sheet(id);
  const [left, bottom] = [38, 16];
  const end = Math.max(now.time, WINDOW_S);
  const x = (t) => left + ((t - end + WINDOW_S) / WINDOW_S) * (width - left - 4);
  const y = (v) => 4 + ((high - v) / (high - low)) * (height - bottom - 8);
  for (let i = 0; i + 1 < bands.length; i++) {
    pen.fillStyle = colours[`zone-${i}`];
    const top = y(Math.min(bands[i + 1], high));
    pen.fillRect(left, top, width - left - 4, y(bands[i]) - top);
  }
  // The names go where there is room for them, clear of the line above and below.
  pen.fillStyle = colours.faint;
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  for (let i = 0; i + 1 < bands.length; i++) {
    const [top, foot] = [y(Math.min(bands[i + 1], high)), y(bands[i])];
    if (foot - top > 13) pen.fillText(ZONES[i], width - 10, (top + foot) / 2);
  }
  pen.lineWidth = 1;
  const step = nice((high - low) / 6);
  for (let v = Math.ceil(low / step) * step; v <= high; v += step) {
    pen.strokeStyle = Math.abs(v) < step / 2 ? colours.faint : colours.line;
    line(pen, [[left, y(v)], [width - 4, y(v)]]);
    pen.fillText(String(Number(v.toFixed(6))).replace("-", "−"), left - 5, y(v));
  }
  pen.textAlign = "center";
  pen.textBaseline = "bottom";
  for (let t = Math.ceil((end - WINDOW_S) / 15) * 15; t <= end; t += 15) {
    pen.fillText(`${t} s`, Math.min(Math.max(x(t), left + 8), width - 14), height);
  }
  pen.lineWidth = 1.75;
  for (const [column, colour] of series) {
    pen.strokeStyle = colours[colour];
    let points = [];
    for (const row of history) {
      if (row[TIME] < end - WINDOW_S) continue;
      if (row[column] === null) {
        line(pen, points);
        points = [];
      } else points.push([x(row[TIME]), y(row[column])]);
    }
    line(pen, points);
  }
}

function nice(step) {
  const power = 10 ** Math.floor(Math.log10(step));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= step);
}

function line(pen, points) {
  if (points.length < 2) return;
  pen.beginPath();
  for (const [x, y] of points) pen.lineTo(x, y);
  pen.stroke();
}

function drawMap() {
  const [pen, width, height] = sheet("map");
  const scale = Math.min(width, height) / (2 * scene.room + 0.5);
  const at = (x, y) => [width / 2 + x * scale, height / 2 - y * scale];
  const disc = (x, y, radius) => {
    pen.beginPath();
    pen.arc(...at(x, y), radius * scale, 0, 7);
  };
  pen.strokeStyle = colours.line;
  pen.lineWidth = 1;
  for (let m = -4; m <= 4; m++) {
    line(pen, [at(m, -scene.room), at(m, scene.room)]);
    line(pen, [at(-scene.room, m), at(scene.room, m)]);
  }
  pen.fillStyle = colours.faint;
  pen.textAlign = "center";
  pen.fillText("1 m", ...at(0.5 - Math.floor(scene.room), 0.12 - scene.room));
  pen.strokeStyle = colours.faint;
  pen.lineWidth = 3;
  const side = 2 * scene.room * scale;
  pen.strokeRect(...at(-scene.room, scene.room), side, side);
  pen.fillStyle = colours.faint;
  for (const piece of scene.furniture) {
    if (piece.length === 3) {
      disc(...piece);
      pen.fill();
      continue;
    }
    const [x, y, halfX, halfY, yaw] = piece;
    pen.save();
    pen.translate(...at(x, y));
    pen.rotate(-yaw);
    pen.fillRect(-halfX * scale, -halfY * scale, 2 * halfX * scale, 2 * halfY * scale);
    pen.restore();
  }
  // Zones and field of view end at the walls.
  pen.save();
  pen.beginPath();
  pen.rect(...at(-scene.room, scene.room), side, side);
  pen.clip();
  const [robotX, robotY, yaw] = now.robot;
  const away = ([x, y]) => Math.hypot(x - robotX, y - robotY);
  const middle = now.people[now.followed] || now.people.filter(Boolean).sort((a, b) => away(a) - away(b))[0];
  if (middle) {
    const [x, y] = middle;
    scene.zones.forEach((radius, i) => {
      disc(x, y, radius);
      pen.fillStyle = colours[`zone-${i}`];
      pen.fill();
    });
  }
  pen.fillStyle = colours.robot;
  pen.globalAlpha = 0.1;
  pen.beginPath();
  pen.moveTo(...at(robotX, robotY));
  pen.arc(...at(robotX, robotY), 5 * scale, -yaw - scene.field / 2, -yaw + scene.field / 2);
  pen.fill();
  pen.restore();
  pen.globalAlpha = 0.6;
  pen.lineWidth = 1.5;
  const trails = now.people.map((_, i) => [PEOPLE + 2 * i, i === now.followed ? "followed" : "other"]);
  for (const [column, colour] of [[X, "robot"], ...trails]) {
    pen.strokeStyle = colours[colour];
    line(pen, history.filter((row) => row[column] !== null).slice(-1200).map((row) => at(row[column], row[column + 1])));
  }
  pen.globalAlpha = 1;
  pen.fillStyle = colours.scan;
  for (const [x, y] of now.scan) pen.fillRect(at(x, y)[0] - 1, at(x, y)[1] - 1, 2, 2);
  pen.lineWidth = 2.5;
  now.people.forEach((person, i) => {
    if (!person) return;
    disc(...person, 0.15);
    pen.fillStyle = pen.strokeStyle = colours[i === now.followed ? "followed" : "other"];
    if (i === now.followed) pen.fill();
    else pen.stroke();
  });
  pen.save();
  pen.translate(...at(robotX, robotY));
  pen.rotate(-yaw);
  pen.fillStyle = colours.robot;
  pen.beginPath();
  pen.roundRect(-0.145 * scale, -0.11 * scale, 0.29 * scale, 0.22 * scale, 3);
  pen.fill();
  pen.fillStyle = colours.card;
  pen.fillRect(0.06 * scale, -0.07 * scale, 0.05 * scale, 0.14 * scale);
  pen.restore();
}

function drawScale() {
  const [pen, width] = sheet("scale");
  const { far, colours: shades } = scene.depth;
  const end = width - 76; // the rest is for black
  const fill = pen.createLinearGradient(0, 0, end, 0);
  shades.forEach((shade, i) => fill.addColorStop(i / (shades.length - 1), shade));
  pen.fillStyle = fill;
  pen.fillRect(0, 0, end, 12);
  pen.fillStyle = "#000";
  pen.fillRect(end + 10, 0, 66, 12);
  pen.fillStyle = colours.faint;
  pen.textBaseline = "top";
  pen.textAlign = "center";
  pen.fillText("unknown", end + 43, 17);
  const step = nice(far / 5);
  for (let m = 0; m <= far; m += step) {
    const x = (m / far) * end;
    pen.fillRect(Math.min(x, end - 1), 12, 1, 3);
    pen.textAlign = m ? (m === far ? "right" : "center") : "left";
    pen.fillText(m + step > far ? `${m} m` : m, x, 17);
  }
}

function readColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of style.length ? [...document.styleSheets[0].cssRules[0].style] : []) {
    if (name.startsWith("--")) colours[name.slice(2)] = style.getPropertyValue(name).trim();
  }
  redraw();
}

readColours();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readColours);
window.addEventListener("resize", redraw);
connect();
