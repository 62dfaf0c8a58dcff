// The page of a running episode: shows what the run sends, and sends back control messages.
"use strict";

const KEPT_PICTURES = 400; // of the camera, for the timeline
const KEPT = 6000; // control periods kept for the trails
// Columns of a row; from PEOPLE on x and y of each person, in the scenario's order.
const [TIME, ERROR, DISTANCE, LINEAR, ANGULAR, MEASURED, X, Y, YAW, PEOPLE] = [...Array(10).keys()];

let scene = null; // what stays the same: room, furniture, zones
let now = null; // the newest state
let past = null; // the row that the timeline shows; null for the newest
let pictures = []; // camera pictures for the timeline: time and JPEG
let history = []; // one row a control period
let colours = {};
let drawing = false;

function read(message) {
  if (message.scenario !== undefined) welcome(message);
  if (message.state) state(message.state, message.rows);
  if (message.ended) end(message.ended);
}

function welcome(message) {
  scene = message;
  history = [];
  pictures = [];
  past = null;
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
  $("boxes").textContent = now.boxes;
  choose();
  shares();
  if (now.detect_ms !== null) put("detect", now.detect_ms, 1, "ms");
  $("contacts").textContent = now.contacts.person + now.contacts.wall;
  if (!past && history.length) numbers(history.at(-1));
  $("timeline").max = now.time;
  if (!past) $("timeline").value = now.time;
  redraw();
}

// The numbers of one control period: the newest, or that of the timeline.
function numbers(row) {
  put("measured", row[MEASURED], 2, "m");
  $("seen").textContent = seen(row);
  put("distance", row[DISTANCE], 2, "m");
  $("zone").textContent = row[DISTANCE] === null ? "–" : zone(row[DISTANCE]);
  put("error", row[ERROR], 0, "px");
  put("linear", row[LINEAR], 2, "m/s");
  put("angular", row[ANGULAR], 2, "rad/s");
}

function seen(row) {
  if (row[MEASURED] !== null) return `${number(row[MEASURED], 2)} m by the depth image · ${zone(row[MEASURED])}`;
  return row[ERROR] === null ? "no box is followed in this image" : "the depth image does not tell how far";
}

function show(data) {
  const bytes = new Uint8Array(data);
  const kind = String.fromCharCode(bytes[0]);
  // A node's window says its name before its picture.
  const start = kind === "w" ? bytes.indexOf(10) + 1 : 1;
  const picture =
    kind === "w" ? nodeWindow(new TextDecoder().decode(bytes.subarray(1, start - 1))) : $({ c: "camera", d: "depth" }[kind]);
  const jpeg = bytes.slice(start);
  if (kind === "c") {
    pictures.push([now.time, jpeg]);
    // Of a long run every other is kept, then every fourth, and so on.
    if (pictures.length > KEPT_PICTURES) pictures = pictures.filter((_, i) => i % 2 === 0 || i > KEPT_PICTURES - 50);
  }
  if (kind !== "c" || !past) putPicture(picture, jpeg);
  picture.dataset.count = Number(picture.dataset.count || 0) + 1;
}

// Whom to follow: a button for each person in the picture, by number, or a click on them.

function choose() {
  const row = $("choices");
  const shown = now.choices.map(([number]) => number).sort((a, b) => a - b);
  $("whom").hidden = shown.length < 2 && !row.childElementCount;
  // Buttons that stay are kept: one that is replaced loses the focus, and a click on it.
  if (row.dataset.shown !== String(shown)) {
    row.dataset.shown = String(shown);
    for (const old of [...row.children]) if (!shown.includes(Number(old.value))) old.remove();
    shown.forEach((number, i) => {
      if (row.children[i]?.value === String(number)) return;
      const onclick = () => send({ follow: number });
      row.insertBefore(element("button", { value: number, textContent: number, onclick }), row.children[i] || null);
    });
  }
  const followed = now.choices.filter(([, followed]) => followed).map(([number]) => String(number));
  for (const button of row.children) button.setAttribute("aria-pressed", followed.includes(button.value));
}

$("camera").onclick = ({ offsetX, offsetY, target }) => {
  if (past || !now) return;
  const [x, y] = [(offsetX * target.naturalWidth) / target.clientWidth, (offsetY * target.naturalHeight) / target.clientHeight];
  const hit = now.choices.filter(([, , left, top, w, h]) => x >= left && x < left + w && y >= top && y < top + h);
  // Of people before each other, whose box is smaller is meant.
  hit.sort((a, b) => a[4] * a[5] - b[4] * b[5]);
  if (hit.length) send({ follow: hit[0][0] });
};

// Why this command: a bar as wide as its cost is high, a part for each critic, by name where there is room for it.

const FULL_COST = 2; // a bar over the whole width

function shares() {
  const costs = past ? [] : now.shares.filter(([, cost]) => cost > 0.01);
  const sum = costs.reduce((all, [, cost]) => all + cost, 0);
  $("shares").hidden = !now.shares.length;
  const part = ([name, cost], i) => {
    const words = name.replaceAll("_", " ");
    const piece = element("span", { textContent: words, title: `${words}: ${number(cost, 2)}`, className: `share-${i % 4}` });
    piece.style.width = `${(100 * cost) / Math.max(sum, FULL_COST)}%`;
    return piece;
  };
  $("shares").replaceChildren(...(costs.length ? costs.map(part) : [element("small", { textContent: "costs nothing" })]));
}

// The timeline

function nearest(rows, time) {
  let [low, high] = [0, rows.length - 1];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (rows[middle][TIME] < time) low = middle + 1;
    else high = middle;
  }
  return rows[low];
}

function goTo(time) {
  if (!history.length) return;
  past = time >= now.time - 0.05 ? null : nearest(history, time);
  const row = past || history.at(-1);
  $("timeline").value = row[TIME];
  $("shown").textContent = past ? `${row[TIME].toFixed(1)} s` : "now";
  $("live").hidden = !past;
  numbers(row);
  const picture = pictures.length && nearest(pictures, row[TIME]);
  if (picture) putPicture($("camera"), picture[1]);
  redraw();
}

// The picture of one cv2.imshow window; its figure is made when it first shows something.
function nodeWindow(name) {
  const known = [...document.querySelectorAll("#windows img")].find((picture) => picture.alt === name);
  if (known) return known;
  const [figure, picture] = [element("figure"), element("img", { alt: name })];
  figure.append(element("figcaption", { textContent: name }), picture);
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
  for (const control of document.querySelectorAll("header :is(button, select), form input")) control.disabled = true;
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

const pause = () => send({ do: now && now.paused ? "resume" : "pause" });
$("pause").onclick = pause;
$("step").onclick = () => send({ do: "step" });
$("speed").onchange = (event) => send({ do: "speed", value: Number(event.target.value) });
$("timeline").oninput = (event) => goTo(event.target.valueAsNumber);
$("live").onclick = () => goTo(Infinity);
$("span").onchange = (event) => zoom(Number(event.target.value) || Infinity);
document.onkeydown = (event) => {
  if (event.key === "Escape") goTo(Infinity);
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
    if (part !== group) $("fields").append(element("h3", { textContent: part.replaceAll("_", " ") }));
    group = part;
    const words = (unit && own.endsWith(`_${unit}`) ? own.slice(0, -unit.length - 1) : own).replaceAll("_", " ");
    const input = element("input", { type: "number", step: whole ? 1 : "any", min: low, max: high, name, value });
    const label = element("label", { title: `${tooltip} From ${low} to ${high}${unit && ` ${unit}`}.` });
    label.append(element("span", { textContent: words }), input, element("small", { textContent: unit }));
    input.onfocus = () => ($("about").textContent = label.title);
    input.onchange = () => send({ set: name, value: input.valueAsNumber });
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
    const most = (columns, least) => {
      let high = least;
      for (const row of rowsShown()) for (const column of columns) high = Math.max(high, Math.abs(row[column] || 0));
      return high;
    };
    const side = most([ERROR], 50) * 1.1;
    plot("plot-error", [[ERROR, "error", "px"]], -side, side);
    const far = most([DISTANCE, MEASURED], 4) * 1.05;
    plot("plot-distance", [[DISTANCE, "distance", "m"], [MEASURED, "measured", "m"]], 0, far, [0, ...scene.zones, far]);
    const fast = most([LINEAR, ANGULAR], 0.3) * 1.1;
    plot("plot-speed", [[LINEAR, "linear", "m/s"], [ANGULAR, "angular", "rad/s"]], -fast, fast);
  });
}

const personIn = (row, i) => (row[PEOPLE + 2 * i] === null ? null : row.slice(PEOPLE + 2 * i, PEOPLE + 2 * i + 2));

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
  const [robotX, robotY, yaw] = past ? past.slice(X, PEOPLE) : now.robot;
  const people = past ? now.people.map((_, i) => personIn(past, i)) : now.people;
  const trail = past ? history.slice(0, history.indexOf(past) + 1) : history;
  const away = ([x, y]) => Math.hypot(x - robotX, y - robotY);
  const middle = people[now.followed] || people.filter(Boolean).sort((a, b) => away(a) - away(b))[0];
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
    line(pen, trail.filter((row) => row[column] !== null).slice(-1200).map((row) => at(row[column], row[column + 1])));
  }
  // Where the commands lead that were compared: faint, and the one sent in bold.
  pen.strokeStyle = colours.robot;
  const [sent, ...compared] = past ? [] : now.rollouts.map((way) => [[robotX, robotY], ...way].map(([x, y]) => at(x, y)));
  pen.globalAlpha = 0.18;
  pen.lineWidth = 1;
  for (const way of compared) line(pen, way);
  pen.globalAlpha = 1;
  pen.lineWidth = 3;
  if (sent) line(pen, sent);
  pen.fillStyle = colours.scan;
  for (const [x, y] of past ? [] : now.scan) pen.fillRect(at(x, y)[0] - 1, at(x, y)[1] - 1, 2, 2);
  pen.lineWidth = 2.5;
  people.forEach((person, i) => {
    if (!person) return;
    disc(...person, 0.15);
    pen.fillStyle = pen.strokeStyle = colours[i === now.followed ? "followed" : "other"];
    if (i === now.followed) pen.fill();
    else pen.stroke();
  });
  // Where the follower takes people to be: a ring, how sure it is, and how likely this is the person followed.
  pen.lineWidth = 1.5;
  pen.setLineDash([4, 3]);
  for (const [x, y, probability, same, id] of past ? [] : now.believed) {
    disc(x, y, 0.3);
    pen.strokeStyle = pen.fillStyle = colours.believed;
    pen.stroke();
    // On the side where the room is wider: the map's edge cuts nothing off.
    pen.textAlign = x > 0 ? "right" : "left";
    const [edge, line] = at(x + (x > 0 ? -0.36 : 0.36), y);
    pen.fillText(`person ${id}: ${percent(probability)}`, edge, line - 2);
    if (same !== null) pen.fillText(`followed ${percent(same)}`, edge, line + 12);
  }
  pen.setLineDash([]);
  pen.save();
  pen.translate(...at(robotX, robotY));
  pen.rotate(-yaw);
  pen.fillStyle = colours.robot;
  pen.beginPath();
  const [long, wide] = scene.body.map((half) => half * scale);
  pen.roundRect(-long, -wide, 2 * long, 2 * wide, 3);
  pen.fill();
  pen.fillStyle = colours.card;
  pen.fillRect(0.4 * long, -0.64 * wide, 0.35 * long, 1.28 * wide);
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
